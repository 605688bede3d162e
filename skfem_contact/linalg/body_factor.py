"""`BodyFactor`: what contact needs of a factorised body, however and wherever it was factorised."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Index = NDArray[np.intp]


class Surface(Protocol):
    """What forces on some DOFs move there."""

    def __call__(self, force: Array, flexibility: Array | None = None) -> Array:
        """Displacements (m,) under forces (m,).

        Parameters
        ----------
        force : ndarray, shape (m,)
        flexibility : ndarray, shape (n_c, n_c), optional
            ``(S + ...)^-1`` of what the factorisation keeps, with what holds it besides.
        """
        ...


class BodyFactor(Protocol):
    """A stiffness K (n, n) of which all DOFs i but the kept ones c are eliminated.

    There are two: `multifrontal.factor.MultifrontalCholesky` in one process, and
    `distributed.condensation.DistributedFactor` over MPI ranks. A backend makes them
    (`backend.Backend.condensed`).

    Attributes
    ----------
    keep : ndarray of int, shape (n_c,)
        DOFs that are not eliminated.
    order : ndarray of int, shape (n,)
        The DOFs in the order of elimination; the kept ones come last.
    S : ndarray, shape (n_c, n_c)
        ``K_cc - K_ci K_ii^-1 K_ic``, symmetric, in the order of `keep`; empty once it was taken.
    memory : int
        What the factors take [bytes], on all ranks together.
    """

    keep: Index
    S: Array

    @property
    def order(self) -> Index:
        """Shape (n,)."""
        ...

    @property
    def memory(self) -> int:
        """Bytes."""
        ...

    def take_S(self) -> Array:
        """`S` for the caller alone, who may change it."""
        ...

    def eliminate(self, f: Array) -> Array:
        """Loads (n,) or (n, r) with the interior eliminated, (n, r), in the order `order`.

        The last rows are ``f_c - K_ci K_ii^-1 f_i``; what the others are is for `substitute` to know.
        """
        ...

    def substitute(self, u_keep: Array, eliminated: Array) -> Array:
        """Displacements (n, r), in the order `order`, from those of the kept DOFs (n_c, r).

        `eliminated` is from `eliminate`, or a combination of such; it is overwritten.
        """
        ...

    def reduce_load(self, f: Array) -> Array:
        """``f_c - K_ci K_ii^-1 f_i``, (n,) -> (n_c,) or (n, r) -> (n_c, r)."""
        ...

    def response(self, dofs: Index) -> Surface:
        """What forces on some DOFs (m,) move there."""
        ...
