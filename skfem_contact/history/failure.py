"""What users are told where a load step has no answer."""

from __future__ import annotations

import numpy as np

from skfem_contact.answers.answer import Answer
from skfem_contact.answers.result import ContactResult
from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.conditions.contact import Contact
from skfem_contact.conditions.motions import no_equilibrium
from skfem_contact.errors import NoEquilibrium, NotConverged
from skfem_contact.history.energy import rough_at_rest
from skfem_contact.history.finding import CAN_CARRY, Finding
from skfem_contact.history.load_step import Advance, Attempt
from skfem_contact.pairing.vertices import Corners

USUALLY = (
    "Usually the load has no equilibrium or several (a large coefficient of friction), or the "
    "step is too large for its path. Try smaller load steps in history(...), another loop, or "
    "a smaller mu; "
)
CARRIES = (
    "Contact carries up to {} of this step: that much was reached by a load that is pulled through a "
    "spring{}. With friction it depends on the way, and other steps may come to a little more. "
)
MOVES_ON = "; beyond it the bodies move on without carrying more"
NOTHING = (
    "Contact carries no part of this step: pulled through a spring, however little, the bodies "
    "move on. "
)
TOO_MUCH = "Take a smaller load, more friction, or prescribe displacements to go beyond the limit; "
JUMPS = (
    "Friction that is not zero without pressure (Tresca, cohesion) is lost all at once where a point "
    "opens, and such a point may have no state at all: closed it is pulled, open it overlaps. A bound "
    "that begins at zero, Coulomb(mu, tau_max=...) with a large mu, is free of that, and so is a bond "
    "that never opens, Contact(separation=False). "
)
CORNERS = (
    "Its surfaces have sharp corners. Usually a face gives way to the next one there: the "
    "body snaps from the one to the other, and between them there is no equilibrium, "
    "however small the step. Round the corners by an arc of a few facets, push "
    "less deep, or lead the bodies apart and together again behind the corner; "
)


def failure(found: Finding, answer: Answer) -> NoEquilibrium | NotConverged:
    """The exception for a load step that did not arrive, with the last state."""
    by, attempt, result = found.stepper, found.advance.attempt, ContactResult(answer)
    interface = by.model.interface
    motions, free = attempt.problem.motions, attempt.outcome.free
    carries = _carries(found.advance)
    if found.rest is not None:
        driven = found.rest
        return no_equilibrium(by.model.motions, driven.free, CAN_CARRY, None, result, pull=driven.pull)
    if free is None and found.refuted is not None:
        motions, free = by.model.motions, found.refuted[:, None]
    if free is not None:
        shown = found.refuted is not None
        f = attempt.case.f
        return no_equilibrium(motions, free, CAN_CARRY, f, result, shown, carries=carries)
    usually = carries + (TOO_MUCH if attempt.at_limit else USUALLY)
    culprit = attempt.culprit
    if culprit >= 0 and _has_corners(interface.contacts[interface.contact_of(culprit)]):
        usually = CORNERS
    elif attempt.stateless is not None:
        usually = JUMPS + _stateless(attempt)
    elif attempt.outcome.iterate.changes and rough_at_rest(
        interface, attempt.local.area, attempt.problem.kin.tangents
    ):
        usually = JUMPS + USUALLY
    return NotConverged(
        f"The loop '{by.loop}' did not converge: {result.message}. {usually}"
        "the last state is in `.result` of this exception, the steps before it in `.results`.",
        result,
    )


def _carries(way: Advance) -> str:
    """How much of the step is carried, in words: four digits, none of them too large."""
    if way.carried is None or way.carried >= 1.0:
        return ""
    limit = way.attempt.at_limit
    share = np.floor(1e4 * way.carried) / 1e4
    if share > 0.0:
        return CARRIES.format(f"{share:.4g}", MOVES_ON if limit else "")
    return NOTHING if limit else ""


def _stateless(attempt: Attempt) -> str:
    """The points that have no state, in words."""
    interface, points, shares = attempt.model.interface, attempt.problem.kin.points, attempt.stateless
    assert shares is not None
    found = np.flatnonzero(shares)
    i = int(found[0])
    more = "" if len(found) == 1 else f" ({len(found)} points do so, of which this is the first)"
    return (
        f"Here {interface.point_words(i, points[i])} has none: with a bound that begins at zero, and "
        f"rises however steeply, it slips without pressure at {100 * shares[i]:.3g} % of it{more}. "
    )


def _has_corners(contact: Contact) -> bool:
    """Whether the surfaces of a contact have convex corners, their ends included."""
    sides = [s for s in (contact.secondary, contact.primary) if isinstance(s, ContactSurface)]
    return any(len(Corners.of(side).node) for side in sides if side.dim == 2)
