"""The loops `newton` and `direct`: solve for a set of statuses, let the answer correct the set.

``newton``      semismooth Newton: the friction force of a slipping point follows the normal force
                within the linear solve.
``direct``      [M] fig. 4b: a slipping point carries the friction force of the last iterate as a load.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from skfem_contact.conditions.state import OPEN, SLIP, STICK
from skfem_contact.linalg.singular import SingularMatrix
from skfem_contact.loops.rules import disagreement, hold, law_residual, propose
from skfem_contact.loops.step import Guess, Iterate, Step
from skfem_contact.problem.response import Conditions, Response

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]


def newton(step: Step, guess: Guess, tolerance: float) -> Iterator[Iterate]:
    """Semismooth Newton with the consistent derivative of the return map."""
    return _active_set(step, guess, tolerance, coupled=True)


def direct(step: Step, guess: Guess, tolerance: float) -> Iterator[Iterate]:
    """[M] fig. 4b: slipping points carry the friction force of the last iterate."""
    return _active_set(step, guess, tolerance, coupled=False)


def _active_set(step: Step, guess: Guess, tolerance: float, coupled: bool) -> Iterator[Iterate]:
    """Solve for a set of statuses, let the answer correct the set, until it agrees."""
    current = guess
    # the limits of `direct` settle over several iterations: until then its sets may well change
    pace = Pace(patience=4 if coupled else 15)
    while True:
        status, held = hold(step, current)
        if held is not None:
            current = replace(current, status=status)
        response, conditions = _solve(step, current, coupled)
        proposal = propose(step, current, response)
        wrong = disagreement(current, proposal)
        residual = law_residual(step, status, current.direction, response)
        changing = wrong if held is None else wrong & ~held.points
        kept = held is not None and bool((wrong & held.points).any())
        yield Iterate(
            status,
            current.direction,
            response,
            conditions,
            int(wrong.sum()),
            residual,
            converged=not (changing.any() or kept) and residual <= tolerance,
            note=pace.note(),
            held=held.motion if held is not None and kept else None,
        )
        current = pace.advance(step, current, proposal, changing, response)


@dataclass
class Pace:
    """How many points may change at once (block principal pivoting of Judice and Pires, 1994).

    Whole sets change as long as their number falls; after a few iterations without progress, one
    point at a time, the last in the order of `Step.rank`, until there is progress again. On problems
    with unique solutions this ends; where it does not, the driver's count does.
    """

    patience: int
    best: int = np.iinfo(int).max
    left: int = 0
    single: bool = False

    def note(self) -> str:
        return "one point at a time" if self.single else ""

    def advance(
        self, step: Step, current: Guess, proposal: Guess, wrong: Mask, response: Response
    ) -> Guess:
        count = int(wrong.sum())
        if count < self.best:
            self.best, self.left, self.single = count, self.patience, False
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


def _solve(step: Step, current: Guess, coupled: bool) -> tuple[Response, Conditions]:
    """Solve for a set; where the law's tangent has no unique answer, with limits that lag."""
    conditions = _conditions(step, current, coupled)
    try:
        return step.problem.solve(conditions, step.load), conditions
    except SingularMatrix:
        if not conditions.coupling.any():
            raise
    conditions = _conditions(step, current, coupled=False)
    return step.problem.solve(conditions, step.load), conditions


def _conditions(step: Step, current: Guess, coupled: bool) -> Conditions:
    closed = current.status != OPEN
    slips = (current.status == SLIP) & step.frictional
    sticks = current.status == STICK
    stick = sticks & (step.exact & step.frictional | step.tied)
    m, t = current.direction.shape
    offset, coupling, spring = np.zeros((m, t)), np.zeros((m, t)), np.zeros((m, t, t))
    if slips.any():
        along, asked = current.direction, (current.normal_force, current.slip)
        if coupled:
            force, by = step.derivatives(along, *asked)
            coupling[slips] = by.normal_force[slips]
            force -= coupling * np.maximum(current.normal_force, 0.0)[:, None]
            if by.slip.any():
                # a bound that falls with the slip lags: it would take stiffness away from the bodies
                grows = slips & (np.einsum("ikk->i", by.slip) > 0)
                spring[grows] = by.slip[grows]
                force -= np.einsum("ikl,il->ik", spring, current.slip)
        else:
            force = step.sliding(along, *asked)
        offset[slips] = force[slips]
    elastic = sticks & step.frictional & ~step.exact
    if elastic.any():
        offset[elastic] = step.trial(np.zeros((m, t)))[elastic]
        spring[elastic] = step.stiffness[elastic, None, None] * np.eye(t)
    return Conditions(closed, stick, step.last.slip, spring, offset, coupling)
