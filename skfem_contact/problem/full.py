"""The contact problem on all DOFs: ``T'KT`` is built and solved in every iteration."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag as dense_block_diag
from scipy.sparse import block_diag, csr_matrix

from skfem_contact.bodies.system import System
from skfem_contact.conditions.kinematics import Kinematics
from skfem_contact.conditions.loads import LoadCase
from skfem_contact.linalg.direct import as_linear_solver
from skfem_contact.problem.spaces import Load, Response, Source, SparseSpace

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]


class FullSystem:
    """All DOFs as unknowns, for any linear backend; the reference for the condensed route."""

    def __init__(self, system: System, stiffness: Sequence[csr_matrix], backend: Any) -> None:
        self.system = system
        self.backend = as_linear_solver(backend)
        self.K = csr_matrix(block_diag(stiffness))
        self.points = np.concatenate([body.dof_points for body in system.bodies])
        self.modes: Array | None = None
        if self.backend.uses_modes:
            self.modes = dense_block_diag(*(body.rigid_modes for body in system.bodies))

    def recover(
        self, sources: Source, components: Sequence[Any], cases: Sequence[LoadCase]
    ) -> list[Array]:
        """All displacements, r arrays (n,), which are the sources themselves (n, r)."""
        return [np.array(u) for u in sources.values.T]

    def attach(self, kin: Kinematics, slipping: Mask, prefer: Mask, labels: Sequence[str]) -> FullRows:
        """The contact problem for one pairing."""
        return FullRows(self, kin, slipping, prefer, labels)


class FullRows:
    """The contact problem on all DOFs for one pairing."""

    def __init__(
        self,
        model: FullSystem,
        kin: Kinematics,
        slipping: Mask,
        prefer: Mask,
        labels: Sequence[str],
    ) -> None:
        self.space = SparseSpace(
            K=model.K,
            kin=kin,
            D=model.system.D,
            prefer=prefer,
            backend=model.backend,
            labels=labels,
            scale=model.system.extent,
            frictional=slipping,
            points=model.points,
            modes=model.modes,
        )

    def load(self, case: LoadCase) -> Load:
        """The load case as it stands."""
        return Load(case.f, case.gap0, case.slip0, case.x)

    def source(self, load: Load, response: Response) -> Source:
        """The unknowns are the displacements of all DOFs already."""
        return Source(response.solution, forces=False)

    def contact_displacement(self, source: Source, case: LoadCase) -> Array:
        """Displacements of all DOFs (n,)."""
        return source.values
