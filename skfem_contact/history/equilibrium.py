"""The answer to a load step, whether or not contact holds all bodies in place; or why there is none.

`EquilibriumSearch.find` alone decides what came of a step. It ends with a `Verdict`: the step
arrived, has no equilibrium, or its loop did not converge.
"""

from __future__ import annotations

from dataclasses import field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from skfem_contact.answers.answer import Answer
from skfem_contact.answers.result import ContactResult
from skfem_contact.arrays import Array, Mask, lengths, size_of
from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.conditions.friction_rule import jumps_open, resisting_slips
from skfem_contact.conditions.interface import Interface
from skfem_contact.conditions.motions import (
    BARELY,
    SHOWN,
    SHOWN_HERE,
    RigidMotions,
    drives,
    escape,
    no_equilibrium,
    null_space,
)
from skfem_contact.conditions.state import OPEN, SLIP, STICK
from skfem_contact.digits import COMPUTED, GIVEN, SOLVED
from skfem_contact.errors import NoEquilibrium, NotConverged, SingularMatrix
from skfem_contact.history.load_step import Advance, Attempt, LoadStep, Recovery
from skfem_contact.history.stepper import TURNED, Stepper
from skfem_contact.history.stepping import advance
from skfem_contact.obstacles.obstacle import Faceted
from skfem_contact.pairing.corners import Corners
from skfem_contact.problem.model import EVEN_CLOSED, LinearModel
from skfem_contact.records import dataclass

if TYPE_CHECKING:
    from skfem_contact.history.checkpoint import SavedState
    from skfem_contact.history.neutral_equilibrium import Rest

    Known = Answer | SavedState | None

CAN_CARRY = "with the forces that contact can carry"


# Friction holds a motion at an angle to its direction by the square of the angle. Where that is below
# 1e-10, at 1e-5 rad, half of the digits of the place are lost: it counts as free, as what moves by
# `SOLVED` of a unit does.
ACROSS = 1e-4

# The smallest number that is divided by.
TINY = float(np.finfo(float).tiny)


@dataclass(eq=False)
class Grip:
    """The hold of the bodies at an answer: points that carry a force, and friction.

    Attributes
    ----------
    motions : RigidMotions
        Those that supports leave free, as the pairing of the answer sees them.
    attempt : Attempt
    carrying : ndarray of bool, shape (m,)
        Points with more than round-off of a force, glued ones too.
    stick : ndarray of bool, shape (m,)
        Of these the ones that friction or glue holds, also where it grows with the slip.
    largest : float
        Largest normal force, or what is round-off of the loads where nothing presses [force].
    firmly : float
        What holds a motion, see `RigidMotions.free`.
    """

    motions: RigidMotions
    attempt: Attempt
    carrying: Mask
    stick: Mask
    largest: float
    firmly: float

    @classmethod
    def of(cls, model: LinearModel, attempt: Attempt) -> Grip:
        """Say that of an attempt."""
        motions, state = attempt.problem.motions, attempt.local
        if attempt.model is not model:  # there DOFs are held that nothing holds
            motions = model.motions.seen_by(attempt.problem.kin)
        most = size_of(state.normal_force)
        floor = max(SOLVED * most, COMPUTED * attempt.terms)
        carrying = (state.status != OPEN) & (state.normal_force > floor)
        carrying |= motions.kin.never_opens
        stick = carrying & model.interface.slipping & (state.status == STICK)
        slips = carrying & (state.status == SLIP)
        if not attempt.friction.steady and np.count_nonzero(slips):
            stick |= resisting_slips(model.interface.laws, state, slips)
        firmly = TURNED if model.geometry.follows else SOLVED
        return cls(motions, attempt, carrying, stick, max(most, floor, TINY), firmly)

    @cached_property
    def idles(self) -> bool:
        """Whether an answer rests on points that carry nothing: some motion is held by nothing else.

        A point holds a motion by the work of its force: one that hardly moves on it and hardly carries
        anything (a point of an arc, that a body has rolled to by several widths) holds by round-off.
        """
        motions, carrying, stick = self.motions, self.carrying, self.stick
        share = self.attempt.local.normal_force / self.largest
        share[motions.kin.bilateral] = 1.0
        if motions.held(carrying * share**2, stick, max(self.firmly, GIVEN)):
            return False  # all the more so with the whole of their rows
        rows, across = motions.rows(carrying, stick), self._across()
        if null_space(np.concatenate([rows, across]), self.firmly).shape[1]:
            return True
        rows[: np.count_nonzero(carrying)] *= share[carrying, None]
        return null_space(np.concatenate([rows, across]), GIVEN).shape[1] > 0

    def _across(self, full: Mask | None = None) -> Array:
        """Rows (r, k) by which friction at its bound holds motions across its direction.

        At carrying points that slip, and at sticking ones whose friction is at its bound too, `full`.
        In space it turns with the slip, and so resists what turns it. How stiffly falls with the square
        of the angle between the motion and the friction, and with the way that has been slid.
        """
        motions, local = self.motions, self.attempt.local
        if motions.kin.tangents < 2:
            return np.zeros((0, motions.k))
        at = self.carrying & (local.status == SLIP) & np.any(local.tangential_force != 0, axis=1)
        if full is not None:
            at |= full
        friction = local.tangential_force[at]
        d = friction / lengths(friction)[:, None]
        slip = motions.tangential[at]
        left = slip - d[:, :, None] * np.einsum("pt,ptk->pk", d, slip)[:, None]
        return ACROSS * left.reshape(-1, motions.k)

    def adrift(self, interface: Interface) -> tuple[str, ...]:
        """Sentences on bodies whose place an answer does not decide, and that were not settled.

        A point that sticks with friction at its bound holds nothing: it may as well slip on, while
        others that slipped do so less, and all forces stay. On which of them the body comes to rest is
        a matter of the iterations. So it is where forces are round-off and contact slides far. A
        body that has slid over many of its lengths has round-off of that motion in its forces.
        """
        motions, state, full = self.motions, self.attempt.local, np.zeros(len(self.stick), dtype=bool)
        if np.count_nonzero(self.stick) and state.tangential_force.size:
            friction = lengths(state.tangential_force)
            full = self.stick & interface.frictional & (friction > 0) & (state.status == STICK)
            bound = self.attempt.friction_bound
            moved = max(self.attempt.model.stiffest) * size_of(state.slip)
            full &= friction >= (1 - SOLVED) * bound - COMPUTED * moved
        if not (np.count_nonzero(full) or self.idles):  # all that sticks holds, and that is enough
            return ()
        free = motions.free(self.carrying, self.stick & ~full, more=self._across(full))
        if not free.shape[1]:
            return ()
        if free.shape[1] == 1 and full.any():  # all of them have to slip against their friction at once
            slip = (motions.tangential[full] @ free)[..., 0]
            work = np.einsum("pt,pt->p", slip, state.tangential_force[full])
            if np.min(work) < 0 < np.max(work):
                return ()
        return motions.indifferent(free, BARELY)


@dataclass(frozen=True, eq=False)
class Verdict:
    """The end of a load step: it arrived, has no equilibrium, or its loop did not converge.

    Attributes
    ----------
    free : ndarray, shape (k, j), or None
        Motions along which nothing balances the loads, where there is no equilibrium.
    motions : RigidMotions or None
        Of which these are combinations.
    when : str
        Under which circumstances they are free, in words.
    f : ndarray, shape (n,), or None
        The load that drives them [force].
    shown : str
        What statics alone shows of the load, in words.
    pull : float
        What it would take to hold the bodies, over the largest point force, if known.
    carries : str
        How much of the load is carried, in words.
    advice : str
        What to try where the loop did not converge.
    reached : bool
        Whether there is a last state to show.
    """

    free: Array | None = None
    motions: RigidMotions | None = None
    when: str = CAN_CARRY
    f: Array | None = None
    shown: str = ""
    pull: float = 0.0
    carries: str = ""
    advice: str = ""
    reached: bool = True

    def error(self, loop: str, result: ContactResult | None) -> NoEquilibrium | NotConverged:
        """The exception for a step that did not arrive, with the last state."""
        if self.free is not None:
            assert self.motions is not None
            known = self.f, result, self.shown, self.pull, self.carries
            return no_equilibrium(self.motions, self.free, self.when, *known)
        failed = f"The loop '{loop}' did not converge"
        if result is None:
            return NotConverged(f"{failed}. {self.carries}{self.advice}{EARLIER}")
        from skfem_contact.answers.uniqueness import falling  # few loops fail

        names, other = falling(result._answer, -1.0), "direct" if loop == "newton" else "newton"
        falls = FALLS.format(", ".join(map(repr, names)), other) if names else ""
        advice = f"{self.carries}{falls}{self.advice}{LAST}"
        return NotConverged(f"{failed}: {result.message}. {advice}", result)


#: There is an answer.
ARRIVED = Verdict()


@dataclass(eq=False)
class EquilibriumSearch:
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
    settled : Rest or None
        The answer that leaves motions free, where it is one.
    recovery : Recovery
        What the displacements of the answer follow from.
    places : tuple of str
        What is to be said of bodies that may stand elsewhere.
    """

    stepper: Stepper
    step: LoadStep
    start: Known
    advance: Advance = field(init=False)
    rest: Rest | None = None
    refuted: Array | None = None
    grip: Grip | None = None
    settled: Rest | None = None
    recovery: Recovery = field(init=False)
    places: tuple[str, ...] = ()

    def find(self) -> Verdict:
        """Find the answer; where it leaves motions free, at the place that moves least."""
        verdict = self._found()
        if verdict.reached:
            self._place()
        return verdict

    def _place(self) -> None:
        """Find out where bodies stand, and whether they may stand elsewhere."""
        rest, grip, model = self.settled, self.grip, self.stepper.model
        self.recovery = Recovery.of(self.advance.attempt) if rest is None else rest.recover
        if rest is not None and rest.free.shape[1]:
            self.places = model.motions.indifferent(rest.free, rest.why)
            return
        if rest is not None:  # found on weak springs, and held by what carries
            grip = Grip.of(model, rest.advance.attempt)
        self.places = () if grip is None else grip.adrift(model.interface)

    def _found(self) -> Verdict:
        model, f = self.stepper.model, self.step.target.f
        if model.loose.shape[1] and drives(model.motions, f, model.loose):
            return Verdict(model.loose, model.motions, EVEN_CLOSED, f, shown=SHOWN, reached=False)
        may_float = bool(model.motions.k)
        try:
            self.advance = advance(
                self.stepper.pinned or self.stepper, self.step, self._doubt if may_float else None
            )
        except SingularMatrix as error:  # round-off decides whether a free motion makes it so
            if not may_float:
                raise
            return self._free(error)
        good = self.advance.good
        if may_float and good:
            self.grip = Grip.of(model, self.advance.attempt)
            if model.loose.shape[1] or self.grip.idles:
                self._come_to_rest(self._try_settle())
        rest = self.settled
        if rest is not None:
            rest.advance.trace[:0] = self.advance.trace
            self.advance = rest.advance
        return ARRIVED if good and self.rest is None else self._judged()

    def _judged(self) -> Verdict:
        """Return what the last attempt says of the step, and what was found out about it on the way."""
        attempt, model = self.advance.attempt, self.stepper.model
        if attempt.good:
            return ARRIVED
        if self.rest is not None:
            return Verdict(self.rest.free, model.motions, pull=self.rest.pull)
        motions, free = attempt.problem.motions, attempt.outcome.free
        carries = _carries(self.advance)
        if free is None and self.refuted is not None:
            motions, free = model.motions, self._sliding(self.refuted)[:, None]
        interface, kin, f = model.interface, attempt.problem.kin, attempt.case.f
        if free is not None:
            shown = SHOWN if self.refuted is not None else ""
            if model.geometry.changing.any() and escape(motions, interface, kin.paired, f) is not None:
                shown = SHOWN_HERE
            return Verdict(free, motions, f=f, shown=shown, carries=carries)
        named = attempt if attempt.culprit >= 0 else self.advance.unsettled or attempt
        if at_corners(named):
            return Verdict(advice=("" if named is attempt else FIRST.format(named.failure)) + CORNERS)
        if attempt.stateless is not None:
            return Verdict(advice=JUMPS + _stateless(attempt))
        changes = attempt.outcome.iterate.changes
        opens = attempt.local.area, kin.tangents, ~interface.bilateral
        if changes and jumps_open(interface.laws, *opens):
            return Verdict(advice=JUMPS + USUALLY)
        if not (interface.laws or attempt.at_limit or model.geometry.follows):
            return Verdict(advice=SMOOTH)
        return Verdict(carries=carries, advice=TOO_MUCH if attempt.at_limit else USUALLY)

    def _sliding(self, motion: Array) -> Array:
        """The part of a motion (k,) that closed points do not hold; all of it, where it opens them.

        Friction at its bound is refuted by motions that lift as they slide, along the rim of its cone.
        """
        model = self.stepper.model
        free = model.motions.free(model.kin.paired, np.zeros(len(model.kin.paired), dtype=bool))
        part = free @ (free.T @ motion)
        return part if np.linalg.norm(part) > GIVEN * np.linalg.norm(motion) else motion

    def _doubt(self, failed: Attempt, last: bool) -> bool:
        """After a failure: is there no equilibrium, or one that leaves a motion free?

        Not where bodies move on under less than the load: it drives what is free.
        """
        model, case = self.stepper.model, self.step.target
        geometry, kin = model.geometry, model.kin
        if not geometry.changing.any():  # else other points may meet
            kin = geometry.at(np.zeros(model.system.n), case) if geometry.follows else kin
            self.refuted = escape(model.motions.seen_by(kin), model.interface, kin.paired, case.f)
        if self.refuted is not None:
            return True
        if failed.at_limit:
            return False
        self._come_to_rest(self._try_settle(last))
        return self.settled is not None

    def _free(self, error: SingularMatrix) -> Verdict:
        """Take the answer where a set of points left a motion free; none is no equilibrium.

        Where DOFs that hold the motion do not help and contact leaves none free, the matrix is singular
        of itself: `error`.
        """
        model = self.stepper.model
        motions, kin = model.motions, model.kin
        free = motions.free(kin.paired, kin.paired & model.interface.slipping)
        try:
            rest = self._settle(True)
        except SingularMatrix:
            if not free.shape[1]:
                raise error from None
            rest = None
        if rest is None:
            free = free if free.shape[1] else np.eye(motions.k)
            return Verdict(free, motions, f=self.step.target.f, reached=False)
        if rest.pull:
            return Verdict(rest.free, motions, pull=rest.pull, reached=False)
        self._come_to_rest(rest)
        self.advance = rest.advance
        return self._judged()

    def _come_to_rest(self, rest: Rest | None) -> None:
        self.rest = rest
        self.settled = None if rest is None or rest.pull else rest

    def _settle(self, last: bool) -> Rest | None:
        from skfem_contact.history.neutral_equilibrium import NeutralEquilibrium  # needed by few

        u_last = np.zeros(self.stepper.model.system.n) if self.start is None else self.start.u
        return NeutralEquilibrium(self.stepper, self.step, u_last).settle(last)

    def _try_settle(self, last: bool = False) -> Rest | None:
        try:
            return self._settle(last)
        except SingularMatrix:  # springs as weak as these do not hold a body everywhere
            return None


LAST = "The last state is in `.result` of this exception, the steps before it in `.results`."
EARLIER = "The steps before this one are in `.results` of this exception."
USUALLY = (
    "Usually the load is more than friction can hold, or it has several equilibria (a large "
    "coefficient of friction), or the step is too large for its path. Compare the load with mu times "
    "the normal force. Try smaller load steps in history(...), prescribed displacements in the place "
    "of a force, or another loop. "
)
SMOOTH = (
    "Without friction a load that supports and contact can carry has one answer. Usually bodies are so "
    "thin, some hundred times as long as thick, that digits are lost: take fewer elements along them, "
    "or linear=skfem_contact.linalg.Direct(), which keeps more. "
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
TOO_MUCH = "Take a smaller load, more friction, or prescribe displacements to go beyond the limit. "
JUMPS = (
    "Friction that is not zero without pressure (Tresca, cohesion) is lost all at once where a point "
    "opens, and such a point may have no state at all: closed it is pulled, open it overlaps. A bound "
    "that begins at zero, Coulomb(mu, tau_max=...) with a large mu, is free of that, and so is a bond "
    "that never opens, Contact(separation=False). "
)
FIRST = "A larger part of the step came to this: {}. "
FALLS = (
    "The friction of contact {} falls with the slip: points that begin to slip carry less, and may go "
    "on by themselves. Try loop={!r}, which passes most of these; then smaller load steps, and "
    "prescribed displacements in the place of a force. "
)
CORNERS = (
    "Its surfaces have sharp corners. Usually a face gives way to the next one there: the "
    "body snaps from the one to the other, and between them there is no equilibrium, "
    "however small the step. Round the corners by an arc of a few facets, push "
    "less deep, or lead the bodies apart and together again behind the corner. "
)


def _carries(way: Advance) -> str:
    """Return how much of the step is carried, in words: four digits, none of them too large."""
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


def at_corners(attempt: Attempt) -> bool:
    """Whether an attempt failed for a point of surfaces with convex corners, their ends included."""
    if attempt.culprit < 0:
        return False
    interface = attempt.model.interface
    contact = interface.contacts[interface.contact_of(attempt.culprit)]
    primary = contact.primary
    sides = contact.secondary, primary.outline if isinstance(primary, Faceted) else primary
    surfaces = [side for side in sides if isinstance(side, ContactSurface)]
    return any(len(Corners.of(side).node) for side in surfaces if side.dim == 2)
