"""`RigidPolyline`: a rigid obstacle in the plane given by the points of its outline."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from skfem_contact.arguments import check_name, check_switch, numbers, take, with_known_keywords
from skfem_contact.bodies.bare import bare_surface
from skfem_contact.bodies.kinks import end_slopes
from skfem_contact.bodies.selection import written
from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.digits import COMPUTED, SOLVED
from skfem_contact.errors import InputError
from skfem_contact.obstacles.obstacle import Outlined
from skfem_contact.pairing.closest import signed_distances
from skfem_contact.pairing.node import Pairing, node_to_segment
from skfem_contact.sealed import sealed
from skfem_contact.trees import Tree

Array = NDArray[np.float64]

#: Part of a straight edge over which its normals turn towards a smooth bend at its end. Longer, and
#: friction on flats leans by the bend; shorter, and points that pass it meet a corner.
ROUNDED = 1 / 8

#: Distance over the largest coordinate at which two points may be one: coordinates that were turned
#: and moved are wrong by a few halves of their last digit.
SAME_PLACE = 8 * 2.0**-52


@with_known_keywords()
@dataclass(frozen=True, eq=False, init=False)
class RigidPolyline(Outlined):
    """A rigid obstacle in the plane with straight edges between points.

    Surfaces find their partners on it as they do on meshes: normals are continuous where edges meet
    at less than 45 degrees; else there is a corner, which also presses between two
    nodes. Corners of the body meet its edges. Edges that turn alike at both ends, by 22.5 degrees at
    most and two of them at least, stand for a curve, and normals turn all along them. Other edges are
    straight, such as a flat between two chamfers: normals turn within an eighth of them at their ends.

    Parameters
    ----------
    points : array, shape (n, 2)
        In order along the outline, with the solid on the left; of a closed one in either direction.
        It is closed if the first point is repeated at the end [length].
    closed : bool, optional
        Whether it goes back from the last point to the first.
    hollow : bool, optional
        Of a closed one: the body is inside.
    name : str, optional

    Raises
    ------
    InputError
        Too few points, edges without length, outlines that cross themselves.

    Notes
    -----
    Beyond the ends of an open polyline there is nothing to meet: where its end may touch, close it.

    Examples
    --------
    A wedge that points downwards:

    >>> wedge = RigidPolyline([(0, 0), (1, 2), (-1, 2)], closed=True, name="wedge")
    >>> wedge.moved((0.0, -0.5)).points.tolist()
    [[0.0, -0.5], [1.0, 1.5], [-1.0, 1.5]]
    >>> wedge.signed_distance([(0.0, 1.5), (0.0, -1.0)]).round(6).tolist()
    [-0.5, 1.0]
    """

    points: Array
    closed: bool = False
    hollow: bool = False
    name: str | None = None
    _dim = 2

    def __init__(
        self, points: ArrayLike, closed: bool = False, hollow: bool = False, name: str | None = None
    ) -> None:
        take(self, points=points, closed=closed, hollow=hollow, name=name)

    def __post_init__(self) -> None:
        check_name(self.name, "name of a RigidPolyline")
        for key in ("closed", "hollow"):
            check_switch(getattr(self, key), f"RigidPolyline: {key}")
        points, closed = _points(self.points, self.closed, self.label)
        if self.hollow and not closed:
            raise InputError(
                f"hollow=True of {self.label!r}: an open polyline has no inside; list its points with "
                "the solid on the left"
            )
        _check_edges(points, closed, self.label)
        if closed and (_area(points) < 0) != self.hollow:
            points = points[::-1].copy()
        for key, value in (("points", sealed(points)), ("closed", closed)):
            object.__setattr__(self, key, value)

    @cached_property
    def outline(self) -> ContactSurface:
        """Its edges with their normals, as surfaces of bodies have them.

        Edges that are no pieces of a curve are cut near their ends, see `_cut_at_bends`.
        """
        count = len(self.points)
        start = np.arange(count if self.closed else count - 1)
        plain = bare_surface(self.points, np.column_stack([start, (start + 1) % count]), self.label)
        points = _cut_at_bends(plain)
        if len(points) == count:
            return plain
        start = np.arange(len(points) if self.closed else len(points) - 1)
        return bare_surface(points, np.column_stack([start, (start + 1) % len(points)]), self.label)

    @property
    def reference(self) -> Array:
        """The centroid of its area; of an open one, of the curve."""
        start, end = self._ends
        if self.closed:
            twice = start[:, 0] * end[:, 1] - start[:, 1] * end[:, 0]
            return np.asarray((start + end).T @ twice / (3 * twice.sum()))
        length = np.linalg.norm(end - start, axis=1)
        return np.asarray(0.5 * (start + end).T @ length / length.sum())

    @property
    def _ends(self) -> tuple[Array, Array]:
        start, end = self.outline.facets.T
        return self.outline.points[start], self.outline.points[end]

    def _partners(self, surface: ContactSurface) -> Pairing:
        return node_to_segment(surface, self.outline)

    def _signed_distances(self, points: Array) -> Array:
        return signed_distances(self.outline, points)


def _cut_at_bends(plain: ContactSurface) -> Array:
    """The points of an outline, and more of them on straight edges, beside smooth bends.

    Normals are interpolated between the nodes of an edge. On a piece of a curve that is right. The flat
    of a tool with chamfers is none: over all of its length forces would lean by up to half of the angle
    of the chamfer. There normals turn over a short piece at the end of the edge.
    """
    before, after = plain.neighbours.T
    own, there = plain.facet_normals, plain.facet_node_normals
    slopes = end_slopes(plain.points, plain.facets, there)
    alike = np.abs(slopes).max(axis=1) > 0
    # a flat between two chamfers turns alike at both ends, too, but has no like beside it
    inner = alike & ((alike[before] & (before >= 0)) | (alike[after] & (after >= 0)))
    last = (before < 0) & inner[after] | (after < 0) & inner[before]
    straight = ~(inner | last)
    # averaged with a neighbour, and not in line with it
    bent = np.linalg.norm(there - own[:, None], axis=2) > SOLVED
    cut = bent & straight[:, None]
    if not cut.any():
        return plain.points
    lengths = plain.lengths[:, None]
    room = np.minimum(ROUNDED * lengths, 0.5 * plain.lengths[plain.neighbours])
    start, end = plain.points[plain.facets[:, 0]], plain.points[plain.facets[:, 1]]
    along = (end - start) / lengths
    points = []
    for k in range(len(start)):  # an outline has few edges that are cut
        points.append(start[k])
        if cut[k, 0]:
            points.append(start[k] + room[k, 0] * along[k])
        if cut[k, 1]:
            points.append(end[k] - room[k, 1] * along[k])
    if before[0] < 0:
        points.append(end[-1])
    return np.array(points)


def _points(given: Any, closed: bool, label: str) -> tuple[Array, bool]:
    usage = "give at least 2 finite points (n, 2), 3 of a closed polyline"
    points = numbers(given, f"points of {label!r}", usage)
    if points.ndim == 2 and len(points) > 1 and np.array_equal(points[0], points[-1]):
        points, closed = points[:-1], True
    shape = points.ndim == 2 and points.shape[1:] == (2,) and len(points) >= (3 if closed else 2)
    if not shape or not np.isfinite(points).all():
        raise InputError(f"points of {label!r} have shape {points.shape}, or are not finite; {usage}")
    return points, closed


def _check_edges(points: Array, closed: bool, label: str) -> None:
    end = np.roll(points, -1, axis=0) if closed else points[1:]
    start = points if closed else points[:-1]
    length = np.linalg.norm(end - start, axis=1)
    short = np.flatnonzero(length <= COMPUTED * np.max(np.ptp(points, axis=0)))
    if len(short):
        raise InputError(
            f"{len(short)} edges of {label!r} have no length, the first from point {short[0]} at "
            f"{written(points[short[0]])}; leave out points that are given twice"
        )
    touching = SAME_PLACE * float(np.abs(points).max())
    i, j = _near_edges(start, end, touching)
    apart = (j - i > 1) & ~(closed & (i == 0) & (j == len(start) - 1))
    i, j = i[apart], j[apart]
    crossing = np.flatnonzero(_cross(start[i], end[i], start[j], end[j], touching))
    if len(crossing):
        k = crossing[0]
        raise InputError(
            f"{label!r} crosses itself: the edge from point {i[k]} at {written(start[i[k]])} and the "
            f"one from point {j[k]} at {written(start[j[k]])}; an outline has one inside. List the "
            "points in their order along it."
        )
    back = _turned_back(start, end, closed, touching)
    if len(back):
        raise InputError(
            f"{label!r} goes back on itself at point {back[0]} at {written(points[back[0]])}: there it "
            "has no inside"
        )


def _near_edges(start: Array, end: Array, touching: float) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Pairs of edges whose circles meet, each once, the smaller number first."""
    radius = 0.5 * np.linalg.norm(end - start, axis=1) + touching
    middle = 0.5 * (start + end)
    # long edges are asked one by one: their circle is no guide for the short ones
    tree = Tree(middle)
    found = tree.query_ball_point(middle, radius + radius.max())
    i = np.repeat(np.arange(len(middle)), [len(some) for some in found])
    j = np.concatenate([np.asarray(some, dtype=np.intp) for some in found])
    near = (i < j) & (np.linalg.norm(middle[i] - middle[j], axis=1) <= radius[i] + radius[j])
    return i[near], j[near]


def _cross(a: Array, b: Array, c: Array, d: Array, touching: float) -> NDArray[np.bool_]:
    """Whether the edges from a to b and from c to d have a point in common, shape (p,).

    Points that are known to `touching` [length] only are on a line that they are no farther off.
    """

    def side(p: Array, q: Array, r: Array) -> Array:
        along, to = q - p, r - p
        across = along[:, 0] * to[:, 1] - along[:, 1] * to[:, 0]
        unsure = touching * (np.linalg.norm(along, axis=1) + np.linalg.norm(to, axis=1))
        return np.where(np.abs(across) > unsure, np.sign(across), 0.0)

    low = np.maximum(np.minimum(a, b), np.minimum(c, d))
    high = np.minimum(np.maximum(a, b), np.maximum(c, d))
    boxes = np.all(low <= high + touching, axis=1)
    apart = side(a, b, c) * side(a, b, d) > 0
    return np.asarray(boxes & ~apart & ~(side(c, d, a) * side(c, d, b) > 0))


def _turned_back(start: Array, end: Array, closed: bool, touching: float) -> NDArray[np.intp]:
    """Points at which an edge returns along the one before."""
    length = np.linalg.norm(end - start, axis=1)
    along = (end - start) / length[:, None]
    before = np.roll(along, 1, axis=0)
    across = before[:, 0] * along[:, 1] - before[:, 1] * along[:, 0]
    # ends that are known to `touching` say so much less of the direction of a short edge
    unsure = touching * (1 / length + 1 / np.roll(length, 1))
    back = (np.abs(across) <= COMPUTED + unsure) & (np.einsum("ed,ed->e", before, along) < 0)
    back[0] &= closed
    return np.flatnonzero(back)


def _area(points: Array) -> float:
    x, y = points.T
    return float(0.5 * np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y))
