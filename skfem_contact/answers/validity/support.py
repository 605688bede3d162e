"""Rigid motions of bodies, by what is known of them, and how far they give under contact."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from skfem_contact.answers.answer import Answer
from skfem_contact.answers.thresholds import SUPPORTED
from skfem_contact.answers.validity.deformed_boundaries import BoundaryNodes
from skfem_contact.arrays import Array, Index, Mask
from skfem_contact.bodies.body import Body
from skfem_contact.bodies.member import Member, unit_motions
from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.bodies.system import System
from skfem_contact.digits import SOLVED
from skfem_contact.pairing.node import Pairing
from skfem_contact.records import dataclass
from skfem_contact.trees import Tree


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

    def at(self, points: Array, motion: Array) -> Array:
        """Displacements of points (m, d) by a motion, shape (m, d)."""
        return np.asarray(self.unit_at(points) @ motion)

    def unit_at(self, points: Array) -> Array:
        """Displacements of points (m, d) by all motions, shape (m, d, r)."""
        return unit_motions(points, self.centre, self.arm)

    def along(self, points: Array, direction: Array) -> Array:
        """How far motions move points (m, d) along their directions (m, d): rows, shape (m, r)."""
        return np.asarray(np.einsum("md,mdk->mk", direction, self.unit_at(points)))

    def holds(self, points: Array, direction: Array) -> bool:
        """Return whether no open motion moves points along their directions, both (m, d)."""
        moved = self.along(points, direction) @ self.free
        return bool(np.max(np.abs(moved), initial=0.0) < SUPPORTED)


def off_rigid(supports: Mapping[str, Support], u: Array) -> dict[str, float]:
    """How far known displacements are off a rigid motion, over the extent of their body, by name."""
    off = {
        name: np.max(np.abs(u[s.dofs] - s.unit @ s.motion(u)), initial=0.0)
        for name, s in supports.items()
    }
    return {name: float(size) / supports[name].arm for name, size in off.items()}


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


def elastic_approach(result: Answer, i: int, closed: Mask, displacement: Array | None = None) -> float:
    """What bodies take up at closed points, less their supports' rigid motions; 0 where they float.

    Takes the displacements (n,) of all bodies, or some that are right on surfaces and at supports.

    The force over the diagonal of K, which is all that is known without the interior, is far less in
    bodies that are nearly incompressible.
    """
    contact, part, system = result.contacts[i], result.slices()[i], result.system
    sides = [contact.secondary] if contact.rigid else [contact.secondary, contact.primary]
    u = result.u if displacement is None else displacement
    elastic = np.array(u)
    for body in {id(side.body): side.body for side in sides}.values():  # type: ignore[union-attr]
        support = Support.of(body, 0)
        if not support.holds(contact.secondary.points[closed], result.kin.normal[part][closed]):
            return 0.0
        rigid = support.at(body.dof_points, support.motion(u[system.slice(body)]))
        elastic[system.slice(body)] -= rigid[np.arange(body.n), body.dof_component]
    if contact.rigid_body is not None:
        elastic[system.slice(contact.rigid_body)] = 0.0
    lifted = (result.kin.B_n[part] @ elastic)[closed]
    return float(np.max(np.abs(lifted), initial=0.0))
