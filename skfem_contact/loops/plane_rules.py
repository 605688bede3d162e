"""The rules by which points change in the plane, where friction has two directions and no others."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from skfem_contact.conditions.return_map import lengths
from skfem_contact.conditions.state import OPEN, SLIP, STICK
from skfem_contact.loops.step import Guess, Step
from skfem_contact.loops.thresholds import ROUND_OFF
from skfem_contact.problem.response import Response

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

# That of a single number.
EPS = float(np.finfo(float).eps)


def propose_in_plane(step: Step, current: Guess, response: Response) -> Guess:
    """The set that the answer asks for: Signorini's conditions and the friction law, point by point."""
    force_scale = response.largest_force
    was_open = current.status == OPEN
    finite = np.isfinite(response.gap)
    gap_scale = np.abs(response.gap[finite] - step.load.gap0[finite]).max(initial=0.0)
    nothing = max(ROUND_OFF * force_scale, step.noise)
    penetrates = was_open & (response.gap < -ROUND_OFF * gap_scale) & step.paired
    pulls = ~was_open & (response.normal_force < -nothing) & ~step.bilateral

    slips, direction = np.zeros_like(was_open), np.zeros_like(response.slip)
    if step.laws:
        slips, direction = _slip_rule(step, current, response, force_scale, penetrates)
    status = np.where(slips, SLIP, STICK)
    status = np.where(was_open & ~penetrates | pulls, OPEN, status)
    status = np.where(step.tied & step.paired, STICK, status)
    return Guess(status, direction, response.normal_force, response.tangential_force, response.slip)


def _slip_rule(
    step: Step,
    current: Guess,
    response: Response,
    force_scale: float,
    closes: Mask,
) -> tuple[Mask, Array]:
    """Which points slip that are closed or just close, and in which direction friction then acts."""
    exact, trial = step.exact, response.tangential_force
    if not exact.all():
        trial = np.where(exact[:, None], trial, step.trial(response.slip))
    size = lengths(trial)
    lawful, _ = step.force(trial, response.normal_force, response.slip)
    beyond = lengths(trial - lawful) > max(ROUND_OFF * force_scale, step.noise)
    was_slip = current.status == SLIP
    # an exactly sticking point has no trial force while it slips: it goes on slipping as long as
    # the slip of this step follows the friction
    step_slip = response.slip - step.last.slip
    slip_scale = np.abs(step_slip).max(initial=0.0)
    forward = np.sum(step_slip * current.direction, axis=1) >= -ROUND_OFF * slip_scale
    slips = np.where(exact & was_slip, forward, beyond) & step.frictional
    unit = trial / np.where(size > 0, size, 1.0)[:, None]
    # where the slip turns back the point sticks first, or forward and backward slip alternate
    slips &= ~was_slip | (np.sum(unit * current.direction, axis=1) >= 0) | exact
    # where nothing presses, forces are round-off and decide nothing: what slips goes on, for stuck it
    # would press by friction again, and be let go again
    slips &= was_slip | (force_scale > step.noise)
    # a coefficient of zero, or one that no force can tell from it: nothing can stick, not even the
    # round-off of a force
    probe = np.full_like(size, force_scale if force_scale > 0 else 1.0)
    smooth = (step.limit(probe, response.slip) <= EPS * probe) & step.frictional
    slips |= smooth
    # where nothing resisted yet a point began to slip without a direction: now its slip tells
    known = current.direction.any(axis=1)
    keep = exact & was_slip & known
    direction = np.where(keep[:, None], current.direction, unit)
    blank = exact & was_slip & ~known
    if blank.any():
        distance = lengths(step_slip)
        along = step_slip / np.where(distance > 0, distance, 1.0)[:, None]
        direction = np.where(blank[:, None], along, direction)
    slips &= current.status != OPEN
    if closes.any():
        # a point that closes slips if it moves sideways by more than it sinks in allows: the trial
        # force r (s - s_n) against the limit under the trial pressure -r g (Alart and Curnier, 1991),
        # with an r that makes the largest slip the largest force. If it stuck, it could be in
        # tension, open, and close again without end
        r = force_scale / slip_scale if slip_scale > 0 else 0.0
        pressing = -r * np.where(closes, response.gap, 0.0)
        _, gives = step.force(r * step_slip, pressing, response.slip)
        sideways = closes & step.frictional & (gives | smooth)
        distance = lengths(step_slip)
        along = step_slip / np.where(distance > 0, distance, 1.0)[:, None]
        slips |= sideways
        direction = np.where(sideways[:, None], along, direction)
    return slips, np.where(slips[:, None], direction, 0.0)
