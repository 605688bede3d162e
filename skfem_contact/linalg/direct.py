"""Linear solvers behind one small interface (`backend`).

A backend is a frozen bag of settings; ``backend.factorize(A)`` returns a `Factorisation` that
owns everything computed from A and solves for as many right-hand sides as asked:

* `Direct`: multifrontal Cholesky, or SuperLU where that does not apply;
* `amg.AMG`: conjugate gradients, preconditioned by smoothed aggregation (pyamg);
* `FromSolver`: any solver ``x = solver(A, b)`` as ``skfem.solve`` takes it.

None of the direct solvers notices by itself that a matrix is singular: all return something.
Here the pivots are compared with the diagonal (or, where they are not to be had cheaply, the
smallest eigenvalue is estimated), and `SingularMatrix` says which DOF has no stiffness left.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from skfem_contact.bodies.member import Member
from skfem_contact.errors import InputError, LinearSolveError, SingularMatrix
from skfem_contact.linalg.backend import (
    Backend,
    BodyFactor,
    Factorisation,
    by_column,
    check_eigenvalue,
    singular,
)
from skfem_contact.linalg.fronts import LEAF, Pattern, dissection_order
from skfem_contact.linalg.multifrontal import MultifrontalCholesky
from skfem_contact.records import dataclass

# Residual over load up to which a solver of the user's own is trusted: conjugate gradients of
# skfem.utils leave some 1e-6 at their default tolerance.
ACCEPTED = 1e-4


@dataclass(frozen=True)
class Direct(Backend):
    """Sparse factorisation.

    Parameters
    ----------
    method : str
        ``"superlu"``, or ``"auto"``: the multifrontal method where a matrix is positive definite and
        points are known.

    Examples
    --------
    >>> import numpy as np
    >>> import scipy.sparse as sp
    >>> A = sp.csr_array([[2.0, -1.0], [-1.0, 2.0]])
    >>> factor = Direct().factorize(A, points=np.array([[0.0], [1.0]]))
    >>> factor.name, factor.solve(np.array([1.0, 1.0])).round(12).tolist()
    ('multifrontal Cholesky', [1.0, 1.0])
    """

    uses_modes = False

    method: str = "auto"

    def __post_init__(self) -> None:
        if not isinstance(self.method, str) or self.method not in ("auto", "superlu"):
            raise InputError(f"Direct(method={self.method!r}): known are 'auto' and 'superlu'.")

    def condensed(self, body: Member, K: Any, free: np.ndarray, keep: np.ndarray) -> BodyFactor:
        """Condense by the multifrontal method, whatever `method` is."""
        points = body.dof_points[free]
        pattern = _pattern(body, K, points, keep, free) if body.nonlinear else None
        return MultifrontalCholesky(K, points, keep, free=free, pattern=pattern)

    def _factorize(
        self, A: Any, points: np.ndarray | None, modes: np.ndarray | None, spd: bool
    ) -> Factorisation:
        if points is not None and spd and self.method != "superlu":
            factor = MultifrontalCholesky(A, points)
            return Factorisation("multifrontal Cholesky", factor.memory, factor.solve)
        return _superlu(sp.csc_matrix(A), points, spd)


@dataclass(frozen=True, eq=False)
class FromSolver(Backend):
    """Any ``x = solver(A, b)``, such as those of ``skfem.utils``; one call per right-hand side.

    Parameters
    ----------
    solver : callable
        Called with a csr_matrix and a vector. A residual above 1e-4 of the load is refused.

    Examples
    --------
    >>> import numpy as np
    >>> import scipy.sparse as sp
    >>> from skfem.utils import solver_direct_scipy
    >>> factor = FromSolver(solver_direct_scipy()).factorize(2.0 * sp.eye_array(3))
    >>> factor.solve(np.ones(3)).tolist()
    [0.5, 0.5, 0.5]
    """

    uses_modes = False

    solver: Callable[..., Any]

    def _factorize(
        self, A: Any, points: np.ndarray | None, modes: np.ndarray | None, spd: bool
    ) -> Factorisation:
        A = sp.csr_matrix(A)
        name = getattr(self.solver, "__name__", type(self.solver).__name__)

        def solve(b: np.ndarray) -> np.ndarray:
            try:
                x = np.asarray(self.solver(A, b), dtype=float)
            except InputError:
                raise
            except ValueError as error:
                raise LinearSolveError(
                    f"The linear solver {name!r} failed: {error}. Some solvers of skfem.utils keep "
                    "the preconditioner of the first matrix they saw, but every iteration has a "
                    "matrix of its own: pass lambda A, b: solver_iter_pcg(...)(A, b), which makes "
                    "a new one each time."
                ) from error
            if x.shape != b.shape or not np.all(np.isfinite(x)):
                what = "NaN or inf" if x.shape == b.shape else f"shape {x.shape} for {b.shape}"
                raise LinearSolveError(
                    f"The linear solver {name!r} returned {what}. Usually the matrix is singular, "
                    "as a rigid motion is left free. Try linear=Direct(), which says where."
                )
            residual = float(np.linalg.norm(b - A @ x))
            if residual > ACCEPTED * np.linalg.norm(b):
                kind = "symmetric" if spd else "unsymmetric (slipping points of the loop newton)"
                raise LinearSolveError(
                    f"The linear solver {name!r} leaves {residual / np.linalg.norm(b):.1e} of the "
                    f"load as residual; the matrix is {kind}. Try a smaller tolerance, "
                    "loop='direct', whose matrices are symmetric, or linear=Direct().",
                    residual / float(np.linalg.norm(b)),
                )
            return x

        return Factorisation(name, 0, by_column(solve))


def as_linear_solver(linear: Any) -> Backend:
    """A backend as it is, a callable as `FromSolver`; anything else is an `InputError`."""
    if isinstance(linear, Backend):
        return linear
    if callable(linear) and not isinstance(linear, type):
        return FromSolver(linear)
    raise InputError(
        f"linear={linear!r} is no linear solver: use Direct(), AMG(), PETSc() or a scikit-fem "
        "solver such as skfem.utils.solver_direct_scipy()."
    )


#: Of bodies that are factorised at every iterate: their tangents have entries in the same places.
_PATTERNS: WeakKeyDictionary[Member, tuple[tuple[np.ndarray, ...], Pattern]] = WeakKeyDictionary()


def _pattern(body: Member, K: Any, points: np.ndarray, keep: np.ndarray, free: np.ndarray) -> Pattern:
    """Return where the entries of a tangent go, found once for a body; parameters as of `condensed`."""
    given, known = (K.indptr, K.indices, keep, free), _PATTERNS.get(body)
    if known is None or not all(map(np.array_equal, known[0], given)):
        found = Pattern.of(K, points, keep, LEAF, free)
        known = _PATTERNS[body] = given, found._replace(places=list(found.places))
    return known[1]


def _superlu(A: Any, points: np.ndarray | None, spd: bool) -> Factorisation:
    """SuperLU with the order of elimination that suits: its default is up to 7 times slower."""
    order = np.arange(A.shape[0]) if points is None or not spd else dissection_order(A, points)
    settings: dict[str, Any] = {"permc_spec": "COLAMD"}
    if spd:
        settings = {
            "permc_spec": "MMD_AT_PLUS_A" if points is None else "NATURAL",
            "diag_pivot_thresh": 0.0,
        }
        settings["options"] = {"SymmetricMode": True, "Equil": False}
    try:
        factor = splu(A[order][:, order], **settings)
    except RuntimeError as error:  # "Factor is exactly singular"
        raise singular(-1, 0.0) from error

    def solve(b: np.ndarray) -> np.ndarray:
        x = np.empty_like(b)
        x[order] = factor.solve(b[order])
        return x

    # SuperLU hands out its pivots only with a copy of all factors: use the other criterion
    check_eigenvalue(abs(A).max(axis=1).toarray().ravel(), solve)
    return Factorisation("SuperLU", 12 * factor.nnz, solve)


class IndefiniteFactor(BodyFactor):
    """A symmetric stiffness that is not positive definite, all DOFs but some eliminated.

    The tangent of a body that softens or buckles, as Newton's method meets on its way: Cholesky's
    method has no factors of it, SuperLU has. See `backend.BodyFactor`.

    Parameters
    ----------
    K : csr_matrix, shape (n, n)
        Symmetric [force/length].
    points : ndarray, shape (n, d)
        Position of each DOF [length]; they guide the order of elimination.
    keep : ndarray of int, shape (n_c,)
        DOFs that are not eliminated.

    Raises
    ------
    SingularMatrix
        The stiffness of the others is singular.

    Examples
    --------
    A spring in series with one that pushes away, which together resist by -2:

    >>> K = sp.csr_matrix([[1.0, -1.0, 0.0], [-1.0, 1.0 - 2 / 3, 2 / 3], [0.0, 2 / 3, -2 / 3]])
    >>> IndefiniteFactor(K, np.arange(3.0)[:, None], np.array([0, 2])).S.round(12)
    array([[-2.,  2.],
           [ 2., -2.]])
    """

    def __init__(self, K: sp.csr_matrix, points: np.ndarray, keep: np.ndarray) -> None:
        interior = np.delete(np.arange(K.shape[0]), keep)
        A = sp.csr_matrix(K[interior][:, interior])
        interior = interior[dissection_order(A, points[interior])]
        self.keep, self.order = keep, np.concatenate([interior, keep])
        A, from_kept = sp.csc_matrix(K[interior][:, interior]), K[interior][:, keep].toarray()
        try:
            self._factor = splu(A, permc_spec="NATURAL", options={"SymmetricMode": True})
        except RuntimeError as error:  # "Factor is exactly singular"
            raise SingularMatrix(str(error)) from None
        self._follow = self._factor.solve(from_kept)
        S = K[keep][:, keep].toarray() - from_kept.T @ self._follow
        self.S = 0.5 * (S + S.T)

    @property
    def memory(self) -> int:
        """Bytes."""
        return int(12 * self._factor.nnz + self._follow.nbytes + self.S.nbytes)

    def eliminate(self, f: np.ndarray) -> np.ndarray:
        """Loads (n,) or (n, r) with the interior eliminated, (n, r), in the order `order`."""
        f = f.reshape(len(f), -1)[self.order]
        inside = len(self.order) - len(self.keep)
        out = np.empty_like(f)
        out[:inside] = self._factor.solve(f[:inside])
        out[inside:] = f[inside:] - self._follow.T @ f[:inside]
        return out

    def substitute(self, u_keep: np.ndarray, eliminated: np.ndarray) -> np.ndarray:
        """Displacements (n, r), in the order `order`; `eliminated` is overwritten."""
        inside = len(self.order) - len(self.keep)
        u_keep = u_keep.reshape(len(self.keep), eliminated.shape[1])
        eliminated[:inside] -= self._follow @ u_keep
        eliminated[inside:] = u_keep
        return eliminated
