"""Factors of dense matrices, Cholesky and LU: the only place that calls LAPACK for whole matrices.

(The multifrontal factorisation calls it for the pivots of its fronts, in place.)

A load history solves some hundred times with factors of a few rows, which takes less than SciPy's
checks of every call: LAPACK is called directly. And there may be no equations at all, where nothing
is prescribed, nothing sticks, or every DOF is decided by contact: their solution has no entries, but
LAPACK takes them for an illegal value.

Large ones are changed in place, by blocks of rows, without a second one beside them.

Least squares with unknowns that are not negative are here too: `scipy.optimize.nnls` of SciPy 1.15, the
last one for Python 3.10, gives answers that are not the least ones, without a word.

So are one BLAS thread for the many small dense blocks of contact problems, and memory: how much a
factorisation may take, before anything is known of it, and in words.
"""

from __future__ import annotations

from functools import lru_cache
from threading import Lock, local
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import LinAlgError, lapack

from skfem_contact.arrays import Array, Mask
from skfem_contact.digits import ROUND_OFF
from skfem_contact.errors import SingularMatrix
from skfem_contact.records import dataclass

# Rows of a matrix that are worked on at once: enough for matrix products, few beside the matrix. One
# that is not large is one block.
ROWS_AT_ONCE = 1024

# Rows of a triangle that are copied at once: few operations, and a block that caches hold.
MIRRORED_AT_ONCE = 128

# Twice the bytes of the factors of squares over n log2 n, and of cubes over n^1.37: 3.2 GB are taken by
# a million DOFs in the plane; 0.21, 0.98 and 2.8 GB for 30 000, 95 000 and 202 000 in space.
FACTORS_2D, FACTORS_3D = 240.0, 300.0


class SingleThreaded:
    """The time in which BLAS has one thread: from the first who asks for it to the last who leaves.

    The dense blocks of contact problems are small: two threads spend their time waiting for each
    other and cost up to 30 times the CPU.

    The setting is one of the process as a rule. If everyone who came set it and took it back, one of
    two Python threads would take back what the other still needs, and the other leave one thread for
    good. Of a BLAS that has a setting for each Python thread every one takes back its own.
    """

    def __init__(self) -> None:
        self._lock, self._inside, self.taken = Lock(), 0, list[tuple[Any, int]]()
        self._own = _Own()

    def __enter__(self) -> None:
        own = self._own
        if not own.depth:
            with self._lock:
                for library in _blas().lib_controllers:
                    # asking takes a microsecond, setting twenty
                    if (count := library.num_threads) != 1:
                        layer = getattr(library, "threading_layer", "")
                        of_each_thread = library.internal_api == "mkl" or layer == "openmp"
                        (own if of_each_thread else self).taken.append((library, count))
                        _set(library, 1)
                self._inside += 1
        own.depth += 1

    def __exit__(self, *failed: object) -> None:
        own = self._own
        own.depth -= 1
        if not own.depth:
            _give_back(own.taken)
            with self._lock:
                self._inside -= 1
                if not self._inside:
                    _give_back(self.taken)


class _Own(local):
    """The number of times that a thread is inside, and what it has set for itself."""

    def __init__(self) -> None:
        self.depth, self.taken = 0, list[tuple[Any, int]]()


def _set(library: Any, count: int) -> None:
    library.set_num_threads(count)
    # threadpoolctl lets nobody but the thread that was first set it, until that gives it free
    free = getattr(library, "clear_controlling_thread", None)
    if free is not None:
        free()


def _give_back(taken: list[tuple[Any, int]]) -> None:
    while taken:
        _set(*taken.pop())


#: One for the process: BLAS has one thread as long as anybody is ``with`` it.
single_threaded = SingleThreaded()


@lru_cache(maxsize=1)
def _blas() -> Any:
    from threadpoolctl import ThreadpoolController  # it looks for libraries when it is imported

    return ThreadpoolController().select(user_api="blas")


@dataclass(frozen=True)
class Limits:
    """The memory that a solver may take [bytes]."""

    dense: float
    factors: float


def factor_bound(n: int, dim: int) -> float:
    """About twice what the factors of a body of n DOFs take in general [bytes].

    Where this is allowed, nobody needs to look closer.

    >>> f"{factor_bound(100_000, 3):.2g}", f"{factor_bound(100_000, 2):.2g}"
    ('2.1e+09', '4e+08')
    """
    if n < 2:
        return 0.0
    if dim < 3:
        return float(FACTORS_2D * n * np.log2(n))
    return float(FACTORS_3D * n**1.37)


def written_bytes(count: float) -> str:
    """A number of bytes with three digits.

    >>> written_bytes(80), written_bytes(1234567), written_bytes(3e9)
    ('80 B', '1.23 MB', '3 GB')
    """
    for unit, size in (("GB", 1e9), ("MB", 1e6), ("kB", 1e3)):
        if count >= size:
            return f"{count / size:.3g} {unit}"
    return f"{count:.0f} B"


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

    def solve(self, b: Array, transposed: bool = False) -> Array:
        """``A^-1 b`` for b of shape (n,) or (n, r); `transposed`: with the transpose of A.

        >>> lu(np.array([[1.0, 1.0], [0.0, 1.0]])).solve(np.array([1.0, 0.0]), transposed=True)
        array([ 1., -1.])
        """
        if not b.size:
            return np.zeros(b.shape)
        if self.exchanged is None:
            return np.asarray(lapack.dpotrs(self.factors, b, lower=1)[0])
        # SciPy counts them from one while LAPACK works, in the array it is given, and threads run on
        exchanged = self.exchanged.copy()
        return np.asarray(lapack.dgetrs(self.factors, exchanged, b, trans=int(transposed))[0])

    @property
    def diagonal(self) -> Array:
        """Diagonal of Cholesky's L, which are the roots of the pivots; or size of that of U, (n,)."""
        diagonal = self.factors.diagonal()
        return diagonal if self.exchanged is None else np.abs(diagonal)

    def even(self, share: float) -> bool:
        """Return whether no entry of `diagonal` is below this share of the largest one."""
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
    LinAlgError
        `A` is not positive definite.

    Examples
    --------
    >>> cholesky(np.zeros((0, 0))).solve(np.zeros((0, 2))).shape
    (0, 2)
    """
    if not A.size:
        return DenseFactors(A)
    factors, failed = lapack.dpotrf(A, lower=1, clean=0, overwrite_a=overwrite)
    if failed:
        raise LinAlgError(f"row {failed - 1} has no pivot left once those before it are eliminated")
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
    LinAlgError
        A pivot is exactly zero; round-off makes pivots that are not, see `DenseFactors.diagonal`.
    """
    if not A.size:
        return DenseFactors(A, np.zeros(0, dtype=np.int32))
    factors, exchanged, failed = lapack.dgetrf(A, overwrite_a=overwrite)
    if failed:
        raise LinAlgError(f"row {failed - 1} has no pivot left once those before it are eliminated")
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
    largest = np.max(np.abs(A.diagonal()), initial=0.0)
    try:
        factors = lu(A, overwrite=True)
        if np.all(factors.diagonal > ROUND_OFF * largest):
            return factors
    except LinAlgError:
        pass
    raise SingularMatrix("the matrix of the contact problem is singular")


def definite_inverse(A: Array, least: float = 0.0) -> Array:
    """Inverse of a symmetric positive definite matrix, in its place; exactly symmetric.

    Rows whose pivot, of a unit diagonal, is below `least` are refused: they depend on others. No
    diagonal entry is zero.

    Raises
    ------
    LinAlgError
        Rows depend on each other; `A` is lost.
    """
    own = A.diagonal().copy()
    factors = cholesky(A.T, overwrite=True)
    if least and np.min(factors.diagonal / np.sqrt(own), initial=1.0) < least:
        raise LinAlgError("dependent contact rows")
    return factors.inverse()


def indefinite_inverse(A: Array, least: float = 0.0) -> Array:
    """Inverse of a symmetric matrix that is not positive definite, as of bodies that are not stable.

    Rows are refused as by `definite_inverse`, by the square of `least`.

    Raises
    ------
    LinAlgError
        Rows depend on each other; `A` is lost.
    """
    size = np.sqrt(np.max(np.abs(A), axis=1))
    if not np.all((size > 0) & np.isfinite(size)):  # a tangent that a bad iterate has spoiled
        raise LinAlgError("contact rows without a finite flexibility")
    A /= size
    A /= size[:, None]
    factors = lu(A)
    if least and not factors.even(least**2):
        raise LinAlgError("dependent contact rows")
    inverse = factors.solve(np.eye(len(A)))
    inverse /= size
    inverse /= size[:, None]
    symmetrise(inverse)
    return inverse


def symmetrise(A: Array) -> None:
    """``(A + A') / 2``.

    >>> A = np.array([[1.0, 2.0], [4.0, 3.0]])
    >>> symmetrise(A)
    >>> A.tolist()
    [[1.0, 3.0], [3.0, 3.0]]
    """
    for begin in range(0, len(A), ROWS_AT_ONCE):
        rows, beyond = slice(begin, begin + ROWS_AT_ONCE), slice(begin, None)
        mean = 0.5 * (A[rows, beyond] + A[beyond, rows].T)
        A[rows, beyond] = mean
        A[beyond, rows] = mean.T


def mirror(A: Array) -> None:
    """Return what is below the diagonal written above it, too.

    >>> A = np.array([[1.0, 0.0], [4.0, 3.0]])
    >>> mirror(A)
    >>> A.tolist()
    [[1.0, 4.0], [4.0, 3.0]]
    """
    for begin in range(0, len(A), MIRRORED_AT_ONCE):
        end = min(begin + MIRRORED_AT_ONCE, len(A))
        block = A[begin:end, begin:end]
        np.copyto(block, block.T, where=~np.tri(len(block), dtype=bool))
        A[begin:end, end:] = A[end:, begin:end].T


def nonnegative_least_squares(A: Array, b: Array) -> Array:
    """The x that makes ``|A x - b|`` the least of all ``x >= 0``.

    By C. L. Lawson and R. J. Hanson, *Solving least squares problems* (1974), chapter 23: unknowns
    leave zero one by one, the steepest first, as long as any slope is more than round-off. A step that
    does not come nearer is taken back, so that no choice of unknowns comes twice.

    Parameters
    ----------
    A : ndarray, shape (r, n)
        With few rows: no more unknowns than rows are above zero, and small systems are solved.
    b : ndarray, shape (r,)

    Returns
    -------
    ndarray, shape (n,)

    Examples
    --------
    >>> nonnegative_least_squares(np.array([[1.0, 1.0], [0.0, 1.0]]), np.array([1.0, -1.0]))
    array([1., 0.])
    """
    x, above = np.zeros(A.shape[1]), np.zeros(A.shape[1], dtype=bool)
    refused, left = above.copy(), np.linalg.norm(b)
    # columns that depend on those above zero have a slope of round-off, and no bound
    least = ROUND_OFF * max(A.shape) * np.max(np.sum(np.abs(A), axis=0), initial=0.0)
    while True:
        slope = np.where(above | refused, 0.0, A.T @ (b - A @ x))
        if np.max(slope, initial=0.0) <= least:
            return x
        steepest = int(np.argmax(slope))
        trial, chosen = _with(steepest, A, b, x, above)
        distance = np.linalg.norm(A @ trial - b)
        if distance < left:
            x, above, left = trial, chosen, distance
            refused[:] = False
        else:
            refused[steepest] = True


def _with(one: int, A: Array, b: Array, x: Array, above: Mask) -> tuple[Array, Mask]:
    """The answer with one more unknown above zero, less those that reach zero on the way to it."""
    above = above.copy()
    above[one] = True
    while True:
        least = np.zeros(len(x))
        least[above] = np.linalg.lstsq(A[:, above], b, rcond=None)[0]
        falls = np.flatnonzero(above & (least <= 0.0))
        if not len(falls):
            return least, above
        way = x[falls] - least[falls]
        share = np.divide(x[falls], way, out=np.zeros(len(falls)), where=way > 0)
        reached = falls[share <= share.min()]
        x = x + share.min() * (least - x)
        above[reached], x[reached] = False, 0.0
