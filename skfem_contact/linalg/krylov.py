"""GMRES with a preconditioner from the right: its residual is that of the equations themselves.

Equations may fall into parts that nothing couples, as those of bodies that do not touch. Iterations
end where the residual of all is small: that of a light load beside a heavy one counts for nothing. So
each part is divided by its own load (`sizes_of_parts`), which changes nothing of the equations.

Anderson's secants accelerate fixed points.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.linalg import solve_triangular

from skfem_contact.arrays import Array, Index
from skfem_contact.digits import GIVEN
from skfem_contact.records import dataclass

Operator = Callable[[Array], Array]


def sizes_of_parts(part: Index, terms: Array) -> Array:
    """Return the size of what acts on the part that each equation belongs to, (n,).

    It is zero in parts where nothing acts, whose solution is zero.

    Parameters
    ----------
    part : ndarray of int, shape (n,)
        The number of the part of each equation.
    terms : ndarray, shape (n,)
        The right-hand side, or the sizes of the terms that it is the sum of.

    Examples
    --------
    >>> sizes_of_parts(np.array([0, 0, 1]), np.array([3e8, 4e8, 0.0]))
    array([5.e+08, 5.e+08, 0.e+00])
    """
    return np.asarray(np.sqrt(np.bincount(part, terms**2))[part])


def divided(x: Array, sizes: Array) -> Array:
    """Return values over sizes, and zero where those are zero."""
    return np.divide(x, sizes, out=np.zeros(len(x)), where=sizes > 0)


@dataclass(frozen=True, eq=False)
class Iterated:
    """The end of an iteration.

    Attributes
    ----------
    x : ndarray, shape (n,)
    iterations : int
        Products with the matrix, those that measure the residual apart.
    residual : float
        ``|b - A x|``, measured.
    enough : bool
        Whether it is as small as was asked for.
    """

    x: Array
    iterations: int
    residual: float
    enough: bool


def gmres(
    product: Operator,
    b: Array,
    precondition: Operator,
    x: Array,
    tolerance: float,
    most: int,
    restart: int = 100,
    roughly: float = 0.0,
) -> Iterated:
    """Solve ``A x = b`` until ``|b - A x|`` is below a tolerance, which is absolute.

    The share `roughly` of what it is to begin with is enough in any case. It begins at zero where `x`
    leaves more than that, as where most of a load was taken back.

    It ends after `most` iterations, or where a restart no longer halves the residual: what is left is
    for the caller to judge.

    Examples
    --------
    >>> A = np.array([[2.0, 1.0], [0.0, 3.0]])
    >>> found = gmres(lambda x: A @ x, np.array([3.0, 6.0]), lambda r: r / 2, np.zeros(2), 1e-12, 10)
    >>> found.x.round(12).tolist(), found.iterations
    ([0.5, 2.0], 2)
    """
    r = b - product(x)
    size, iterations = float(np.linalg.norm(r)), 0
    if not size <= np.linalg.norm(b):
        x, r, size = np.zeros_like(b), b, float(np.linalg.norm(b))
    tolerance = max(tolerance, roughly * size)
    while size > tolerance and iterations < most:
        correction, spent = _cycle(product, precondition, r, tolerance, min(restart, most - iterations))
        iterations += spent
        better = x + correction
        r = b - product(better)
        before, size = size, float(np.linalg.norm(r))
        if not size < before:  # a NaN as well
            return Iterated(x, iterations, before, False)
        x = better
        if size > 0.5 * before:
            break
    return Iterated(x, iterations, size, size <= tolerance)


def _cycle(
    product: Operator, precondition: Operator, r: Array, tolerance: float, most: int
) -> tuple[Array, int]:
    """The correction that leaves least of a residual, from a Krylov space of some directions."""
    size = float(np.linalg.norm(r))
    V, Z = np.empty((most + 1, len(r))), np.empty((most, len(r)))  # the system gives what is written to
    H = np.zeros((most + 1, most))
    left = np.append(size, np.zeros(most))  # the residual in the coordinates of the rotated space
    V[0], count = r / size, 0
    turns: list[tuple[float, float]] = []
    for k in range(most):
        Z[k] = precondition(V[k])  # kept, as what they add up to would cost one more
        w = product(Z[k])
        for _ in range(2):  # in one go as much as their round-off is left of them
            along = V[: k + 1] @ w
            w -= along @ V[: k + 1]
            H[: k + 1, k] += along
        beyond = float(np.linalg.norm(w))
        for i, (c, s) in enumerate(turns):
            H[i, k], H[i + 1, k] = c * H[i, k] + s * H[i + 1, k], c * H[i + 1, k] - s * H[i, k]
        length = float(np.hypot(H[k, k], beyond))
        if not 0.0 < length < np.inf:  # a singular matrix: nothing more to gain
            break
        c, s = H[k, k] / length, beyond / length
        turns.append((c, s))
        H[k, k], count = length, k + 1
        left[k], left[k + 1] = c * left[k], -s * left[k]
        if abs(left[k + 1]) <= tolerance or beyond <= np.finfo(float).eps * length:
            break
        V[k + 1] = w / beyond
    weights = solve_triangular(H[:count, :count], left[:count]) if count else np.zeros(0)
    return weights @ Z[:count], count


class Anderson:
    """The next argument of ``u = G(u)`` from the last few pairs of argument and value.

    With ``r = G(u) - u``, the combination of the last differences of r that comes closest to the
    present r is taken off, and the same combination of differences of G. One pair gives G(u) itself.

    Parameters
    ----------
    depth : int
        How many differences are remembered.

    Examples
    --------
    Two rounds solve a scalar linear problem, u = 0.5 u + 1:

    >>> secant = Anderson()
    >>> u = np.array([0.0])
    >>> for _ in range(2):
    ...     u = secant.next(u, 0.5 * u + 1)
    >>> u
    array([2.])

    References
    ----------
    H. F. Walker, P. Ni, SIAM J. Numer. Anal. 49 (2011) 1715-1735.
    """

    def __init__(self, depth: int = 3) -> None:
        self.depth = depth
        self._values: list[Array] = []
        self._residuals: list[Array] = []

    @property
    def active(self) -> bool:
        """Return whether there is more than one pair to combine."""
        return len(self._values) > 1

    def next(self, u: Array, value: Array) -> Array:
        """The next argument, after ``value = G(u)``."""
        self._values = [*self._values, value][-self.depth - 1 :]
        self._residuals = [*self._residuals, value - u][-self.depth - 1 :]
        if len(self._values) == 1:
            return value
        change = np.diff(self._residuals, axis=0).T
        share = np.linalg.lstsq(change, self._residuals[-1], rcond=GIVEN)[0]
        return np.asarray(value - np.diff(self._values, axis=0).T @ share)
