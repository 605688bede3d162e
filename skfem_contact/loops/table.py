"""The nonlinear loops by name.

A loop is a generator of iterates. It solves one load step: which points are closed, which of them
slip, and how large the friction forces are. It yields every iterate with a record and never stops by
itself except when it has converged; one driver (`skfem_contact.loops.driver`) counts, logs, stops and
raises. Loops keep nothing between calls.

All reach the same solution. Open and closed points change by the same rule: a closed point in tension
opens, an open one that penetrates closes. The tangential stiffness that each needs is in `STIFFNESS` of
`skfem_contact.conditions.thresholds`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

from skfem_contact.loops.active_set import direct, newton
from skfem_contact.loops.fictitious import fictitious
from skfem_contact.loops.step import Guess, Iterate, Step
from skfem_contact.loops.thresholds import NEWTON_ITERATIONS


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
