r"""Fields on a contact surface between its nodes: interpolation, the edge of contact, its area.

**Where does contact end?** A node knows only whether it is closed, which leaves an uncertainty of
one facet. But next to the edge of any contact between smooth surfaces, at the distance ``r``, the
pressure vanishes like ``r**(1/2)`` and the gap opens like ``r**(3/2)``: the leading term of the
elastic field, whatever the bodies and loads. So ``gap**(2/3)`` is a straight line, and it is
drawn through the second and third open node (the first is so close to the edge that its gap is
mostly the error of the mesh); with fewer open nodes, through the first two, or midway. The edge
is looked for between half a facet inside the last closed node and the first open one. On Hertz
contact this is within .1 of the distance between nodes, wherever the edge lies.

Where contact ends because the other surface does, the last closed node is the edge. Ends of the
secondary surface that are closed are no edges.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.errors import InputError
from skfem_contact.pairing.projection import project
from skfem_contact.records import dataclass
from skfem_contact.trees import Tree

Array = NDArray[np.float64]
Index = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class Segments:
    """A surface in 2-D as segments from node to node: the facets, or halves of quadratic ones.

    Attributes
    ----------
    start, end : ndarray of int, shape (s,)
        Nodes.
    length : ndarray, shape (s,)
        Along the surface [length].
    area : ndarray, shape (s,)
        Length times the `measure` of the body [area].
    """

    start: Index
    end: Index
    length: Array
    area: Array

    @classmethod
    def of(cls, surface: ContactSurface) -> Segments:
        """The segments of a surface, in the order of its facets."""
        if surface.points.shape[1] != 2:
            raise InputError(
                f"surface {surface.label!r}: edges of contact, and estimates of errors that go by "
                "them, are not implemented in 3-D yet"
            )
        chain = surface.facets[:, [0, 1] if surface.facets.shape[1] == 2 else [0, 2, 1]]
        start, end = chain[:, :-1], chain[:, 1:]
        chord = np.linalg.norm(surface.points[end] - surface.points[start], axis=2)
        length = chord * (surface.lengths / chord.sum(axis=1))[:, None]
        middle = 0.5 * (surface.points[start] + surface.points[end])
        measure = surface.body.measure
        weight = 1.0 if measure is None else measure(np.moveaxis(middle, -1, 0))
        return cls(start.ravel(), end.ravel(), length.ravel(), (length * weight).ravel())

    def after(self, forward: bool, m: int) -> Index:
        """The segment that leaves each of m nodes along (or against) the surface; -1 where it ends."""
        segment = np.full(m, -1)
        segment[self.start if forward else self.end] = np.arange(len(self.start))
        return segment


@dataclass(frozen=True, eq=False)
class Edges:
    """Where contact ends.

    Attributes
    ----------
    inside, outside : ndarray of int, shape (k,)
        Closed node and its open neighbour.
    segment : ndarray of int, shape (k,)
        The segment between them.
    part : ndarray, shape (k,)
        Of the way from the closed to the open node, in [-0.5, 1].
    """

    inside: Index
    outside: Index
    segment: Index
    part: Array


def find_edges(segments: Segments, closed: NDArray[np.bool_], gap: Array) -> Edges:
    """Locate the edges of contact by the rule of this module.

    Parameters
    ----------
    segments : Segments
    closed : ndarray of bool, shape (m,)
    gap : ndarray, shape (m,)
        ``inf`` where a point has no partner [length].

    Examples
    --------
    A gap that opens as ``(x - 1.3)**(3/2)`` over nodes at 0, 1, 2, ...:

    >>> x = np.arange(6)
    >>> segments = Segments(x[:-1], x[1:], np.ones(5), np.ones(5))
    >>> edges = find_edges(segments, x < 2, np.maximum(x - 1.3, 0.0) ** 1.5)
    >>> print(edges.inside, edges.outside, edges.part.round(12))
    [1] [2] [0.3]
    """
    ways = [_edges_along(segments, closed, gap, forward) for forward in (True, False)]
    names = ("inside", "outside", "segment", "part")
    columns = {k: np.concatenate([getattr(way, k) for way in ways]) for k in names}
    order = np.lexsort((columns["outside"], columns["inside"]))
    return Edges(**{name: column[order] for name, column in columns.items()})


def _edges_along(segments: Segments, closed: NDArray[np.bool_], gap: Array, forward: bool) -> Edges:
    segment = segments.after(forward, len(closed))
    far_end = segments.end if forward else segments.start
    open_next = (segment >= 0) & ~closed[far_end[segment]]
    inside = np.flatnonzero(closed & open_next)
    # the nodes beyond, their distances from the closed one, and whether they are open and known
    node, reach, known = [inside], [np.zeros(len(inside))], [np.ones(len(inside), dtype=bool)]
    for _ in range(3):
        via = segment[node[-1]]
        node.append(far_end[via])
        reach.append(reach[-1] + segments.length[via])
        known.append(known[-1] & (via >= 0) & ~closed[node[-1]] & np.isfinite(gap[node[-1]]))
    height = [
        np.maximum(np.where(there, gap[n], 0.0), 0.0) ** (2 / 3)
        for n, there in zip(node, known, strict=True)
    ]
    place = np.where(known[1], 0.5 * reach[1], 0.0)
    for i, j in ((1, 2), (2, 3)):
        rise = height[j] - height[i]
        rises = known[j] & (rise > 0)
        run = np.divide(reach[j] - reach[i], rise, out=np.zeros(len(inside)), where=rises)
        place = np.where(rises, reach[i] - run * height[i], place)
    part = np.clip(place / reach[1], -0.5, 1.0)
    return Edges(inside, node[1], segment[inside], part)


def edge_positions(surface: ContactSurface, closed: NDArray[np.bool_], gap: Array) -> Array:
    """Positions of the edges of contact, in the order of the points of the surface, (k, d)."""
    edges = find_edges(Segments.of(surface), closed, gap)
    part = edges.part[:, None]
    return (1 - part) * surface.points[edges.inside] + part * surface.points[edges.outside]


def closed_area(surface: ContactSurface, closed: NDArray[np.bool_], gap: Array) -> float:
    """Area in contact, up to the edges [area]."""
    segments = Segments.of(surface)
    whole = closed[segments.start] & closed[segments.end]
    edges = find_edges(segments, closed, gap)
    return max(float(segments.area[whole].sum() + edges.part @ segments.area[edges.segment]), 0.0)


def interpolate(surface: ContactSurface, values: Array, points: Array) -> Array:
    """Nodal values at other points of a surface, by the shape functions of its facets.

    Parameters
    ----------
    surface : ContactSurface
    values : ndarray, shape (m, ...)
    points : ndarray, shape (p, d)
        Points on the surface; others are projected onto it.

    Returns
    -------
    ndarray, shape (p, ...)
    """
    points = np.atleast_2d(np.asarray(points, dtype=float))
    if points.ndim != 2 or points.shape[1] != surface.points.shape[1]:
        raise InputError(
            f"points have shape {points.shape}; give positions (p, {surface.points.shape[1]})"
        )
    few = min(4, len(surface.facets))
    middle = surface.points[surface.facets].mean(axis=1)
    near = np.asarray(Tree(middle).query(points, k=few)[1]).reshape(len(points), few)
    several = np.repeat(points, few, axis=0)
    feet = project(surface, near.ravel(), several)
    distance = np.linalg.norm(several - feet.foot, axis=1)
    best = np.arange(len(points)) * few + distance.reshape(-1, few).argmin(axis=1)
    facet, N = near.ravel()[best], feet.shape[best]
    return np.einsum("pk,pk...->p...", N, np.asarray(values)[surface.facets[facet]])


def displaced(surface: ContactSurface, points: Array) -> ContactSurface:
    """The surface with its nodes at other positions, for the functions above."""
    return replace(surface, points=points)
