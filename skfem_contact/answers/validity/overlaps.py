"""Overlaps of two bodies: where steps look for them, and what these come from.

The points of both surfaces, and those between them, are looked for in the whole body on the other
side, by what a step knows of displacements: those of contact surfaces and supports, extrapolated to the
rest of the boundary (`Extrapolation`). That is a suspicion: the verdict is that of `assess`, with all
displacements. Where bodies slide far anything may come to overlap in any step; with small sliding
overlaps of solids grow as forces do, and `watch` looks once for every doubling.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from skfem_contact.answers.thresholds import ALONE
from skfem_contact.answers.validity.chords import drawn_off
from skfem_contact.answers.validity.deformed_boundaries import Boundary, BoundaryNodes, within
from skfem_contact.answers.validity.edges import Edges, crossing, sharp_edges_of
from skfem_contact.answers.validity.support import Extrapolation
from skfem_contact.answers.validity.track import Track
from skfem_contact.answers.validity.validity import Drift
from skfem_contact.bodies.body import Body
from skfem_contact.bodies.selection import written
from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.conditions.contact import Contact
from skfem_contact.conditions.geometry import Geometry
from skfem_contact.conditions.loads import LoadCase
from skfem_contact.conditions.state import State
from skfem_contact.digits import SOLVED
from skfem_contact.pairing.corners import unselected_sides
from skfem_contact.trees import Tree

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Mask = NDArray[np.bool_]


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

    @cached_property
    def beside_surfaces(self) -> dict[int, Extrapolation]:
        """What surfaces that slide far do not tell of them."""
        return self._beside(self.geometry.surface_dofs)

    @cached_property
    def beside_contacts(self) -> dict[int, Extrapolation]:
        """What is not known of them without the interior."""
        return self._beside(self.known())

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
        if not self.far:
            return frozenset()
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

        The bound is the lower one of `ContactValidity.excess`, with what is known of the approach.
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
            bound = max(explained + ALONE * approach, noise)
            points = points[within(points, other.box)]
            if not len(points):
                continue
            # in contact nearly all are next to it, and neither how deep nor whether inside matters
            points = points[~other.beside(points, bound + float(np.min(added, initial=0.0)))]
            points = points[other.inside(points)]
            if not len(points):
                continue
            depth = other.distance(points)
            if added.any():
                depth = depth - added[Tree(nodes[0]).nearest(points)]
            if depth.max() > bound:
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
