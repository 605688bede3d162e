"""The rules by which points change in the plane, where friction has two directions and no others."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from skfem_contact.arrays import largest
from skfem_contact.conditions.state import OPEN, SLIP, STICK
from skfem_contact.loops.projection import trial_round_off
from skfem_contact.loops.step import Guess, Step
from skfem_contact.loops.thresholds import ROUND_OFF
from skfem_contact.problem.response import Response

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

# The status of a closed point by whether it slips; thrice as quick as `np.where`.
STICKS_OR_SLIPS = np.array([STICK, SLIP])

# That of a single number.
EPS = float(np.finfo(float).eps)


def propose_in_plane(step: Step, current: Guess, response: Response) -> Guess:
    """The set that the answer asks for: Signorini's conditions and the friction law, point by point."""
    force_scale = response.largest_force
    was_open = current.status == OPEN
    nothing = max(ROUND_OFF * force_scale, step.noise)
    penetrates = was_open & (response.gap < 0.0) & step.paired
    if np.count_nonzero(penetrates):
        finite = np.isfinite(response.gap)
        gap_scale = np.abs(response.gap[finite] - step.load.gap0[finite]).max(initial=0.0)
        penetrates &= response.gap < -ROUND_OFF * gap_scale
    pulls = response.normal_force < -nothing  # at open points it is zero
    if step.closed_for_good is not None:
        pulls &= ~step.bilateral

    if step.friction.laws:
        slips, along = _slip_rule(step, current, response, force_scale, penetrates)
        status, direction = STICKS_OR_SLIPS.take(slips), along[:, None]
    else:
        status, direction = np.full(len(was_open), STICK), np.zeros(response.slip.shape)
    status[was_open ^ penetrates | pulls] = OPEN
    if step.closed_for_good is not None:
        status[step.tied & step.paired] = STICK
    return Guess(status, direction, response.normal_force, response.tangential_force, response.slip)


def _slip_rule(
    step: Step,
    current: Guess,
    response: Response,
    force_scale: float,
    closes: Mask,
) -> tuple[Mask, Array]:
    """Which points slip that are closed or just close, and to which side friction then acts, (m,)."""
    exact, trial = step.exact, response.tangential_force
    if not step.all_exact:
        trial = np.where(exact[:, None], trial, step.trial(response.slip))
    excess = step.friction.excess(trial, response.normal_force, response.slip)
    beyond = excess > max(ROUND_OFF * force_scale, step.noise)
    was_slip, was_along = current.status == SLIP, current.direction[:, 0]
    if not step.all_exact:
        beyond |= _goes_on(step, current, response, trial)
    # an exactly sticking point has no trial force while it slips: it goes on slipping as long as
    # the slip of this step follows the friction
    step_slip = (response.slip - step.last.slip)[:, 0]
    slip_scale = largest(np.abs(step_slip))
    forward = step_slip * was_along >= -ROUND_OFF * slip_scale
    keep = was_slip if step.all_exact else exact & was_slip
    slips = np.where(keep, forward, beyond) & step.frictional
    side = np.sign(trial[:, 0])
    if not step.all_exact:
        # where the slip turns back the point sticks first, or forward and backward slip alternate
        slips &= ~was_slip | (side * was_along >= 0) | exact
    # where nothing presses, forces are round-off and decide nothing: what slips goes on, for stuck it
    # would press by friction again, and be let go again
    if force_scale <= step.noise:
        slips &= was_slip
    smooth = smooth_points(step, force_scale, response.slip)
    if smooth is not False:
        slips |= smooth
    side = np.where(keep, was_along, side)
    # where nothing resisted yet a point began to slip without a direction: now its slip tells
    blank = keep & (was_along == 0)
    if np.count_nonzero(blank):
        side = np.where(blank, np.sign(step_slip), side)
    slips &= current.status != OPEN
    if np.count_nonzero(closes):
        # a point that closes slips if it moves sideways by more than it sinks in allows: the trial
        # force r (s - s_n) against the limit under the trial pressure -r g (Alart and Curnier, 1991),
        # with an r that makes the largest slip the largest force. If it stuck, it could be in
        # tension, open, and close again without end
        r = force_scale / slip_scale if slip_scale > 0 else 0.0
        pressing = -r * np.where(closes, response.gap, 0.0)
        _, gives = step.friction.project(r * step_slip[:, None], pressing, response.slip)
        sideways = closes & step.frictional & (gives | smooth)
        slips |= sideways
        side = np.where(sideways, np.sign(step_slip), side)
    return slips, np.where(slips, side, 0.0)


def _goes_on(step: Step, current: Guess, response: Response, trial: Array) -> Mask:
    """Points with a finite stiffness that slip, and are on the bound as well as can be told, (m,).

    Where loads turn back, what has slipped is left on its bound without moving: its slip is
    round-off, and the trial force the stiffness times that.
    """
    lawful = step.friction.sliding(current.direction, response.normal_force, response.slip)
    missing = np.sum((lawful - trial) * current.direction, axis=1)
    return (current.status == SLIP) & ~step.exact & (missing <= trial_round_off(step, response))


def smooth_points(step: Step, force_scale: float, slip: Array) -> Mask | bool:
    """Points where nothing can stick, not even the round-off of a force, (m,); False where none.

    Their coefficient is zero, or one that no force can tell from it.
    """
    if not step.friction.smooth:
        return False
    probe = np.full(len(slip), force_scale if force_scale > 0 else 1.0)
    return (step.friction.bound(probe, slip) <= EPS * probe) & step.frictional
