"""Nonsmooth Gauss-Seidel for problems of Coulomb friction: what solvers of grains and robots do.

Point after point takes the force that its own conditions ask for while all others stand still (Jourdan,
Alart, Jean, 1998): here by projections onto the friction cone with the point's own step (De Saxcé,
Feng, 1998). With numba it is compiled; without, it is a hundred times slower.
"""

from __future__ import annotations

import time
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import bsr_matrix

try:
    from numba import njit
except ImportError:

    def njit(function: Any) -> Any:
        """The function as it stands."""
        return function


Array = NDArray[np.float64]

# Sweeps between two looks at the error; projections of a point at most, and the change of its force,
# over its size, at which they end.
SWEEPS, LOCAL, SAME = 20, 100, 1e-14


@njit
def projected(r: Array, mu: float) -> None:
    """Put a force ``(r_n, r_t)`` to the nearest one within the cone ``|r_t| <= mu r_n``."""
    t = 0.0
    for k in range(1, len(r)):
        t += r[k] * r[k]
    t = t**0.5
    if mu * t <= -r[0]:
        r[:] = 0.0
    elif t > mu * r[0]:
        normal = (r[0] + mu * t) / (1.0 + mu * mu)
        r[0] = normal
        for k in range(1, len(r)):
            r[k] *= mu * normal / t


@njit
def sweeps(
    data: Array,
    columns: NDArray[np.int32],
    begins: NDArray[np.int32],
    q: Array,
    mu: Array,
    r: Array,
    count: int,
) -> None:
    """Take point after point, `count` times all; the forces r (m, d) are changed in place."""
    m, d = r.shape
    u, free, new = np.zeros(d), np.zeros(d), np.zeros(d)
    for _ in range(count):
        for i in range(m):
            own, size = -1, 0.0
            free[:] = q[i]
            for b in range(begins[i], begins[i + 1]):
                j = columns[b]
                if j == i:
                    own = b
                    continue
                for k in range(d):
                    for n in range(d):
                        free[k] += data[b, k, n] * r[j, n]
            for k in range(d):
                row = 0.0
                for n in range(d):
                    row += abs(data[own, k, n])
                size = max(size, row)
            rho = 1.0 / size
            for _ in range(LOCAL):
                slip = 0.0
                for k in range(d):
                    u[k] = free[k]
                    for n in range(d):
                        u[k] += data[own, k, n] * r[i, n]
                    if k > 0:
                        slip += u[k] * u[k]
                u[0] += mu[i] * slip**0.5
                for k in range(d):
                    new[k] = r[i, k] - rho * u[k]
                projected(new, mu[i])
                change, most = 0.0, 0.0
                for k in range(d):
                    change = max(change, abs(new[k] - r[i, k]))
                    most = max(most, abs(new[k]))
                    r[i, k] = new[k]
                if change <= SAME * most:
                    break


def gauss_seidel(
    W: Any, q: Array, mu: Array, error: Any, goal: float, seconds: float
) -> tuple[Array, float]:
    """Forces (m, d), and the CPU time they have taken.

    Parameters
    ----------
    W : sparse matrix, shape (m d, m d)
    q : ndarray, shape (m, d)
    mu : ndarray, shape (m,)
    error : callable
        Of forces (m, d); at `goal` they are an answer.
    goal : float
    seconds : float
        CPU time at most.
    """
    blocks = bsr_matrix(W, blocksize=(q.shape[1],) * 2)
    blocks.sort_indices()
    parts = np.ascontiguousarray(blocks.data), blocks.indices, blocks.indptr
    sweeps(*parts, q, mu, np.zeros_like(q), 1)  # compiled before time is taken
    begin, r = time.process_time(), np.zeros_like(q)
    while True:
        sweeps(*parts, q, mu, r, SWEEPS)
        spent = time.process_time() - begin
        if error(r) <= goal or spent > seconds:
            return r, spent
