"""`LinearSolve`: how a linear problem was solved; and what is said where it was not."""

from __future__ import annotations

from dataclasses import dataclass

from skfem_contact.linalg.backend import LinearSolveError
from skfem_contact.linalg.distributed.share import Solved

# PETSc's KSPConvergedReason in words.
REASONS = {
    -3: "it did not end within max_iterations",
    -4: "the residual grew without bound",
    -5: "the iteration broke down",
    -6: "the iteration broke down",
    -8: "the preconditioner is not positive definite",
    -9: "a number was not finite",
    -10: "the matrix is not positive definite",
    -11: "the preconditioner could not be set up",
}


@dataclass(frozen=True)
class LinearSolve:
    """How one linear problem was solved.

    Attributes
    ----------
    unknowns : int
    method : str
        Iteration and preconditioner as PETSc calls them, such as ``cg + gamg``.
    iterations : int
    residual : float
        ``|b - A x| / |b|``, measured.
    ranks : int
    setup, seconds : float
        Time of the preconditioner, of which the first of several solves has all, and of the solve [s].
    memory : int
        Matrices of all ranks together, those of multigrid or the factors included [bytes].
    columns : int
        Right-hand sides that were solved for together; residual and iterations are the largest.
    """

    unknowns: int
    method: str
    iterations: int
    residual: float
    ranks: int
    setup: float
    seconds: float
    memory: int
    columns: int = 1


def not_solved(name: str, how: Solved, tol: float) -> LinearSolveError:
    """The error of an iteration that ended above its tolerance."""
    known = REASONS.get(how.reason, f"PETSc's reason is {how.reason}")
    why = f"{known[0].upper()}{known[1:]}. " if how.reason < 0 else ""
    if how.residual <= tol:
        return LinearSolveError(
            f"PETSc, {name}: the residual is {how.residual:.1e} of the load after {how.iterations} "
            f"iterations, but moves single points by {how.local:.1e} of the largest displacement: "
            "some bodies or springs are much softer than others. Try PETSc(method='direct').",
            how.residual,
            how.iterations,
        )
    return LinearSolveError(
        f"PETSc, {name}: the residual is {how.residual:.1e} of the load after {how.iterations} "
        f"iterations, above tol={tol:.1e}. {why}Usually a rigid motion is "
        "left free, or springs are much stiffer than the bodies. Try PETSc(method='direct'), or a "
        "larger tol or max_iterations.",
        how.residual,
        how.iterations,
    )
