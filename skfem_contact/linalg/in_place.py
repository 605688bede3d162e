"""Large dense matrices changed in place, by blocks of rows, without a second one beside them."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from skfem_contact.linalg import thresholds

Array = NDArray[np.float64]


def blocks(count: int) -> Iterator[slice]:
    """Rows that are worked on at once; a matrix that is not large is one block."""
    for begin in range(0, count, thresholds.ROWS_AT_ONCE):
        yield slice(begin, min(begin + thresholds.ROWS_AT_ONCE, count))


def symmetrise(A: Array) -> None:
    """``(A + A') / 2``.

    >>> A = np.array([[1.0, 2.0], [4.0, 3.0]])
    >>> symmetrise(A)
    >>> A.tolist()
    [[1.0, 3.0], [3.0, 3.0]]
    """
    for rows in blocks(len(A)):
        mean = 0.5 * (A[rows, rows.start :] + A[rows.start :, rows].T)
        A[rows, rows.start :] = mean
        A[rows.start :, rows] = mean.T


def mirror(A: Array) -> None:
    """What is below the diagonal written above it, too.

    >>> A = np.array([[1.0, 0.0], [4.0, 3.0]])
    >>> mirror(A)
    >>> A.tolist()
    [[1.0, 4.0], [4.0, 3.0]]
    """
    for begin in range(0, len(A), thresholds.MIRRORED_AT_ONCE):
        end = min(begin + thresholds.MIRRORED_AT_ONCE, len(A))
        block = A[begin:end, begin:end]
        np.copyto(block, block.T, where=~np.tri(len(block), dtype=bool))
        A[begin:end, end:] = A[end:, begin:end].T


def divide(A: Array, scale: Array) -> None:
    """``A_ij / (scale_i scale_j)``."""
    for rows in blocks(len(A)):
        A[rows] /= np.outer(scale[rows], scale)


def subtract_product(A: Array, B: Array, C: Array) -> None:
    """``A - B C``."""
    for rows in blocks(len(A)):
        A[rows] -= B[rows] @ C
