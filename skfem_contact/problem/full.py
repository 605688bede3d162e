"""The contact problem on all DOFs: ``T'KT`` is built and solved in every iteration."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np
from scipy.linalg import block_diag as dense_block_diag
from scipy.sparse import block_diag, csr_matrix, diags

from skfem_contact.arrays import Array, Mask
from skfem_contact.bodies.member import RemoteStiffness
from skfem_contact.bodies.system import System
from skfem_contact.conditions.kinematics import without_columns
from skfem_contact.conditions.loads import LoadCase
from skfem_contact.linalg.direct import as_linear_solver
from skfem_contact.problem.response import Conditions, Load, Resistance, Response, Source
from skfem_contact.problem.seam import ContactProblem, PosedOn
from skfem_contact.problem.sparse import DependentRows, DisplacementsInSeries, SparseSpace
from skfem_contact.problem.springs import point_resistance, spring_compliance
from skfem_contact.problem.thresholds import STIFFER

logger = logging.getLogger("skfem_contact")


class FullSystem:
    """All DOFs as unknowns, for any linear backend; the reference for the condensed route."""

    def __init__(self, system: System, stiffness: Sequence[csr_matrix], backend: Any) -> None:
        self.system = system
        self.backend = as_linear_solver(backend)
        self.points: Array | None = None
        self.modes: Array | None = None
        if any(isinstance(K, RemoteStiffness) for K in stiffness):
            self.K = self.backend.stacked(system.bodies, stiffness)
            return  # who holds the rows has their places and motions
        self.K = csr_matrix(block_diag(stiffness))
        self.points = np.concatenate([body.dof_points for body in system.bodies])
        if self.backend.uses_modes:
            self.modes = dense_block_diag(*map(system.modes, range(len(system.bodies))))

    def surface(self, source: Source, case: LoadCase) -> Array:
        """Displacements of all DOFs (n,)."""
        return source.values

    def recover(
        self, sources: Source, components: Sequence[Any], cases: Sequence[LoadCase]
    ) -> list[Array]:
        """All displacements, r arrays (n,), which are the sources themselves (n, r)."""
        return [np.array(u) for u in sources.values.T]

    def attach(self, on: PosedOn, prefer: Mask, labels: Sequence[str]) -> ContactProblem:
        """The contact problem on one pairing."""
        return FullProblem(self, on, prefer, labels)


class FullProblem(ContactProblem):
    """The contact problem on all DOFs."""

    _seen: DisplacementsInSeries | None = None

    def __init__(self, bodies: FullSystem, on: PosedOn, prefer: Mask, labels: Sequence[str]) -> None:
        self.space = SparseSpace(
            K=bodies.K,
            kin=on.kin,
            D=bodies.system.D,
            prefer=prefer,
            backend=bodies.backend,
            labels=labels,
            scale=bodies.system.extent,
            frictional=on.slipping,
            points=bodies.points,
            modes=bodies.modes,
        )
        super().__init__(bodies, on)

    def _begin_anew(self) -> None:
        super()._begin_anew()
        self.space = replace(self.space, _key=None, _factor=None)
        if self._seen is not None:
            self._seen = self._through_springs()

    @cached_property
    def resistance(self) -> Resistance:
        """Return what each point resists by itself, by K's diagonal."""
        given = STIFFER * self._softness
        return point_resistance(self.kin, self.slips, lambda rows: rows @ diags(given))

    @cached_property
    def _softness(self) -> Array:
        """Return how far a unit force moves each DOF, all others held, (n,) [length/force]."""
        diagonal = self.space.K.diagonal()
        given = np.zeros_like(diagonal)
        free = np.setdiff1d(np.flatnonzero(diagonal > 0), self.space.D)
        given[free] = 1.0 / diagonal[free]
        return given

    def solve(self, conditions: Conditions, load: Load) -> Response:
        """Gaps, slips and forces under these conditions; through springs once rows are dependent."""
        if self._seen is None:
            try:
                return self.space.solve(conditions, load)
            except DependentRows:
                logger.info("contact rows depend on each other: points are seen through springs")
                self.springs = self._compliance()
                self._seen = self._through_springs()
        n = self.kin.B_n.shape[1]
        if len(load.force) == n:
            still = np.zeros(load.gap0.shape), np.zeros(load.slip0.shape)
            load = self.at_forces(load, *still)
        found = self._seen.solve(conditions, load)
        return replace(found, solution=found.solution[:n])

    def _through_springs(self) -> DisplacementsInSeries:
        assert self.springs is not None
        return self.in_series(Resistance(1.0 / self.springs, 1.0 / self.springs))

    def at_forces(self, load: Load, normal_force: Array, tangential_force: Array) -> Load:
        """The load with the forces at which the springs of the problem have no strain."""
        assert self._seen is not None
        return self._seen.at_forces(load, normal_force, tangential_force)

    def in_series(self, C: Resistance) -> DisplacementsInSeries:
        """The same problem with springs of the stiffness C in series with its points."""
        return DisplacementsInSeries(self.space, C)

    def _compliance(self) -> Array:
        """Say that of the springs of the problem, by K's diagonal."""
        free = np.setdiff1d(np.arange(len(self._softness)), self.space.D)
        softness = self._softness[free]
        rows = without_columns(self.kin, free)
        return spring_compliance(rows, self.slips, lambda B: B.multiply(B) @ softness)

    def load(self, case: LoadCase) -> Load:
        """The load case as it stands."""
        return Load(case.f, case.gap0, case.slip0, case.x)

    def sources(self, found: Sequence[tuple[Load, Response]]) -> list[Source]:
        """Displacements of all DOFs."""
        return [Source(response.solution, forces=False) for _, response in found]
