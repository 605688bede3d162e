r"""Closest points of single facets to points, and the normal field there.

The closest point of a facet x(xi) to a point p is stationary for ``|x(xi) - p|^2 / 2``. On a straight
line it is known at once, on a quadratic one Newton's steps are cut back to the ends. On faces the
quadratic model is minimised over the reference triangle or square exactly, corners and edges included
(a step that is cut back to a polygon need not go down), from the nearest point of a lattice over the
face. Plane triangles take one step, warped and curved faces some five.

The closest point is taken, and not the point that the normal field looks along: that is one only in a
neighbourhood of the surface, and is none or several around corners. The normal *at* the closest point
is interpolated between the averaged normals at corners, which is what keeps it continuous
(`pairing.node`). Both agree on smooth surfaces up to the square of the size of a facet.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from skfem_contact.bodies.facet_kinds import FacetKind, node_positions
from skfem_contact.bodies.normals import across, cross, unit
from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.bodies.thresholds import LEAST_SLOPE, NEAREST
from skfem_contact.digits import SOLVED
from skfem_contact.pairing.thresholds import SETTLED
from skfem_contact.pairing.vectors import dot
from skfem_contact.records import dataclass

Array = NDArray[np.float64]
Index = NDArray[np.intp]

#: Which way along a line leads out of it, by the place on it: start, end, inside.
OUT = np.array([-1.0, 1.0, 0.0])
#: Newton steps at most; warped faces take five, and what lies beyond centres of curvature more.
STEPS = 30
#: Round-off of distances, below which a step has not led away: of themselves, and of coordinates.
SAME_DISTANCE, SAME_PLACE = 5e-15, 1e-15
#: Of the squared length element, the least curvature of the model: beyond a centre of curvature the
#: true one is negative.
LEAST = 0.1


@dataclass(frozen=True, eq=False)
class Feet:
    """Closest points of p facets to p points.

    Attributes
    ----------
    xi : ndarray, shape (p, d-1)
        Reference coordinates.
    shape : ndarray, shape (p, k)
        Shape functions there.
    foot : ndarray, shape (p, d)
        The closest points [length].
    own : ndarray, shape (p, d)
        Outward unit normals of the facets themselves there.
    place : ndarray of int, shape (p,)
        Where on the facet: -1 inside, i on edge i, c + i at corner i of c. The edges of a line are its
        start and its end.
    over : ndarray, shape (p,)
        By how much the point lies beyond the edge or corner, along the facet [length]; else 0.
    """

    xi: Array
    shape: Array
    foot: Array
    own: Array
    place: Index
    over: Array

    def some(self, chosen: Index) -> Feet:
        """These feet, in this order."""
        return Feet(*(value[chosen] for value in vars(self).values()))


def project(surface: ContactSurface, facet: Index, points: Array) -> Feet:
    """Closest points of facets to points, one facet for each point.

    Parameters
    ----------
    surface : ContactSurface
    facet : ndarray of int, shape (p,)
    points : ndarray, shape (p, d)
    """
    if surface.dim == 2:
        return _on_lines(surface, facet, points)
    kind = surface.kind
    nodes, points = node_positions(surface.points, surface.facets[facet]), np.asfortranarray(points)
    xi = _closest(kind, nodes, points)
    place = _places(kind, xi)
    xi = _snapped(kind, xi, place)
    N, dN = kind.shapes(xi)
    foot = np.einsum("pk,pkd->pd", N, nodes)
    along = np.einsum("pki,pkd->pid", dN, nodes)
    own = cross(along[:, 0], along[:, 1])
    own /= np.linalg.norm(own, axis=1, keepdims=True)
    apart = points - foot
    beside = apart - dot(apart, own)[:, None] * own
    over = np.where(place >= 0, np.linalg.norm(beside, axis=1), 0.0)
    return Feet(xi, N, foot, own, place, over)


def interpolated_normals(surface: ContactSurface, facet: Index, xi: Array) -> Array:
    """The continuous unit normal field on facets at reference coordinates (p, d-1), shape (p, d).

    Between the normals at the corners, also on quadratic facets.
    """
    if surface.dim == 2:
        ends = surface.facet_node_normals.take(facet, axis=0)
        return unit((1 - xi) * ends[:, 0] + xi * ends[:, 1])
    corner = _some(surface.facet_node_normals[:, : surface.kind.corners], facet)
    normal = np.einsum("pk,pkd->pd", surface.kind.linear.shapes(xi)[0], corner)
    return normal / np.linalg.norm(normal, axis=1, keepdims=True)


def _on_lines(surface: ContactSurface, facet: Index, points: Array) -> Feet:
    """Closest points of lines: on straight ones without shape functions, in a third of the time."""
    # `take` gathers rows in a tenth of the time of an index
    nodes = surface.points.take(surface.facets.take(facet, axis=0), axis=0)
    chord = nodes[:, 1] - nodes[:, 0]
    t = np.clip(dot(points - nodes[:, 0], chord) / dot(chord, chord), 0.0, 1.0)
    if surface.quadratic:
        t = _newton(surface.kind, nodes, points, t)
        N, dN = surface.kind.shapes(t[:, None])
        foot = np.einsum("pk,pkd->pd", N, nodes)
        along = np.einsum("pk,pkd->pd", dN[..., 0], nodes)
    else:
        N, along = np.stack([1 - t, t], axis=1), chord
        foot = N[:, :1] * nodes[:, 0] + N[:, 1:] * nodes[:, 1]
    along = unit(along)
    place = (t >= 1).astype(np.intp) - ((t > 0) & (t < 1))
    over = np.maximum(OUT[place] * dot(points - foot, along), 0.0)
    return Feet(t[:, None], N, foot, across(along[:, None]), place, over)


def _newton(kind: FacetKind, nodes: Array, points: Array, xi: Array) -> Array:
    """Minimise the distance to quadratic lines: projected Newton steps, best of six starts; (p,)."""
    fixed = np.broadcast_to(np.linspace(0.0, 1.0, 5)[:, None], (5, len(xi)))
    starts = np.vstack([fixed, xi])
    where = np.einsum("spk,pkd->spd", kind.shapes(starts[..., None])[0], nodes)
    best = np.argmin(np.sum((where - points) ** 2, axis=2), axis=0)
    xi = starts[best, np.arange(len(xi))]
    second = 4 * nodes[:, 0] + 4 * nodes[:, 1] - 8 * nodes[:, 2]
    for _ in range(12):
        N, dN = kind.shapes(xi[:, None])
        apart = np.einsum("pk,pkd->pd", N, nodes) - points
        first = np.einsum("pk,pkd->pd", dN[..., 0], nodes)
        squared = dot(first, first)
        # beyond the centre of curvature the second derivative is negative: keep descending
        slope = np.maximum(squared + dot(apart, second), LEAST_SLOPE * squared)
        new = np.clip(xi - dot(apart, first) / slope, 0.0, 1.0)
        change, xi = np.abs(new - xi).max(initial=0.0), new
        if change <= NEAREST:
            break
    return xi


def _closest(kind: FacetKind, nodes: Array, points: Array) -> Array:
    """Reference coordinates (p, 2) of the closest points of faces with nodes (p, k, 3).

    All arrays are in Fortran order, see `node_positions`.
    """
    starts = kind.middle[None] if kind.straight else _lattice(kind, 4 if kind.quadratic else 2)
    where = np.einsum("sk,pkd->psd", kind.shapes(starts)[0], nodes, order="F")
    first = np.argmin(np.sum((where - points[:, None]) ** 2, axis=2), axis=1)
    xi = _some(starts, first)
    second = kind.curvatures
    bent = None if second is None else np.einsum("kij,pkd->pijd", second, nodes, order="F")
    left = np.arange(len(points))
    value = np.full(len(points), np.inf)
    # of points that nearly touch distances have few digits, and must not turn good steps back
    round_off = SAME_PLACE * np.abs(points).max(initial=0.0)
    step = np.zeros_like(xi)
    for _ in range(STEPS):
        x, at = _some(nodes, left), _some(xi, left)
        N, dN = kind.shapes(at)
        apart = np.einsum("pk,pkd->pd", N, x) - _some(points, left)
        now = np.sqrt(dot(apart, apart))
        worse = now > value[left] * (1 + SAME_DISTANCE) + round_off
        if worse.any():  # back by half of the way; the model was too flat
            back = left[worse]
            step[back] *= 0.5
            xi[back] -= step[back]
            good = np.flatnonzero(~worse)
            x, at, dN, apart = (_some(part, good) for part in (x, at, dN, apart))
            now = now[good]
        on = left[~worse]
        value[on] = now
        along = np.einsum("pki,pkd->pid", dN, x)
        curved = np.einsum("pkij,pkd->pijd", kind.second(at), x) if bent is None else _some(bent, on)
        step[on] = _model_minimum(kind, at, apart, along, curved) - at
        xi[on] += step[on]
        moved = np.abs(step[left]).max(axis=1) > SETTLED
        left = left[moved]
        if kind.straight or not len(left):
            break
    return xi


def _some(values: Array, chosen: Index) -> Array:
    """``values[chosen]`` in Fortran order."""
    return np.asarray(np.take(values.T, chosen, axis=-1).T)


def _lattice(kind: FacetKind, parts: int) -> Array:
    """Reference coordinates all over a face, its edges cut into some parts."""
    t = np.linspace(0.0, 1.0, parts + 1)
    xi = np.stack(np.meshgrid(t, t), axis=-1).reshape(-1, 2)
    return xi[xi.sum(axis=1) <= 1 + SETTLED] if kind.triangle else xi


def _model_minimum(kind: FacetKind, xi: Array, apart: Array, along: Array, curved: Array) -> Array:
    """Find where in the reference polygon Newton's model of the squared distance is least, (p, 2)."""
    metric = np.einsum("pid,pjd->pij", along, along)
    bend = np.einsum("pd,pijd->pij", apart, curved)
    # as much of the second part as leaves a minimum: by its least eigenvalue in the metric
    det = metric[:, 0, 0] * metric[:, 1, 1] - metric[:, 0, 1] ** 2
    half = (
        0.5 * (metric[:, 1, 1] * bend[:, 0, 0] + metric[:, 0, 0] * bend[:, 1, 1])
        - metric[:, 0, 1] * bend[:, 0, 1]
    ) / det
    product = (bend[:, 0, 0] * bend[:, 1, 1] - bend[:, 0, 1] ** 2) / det
    least = half - np.sqrt(np.maximum(half**2 - product, 0.0))
    share = np.where(least < LEAST - 1.0, (1.0 - LEAST) / np.maximum(-least, np.finfo(float).tiny), 1.0)
    H = metric + share[:, None, None] * bend
    g = np.einsum("pd,pid->pi", apart, along)

    det = H[:, 0, 0] * H[:, 1, 1] - H[:, 0, 1] ** 2
    free = np.stack(
        [H[:, 0, 1] * g[:, 1] - H[:, 1, 1] * g[:, 0], H[:, 0, 1] * g[:, 0] - H[:, 0, 0] * g[:, 1]],
        axis=1,
    )
    best = xi + free / det[:, None]
    outside = np.flatnonzero(_beyond(kind, best).max(axis=1) > 0)
    if not len(outside):
        return best
    at, H, g = xi[outside], H[outside], g[outside]
    corners = kind.locations[: kind.corners]
    lowest = np.full(len(at), np.inf)
    for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        way = b - a
        slope = (g + np.einsum("pij,pj->pi", H, a - at)) @ way
        t = np.clip(-slope / np.einsum("i,pij,j->p", way, H, way), 0.0, 1.0)
        place = a + t[:, None] * way
        step = place - at
        value = np.einsum("pi,pi->p", g, step) + 0.5 * np.einsum("pi,pij,pj->p", step, H, step)
        lower = value < lowest
        best[outside[lower]], lowest[lower] = place[lower], value[lower]
    return best


def _beyond(kind: FacetKind, xi: Array) -> Array:
    """Return how far reference coordinates are beyond each edge of the reference polygon, (p, c)."""
    x, y = xi[:, 0], xi[:, 1]
    if kind.triangle:
        return np.stack([-y, x + y - 1.0, -x], axis=1)
    return np.stack([-y, x - 1.0, y - 1.0, -x], axis=1)


def _places(kind: FacetKind, xi: Array) -> Index:
    """-1 inside, i on edge i, c + i at the corner from which edge i starts."""
    c = kind.corners
    on = _beyond(kind, xi) > -SOLVED
    edge = np.where(on.any(axis=1), np.argmax(on, axis=1), -1)
    corner = on & np.roll(on, 1, axis=1)
    return np.where(corner.any(axis=1), c + np.argmax(corner, axis=1), edge)


def _snapped(kind: FacetKind, xi: Array, place: Index) -> Array:
    """Coordinates of corners exactly."""
    at = place >= kind.corners
    xi[at] = kind.locations[place[at] - kind.corners]
    return xi
