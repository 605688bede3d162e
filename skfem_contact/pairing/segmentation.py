r"""Segmentation of an interface: the pieces on which one facet meets one facet.

A point ``x(xi)`` of the secondary surface meets the point ``y`` of the primary that lies on the
line along the secondary's normal,

    y = x(xi) + alpha n(xi),        n(xi) = sum_k N_k(xi) n_k,

with the nodal normals ``n_k`` interpolated like the position. The field ``n`` is continuous, so
the map is one to one: on curved or polygonal surfaces nothing of the primary is left out between
two facets and nothing counted twice, which it would be along the facets' own normals. On flat
surfaces the two are the same. At a corner of 45 degrees or more each facet keeps its own normal.

Between the projections of the ends of the primary facets all integrands are smooth (on straight
facets of flat surfaces polynomials), and Gauss quadrature on each such segment is exact for them.

Only this module and `search` know that surfaces are curves. A third dimension replaces the strips of
normals, the intervals and the quadrature of segments by prisms, clipped polygons and their triangles;
what leaves the module (`Quadrature`) stays the same.

References
----------
B. Yang, T. A. Laursen, X. Meng, Int. J. Numer. Meth. Engng 62 (2005) 1183-1225: segments along a
continuous normal field.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from skfem_contact.bodies.facets import facet_shapes
from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.pairing.search import normal_candidates
from skfem_contact.pairing.thresholds import BISECTION_DONE, FACING, NEWTON_DONE, SLIVER
from skfem_contact.pairing.vectors import dot, ragged, turned

Array = NDArray[np.float64]
Index = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class Quadrature:
    """Quadrature points of an interface, each with its place on both surfaces.

    Attributes
    ----------
    secondary_facet, primary_facet : ndarray of int, shape (q,)
    secondary_shape, primary_shape : ndarray, shapes (q, k) and (q, k')
        Shape functions of the nodes of the two facets.
    weight : ndarray, shape (q,)
        Weight times length times the secondary body's ``measure`` [area].
    """

    secondary_facet: Index
    primary_facet: Index
    secondary_shape: Array
    primary_shape: Array
    weight: Array


def interface_quadrature(
    secondary: ContactSurface, primary: ContactSurface, reach: float | None = None
) -> Quadrature:
    """Quadrature of all parts of the secondary that the primary covers.

    Where a normal line meets the primary more than once (two layers, a closed curve), the meeting
    closest to the secondary counts, and only if the surfaces face each other there.

    Parameters
    ----------
    secondary, primary : ContactSurface
    reach : float, optional
        Longest distance along the normal [length]. Without it gaps are unlimited, and overlaps go
        up to half the diagonal of the box around the smaller surface, as in `node_to_segment`.
    """
    limits = (np.inf, half_extent(secondary, primary)) if reach is None else (float(reach),) * 2
    e, f = normal_candidates(secondary, primary, max(limits))
    e, f, start, stop = _segments(secondary, primary, e, f, limits)
    at, w = _segment_rule(secondary, primary)
    length = stop - start
    xi = (start[:, None] + length[:, None] * at).ravel()
    e, f = np.repeat(e, len(at)), np.repeat(f, len(at))
    eta = _meet(secondary, primary, e, f, xi)
    return Quadrature(
        secondary_facet=e,
        primary_facet=f,
        secondary_shape=facet_shapes(xi, secondary.facets.shape[1])[0],
        primary_shape=facet_shapes(eta, primary.facets.shape[1])[0],
        weight=(length[:, None] * w).ravel() * area_element(secondary, e, xi),
    )


def _segment_rule(secondary: ContactSurface, primary: ContactSurface) -> tuple[Array, Array]:
    """Gauss points and weights on [0, 1] for each segment."""
    k = max(secondary.facets.shape[1], primary.facets.shape[1])
    # 2 k - 1 is exact for two shape functions, a measure linear in the position, and one to spare
    # (k = 2: degree 5 of 3 needed, k = 3: degree 9 of 5) for segments of curved facets
    return _gauss(2 * k - 1)


def points_per_segment(secondary: ContactSurface, primary: ContactSurface) -> Array:
    """Places on [0, 1] of the quadrature points of each segment, which follow each other."""
    return _segment_rule(secondary, primary)[0]


def half_extent(*surfaces: ContactSurface) -> float:
    """Half the diagonal of the box around the smallest of the surfaces."""
    return 0.5 * float(min(np.linalg.norm(np.ptp(s.points, axis=0)) for s in surfaces))


def facet_areas(surface: ContactSurface) -> Array:
    """Integral of the body's ``measure`` over each whole facet, shape (nf,) [area]."""
    at, w = _gauss(5)
    nf = len(surface.facets)
    density = area_element(surface, np.repeat(np.arange(nf), len(at)), np.tile(at, nf))
    return density.reshape(nf, -1) @ w


def area_element(surface: ContactSurface, facet: Index, xi: Array) -> Array:
    """``measure |dx/dxi|`` at points ``xi`` in [0, 1] of facets, shape (q,)."""
    nodes = surface.points[surface.facets[facet]]
    N, dN = facet_shapes(xi, nodes.shape[1])
    stretch = np.linalg.norm(_combine(dN, nodes), axis=1)
    measure = surface.body.measure
    return stretch if measure is None else stretch * measure(_combine(N, nodes).T)


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
    ends = [_project(nodes, normals, primary.points[primary.facets[f, side]]) for side in range(2)]
    start, stop = np.minimum(*ends), np.maximum(*ends)
    found = stop - start > SLIVER  # False for nan
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
    gap, facing = _relation(secondary, primary, e, f, 0.5 * (start + stop))
    closest = np.lexsort((np.abs(gap), piece))
    first = np.ones(len(closest), dtype=bool)
    first[1:] = np.diff(piece[closest]) > 0
    chosen = np.zeros(len(closest), dtype=bool)
    chosen[closest] = first
    near = (gap <= limits[0]) & (gap >= -limits[1])
    valid = chosen & (stop - start > SLIVER) & facing & near
    return e[valid], f[valid], start[valid], stop[valid]


def _project(nodes: Array, normals: Array, y: Array) -> Array:
    """Coordinate of points ``y`` on facets along their normal field, cut to [0, 1]; (p,).

    Seeks the zero of ``(y - x(xi)) . t(xi)`` with ``t`` the normal turned by 90 degrees: Newton
    steps inside a bracket. ``nan`` beyond the focus of a hollow facet, where normals have crossed.
    """

    def lateral(xi: Array, at: Index) -> tuple[Array, Array]:
        N, dN = facet_shapes(xi, nodes.shape[1])
        away = y[at] - _combine(N, nodes[at])
        along, bend = turned(_combine(N, normals[at])), turned(_combine(dN, normals[at]))
        slope = dot(away, bend) - dot(_combine(dN, nodes[at]), along)
        return dot(away, along), slope

    everyone = np.arange(len(y))
    before = lateral(np.zeros(len(y)), everyone)[0] <= 0
    behind = lateral(np.ones(len(y)), everyone)[0] >= 0
    xi = np.select([before & behind, before, behind], [np.nan, 0.0, 1.0], 0.5)
    at = np.flatnonzero(~before & ~behind)
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
        moving = np.abs(new - now) > np.where(newton, NEWTON_DONE, BISECTION_DONE)
        at, low, high = at[moving], low[moving], high[moving]
        if not len(at):
            break
    return xi


def _meet(secondary: ContactSurface, primary: ContactSurface, e: Index, f: Index, xi: Array) -> Array:
    """Coordinate on primary facets of the points that the normals at ``xi`` meet; (q,)."""
    x, normal = _position(secondary, e, xi)
    along = turned(normal)
    c = dot(primary.points[primary.facets[f]] - x[:, None], along[:, None])
    # a eta^2 + b eta + c0 between ends of opposite sign; the root in the form without loss
    c0, b = c[:, 0], c[:, 1] - c[:, 0]
    a = np.zeros(len(c))
    if c.shape[1] == 3:
        a = 2 * (c[:, 0] + c[:, 1]) - 4 * c[:, 2]
        b = b - a
    rising = np.where(c[:, 1] >= c[:, 0], 1.0, -1.0)  # the root where the polynomial does
    surd = rising * np.sqrt(np.maximum(b**2 - 4 * a * c0, 0.0))
    with np.errstate(divide="ignore", invalid="ignore"):
        eta = np.where(b * surd > 0, -2 * c0 / (b + surd), (surd - b) / (2 * a))
    return np.clip(np.nan_to_num(eta, nan=0.5), 0.0, 1.0)


def _relation(
    secondary: ContactSurface, primary: ContactSurface, e: Index, f: Index, xi: Array
) -> tuple[Array, NDArray[np.bool_]]:
    """Gap along the normal, and whether the surfaces face each other there."""
    x, normal = _position(secondary, e, xi)
    nodes = primary.points[primary.facets[f]]
    N, dN = facet_shapes(_meet(secondary, primary, e, f, xi), nodes.shape[1])
    outward = -turned(_combine(dN, nodes))
    size = np.linalg.norm(normal, axis=1)
    gap = dot(_combine(N, nodes) - x, normal) / size
    return gap, dot(normal, outward) < -FACING * size * np.linalg.norm(outward, axis=1)


def _position(surface: ContactSurface, facet: Index, xi: Array) -> tuple[Array, Array]:
    """Points of facets and the normal field there (not of unit length), shapes (q, d)."""
    N, _ = facet_shapes(xi, surface.facets.shape[1])
    return (
        _combine(N, surface.points[surface.facets[facet]]),
        _combine(N, surface.facet_node_normals[facet]),
    )


def _combine(N: Array, values: Array) -> Array:
    """Sum of nodal values with shape functions, (q, k) and (q, k, d) to (q, d)."""
    return np.einsum("qk,qkd->qd", N, values)
