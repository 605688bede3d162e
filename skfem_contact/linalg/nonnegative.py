"""Least squares with unknowns that are not negative.

`scipy.optimize.nnls` of SciPy 1.15, the last one for Python 3.10, gives answers that are not the least
ones, without a word.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

# Slope over the size of the matrix that is round-off, as in `scipy.optimize.nnls`.
ROUND_OFF = 10 * np.finfo(float).eps


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
