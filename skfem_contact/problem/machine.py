r"""The contact problem under a loading machine: the load of a step is pulled through a spring.

A dead load beyond what contact can carry has no answer. Pulled through a spring it always has one: the
machine yields. With h the change of the load in a step, as forces on gaps and slips, and k the
stiffness of the machine,

    (S + k h h') z = f + k h d + p,

where the machine has come to d. The share of the step that the bodies then carry is ``k (d - h'z)``.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from skfem_contact.conditions.motions import RigidMotions
from skfem_contact.conditions.thresholds import NO_WORK
from skfem_contact.problem.points import PointSpace
from skfem_contact.problem.response import Conditions, Load, Resistance, Response

Array = NDArray[np.float64]


class LoadingMachine:
    """Gaps and slips of a load step that is pulled through a spring.

    The spring is as stiff as the points themselves are under the change of the load. Gaps and slips
    that supports prescribe are those of the end of the step from the beginning on.

    Parameters
    ----------
    space : PointSpace
    before, target : Load
        Where the step begins and ends.
    own : Resistance
        What each point resists by itself.

    Attributes
    ----------
    pulls : bool
        Whether anything else changes. Else there is no machine.
    """

    springs = None  # points are not seen through any

    def __init__(self, space: PointSpace, before: Load, target: Load, own: Resistance) -> None:
        gap0 = np.where(space.normal_rows < 0, target.gap0, before.gap0)
        slip0 = np.where(space.tangential_rows < 0, target.slip0, before.slip0)
        before = replace(before, gap0=gap0, slip0=slip0)
        self._space, self._before = space, before
        tangential = np.broadcast_to(own.tangential[:, None], space.tangential_rows.shape)
        resists = self._on_rows(own.normal, tangential)
        # gaps and slips that obstacles change are changes of the load too: S times them
        moved = self._on_rows(_change(gap0, target.gap0), _change(slip0, target.slip0))
        self._along = target.force - before.force + space.S @ moved
        gives = float(np.sum(self._along**2 / resists))
        self.pulls = gives > 0
        self._stiffness = 1.0 / gives if self.pulls else 0.0
        if self.pulls:
            S = space.S + self._stiffness * np.outer(self._along, self._along)
            self.points = PointSpace(S, space.normal_rows, space.tangential_rows)

    def begin_at(self, gap: Array, slip: Array) -> None:
        """Let the machine have no force at these gaps and slips, (m,) and (m, d-1) [length]."""
        gap = np.where(np.isfinite(gap), gap, 0.0)
        gap0 = np.where(np.isfinite(self._before.gap0), self._before.gap0, 0.0)
        z = self._on_rows(gap - gap0, slip - self._before.slip0)
        self._origin = float(self._along @ z)

    def at(self, pull: float) -> Load:
        """The load where the machine has come to: the share that it would hold if nothing moved."""
        d = pull + self._stiffness * self._origin
        return replace(self._before, force=self._before.force + d * self._along)

    def share(self, pull: float, response: Response) -> float:
        """The share of the step that the bodies carry."""
        yielded = float(self._along @ response.solution) - self._origin
        return pull - self._stiffness * yielded

    def leaves(self, motions: RigidMotions) -> RigidMotions:
        """The rigid motions that supports and the machine leave free."""
        if not motions.k:
            return motions
        n = motions.kin.m
        rows = [
            self._on_rows(motions.normal[:, i], motions.tangential[:, :, i]) for i in range(motions.k)
        ]
        work = np.array(rows) @ self._along
        if np.max(np.abs(work)) <= NO_WORK * np.linalg.norm(self._along) * np.sqrt(n):
            return motions
        left = np.linalg.qr(work[:, None], mode="complete")[0][:, 1:]
        modes = motions.modes @ left
        return replace(motions, modes=modes / np.max(np.abs(modes), axis=0, initial=0.0))

    def at_forces(self, load: Load, normal_force: Array, tangential_force: Array) -> Load:
        """The load itself: there are no springs to be without strain."""
        return load

    def solve(self, conditions: Conditions, load: Load) -> Response:
        """Gaps, slips and forces under these conditions."""
        return self.points.solve(conditions, load)

    def _on_rows(self, normal: Array, tangential: Array) -> Array:
        """Values of points and their tangents, on the rows that there are."""
        out = np.zeros(len(self._space.S) + 1)  # the last for rows of -1, which there are not
        out[self._space.normal_rows] = normal
        out[self._space.tangential_rows] = tangential
        return out[:-1]


def _change(before: Array, target: Array) -> Array:
    """The difference of two vectors; zero where there is no point."""
    known = np.isfinite(before) & np.isfinite(target)
    return np.where(known, np.where(known, target, 0.0) - np.where(known, before, 0.0), 0.0)
