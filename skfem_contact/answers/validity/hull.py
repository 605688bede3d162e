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

from skfem_contact.answers.thresholds import PAIRS_AT_ONCE
from skfem_contact.answers.validity.overlap import within
from skfem_contact.bodies.body import Body
from skfem_contact.bodies.facet_kinds import kind_of
from skfem_contact.bodies.facets import seen_from_outside
from skfem_contact.bodies.nodes import facet_nodes, node_dofs
from skfem_contact.pairing.vectors import ragged
from skfem_contact.trees import Tree

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

    @cached_property
    def box(self) -> tuple[Array, Array]:
        """Least and largest coordinates, (3,) each [length]."""
        return self.corners.min(axis=(0, 1)), self.corners.max(axis=(0, 1))

    def samples(self, box: tuple[Array, Array]) -> Array:
        """Corners, middles of edges and of all triangles that lie in a box, each once, (p, 3)."""
        x = self.corners
        edges = 0.5 * (x + np.roll(x, -1, axis=1))
        points = np.concatenate([x.reshape(-1, 3), edges.reshape(-1, 3), x.mean(axis=1)])
        return np.unique(points[within(points, box)], axis=0)

    def inside(self, points: Array) -> Mask:
        """Which points lie inside, shape (p,).

        A triangle is compared only with the points that lie beside it along one axis across the ray:
        among points that are sorted along it these follow each other.
        """
        out = np.zeros(len(points), dtype=bool)
        near = np.flatnonzero(within(points, self.box))
        if not len(near):
            return out
        start, rise, lowest, highest, normal = self._across
        p = points[near] @ ACROSS.T
        order = np.argsort(p[:, 0])
        near, p = near[order], p[order]
        first = np.searchsorted(p[:, 0], lowest[:, 0], side="left")
        count = np.searchsorted(p[:, 0], highest[:, 0], side="right") - first
        met = np.zeros(len(near), dtype=np.intp)
        for some in _blocks(count):
            t = np.repeat(some, count[some])
            row = ragged(first[some], count[some])
            beside = (p[row, 1] >= lowest[t, 1]) & (p[row, 1] <= highest[t, 1])
            row, t = row[beside], t[beside]
            away = p[row, None] - start[t]
            side = rise[t, :, 0] * away[..., 1] - rise[t, :, 1] * away[..., 0]
            hit = np.all(side > 0, axis=1) | np.all(side < 0, axis=1)
            row, t = row[hit], t[hit]
            # where the ray meets the plane of the triangle: ahead or behind
            height = np.einsum("pd,pd->p", self.corners[t, 0] - points[near[row]], normal[t])
            ahead = height * (normal[t] @ RAY) > 0
            met += np.bincount(row[ahead], minlength=len(near))
        out[near] = met % 2 == 1
        return out

    @cached_property
    def _across(self) -> tuple[Array, Array, Array, Array, Array]:
        """Seen along the ray: corners, edges and bounds of the triangles; and their normals."""
        x = self.corners @ ACROSS.T  # (t, 3, 2)
        edges = self.corners[:, 1:] - self.corners[:, :1]
        rise = np.roll(x, -1, axis=1) - x
        return x, rise, x.min(axis=1), x.max(axis=1), np.cross(edges[:, 0], edges[:, 1])

    @cached_property
    def _tree(self) -> tuple[Any, float]:
        """Middles of the triangles, and how far their corners are from these at most."""
        middle = self.corners.mean(axis=1)
        return Tree(middle), float(np.linalg.norm(self.corners - middle[:, None], axis=2).max())

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
    # no surface that can touch: of this boundary nobody asks normals or areas
    basis = body.basis
    numbers, vertices = seen_from_outside(basis.mesh, basis.mesh.boundary_facets())
    nodes = facet_nodes(basis, numbers, vertices)
    dofs = node_dofs(basis, nodes.ravel(), body.components)
    x = (basis.doflocs[:, dofs[:, 0]].T + u[dofs]).reshape(*nodes.shape, -1)
    kind = kind_of(3, nodes.shape[1])
    if kind.centreless:
        N, _ = kind.shapes(kind.middle)
        x = np.concatenate([x, np.einsum("k,fkd->fd", N, x)[:, None]], axis=1)
    return Hull(np.ascontiguousarray(x[:, kind.triangles].reshape(-1, 3, 3)))


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


def _blocks(count: Index) -> list[Index]:
    """Triangles in parts that have not too many pairs, from how many each has."""
    ends = np.cumsum(count)
    parts = np.arange(PAIRS_AT_ONCE, ends[-1], PAIRS_AT_ONCE)
    return np.split(np.arange(len(count)), np.searchsorted(ends, parts))
