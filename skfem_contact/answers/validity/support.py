r"""Rigid motions of bodies, by what is known of them, and how far they give under contact.

*Turns*, and what linear bodies leave out that turn.

Forces act where points are; linear bodies do not turn, and have the arms of the undeformed place. With
finite sliding frames of contact points turn with the surfaces. Under forces f at arms a, what has
turned by R

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

from skfem_contact.answers.answer import Answer, point_forces
from skfem_contact.answers.validity.deformed_boundaries import BoundaryNodes
from skfem_contact.answers.validity.validity import A_TENTH, Drift
from skfem_contact.arrays import Array, Index, Mask, cross, size_of
from skfem_contact.bodies.body import Body
from skfem_contact.bodies.member import Member, unit_motions
from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.bodies.system import System
from skfem_contact.conditions.contact import Contact
from skfem_contact.conditions.friction_rule import friction_bound
from skfem_contact.conditions.geometry import surface_dofs
from skfem_contact.conditions.state import STICK
from skfem_contact.digits import SOLVED
from skfem_contact.obstacles.obstacle import rotation_matrix
from skfem_contact.pairing.node import Pairing
from skfem_contact.records import dataclass
from skfem_contact.trees import Tree

#: Singular values of unit motions at the prescribed DOFs below which these hold no motion: a support
#: a thousandth as wide as the body says nothing about its turn.
SUPPORTED = 1e-3

#: A rotation (d, d), a point (d,), and where that has come.
Turn = tuple[Array, Array, Array]


@dataclass(frozen=True, eq=False)
class Support:
    """The rigid motion closest to the prescribed displacements of a body.

    Motions are (translations along the axes, turns about them times `arm`): r = 3 numbers in 2-D, 6 in
    3-D.

    Attributes
    ----------
    dofs : ndarray of int, shape (k,)
        Prescribed DOFs of the body, in the stacked numbering.
    fit : ndarray, shape (r, k)
        The motion from their values; what they do not say is zero.
    centre : ndarray, shape (d,)
    arm : float
        Extent of the body [length].
    free : ndarray, shape (r, j)
        Motions that the prescribed DOFs leave open.
    unit : ndarray, shape (k, r)
        Displacements of the DOFs by each motion.

    Examples
    --------
    The bottom of a unit square moves by (0.3, 0.1):

    >>> import skfem as fem
    >>> from skfem.models.elasticity import linear_elasticity
    >>> basis = fem.Basis(fem.MeshQuad().with_defaults(), fem.ElementVector(fem.ElementQuad1()))
    >>> support = Support.of(Body(basis, linear_elasticity(), D="bottom"), 0)
    >>> motion = support.motion(basis.project(lambda x: np.stack([0.3 + 0 * x[0], 0.1 + 0 * x[0]])))
    >>> motion.round(12) + 0.0
    array([0.3, 0.1, 0. ])
    >>> support.free.shape
    (3, 0)
    """

    dofs: Index
    fit: Array
    centre: Array
    arm: float
    free: Array
    unit: Array

    @classmethod
    def of(cls, body: Member, start: int, known: Index | None = None, arm: float = 0.0) -> Support:
        """The support of a body whose stacked DOFs start at a number.

        By DOFs of the body whose displacements are known, if these are not the prescribed ones. Of a
        rigid body with what its rotation is multiplied by in its system, `arm`.
        """
        D = body.D if known is None else known
        if not isinstance(body, Body):
            one = np.eye(body.n)
            free = np.delete(one, D, axis=1)
            return cls(D + start, one[:, D], body.dof_points[0], arm, free, one[D])
        box = body.basis.mesh.p
        centre = 0.5 * (box.min(axis=1) + box.max(axis=1))
        # the length of a bar whose nodes scatter as much: the same in all axes
        arm = float(np.sqrt(12.0 * np.linalg.eigvalsh(np.cov(box, bias=True))[-1]))
        modes = unit_motions(body.dof_points[D], centre, arm)
        modes = modes[np.arange(len(D)), body.dof_component[D]]
        motions = np.eye(modes.shape[1])
        if body.axisymmetric:  # none but along the axis
            motions = motions[:, 1:2]
        values, vectors = np.linalg.eigh((modes @ motions).T @ (modes @ motions))
        held = values > SUPPORTED**2
        known = motions @ vectors[:, held]
        fit = (known / values[held]) @ (modes @ known).T
        return cls(D + start, fit, centre, arm, motions @ vectors[:, ~held], modes)

    def motion(self, x: Array) -> Array:
        """The motion under prescribed values x (n,), shape (r,)."""
        return np.asarray(self.fit @ x[self.dofs])

    def turns(self, motion: Array) -> bool:
        """Return whether a motion turns the body by so much that friction may feel it."""
        return float(np.linalg.norm(motion[len(self.centre) :])) > A_TENTH**3 * self.arm

    def turn(self, motion: Array) -> Turn:
        """The rotation of a motion, its centre, and where that has come."""
        d = len(self.centre)
        angle = motion[d:] / self.arm
        return rotation_matrix(angle if d == 3 else angle[0]), self.centre, self.centre + motion[:d]

    def at(self, points: Array, motion: Array) -> Array:
        """Displacements of points (m, d) by a motion, shape (m, d)."""
        return np.asarray(self.unit_at(points) @ motion)

    def unit_at(self, points: Array) -> Array:
        """Displacements of points (m, d) by all motions, shape (m, d, r)."""
        return unit_motions(points, self.centre, self.arm)

    def holds(self, unit: Array, direction: Array) -> bool:
        """Return whether no open motion moves points along their directions (m, d), by `unit_at`."""
        moved = np.einsum("md,mdk->mk", direction, unit) @ self.free
        return bool(np.max(np.abs(moved), initial=0.0) < SUPPORTED)


def fitted(supports: Sequence[Support], u: Array) -> tuple[list[Array], list[float], list[Turn | None]]:
    """Motions under displacements (n,); how far these are off them over the extents; large turns."""
    motions, off, turns = list[Array](), list[float](), list[Turn | None]()
    for support in supports:
        motion = support.motion(u)
        away = np.abs(u[support.dofs] - support.unit @ motion)
        motions.append(motion)
        off.append(float(np.max(away, initial=0.0)) / support.arm)
        turns.append(support.turn(motion) if support.turns(motion) else None)
    return motions, off, turns


class Extrapolation:
    """Displacements of nodes that are not known without the interior of their body.

    They follow the rigid motion of what is known, and the nearest node that is known.

    Parameters
    ----------
    system : System
    side : BoundaryNodes
    there : ndarray of bool, shape (n,)
        DOFs of the system whose displacements are known.

    Attributes
    ----------
    nodes : ndarray of int
        The numbers of those that are not known.
    """

    def __init__(self, system: System, side: BoundaryNodes, there: Mask) -> None:
        self.side, self.part = side, system.slice(side.body)
        known = np.flatnonzero(there[self.part])
        is_known = np.isin(side.dofs, known).all(axis=1)
        self.nodes, known_nodes = np.flatnonzero(~is_known), np.flatnonzero(is_known)
        if not len(self.nodes):
            return
        self.support = Support.of(side.body, int(self.part.start), known)
        self.beside = known_nodes[:0]
        if len(known_nodes):
            nearest = Tree(side.points[known_nodes]).nearest(side.points[self.nodes])
            self.beside = known_nodes[nearest]

    def filled(self, u: Array) -> Array:
        """Displacements of the body from those of the system (n,), unknown ones as near as can be."""
        part = u[self.part]
        if not len(self.nodes):
            return part
        x, dofs = self.side.points, self.side.dofs
        motion = self.support.motion(u)
        moved = self.support.at(x[self.nodes], motion)
        if len(self.beside):
            moved += part[dofs[self.beside]] - self.support.at(x[self.beside], motion)
        part = part.copy()
        part[dofs[self.nodes]] = moved
        return part


def beyond_round_off(approach: float, extent: float) -> float:
    """An elastic approach, or zero where nothing presses and round-off is what there is [length]."""
    # where a load has been taken back, curves that mortar fits leave 1e-11 of the extent; a centimetre
    # of steel is pressed in by 4e-9 of its height under its own weight
    return approach if approach > SOLVED * extent else 0.0


def pressed_in(
    pairing: Pairing, sides: Sequence[ContactSurface], stiff: Sequence[Array], size: Sequence[float]
) -> tuple[float, Array | None]:
    """Approach of both sides under a force; and what that is too much at points that supports hold.

    By the stiffness (m,) of the nodes of each side. The second is of shape (m,), or None where none is.
    """
    approach, too_much, any_held = 0.0, np.zeros(len(pairing.gap)), False
    weights = pairing.secondary_weights, pairing.primary_weights
    for W, side, d, h in zip(weights, sides, stiff, size, strict=False):
        soft = float(h / np.median(d[d > 0])) if (d > 0).any() else 0.0
        approach += soft
        held = side.held.all(axis=1)
        if held.any():
            any_held = True
            total = np.asarray(abs(W).sum(axis=1)).ravel()
            share = np.asarray(abs(W) @ held) / np.where(total > 0, total, 1.0)
            too_much += share * soft
    return approach, too_much if any_held else None


def elastic_approach(result: Answer, i: int, displacement: Array | None = None) -> float:
    """What bodies take up at closed points, less the rigid motion of their supports or, where these
    do not hold them there, of the whole body.

    Takes the displacements (n,) of all bodies, or some that are right on surfaces and at supports.

    The force over the diagonal of K, which is all that is known without the interior, is far less in
    bodies that are nearly incompressible.
    """
    contact, part, system = result.contacts[i], result.slices()[i], result.system
    closed = result.closed(i)
    sides = [contact.secondary] if contact.rigid else [contact.secondary, contact.primary]
    elastic = np.array(result.u if displacement is None else displacement)
    for body in {id(side.body): side.body for side in sides}.values():  # type: ignore[union-attr]
        support = Support.of(body, 0)
        unit = support.unit_at(contact.secondary.points[closed])
        if not support.holds(unit, result.kin.normal[part][closed]):
            support = Support.of(body, 0, np.arange(body.n))
        rigid = support.at(body.dof_points, support.motion(elastic[system.slice(body)]))
        elastic[system.slice(body)] -= rigid[np.arange(body.n), body.dof_component]
    if contact.rigid_body is not None:
        elastic[system.slice(contact.rigid_body)] = 0.0
    return size_of((result.kin.B_n[part] @ elastic)[closed])


def with_elastic_approach(
    result: Answer, i: int, drift: Drift, displacement: Array | None = None
) -> Drift:
    """The drift of a contact with its `elastic_approach`, where that is more."""
    elastic = elastic_approach(result, i, displacement)
    elastic = beyond_round_off(elastic, result.system.extent)
    return replace(drift, approach=max(drift.approach, elastic))


# -- turns ----------------------------------------------------------------------------------------


def rigid_rotations(turns: Mapping[str, Turn]) -> dict[str, float]:
    """Mean rotation of the surfaces that slide far, by body name [rad], counterclockwise.

    In 3-D the size of the rotation vector.
    """
    return {name: _angle(turn) for name, (turn, *_) in turns.items()}


def surface_turns(system: System, contacts: Sequence[Contact], surface: Array) -> dict[str, Turn]:
    """The rotation (d, d) of each body, with a point (d,) and where that has come, by name.

    Those of the rigid motion that is closest to the displacements of all nodes of a body that belong to
    a surface that slides far. Bodies without such a surface are left out, and those of large strains,
    which follow any rotation.

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
            # of faces that meet the closest rigid motion has part of a large strain in it
            if side.dofs.shape[1] != side.dim or side.body.finite_strain:
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
    result: Answer, turns: Mapping[str, Turn], supports: Sequence[Support], approaches: Sequence[float]
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
    system, moved, shares = result.system, _moved(result), {}
    f, on_grown = _forces(result, moved), _forces(result, _measured(result))
    for name, (turn, old, new) in turns.items():
        body, support = system.solids[name], supports[system.index(name)]
        if body.finite_strain:
            continue
        sides = [(c.secondary.body, getattr(c.primary, "body", None)) for c in result.contacts]
        own = [i for i, both in enumerate(sides) if any(side is body for side in both)]
        left, whole = 0.0, 0.0
        if support.free.shape[1]:
            force = _on_nodes(body, (f + result.load)[system.slice(body)])
            centre = _held_at(result, moved, body, force)
            if centre is not None:
                left = _missing_moment(force, body.dof_points - centre, turn, support)
                whole = _most_friction(result, moved, own, new + turn @ (centre - old))
        else:
            force = _on_nodes(body, on_grown[system.slice(body)])
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


def _moved(result: Answer) -> Mask:
    """Points whose forces act where they have moved to, (m,).

    Of contacts that slide far; where none does, of those with obstacles that slip all over, so that
    their friction is what holds a body against turning.
    """
    if result.model.geometry.follows:
        return result.model.geometry.finite
    sticks, moved = result.state.status == STICK, ~result.model.interface.tied
    for contact, part in zip(result.contacts, result.slices(), strict=True):
        moved[part] &= contact.rigid and not sticks[part].any()
    return np.asarray(moved)


def _measured(result: Answer) -> Mask:
    """Points whose gaps are those of the deformed bodies, which see what grows in a turn, (m,)."""
    geometry = result.model.geometry
    return np.asarray(geometry.finite | geometry.on_plane & ~result.model.interface.tied)


def _forces(result: Answer, at: Mask) -> Array:
    """The forces of some points (m,) on the bodies, (n,) [force]."""
    local = result.local
    normal, along = np.where(at, local.normal_force, 0.0), local.tangential_force * at[:, None]
    return point_forces(result.kin, replace(local, normal_force=normal, tangential_force=along))


def _held_at(result: Answer, moved: Mask, body: Body, force: Array) -> Array | None:
    """Where what is not among the forces (n, d) on a body holds it, by which moments are taken.

    Supports and other contacts; None where springs in K do, whose place is not known.
    """
    each = zip(result.contacts, result.slices(), strict=True)
    others = [c for c, part in each if not moved[part].any()]
    sides = [s for c in others for s in (c.secondary, c.primary)]
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


def _most_friction(result: Answer, moved: Mask, own: Sequence[int], centre: Array) -> float:
    """The largest moments of friction about a point in contacts whose points move, added up."""
    bound = np.where(moved, friction_bound(result.model.interface.laws, result.local), 0.0)
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
        u = result.at_surfaces()
        known = [elastic_approach(result, i, u) or old for i, old in zip(own, known, strict=True)]
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
        "and takes the turn for a strain, while contact acts where points are. "
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
