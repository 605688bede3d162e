"""Pieces of the equation of a load step: friction from which one is negative, and that of an answer.

What follows from them is at the top of the module `uniqueness`.
"""

from __future__ import annotations

from itertools import product

import numpy as np
from scipy.linalg import LinAlgError

from skfem_contact.answers.thresholds import DIRECTIONS
from skfem_contact.arrays import Array, Index, Mask
from skfem_contact.conditions.state import OPEN, SLIP
from skfem_contact.digits import COMPUTED, SOLVED
from skfem_contact.linalg.dense_factors import DenseFactors, cholesky, lu
from skfem_contact.problem.points import PointSpace
from skfem_contact.problem.thresholds import LOOSE
from skfem_contact.records import dataclass


def critical_friction(space: PointSpace, status: Index, friction: Array, G: Array) -> Array:
    """Least coefficient for which a point that slips makes a piece negative, the others open or stuck.

    It meets the stiffness k. In 2-D the coefficient is ``k_tt / |k_tn|``. In 3-D the direction d of
    friction is any, and so is the spring c across it; the determinant

        ``det(k_tt) (1 + mu d' k_tt^-1 k_tn) + c (d' k_tt d + mu d' k_tn)``

    is negative for some of them above ``min(1 / |k_tt^-1 k_tn|, d' k_tt d / |d' k_tn|)``.

    Parameters
    ----------
    space : PointSpace
    status : ndarray of int, shape (m,)
    friction : ndarray, shape (m,)
        NaN at points to leave out.
    G : ndarray, shape (m,)
        Tangential stiffness of sticking points, ``inf`` for exact sticking.

    Returns
    -------
    ndarray, shape (m,)

    Raises
    ------
    LinAlgError
        If the points that are closed do not hold the bodies.

    Examples
    --------
    One point on two springs that its gap and its slip share; and with a second slip beside it:

    >>> S = np.array([[2.0, 1.0, 0.0], [1.0, 3.0, 0.0], [0.0, 0.0, 1.0]])
    >>> status, mu, G = np.array([0]), np.ones(1), np.full(1, np.inf)
    >>> critical_friction(PointSpace(S[:2, :2], np.array([0]), np.array([[1]])), status, mu, G)
    array([3.])
    >>> critical_friction(PointSpace(S, np.array([0]), np.array([[1, 2]])), status, mu, G).round(3)
    array([2.828])
    """
    able, exists = _able(space, friction), space.tangential_rows >= 0
    soft = (status != OPEN) & able & np.isfinite(G)
    free, A = _unheld(space, status == OPEN, soft, _isotropic(space, G))
    place = np.full(len(space.S), -1)
    place[free] = np.arange(len(free))
    W = _factors(A).inverse()
    coupling = W @ space.S[free]  # of free rows to all others
    out = np.where(able, np.inf, np.nan)
    for has in product((True, False), repeat=exists.shape[1]):
        columns = np.flatnonzero(has)
        mine = able & (exists == np.array(has)).all(axis=1)
        for some, stiffness in (
            (status == OPEN, _open),
            (soft, _soft),
            ((status != OPEN) & ~soft, _stuck),
        ):
            chosen = np.flatnonzero(mine & some)
            if len(chosen):
                n, t = space.normal_rows[chosen], space.tangential_rows[chosen][:, columns]
                met = stiffness(Free(space.S, free, place, W, coupling), n, t, G[chosen])
                out[chosen] = _least(*met)
    return out


def orientation(
    space: PointSpace,
    status: Index,
    tangential_force: Array,
    friction: Array,
    G: Array,
    springs: Array,
) -> int:
    """Sign of the determinant of the linear problem that an answer solves: 1, -1, or 0 for round-off.

    Parameters
    ----------
    space : PointSpace
    status : ndarray of int, shape (m,)
    tangential_force : ndarray, shape (m, d-1)
        That resists a positive slip.
    friction : ndarray, shape (m,)
    G : ndarray, shape (m,)
    springs : ndarray, shape (m, d-1, d-1)
        Of points that slip, from `turning_springs`.
    """
    t = space.tangential_rows
    exists = np.isfinite(friction) & (t >= 0).any(axis=1)
    slips = (status == SLIP) & exists
    soft = (status != OPEN) & exists & ~slips & np.isfinite(G)
    held_by = np.where(slips[:, None, None], springs, _isotropic(space, G))
    free, J = _unheld(space, status == OPEN, soft | slips, held_by)
    _factors(J)  # what follows has a meaning only where the bodies are held
    size = np.sqrt(np.diag(J))
    length = np.linalg.norm(tangential_force, axis=1)
    coupled = slips & (friction > 0) & (space.normal_rows >= 0)
    for k in range(t.shape[1]):
        on = coupled & (t[:, k] >= 0)
        push = friction[on] * tangential_force[on, k] / np.where(length[on] > 0, length[on], 1.0)
        J[np.searchsorted(free, t[on, k])] += (
            push[:, None] * space.S[np.ix_(space.normal_rows[on], free)]
        )
    J /= size
    J /= size[:, None]
    try:
        factors = lu(J, overwrite=True)
    except LinAlgError:
        return 0
    # where pieces of opposite signs meet, round-off would tell of answers that there are not
    least = COMPUTED * np.max(factors.diagonal, initial=1.0)
    return factors.sign if np.all(factors.diagonal > least) else 0


def turning_springs(tangential_force: Array, slip: Array, G: Array, space: PointSpace) -> Array:
    """What resists a slip across friction, which turns with it: ``|tau| / |s| (1 - d d')``, (m, t, t).

    A tangential stiffness G is in series with it: friction turns with the trial force, which is longer
    than `tau` by G times the slip.

    Parameters
    ----------
    tangential_force, slip : ndarray, shape (m, d-1)
        The slip is what G does not give back.
    G : ndarray, shape (m,)
    space : PointSpace
    """
    m, t = tangential_force.shape
    if t == 1:
        return np.zeros((m, 1, 1))
    force, moved = np.linalg.norm(tangential_force, axis=1), np.linalg.norm(slip, axis=1)
    d = tangential_force / np.where(force > 0, force, 1.0)[:, None]
    across = np.eye(t) - d[:, :, None] * d[:, None, :]
    gives = np.divide(moved, force, out=np.full(m, np.inf), where=force > 0) + 1.0 / G
    least = SOLVED / np.max(np.diag(space.S))  # a spring as stiff as that is as good as sticking
    c = 1.0 / np.maximum(gives, least)
    return np.asarray(c[:, None, None] * across)


@dataclass(frozen=True, eq=False)
class Free:
    """The rows that are free: their numbers, places (-1: held), compliance W, and W S."""

    S: Array
    rows: Index
    place: Index
    W: Array
    coupling: Array


#: Stiffness that points meet, along their slips (p, c, c) and between them and the gap (p, c), the
#: second over the first (p, c), and what they are measured by (p,).
Met = tuple[Array, Array, Array, Array]


def _open(free: Free, n: Index, t: Index, _: Array) -> Met:
    i, j = free.place[n], free.place[t]
    W_nn, W_tn = free.W[i, i], free.W[j, i[:, None]]
    W_tt = free.W[j[:, :, None], j[:, None, :]]
    over = -W_tn / W_nn[:, None]
    K = np.linalg.inv(W_tt + over[:, :, None] * W_tn[:, None, :]).astype(float)
    k = np.einsum("pij,pj->pi", K, over)
    return K, k, over, np.reciprocal(np.einsum("pii->p", W_tt))


def _soft(free: Free, n: Index, t: Index, G: Array) -> Met:
    j = free.place[t]
    met = np.linalg.inv(free.W[j[:, :, None], j[:, None, :]]).astype(float)
    K = met - G[:, None, None] * np.eye(t.shape[1])
    k = np.einsum("pij,pj->pi", met, free.coupling[j, n[:, None]])
    return K, k, _over(K, k), np.einsum("pii->p", met)


def _stuck(free: Free, n: Index, t: Index, _: Array) -> Met:
    S = free.S
    K = S[t[:, :, None], t[:, None, :]]
    follows = free.coupling[:, t]  # (free, p, c)
    K = K - np.einsum("fpi,fpj->pij", S[free.rows][:, t], follows)
    k = S[t, n[:, None]] - np.einsum("fp,fpi->pi", S[np.ix_(free.rows, n)], follows)
    return K, k, _over(K, k), np.einsum("pii->p", S[t[:, :, None], t[:, None, :]])


def _over(K: Array, k: Array) -> Array:
    """``K^-1 k``; K is of points that something holds, or of no use."""
    good = np.linalg.eigvalsh(K)[:, 0] > 0
    return np.asarray(
        np.linalg.solve(np.where(good[:, None, None], K, np.eye(K.shape[1])), k[..., None])
    )[..., 0]


def _least(K: Array, k: Array, over: Array, scale: Array) -> Array:
    """The critical coefficient; infinite without coupling, or where nothing but this point holds."""
    held = np.linalg.eigvalsh(K)[:, 0] > SOLVED * scale
    clear = held & (np.linalg.norm(k, axis=1) > COMPUTED * scale)
    found = 1.0 / np.linalg.norm(over[clear], axis=1)
    if k.shape[1] == 2:  # at any of many directions it is sufficient: the least of them, nearly
        angle = np.pi * np.arange(DIRECTIONS) / DIRECTIONS
        d = np.column_stack([np.cos(angle), np.sin(angle)])
        along = np.einsum("qi,pij,qj->pq", d, K[clear], d, optimize=True)
        with np.errstate(divide="ignore"):  # along a direction across the coupling
            found = np.minimum(found, np.min(along / np.abs(k[clear] @ d.T), axis=1))
    out = np.full(len(k), np.inf)
    out[clear] = found
    return out


def _able(space: PointSpace, friction: Array) -> Mask:
    """Points with friction whose gap and slip can change."""
    slips = (space.tangential_rows >= 0).any(axis=1)
    return np.asarray(np.isfinite(friction) & (space.normal_rows >= 0) & slips)


def _isotropic(space: PointSpace, G: Array) -> Array:
    """The same stiffness along all tangents, (m, t, t); zero where it is infinite."""
    t = space.tangential_rows.shape[1]
    return np.where(np.isfinite(G), G, 0.0)[:, None, None] * np.eye(t)


def _unheld(space: PointSpace, opened: Mask, soft: Mask, springs: Array) -> tuple[Index, Array]:
    """Rows that are free, those of open points and of slips that a spring holds; their stiffness."""
    n, t = space.normal_rows, space.tangential_rows
    free = np.concatenate([n[opened], t[opened].ravel(), t[soft].ravel()])
    free = np.sort(free[free >= 0])
    A = space.S[np.ix_(free, free)]
    for j, k in product(range(t.shape[1]), repeat=2):
        on = soft & (t[:, j] >= 0) & (t[:, k] >= 0)
        A[np.searchsorted(free, t[on, j]), np.searchsorted(free, t[on, k])] += springs[on, j, k]
    return free, A


def _factors(A: Array) -> DenseFactors:
    """Cholesky factor of the stiffness that free rows meet; closed points have to hold them."""
    factors = cholesky(A)
    if not factors.even(LOOSE):
        raise LinAlgError("the closed points leave a motion free")
    return factors
