"""`RemoteStiffness`: the stiffness of a body that this process has not as a matrix.

A backend that holds matrices elsewhere subclasses it; the library asks nothing else of it.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy.sparse import csr_matrix

from skfem_contact.arrays import Array
from skfem_contact.errors import InputError


class RemoteStiffness(ABC):
    """A symmetric matrix (n, n) that is held elsewhere.

    It has what contact asks of a stiffness: products, its diagonal, a few of its rows, sparse terms
    added. What needs all of it in one place is refused in words.

    Attributes
    ----------
    shape : tuple of int
    nnz : int
        Number of entries.
    """

    shape: tuple[int, int]
    nnz: int
    ndim = 2
    __array_ufunc__ = None  # products with arrays from the left are errors, not arrays of objects

    @abstractmethod
    def refused(self, why: str) -> InputError:
        """The error for what needs all of the matrix in one place."""

    @abstractmethod
    def diagonal(self) -> Array:
        """Shape (n,)."""

    @abstractmethod
    def times(self, x: Array, absolute: bool = False) -> Array:
        """``K x``, or ``|K| x``, of x (n,) or (n, k)."""

    @abstractmethod
    def rows(self, dofs: Any) -> csr_matrix:
        """Some rows, (len(dofs), n)."""

    @abstractmethod
    def __add__(self, other: Any) -> RemoteStiffness:
        """With a symmetric sparse matrix (n, n) added, which one process holds."""

    @property
    def T(self) -> RemoteStiffness:
        """Itself."""
        return self

    def __matmul__(self, x: Any) -> Array:
        return self.times(np.asarray(x, dtype=float))

    def __abs__(self) -> Magnitudes:
        return Magnitudes(self)

    def __getitem__(self, dofs: Any) -> csr_matrix:
        if isinstance(dofs, tuple):
            raise self.refused("its columns were asked for: K[dofs] gives rows")
        return self.rows(dofs)


class Magnitudes:
    """``|K|``, to be multiplied with."""

    def __init__(self, K: RemoteStiffness) -> None:
        self.K = K

    def __matmul__(self, x: Any) -> Array:
        return self.K.times(np.asarray(x, dtype=float), absolute=True)


def check_whole(stiffness: Sequence[Any], needs_it: str) -> None:
    """Refuse what is done with whole matrices alone."""
    for K in stiffness:
        if isinstance(K, RemoteStiffness):
            raise K.refused(needs_it)
