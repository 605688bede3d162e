"""Convex corners of a surface, and the facets of another surface that they meet: see `corners`."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from skfem_contact.bodies.normals import sizes
from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.bodies.thresholds import CORNER
from skfem_contact.digits import GIVEN, SOLVED
from skfem_contact.pairing.joints import across_edges
from skfem_contact.pairing.projection import interpolated_normals, project
from skfem_contact.pairing.thresholds import PAIRS_AT_ONCE, SLACK
from skfem_contact.pairing.vectors import dot
from skfem_contact.records import dataclass

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Mask = NDArray[np.bool_]

# Cosine of the turn beyond which it is measured: less than that of any corner, round-off included.
BENDS = CORNER + SOLVED


@dataclass(frozen=True, eq=False)
class Corners:
    """Convex corners of a surface, its ends included.

    Attributes
    ----------
    node : ndarray of int, shape (c,)
    first : ndarray, shape (c,)
        Direction of the normal of the facet that ends there [rad].
    turn : ndarray, shape (c,)
        Angle from there to the normal of the facet that begins there, > 0 [rad].
    covered : ndarray of bool, shape (c, 2)
        Whether the facet that ends (begins) there belongs to the surface.
    facet : ndarray of int, shape (c,)
        A facet of the surface there.
    """

    node: Index
    first: Array
    turn: Array
    covered: Mask
    facet: Index

    @classmethod
    def of(cls, surface: ContactSurface) -> Corners:
        """Find the sharp corners, and ends of any angle; none on a line of symmetry."""
        after = surface.neighbours[:, 1]
        own = surface.own_normals
        # angles only where the surface bends at all
        inner = np.flatnonzero((after >= 0) & (dot(own[:, 1], own[:, 0].take(after, axis=0)) < BENDS))
        bend = _wrap(_direction(own[after[inner], 0]) - _direction(own[inner, 1]))
        sharp = (bend > 0) & (np.cos(bend) < CORNER)
        inner, bend = inner[sharp], bend[sharp]
        f, side = np.nonzero((surface.neighbours < 0) & (surface.end_turns > 0))
        turn = surface.end_turns[f, side]
        first = _direction(own[f, side]) - np.where(side == 1, 0.0, turn)
        # a node that may not leave the line that the surface ends at lies on a line of symmetry
        other = np.where(side == 1, first + turn, first)
        held = surface.held[surface.facets[f, side]]
        across = np.abs(np.stack([np.cos(other), np.sin(other)], axis=1))
        keep = (held.sum(axis=1) != 1) | (np.sum(held * across, axis=1) < CORNER)
        f, side, turn, first = f[keep], side[keep], turn[keep], first[keep]
        node = np.concatenate([surface.facets[inner, 1], surface.facets[f, side]])
        covered = np.concatenate([np.ones((len(inner), 2), bool), np.stack([side == 1, side == 0], 1)])
        return cls(
            node=node,
            first=np.concatenate([_direction(own[inner, 1]), first]),
            turn=np.concatenate([bend, turn]),
            covered=covered,
            facet=np.concatenate([inner, f]),
        )


@dataclass(frozen=True, eq=False)
class Met:
    """Corners that meet a facet of the other surface, shapes (q,), (q, k), (q, d)."""

    corner: Index
    facet: Index
    shape: Array  # shape functions at the foot
    normal: Array  # outward of the facet
    gap: Array


def meet(
    corners: Corners,
    own: ContactSurface,
    other: ContactSurface,
    tilt: Array,
    limits: tuple[float, float],
    only_overlaps: bool = False,
) -> Met:
    """The closest point of the other surface to each vertex, where it is within its cone.

    With `only_overlaps` those alone that lie in the other body by more than they touch it.
    """
    lowest = np.where(corners.covered[:, 0], tilt, -SLACK)
    highest = corners.turn - np.where(corners.covered[:, 1], tilt, -SLACK)
    lean = lean_of(corners, np.arange(len(corners.node))[:, None], other, np.arange(len(other.facets)))
    leans = (lean > lowest[:, None]) & (lean < highest[:, None])
    if not leans.any():  # as on flat interfaces
        return nothing(own.dim)
    met = closest(corners, own, other, limits, only_overlaps)
    if not len(met.corner):
        return met
    met = some(met, leans[met.corner, met.facet])
    _, first = np.unique(met.corner, return_index=True)
    met = some(met, first)
    return some(met, met.gap < -GIVEN * other.lengths[met.facet]) if only_overlaps else met


def closest(
    corners: Corners,
    own: ContactSurface,
    other: ContactSurface,
    limits: tuple[float, float],
    only_overlaps: bool = False,
) -> Met:
    """The closest points of the other surface to each vertex; `only_overlaps`: none if none does."""
    corner, facet = _candidates(own.points[corners.node], other)
    if own.body is other.body:
        mine = own.dofs[corners.node[corner], 0]
        apart = ~(other.dofs[other.facets[facet], 0] == mine[:, None]).any(axis=1)
        corner, facet = corner[apart], facet[apart]
    x = own.points[corners.node[corner]]
    if only_overlaps and _all_outside(x, other, facet):
        return nothing(own.dim)
    feet = project(other, facet, x)
    apart, normal = x - feet.foot, interpolated_normals(other, facet, feet.xi)
    gap, distance = dot(apart, normal), sizes(apart)
    nearest = np.full(len(corners.node), np.inf)
    np.minimum.at(nearest, corner, distance)
    good = distance <= nearest[corner] + SOLVED * other.lengths[facet]
    # beyond an end: its node is the closest point only if it is that of the next facet, too
    twin = other.twins[facet, feet.place]
    outward, there = across_edges(other, feet, twin)
    at_node = -dot(apart, outward) <= GIVEN * other.lengths[twin // 2]
    at_node &= (twin >= 0) & (dot(feet.own, there) >= CORNER)
    good &= (feet.over <= GIVEN * other.lengths[facet]) | at_node
    good &= np.where(gap >= 0, distance <= limits[0], distance <= limits[1])
    return some(Met(corner, facet, feet.shape, normal, gap), good)


def _all_outside(points: Array, surface: ContactSurface, facet: Index) -> bool:
    """Return whether no point can lie in the body at its facet, as is soon seen of straight facets.

    The gap is then a mean, with positive weights, of the distances from both ends of the facet along
    the normals at both ends.
    """
    if surface.quadratic:
        return False
    ends = surface.points.take(surface.facets.take(facet, axis=0), axis=0)
    normals = surface.facet_node_normals.take(facet, axis=0)
    above = np.einsum("qid,qjd->qij", points[:, None] - ends, normals)
    # half of what only touches, as a mean of two unit vectors is shorter than one
    return bool(np.all(above >= -0.5 * GIVEN * surface.lengths.take(facet)[:, None, None]))


def _candidates(points: Array, surface: ContactSurface) -> tuple[Index, Index]:
    """Pairs of points and facets among which the closest facets to the points are."""
    middle = surface.points.take(surface.facets, axis=0).mean(axis=1)
    # no point of a facet, curved or not, is farther from its middle
    reach = surface.lengths
    found: list[tuple[Index, Index]] = [(np.zeros(0, dtype=np.intp),) * 2]
    block = max(1, PAIRS_AT_ONCE // len(middle))
    for start in range(0, len(points), block):
        away = sizes(points[start : start + block, None] - middle)
        point, facet = np.nonzero(away - reach <= (away + reach).min(axis=1, keepdims=True))
        found.append((start + point, facet))
    corner, facet = (np.concatenate(column) for column in zip(*found, strict=True))
    return corner, facet


def lean_of(corners: Corners, corner: Index, other: ContactSurface, facet: Index) -> Array:
    """Angle from the beginning of a corner's cone to the opposite of a facet's normal [rad]."""
    return _wrap(_direction(-other.facet_normals[facet]) - corners.first[corner])


def nothing(d: int) -> Met:
    """No corner that meets anything, in d dimensions."""
    none = np.zeros(0, dtype=np.intp)
    return Met(none, none, np.zeros((0, 2)), np.zeros((0, d)), np.zeros(0))


def some(met: Met, chosen: Index | Mask) -> Met:
    return Met(*(getattr(met, name)[chosen] for name in ("corner", "facet", "shape", "normal", "gap")))


def _direction(vectors: Array) -> Array:
    """Angles of plane vectors (n, 2), (n,) [rad]."""
    return np.asarray(np.arctan2(vectors[:, 1], vectors[:, 0]))


def _wrap(angle: Array) -> Array:
    """Angle in [-pi, pi)."""
    return np.asarray((angle + np.pi) % (2 * np.pi) - np.pi)
