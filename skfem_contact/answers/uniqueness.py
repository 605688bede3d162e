r"""Other answers to a load: critical friction of points, index of an answer, and a proof.

With the stiffness S of gaps and slips (`problem.points`) a load step is an equation made of pieces. In
2-D these are linear: the patterns of open, sticking and slipping points, with the rows of S of open
points, and for slipping points ``S_t + mu d S_n`` (`d` = 1 or -1, the direction of friction).

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

In 3-D pieces are not linear, as the direction of friction turns with the slip s: it adds a spring
``mu lambda / |s| (1 - d d')`` to the rows. Degree and indices are what they were, and so are both
consequences, with the least coefficient for which any direction and any such spring makes the
determinant of one point negative: `critical_friction`.

That there is exactly *one* answer to every load is shown by energy, in both dimensions and up to a
coefficient that falls with the number of points across the contact: `unique_up_to`.

**The proof.** Let two answers to one load differ by gaps and slips ``z = (g, s)`` and by forces ``S z =
(a, q)``, `a` the normal ones. Where one of the two is open, or both are closed, ``a_i g_i <= 0`` at
every point. For Coulomb's law, however the slips have come about, ``q_i . s_i <= mu_i |a_i| |s_i|``:
each friction force does at least as much work on its own slip as any other within its bound, and the
bounds differ by ``mu_i |a_i|``. So for any number ``c >= 0``, and any positive ``d_i`` with ``|a| |s|
<= (d a^2 + s^2 / d) / 2``,

    ``z' S z + c a . g  <=  sum_i mu_i / 2 (d_i a_i^2 + s_i^2 / d_i)``.

With ``W = S^-1``, ``K = W_tt^-1`` and ``N = W_nn - W_nt K W_tn`` the left-hand side is
``(1 + c) a' N a + c a' W_nt K s + s' K s``. Where this form is larger than the right-hand side for all
`a` and `s` but zero, there is no second answer. For one point in 2-D the best `c` and `d` make this the
exact condition ``mu < k_tt / |k_tn|``. For many points it is only sufficient, and the coefficient up to
which it holds falls with the root of the number of points across the contact. Where gaps and slips are
not coupled, as between flat bodies that mirror each other, any coefficient will do as `c` grows.

A finite tangential stiffness G is a compliance ``1 / G`` more in ``W_tt``: `s` is then what slips.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import product

import numpy as np
from scipy.linalg import LinAlgError
from scipy.sparse.linalg import ArpackNoConvergence, LinearOperator, eigsh

from skfem_contact.answers.answer import Answer
from skfem_contact.arrays import Array, Index, Mask, lengths, unit_vectors
from skfem_contact.conditions.contact import Contact
from skfem_contact.conditions.friction import Coulomb, Tresca
from skfem_contact.conditions.orthotropic import OrthotropicCoulomb
from skfem_contact.conditions.state import OPEN, SLIP
from skfem_contact.digits import COMPUTED, GIVEN, SOLVED
from skfem_contact.linalg.dense_factors import DenseFactors, cholesky, lu
from skfem_contact.problem.points import PointSpace
from skfem_contact.problem.zone import LOOSE
from skfem_contact.records import dataclass

#: Directions of friction in half a turn that are tried in 3-D: the least coefficient to four digits.
#: More take time alone.
DIRECTIONS = 720

#: What is shown of one answer is shown for this much less than eigenvalues say, so that their own error
#: and round-off of the matrices do not count. Eigenvalues of more than so few rows are iterated.
SHOWN, FEW = 1e-3, 100

#: Shares of the normal compliance that are tried for the proof: each is as valid, one is the best.
SHARES = (0.0, 0.5, 2.0, 8.0, 32.0, 1024.0)


@dataclass(frozen=True, eq=False)
class Uniqueness:
    """The knowledge about other answers to the load of a result.

    All of it is about this load step: from the state before it, on the pairing of the result.

    Attributes
    ----------
    critical_friction : ndarray, shape (m,)
        Coefficient of friction from which on this point alone gives loads with several answers, the
        other points open or stuck as in this answer; ``inf`` if no coefficient does, NaN at points
        without friction or partner. Over all contacts: ``len(values.points)`` for each of the result.
    friction : ndarray, shape (m,)
        Coefficient of the friction law in this answer, ``dL / d lambda``; NaN at the same points. Of
        `OrthotropicCoulomb` both are the larger one of two whose ratio stays.
    index : int
        Sign of the determinant of this answer's linear problem. If it is -1, and supports hold all
        bodies, this very load has at least two other answers. 0 where nothing follows from it: with
        wear, with a user's own law, where a bound is not zero on points that open (Tresca, cohesion),
        and at the critical friction itself, where the determinant is round-off.
    held : bool
        Whether they do.
    unique_up_to : float
        *Every* load has exactly one answer while no coefficient of friction is more than this many
        times what it is here. That is shown, not measured: beyond it nothing is known, and 0 is where
        nothing is known at all: with bodies that supports do not hold, with wear, laws of one's own,
        and bounds that are not zero on points that open.

    Examples
    --------
    >>> known = Uniqueness(np.array([1.5, np.inf]), np.array([2.0, 2.0]), 1, True, 0.5)
    >>> known.may_be_several
    array([ True, False])
    >>> known.only_one
    False
    """

    critical_friction: Array
    friction: Array
    index: int
    held: bool
    unique_up_to: float = 0.0

    @property
    def may_be_several(self) -> Mask:
        """Points whose friction is above the critical one, shape (m,)."""
        with np.errstate(invalid="ignore"):
            return np.asarray(self.friction > self.critical_friction)

    @property
    def only_one(self) -> bool:
        """Return whether it is shown that this load has no other answer; False is not known."""
        return self.unique_up_to >= 1.0


def uniqueness(result: Answer) -> Uniqueness | None:
    """Return what is known about other answers to the load of a result.

    Parameters
    ----------
    result : Answer

    Returns
    -------
    Uniqueness or None
        None where it is not computed: on the sparse route, with contact rows that depend on each
        other, and where the answer leaves a motion free.
    """
    found = result.recover.space(result.kin)
    if found is None:
        return None
    space, held = found
    friction, G = coefficients(result), result.tangential_stiffness
    able = (space.normal_rows >= 0) & (space.tangential_rows >= 0).any(axis=1)
    friction = np.where(able, friction, np.nan)
    status, resisting = result.state.status, result.local.tangential_force
    steepest = np.where(able, steepest_bounds(result), 0.0)
    one = not np.isnan(steepest).any()
    try:
        critical = critical_friction(space, status, friction, G)
        springs = turning_springs(resisting, result.plastic_slip, G, space)
        index = orientation(space, status, resisting, friction, G, springs) if one else 0
    except LinAlgError:
        return None
    at_most = unique_up_to(space, steepest, G, result.kin.tied) if one and held else 0.0
    return Uniqueness(critical, friction, index, held, at_most)


def coefficients(result: Answer) -> Array:
    """Slope of the friction law at every point in this answer; NaN without law or partner, (m,)."""
    state, kin = result.local, result.kin
    out = np.full(kin.m, np.nan)
    slip = state.slip - state.reference
    for _, part, _, law in result.frictional():
        force = np.maximum(state.normal_force[part], 0.0)
        out[part] = law.slope(force, kin.area[part], slip[part])
    out = np.where(kin.bilateral & (state.normal_force < 0), 0.0 * out, out)  # tension changes no bound
    return np.where(kin.paired, out, np.nan)


def steepest_bounds(result: Answer) -> Array:
    """By how much a bound changes at most with the normal force, whatever that is, shape (m,).

    NaN where it may jump, or depend on more than the normal force. An open point has no friction: a
    bound that is not zero without pressure jumps there.
    """
    out = np.zeros(result.kin.m)
    for contact, part in zip(result.contacts, result.slices(), strict=True):
        if contact.friction is not None:
            out[part] = _steepest(contact)
    return out


def _steepest(contact: Contact) -> Array | float:
    law = contact.friction
    if contact.wear is not None:
        return np.nan
    if type(law) is Tresca and contact.bilateral:
        return 0.0
    if type(law) is Coulomb and (contact.bilateral or not np.any(law.cohesion)):
        return law.mu
    if type(law) is OrthotropicCoulomb and (contact.bilateral or not np.any(law.cohesion)):
        return law.larger
    return np.nan


def unique_up_to(space: PointSpace, friction: Array, G: Array, tied: Mask) -> float:
    """Factor on all coefficients of friction up to which every load has exactly one answer.

    Parameters
    ----------
    space : PointSpace
        Of bodies that supports hold.
    friction : ndarray, shape (m,)
        The most by which a bound changes with the normal force; 0 without friction.
    G : ndarray, shape (m,)
        Tangential stiffness of sticking points, ``inf`` for exact sticking.
    tied : ndarray of bool, shape (m,)
        Points that neither open nor slip.

    Returns
    -------
    float
        Shown, not the largest there is; ``inf`` without friction, 0 where nothing is shown.

    Examples
    --------
    One point, whose critical coefficient is ``k_tt / |k_tn|`` = 3:

    >>> space = PointSpace(np.array([[2.0, 1.0], [1.0, 3.0]]), np.array([0]), np.array([[1]]))
    >>> found = unique_up_to(space, np.array([0.5]), np.full(1, np.inf), np.zeros(1, dtype=bool))
    >>> 5.6 < found < 6.0
    True
    """
    normal = np.where(tied, -1, space.normal_rows)
    tangential = np.where(tied[:, None], -1, space.tangential_rows)
    rubs = (friction > 0) & (normal >= 0) & (tangential >= 0).any(axis=1)
    if not rubs.any():
        return np.inf
    point, _ = np.nonzero(tangential >= 0)
    n, t = normal[normal >= 0], tangential[tangential >= 0]
    try:
        form = Form(space, n, t, G[point])
        # what holds for more friction holds for less, whose squares are no numbers any more
        least = np.sqrt(np.finfo(float).tiny)  # its square is a number yet
        mu = np.where(rubs, np.maximum(friction, least), 0.0)
        d = _ratios(form, np.flatnonzero(normal >= 0), point, len(normal))
        balance = form.balance((mu * d)[normal >= 0], (mu / d)[point])
    except (LinAlgError, ArpackNoConvergence):
        return 0.0
    best: list[tuple[float, Array, float]] = []
    for share in SHARES:
        best.append((*form.estimate(share, balance), share))
        if len(best) > 1 and best[-1][0] < best[-2][0]:
            break  # it rises and falls with the share
    factor, diagonal, share = max(best, key=lambda found: found[0])
    return factor if factor > 0 and form.exceeds(share, factor * diagonal) else 0.0


def _ratios(form: Form, presses: Index, slips: Index, m: int) -> Array:
    """A weight for each point: the ratio of its slip to its force as far as it alone has them, (m,)."""
    soft, stiff = np.ones(m), np.full(m, np.inf)
    soft[presses] = np.diag(form.N)
    np.minimum.at(stiff, slips, np.diag(form.K))
    return np.where(np.isfinite(stiff), np.sqrt(soft / stiff), 1.0)


class Form:
    """The quadratic form of forces `a` and slips `s`.

    Parameters
    ----------
    space : PointSpace
    n, t : ndarray of int
        Rows of gaps and of slips.
    G : ndarray, shape (len(t),)

    Raises
    ------
    LinAlgError
        If it is not positive definite.
    """

    def __init__(self, space: PointSpace, n: Index, t: Index, G: Array) -> None:
        rows = np.concatenate([n, t])
        factors = cholesky(space.S[np.ix_(rows, rows)], overwrite=True)
        if not factors.even(LOOSE):
            raise LinAlgError("nothing but contact holds the bodies")
        W, k = factors.inverse(), len(n)
        self.W_nt, self.W_tt = np.ascontiguousarray(W[:k, k:]), W[k:, k:] + np.diag(1.0 / G)
        self.K = cholesky(self.W_tt).inverse()
        self.X = self.W_nt @ self.K
        #: What slips take from the compliance of the gaps
        self.taken = self.X @ self.W_nt.T
        self.N = W[:k, :k] - self.taken
        self.N = 0.5 * (self.N + self.N.T)

    def _matrix(self, share: float) -> Array:
        """The form in forces and slips."""
        X = 0.5 * share * self.X
        return np.block([[(1 + share) * self.N, X], [X.T, self.K]])

    def _solve(self, share: float) -> Callable[[Array], Array]:
        """By the inverse of the form: slips are eliminated, of which the stiffness K is ``W_tt^-1``."""
        half, k = 0.5 * share, len(self.N)
        forces = cholesky((1 + share) * self.N - half**2 * self.taken, overwrite=True)

        def solve(b: Array) -> Array:
            slips = self.W_tt @ b[k:]
            if not half:
                return np.concatenate([forces.solve(b[:k]), slips])
            a = forces.solve(b[:k] - half * (self.W_nt @ b[k:]))
            return np.concatenate([a, slips - half * (self.W_nt.T @ a)])

        return solve

    def balance(self, of_forces: Array, of_slips: Array) -> Array:
        """Half the diagonal matrix, its parts weighted so that both take as much of the form."""
        of_a = _largest(cholesky(self.N).solve, of_forces)
        of_s = _largest(self.W_tt.__matmul__, of_slips)
        c = np.sqrt(of_s / of_a)
        return 0.5 * np.concatenate([c * of_forces, of_slips / c])

    def estimate(self, share: float, balance: Array) -> tuple[float, Array]:
        """Up to which multiple of a diagonal matrix the form should be the larger one, and that matrix.

        Zero where the form itself is not positive definite.
        """
        grown = np.sqrt(1.0 + share)  # forces have so much more of the form
        forces = np.arange(len(balance)) < len(self.N)
        diagonal = balance * np.where(forces, grown, 1.0 / grown)
        try:
            return (1.0 - SHOWN) / _largest(self._solve(share), diagonal), diagonal
        except (LinAlgError, ArpackNoConvergence):
            return 0.0, diagonal

    def exceeds(self, share: float, diagonal: Array) -> bool:
        """Return whether the form is larger than a diagonal one: shown by a factorisation that ends."""
        M = self._matrix(share)
        scale = np.sqrt(np.diag(M))
        M[np.diag_indices_from(M)] -= diagonal
        M /= scale
        M /= scale[:, None]
        # it is that of a matrix not farther away than its round-off
        M[np.diag_indices_from(M)] -= 10 * len(M) * np.finfo(float).eps
        try:
            cholesky(M, overwrite=True)
        except LinAlgError:
            return False
        return True


def _largest(solve: Callable[[Array], Array], diagonal: Array) -> float:
    """Largest eigenvalue of ``D M^-1``, D a diagonal matrix without negative entries."""
    on = np.flatnonzero(diagonal)
    root = np.sqrt(diagonal[on])

    def product(x: Array) -> Array:
        full = np.zeros((len(diagonal), *x.shape[1:]))
        full[on] = (root * x.T).T
        return np.asarray((root * solve(full)[on].T).T)

    if len(on) <= FEW:
        return float(np.linalg.eigvalsh(product(np.eye(len(on))))[-1])
    A = LinearOperator((len(on), len(on)), matvec=product, dtype=float)
    found = eigsh(A, 1, v0=root, tol=SHOWN / 10, return_eigenvectors=False)
    return float(found[0])


# -- pieces of the equation ---------------------------------------------------------------------------


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
    exists = space.tangential_rows >= 0
    able = np.isfinite(friction) & (space.normal_rows >= 0) & exists.any(axis=1)  # gap and slip change
    soft = (status != OPEN) & able & np.isfinite(G)
    free, A = _unheld(space, status == OPEN, soft, _isotropic(space, G))
    W = _factors(A).inverse()
    out, closed = np.where(able, np.inf, np.nan), status != OPEN
    for has in product((True, False), repeat=exists.shape[1]):
        mine = able & (exists == np.array(has)).all(axis=1)
        kinds = {(True, True): ~closed, (False, True): soft, (False, False): closed & ~soft}
        for is_free, some in kinds.items():
            chosen = np.flatnonzero(mine & some)
            if len(chosen):
                rows = space.normal_rows[chosen], space.tangential_rows[chosen][:, has]
                out[chosen] = _least(*_met(space.S, free, W, *rows, is_free, G[chosen]))
    return out


def orientation(
    space: PointSpace, status: Index, tangential_force: Array, friction: Array, G: Array, springs: Array
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
    push = friction[:, None] * unit_vectors(tangential_force)
    coupled = slips & (friction > 0) & (space.normal_rows >= 0)
    for k in range(t.shape[1]):
        on = coupled & (t[:, k] >= 0)
        rows = space.S[np.ix_(space.normal_rows[on], free)]
        J[np.searchsorted(free, t[on, k])] += push[on, k, None] * rows
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
    force, moved, d = lengths(tangential_force), lengths(slip), unit_vectors(tangential_force)
    across = np.eye(t) - d[:, :, None] * d[:, None, :]
    gives = np.divide(moved, force, out=np.full(m, np.inf), where=force > 0) + 1.0 / G
    least = SOLVED / np.max(np.diag(space.S))  # a spring as stiff as that is as good as sticking
    c = 1.0 / np.maximum(gives, least)
    return np.asarray(c[:, None, None] * across)


def _met(
    S: Array, free: Index, W: Array, n: Index, t: Index, is_free: tuple[bool, bool], G: Array
) -> tuple[Array, Array, Array]:
    """Stiffness that points meet along their slips, and between these and the gap; and its scale.

    Of shapes (p, c, c), (p, c) and (p,), beside free rows of the compliance W. `is_free` says whether
    gaps are among these, and slips, which springs G then hold.
    """
    if is_free[0]:
        r = np.searchsorted(free, np.column_stack([n, t]))
        whole = np.linalg.inv(W[r[:, :, None], r[:, None]])
        K, k = whole[:, 1:, 1:], whole[:, 1:, 0]
        terms = K
    elif is_free[1]:
        r = np.searchsorted(free, t)
        terms = np.linalg.inv(W[r[:, :, None], r[:, None]])
        K = terms - G[:, None, None] * np.eye(t.shape[1])
        k = np.einsum("pij,pjf,fp->pi", terms, W[r], S[np.ix_(free, n)], optimize=True)
    else:
        terms, beside = S[t[:, :, None], t[:, None]], S[free][:, t]  # (free, p, c)
        follows = np.tensordot(W, beside, axes=1)
        K = terms - np.einsum("fpi,fpj->pij", beside, follows)
        k = S[t, n[:, None]] - np.einsum("fp,fpi->pi", S[np.ix_(free, n)], follows)
    return np.asarray(K, dtype=float), np.asarray(k, dtype=float), np.einsum("pii->p", terms)


def _least(K: Array, k: Array, scale: Array) -> Array:
    """The critical coefficient; infinite without coupling, or where nothing but this point holds."""
    held = np.linalg.eigvalsh(K)[:, 0] > SOLVED * scale
    clear = held & (np.linalg.norm(k, axis=1) > COMPUTED * scale)
    out, K, k = np.full(len(k), np.inf), K[clear], k[clear]
    out[clear] = 1.0 / np.linalg.norm(np.linalg.solve(K, k[..., None])[..., 0], axis=1)
    if k.shape[1] == 2:  # at any of many directions it is sufficient: the least of them, nearly
        angle = np.pi * np.arange(DIRECTIONS) / DIRECTIONS
        d = np.column_stack([np.cos(angle), np.sin(angle)])
        along = np.einsum("qi,pij,qj->pq", d, K, d, optimize=True)
        with np.errstate(divide="ignore"):  # along a direction across the coupling
            out[clear] = np.minimum(out[clear], np.min(along / np.abs(k @ d.T), axis=1))
    return out


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


# -- in words, by the laws alone ---------------------------------------------------------------------


def jump_lines(answer: Answer) -> list[str]:
    """Say what a report says of friction that is lost all at once where a point opens."""
    lines, slip = [], answer.local.slip - answer.local.reference
    for contact, part, name, law in answer.frictional():
        if contact.bilateral:
            continue
        at_opening = law.limit(np.zeros(len(slip[part])), answer.kin.area[part], slip[part])
        state, moved = answer.local, np.linalg.norm(answer.local.slip[part], axis=1)
        # coupling makes of friction a normal force, and of slip a gap, that are hardly larger
        light = state.normal_force[part] < np.linalg.norm(state.tangential_force[part], axis=1)
        light |= (state.status[part] == OPEN) & (answer.gap[part] < moved)
        if (at_opening[light & answer.kin.paired[part]] > 0).any():
            lines += [
                f"the friction of contact {name!r} does not begin at zero: a point may be closed by",
                "it, or open, and this load may have other answers; this is the one found from before",
            ]
    return lines


def fall_lines(answer: Answer) -> list[str]:
    """Say what a report says of friction that falls with the slip of points that slip."""
    lines = []
    for name in falling(answer, GIVEN):
        lines += [
            f"the friction of contact {name!r} falls with the slip: where it does so faster than",
            "the bodies give way a load has several answers; other steps or loops may find others",
        ]
    return lines


def falling(answer: Answer, share: float) -> list[str]:
    """Return the contacts whose friction falls over this share of the slip of points that slip.

    A share of -1 compares it with that without slip. Round-off of bounds is four digits below what
    counts, even over a share as small as that.
    """
    names, state = [], answer.local
    slip = state.slip - state.reference
    for _, part, name, law in answer.frictional():
        here = np.maximum(state.normal_force[part], 0.0), answer.kin.area[part]
        now = law.limit(*here, slip[part])
        rise = (law.limit(*here, (1 + share) * slip[part]) - now) / share
        if (rise < -GIVEN * now)[state.status[part] == SLIP].any():
            names.append(name)
    return names
