"""`Lever`: how the DOFs of a rigid body move the contact points on it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skfem_contact.bodies.system import System
from skfem_contact.conditions.contact import Contact
from skfem_contact.obstacles.rigid_body import RigidBody
from skfem_contact.pairing.node import Pairing
from skfem_contact.pairing.thresholds import MOVING_SHARE
from skfem_contact.pairing.vectors import cross

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Mask = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Lever:
    r"""The rigid side of a contact: a point moves by ``v + w x r``.

    Attributes
    ----------
    body : RigidBody
    arm : ndarray, shape (m, d)
        ``r``, from the body's point, where that is now, to the contact points on the obstacle [length].
    start : int
        First DOF of the body in the numbering of the system.
    scale : float
        What rotations are multiplied by in it, `System.scale` [length].
    """

    body: RigidBody
    arm: Array
    start: int
    scale: float

    @classmethod
    def of(
        cls, system: System, contact: Contact, pairing: Pairing, moved: Array | None = None
    ) -> Lever | None:
        """That of a contact; None where its primary is no rigid body.

        Parameters
        ----------
        system : System
        contact : Contact
        pairing : Pairing
        moved : ndarray, shape (d,), optional
            Translation of the body where the pairing was made [length].
        """
        body = contact.rigid_body
        if body is None:
            return None
        at = pairing.action
        if not contact.bilateral:  # glue holds the points where they are
            gap = np.where(pairing.paired, pairing.gap, 0.0)
            at = at - gap[:, None] * pairing.normal
        about = body.about if moved is None else body.about + moved
        return cls(body, at - about, int(system.slice(body).start), system.extent)

    def rows(self, direction: Array) -> Array:
        """Displacements of the points along directions (m, d) by each DOF, shape (m, n_body)."""
        return np.concatenate([direction, cross(self.arm, direction) / self.scale], axis=1)

    def entries(self, direction: Array, paired: Mask, held: Mask) -> tuple[Array, Index, Index]:
        """Values, rows and columns of ``-direction . (v + w x r)`` for matrices of the system.

        Of rows that are `held` only what is prescribed.
        """
        values = -self.rows(direction)
        free = np.ones(self.body.n, dtype=bool)
        free[self.body.D] = False
        values[np.ix_(held, free)] = 0.0
        some = np.flatnonzero(paired)
        columns = np.tile(np.arange(self.start, self.start + self.body.n), len(some))
        rows: NDArray[np.intp] = np.repeat(some, self.body.n)
        return np.asarray(values[some].ravel()), rows, columns

    def holds(self, direction: Array) -> Mask:
        """Whether its supports keep the points from moving along directions (m, d), shape (m,)."""
        size = np.abs(self.rows(direction))
        free = np.ones(self.body.n)
        free[self.body.D] = 0.0
        return np.asarray(size @ free < MOVING_SHARE * size.sum(axis=1))


def as_motion(system: System, body: RigidBody, u: Array) -> tuple[Array, Any, Array]:
    """Where a rigid body is at displacements u of the system (n,), as obstacles take a motion."""
    own: Array = u[system.slice(body)] / system.scale(body)
    return body.motion(own)
