"""Linear solvers, which know nothing of contact.

* `backend`: the interface of a solver; `direct`, `amg`: the ones that come with the library;
* `multifrontal`: Cholesky factorisation that leaves a Schur complement;
* `dense_factors`: factors of dense matrices, the one place that calls LAPACK for them;
* `singular`, `threads`: singular matrices recognised; one BLAS thread for small blocks;
* `thresholds`: numbers, and where they come from.
"""
