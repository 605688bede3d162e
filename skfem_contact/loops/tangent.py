r"""The linear conditions of one iteration: statuses, and the derivative of the return map.

At a point that slips, friction is ``tau = P(t, lambda, s)``, with the return map P under a trial
force t. A finite tangential stiffness G makes it ``t = tau_n + G (s - s_n)``. Where sticking is exact
it is that of `projection`, ``t = tau + rho (s - s_n)``, with tau itself in it, for which the linear
equation is solved,

    tau = P + J (t' - t) + ...   =>   (1 - J) tau = rho J (s - s_n) + ...

With ``P = L d``, ``d = t / |t|``, ``b = L / |t|`` this is a spring across the direction of friction,
``rho b / (1 - b) (1 - d d')``: symmetric and positive semidefinite, at the answer
``L / |s - s_n| (1 - d d')`` whatever rho is. With one tangent it is zero.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from skfem_contact.arrays import lengths
from skfem_contact.conditions.friction_rule import grows
from skfem_contact.conditions.state import OPEN, SLIP, STICK
from skfem_contact.conditions.thresholds import BEYOND
from skfem_contact.loops.step import Guess, Step
from skfem_contact.problem.response import Conditions, odd_round_off

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]


def linear_conditions(step: Step, current: Guess, coupled: bool) -> Conditions:
    """What a set of statuses asks of every point.

    Parameters
    ----------
    step : Step
    current : Guess
    coupled : bool
        Whether friction follows the normal force within the linear solve, or its limit lags.
    """
    closed = current.status != OPEN
    slips = (current.status == SLIP) & step.frictional
    sticks = current.status == STICK
    stick = sticks & step.gripped
    m, t = current.direction.shape
    offset, coupling = np.zeros((m, t)), np.zeros((m, t))
    spring = np.zeros((m, t, t))
    if np.count_nonzero(slips):
        force, spring, coupling = _slipping(step, current, slips, coupled)
        offset = np.where(slips[:, None], force, 0.0)
    elastic = None if step.all_exact else sticks & step.frictional & ~step.exact
    if elastic is not None and np.count_nonzero(elastic):
        offset[elastic] = step.trial(np.zeros((m, t)))[elastic]
        spring[elastic] = step.stiffness[elastic, None, None] * np.eye(t)
    return Conditions(closed, stick, step.last.slip, spring, offset, coupling)


def _follows(step: Step, current: Guess, slips: Mask) -> Mask:
    """Points that slip and whose bound follows the normal force, (m,)."""
    if step.closed_for_good is None:
        return slips
    # under tension, which only a bond can have, the bound does not
    return slips & ~(step.bilateral & (current.normal_force < 0))


def _slipping(step: Step, current: Guess, slips: Mask, coupled: bool) -> tuple[Array, Array, Array]:
    """Friction of points that slip as ``offset + spring s + coupling lambda``."""
    reach = BEYOND if current.reach is None else current.reach[:, None]
    normal_force, slip = current.normal_force, current.slip
    force, beyond, by = step.friction.slipping(current.direction, reach, normal_force, slip)
    coupling, spring = np.zeros(force.shape), np.zeros(by.slip.shape)
    if coupled:
        coupling = np.where(_follows(step, current, slips)[:, None], by.normal_force, 0.0)
        force -= coupling * np.maximum(current.normal_force, 0.0)[:, None]
        if np.count_nonzero(by.slip):
            # a bound that falls with the slip lags: it would take stiffness away from the bodies
            rising = slips & grows(by)
            spring[rising] = by.slip[rising]
            force -= np.einsum("ikl,il->ik", spring, current.slip)
    if step.turns:
        turning = np.where((slips & beyond)[:, None, None], by.trial, 0.0)
        return _turning(step, current, reach * current.direction, turning, (force, spring, coupling))
    return force, spring, coupling


def _turning(
    step: Step, current: Guess, trial: Array, J: Array, friction: tuple[Array, Array, Array]
) -> tuple[Array, Array, Array]:
    """The same with the derivative J by the trial force, which is solved for where it has tau in it."""
    assert step.resistance is not None
    force, spring, coupling = friction
    exact = with_force = step.exact
    k = np.where(exact, step.resistance.tangential, step.stiffness)[:, None]
    if current.made is not None:  # the trial force of these is along the slip alone
        made, slip = current.made, lengths(current.slip - step.last.slip)
        k = np.where(made, lengths(trial) / np.where(made, slip, 1.0), k[:, 0])[:, None]
        with_force = exact & ~made
    still = np.where(exact[:, None], -k * step.last.slip, step.trial(np.zeros_like(trial)))
    force = force + np.einsum("ikl,il->ik", J, still - trial)
    spring = spring + k[:, :, None] * J
    solved = np.linalg.inv(np.eye(J.shape[1]) - np.where(with_force[:, None, None], J, 0.0))
    force, spring = np.einsum("ikl,il->ik", solved, force), solved @ spring
    # springs that count as symmetric are: of two halves that differ the solver reads one
    odd = odd_round_off(spring)
    return (
        force + np.einsum("ikl,il->ik", odd, current.slip),
        spring - odd,
        np.einsum("ikl,il->ik", solved, coupling),
    )
