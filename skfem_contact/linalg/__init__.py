"""Linear solvers, which know nothing of contact.

* `backend`: the interface of a solver, what contact needs of a factorised body, and singular matrices
  recognised;
* `direct`, `amg`: the ones that come with the library;
* `multifrontal`: Cholesky factorisation that leaves a Schur complement;
* `dense_factors`: factors of dense matrices, the one place that calls LAPACK for them, matrices changed
  in place, and least squares with a bound;
* `krylov`: iterations for unsymmetric equations, and secants for fixed points;
* `resources`: one BLAS thread for small blocks, and the memory that a factorisation will take.
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
        "dense_factors": "cholesky factorised lu nonnegative_least_squares",
        "direct": "as_linear_solver Direct FromSolver",
        "krylov": "Anderson gmres",
        "multifrontal.factor": "MultifrontalCholesky SurfaceResponse",
        "multifrontal.fronts": "analyse factor_size find_runs",
        "multifrontal.ordering": "dissect dissection_order",
        "resources": "Limits single_threaded",
    },
)
