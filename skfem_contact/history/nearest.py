"""Of all places that equilibrium leaves to a body the one from which its nodes have moved the least."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from skfem_contact.conditions.motions import NOWHERE, RigidMotions
from skfem_contact.digits import COMPUTED
from skfem_contact.history.load_step import Advance
from skfem_contact.history.recovery import Recovery
from skfem_contact.history.thresholds import TOUCH
from skfem_contact.linalg.dense_factors import nonnegative_least_squares

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Rest:
    """An answer that leaves motions free.

    Attributes
    ----------
    advance : Advance
    free : ndarray, shape (k, j)
        Combinations of the model's free motions that are indifferent.
    recover : Recovery
        Of its displacements.
    pull : float
        What it takes to hold the bodies there, over the largest point force: no answer if there is any.
    why : str
        Why a body stands where it stands.
    """

    advance: Advance
    free: Array
    recover: Recovery
    pull: float = 0.0
    why: str = NOWHERE


def nearest_place(
    motions: RigidMotions, free: Array, barred: Mask, advance: Advance, u_last: Array
) -> Rest | None:
    """Move an answer along its free motions to where it has moved least; None if bodies overlap.

    Parameters
    ----------
    motions : RigidMotions
    free : ndarray, shape (k, j)
    barred : ndarray of bool, shape (m,)
        Points without force that these motions open and close.
    advance : Advance
        That has arrived, which is moved.
    u_last : ndarray, shape (n,)
        Displacements from which movement counts [length].
    """
    attempt = advance.attempt
    u = Recovery.of(attempt)()
    # motions of unit size in the mean square: the distance is that of their coefficients
    Q, R = np.linalg.qr(motions.modes @ free)
    open_ = barred & np.isfinite(attempt.local.gap)
    A = np.linalg.solve(R.T, (motions.normal[open_] @ free).T).T
    wanted = Q.T @ (u_last - u)
    y = nearest(A, -attempt.local.gap[open_], wanted)
    if y is None:
        return None
    gap = attempt.local.gap.copy()
    gap[open_] += A @ y
    if np.min(gap[open_], initial=0.0) < -TOUCH * max(motions.system.extent, np.max(np.abs(u_last))):
        return None
    local, shift = attempt.local, Q @ y
    slip = local.slip
    if slip.size and motions.kin.tangents:
        moved = (motions.kin.B_t @ shift).reshape(slip.shape)
        slip = np.where(barred[:, None], slip + moved, slip)
    reference = np.where(barred[:, None], slip, local.reference)
    local = replace(local, slip=slip, reference=reference, gap=gap)
    advance.attempt = replace(attempt, local=local)
    return Rest(advance, free, Recovery.of(attempt, shift))


def nearest(A: Array, b: Array, wanted: Array) -> Array | None:
    """The point nearest to the one wanted with ``A y >= b``; None where there is none.

    Examples
    --------
    >>> nearest(np.array([[1.0, 0.0]]), np.array([2.0]), np.array([0.0, 3.0]))
    array([2., 3.])
    """
    h = b - A @ wanted
    scale = float(np.max(h, initial=0.0))
    if scale <= 0.0:  # the place that is wanted is free
        return wanted
    E = np.vstack([A.T, h / scale])
    target = np.zeros(len(E))
    target[-1] = 1.0
    r = E @ nonnegative_least_squares(E, target) - target
    if not abs(r[-1]) > COMPUTED:
        return None
    return np.asarray(wanted - scale * r[:-1] / r[-1])
