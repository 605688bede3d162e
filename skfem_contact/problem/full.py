"""The contact problem on all DOFs: ``T'KT`` is built and solved in every iteration."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag as dense_block_diag
from scipy.sparse import block_diag, csr_matrix, diags

from skfem_contact.bodies.distributed import DistributedStiffness
from skfem_contact.bodies.system import System
from skfem_contact.conditions.loads import LoadCase
from skfem_contact.linalg.direct import as_linear_solver
from skfem_contact.problem.displacements import OnDisplacements
from skfem_contact.problem.resistance import point_resistance
from skfem_contact.problem.response import Load, Resistance, Source
from skfem_contact.problem.seam import ContactProblem, Posed, PosedOn
from skfem_contact.problem.sparse import SparseSpace
from skfem_contact.problem.thresholds import STIFFER

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]


class FullSystem:
    """All DOFs as unknowns, for any linear backend; the reference for the condensed route."""

    def __init__(self, system: System, stiffness: Sequence[csr_matrix], backend: Any) -> None:
        self.system = system
        self.backend = as_linear_solver(backend)
        self.points: Array | None = None
        self.modes: Array | None = None
        if any(isinstance(K, DistributedStiffness) for K in stiffness):
            self.K = self.backend.stacked(system.bodies, stiffness)
            return  # the ranks have places and motions of their rows
        self.K = csr_matrix(block_diag(stiffness))
        self.points = np.concatenate([body.dof_points for body in system.bodies])
        if self.backend.uses_modes:
            self.modes = dense_block_diag(*(body.rigid_modes for body in system.bodies))

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


class FullProblem(OnDisplacements, Posed):
    """The contact problem on all DOFs."""

    def __init__(self, bodies: FullSystem, on: PosedOn, prefer: Mask, labels: Sequence[str]) -> None:
        super().__init__(on)
        self.slips = bool(on.slipping.any())
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

    @cached_property
    def resistance(self) -> Resistance:
        """What each point resists by itself, by K's diagonal."""
        diagonal = self.space.K.diagonal()
        given = np.zeros_like(diagonal)
        free = np.setdiff1d(np.flatnonzero(diagonal > 0), self.space.D)
        given[free] = STIFFER / diagonal[free]
        return point_resistance(self.kin, self.slips, lambda rows: rows @ diags(given))

    def load(self, case: LoadCase) -> Load:
        """The load case as it stands."""
        return Load(case.f, case.gap0, case.slip0, case.x)

    def surface(self, source: Source, case: LoadCase) -> Array:
        """Displacements of all DOFs (n,)."""
        return source.values
