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
from skfem_contact.history.thresholds import HARDLY_MOVES, PRESSED, SAME_COORDINATES
from skfem_contact.linalg.backend import LinearSolveError
from skfem_contact.linalg.resources import single_threaded
from skfem_contact.linalg.singular import SingularMatrix
from skfem_contact.obstacles.rigid_body import RigidBody
from skfem_contact.pairing.vectors import cross

Array = NDArray[np.float64]


def second_order(attempt: Attempt) -> dict[str, float]:
    """What moments of second order change of the motion of rigid bodies, over that motion, by name.

    Of bodies that may turn, in contacts with small sliding.
    """
    model = attempt.model
    system, contacts = model.system, model.interface.contacts
    tools = dict.fromkeys(c.rigid_body for c in contacts if c.sliding == "small")  # once, in order
    leaning = [b for b in tools if isinstance(b, RigidBody) and np.setdiff1d(b.rotations, b.D).size]
    if not leaning:
        return {}
    problem, seen = attempt.problem, attempt.seen
    load, response = attempt.load, attempt.outcome.iterate.response
    with single_threaded():
        u = problem.surface(problem.source(load, response), seen)
        f, found = np.array(seen.f), dict[RigidBody, tuple[float, Array]]()
        for body in leaning:
            moment, arm, along = _moment(attempt, body, u)
            dofs = system.slice(body).start + body.rotations
            f[dofs] += moment / system.extent
            found[body] = arm, along
        if np.array_equal(f, seen.f):
            return {}
        turned = replace(seen, f=f)
        again = problem.load(turned)
        if problem.springs is not None:  # which have no strain in the answer, and are none here
            again = problem.at_forces(again, response.normal_force, response.tangential_force)
        try:
            other = problem.solve(attempt.outcome.iterate.conditions, again)
        except (SingularMatrix, LinearSolveError):
            return {}
        change = problem.surface(problem.source(again, other), turned) - u
    shares = {}
    for body, (arm, along) in found.items():
        part = system.slice(body)
        ways = [_sway(body, v[part], arm / system.extent, along) for v in (u, change)]
        least = HARDLY_MOVES * float(np.linalg.norm(u[part][: body.dim]))
        least = max(least, SAME_COORDINATES * system.extent)
        shares[system.names[system.index(body)]] = ways[1] / max(ways[0], least, np.finfo(float).tiny)
    return shares


def _moment(attempt: Attempt, body: RigidBody, u: Array) -> tuple[Array, float, Array]:
    """Of second order, by rotation (zero where it is prescribed).

    Then the longest arm of a force, and the direction in which the body is pressed, zero for none.
    """
    model, kin, local = attempt.model, attempt.problem.kin, attempt.local
    system, d = model.system, body.dim
    v = u[system.slice(body)][:d]
    moment, arm = np.zeros(len(body.rotations)), 0.0
    total, sizes = np.zeros(d), 0.0
    for contact, part in zip(model.interface.contacts, model.interface.point_slices, strict=True):
        if contact.rigid_body is not body or contact.sliding != "small":
            continue
        side = contact.secondary
        forces = -local.normal_force[part][:, None] * kin.normal[part]
        forces += np.einsum("ik,ikd->id", local.tangential_force[part], kin.axes[part])
        moved = u[system.slice(side.body)][side.dofs] - v
        moment += cross(moved, forces).sum(axis=0)
        size = np.linalg.norm(forces, axis=1)
        total, sizes = total + forces.sum(axis=0), sizes + float(size.sum())
        away = np.linalg.norm(side.points[size > 0] - body.about, axis=1)
        arm = max(arm, float(np.max(away, initial=0.0)))
    moment[np.isin(body.rotations, body.D)] = 0.0
    size = float(np.linalg.norm(total))
    # between two jaws forces cancel, and no direction is that of pressing
    along = total / size if size > PRESSED * sizes else np.zeros(d)
    return moment, arm, along


def _sway(body: RigidBody, way: Array, arm: float, along: Array) -> float:
    """The largest of a motion but for the way it is pressed in; turns at the end of the longest arm."""
    v = way[: body.dim]
    across = v - along * (along @ v)
    return max(float(np.linalg.norm(across)), arm * float(np.linalg.norm(way[body.dim :])))
