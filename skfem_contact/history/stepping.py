"""From one state to the next: a load step, cut into smaller ones where nothing else helps.

A step is tried whole, from the last state's contact zone; if that fails, from
complementary pivoting (Lemke's method), then on a loading machine, which finds the answer or how much
of the load is carried (`loops.pulled`). Where there is no machine, as contact slides far or wears, the
step is halved; where a point slid too far in it, it is cut to the share that the distance tells. What
is left in the end is friction that rises steeply where it jumps (`loops.starts`).

Where surfaces wear, every attempt at a load step is solved again with the depth that it wears off.
The depth worn in a step opens the gaps at its end, and follows from the forces there: an equation
``w = w_n + c (lambda_n + lambda(w))`` with ``c = k |slip| / 2A`` at every point, a fixed point that
secants reach. Closed points answer a depth by ``d lambda = -S dw``, with the stiffness S that the
contact problem has on gaps and slips. The largest eigenvalue of ``c S`` is the share of the depth worn
that elastic bodies answer by another pressure, and says how long a step may be: what is rough from
point to point changes in a step by the factor ``(1 - c S) / (1 + c S)``, which must not be negative.
The second round shows how much of the first one's depth is answered; steps too long by that are cut.

Where contact slides far, every attempt is solved again on the pairing of its own answer. That is a
fixed point, which secants reach in half the rounds of repetition. A step in which a point slid too
far is refused, with the distance.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from skfem_contact.arrays import Array, Mask, lengths
from skfem_contact.conditions.interface import Interface
from skfem_contact.conditions.kinematics import Kinematics
from skfem_contact.conditions.state import OPEN, LocalState, State
from skfem_contact.digits import COMPUTED, GIVEN, NEWTON_STEPS, SOLVED
from skfem_contact.errors import SingularMatrix
from skfem_contact.history.load_step import Advance, Attempt, LoadStep
from skfem_contact.history.stepper import RAN_AWAY, Stepper
from skfem_contact.linalg.krylov import Anderson
from skfem_contact.loops.starts import REGULARISED
from skfem_contact.loops.step import Record
from skfem_contact.records import dataclass

# A step that fails is halved, and after a success the next part is twice as large: what one cut too
# many costs is won back by one that succeeds.
LONGER = 2.0

# What a step is cut to, of the distance that points may slide.
AIM = 0.95

# Rounds of plain repetition, which suffice where pressures are small against the modulus.
PLAIN = 3

# Round from which on a point that has left the primary surface is not taken back in the same step:
# at its very end there is no pairing that is that of its own answer.
EDGE = 5

# The share of the depth worn off in a step that the bodies may answer by another pressure is at most
# one: beyond it a point would wear until it is open, where it has only got lighter. In the mean of all
# points it is less.
ANSWERED = 0.3

# What a step is shortened by at least: pressures that have become zero do not say by how much.
FAR_TOO_LONG = 4.0

WHOLE_TURN = (
    "a rigid body is a whole turn or several from where it began, and would turn about another axis, "
    "for which its rotation vector has no direction"
)

logger = logging.getLogger("skfem_contact")


@dataclass
class Bisection:
    """The share of a load step that is done, and the size of the part that is attempted next.

    Attributes
    ----------
    most : int
        How often in a row a part may be cut.
    smallest : float
        Share that is not cut any more; distances that were measured do not count towards it.
    """

    most: int
    smallest: float
    done: float = 0.0
    share: float = 1.0
    fails: int = 0

    @property
    def aim(self) -> float:
        """Share of the step at the end of the part."""
        return min(1.0, self.done + self.share)

    @property
    def spent(self) -> bool:
        """Return whether a part that fails is not cut any more."""
        return self.share <= max(self.smallest, SOLVED) or self.fails >= self.most

    def go_on(self, travel: float) -> None:
        """Begin the next part where this one has ended, by the distance that points slid in it."""
        share = grown(self.share, travel)
        self.done, self.fails = self.aim, 0
        self.share = min(share, 1.0 - self.done)

    def of(self, step: LoadStep, part: LoadStep) -> LoadStep:
        """The part of a step that is attempted next, which begins where `part` does."""
        if self.share == 1.0:  # the whole step
            return part
        target = step.before.towards(step.target, self.aim)
        return replace(part, target=target, share=self.aim - self.done)

    def cut(self, travel: float) -> None:
        """Take a smaller part: half of it, or as much as lets no point slide too far."""
        shorter = 1 / LONGER
        if travel > 1.0:  # no fault of the step's but its size: measured, not tried
            shorter = AIM / travel
            self.smallest *= shorter
        self.share *= shorter
        self.fails += 1


def advance(
    by: Stepper, step: LoadStep, doubt: Callable[[Attempt, bool], bool] | None = None
) -> Advance:
    """Solve a load step, in parts where it fails; the last attempt says whether it arrived.

    `doubt(attempt, False)` is asked where the whole step has failed, whether to leave it at that, and
    `doubt(attempt, True)` where smaller steps have failed as well.
    """
    interface = by.model.interface
    so_far = Advance(np.zeros((2, len(interface.names))))
    parts = Bisection(by.options.max_cuts, LONGER**-by.options.max_cuts)
    part = step  # that is attempted: from where the parts before it have come to
    starts = _starts(by, step.known)
    freed: Attempt | None = None  # of pivoting, which has left a motion free
    while True:
        aim = parts.aim
        part = parts.of(step, part)
        attempt = _first_held(by, part, starts)
        if attempt is None:
            return so_far
        good = so_far.came_to(attempt, parts.done, aim)
        if good and aim >= 1.0:
            return so_far
        if freed is not None and not good:  # the machine tells only what is carried
            so_far.attempt = attempt = replace(freed, carried=attempt.carried)
        limit = not good and attempt.at_limit  # the rest of the starts has nothing to find
        last = len(starts) == 1 or limit or attempt.failure == RAN_AWAY  # wherever it begins
        lost = not good and not attempt.stopped and last
        # what pivoting has left free is doubted as it was
        doubted = attempt if freed is None else freed
        if lost and doubt is not None and parts.share == 1.0 and doubt(doubted, False):
            return so_far
        if good:
            part = replace(part, state=attempt.state, before=part.target, known=attempt.state)
            starts = _starts(by, attempt.state)
            so_far.substeps += 1
            parts.go_on(attempt.travel)
        elif freed is not None:
            return so_far
        elif "pivoting" in starts and attempt.outcome.free is not None and by.complete:
            # smaller steps would end there too; the machine says how much of this one is carried
            freed = attempt if starts[0] == "pivoting" else None
            rest = ("pulled",) if freed else ("pivoting", "pulled")
            starts = [start for start in starts if start in rest]
            if not starts:
                return so_far
        elif len(starts) > 1 and not (limit or attempt.failure or attempt.stopped):
            starts.pop(0)  # before cutting: begin elsewhere
        elif so_far.carried is not None or parts.spent or attempt.stopped:
            if by.jumps and not (attempt.stopped or attempt.failure or starts == [REGULARISED]):
                starts = [REGULARISED]  # before giving up
                continue
            if doubt is not None and so_far.cuts and not attempt.stopped:
                doubt(attempt, True)
            return so_far
        else:
            so_far.cuts += 1
            parts.cut(attempt.travel)
            logger.info("step cut to %.4g of its size: %s", parts.share, attempt.reason)
            part, starts = replace(part, known=part.state), _starts(by, part.state)


def _starts(by: Stepper, known: State | None) -> list[str]:
    """Where attempts begin that go on from a state, or from nothing."""
    return [start for start in by.starts if start != ("warm" if known is None else "cold")]


def _first_held(by: Stepper, part: LoadStep, starts: list[str]) -> Attempt | None:
    """An attempt from the first of the starts by which bodies are held; those before it are dropped.

    None where nothing is left but bounds that were made to rise steeply, and they are not.
    """
    while True:
        try:
            return attempted(by, part, starts[0])
        except SingularMatrix:
            # not of the bodies, if another set of points can be solved for
            if starts == [REGULARISED]:
                return None
            if len(starts) == 1:
                raise
            starts.pop(0)


def grown(share: float, travel: float) -> float:
    """The share to try after a success: twice as much, but no further than points may slide."""
    return share * min(LONGER, AIM / travel if travel > 0 else LONGER)


def attempted(by: Stepper, step: LoadStep, start: str) -> Attempt:
    """One attempt at a load step, with what wears off in it."""
    model, last = by.model, step.state
    interface = model.interface
    worn = interface.wear or np.count_nonzero(last.wear)
    if step.pairing is not None:  # renewed by somebody else
        return by.attempt(step, model.problem_on(*step.pairing), start)
    if not (worn or model.geometry.follows):  # as nearly always
        return by.attempt(step, step.workspace.borrowed(model.base), start)
    if not interface.wear:
        return _with_depth(by, step, start, last.wear)
    depth, secant, trace = last.wear, Anderson(), list[Record]()
    share = before = 0.0
    for number in range(NEWTON_STEPS):
        attempt = _with_depth(by, step, start, depth)
        trace += attempt.outcome.trace
        attempt = replace(attempt, outcome=replace(attempt.outcome, trace=tuple(trace)))
        if not attempt.good:
            return attempt
        way = lengths(attempt.problem.kin.slip_along(attempt.plastic_slip))
        volume = worn_volume(interface, attempt.start, attempt.local, way)
        area = attempt.local.area
        grown = np.divide(volume, area, out=np.zeros_like(volume), where=area > 0)
        change = last.wear + grown - depth
        left, size = float(np.linalg.norm(change)), float(np.linalg.norm(grown))
        if number == 1 and before > 0:
            share = left / before / ANSWERED
        if share > 1.0:
            words = f"its wear would change the pressures {share:.2g} times as much as they may"
            return replace(attempt, failure=words, travel=max(attempt.travel, share, FAR_TOO_LONG))
        if left <= max(GIVEN * size, COMPUTED * float(np.linalg.norm(depth))):
            local = replace(attempt.local, wear=last.wear + grown, worn=last.worn + volume)
            return replace(attempt, local=local, travel=max(attempt.travel, share))
        before, start = left, "warm"
        depth = secant.next(depth, depth + change)
        step = replace(step, known=attempt.state)
    return replace(attempt, failure=f"the depth worn off did not settle in {NEWTON_STEPS} rounds")


def _with_depth(by: Stepper, step: LoadStep, start: str, depth: Array) -> Attempt:
    """One attempt with the gaps that a depth worn off leaves, (m,)."""
    if not np.count_nonzero(depth):
        return on_own_pairing(by, step, start)
    attempt = on_own_pairing(by, replace(step, target=step.target.worn(depth)), start)
    return replace(attempt, case=step.target)


def worn_volume(interface: Interface, last: LocalState, new: LocalState, way: Array) -> Array:
    """Volume worn off each point between two states, by the laws of all contacts, (m,).

    The mean of the forces at both ends, zero at open points, on a way (m,).
    """
    pressing = [np.where(s.status != OPEN, np.maximum(s.normal_force, 0.0), 0.0) for s in (last, new)]
    force, volume = 0.5 * (pressing[0] + pressing[1]), np.zeros(len(way))
    for part, law in interface.wear:
        volume[part] = law.volume(force[part], way[part])
    return volume


def on_own_pairing(by: Stepper, step: LoadStep, start: str) -> Attempt:
    """One attempt at a load step; where contact slides far, on the pairing of its own answer."""
    model, options = by.model, by.options
    geometry, case = model.geometry, step.target
    if not geometry.follows:
        return by.attempt(step, step.workspace.borrowed(model.base), start)
    at = step.state.surface + step.share * step.state.trend
    u = geometry.predicted(at, case)
    problem = model.problem_on(geometry.at(u, case), u)
    trace: tuple[Record, ...] = ()
    secant, lost = Anderson(), np.zeros(len(geometry.finite), dtype=bool)
    for number in range(options.max_placements):
        attempt = by.attempt(step, problem, start)
        trace += attempt.outcome.trace
        outcome = replace(attempt.outcome, trace=trace)
        attempt = replace(attempt, outcome=outcome)
        if not attempt.good:
            return attempt
        attempt = travelled(by, attempt)
        if attempt.failure:
            return attempt
        there = geometry.spread(attempt.local.surface)
        asked, spun = geometry.turned(u, there)
        plain, dofs = number < PLAIN, geometry.surface_dofs
        u = asked if plain else geometry.spread(secant.next(u[dofs], asked[dofs]))
        next_kin = without_points(geometry.at(u, case, problem.kin), lost)
        if number >= EDGE:
            lost = lost | (problem.kin.paired & ~next_kin.paired)
        mismatch = max(spun, geometry.mismatch(problem.kin, next_kin, attempt.local, by.barred))
        limit = options.placement_tolerance
        if number + 1 == options.max_placements:
            limit = max(limit, options.tolerance)  # forces that a loop knows so far move points as far
        if mismatch <= limit:
            # so far only the next pairing is alike: what counts is that of the answer itself
            own = next_kin
            if not plain:
                own = without_points(geometry.at(there, case, next_kin), lost)
                mismatch = geometry.mismatch(problem.kin, own, attempt.local, by.barred)
            if mismatch <= limit:
                return settled(by, attempt, own, mismatch)
        start, step = "warm", replace(step, known=attempt.state)
        problem = model.problem_on(next_kin, u)
    point = geometry.least_settled(problem.kin, next_kin, attempt.local)
    words = f"the pairing did not settle in {options.max_placements} rounds ({mismatch:.1e}): "
    if spun == mismatch:
        return replace(attempt, mismatch=mismatch, failure=words + WHOLE_TURN)
    words += model.interface.point_words(point, next_kin.points[point])
    words += " meets another partner in every round"
    return replace(attempt, mismatch=mismatch, failure=words, culprit=point)


def settled(by: Stepper, attempt: Attempt, own: Kinematics, mismatch: float) -> Attempt:
    """The attempt whose pairing is that of its own answer, with the gaps of that."""
    local = attempt.local
    gap = np.where(by.model.geometry.finite & (local.status == OPEN), own.gap0, local.gap)
    # an obstacle takes its points along without another condition, and forces act where they are now
    attempt = replace(attempt, mismatch=mismatch, local=replace(local, gap=gap), action=own.action)
    return travelled(by, attempt)


def travelled(by: Stepper, attempt: Attempt) -> Attempt:
    """Measure how far points slid, over what is allowed; refuse what is beyond it."""
    geometry, interface = by.model.geometry, by.model.interface
    last, new = attempt.start, attempt.local
    closed = (new.status != OPEN) & (last.status != OPEN) & geometry.changing
    slid = np.linalg.norm(attempt.problem.kin.slip_along(new.slip - last.slip), axis=1)
    travel, culprit = 0.0, -1
    for contact, part in zip(interface.contacts, interface.point_slices, strict=True):
        way = np.where(closed[part], slid[part], 0.0)
        share = np.max(way) / (by.options.max_travel * np.mean(contact.secondary.lengths))
        if not share <= travel:  # a NaN as well
            travel, culprit = float(share), part.start + int(np.argmax(way))
    if travel > 1.0 + SOLVED:
        words = interface.point_words(culprit, attempt.problem.kin.points[culprit])
        words += f" slid {travel:.3g} times as far as max_travel allows"
        return replace(attempt, failure=words, travel=travel, culprit=culprit)
    return replace(attempt, travel=travel)


def without_points(kin: Kinematics, lost: Mask) -> Kinematics:
    """The pairing with some points open for good."""
    if not lost.any():
        return kin
    return replace(kin, paired=kin.paired & ~lost, gap0=np.where(lost, np.inf, kin.gap0))
