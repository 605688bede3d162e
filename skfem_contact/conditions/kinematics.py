r"""`Kinematics`: gap and slip as linear functions of the displacements.

Every discretisation (node-to-segment, mortar, rigid obstacle) arrives here as a `Pairing`; from
here on there are only the two sparse operators of

    gap   g = gap0 + B_n u      > 0 open, = 0 closed
    slip  s =        B_t u      secondary minus primary

with the frame of each point: ``normal`` (outward of the primary) and ``d - 1`` tangents.

Gaps and slips that supports prescribe are rows like others: contact has no say in them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cached_property, partial

import numpy as np
from scipy.sparse import block_diag, csr_matrix, identity

from skfem_contact.arrays import Array, Index, Mask
from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.bodies.system import System
from skfem_contact.conditions.contact import Contact, field_values
from skfem_contact.conditions.discretisation import carriers
from skfem_contact.conditions.orthotropic import OrthotropicCoulomb, combinations, duals, material_frame
from skfem_contact.conditions.rows import (
    Lever,
    Sides,
    stacked_rows,
    tangential_rows,
    with_free_part,
)
from skfem_contact.digits import GIVEN
from skfem_contact.errors import InputError
from skfem_contact.pairing.dual import can_move
from skfem_contact.pairing.node import Pairing, gap_vectors, gap_weights
from skfem_contact.records import dataclass

ALL = slice(None)


@dataclass(frozen=True, eq=False)
class Kinematics:
    """Gap and slip operators of m contact points over n DOFs.

    Attributes
    ----------
    B_n : csr_matrix, shape (m, n)
        Normal rows; empty where a point is not paired.
    tangential : callable
        Makes `B_t`.
    tangents : int
        Tangents per point, d - 1 (0 for scalar problems).
    gap0 : ndarray, shape (m,)
        Initial gap [length]; ``inf`` where a point is not paired.
    area : ndarray, shape (m,)
        Tributary area [area].
    points, normal : ndarray, shape (m, d)
    tangent : ndarray, shape (m, d-1, d)
        Unit tangents; along and across the direction of friction, where it has one.
    paired, tied, bilateral : ndarray of bool, shape (m,)
        With a partner; glued; those that never open, glued ones too.
    heir : ndarray of int, shape (m,)
        The point whose pressure and traction hold at each point: itself in general; see
        `discretisation.carriers`.
    action : ndarray, shape (m, d)
        Where the force of each point acts on the secondary: its position in general.
    offset : ndarray, shape (m, d)
        From the primary to the secondary side of each point on the undeformed bodies [length]; its
        position where the primary is an obstacle without DOFs.
    tilt : ndarray, shape (m,)
        Angle between the two sides' normals [rad], see `Pairing.tilt`.
    corners : tuple of frozenset
        For each contact the vertices that carry by themselves, `Pairing.corners`.
    vertex : ndarray of int, shape (m,)
        The primary node whose row a point carries in place of its own; -1 where none.
    gap_weights : csr_matrix, shape (m, m), or None
        Gaps given at the points in those of the rows (`pairing.node`); None where they are the same.
    scaled : ndarray, shape (m, d-1, d), or None
        `axes`; None where they are the tangents.

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
    >>> contact = sc.Contact(high.surface("bottom"), low.surface("top"))
    >>> from skfem_contact.conditions.kinematics import kinematics
    >>> from skfem_contact.pairing.node import node_to_segment
    >>> kin = kinematics(
    ...     sc.bodies.stack([low, high]), contact, node_to_segment(contact.secondary, contact.primary)
    ... )
    >>> kin.gap0.tolist(), kin.B_n.shape
    ([0.0, 0.0, 0.0], (3, 36))
    """

    B_n: csr_matrix
    tangential: Callable[[], csr_matrix]
    tangents: int
    gap0: Array
    area: Array
    points: Array
    normal: Array
    tangent: Array
    paired: Mask
    tied: Mask
    bilateral: Mask
    heir: Index
    action: Array
    offset: Array
    tilt: Array
    vertex: Index
    corners: tuple[frozenset[tuple[int, int]], ...] = ()
    gap_weights: csr_matrix | None = None
    scaled: Array | None = None

    def of_rows(self, given: Array) -> Array:
        """Gaps (m,) that are given at the points, as those of the rows."""
        return given if self.gap_weights is None else np.asarray(self.gap_weights @ given)

    @cached_property
    def never_opens(self) -> Mask:
        """Points that have a partner for good, (m,)."""
        return self.bilateral & self.paired

    @cached_property
    def inherits(self) -> bool:
        """Return whether any point has the pressure of another one, its heir."""
        return bool(np.any(self.heir != np.arange(len(self.heir))))

    @cached_property
    def per_area(self) -> Array:
        """Return one over the tributary areas, zero where there is none, (m,)."""
        return np.divide(1.0, self.area, out=np.zeros(len(self.area)), where=self.area > 0)

    @property
    def m(self) -> int:
        """Number of contact points."""
        return len(self.gap0)

    @cached_property
    def B_t(self) -> csr_matrix:
        """Tangential rows, point by point, shape (m (d-1), n); made when first asked for.

        Without friction nobody asks, unless for the slip of a result.
        """
        return self.tangential()

    @cached_property
    def axes(self) -> Array:
        """The axes that components of slips and of friction are taken along, (m, d-1, d).

        The tangents, scaled where friction has a material direction, see `rows`; none of a field
        with one component.
        """
        if self.scaled is not None:
            return self.scaled
        return self.tangent if self.tangents else self.tangent[:, :0]

    @cached_property
    def duals(self) -> Array:
        """The vectors that slips are combined of by their components, (m, d-1, d)."""
        return self.axes if self.scaled is None else duals(self.axes, self.normal)

    def slip_along(self, components: Array, part: slice = ALL) -> Array:
        """Slips of some points along their unit tangents, from those along their axes, (k, d-1)."""
        return self._along_tangents(components, self.duals, part)

    def friction_along(self, components: Array, part: slice = ALL) -> Array:
        """Friction of some points along their unit tangents, from that along their duals, (k, d-1)."""
        return self._along_tangents(components, self.axes, part)

    def _along_tangents(self, components: Array, basis: Array, part: slice) -> Array:
        if self.scaled is None:
            return components
        return np.einsum("ik,ikd,ild->il", components, basis[part], self.tangent[part])


def initial_gap(contact: Contact, pairing: Pairing, interference: object = None) -> Array:
    """``gap0`` of every point: geometry or as given, adjusted, less the interference."""
    gap, weights = np.array(pairing.gap), gap_weights(pairing)
    if contact.gap is not None:
        given = field_values(contact.gap, pairing.points, f"gap of contact {contact.label}")
        given = given if weights is None else weights @ given
        gap = np.where(pairing.paired, given, np.inf)
    if contact.bilateral and contact.gap is None:
        gap = np.where(pairing.paired, 0.0, np.inf)  # held together as meshed
    gap = np.where(np.abs(gap) <= contact.adjust, 0.0, gap)
    delta = contact.interference if interference is None else interference
    what = f"interference of contact {contact.label}"
    overlap = field_values(delta, pairing.points, what)  # type: ignore[arg-type]
    return gap - (overlap if weights is None else weights @ overlap)


def kinematics(
    system: System,
    contact: Contact,
    pairing: Pairing,
    gap0: Array | None = None,
    moved: Array | None = None,
) -> Kinematics:
    """Gap and slip operators of one contact over the DOFs of all bodies.

    Parameters
    ----------
    system : System
    contact : Contact
    pairing : Pairing
    gap0 : ndarray, shape (m,), optional
        Initial gaps, where they are known; else those of the pairing and the contact [length].
    moved : ndarray, shape (d,), optional
        Translation of a rigid body where the pairing was made; of the undeformed bodies none [length].
    """
    secondary = contact.secondary
    scalar = secondary.dofs.shape[1] == 1
    frame = np.concatenate([pairing.normal[:, None, :], pairing.tangent], axis=1)
    if scalar:  # a field with one component: the row of the value itself, no direction
        frame = np.ones((len(pairing.gap), 1, 1))
    sides = Sides.of(system, contact, pairing, moved)
    still = np.zeros(frame[:, 1:, 0].shape, dtype=bool)
    if pairing.still is not None:
        still |= pairing.still
    slips = [sides.of_slip(along) for along in still.T]
    tangent, axes, A = pairing.tangent, None, None
    law = contact.friction
    if isinstance(law, OrthotropicCoulomb):
        tangent = material_frame(law, pairing, contact.label)
        first = still[:, 0] | slips[0].prescribed(frame[:, 1])
        A = combinations(tangent, law.ratios, pairing.tangent, first)
        axes = A @ pairing.tangent
    B_n = sides.rows(frame[:, 0], sides.held(frame[:, 0], contact.bilateral))
    leaning, along = None, frame[:, 1:]
    if frame.shape[1:] == (2, 2) and still.any():
        leaning, left = _leaning(secondary, frame, still[:, 0], contact.tied)
        # what is free comes with the normal row, of both sides
        along = np.where((leaning != 0)[:, None, None] & ~secondary.held[:, None], 0.0, along)
    tangential = partial(tangential_rows, slips, system.n, along, still, A)
    if leaning is not None and leaning.any():
        tangential = partial(with_free_part, tangential, B_n, leaning, left)
    return Kinematics(
        B_n=B_n,
        tangential=tangential,
        tangents=frame.shape[1] - 1,
        gap0=initial_gap(contact, pairing) if gap0 is None else gap0,
        area=np.array(pairing.area),
        points=pairing.points,
        normal=pairing.normal,
        tangent=tangent,
        paired=np.array(pairing.paired),
        tied=np.full(len(pairing.gap), contact.tied),
        bilateral=np.full(len(pairing.gap), contact.bilateral),
        heir=carriers(secondary, pairing),
        action=pairing.action,
        offset=_offset(contact, pairing, sides.lever),
        tilt=pairing.tilt,
        vertex=np.full(len(pairing.gap), -1) if pairing.vertex is None else pairing.vertex,
        corners=(pairing.corners,),
        gap_weights=gap_weights(pairing),
        scaled=axes,
    )


def _leaning(secondary: ContactSurface, frame: Array, still: Mask, tied: bool) -> tuple[Array, Array]:
    """Of nodes that supports guide: tangential over normal component along what is free, (m,).

    And what is left of the tangential component along what is held, once so much of the normal row is
    taken, as a share, (m,). Zero and one at nodes that are not `still`, and where the normal is free.
    """
    free = still[:, None] & ~secondary.held
    across, along = (np.sum(np.where(free, axis, 0.0), axis=1) for axis in (frame[:, 0], frame[:, 1]))
    # as far as supports leave a row of any contact
    leans = (np.abs(along) > 0) & (tied | can_move(secondary.held, frame[:, 1]))
    ratio = np.divide(along, across, out=np.zeros(len(still)), where=leans)
    held = (np.sum(np.where(secondary.held, axis, 0.0), axis=1) for axis in (frame[:, 0], frame[:, 1]))
    across, along = held
    taken = np.divide(ratio * across, along, out=np.zeros(len(still)), where=leans)
    return ratio, 1.0 - taken


def _offset(contact: Contact, pairing: Pairing, lever: Lever | None) -> Array:
    """`Kinematics.offset` by the weights of the normal rows, which need not be those of the slip."""
    secondary, primary = contact.secondary, contact.primary
    if not isinstance(primary, ContactSurface):
        own = np.asarray(pairing.secondary_weights @ secondary.points)
        return own if lever is None else own - lever.body.about - lever.arm
    weights = pairing.secondary_weights, pairing.primary_weights, pairing.primary_bulge
    return gap_vectors(secondary, primary, *weights)


def join(parts: Sequence[Kinematics]) -> Kinematics:
    """All contacts in one numbering of points, in the order given."""
    if not parts:
        raise InputError("There is no contact: give at least one Contact.")
    if len(parts) == 1:
        return parts[0]
    names = "gap0 area points normal tangent paired tied bilateral action offset tilt vertex"
    values = {name: np.concatenate([getattr(part, name) for part in parts]) for name in names.split()}
    first = np.cumsum([0, *(part.m for part in parts)])
    heir = np.concatenate([k + part.heir for k, part in zip(first[:-1], parts, strict=True)])
    turned, weights = any(part.scaled is not None for part in parts), None
    if any(part.gap_weights is not None for part in parts):
        blocks = [identity(p.m) if p.gap_weights is None else p.gap_weights for p in parts]
        weights = csr_matrix(block_diag(blocks))
    return Kinematics(
        B_n=stacked_rows([part.B_n for part in parts]),
        tangential=partial(_joined_tangential, tuple(parts)),
        tangents=parts[0].tangents,
        heir=heir,
        corners=tuple(found for part in parts for found in part.corners),
        gap_weights=weights,
        scaled=np.concatenate([part.axes for part in parts]) if turned else None,
        **values,
    )


def without_columns(kin: Kinematics, columns: Index) -> Kinematics:
    """The same rows restricted to some DOFs."""
    place = np.full(kin.B_n.shape[1], -1, dtype=kin.B_n.indices.dtype)
    place[columns] = np.arange(len(columns))
    return replace(
        kin,
        B_n=with_columns(kin.B_n, place, len(columns)),
        tangential=partial(_tangential_columns, kin, place, len(columns)),
    )


def with_columns(B: csr_matrix, place: Index, count: int) -> csr_matrix:
    """Columns moved to their new place, and left out where that is negative.

    By hand, because slicing in SciPy goes over all columns of all bodies, for every new pairing.
    """
    column = place[B.indices]
    keep = column >= 0
    start = np.zeros(len(keep) + 1, dtype=B.indptr.dtype)
    np.cumsum(keep, out=start[1:])
    return csr_matrix((B.data[keep], column[keep], start[B.indptr]), shape=(B.shape[0], count))


def columns_of(B: csr_matrix, span: slice) -> csr_matrix:
    """Columns that follow each other, those of one body."""
    place = np.full(B.shape[1], -1, dtype=B.indices.dtype)
    place[span] = np.arange(span.stop - span.start)
    return with_columns(B, place, span.stop - span.start)


def _joined_tangential(parts: Sequence[Kinematics]) -> csr_matrix:
    return stacked_rows([part.B_t for part in parts])


def _tangential_columns(kin: Kinematics, place: Index, count: int) -> csr_matrix:
    return with_columns(kin.B_t, place, count)


def prescribed_rows(B: csr_matrix, D: Index) -> Mask:
    """Rows all of whose DOFs are prescribed: what they measure can not change."""
    return np.asarray(_on_free(B, D) <= GIVEN)


def prescribed_tangents(kin: Kinematics, D: Index) -> Mask:
    """Tangents along which supports alone prescribe the slip of a point, shape (m, d-1)."""
    row = (_on_free(kin.B_t, D) == 0) & (np.diff(kin.B_t.indptr) > 0)
    return np.asarray(row.reshape(kin.m, kin.tangents) & kin.paired[:, None])


def _on_free(B: csr_matrix, D: Index) -> Array:
    """Sum of the sizes of the entries of each row that are at DOFs which are not prescribed."""
    free = np.ones(B.shape[1])
    free[D] = 0.0
    row = np.repeat(np.arange(B.shape[0]), np.diff(B.indptr))
    return np.asarray(np.bincount(row, np.abs(B.data) * free[B.indices], B.shape[0]), dtype=float)
