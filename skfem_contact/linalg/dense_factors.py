"""Factors of dense matrices that may be empty, which LAPACK takes for an illegal value.

Nothing prescribed, nothing sticking, every DOF decided by contact: then there are no equations, and
their solution has no entries. SciPy looks after that in its later versions, and not everywhere.

A load history solves some hundred times with factors of a few rows, which takes less than SciPy's
checks of every call: LAPACK is called directly.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.linalg
from numpy.typing import NDArray
from scipy.linalg.lapack import dgetrs, dpotrs

Array = NDArray[np.float64]


def lu_factor(A: Array, overwrite: bool = False) -> Any:
    """LU factors, for `lu_solve`; rows are exchanged.

    Parameters
    ----------
    A : ndarray, shape (n, n)
    overwrite : bool
        Whether `A` may be lost.

    Examples
    --------
    >>> lu_solve(lu_factor(np.zeros((0, 0))), np.zeros((0, 2))).shape
    (0, 2)
    """
    if not A.size:
        return A, np.zeros(0, dtype=np.int32)
    return scipy.linalg.lu_factor(A, overwrite_a=overwrite, check_finite=False)


def lu_solve(factor: Any, b: Array) -> Array:
    """Solve with the factors of `lu_factor`; `b` is (n,) or (n, r)."""
    if not b.size:
        return np.zeros(b.shape)
    return np.asarray(dgetrs(*factor, b)[0])


def cho_factor(A: Array, overwrite: bool = False) -> Any:
    """Lower Cholesky factor, for `cho_solve`; above its diagonal is what was there.

    Raises
    ------
    scipy.linalg.LinAlgError
        If `A` is not positive definite.
    """
    if not A.size:
        return A, True
    return scipy.linalg.cho_factor(A, lower=True, overwrite_a=overwrite, check_finite=False)


def cho_solve(factor: Any, b: Array) -> Array:
    """Solve with the factor of `cho_factor`; `b` is (n,) or (n, r)."""
    if not b.size:
        return np.zeros(b.shape)
    triangle, lower = factor
    return np.asarray(dpotrs(triangle, b, lower=lower)[0])
