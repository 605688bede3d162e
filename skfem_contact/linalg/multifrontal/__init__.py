"""Multifrontal Cholesky factorisation that leaves a Schur complement on chosen DOFs.

* `ordering`: nested dissection from positions;
* `fronts`: what every front holds, and how large they will be;
* `factor`: the factorisation, how fronts add up, and what forces on some DOFs move there.
"""
