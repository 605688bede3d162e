"""Deformed boundaries against each other and against obstacles: overlaps and gaps, seen from outside.

The boundary of every body, moved by its displacement, is a set of simplices: straight pieces in the
plane, triangles in space; a curved facet gives several. A point is inside where a ray from it meets an
odd number of them. The ray has a direction that no mesh has, so that it hits no corner or edge. This
knows of no surface, partner or normal of the contact modules, and shares no code with them: what they
overlook is seen here.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

from skfem_contact.arrays import (
    AT_ONCE,
    Array,
    Index,
    Mask,
    across,
    dot,
    off_segments,
    ragged,
    unit_vectors,
)
from skfem_contact.bodies.body import Body
from skfem_contact.bodies.facet_kinds import FacetKind, area_vectors, kind_of
from skfem_contact.bodies.normal_field import POLYGON, twin_edges
from skfem_contact.bodies.selection import facet_nodes, node_dofs, seen_from_outside
from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.digits import SOLVED
from skfem_contact.pairing.closest import LEAN
from skfem_contact.pairing.dual import OVERHANG
from skfem_contact.records import dataclass
from skfem_contact.trees import Tree

#: Straight pieces that a quadratic facet is drawn with: they miss 1/64 of its sagitta. More do no harm.
PIECES = 8

#: The direction of rays in space, its first two in the plane: of no mesh that has a reason.
RAY = np.array([0.8127, 0.3491, 0.4669])
#: Directions across it, by the dimension.
ACROSS = {d: np.linalg.svd(RAY[None, :d])[2][1:] for d in (2, 3)}


@dataclass(frozen=True, eq=False)
class Boundary:
    """The boundary of a body as simplices.

    Attributes
    ----------
    corners : ndarray, shape (s, d, d)
        Of pieces or triangles, in any order and sense [length].
    nodes : ndarray, shape (b, d)
        Which lie on the boundary itself; what is drawn between them is off a curved one [length].

    Examples
    --------
    A triangle in the plane and a tetrahedron, with points in and beside them:

    >>> x = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    >>> triangle = Boundary(x[[[0, 1], [1, 2], [2, 0]]], x)
    >>> triangle.depth(np.array([[0.25, 0.25], [0.75, 0.75]])).tolist()
    [0.25, 0.0]
    >>> x = np.vstack([np.zeros(3), np.eye(3)])
    >>> tetrahedron = Boundary(x[[[0, 1, 2], [0, 1, 3], [0, 2, 3], [1, 2, 3]]], x)
    >>> tetrahedron.depth(np.array([[0.1, 0.2, 0.3], [0.5, 0.5, 0.5], [-1, 0, 0]])).tolist()
    [0.1, 0.0, 0.0]
    """

    corners: Array
    nodes: Array

    @cached_property
    def box(self) -> tuple[Array, Array]:
        """Least and largest coordinates, (d,) each [length]."""
        return self.corners.min(axis=(0, 1)), self.corners.max(axis=(0, 1))

    def samples(self, box: tuple[Array, Array]) -> Array:
        """Corners, middles of edges and of all simplices that lie in a box, each once, (p, d)."""
        x = self.corners
        edges = 0.5 * (x + np.roll(x, -1, axis=1))
        d = x.shape[2]
        points = np.concatenate([x.reshape(-1, d), edges.reshape(-1, d), x.mean(axis=1)])
        return np.unique(points[within(points, box)], axis=0)

    def inside(self, points: Array) -> Mask:
        """Return which points lie inside, shape (p,).

        A simplex is compared only with the points in its strips of one axis across the ray that lie
        beside it along the last one: sorted by strip, then along it, these follow each other.
        """
        out = np.zeros(len(points), dtype=bool)
        near = np.flatnonzero(within(points, self.box))
        if not len(near):
            return out
        start, lowest, highest, normal = self._across
        p = points[near] @ ACROSS[points.shape[1]].T
        near, p = near[order := np.argsort(p[:, -1])], p[order]
        n, origin = len(near), lowest[:, 0].min()
        width = np.mean(highest[:, 0] - lowest[:, 0]) or 1.0

        def strip(x: Array) -> Index:
            return np.asarray((x - origin) // width, dtype=np.intp)

        key = strip(p[:, 0]) * n + np.arange(n)
        by_strip = np.argsort(key)
        key = key[by_strip]
        first, last = strip(lowest[:, 0]), strip(highest[:, 0])
        simplex = np.repeat(np.arange(len(first)), last - first + 1)
        begin = ragged(first, last - first + 1) * n
        low = np.searchsorted(p[:, -1], lowest[:, -1], side="left")[simplex]
        high = np.searchsorted(p[:, -1], highest[:, -1], side="right")[simplex]
        first = np.searchsorted(key, begin + low)
        count = np.searchsorted(key, begin + high) - first
        met = np.zeros(n, dtype=np.intp)
        for some in _blocks(count):
            t = np.repeat(simplex[some], count[some])
            row = by_strip[ragged(first[some], count[some])]
            beside = (p[row, 0] >= lowest[t, 0]) & (p[row, 0] <= highest[t, 0])
            row, t = row[beside], t[beside]
            side = _sides(start[t], p[row])
            hit = np.all(side > 0, axis=1) | np.all(side < 0, axis=1)
            row, t = row[hit], t[hit]
            # where the ray meets the line or plane of the simplex: ahead or behind
            height = np.einsum("pd,pd->p", self.corners[t, 0] - points[near[row]], normal[t])
            ahead = height * (normal[t] @ RAY[: points.shape[1]]) > 0
            met += np.bincount(row[ahead], minlength=n)
        out[near] = met % 2 == 1
        return out

    @cached_property
    def _across(self) -> tuple[Array, Array, Array, Array]:
        """Seen along the ray: corners and bounds of the simplices; and their normals, of any length."""
        x = self.corners @ ACROSS[self.corners.shape[2]].T  # (s, d, d - 1)
        normal = across(self.corners[:, 1:] - self.corners[:, :1])
        return x, x.min(axis=1), x.max(axis=1), normal

    @cached_property
    def _tree(self) -> tuple[Tree, Array]:
        """Middles of the simplices, and how far the corners of each are from its own at most, (s,)."""
        middle = self.corners.mean(axis=1)
        return Tree(middle), np.linalg.norm(self.corners - middle[:, None], axis=2).max(axis=1)

    def distance(self, points: Array) -> Array:
        """Distances of points from the boundary, shape (p,) [length]."""
        tree, radius = self._tree
        middle = tree.points
        near = self._met_by(points, 0.0)  # where points are, or any will do for a bound
        first = near[Tree(middle[near]).nearest(points)]
        out = _to_simplices(points, self.corners[first])
        out = np.minimum(out, np.linalg.norm(points - middle[first], axis=1))
        near = self._met_by(points, np.max(out, initial=0.0))
        candidates = Tree(middle[near]).query_ball_point(points, out + np.max(radius[near]))
        count = np.array([len(found) for found in candidates], dtype=np.intp)
        for some in _blocks(count):
            row = np.repeat(some, count[some])
            which = near[np.concatenate([np.asarray(candidates[k], dtype=np.intp) for k in some])]
            away = np.linalg.norm(points[row] - middle[which], axis=1)
            meets = away <= out[row] + radius[which]  # of one simplex: they differ in size
            row, which = row[meets], which[meets]
            np.minimum.at(out, row, _to_simplices(points[row], self.corners[which]))
        return out

    def _met_by(self, points: Array, distance: float) -> Index:
        """Simplices whose boxes meet that of points, or are no farther from it; all if none does."""
        low = points.min(axis=0, initial=np.inf) - distance
        high = points.max(axis=0, initial=-np.inf) + distance
        x = self.corners
        met = np.all((x.min(axis=1) <= high) & (x.max(axis=1) >= low), axis=1)
        return np.flatnonzero(met if met.any() else ~met)

    def depth(self, points: Array) -> Array:
        """Return how deep points lie inside, zero outside, shape (p,) [length]."""
        out, inside = np.zeros(len(points)), self.inside(points)
        if inside.any():
            out[inside] = self.distance(points[inside])
        return out

    def inner(self, points: Array, length: float) -> tuple[Array, Array]:
        """Points inside that may lie deeper than a length, and how deep they do, (p, d) and (p,)."""
        points = points[within(points, self.box)]
        if len(points):
            # in contact one simplex shows of nearly all that they are next to it, inside or not
            nearest, first = self._tree[0].query(points)
            points = points[np.minimum(_to_simplices(points, self.corners[first]), nearest) > length]
            points = points[self.inside(points)]
        return points, self.distance(points) if len(points) else np.zeros(0)

    def signed(self, points: Array) -> Array:
        """Distances of points, negative inside, shape (p,) [length]."""
        return np.where(self.inside(points), -1.0, 1.0) * self.distance(points)


@dataclass(frozen=True, eq=False)
class BoundaryNodes:
    """The nodes on the whole boundary of a body, of which nobody asks normals or areas.

    Attributes
    ----------
    body : Body
    kind : FacetKind
    points : ndarray, shape (b, d)
        Undeformed [length].
    dofs : ndarray of int, shape (b, d)
        Of the body.
    facets : ndarray of int, shape (f, k)
        Numbers of points.
    """

    body: Body
    kind: FacetKind
    points: Array
    dofs: NDArray[np.int32]
    facets: Index

    @classmethod
    def of(cls, body: Body) -> BoundaryNodes:
        """Those of a body."""
        basis, mesh = body.basis, body.basis.mesh
        nodes = facet_nodes(mesh, basis, *seen_from_outside(mesh, mesh.boundary_facets()))
        some, facets = np.unique(nodes, return_inverse=True)
        dofs = node_dofs(basis, some, body.components)
        points = basis.doflocs[:, dofs[:, 0]].T
        return cls(body, kind_of(body.dim, nodes.shape[1]), points, dofs, facets.reshape(nodes.shape))

    def displaced(self, u: Array) -> Boundary:
        """The boundary displaced by u (n_body,) [length]."""
        weights, simplices = _drawing(self.kind)
        points = self.points + u[self.dofs]
        x = points[self.facets]
        if weights is not None:
            x = np.einsum("qk,fkd->fqd", weights, x)
        d = points.shape[1]
        return Boundary(np.ascontiguousarray(x[:, simplices].reshape(-1, d, d)), points)


def boundary(body: Body, u: Array) -> Boundary:
    """The whole boundary of a body, displaced by u (n_body,) [length]."""
    return BoundaryNodes.of(body).displaced(u)


def within(points: Array, box: tuple[Array, Array]) -> Mask:
    """Return which points (p, d) lie in a box of least and largest coordinates, its sides included."""
    low, high = box
    return np.asarray(np.all((points >= low) & (points <= high), axis=1))


@lru_cache
def _drawing(kind: FacetKind) -> tuple[Array | None, Index]:
    """How facets of a kind are drawn: places by their nodes, where these are not enough; simplices."""
    if kind.dim == 1 and kind.quadratic:
        at = np.linspace(0.0, 1.0, PIECES + 1)
        return kind.shapes(at[:, None])[0], np.stack([np.arange(PIECES), 1 + np.arange(PIECES)], axis=1)
    if not kind.centreless:
        return None, kind.simplices
    return np.vstack([np.eye(kind.nodes), kind.shapes(kind.middle)[0]]), kind.simplices


def _sides(corners: Array, points: Array) -> Array:
    """Numbers (p, d) that have one sign where a point is in a simplex, both seen along the ray."""
    away = points[:, None] - corners
    if corners.shape[2] == 1:
        return np.asarray(away[..., 0] * [1.0, -1.0])
    rise = np.roll(corners, -1, axis=1) - corners
    return np.asarray(rise[..., 0] * away[..., 1] - rise[..., 1] * away[..., 0])


def _to_simplices(points: Array, corners: Array) -> Array:
    """Distances of points (p, d) from one piece or triangle each, (p, d, d)."""
    side = np.roll(corners, -1, axis=1) - corners
    away = points[:, None] - corners
    to_edges = np.linalg.norm(off_segments(points[:, None], corners, side), axis=2).min(axis=1)
    if points.shape[1] == 2:
        return np.asarray(to_edges)
    normal = np.cross(side[:, 0], -side[:, 2])
    size = np.linalg.norm(normal, axis=1)
    height = np.abs(np.einsum("pd,pd->p", away[:, 0], normal)) / np.maximum(size, np.finfo(float).tiny)
    turn = np.einsum("psd,pd->ps", np.cross(side, away), normal)
    above = np.all(turn >= 0, axis=1) & (size > 0)
    return np.asarray(np.where(above, np.minimum(height, to_edges), to_edges))


def _blocks(count: Index) -> list[Index]:
    """Items in parts whose pairs are compared at once, from how many each has."""
    ends, most = np.cumsum(count), AT_ONCE // 100  # what a pair takes, about
    parts = np.arange(most, ends[-1:].sum(), most)
    found = np.split(np.arange(len(count)), np.searchsorted(ends, parts))
    return [part for part in found if len(part)]


# -- edges of solids ------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Edges:
    """Convex edges of the boundary of a body, at the faces of one surface.

    Attributes
    ----------
    ends : ndarray of int, shape (e, 2)
        Nodes of the surface.
    corners : ndarray of int, shape (e, 2, c)
        Those of both faces beside each edge, where they belong to the surface.
    face : ndarray of int, shape (e, 2)
        Faces of the surface beside each edge; -1 for one that does not belong to it.
    normal : ndarray, shape (e, 2, 3)
        Outward normals of both faces.
    points : ndarray, shape (e, 2, 3)
        Where the ends are [length].
    room : ndarray, shape (e,)
        Half of the shortest edge of the two faces: what lies deeper is another part of the
        boundary [length].
    """

    ends: Index
    corners: Index
    face: Index
    normal: Array
    points: Array
    room: Array

    def at(self, points: Array) -> Edges:
        """The same edges with the nodes of the surface at other places, (m, 3).

        Faces that do not belong to it have not turned.
        """
        normal = area_vectors(points[self.corners])
        normal /= np.maximum(np.linalg.norm(normal, axis=2, keepdims=True), np.finfo(float).tiny)
        normal = np.where((self.face >= 0)[..., None], normal, self.normal)
        return replace(self, normal=normal, points=points[self.ends])


def sharp_edges_of(surface: ContactSurface) -> Edges:
    """Convex edges at which the boundary of the body turns by more than the pieces of a curve do.

    Those between two faces of the surface, and those at which it ends.
    """
    mesh, basis = surface.body.basis.mesh, surface.body.basis
    numbers, corners = seen_from_outside(mesh, mesh.boundary_facets())
    x = np.transpose(mesh.p[:, corners], (1, 2, 0))
    n = unit_vectors(area_vectors(x))
    twins, c = twin_edges(corners), corners.shape[1]
    face, edge = np.nonzero(twins >= 0)
    there = twins[face, edge] // c
    once = face < there
    face, edge, there = face[once], edge[once], there[once]
    ends = np.stack([corners[face, edge], corners[face, (edge + 1) % c]], axis=1)
    # numbers in the surface
    mine = np.full(mesh.facets.shape[1], -1)
    mine[surface.mesh_facets] = np.arange(len(surface.mesh_facets))
    faces = mine[numbers[np.stack([face, there], axis=1)]]
    middle = mesh.p[:, ends].mean(axis=2).T
    convex = (dot(n[face], n[there]) < POLYGON) & (dot(x[there].mean(axis=1) - middle, n[face]) < 0)
    some = np.flatnonzero(convex & (faces >= 0).any(axis=1))
    face, there, ends, faces = face[some], there[some], ends[some], faces[some]
    place = np.full(surface.body.n, -1)
    place[surface.dofs[:, 0]] = np.arange(len(surface.points))
    shortest = np.linalg.norm(x - np.roll(x, -1, axis=1), axis=2).min(axis=1)
    return Edges(
        ends=place[basis.nodal_dofs[0, ends]],
        corners=surface.facets[:, :c][faces],
        face=faces,
        normal=np.stack([n[face], n[there]], axis=1),
        points=np.moveaxis(mesh.p[:, ends], 0, -1),
        room=0.5 * np.minimum(shortest[face], shortest[there]),
    )


def crossings(one: Edges, other: Edges, apart: float = 0.0) -> tuple[Array, Array, Array]:
    """Depths (p,) and places (p, 3) where edges of two bodies cross, each inside the other body.

    And the unit vectors (p, 3) across both edges, from the first body to the second. Edges that are
    not farther than `apart` from each other count as well, with negative depths.

    >>> import numpy as np
    >>> up, down = (
    ...     np.array([[[0, 1, 1], [0, -1, 1]]]) / 2**0.5,
    ...     np.array([[[1, 0, -1], [-1, 0, -1]]]) / 2**0.5,
    ... )
    >>> def ridge(normal, points):
    ...     return Edges(
    ...         np.array([[0, 1]]),
    ...         np.zeros((1, 2, 4), int),
    ...         np.array([[0, 1]]),
    ...         normal,
    ...         np.array([points]),
    ...         np.ones(1),
    ...     )
    >>> depth, place, across = crossings(
    ...     ridge(up, [[-1.0, 0, 0], [1.0, 0, 0]]), ridge(down, [[0, -1.0, -0.1], [0, 1.0, -0.1]])
    ... )
    >>> depth.round(12).tolist(), place.round(12).tolist(), across.tolist()
    ([0.1], [[0.0, 0.0, -0.05]], [[0.0, 0.0, 1.0]])
    """
    empty = np.zeros(0), np.zeros((0, 3)), np.zeros((0, 3))
    if not (len(one.ends) and len(other.ends)):
        return empty
    a, b = one.points, other.points
    half = [0.5 * np.linalg.norm(x[:, 1] - x[:, 0], axis=1).max() for x in (a, b)]
    i, j = Tree(a.mean(axis=1)).pairs(b.mean(axis=1), half[0] + half[1])
    way = a[i, 1] - a[i, 0], b[j, 1] - b[j, 0]
    length = [np.linalg.norm(w, axis=1) for w in way]
    across = np.cross(*way)
    size = np.linalg.norm(across, axis=1)
    some = np.flatnonzero(size > LEAN * length[0] * length[1])  # others are parallel
    if not len(some):  # as a rule
        return empty
    i, j, across = i[some], j[some], across[some] / size[some, None]
    first, second = way[0][some], way[1][some]
    across *= np.where(dot(across, one.normal[i].sum(axis=1)) < 0, -1.0, 1.0)[:, None]
    seen = _between(one.normal[i], across) & _between(other.normal[j], -across)
    # where the lines are closest
    away = b[j, 0] - a[i, 0]
    up = np.cross(first, second)
    square = dot(up, up)
    s = dot(np.cross(away, second), up) / square
    t = dot(np.cross(away, first), up) / square
    beyond = np.maximum(np.abs(s - 0.5), np.abs(t - 0.5)) - 0.5
    # where an edge goes on in the next one, bent, two may pass both crossings by
    seen &= beyond <= (OVERHANG if apart > 0 else 0.0)
    depth = -dot(away, across)
    depth = np.where(beyond > 0, np.minimum(depth, 0.0), depth)
    seen &= (depth > -apart) & (depth < np.minimum(one.room[i], other.room[j]))
    place = 0.5 * (a[i, 0] + s[:, None] * first + b[j, 0] + t[:, None] * second)
    return depth[seen], place[seen], across[seen]


def _between(normals: Array, way: Array) -> NDArray[np.bool_]:
    """Return whether directions (p, 3) across edges lie between the normals (p, 2, 3) beside them."""
    first, last = normals[:, 0], normals[:, 1]
    # normals that are opposite, of two lips of a slit, leave no direction between them
    axis = unit_vectors(np.cross(first, last))
    begin, end = dot(np.cross(first, way), axis), dot(np.cross(way, last), axis)
    return np.asarray((begin > LEAN) & (end > LEAN) & (dot(first + last, way) > 0))


# -- where surfaces end ---------------------------------------------------------------------------


class Rim:
    """The rim of a surface: the end points of a curve, or the edges of faces.

    Attributes
    ----------
    corners : ndarray, shape (e, d - 1, d)
        Ends of curves, or of the chords of edges [length].
    outward : ndarray, shape (e, d)
        Unit vectors out of the surface, in the plane of the facet.
    """

    def __init__(self, corners: Array, outward: Array) -> None:
        self.corners = corners
        self.outward = outward / np.linalg.norm(outward, axis=1, keepdims=True)
        middle = corners.mean(axis=1)
        self.tree = Tree(middle) if len(corners) else None
        self.half = float(np.max(np.linalg.norm(corners[:, 0] - middle, axis=1), initial=0.0))

    @classmethod
    def of(cls, surface: ContactSurface) -> Rim:
        """Say that of a surface."""
        x, c = surface.points, surface.kind.corners
        facet, edge = np.nonzero(surface.twins < 0)
        ends = x[surface.facets[facet[:, None], np.column_stack([edge, (edge + 1) % c])]]
        if surface.dim == 2:
            return cls(ends[:, :1], ends[:, 0] - ends[:, 1])
        return cls(ends, np.cross(ends[:, 1] - ends[:, 0], surface.facet_normals[facet]))

    def at_least(self, points: Array) -> Array:
        """What points are away from the rim at least, (m,); ``inf`` where there is none [length]."""
        if self.tree is None:
            return np.full(len(points), np.inf)
        return np.maximum(self.tree.distances(points) - self.half, 0.0)

    def beyond(self, points: Array) -> Array:
        """How far points lie beyond the rim along the surface, negative above it, (p,) [length]."""
        if self.tree is None:
            return np.full(len(points), -np.inf)
        few = min(8, len(self.corners))
        near = np.asarray(self.tree.query(points, k=few)[1]).reshape(len(points), few)
        start, end = self.corners[near, 0], self.corners[near, -1]
        away = off_segments(points[:, None], start, end - start)
        distance = np.linalg.norm(away, axis=2)
        # where two edges meet at the nearest corner the sum of both tells, of notches and holes as well
        out = np.sum(away * self.outward[near], axis=2)
        nearest = distance <= distance.min(axis=1, keepdims=True) * (1 + SOLVED)
        out = np.sum(out, axis=1, where=nearest)
        return np.where(out > 0, 1.0, -1.0) * distance.min(axis=1)
