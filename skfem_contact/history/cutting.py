"""From one state to the next: a load step, cut into smaller ones where nothing else helps.

A step is tried whole, from the last state's contact zone; if that fails, from
complementary pivoting (Lemke's method), then on a loading machine, which finds the answer or how much
of the load is carried (`loops.pulled`). Where there is no machine, as contact slides far or wears, the
step is halved; where a point slid too far in it, it is cut to the share that the distance tells. What
is left in the end is friction that rises steeply where it jumps (`loops.proximal`).
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import dataclass, replace

from skfem_contact.digits import SOLVED
from skfem_contact.history.contact_search import attempted
from skfem_contact.history.load_step import Advance, Attempt, LoadStep, nothing
from skfem_contact.history.stepper import RAN_AWAY, STEEPLY, Stepper
from skfem_contact.history.thresholds import AIM, LONGER, SHORTER
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
        return self.share <= max(self.smallest, SOLVED) or self.fails >= self.most

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
    doubt: Callable[[Attempt, bool], bool] | None = None,
    begin: list[str] | None = None,
) -> Advance:
    """Solve a load step, in parts where it fails; the last attempt says whether it arrived.

    `doubt(attempt, False)` is asked where the whole step has failed, whether to leave it at that, and
    `doubt(attempt, True)` where smaller steps have failed as well. `begin` are the starts of the first
    attempt, by default all that there are.
    """
    interface = by.model.interface
    so_far = Advance(nothing(interface))
    parts = Parts(by.options.max_cuts, SHORTER**by.options.max_cuts)
    part = step  # that is attempted: from where the parts before it have come to
    starts = begin or by.starts_from(step.known)
    while True:
        aim = parts.aim
        if parts.share < 1.0:
            target = step.before.towards(step.target, aim)
            part = replace(part, target=target, share=aim - parts.done)
        try:
            attempt = attempted(by, part, starts[0])
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
        if attempt.carried is not None:
            so_far.carried = parts.done + (aim - parts.done) * attempt.carried.share
        limit = attempt.at_limit and not attempt.good  # the rest of the starts has nothing to find
        last = len(starts) == 1 or limit or attempt.failure == RAN_AWAY  # wherever it begins
        lost = not attempt.good and not attempt.stopped and last
        if lost and doubt is not None and parts.share == 1.0 and doubt(attempt, False):
            return so_far
        if attempt.good:
            if interface.laws:
                so_far.energy += attempt.energy
            if aim >= 1.0:
                return so_far
            state = attempt.state
            part = replace(part, state=state, before=part.target, known=state)
            starts = by.starts_from(state)
            so_far.substeps += 1
            parts.go_on(attempt.travel)
        elif attempt.outcome.free is not None and "pivoting" in starts and by.complete:
            # smaller steps would end there too
            if starts == ["pivoting"]:
                return so_far
            starts = ["pivoting"]
        elif len(starts) > 1 and not (limit or attempt.failure or attempt.stopped):
            starts.pop(0)  # before cutting: begin elsewhere
        elif so_far.carried is not None or parts.spent or attempt.stopped:
            if by.jumps and not (attempt.stopped or attempt.failure or starts == [STEEPLY]):
                starts = [STEEPLY]  # before giving up
                continue
            if doubt is not None and so_far.cuts and not attempt.stopped:
                doubt(attempt, True)
            return so_far
        else:
            parts.cut(attempt.travel)
            so_far.cuts += 1
            reason = attempt.failure or attempt.outcome.message
            logger.info("step cut to %.4g of its size: %s", parts.share, reason)
            part, starts = replace(part, known=part.state), by.starts_from(part.state)


def grown(share: float, travel: float) -> float:
    """The share to try after a success: twice as much, but no further than points may slide."""
    return share * min(LONGER, AIM / travel if travel > 0 else LONGER)
