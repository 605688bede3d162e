"""Matrices, vectors and DOF numbers that users give to the constraint functions, checked."""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import ArrayLike, NDArray

from skfem_contact.arguments import shown
from skfem_contact.bodies.inputs import csr32
from skfem_contact.elimination.pivoting import FloatArray, IntArray
from skfem_contact.errors import InputError


def checked_rows(C: Any, b: ArrayLike) -> tuple[sp.csr_matrix, FloatArray]:
    """Constraint rows in memory of their own, without duplicate entries and explicit zeros."""
    C = sparse_matrix("C", C)
    if np.iscomplexobj(C.data):
        raise InputError("C is complex; constraint rows have to be real.")
    C = csr32(C.astype(np.float64))  # copies
    C.sum_duplicates()
    C.eliminate_zeros()
    wrong = np.flatnonzero(~np.isfinite(C.data))
    if len(wrong):
        row = int(np.searchsorted(C.indptr, wrong[0], side="right")) - 1
        raise InputError(f"C has NaN or inf in row {row}. Check normals and weights of that row.")
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
    array = _array(name, v)
    if array.shape != (n,):
        raise InputError(f"{name} has shape {array.shape}, but ({n},) is needed.")
    if array.dtype.kind not in "fiubc":
        raise InputError(f"{name} has entries of type {array.dtype}, but numbers are needed.")
    if at is not None:
        array = array[at]
    wrong = np.flatnonzero(~np.isfinite(array))
    if len(wrong):
        entry = int(wrong[0] if at is None else at[wrong[0]])
        raise InputError(f"{name} has NaN or inf in entry {entry}: finite numbers are needed.")
    return array


def _array(name: str, value: Any) -> NDArray[Any]:
    try:
        return np.asarray(value)
    except ValueError:  # nested to different depths
        raise InputError(f"{name} is {shown(value)}, which is no array: its parts differ.") from None


def dof_mask(prefer: ArrayLike, n: int) -> NDArray[np.bool_]:
    mask = _array("prefer", prefer)
    if mask.shape != (n,) or mask.dtype != bool:
        raise InputError(
            f"prefer has shape {mask.shape} and type {mask.dtype}; give a mask, one bool for each"
            f" of the {n} DOFs."
        )
    return mask


def dof_numbers(D: Any, n: int, name: str = "D") -> IntArray:
    """Sorted DOF numbers of what scikit-fem calls D (or I): array, DofsView or dict of them."""
    if D is None:
        return np.arange(0)
    dofs = np.arange(0)
    for part in D.values() if isinstance(D, dict) else (D,):
        numbers = _array(name, part.flatten() if hasattr(part, "flatten") else part)
        if numbers.dtype == bool and numbers.shape == (n,):
            numbers = np.flatnonzero(numbers)
        if numbers.size and not np.issubdtype(numbers.dtype, np.integer):
            raise InputError(f"{name} has to hold DOF numbers, but it has type {numbers.dtype}.")
        dofs = np.union1d(dofs, numbers.astype(dofs.dtype))
    if len(dofs) and (dofs[0] < 0 or dofs[-1] >= n):
        wrong = dofs[0] if dofs[0] < 0 else dofs[-1]
        raise InputError(f"{name} names DOF {wrong}, but the DOFs are 0 to {n - 1}.")
    return dofs
