"""Gaps and slips that supports prescribe: contact has no say in them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix

from skfem_contact.conditions.kinematics import Kinematics
from skfem_contact.digits import GIVEN
from skfem_contact.pairing.vectors import entries

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]


def prescribed_rows(B: csr_matrix, D: NDArray[np.intp]) -> Mask:
    """Rows all of whose DOFs are prescribed: what they measure can not change."""
    return np.asarray(_on_free(B, D) <= GIVEN)


def guided_tangents(kin: Kinematics, D: NDArray[np.intp]) -> Mask:
    """Tangents along which supports alone prescribe the slip of a point, shape (m, d-1)."""
    row = (_on_free(kin.B_t, D) == 0) & (np.diff(kin.B_t.indptr) > 0)
    return np.asarray(row.reshape(kin.m, kin.tangents) & kin.paired[:, None])


def _on_free(B: csr_matrix, D: NDArray[np.intp]) -> Array:
    """Sum of the sizes of the entries of each row that are at DOFs which are not prescribed."""
    free = np.ones(B.shape[1])
    free[D] = 0.0
    row, column, value = entries(B)
    return np.asarray(np.bincount(row, np.abs(value) * free[column], B.shape[0]), dtype=float)
