"""Do deformed solids overlap? Judged from outside, as `overlap` does it in the plane.

The boundary of every body, moved by its displacement, is a set of triangles. A point is inside where a
ray from it meets an odd number of them. The ray has a direction that no mesh has, so that it hits no
edge. This shares no code with the search for partners, and no word of contact.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skfem_contact.answers.contours import TRIANGLES
from skfem_contact.answers.thresholds import PAIRS_AT_ONCE
from skfem_contact.bodies.body import Body
from skfem_contact.trees import kd_tree

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Mask = NDArray[np.bool_]

#: The direction of rays, and two across it: of no mesh that has a reason.
RAY = np.array([0.8127, 0.3491, 0.4669])
ACROSS = np.linalg.svd(RAY[None])[2][1:]


@dataclass(frozen=True, eq=False)
class Hull:
    """The boundary of a solid as triangles.

    Attributes
    ----------
    corners : ndarray, shape (t, 3, 3)
        Of the triangles, in any order and sense [length].

    Examples
    --------
    A tetrahedron, and three points:

    >>> x = np.vstack([np.zeros(3), np.eye(3)])
    >>> hull = Hull(x[[[0, 1, 2], [0, 1, 3], [0, 2, 3], [1, 2, 3]]])
    >>> hull.depth(np.array([[0.1, 0.2, 0.3], [0.5, 0.5, 0.5], [-1, 0, 0]])).tolist()
    [0.1, 0.0, 0.0]
    """

    corners: Array

    @property
    def samples(self) -> Array:
        """Corners, middles of edges and of all triangles, each once, (p, 3)."""
        x = self.corners
        edges = 0.5 * (x + np.roll(x, -1, axis=1))
        points = np.concatenate([x.reshape(-1, 3), edges.reshape(-1, 3), x.mean(axis=1)])
        return np.unique(points, axis=0)

    def inside(self, points: Array) -> Mask:
        """Which points lie inside, shape (p,)."""
        out = np.zeros(len(points), dtype=bool)
        low, high = self.corners.min(axis=(0, 1)), self.corners.max(axis=(0, 1))
        near = np.flatnonzero(np.all((points >= low) & (points <= high), axis=1))
        x = self.corners @ ACROSS.T  # (t, 3, 2)
        start, rise = x, np.roll(x, -1, axis=1) - x
        lowest, highest = x.min(axis=1), x.max(axis=1)
        normal = np.cross(
            self.corners[:, 1] - self.corners[:, 0], self.corners[:, 2] - self.corners[:, 0]
        )
        for some in _blocks(near, len(x)):
            p = points[some] @ ACROSS.T
            row, t = np.nonzero(np.all((p[:, None] >= lowest) & (p[:, None] <= highest), axis=2))
            away = p[row, None] - start[t]
            side = rise[t, :, 0] * away[..., 1] - rise[t, :, 1] * away[..., 0]
            hit = np.all(side > 0, axis=1) | np.all(side < 0, axis=1)
            row, t = row[hit], t[hit]
            # where the ray meets the plane of the triangle: ahead or behind
            height = np.einsum("pd,pd->p", self.corners[t, 0] - points[some][row], normal[t])
            ahead = height * (normal[t] @ RAY) > 0
            out[some] = np.bincount(row[ahead], minlength=len(some)) % 2 == 1
        return out

    @cached_property
    def _tree(self) -> tuple[Any, float]:
        """Middles of the triangles, and how far their corners are from these at most."""
        middle = self.corners.mean(axis=1)
        return kd_tree(middle), float(np.linalg.norm(self.corners - middle[:, None], axis=2).max())

    def distance(self, points: Array) -> Array:
        """Distances of points from the boundary, shape (p,) [length]."""
        tree, radius = self._tree
        nearest, first = tree.query(points)
        bound = _to_triangles(points, self.corners[first])
        out = np.minimum(bound, nearest)
        candidates = tree.query_ball_point(points, bound + radius)
        count = np.array([len(found) for found in candidates], dtype=np.intp)
        for some in np.array_split(np.arange(len(points)), 1 + count.sum() // PAIRS_AT_ONCE):
            if not len(some):
                continue
            row = np.repeat(some, count[some])
            which = np.concatenate([np.asarray(candidates[k], dtype=np.intp) for k in some])
            np.minimum.at(out, row, _to_triangles(points[row], self.corners[which]))
        return out

    def depth(self, points: Array) -> Array:
        """How deep points lie inside, zero outside, shape (p,) [length]."""
        out, inside = np.zeros(len(points)), self.inside(points)
        if inside.any():
            out[inside] = self.distance(points[inside])
        return out

    def signed(self, points: Array) -> Array:
        """Distances of points, negative inside, shape (p,) [length]."""
        return np.where(self.inside(points), -1.0, 1.0) * self.distance(points)


def hull(body: Body, u: Array) -> Hull:
    """The whole boundary of a solid, displaced.

    Parameters
    ----------
    body : Body
    u : ndarray, shape (n_body,)
        Displacement of the body [length].
    """
    surface = body.surface(None)
    x = (surface.points + u[surface.dofs])[surface.facets]
    kind = surface.kind
    if kind.name in ("quad4", "quad8"):
        N, _ = kind.shapes(kind.middle)
        x = np.concatenate([x, np.einsum("k,fkd->fd", N, x)[:, None]], axis=1)
    return Hull(np.ascontiguousarray(x[:, np.array(TRIANGLES[kind.name])].reshape(-1, 3, 3)))


def _to_triangles(points: Array, corners: Array) -> Array:
    """Distances of points (p, 3) from one triangle each, (p, 3, 3)."""
    side = np.roll(corners, -1, axis=1) - corners
    away = points[:, None] - corners
    square = np.maximum(np.einsum("psd,psd->ps", side, side), np.finfo(float).tiny)
    part = np.clip(np.einsum("psd,psd->ps", away, side) / square, 0.0, 1.0)
    to_edges = np.linalg.norm(away - part[..., None] * side, axis=2).min(axis=1)
    normal = np.cross(side[:, 0], -side[:, 2])
    size = np.linalg.norm(normal, axis=1)
    height = np.abs(np.einsum("pd,pd->p", away[:, 0], normal)) / np.maximum(size, np.finfo(float).tiny)
    turn = np.einsum("psd,pd->ps", np.cross(side, away), normal)
    above = np.all(turn >= 0, axis=1) & (size > 0)
    return np.asarray(np.where(above, np.minimum(height, to_edges), to_edges))


def _blocks(numbers: Index, pieces: int) -> list[Index]:
    count = -(-len(numbers) * pieces // PAIRS_AT_ONCE)
    return np.array_split(numbers, count) if count else []
