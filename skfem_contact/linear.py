"""Linear solvers behind one small interface.

A solver is a frozen bag of settings; ``solver.factorize(A)`` returns an object that owns
everything computed from A and solves for as many right-hand sides as asked:

========================  =====================================================================
`Direct`                  multifrontal Cholesky, or SuperLU where that does not apply
`AMG`                     conjugate gradients, preconditioned by smoothed aggregation (pyamg)
`Dense`                   LAPACK, for the small systems on contact DOFs
`FromSolver`              any solver ``x = solver(A, b)`` as ``skfem.solve`` takes it
========================  =====================================================================

None of the direct solvers notices by itself that a matrix is singular: all return something.
Here the pivots are compared with the diagonal (or, where they are not to be had cheaply, the
smallest eigenvalue is estimated), and `SingularMatrix` says which DOF has no stiffness left.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Protocol

import numpy as np
import scipy.sparse as sp
from scipy.linalg import lapack
from scipy.sparse.linalg import splu

from skfem_contact.errors import ContactError, InputError
from skfem_contact.multifrontal import (
    LOST,
    NEGLIGIBLE,
    SUSPICIOUS,
    MultifrontalCholesky,
    NotPositiveDefinite,
    smallest_eigenvalue,
)
from skfem_contact.ordering import dissection_order


class SingularMatrix(ContactError):
    """A matrix is singular to working precision.

    Attributes
    ----------
    dof : int
        The DOF (row) at which it shows; -1 where unknown.
    ratio : float
        Stiffness left there divided by its diagonal entry.
    """

    def __init__(self, dof: int, ratio: float) -> None:
        where = f"at DOF {dof} {ratio:.1e}" if dof >= 0 else "somewhere nothing"
        super().__init__(
            f"The matrix is singular to working precision: {where} of the stiffness is left once "
            "the other DOFs are eliminated. Usually a rigid motion is left free by D, the "
            "contacts and the constraints together."
        )
        self.dof, self.ratio = int(dof), float(ratio)


class LinearSolveError(ContactError):
    """An iterative or foreign solver returned no solution.

    Attributes
    ----------
    residual : float
        ``|b - A x| / |b|`` of the best answer.
    iterations : int
        How many were made.
    """

    def __init__(self, message: str, residual: float = np.nan, iterations: int = 0) -> None:
        super().__init__(message)
        self.residual, self.iterations = float(residual), int(iterations)


class Factorisation(Protocol):
    """What `factorize` returns.

    Attributes
    ----------
    name : str
        The method, for reports.
    memory : int
        What it keeps [bytes]; 0 where unknown.
    """

    name: str
    memory: int

    def solve(self, b: np.ndarray) -> np.ndarray:
        """``A^-1 b`` for b of shape (n,) or (n, r)."""
        ...


class LinearSolver(Protocol):
    """Settings that can factorise."""

    def factorize(
        self,
        A: Any,
        *,
        points: np.ndarray | None = None,
        modes: np.ndarray | None = None,
        spd: bool = True,
    ) -> Factorisation:
        """Prepare to solve with `A`.

        Parameters
        ----------
        A : sparse matrix, shape (n, n)
        points : ndarray, shape (n, d), optional
            Position of each DOF [length]: guides the order of elimination.
        modes : ndarray, shape (n, k), optional
            Rigid motions of the bodies: what `AMG` must know.
        spd : bool
            Whether `A` is symmetric and positive definite.

        Raises
        ------
        SingularMatrix
            Where the method can tell.
        """
        ...


@dataclass(frozen=True)
class Solver:
    """A factorisation: a method's name, its memory [bytes] and its function to solve."""

    name: str
    memory: int
    function: Callable[[np.ndarray], np.ndarray]

    def solve(self, b: np.ndarray) -> np.ndarray:
        """``A^-1 b`` for b of shape (n,) or (n, r)."""
        return self.function(np.asarray(b, dtype=float))


@dataclass(frozen=True)
class Direct:
    """Sparse factorisation.

    Parameters
    ----------
    method : str
        ``"multifrontal"`` (positive definite, needs points), ``"superlu"``, or ``"auto"``: the
        first where it applies.

    Examples
    --------
    >>> import numpy as np
    >>> import scipy.sparse as sp
    >>> A = sp.csr_array([[2.0, -1.0], [-1.0, 2.0]])
    >>> factor = Direct().factorize(A, points=np.array([[0.0], [1.0]]))
    >>> factor.name, factor.solve(np.array([1.0, 1.0])).round(12).tolist()
    ('multifrontal Cholesky', [1.0, 1.0])
    """

    method: str = "auto"

    def __post_init__(self) -> None:
        if self.method not in ("auto", "multifrontal", "superlu"):
            raise InputError(
                f"Direct(method={self.method!r}): known are 'auto', 'multifrontal' and 'superlu'."
            )

    def factorize(
        self,
        A: Any,
        *,
        points: np.ndarray | None = None,
        modes: np.ndarray | None = None,
        spd: bool = True,
    ) -> Factorisation:
        """See `LinearSolver.factorize`; `modes` do not matter."""
        A = _square(A)
        if self.method == "multifrontal" and (points is None or not spd):
            raise InputError(
                "Direct(method='multifrontal') needs points and a positive definite matrix "
                f"(points {'missing' if points is None else 'given'}, spd={spd}): "
                "use Direct() or Direct(method='superlu')."
            )
        with single_threaded():
            if points is not None and spd and self.method != "superlu":
                return _multifrontal(A, points)
            return _superlu(A, points, spd)


@dataclass(frozen=True)
class AMG:
    """Conjugate gradients, preconditioned by smoothed aggregation with rigid motions.

    Parameters
    ----------
    tol : float
        Largest ``|b - A x| / |b|`` accepted.
    max_iterations : int
        More raise `LinearSolveError`. Well posed problems need 10 to 60.

    Notes
    -----
    Give *all* rigid motions of each body as modes: with translations only it takes half as many
    iterations again, with constants ten times as many. Springs much stiffer than the bodies ruin
    it, eliminated constraints do not.
    """

    tol: float = 1e-10
    max_iterations: int = 500

    def factorize(
        self,
        A: Any,
        *,
        points: np.ndarray | None = None,
        modes: np.ndarray | None = None,
        spd: bool = True,
    ) -> Factorisation:
        """See `LinearSolver.factorize`; `points` do not matter."""
        from pyamg import smoothed_aggregation_solver

        if not spd:
            raise InputError("AMG() needs a symmetric positive definite matrix: use Direct().")
        A = sp.csr_matrix(_square(A))
        with single_threaded():
            hierarchy = smoothed_aggregation_solver(
                A,
                B=None if modes is None else np.array(modes, dtype=float),
                strength=("symmetric", {"theta": 0.0}),
                presmoother=("gauss_seidel", {"sweep": "forward"}),
                postsmoother=("gauss_seidel", {"sweep": "backward"}),
                coarse_solver="splu",  # the default, a pseudo-inverse, takes ten times as long
            )
        cycle = hierarchy.aspreconditioner(cycle="V")

        def solve(b: np.ndarray) -> np.ndarray:
            return _pcg(A, b, cycle, self.tol, self.max_iterations)

        levels = hierarchy.levels
        parts = [level.A for level in levels]
        parts += [part for level in levels[:-1] for part in (level.P, level.R)]
        return Solver("AMG + CG", sum(map(_nbytes, parts)), _by_column(solve))


@dataclass(frozen=True)
class Dense:
    """Dense Cholesky factorisation, LU with pivoting where `A` is unsymmetric."""

    def factorize(
        self,
        A: Any,
        *,
        points: np.ndarray | None = None,
        modes: np.ndarray | None = None,
        spd: bool = True,
    ) -> Factorisation:
        """See `LinearSolver.factorize`; `A` may be dense, `points` and `modes` do not matter."""
        full = np.array(A.toarray() if sp.issparse(A) else A, dtype=float, order="F")
        _square(full)
        scale = full.diagonal().copy() if spd else np.abs(full).max(axis=0, initial=0.0)
        solve: Callable[[np.ndarray], np.ndarray]
        if spd:
            factor, failed = lapack.dpotrf(full, lower=1, clean=0, overwrite_a=1)
            pivots, name = factor.diagonal() ** 2, "dense Cholesky"
            solve = lambda b: lapack.dpotrs(factor, b, lower=1)[0]  # noqa: E731
        else:
            factor, rows, failed = lapack.dgetrf(full, overwrite_a=1)
            pivots, name = np.abs(factor.diagonal()), "dense LU"
            solve = lambda b: lapack.dgetrs(factor, rows, b)[0]  # noqa: E731
        _check_pivots(pivots, scale, failed, solve)
        return Solver(name, factor.nbytes, solve)


@dataclass(frozen=True, eq=False)
class FromSolver:
    """Any ``x = solver(A, b)``, such as those of ``skfem.utils``; one call per right-hand side.

    Parameters
    ----------
    solver : callable
        Called with a csr_matrix and a vector. What it leaves as residual is its own business.

    Examples
    --------
    >>> import numpy as np
    >>> import scipy.sparse as sp
    >>> from skfem.utils import solver_direct_scipy
    >>> factor = FromSolver(solver_direct_scipy()).factorize(2.0 * sp.eye_array(3))
    >>> factor.solve(np.ones(3)).tolist()
    [0.5, 0.5, 0.5]
    """

    solver: Callable[..., Any]

    def factorize(
        self,
        A: Any,
        *,
        points: np.ndarray | None = None,
        modes: np.ndarray | None = None,
        spd: bool = True,
    ) -> Factorisation:
        """See `LinearSolver.factorize`; only `A` is passed on."""
        A = sp.csr_matrix(_square(A))
        name = getattr(self.solver, "__name__", type(self.solver).__name__)

        def solve(b: np.ndarray) -> np.ndarray:
            x = np.asarray(self.solver(A, b), dtype=float)
            if x.shape != b.shape or not np.all(np.isfinite(x)):
                raise LinearSolveError(
                    f"The linear solver {name!r} returned "
                    + ("NaN or inf" if x.shape == b.shape else f"shape {x.shape} for {b.shape}")
                    + ". Usually the matrix is singular: a rigid motion is left free. Try "
                    "linear=Direct(), which says where."
                )
            return x

        return Solver(name, 0, _by_column(solve))


def as_linear_solver(linear: Any) -> LinearSolver:
    """Settings as they are, a callable as `FromSolver`; anything else is an `InputError`."""
    if hasattr(linear, "factorize"):
        return linear
    if callable(linear):
        return FromSolver(linear)
    raise InputError(
        f"linear={linear!r} is no linear solver: use Direct(), AMG(), Dense() or a scikit-fem "
        "solver such as skfem.utils.solver_direct_scipy()."
    )


def single_threaded() -> AbstractContextManager[Any]:
    """Limit BLAS to one thread, where ``threadpoolctl`` is installed.

    The dense blocks of contact problems are small: two threads spend their time waiting for each
    other and cost up to 30 times the CPU.
    """
    controller = _threads()
    return nullcontext() if controller is None else controller.limit(limits=1, user_api="blas")


@lru_cache(maxsize=1)
def _threads() -> Any:
    try:
        from threadpoolctl import ThreadpoolController
    except ImportError:
        return None
    return ThreadpoolController()


def _multifrontal(A: Any, points: np.ndarray) -> Factorisation:
    try:
        factor = MultifrontalCholesky(A, points)
    except NotPositiveDefinite as error:
        raise SingularMatrix(error.dof, error.ratio) from error

    def solve(b: np.ndarray) -> np.ndarray:
        with single_threaded():
            return factor.solve(b)

    return Solver("multifrontal Cholesky", factor.memory, solve)


def _superlu(A: Any, points: np.ndarray | None, spd: bool) -> Factorisation:
    """SuperLU with the order of elimination that suits: its default is up to 7 times slower."""
    options: dict[str, Any] = {"permc_spec": "COLAMD"}
    order = np.arange(A.shape[0])
    if spd:
        options = {
            "permc_spec": "MMD_AT_PLUS_A",
            "diag_pivot_thresh": 0.0,
            "options": {"SymmetricMode": True, "Equil": False},
        }
        if points is not None and points.shape[1] > 2:
            order = dissection_order(A, points)
            options["permc_spec"] = "NATURAL"
            A = A.tocsr()[order][:, order]
    A = sp.csc_matrix(A)
    try:
        factor = splu(A, **options)
    except RuntimeError as error:
        raise SingularMatrix(-1, 0.0) from error

    def solve(b: np.ndarray) -> np.ndarray:
        x = np.empty_like(b)
        x[order] = factor.solve(b[order])
        return x

    # SuperLU hands out its pivots only with a copy of all factors: take the other criterion
    _check_eigenvalue(abs(A).max(axis=1).toarray().ravel()[np.argsort(order)], solve)
    return Solver("SuperLU", 12 * factor.nnz, solve)


def _check_pivots(
    pivots: np.ndarray, scale: np.ndarray, failed: int, solve: Callable[[np.ndarray], np.ndarray]
) -> None:
    """Raise where a dense factorisation stopped or lost a pivot in round-off."""
    dof, ratio = failed - 1, 0.0
    if not failed:
        ratios = pivots / scale
        dof = int(np.argmin(ratios)) if ratios.size else 0  # a NaN is found as well
        ratio = float(ratios[dof]) if ratios.size else 1.0
    if not ratio >= LOST:
        raise SingularMatrix(dof, ratio)
    if ratio < SUSPICIOUS:
        _check_eigenvalue(scale, solve)


def _check_eigenvalue(scale: np.ndarray, solve: Callable[[np.ndarray], np.ndarray]) -> None:
    smallest, dof = smallest_eigenvalue(scale, solve)
    if not smallest >= NEGLIGIBLE:
        raise SingularMatrix(dof, smallest)


def _pcg(
    A: Any, b: np.ndarray, preconditioner: Any, tol: float, max_iterations: int
) -> np.ndarray:
    """Preconditioned conjugate gradients; the residual is measured, not only updated."""
    x, norm = np.zeros_like(b), np.linalg.norm(b)
    if norm == 0.0:
        return x
    r = b.copy()
    z = preconditioner @ r
    p, rz = z, r @ z
    residual = 1.0
    for iteration in range(1, max_iterations + 1):
        Ap = A @ p
        curvature = p @ Ap
        if not curvature > 0.0:
            break  # not positive definite, or NaN
        step = rz / curvature
        x += step * p
        r -= step * Ap
        if np.linalg.norm(r) <= tol * norm:
            r = b - A @ x  # updates drift away from the truth: go on from there
            residual = np.linalg.norm(r) / norm
            if residual <= tol:
                return x
        z = preconditioner @ r
        rz, previous = r @ z, rz
        p = z + (rz / previous) * p
    residual = np.linalg.norm(b - A @ x) / norm
    raise LinearSolveError(
        f"AMG: the residual is {residual:.1e} of the load after {iteration} iterations, above "
        f"tol={tol:.1e}. Usually a rigid motion is left free, the modes are missing, or springs "
        "are much stiffer than the bodies. Try linear=Direct(), or AMG with a larger tol or "
        "max_iterations.",
        residual=float(residual),
        iterations=iteration,
    )


def _by_column(
    solve: Callable[[np.ndarray], np.ndarray],
) -> Callable[[np.ndarray], np.ndarray]:
    """Let a solver of vectors take the columns of an array (n, r) one by one."""

    def columns(b: np.ndarray) -> np.ndarray:
        if b.ndim == 1:
            return solve(b)
        x = np.empty_like(b)
        for column in range(b.shape[1]):
            x[:, column] = solve(np.ascontiguousarray(b[:, column]))
        return x

    return columns


def _square(A: Any) -> Any:
    if A.ndim != 2 or A.shape[0] != A.shape[1]:
        raise InputError(f"A of shape {A.shape} is not square: pass the matrix of a system.")
    return A


def _nbytes(A: Any) -> int:
    return sum(part.nbytes for part in (A.data, A.indices, A.indptr))
