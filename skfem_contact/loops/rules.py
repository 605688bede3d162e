"""The rules by which points change: Signorini's conditions and the friction law, point by point."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from skfem_contact.conditions.return_map import lengths
from skfem_contact.conditions.state import OPEN, SLIP, STICK
from skfem_contact.loops.step import Guess, Step
from skfem_contact.loops.thresholds import DIGITS_ALIKE, FIRMLY, ROUND_OFF
from skfem_contact.problem.response import Response

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

# That of a single number.
EPS = float(np.finfo(float).eps)


def propose(step: Step, current: Guess, response: Response) -> Guess:
    """The set that the answer asks for: Signorini's conditions and the friction law, point by point."""
    force_scale = response.largest_force
    was_open = current.status == OPEN
    finite = np.isfinite(response.gap)
    gap_scale = np.abs(response.gap[finite] - step.load.gap0[finite]).max(initial=0.0)
    nothing = max(ROUND_OFF * force_scale, step.noise)
    penetrates = was_open & (response.gap < -ROUND_OFF * gap_scale) & step.paired
    pulls = ~was_open & (response.normal_force < -nothing)

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
    keep = exact & was_slip
    direction = np.where(keep[:, None], current.direction, unit)
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


def disagreement(current: Guess, proposal: Guess) -> Mask:
    """Points whose status or slip direction changes."""
    turned = lengths(current.direction - proposal.direction) > 1.0
    return (current.status != proposal.status) | (turned & (proposal.status == SLIP))


def law_residual(step: Step, status: NDArray[np.intp], direction: Array, response: Response) -> float:
    """Largest distance of a slipping point's friction force from the law, over the largest force."""
    if not step.laws:
        return 0.0
    scale = response.largest_force
    if scale <= step.noise:
        return 0.0
    slips = (status == SLIP) & (response.normal_force >= 0)
    if not slips.any():
        return 0.0
    lawful = step.sliding(direction, response.normal_force, response.slip)
    error = lengths(response.tangential_force - lawful)
    return float(error[slips].max() / scale)


@dataclass(frozen=True, eq=False)
class Held:
    """Points kept closed or sticking because a body would be free without them."""

    points: Mask
    motion: Array


def hold(step: Step, current: Guess) -> tuple[NDArray[np.intp], Held | None]:
    """Keep just so many points closed and sticking that no rigid motion is free.

    A body that only contact and friction hold makes the matrix singular while all its points are
    open or all slip, even if the answer is neither. The points nearest to what is needed are kept:
    those farthest below their friction limit, then those with the smallest gap. If the answer goes
    on contradicting them, there is no equilibrium; the driver says so.
    """
    status, motions = current.status, step.motions
    if motions.k == 0:
        return status, None
    holds = step.frictional | step.tied
    free = motions.free(status != OPEN, (status == STICK) & holds, FIRMLY)
    if free.shape[1] == 0:
        return status, None
    status, first = status.copy(), free
    points = np.zeros(len(status), dtype=bool)
    limit = step.limit(current.normal_force, current.slip)
    excess = lengths(current.tangential_force) - limit
    slipping, opened = _by(excess, status == SLIP, step), _by(step.load.gap0, status == OPEN, step)
    order = np.concatenate([slipping, opened])
    for i in order:
        if free.shape[1] == 0:
            break
        resists = np.abs(motions.normal[i] @ free).max(initial=0.0) > 1e-6
        turns = holds[i] and np.abs(motions.tangential[i] @ free).max(initial=0.0) > 1e-6
        if (status[i] == OPEN and resists) or turns:
            status[i] = STICK
            points[i] = True
            free = motions.free(status != OPEN, (status == STICK) & holds, FIRMLY)
    return status, Held(points, first)


def _by(value: Array, mask: Mask, step: Step) -> NDArray[np.intp]:
    """Points from the smallest value to the largest; those alike up to round-off by their rank."""
    chosen = np.flatnonzero(mask & step.paired)
    largest = np.max(np.abs(value[chosen]), initial=0.0)
    alike = np.round(value[chosen] / largest if largest > 0 else value[chosen], DIGITS_ALIKE)
    return chosen[np.lexsort((step.rank[chosen], alike))]
