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

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix

from skfem_contact.bodies.facets import facet_shapes
from skfem_contact.bodies.normals import tangents
from skfem_contact.bodies.projection import interpolated_normals, project
from skfem_contact.bodies.surface import CurveSurface
from skfem_contact.bodies.thresholds import CORNER
from skfem_contact.pairing.closest import search_range
from skfem_contact.pairing.node import Pairing
from skfem_contact.pairing.thresholds import COINCIDENT, CROSS, LEAN, PAIRS_AT_ONCE, SLACK, TIE

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Mask = NDArray[np.bool_]
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
    def of(cls, surface: CurveSurface) -> Corners:
        """Find the sharp corners, and ends of any angle; none on a line of symmetry."""
        after = surface.neighbours[:, 1]
        angle = np.arctan2(surface.end_normals[..., 1], surface.end_normals[..., 0])
        bend = _wrap(angle[after, 0] - angle[:, 1])
        inner = np.flatnonzero((after >= 0) & (bend > 0) & (np.cos(bend) < CORNER))
        f, side = np.nonzero((surface.neighbours < 0) & (surface.end_turns > 0))
        turn = surface.end_turns[f, side]
        first = np.where(side == 1, angle[f, 1], angle[f, 0] - turn)
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
            first=np.concatenate([angle[inner, 1], first]),
            turn=np.concatenate([bend[inner], turn]),
            covered=covered,
            facet=np.concatenate([inner, f]),
        )


@dataclass(frozen=True, eq=False)
class _Met:
    """Corners that meet a facet of the other surface, shapes (q,), (q, d)."""

    corner: Index
    facet: Index
    xi: Array
    normal: Array  # outward of the facet
    gap: Array


@dataclass(frozen=True, eq=False)
class CornerContacts:
    """What the corners of two surfaces meet.

    Attributes
    ----------
    tilt : float
        `LEAN`.
    own, other : tuple of Corners and the facets they meet
        The corners of the secondary on facets of the primary, and the other way round.
    """

    secondary: CurveSurface
    primary: CurveSurface
    tilt: float
    own: tuple[Corners, _Met]
    other: tuple[Corners, _Met]

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
            lean = _lean(corners, met.corner, self.secondary, next_facet)
            leans = (lean > self.tilt) & (lean < corners.turn[met.corner] - self.tilt)
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
        rows = _Rows(pairing, self.secondary, self.primary)
        corners, met = self.own
        node = corners.node[met.corner]
        # a partner that faces the node may be farther off than the one that faces the corner
        farther = np.abs(pairing.gap[node]) > np.abs(met.gap) + TIE * self.primary.lengths[met.facet]
        for k in np.flatnonzero(every | farther):
            rows.of_own_vertex(int(node[k]), met, int(k))
        corners, met = self.other
        for k in np.argsort(met.gap, kind="stable")[::-1]:  # the deepest is written last
            rows.of_other_vertex(corners, met, int(k))
        return rows.pairing(self.names)


def corner_contacts(
    secondary: CurveSurface,
    primary: CurveSurface,
    *,
    reach: float | None = None,
    only_overlaps: bool = False,
    known: Names = frozenset(),
) -> CornerContacts:
    """Find the vertices of either surface that meet a facet of the other.

    Parameters
    ----------
    secondary, primary : CurveSurface
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
        met = _meet(corners, own, other, tilt, limits)
        if only_overlaps:
            met = _some(met, met.gap < -COINCIDENT * other.lengths[met.facet])
        found.append((corners, met))
    return CornerContacts(secondary, primary, LEAN, *found)


def unselected_sides(own: CurveSurface, other: CurveSurface) -> list[tuple[int, float]]:
    """Ends of a surface that the other one overlaps from a side that is not part of the surface.

    Returns
    -------
    list of (int, float)
        Number of the point, and by how much it lies in the other body [length].
    """
    corners = Corners.of(own)
    met = _closest(corners, own, other, search_range(own, other, None))
    lean, turn = _lean(corners, met.corner, other, met.facet), corners.turn[met.corner]
    ahead, behind = ~corners.covered[met.corner].T
    outside = behind & (lean >= turn - SLACK) & (lean < turn + CROSS)
    outside |= ahead & (lean <= SLACK) & (lean > -CROSS)
    deep = met.gap < -LEAN * other.lengths[met.facet]
    return [
        (int(corners.node[met.corner[k]]), -float(met.gap[k])) for k in np.flatnonzero(outside & deep)
    ]


def _meet(
    corners: Corners,
    own: CurveSurface,
    other: CurveSurface,
    tilt: Array,
    limits: tuple[float, float],
) -> _Met:
    """The closest point of the other surface to each vertex, where it is within its cone."""
    met = _closest(corners, own, other, limits)
    corner = met.corner
    lean = _lean(corners, corner, other, met.facet)
    lowest = np.where(corners.covered[corner, 0], tilt[corner], -SLACK)
    highest = corners.turn[corner] - np.where(corners.covered[corner, 1], tilt[corner], -SLACK)
    met = _some(met, (lean > lowest) & (lean < highest))
    _, first = np.unique(met.corner, return_index=True)
    return _some(met, first)


def _closest(
    corners: Corners, own: CurveSurface, other: CurveSurface, limits: tuple[float, float]
) -> _Met:
    """The closest points of the other surface to each vertex."""
    corner, facet = _candidates(own.points[corners.node], other)
    if own.body is other.body:
        mine = own.dofs[corners.node[corner], 0]
        apart = ~(other.dofs[other.facets[facet], 0] == mine[:, None]).any(axis=1)
        corner, facet = corner[apart], facet[apart]
    x = own.points[corners.node[corner]]
    xi, foot, over = project(other, facet, x)
    normal = interpolated_normals(other, facet, xi)
    gap = np.einsum("qd,qd->q", x - foot, normal)
    distance = np.linalg.norm(x - foot, axis=1)
    nearest = np.full(len(corners.node), np.inf)
    np.minimum.at(nearest, corner, distance)
    good = distance <= nearest[corner] + TIE * other.lengths[facet]
    # beyond an end: its node is the closest point only if it is that of the next facet, too
    side = (xi >= 0.5).astype(int)
    onward = other.neighbours[facet, side]
    there = other.end_normals[onward, 1 - side]
    into = np.where(side == 1, 1.0, -1.0)[:, None] * tangents(there)[:, 0]
    at_node = np.einsum("qd,qd->q", x - foot, into) <= COINCIDENT * other.lengths[onward]
    at_node &= (onward >= 0) & (np.einsum("qd,qd->q", other.end_normals[facet, side], there) >= CORNER)
    good &= (over <= COINCIDENT * other.lengths[facet]) | at_node
    good &= np.where(gap >= 0, distance <= limits[0], distance <= limits[1])
    return _some(_Met(corner, facet, xi, normal, gap), good)


def _candidates(points: Array, surface: CurveSurface) -> tuple[Index, Index]:
    """Pairs of points and facets among which the closest facets to the points are."""
    middle = surface.points[surface.facets].mean(axis=1)
    # no point of a facet, curved or not, is farther from its middle
    reach = surface.lengths
    found: list[tuple[Index, Index]] = [(np.zeros(0, dtype=np.intp),) * 2]
    block = max(1, PAIRS_AT_ONCE // len(middle))
    for start in range(0, len(points), block):
        away = np.linalg.norm(points[start : start + block, None] - middle, axis=2)
        point, facet = np.nonzero(away - reach <= (away + reach).min(axis=1, keepdims=True))
        found.append((start + point, facet))
    corner, facet = (np.concatenate(column) for column in zip(*found, strict=True))
    return corner, facet


def _lean(corners: Corners, corner: Index, other: CurveSurface, facet: Index) -> Array:
    """Angle from the beginning of a corner's cone to the opposite of a facet's normal [rad]."""
    normal = other.facet_normals[facet]
    return _wrap(np.arctan2(-normal[:, 1], -normal[:, 0]) - corners.first[corner])


def _some(met: _Met, chosen: Index | Mask) -> _Met:
    return _Met(*(getattr(met, name)[chosen] for name in ("corner", "facet", "xi", "normal", "gap")))


class _Rows:
    """A pairing some of whose rows are replaced."""

    def __init__(self, pairing: Pairing, secondary: CurveSurface, primary: CurveSurface) -> None:
        self.old, self.secondary, self.primary = pairing, secondary, primary
        self.values = {
            name: np.array(getattr(pairing, name))
            for name in ("normal", "gap", "area", "paired", "miss", "facet")
        }
        self.values["vertex"] = np.full(len(pairing.gap), -1)
        self.weights: dict[int, tuple[tuple[Index, Array], tuple[Index, Array]]] = {}

    def of_own_vertex(self, node: int, met: _Met, k: int) -> None:
        """A vertex of the secondary on a facet of the primary."""
        nodes = self.primary.facets[met.facet[k]]
        N = facet_shapes(met.xi[k], len(nodes))[0]
        self._write(node, (np.array([node]), np.ones(1)), (nodes, N), met.normal[k], met, k)
        self.values["facet"][node] = met.facet[k]

    def of_other_vertex(self, corners: Corners, met: _Met, k: int) -> None:
        """A vertex of the primary on a facet of the secondary: the row of the end farther off."""
        nodes = self.secondary.facets[met.facet[k]]
        N = facet_shapes(met.xi[k], len(nodes))[0]
        vertex = corners.node[met.corner[k]]
        ends = nodes[:2]
        own = self.values["gap"][ends]
        there = int(np.argmax(N[:2]))
        deepest = met.gap[k] + COINCIDENT * self.secondary.lengths[met.facet[k]]
        if N[there] > 1 - COINCIDENT and own[there] <= deepest:
            self.values["vertex"][ends[there]] = vertex
            return  # the vertex lies at a node, whose own row says the same
        host = there if own[0] == own[1] else int(np.argmax(own))
        if met.gap[k] >= own[host]:
            return
        node = int(ends[host])
        self._write(node, (nodes, N), (np.array([vertex]), np.ones(1)), -met.normal[k], met, k)
        self.values["facet"][node] = corners.facet[met.corner[k]]
        self.values["vertex"][node] = vertex

    def _write(
        self,
        node: int,
        own: tuple[Index, Array],
        other: tuple[Index, Array],
        normal: Array,
        met: _Met,
        k: int,
    ) -> None:
        self.weights[int(node)] = own, other
        new = {"normal": normal, "gap": met.gap[k], "paired": True, "miss": 0.0}
        for name, value in new.items():
            self.values[name][node] = value

    def pairing(self, names: Names) -> Pairing:
        """The pairing with the rows that were written."""
        old, written = self.old, np.array(list(self.weights), dtype=int)
        new: dict[str, Any] = dict(self.values)
        normal = new["normal"]
        for name in ("secondary_normal", "primary_normal"):
            if getattr(old, name) is not None:
                new[name] = getattr(old, name).copy()
                new[name][written] = normal[written]
        if old.slip_weights is not None:
            new["slip_weights"] = tuple(self._replaced(i, w) for i, w in enumerate(old.slip_weights))
        if old.primary_bulge is not None:
            none = np.zeros(0, dtype=np.intp), np.zeros(0)
            new["primary_bulge"] = _replaced(old.primary_bulge, dict.fromkeys(self.weights, none))
        if old.still is not None:
            new["still"] = old.still.copy()
            new["still"][written] = False
        return replace(
            old,
            **new,
            corners=names,
            tangent=tangents(normal),
            secondary_weights=self._replaced(0, old.secondary_weights),
            primary_weights=self._replaced(1, old.primary_weights),
        )

    def _replaced(self, side: int, matrix: csr_matrix) -> csr_matrix:
        return _replaced(matrix, {node: rows[side] for node, rows in self.weights.items()})


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


def _wrap(angle: Array) -> Array:
    """Angle in [-pi, pi)."""
    return np.asarray((angle + np.pi) % (2 * np.pi) - np.pi)
