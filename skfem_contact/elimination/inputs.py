"""Matrices, vectors and DOF numbers that users give to the constraint functions, checked."""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import ArrayLike, NDArray

from skfem_contact.arguments import shown
from skfem_contact.arrays import check_finite, check_size, check_type, dof_numbers, rectangular
from skfem_contact.bodies.inputs import csr32
from skfem_contact.elimination.pivoting import FloatArray, IntArray
from skfem_contact.errors import InputError

NO_ARRAY = "which is no array: its parts differ."


def checked_rows(C: Any, b: ArrayLike) -> tuple[sp.csr_matrix, FloatArray]:
    """Constraint rows in memory of their own, without duplicate entries and explicit zeros."""
    C = sparse_matrix("C", C)
    if np.iscomplexobj(C.data):
        raise InputError("C is complex; constraint rows have to be real.")
    C = csr32(C.astype(np.float64))  # copies
    C.sum_duplicates()
    C.eliminate_zeros()
    check_finite(C.data, "C", "row", np.repeat(np.arange(C.shape[0]), np.diff(C.indptr)))
    b = finite_vector("b", b, C.shape[0])
    if np.iscomplexobj(b):
        raise InputError("b is complex; constraint rows have to be real.")
    return C, b.astype(np.float64)


def sparse_matrix(name: str, value: Any) -> sp.csr_matrix:
    try:
        matrix = sp.csr_matrix(value)
        if matrix.dtype.kind in "fiubc":
            return matrix
    except (TypeError, ValueError, IndexError, AttributeError):
        pass
    raise InputError(f"{name} is {shown(value)}; give a sparse matrix or an array of numbers")


def finite_vector(name: str, v: ArrayLike, n: int, at: IntArray | None = None) -> NDArray[Any]:
    """The vector `v` of shape (n,), or its entries `at`; finite, not copied."""
    array = rectangular(v, name, NO_ARRAY)
    check_size(array, n, name, f"but ({n},) is needed.")
    check_type(array, name, "but numbers are needed.", "fiubc")
    array = array if at is None else array[at]
    check_finite(array, name, number=at)
    return array


def dof_mask(prefer: ArrayLike, n: int) -> NDArray[np.bool_]:
    mask = rectangular(prefer, "prefer", NO_ARRAY)
    if mask.shape != (n,) or mask.dtype != bool:
        raise InputError(
            f"prefer has shape {mask.shape} and type {mask.dtype}; give a mask, one bool for each"
            f" of the {n} DOFs."
        )
    return mask


def prescribed(D: Any, n: int, name: str = "D") -> IntArray:
    """Sorted DOF numbers of what scikit-fem calls D (or I): array, DofsView or dict of them."""
    if D is None:
        return np.arange(0)
    dofs = np.arange(0)
    for part in D.values() if isinstance(D, dict) else (D,):
        numbers = rectangular(part.flatten() if hasattr(part, "flatten") else part, name, NO_ARRAY)
        dofs = np.union1d(dofs, dof_numbers(numbers.ravel(), n, name))
    return dofs
