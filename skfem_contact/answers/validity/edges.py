"""Sharp edges of two solids that cross each other, between the nodes of both.

Edges that cross inside each other are overlaps that the nodes of neither boundary tell. Where they only
touch, node by node, forces act along normals of faces and not across both edges.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from skfem_contact.answers.thresholds import A_TENTH, OVERLAP
from skfem_contact.arrays import Array, Index, dot
from skfem_contact.bodies.facet_kinds import area_vectors
from skfem_contact.bodies.normal_field import CIRCLE, twin_edges
from skfem_contact.bodies.selection import seen_from_outside
from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.digits import GIVEN
from skfem_contact.pairing.closest import LEAN
from skfem_contact.pairing.dual import OVERHANG
from skfem_contact.records import dataclass
from skfem_contact.trees import Tree

# Turn of a boundary from which on an edge is sharp [rad]: with less it may stand for a curve of 16
# faces to the circle (`bodies.normal_field.CIRCLE`), also just that and round-off.
SHARP = float(2 * np.pi / CIRCLE * (1 + GIVEN))


@dataclass(frozen=True)
class Crossing:
    """The deepest crossing of two edges, or the nearest one where they only touch.

    Attributes
    ----------
    count : int
        Pairs of edges that are too deep in each other; zero where they touch.
    depth : float
        [length]
    place : ndarray, shape (3,)
        [length]
    across : ndarray, shape (3,)
        Unit vector across both edges.
    """

    count: int
    depth: float
    place: Array
    across: Array


def crossing(
    edges: Sequence[Edges],
    points: Sequence[Array],
    added: Array,
    approach: float,
    noise: float,
) -> Crossing | None:
    """Measure how edges of two solids cross.

    Parameters
    ----------
    edges : two of Edges
        Of the secondary and the primary, as they are meshed.
    points : two of ndarray, shape (m, 3)
        Where their nodes are [length].
    added : ndarray, shape (m,)
        What the user has the gaps be larger than the meshes say, at the secondary's nodes [length].
    approach, noise : float
        What the bodies take up elastically, and round-off of places [length].
    """
    one, other = (own.at(x) for own, x in zip(edges, points, strict=True))
    # what touches has been moved aside by no more than the approach
    depth, place, across = crossings(one, other, apart=max(noise, approach))
    if not len(depth):
        return None
    if added.any():
        depth = depth - added[Tree(points[0]).nearest(place)]
    i, count = int(np.argmax(depth)), int(np.count_nonzero(depth > max(noise, OVERLAP * approach)))
    return Crossing(count, float(depth[i]), place[i], across[i])


def pressed_aside(found: Crossing, side: ContactSurface, normal: Array, closed: Index) -> bool:
    """Return whether the point that presses where two edges touch does so in another direction.

    Parameters
    ----------
    found : Crossing
    side : ContactSurface
        The secondary, as it is meshed.
    normal : ndarray, shape (m, 3)
        Along which its points press.
    closed : ndarray of int
        Those that do.
    """
    if not len(closed):
        return False
    apart = np.linalg.norm(side.points[closed] - found.place, axis=1)
    if apart.min() > side.lengths.max():
        return False
    along = abs(float(normal[closed[np.argmin(apart)]] @ found.across))
    return bool(along < np.cos(3 * A_TENTH))  # edges lean with the strains of their bodies


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
    n = area_vectors(x)
    n /= np.maximum(np.linalg.norm(n, axis=1, keepdims=True), np.finfo(float).tiny)
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
    convex = (dot(n[face], n[there]) < np.cos(SHARP)) & (
        dot(x[there].mean(axis=1) - middle, n[face]) < 0
    )
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
    axis = np.cross(first, last)
    # normals that are opposite, of two lips of a slit, leave no direction between them
    axis /= np.maximum(np.linalg.norm(axis, axis=1, keepdims=True), np.finfo(float).tiny)
    begin, end = dot(np.cross(first, way), axis), dot(np.cross(way, last), axis)
    return np.asarray((begin > LEAN) & (end > LEAN) & (dot(first + last, way) > 0))
