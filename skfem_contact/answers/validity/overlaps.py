"""Overlaps of two bodies that contact conditions do not see, by their deformed boundaries.

The points of both surfaces, and those between them, are looked for in the whole body on the other
side, by what a step knows of displacements: those of contact surfaces and supports, extrapolated to the
rest of the boundary (`Extrapolation`). That is a suspicion: the verdict is that of `between`, with all
displacements. Where bodies slide far anything may come to overlap in any step; with small sliding
overlaps of solids grow as forces do, and `assess` looks once for every doubling.

Edges of solids that cross inside each other are overlaps that the nodes of neither boundary tell. Where
they only touch, node by node, forces act along normals of faces and not across both edges.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from skfem_contact.answers.answer import Answer
from skfem_contact.answers.validity.chords import drawn_off
from skfem_contact.answers.validity.deformed_boundaries import Boundary, BoundaryNodes, within
from skfem_contact.answers.validity.support import Extrapolation
from skfem_contact.answers.validity.track import ContactWatch
from skfem_contact.answers.validity.validity import A_TENTH, OVERLAP, Crossing, Drift, Meeting
from skfem_contact.arrays import Array, Index, Mask
from skfem_contact.bodies.body import Body
from skfem_contact.bodies.facets import area_vectors, seen_from_outside, twin_edges
from skfem_contact.bodies.selection import written
from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.conditions.contact import Contact
from skfem_contact.conditions.geometry import Geometry
from skfem_contact.digits import SOLVED
from skfem_contact.pairing.corners import unselected_sides
from skfem_contact.pairing.thresholds import LEAN, OVERHANG, SHARP
from skfem_contact.pairing.vectors import dot
from skfem_contact.records import dataclass
from skfem_contact.trees import Tree


class Overlaps:
    """The facts that are known beforehand of all contacts between two bodies that may overlap.

    Parameters
    ----------
    geometry : Geometry
    tracks : sequence of ContactWatch
        Of every contact.
    known : callable
        Gives the DOFs whose displacements are known without the interior.

    Attributes
    ----------
    far, near : list of int
        Contacts that slide far, to be looked at after every step, and solids with small sliding.
    """

    def __init__(
        self, geometry: Geometry, tracks: Sequence[ContactWatch], known: Callable[[], Index]
    ) -> None:
        self.geometry, self.system, self.contacts = geometry, geometry.system, geometry.contacts
        self.tracks, self.known = tracks, known
        self.held = np.asarray(self.system.D)
        two = [i for i, c in enumerate(self.contacts) if of_two_bodies(c)]
        self.far = [i for i in two if self.contacts[i].sliding == "finite"]
        self.near = [i for i in two if i not in self.far and self.contacts[i].secondary.dim == 3]

    @cached_property
    def nodes(self) -> dict[int, BoundaryNodes]:
        """The boundaries of all bodies that are looked at, by number."""
        bodies = {
            self.system.index(s.body) for i in self.far + self.near for s in sides_of(self.contacts[i])
        }
        return {
            b: BoundaryNodes.of(body)
            for b, body in enumerate(self.system.bodies)
            if b in bodies and isinstance(body, Body)
        }

    #: What is not known of them by surfaces that slide far, and by all contacts without the interior.
    beside_surfaces = cached_property(lambda self: self._beside(self.geometry.surface_dofs))
    beside_contacts = cached_property(lambda self: self._beside(self.known()))

    def _beside(self, dofs: Index) -> dict[int, Extrapolation]:
        known = np.zeros(self.system.n, dtype=bool)
        known[dofs] = True
        known[self.held] = True
        return {b: Extrapolation(self.system, nodes, known) for b, nodes in self.nodes.items()}

    @cached_property
    def chords(self) -> dict[int, list[float]]:
        """How far what is drawn of both sides stands off them, by the contact's number."""
        return {i: [drawn_off(s) for s in sides_of(self.contacts[i])] for i in self.far + self.near}

    @cached_property
    def edges(self) -> dict[int, list[Edges]]:
        """Edges of both sides of solids, by the contact's number."""
        solid = [i for i in self.far + self.near if self.contacts[i].secondary.dim == 3]
        return {i: [sharp_edges_of(s) for s in sides_of(self.contacts[i])] for i in solid}

    def look_far(self, result: Answer, drifts: Sequence[Drift]) -> frozenset[int]:
        """Numbers of contacts that slide far and seem to overlap by more than their bounds.

        By the drifts of all contacts, as far as a step knows them.
        """
        if not self.far:
            return frozenset()
        parts = self._filled(self.beside_surfaces, result.at_surfaces())
        return frozenset(i for i in self.far if self._seems(i, parts, result, drifts[i]))

    def look_near(self, i: int, result: Answer, drift: Drift) -> bool:
        """Whether solids with small sliding seem to, by displacements of contacts and supports."""
        if self._hidden(self.tracks[i]):
            return True
        parts = self._filled(self.beside_contacts, result.recover.at_contact())
        return self._seems(i, parts, result, drift)

    @staticmethod
    def _filled(beside: dict[int, Extrapolation], u: Array) -> dict[int, Array]:
        return {b: unknown.filled(u) for b, unknown in beside.items()}

    def _hidden(self, track: ContactWatch) -> bool:
        """Whether nodes in no row lie among those that are: only the interior knows their places."""
        known = np.zeros(self.system.n, dtype=bool)
        known[self.known()] = known[self.held] = True
        x = np.concatenate([track.points[track.paired], track.feet[track.paired]])
        if not len(x):
            return True
        room = float(np.max(np.abs(track.points - track.feet))) + float(np.max(track.sagittas))
        room += SOLVED * self.system.extent
        box = x.min(axis=0) - room, x.max(axis=0) + room
        return any(
            within(side.points[~known[self.system.slice(side.body)][side.dofs].all(axis=1)], box).any()
            for side in sides_of(track.contact)
        )

    def _seems(self, i: int, parts: dict[int, Array], result: Answer, drift: Drift) -> bool:
        """Whether a contact seems to overlap, by displacements of its bodies."""
        added = np.nan_to_num(self.tracks[i].gap_added(result))
        noise, sides = SOLVED * self.system.extent, sides_of(self.contacts[i])
        numbers = [self.system.index(side.body) for side in sides]
        places = [s.points + parts[b][s.dofs] for s, b in zip(sides, numbers, strict=True)]
        bodies = [self.nodes[b].displaced(parts[b]) for b in numbers]
        given = places, added, drift.approach, noise
        if any(self._beyond(i, k, bodies[1 - k], *given) for k in range(2)):
            return True
        return i in self.edges and crossing(self.edges[i], *given) is not None

    def _beyond(
        self,
        i: int,
        k: int,
        other: Boundary,
        places: Sequence[Array],
        added: Array,
        approach: float,
        noise: float,
    ) -> bool:
        """Whether points of one side of a contact lie in the other body, deeper than their bound.

        The bound is that of `ContactValidity.excess`, with what is known of the approach; a lower one
        where small sliding of solids is looked at, seldom and by what is known of the displacements.
        """
        side, chords = sides_of(self.contacts[i])[k], self.chords[i]
        # what supports hold in the other body is warned of as that
        free: Mask = np.logical_not(np.all(side.held, axis=1))
        ends = side.facets[free[side.facets].all(axis=1)]
        between = np.einsum("pk,fkd->pfd", side.kind.between, places[k][ends])
        for points, explained in (
            (places[k][free], chords[1 - k]),
            (between.reshape(-1, side.dim), sum(chords)),
        ):
            bound = max(explained + (A_TENTH if i in self.near else OVERLAP) * approach, noise)
            points, depth = other.inner(points, bound + float(np.min(added, initial=0.0)))
            if len(points) and added.any():
                depth = depth - added[Tree(places[0]).nearest(points)]
            if np.max(depth, initial=0.0) > bound:
                return True
        return False


def unselected_words(result: Answer, i: int) -> str:
    """Where a surface in the plane ends and the other body lies on the side beyond, held by nothing."""
    contacts, contact, u = result.contacts, result.contacts[i], result.at_surfaces()
    if contact.sliding == "small" or contact.secondary.dim == 3 or not of_two_bodies(contact):
        return ""
    sides = [side.moved(u[result.system.slice(side.body)]) for side in sides_of(contact)]
    others = [s for c in contacts for s in (c.secondary, c.primary)]
    words = []
    for own, other in (sides, sides[::-1]):
        shared = [s for s in others if isinstance(s, ContactSurface) and s.body is own.body]
        for node, depth in unselected_sides(own, other):
            dofs = own.dofs[node, 0]
            if sum(dofs in s.dofs[:, 0] for s in shared) > 1:
                continue  # the side belongs to another contact
            words.append(
                f"point {node} at {written(own.points[node])}, where surface {own.label!r} ends, "
                f"lies {depth:.3g} inside the body of {other.label!r}, which presses on a side "
                f"that does not belong to {own.label!r}: nothing holds it there. Take that side "
                "into the surface, or make a second contact with it."
            )
    return " ".join(words)


def of_two_bodies(contact: Contact) -> bool:
    """Return whether two bodies press each other where the meshes say.

    In one and the same body inside and outside are not told apart. Where the user gives the gap, the
    meshes are not the shapes that touch, and their overlaps are what the user knows of.
    """
    secondary, primary = contact.secondary, contact.primary
    if not isinstance(primary, ContactSurface) or contact.tied or contact.gap is not None:
        return False
    return primary.body is not secondary.body and secondary.dofs.shape[1] == secondary.dim


def sides_of(contact: Contact) -> tuple[ContactSurface, ContactSurface]:
    """Both surfaces of a contact of two bodies."""
    assert isinstance(contact.primary, ContactSurface)
    return contact.secondary, contact.primary


def between(
    secondary: Boundary,
    primary: Boundary,
    chords: tuple[float, float],
    extent: float,
    nodes: Array,
    added: Array,
    closed: Mask,
    paired: Mask,
) -> Meeting:
    """Two deformed bodies, all of their boundaries.

    Nodes are on the boundary that is meshed: that they overlap only chords of the other side explain.

    Parameters
    ----------
    secondary, primary : Boundary
    chords : two of float
        How far what is drawn of each stands off it [length].
    extent : float
        Of the bodies [length].
    nodes : ndarray, shape (m, d)
        Of the secondary surface, displaced [length].
    added : ndarray, shape (m,)
        What the user has the gaps be larger than the meshes say [length].
    closed, paired : ndarray of bool, shape (m,)
    """
    noise = SOLVED * extent
    # with an interference bodies may overlap before their meshes do: this shows at the nodes
    true = np.full(len(nodes), np.inf)
    true[paired] = primary.signed(nodes[paired]) + added[paired]
    deepest = int(np.argmin(true))
    best = Meeting(0.0, chords=sum(chords))
    if true[deepest] < -noise:
        best = Meeting(-float(true[deepest]), chords=chords[1], place=nodes[deepest])
    for k, (one, other) in enumerate(((secondary, primary), (primary, secondary))):
        own = one.nodes[within(one.nodes, other.box)]  # the others lie outside
        samples = one.samples(other.box)
        for points, explained in ((own, chords[1 - k]), (samples, sum(chords))):
            depth = other.depth(points)
            points, depth = points[depth > noise], depth[depth > noise]
            if len(points) and added[paired].any():
                depth = depth - added[paired][Tree(nodes[paired]).nearest(points)]
            beyond = float(np.max(depth, initial=0.0)) - explained
            if len(points) and depth.max() > 0 and beyond > best.overlap - best.chords:
                i = int(np.argmax(depth))
                best = Meeting(float(depth[i]), 0, 0.0, explained, points[i], k)
    lonely = primary.depth(nodes[~paired]) > max(sum(chords), noise)
    opening = float(np.max(true[closed], initial=0.0))
    return replace(best, unseen=int(lonely.sum()), opening=opening)


# -- edges of solids ------------------------------------------------------------------------------


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
