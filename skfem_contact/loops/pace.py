"""How many points may change at once, where statuses are all that changes."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from skfem_contact.loops.step import Guess, Step
from skfem_contact.problem.response import Response

Mask = NDArray[np.bool_]


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
    settled: bool = False  # a set that stays, but for limits that lag, has not settled

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
