"""`Placement`: one pairing of all contacts, with the contact problem on it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skfem_contact.conditions.kinematics import Kinematics
from skfem_contact.conditions.motions import RigidMotions
from skfem_contact.conditions.prescribed import guided_points, prescribed_rows

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Placement:
    """One pairing of all contacts, with the contact problem on it.

    Attributes
    ----------
    kin : Kinematics
        Its `gap0` are the gaps at the displacements `u`.
    rows : object
        The contact problem: ``space``, ``load``, ``source``, ``contact_displacement``.
    motions : RigidMotions
    u : ndarray, shape (n,) or None
        Displacements of the surfaces at which the pairing was made; None for the undeformed bodies.
    dense_rows : callable
        ``dense_rows()`` gives the contact problem on gaps and slips for pivoting: on the condensed
        route `rows`, on the sparse one made for this alone, when nothing else has helped.
    model : LinearModel
        Whose bodies these are.
    """

    kin: Kinematics
    rows: Any
    motions: RigidMotions
    u: Array | None
    dense_rows: Callable[[], Any]
    model: Any

    @cached_property
    def able(self) -> Mask:
        """Points whose gap can change: where it is prescribed, D carries the force instead."""
        return ~prescribed_rows(self.kin.B_n, self.motions.system.D)

    @cached_property
    def guided(self) -> Mask:
        """Points whose slip supports prescribe: they take whatever friction there is."""
        return guided_points(self.kin, self.motions.system.D)
