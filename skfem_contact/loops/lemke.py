r"""Lemke's method: a way to the solution that can not cycle, for steps on which a loop fails.

In 2-D a load step of Coulomb friction is a linear complementarity problem in the contact forces. With
``W = S^-1``, ``tau = b+ - b-`` and the slip ``sigma >= 0`` of each point,

    0 <= lambda  _|_  g = q_n + W_nn lambda - W_nt (b+ - b-)                     >= 0
    0 <= b+      _|_  sigma - s,   0 <= b-  _|_  sigma + s,   s = q_t + ...       >= 0
    0 <= sigma   _|_  L(lambda) - b+ - b-                                        >= 0

its matrix is copositive for every coefficient of friction, so that complementary pivoting ends at a
solution (Klarbring and Pang, SIAM J. Optim. 8, 1998). The pivots work on a dense tableau and cost
far more than the Newton iterations they replace; the answer is used as starting values only, and
the loop itself has the last word.
"""

from __future__ import annotations

import numpy as np

from skfem_contact.arrays import Array, Index, Mask
from skfem_contact.conditions.state import OPEN, SLIP, STICK
from skfem_contact.digits import COMPUTED, NEWTON_STEPS, ROUND_OFF, SOLVED
from skfem_contact.loops.step import Guess, Step
from skfem_contact.problem.points import PointSpace
from skfem_contact.records import dataclass

# Springs that hold a free rigid motion, over the largest stiffness: weak enough to disturb nothing, or,
# where pivots drown in the round-off of that, less weak. The loop takes them away again.
WEAK_SPRINGS = (1e-9, 1e-6)


def lemke(M: Array, q: Array) -> Array | None:
    """Solve ``w = M z + q``, ``w >= 0``, ``z >= 0``, ``w'z = 0`` by complementary pivoting.

    Parameters
    ----------
    M : ndarray, shape (n, n)
    q : ndarray, shape (n,)

    Returns
    -------
    ndarray, shape (n,), or None
        None where the method ends on a ray: then no solution was found.

    References
    ----------
    Cottle, Pang, Stone, The Linear Complementarity Problem, 1992, section 4.4; ties are broken
    lexicographically, which excludes cycling.

    Examples
    --------
    >>> import numpy as np
    >>> lemke(np.array([[2.0, 1.0], [1.0, 2.0]]), np.array([-5.0, -6.0])).round(12)
    array([1.33333333, 2.33333333])
    """
    n = len(q)
    if n == 0 or q.min() >= 0:
        return np.zeros(n)
    # columns w, z, the artificial variable, right-hand side:  w - M z - z0 = q
    table = np.concatenate([np.eye(n), -M, -np.ones((n, 1)), q[:, None]], axis=1)
    basis = np.arange(n)
    row, enter, scale = int(np.argmin(q)), 2 * n, float(np.abs(q).max())
    for _ in range(50 * n):
        pivot = table[row] / table[row, enter]
        table -= np.outer(table[:, enter], pivot)
        table[row] = pivot
        leave, basis[row] = int(basis[row]), enter
        if leave == 2 * n:
            break
        enter = leave + n if leave < n else leave - n
        blocking = _blocking_row(table, basis, enter, n, scale)
        if blocking is None:  # a ray; with z0 = 0 up to round-off it is a solution all the same
            if table[np.flatnonzero(basis == 2 * n)[0], -1] > SOLVED * scale:
                return None
            break
        row = blocking
    else:
        return None
    z = np.zeros(2 * n + 1)
    z[basis] = table[:, -1]
    return z[n : 2 * n]


def _blocking_row(table: Array, basis: Index, enter: int, n: int, scale: float) -> int | None:
    column = table[:, enter]
    rows = np.flatnonzero(column > COMPUTED * max(1.0, np.abs(column).max()))
    if len(rows) == 0:
        return None
    ratio = np.maximum(table[rows, -1], 0.0) / column[rows]
    least = ratio.min() * (1 + SOLVED) + COMPUTED * scale
    artificial = rows[(basis[rows] == 2 * n) & (ratio <= least)]
    if len(artificial):
        return int(artificial[0])
    tied = rows[ratio <= ratio.min() + ROUND_OFF * scale]
    if len(tied) == 1:
        return int(tied[0])
    order = table[tied, :n] / table[tied, enter][:, None]
    return int(tied[np.lexsort(order.T[::-1])[0]])


@dataclass(frozen=True, eq=False)
class _Problem:
    """Compliances and free gaps and slips of the points that take part.

    Points that never open have no gap to find: friction on them has the bound of the last forces.
    """

    points: Index  # those that may touch
    friction: Index  # with friction
    pressed: Mask  # those of them that may open
    W_nn: Array
    W_nt: Array
    W_tt: Array
    q_n: Array
    q_t: Array


def lemke_guess(step: Step, current: Guess) -> Guess | None:
    """Starting values from the complementarity problem of a step; None where there are none.

    Parameters
    ----------
    step : Step
    current : Guess
        Where a law that is not linear in the normal force is linearised first.
    """
    space = step.problem.points
    if space is None or step.turns:
        return None
    # contact has gone elsewhere, or is glue or guides alone: nothing is to be decided
    if not (step.paired & ~step.bilateral | step.frictional).any():
        return None
    for weak in WEAK_SPRINGS if step.motions.k else WEAK_SPRINGS[:1]:
        guess = _sweeps(step, _problem(step, space, weak), current)
        if guess is not None:
            return guess
    return None


def _sweeps(step: Step, problem: _Problem, current: Guess) -> Guess | None:
    """Starting values, the law linearised about the last of them; None where it ends on a ray."""
    force = np.maximum(current.normal_force, 0.0)
    guess: Guess | None = None
    for _ in range(NEWTON_STEPS):
        slope = step.friction.slope(force, current.slip)[problem.friction]
        slope = np.where(problem.pressed, slope, 0.0)
        cohesion = (
            step.friction.bound(force, current.slip)[problem.friction] - slope * force[problem.friction]
        )
        z = _solve(problem, slope, cohesion)
        if z is None:
            return guess
        guess = _statuses(step, problem, z, current)
        found = step.friction.slope(guess.normal_force, current.slip)[problem.friction]
        if np.allclose(slope, np.where(problem.pressed, found, 0.0)):
            return guess
        force = guess.normal_force
    return guess


def _problem(step: Step, space: PointSpace, weak: float) -> _Problem:
    load, last = step.load, step.last
    slips = space.tangential_rows.shape[1] == 1
    t_rows = space.tangential_rows[:, 0] if slips else np.full(len(load.gap0), -1)
    z = np.zeros(len(space.S))
    closed = step.bilateral & (space.normal_rows >= 0)
    held = space.normal_rows[closed]
    z[held] = -load.gap0[closed]
    tied_t = step.tied[:, None] & (space.tangential_rows >= 0)
    z[space.tangential_rows[tied_t]] = (last.slip - load.slip0)[tied_t]
    held = np.concatenate([held, space.tangential_rows[tied_t]])
    free = np.setdiff1d(np.arange(len(space.S)), held)
    W = np.zeros_like(space.S)
    W[np.ix_(free, free)] = _compliance(space.S[np.ix_(free, free)], weak if step.motions.k else 0.0)
    at_rest = W @ (space.force(load) - space.S @ z) + z

    able = step.paired & ~step.bilateral & (space.normal_rows >= 0)
    order = np.argsort(step.rank)  # whichever order they were given in
    points = order[able[order]]
    rubs = step.frictional & (t_rows >= 0) & (able | step.bilateral)
    friction = order[rubs[order]]
    n, t = space.normal_rows[points], t_rows[friction]
    G = step.stiffness[friction]
    soft = np.where(np.isfinite(G), 1.0 / np.where(np.isfinite(G), G, 1.0), 0.0)
    q_t = np.zeros(0)
    if slips:
        elastic = soft * last.tangential_force[friction, 0]
        q_t = (load.slip0 - last.slip)[friction, 0] + at_rest[t] + elastic
    return _Problem(
        points,
        friction,
        able[friction],
        W[np.ix_(n, n)],
        W[np.ix_(n, t)],
        W[np.ix_(t, t)] + np.diag(soft),
        load.gap0[points] + at_rest[n],
        q_t,
    )


def _compliance(S: Array, weak: float) -> Array:
    """Inverse of S; where a rigid motion is free, with `weak` springs against it."""
    diagonal = np.abs(np.diag(S))
    largest = np.max(diagonal, initial=0.0) or 1.0
    # a point whose motion costs nothing, on a body that turns freely, is scaled like the others
    size = np.sqrt(np.where(diagonal > COMPUTED * largest, diagonal, largest))
    values, vectors = np.linalg.eigh(S / np.outer(size, size))
    # a body that moves freely as a whole has round-off of either sign alone; the unit is the scaled one
    most = np.max(values, initial=0.0) or 1.0
    values = np.maximum(values, max(weak, ROUND_OFF) * most)
    return (vectors / values) @ vectors.T / np.outer(size, size)


def _solve(problem: _Problem, slope: Array, cohesion: Array) -> Array | None:
    a, b = len(problem.points), len(problem.friction)
    soft = np.diag(problem.W_nn if a else problem.W_tt)
    k = 1.0 / np.mean(soft) if len(soft) else 1.0  # turns gaps and slips into forces
    P = np.zeros((b, a))
    place = np.full(np.max(problem.points, initial=-1) + 1, -1)
    place[problem.points] = np.arange(a)
    pressed = np.flatnonzero(problem.pressed)
    P[pressed, place[problem.friction[pressed]]] = slope[pressed]
    W_nt, W_tt = k * problem.W_nt, k * problem.W_tt
    one, none = np.eye(b), np.zeros((b, b))
    M = np.block(
        [
            [k * problem.W_nn, -W_nt, W_nt, np.zeros((a, b))],
            [-W_nt.T, W_tt, -W_tt, one],
            [W_nt.T, -W_tt, W_tt, one],
            [P, -one, -one, none],
        ]
    )
    return lemke(M, np.concatenate([k * problem.q_n, -k * problem.q_t, k * problem.q_t, cohesion]))


def _statuses(step: Step, problem: _Problem, z: Array, current: Guess) -> Guess:
    a, b = len(problem.points), len(problem.friction)
    normal_force, forward, backward, sigma = np.split(z, [a, a + b, a + 2 * b])
    friction = forward - backward
    m, t = current.direction.shape
    status = np.where(step.bilateral & step.paired, STICK, OPEN)
    status[problem.points] = np.where(normal_force > 0, STICK, OPEN)
    force = np.where(step.bilateral, current.normal_force, 0.0)
    tangential, direction = np.zeros((m, t)), np.zeros((m, t))
    force[problem.points] = normal_force
    if b:
        tangential[problem.friction, 0] = friction
        # a slipping point with a limit of zero has no direction: it is left to the loop
        slips = (
            slipping(forward, backward, sigma) & (status[problem.friction] != OPEN) & (friction != 0)
        )
        status[problem.friction[slips]] = SLIP
        direction[problem.friction[slips], 0] = np.sign(friction[slips])
    return Guess(status, direction, force, tangential, current.slip, pivoted=True)


def slipping(forward: Array, backward: Array, sigma: Array) -> Mask:
    """Find the points that slip, by both parts ``b+``, ``b-`` of their friction and their slip, (b,).

    Where both parts act the friction is below its bound, and the point sticks: its slip is zero. A
    solution has them to round-off, and the one that is nearer to zero, over what there is, is zero.
    What pivots have lost may be far below zero, and counts as zero.

    >>> forward, backward = np.array([1.0, 0.8, 1.0, 0.0]), np.array([0.0, 0.2, 1e-17, -20.0])
    >>> slipping(forward, backward, np.array([1e-9, 1e-25, 2e-9, 1e-9])).tolist()
    [True, False, True, True]
    """
    tiny = np.finfo(float).tiny
    least = np.maximum(np.minimum(forward, backward), 0.0)
    both = least / np.maximum(forward + backward, tiny)
    far = np.maximum(sigma, 0.0) / max(np.max(sigma, initial=0.0), tiny)
    return np.asarray((sigma > 0) & (both <= far))
