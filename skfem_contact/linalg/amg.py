"""Conjugate gradients with algebraic multigrid, for what is too large to be factorised."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp
from pyamg import smoothed_aggregation_solver
from pyamg.relaxation.relaxation import gauss_seidel
from scipy.sparse.csgraph import connected_components

from skfem_contact.arguments import with_known_keywords
from skfem_contact.errors import LinearSolveError
from skfem_contact.linalg.backend import Backend, Factorisation, by_column, check_diagonal
from skfem_contact.linalg.krylov import divided, gmres, sizes_of_parts


@with_known_keywords(tolerance="write tol")
@dataclass(frozen=True)
class AMG(Backend):
    """Conjugate gradients, preconditioned by smoothed aggregation with rigid motions.

    Parameters
    ----------
    tol : float
        Largest ``|b - A x| / |b|`` accepted, and of each part of the equations that no entry of A
        couples with the others.
    max_iterations : int
        More raise `LinearSolveError`. Well posed problems need 10 to 60.

    Notes
    -----
    Give *all* rigid motions of each body as modes: with translations only it takes half as many
    iterations again, with constants ten times as many. Springs much stiffer than the bodies ruin
    it, eliminated constraints do not.

    Examples
    --------
    >>> import skfem as fem
    >>> import skfem_contact as sc
    >>> from skfem.models.elasticity import linear_elasticity
    >>> mesh = fem.MeshQuad().refined(2).with_defaults()
    >>> basis = fem.Basis(mesh, fem.ElementVector(fem.ElementQuad1()), intorder=2)
    >>> block = sc.Body(basis, linear_elasticity(), D="top", x={"top": (0.002, -0.01)}, name="block")
    >>> floor = sc.RigidPlane((0, 0), (0, 1), name="floor")
    >>> foot = sc.Contact(block.surface("bottom"), floor, friction=sc.Coulomb(0.3), name="foot")
    >>> solver = sc.ContactSolver(block, foot, linear=sc.linalg.AMG(tol=1e-12))
    >>> factorised = sc.ContactSolver(block, foot).solve()
    >>> bool(
    ...     abs(solver.solve().pressure - factorised.pressure).max() < 1e-8 * factorised.pressure.max()
    ... )
    True
    """

    tol: float = 1e-10
    max_iterations: int = 500

    def _factorize(
        self, A: Any, points: np.ndarray | None, modes: np.ndarray | None, spd: bool
    ) -> Factorisation:
        A = sp.csr_matrix(A)
        if spd:
            check_diagonal(A.diagonal())
        # slipping rows of the loop newton make A unsymmetric; its symmetric part preconditions it
        grids = hierarchy(A if spd else sp.csr_matrix(0.5 * (A + A.T)), modes)
        method = conjugate_gradients if spd else _gmres
        part = connected_components(A, directed=False)[1]

        def solve(b: np.ndarray) -> np.ndarray:
            sizes = sizes_of_parts(part, b)
            b = divided(b, sizes)
            tol = self.tol / max(float(np.linalg.norm(b)), 1.0)  # of which it is a share
            return np.asarray(sizes * method(A, b, grids.cycle, tol, self.max_iterations))

        return Factorisation("AMG + CG" if spd else "AMG + GMRES", grids.memory, by_column(solve))


@dataclass(frozen=True, eq=False)
class Grid:
    """A matrix of a hierarchy in two triangles, and what leads to the next coarser one.

    A sweep of Gauss and Seidel from zero is a substitution in one triangle, what it leaves a product
    with the other: a cycle reads every entry twice, where sweeps and residuals read them three times.

    Attributes
    ----------
    lower, upper : csr_matrix, shape (n, n)
        Both with the diagonal.
    diagonal : ndarray, shape (n,)
    P : csr_matrix, shape (n, n_coarse)
    """

    lower: sp.csr_matrix
    upper: sp.csr_matrix
    diagonal: np.ndarray
    P: sp.csr_matrix

    @classmethod
    def of(cls, A: Any, P: Any, kind: type) -> Grid:
        """In numbers of some precision."""
        A = sp.csr_matrix(A, dtype=kind)
        lower, upper = sp.tril(A, format="csr"), sp.triu(A, format="csr")
        return cls(lower, upper, A.diagonal(), sp.csr_matrix(P, dtype=kind))

    @property
    def memory(self) -> int:
        """Bytes."""
        parts = self.lower, self.upper, self.P
        return sum(part.data.nbytes + part.indices.nbytes + part.indptr.nbytes for part in parts)


@dataclass(frozen=True, eq=False)
class Hierarchy:
    """Grids of a matrix.

    The finest is in single precision: reading it is what a cycle takes its time for. A cycle is a
    preconditioner only, and what it leaves is measured in double precision.

    Attributes
    ----------
    grids : sequence of Grid
        From the finest on.
    coarsest : callable
        Solves with the matrix of the last one.
    """

    grids: Sequence[Grid]
    coarsest: Callable[[np.ndarray], np.ndarray]

    @property
    def memory(self) -> int:
        """Of all grids [bytes]."""
        return sum(grid.memory for grid in self.grids)

    def cycle(self, b: np.ndarray) -> np.ndarray:
        """A V-cycle, ``b -> x`` with ``A x`` about b: symmetric."""
        size = float(np.linalg.norm(b))
        if size == 0.0:
            return np.zeros_like(b)
        return size * self._from(0, b / size)  # single precision has a short range, too

    def _from(self, number: int, b: np.ndarray) -> np.ndarray:
        """From one grid down, without the residuals that PyAMG measures before and after."""
        if number == len(self.grids):
            return np.ravel(self.coarsest(b))
        grid = self.grids[number]
        b = b.astype(grid.P.dtype, copy=False)
        x = np.zeros_like(b)
        gauss_seidel(grid.lower, x, b, sweep="forward")
        left = grid.diagonal * x - grid.upper @ x
        coarser = self._from(number + 1, (grid.P.T @ left).astype(float, copy=False))
        x += grid.P @ coarser.astype(b.dtype)
        gauss_seidel(grid.upper, x, b + grid.diagonal * x - grid.lower @ x, sweep="backward")
        return x.astype(float, copy=False)


def hierarchy(A: Any, modes: np.ndarray | None) -> Hierarchy:
    """Smoothed aggregation of a symmetric positive definite matrix.

    Parameters
    ----------
    A : csr_matrix, shape (n, n)
    modes : ndarray, shape (n, k), or None
        Rigid motions.
    """
    # PyAMG estimates eigenvalues from NumPy's own random numbers: answers would not repeat
    state = np.random.get_state()  # noqa: NPY002
    np.random.seed(0)  # noqa: NPY002
    try:
        levels = smoothed_aggregation_solver(
            A,
            B=None if modes is None else np.array(modes, dtype=float),
            strength=("symmetric", {"theta": 0.0}),
            presmoother=None,
            postsmoother=None,
            # rigid motions are what K barely resists: smoothing them first takes time for nothing
            improve_candidates=None,
        ).levels
    finally:
        np.random.set_state(state)  # noqa: NPY002
    kinds = [np.float32, *len(levels) * [np.float64]]
    grids = [Grid.of(level.A, level.P, kind) for level, kind in zip(levels[:-1], kinds, strict=False)]
    # rigid motions of few nodes depend on each other, and what they span has equations that are zero
    return Hierarchy(grids, np.linalg.pinv(levels[-1].A.toarray(), hermitian=True).dot)


def conjugate_gradients(
    A: Any,
    b: np.ndarray,
    cycle: Callable[[np.ndarray], np.ndarray],
    tol: float,
    most: int,
    to_round_off: bool = False,
) -> np.ndarray:
    """Preconditioned conjugate gradients, whose residual and energy are measured.

    The residual that is updated drifts away from the truth: where it is small enough, the true one is
    looked at, and the iteration begins anew from there. SciPy's goes on where a direction has no
    stiffness, divides by zero or finds an answer of a matrix that is not positive definite.
    With `to_round_off` a residual above the tolerance is accepted that is round-off of its terms.
    """
    x, norm, iterations = np.zeros_like(b), float(np.linalg.norm(b)), 0
    r, p, rho = b, np.zeros_like(b), np.inf
    while norm != 0.0:  # nor NaN: that is told below
        if np.linalg.norm(r) <= tol * norm or iterations >= most:
            r, p, rho = b - A @ x, np.zeros_like(b), np.inf
            residual = float(np.linalg.norm(r))
            if residual <= tol * norm < np.inf or (to_round_off and residual <= _round_off(A, x)):
                break
            if iterations >= most:
                raise not_within(residual / norm, tol, iterations)
        z = cycle(r)
        before, rho = rho, float(r @ z)
        p = z + rho / before * p
        Ap = A @ p
        iterations += 1
        energy = float(p @ Ap)
        if rho > 0.0 and energy > 0.0:
            x, r = x + rho / energy * p, r - rho / energy * Ap
        else:  # or NaN: there is nothing more to gain
            most = iterations
    return x


def _round_off(A: Any, x: np.ndarray) -> float:
    """Return what ``A x`` is uncertain by: a sum of n terms is known to n roundings of their sizes.

    (N. J. Higham, Accuracy and stability of numerical algorithms, 2002, section 3.1.)
    """
    return float(longest_row(A) * 0.5 * np.finfo(float).eps * np.linalg.norm(abs(A) @ np.abs(x)))


def longest_row(A: Any) -> int:
    """Entries of the longest row."""
    return int(np.diff(A.indptr).max()) * (A.blocksize[1] if A.format == "bsr" else 1)


def _gmres(
    A: Any, b: np.ndarray, cycle: Callable[[np.ndarray], np.ndarray], tol: float, most: int
) -> np.ndarray:
    """Preconditioned GMRES for unsymmetric systems; the residual is measured.

    One that is round-off of its terms is accepted: springs in series with points are stiff.
    """
    norm = float(np.linalg.norm(b))
    found = gmres(A.dot, b, cycle, np.zeros_like(b), tol * norm, most)
    if found.enough or found.residual <= _round_off(A, found.x):
        return found.x
    raise not_within(found.residual / norm, tol, found.iterations)


def not_within(residual: float, tol: float, iterations: int) -> LinearSolveError:
    """The error for a solution that was not found within a tolerance."""
    return LinearSolveError(
        f"AMG: the residual is {residual:.1e} of the load after {iterations} iterations, above "
        f"tol={tol:.1e}. Usually a rigid motion is left free, the modes are missing, or springs "
        "are much stiffer than the bodies. Try linear=Direct(), or AMG with a larger tol or "
        "max_iterations.",
        residual,
        iterations,
    )
