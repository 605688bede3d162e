"""Multifrontal Cholesky factorisation that leaves a Schur complement on chosen DOFs.

* `ordering`: nested dissection from positions;
* `fronts`: what every front holds; `assembly`: how fronts add up;
* `factor`: the factorisation; `size`: how large it will be;
* `response`: what forces on some DOFs move there.
"""
