"""How many points may change at once, where statuses are all that changes."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from skfem_contact.loops.projection import all_left, resistances
from skfem_contact.loops.step import Guess, Step
from skfem_contact.problem.response import Resistance, Response

Mask = NDArray[np.bool_]


@dataclass
class Pace:
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
