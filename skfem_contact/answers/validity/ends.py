"""Where surfaces end: the way along a curve to its ends, and the rim of faces."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.digits import SOLVED
from skfem_contact.trees import Tree

Array = NDArray[np.float64]
Index = NDArray[np.intp]


def ways_to_ends(surface: ContactSurface, facet: Index, points: Array) -> tuple[Array, Array]:
    """Along the surface from points above facets to where it begins and ends; ``inf`` if it is closed.

    Parameters
    ----------
    surface : ContactSurface
    facet : ndarray of int, shape (m,)
    points : ndarray, shape (m, d)
    """
    number, before = np.arange(len(surface.facets)), surface.neighbours[:, 0]
    first = before != number - 1
    first[0] = True
    piece = np.cumsum(first) - 1
    total = np.bincount(piece, surface.lengths)
    start = np.cumsum(surface.lengths) - surface.lengths
    start = start - start[np.flatnonzero(first)][piece]
    closed = np.ones(len(total), dtype=bool)
    closed[piece[(surface.neighbours < 0).any(axis=1)]] = False
    a, b = surface.points[surface.facets[facet, 0]], surface.points[surface.facets[facet, 1]]
    along = (b - a) / np.linalg.norm(b - a, axis=1)[:, None]
    place = start[facet] + np.einsum("md,md->m", points - a, along)
    endless = closed[piece[facet]]
    return (
        np.where(endless, np.inf, place),
        np.where(endless, np.inf, total[piece[facet]] - place),
    )


class Rim:
    """The edges where a surface ends.

    Attributes
    ----------
    start, end : ndarray, shape (e, 3)
        Chords of the edges [length].
    outward : ndarray, shape (e, 3)
        Unit vectors out of the surface, in the plane of the face.
    """

    def __init__(self, start: Array, end: Array, normal: Array) -> None:
        self.start, self.end = start, end
        outward = np.cross(end - start, normal)
        self.outward = outward / np.linalg.norm(outward, axis=1, keepdims=True)
        self.tree = Tree(0.5 * (start + end)) if len(start) else None
        self.half = 0.5 * float(np.max(np.linalg.norm(end - start, axis=1), initial=0.0))

    @classmethod
    def of(cls, surface: ContactSurface) -> Rim:
        """That of a surface."""
        face, edge = np.nonzero(surface.twins < 0)
        corners = surface.facets[:, : surface.kind.corners]
        after = (edge + 1) % surface.kind.corners
        x = surface.points
        return cls(x[corners[face, edge]], x[corners[face, after]], surface.facet_normals[face])

    def at_least(self, points: Array) -> Array:
        """What points are away from the rim at least, (m,); ``inf`` where there is none [length]."""
        if self.tree is None:
            return np.full(len(points), np.inf)
        return np.maximum(self.tree.distances(points) - self.half, 0.0)

    def beyond(self, points: Array) -> Array:
        """How far points lie beyond the rim along the surface, negative above it, (p,) [length]."""
        assert self.tree is not None
        few = min(8, len(self.start))
        near = np.asarray(self.tree.query(points, k=few)[1]).reshape(len(points), few)
        way = self.end[near] - self.start[near]
        away = points[:, None] - self.start[near]
        part = np.clip(np.sum(away * way, axis=2) / np.sum(way**2, axis=2), 0.0, 1.0)
        away = away - part[..., None] * way
        distance = np.linalg.norm(away, axis=2)
        # of two edges that meet at the nearest corner the one that the point is farther out of
        out = np.sum(away * self.outward[near], axis=2)
        nearest = distance <= distance.min(axis=1, keepdims=True) * (1 + SOLVED)
        out = np.where(nearest, out, -np.inf).max(axis=1)
        return np.where(out > 0, 1.0, -1.0) * distance.min(axis=1)
