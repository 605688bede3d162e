"""The verdict on the model at an answer: each bound is measured in one place, whoever asks.

`Assessment` has the measures, with the displacements of whole bodies. A load step asks it for what it
has cause to suspect (`watch`), `result.validity` for all: what a step warns of and what `validity` says
are the same findings.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace
from functools import cache

import numpy as np

from skfem_contact.answers.answer import Answer
from skfem_contact.answers.thresholds import A_TENTH
from skfem_contact.answers.validity.chords import drawn_off
from skfem_contact.answers.validity.deformed_boundaries import (
    Boundary,
    Meeting,
    at_obstacle,
    between,
    boundary,
    with_corners,
)
from skfem_contact.answers.validity.edges import crossing, pressed_aside, sharp_edges_of
from skfem_contact.answers.validity.overlaps import of_two_bodies, sides_of, unselected_words
from skfem_contact.answers.validity.strain import lockable, locked, strains
from skfem_contact.answers.validity.support import beyond_round_off, elastic_approach
from skfem_contact.answers.validity.track import tool_motion
from skfem_contact.answers.validity.turned import leaning
from skfem_contact.answers.validity.validity import (
    ContactValidity,
    Drift,
    Validity,
    crossing_words,
    facet_words,
    locking_words,
    overlap_words,
    prescribed_words,
    rotation_words,
    sliding_words,
    strain_words,
)
from skfem_contact.bodies.body import Body
from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.conditions.contact import Contact
from skfem_contact.conditions.orthotropic import OrthotropicCoulomb
from skfem_contact.conditions.rows import as_motion
from skfem_contact.conditions.state import OPEN
from skfem_contact.digits import SOLVED
from skfem_contact.errors import warn
from skfem_contact.obstacles.obstacle import Obstacle

#: What may be wrong with a contact, in the order in which it is told.
OF_CONTACTS = ("sliding", "overlap", "facets")


def assess(result: Answer) -> Validity:
    """Measure the validity of a result; needs the displacements of all bodies.

    Warns
    -----
    ContactWarning
        What is beyond its bound, unless its history has said so before.
    """
    measured = Assessment(result)
    problems: dict[tuple[str, str], str] = {}
    if result.diagnostics.tracks:  # scalar fields move nothing
        for i, (contact, name) in enumerate(zip(result.contacts, result.names, strict=True)):
            label = f"Contact {name!r} ({contact.label}): "
            found = measured.of_contact(i)
            problems |= {(kind, name): label + words for kind, words in found.items()}
    for name in measured.bounded:
        found = measured.of_body(name)
        problems |= {(kind, name): words for kind, words in found.items()}
    problems |= leaning(result.system, result.diagnostics.leaning, problems)
    for (kind, name), text in problems.items():
        issued = (kind, name) in result.diagnostics.issued
        issued |= kind == "overlap" and result.diagnostics.prescribed(name)
        if result.converged and not issued:
            warn(text)
    size, largest, rotation = (
        {name: measured.strains(name)[k] for name in measured.bounded} for k in range(3)
    )
    contacts = range(len(result.names)) if result.diagnostics.tracks else ()
    return Validity(
        {result.names[i]: measured.contact(i) for i in contacts},
        size,
        largest,
        rotation,
        problems,
        dict(result.diagnostics.leaning),
        {name: locked(result, name) for name in measured.lockable},
        tuple(key for key in result.diagnostics.beyond if key not in problems),
    )


class Assessment:
    """The measures of one answer, each taken when it is first asked for.

    Parameters
    ----------
    result : Answer
    """

    def __init__(self, result: Answer) -> None:
        self.result, self.system = result, result.system
        self.solids: dict[str, Body] = {n: b for n, b in self.system.solids.items() if b.components > 1}
        # those that strains and turns have bounds of: materials of finite strain follow them
        self.bounded = [name for name, body in self.solids.items() if not body.finite_strain]
        self.lockable = lockable(result)
        self.meetings = dict(result.diagnostics.meetings)
        # each measure once
        self.strains, self.boundary = cache(self._strains), cache(self._boundary)
        self.drift, self.contact = cache(self._drift), cache(self._contact)

    # -- bodies -------------------------------------------------------------------------------

    def _strains(self, name: str) -> tuple[float, float, float]:
        """Mean and largest strain, and rotation, of a body; see `strain.strains`."""
        return strains(self.solids[name], self.result.stretched(name))

    def _boundary(self, name: str) -> Boundary:
        """The deformed boundary of a body."""
        return boundary(self.solids[name], self.result.displacement(name))

    def of_body(self, name: str) -> dict[str, str]:
        """Return what is beyond its bound of one body, in words by kind.

        Bending and shear turn parts of a body by as much as they strain it, or by more. What is not
        more than the strain is told by it.
        """
        found = {}
        strain, _, rotation = self.strains(name)
        if strain > A_TENTH:
            found["strain"] = strain_words(name, strain)
        if rotation > max(A_TENTH, strain):
            found["rotation"] = rotation_words(name, rotation)
        if name in self.lockable:
            words = locking_words(name, self.solids[name], locked(self.result, name))
            found |= {"locking": words} if words else {}
        return found

    # -- contacts -----------------------------------------------------------------------------

    def of_contact(self, i: int, kinds: Collection[str] = OF_CONTACTS) -> dict[str, str]:
        """Return what is beyond its bound of one contact, in words by kind; of the kinds asked for."""
        found, drift, contact = {}, self.drift(i), self.result.contacts[i]
        if not drift.small_sliding_holds:
            found["sliding"] = sliding_words(drift, self._turning(i))
        elif "overlap" in kinds:  # small sliding that does not follow is the reason already
            found["overlap"] = self._overlap(i)
        if drift.facets_too_long and contact.rigid_body is not None:
            drift = self._pressed_in(i, drift)  # how far a force moves the tool says too little
        if drift.facets_too_long:
            found["facets"] = facet_words(drift, contact)
        return {kind: words for kind, words in found.items() if words and kind in kinds}

    def _turning(self, i: int) -> list[str]:
        """Names of linear bodies that turn so far that torques are off where contact slides far."""
        contact, system = self.result.contacts[i], self.system
        sides = contact.secondary, contact.primary
        names = {system.names[system.index(s.body)] for s in sides if isinstance(s, ContactSurface)}
        most = A_TENTH * min(_coefficient(contact), 1.0)
        return [
            n for n in self.bounded if n in names and self.strains(n)[2] > max(most, self.strains(n)[0])
        ]

    def _contact(self, i: int) -> ContactValidity:
        """All that is measured of one contact."""
        result, part = self.result, self.result.slices()[i]
        closed = (result.state.status[part] != OPEN) & result.kin.paired[part]
        meeting = self.meeting(i)
        angle = float(np.max(result.kin.tilt[part][closed], initial=0.0))
        mu = _coefficient(result.contacts[i])
        share = angle / mu if mu > 0 else np.nan
        seen = meeting.overlap, meeting.chords, meeting.unseen, meeting.opening
        return ContactValidity(self.drift(i), *seen, angle, share)

    def _overlap(self, i: int) -> str:
        """Return what contact conditions do not see of one contact, in words; empty for nothing."""
        result, drift, contact = self.result, self.drift(i), self.result.contacts[i]
        if i in result.diagnostics.undetected:
            return result.diagnostics.undetected[i]
        part = self.contact(i)
        if part.excess > 1.0:
            if result.diagnostics.prescribed(result.names[i]):
                return prescribed_words(part)
            way = unselected_words(result.model.geometry, i, result.state)
            return overlap_words(part, contact, self.meeting(i), way)
        # facets that are too long are the reason already
        if drift.facets_too_long or not (contact.secondary.dim == 3 and of_two_bodies(contact)):
            return ""
        return self._crossing(i)

    def _crossing(self, i: int) -> str:
        """Return what edges of two solids do that cross, in words; empty for nothing."""
        result, sides = self.result, sides_of(self.result.contacts[i])
        part, approach = result.slices()[i], self.drift(i).approach
        added = result.diagnostics.tracks[i].added - result.worn_case.interference[part]
        places = [side.points + result.displacement(side.body)[side.dofs] for side in sides]
        edges = [sharp_edges_of(side) for side in sides]
        found = crossing(edges, places, added, approach, SOLVED * self.system.extent)
        closed = np.flatnonzero(result.state.status[part] != OPEN)
        normal = result.kin.normal[part]
        if found is None or not (found.count or pressed_aside(found, sides[0], normal, closed)):
            return ""
        return crossing_words(found, *(side.label for side in sides))

    def meeting(self, i: int) -> Meeting:
        """Return how the deformed boundaries meet; the step may have measured it."""
        if i not in self.meetings:
            self.meetings[i] = self._met(i)
        return self.meetings[i]

    def _met(self, i: int) -> Meeting:
        result, system = self.result, self.system
        contact, part, track = result.contacts[i], result.slices()[i], result.diagnostics.tracks[i]
        secondary = contact.secondary
        moved = secondary.points + result.displacement(secondary.body)[secondary.dofs]
        added = track.added - result.worn_case.interference[part]
        paired = result.kin.paired[part]
        closed = (result.state.status[part] != OPEN) & paired
        name = system.names[system.index(secondary.body)]
        if isinstance(contact.primary, Obstacle):
            motion = result.case.motion[i].as_argument()
            if contact.rigid_body is not None:
                motion = as_motion(system, contact.rigid_body, result.u)
            obstacle = contact.primary.moved(motion)
            # the obstacle is exact: where facets are too long to meet it, nothing explains the overlap
            chords = drawn_off(secondary)
            found = at_obstacle(obstacle, secondary, chords, moved, added, closed, paired)
            if obstacle.outline is None or contact.bilateral or contact.gap is not None:
                return found
            corners = obstacle.outline.points
            return with_corners(found, self.boundary(name), corners, chords, moved, added)
        if contact.primary.body is secondary.body:
            return Meeting()
        other = system.names[system.index(contact.primary.body)]
        off = drawn_off(secondary), drawn_off(contact.primary)
        boundaries = self.boundary(name), self.boundary(other)
        return between(*boundaries, off, system.extent, moved, added, closed, paired)

    def _drift(self, i: int) -> Drift:
        """Return how far a contact has drifted, with the slips of the displacements."""
        result = self.result
        contact, part, track = result.contacts[i], result.slices()[i], result.diagnostics.tracks[i]
        closed = (result.state.status[part] != OPEN) & result.kin.paired[part]
        drift = result.diagnostics.drifts[i]
        if contact.sliding != "small":
            return self._pressed_in(i, drift)
        t = result.kin.tangents
        slip = result.kin.B_t[part.start * t : part.stop * t] @ result.u
        slip = np.einsum("mk,mkd->md", slip.reshape(-1, t), result.kin.duals[part])
        gap, force = result.gap[part], result.state.normal_force[part]
        tool = tool_motion(self.system, contact, track, result.u)
        found = track.drift(closed, slip, gap, force, drift.approach, result.worn_case, i, part, tool)
        return replace(drift, **found)

    def _pressed_in(self, i: int, drift: Drift) -> Drift:
        """Return it with the elastic approach of the displacements, where that is more."""
        part = self.result.slices()[i]
        closed = (self.result.state.status[part] != OPEN) & self.result.kin.paired[part]
        elastic = beyond_round_off(elastic_approach(self.result, i, closed), self.system.extent)
        return replace(drift, approach=max(drift.approach, elastic))


def _coefficient(contact: Contact) -> float:
    """The largest coefficient of friction of a contact; NaN without one."""
    law = contact.friction
    coefficient = law.smaller if isinstance(law, OrthotropicCoulomb) else getattr(law, "mu", np.nan)
    return float(np.max(coefficient))
