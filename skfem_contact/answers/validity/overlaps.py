"""Overlaps that contact conditions do not see: of two bodies, and with obstacles.

The points of both surfaces, and those between them, are looked for in the whole body on the other
side, by what a step knows of displacements: those of contact surfaces and supports, extrapolated to the
rest of the boundary (`Extrapolation`). That is a suspicion: the verdict is that of `assess`, with all
displacements. Where bodies slide far anything may come to overlap in any step; with small sliding
overlaps of solids grow as forces do, and `watch` looks once for every doubling.

What obstacles hide goes by kinds that each have a shape for it:

* a surface that begins where its obstacle is solid, and does not touch it: `hollow` by mistake;
* a round tool that stands in a facet between nodes;
* flats of large triangles whose normals lean towards the bends beside them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property

import numpy as np

from skfem_contact.answers.thresholds import A_TENTH, OVERLAP, SAGITTA
from skfem_contact.answers.validity.chords import bends, drawn_off, kinked_edges
from skfem_contact.answers.validity.deformed_boundaries import (
    Boundary,
    BoundaryNodes,
    signed_distance,
    within,
)
from skfem_contact.answers.validity.edges import Edges, crossing, sharp_edges_of
from skfem_contact.answers.validity.support import Extrapolation
from skfem_contact.answers.validity.track import Rim, Track
from skfem_contact.answers.validity.validity import Drift
from skfem_contact.arrays import Array, Index, Mask
from skfem_contact.bodies.body import Body
from skfem_contact.bodies.selection import written
from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.conditions.contact import Contact
from skfem_contact.conditions.geometry import Geometry
from skfem_contact.conditions.rows import as_motion
from skfem_contact.conditions.state import OPEN, LoadCase, State
from skfem_contact.digits import SOLVED
from skfem_contact.obstacles.obstacle import Obstacle
from skfem_contact.obstacles.rigid_body import shape_of
from skfem_contact.pairing.corners import unselected_sides
from skfem_contact.pairing.node import Pairing, node_to_segment
from skfem_contact.trees import Tree

#: Triangles this many times as large as the faces that meet them: smaller ones are a bend themselves.
LARGER = 2.0


class Overlaps:
    """The facts that are known beforehand of all contacts between two bodies that may overlap.

    Parameters
    ----------
    geometry : Geometry
    known : callable
        Gives the DOFs whose displacements are known without the interior.

    Attributes
    ----------
    far, near : list of int
        Contacts that slide far, to be looked at after every step, and solids with small sliding.
    """

    def __init__(self, geometry: Geometry, known: Callable[[], Index]) -> None:
        self.geometry, self.system, self.contacts = geometry, geometry.system, geometry.contacts
        self.known = known
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

    def look_far(
        self, state: State, case: LoadCase, tracks: Sequence[Track], drifts: Sequence[Drift]
    ) -> frozenset[int]:
        """Numbers of contacts that slide far and seem to overlap by more than their bounds.

        Parameters
        ----------
        state, case : State, LoadCase
        tracks, drifts : sequence of Track and Drift
            Of every contact.
        """
        u = self.geometry.spread(state.surface)
        u[self.held] = case.x[self.held]
        return self._look(self.far, self.beside_surfaces, u, case, tracks, drifts)

    def look_near(
        self, i: int, u: Array, case: LoadCase, tracks: Sequence[Track], drifts: Sequence[Drift]
    ) -> bool:
        """Whether solids with small sliding seem to, by displacements (n,) of contacts and supports."""
        hidden = self._hidden(i, tracks[i])
        return hidden or bool(self._look([i], self.beside_contacts, u, case, tracks, drifts))

    def _hidden(self, i: int, track: Track) -> bool:
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
            for side in sides_of(self.contacts[i])
        )

    def _look(
        self,
        some: Sequence[int],
        beside: dict[int, Extrapolation],
        u: Array,
        case: LoadCase,
        tracks: Sequence[Track],
        drifts: Sequence[Drift],
    ) -> frozenset[int]:
        parts = {b: unknown.filled(u) for b, unknown in beside.items()}
        found, noise = set(), SOLVED * self.system.extent
        for i in some:
            added = tracks[i].added - case.interference[self.geometry.point_slices[i]]
            added, approach = np.nan_to_num(added), drifts[i].approach
            numbers = [self.system.index(side.body) for side in sides_of(self.contacts[i])]
            places = [self.nodes[b].points + parts[b][self.nodes[b].dofs] for b in numbers]
            nodes = [
                s.points + parts[b][s.dofs]
                for s, b in zip(sides_of(self.contacts[i]), numbers, strict=True)
            ]
            others = [self.nodes[b].at(x) for b, x in zip(numbers[::-1], places[::-1], strict=True)]
            if any(self._beyond(i, k, others[k], nodes, added, approach, noise) for k in range(2)) or (
                i in self.edges and crossing(self.edges[i], nodes, added, approach, noise)
            ):
                found.add(i)
        return frozenset(found)

    def _beyond(
        self,
        i: int,
        k: int,
        other: Boundary,
        nodes: Sequence[Array],
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
        between = np.einsum("pk,fkd->pfd", side.kind.between, nodes[k][ends])
        for points, explained in (
            (nodes[k][free], chords[1 - k]),
            (between.reshape(-1, side.dim), sum(chords)),
        ):
            bound = max(explained + (A_TENTH if i in self.near else OVERLAP) * approach, noise)
            points, depth = other.inner(points, bound + float(np.min(added, initial=0.0)))
            if len(points) and added.any():
                depth = depth - added[Tree(nodes[0]).nearest(points)]
            if np.max(depth, initial=0.0) > bound:
                return True
        return False


def unselected_words(geometry: Geometry, i: int, state: State) -> str:
    """Where a surface in the plane ends and the other body lies on the side beyond, held by nothing."""
    contacts = geometry.contacts
    if (
        contacts[i].sliding == "small"
        or contacts[i].secondary.dim == 3
        or not of_two_bodies(contacts[i])
    ):
        return ""
    u = geometry.spread(state.surface)
    sides = [side.moved(u[geometry.system.slice(side.body)]) for side in sides_of(contacts[i])]
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


# -- a surface in the solid of its obstacle -------------------------------------------------------


def depth_in_solid(contact: Contact, pairing: Pairing) -> float:
    """How deep a surface lies in the solid of its obstacle, all of it and unseen; zero if it does not.

    Finite sliding looks for partners anew in every step, so a point without one is no mistake: it may
    come to meet the obstacle yet. But where all of a surface is in the solid from the beginning, and
    nothing of it finds what it could touch, the obstacle is taken for its own inverse. (With small
    sliding points that find nobody are refused.) A closed outline may offer its far side instead: its
    gaps are open, where the points are in the solid.

    Parameters
    ----------
    contact : Contact
        On an obstacle.
    pairing : Pairing
        Of the undeformed bodies.
    """
    obstacle, surface = _shape(contact), contact.secondary
    outline, paired = obstacle.outline, pairing.paired
    known = contact.gap is not None or contact.adjust
    if paired.any() and (outline is None or known or np.any(pairing.gap[paired] <= 0)):
        return 0.0  # what overlaps is seen
    distance = signed_distance(obstacle, surface, surface.points)
    if outline is not None and np.any(abs(distance) >= abs(Rim.of(outline).beyond(surface.points))):
        return 0.0  # on which side of an open outline points beyond its ends are is not known
    noise = SOLVED * float(np.max(np.ptp(surface.points, axis=0)))
    deepest = -float(distance.min())
    return deepest if deepest > noise and np.all(distance <= noise) else 0.0


def in_solid_words(contact: Contact, depth: float) -> str:
    """Say that a surface lies in the solid of its obstacle, and what to do."""
    shape = _shape(contact)
    hollow = getattr(shape, "hollow", None)
    way = "turn the sign of its function" if hollow is None else f"give it hollow={not hollow}"
    if not getattr(shape, "closed", True):
        way = "give its points, or the corners of its triangles, the other way round"
    return (
        f"nothing touches. From the beginning all of {contact.secondary.label!r} lies where "
        f"{contact.primary.label!r} is solid{', which is round its hole' if hollow else ''}, by up to "
        f"{depth:.3g}, and finds nothing there that it could touch. If the body is meant to be on the "
        f"other side, {way}; else the obstacle is in the wrong place."
    )


def _shape(contact: Contact) -> Obstacle:
    primary = contact.primary
    assert isinstance(primary, Obstacle)
    return shape_of(primary)


# -- round tools between nodes --------------------------------------------------------------------


def pierced(surface: ContactSurface, bend: Array, gap: Array) -> tuple[float, Array] | None:
    """Return where a round tool stands in a facet none of whose nodes it touches, and how deep.

    Parameters
    ----------
    surface : ContactSurface
    bend : ndarray, shape (d, d)
        Of the obstacle.
    gap : ndarray, shape (m,)
        Of the answer, all open; `inf` without a partner [length].

    Returns
    -------
    (depth, place) or None
        If it stands in a facet by more than a fifth of its height over the facet.
    """
    if np.trace(bend) <= 0:  # planes and holes have no part that reaches between nodes
        return None
    chords = _pieces(surface)
    x = surface.points
    along = x[chords[:, 1]] - x[chords[:, 0]]
    rise = np.einsum("cd,de,ce->c", along, bend, along)
    # of sides that fit, such as a pin in a hole of many sides, the smooth boundaries count
    own = np.repeat(bends(surface)[0], len(along) // len(surface.facets), axis=0)
    rise = np.minimum(rise, rise + np.einsum("cd,cde,ce->c", along, own, along))
    found = np.isfinite(gap)[chords].all(axis=1) & (rise > 0)
    chords, rise = chords[found], rise[found]
    a, b = gap[chords].T
    between = np.abs(a - b) < 0.5 * rise  # the lowest place of the parabola
    if not between.any():
        return None
    a, b, rise, chords = a[between], b[between], rise[between], chords[between]
    depth = rise / 8 - 0.5 * (a + b) + 0.5 * (a - b) ** 2 / rise
    worst = int(np.argmax(depth))
    if depth[worst] <= SAGITTA * rise[worst] / 8:
        return None
    part = 0.5 + (a[worst] - b[worst]) / rise[worst]
    return float(depth[worst]), (1 - part) * x[chords[worst, 0]] + part * x[chords[worst, 1]]


def _pieces(surface: ContactSurface) -> Index:
    """Nodes at the ends of chords between which there is no node, (c, 2)."""
    facets, kind, k = surface.facets, surface.kind, surface.kind.corners
    if kind.quadratic:  # along the edges; in the middle of a face there may be a node
        edges = [(i, k + i) for i in range(k)] + [(k + i, (i + 1) % k) for i in range(k)]
        pairs = [(0, 2), (2, 1)] if surface.dim == 2 else edges
    else:
        pairs = [(i, j) for j in range(k) for i in range(j)]
    return facets[:, pairs].reshape(-1, 2)


def pierced_words(surface: ContactSurface, depth: float, place: Array, label: str) -> str:
    """Say that a tool stands between nodes and presses on nothing, and what to do."""
    return (
        f"{label!r} stands in {surface.label!r} by {depth:.3g} at {written(place)}, between nodes that "
        "it does not touch, and presses on nothing: facets are too long for so light a contact. Refine "
        "the surface where the tool touches, to four nodes or more under it."
    )


# -- obstacles of triangles -----------------------------------------------------------------------


def of_triangles(contact: Contact) -> bool:
    """Return whether it is a solid on an obstacle of triangles, whose normals may lean."""
    outline = contact.primary.outline if isinstance(contact.primary, Obstacle) else None
    rigid = outline is not None and outline.dim == 3
    return rigid and not contact.bilateral and contact.gap is None


def outline_of(geometry: Geometry, i: int, case: LoadCase, u: Array) -> ContactSurface:
    """Return the straight pieces of the obstacle of a contact at their place."""
    obstacle, body = geometry.contacts[i].primary, geometry.contacts[i].rigid_body
    assert isinstance(obstacle, Obstacle)
    moved = case.motion[i].as_argument() if body is None else as_motion(geometry.system, body, u)
    outline = obstacle.moved(moved).outline
    assert outline is not None
    return outline


def leaning_faces(secondary: ContactSurface, outline: ContactSurface) -> Mask:
    """Large triangles that are no pieces of a curve, and whose normals lean nevertheless, shape (nf,).

    Normals turn from a flat into a chamfer over a strip along the bend (`obstacles.bends`). Forces on
    what stands there, and not on the flat, lean by up to half of the angle of the bend.
    A flat that turns alike at both ends, by less than 16 sides to a circle do, may be a piece of one.
    """
    size = LARGER * float(np.median(secondary.lengths))
    corners = outline.facet_node_normals[:, : outline.kind.corners]
    off = np.linalg.norm(corners - outline.facet_normals[:, None], axis=2).max(axis=1)
    return kinked_edges(outline).any(axis=1) & (off > A_TENTH) & (outline.lengths > size)


def leaning_words(geometry: Geometry, i: int, state: State, case: LoadCase, u: Array) -> str:
    """Say what to say of forces that lean on flats of triangles; empty if they do not, or hardly.

    Parameters
    ----------
    geometry : Geometry
    i : int
        The contact, on an obstacle of triangles.
    state, case
        Of the answer.
    u : ndarray, shape (n,)
        Displacements, right at the contact DOFs [length].
    """
    contact, part = geometry.contacts[i], geometry.point_slices[i]
    surface, outline = contact.secondary, outline_of(geometry, i, case, u)
    leaning = leaning_faces(surface, outline)
    force = np.where(state.status[part] != OPEN, np.abs(state.normal_force[part]), 0.0)
    if not (leaning.any() and force.any()):
        return ""
    pairing = node_to_segment(surface.moved(u[geometry.system.slice(surface.body)]), outline)
    on_flat = pairing.paired & leaning[np.where(pairing.paired, pairing.facet, 0)]
    facet = np.where(on_flat, pairing.facet, 0)
    off = (pairing.normal - outline.facet_normals[facet]) * (force * on_flat)[:, None]
    lean = float(np.linalg.norm(off.sum(axis=0)) / force.sum())
    if lean <= A_TENTH:
        return ""
    return (
        f"normals of {contact.primary.label!r} lean by {lean:.2g} rad in the mean from those of its "
        "triangles, which are large and flat beside bends of less than 45 degrees, and so do the "
        "forces. Along a bend normals turn over an eighth of a triangle; where that is too wide, give "
        "the flat narrow triangles along it."
    )
