"""Factors of dense matrices, Cholesky and LU: the only place that calls LAPACK for whole matrices.

(The multifrontal factorisation calls it for the pivots of its fronts, in place.)

A load history solves some hundred times with factors of a few rows, which takes less than SciPy's
checks of every call: LAPACK is called directly. And there may be no equations at all, where nothing
is prescribed, nothing sticks, or every DOF is decided by contact: their solution has no entries, but
LAPACK takes them for an illegal value.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import LinAlgError, lapack

from skfem_contact.linalg.in_place import mirror
from skfem_contact.linalg.singular import SingularMatrix
from skfem_contact.linalg.thresholds import NO_PIVOT

Array = NDArray[np.float64]


class NoPivot(LinAlgError):
    """A pivot is zero, or negative where it has to be positive.

    Attributes
    ----------
    row : int
        Of the matrix.
    """

    def __init__(self, row: int) -> None:
        super().__init__(f"row {row} has no pivot left once those before it are eliminated")
        self.row = row


@dataclass(frozen=True, eq=False)
class DenseFactors:
    """Factors of a matrix A, from `cholesky` or `lu`.

    Attributes
    ----------
    factors : ndarray, shape (n, n)
        L in the lower triangle, with what was in A above it; or L and U, L without its diagonal.
    exchanged : ndarray of int, shape (n,), or None
        The rows that were exchanged (`lu`); None is Cholesky's factor.
    """

    factors: Array
    exchanged: NDArray[np.int32] | None = None

    def solve(self, b: Array) -> Array:
        """``A^-1 b`` for b of shape (n,) or (n, r)."""
        if not b.size:
            return np.zeros(b.shape)
        if self.exchanged is None:
            return np.asarray(lapack.dpotrs(self.factors, b, lower=1)[0])
        # SciPy counts them from one while LAPACK works, in the array it is given, and threads run on
        exchanged = self.exchanged.copy()
        return np.asarray(lapack.dgetrs(self.factors, exchanged, b)[0])

    @property
    def diagonal(self) -> Array:
        """Diagonal of Cholesky's L, which are the roots of the pivots; or size of that of U, (n,)."""
        diagonal = self.factors.diagonal()
        return diagonal if self.exchanged is None else np.abs(diagonal)

    def even(self, share: float) -> bool:
        """Whether no entry of `diagonal` is below this share of the largest one."""
        diagonal = self.diagonal
        return bool(np.min(diagonal, initial=np.inf) >= share * np.max(diagonal, initial=0.0))

    @property
    def sign(self) -> int:
        """Sign of the determinant.

        >>> lu(np.array([[0.0, 1.0], [1.0, 0.0]])).sign
        -1
        """
        if self.exchanged is None:
            return 1
        swaps = np.count_nonzero(self.exchanged != np.arange(len(self.exchanged)))
        negative = np.count_nonzero(self.factors.diagonal() < 0)
        return -1 if (swaps + negative) % 2 else 1

    def inverse(self) -> Array:
        """``A^-1`` from Cholesky's factor, which it overwrites; exactly symmetric.

        LAPACK's own way takes a third of the operations of a solve with the unit matrix.

        >>> cholesky(np.array([[4.0, 2.0], [2.0, 2.0]])).inverse()
        array([[ 0.5, -0.5],
               [-0.5,  1. ]])
        """
        if not self.factors.size:
            return np.zeros((0, 0))
        inverse: Array = lapack.dpotri(self.factors, lower=1, overwrite_c=1)[0]
        mirror(inverse)  # above the diagonal LAPACK leaves what was there
        return inverse.T  # in the order of rows, as NumPy's own


def cholesky(A: Array, overwrite: bool = False) -> DenseFactors:
    """Cholesky factor of a symmetric matrix, of which the lower triangle is read.

    Parameters
    ----------
    A : ndarray, shape (n, n)
    overwrite : bool
        Whether `A` may be lost.

    Raises
    ------
    NoPivot
        If `A` is not positive definite; it is a `LinAlgError`.

    Examples
    --------
    >>> cholesky(np.zeros((0, 0))).solve(np.zeros((0, 2))).shape
    (0, 2)
    """
    if not A.size:
        return DenseFactors(A)
    factors, failed = lapack.dpotrf(A, lower=1, clean=0, overwrite_a=overwrite)
    if failed:
        raise NoPivot(failed - 1)
    return DenseFactors(factors)


def lu(A: Array, overwrite: bool = False) -> DenseFactors:
    """LU factors of any square matrix; rows are exchanged.

    Parameters
    ----------
    A : ndarray, shape (n, n)
    overwrite : bool
        Whether `A` may be lost.

    Raises
    ------
    NoPivot
        If a pivot is exactly zero; round-off makes pivots that are not, see `DenseFactors.diagonal`.
    """
    if not A.size:
        return DenseFactors(A, np.zeros(0, dtype=np.int32))
    factors, exchanged, failed = lapack.dgetrf(A, overwrite_a=overwrite)
    if failed:
        raise NoPivot(failed - 1)
    return DenseFactors(factors, exchanged)


def factorised(A: Array, symmetric: bool) -> DenseFactors:
    """Factors of a matrix, which they may overwrite: Cholesky, or LU with a check of the pivots.

    Raises
    ------
    SingularMatrix
        Where there is no answer.
    """
    if symmetric:
        try:
            return cholesky(A, overwrite=True)
        except LinAlgError:
            raise SingularMatrix("the matrix of the contact problem is not positive definite") from None
    largest = np.max(np.abs(np.diag(A)), initial=0.0)
    try:
        factors = lu(A, overwrite=True)
        if np.all(factors.diagonal > NO_PIVOT * largest):
            return factors
    except LinAlgError:
        pass
    raise SingularMatrix("the matrix of the contact problem is singular")
