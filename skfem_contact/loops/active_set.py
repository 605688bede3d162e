"""The loops: solve for a set of statuses, let the answer correct the set.

``newton``      semismooth Newton: the friction force of a slipping point follows the normal force
                within the linear solve.
``direct``      [M] fig. 4b: a slipping point carries the friction force of the last iterate as a load.
``fictitious``  [M] fig. 4a, an initial-stress method: every closed point keeps its spring, and what a
                friction force exceeds its limit by returns as a load. One factorisation serves as long
                as the set of closed points does not change.

A loop is a generator of iterates. It solves one load step: which points are closed, which of them
slip, and how large the friction forces are. It yields every iterate with a record and never stops by
itself except when it has converged; one driver (`skfem_contact.loops.driver`) counts, logs, stops and
raises. Loops keep nothing state_between calls.

All reach the same solution. Open and closed points change by the same rule: a closed point in tension
opens, an open one that penetrates closes. How far an iteration goes is told by `BlockPivoting` in the
plane, and by `LineSearch` where directions of friction turn. The tangential stiffness that each loop
needs is in `STIFFNESS` of `skfem_contact.conditions.thresholds`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from skfem_contact.conditions.state import OPEN, SLIP, STICK
from skfem_contact.linalg.krylov import Anderson
from skfem_contact.loops.complementarity import (
    all_left,
    disagreement,
    law_residual,
    propose,
    resistances,
    violations,
)
from skfem_contact.loops.multipliers import through_springs
from skfem_contact.loops.step import Guess, Iterate, Step
from skfem_contact.loops.tangent import linear_conditions, stabilise
from skfem_contact.loops.thresholds import DECREASE, FREE_CHANGES, HALVINGS, NEWTON_ITERATIONS, SETTLED
from skfem_contact.problem.response import Conditions, Resistance, Response
from skfem_contact.records import dataclass

Mask = NDArray[np.bool_]
Array = NDArray[np.float64]


def newton(step: Step, guess: Guess, tolerance: float) -> Iterator[Iterate]:
    """Semismooth Newton with the consistent derivative of the return map."""
    return through_springs(partial(_active_set, coupled=True), step, guess, tolerance)


def direct(step: Step, guess: Guess, tolerance: float) -> Iterator[Iterate]:
    """[M] fig. 4b: slipping points carry the friction force of the last iterate."""
    return through_springs(partial(_active_set, coupled=False), step, guess, tolerance)


def _active_set(step: Step, guess: Guess, tolerance: float, coupled: bool) -> Iterator[Iterate]:
    """Solve for a set of statuses, let the answer correct the set, until it agrees."""
    current = guess
    # the limits of `direct` settle over several iterations: until then its sets may well change
    pace = LineSearch(whole=not coupled) if step.turns else BlockPivoting(patience=4 if coupled else 15)
    settled = False
    while True:
        status, held = stabilise(step, current, coupled)
        if held is not None:
            current = replace(current, status=status)
        conditions = linear_conditions(step, current, coupled)
        if held is None and not settled:
            conditions = replace(conditions, rough=True)
        response = step.problem.solve(conditions, step.load)
        proposal = propose(step, current, response)
        if step.turns:
            wrong, residual = violations(step, current, response, tolerance)
        else:
            wrong = disagreement(current, proposal)
            residual = law_residual(step, status, current.direction, response)
        changing = wrong if held is None else wrong & ~held.points
        kept = held is not None and np.count_nonzero(wrong & held.points) > 0
        yield Iterate(
            status,
            current.direction,
            response,
            conditions,
            int(np.count_nonzero(wrong)),
            residual,
            converged=not (np.count_nonzero(changing) or kept or response.rough)
            and (residual <= tolerance or pace.settled),
            note=pace.note(),
            held=held.motion if held is not None and kept else None,
            nearer=pace.nearer,
        )
        current = pace.advance(step, current, proposal, changing, response)
        settled = not np.count_nonzero(changing)


@dataclass
class BlockPivoting:
    """How many points may change at once (block principal pivoting of Judice and Pires, 1994).

    Whole sets change as long as there is progress; after a few iterations without any, one point at a
    time, the last in the order of `Step.rank`, until there is progress again. On problems with unique
    solutions this ends; where it does not, the driver's count does.

    Progress is a smaller number of points to change than ever, or less that these leave over of the
    conditions. The number alone does not tell: where the end of a slip zone travels, the few points
    there change in every iteration, and others as many in the next. No set has less left over than
    ever twice, so that this ends as well. Where bounds change with the slip, as those of users' own
    laws may, one set has many answers, which may come nearer without end: there the number alone
    counts.

    Attributes
    ----------
    nearer : bool
        Whether the last set had less left over than all before it that were asked.
    """

    patience: int
    best: int = np.iinfo(int).max
    left: int = 0
    single: bool = False
    settled: bool = False  # a set that stays, but for limits that lag, has not settled
    nearer: bool = False
    least: float = np.inf
    rho: Resistance | None = None  # that of the first set that was asked: what is left compares

    def note(self) -> str:
        return "one point at a time" if self.single else ""

    def advance(
        self, step: Step, current: Guess, proposal: Guess, wrong: Mask, response: Response
    ) -> Guess:
        count, self.nearer = int(wrong.sum()), False
        if count < self.best:
            self.best, self.left, self.single = count, self.patience, False
        elif self._comes_nearer(step, response):
            self.left, self.single = self.patience, False
        elif self.left > 0:
            self.left -= 1
        else:
            self.single = True
        take = wrong
        if self.single and count:
            take = np.zeros_like(wrong)
            last = np.flatnonzero(wrong)
            take[last[np.argmax(step.rank[last])]] = True
        return replace(
            proposal,
            status=np.where(take, proposal.status, current.status),
            direction=np.where(take[:, None], proposal.direction, current.direction),
        )

    def _comes_nearer(self, step: Step, response: Response) -> bool:
        """Whether less is left over than ever; asked only where the number does not fall."""
        if self.least == 0.0 or not step.friction.steady:
            return False
        self.rho = self.rho or resistances(step, response)
        left = all_left(step, response, self.rho)
        self.nearer = left < self.least
        self.least = min(left, self.least)
        return self.nearer


@dataclass
class LineSearch:
    """Armijo's rule on what the projection leaves over: a step is halved until less is left.

    Between two states lie those whose gaps, slips and forces are the same mean of theirs: bodies are
    linear, so that they are in equilibrium too. Before the first state none is known, and the step to
    it is whole. `whole`: all are. Limits that lag lead to another fixed point in every iteration, and
    not straight down to that of the step.
    """

    whole: bool
    settled: bool = False
    nearer: bool = False  # the search itself sees to it
    at: Response | None = None
    left: float = np.inf
    share: float = 1.0

    def note(self) -> str:
        return "" if self.share == 1.0 else f"{self.share:.2g} of a step"

    def advance(
        self, step: Step, current: Guess, proposal: Guess, wrong: Mask, response: Response
    ) -> Guess:
        # one more iteration tells round-off from what is left of a step
        self.settled = not wrong.any()
        there, left, self.share = response, all_left(step, response), 1.0
        if self.at is not None and not self.whole:
            for _ in range(HALVINGS):
                if left <= (1.0 - DECREASE * self.share) * self.left:
                    break
                self.share *= 0.5
                there = state_between(self.at, response, self.share)
                left = all_left(step, there)
        self.at, self.left = there, left
        return proposal if there is response else propose(step, current, there)


def state_between(a: Response, b: Response, share: float) -> Response:
    """The state at a share of the way from `a` to `b`; points without partner have no gap in either."""
    finite = np.isfinite(b.gap)
    gap = np.where(finite, 0.0, b.gap)
    gap[finite] = _mean(a.gap[finite], b.gap[finite], share)
    return Response(
        gap,
        _mean(a.slip, b.slip, share),
        _mean(a.normal_force, b.normal_force, share),
        _mean(a.tangential_force, b.tangential_force, share),
        _mean(a.solution, b.solution, share),
    )


def _mean(a: Array, b: Array, share: float) -> Array:
    return a + share * (b - a)


def fictitious(step: Step, guess: Guess, tolerance: float) -> Iterator[Iterate]:
    """[M] fig. 4a: the method of fictitious friction forces, accelerated by Anderson's mixing."""
    return through_springs(_fictitious, step, guess, tolerance)


def _fictitious(step: Step, guess: Guess, tolerance: float) -> Iterator[Iterate]:
    """The same without the springs through which points may be seen.

    Every closed point keeps its spring G. The friction force that the linear solve gives,
    ``tau_n + G (s - s_n) + e``, is compared with the return map of the elastic predictor, and the
    excess ``e`` is corrected until the two agree. The plain iteration contracts by a factor that
    tends to one as G grows; the acceleration shortens it but does not lift that limit.
    """
    excess = _excess(step, guess)
    mixing = Anderson(depth=7)
    current, free_changes = guess, FREE_CHANGES
    while True:
        closed_as_stick = np.where(current.status == OPEN, OPEN, STICK)
        status, held = stabilise(step, replace(current, status=closed_as_stick))
        elastic = (status == STICK) & step.frictional
        offset = np.where(elastic[:, None], step.last.tangential_force + excess, 0.0)
        spring = np.zeros((*offset.shape, offset.shape[1]))
        spring[elastic] = step.stiffness[elastic, None, None] * np.eye(offset.shape[1])
        conditions = Conditions(
            closed=status != OPEN,
            stick=(status != OPEN) & step.tied,
            anchor=step.last.slip,
            spring=spring,
            offset=offset,
            coupling=np.zeros_like(offset),
        )
        response = step.problem.solve(conditions, step.load)
        trial = step.trial(response.slip)
        mapped, slips = step.friction.project(trial, response.normal_force, response.slip)
        error = np.where(elastic[:, None], mapped - response.tangential_force, 0.0)
        scale = response.largest_force
        residual = float(np.max(np.abs(error), initial=0.0) / scale) if scale > 0 else 0.0

        proposal = propose(step, replace(current, status=status), response)
        wrong = (proposal.status == OPEN) != (status == OPEN)
        size = np.linalg.norm(mapped, axis=1)
        unit = mapped / np.where(size > 0, size, 1.0)[:, None]
        carries = (response.normal_force > 0) | step.bilateral
        shown = np.where(elastic & slips & carries, SLIP, status)
        kept = held is not None and bool((wrong & held.points).any())
        yield Iterate(
            shown,
            np.where((shown == SLIP)[:, None], unit, 0.0),
            response,
            conditions,
            int(wrong.sum()),
            residual,
            converged=not wrong.any() and residual <= tolerance,
            note="accelerated" if mixing.active else "",
            held=held.motion if held is not None and kept else None,
        )
        image = np.where(elastic[:, None], mapped - trial, 0.0)
        if wrong.any() and (free_changes > 0 or residual <= SETTLED):
            free_changes -= 1
            mixing = Anderson(depth=7)  # another set is another fixed-point problem
            excess = image
            status = np.where(proposal.status == OPEN, OPEN, STICK)
        else:
            excess = mixing.next(excess.ravel(), image.ravel()).reshape(excess.shape)
        current = replace(proposal, status=status)


def _excess(step: Step, guess: Guess) -> Array:
    """By what the law is exceeded where the guess presses, (m, d-1): none where nothing is known."""
    trial = step.trial(guess.slip)
    mapped, _ = step.friction.project(trial, guess.normal_force, guess.slip)
    known = step.frictional & (guess.normal_force > 0)
    return np.where(known[:, None], mapped - trial, 0.0)


@dataclass(frozen=True)
class Loop:
    """A loop and its limits.

    Attributes
    ----------
    iterates : callable
        ``iterates(step, guess, tolerance)``, the generator.
    most : int
        Iterations that an attempt may take where `Options` do not say.
    patience : int or None
        Iterations without progress after which an attempt is given up.
    """

    iterates: Callable[[Step, Guess, float], Iterator[Iterate]]
    most: int
    patience: int | None


LOOPS = {
    "newton": Loop(newton, NEWTON_ITERATIONS, 30),
    "direct": Loop(direct, 150, 30),
    # its convergence is linear: it creeps, but to halve the violation so rarely leads nowhere
    "fictitious": Loop(fictitious, 2000, 300),
}
