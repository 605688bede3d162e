r"""Turns of bodies, and what linear bodies leave out that turn and slide far.

With finite sliding frames of contact points turn with the surfaces and forces act where points are; the
linear bodies do not turn. Under forces f at arms a, what has turned by R

* is out of balance by the moment of ``(R a - a) x f``. A pin under a force N has N times its radius
  times its angle, beside a torque of friction of mu N times its radius. It is told over the most that
  friction can hold. Supports that hold a body against turning take it up, and nothing else feels it;
* has grown by :math:`1 - \cos\theta` without a stress. What supports turn presses the more for that:
  the work of its forces along it is told over their work along the elastic approach. What is free
  moves aside.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace

import numpy as np

from skfem_contact.answers.answer import Answer
from skfem_contact.answers.placed import point_forces
from skfem_contact.answers.thresholds import A_TENTH, SUPPORTED
from skfem_contact.answers.validity.support import Support, elastic_approach
from skfem_contact.arrays import Array, cross
from skfem_contact.bodies.body import Body
from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.bodies.system import System
from skfem_contact.conditions.contact import Contact
from skfem_contact.conditions.friction_rule import friction_bound
from skfem_contact.conditions.geometry import surface_dofs
from skfem_contact.conditions.state import OPEN
from skfem_contact.digits import SOLVED

#: A rotation (d, d), a point (d,), and where that has come.
Turn = tuple[Array, Array, Array]


def rigid_rotations(turns: Mapping[str, Turn]) -> dict[str, float]:
    """Mean rotation of the surfaces that slide far, by body name [rad], counterclockwise.

    In 3-D the size of the rotation vector.
    """
    return {name: _angle(turn) for name, (turn, *_) in turns.items()}


def surface_turns(system: System, contacts: Sequence[Contact], surface: Array) -> dict[str, Turn]:
    """The rotation (d, d) of each body, with a point (d,) and where that has come, by name.

    Those of the rigid motion that is closest to the displacements of all nodes of a body that belong to
    a surface that slides far. Bodies without such a surface are left out.

    Parameters
    ----------
    system : System
    contacts : sequence of Contact
    surface : ndarray
        Displacements of the surfaces, in the order of `surface_dofs` [length].
    """
    dofs = surface_dofs(system, contacts)
    nodes: dict[int, list[tuple[Array, Array]]] = {}
    for contact in contacts:
        for side in (contact.secondary, contact.primary):
            if contact.sliding == "small" or not isinstance(side, ContactSurface):
                continue
            if side.dofs.shape[1] != side.dim:
                continue
            i = system.index(side.body)
            u = surface[np.searchsorted(dofs, system.offsets[i] + side.dofs)]
            nodes.setdefault(i, []).append((side.points, u))
    found = {}
    for i, pairs in sorted(nodes.items()):
        x = np.concatenate([points for points, _ in pairs])
        y = x + np.concatenate([u for _, u in pairs])
        old, new = x.mean(axis=0), y.mean(axis=0)
        left, _, right = np.linalg.svd((y - new).T @ (x - old))
        left[:, -1] *= np.sign(np.linalg.det(left) * np.linalg.det(right))  # no mirror image
        found[system.names[i]] = left @ right, old, new
    return found


def _angle(turn: Array) -> float:
    if len(turn) == 2:
        return float(np.arctan2(turn[1, 0], turn[0, 0]))
    vector = np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]])
    return float(np.arctan2(np.linalg.norm(vector), np.trace(turn) - 1))


def turned(
    result: Answer,
    turns: Mapping[str, Turn],
    supports: Sequence[Support],
    approaches: Sequence[float],
) -> dict[str, float]:
    """What linear bodies leave out that turn, over what it is a part of, by name: see the module.

    Parameters
    ----------
    result : Answer
    turns : mapping of Turn
        By `surface_turns`.
    supports : sequence of Support
        Of all bodies.
    approaches : sequence of float
        Of all contacts, elastic ones at least [length].
    """
    system, kin, local = result.system, result.kin, result.local
    far, shares = result.model.geometry.finite, {}
    normal, along = np.where(far, local.normal_force, 0.0), local.tangential_force * far[:, None]
    f = point_forces(kin, replace(local, normal_force=normal, tangential_force=along))
    for name, (turn, old, new) in turns.items():
        body, support = system.solids[name], supports[system.index(name)]
        if body.finite_strain:
            continue
        sides = [(c.secondary.body, getattr(c.primary, "body", None)) for c in result.contacts]
        own = [i for i, both in enumerate(sides) if any(side is body for side in both)]
        left, whole = 0.0, 0.0
        if support.free.shape[1]:
            force = _on_nodes(body, (f + result.load)[system.slice(body)])
            centre = _held_at(body, result.contacts, force)
            if centre is not None:
                left = _missing_moment(force, body.dof_points - centre, turn, support)
                whole = _most_friction(result, own, new + turn @ (centre - old))
        else:
            force = _on_nodes(body, f[system.slice(body)])
            grown = turn.T - 0.5 * (turn + turn.T) @ turn.T
            arm = body.dof_points - body.dof_points[body.D].mean(axis=0)
            left = abs(float(np.sum(arm @ grown * force)))
            whole = _pressing(result, own, approaches, left)
        if whole > 0:
            shares[name] = left / whole
    return shares


def _on_nodes(body: Body, f: Array) -> Array:
    """Forces on the DOFs of a body as vectors there, (n, d)."""
    return np.asarray(np.eye(body.dim)[body.dof_component] * f[:, None])


def _held_at(body: Body, contacts: Sequence[Contact], force: Array) -> Array | None:
    """Where what is not among the forces (n, d) on a body holds it, by which moments are taken.

    Supports and contact with small sliding; None where springs in K do, whose place is not known.
    """
    sides = [s for c in contacts if c.sliding == "small" for s in (c.secondary, c.primary)]
    held = [s.points for s in sides if isinstance(s, ContactSurface) and s.body is body]
    held.append(body.dof_points[body.D])
    if sum(map(len, held)):
        return np.asarray(np.concatenate(held).mean(axis=0))
    left, sizes = np.abs(force.sum(axis=0)).max(), np.abs(force).sum()
    return np.asarray(body.dof_points.mean(axis=0)) if left <= SOLVED * sizes else None


def _missing_moment(force: Array, arm: Array, turn: Array, support: Support) -> float:
    """About the axes that supports leave free."""
    d = len(turn)
    axes, size, _ = np.linalg.svd(support.free[d:])
    missing = cross(arm @ (turn.T - np.eye(d)), force).sum(axis=0)
    return float(np.linalg.norm(missing @ axes[:, : np.count_nonzero(size > SUPPORTED)]))


def _most_friction(result: Answer, own: Sequence[int], centre: Array) -> float:
    """The largest moments of friction about a point in contacts that slide far, added up."""
    bound = friction_bound(result.model.interface.laws, result.local)
    bound = np.where(result.model.geometry.finite, bound, 0.0)
    arms, parts = np.linalg.norm(result.kin.points - centre, axis=1), result.slices()
    return sum(float(bound[parts[i]] @ arms[parts[i]]) for i in own)


def _pressing(result: Answer, own: Sequence[int], approaches: Sequence[float], left: float) -> float:
    """Work of normal forces along the elastic approach: as it is measured, where that may matter.

    Where contact goes all around, estimates of the approach are a dozen times too large.
    """
    parts = [result.slices()[i] for i in own]
    forces = [float(np.abs(result.state.normal_force[part]).sum()) for part in parts]
    known = [approaches[i] for i in own]
    if left > A_TENTH**3 * np.dot(forces, known):
        u = result.model.geometry.spread(result.state.surface)
        u[result.system.D] = result.case.x[result.system.D]
        for k, part in enumerate(parts):
            closed = (result.state.status[part] != OPEN) & result.kin.paired[part]
            known[k] = elastic_approach(result, own[k], closed, u) or known[k]
    return float(np.dot(forces, known))


def leaning(
    system: System, shares: dict[str, float], told: Collection[tuple[str, str]]
) -> dict[tuple[str, str], str]:
    """What moments of second order change beyond its bound, in words; by `second_order` of a step.

    Of rigid bodies over their motion; of others, whose rotation has not been told, see `turned`.
    """
    found = {("second order", name): share for name, share in shares.items() if share > A_TENTH}
    found = {key: share for key, share in found.items() if ("rotation", key[1]) not in told}
    return {
        key: (_turned_words if key[1] in system.solids else _rolling_words)(key[1], share)
        for key, share in found.items()
    }


def _turned_words(name: str, share: float) -> str:
    return (
        f"Body {name!r} is linear and has turned: its stiffness has the arms of the undeformed body "
        "and takes the turn for a strain, while contact with sliding='finite' acts where points are. "
        f"What this leaves out is {100 * share:.3g} % of the moment that friction can hold, or, where "
        "supports turn the body, of what presses it; torques and forces may be off by as much. Take a "
        "NonlinearBody, with sliding='finite' in all contacts that turn with it, glue too; or a "
        "RigidBody."
    )


def _rolling_words(name: str, share: float) -> str:
    return (
        "Rigid bodies carry their loads along, and contact forces act where the points have moved to: "
        "small sliding, which has the arms of the undeformed place, leaves out the moment of that. It "
        f"would change the motion of {name!r} by {100 * share:.3g} % at first, and without end where a "
        "body rolls off or topples. Give its contacts sliding='finite', or hold its rotation by D."
    )
