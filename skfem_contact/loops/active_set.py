"""The loops `newton` and `direct`: solve for a set of statuses, let the answer correct the set.

``newton``      semismooth Newton: the friction force of a slipping point follows the normal force
                within the linear solve.
``direct``      [M] fig. 4b: a slipping point carries the friction force of the last iterate as a load.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import partial

import numpy as np

from skfem_contact.loops.multipliers import through_springs
from skfem_contact.loops.pace import Pace
from skfem_contact.loops.rules import disagreement, hold, law_residual, propose, violations
from skfem_contact.loops.search import Search
from skfem_contact.loops.step import Guess, Iterate, Step
from skfem_contact.loops.tangent import linear_conditions


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
    pace = Search(whole=not coupled) if step.turns else Pace(patience=4 if coupled else 15)
    settled = False
    while True:
        status, held = hold(step, current, coupled)
        if held is not None:
            current = replace(current, status=status)
        conditions = linear_conditions(step, current, coupled)
        if step.turns and held is None and not settled:
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
        settled = step.turns and not np.count_nonzero(changing)
