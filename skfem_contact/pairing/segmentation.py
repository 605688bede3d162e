r"""Segmentation of an interface between curves: the intervals on which one facet meets one facet.

A point ``x(xi)`` of the secondary surface meets the point ``y`` of the primary that lies on the
line along the secondary's normal,

    y = x(xi) + alpha n(xi),        n(xi) = sum_k N_k(xi) n_k,

with the nodal normals ``n_k`` interpolated like the position. The field ``n`` is continuous, so
the map is one to one: on curved or polygonal surfaces nothing of the primary is left out between
two facets and nothing counted twice, which it would be along the facets' own normals. On flat
surfaces the two are the same. At a corner of 45 degrees or more each facet keeps its own normal.

Between the projections of the ends of the primary facets all integrands are smooth (on straight
facets of flat surfaces polynomials), and Gauss quadrature on each such segment is exact for them.

References
----------
B. Yang, T. A. Laursen, X. Meng, Int. J. Numer. Meth. Engng 62 (2005) 1183-1225: segments along a
continuous normal field.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from skfem_contact.bodies.facet_kinds import FacetKind
from skfem_contact.bodies.normals import sizes
from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.digits import SOLVED
from skfem_contact.pairing.closest import search_range
from skfem_contact.pairing.pieces import Meeting, Pieces
from skfem_contact.pairing.search import FacetTree, Nodes, facet_balls
from skfem_contact.pairing.thresholds import BISECTION_DONE, FACING
from skfem_contact.pairing.vectors import dot, ragged, turned
from skfem_contact.records import dataclass

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Mask = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Segments(Pieces):
    """Intervals of the secondary's facets, each below one facet of the primary.

    Attributes
    ----------
    secondary, primary : ContactSurface
    e, f : ndarray of int, shape (p,)
        Facets of both.
    start, stop : ndarray, shape (p,)
        Local coordinates on the facets e, in [0, 1].
    """

    e: Index
    f: Index
    start: Array
    stop: Array

    @property
    def facets(self) -> tuple[Index, Index]:
        """Facets of the secondary and of the primary that each piece is part of, (p,) each."""
        return self.e, self.f

    def points(
        self, some: Index | None = None, heights: bool = False
    ) -> Iterator[tuple[Index, Meeting, Array]]:
        """Yield the Gauss points of all pieces, or of some, at once, see `Pieces.points`."""
        some = np.arange(len(self.e)) if some is None else some
        k = max(self.secondary.facets.shape[1], self.primary.facets.shape[1])
        # 2 k - 1 is exact for two shape functions, a measure linear in the position, and one to spare
        # (k = 2: degree 5 of 3 needed, k = 3: degree 9 of 5) for segments of curved facets
        at, w = _gauss(2 * k - 1)
        length = (self.stop - self.start)[some, None]
        xi = self.start[some, None] + length * at
        weight = length * w * _area_element(self.secondary, self.e[some], xi)
        yield some, _meeting(self.secondary, self.primary, self.e[some], self.f[some], xi), weight

    def corners(self, some: Index) -> Meeting:
        """Return what meets at both ends of some pieces."""
        xi = np.stack([self.start[some], self.stop[some]], axis=1)
        return _meeting(self.secondary, self.primary, self.e[some], self.f[some], xi)

    def distances(self, some: Index) -> Array:
        """Return how far nodes are from some pieces of their facets, in local coordinates, (p, k)."""
        at = self.secondary.kind.locations[:, 0]
        beyond = np.maximum(self.start[some, None] - at, at - self.stop[some, None])
        return np.maximum(beyond, 0.0)

    def nodes(self, some: Index, local: Index) -> Meeting:
        """Return what normals at nodes meet, one of the facet of each piece, if its partner went on."""
        xi = self.secondary.kind.locations[local]
        return _meeting(self.secondary, self.primary, self.e[some], self.f[some], xi, beyond=1.0)


def segment(secondary: ContactSurface, primary: ContactSurface, reach: float | None = None) -> Segments:
    """Find all parts of the secondary that the primary covers.

    Where a normal line meets the primary more than once (two layers, a closed curve), the meeting
    closest to the secondary counts, and only if the surfaces face each other there.

    Parameters
    ----------
    secondary, primary : ContactSurface
    reach : float, optional
        Longest distance along the normal [length]. Without it gaps are unlimited, and overlaps go
        up to half the diagonal of the box around the smaller surface, as in `node_to_segment`.
    """
    limits = search_range(secondary, primary, reach)
    e, f = _candidates(secondary, primary, max(limits))
    return Segments(secondary, primary, *_segments(secondary, primary, e, f, limits))


def _candidates(
    secondary: ContactSurface, primary: ContactSurface, reach: float
) -> tuple[Index, Index]:
    """Pairs of facets that may meet along the normals of the secondary.

    The work is proportional to the facets and the pairs found, whatever the distance between the
    surfaces (a search by radius would need `reach`).

    Returns
    -------
    e, f : ndarray of int
        Secondary and primary facets, ordered by both.
    """
    centre, radius = facet_balls(secondary)
    along = turned(secondary.facet_node_normals[:, :2])
    along /= sizes(along)[..., None]
    # by the corner of a facet (2 e, 2 e + 1): where it is along its line of sight
    along = along.reshape(-1, 2)
    place = dot(secondary.points.take(secondary.facets[:, :2].ravel(), axis=0), along)

    def in_strip(e: Index, nodes: Nodes) -> Mask:
        start, end = 2 * e, 2 * e + 1
        past_start = dot(nodes.centre, along.take(start, axis=0)) - place[start] >= -nodes.radius
        before_end = dot(nodes.centre, along.take(end, axis=0)) - place[end] <= nodes.radius
        distance = sizes(nodes.centre - centre.take(e, axis=0))
        return past_start & before_end & (distance <= reach + radius[e] + nodes.radius)

    tree = FacetTree.build(primary, len(secondary.facets), cones=False)
    found = tree.descend(len(secondary.facets), in_strip)
    e, f = (np.concatenate(column) for column in zip(*found, strict=True))
    order = np.lexsort((f, e))
    return e[order], f[order]


def _area_element(surface: ContactSurface, facet: Index, xi: Array) -> Array:
    """``measure |dx/dxi|`` at places ``xi`` (p, n) in [0, 1] of facets, shape (p, n)."""
    nodes = surface.points[surface.facets[facet]]
    N, dN = surface.kind.shapes(xi[..., None])
    stretch = sizes(dN[..., 0] @ nodes)
    measure = surface.body.measure
    return stretch if measure is None else stretch * measure(np.moveaxis(N @ nodes, -1, 0))


@lru_cache
def _gauss(n: int) -> tuple[Array, Array]:
    """Gauss points and weights on [0, 1]."""
    at, w = np.polynomial.legendre.leggauss(n)
    return 0.5 * (at + 1), 0.5 * w


def _segments(
    secondary: ContactSurface,
    primary: ContactSurface,
    e: Index,
    f: Index,
    limits: tuple[float, float],
) -> tuple[Index, Index, Array, Array]:
    """Non-overlapping intervals ``(e, f, start, stop)`` of secondary facets under primary ones."""
    nodes = secondary.points[secondary.facets[e]]
    normals = secondary.facet_node_normals[e]
    first, last = (primary.points.take(node, axis=0) for node in primary.facets[f, :2].T)
    both = (np.concatenate(pair) for pair in ((nodes, nodes), (normals, normals), (first, last)))
    ends = _project(secondary.kind, *both).reshape(2, -1)
    start, stop = ends.min(axis=0), ends.max(axis=0)  # a nan where either is
    found = stop - start > SOLVED  # False for nan
    e, f, start, stop = e[found], f[found], start[found], stop[found]
    # cut every interval at the ends of all intervals of the same secondary facet
    facet, cut = np.concatenate([e, e]), np.concatenate([start, stop])
    order = np.lexsort((cut, facet))
    rank = np.empty_like(order)
    rank[order] = np.arange(len(order))
    cut = cut[order]
    pieces = rank[len(e) :] - rank[: len(e)]
    piece = ragged(rank[: len(e)], pieces)
    e, f = np.repeat(e, pieces), np.repeat(f, pieces)
    start, stop = cut[piece], cut[piece + 1]
    # of all primary facets over one piece the closest counts, if it faces the secondary
    points = _meeting(secondary, primary, e, f, 0.5 * (start + stop)[:, None])
    gap, facing = points.gap[:, 0], _looks_at(primary, points)[:, 0]
    closest = np.lexsort((np.abs(gap), piece))
    first = np.ones(len(closest), dtype=bool)
    first[1:] = np.diff(piece[closest]) > 0
    chosen = np.zeros(len(closest), dtype=bool)
    chosen[closest] = first
    near = (gap <= limits[0]) & (gap >= -limits[1])
    valid = chosen & (stop - start > SOLVED) & facing & near
    return e[valid], f[valid], start[valid], stop[valid]


def _project(kind: FacetKind, nodes: Array, normals: Array, y: Array) -> Array:
    """Coordinate of points ``y`` on facets along their normal field, cut to [0, 1]; (p,).

    Seeks the zero of ``(y - x(xi)) . t(xi)`` with ``t`` the normal turned by 90 degrees: Newton
    steps inside a bracket. ``nan`` beyond the focus of a hollow facet, where normals have crossed.
    """

    def lateral(xi: Array, at: Index) -> tuple[Array, Array]:
        N, dN = kind.shapes(xi[:, None])
        slopes = dN[..., 0]
        away = y[at] - _combine(N, nodes[at])
        along, bend = turned(_combine(N, normals[at])), turned(_combine(slopes, normals[at]))
        slope = dot(away, bend) - dot(_combine(slopes, nodes[at]), along)
        return dot(away, along), slope

    everyone = np.arange(len(y))
    first, last = (lateral(np.full(len(y), end), everyone)[0] for end in (0.0, 1.0))
    before, behind = first <= 0, last >= 0
    xi = np.select([before & behind, before, behind], [np.nan, 0.0, 1.0], 0.5)
    at = np.flatnonzero(~before & ~behind)
    xi[at] = first[at] / (first[at] - last[at])  # a secant: on straight facets it is all but there
    low, high = np.zeros(len(at)), np.ones(len(at))
    for _ in range(60):  # a bisection alone is at round-off by then; Newton mostly after 3
        now = xi[at]
        value, slope = lateral(now, at)
        low, high = np.where(value > 0, now, low), np.where(value > 0, high, now)
        new = now - value / np.where(slope < 0, slope, -np.inf)
        newton = (slope < 0) & (new >= low) & (new <= high)
        new = np.where(newton, new, 0.5 * (low + high))
        xi[at] = new
        # Newton squares its error; to wait until nothing moves is to watch round-off
        moving = np.abs(new - now) > np.where(newton, SOLVED, BISECTION_DONE)
        at, low, high = at[moving], low[moving], high[moving]
        if not len(at):
            break
    return xi


def _meeting(
    secondary: ContactSurface,
    primary: ContactSurface,
    e: Index,
    f: Index,
    xi: Array,
    beyond: float = 0.0,
) -> Meeting:
    """Return what normals at places ``xi`` (p, n) of facets e meet on facets f, or how far beyond."""
    nodes, other = secondary.points[secondary.facets[e]], primary.points[primary.facets[f]]
    N, _ = secondary.kind.shapes(xi[..., None])
    normal = N @ secondary.facet_node_normals[e]
    eta = np.clip(_meet(N @ nodes, normal, other), -beyond, 1.0 + beyond)
    M, _ = primary.kind.shapes(eta[..., None])
    return Meeting(e, f, N, M, normal, (nodes, other), None)


def _meet(x: Array, normal: Array, nodes: Array) -> Array:
    """Coordinates on facets with `nodes` (p, k', 2) of what lines through points x meet, (p, n).

    The lines are along `normal`, (p, n, 2) as x is.
    """
    c = dot(nodes[:, None] - x[:, :, None], turned(normal)[:, :, None])
    # a eta^2 + b eta + c0 between ends of opposite sign; the root in the form without loss
    c0, b = c[..., 0], c[..., 1] - c[..., 0]
    a = np.zeros(b.shape)
    if c.shape[-1] == 3:
        a = 2 * (c[..., 0] + c[..., 1]) - 4 * c[..., 2]
        b = b - a
    rising = np.where(c[..., 1] >= c[..., 0], 1.0, -1.0)  # the root where the polynomial does
    surd = rising * np.sqrt(np.maximum(b**2 - 4 * a * c0, 0.0))
    with np.errstate(divide="ignore", invalid="ignore"):
        eta = np.where(b * surd > 0, -2 * c0 / (b + surd), (surd - b) / (2 * a))
    eta[np.isnan(eta)] = 0.5
    return eta


def _looks_at(primary: ContactSurface, points: Meeting) -> Mask:
    """Return whether the primary faces the secondary where they meet, (p, n)."""
    slopes = primary.kind.shapes(points.M @ primary.kind.locations)[1][..., 0]
    outward = -turned(slopes @ points.nodes[1])
    limit = -FACING * sizes(points.normal) * sizes(outward)
    return np.asarray(dot(points.normal, outward) < limit)


def _combine(N: Array, values: Array) -> Array:
    """Sum of nodal values with shape functions, (q, k) and (q, k, d) to (q, d)."""
    return np.einsum("qk,qkd->qd", N, values)
