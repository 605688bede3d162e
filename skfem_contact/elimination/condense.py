"""Constraints for `skfem.solve`: a system condensed by rows, as scikit-fem takes it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import ArrayLike, NDArray

from skfem_contact.arguments import known_keywords, shown
from skfem_contact.elimination.eliminate import eliminate
from skfem_contact.elimination.inputs import prescribed, sparse_matrix
from skfem_contact.elimination.thresholds import AGREEMENT
from skfem_contact.errors import InputError

# Attributes of rows that `condense` passes to `eliminate`.
OPTIONS = ("prefer", "labels", "scale")


@known_keywords(K="write A", f="write b")
def condense(
    A: Any,
    b: Any = None,
    x: ArrayLike | None = None,
    I: Any = None,
    D: Any = None,
    expand: bool = True,
    *,
    rows: Any = None,
) -> tuple[Any, ...]:
    r"""Condense a system by constraint rows into what ``skfem.solve`` takes.

    `skfem.condense` with one argument more, `rows`.

    Parameters
    ----------
    A : sparse matrix, shape (n, n)
        Stiffness [force/length].
    b : ndarray, shape (n,), or sparse matrix, shape (n, n), optional
        Load [force], default zero; or the mass matrix of an eigenproblem.
    x : ndarray, shape (n,), optional
        Values of the prescribed DOFs, default zero.
    I : ndarray of int, DofsView or dict of DofsView, optional
        The DOFs that are not prescribed, in place of `D`.
    D : ndarray of int, DofsView or dict of DofsView, optional
        Prescribed DOFs.
    expand : bool
        Whether to return what the solution is expanded by, too.
    rows : object with attributes `C` and `b`, or tuple (C, b), optional
        Constraint rows; its attributes `labels`, `prefer` and `scale` are passed to `eliminate`
        where it has them.

    Returns
    -------
    tuple
        ``(T'AT, T'(b - Ac), zeros(n), (arange(n), lambda z: T @ z + c))``, for a mass matrix M
        ``(T'AT, T'MT, zeros(n), (arange(n), lambda z: T @ z))``; without `expand` the first two.

    Notes
    -----
    ``solver_iter_pcg()`` at its default tolerance leaves an error of 1e-6 or so; pass `rtol`.

    Examples
    --------
    >>> from skfem import solve
    >>> K = sp.csr_matrix([[2.0, -1.0, 0.0], [-1.0, 2.0, -1.0], [0.0, -1.0, 1.0]])
    >>> solve(*condense(K, np.array([0.0, 0.0, 1.0]), rows=([[-0.5, 1.0, -0.5]], [0.0])))
    array([1., 2., 3.])
    """
    A = sparse_matrix("A", A)
    n = A.shape[0]
    if not np.isfinite(A.data).all():
        raise InputError("A has NaN or inf entries. Check the form it is assembled from.")
    if hasattr(x, "C") and hasattr(x, "b"):
        raise InputError("x is rows of constraints; x are prescribed values: write rows=...")
    if I is not None:
        if D is not None:
            raise InputError("I and D are both given; give the DOFs to keep, or those prescribed")
        D = np.setdiff1d(np.arange(n), prescribed(I, n, "I"))
    C, c, options = _rows(rows, n)
    constraint = eliminate(C, c, D, x, **options)
    is_mass: bool = sp.issparse(b)
    if is_mass:
        M = sp.csr_matrix(b)
        if not np.isfinite(M.data).all():
            raise InputError("The mass matrix has NaN or inf entries.")
        A_r, b_r = constraint.reduce(A)[0], constraint.reduce(M)[0]
    else:
        A_r, b_r = constraint.reduce(A, b)
    zeros = np.zeros(n, dtype=np.result_type(A_r, b_r, float))
    expansion = _Modes(constraint.T, zeros.dtype) if is_mass else constraint.expand
    return (A_r, b_r, zeros, (np.arange(n), expansion)) if expand else (A_r, b_r)


def _rows(rows: Any, n: int) -> tuple[Any, Any, dict[str, Any]]:
    """The matrix, the right-hand side and what else is known of the constraint rows."""
    rows = (sp.csr_matrix((0, n)), np.zeros(0)) if rows is None else rows
    if not (isinstance(rows, tuple) and len(rows) == 2) and not (
        hasattr(rows, "C") and hasattr(rows, "b")
    ):
        raise InputError(f"rows is {shown(rows)}; give contact_rows(...), or a pair (C, b)")
    C, b = rows if isinstance(rows, tuple) else (rows.C, rows.b)
    return C, b, {name: getattr(rows, name) for name in OPTIONS if hasattr(rows, name)}


@dataclass(frozen=True, eq=False)
class _Modes:
    """``T @ z``, real for a real problem: ARPACK's `eigs` gives real modes as complex numbers."""

    T: sp.csr_matrix
    dtype: Any

    def __call__(self, z: NDArray[Any]) -> NDArray[Any]:
        mode: NDArray[Any] = self.T @ z
        if np.iscomplexobj(mode) and not np.issubdtype(self.dtype, np.complexfloating):
            if np.abs(mode.imag).max() > AGREEMENT * np.abs(mode).max():
                raise InputError(
                    "An eigenmode of a real system came out complex. If K and M are symmetric (a"
                    " multiple eigenvalue, split by round-off), pass"
                    " solver=solver_eigen_scipy_sym(); otherwise pass K as a complex matrix."
                )
            return mode.real
        return mode
