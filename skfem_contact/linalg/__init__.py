"""Linear solvers, which know nothing of contact.

* `backend`: the interface of a solver, and what contact needs of a factorised body;
* `direct`, `amg`: the ones that come with the library;
* `multifrontal`: Cholesky factorisation that leaves a Schur complement;
* `dense_factors`: factors of dense matrices, the one place that calls LAPACK for them, matrices changed
  in place, and least squares with a bound;
* `krylov`: iterations for unsymmetric equations, and secants for fixed points;
* `singular`: singular matrices recognised;
* `resources`: one BLAS thread for small blocks, and the memory that a factorisation will take;
* `thresholds`: numbers, and where they come from.
"""
