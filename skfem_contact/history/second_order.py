r"""Rigid bodies that roll and lean: moments of second order, which small sliding leaves out.

A tool that moves by v carries its loads along, and contact forces act at points that have moved by u.
So it turns under ``sum (u - v) x F`` besides: the moment that lets a roller roll on and a tower topple,
P-delta to builders. Small sliding has the arms of the undeformed place, and so an equilibrium for a
roller that anything sets rolling. Here the moment is put on the answer, once and with every point as it
is; how much the tool then moves beside how much it did says what the answer is worth.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from skfem_contact.history.load_step import Attempt
from skfem_contact.history.thresholds import HARDLY_MOVES
from skfem_contact.linalg.backend import LinearSolveError
from skfem_contact.linalg.singular import SingularMatrix
from skfem_contact.linalg.threads import single_threaded
from skfem_contact.obstacles.rigid_body import RigidBody
from skfem_contact.pairing.vectors import cross

Array = NDArray[np.float64]


def second_order(attempt: Attempt) -> dict[str, float]:
    """What moments of second order change of the motion of rigid bodies, over that motion, by name.

    Of bodies that may turn, in contacts with small sliding.
    """
    model = attempt.model
    system, contacts = model.system, model.interface.contacts
    tools = {c.rigid_body for c in contacts if c.sliding == "small"} - {None}
    leaning = [b for b in tools if isinstance(b, RigidBody) and np.setdiff1d(b.rotations, b.D).size]
    if not leaning:
        return {}
    problem, seen = attempt.problem, attempt.seen
    load, response = attempt.load, attempt.outcome.iterate.response
    with single_threaded():
        u = problem.surface(problem.source(load, response), seen)
        f, found = np.array(seen.f), {}
        for body in leaning:
            moment, arm = _moment(attempt, body, u)
            dofs = system.slice(body).start + body.rotations
            f[dofs] += moment / system.extent
            found[body] = arm
        if np.array_equal(f, seen.f):
            return {}
        again = problem.load(replace(seen, f=f))
        try:
            other = problem.solve(attempt.outcome.iterate.conditions, again)
        except (SingularMatrix, LinearSolveError):
            return {}
        change = problem.surface(problem.source(again, other), seen) - u
    return {
        system.names[system.index(body)]: _share(body, u[part], change[part], arm / system.extent)
        for body, arm in found.items()
        for part in [system.slice(body)]
    }


def _moment(attempt: Attempt, body: RigidBody, u: Array) -> tuple[Array, float]:
    """Of second order, by rotation (zero where it is prescribed), and the longest arm of a force."""
    model, kin, local = attempt.model, attempt.problem.kin, attempt.local
    system, d = model.system, body.dim
    v = u[system.slice(body)][:d]
    moment, arm = np.zeros(len(body.rotations)), 0.0
    for contact, part in zip(model.interface.contacts, model.interface.point_slices, strict=True):
        if contact.rigid_body is not body or contact.sliding != "small":
            continue
        side = contact.secondary
        forces = -local.normal_force[part][:, None] * kin.normal[part]
        forces += np.einsum("ik,ikd->id", local.tangential_force[part], kin.tangent[part])
        moved = u[system.slice(side.body)][side.dofs] - v
        moment += cross(moved, forces).sum(axis=0)
        pressed = np.any(forces != 0, axis=1)
        away = np.linalg.norm(side.points[pressed] - body.about, axis=1)
        arm = max(arm, float(np.max(away, initial=0.0)))
    moment[np.isin(body.rotations, body.D)] = 0.0
    return moment, arm


def _share(body: RigidBody, moved: Array, change: Array, arm: float) -> float:
    """The largest change of a free DOF over its motion; turns as ways at the end of the longest arm."""
    length = np.ones(body.n)
    length[body.rotations] = arm
    way, more = np.abs(moved) * length, np.abs(change) * length
    more[body.D] = 0.0
    least = HARDLY_MOVES * np.max(way)
    if least == 0:
        return 0.0
    return float(np.max(more / np.maximum(way, least)))
