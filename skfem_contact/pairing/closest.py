"""The facet of a surface that is closest to each point, overhangs beyond its rim, and distances."""

from __future__ import annotations

from functools import cached_property
from math import dist

import numpy as np

from skfem_contact.arrays import Array, Index, Mask, dot, sizes
from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.digits import GIVEN, SOLVED
from skfem_contact.errors import InputError
from skfem_contact.pairing.projection import Feet, Joints, across_edges, interpolated_normals, project
from skfem_contact.pairing.search import FACING, FacetTree, closest_candidates
from skfem_contact.records import dataclass
from skfem_contact.trees import Tree

# Up to this part of a facet the sloping side of a body at the end of a surface decides what is above
# the end; what lies farther beyond it is another part of the boundary. With finite sliding surfaces go
# on by this part of a facet beyond where they end, as "extension zones" of contact codes do: ends that
# are flush in the mesh slip past each other by strains, a hundredth of a facet at most, and a block
# that slides off has lost its last point a tenth of a facet later.
EXTENDED = 0.1

# Angle [rad] between a facet and the end of the other surface from which on the vertex carries.
# Below, the vertex is at most this times a facet length deeper than the last node, which is less
# than the chords of a curve explain. For means over facets, too: one of zero over a facet that leans
# by 0.09 lets the vertex in by 0.07 of its length. A smaller turn beside a straight part may be that of
# a curve which begins there.
LEAN = 0.04


def search_range(
    secondary: ContactSurface, primary: ContactSurface, reach: float | None
) -> tuple[float, float]:
    """Largest distances at which partners are looked for: of open points, of overlapping ones."""
    if reach is None:
        boxes = [dist(s.points.min(axis=0), s.points.max(axis=0)) for s in (secondary, primary)]
        return np.inf, 0.5 * min(boxes)
    if not isinstance(reach, int | float | np.number) or not reach > 0:
        raise InputError(f"reach={reach!r} is not a positive length")
    return float(reach), float(reach)


def margins(secondary: ContactSurface, primary: ContactSurface, extended: bool) -> Array:
    """Return how far facets of the primary reach beyond their ends and sharp edges, (nf,) [length].

    `EXTENDED` of a facet, of the smallest of the secondary where these are smaller: at most one of its
    points is in there. Zero where they are not `extended`.
    """
    if not extended:
        return np.zeros(len(primary.lengths))
    return EXTENDED * np.minimum(primary.lengths, secondary.lengths.min())


def closest_facets(
    secondary: ContactSurface,
    primary: ContactSurface,
    outside: float,
    inside: float,
    extended: bool = False,
) -> tuple[Index, Index, Array]:
    """Points that have a partner, in their order, their facets, and reference coordinates there."""
    side = Side(secondary, primary, outside, inside, margins(secondary, primary, extended))
    # the facet nearest to each point and, for where it is no partner, the next one, (m, 2 or 1)
    middles = Tree(primary.points.take(primary.facets, axis=0).mean(axis=1))
    few = np.arange(1, min(2, len(primary.facets)) + 1)
    m, guesses = len(secondary.points), middles.query(secondary.points, k=few, ordered=True)[1]
    bound, found, known = np.full(m, np.inf), [], np.full(guesses.shape, -1)
    # first guesses bound the distance: the exact search then is short
    for column, guess in enumerate(guesses.T):
        left = np.flatnonzero(np.isinf(bound))
        if column and not len(left):
            break
        known[left, column] = guess[left]
        found.append(side.valid_pairs(left, guess[left]))
        point, facet, _, distance = found[-1]
        np.minimum.at(bound, point, distance + 2 * SOLVED * primary.lengths[facet])
    blocks = closest_candidates(
        FacetTree.build(primary, m),
        secondary.points,
        secondary.normals,
        facing=float(np.arccos(FACING)),
        bound=bound,
        outside=outside,
        inside=inside,
    )
    # what is beside an end is no stationary point, but its facet is the nearest: hence the guess, too
    for point, facet in blocks:
        new = (known.take(point, axis=0) != facet[:, None]).all(axis=1)
        if new.any():
            found.append(side.valid_pairs(point[new], facet[new]))
    point, facet, xi, distance = (np.concatenate(column) for column in zip(*found, strict=True))
    nearest = np.full(m, np.inf)
    np.minimum.at(nearest, point, distance)
    near = np.flatnonzero(distance <= nearest[point] + SOLVED * primary.lengths[facet])
    chosen = near[_most_opposite(secondary, primary, point[near], facet[near])]
    return point[chosen], facet[chosen], xi[chosen]


def _most_opposite(
    secondary: ContactSurface, primary: ContactSurface, point: Index, facet: Index
) -> Index:
    """Choose among equally near facets the one that faces its point most, for each point.

    Rounded, so that round-off does not decide between two sides of a symmetric corner. Ties that are
    left are decided by where facets are, seen from the point, and not by their numbers.
    """
    if np.all(point[1:] > point[:-1]):  # no two of them
        return np.arange(len(point))
    facing = dot(secondary.normals.take(point, axis=0), primary.facet_normals.take(facet, axis=0))
    middle = primary.points[primary.facets[facet, : primary.kind.corners]].mean(axis=1)
    away = (middle - secondary.points[point]) / primary.lengths[facet][:, None]
    keys = np.column_stack([facing, sizes(away), away])
    order = np.lexsort((facet, *np.round(keys, 6).T[::-1], point))
    first = np.append(True, np.diff(point[order]) > 0)[: len(point)]
    return np.asarray(order[first])


@dataclass(frozen=True, eq=False)
class Side:
    """The primary surface with what is asked of it again and again, and the points that look at it.

    Attributes
    ----------
    secondary, primary : ContactSurface
    outside, inside : float
        Largest distances of open and of overlapping points [length].
    margin : ndarray, shape (nf,)
        How far facets of the primary reach beyond ends, see `margins` [length].
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

    def valid_pairs(self, point: Index, facet: Index) -> tuple[Index, Index, Array, Array]:
        """Return the pairs whose facet may be the partner, their coordinates and distances."""
        secondary, primary = self.secondary, self.primary
        looks, faces = secondary.normals.take(point, axis=0), primary.facet_normals.take(facet, axis=0)
        facing = dot(looks, faces) < -FACING
        if secondary.body is primary.body:  # the tip of a slit belongs to both lips
            mine = secondary.dofs[point, 0]
            facing &= ~(primary.dofs[primary.facets[facet], 0] == mine[:, None]).any(axis=1)
        if not facing.all():
            point, facet, looks = point[facing], facet[facing], looks[facing]
        feet, _, distance, _, good = self.stationary(facet, secondary.points.take(point, axis=0), looks)
        return point[good], facet[good], feet.xi[good], distance[good]

    def stationary(
        self, facet: Index, points: Array, looks: Array | None = None
    ) -> tuple[Feet, Array, Array, Array, Mask]:
        """Feet of points (p, d) on facets, and whether they are partners by their places.

        Parameters
        ----------
        facet : ndarray of int, shape (p,)
        points : ndarray, shape (p, d)
        looks : ndarray, shape (p, d), optional
            Normals of the points, which are beside sharp edges no vertices; those that are flush with
            an end may lie in the `margin` there.

        Returns
        -------
        feet, normal, distance, height, good
            The field of normals at the feet (p, d), distances from them and heights along it (p,)
            [length].
        """
        primary = self.primary
        feet = project(primary, facet, points)
        apart = points - feet.foot
        distance = sizes(apart)
        normal = interpolated_normals(primary, facet, feet.xi)
        height = dot(apart, normal)
        good = np.where(height >= 0, distance <= self.outside, distance <= self.inside)
        beyond = np.flatnonzero(good & (feet.over > GIVEN * primary.lengths[facet]))
        if len(beyond):
            rims, some = feet.some(beyond), facet[beyond]
            apart, across = apart[beyond], height[beyond]
            # beyond a sharp edge what looks lies at most 45 degrees off the normal of its facet
            steep = rims.over <= np.abs(dot(apart, rims.own)) * (1 + GIVEN)
            in_cone = steep & (looks is not None)
            good[beyond] = self._at_rims(some, rims, apart, across, in_cone)
            if looks is not None and self.margin.any():
                flush = dot(looks[beyond], normal[beyond]) <= -np.cos(LEAN)
                good[beyond] |= flush & self._in_the_margin(some, rims, across)
        return feet, normal, distance, height, good

    def _in_the_margin(self, facet: Index, feet: Feet, height: Array) -> Mask:
        """Return whether points just beyond an end or a sharp edge are in the margin there.

        Where a surface leans over the end, its vertex carries (`corners`).
        """
        primary, c = self.primary, self.primary.kind.corners
        ends, local = (primary.twins < 0) | primary.sharp_edges, feet.place % c
        # two edges meet at a corner, the one that starts there and the one before it
        there = ends[facet, local] | ((feet.place >= c) & ends[facet, local - 1])
        margin = self.margin[facet]
        return np.asarray(there & (feet.over <= margin) & (height >= -margin))

    def _at_rims(self, facet: Index, feet: Feet, apart: Array, height: Array, in_cone: Mask) -> Mask:
        """Return whether a foot at the rim of its facet is the closest point of the whole surface.

        It is that of the facets across the edge or round the corner too, and the surface goes on there,
        on a plane of symmetry as its mirror image.
        """
        primary, c = self.primary, self.primary.kind.corners
        at = np.flatnonzero(feet.place >= c)
        if not len(at):
            return self._at_edges(facet, feet, apart, height, in_cone)
        good = np.zeros(len(facet), dtype=bool)
        corner = primary.facets[facet[at], feet.place[at] - c]
        least = GIVEN * primary.lengths[facet[at]]
        across = np.where(primary.mirrored[corner], np.abs(apart[at]), 0.0).max(axis=1)
        leads = self.joints.leads_off(corner, apart[at], least) | (across > least)
        good[at] = ~leads & (~primary.sharp_points[corner] | in_cone[at])
        at = np.flatnonzero(feet.place < c)
        good[at] = self._at_edges(facet[at], feet.some(at), apart[at], height[at], in_cone[at])
        return good

    def _at_edges(self, facet: Index, feet: Feet, apart: Array, height: Array, in_cone: Mask) -> Mask:
        """`_at_rims` at feet on edges, which for lines are their ends."""
        primary, edge = self.primary, feet.place
        twin, size = primary.twins[facet, edge], primary.lengths[facet]
        outward, normal = across_edges(primary, feet, twin)
        nearer = -dot(apart, outward) > GIVEN * primary.lengths[twin // primary.kind.corners]
        good = (twin >= 0) & ~nearer & ((dot(feet.own, normal) >= primary.corner) | in_cone)
        if np.any(twin < 0):  # the surface ends: on a plane of symmetry, or above the side of the body
            mirror = primary.mirror_edges[facet, edge]
            across = np.where(mirror, np.abs(apart), 0.0).max(axis=1)
            ended = mirror.any(axis=1) & (across <= GIVEN * size)
            aside = np.clip(height * _slopes(primary.end_turns[facet, edge]), 0.0, EXTENDED * size)
            ended |= (aside > 0) & (feet.over <= aside + GIVEN * size)
            good |= (twin < 0) & ended
        return good


def _slopes(turn: Array) -> Array:
    """Return how far the side of a body that a curve ends at leads away from the end, per height.

    A point at a height h (< 0: inside) is on the inner side of the straight line through the side if
    it lies beyond the end by no more than h times this: the lower corner of an inclined joint between
    blocks of equal width overlaps the upper one's end, but is not opposite to its last facet. Where
    the boundary turns by less than 45 degrees or more than 135 it goes on, or back, as a surface.
    """
    steep = np.abs(turn - 0.5 * np.pi) <= 0.25 * np.pi + GIVEN
    return np.where(steep, -1.0 / np.tan(np.where(steep, turn, 0.5 * np.pi)), 0.0)


def overhang(
    secondary: ContactSurface, primary: ContactSurface, lonely: Mask, outside: float, inside: float
) -> tuple[Array, Index]:
    """By how much points without a partner lie beyond the nearest rim or sharp edge facing them.

    Returns
    -------
    miss : ndarray, shape (m,)
        Infinite where there is nothing they could be beyond of; 0 where not `lonely` [length].
    facet : ndarray of int, shape (m,)
        The facet with that edge; -1 where there is none.
    """
    miss = np.where(lonely, np.inf, 0.0)
    end_facet = np.full(len(miss), -1)
    facet, edge = np.nonzero((primary.twins < 0) | primary.sharp_edges)
    point = np.flatnonzero(lonely)
    if not (len(facet) and len(point)):
        return miss, end_facet
    ends = primary.kind.edges[:, : primary.dim - 1]
    middle = primary.points[primary.facets[facet[:, None], ends[edge]]].mean(axis=1)
    few = min(8, len(facet))
    _, near = Tree(middle).query(secondary.points[point], k=np.arange(1, few + 1))
    item, near = np.repeat(point, few), near.ravel()
    face = facet[near]
    feet = project(primary, face, secondary.points[item])
    height = dot(secondary.points[item] - feet.foot, feet.own)
    faces = dot(secondary.normals[item], primary.facet_normals[face])
    within = (height <= outside) & (height >= -inside)
    good = (faces < -FACING) & (feet.over > 0) & within
    if primary.dim == 2:  # beyond this end, and not beyond the other one
        good &= feet.place == edge[near]
    # the nearest of them: those of one point follow each other
    distance = np.where(good, np.hypot(feet.over, height), np.inf).reshape(len(point), few)
    first = np.argmin(distance, axis=1)
    rows = np.flatnonzero(np.isfinite(distance.min(axis=1)))
    chosen = rows * few + first[rows]
    miss[point[rows]] = feet.over[chosen]
    end_facet[point[rows]] = face[chosen]
    return miss, end_facet


def nearby_facets(surface: ContactSurface, points: Array) -> tuple[Index, Index]:
    """Points, and facets among which all of the nearest to them are, whichever way anything looks."""
    # none is farther than the nearest node or middle of a facet
    middles = surface.kind.shapes(surface.kind.middle)[0] @ surface.points[surface.facets]
    bound = Tree(np.concatenate([surface.points, middles])).distances(points)
    bound += SOLVED * surface.lengths.max()
    found = FacetTree.build(surface, len(points), cones=False).descend(
        len(points), lambda p, nodes: sizes(points[p] - nodes.centre) - nodes.radius <= bound[p]
    )
    point, facet = (np.concatenate(column) for column in zip(*found, strict=True))
    return point, facet


def signed_distances(surface: ContactSurface, points: Array) -> Array:
    """Distances of points (p, d) from a surface, negative where its body is, shape (p,) [length].

    The closest of all facets counts, whichever way anything looks. At an edge the sum of both facets'
    normals tells the sides apart, at a corner of faces the sum weighted by their angles: J. A.
    Baerentzen, H. Aanaes, IEEE Trans. Vis. Comput. Graph. 11 (2005) 243-253. Beyond the ends of an open
    curve nothing is inside.
    """
    point, facet = nearby_facets(surface, points)
    feet = project(surface, facet, points[point])
    distance = sizes(points[point] - feet.foot)
    order = np.lexsort((facet, distance, point))
    first = order[np.unique(point[order], return_index=True)[1]]
    facet, feet, distance = facet[first], feet.some(first), distance[first]
    inside = dot(points - feet.foot, _outward(surface, facet, feet)) < 0
    if surface.dim == 2:
        ended = surface.twins[facet, feet.place] < 0
        inside &= ~(ended & (feet.over > GIVEN * surface.lengths[facet]))
    return np.where(inside, -1.0, 1.0) * distance


def _outward(surface: ContactSurface, facet: Index, feet: Feet) -> Array:
    """A direction that tells outside from inside at feet, (p, d)."""
    c, outward = surface.kind.corners, feet.own.copy()
    on_edge = (feet.place >= 0) & (feet.place < c)
    twin = np.where(on_edge, surface.twins[facet, np.where(on_edge, feet.place, 0)], -1)
    at = np.flatnonzero(twin >= 0)
    outward[at] += across_edges(surface, feet.some(at), twin[at])[1]
    at = np.flatnonzero(feet.place >= c)
    if len(at):
        outward[at] = _corner_normals(surface)[surface.facets[facet[at], feet.place[at] - c]]
    return outward


def _corner_normals(surface: ContactSurface) -> Array:
    """Sums of the faces' normals at each node, weighted by their angles there, (m, 3)."""
    corners = surface.facets[:, : surface.kind.corners]
    x = surface.points[corners]
    ahead, back = np.roll(x, -1, axis=1) - x, np.roll(x, 1, axis=1) - x
    angle = np.arctan2(np.linalg.norm(np.cross(ahead, back), axis=2), dot(ahead, back))
    total = np.zeros_like(surface.points)
    np.add.at(total, corners, angle[..., None] * surface.own_normals[:, : surface.kind.corners])
    return total
