"""Linear solvers, which know nothing of contact.

* `backend`: the interface of a solver; `direct`, `amg`: the ones that come with the library;
* `body_factor`: what contact needs of a factorised body;
* `distributed`: linear problems over MPI ranks, by PETSc; `stacked`: what others see of it;
* `multifrontal`: Cholesky factorisation that leaves a Schur complement;
* `dense_factors`: factors of dense matrices, the one place that calls LAPACK for them;
* `krylov`: iterations for unsymmetric equations; `nonnegative`: least squares with a bound;
* `in_place`: large dense matrices changed in place;
* `singular`, `threads`: singular matrices recognised; one BLAS thread for small blocks;
* `memory`: what a factorisation will take;
* `thresholds`: numbers, and where they come from.
"""
