"""Friction at points whose slip is prescribed: supports move them, and take the force.

Where all DOFs of a tangential row are prescribed, the row has no equation to enter: whatever the
friction, supports balance it. The law gives it all the same, from the slip that they prescribe, and
what is reported as friction, its resultant and its energy are those of the law.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from skfem_contact.conditions.state import OPEN, SLIP, STICK
from skfem_contact.conditions.thresholds import BEYOND
from skfem_contact.loops.projection import same_slip
from skfem_contact.loops.step import Step

if TYPE_CHECKING:
    from skfem_contact.problem.response import Response

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]


def guided_friction(
    step: Step, guided: Mask, status: NDArray[np.intp], response: Response
) -> tuple[NDArray[np.intp], Array]:
    """Status (m,) and friction (m, d-1) of the answer, by the law where the slip is prescribed.

    In `step` guided points are none with friction: there is no equation for it.
    """
    at = guided & (status != OPEN)
    if not np.count_nonzero(at):
        return status, response.tangential_force
    moved = response.slip - step.last.slip
    size = np.linalg.norm(moved, axis=1)
    moves = size > same_slip(step, response)
    along = moved / np.where(moves, size, 1.0)[:, None]
    # exact sticking gives way to any slip
    exact = np.where(moves[:, None], BEYOND * along, step.last.tangential_force)
    trial = np.where(step.exact[:, None], exact, step.trial(response.slip))
    force, slips = step.friction.project(trial, response.normal_force, response.slip)
    slips |= moves & step.exact
    return (
        np.where(at, np.where(slips, SLIP, STICK), status),
        np.where(at[:, None], force, response.tangential_force),
    )
