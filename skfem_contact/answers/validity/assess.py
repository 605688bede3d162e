"""The verdict on the model at an answer: each bound is measured in one place, whoever asks.

`Assessment` has the measures, with the displacements of whole bodies. A load step asks it for what it
has cause to suspect (`watch`), `result.validity` for all: what a step warns of and what `validity` says
are the same findings.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skfem_contact.answers.answer import Answer
from skfem_contact.answers.thresholds import LARGE
from skfem_contact.answers.validity.drift import Drift
from skfem_contact.answers.validity.give import beyond_round_off, elastic_approach
from skfem_contact.answers.validity.hull import Hull, hull
from skfem_contact.answers.validity.intrusion import Intrusions
from skfem_contact.answers.validity.locking import lockable, locked_share, locking_words
from skfem_contact.answers.validity.lookout import Lookouts
from skfem_contact.answers.validity.meeting import Meeting, at_obstacle, between, drawn_off, sagitta
from skfem_contact.answers.validity.overlap import Outline, outline
from skfem_contact.answers.validity.rotation import leaning, rotation_words
from skfem_contact.answers.validity.solids import looked_at, obstacle_drift
from skfem_contact.answers.validity.strain import strains
from skfem_contact.answers.validity.track import tool_motion
from skfem_contact.answers.validity.validity import ContactValidity, Validity
from skfem_contact.answers.validity.words import (
    facet_words,
    overlap_words,
    prescribed_words,
    sliding_words,
    strain_words,
)
from skfem_contact.bodies.body import Body
from skfem_contact.conditions.friction import FrictionLaw
from skfem_contact.conditions.geometry import Geometry
from skfem_contact.conditions.orthotropic import OrthotropicCoulomb
from skfem_contact.conditions.rows import as_motion
from skfem_contact.errors import warn
from skfem_contact.obstacles.obstacle import Obstacle

Array = NDArray[np.float64]

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
    if result.watched.tracks:  # scalar fields move nothing
        for i, (contact, name) in enumerate(zip(result.contacts, result.names, strict=True)):
            label = f"Contact {name!r} ({contact.label}): "
            found = measured.of_contact(i)
            problems |= {(kind, name): label + words for kind, words in found.items()}
    for name in measured.solids:
        found = measured.of_body(name)
        problems |= {(kind, name): words for kind, words in found.items()}
    problems |= leaning(result.watched.leaning)
    for (kind, name), text in problems.items():
        told = (kind, name) in result.watched.said
        told |= kind == "overlap" and result.watched.prescribed(name)
        if result.converged and not told:
            warn(text)
    size, largest, rotation = (
        {name: measured.strains(name)[k] for name in measured.solids} for k in range(3)
    )
    contacts = range(len(result.names)) if result.watched.tracks else ()
    return Validity(
        {result.names[i]: measured.contact(i) for i in contacts},
        size,
        largest,
        rotation,
        problems,
        dict(result.watched.leaning),
        {name: measured.locked(name) for name in measured.lockable},
        tuple(key for key in result.watched.beyond if key not in problems),
    )


class Assessment:
    """The measures of one answer, each taken when it is first asked for.

    Parameters
    ----------
    result : Answer
    lookouts, intrusions : optional
        Those of all contacts, where they are known from steps.
    """

    def __init__(
        self,
        result: Answer,
        lookouts: Lookouts | None = None,
        intrusions: Intrusions | None = None,
    ) -> None:
        self._lookouts, self._intrusions = lookouts, intrusions
        self.result, self.system = result, result.system
        self.solids: dict[str, Body] = {n: b for n, b in self.system.solids.items() if b.components > 1}
        self.lockable = lockable(result)
        self._known: dict[tuple[str, Any], Any] = {}

    # -- bodies -------------------------------------------------------------------------------

    def strains(self, name: str) -> tuple[float, float, float]:
        """Mean and largest strain, and rotation, of a body; see `strain.strains`."""
        body = self.solids[name]
        found: tuple[float, float, float] = self._once(
            "strain", name, lambda: strains(body, self.result.displacement(body))
        )
        return found

    def locked(self, name: str) -> float:
        """Share of a body's energy that neighbouring elements take back; see `locking`."""
        body = self.solids[name]
        found: float = self._once(
            "locking", name, lambda: locked_share(body, self.result.displacement(body))
        )
        return found

    def of_body(self, name: str) -> dict[str, str]:
        """What is beyond its bound of one body, in words by kind.

        Bending and shear turn parts of a body by as much as they strain it, or by more. What is not
        more than the strain is told by it.
        """
        found = {}
        strain, _, rotation = self.strains(name)
        if strain > LARGE:
            found["strain"] = strain_words(name, strain)
        if rotation > max(LARGE, strain):
            found["rotation"] = rotation_words({name: rotation})
        if name in self.lockable:
            words = locking_words(name, self.solids[name], self.locked(name))
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

    def drift(self, i: int) -> Drift:
        """How far a contact has drifted, with the slips of the displacements."""
        found: Drift = self._once("drift", i, lambda: _drift(self.result, i))
        return found

    def contact(self, i: int) -> ContactValidity:
        """All that is measured of one contact."""
        found: ContactValidity = self._once("contact", i, lambda: self._contact(i))
        return found

    def _overlap(self, i: int) -> str:
        """What contact conditions do not see of one contact, in words; empty for nothing."""
        result, drift = self.result, self.drift(i)
        if i in result.watched.unseen:
            return result.watched.unseen[i]
        # facets that are too long are the reason already
        if i in result.watched.standing and not drift.facets_too_long:
            words = self.lookouts.sure(i, result, drift)
            if words:
                return words
        part = self.contact(i)
        if part.excess <= 1.0:
            return ""
        if result.watched.prescribed(result.names[i]):
            return prescribed_words(part)
        found = self.intrusions.sure(i, result) if i in result.watched.intrusions else None
        return overlap_words(part, result.contacts[i], found)

    @cached_property
    def lookouts(self) -> Lookouts:
        """Of solids' vertices and edges."""
        return self._lookouts or Lookouts(self._geometry, lambda: np.arange(self.system.n))

    @cached_property
    def intrusions(self) -> Intrusions:
        """Of plane bodies that slide far."""
        return self._intrusions or Intrusions(self._geometry, self.result.contacts)

    @property
    def _geometry(self) -> Geometry:
        geometry: Geometry = self.result.recover.model.geometry
        return geometry

    def _outline(self, name: str) -> Outline | Hull:
        body = self.solids[name]
        draw = outline if body.dim == 2 else hull
        found: Outline | Hull = self._once(
            "outline", name, lambda: draw(body, self.result.displacement(body))
        )
        return found

    def _contact(self, i: int) -> ContactValidity:
        result = self.result
        contact, part = result.contacts[i], result.slices()[i]
        closed = (result.state.status[part] != 0) & result.kin.paired[part]
        chords, meeting = self._meeting(i, closed)
        angle = float(np.max(result.kin.tilt[part][closed], initial=0.0))
        mu = float(np.max(_coefficient(contact.friction)))
        share = angle / mu if mu > 0 else np.nan
        seen = meeting.overlap, chords, meeting.unseen, meeting.opening
        return ContactValidity(self.drift(i), *seen, angle, share)

    def _meeting(self, i: int, closed: NDArray[np.bool_]) -> tuple[float, Meeting]:
        """What chords explain, and how the deformed boundaries meet."""
        result, system = self.result, self.system
        contact, part, track = result.contacts[i], result.slices()[i], result.watched.tracks[i]
        secondary = contact.secondary
        moved = secondary.points + result.displacement(secondary.body)[secondary.dofs]
        added = track.added - result.worn_case.interference[part]
        paired = result.kin.paired[part]
        if isinstance(contact.primary, Obstacle):
            # the obstacle is exact: where facets are too long to meet it, nothing explains the overlap
            chords = sagitta(secondary, secondary.facet_node_normals)
            motion = result.case.motion[i].as_argument()
            if contact.rigid_body is not None:
                motion = as_motion(system, contact.rigid_body, result.u)
            obstacle = contact.primary.moved(motion)
            return chords, at_obstacle(obstacle, secondary, chords, moved, added, closed, paired)
        if contact.primary.body is secondary.body:
            return 0.0, Meeting()
        one, other = (system.names[system.index(s.body)] for s in (secondary, contact.primary))
        chords = drawn_off(secondary) + drawn_off(contact.primary)
        first, second = self._outline(one), self._outline(other)
        return chords, between(first, second, chords, system.extent, moved, added, closed, paired)

    def _once(self, what: str, which: Any, measure: Any) -> Any:
        if (what, which) not in self._known:
            self._known[what, which] = measure()
        return self._known[what, which]


def _drift(result: Answer, i: int) -> Drift:
    contact, part, track = result.contacts[i], result.slices()[i], result.watched.tracks[i]
    closed = (result.state.status[part] != 0) & result.kin.paired[part]
    drift = result.watched.drifts[i]
    if contact.sliding == "small":
        slip = _slip(result, part)
        gap = result.gap[part]
        force = result.state.normal_force[part]
        tool = tool_motion(result.system, contact, track, result.u)
        found = track.drift(closed, slip, gap, force, drift.approach, result.worn_case, i, part, tool)
        if looked_at(contact):
            answer = result.state, result.gap, result.worn_case, result.u, drift.approach
            found |= obstacle_drift(result.recover.model.geometry, i, *answer)
        return replace(drift, **found)
    elastic = beyond_round_off(elastic_approach(result, i, closed), result.system.extent)
    return replace(drift, approach=max(drift.approach, elastic))


def _coefficient(law: FrictionLaw | None) -> Any:
    """The coefficient of friction that a tilt counts against, one or (m,); NaN without."""
    return law.smaller if isinstance(law, OrthotropicCoulomb) else getattr(law, "mu", np.nan)


def _slip(result: Answer, part: slice) -> Array:
    """By the displacements: along the tangents (m,), in 3-D vectors (m, 3)."""
    t = result.kin.tangents
    slip = result.kin.B_t[part.start * t : part.stop * t] @ result.u
    if t == 1:
        return slip.ravel()
    return np.asarray(np.einsum("mk,mkd->md", slip.reshape(-1, t), result.kin.duals[part]))
