"""Friction that is not needed, taken out of an answer whose forces are not unique.

Springs share a force between pressure and friction where both can balance it. Friction is asked for
only where pressure can not: so a uniform stress stays uniform where blocks meet.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix

from skfem_contact.arrays import largest
from skfem_contact.conditions.kinematics import without_columns
from skfem_contact.conditions.rows import stacked
from skfem_contact.conditions.state import SLIP
from skfem_contact.digits import COMPUTED
from skfem_contact.loops.step import Iterate, Step
from skfem_contact.problem.springs import least_friction

Array = NDArray[np.float64]


def with_least_friction(step: Step, iterate: Iterate) -> Iterate:
    """The same answer with no more friction than is needed, where pressures and bounds allow it.

    Points that slip keep their forces: friction follows the normal force there. A set of rows is taken
    after the other, each by itself.

    Parameters
    ----------
    step : Step
    iterate : Iterate
        An answer in which no spring has a strain.
    """
    give, response, held = step.problem.springs, iterate.response, iterate.conditions
    sticks = held.closed & held.stick
    if give is None or not np.any(sticks & step.frictional):
        return iterate
    system, t = step.motions.system, step.motions.kin.tangents
    kin = without_columns(step.motions.kin, np.setdiff1d(np.arange(system.n), system.D))
    every = stacked([kin.B_n, csr_matrix(-kin.B_t)])
    rests = held.closed & ((iterate.status != SLIP) | ~step.resisting)
    moves = np.diff(every.indptr) > 0  # the others are data: supports make them
    at = np.flatnonzero(np.append(rests, np.repeat(sticks, t)) & moves)
    rubs = np.append(np.zeros(len(rests), dtype=bool), np.repeat(step.frictional, t))[at]
    gives = np.append(give, np.repeat(give, t))[at]
    force = np.append(response.normal_force, response.tangential_force)
    for of, found in least_friction(csr_matrix(every[at]), rubs, gives, force[at]):
        new = force.copy()
        new[at[of]] = found
        force = new if _allowed(step, iterate, new) else force
    n, tau = np.split(force, [len(rests)])
    tau = tau.reshape(response.tangential_force.shape)
    return replace(iterate, response=replace(response, normal_force=n, tangential_force=tau))


def _allowed(step: Step, iterate: Iterate, force: Array) -> bool:
    """Whether no point pulls, and no friction is beyond its bound, by more than in the answer.

    Normal forces (m,) come first. An answer is one to the tolerance of its loop.
    """
    n, tau = np.split(force, [len(iterate.status)])
    before, known = iterate.response, COMPUTED * largest(np.abs(force))
    sticks = iterate.conditions.stick & step.frictional
    beyond = step.friction.excess(tau.reshape(len(n), -1), n, before.slip)
    beyond -= step.friction.excess(before.tangential_force, before.normal_force, before.slip)
    pulls = np.minimum(before.normal_force, 0.0) - n
    return bool(np.all(pulls[~step.bilateral] <= known) and np.all(beyond[sticks] <= known))
