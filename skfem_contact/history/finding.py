"""The answer to a load step, whether or not contact holds all bodies in one place."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from skfem_contact.answers.answer import Answer
from skfem_contact.answers.result import ContactResult
from skfem_contact.bodies.surface import CurveSurface
from skfem_contact.conditions.contact import Contact
from skfem_contact.conditions.motions import no_equilibrium
from skfem_contact.conditions.statics import drives, escape
from skfem_contact.errors import NoEquilibrium, NotConverged
from skfem_contact.history.checkpoint import SavedState
from skfem_contact.history.cutting import advance
from skfem_contact.history.grip import Grip
from skfem_contact.history.indifference import Indifference, Rest
from skfem_contact.history.load_step import Advance, Attempt, LoadStep, rough_at_rest
from skfem_contact.history.stepper import Stepper
from skfem_contact.linalg.singular import SingularMatrix
from skfem_contact.pairing.vertices import Corners
from skfem_contact.problem.model import EVEN_CLOSED

Array = NDArray[np.float64]
Known = Answer | SavedState | None

CAN_CARRY = "with the forces that contact can carry"


@dataclass(eq=False)
class Finding:
    """Looks for the answer to one load step, and has what it came to.

    Attributes
    ----------
    stepper : Stepper
    step : LoadStep
    start : Answer, SavedState or None
        What the step goes on from; None where nothing was before.
    advance : Advance
    rest : Rest or None
        Where the answer leaves motions free, that of `advance`; or, with a `pull`, what it would take
        to hold a motion that strains alone drive.
    refuted : ndarray, shape (k,), or None
        A motion by which statics alone shows that there is no equilibrium.
    grip : Grip or None
        What holds the bodies of an attempt that was good, where supports do not.
    """

    stepper: Stepper
    step: LoadStep
    start: Known
    advance: Advance = field(init=False)
    rest: Rest | None = None
    refuted: Array | None = None
    grip: Grip | None = None

    @property
    def settled(self) -> Rest | None:
        """The answer that leaves motions free, where it is one."""
        return None if self.rest is None or self.rest.pull else self.rest

    def find(self) -> None:
        """Find the answer; where it leaves motions free, at the place that moves least."""
        model, f = self.stepper.model, self.step.target.f
        if model.loose.shape[1] and drives(model.motions, f, model.loose):
            raise no_equilibrium(model.motions, model.loose, EVEN_CLOSED, f, shown=True)
        may_float = bool(model.motions.k)
        try:
            self.advance = advance(self.stepper.held, self.step, self._doubt if may_float else None)
        except SingularMatrix as error:  # round-off decides whether a free motion makes it so
            if not may_float:
                raise
            self._free(error)
            return
        if may_float and self.advance.attempt.good:
            self.grip = Grip.of(model, self.advance.attempt)
            if self.grip.idles:
                self._press()
            if model.loose.shape[1] or self.grip.idles:
                self.rest = self._try_settle()
        rest = self.settled
        if rest is not None:
            rest.advance.trace[:0] = self.advance.trace
            self.advance = rest.advance

    def _doubt(self, failed: Attempt, last: bool) -> bool:
        """After a failure: is there no equilibrium, or one that leaves a motion free?

        Not where bodies move on under less than the load: it drives what is free.
        """
        model = self.stepper.model
        if not model.geometry.follows:  # other points may meet
            self.refuted = escape(model.motions, model.interface, model.kin.paired, self.step.target.f)
        if self.refuted is not None:
            return True
        if failed.at_limit:
            return False
        self.rest = self._try_settle(last)
        return self.settled is not None

    def _press(self) -> None:
        """Take an answer that holds all bodies where they were pressed before, if there is one.

        A block between inclined sides may stand loose as well as squeezed by friction. From squeezed it
        comes to loose by no small step, but iterations may jump there: pivoting has no such jumps.
        """
        by = self.stepper.held
        if "pivoting" not in by.starts or not np.any(self.step.state.normal_force > 0):
            return
        once = replace(by, options=replace(by.options, max_cuts=0))
        try:
            found = advance(once, self.step, begin=["pivoting"])
        except SingularMatrix:  # where it leads leaves a motion free as well
            return
        if not found.attempt.good:
            return
        grip = Grip.of(self.stepper.model, found.attempt)
        if not grip.idles:
            found.trace[:0] = self.advance.trace
            self.advance, self.grip = found, grip

    def _free(self, error: SingularMatrix) -> None:
        """Take the answer where a set of points left a motion free; none is no equilibrium.

        Where DOFs that hold the motion do not help and contact leaves none free, the matrix is singular
        of itself: `error`.
        """
        model = self.stepper.model
        motions, kin = model.motions, model.kin
        free = motions.free(kin.paired, kin.paired & model.interface.slipping)
        try:
            self.rest = rest = self._settle(True)
        except SingularMatrix:
            if not free.shape[1]:
                raise error from None
            rest = None
        if rest is not None and rest.pull:
            raise no_equilibrium(motions, rest.free, CAN_CARRY, pull=rest.pull) from error
        if rest is not None:
            self.advance = rest.advance
            return
        free = free if free.shape[1] else np.eye(motions.k)
        raise no_equilibrium(motions, free, CAN_CARRY, self.step.target.f) from error

    def _settle(self, last: bool) -> Rest | None:
        u_last = np.zeros(self.stepper.model.system.n) if self.start is None else self.start.u
        return Indifference(self.stepper, self.step, u_last).settle(last)

    def _try_settle(self, last: bool = False) -> Rest | None:
        try:
            return self._settle(last)
        except SingularMatrix:  # springs as weak as these do not hold a body everywhere
            return None


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
    sides = [s for s in (contact.secondary, contact.primary) if isinstance(s, CurveSurface)]
    return any(len(Corners.of(side).node) for side in sides)
