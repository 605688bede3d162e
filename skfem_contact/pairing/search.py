"""Which facets can hold the closest point to a given point? A hierarchy of boxes and normal cones.

Facets are listed along their surface, so pairs, fours, eights, ... of consecutive facets are
compact and make a binary tree without any sorting. Each node of the tree knows a ball around its
facets and the range of directions in which their closest points can be seen from. A point is at a
stationary distance from a facet only if the line of sight lies in that range, so nearly all of the
surface is discarded at once, near and far, and the search is exact: nothing is discarded that
could be a partner.

D. Johnson, E. Cohen: Spatialized normal cone hierarchies. Proc. I3D (2001) 129-134.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from skfem_contact.bodies.normals import CORNER
from skfem_contact.bodies.surface import ContactSurface

#: Pairs (point, node of the tree) worked on at once; bounds the memory at some 100 bytes for each.
BLOCK = 1 << 18

#: Balls are larger by this fraction of their radius, for round-off and for tolerances at the ends.
MARGIN = 1e-5


@dataclass(frozen=True, eq=False)
class FacetTree:
    """Balls and normal cones of 1, 2, 4, ... consecutive facets; ``levels[0]`` are the facets.

    Each level is ``(centre (k, 2), radius (k,), angle (k,), spread (k,))``: the closest points of
    the facets look along directions within `spread` of `angle` [rad], or exactly opposite.
    """

    levels: tuple[tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray], ...]

    @classmethod
    def build(cls, surface: ContactSurface) -> FacetTree:
        """Build the hierarchy over the facets of a surface."""
        lower, upper = _boxes(surface)
        angle, spread = _cones(surface)
        levels = [(*_ball(lower, upper), angle, spread)]
        while len(lower) > 1:
            left, right = _children(len(lower))
            lower = np.minimum(lower[left], lower[right])
            upper = np.maximum(upper[left], upper[right])
            angle, spread = _merge(angle[left], spread[left], angle[right], spread[right])
            levels.append((*_ball(lower, upper), angle, spread))
        return cls(tuple(levels))

    def candidates(
        self,
        points: np.ndarray,
        looks: np.ndarray,
        *,
        facing: float,
        bound: np.ndarray,
        outside: float,
        inside: float,
    ) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """Yield pairs (point, facet) among which all stationary closest points are.

        Parameters
        ----------
        points, looks : ndarray, shape (m, 2)
            Points, and the unit directions they look along.
        facing : float
            Largest angle [rad] between the line of sight and the opposite of a facet's normal.
        bound : ndarray, shape (m,)
            Facets farther away than this need not be found [length].
        outside, inside : float
            Largest distance on the side of the normal, and on the side of the body [length].

        Yields
        ------
        point, facet : ndarray of int
        """
        opposite = np.arctan2(-looks[:, 1], -looks[:, 0])
        top = len(self.levels) - 1
        everyone = np.arange(len(points))
        stack = [
            (top, everyone[i : i + BLOCK], np.zeros(len(everyone[i : i + BLOCK]), dtype=np.int64))
            for i in range(0, len(points), BLOCK)
        ]
        while stack:
            level, point, node = stack.pop()
            centre, radius, angle, spread = (array[node] for array in self.levels[level])
            sight = points[point] - centre
            distance = np.hypot(sight[:, 0], sight[:, 1])
            near = distance - radius
            direction = np.arctan2(sight[:, 1], sight[:, 0])
            # the directions in which the ball is seen; everywhere from within
            parallax = np.arcsin(np.minimum(radius / np.maximum(distance, radius), 1.0))
            within = near <= 0
            turn = np.abs(_wrap(direction - angle))
            limit = spread + parallax + MARGIN
            in_front = (turn <= limit) & (near <= outside)
            behind = (np.pi - turn <= limit) & (near <= inside)
            faces = np.abs(_wrap(opposite[point] - angle)) <= spread + facing
            keep = faces & (near <= bound[point]) & (within | in_front | behind)
            point, node = point[keep], node[keep]
            if level == 0:
                yield point, node
                continue
            point, node = np.repeat(point, 2), (2 * node[:, None] + [0, 1]).ravel()
            there = node < len(self.levels[level - 1][1])
            point, node = point[there], node[there]
            pieces = max(1, -(-len(point) // BLOCK))
            stack.extend(
                (level - 1, p, q)
                for p, q in zip(
                    np.array_split(point, pieces), np.array_split(node, pieces), strict=True
                )
            )


def _children(count: int) -> tuple[np.ndarray, np.ndarray]:
    left = np.arange(0, count, 2)
    return left, np.minimum(left + 1, count - 1)


def _boxes(surface: ContactSurface) -> tuple[np.ndarray, np.ndarray]:
    corners = surface.points[surface.facets]
    if surface.quadratic:
        # a quadratic curve lies in the hull of its ends and its Bezier control point
        corners = corners.copy()
        corners[:, 2] = 2 * corners[:, 2] - 0.5 * (corners[:, 0] + corners[:, 1])
    return corners.min(axis=1), corners.max(axis=1)


def _ball(lower: np.ndarray, upper: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    radius = 0.5 * np.linalg.norm(upper - lower, axis=1)
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
        own = surface.end_normals[:, side]
        other = surface.neighbours[:, side]
        there = surface.end_normals[other, 1 - side]
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
