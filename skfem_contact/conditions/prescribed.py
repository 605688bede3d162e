"""Gaps and slips that supports prescribe: contact has no say in them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from skfem_contact.conditions.kinematics import Kinematics
from skfem_contact.conditions.thresholds import FIXED

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]


def prescribed_rows(B: Array, D: NDArray[np.intp]) -> Mask:
    """Rows all of whose DOFs are prescribed: what they measure can not change."""
    free = np.ones(B.shape[1])
    free[D] = 0.0
    return np.asarray(abs(B) @ free <= FIXED)


def guided_tangents(kin: Kinematics, D: NDArray[np.intp]) -> Mask:
    """Tangents along which supports alone prescribe the slip of a point, shape (m, d-1)."""
    free = np.ones(kin.B_t.shape[1])
    free[D] = 0.0
    size = abs(kin.B_t)
    row = (size @ free == 0) & (np.diff(kin.B_t.indptr) > 0)
    return np.asarray(row.reshape(kin.m, kin.tangents) & kin.paired[:, None])
