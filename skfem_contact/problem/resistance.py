"""What each contact point resists by itself: the diagonal blocks of the compliance of all points."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix

from skfem_contact.conditions.kinematics import Kinematics
from skfem_contact.problem.response import Resistance
from skfem_contact.problem.thresholds import ROWS_AT_ONCE

Array = NDArray[np.float64]


def point_resistance(
    kin: Kinematics, slips: bool, flexibility: Callable[[csr_matrix], csr_matrix | Array]
) -> Resistance:
    """Resistance of each point from rows times the flexibility of the bodies.

    Parameters
    ----------
    kin : Kinematics
    slips : bool
        Whether tangential rows are modelled.
    flexibility : callable
        ``B -> B F``, of rows (r, n) the displacements that unit forces along them cause, (r, n).
    """
    t = kin.tangents if slips else 0
    normal = _blocks(kin.B_n, 1, flexibility)[:, 0, 0]
    resisted = _inverse(normal)
    if t == 0:
        return Resistance(resisted, resisted)
    softest = np.asarray(np.linalg.eigvalsh(_blocks(kin.B_t, t, flexibility))[:, -1], dtype=float)
    return Resistance(resisted, _inverse(softest))


def _blocks(B: csr_matrix, size: int, flexibility: Callable[[csr_matrix], csr_matrix | Array]) -> Array:
    """Diagonal blocks (m, size, size) of ``B F B'``, of a few rows at a time."""
    out = np.zeros((B.shape[0] // size, size, size))
    some = max(1, ROWS_AT_ONCE // size)
    for first in range(0, len(out), some):
        points = slice(first, min(first + some, len(out)))
        rows = csr_matrix(B[points.start * size : points.stop * size])
        W = _dense(flexibility(rows) @ rows.T)
        count = points.stop - points.start
        where = np.arange(count)[:, None] * size + np.arange(size)
        out[points] = W[where[:, :, None], where[:, None, :]]
    return out


def _dense(A: csr_matrix | Array) -> Array:
    return np.asarray(A.toarray() if hasattr(A, "toarray") else A)


def _inverse(compliance: Array) -> Array:
    """One over it; what can not move at all resists like the stiffest of the others."""
    moves = compliance > 0
    if not moves.any():
        return np.ones_like(compliance)
    return 1.0 / np.where(moves, compliance, np.min(compliance[moves]))
