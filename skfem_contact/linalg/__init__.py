"""Linear solvers, which know nothing of contact.

* `backend`: the interface of a solver; `direct`, `amg`: the ones that come with the library;
* `multifrontal`: Cholesky factorisation that leaves a Schur complement;
* `dense_factors`: factors of dense matrices that may be empty;
* `singular`, `threads`: singular matrices recognised; one BLAS thread for small blocks.
"""
