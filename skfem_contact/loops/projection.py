r"""Signorini's conditions and the friction law as one projection (Alart and Curnier, 1991).

With each point's own resistance rho against being moved, a state of gaps, slips and forces satisfies
both where, point by point,

    lambda = max(a, 0),                       a = lambda - rho_n g,
    tau = P(t) if a > 0, else 0,              t = tau + rho_t (s - s_n),

with P the return map of the friction law under the normal force a. Any positive rho will do: it only
says how gaps and slips count beside forces. A point with a finite tangential stiffness G has its
elastic trial force ``t = tau_n + G (s - s_n)`` instead. Points that never open have ``lambda = a``, and
laws are asked with ``max(a, 0)``.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from skfem_contact.conditions.return_map import lengths
from skfem_contact.loops.step import Step
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
    if step.all_exact:
        return trial
    return np.where(step.exact[:, None], trial, step.trial(response.slip))


def left_over(step: Step, response: Response) -> tuple[Array, Array]:
    """What is left of both equations at every point, (m,) and (m, d-1) [force]."""
    rho = resistances(step, response)
    force = pressing(response, rho)
    closed = (step.bilateral | (force > 0)) & step.paired
    force = np.where(closed, force, 0.0)
    trial = pushing(step, response, rho)
    friction = np.where(step.tied[:, None], trial, step.force(trial, force, response.slip)[0])
    tangential = response.tangential_force - np.where(closed[:, None], friction, 0.0)
    modelled = step.paired & step.resisting
    return response.normal_force - force, np.where(modelled[:, None], tangential, 0.0)
