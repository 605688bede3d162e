r"""Whether a load may have other answers: critical friction of the points, and the index of an answer.

In 2-D a load step is a piecewise linear equation. Every pattern of open, sticking and slipping points
is a piece, whose matrix has, with the stiffness S of gaps and slips (`problem.points`), the rows
of open points, and for slipping points ``S_t + mu d S_n`` (`d` = 1 or -1, the direction of friction).

*Every load has exactly one answer if and only if the determinants of all 4^m pieces are positive*:
at most four pieces meet in a face of codimension two, and then pieces of one orientation suffice (Kuhn
and Löwen, 1987). Too many to try; but two consequences of it are cheap:

* If one piece is negative, loads inside it have several answers. With a single point slipping, the
  others open or stuck, its sign is that of ``k_tt - mu |k_tn|``, k the stiffness that this point meets.
  So ``mu > k_tt / |k_tn|`` at one point is *sufficient* for loads with several answers to exist, and
  for a problem with one point necessary too. With more points it is not: they can do it together.
* The signs of all answers to one load, their indices, add up to one if supports hold all bodies, since
  the degree of the map does not change on the way from ``mu = 0``. So an answer of index -1 is
  *sufficient* for at least two further answers to this very load.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import LinAlgError

from skfem_contact.answers.answer import Answer
from skfem_contact.answers.thresholds import NO_COUPLING, NOT_HELD
from skfem_contact.conditions.checked_law import CheckedLaw
from skfem_contact.conditions.state import OPEN, SLIP, LocalState
from skfem_contact.linalg.dense_factors import DenseFactors, cholesky
from skfem_contact.problem.points import PointSpace
from skfem_contact.problem.thresholds import LOOSE

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Uniqueness:
    """What is known about other answers to the load of a result.

    Attributes
    ----------
    critical_friction : ndarray, shape (m,)
        Coefficient of friction from which on this point alone gives loads with several answers, the
        other points open or stuck as in this answer; ``inf`` if no coefficient does, NaN at points
        without friction or partner. Over all contacts: ``len(values.points)`` for each of the result.
    friction : ndarray, shape (m,)
        Coefficient of the friction law in this answer, ``dL / d lambda``; NaN at the same points.
    index : int
        Sign of the determinant of this answer's linear problem. If it is -1, and supports hold all
        bodies, this very load has at least two other answers.
    held : bool
        Whether they do.

    Examples
    --------
    >>> known = Uniqueness(np.array([1.5, np.inf]), np.array([2.0, 2.0]), 1, True)
    >>> known.may_be_several
    array([ True, False])
    """

    critical_friction: Array
    friction: Array
    index: int
    held: bool

    @property
    def may_be_several(self) -> Mask:
        """Points whose friction is above the critical one, shape (m,)."""
        with np.errstate(invalid="ignore"):
            return np.asarray(self.friction > self.critical_friction)


def uniqueness(result: Answer) -> Uniqueness | None:
    """What is known about other answers to the load of a result.

    Parameters
    ----------
    result : Answer

    Returns
    -------
    Uniqueness or None
        None where it is not computed: on the sparse route, with contact rows that depend on each
        other, in 3-D, and where the answer leaves a motion free.
    """
    found = result.recover.space(result.kin) if result.kin.tangents == 1 else None
    if found is None:
        return None
    space, held = found
    friction, G = coefficients(result), result.tangential_stiffness
    friction = np.where(_able(space, friction), friction, np.nan)
    try:
        critical = critical_friction(space, result.state.status, friction, G)
        index = orientation(space, result.local, friction, G)
    except LinAlgError:
        return None
    return Uniqueness(critical, friction, index, held)


def coefficients(result: Answer) -> Array:
    """Slope of the friction law at every point in this answer; NaN without law or partner, (m,)."""
    state, kin = result.local, result.kin
    out = np.full(kin.m, np.nan)
    slip = state.slip - state.reference
    for contact, part, name in zip(result.contacts, result.slices(), result.names, strict=True):
        if contact.friction is not None:
            force = np.maximum(state.normal_force[part], 0.0)
            law = CheckedLaw(contact.friction, name, contact.secondary.points)
            out[part] = law.slope(force, kin.area[part], slip[part])
    out = np.where(kin.bilateral & (state.normal_force < 0), 0.0 * out, out)  # tension changes no bound
    return np.where(kin.paired, out, np.nan)


def critical_friction(space: PointSpace, status: NDArray[np.intp], friction: Array, G: Array) -> Array:
    """``k_tt / |k_tn|`` of the stiffness that each point meets, the others open or stuck, (m,).

    Parameters
    ----------
    space : PointSpace
    status : ndarray of int, shape (m,)
    friction : ndarray, shape (m,)
        NaN at points to leave out.
    G : ndarray, shape (m,)
        Tangential stiffness of sticking points, ``inf`` for exact sticking.

    Raises
    ------
    LinAlgError
        If the points that are closed do not hold the bodies.

    Examples
    --------
    One point on two springs that its gap and its slip share:

    >>> S = np.array([[2.0, 1.0], [1.0, 3.0]])
    >>> space = PointSpace(S, np.array([0]), np.array([[1]]))
    >>> critical_friction(space, np.array([0]), np.ones(1), np.full(1, np.inf))
    array([3.])
    """
    n, t = space.normal_rows, space.tangential_rows[:, 0]
    able = _able(space, friction)
    out = np.where(able, np.inf, np.nan)
    soft = (status != OPEN) & able & np.isfinite(G)
    free, A = _unheld(space, status == OPEN, soft, G)
    place = np.full(len(space.S), -1)
    place[free] = np.arange(len(free))
    W = _factors(A).inverse()
    coupling = W @ space.S[free]  # of free rows to all others

    opened = able & (status == OPEN)
    i, j = place[n[opened]], place[t[opened]]
    out[opened] = _ratio(W[i, i], W[i, j], W[i, i])
    i, j = n[soft], place[t[soft]]
    w = W[j, j]
    out[soft] = _ratio(1.0 / w - G[soft], coupling[j, i] / w, 1.0 / w)
    stuck = able & (status != OPEN) & ~soft
    i, j = n[stuck], t[stuck]
    S = space.S
    k_tt = S[j, j] - np.einsum("kj,kj->j", S[np.ix_(free, j)], coupling[:, j])
    k_tn = S[i, j] - np.einsum("kj,kj->j", S[np.ix_(free, i)], coupling[:, j])
    out[stuck] = _ratio(k_tt, k_tn, S[j, j])
    return out


def orientation(space: PointSpace, state: LocalState, friction: Array, G: Array) -> int:
    """Sign of the determinant of the linear problem that an answer solves: 1, -1, or 0.

    Parameters
    ----------
    space : PointSpace
    state : LocalState
    friction : ndarray, shape (m,)
    G : ndarray, shape (m,)
    """
    t = space.tangential_rows[:, 0]
    exists = np.isfinite(friction) & (t >= 0)
    slips = (state.status == SLIP) & exists
    soft = (state.status != OPEN) & exists & ~slips & np.isfinite(G)
    free, J = _unheld(space, state.status == OPEN, soft | slips, np.where(slips, 0.0, G))
    _factors(J)  # what follows has a meaning only where the bodies are held
    coupled = slips & (friction > 0) & (space.normal_rows >= 0)
    place = np.searchsorted(free, t[coupled])
    push = friction[coupled] * np.sign(state.tangential_force[coupled, 0])
    J[place] += push[:, None] * space.S[np.ix_(space.normal_rows[coupled], free)]
    size = np.sqrt(np.diag(space.S)[free])
    return int(np.linalg.slogdet(J / np.outer(size, size))[0])


def _able(space: PointSpace, friction: Array) -> Mask:
    """Points with friction whose gap and slip can change."""
    return np.isfinite(friction) & (space.normal_rows >= 0) & (space.tangential_rows[:, 0] >= 0)


def _unheld(space: PointSpace, opened: Mask, soft: Mask, G: Array) -> tuple[NDArray[np.intp], Array]:
    """Rows that are free, those of open points and of slips that a spring holds; their stiffness."""
    n, t = space.normal_rows, space.tangential_rows[:, 0]
    free = np.concatenate([n[opened], t[opened], t[soft]])
    free = np.sort(free[free >= 0])
    A = space.S[np.ix_(free, free)]
    springs = np.searchsorted(free, t[soft])
    A[springs, springs] += G[soft]
    return free, A


def _factors(A: Array) -> DenseFactors:
    """Cholesky factor of the stiffness that free rows meet; closed points have to hold them."""
    factors = cholesky(A)
    if not factors.even(LOOSE):
        raise LinAlgError("the closed points leave a motion free")
    return factors


def _ratio(k_tt: Array, k_tn: Array, scale: Array) -> Array:
    """``k_tt / |k_tn|``; infinite where there is no coupling, or nothing but this point holds."""
    clear = (np.abs(k_tn) > NO_COUPLING * scale) & (k_tt > NOT_HELD * scale)
    return np.where(clear, k_tt / np.where(clear, np.abs(k_tn), 1.0), np.inf)
