"""The line search that makes Newton's steps come down where directions of friction turn."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from skfem_contact.loops.projection import all_left
from skfem_contact.loops.rules import propose
from skfem_contact.loops.step import Guess, Step
from skfem_contact.loops.thresholds import DECREASE, HALVINGS
from skfem_contact.problem.response import Response

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]


@dataclass
class Search:
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
                there = between(self.at, response, self.share)
                left = all_left(step, there)
        self.at, self.left = there, left
        return proposal if there is response else propose(step, current, there)


def between(a: Response, b: Response, share: float) -> Response:
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
