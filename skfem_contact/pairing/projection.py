r"""Closest points of single facets to points, and the normal field there.

The closest point of a facet x(xi) to a point p is stationary for ``|x(xi) - p|^2 / 2``. On a straight
line it is known at once. Else the quadratic model is minimised over the reference line, triangle or
square exactly, corners and edges included (a step that is cut back to a polygon need not go down), from
the nearest point of a lattice over the facet. Plane triangles take one step, warped and curved faces
some five.

The closest point is taken, and not the point that the normal field looks along: that is one only in a
neighbourhood of the surface, and is none or several around corners. The normal *at* the closest point
is interpolated between the averaged normals at corners, which is what keeps it continuous
(`pairing.node`). Both agree on smooth surfaces up to the square of the size of a facet.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from skfem_contact.arrays import Array, Index, Mask, across, cross, dot, ragged, sizes, turned, unit
from skfem_contact.bodies.facet_kinds import FacetKind, node_positions
from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.digits import COMPUTED, NEWTON_STEPS, SOLVED
from skfem_contact.records import dataclass

#: Which way along a line leads out of it, by the place on it: start, end, inside.
OUT = np.array([-1.0, 1.0, 0.0])
#: Of the squared length element, the least curvature of the model: beyond a centre of curvature the
#: true one is negative.
LEAST_CURVATURE = 0.1


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
    kind = surface.kind
    nodes, points = node_positions(surface.points, surface.facets[facet]), np.asfortranarray(points)
    xi = _closest(kind, nodes, points)
    place = _places(kind, xi)
    N, dN = kind.shapes(xi)
    foot = np.einsum("pk,pkd->pd", N, nodes)
    own = unit(across(np.einsum("pki,pkd->pid", dN, nodes)))
    apart = points - foot
    beside = apart - dot(apart, own)[:, None] * own
    over = np.where(place >= 0, sizes(beside), 0.0)
    return Feet(xi, N, foot, own, place, over)


def interpolated_normals(surface: ContactSurface, facet: Index, xi: Array) -> Array:
    """The continuous unit normal field on facets at reference coordinates (p, d-1), shape (p, d).

    Between the normals at the corners, also on quadratic facets.
    """
    corner = _some(surface.facet_node_normals[:, : surface.kind.corners], facet)
    return unit(np.einsum("pk,pkd->pd", surface.kind.linear.shapes(xi)[0], corner))


def _closest(kind: FacetKind, nodes: Array, points: Array) -> Array:
    """Reference coordinates (p, d-1) of the closest points of facets with nodes (p, k, d).

    All arrays are in Fortran order, see `node_positions`.
    """
    if kind.straight and kind.dim == 1:  # without shape functions, in a third of the time
        chord = nodes[:, 1] - nodes[:, 0]
        return np.clip(dot(points - nodes[:, 0], chord) / dot(chord, chord), 0.0, 1.0)[:, None]
    starts = kind.middle[None] if kind.straight else _lattice(kind, 4 if kind.quadratic else 2)
    where = np.einsum("sk,pkd->psd", kind.shapes(starts)[0], nodes, order="F")
    first = np.argmin(np.sum((where - points[:, None]) ** 2, axis=2), axis=1)
    xi = _some(starts, first)
    second = kind.curvatures
    bent = None if second is None else np.einsum("kij,pkd->pijd", second, nodes, order="F")
    left = np.arange(len(points))
    value = np.full(len(points), np.inf)
    # of points that nearly touch distances have few digits, and must not turn good steps back
    round_off = COMPUTED * np.abs(points).max(initial=0.0)
    step = np.zeros_like(xi)
    for _ in range(NEWTON_STEPS):
        x, at = _some(nodes, left), _some(xi, left)
        N, dN = kind.shapes(at)
        apart = np.einsum("pk,pkd->pd", N, x) - _some(points, left)
        now = np.sqrt(dot(apart, apart))
        worse = now > value[left] * (1 + COMPUTED) + round_off
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
        moved = np.abs(step[left]).max(axis=1) > COMPUTED  # steps square the error
        left = left[moved]
        if kind.straight or not len(left):
            break
    return xi


def _some(values: Array, chosen: Index) -> Array:
    """``values[chosen]`` in Fortran order."""
    return np.asarray(np.take(values.T, chosen, axis=-1).T)


@lru_cache
def _lattice(kind: FacetKind, parts: int) -> Array:
    """Reference coordinates all over a facet, its edges cut into some parts."""
    t = np.linspace(0.0, 1.0, parts + 1)
    xi = np.stack(np.meshgrid(*[t] * kind.dim), axis=-1).reshape(-1, kind.dim)
    return xi[xi.sum(axis=1) <= 1 + COMPUTED] if kind.triangle else xi


def _model_minimum(kind: FacetKind, xi: Array, apart: Array, along: Array, curved: Array) -> Array:
    """Find where in the reference facet Newton's model of the squared distance is least, (p, d-1)."""
    metric = np.einsum("pid,pjd->pij", along, along)
    bend = np.einsum("pd,pijd->pij", apart, curved)
    # as much of the second part as leaves a minimum: by its least eigenvalue in the metric
    least = _least_eigenvalue(metric, bend)
    share = np.where(
        least < LEAST_CURVATURE - 1.0,
        (1.0 - LEAST_CURVATURE) / np.maximum(-least, np.finfo(float).tiny),
        1.0,
    )
    H = metric + share[:, None, None] * bend
    g = np.einsum("pd,pid->pi", apart, along)
    if kind.dim == 1:
        return np.clip(xi - g / H[:, 0], 0.0, 1.0)
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


def _least_eigenvalue(metric: Array, bend: Array) -> Array:
    """The least eigenvalue of `bend` in the metric, (p, d-1, d-1) both, shape (p,)."""
    if metric.shape[1] == 1:
        return np.asarray(bend[:, 0, 0] / metric[:, 0, 0])
    det = metric[:, 0, 0] * metric[:, 1, 1] - metric[:, 0, 1] ** 2
    half = (
        0.5 * (metric[:, 1, 1] * bend[:, 0, 0] + metric[:, 0, 0] * bend[:, 1, 1])
        - metric[:, 0, 1] * bend[:, 0, 1]
    ) / det
    product = (bend[:, 0, 0] * bend[:, 1, 1] - bend[:, 0, 1] ** 2) / det
    return np.asarray(half - np.sqrt(np.maximum(half**2 - product, 0.0)))


def _beyond(kind: FacetKind, xi: Array) -> Array:
    """Return how far reference coordinates are beyond each edge of the reference facet, (p, c)."""
    if kind.dim == 1:
        return np.concatenate([-xi, xi - 1.0], axis=1)
    x, y = xi[:, 0], xi[:, 1]
    if kind.triangle:
        return np.stack([-y, x + y - 1.0, -x], axis=1)
    return np.stack([-y, x - 1.0, y - 1.0, -x], axis=1)


def _places(kind: FacetKind, xi: Array) -> Index:
    """-1 inside, i on edge i, c + i at the corner from which edge i starts, which `xi` then are."""
    c = kind.corners
    on = _beyond(kind, xi) > -SOLVED
    place = np.where(on.any(axis=1), np.argmax(on, axis=1), -1)
    if kind.dim == 1:
        return place
    corner = on & np.roll(on, 1, axis=1)
    at = np.flatnonzero(corner.any(axis=1))
    place[at] = c + np.argmax(corner[at], axis=1)
    xi[at] = kind.locations[place[at] - c]
    return place


def rim_points(surface: ContactSurface, mirrored: bool = True) -> Mask:
    """Nodes on edges where the surface ends, shape (m,).

    `mirrored`: also where it only ends on a plane of symmetry, square to it: the edge lies in a plane
    across an axis, that component of its nodes is prescribed, and their normals have none of it.
    """
    edges = surface.facets[:, surface.kind.edges][surface.twins < 0]
    if not mirrored:
        edges = edges[~surface.mirrored_rim.any(axis=1)]
    rim = np.zeros(len(surface.points), dtype=bool)
    rim[edges] = True
    return rim


@dataclass(frozen=True, eq=False)
class Joints:
    """The joints at the corners of faces, which tell whether a corner is the closest point of all.

    Attributes
    ----------
    first : ndarray of int, shape (m + 1,)
        Point i has the rows ``first[i]`` to ``first[i + 1]`` of `row`.
    row : ndarray of int, shape (nf c,)
        Numbers ``c f + i`` of the corners of faces at each point.
    leaving, arriving : ndarray, shape (nf c, 3)
        Unit vectors from the corner along the edges that start and that end there.
    outward : ndarray, shape (nf c, 2, 3)
        Across the edges that start and end there, out of the surface where it ends, and not on a plane
        of symmetry; else zero.
    """

    first: Index
    row: Index
    leaving: Array
    arriving: Array
    outward: Array

    @classmethod
    def of(cls, surface: ContactSurface) -> Joints:
        """Collect the corners of a surface by its points."""
        c = surface.kind.corners
        corners = surface.facets[:, :c]
        row = np.argsort(corners.ravel(), kind="stable")
        count = np.bincount(corners.ravel(), minlength=len(surface.points))
        start, end = edge_tangents(surface)
        leaving, arriving = start, -np.roll(end, 1, axis=1)
        normal = surface.own_normals[:, :c]
        rim = ((surface.twins < 0) & ~surface.mirror_edges.any(axis=2))[..., None]
        before = np.where(np.roll(rim, 1, axis=1), cross(-arriving, normal), 0.0)
        outward = np.stack([np.where(rim, cross(leaving, normal), 0.0), before], axis=2)
        return cls(
            np.concatenate([[0], np.cumsum(count)]),
            row,
            leaving.reshape(-1, 3),
            arriving.reshape(-1, 3),
            outward.reshape(-1, 2, 3),
        )

    def leads_off(self, point: Index, apart: Array, least: Array) -> Mask:
        """Return whether some face at points comes nearer than they, or the surface ends on the way.

        Parameters
        ----------
        point : ndarray of int, shape (p,)
            Points of the surface.
        apart : ndarray, shape (p, 3)
            From there to what they are the closest point to [length].
        least : ndarray, shape (p,)
            What counts as round-off [length].
        """
        count = self.first[point + 1] - self.first[point]
        row = self.row[ragged(self.first[point], count)]
        item = np.repeat(np.arange(len(point)), count)
        away = apart[item]
        along = np.maximum(dot(self.leaving[row], away), dot(self.arriving[row], away))
        beyond = np.einsum("rsd,rd->rs", self.outward[row], away).max(axis=1)
        off = np.zeros(len(point), dtype=bool)
        off[item[np.maximum(along, beyond) > least[item]]] = True
        return off


def edge_tangents(surface: ContactSurface) -> tuple[Array, Array]:
    """Unit vectors along each edge at its start and its end, each (nf, c, 3)."""
    kind, c = surface.kind, surface.kind.corners
    at = kind.locations[:c]
    way = np.roll(at, -1, axis=0) - at
    _, dN = kind.shapes(at)
    x = node_positions(surface.points, surface.facets)
    start = np.einsum("cki,ci,fkd->fcd", dN, way, x, order="F")
    end = np.einsum("cki,ci,fkd->fcd", np.roll(dN, -1, axis=0), way, x, order="F")
    return unit(start), unit(end)


def across_edges(surface: ContactSurface, feet: Feet, number: Index) -> tuple[Array, Array]:
    """Out of the facets across the edges that feet are on, and their own normals, at the feet.

    Parameters
    ----------
    surface : ContactSurface
    feet : Feet
        On edges.
    number : ndarray of int, shape (p,)
        The same edges in the facets across, ``c f + i`` of edge i of facet f.

    Returns
    -------
    outward, normal : ndarray, shape (p, d)
        Unit vectors.
    """
    kind, c = surface.kind, surface.kind.corners
    facet, edge = number // c, number % c
    if kind.dim == 1:
        normal = surface.own_normals[facet, edge]
        return OUT[edge][:, None] * turned(normal), normal
    at = kind.locations[:c]
    ways = np.roll(at, -1, axis=0) - at
    # the way along the edge is the same, from the other end
    part = dot(feet.xi - at[feet.place], ways[feet.place]) / np.sum(ways**2, axis=1)[feet.place]
    way = ways[edge]
    _, dN = kind.shapes(np.asfortranarray(at[edge] + (1.0 - part)[:, None] * way))
    along = np.einsum("pki,pkd->pid", dN, node_positions(surface.points, surface.facets[facet]))
    normal = unit(cross(along[:, 0], along[:, 1]))
    tangent = unit(np.einsum("pi,pid->pd", way, along))
    return cross(tangent, normal), normal
