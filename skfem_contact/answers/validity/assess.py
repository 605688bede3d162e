"""The verdict on the model at an answer: each bound is measured in one place, whoever asks.

`Assessment` has the measures, with the displacements of whole bodies. A load step asks it for what it
has cause to suspect (`watch`), `result.validity` for all: what a step warns of and what `validity` says
are the same findings.
"""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import replace
from functools import cached_property, wraps
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from skfem_contact.answers.answer import Answer
from skfem_contact.answers.thresholds import A_TENTH
from skfem_contact.answers.validity.chords import chord_height, drawn_off
from skfem_contact.answers.validity.deformed_boundaries import (
    Boundary,
    Meeting,
    at_obstacle,
    between,
    boundary,
)
from skfem_contact.answers.validity.locking import lockable, locked
from skfem_contact.answers.validity.plane_overlaps import PlaneOverlaps
from skfem_contact.answers.validity.solid_overlaps import SolidOverlaps
from skfem_contact.answers.validity.strain import leaning, strains
from skfem_contact.answers.validity.support import beyond_round_off, elastic_approach
from skfem_contact.answers.validity.track import tool_motion
from skfem_contact.answers.validity.validity import ContactValidity, Drift, Validity
from skfem_contact.answers.validity.words import (
    facet_words,
    locking_words,
    overlap_words,
    prescribed_words,
    rotation_words,
    sliding_words,
    strain_words,
)
from skfem_contact.bodies.body import Body
from skfem_contact.conditions.friction import FrictionLaw
from skfem_contact.conditions.geometry import Geometry
from skfem_contact.conditions.orthotropic import OrthotropicCoulomb
from skfem_contact.conditions.rows import as_motion
from skfem_contact.conditions.state import OPEN
from skfem_contact.errors import warn
from skfem_contact.obstacles.obstacle import Obstacle

Array = NDArray[np.float64]
Key = TypeVar("Key")
Value = TypeVar("Value")

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
    problems |= leaning(result.diagnostics.leaning)
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


def _once(measure: Callable[[Any, Key], Value]) -> Callable[[Any, Key], Value]:
    """A method of one argument, which is computed once for each."""

    @wraps(measure)
    def kept(self: Any, key: Key) -> Value:
        known = measure.__name__, key
        if known not in self._known:
            self._known[known] = measure(self, key)
        found: Value = self._known[known]
        return found

    return kept


class Assessment:
    """The measures of one answer, each taken when it is first asked for.

    Parameters
    ----------
    result : Answer
    solid_overlaps, plane_overlaps : optional
        Those of all contacts, where they are known from steps.
    """

    def __init__(
        self,
        result: Answer,
        solid_overlaps: SolidOverlaps | None = None,
        plane_overlaps: PlaneOverlaps | None = None,
    ) -> None:
        self._solid_overlaps, self._plane_overlaps = solid_overlaps, plane_overlaps
        self.result, self.system = result, result.system
        self.solids: dict[str, Body] = {n: b for n, b in self.system.solids.items() if b.components > 1}
        # those that strains and turns have bounds of: materials of finite strain follow them
        self.bounded = [name for name, body in self.solids.items() if not body.finite_strain]
        self.lockable = lockable(result)
        self._known: dict[tuple[str, Any], Any] = {}

    # -- bodies -------------------------------------------------------------------------------

    @_once
    def strains(self, name: str) -> tuple[float, float, float]:
        """Mean and largest strain, and rotation, of a body; see `strain.strains`."""
        return strains(self.solids[name], self.result.displacement(name))

    @_once
    def boundary(self, name: str) -> Boundary:
        """The deformed boundary of a body."""
        return boundary(self.solids[name], self.result.displacement(name))

    def of_body(self, name: str) -> dict[str, str]:
        """What is beyond its bound of one body, in words by kind.

        Bending and shear turn parts of a body by as much as they strain it, or by more. What is not
        more than the strain is told by it.
        """
        found = {}
        strain, _, rotation = self.strains(name)
        if strain > A_TENTH:
            found["strain"] = strain_words(name, strain)
        if rotation > max(A_TENTH, strain):
            found["rotation"] = rotation_words({name: rotation})
        if name in self.lockable:
            words = locking_words(name, self.solids[name], locked(self.result, name))
            found |= {"locking": words} if words else {}
        return found

    # -- contacts -----------------------------------------------------------------------------

    def of_contact(self, i: int, kinds: Collection[str] = OF_CONTACTS) -> dict[str, str]:
        """What is beyond its bound of one contact, in words by kind; of the kinds asked for."""
        found, drift, contact = {}, self.drift(i), self.result.contacts[i]
        if not drift.small_sliding_holds:
            found["sliding"] = sliding_words(drift)
        elif "overlap" in kinds:  # small sliding that does not follow is the reason already
            found["overlap"] = self._overlap(i)
        if drift.facets_too_long:
            found["facets"] = facet_words(drift, contact.rigid)
        return {kind: words for kind, words in found.items() if words and kind in kinds}

    @_once
    def drift(self, i: int) -> Drift:
        """How far a contact has drifted, with the slips of the displacements."""
        return _drift(self.result, i)

    @_once
    def contact(self, i: int) -> ContactValidity:
        """All that is measured of one contact."""
        result, part = self.result, self.result.slices()[i]
        closed = (result.state.status[part] != OPEN) & result.kin.paired[part]
        chords, meeting = self.meeting(i)
        angle = float(np.max(result.kin.tilt[part][closed], initial=0.0))
        mu = float(np.max(_coefficient(result.contacts[i].friction)))
        share = angle / mu if mu > 0 else np.nan
        seen = meeting.overlap, chords, meeting.unseen, meeting.opening
        return ContactValidity(self.drift(i), *seen, angle, share)

    def _overlap(self, i: int) -> str:
        """What contact conditions do not see of one contact, in words; empty for nothing."""
        result, drift = self.result, self.drift(i)
        if i in result.diagnostics.undetected:
            return result.diagnostics.undetected[i]
        # facets that are too long are the reason already
        if i in result.diagnostics.hidden and not drift.facets_too_long:
            words = self.solid_overlaps.sure(i, result, drift)
            if words:
                return words
        part = self.contact(i)
        if part.excess <= 1.0:
            return ""
        if result.diagnostics.prescribed(result.names[i]):
            return prescribed_words(part)
        way = self.plane_overlaps.reasons(i, result.state) if i in result.diagnostics.intrusions else ""
        return overlap_words(part, result.contacts[i], self.meeting(i)[1], way)

    @cached_property
    def solid_overlaps(self) -> SolidOverlaps:
        """Of solids' vertices and edges."""
        return self._solid_overlaps or SolidOverlaps(self._geometry, lambda: np.arange(self.system.n))

    @cached_property
    def plane_overlaps(self) -> PlaneOverlaps:
        """Of plane bodies that slide far."""
        return self._plane_overlaps or PlaneOverlaps(self._geometry)

    @property
    def _geometry(self) -> Geometry:
        geometry: Geometry = self.result.recover.model.geometry
        return geometry

    @_once
    def meeting(self, i: int) -> tuple[float, Meeting]:
        """What chords explain, and how the deformed boundaries meet."""
        result, system = self.result, self.system
        contact, part, track = result.contacts[i], result.slices()[i], result.diagnostics.tracks[i]
        secondary = contact.secondary
        moved = secondary.points + result.displacement(secondary.body)[secondary.dofs]
        added = track.added - result.worn_case.interference[part]
        paired = result.kin.paired[part]
        closed = (result.state.status[part] != OPEN) & paired
        if isinstance(contact.primary, Obstacle):
            # the obstacle is exact: where facets are too long to meet it, nothing explains the overlap
            chords = chord_height(secondary)
            motion = result.case.motion[i].as_argument()
            if contact.rigid_body is not None:
                motion = as_motion(system, contact.rigid_body, result.u)
            obstacle = contact.primary.moved(motion)
            return chords, at_obstacle(obstacle, secondary, chords, moved, added, closed, paired)
        if contact.primary.body is secondary.body:
            return 0.0, Meeting()
        one, other = (system.names[system.index(s.body)] for s in (secondary, contact.primary))
        chords = drawn_off(secondary) + drawn_off(contact.primary)
        first, second = self.boundary(one), self.boundary(other)
        return chords, between(first, second, chords, system.extent, moved, added, closed, paired)


def _drift(result: Answer, i: int) -> Drift:
    contact, part, track = result.contacts[i], result.slices()[i], result.diagnostics.tracks[i]
    closed = (result.state.status[part] != OPEN) & result.kin.paired[part]
    drift = result.diagnostics.drifts[i]
    if contact.sliding == "small":
        slip = _slip(result, part)
        gap = result.gap[part]
        force = result.state.normal_force[part]
        tool = tool_motion(result.system, contact, track, result.u)
        found = track.drift(closed, slip, gap, force, drift.approach, result.worn_case, i, part, tool)
        return replace(drift, **found)
    elastic = beyond_round_off(elastic_approach(result, i, closed), result.system.extent)
    return replace(drift, approach=max(drift.approach, elastic))


def _coefficient(law: FrictionLaw | None) -> Any:
    """The coefficient of friction that a tilt counts against, one or (m,); NaN without."""
    return law.smaller if isinstance(law, OrthotropicCoulomb) else getattr(law, "mu", np.nan)


def _slip(result: Answer, part: slice) -> Array:
    """By the displacements, vectors in the tangent planes (m, d)."""
    t = result.kin.tangents
    slip = result.kin.B_t[part.start * t : part.stop * t] @ result.u
    return np.asarray(np.einsum("mk,mkd->md", slip.reshape(-1, t), result.kin.duals[part]))
