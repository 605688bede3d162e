r"""The dense matrix of the contact problem: ``(G F G')^-1`` of the rows of gaps, slips and anchors.

With many points, such a matrix is most of the memory that a solver takes. So it is formed by blocks of
rows, changed in place from then on, and its size is known before (`dense_bytes`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import LinAlgError
from scipy.sparse import csr_matrix

from skfem_contact.linalg.dense_factors import (
    DenseFactors,
    blocks,
    cholesky,
    divide,
    lu,
    subtract_product,
    symmetrise,
)
from skfem_contact.problem import thresholds

Array = NDArray[np.float64]


def dense_bytes(kept: Sequence[int], rows: int) -> int:
    """Memory of the dense matrices of a contact problem at most, before any of them is there [bytes].

    That is the flexibility of each body, the stiffness of gaps and slips, and what an iteration makes
    of it: a factorisation, and what friction adds.

    Parameters
    ----------
    kept : sequence of int
        Contact DOFs of each body.
    rows : int
        Gaps and slips.

    Examples
    --------
    Two bodies of 1000 points, which all have three rows: four and a half matrices.

    >>> dense_bytes([3000, 3000], 3000) / (8 * 3000**2)
    4.5
    """
    return sum(8 * int(n) ** 2 for n in kept) + int(thresholds.PER_ROWS * 8 * rows**2)


def row_flexibility(G: csr_matrix, times_flexibility: Callable[[csr_matrix], Array]) -> Array:
    """``G F G'``, by blocks of rows.

    Parameters
    ----------
    G : csr_matrix, shape (r, n_c)
    times_flexibility : callable
        Some of these rows times F.
    """
    W = np.empty((G.shape[0], G.shape[0]))
    for rows in blocks(len(W)):
        some = G[rows] if rows.stop - rows.start < len(W) else G
        W[:, rows] = G @ times_flexibility(some).T
    return W


def indefinite_inverse(W: Array) -> Array:
    """Inverse of a symmetric matrix that is not positive definite, as of bodies that are not stable.

    Raises
    ------
    LinAlgError
        Rows depend on each other.
    """
    symmetrise(W)
    size = np.sqrt(np.max(np.abs(W), axis=1))
    divide(W, size)
    factors = lu(W)
    if not factors.even(thresholds.DEPENDENT**2):
        raise LinAlgError("dependent contact rows")
    inverse = factors.solve(np.eye(len(W)))
    symmetrise(inverse)
    divide(inverse, size)
    return inverse


def inverse(W: Array, refuses: bool = True) -> Array:
    """Inverse of a symmetric positive definite matrix, in its place; dependent rows may be refused.

    No diagonal entry is zero: rows without free coefficients are left out before, and the flexibility
    of the bodies is positive definite.

    Raises
    ------
    LinAlgError
        Rows depend on each other; `W` is lost.
    """
    scale = np.sqrt(np.diag(W))
    symmetrise(W)
    divide(W, scale)
    factors = cholesky(W.T, overwrite=True)
    if refuses and np.min(factors.diagonal, initial=1.0) < thresholds.DEPENDENT:
        raise LinAlgError("dependent contact rows")
    inverse = factors.inverse()
    divide(inverse, scale)
    return inverse


def without_anchors(A: Array, A_zq: Array, rigid: DenseFactors) -> Array:
    """``A_zz - A_zq R A_qz``, a part of A itself; R is the inverse of what `rigid` factorises."""
    q = len(A_zq)
    if len(A) == q:
        return A
    S = A[:q, :q]
    subtract_product(S, A_zq, rigid.solve(A_zq.T))
    symmetrise(S)
    return S
