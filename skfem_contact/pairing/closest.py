"""The facet of a surface that is closest to each point, and how far other points overhang its end."""

from __future__ import annotations

import numpy as np

from skfem_contact.bodies.normals import sizes, tangents
from skfem_contact.bodies.projection import interpolated_normals, project
from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.bodies.thresholds import CORNER
from skfem_contact.digits import SOLVED
from skfem_contact.errors import InputError
from skfem_contact.pairing.search import FacetTree, Nodes, closest_candidates
from skfem_contact.pairing.thresholds import ASIDE, COINCIDENT, EXTENDED, FACING
from skfem_contact.pairing.vectors import ahead
from skfem_contact.trees import Tree


def search_range(
    secondary: ContactSurface, primary: ContactSurface, reach: float | None
) -> tuple[float, float]:
    """Largest distances at which partners are looked for: of open points, of overlapping ones."""
    if reach is None:
        boxes = [np.linalg.norm(np.ptp(s.points, axis=0)) for s in (secondary, primary)]
        return np.inf, 0.5 * float(min(boxes))
    if not isinstance(reach, int | float | np.number) or not reach > 0:
        raise InputError(f"reach={reach!r} is not a positive length")
    return float(reach), float(reach)


def margins(secondary: ContactSurface, primary: ContactSurface, extended: bool) -> np.ndarray:
    """How far facets of the primary reach beyond their ends and sharp edges, (nf,) [length].

    `EXTENDED` of a facet, of the smallest of the secondary where these are smaller: at most one of its
    points is in there. Nothing but round-off where they are not `extended`.
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
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Point numbers, facets and local coordinates of all pairs."""
    margin = margins(secondary, primary, extended)

    def valid_pairs(point: np.ndarray, facet: np.ndarray) -> tuple[np.ndarray, ...]:
        xi, distance, valid = _judge(secondary, primary, point, facet, outside, inside, margin)
        return point[valid], facet[valid], xi[valid], distance[valid]

    # a first guess among the nearest facets bounds the distance, the exact search then is short
    m = len(secondary.points)
    bound = np.full(m, np.inf)
    few = min(4, len(primary.facets))
    middles = Tree(primary.points.take(primary.facets, axis=0).mean(axis=1))
    _, guess = middles.query(secondary.points, k=few, ordered=False)
    point, facet = np.repeat(np.arange(m), few), guess.reshape(-1)
    judged = point * len(primary.facets) + facet
    found = [valid_pairs(point, facet)]
    point, facet, _, distance = found[0]
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
        new = ~np.isin(point * len(primary.facets) + facet, judged)
        if new.any():
            found.append(valid_pairs(point[new], facet[new]))
    point, facet, xi, distance = (np.concatenate(column) for column in zip(*found, strict=True))
    nearest = np.full(m, np.inf)
    np.minimum.at(nearest, point, distance)
    near = distance <= nearest[point] + SOLVED * primary.lengths[facet]
    point, facet, xi = point[near], facet[near], xi[near]
    facing = np.einsum("pd,pd->p", secondary.normals[point], primary.facet_normals[facet])
    # rounded, so that round-off does not decide between two sides of a symmetric corner
    order = np.lexsort((facet, np.round(facing, 6), point))
    _, first = np.unique(point[order], return_index=True)
    chosen = order[first]
    return point[chosen], facet[chosen], xi[chosen]


def _judge(
    secondary: ContactSurface,
    primary: ContactSurface,
    point: np.ndarray,
    facet: np.ndarray,
    outside: float,
    inside: float,
    margin: np.ndarray,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Local coordinate and distance of each pair, and whether the facet may be the partner."""
    x = secondary.points.take(point, axis=0)
    xi, foot, over = project(primary, facet, x)
    apart = x - foot
    distance = sizes(apart)
    height = np.einsum("pd,pd->p", apart, interpolated_normals(primary, facet, xi))
    looks, faces = secondary.normals.take(point, axis=0), primary.facet_normals.take(facet, axis=0)
    facing = np.einsum("pd,pd->p", looks, faces) < -FACING
    side = (xi >= 0.5).astype(int)
    other = primary.neighbours[facet, side]
    slope = np.where(other < 0, _slopes(primary.end_turns[facet, side]), 0.0)
    aside = np.clip(height * slope, 0.0, ASIDE * primary.lengths[facet])
    above_facet = over <= aside + COINCIDENT * primary.lengths[facet]

    # beyond an end: the vertex is the closest point only if it is that of the next facet, too
    own_normal = primary.own_normals[facet, side]
    next_normal = primary.own_normals[other, 1 - side]
    into_next = np.where(side == 1, 1.0, -1.0) * ahead(apart, next_normal)
    beyond_next = into_next > COINCIDENT * primary.lengths[other]
    smooth = np.einsum("pd,pd->p", own_normal, next_normal) >= CORNER
    in_cone = over <= np.abs(np.einsum("pd,pd->p", apart, own_normal)) * (1 + COINCIDENT)
    at_vertex = (other >= 0) & ~beyond_next & (smooth | in_cone)
    # or in the margin of an end, and no deeper: what is deeper stands beside the body
    past = (other < 0) | ~smooth
    above_facet |= past & (over <= margin[facet]) & (height >= -margin[facet])

    within = np.where(height >= 0, distance <= outside, distance <= inside)
    itself = np.zeros(len(point), dtype=bool)
    if secondary.body is primary.body:  # the tip of a slit belongs to both lips
        mine = secondary.dofs[point, 0]
        itself = (primary.dofs[primary.facets[facet], 0] == mine[:, None]).any(axis=1)
    return xi, distance, facing & (above_facet | at_vertex) & within & ~itself


def _slopes(turn: np.ndarray) -> np.ndarray:
    """How far the side of a body that a surface ends at leads away from the end, per height.

    A point at a height h (< 0: inside) is on the inner side of the straight line through the side if
    it lies beyond the end by no more than h times this: the lower corner of an inclined joint between
    blocks of equal width overlaps the upper one's end, but is not opposite to its last facet. Where
    the boundary turns by less than 45 degrees or more than 135 it goes on, or back, as a surface.
    """
    steep = np.abs(turn - 0.5 * np.pi) <= 0.25 * np.pi + COINCIDENT
    return np.where(steep, -1.0 / np.tan(np.where(steep, turn, 0.5 * np.pi)), 0.0)


def signed_distances(surface: ContactSurface, points: np.ndarray) -> np.ndarray:
    """Distances of points (p, 2) from a surface, negative where its body is, shape (p,) [length].

    The closest of all facets counts, whichever way anything looks. Beyond the ends of an open curve
    nothing is inside.
    """
    middles = Tree(surface.points[surface.facets].mean(axis=1))
    guess = middles.query(points)[1]
    bound = np.linalg.norm(points - project(surface, guess, points)[1], axis=1)

    def in_reach(point: np.ndarray, nodes: Nodes) -> np.ndarray:
        away = np.linalg.norm(points[point] - nodes.centre, axis=1)
        return np.asarray(away - nodes.radius <= bound[point])

    found = FacetTree.build(surface, len(points)).descend(len(points), in_reach)
    point, facet = (np.concatenate(column) for column in zip(*found, strict=True))
    xi, foot, _ = project(surface, facet, points[point])
    distance = np.linalg.norm(points[point] - foot, axis=1)
    order = np.lexsort((facet, distance, point))
    first = order[np.unique(point[order], return_index=True)[1]]
    facet, xi, foot = facet[first], xi[first], foot[first]
    # at a vertex the sum of both normals tells the sides apart, on an edge its own
    side = (xi >= 0.5).astype(int)
    other = surface.neighbours[facet, side]
    at_vertex = (other >= 0) & (np.abs(xi - side) <= COINCIDENT)
    there = surface.own_normals[other, 1 - side]
    normal = surface.own_normals[facet, side] + np.where(at_vertex[:, None], there, 0.0)
    away = points - foot
    sign = np.where(np.einsum("pd,pd->p", away, normal) < 0, -1.0, 1.0)
    # beyond the end of an open curve there is no body
    across = np.abs(normal[:, 0] * away[:, 1] - normal[:, 1] * away[:, 0])
    ends = surface.points[surface.facets[facet, :2]]
    length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    beyond = (other < 0) & (np.abs(xi - side) <= COINCIDENT) & (across > COINCIDENT * length)
    return np.asarray(np.where(beyond, 1.0, sign) * distance[first])


def overhang(
    secondary: ContactSurface,
    primary: ContactSurface,
    lonely: np.ndarray,
    outside: float,
    inside: float,
) -> tuple[np.ndarray, np.ndarray]:
    """By how much points without a partner lie beyond the nearest end or corner facing them."""
    miss = np.where(lonely, np.inf, 0.0)
    end_facet = np.full(len(miss), -1)
    facet, side = np.nonzero((primary.twins < 0) | primary.sharp_edges)
    point = np.flatnonzero(lonely)
    if not (len(facet) and len(point)):
        return miss, end_facet
    vertex = primary.points[primary.facets[facet, side]]
    few = min(8, len(facet))
    _, near = Tree(vertex).query(secondary.points[point], k=few)
    near = near.reshape(len(point), few)
    apart = secondary.points[point][:, None] - vertex[near]
    normal = primary.own_normals[facet, side][near]
    outward = np.where(side == 1, 1.0, -1.0)[:, None] * tangents(primary.own_normals[facet, side])[:, 0]
    along = np.einsum("pkd,pkd->pk", apart, outward[near])
    height = np.einsum("pkd,pkd->pk", apart, normal)
    faces = np.einsum("pd,pkd->pk", secondary.normals[point], primary.facet_normals[facet][near])
    within = (height <= outside) & (height >= -inside)
    good = (faces < -FACING) & (along > 0) & within
    first = np.argmax(good, axis=1)
    rows = np.flatnonzero(good.any(axis=1))
    miss[point[rows]] = along[rows, first[rows]]
    end_facet[point[rows]] = facet[near[rows, first[rows]]]
    return miss, end_facet
