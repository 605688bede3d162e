"""Where contact slides far: does anything overlap that the pairing does not see?

The points of both surfaces, and the middles between them, are looked for in the whole body on the
other side after every step: polygons in polygons (`overlap`), with boundaries from what a load step
knows (`skin`). That is a suspicion: the verdict is that of `assess`, with all displacements.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from skfem_contact.answers.answer import Answer
from skfem_contact.answers.thresholds import OVERLAP
from skfem_contact.answers.validity.drift import Drift
from skfem_contact.answers.validity.meeting import drawn_off
from skfem_contact.answers.validity.overlap import Outline
from skfem_contact.answers.validity.skin import Skin
from skfem_contact.answers.validity.track import Track
from skfem_contact.answers.validity.watched import Intrusion
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
Mask = NDArray[np.bool_]


class Intrusions:
    """What is known beforehand of all contacts between two bodies that slide far."""

    def __init__(self, geometry: Geometry, contacts: Sequence[Contact]) -> None:
        self.geometry, self.system, self.contacts = geometry, geometry.system, contacts
        known = np.zeros(self.system.n, dtype=bool)
        known[geometry.surface_dofs] = True
        known[self.system.D] = True
        self.held = np.asarray(self.system.D)
        self.looked = [i for i, contact in enumerate(contacts) if _looked_at(contact)]
        bodies = {self.system.index(s.body) for i in self.looked for s in _sides(contacts[i])}
        self.skins = {
            b: Skin.of(body, known[self.system.slice(body)])
            for b, body in enumerate(self.system.bodies)
            if b in bodies and isinstance(body, Body)
        }
        self.chords = {i: _chords(_sides(contacts[i])) for i in self.looked}

    def look(
        self, state: State, case: LoadCase, tracks: Sequence[Track], drifts: Sequence[Drift]
    ) -> dict[int, Intrusion]:
        """Overlaps that seem to be beyond their bounds, by the number of the contact.

        Parameters
        ----------
        state, case : State, LoadCase
        tracks, drifts : sequence of Track and Drift
            Of every contact.
        """
        if not self.looked:
            return {}
        u = self.geometry.spread(state.surface)
        u[self.held] = case.x[self.held]
        parts = {b: u[self.system.slice(self.system.bodies[b])] for b in self.skins}
        places = {b: skin.moved(parts[b]) for b, skin in self.skins.items()}
        found = {i: self._found(i, parts, places, case, tracks) for i in self.looked}
        # the bound of `ContactValidity.excess`, with what is known of the approach
        least = {i: self.chords[i] + OVERLAP * drifts[i].approach for i in self.looked}
        return {i: one for i, one in found.items() if one is not None and one.depth > least[i]}

    def sure(self, i: int, result: Answer) -> tuple[str, str] | None:
        """Where the deepest overlap of one contact is, and what to do, in words; None without one.

        With the displacements of whole bodies.
        """
        parts = {
            self.system.index(s.body): result.displacement(s.body) for s in _sides(self.contacts[i])
        }
        places = {b: self.skins[b].placed(u) for b, u in parts.items()}
        found = self._found(i, parts, places, result.worn_case, result.watched.tracks)
        if found is None:
            return None
        place = (
            f", at {written(np.array(found.at))}, where {found.surface!r} lies in the body of "
            f"{found.body!r}"
        )
        return place, " ".join(self.reasons(i, result.state))

    def _found(
        self,
        i: int,
        parts: dict[int, Array],
        places: dict[int, Array],
        case: LoadCase,
        tracks: Sequence[Track],
    ) -> Intrusion | None:
        sides = _sides(self.contacts[i])
        numbers = [self.system.index(side.body) for side in sides]
        nodes = [s.points + parts[b][s.dofs] for s, b in zip(sides, numbers, strict=True)]
        added = tracks[i].added - case.interference[self.geometry.point_slices[i]]
        deepest = self._deepest(sides, numbers, nodes, places, np.nan_to_num(added))
        if deepest is None:
            return None
        depth, at, k = deepest
        return Intrusion(depth, at, sides[k].label, sides[1 - k].label)

    def _deepest(
        self,
        sides: tuple[ContactSurface, ContactSurface],
        numbers: list[int],
        nodes: list[Array],
        places: dict[int, Array],
        added: Array,
    ) -> tuple[float, tuple[float, ...], int] | None:
        """Depth, place, and the side whose point it is; None where nothing overlaps."""
        noise = SOLVED * self.system.extent
        best = None
        for k in range(2):
            # what supports hold in the other body is warned of as that
            free: Mask = np.logical_not(np.all(sides[k].held, axis=1))
            ends = sides[k].facets[free[sides[k].facets].all(axis=1)]
            between = np.einsum("pk,fkd->pfd", sides[k].kind.between, nodes[k][ends])
            points = np.concatenate([nodes[k][free], between.reshape(-1, 2)])
            there = places[numbers[1 - k]]
            points = points[((points >= there.min(axis=0)) & (points <= there.max(axis=0))).all(axis=1)]
            if not len(points):
                continue
            outline = self.skins[numbers[1 - k]].outline(there)
            points = points[outline.inside(points)]
            if not len(points):
                continue
            depth = _near(outline, points).distance(points)
            if added.any():
                depth = depth - added[Tree(nodes[0]).query(points)[1]]
            deepest = int(np.argmax(depth))
            if depth[deepest] > max(noise, best[0] if best else 0.0):
                best = float(depth[deepest]), tuple(map(float, points[deepest])), k
        return best

    def reasons(self, i: int, state: State) -> tuple[str, ...]:
        """Where a surface ends and the other body lies on the side beyond: what nothing holds."""
        u = self.geometry.spread(state.surface)
        sides = [side.moved(u[self.system.slice(side.body)]) for side in _sides(self.contacts[i])]
        others = [s for c in self.contacts for s in (c.secondary, c.primary)]
        words = []
        for own, other in (sides, sides[::-1]):
            shared = [s for s in others if isinstance(s, ContactSurface) and s.body is own.body]
            if own.dim != 2:
                continue
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
        return tuple(words)


def _looked_at(contact: Contact) -> bool:
    """Of two bodies: in one and the same inside and outside are not told apart.

    Where the user gives the gap, the meshes are not the shapes that touch, and their overlaps are
    what the user knows of.
    """
    primary = contact.primary
    plane = isinstance(primary, ContactSurface) and primary.body is not contact.secondary.body
    plane = plane and contact.secondary.dim == 2
    return plane and contact.sliding == "finite" and not contact.tied and contact.gap is None


def _sides(contact: Contact) -> tuple[ContactSurface, ContactSurface]:
    assert isinstance(contact.primary, ContactSurface)
    return contact.secondary, contact.primary


def _chords(sides: Sequence[ContactSurface]) -> float:
    return sum(drawn_off(side) for side in sides)


def _near(outline: Outline, points: Array) -> Outline:
    """The pieces among which the closest to each of these points are."""
    far = Tree(outline.start).distances(points).max()
    low, high = points.min(axis=0) - far, points.max(axis=0) + far
    a, b = np.minimum(outline.start, outline.end), np.maximum(outline.start, outline.end)
    some = ((b >= low) & (a <= high)).all(axis=1)
    return Outline(outline.start[some], outline.end[some])
