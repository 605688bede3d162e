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
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from skfem_contact.arrays import lengths
from skfem_contact.conditions.thresholds import BEYOND
from skfem_contact.digits import COMPUTED
from skfem_contact.loops.step import Step
from skfem_contact.loops.thresholds import SOLVED_SLIP
from skfem_contact.problem.response import Resistance, Response

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]


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
    made = made_to_slip(step, response)
    if made is not None:
        along = moved / np.where(made, lengths(moved), 1.0)[:, None]
        trial = np.where(made[:, None], BEYOND * along, trial)
    if step.all_exact:
        return trial
    return np.where(step.exact[:, None], trial, step.trial(response.slip))


def made_to_slip(step: Step, response: Response) -> Mask | None:
    """Points that exact sticking does not hold, as supports move them along a tangent, (m,).

    None where there are no such supports.
    """
    if step.guided_along is None:
        return None
    moved = lengths(np.where(step.guided_along, response.slip - step.last.slip, 0.0))
    return step.exact & (moved > same_slip(step, response))


def same_slip(step: Step, response: Response) -> float:
    """A slip up to this may be the round-off of prescribed displacements [length]."""
    finite = np.isfinite(response.gap)
    approach = np.abs(response.gap[finite] - step.load.gap0[finite]).max(initial=0.0)
    slips = max(lengths(slip).max(initial=0.0) for slip in (response.slip, step.last.slip))
    return COMPUTED * float(max(step.far, approach, slips))


def trial_round_off(step: Step, response: Response) -> Array:
    """What a finite stiffness makes of the round-off of slips, zero where sticking is exact, (m,)."""
    return np.where(step.exact, 0.0, step.stiffness) * (SOLVED_SLIP * same_slip(step, response))


def left_over(step: Step, response: Response, rho: Resistance | None = None) -> tuple[Array, Array]:
    """What is left of both equations at every point, (m,) and (m, d-1) [force]."""
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
