"""Anderson acceleration of a fixed-point iteration: secants instead of plain repetition."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from skfem_contact.digits import GIVEN

Array = NDArray[np.float64]


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
        """Whether there is more than one pair to combine."""
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
