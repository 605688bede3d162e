"""Linear solvers, which know nothing of contact.

* `backend`: the interface of a solver, what contact needs of a factorised body, and singular matrices
  recognised;
* `direct`, `amg`: the ones that come with the library;
* `multifrontal`: Cholesky factorisation that leaves a Schur complement on chosen DOFs, how fronts add
  up, and what forces on some DOFs move there; `fronts`: nested dissection from positions, what every
  front holds, and how large they will be;
* `dense_factors`: factors of dense matrices, the one place that calls LAPACK for them, matrices changed
  in place, least squares with a bound, one BLAS thread, and the memory that a factorisation will take;
* `krylov`: iterations for unsymmetric equations, and secants for fixed points.
"""

from typing import TYPE_CHECKING

from skfem_contact.records import entrances

if TYPE_CHECKING:
    from skfem_contact.linalg.amg import AMG as AMG
    from skfem_contact.linalg.direct import Direct as Direct

__all__ = ["AMG", "Direct"]

__getattr__, __dir__ = entrances(
    __name__,
    __all__,
    {
        "amg": "AMG conjugate_gradients hierarchy",
        "backend": "Backend",
        "dense_factors": "cholesky definite_inverse factorised Limits lu nonnegative_least_squares "
        "single_threaded",
        "direct": "as_linear_solver Direct FromSolver",
        "krylov": "Anderson gmres",
        "multifrontal": "find_runs MultifrontalCholesky SurfaceResponse",
        "fronts": "analyse dissect dissection_order factor_size",
    },
)
