"""The loop `fictitious`: an initial-stress method, see `active_set`."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from skfem_contact.conditions.state import OPEN, SLIP, STICK
from skfem_contact.digits import GIVEN
from skfem_contact.linalg.krylov import Anderson
from skfem_contact.loops.active_set import stabilise
from skfem_contact.loops.complementarity import Projection
from skfem_contact.loops.multipliers import through_springs
from skfem_contact.loops.step import Guess, Iterate, Step
from skfem_contact.loops.thresholds import FREE_CHANGES
from skfem_contact.problem.response import Conditions

Array = NDArray[np.float64]


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

        proposal = Projection(step, response).proposal(replace(current, status=status))
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
        if wrong.any() and (free_changes > 0 or residual <= GIVEN):
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
