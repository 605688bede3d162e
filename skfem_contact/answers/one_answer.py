r"""A proof that a load step has one answer, whatever its load: by energy, in both dimensions.

Let two answers to one load differ by gaps and slips ``z = (g, s)`` and by forces ``S z = (a, q)``, `a`
the normal ones. Where one of the two is open, or both are closed, ``a_i g_i <= 0`` at every point. For
Coulomb's law, however the slips have come about, ``q_i . s_i <= mu_i |a_i| |s_i|``: each friction force
does at least as much work on its own slip as any other within its bound, and the bounds differ by
``mu_i |a_i|``. So for any number ``c >= 0``, and any positive ``d_i`` with
``|a| |s| <= (d a^2 + s^2 / d) / 2``,

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

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import LinAlgError
from scipy.sparse.linalg import ArpackNoConvergence, LinearOperator, eigsh

from skfem_contact.answers.thresholds import CLOSE, FEW, LEAST_FRICTION, SHARES, SHOWN
from skfem_contact.linalg.dense_factors import cholesky, divide
from skfem_contact.problem.points import PointSpace
from skfem_contact.problem.thresholds import LOOSE

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Mask = NDArray[np.bool_]


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
        mu = np.where(rubs, np.maximum(friction, LEAST_FRICTION), 0.0)
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
        """Whether the form is larger than a diagonal one: shown by a factorisation that ends."""
        M = self._matrix(share)
        scale = np.sqrt(np.diag(M))
        M[np.diag_indices_from(M)] -= diagonal
        divide(M, scale)
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
    found = eigsh(A, 1, v0=root, tol=CLOSE, return_eigenvectors=False)
    return float(found[0])
