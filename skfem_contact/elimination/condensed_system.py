"""Constraints for `skfem.solve`: a system condensed by rows, as scikit-fem takes it.

The rows of contacts, for scripts that solve for themselves, are made by `contact_rows`.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import csr_matrix, vstack

from skfem_contact.arguments import check_kind, known_keywords, members, numbers, shown
from skfem_contact.arrays import Array, Mask
from skfem_contact.bodies.system import System
from skfem_contact.conditions.contact import Contact
from skfem_contact.conditions.discretisation import pair
from skfem_contact.conditions.interface import point_labels, secondary_dofs
from skfem_contact.conditions.kinematics import join, kinematics
from skfem_contact.digits import SOLVED
from skfem_contact.elimination.constraint import eliminate, prescribed, sparse_matrix
from skfem_contact.errors import InputError
from skfem_contact.records import dataclass

# Attributes of rows that `condense` passes to `eliminate`.
OPTIONS = ("prefer", "labels", "scale")


@known_keywords(K="write A", f="write b")
def condense(
    A: Any,
    b: Any = None,
    x: ArrayLike | None = None,
    I: Any = None,
    D: Any = None,
    expand: bool = True,
    *,
    rows: Any = None,
) -> tuple[Any, ...]:
    r"""Condense a system by constraint rows into what ``skfem.solve`` takes.

    `skfem.condense` with one argument more, `rows`.

    Parameters
    ----------
    A : sparse matrix, shape (n, n)
        Stiffness [force/length].
    b : ndarray, shape (n,), or sparse matrix, shape (n, n), optional
        Load [force], default zero; or the mass matrix of an eigenproblem.
    x : ndarray, shape (n,), optional
        Values of the prescribed DOFs, default zero.
    I : ndarray of int, DofsView or dict of DofsView, optional
        The DOFs that are not prescribed, in place of `D`.
    D : ndarray of int, DofsView or dict of DofsView, optional
        Prescribed DOFs.
    expand : bool
        Whether to return what the solution is expanded by, too.
    rows : object with attributes `C` and `b`, or tuple (C, b), optional
        Constraint rows; its attributes `labels`, `prefer` and `scale` are passed to `eliminate`
        where it has them.

    Returns
    -------
    tuple
        ``(T'AT, T'(b - Ac), zeros(n), (arange(n), lambda z: T @ z + c))``, for a mass matrix M
        ``(T'AT, T'MT, zeros(n), (arange(n), lambda z: T @ z))``; without `expand` the first two.

    Notes
    -----
    ``solver_iter_pcg()`` at its default tolerance leaves an error of 1e-6 or so; pass `rtol`.

    Examples
    --------
    >>> from skfem import solve
    >>> K = sp.csr_matrix([[2.0, -1.0, 0.0], [-1.0, 2.0, -1.0], [0.0, -1.0, 1.0]])
    >>> solve(*condense(K, np.array([0.0, 0.0, 1.0]), rows=([[-0.5, 1.0, -0.5]], [0.0])))
    array([1., 2., 3.])
    """
    A = sparse_matrix("A", A)
    n = A.shape[0]
    if not np.isfinite(A.data).all():
        raise InputError("A has NaN or inf entries. Check the form it is assembled from.")
    if hasattr(x, "C") and hasattr(x, "b"):
        raise InputError("x is rows of constraints; x are prescribed values: write rows=...")
    if I is not None:
        if D is not None:
            raise InputError("I and D are both given; give the DOFs to keep, or those prescribed")
        D = np.setdiff1d(np.arange(n), prescribed(I, n, "I"))
    C, c, options = _rows(rows, n)
    constraint = eliminate(C, c, D, x, **options)
    is_mass: bool = sp.issparse(b)
    if is_mass:
        M = sp.csr_matrix(b)
        if not np.isfinite(M.data).all():
            raise InputError("The mass matrix has NaN or inf entries.")
        A_r, b_r = constraint.reduce(A)[0], constraint.reduce(M)[0]
    else:
        A_r, b_r = constraint.reduce(A, b)
    zeros = np.zeros(n, dtype=np.result_type(A_r, b_r, float))
    expansion = _Modes(constraint.T, zeros.dtype) if is_mass else constraint.expand
    return (A_r, b_r, zeros, (np.arange(n), expansion)) if expand else (A_r, b_r)


def _rows(rows: Any, n: int) -> tuple[Any, Any, dict[str, Any]]:
    """The matrix, the right-hand side and what else is known of the constraint rows."""
    rows = (sp.csr_matrix((0, n)), np.zeros(0)) if rows is None else rows
    if not (isinstance(rows, tuple) and len(rows) == 2) and not (
        hasattr(rows, "C") and hasattr(rows, "b")
    ):
        raise InputError(f"rows is {shown(rows)}; give contact_rows(...), or a pair (C, b)")
    C, b = rows if isinstance(rows, tuple) else (rows.C, rows.b)
    return C, b, {name: getattr(rows, name) for name in OPTIONS if hasattr(rows, name)}


@dataclass(frozen=True, eq=False)
class _Modes:
    """``T @ z``, real for a real problem: ARPACK's `eigs` gives real modes as complex numbers."""

    T: sp.csr_matrix
    dtype: Any

    def __call__(self, z: NDArray[Any]) -> NDArray[Any]:
        mode: NDArray[Any] = self.T @ z
        if np.iscomplexobj(mode) and not np.issubdtype(self.dtype, np.complexfloating):
            if np.abs(mode.imag).max() > SOLVED * np.abs(mode).max():
                raise InputError(
                    "An eigenmode of a real system came out complex. If K and M are symmetric (a"
                    " multiple eigenvalue, split by round-off), pass"
                    " solver=solver_eigen_scipy_sym(); otherwise pass K as a complex matrix."
                )
            return mode.real
        return mode


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
    >>> rows = sc.elimination.contact_rows(sc.bodies.stack([low, high]), glued)
    >>> rows.C.shape  # gap and slip of three points, and all 36 DOFs
    (6, 36)
    """

    C: csr_matrix
    b: Array
    prefer: Mask
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
    >>> system = sc.bodies.stack([a, b])
    >>> tie = sc.Contact(b.surface("bottom"), a.surface("top"), tied=True)
    >>> rows = sc.elimination.contact_rows(system, tie)
    >>> u = fem.solve(*sc.elimination.condense(system.K, system.f, rows=rows, D=system.D, x=system.x))
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
