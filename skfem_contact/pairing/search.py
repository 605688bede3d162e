"""Search of facets that can hold a partner: one tree over the facets, asked for the closest.

Pairs, fours, eights, ... of facets that follow each other are compact and make a binary tree: those of
a curve are listed along it, faces are put into an order by halving the surface along its longest extent
again and again. Each node of the tree knows a ball around its facets and a cone of the
directions in which their closest points can be seen.

A point is at a stationary distance from a facet only if the line of sight lies in that cone, so nearly
all of the surface is discarded at once, near and far. Nothing is discarded that could be a partner.
`segmentation` and `cells` ask the tree for the facets that normal lines of another surface can meet.

D. Johnson, E. Cohen: Spatialized normal cone hierarchies. Proc. I3D (2001) 129-134.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from skfem_contact.arrays import Array, Index, Mask, dot, runs, sizes, tangents
from skfem_contact.bodies.facet_kinds import node_positions
from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.digits import COMPUTED, GIVEN
from skfem_contact.records import dataclass

# A facet is a candidate if its normal n_p and that of the node, n_s, have n_s . n_p < -FACING:
# they may be up to 84 degrees off the exactly opposite direction. So much may a direction be off the
# free one along which a node at a roller still moves, as in `elimination.pivoting`.
FACING = 0.1

# By which part of its box, and of the turn of its normals at the nodes, a quadratic face may go beyond
# them: a parabola with its middle node at a quarter of the edge goes beyond its nodes by 1/24.
BULGE = 0.1

# To ask about so many pairs takes no longer than to go through the upper levels of a tree.
FEW_PAIRS = 1 << 12

# Balls are larger by this fraction of their radius, for the tolerances at the ends, of `GIVEN` each.
MARGIN = 10 * GIVEN

# At the centre of a ball a point is within, whatever its direction.
TINY = float(np.finfo(float).tiny)


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
    points, looks : ndarray, shape (m, d)
        Points, and the unit directions they look along.
    facing : float
        Largest angle [rad] between the line of sight and the opposite of a facet's normal.
    bound : ndarray, shape (m,)
        Facets farther away than this need not be found [length].
    outside, inside : float
        Largest distance on the side of the normal, and on the side of the body [length].
    """

    def in_sight(point: Index, nodes: Nodes) -> Mask:
        sight = points.take(point, axis=0) - nodes.centre
        distance = sizes(sight)
        found = distance - nodes.radius <= bound[point]
        close = np.flatnonzero(found)  # angles take longer
        found[close] = in_cone(point[close], nodes.at(close), sight[close], distance[close])
        return found

    def in_cone(point: Index, nodes: Nodes, sight: Array, distance: Array) -> Mask:
        near, (axis, spread) = distance - nodes.radius, nodes.cones
        # the directions in which the ball is seen; everywhere from within
        parallax = np.arcsin(np.minimum(nodes.radius / np.maximum(distance, nodes.radius), 1.0))
        turn = _angles(dot(sight, axis) / np.maximum(distance, TINY))
        limit = spread + parallax + MARGIN
        in_front = (turn <= limit) & (near <= outside)
        behind = (np.pi - turn <= limit) & (near <= inside)
        faces = _angles(-dot(looks.take(point, axis=0), axis)) <= spread + facing + MARGIN
        return faces & ((near <= 0) | in_front | behind)

    return tree.descend(len(points), in_sight)


@dataclass(frozen=True, eq=False)
class Nodes:
    """Nodes of the tree: balls around their facets, and cones of directions.

    ``centre`` is (n, d), `radius` (n,). `cones` are axes and spreads: the closest points of the facets
    look along directions within the spread (n,) of the axis (n, d) [rad], or exactly opposite. A tree
    of balls alone has no cones.
    """

    centre: Array
    radius: Array
    cones: tuple[Array, ...] = ()

    def at(self, node: Index) -> Nodes:
        """These nodes, in this order."""
        # `take` gathers rows in a tenth of the time of an index
        cones = tuple(part.take(node, axis=0) for part in self.cones)
        return Nodes(self.centre.take(node, axis=0), self.radius.take(node), cones)


@dataclass(frozen=True, eq=False)
class FacetTree:
    """Nodes of 1, 2, 4, ... facets that follow each other in `order`; ``levels[0]`` are the facets."""

    levels: tuple[Nodes, ...]
    order: Index | None

    @classmethod
    def build(cls, surface: ContactSurface, count: int | None = None, cones: bool = True) -> FacetTree:
        """Build the hierarchy over the facets of a surface, as high as `count` items need it.

        Where all nodes of a level can be asked about every item at once, levels above save nothing.
        Without `cones` it knows of balls alone.
        """
        few = 1 if count is None else FEW_PAIRS / max(count, 1)
        seen = (surface.facet_normals, _spreads(surface)) if cones else ()
        return cls.over(*_boxes(surface), seen, few)

    @classmethod
    def over(
        cls, lower: Array, upper: Array, seen: tuple[Array, ...] = (), few: float = 1
    ) -> FacetTree:
        """Build it over boxes (nf, d) around facets, with cones or of balls alone; see `build`."""
        order = None
        if lower.shape[1] == 3 and len(lower) > few:
            order = bisected(0.5 * (lower + upper))
            lower, upper = lower[order], upper[order]
            seen = tuple(part[order] for part in seen)
        levels = [Nodes(*_balls(lower, upper), seen)]
        while len(lower) > max(few, 1):
            left = np.arange(0, len(lower), 2)
            right = np.minimum(left + 1, len(lower) - 1)
            lower = np.minimum(lower[left], lower[right])
            upper = np.maximum(upper[left], upper[right])
            if seen:
                seen = _merge(*(part[some] for some in (left, right) for part in seen))
            levels.append(Nodes(*_balls(lower, upper), seen))
        return cls(tuple(levels), order)

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
        levels = self.levels
        widest = len(levels[-1].radius)
        top = np.repeat(np.arange(count), widest), np.tile(np.arange(widest), count)
        stack = [(len(levels) - 1, *top)]
        while stack:
            level, item, node = stack.pop()
            parts = runs(len(item), 100)  # what a pair takes, about
            if len(parts) > 1:
                stack.extend((level, item[part], node[part]) for part in parts)
                continue
            keep = meets(item, levels[level].at(node))
            item, node = item[keep], node[keep]
            if level == 0:
                yield item, node if self.order is None else self.order[node]
                continue
            item, node = np.repeat(item, 2), np.stack([2 * node, 2 * node + 1], axis=1).ravel()
            there = node < len(levels[level - 1].radius)
            stack.append((level - 1, item[there], node[there]))


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
        # a row for each group, the last one filled up: sorting them is quicker than sorting all
        rows = np.pad(along, (0, -len(x) % size), constant_values=np.inf).reshape(-1, size)
        within = np.argsort(rows, axis=1, kind="stable") + start[:, None]
        order = order[within.ravel()[: len(x)]]
        size //= 2
    return order


def _boxes(surface: ContactSurface) -> tuple[Array, Array]:
    """Boxes around facets, (nf, d) each; linear ones lie in the hull of their nodes."""
    x = node_positions(surface.points, surface.facets)
    if surface.quadratic and surface.dim == 2:
        # a quadratic curve lies in the hull of its ends and its Bezier control point
        x[:, 2] = 2 * x[:, 2] - 0.5 * (x[:, 0] + x[:, 1])
    lower, upper = x.min(axis=1), x.max(axis=1)
    if surface.quadratic and surface.dim == 3:
        more = BULGE * sizes(upper - lower)[:, None]
        lower, upper = lower - more, upper + more
    return lower, upper


def _balls(lower: Array, upper: Array) -> tuple[Array, Array]:
    return 0.5 * (lower + upper), 0.5 * sizes(upper - lower) * (1 + MARGIN)


def _spreads(surface: ContactSurface) -> Array:
    """Half angles of the cones of directions in which closest points on each facet look, (nf,) [rad].

    Round the normal at its middle: of a warped face normals are between those at the corners, of a
    curved one between those at the nodes and a little beyond. At a smooth joint the cone reaches over
    to all facets round the corner, at a sharp one it opens by 45 degrees.
    """
    c = surface.kind.corners
    own, middle = surface.own_normals, surface.facet_normals
    angle = _angles(dot(own, middle[:, None]))
    turn = angle.max(axis=1) * (1.0 + BULGE if surface.quadratic else 1.0)
    # round each corner: the averaged normal, and how far that of any facet is from it
    mean, corners = surface.facet_node_normals[:, :c], surface.facets[:, :c]
    off = _angles(dot(own[:, :c], mean))
    around = np.zeros(len(surface.points))
    np.maximum.at(around, corners, off)
    smooth = _angles(dot(mean, middle[:, None])) + around[corners]
    reach = np.where(surface.sharp_points[corners], angle[:, :c] + 0.25 * np.pi, smooth)
    return np.minimum(np.maximum(turn, reach.max(axis=1)), np.pi)


def _angles(cosine: Array) -> Array:
    return np.asarray(np.arccos(np.minimum(np.maximum(cosine, -1.0), 1.0)))


def _merge(axis: Array, spread: Array, other: Array, other_spread: Array) -> tuple[Array, Array]:
    """The least cone of directions that holds two cones: its axis in the plane of both."""
    angle = _angles(dot(axis, other))
    first = np.minimum(-spread, angle - other_spread)
    last = np.maximum(spread, angle + other_spread)
    turn, half = 0.5 * (first + last), np.minimum(0.5 * (last - first), np.pi)
    across = other - np.cos(angle)[:, None] * axis
    length = sizes(across)[:, None]
    # opposite or equal axes have no plane: any direction across does
    across = np.where(
        length > COMPUTED, across / np.where(length > COMPUTED, length, 1.0), tangents(axis)[:, 0]
    )
    return np.cos(turn)[:, None] * axis + np.sin(turn)[:, None] * across, half
