"""The contact problem on all DOFs: ``T'KT`` is built and solved in every iteration."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag as dense_block_diag
from scipy.sparse import block_diag, csr_matrix

from skfem_contact.body import System
from skfem_contact.condensation import LoadCase
from skfem_contact.kinematics import Kinematics
from skfem_contact.linear import as_linear_solver
from skfem_contact.spaces import Load, SparseSpace

Array = NDArray[np.float64]


class FullSystem:
    """All DOFs as unknowns, for any linear backend; the reference for the condensed route."""

    def __init__(
        self,
        system: System,
        stiffness: Sequence[csr_matrix],
        kin: Kinematics,
        slipping: NDArray[np.bool_],
        prefer: NDArray[np.bool_],
        labels: Sequence[str],
        backend: Any,
    ) -> None:
        self.space = SparseSpace(
            K=csr_matrix(block_diag(stiffness)),
            kin=kin,
            D=system.D,
            prefer=prefer,
            backend=as_linear_solver(backend),
            labels=labels,
            scale=system.extent,
            frictional=slipping,
            points=np.concatenate([body.dof_points for body in system.bodies]),
            modes=dense_block_diag(*(body.rigid_modes for body in system.bodies)),
        )

    def load(self, case: LoadCase) -> Load:
        """The load case as it stands."""
        return Load(case.f, case.gap0, case.slip0, case.x)

    def recover(self, loads: Sequence[Load], cases: Sequence[LoadCase], z: Array) -> Array:
        """The unknowns are the displacements already."""
        return z
