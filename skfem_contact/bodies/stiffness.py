"""`Stiffness`: checked once, and shared by bodies that are made from each other."""

from __future__ import annotations

from typing import Any
from weakref import WeakValueDictionary

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix
from skfem.assembly import BilinearForm

from skfem_contact.bodies.inputs import assembled_stiffness, check_unprescribed
from skfem_contact.records import dataclass


@dataclass(frozen=True, eq=False)
class Stiffness:
    """A checked stiffness, what it was assembled from, and why by scikit-fem where it was."""

    K: csr_matrix
    basis: Any
    form: BilinearForm | None
    by_skfem: str = ""
    tensor: NDArray[np.float64] | None = None

    @classmethod
    def of(cls, K: Any, basis: Any, D: NDArray[np.int64], whose: str) -> Stiffness:
        """Say that of the body whose `K` this is, as in dataclasses.replace, or a new one.

        `D` are the prescribed DOFs.
        """
        known = _KNOWN.get(id(K))
        if known is not None and known.K is K and known.basis is basis:
            return known
        form = K if isinstance(K, BilinearForm) else None
        matrix, made = assembled_stiffness(K, basis, whose)
        if made is None:
            check_unprescribed(matrix, D, whose)
            return cls(matrix, basis, form).remembered()
        return cls(matrix, basis, form, made.by_skfem, made.tensor).remembered()

    def remembered(self) -> Stiffness:
        """Itself, from now on found by its matrix as long as a body has it."""
        _KNOWN[id(self.K)] = self
        return self


_KNOWN: WeakValueDictionary[int, Stiffness] = WeakValueDictionary()
