"""Conjugate gradients with algebraic multigrid, for what is too large to be factorised."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import gmres

from skfem_contact.arguments import with_known_keywords
from skfem_contact.linalg.backend import Backend, Factorisation, LinearSolveError, by_column


@with_known_keywords(tolerance="write tol")
@dataclass(frozen=True)
class AMG(Backend):
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

    def _factorize(
        self, A: Any, points: np.ndarray | None, modes: np.ndarray | None, spd: bool
    ) -> Factorisation:
        from pyamg import smoothed_aggregation_solver

        A = sp.csr_matrix(A)
        # slipping rows of the loop newton make A unsymmetric; its symmetric part preconditions it
        hierarchy = smoothed_aggregation_solver(
            A if spd else sp.csr_matrix(0.5 * (A + A.T)),
            B=None if modes is None else np.array(modes, dtype=float),
            strength=("symmetric", {"theta": 0.0}),
            presmoother=("gauss_seidel", {"sweep": "forward"}),
            postsmoother=("gauss_seidel", {"sweep": "backward"}),
            coarse_solver="splu",  # the default, a pseudo-inverse, takes ten times as long
        )
        cycle = hierarchy.aspreconditioner(cycle="V")

        method = _pcg if spd else _gmres

        def solve(b: np.ndarray) -> np.ndarray:
            return method(A, b, cycle, self.tol, self.max_iterations)

        parts = [level.A for level in hierarchy.levels]
        parts += [part for level in hierarchy.levels[:-1] for part in (level.P, level.R)]
        memory = sum(part.data.nbytes + part.indices.nbytes + part.indptr.nbytes for part in parts)
        return Factorisation("AMG + CG" if spd else "AMG + GMRES", memory, by_column(solve))


def _pcg(A: Any, b: np.ndarray, preconditioner: Any, tol: float, most: int) -> np.ndarray:
    """Preconditioned conjugate gradients; the residual is measured, not only updated."""
    x, norm = np.zeros_like(b), float(np.linalg.norm(b))
    if norm == 0.0:
        return x
    r = b.copy()
    p = z = preconditioner @ r
    rz, iterations = r @ z, 0
    while iterations < most:
        iterations += 1
        Ap = A @ p
        curvature = p @ Ap
        if not curvature > 0.0:
            break  # not positive definite, or NaN
        step = rz / curvature
        x += step * p
        r -= step * Ap
        if np.linalg.norm(r) <= tol * norm:
            r = b - A @ x  # updates drift away from the truth: check, and go on from there
            if np.linalg.norm(r) <= tol * norm:
                return x
        z = preconditioner @ r
        rz, previous = r @ z, rz
        p = z + (rz / previous) * p
    raise _too_many(A, b, x, tol, iterations)


def _gmres(A: Any, b: np.ndarray, preconditioner: Any, tol: float, most: int) -> np.ndarray:
    """Preconditioned GMRES of SciPy for unsymmetric systems; the residual is measured."""
    norm = float(np.linalg.norm(b))
    if norm == 0.0:
        return np.zeros_like(b)
    restart = min(100, len(b))
    x = np.zeros_like(b)
    # SciPy stops by the preconditioned residual: go on from there until the true one is small
    for _ in range(max(1, most // restart)):
        dx, _ = gmres(A, b - A @ x, M=preconditioner, rtol=tol, restart=restart, maxiter=1)
        x = x + dx
        if np.linalg.norm(b - A @ x) <= tol * norm:
            return x
    raise _too_many(A, b, x, tol, most)


def _too_many(A: Any, b: np.ndarray, x: np.ndarray, tol: float, iterations: int) -> LinearSolveError:
    residual = float(np.linalg.norm(b - A @ x) / np.linalg.norm(b))
    return LinearSolveError(
        f"AMG: the residual is {residual:.1e} of the load after {iterations} iterations, above "
        f"tol={tol:.1e}. Usually a rigid motion is left free, the modes are missing, or springs "
        "are much stiffer than the bodies. Try linear=Direct(), or AMG with a larger tol or "
        "max_iterations.",
        residual,
        iterations,
    )
