r"""Contact at convex corners: a vertex of one surface meets a facet of the other.

Nodes of the secondary that look for facets of the primary, and means over what facets share, both
lose a corner: between two nodes of a coarse secondary the vertex of the primary presses unseen, and
the mean over a facet that leans away from the vertex is open while the vertex is in the body. There

    g = n . (sum_k N_k(xi) x_k - x_vertex)

is the row: the facet of the secondary at the vertex' foot ``xi``, the vertex of the primary with weight
one (a quadrature point of the multiplier at the vertex alone), along the normal of the facet; or the
same with the two sides exchanged, for a vertex of the secondary. The row is that of one secondary
node, in place of its own: of the two ends of the facet the one that is farther from contact.

A vertex meets what leans by more than `LEAN` towards the other facet of the corner, and no farther
than that facet's normal. What the surface ends at is known from the mesh, so that the end of "top" is
a corner even if the side of the body was not selected. On flat interfaces nothing changes.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from scipy.sparse import csr_matrix

from skfem_contact.arrays import Array, Index, Mask, dot, tangents
from skfem_contact.bodies.normal_field import CORNER
from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.digits import GIVEN, SOLVED
from skfem_contact.pairing.closest import LEAN, Side, nearby_facets, search_range
from skfem_contact.pairing.node import Pairing
from skfem_contact.records import dataclass

# Angle [rad] beyond the normal of a facet that was not selected up to which the vertex still carries:
# corners turn with the strains of their body.
SLACK = 0.1

# What leans farther beyond an end than this [rad] is another part of the boundary.
CROSS = 0.5 * np.pi

# (0 of the secondary, 1 of the primary; number of the point)
Names = frozenset[tuple[int, int]]


@dataclass(frozen=True, eq=False)
class Corners:
    """Convex corners of a surface, its ends included.

    Attributes
    ----------
    node : ndarray of int, shape (c,)
    first : ndarray, shape (c,)
        Direction of the normal of the facet that ends there [rad].
    turn : ndarray, shape (c,)
        Angle from there to the normal of the facet that begins there, > 0 [rad].
    covered : ndarray of bool, shape (c, 2)
        Whether the facet that ends (begins) there belongs to the surface.
    facet : ndarray of int, shape (c,)
        A facet of the surface there.
    """

    node: Index
    first: Array
    turn: Array
    covered: Mask
    facet: Index

    @classmethod
    def of(cls, surface: ContactSurface) -> Corners:
        """Find the sharp corners, and ends of any angle; none on a line of symmetry."""
        after, corner = surface.neighbours[:, 1], surface.corner
        own = surface.own_normals
        # angles only where the surface bends by what a corner does, round-off included
        cosine = dot(own[:, 1], own[:, 0].take(after, axis=0))
        inner = np.flatnonzero((after >= 0) & (cosine < corner + SOLVED))
        bend = _wrap(_direction(own[after[inner], 0]) - _direction(own[inner, 1]))
        sharp = (bend > 0) & (np.cos(bend) < corner)
        inner, bend = inner[sharp], bend[sharp]
        f, side = np.nonzero((surface.neighbours < 0) & (surface.end_turns > 0))
        turn = surface.end_turns[f, side]
        first = _direction(own[f, side]) - np.where(side == 1, 0.0, turn)
        # a node that may not leave the line that the surface ends at lies on a line of symmetry
        other = np.where(side == 1, first + turn, first)
        held = surface.held[surface.facets[f, side]]
        across = np.abs(np.stack([np.cos(other), np.sin(other)], axis=1))
        keep = (held.sum(axis=1) != 1) | (np.sum(held * across, axis=1) < CORNER)
        f, side, turn, first = f[keep], side[keep], turn[keep], first[keep]
        node = np.concatenate([surface.facets[inner, 1], surface.facets[f, side]])
        covered = np.concatenate([np.ones((len(inner), 2), bool), np.stack([side == 1, side == 0], 1)])
        return cls(
            node=node,
            first=np.concatenate([_direction(own[inner, 1]), first]),
            turn=np.concatenate([bend, turn]),
            covered=covered,
            facet=np.concatenate([inner, f]),
        )

    def lean(self, corner: Index, other: ContactSurface, facet: Index) -> Array:
        """Angle from the beginning of a corner's cone to the opposite of a facet's normal [rad]."""
        return _wrap(_direction(-other.facet_normals[facet]) - self.first[corner])


@dataclass(frozen=True, eq=False)
class Met:
    """Corners that meet a facet of the other surface, shapes (q,), (q, k), (q, d)."""

    corner: Index
    facet: Index
    shape: Array  # shape functions at the foot
    normal: Array  # outward of the facet
    gap: Array

    def some(self, chosen: Index | Mask) -> Met:
        """These of them."""
        return Met(*(value[chosen] for value in vars(self).values()))


def meet(
    corners: Corners,
    own: ContactSurface,
    other: ContactSurface,
    tilt: Array,
    limits: tuple[float, float],
    only_overlaps: bool = False,
) -> Met:
    """The closest point of the other surface to each vertex, where it is within its cone.

    With `only_overlaps` those alone that lie in the other body by more than they touch it.
    """
    lowest = np.where(corners.covered[:, 0], tilt, -SLACK)
    highest = corners.turn - np.where(corners.covered[:, 1], tilt, -SLACK)
    lean = corners.lean(np.arange(len(corners.node))[:, None], other, np.arange(len(other.facets)))
    leans = (lean > lowest[:, None]) & (lean < highest[:, None])
    some = np.flatnonzero(leans.any(axis=1))
    if not len(some):  # as on flat interfaces
        return Met(some, some, np.zeros((0, 2)), np.zeros((0, 2)), np.zeros(0))
    met = closest(corners, some, own, other, limits)
    met = met.some(leans[met.corner, met.facet])
    met = met.some(np.unique(met.corner, return_index=True)[1])
    return met.some(met.gap < -GIVEN * other.lengths[met.facet]) if only_overlaps else met


def closest(
    corners: Corners,
    chosen: Index,
    own: ContactSurface,
    other: ContactSurface,
    limits: tuple[float, float],
) -> Met:
    """The closest points of the other surface to some vertices, but those that it has itself."""
    if own.body is other.body:
        chosen = chosen[~np.isin(own.dofs[corners.node[chosen], 0], other.dofs[:, 0])]
    x = own.points[corners.node[chosen]]
    point, facet = nearby_facets(other, x)
    side = Side(own, other, *limits, np.zeros(len(other.facets)))
    feet, normal, distance, gap, good = side.stationary(facet, x[point])
    nearest = np.full(len(x), np.inf)
    np.minimum.at(nearest, point, distance)
    good &= distance <= nearest[point] + SOLVED * other.lengths[facet]
    return Met(chosen[point], facet, feet.shape, normal, gap).some(good)


@dataclass(frozen=True, eq=False)
class CornerContacts:
    """The contacts of the corners of two surfaces.

    Attributes
    ----------
    own, other : tuple of Corners and the facets they meet
        The corners of the secondary on facets of the primary, and the other way round.
    """

    secondary: ContactSurface
    primary: ContactSurface
    own: tuple[Corners, Met]
    other: tuple[Corners, Met]

    @property
    def names(self) -> Names:
        """The corners that met something."""
        sides = enumerate((self.own, self.other))
        return frozenset((i, int(n)) for i, (c, met) in sides for n in c.node[met.corner])

    @property
    def pressed(self) -> Index:
        """Facets of the secondary that a vertex of the primary meets, and those next to them.

        Of the next ones only those that lean, too: a vertex passes to them without a jump.
        """
        corners, met = self.other
        if not len(met.corner):
            return met.facet
        beside = self.secondary.neighbours[met.facet]
        found = [met.facet]
        for next_facet in beside.T:
            lean = corners.lean(met.corner, self.secondary, next_facet)
            leans = (lean > LEAN) & (lean < corners.turn[met.corner] - LEAN)
            found.append(next_facet[leans & (next_facet >= 0)])
        return np.unique(np.concatenate(found))

    def rows(self, pairing: Pairing, every: bool) -> Pairing:
        """The pairing with the rows of the vertices.

        Parameters
        ----------
        pairing : Pairing
        every : bool
            Whether rows of vertices of the secondary are replaced that have a partner already.
        """
        if not (len(self.own[1].corner) or len(self.other[1].corner)):
            return pairing
        gap, vertex = pairing.gap.copy(), np.full(len(pairing.gap), -1)
        rows: dict[int, Row] = {}
        corners, met = self.own
        node = corners.node[met.corner]
        # a partner that faces the node may be farther off than the one that faces the corner
        farther = np.abs(gap[node]) > np.abs(met.gap) + SOLVED * self.primary.lengths[met.facet]
        for k in np.flatnonzero(every | farther):
            own, facet = int(node[k]), met.facet[k]
            other = self.primary.facets[facet], met.shape[k]
            rows[own] = Row((node[k : k + 1], np.ones(1)), other, met.normal[k], facet)
            gap[own] = met.gap[k]
        corners, met = self.other
        for k in np.argsort(met.gap, kind="stable")[::-1]:  # the deepest is written last
            corner, facet = met.corner[k], met.facet[k]
            # the row of the node at the vertex, or of the end of the facet that is farther off
            nodes, N, at = self.secondary.facets[facet], met.shape[k], corners.node[[corner]]
            there, apart = int(np.argmax(N[:2])), gap[nodes[:2]]
            host, slack = there if apart[0] == apart[1] else int(np.argmax(apart)), 0.0
            normal = met.normal[k]
            if N[there] > 1 - GIVEN:  # round-off chooses between the facets at a node, and no row
                host, slack = there, GIVEN * self.secondary.lengths[facet]
                normal = self.secondary.facet_node_normals[facet, there]
                if self.secondary.sharp_points[nodes[there]] and apart[there] <= met.gap[k] + slack:
                    vertex[nodes[there]] = at[0]  # a corner, whose own row says the same
                    continue
            if met.gap[k] < apart[host] + slack:
                own = int(nodes[host])
                rows[own] = Row((nodes, N), (at, np.ones(1)), -normal, corners.facet[corner])
                gap[own], vertex[own] = met.gap[k], at[0]
        return _with_rows(pairing, rows, gap=gap, vertex=vertex, corners=self.names)


def corner_contacts(
    secondary: ContactSurface,
    primary: ContactSurface,
    *,
    reach: float | None = None,
    only_overlaps: bool = False,
    known: Names = frozenset(),
) -> CornerContacts:
    """Find the vertices of either surface that meet a facet of the other.

    Parameters
    ----------
    secondary, primary : ContactSurface
    reach : float, optional
        As in `node_to_segment`.
    only_overlaps : bool
        Leave out vertices that do not overlap now: for small sliding.
    known : set
        `CornerContacts.names` of a round before: these vertices carry however little they lean, so
        that no round undoes what the last one found.
    """
    limits = search_range(secondary, primary, reach)
    found = []
    for side, (own, other) in enumerate(((secondary, primary), (primary, secondary))):
        corners = Corners.of(own)
        held = np.array([(side, int(node)) in known for node in corners.node], dtype=bool)
        tilt = np.where(held, -SLACK, LEAN)
        found.append((corners, meet(corners, own, other, tilt, limits, only_overlaps)))
    return CornerContacts(secondary, primary, *found)


def unselected_sides(own: ContactSurface, other: ContactSurface) -> list[tuple[int, float]]:
    """Ends of a surface that the other one overlaps from a side that is not part of the surface.

    Returns
    -------
    list of (int, float)
        Number of the point, and by how much it lies in the other body [length].
    """
    corners = Corners.of(own)
    met = closest(corners, np.arange(len(corners.node)), own, other, search_range(own, other, None))
    lean, turn = corners.lean(met.corner, other, met.facet), corners.turn[met.corner]
    ahead, behind = ~corners.covered[met.corner].T
    outside = behind & (lean >= turn - SLACK) & (lean < turn + CROSS)
    outside |= ahead & (lean <= SLACK) & (lean > -CROSS)
    deep = met.gap < -LEAN * other.lengths[met.facet]
    return [
        (int(corners.node[met.corner[k]]), -float(met.gap[k])) for k in np.flatnonzero(outside & deep)
    ]


class Row(NamedTuple):
    """Nodes of both sides with their weights, the normal, and the facet of the primary."""

    own: tuple[Index, Array]
    other: tuple[Index, Array]
    normal: Array
    facet: int


def _with_rows(pairing: Pairing, rows: dict[int, Row], **new: Any) -> Pairing:
    """The pairing with other rows of some points, and with what else is `new`."""
    written, m = np.array(list(rows), dtype=np.intp), len(pairing.gap)
    normal = np.array([row.normal for row in rows.values()]).reshape(-1, pairing.points.shape[1])
    values = {
        **dict.fromkeys(("normal", "secondary_normal", "primary_normal"), normal),
        "facet": [row.facet for row in rows.values()],
        "paired": True,
        **dict.fromkeys(("miss", "smooth", "still"), 0),
    }
    for name, value in values.items():
        if getattr(pairing, name) is not None:
            new[name] = getattr(pairing, name).copy()
            new[name][written] = value
    if pairing.primary_bulge is not None:
        new["primary_bulge"] = bulge = pairing.primary_bulge.copy()
        bulge.data[np.isin(np.repeat(np.arange(m), np.diff(bulge.indptr)), written)] = 0.0

    def replaced(*both: csr_matrix) -> list[csr_matrix]:
        new = {i: row.own for i, row in rows.items()}, {i: row.other for i, row in rows.items()}
        return [_replaced(W, side) for W, side in zip(both, new, strict=True)]

    if pairing.slip_weights is not None:
        new["slip_weights"] = tuple(replaced(*pairing.slip_weights))
    own, other = replaced(pairing.secondary_weights, pairing.primary_weights)
    new |= {"secondary_weights": own, "primary_weights": other, "tangent": tangents(new["normal"])}
    return replace(pairing, **new)


def _replaced(matrix: csr_matrix, rows: dict[int, tuple[Index, Array]]) -> csr_matrix:
    """A sparse matrix with some rows replaced by (columns, values)."""
    coo = matrix.tocoo()
    keep = ~np.isin(coo.row, list(rows))
    parts = [(coo.row[keep], coo.col[keep], coo.data[keep])]
    parts += [(np.full(len(c), node), c, v) for node, (c, v) in rows.items()]
    row, col, data = (np.concatenate(part) for part in zip(*parts, strict=True))
    out = csr_matrix((data, (row, col)), shape=matrix.shape)
    out.eliminate_zeros()
    return out


def _direction(vectors: Array) -> Array:
    """Angles of plane vectors (n, 2), (n,) [rad]."""
    return np.asarray(np.arctan2(vectors[:, 1], vectors[:, 0]))


def _wrap(angle: Array) -> Array:
    """Angle in [-pi, pi)."""
    return np.asarray((angle + np.pi) % (2 * np.pi) - np.pi)
