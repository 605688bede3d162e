"""From one state to the next: a load step, cut into smaller ones where it fails.

A step is tried whole, from the last state's contact zone; if that fails, from a cold start, then from
complementary pivoting (Lemke's method); if all fail it is halved. What is left in the end is friction
that rises steeply where it jumps (`loops.steep`). Where contact slides far and a point
slid too far in it, it is cut to the share that the distance tells.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import dataclass, replace

from skfem_contact.errors import ConstraintError
from skfem_contact.history.energy import nothing
from skfem_contact.history.load_step import Advance, LoadStep
from skfem_contact.history.stepper import RAN_AWAY, STEEPLY, Stepper
from skfem_contact.history.thresholds import AIM, LONGER, SHORTER, SNAPS
from skfem_contact.history.wearing import attempted
from skfem_contact.linalg.singular import SingularMatrix

logger = logging.getLogger("skfem_contact")


@dataclass
class Parts:
    """How much of a load step is done, and how large a part of it is attempted next.

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
        """Whether a part that fails is not cut any more."""
        return self.share <= max(self.smallest, SNAPS) or self.fails >= self.most

    def go_on(self, travel: float) -> None:
        """Begin the next part where this one has ended, by the distance that points slid in it."""
        share = grown(self.share, travel)
        self.done, self.fails = self.aim, 0
        self.share = min(share, 1.0 - self.done)

    def cut(self, travel: float) -> None:
        """Take a smaller part: half of it, or as much as lets no point slide too far."""
        shorter = SHORTER
        if travel > 1.0:  # no fault of the step's but its size: measured, not tried
            shorter = AIM / travel
            self.smallest *= shorter
        self.share *= shorter
        self.fails += 1


def advance(
    by: Stepper,
    step: LoadStep,
    doubt: Callable[[bool], bool] | None = None,
    begin: list[str] | None = None,
) -> Advance:
    """Solve a load step, in parts where it fails; the last attempt says whether it arrived.

    `doubt(False)` is asked where the whole step has failed, whether to leave it at that, and
    `doubt(True)` where smaller steps have failed as well. `begin` are the starts of the first
    attempt, by default all that there are.
    """
    interface = by.model.interface
    so_far = Advance(nothing(interface))
    parts = Parts(by.options.max_cuts, SHORTER**by.options.max_cuts)
    part = step  # that is attempted: from where the parts before it have come to
    starts = begin or [s for s in by.starts if step.known is not None or s != "warm"]
    while True:
        aim = parts.aim
        if parts.share < 1.0:
            target = step.before.towards(step.target, aim)
            part = replace(part, target=target, share=aim - parts.done)
        try:
            attempt = attempted(by, part, starts[0])
        except ConstraintError:
            # contacts that share a node and can not all close there are no contradiction yet
            if starts == ["apart"]:
                raise
            starts = ["apart"]
            continue
        except SingularMatrix:
            # not of the bodies, if another set of points can be solved for
            if starts == [STEEPLY]:
                return so_far
            if len(starts) == 1:
                raise
            starts.pop(0)
            continue
        so_far.attempt = attempt
        so_far.trace.extend(attempt.outcome.trace)
        last = len(starts) == 1 or attempt.failure == RAN_AWAY  # wherever it begins
        lost = not attempt.good and not attempt.stopped and last
        if lost and doubt is not None and parts.share == 1.0 and doubt(False):
            return so_far
        if attempt.good:
            if interface.laws:
                so_far.energy += attempt.energy
            if aim >= 1.0:
                return so_far
            state = attempt.state
            part = replace(part, state=state, before=part.target, known=state)
            starts = list(by.starts)
            so_far.substeps += 1
            parts.go_on(attempt.travel)
        elif attempt.outcome.free is not None and "pivoting" in starts and by.complete:
            # smaller steps would end there too
            if starts == ["pivoting"]:
                return so_far
            starts = ["pivoting"]
        elif len(starts) > 1 and not attempt.failure and not attempt.stopped:
            starts.pop(0)  # before cutting: begin elsewhere
        elif parts.spent or attempt.stopped:
            if by.jumps and not (attempt.stopped or attempt.failure or starts == [STEEPLY]):
                starts = [STEEPLY]  # before giving up
                continue
            if doubt is not None and not attempt.stopped:
                doubt(True)
            return so_far
        else:
            parts.cut(attempt.travel)
            so_far.cuts += 1
            reason = attempt.failure or attempt.outcome.message
            logger.info("step cut to %.4g of its size: %s", parts.share, reason)
            part, starts = replace(part, known=part.state), list(by.starts)


def grown(share: float, travel: float) -> float:
    """The share to try after a success: twice as much, but no further than points may slide."""
    return share * min(LONGER, AIM / travel if travel > 0 else LONGER)
