"""`DistributedStiffness`: the stiffness of a body that no process has as a whole."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix

from skfem_contact.errors import InputError

Array = NDArray[np.float64]


class DistributedStiffness(ABC):
    """A symmetric matrix (n, n) of which each rank holds some rows.

    It has what contact asks of a stiffness: products, its diagonal, a few of its rows, sparse terms
    added. What needs all of it in one place is refused in words.

    Attributes
    ----------
    shape : tuple of int
    nnz : int
        Number of entries on all ranks.
    """

    shape: tuple[int, int]
    nnz: int
    ndim = 2
    __array_ufunc__ = None  # products with arrays from the left are errors, not arrays of objects

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
    def __add__(self, other: Any) -> DistributedStiffness:
        """With a symmetric sparse matrix (n, n) added, which one process holds."""

    @property
    def T(self) -> DistributedStiffness:
        """Itself."""
        return self

    def __matmul__(self, x: Any) -> Array:
        return self.times(np.asarray(x, dtype=float))

    def __mul__(self, factor: Any) -> NoReturn:
        raise refused("numbers do not multiply it: let the function that assembles have the factor")

    __rmul__ = __mul__

    def __abs__(self) -> Magnitudes:
        return Magnitudes(self)

    def __getitem__(self, dofs: Any) -> csr_matrix:
        if isinstance(dofs, tuple):
            raise refused("its columns were asked for: K[dofs] gives rows")
        return self.rows(dofs)

    def __repr__(self) -> str:
        return f"<stiffness of {self.shape[0]} DOFs, {self.nnz} entries, held rank by rank>"

    def __getattr__(self, name: str) -> NoReturn:
        # what NumPy, SciPy, pickle and copy look for by themselves is simply not there
        if name.startswith("_"):
            raise AttributeError(name)
        raise AttributeError(str(refused(f"there is no {name!r} of it")))

    def __reduce_ex__(self, protocol: Any) -> NoReturn:
        raise refused("it can not be pickled or copied: use save_state for states of a history")


class Magnitudes:
    """``|K|``, to be multiplied with."""

    def __init__(self, K: DistributedStiffness) -> None:
        self.K = K

    def __matmul__(self, x: Any) -> Array:
        return self.K.times(np.asarray(x, dtype=float), absolute=True)


def refused(why: str) -> InputError:
    """The error for what needs all of the matrix in one place."""
    return InputError(
        f"this stiffness was assembled rank by rank, and no process has all of it; {why}. It has "
        "K @ x, K.diagonal(), K[dofs], and goes with ContactSolver(..., linear=PETSc()) alone."
    )


def check_whole(stiffness: Sequence[Any], what: str) -> None:
    """Refuse what is done with whole matrices alone."""
    if any(isinstance(K, DistributedStiffness) for K in stiffness):
        raise refused(f"{what} needs all of it")
