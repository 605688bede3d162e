"""The face of a surface that is closest to each point, and how far other points are beyond its rim."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from skfem_contact.bodies.facet_kinds import node_positions
from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.bodies.thresholds import CORNER
from skfem_contact.digits import SOLVED
from skfem_contact.pairing.closest import margins
from skfem_contact.pairing.faces.joints import Joints, across_edges
from skfem_contact.pairing.faces.projection import Feet, interpolated_normals, project
from skfem_contact.pairing.faces.search import FaceTree, closest_candidates
from skfem_contact.pairing.thresholds import COINCIDENT, FACING
from skfem_contact.pairing.vectors import dot
from skfem_contact.trees import Tree

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Mask = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Side:
    """The primary surface with what is asked of it again and again, and the points that look at it.

    Attributes
    ----------
    secondary, primary : ContactSurface
    outside, inside : float
        Largest distances of open and of overlapping points [length].
    margin : ndarray, shape (nf,)
        How far faces of the primary reach beyond the rim, see `closest.margins` [length].
    """

    secondary: ContactSurface
    primary: ContactSurface
    outside: float
    inside: float
    margin: Array

    @cached_property
    def joints(self) -> Joints:
        """The corners of the primary by its points."""
        return Joints.of(self.primary)

    def judge(self, point: Index, facet: Index) -> tuple[Mask, Array]:
        """Whether faces may be the partners of points, and the distances [length]."""
        secondary, primary = self.secondary, self.primary
        facing = dot(secondary.normals[point], primary.facet_normals[facet]) < -FACING
        facing &= ~self._itself(point, facet)
        valid, distance = facing.copy(), np.full(len(point), np.inf)
        point, facet = point[facing], facet[facing]
        feet = project(primary, facet, secondary.points[point])
        apart = secondary.points[point] - feet.foot
        length = np.linalg.norm(apart, axis=1)
        height = dot(apart, interpolated_normals(primary, facet, feet.xi))
        within = np.where(height >= 0, length <= self.outside, length <= self.inside)
        above = feet.over <= COINCIDENT * primary.lengths[facet]
        beyond = np.flatnonzero(within & ~above)
        some = _some(feet, beyond)
        above[beyond] = self._on_a_joint(facet[beyond], some, apart[beyond])
        above[beyond] |= self._in_the_margin(facet[beyond], some, height[beyond])
        distance[facing] = length
        valid[facing] = within & above
        return valid, distance

    def _itself(self, point: Index, facet: Index) -> Mask:
        """Nodes of a slit that belong to both of its sides, and faces that they are corners of."""
        if self.secondary.body is not self.primary.body:
            return np.zeros(len(point), dtype=bool)
        mine = self.secondary.dofs[point, 0]
        return np.asarray(
            (self.primary.dofs[self.primary.facets[facet], 0] == mine[:, None]).any(axis=1)
        )

    def _in_the_margin(self, facet: Index, feet: Feet, height: Array) -> Mask:
        """Whether points just beyond the rim or a sharp edge are in the margin there, and no deeper."""
        primary, c = self.primary, self.primary.kind.corners
        ends = (primary.twins < 0) | primary.sharp_edges
        local = feet.place % c
        # two edges meet at a corner, the one that starts there and the one before it
        there = ends[facet, local] | ((feet.place >= c) & ends[facet, local - 1])
        margin = self.margin[facet]
        return np.asarray(there & (feet.over <= margin) & (height >= -margin))

    def _on_a_joint(self, facet: Index, feet: Feet, apart: Array) -> Mask:
        """Whether a foot at the rim of its face is the closest point of the whole surface.

        It is that of the faces across the edge or round the corner too, and the surface goes on there,
        on a plane of symmetry as its mirror image.
        Beyond a sharp edge the node lies at most 45 degrees off the normal of its face.
        """
        primary, c = self.primary, self.primary.kind.corners
        on_edge = feet.place < c
        local = np.where(on_edge, feet.place, feet.place - c)
        least = COINCIDENT * primary.lengths[facet]
        good = np.zeros(len(facet), dtype=bool)
        in_cone = feet.over <= np.abs(dot(apart, feet.own)) * (1 + COINCIDENT)

        at = np.flatnonzero(on_edge)
        twin = primary.twins[facet[at], local[at]]
        across = np.where(primary.mirror_edges[facet[at], local[at]], np.abs(apart[at]), 0.0)
        mirrored = primary.mirror_edges[facet[at], local[at]].any(axis=1)
        good[at] = mirrored & (across.max(axis=1) <= least[at])
        at, twin = at[twin >= 0], twin[twin >= 0]
        part = _part_of_edge(primary, feet.xi[at], local[at])
        outward, normal = across_edges(primary, twin, 1.0 - part)
        nearer = -dot(apart[at], outward) > COINCIDENT * primary.lengths[twin // c]
        smooth = dot(feet.own[at], normal) >= CORNER
        good[at] = ~nearer & (smooth | in_cone[at])

        at = np.flatnonzero(~on_edge)
        corner = primary.facets[facet[at], local[at]]
        smooth = ~primary.sharp_points[corner]
        across = np.where(primary.mirrored[corner], np.abs(apart[at]), 0.0).max(axis=1)
        leads = self.joints.leads_off(corner, apart[at], least[at]) | (across > least[at])
        good[at] = ~leads & (smooth | in_cone[at])
        return good


def _some(feet: Feet, chosen: Index) -> Feet:
    return Feet(*(value[chosen] for value in vars(feet).values()))


def _part_of_edge(surface: ContactSurface, xi: Array, edge: Index) -> Array:
    """Which part of the way along edges reference coordinates are, shape (p,)."""
    at = surface.kind.locations[: surface.kind.corners]
    way = np.roll(at, -1, axis=0) - at
    return dot(xi - at[edge], way[edge]) / np.sum(way**2, axis=1)[edge]


def closest_faces(
    secondary: ContactSurface,
    primary: ContactSurface,
    outside: float,
    inside: float,
    extended: bool = False,
) -> tuple[Index, Index]:
    """Points that have a partner, in their order, and their faces."""
    side = Side(secondary, primary, outside, inside, margins(secondary, primary, extended))

    def valid_pairs(point: Index, facet: Index) -> tuple[Index, Index, Array]:
        valid, distance = side.judge(point, facet)
        return point[valid], facet[valid], distance[valid]

    # a first guess, the nearest face or else the next one, bounds the distance: the exact search then
    # is short
    m = len(secondary.points)
    bound, found = np.full(m, np.inf), []
    few = min(2, len(primary.facets))
    centres = node_positions(primary.points, primary.facets).mean(axis=1)
    _, guess = Tree(centres).query(secondary.points, k=np.arange(1, few + 1))
    for nearest in guess.T:
        left = np.flatnonzero(np.isinf(bound))
        found.append(valid_pairs(left, nearest[left]))
        point, facet, distance = found[-1]
        bound[point] = distance + 2 * SOLVED * primary.lengths[facet]

    blocks = closest_candidates(
        FaceTree.build(primary),
        secondary.points,
        secondary.normals,
        facing=float(np.arccos(FACING)),
        bound=bound,
        outside=outside,
        inside=inside,
    )
    found += [valid_pairs(point, facet) for point, facet in blocks]
    point, facet, distance = (np.concatenate(column) for column in zip(*found, strict=True))
    nearest = np.full(m, np.inf)
    np.minimum.at(nearest, point, distance)
    near = distance <= nearest[point] + SOLVED * primary.lengths[facet]
    return _most_opposite(secondary, primary, point[near], facet[near])


def _most_opposite(
    secondary: ContactSurface, primary: ContactSurface, point: Index, facet: Index
) -> tuple[Index, Index]:
    """Of equally near faces the one that faces its point most, for each point.

    Ties that are left are settled by where the faces are, seen from the point, and not by their
    numbers. Rounded, so that round-off does not decide between two sides of a symmetric corner.
    """
    facing = dot(secondary.normals[point], primary.facet_normals[facet])
    middle = primary.points[primary.facets[facet, : primary.kind.corners]].mean(axis=1)
    away = (middle - secondary.points[point]) / primary.lengths[facet][:, None]
    keys = np.round(np.column_stack([facing, np.linalg.norm(away, axis=1), away]), 6)
    order = np.lexsort((facet, *keys.T[::-1], point))
    first = np.append(True, np.diff(point[order]) > 0)[: len(point)]
    chosen = order[first]
    return point[chosen], facet[chosen]


def overhang(
    secondary: ContactSurface, primary: ContactSurface, lonely: Mask, outside: float, inside: float
) -> tuple[Array, Index]:
    """By how much points without a partner lie beyond the nearest rim or sharp edge facing them.

    Returns
    -------
    miss : ndarray, shape (m,)
        Infinite where there is nothing they could be beyond of; 0 where not `lonely` [length].
    facet : ndarray of int, shape (m,)
        The face with that edge; -1 where there is none.
    """
    miss = np.where(lonely, np.inf, 0.0)
    end_facet = np.full(len(miss), -1)
    facet, edge = np.nonzero((primary.twins < 0) | primary.sharp_edges)
    point = np.flatnonzero(lonely)
    if not (len(facet) and len(point)):
        return miss, end_facet
    c = primary.kind.corners
    middle = 0.5 * (
        primary.points[primary.facets[facet, edge]]
        + primary.points[primary.facets[facet, (edge + 1) % c]]
    )
    few = min(8, len(facet))
    _, near = Tree(middle).query(secondary.points[point], k=few)
    item = np.repeat(point, few)
    face = facet[near.reshape(-1)]
    feet = project(primary, face, secondary.points[item])
    height = dot(secondary.points[item] - feet.foot, feet.own)
    faces = dot(secondary.normals[item], primary.facet_normals[face])
    within = (height <= outside) & (height >= -inside)
    good = (faces < -FACING) & (feet.over > 0) & within
    # the nearest of them: those of one point follow each other
    distance = np.where(good, np.hypot(feet.over, height), np.inf).reshape(len(point), few)
    first = np.argmin(distance, axis=1)
    rows = np.flatnonzero(np.isfinite(distance.min(axis=1)))
    chosen = rows * few + first[rows]
    miss[point[rows]] = feet.over[chosen]
    end_facet[point[rows]] = face[chosen]
    return miss, end_facet
