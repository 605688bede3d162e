"""Values that never change: copies of what users give, and arrays that refuse writing.

A result is as good as long as all that it was computed from is what it was. NumPy refuses to write
into a sealed array: ``result.u *= 2`` is an error where it is written, ``u = 2 * result.u`` is not.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.sparse import csr_matrix


def sealed(array: np.ndarray) -> np.ndarray:
    """The array itself, from now on read-only; for arrays that are nobody else's.

    >>> sealed(np.zeros(2)).flags.writeable
    False
    """
    array.setflags(write=False)
    return array


def sealed_matrix(matrix: csr_matrix) -> csr_matrix:
    """The matrix itself with all its arrays read-only."""
    matrix.has_canonical_format  # noqa: B018 (found out and remembered while it can be)
    for part in (matrix.data, matrix.indices, matrix.indptr):
        sealed(part)
    return matrix


def seal(*values: Any) -> None:
    """Make all arrays and matrices that objects have read-only; for every result, so it is quick."""
    for value in values:
        for part in vars(value).values():
            if isinstance(part, np.ndarray):
                part.setflags(False)  # type: ignore[call-arg]  # write; by keyword it takes thrice as long
            elif type(part) is csr_matrix and part.data.flags.writeable:
                sealed_matrix(part)


def kept(value: Any) -> Any:
    """A value of the user's as it is now: what the user does to it later stays outside.

    Numbers, functions and read-only arrays of their own stay themselves.

    >>> mine = np.ones(2)
    >>> ours = kept((mine, 0.5))
    >>> mine[0] = 3.0
    >>> ours
    (array([1., 1.]), 0.5)
    """
    if isinstance(value, np.ndarray):
        own = not value.flags.writeable and value.base is None
        # a mask is kept for those who refuse it
        return value if own else sealed(np.array(value, subok=np.ma.is_masked(value)))
    if isinstance(value, list | tuple):
        return type(value)([kept(part) for part in value]) if type(value) in (list, tuple) else value
    return value
