"""All solutions of a small 2-D contact problem with Coulomb friction, by trying every pattern.

Every point is open, sticks, or slips one way or the other: 4^m patterns, each a linear problem. With
a cap on the friction force a point slips on the cone or at the cap: 6^m patterns.
A pattern whose answer contradicts none of its own inequalities is a solution, and there are no
others. Nothing of the package is used: dense matrices, forces as unknowns.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np

OPEN, STICK, FORWARD, BACKWARD, CAPPED_FORWARD, CAPPED_BACKWARD = range(6)


@dataclass(frozen=True, eq=False)
class Problem:
    """One load step: ``K u = f + B_n' lam - B_t' tau`` with the state that friction starts from."""

    K: np.ndarray  # (n, n)
    f: np.ndarray  # (n,)
    D: np.ndarray  # prescribed DOFs
    x: np.ndarray  # (n,) their values
    B_n: np.ndarray  # (m, n)
    B_t: np.ndarray  # (m, n)
    gap0: np.ndarray  # (m,)
    mu: float
    G: float  # tangential stiffness of sticking points, inf: exact
    slip_before: np.ndarray  # (m,)
    tau_before: np.ndarray  # (m,)
    cohesion: np.ndarray | float = 0.0  # (m,) force that friction bears without pressure
    cap: np.ndarray | float = np.inf  # (m,) largest friction force, all finite or all infinite


@dataclass(frozen=True, eq=False)
class Solution:
    pattern: tuple[int, ...]
    u: np.ndarray
    gap: np.ndarray
    slip: np.ndarray
    lam: np.ndarray
    tau: np.ndarray
    margin: float  # distance to the nearest violated inequality, over the scale


def all_solutions(problem: Problem, tolerance: float = 1e-9) -> list[Solution]:
    """Every admissible pattern; patterns with the same answer (borderline cases) count once."""
    p, m, n = problem, len(problem.gap0), len(problem.f)
    free = np.setdiff1d(np.arange(n), p.D)
    K = p.K[np.ix_(free, free)]
    B = np.concatenate([p.B_n, -p.B_t])[:, free]
    # scaled by the diagonal: a body that is softer by many powers of ten is not a rigid motion
    size = 1.0 / np.sqrt(np.diag(K))
    values, vectors = np.linalg.eigh(K * np.outer(size, size))
    vectors = size[:, None] * vectors
    rigid = values < 1e-10 * values[-1]
    R = vectors[:, rigid]
    flexible = (vectors[:, ~rigid] / values[~rigid]) @ vectors[:, ~rigid].T
    load = p.f[free] - p.K[np.ix_(free, p.D)] @ p.x[p.D]
    # u = flexible (load + B' y) + R a with y = (lam, tau): gaps and slips as functions of (y, a)
    k = R.shape[1]
    sign = np.concatenate([np.ones(m), -np.ones(m)])[:, None]
    relative = sign * np.column_stack([B @ flexible @ B.T, B @ R])  # rows: gap, slip
    known = sign[:, 0] * (B @ (flexible @ load))
    known += np.concatenate([p.gap0 + p.B_n[:, p.D] @ p.x[p.D], p.B_t[:, p.D] @ p.x[p.D]])
    stiff = 1.0 / np.mean(np.abs(np.diag(relative[:, : 2 * m])))
    balance = np.column_stack([R.T @ B.T, np.zeros((k, k))])

    # the two equations of every point in each of its four states, all scaled to forces
    unit = np.eye(2 * m + k)
    lam, tau = unit[:m], unit[m : 2 * m]
    gap, slip = stiff * relative[:m], stiff * relative[m:]
    gap_rhs = -stiff * known[:m]
    slip_rhs = stiff * (p.slip_before - known[m:])
    if np.isfinite(p.G):
        soft = stiff / p.G
        slip, slip_rhs = slip - soft * tau, slip_rhs - soft * p.tau_before
    zero = np.zeros(m)
    cohesion, cap = zero + p.cohesion, zero + p.cap
    capped = bool(np.isfinite(cap).all())
    left = np.stack(
        [
            np.stack([lam, tau], 1),
            np.stack([gap, slip], 1),
            np.stack([gap, tau - p.mu * lam], 1),
            np.stack([gap, tau + p.mu * lam], 1),
        ]
        + 2 * capped * [np.stack([gap, tau], 1)],
        1,
    )  # point, state, equation, unknown
    right = np.stack(
        [np.stack([zero, zero], 1), np.stack([gap_rhs, slip_rhs], 1)]
        + [np.stack([gap_rhs, sign * cohesion], 1) for sign in (1, -1)]
        + capped * [np.stack([gap_rhs, sign * cap], 1) for sign in (1, -1)],
        1,
    )
    patterns = np.array(list(product(range(left.shape[1]), repeat=m)))
    pick = np.arange(m)
    A = left[pick, patterns].reshape(len(patterns), 2 * m, -1)
    A = np.concatenate([A, np.broadcast_to(balance, (len(A), *balance.shape))], 1)
    b = right[pick, patterns].reshape(len(patterns), 2 * m)
    b = np.concatenate([b, np.broadcast_to(-R.T @ load, (len(b), k))], 1)
    good = np.linalg.cond(A) < 1e12
    patterns, A, b = patterns[good], A[good], b[good]
    y = np.linalg.solve(A, b[:, :, None])[:, :, 0] if len(A) else np.zeros((0, 2 * m + k))

    lam, tau = y[:, :m], y[:, m : 2 * m]
    z = y @ relative.T + known
    gap, slip = z[:, :m], z[:, m:]
    plastic = slip - p.slip_before
    if np.isfinite(p.G):
        plastic = plastic - (tau - p.tau_before) / p.G
    opened, sticks = patterns == OPEN, patterns == STICK
    way = np.where(np.isin(patterns, (FORWARD, CAPPED_FORWARD)), 1.0, -1.0)
    cone = p.mu * lam + cohesion
    room = np.where(opened, stiff * gap, lam)  # all have to be >= 0, in units of force
    room2 = np.where(sticks, np.minimum(cone, cap) - np.abs(tau), way * stiff * plastic)
    if capped:
        over = np.where(patterns >= CAPPED_FORWARD, cone - cap, np.inf)
        under = np.where(np.isin(patterns, (FORWARD, BACKWARD)), cap - cone, np.inf)
        room2 = np.minimum(room2, np.minimum(over, under))
    room2 = np.where(opened, np.inf, room2)
    scale = np.max(np.abs(y[:, : 2 * m]), axis=1, initial=0.0) + stiff * np.max(np.abs(z), axis=1)
    scale = np.where(scale > np.finfo(float).tiny, scale, 1.0)  # denormal forces have no digits
    margin = np.minimum(room, room2).min(axis=1) / scale
    out: list[Solution] = []
    for i in np.flatnonzero(margin >= -tolerance):
        u = np.array(p.x, dtype=float)
        u[free] = flexible @ (load + B.T @ y[i, : 2 * m]) + R @ y[i, 2 * m :]
        new = Solution(tuple(patterns[i]), u, gap[i], slip[i], lam[i], tau[i], float(margin[i]))
        if not any(distance(new, old.u, old.lam, old.tau) < 1e-7 for old in out):
            out.append(new)
    return out


def piece_signs(problem: Problem) -> tuple[np.ndarray, np.ndarray]:
    """All 4^m patterns (without caps), and the sign of the determinant of each one's linear problem.

    With forces ``p = (lam, -tau)`` as unknowns and gaps and slips ``z = W p + ...``, an open point has
    the rows ``p``, a sticking one ``z``, a slipping one ``z_n`` and ``p_t +- mu p_n``:
    all signs are 1 without friction. Bodies have to be held.
    """
    p, m = problem, len(problem.gap0)
    free = np.setdiff1d(np.arange(len(p.f)), p.D)
    B = np.concatenate([p.B_n, p.B_t])[:, free]
    W = B @ np.linalg.solve(p.K[np.ix_(free, free)], B.T)
    unit = np.eye(2 * m)
    z_n, z_t, p_n, p_t = W[:m], W[m:] + unit[m:] / p.G, unit[:m], unit[m:]
    rows = [[p_n, p_t], [z_n, z_t], [z_n, p_t + p.mu * p_n], [z_n, p_t - p.mu * p_n]]
    left = np.stack([np.stack(pair, 1) for pair in rows], 1)  # point, state, equation, unknown
    patterns = np.array(list(product(range(4), repeat=m)))
    A = left[np.arange(m), patterns].swapaxes(1, 2).reshape(len(patterns), 2 * m, 2 * m)
    return patterns, np.linalg.slogdet(A)[0].astype(int)


def distance(
    solution: Solution,
    u: np.ndarray,
    lam: np.ndarray,
    tau: np.ndarray,
    least: tuple[float, float] = (0.0, 0.0),
) -> float:
    """Largest difference of displacements and of forces, each over its largest value, or the least."""
    force = max(np.abs(solution.lam).max(), np.abs(solution.tau).max(), np.abs(lam).max(), least[0])
    length = max(np.abs(solution.u).max(), least[1])
    off = max(np.abs(solution.lam - lam).max(), np.abs(solution.tau - tau).max())
    moved = np.abs(solution.u - u).max()
    return float(max(off / (force or 1.0), moved / (length or 1.0)))
