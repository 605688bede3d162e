r"""Starting values that can not fail: one step of 2-D Coulomb friction as a complementarity problem.

Newton's method on the set of closed, sticking and slipping points may run in circles even where
there is exactly one solution. In two dimensions the whole step is one linear complementarity
problem. With the compliance W between the points, the friction force ``tau = tau_1 - tau_2`` and
the size ``sigma`` of the slip, all of ``lambda, tau_1, tau_2, sigma`` and

    gap     W_nn lambda - W_nt (tau_1 - tau_2) + g_free
    front   sigma - slip                                    complementary to tau_1
    back    sigma + slip                                    complementary to tau_2
    room    mu lambda - tau_1 - tau_2                       complementary to sigma

are not negative, and at each point one of every pair is zero. The matrix is copositive, so Lemke's
method ends at a solution for every load, history and mu (Klarbring and Pang, 1998; Stewart and
Trinkle, 1996); only bodies that contact and friction alone should hold may have none. A finite
stiffness of sticking points adds 1/G to the diagonal of W_tt.

It costs some m dense updates of a matrix of 4 m rows, so it serves where a loop has failed. It
gives starting values and nothing else: the loop decides whether they are right.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import LinAlgError, cho_factor, cho_solve

from skfem_contact.loops import OPEN, SLIP, STICK, Guess, Step
from skfem_contact.spaces import PointSpace

Array = NDArray[np.float64]
Index = NDArray[np.intp]

# Unknowns of the largest problem that is tried: half a minute.
LARGEST = 1600
# Springs that hold bodies which nothing else holds, over the diagonal: they change starting values
# by their size, and leave the compliance half of its digits.
WEAK = 1e-8
# Linearisations of a friction law that is not linear in the normal force (a shear cap).
SWEEPS = 6


def complementary_guess(step: Step, current: Guess) -> Guess | None:
    """Status, slip direction and forces of a step from Lemke's method.

    Parameters
    ----------
    step : Step
    current : Guess
        Where the friction law is linearised first; a law linear in the normal force needs nothing.

    Returns
    -------
    Guess or None
        None where the method does not apply (three dimensions, no dense contact space, too many
        points) or finds no solution.
    """
    space = step.space
    if not isinstance(space, PointSpace) or space.tangential_rows.shape[1] != 1:
        return None
    meets = (space.normal_rows >= 0) & step.paired & ~step.tied
    rubs = meets & (space.tangential_rows[:, 0] >= 0) & step.frictional
    if meets.sum() + 3 * rubs.sum() > LARGEST:
        return None
    try:
        W, free = _compliance(step, space)
    except LinAlgError:
        return None
    point, rub = np.flatnonzero(meets), np.flatnonzero(rubs)
    size = np.sqrt(np.diag(W)[space.normal_rows[point]])
    for _ in range(SWEEPS):
        slope = step.slope(current.normal_force, current.slip)[rub]
        limit = step.limit(current.normal_force, current.slip)[rub]
        limit = limit - slope * np.maximum(current.normal_force, 0.0)[rub]
        M, q = _problem(step, space, W, free, point, rub, size, slope, limit)
        solution = lemke(M, q)
        if solution is None:
            return None
        current = _as_guess(solution, current, point, rub, size)
        new = step.slope(current.normal_force, current.slip)[rub]
        again = step.limit(current.normal_force, current.slip)[rub]
        again = again - new * current.normal_force[rub]
        if np.array_equal(new, slope) and np.allclose(again, limit, rtol=1e-9, atol=0.0):
            break
    return current


def _compliance(step: Step, space: PointSpace) -> tuple[Array, Array]:
    """Compliance W of the rows that are not tied, and their displacements without contact forces."""
    S, q = space.S, len(space.S)
    z, held = np.zeros(q), np.zeros(q, dtype=bool)
    for rows, value in (
        (space.normal_rows, -step.load.gap0),
        (space.tangential_rows[:, 0], (step.last.slip - step.load.slip0)[:, 0]),
    ):
        on = step.tied & (rows >= 0)
        held[rows[on]], z[rows[on]] = True, value[on]
    free = np.flatnonzero(~held)
    A = np.array(S[np.ix_(free, free)])
    if step.motions.k:
        A[np.diag_indices(len(A))] += WEAK * np.abs(np.diag(A))
    factor = cho_factor(A, lower=True, check_finite=False)
    W = np.zeros((q, q))
    W[np.ix_(free, free)] = cho_solve(factor, np.eye(len(free)), check_finite=False)
    z[free] = cho_solve(factor, (step.load.force - S @ z)[free], check_finite=False)
    return 0.5 * (W + W.T), z


def _problem(
    step: Step,
    space: PointSpace,
    W: Array,
    free: Array,
    point: Index,
    rub: Index,
    size: Array,
    slope: Array,
    limit: Array,
) -> tuple[Array, Array]:
    """Matrix and vector of the complementarity problem.

    Lengths are divided, and forces multiplied, by the `size` of a point's own compliance, so that
    the diagonal is of order one for any units and any pair of bodies.
    """
    normal, tangential = space.normal_rows[point], space.tangential_rows[rub, 0]
    place = np.searchsorted(point, rub)
    along = size[place]
    G = step.stiffness[rub]
    soft = np.where(np.isfinite(G), 1.0 / G, 0.0)
    W_nn = W[np.ix_(normal, normal)] / np.outer(size, size)
    W_nt = W[np.ix_(normal, tangential)] / np.outer(size, along)
    W_tt = (W[np.ix_(tangential, tangential)] + np.diag(soft)) / np.outer(along, along)
    gap = (step.load.gap0[point] + free[normal]) / size
    slip = step.load.slip0[rub, 0] + free[tangential] - step.last.slip[rub, 0]
    slip = (slip + soft * step.last.tangential_force[rub, 0]) / along

    one = np.eye(len(rub))
    bound = np.zeros((len(rub), len(point)))
    bound[np.arange(len(rub)), place] = slope
    zero = np.zeros((len(point), len(rub)))
    M = np.block(
        [
            [W_nn, -W_nt, W_nt, zero],
            [-W_nt.T, W_tt, -W_tt, one],
            [W_nt.T, -W_tt, W_tt, one],
            [bound, -one, -one, 0.0 * one],
        ]
    )
    return M, np.concatenate([gap, -slip, slip, limit * along])


def _as_guess(z: Array, current: Guess, point: Index, rub: Index, size: Array) -> Guess:
    a, b = len(point), len(rub)
    m = len(current.status)
    normal_force, tau, slips = np.zeros(m), np.zeros(m), np.zeros(m, dtype=bool)
    normal_force[point] = z[:a] / size
    along = size[np.searchsorted(point, rub)]
    tau[rub] = (z[a : a + b] - z[a + b : a + 2 * b]) / along
    slips[rub] = z[a + 2 * b :] > 0
    status = np.where(current.status != OPEN, STICK, OPEN)  # as it was where nothing is unknown
    status[point] = np.where(z[:a] > 0, STICK, OPEN)
    slips &= (status == STICK) & (tau != 0)
    return replace(
        current,
        status=np.where(slips, SLIP, status),
        direction=np.where(slips, np.sign(tau), 0.0)[:, None],
        normal_force=normal_force,
        tangential_force=tau[:, None],
    )


def lemke(M: Array, q: Array) -> Array | None:
    """Solve ``w = M z + q, w >= 0, z >= 0, w'z = 0`` by Lemke's complementary pivoting.

    Ties are broken lexicographically, so that no basis comes back. The scale of `q` is that of the
    solution; entries of `M` are of order one.

    Parameters
    ----------
    M : ndarray, shape (k, k)
    q : ndarray, shape (k,)

    Returns
    -------
    ndarray, shape (k,), or None
        None if the method ends on a ray; for a copositive `M` that says, up to special cases, that
        there is no solution.

    References
    ----------
    R. W. Cottle, J.-S. Pang, R. E. Stone, The Linear Complementarity Problem, 1992, ch. 4.4.

    Examples
    --------
    >>> lemke(np.array([[2.0, 1.0], [1.0, 2.0]]), np.array([-5.0, -6.0])).round(12)
    array([1.33333333, 2.33333333])
    """
    k = len(q)
    scale = np.max(np.abs(q), initial=0.0)
    if k == 0 or q.min() >= 0:
        return np.zeros(k)
    cover = 2 * k  # columns: w, z, the covering variable, right-hand side
    T = np.concatenate([np.eye(k), -M, -np.ones((k, 1)), q[:, None]], axis=1)
    basis = np.arange(k)
    row, enter = int(np.argmin(q)), cover
    for _ in range(MOST_PIVOTS * k):
        leave = int(basis[row])
        _pivot(T, row, enter)
        basis[row] = enter
        if leave == cover:
            break
        enter = leave + k if leave < k else leave - k
        column = T[:, enter]
        may = np.flatnonzero(column > NO_PIVOT * np.max(np.abs(column)))
        if len(may) == 0:
            if T[basis == cover, -1].max() > ROUND_OFF * scale:
                return None
            break  # a ray along which the covering variable is zero: a degenerate solution
        row = _ratio_test(T, basis, enter, may, cover, scale)
    else:
        return None
    z = np.zeros(2 * k + 1)
    z[basis] = T[:, -1]
    return np.maximum(z[k : 2 * k], 0.0)


# Pivots per row before Lemke's method is given up; on frictional contact it takes one or two.
MOST_PIVOTS = 20
# Entry of a column that is no pivot, over its largest one; a value that is zero, over the largest
# entry of q. Some digits above the round-off of a few hundred updates.
NO_PIVOT, ROUND_OFF = 1e-11, 1e-11


def _pivot(T: Array, row: int, column: int) -> None:
    pivot_row = T[row] / T[row, column]
    rows = np.flatnonzero(T[:, column])
    T[rows] -= T[rows, column][:, None] * pivot_row
    T[row] = pivot_row


def _ratio_test(
    T: Array, basis: Index, enter: int, may: Index, cover: int, scale: float
) -> int:
    """The row that leaves the basis: the first to reach zero, the covering variable if it may."""
    ratio = np.maximum(T[may, -1], 0.0) / T[may, enter]
    least = ratio.min()
    covering = may[(basis[may] == cover) & (ratio <= least * (1 + 1e-9) + ROUND_OFF * scale)]
    if len(covering):
        return int(covering[0])
    tie = may[ratio <= least + 1e-2 * ROUND_OFF * scale]
    if len(tie) > 1:
        signs = T[tie, : len(basis)] / T[tie, enter][:, None]
        tie = tie[np.lexsort(signs.T[::-1])]
    return int(tie[0])
