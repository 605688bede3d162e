"""The validity of an answer, measured when somebody asks.

With the displacements of the interior, and by a search over whole deformed boundaries (`overlap`).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skfem_contact.answers.answer import Answer
from skfem_contact.answers.thresholds import GAP, LARGE, SECOND_ORDER
from skfem_contact.answers.validity.give import beyond_round_off, elastic_approach
from skfem_contact.answers.validity.hull import Hull, hull
from skfem_contact.answers.validity.lookout import Lookouts
from skfem_contact.answers.validity.meeting import Meeting, at_obstacle, between, sagitta
from skfem_contact.answers.validity.overlap import Outline, outline
from skfem_contact.answers.validity.rotation import leaning_words, rotation_words
from skfem_contact.answers.validity.solids import looked_at, obstacle_drift
from skfem_contact.answers.validity.strain import strains
from skfem_contact.answers.validity.track import tool_motion
from skfem_contact.answers.validity.validity import ContactValidity, Validity
from skfem_contact.answers.validity.words import (
    chord_words,
    facet_words,
    overlap_words,
    sliding_words,
    strain_words,
)
from skfem_contact.conditions.friction import FrictionLaw
from skfem_contact.conditions.lever import as_motion
from skfem_contact.conditions.orthotropic import OrthotropicCoulomb
from skfem_contact.errors import warn
from skfem_contact.obstacles.obstacle import Obstacle

Array = NDArray[np.float64]


def assess(result: Answer) -> Validity:
    """Measure the validity of a result; needs the displacements of all bodies.

    Warns
    -----
    ContactWarning
        What is beyond its bound, unless its history has said so before.
    """
    system = result.system
    solids = {name: body for name, body in system.solids.items() if body.components > 1}
    found = {name: strains(body, result.displacement(body)) for name, body in solids.items()}
    outlines = {
        n: (outline if b.dim == 2 else hull)(b, result.displacement(b)) for n, b in solids.items()
    }
    contacts: dict[str, ContactValidity] = {}
    problems: dict[tuple[str, str], str] = {}
    for i, (contact, name) in enumerate(zip(result.contacts, result.names, strict=True)):
        if not result.watched.tracks:  # scalar fields move nothing
            break
        part = contacts[name] = _contact(result, i, outlines)
        label = f"Contact {name!r} ({contact.label}): "
        if not part.drift.small_sliding_holds:
            problems["sliding", name] = label + sliding_words(part.drift)
        elif part.excess > 1.0:  # small sliding that does not follow is the reason already
            problems["overlap", name] = label + overlap_words(part, contact)
        elif (words := _unseen_words(result, i, part)) and not part.drift.facets_too_long:
            problems["overlap", name] = label + words
        if part.drift.facets_too_long:
            problems["facets", name] = label + facet_words(part.drift, contact.rigid)
        if part.chord_share > GAP:
            problems["chords", name] = label + chord_words(part)
        if part.drift.strain > LARGE:
            problems["strain", name] = label + strain_words(part.drift)
    strain, largest, rotation = ({n: f[k] for n, f in found.items()} for k in range(3))
    told = any(kind == "strain" for kind, _ in problems)
    for name in solids:
        if strain[name] > LARGE and not told:
            problems["strain", name] = (
                f"Body {name!r} is strained by {strain[name]:.2g} where most of its energy is. "
                "Bodies are linear: errors are of that order."
            )
    far = {name: turn for name, turn in rotation.items() if turn > LARGE}
    if far:
        problems |= {("rotation", name): rotation_words({name: turn}) for name, turn in far.items()}
    leaning = result.watched.leaning
    far = {name: share for name, share in leaning.items() if share > SECOND_ORDER}
    problems |= {("second order", name): leaning_words({name: share}) for name, share in far.items()}
    for key, text in problems.items():
        if result.converged and key not in result.watched.said:
            warn(text)
    return Validity(contacts, strain, largest, rotation, problems, dict(leaning))


def _unseen_words(result: Answer, i: int, part: ContactValidity) -> str:
    """What no row of the contact sees: corners of obstacles, vertices and edges of solids."""
    if i in result.watched.unseen:
        return result.watched.unseen[i]
    if i not in result.watched.standing:
        return ""
    lookouts = Lookouts(result.recover.model.geometry, lambda: np.arange(result.system.n))
    return lookouts.sure(i, result, part.drift)


def _contact(result: Answer, i: int, outlines: Mapping[str, Outline | Hull]) -> ContactValidity:
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
        drift = replace(drift, **found)
    else:
        elastic = beyond_round_off(elastic_approach(result, i, closed), result.system.extent)
        drift = replace(drift, approach=max(drift.approach, elastic))
    chord_gaps = float(np.max(track.chord[closed], initial=0.0))
    secondary = contact.secondary
    moved = secondary.points + result.displacement(secondary.body)[secondary.dofs]
    added = track.added - result.worn_case.interference[part]
    args = moved, added, closed, result.kin.paired[part]
    if isinstance(contact.primary, Obstacle):
        # the obstacle is exact: where facets are too long to meet it, nothing explains the overlap
        chords = sagitta(secondary, secondary.facet_node_normals)
        motion = result.case.motion[i].as_argument()
        if contact.rigid_body is not None:
            motion = as_motion(result.system, contact.rigid_body, result.u)
        obstacle = contact.primary.moved(motion)
        meeting = at_obstacle(obstacle, secondary, chords, *args)
    elif contact.primary.body is secondary.body:
        chords, meeting = 0.0, Meeting()
    else:
        names = [result.system.names[result.system.index(s.body)] for s in (secondary, contact.primary)]
        chords = sagitta(secondary, secondary.facet_node_normals)
        chords += sagitta(contact.primary, contact.primary.facet_node_normals)
        meeting = between(outlines[names[0]], outlines[names[1]], chords, result.system.extent, *args)
    angle = float(np.max(result.kin.tilt[part][closed], initial=0.0))
    mu = float(np.max(_coefficient(contact.friction)))
    share = angle / mu if mu > 0 else np.nan
    return ContactValidity(
        drift, meeting.overlap, chords, meeting.unseen, meeting.opening, angle, share, chord_gaps
    )


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
