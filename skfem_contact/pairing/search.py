"""Which facets can hold a partner? One tree over the facets of a surface, and two questions to it.

Facets are listed along their surface, so pairs, fours, eights, ... of consecutive facets are
compact and make a binary tree without any sorting. Each node of the tree knows a ball around its
facets and the range of directions in which their closest points can be seen from.

`closest_candidates` asks for the facets that can hold the closest point to a given one. A point is at
a stationary distance from a facet only if the line of sight lies in the range of directions, so nearly
all of the surface is discarded at once, near and far. `normal_candidates` asks for the facets that
normal lines of another surface can meet: those whose ball reaches into the strip of normals of a facet.
Both are exact: nothing is discarded that could be a partner.

D. Johnson, E. Cohen: Spatialized normal cone hierarchies. Proc. I3D (2001) 129-134.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from skfem_contact.bodies.normals import sizes
from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.bodies.thresholds import CORNER
from skfem_contact.pairing.thresholds import FEW_PAIRS, MARGIN, PAIRS_AT_ONCE
from skfem_contact.pairing.vectors import dot, turned

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Mask = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Nodes:
    """Nodes of the tree: balls around their facets, and cones of directions.

    The closest points of the facets look along directions within `spread` of `angle` [rad], or
    exactly opposite. ``centre`` is (k, 2), the others are (k,).
    """

    centre: Array
    radius: Array
    angle: Array
    spread: Array

    def at(self, node: Index) -> Nodes:
        """These nodes, in this order."""
        # `take` gathers rows in a tenth of the time of an index
        parts = (self.centre, self.radius, self.angle, self.spread)
        return Nodes(*(part.take(node, axis=0) for part in parts))


@dataclass(frozen=True, eq=False)
class FacetTree:
    """Nodes of 1, 2, 4, ... consecutive facets; ``levels[0]`` are the facets."""

    levels: tuple[Nodes, ...]

    @classmethod
    def build(cls, surface: ContactSurface, count: int) -> FacetTree:
        """Build the hierarchy over the facets of a surface, as high as `count` items need it.

        Where all nodes of a level can be asked about every item at once, levels above save nothing.
        """
        lower, upper = _boxes(surface)
        angle, spread = _cones(surface)
        levels = [Nodes(*ball_of(lower, upper), angle, spread)]
        while len(lower) > 1 and count * len(lower) > FEW_PAIRS:
            left, right = children(len(lower))
            lower = np.minimum(lower[left], lower[right])
            upper = np.maximum(upper[left], upper[right])
            angle, spread = _merge(angle[left], spread[left], angle[right], spread[right])
            levels.append(Nodes(*ball_of(lower, upper), angle, spread))
        return cls(tuple(levels))

    def descend(
        self, count: int, meets: Callable[[Index, Nodes], Mask]
    ) -> Iterator[tuple[Index, Index]]:
        """Yield pairs (item, facet) whose nodes are all met, from the top down.

        Parameters
        ----------
        count : int
            Items 0, 1, ... descend together.
        meets : callable
            ``meets(item, nodes)``: whether items may have to do with the facets below nodes, k of each.

        Yields
        ------
        item, facet : ndarray of int
        """
        yield from descend(self.levels, count, meets)


class Level(Protocol):
    """Nodes of one level of a tree; those of the next level have the numbers ``2 i``, ``2 i + 1``."""

    @property
    def radius(self) -> Array:
        """Of the balls, (n,) [length]."""
        ...

    def at(self: L, node: Index) -> L:
        """These nodes, in this order."""
        ...


L = TypeVar("L", bound=Level)


def descend(
    levels: Sequence[L], count: int, meets: Callable[[Index, L], Mask]
) -> Iterator[tuple[Index, Index]]:
    """Yield pairs (item, leaf) all of whose nodes are met; `FacetTree.descend` for any tree.

    Parameters
    ----------
    levels : sequence
        Leaves first, the top last.
    count : int
    meets : callable
    """
    top, widest = len(levels) - 1, len(levels[-1].radius)
    at_once = max(1, PAIRS_AT_ONCE // widest)
    stack = []
    for some in np.split(np.arange(count), range(at_once, count, at_once)):
        stack.append((top, np.repeat(some, widest), np.tile(np.arange(widest), len(some))))
    while stack:
        level, item, node = stack.pop()
        keep = meets(item, levels[level].at(node))
        item, node = item[keep], node[keep]
        if level == 0:
            yield item, node
            continue
        item, node = np.repeat(item, 2), np.stack([2 * node, 2 * node + 1], axis=1).ravel()
        there = node < len(levels[level - 1].radius)
        item, node = item[there], node[there]
        pieces = max(1, -(-len(item) // PAIRS_AT_ONCE))
        stack.extend(
            (level - 1, i, n)
            for i, n in zip(np.array_split(item, pieces), np.array_split(node, pieces), strict=True)
        )


def closest_candidates(
    tree: FacetTree,
    points: Array,
    looks: Array,
    *,
    facing: float,
    bound: Array,
    outside: float,
    inside: float,
) -> Iterator[tuple[Index, Index]]:
    """Yield pairs (point, facet) among which all stationary closest points are.

    Parameters
    ----------
    tree : FacetTree
    points, looks : ndarray, shape (m, 2)
        Points, and the unit directions they look along.
    facing : float
        Largest angle [rad] between the line of sight and the opposite of a facet's normal.
    bound : ndarray, shape (m,)
        Facets farther away than this need not be found [length].
    outside, inside : float
        Largest distance on the side of the normal, and on the side of the body [length].
    """
    opposite = np.arctan2(-looks[:, 1], -looks[:, 0])

    def in_sight(point: Index, nodes: Nodes) -> Mask:
        sight = points.take(point, axis=0) - nodes.centre
        distance = np.hypot(sight[:, 0], sight[:, 1])
        found = distance - nodes.radius <= bound[point]
        close = np.flatnonzero(found)  # angles take longer
        found[close] = in_cone(point[close], nodes.at(close), sight[close], distance[close])
        return found

    def in_cone(point: Index, nodes: Nodes, sight: Array, distance: Array) -> Mask:
        near = distance - nodes.radius
        direction = np.arctan2(sight[:, 1], sight[:, 0])
        # the directions in which the ball is seen; everywhere from within
        parallax = np.arcsin(np.minimum(nodes.radius / np.maximum(distance, nodes.radius), 1.0))
        within = near <= 0
        turn = np.abs(_wrap(direction - nodes.angle))
        limit = nodes.spread + parallax + MARGIN
        in_front = (turn <= limit) & (near <= outside)
        behind = (np.pi - turn <= limit) & (near <= inside)
        faces = np.abs(_wrap(opposite[point] - nodes.angle)) <= nodes.spread + facing
        return faces & (within | in_front | behind)

    return tree.descend(len(points), in_sight)


def normal_candidates(
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
    centre, radius = ball_of(*_boxes(secondary))
    ends = secondary.points[secondary.facets[:, :2]]
    along = turned(secondary.facet_node_normals[:, :2])
    along = along / np.linalg.norm(along, axis=2, keepdims=True)

    def in_strip(e: Index, nodes: Nodes) -> Mask:
        past_start = dot(nodes.centre - ends[e, 0], along[e, 0]) >= -nodes.radius
        before_end = dot(nodes.centre - ends[e, 1], along[e, 1]) <= nodes.radius
        distance = np.linalg.norm(nodes.centre - centre[e], axis=1)
        return past_start & before_end & (distance <= reach + radius[e] + nodes.radius)

    found = FacetTree.build(primary, len(secondary.facets)).descend(len(secondary.facets), in_strip)
    e, f = (np.concatenate(column) for column in zip(*found, strict=True))
    order = np.lexsort((f, e))
    return e[order], f[order]


def children(count: int) -> tuple[np.ndarray, np.ndarray]:
    left = np.arange(0, count, 2)
    return left, np.minimum(left + 1, count - 1)


def _boxes(surface: ContactSurface) -> tuple[np.ndarray, np.ndarray]:
    corners = surface.points.take(surface.facets, axis=0)
    if surface.quadratic:
        # a quadratic curve lies in the hull of its ends and its Bezier control point
        corners = corners.copy()
        corners[:, 2] = 2 * corners[:, 2] - 0.5 * (corners[:, 0] + corners[:, 1])
    return corners.min(axis=1), corners.max(axis=1)


def ball_of(lower: np.ndarray, upper: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    radius = 0.5 * sizes(upper - lower)
    return 0.5 * (lower + upper), radius * (1 + MARGIN)


def _cones(surface: ContactSurface) -> tuple[np.ndarray, np.ndarray]:
    """Directions in which closest points on each facet look, its ends included.

    The normal of a quadratic facet turns monotonically between its ends. At a smooth joint the
    cone reaches over to the neighbour's normal; at a corner it opens by 45 degrees.
    """
    normals = surface.facet_normals
    angle = np.arctan2(normals[:, 1], normals[:, 0])
    spread = np.zeros(len(angle))
    for side in (0, 1):
        own = surface.own_normals[:, side]
        other = surface.neighbours[:, side]
        there = surface.own_normals[other, 1 - side]
        sharp = np.einsum("fd,fd->f", own, there) < CORNER
        at_end = np.abs(_wrap(np.arctan2(own[:, 1], own[:, 0]) - angle))
        beyond = np.abs(_wrap(np.arctan2(there[:, 1], there[:, 0]) - angle))
        reach = np.where(sharp, at_end + np.pi / 4, np.maximum(at_end, beyond))
        spread = np.maximum(spread, np.where(other >= 0, reach, at_end))
    return angle, spread


def _merge(
    angle: np.ndarray, spread: np.ndarray, other: np.ndarray, other_spread: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Smallest range of directions that holds two ranges."""
    turn = _wrap(other - angle)
    first = np.minimum(-spread, turn - other_spread)
    last = np.maximum(spread, turn + other_spread)
    return _wrap(angle + 0.5 * (first + last)), np.minimum(0.5 * (last - first), np.pi)


def _wrap(angle: np.ndarray) -> np.ndarray:
    """Angle in [-pi, pi)."""
    return (angle + np.pi) % (2 * np.pi) - np.pi
