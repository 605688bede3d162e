r"""Signorini's conditions and the friction law as one projection (Alart and Curnier, 1991).

With each point's own resistance rho against being moved, a state of gaps, slips and forces satisfies
both where, point by point,

    lambda = max(a, 0),                       a = lambda - rho_n g,
    tau = P(t) if a > 0, else 0,              t = tau + rho_t (s - s_n),

with P the return map of the friction law under the normal force a. Any positive rho will do: it only
says how gaps and slips count beside forces. A point with a finite tangential stiffness G has its
elastic trial force ``t = tau_n + G (s - s_n)`` instead. Where supports make a point slip along one of
its tangents exact sticking gives way, and t is any force along ``s - s_n`` that is beyond the bound.
Points that never open have ``lambda = a``, and laws are asked with ``max(a, 0)``.

`propose` makes of a state the set of statuses that it asks for, point by point; `violations` and
`law_residual` say how far it is from both.

In the plane friction has two directions and no others: a point slips to one side, or to the other.

Where all DOFs of a tangential row are prescribed, the row has no equation to enter: whatever the
friction, supports balance it. The law gives it all the same, from the slip that they prescribe, and
what is reported as friction, its resultant and its energy are those of the law.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from skfem_contact.arrays import largest, lengths
from skfem_contact.conditions.state import OPEN, SLIP, STICK
from skfem_contact.conditions.thresholds import BEYOND
from skfem_contact.digits import COMPUTED, GIVEN
from skfem_contact.loops.step import Guess, Step
from skfem_contact.loops.thresholds import ROUND_OFF, SOLVED_SLIP
from skfem_contact.problem.response import Resistance, Response

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]


def propose(step: Step, current: Guess, response: Response) -> Guess:
    """The set that a state asks for: the projection above, point by point.

    Where round-off would decide, a point keeps the status that it has in `current`.
    """
    if not step.turns:
        return propose_in_plane(step, current, response)
    gap_scale = approach(step, response)
    nothing = round_off(step, response.largest_force)
    rho = resistances(step, response)
    was_open = current.status == OPEN
    force = pressing(response, rho)
    penetrates = was_open & (force > rho.normal * (ROUND_OFF * gap_scale)) & step.paired
    pulls = ~was_open & (force < -nothing) & ~step.bilateral
    force = np.where(step.paired, np.where(step.bilateral, force, np.maximum(force, 0.0)), 0.0)

    driven = driven_to_slip(step, response)
    slips, direction, reach = slipping_in_space(step, current, response, force, rho)
    if driven is not None:
        slips |= driven
    slips &= ~was_open | penetrates
    direction = np.where(slips[:, None], direction, 0.0)
    status = np.where(slips, SLIP, STICK)
    status = np.where(was_open & ~penetrates | pulls, OPEN, status)
    status = np.where(step.tied & step.paired, STICK, status)
    own = response.tangential_force
    return Guess(status, direction, force, own, response.slip, reach=reach, driven=driven)


def slipping_in_space(
    step: Step, current: Guess, response: Response, force: Array, rho: Resistance
) -> tuple[Mask, Array, Array]:
    """Find the points that slip if they are closed, their directions, and their trial forces."""
    exact, was_slip = step.exact, current.status == SLIP
    force_scale = response.largest_force
    nothing = round_off(step, force_scale)
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
    # across its direction a slipping point has bound / (reach - bound) of its stiffness: 1e6 at most
    reach = np.where(bound > 0, np.maximum(size, bound / (1 - GIVEN)), BEYOND)
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
    gap_scale = approach(step, response)
    slip_scale = lengths(response.slip - step.last.slip).max(initial=0.0)
    rho = resistances(step, response)
    known = ROUND_OFF * np.maximum(rho.normal * gap_scale, rho.tangential * slip_scale)
    scale = response.largest_force
    allowed = max(step.noise, tolerance * scale)
    if step.all_exact:
        wrong = left > np.maximum(known, allowed)
    else:
        known = np.maximum(known, trial_round_off(step, response))
        sticks = (current.status == STICK) & step.frictional & ~step.exact
        over = lengths(response.tangential_force) - step.friction.bound(
            response.normal_force, response.slip
        )
        wrong = (left > np.maximum(known, allowed)) | sticks & (over > allowed)
    if scale <= step.noise:
        return wrong, 0.0
    if slip_scale > 0.0 and not np.count_nonzero(wrong):
        stretched = np.maximum(rho.tangential, scale / slip_scale)
        turned = left_over(step, response, Resistance(rho.normal, stretched))[1]
        left = np.maximum(left, lengths(turned))
    return wrong, float(left.max(initial=0.0) / scale)


def resistances(step: Step, response: Response) -> Resistance:
    """Each point's own resistance; where nobody knows it, one that makes both count alike."""
    if step.resistance is not None:
        return step.resistance
    force = response.largest_force
    moved = np.max(lengths(response.slip - step.last.slip), initial=0.0)
    alike = np.full(len(response.gap), force / moved if force > 0 and moved > 0 else 1.0)
    return Resistance(alike, alike)


def pressing(response: Response, rho: Resistance) -> Array:
    """The normal force ``a`` that a state asks for, negative where it asks for none, (m,) [force]."""
    return np.asarray(response.normal_force - rho.normal * response.gap)


def pushing(step: Step, response: Response, rho: Resistance) -> Array:
    """The trial friction force ``t`` of a state, (m, d-1) [force]."""
    moved = response.slip - step.last.slip
    trial = response.tangential_force + rho.tangential[:, None] * moved
    driven = driven_to_slip(step, response)
    if driven is not None:
        along = moved / np.where(driven, lengths(moved), 1.0)[:, None]
        trial = np.where(driven[:, None], BEYOND * along, trial)
    if step.all_exact:
        return trial
    return np.where(step.exact[:, None], trial, step.trial(response.slip))


def driven_to_slip(step: Step, response: Response) -> Mask | None:
    """Points that exact sticking does not hold, as supports move them along a tangent, (m,).

    None where there are no such supports.
    """
    if step.slip_prescribed_along is None:
        return None
    moved = lengths(np.where(step.slip_prescribed_along, response.slip - step.last.slip, 0.0))
    return step.exact & (moved > same_slip(step, response))


def approach(step: Step, response: Response) -> float:
    """The largest change of a gap since nothing was carried, of points with a partner [length]."""
    finite = np.isfinite(response.gap)
    return float(np.abs(response.gap[finite] - step.load.gap0[finite]).max(initial=0.0))


def round_off(step: Step, force_scale: float) -> float:
    """Forces up to this are round-off, where the largest is `force_scale` [force]."""
    return max(ROUND_OFF * force_scale, step.noise)


def same_slip(step: Step, response: Response) -> float:
    """A slip up to this may be the round-off of prescribed displacements [length]."""
    slips = max(lengths(slip).max(initial=0.0) for slip in (response.slip, step.last.slip))
    return COMPUTED * float(max(step.far, approach(step, response), slips))


def trial_round_off(step: Step, response: Response) -> Array:
    """Return what a finite stiffness makes of the round-off of slips, (m,)."""
    return np.where(step.exact, 0.0, step.stiffness) * (SOLVED_SLIP * same_slip(step, response))


def left_over(step: Step, response: Response, rho: Resistance | None = None) -> tuple[Array, Array]:
    """Return the residual of both equations at every point, (m,) and (m, d-1) [force]."""
    rho = rho or resistances(step, response)
    force = pressing(response, rho)
    closed = (step.bilateral | (force > 0)) & step.paired
    force = np.where(closed, force, 0.0)
    trial = pushing(step, response, rho)
    friction = np.where(
        step.tied[:, None], trial, step.friction.project(trial, force, response.slip)[0]
    )
    tangential = response.tangential_force - np.where(closed[:, None], friction, 0.0)
    modelled = step.paired & step.resisting
    return response.normal_force - force, np.where(modelled[:, None], tangential, 0.0)


def all_left(step: Step, response: Response, rho: Resistance | None = None) -> float:
    """Size of what the projection leaves over at all points together [force]."""
    normal, tangential = left_over(step, response, rho)
    return float(np.sqrt(np.sum(normal**2) + np.sum(tangential**2)))


# The status of a closed point by whether it slips; thrice as quick as `np.where`.
STICKS_OR_SLIPS = np.array([STICK, SLIP])

# That of a single number.
EPS = float(np.finfo(float).eps)


def propose_in_plane(step: Step, current: Guess, response: Response) -> Guess:
    """The set that the answer asks for: Signorini's conditions and the friction law, point by point."""
    force_scale = response.largest_force
    was_open = current.status == OPEN
    nothing = round_off(step, force_scale)
    penetrates = was_open & (response.gap < 0.0) & step.paired
    if np.count_nonzero(penetrates):
        penetrates &= response.gap < -ROUND_OFF * approach(step, response)
    pulls = response.normal_force < -nothing  # at open points it is zero
    if step.closed_for_good is not None:
        pulls &= ~step.bilateral

    if step.friction.laws:
        slips, along = slipping_in_plane(step, current, response, force_scale, penetrates)
        status, direction = STICKS_OR_SLIPS.take(slips), along[:, None]
    else:
        status, direction = np.full(len(was_open), STICK), np.zeros(response.slip.shape)
    status[was_open ^ penetrates | pulls] = OPEN
    if step.closed_for_good is not None:
        status[step.tied & step.paired] = STICK
    return Guess(status, direction, response.normal_force, response.tangential_force, response.slip)


def slipping_in_plane(
    step: Step,
    current: Guess,
    response: Response,
    force_scale: float,
    closes: Mask,
) -> tuple[Mask, Array]:
    """Find closed points that slip, and the side to which friction then acts, (m,)."""
    exact, trial = step.exact, response.tangential_force
    if not step.all_exact:
        trial = np.where(exact[:, None], trial, step.trial(response.slip))
    excess = step.friction.excess(trial, response.normal_force, response.slip)
    beyond = excess > round_off(step, force_scale)
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


if TYPE_CHECKING:
    from skfem_contact.problem.response import Response


def friction_of_prescribed_slip(
    step: Step, slip_prescribed: Mask, status: NDArray[np.intp], response: Response
) -> tuple[NDArray[np.intp], Array]:
    """Status (m,) and friction (m, d-1) of the answer, by the law where the slip is prescribed.

    In `step` these points are none with friction: there is no equation for it.
    """
    at = slip_prescribed & (status != OPEN)
    if not np.count_nonzero(at):
        return status, response.tangential_force
    moved = response.slip - step.last.slip
    size = lengths(moved)
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
