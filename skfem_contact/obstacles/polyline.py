"""`RigidPolyline`: a rigid obstacle in the plane given by the points of its outline."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from skfem_contact.arguments import check_name, check_switch, numbers, take, with_known_keywords
from skfem_contact.arrays import Array, Index, Mask, sizes
from skfem_contact.bodies.selection import written
from skfem_contact.digits import COMPUTED, ROUND_OFF
from skfem_contact.errors import InputError
from skfem_contact.obstacles.bends import cut_edges
from skfem_contact.obstacles.obstacle import Faceted, volume
from skfem_contact.pairing.search import FacetTree, Nodes
from skfem_contact.records import dataclass
from skfem_contact.sealed import sealed


@with_known_keywords()
@dataclass(frozen=True, eq=False, init=False)
class RigidPolyline(Faceted):
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
    _kind = "rigid polyline"
    _cut_flats = staticmethod(cut_edges)

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
        vars(self).update(points=sealed(points), closed=closed)
        if closed and (volume(points, self.facets) < 0) != self.hollow:
            vars(self).update(points=sealed(points[::-1].copy()))

    @property
    def facets(self) -> Index:
        """Its edges by the numbers of their points, in order, (ne, 2)."""
        count = len(self.points)
        start = np.arange(count if self.closed else count - 1)
        return np.column_stack([start, (start + 1) % count])


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
    touching = ROUND_OFF * float(np.abs(points).max())
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


def _near_edges(start: Array, end: Array, touching: float) -> tuple[Index, Index]:
    """Pairs of edges near each other, all that meet among them; each once, the smaller number first."""
    radius = 0.5 * sizes(end - start) + touching
    middle = 0.5 * (start + end)

    def met(edge: Index, nodes: Nodes) -> Mask:
        reach = radius[edge] + nodes.radius + touching
        return np.asarray(sizes(middle[edge] - nodes.centre) <= reach)

    tree = FacetTree.over(np.minimum(start, end), np.maximum(start, end))
    i, j = (np.concatenate(part) for part in zip(*tree.descend(len(middle), met), strict=True))
    near = (i < j) & (sizes(middle[i] - middle[j]) <= radius[i] + radius[j])
    i, j = i[near], j[near]
    order = np.lexsort((j, i))
    return i[order], j[order]


def _cross(a: Array, b: Array, c: Array, d: Array, touching: float) -> NDArray[np.bool_]:
    """Return whether the edges from a to b and from c to d have a point in common, shape (p,).

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


def _turned_back(start: Array, end: Array, closed: bool, touching: float) -> Index:
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
