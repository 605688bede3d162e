"""Constraint rows of contacts, for scripts that solve for themselves."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import csr_matrix, vstack

from skfem_contact.arguments import check_kind, known_keywords, members, numbers
from skfem_contact.bodies.system import System
from skfem_contact.conditions.contact import Contact
from skfem_contact.conditions.discretisation import pair
from skfem_contact.conditions.kinematics import join, kinematics
from skfem_contact.errors import InputError

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class ConstraintRows:
    """Rows ``C u = b`` with the names of their points; what `condense` takes.

    Attributes
    ----------
    C : csr_matrix, shape (k, n)
    b : ndarray, shape (k,)
    prefer : ndarray of bool, shape (n,)
        DOFs of the secondary surfaces: the first choice as pivots.
    labels : tuple of str
    scale : float
        Size of the bodies: gaps below its round-off are zero [length].

    Examples
    --------
    >>> import skfem as fem
    >>> import skfem_contact as sc
    >>> from skfem.models.elasticity import linear_elasticity
    >>> def square(y, **settings):
    ...     mesh = fem.MeshQuad().refined(1).translated((0, y)).with_defaults()
    ...     basis = fem.Basis(mesh, fem.ElementVector(fem.ElementQuad1()), intorder=2)
    ...     return sc.Body(basis, linear_elasticity(), **settings)
    >>> low = square(0, D="bottom", name="low")
    >>> high = square(1, D="top", x={"top": (0, 0.01)}, name="high")
    >>> glued = sc.Contact(high.surface("bottom"), low.surface("top"), tied=True)
    >>> rows = sc.contact_rows(sc.stack([low, high]), glued)
    >>> rows.C.shape  # gap and slip of three points, and all 36 DOFs
    (6, 36)
    """

    C: csr_matrix
    b: Array
    prefer: NDArray[np.bool_]
    labels: tuple[str, ...]
    scale: float = 0.0


@known_keywords()
def contact_rows(
    system: System, contacts: Sequence[Contact] | Contact, closed: ArrayLike | None = None
) -> ConstraintRows:
    """The rows that hold the closed points together, for use without a contact solver.

    Parameters
    ----------
    system : System
        From `stack`.
    contacts : sequence of Contact
        A tied contact gives a row per component, any other its normal rows.
    closed : ndarray of bool, shape (m,), optional
        Points to hold, over all contacts; by default all that have a partner.

    Returns
    -------
    ConstraintRows
        For `condense`: ``skfem.solve(*condense(system.K, system.f, rows=rows, D=system.D))``.

    Examples
    --------
    Two unit squares, one upon the other and glued, pulled at the top:

    >>> import numpy as np
    >>> import skfem as fem
    >>> import skfem_contact as sc
    >>> from skfem.models.elasticity import linear_elasticity
    >>> e = fem.ElementVector(fem.ElementQuad1())
    >>> low = fem.MeshQuad().refined(1).with_defaults()
    >>> top = fem.MeshQuad().refined(2).translated((0, 1)).with_defaults()
    >>> a = sc.Body(fem.Basis(low, e), linear_elasticity(0, 0.5), D="bottom")
    >>> basis = fem.Basis(top, e)
    >>> up = basis.project(lambda x: np.stack([0 * x[0], 0.1 + 0 * x[0]]))
    >>> b = sc.Body(basis, linear_elasticity(0, 0.5), D="top", x=up)
    >>> system = sc.stack([a, b])
    >>> tie = sc.Contact(b.surface("bottom"), a.surface("top"), tied=True)
    >>> rows = sc.contact_rows(system, tie)
    >>> u = fem.solve(*sc.condense(system.K, system.f, rows=rows, D=system.D, x=system.x))
    >>> bool(abs(u[a.surface("top").dofs[:, 1]] - 0.05).max() < 1e-12)
    True
    """
    check_kind(system, System, "system", "make it by stack(bodies)")
    contacts = members(contacts, Contact, "contacts", "make each by Contact(surface, other, ...)")
    parts = [kinematics(system, contact, pair(contact)) for contact in contacts]
    kin = join(parts)
    held = kin.paired
    if closed is not None:
        usage = f"give one bool for each of the {kin.m} points"
        mask = closed
        if not (isinstance(mask, np.ndarray) and mask.dtype == bool):
            mask = numbers(mask, "closed", usage)
        if mask.shape != (kin.m,):
            raise InputError(f"closed has shape {mask.shape}; {usage}.")
        held = held & (mask != 0)
    glued = held & kin.tied
    tangential = np.repeat(glued, kin.tangents)
    rows = [kin.B_n[held], *([kin.B_t[tangential]] if glued.any() else [])]
    names = np.concatenate([point_labels(c, p.m) for c, p in zip(contacts, parts, strict=True)])
    return ConstraintRows(
        C=csr_matrix(vstack(rows)),
        b=np.concatenate([-kin.gap0[held], np.zeros(tangential.sum())]),
        prefer=secondary_dofs(system, contacts),
        labels=(*names[held], *np.repeat(names, kin.tangents)[tangential]),
        scale=system.extent,
    )


def point_labels(contact: Contact, m: int) -> NDArray[np.object_]:
    """The points of a contact in words."""
    label = contact.label
    return np.array([f"point {i} of {label}" for i in range(m)], dtype=object)


def secondary_dofs(system: System, contacts: Sequence[Contact]) -> NDArray[np.bool_]:
    """Mask of the DOFs on the secondary surfaces, shape (n,)."""
    mask = np.zeros(system.n, dtype=bool)
    for contact in contacts:
        surface = contact.secondary
        mask[system.offsets[system.index(surface.body)] + surface.dofs] = True
    return mask
