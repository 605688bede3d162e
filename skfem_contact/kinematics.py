r"""`Kinematics`: gap and slip as linear functions of the displacements.

Every discretisation (node-to-segment, mortar, rigid obstacle) arrives here as a `Pairing`; from
here on there are only the two sparse operators of

    gap   g = gap0 + B_n u      > 0 open, = 0 closed
    slip  s =        B_t u      secondary minus primary

with the frame of each point: ``normal`` (outward of the primary) and ``d - 1`` tangents.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import csr_matrix, diags, vstack

from skfem_contact.arguments import check_kind, members, numbers
from skfem_contact.body import System
from skfem_contact.contact import Contact, field_values
from skfem_contact.errors import InputError
from skfem_contact.mortar import dual_mortar
from skfem_contact.obstacle import Obstacle
from skfem_contact.pairing import Pairing, node_to_segment
from skfem_contact.surface import ContactSurface

Array = NDArray[np.float64]

# A row (of unit vectors and weights) whose free coefficients are below this is prescribed: nearly
# matching mortar meshes leave some 1e-8 on a line of symmetry, and 1/1e-8 squared in the stiffness.
FIXED = 1e-6


@dataclass(frozen=True, eq=False)
class Kinematics:
    """Gap and slip operators of m contact points over n DOFs.

    Attributes
    ----------
    B_n : csr_matrix, shape (m, n)
        Normal rows; empty where a point is not paired.
    B_t : csr_matrix, shape (m (d-1), n)
        Tangential rows, point by point.
    gap0 : ndarray, shape (m,)
        Initial gap [length]; ``inf`` where a point is not paired.
    area : ndarray, shape (m,)
        Tributary area [area].
    points, normal : ndarray, shape (m, d)
    tangent : ndarray, shape (m, d-1, d)
    paired, tied : ndarray of bool, shape (m,)
    heir : ndarray of int, shape (m,)
        The point whose pressure and traction hold at each point: itself in general; see `carriers`.
    action : ndarray, shape (m, d)
        Where the force of each point acts on the secondary: its position in general.
    """

    B_n: csr_matrix
    B_t: csr_matrix
    gap0: Array
    area: Array
    points: Array
    normal: Array
    tangent: Array
    paired: NDArray[np.bool_]
    tied: NDArray[np.bool_]
    heir: NDArray[np.intp]
    action: Array

    @property
    def m(self) -> int:
        """Number of contact points."""
        return len(self.gap0)

    @property
    def tangents(self) -> int:
        """Tangents per point, d - 1 (0 for scalar problems)."""
        return self.B_t.shape[0] // max(self.m, 1)


def pair(contact: Contact, *, moved: Sequence[Array] = (), motion: object = None) -> Pairing:
    """Find the partner of every point of the secondary surface.

    Parameters
    ----------
    contact : Contact
    moved : pair of ndarray, optional
        Displacements of the secondary and the primary body, for the deformed geometry [length].
    motion : optional
        Motion of a rigid obstacle: translation (d,), or (translation, angle, centre).
    """
    secondary, primary = contact.secondary, contact.primary
    if len(moved):
        secondary = secondary.moved(moved[0])
    if isinstance(primary, Obstacle):
        pairing = primary.pair(secondary, motion=motion)
        return _without_idle(contact, pairing)
    if len(moved):
        primary = primary.moved(moved[1])
    if contact.method == "mortar":
        return dual_mortar(secondary, primary, reach=contact.reach)
    return _without_idle(contact, node_to_segment(secondary, primary, reach=contact.reach))


def _without_idle(contact: Contact, pairing: Pairing) -> Pairing:
    """The pairing less points whose force has nothing to do with the pressure.

    The end of a quadratic facet on the axis of symmetry has no area: its force vanishes with any
    constant pressure, and the sign of what is left is not that of the pressure. Glued, it may stay.
    """
    idle = idle_points(contact.secondary)
    if contact.tied or not (idle & pairing.paired).any():
        return pairing
    return replace(
        pairing,
        paired=pairing.paired & ~idle,
        gap=np.where(idle, np.inf, pairing.gap),
    )


def idle_points(surface: ContactSurface) -> NDArray[np.bool_]:
    """Points whose shape function has integral zero, shape (m,)."""
    middle = np.zeros(len(surface.points))
    np.maximum.at(middle, surface.facets, surface.area[surface.facets].max(axis=1)[:, None])
    return np.asarray(surface.area <= 1e-10 * middle)


def carriers(surface: ContactSurface, pairing: Pairing) -> NDArray[np.intp]:
    """The point whose pressure holds at each point, shape (m,).

    It is the point itself, except that a node merged by `dual_mortar` takes that of its heir, and
    one without area that of the middle of its facet.
    """
    heir: NDArray[np.intp] = np.arange(len(pairing.gap))
    at = surface.facets
    if at.shape[1] == 3:
        middle = heir.copy()
        middle[at[:, :2]] = at[:, 2:]
        lonely = idle_points(surface) & ~pairing.paired
        heir = np.where(lonely, middle, heir)
    weights = csr_matrix(pairing.secondary_weights).tocoo()
    lent = ~pairing.paired[weights.col] & (weights.row != weights.col)
    heir[weights.col[lent]] = weights.row[lent]
    return heir


def initial_gap(contact: Contact, pairing: Pairing, interference: object = None) -> Array:
    """``gap0`` of every point: geometry or as given, adjusted, less the interference."""
    gap = np.array(pairing.gap)
    if contact.gap is not None:
        given = field_values(contact.gap, pairing.points, f"gap of contact {contact.label}")
        gap = np.where(pairing.paired, given, np.inf)
    if contact.tied and contact.gap is None:
        gap = np.where(pairing.paired, 0.0, np.inf)  # glued as meshed
    gap = np.where(np.abs(gap) <= contact.adjust, 0.0, gap)
    delta = contact.interference if interference is None else interference
    return gap - field_values(delta, pairing.points, f"interference of contact {contact.label}")  # type: ignore[arg-type]


def kinematics(
    system: System, contact: Contact, pairing: Pairing, interference: object = None
) -> Kinematics:
    """Gap and slip operators of one contact over the DOFs of all bodies.

    Parameters
    ----------
    system : System
    contact : Contact
    pairing : Pairing
    interference : optional
        In place of the contact's own.
    """
    secondary = contact.secondary
    scalar = secondary.dofs.shape[1] == 1
    frame = np.concatenate([pairing.normal[:, None, :], pairing.tangent], axis=1)
    if scalar:  # a field with one component: the row of the value itself, no direction
        frame = np.ones((len(pairing.gap), 1, 1))
    weights = [(pairing.secondary_weights, secondary, 1.0)]
    if isinstance(contact.primary, ContactSurface):
        weights.append((pairing.primary_weights, contact.primary, -1.0))
    rows = [_spread(system, weights, frame[:, k], pairing.paired) for k in range(frame.shape[1])]
    m, n = len(pairing.gap), system.n
    B_t = _interleave(rows[1:]) if len(rows) > 1 else csr_matrix((0, n))
    return Kinematics(
        B_n=csr_matrix(rows[0]),
        B_t=B_t,
        gap0=initial_gap(contact, pairing, interference),
        area=np.array(pairing.area),
        points=pairing.points,
        normal=pairing.normal,
        tangent=pairing.tangent,
        paired=np.array(pairing.paired),
        tied=np.full(m, contact.tied),
        heir=carriers(secondary, pairing),
        action=_action(pairing),
    )


def _action(pairing: Pairing) -> Array:
    """Where forces act: the weighted position of merged nodes, the point itself else."""
    mean = pairing.secondary_weights @ pairing.points
    return np.where(pairing.paired[:, None], mean, pairing.points)


def join(parts: Sequence[Kinematics]) -> Kinematics:
    """All contacts in one numbering of points, in the order given."""
    if not parts:
        raise InputError("There is no contact: give at least one Contact.")
    stacked = {
        name: np.concatenate([getattr(part, name) for part in parts])
        for name in ("gap0", "area", "points", "normal", "tangent", "paired", "tied", "action")
    }
    first = np.cumsum([0, *(part.m for part in parts)])
    heir = np.concatenate([k + part.heir for k, part in zip(first[:-1], parts, strict=True)])
    return Kinematics(
        B_n=csr_matrix(vstack([part.B_n for part in parts])),
        B_t=csr_matrix(vstack([part.B_t for part in parts])),
        heir=heir,
        **stacked,
    )


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
    """

    C: csr_matrix
    b: Array
    prefer: NDArray[np.bool_]
    labels: tuple[str, ...]
    scale: float = 0.0


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
        For `condense`: ``skfem.solve(*condense(system.K, system.f, rows, D=system.D))``.

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
    >>> u = fem.solve(*sc.condense(system.K, system.f, rows, D=system.D, x=system.x))
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
        mask = numbers(closed, "closed", usage)
        if mask.shape != (kin.m,):
            raise InputError(f"closed has shape {mask.shape}; {usage}.")
        held = held & (mask != 0)
    tangential = np.repeat(held & kin.tied, kin.tangents)
    names = np.concatenate([point_labels(c, p.m) for c, p in zip(contacts, parts, strict=True)])
    return ConstraintRows(
        C=csr_matrix(vstack([kin.B_n[held], kin.B_t[tangential]])),
        b=np.concatenate([-kin.gap0[held], np.zeros(tangential.sum())]),
        prefer=secondary_dofs(system, contacts),
        labels=(*names[held], *np.repeat(names, kin.tangents)[tangential]),
        scale=system.extent,
    )


def point_labels(contact: Contact, m: int) -> NDArray[np.object_]:
    """The points of a contact in words."""
    return np.array([f"point {i} of {contact.label}" for i in range(m)], dtype=object)


def secondary_dofs(system: System, contacts: Sequence[Contact]) -> NDArray[np.bool_]:
    """Mask of the DOFs on the secondary surfaces, shape (n,)."""
    mask = np.zeros(system.n, dtype=bool)
    for contact in contacts:
        surface = contact.secondary
        mask[system.offsets[system.index(surface.body)] + surface.dofs] = True
    return mask


def without_columns(kin: Kinematics, columns: NDArray[np.intp]) -> Kinematics:
    """The same rows restricted to some DOFs."""
    place = np.full(kin.B_n.shape[1], -1)
    place[columns] = np.arange(len(columns))
    return replace(
        kin,
        B_n=_with_columns(kin.B_n, place, len(columns)),
        B_t=_with_columns(kin.B_t, place, len(columns)),
    )


def _with_columns(B: csr_matrix, place: NDArray[np.intp], count: int) -> csr_matrix:
    """Columns moved to their new place, and left out where that is negative.

    By hand, because slicing in SciPy goes over all columns of all bodies, for every new pairing.
    """
    column = place[B.indices]
    keep = column >= 0
    start = np.concatenate([[0], np.cumsum(keep)])[B.indptr]
    return csr_matrix((B.data[keep], column[keep], start), shape=(B.shape[0], count))


def _spread(
    system: System,
    sides: Sequence[tuple[csr_matrix, ContactSurface, float]],
    direction: Array,
    paired: NDArray[np.bool_],
) -> csr_matrix:
    """Sum over the sides of ``sign direction . (W u_surface)``, zero where a point is not paired."""
    entries = []
    for weights, surface, sign in sides:
        W = csr_matrix(weights).tocoo()
        keep = paired[W.row]
        row, node, value = W.row[keep], W.col[keep], sign * W.data[keep]
        columns = system.offsets[system.index(surface.body)] + surface.dofs[node]
        rows = np.repeat(row, surface.dofs.shape[1])
        entries.append(((value[:, None] * direction[row]).ravel(), rows, columns.ravel()))
    data, rows, columns = (np.concatenate(part) for part in zip(*entries, strict=True))
    spread = csr_matrix((data, (rows, columns)), shape=(len(paired), system.n))
    spread.sum_duplicates()
    spread.eliminate_zeros()
    return spread


def _interleave(blocks: Sequence[csr_matrix]) -> csr_matrix:
    """Rows of several tangents in the order point by point."""
    if len(blocks) == 1:
        return csr_matrix(blocks[0])
    m, k = blocks[0].shape[0], len(blocks)
    order = np.arange(m * k).reshape(k, m).T.ravel()
    return csr_matrix(vstack(blocks).tocsr()[order])


def compliance_scale(B: csr_matrix, diagonal: Array) -> Array:
    """Stiffness of each row as seen by K's diagonal, ``1 / sum(B_ij^2 / K_jj)`` [force/length].

    The softer side decides, so that one multiple of it suits any pair of bodies.
    """
    inverse = np.where(diagonal > 0, 1.0 / np.where(diagonal > 0, diagonal, 1.0), 0.0)
    total = np.asarray((B.multiply(B) @ diags(inverse)).sum(axis=1)).ravel()
    return np.divide(1.0, total, out=np.zeros_like(total), where=total > 0)
