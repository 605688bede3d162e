"""The stiffness of all bodies where no process has it as a whole, as contact problems see it."""

from __future__ import annotations

from abc import abstractmethod
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix

from skfem_contact.bodies.distributed import DistributedStiffness
from skfem_contact.elimination.constraint import AffineConstraint

Array = NDArray[np.float64]


class Stacked(DistributedStiffness):
    """Block diagonal stiffness of all bodies, and sparse terms that one process has."""

    @abstractmethod
    def bordered(self, B: csr_matrix) -> Stacked:
        """With further unknowns ``w = B u``, without stiffness but for what is added to all."""

    @abstractmethod
    def reduced(self, trial: AffineConstraint, f: Array, test: AffineConstraint) -> tuple[Any, Array]:
        """``V'KT``, for the backend to factorise, and ``V'(f - K c)``."""

    @abstractmethod
    def __add__(self, other: Any) -> Stacked:
        """With a symmetric sparse matrix (n, n) added, which one process holds."""
