"""The rigid motion that the supports of a body give it, told from its prescribed displacements."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from skfem_contact.answers.thresholds import SUPPORTED
from skfem_contact.bodies.body import Body
from skfem_contact.bodies.member import Member

Array = NDArray[np.float64]
Index = NDArray[np.intp]


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
        arm = float(np.ptp(box, axis=1).max())
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
        return np.asarray(unit_motions(points, self.centre, self.arm) @ motion)

    def along(self, points: Array, direction: Array) -> Array:
        """How far motions move points (m, d) along their directions (m, d): rows, shape (m, r)."""
        motions = unit_motions(points, self.centre, self.arm)
        return np.asarray(np.einsum("md,mdk->mk", direction, motions))

    def holds(self, points: Array, direction: Array) -> bool:
        """Whether no open motion moves points along their directions, both (m, d)."""
        moved = self.along(points, direction) @ self.free
        return bool(np.max(np.abs(moved), initial=0.0) < SUPPORTED)


def unit_motions(points: Array, centre: Array, arm: float) -> Array:
    """Displacements (m, d, r) of points by translations and turns, of order one."""
    if points.shape[1] == 3:
        modes = np.zeros((len(points), 3, 6))
        modes[:, :, :3] = np.eye(3)
        arms = np.broadcast_to((points - centre)[:, None] / arm, (len(points), 3, 3))
        modes[:, :, 3:] = np.swapaxes(np.cross(np.eye(3), arms), 1, 2)
        return modes
    modes = np.zeros((len(points), 2, 3))
    modes[:, 0, 0] = modes[:, 1, 1] = 1.0
    x = (points - centre) / arm
    modes[:, 0, 2], modes[:, 1, 2] = -x[:, 1], x[:, 0]
    return modes
