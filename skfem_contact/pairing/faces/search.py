"""Which faces can hold the closest point to a given one? A tree over the faces of a surface.

Faces are put in an order in which pairs, fours, eights, ... that follow each other are compact: the
surface is halved along its longest extent again and again. Each node of the tree knows a ball around
its faces and a cone of the directions from which their closest points can be seen. A point is at a
stationary distance from a face only if the line of sight lies in that cone, so nearly all of the
surface is discarded at once, near and far. Nothing is discarded that could be a partner.

D. Johnson, E. Cohen: Spatialized normal cone hierarchies. Proc. I3D (2001) 129-134.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from skfem_contact.bodies.normals import tangents
from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.digits import COMPUTED
from skfem_contact.pairing.search import ball_of, children, descend
from skfem_contact.pairing.thresholds import BULGE, MARGIN
from skfem_contact.pairing.vectors import dot

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Mask = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class FaceNodes:
    """Nodes of the tree: balls around their faces, and cones of directions.

    The closest points of the faces look along directions within `spread` of `axis` [rad], or exactly
    opposite. ``centre`` and ``axis`` are (n, 3), the others are (n,).
    """

    centre: Array
    radius: Array
    axis: Array
    spread: Array

    def at(self, node: Index) -> FaceNodes:
        """These nodes, in this order."""
        return FaceNodes(*(getattr(self, field.name)[node] for field in fields(self)))


@dataclass(frozen=True, eq=False)
class FaceTree:
    """Nodes of 1, 2, 4, ... faces that follow each other in `order`; ``levels[0]`` are the faces."""

    levels: tuple[FaceNodes, ...]
    order: Index

    @classmethod
    def build(cls, surface: ContactSurface) -> FaceTree:
        """Build the hierarchy over the faces of a surface."""
        lower, upper = _boxes(surface)
        order = bisected(0.5 * (lower + upper))
        lower, upper = lower[order], upper[order]
        axis, spread = surface.facet_normals[order], _spreads(surface)[order]
        levels = [FaceNodes(*ball_of(lower, upper), axis, spread)]
        while len(lower) > 1:
            left, right = children(len(lower))
            lower = np.minimum(lower[left], lower[right])
            upper = np.maximum(upper[left], upper[right])
            axis, spread = _merge(axis[left], spread[left], axis[right], spread[right])
            levels.append(FaceNodes(*ball_of(lower, upper), axis, spread))
        return cls(tuple(levels), order)

    def descend(
        self, count: int, meets: Callable[[Index, FaceNodes], Mask]
    ) -> Iterator[tuple[Index, Index]]:
        """Yield pairs (item, face) whose nodes are all met, see `pairing.search.descend`."""
        for item, place in descend(self.levels, count, meets):
            yield item, self.order[place]


def bisected(points: Array) -> Index:
    """An order of points (n, d) in which 2, 4, 8, ... that follow each other are close together.

    >>> bisected(np.array([[0.0], [3.0], [1.0], [2.0]])).tolist()
    [0, 2, 3, 1]
    """
    order = np.arange(len(points))
    size = 1 << max(len(points) - 1, 0).bit_length()
    while size > 1:
        # halves of equal numbers along the longest extent of each group
        group = np.arange(len(points)) // size
        start = np.arange(0, len(points), size)
        x = points[order]
        extent = np.maximum.reduceat(x, start) - np.minimum.reduceat(x, start)
        along = x[np.arange(len(x)), np.argmax(extent, axis=1)[group]]
        order = order[np.lexsort((along, group))]
        size //= 2
    return order


def closest_candidates(
    tree: FaceTree,
    points: Array,
    looks: Array,
    *,
    facing: float,
    bound: Array,
    outside: float,
    inside: float,
) -> Iterator[tuple[Index, Index]]:
    """Yield pairs (point, face) among which all stationary closest points are.

    Parameters
    ----------
    tree : FaceTree
    points, looks : ndarray, shape (m, 3)
        Points, and the unit directions they look along.
    facing : float
        Largest angle [rad] between the line of sight and the opposite of a face's normal.
    bound : ndarray, shape (m,)
        Faces farther away than this need not be found [length].
    outside, inside : float
        Largest distance on the side of the normal, and on the side of the body [length].
    """

    def in_sight(point: Index, nodes: FaceNodes) -> Mask:
        sight = points[point] - nodes.centre
        distance = np.sqrt(dot(sight, sight))
        near = distance - nodes.radius
        parallax = np.arcsin(np.minimum(nodes.radius / np.maximum(distance, nodes.radius), 1.0))
        # the least number: a point at the centre is within, whatever its direction
        turn = _angles(dot(sight, nodes.axis) / np.maximum(distance, np.finfo(float).tiny))
        limit = nodes.spread + parallax + MARGIN
        in_front = (turn <= limit) & (near <= outside)
        behind = (np.pi - turn <= limit) & (near <= inside)
        faces = _angles(-dot(looks[point], nodes.axis)) <= nodes.spread + facing + MARGIN
        return faces & (near <= bound[point]) & ((near <= 0) | in_front | behind)

    return tree.descend(len(points), in_sight)


def _angles(cosine: Array) -> Array:
    return np.arccos(np.clip(cosine, -1.0, 1.0))


def _boxes(surface: ContactSurface) -> tuple[Array, Array]:
    """Boxes around faces: linear ones lie in the hull of their nodes, others bulge out of it."""
    x = surface.points[surface.facets]
    lower, upper = x.min(axis=1), x.max(axis=1)
    if surface.quadratic:
        more = BULGE * np.linalg.norm(upper - lower, axis=1, keepdims=True)
        lower, upper = lower - more, upper + more
    return lower, upper


def _spreads(surface: ContactSurface) -> Array:
    """Half angles of the cones of directions in which closest points on each face look, (nf,) [rad].

    Round the normal at its middle: of a warped face normals are between those at the corners, of a
    curved one between those at the nodes and a little beyond. At a smooth joint the cone reaches over
    to all faces round the corner, at a sharp one it opens by 45 degrees.
    """
    c = surface.kind.corners
    own, middle = surface.own_normals, surface.facet_normals
    angle = _angles(np.einsum("fkd,fd->fk", own, middle))
    turn = angle.max(axis=1) * (1.0 + BULGE if surface.quadratic else 1.0)
    # round each corner: the averaged normal, and how far that of any face is from it
    mean, corners = surface.facet_node_normals[:, :c], surface.facets[:, :c]
    off = _angles(np.einsum("fkd,fkd->fk", own[:, :c], mean))
    around = np.zeros(len(surface.points))
    np.maximum.at(around, corners, off)
    smooth = _angles(np.einsum("fkd,fd->fk", mean, middle)) + around[corners]
    reach = np.where(surface.sharp_points[corners], angle[:, :c] + 0.25 * np.pi, smooth)
    return np.minimum(np.maximum(turn, reach.max(axis=1)), np.pi)


def _merge(axis: Array, spread: Array, other: Array, other_spread: Array) -> tuple[Array, Array]:
    """The least cone of directions that holds two cones: its axis in the plane of both."""
    cosine = np.clip(dot(axis, other), -1.0, 1.0)
    angle = np.arccos(cosine)
    first = np.minimum(-spread, angle - other_spread)
    last = np.maximum(spread, angle + other_spread)
    across = other - cosine[:, None] * axis
    length = np.linalg.norm(across, axis=1, keepdims=True)
    # opposite or equal axes have no plane: any direction across does
    across = np.where(
        length > COMPUTED, across / np.where(length > COMPUTED, length, 1.0), tangents(axis)[:, 0]
    )
    turn = 0.5 * (first + last)[:, None]
    merged = np.cos(turn) * axis + np.sin(turn) * across
    return merged, np.minimum(0.5 * (last - first), np.pi)
