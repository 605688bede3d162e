"""The rules by which points change: Signorini's conditions and the friction law, point by point."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from skfem_contact.arrays import largest, lengths
from skfem_contact.conditions.state import OPEN, SLIP, STICK
from skfem_contact.conditions.thresholds import BEYOND
from skfem_contact.digits import GIVEN
from skfem_contact.loops.plane_rules import propose_in_plane, smooth_points
from skfem_contact.loops.projection import (
    left_over,
    made_to_slip,
    pressing,
    pushing,
    resistances,
    trial_round_off,
)
from skfem_contact.loops.step import Guess, Step
from skfem_contact.loops.thresholds import (
    BETWEEN,
    DIGITS_ALIKE,
    FIRMLY,
    NEARLY_STUCK,
    ROUND_OFF,
    ROUNDED,
)
from skfem_contact.problem.response import Resistance, Response

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]


def propose(step: Step, current: Guess, response: Response) -> Guess:
    """The set that a state asks for: the projection of `projection`, point by point.

    Where round-off would decide, a point keeps the status that it has in `current`.
    """
    if not step.turns:
        return propose_in_plane(step, current, response)
    finite = np.isfinite(response.gap)
    gap_scale = np.abs(response.gap[finite] - step.load.gap0[finite]).max(initial=0.0)
    nothing = max(ROUND_OFF * response.largest_force, step.noise)
    rho = resistances(step, response)
    was_open = current.status == OPEN
    force = pressing(response, rho)
    penetrates = was_open & (force > rho.normal * (ROUND_OFF * gap_scale)) & step.paired
    pulls = ~was_open & (force < -nothing) & ~step.bilateral
    force = np.where(step.paired, np.where(step.bilateral, force, np.maximum(force, 0.0)), 0.0)

    made = made_to_slip(step, response)
    slips, direction, reach = _slip_rule(step, current, response, force, rho)
    if made is not None:
        slips |= made
    slips &= ~was_open | penetrates
    direction = np.where(slips[:, None], direction, 0.0)
    status = np.where(slips, SLIP, STICK)
    status = np.where(was_open & ~penetrates | pulls, OPEN, status)
    status = np.where(step.tied & step.paired, STICK, status)
    own = response.tangential_force
    return Guess(status, direction, force, own, response.slip, reach=reach, made=made)


def _slip_rule(
    step: Step, current: Guess, response: Response, force: Array, rho: Resistance
) -> tuple[Mask, Array, Array]:
    """Which points slip if they are closed, in which direction, and under what trial force."""
    exact, was_slip = step.exact, current.status == SLIP
    force_scale = response.largest_force
    nothing = max(ROUND_OFF * force_scale, step.noise)
    bound = step.friction.bound(force, response.slip)
    trial = pushing(step, response, rho)
    if was_slip.any():
        # along its direction the friction of a point that slips is the bound, also where a bound
        # that is not linear, or lags, has given another
        along = np.sum(response.tangential_force * current.direction, axis=1)
        missing = np.where(was_slip & exact, bound - along, 0.0)
        trial = trial + missing[:, None] * current.direction
    size = lengths(trial)
    # what is open has no status to keep
    slack = np.where(was_slip, -nothing, np.where(current.status == STICK, nothing, 0.0))
    if not step.all_exact:
        slack -= np.where(was_slip, trial_round_off(step, response), 0.0)
    slips = (size > bound + slack) & step.frictional
    unit = trial / np.where(size > 0, size, 1.0)[:, None]
    # where the slip turns back the point sticks first, or forward and backward slip alternate
    slips &= ~was_slip | (np.sum(unit * current.direction, axis=1) >= 0)
    # where nothing presses, forces are round-off and decide nothing: what slips goes on, for stuck it
    # would press by friction again, and be let go again
    slips &= (current.status != STICK) | (force_scale > step.noise)
    smooth = smooth_points(step, force_scale, response.slip)
    keep = was_slip & (smooth | (size <= nothing))
    direction = np.where(keep[:, None], current.direction, unit)
    reach = np.where(bound > 0, np.maximum(size, bound / NEARLY_STUCK), BEYOND)
    return slips | smooth, direction, reach


def disagreement(current: Guess, proposal: Guess) -> Mask:
    """Points whose status or slip direction changes."""
    changes, slips = current.status != proposal.status, proposal.status == SLIP
    if np.count_nonzero(slips):
        old, new = current.direction, proposal.direction
        if old.shape[1] == 1:  # forward, backward, or not known
            turned = ((old != new) & (new != 0))[:, 0]
        else:
            turned = lengths(old - new) > 1.0
            turned |= (lengths(old) == 0) & (lengths(new) > 0)
        changes |= turned & slips
    return changes


def law_residual(step: Step, status: NDArray[np.intp], direction: Array, response: Response) -> float:
    """Largest distance of a slipping point's friction force from the law, over the largest force."""
    if not step.friction.laws:
        return 0.0
    scale = response.largest_force
    if scale <= step.noise:
        return 0.0
    slips = (status == SLIP) & ((response.normal_force >= 0) | step.bilateral)
    if not np.count_nonzero(slips):
        return 0.0
    lawful = step.friction.sliding(direction, response.normal_force, response.slip)
    error = lengths(response.tangential_force - lawful)
    return largest(error[slips]) / scale


def violations(step: Step, current: Guess, response: Response, tolerance: float) -> tuple[Mask, float]:
    """Points that violate the projection, and the largest violation over the largest force.

    What is within the tolerance is no violation, nor is what may be round-off of gaps and slips. A
    finite stiffness enlarges that of slips, but a force beyond its bound is one all the same. Where
    none is left, slips count as in the certificate: the largest of them as much as the largest force.
    Beside resistances small slips would count for nothing, and friction be off their direction.
    """
    normal, tangential = left_over(step, response)
    left = np.maximum(np.abs(normal), lengths(tangential))
    finite = np.isfinite(response.gap)
    gap_scale = np.abs(response.gap[finite] - step.load.gap0[finite]).max(initial=0.0)
    slip_scale = lengths(response.slip - step.last.slip).max(initial=0.0)
    rho = resistances(step, response)
    round_off = ROUND_OFF * np.maximum(rho.normal * gap_scale, rho.tangential * slip_scale)
    scale = response.largest_force
    allowed = max(step.noise, tolerance * scale)
    if step.all_exact:
        wrong = left > np.maximum(round_off, allowed)
    else:
        round_off = np.maximum(round_off, trial_round_off(step, response))
        sticks = (current.status == STICK) & step.frictional & ~step.exact
        over = lengths(response.tangential_force) - step.friction.bound(
            response.normal_force, response.slip
        )
        wrong = (left > np.maximum(round_off, allowed)) | sticks & (over > allowed)
    if scale <= step.noise:
        return wrong, 0.0
    if slip_scale > 0.0 and not np.count_nonzero(wrong):
        stretched = np.maximum(rho.tangential, scale / slip_scale)
        turned = left_over(step, response, Resistance(rho.normal, stretched))[1]
        left = np.maximum(left, lengths(turned))
    return wrong, float(left.max(initial=0.0) / scale)


@dataclass(frozen=True, eq=False)
class Held:
    """Points kept closed or sticking because a body would be free without them."""

    points: Mask
    motion: Array


def hold(step: Step, current: Guess, coupled: bool = True) -> tuple[NDArray[np.intp], Held | None]:
    """Keep just so many points closed and sticking that no rigid motion is free.

    A body that only contact and friction hold makes the matrix singular while all its points are
    open or all slip, even if the answer is neither. The points nearest to what is needed are kept:
    those farthest below their friction limit, then those with the smallest gap. If the answer goes
    on contradicting them, there is no equilibrium; the driver says so. Friction that grows with the
    slip holds as well where it does so within the linear solve, `coupled`.
    """
    status, motions = current.status, step.motions
    if motions.k == 0:
        return status, None
    holds = step.resisting
    if motions.held(status != OPEN, (status == STICK) & holds, FIRMLY):
        return status, None

    springs = np.zeros(len(status), dtype=bool)
    if coupled and np.count_nonzero(rubs := (status == SLIP) & step.frictional):
        springs = rubs & step.friction.hardens(current.direction, current.normal_force, current.slip)

    def still_free() -> Array:
        closed, stick = status != OPEN, (status == STICK) & holds | springs
        return motions.free(closed, stick, FIRMLY, _across(step, current, status))

    free = still_free()
    if free.shape[1] == 0:
        return status, None
    status, first = status.copy(), free
    points = np.zeros(len(status), dtype=bool)
    limit = step.friction.bound(current.normal_force, current.slip)
    excess = lengths(current.tangential_force) - limit
    # a gap is no more exact than the coordinates that it is a difference of
    known = ROUNDED * float(np.abs(motions.kin.points).max(initial=0.0))
    slipping = _by(excess, status == SLIP, step)
    opened = _by(step.load.gap0, status == OPEN, step, known)
    order = np.concatenate([slipping, opened])
    for i in order:
        if free.shape[1] == 0:
            break
        resists = np.abs(motions.normal[i] @ free).max(initial=0.0) > GIVEN
        slid = motions.tangential[i] @ free
        turns = holds[i] and np.sqrt((slid**2).sum(axis=0)).max(initial=0.0) > GIVEN
        if (status[i] == OPEN and resists) or turns:
            status[i] = STICK
            points[i] = True
            free = still_free()
    return status, Held(points, first)


def _across(step: Step, current: Guess, status: NDArray[np.intp]) -> Array | None:
    """Rows (r, k) by which slipping points hold rigid motions, across the direction of friction."""
    if not step.turns or current.reach is None:
        return None
    at = (status == SLIP) & step.frictional & (current.reach < BEYOND)
    d = current.direction[at]
    bound = step.friction.bound(current.normal_force, current.slip)[at]
    share = bound / current.reach[at]
    firm = np.sqrt(np.minimum(share / (1 - share), 1.0))  # stiffnesses are squares of rows
    across = np.eye(d.shape[1]) - d[:, :, None] * d[:, None, :]
    return ((firm[:, None, None] * across) @ step.motions.tangential[at]).reshape(-1, step.motions.k)


def _by(value: Array, mask: Mask, step: Step, known: float = 0.0) -> NDArray[np.intp]:
    """Points from the smallest value to the largest; those alike up to round-off by their rank.

    `known`: what values are uncertain by, however small they are.
    """
    chosen = np.flatnonzero(mask & step.paired)
    largest = max(float(np.max(np.abs(value[chosen]), initial=0.0)), known * 10**DIGITS_ALIKE)
    share = value[chosen] / largest if largest > 0 else value[chosen]
    alike = np.floor(share * 10.0**DIGITS_ALIKE + BETWEEN)
    return chosen[np.lexsort((step.rank[chosen], alike))]
