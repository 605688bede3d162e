"""Proximal point: a way to the answer where Newton's method finds none.

Large coefficients of friction on uneven surfaces leave Newton's steps no way down. The same problem
with a soft spring in series with every point has one: nearly every point is then by itself. Springs
without strain at the forces of the last such problem change nothing where these are the answer. They
are made stiffer from one problem to the next, and from near enough the problem itself is solved.
(R. T. Rockafellar, SIAM J. Control Optim. 14 (1976); with friction nothing is proved.)
"""

from __future__ import annotations

from dataclasses import replace
from typing import cast

import numpy as np

from skfem_contact.loops.active_set import newton
from skfem_contact.loops.driver import Outcome, drive
from skfem_contact.loops.pulled import after
from skfem_contact.loops.step import Guess, Record, Step
from skfem_contact.loops.thresholds import (
    EASED,
    EASED_AFTER,
    FROM_NEAR,
    IN_SERIES,
    MOST_IN_SERIES,
    NEAR,
    SOFTENED,
    SOFTEST,
    TOO_SOFT,
    TOO_STIFF,
)
from skfem_contact.problem.response import Resistance
from skfem_contact.problem.seam import ContactProblem


def proximal(step: Step, guess: Guess, tolerance: float) -> tuple[Guess, Outcome]:
    """Starting values from a chain of easier problems, and how the last of them ended.

    Parameters
    ----------
    step : Step
    guess : Guess
        Where the first of the problems begins.
    tolerance : float
        Of the problem itself.
    """
    softness, eased = SOFTEST, EASED
    trace: list[Record] = []
    while len(trace) < MOST_IN_SERIES and TOO_STIFF < softness < TOO_SOFT:
        found = drive(newton, _in_series(step, softness, guess), guess, tolerance, IN_SERIES)
        trace += [replace(record, note="springs in series") for record in found.trace]
        if not found.converged:
            softness, eased = softness * SOFTENED, EASED_AFTER
            continue
        before, guess = guess, replace(after(step, found), near=True)
        if _change(before, guess) < NEAR:
            found = drive(newton, step, guess, tolerance, FROM_NEAR)
            trace += found.trace
            if found.converged:
                guess, found = _of_least_pressure(step, found, tolerance, trace)
                return guess, replace(found, trace=tuple(trace))
        softness /= eased
    return guess, replace(found, trace=tuple(trace), converged=False, free=None)


def _of_least_pressure(
    step: Step, found: Outcome, tolerance: float, trace: list[Record]
) -> tuple[Guess, Outcome]:
    """Where forces are not unique, the answer to which springs come from no forces, if it is near."""
    guess = after(step, found)
    if step.problem.springs is None:
        return guess, found
    least = drive(newton, step, guess, tolerance, IN_SERIES)
    trace += least.trace
    return (after(step, least), least) if least.converged else (replace(guess, near=True), found)


def _in_series(step: Step, softness: float, guess: Guess) -> Step:
    """The step with a spring in series with every point, `softness` times as soft as the point itself.

    They have no strain at the forces of the guess.
    """
    whole = cast(ContactProblem, step.problem)  # no springs in series twice
    own = step.resistance or whole.resistance
    springs = Resistance(own.normal / softness, own.tangential / softness)
    together = Resistance(own.normal / (1 + softness), own.tangential / (1 + softness))
    problem = whole.in_series(springs)
    load = problem.at_forces(step.load, guess.normal_force, guess.tangential_force)
    return replace(step, problem=problem, load=load, resistance=together)


def _change(before: Guess, after: Guess) -> float:
    """Change of the forces over their size."""
    one, other = (np.column_stack([g.normal_force, g.tangential_force]) for g in (before, after))
    size = np.linalg.norm(other)
    return float(np.linalg.norm(other - one) / size) if size > 0 else 0.0
