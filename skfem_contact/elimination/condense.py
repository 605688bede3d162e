"""Constraints for `skfem.solve`: a system condensed by rows, as scikit-fem takes it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import ArrayLike, NDArray

from skfem_contact.arguments import shown
from skfem_contact.elimination.eliminate import AGREEMENT, eliminate
from skfem_contact.elimination.inputs import sparse_matrix
from skfem_contact.elimination.pivoting import IntArray
from skfem_contact.errors import InputError

# Attributes of rows that `condense` passes to `eliminate`.
OPTIONS = ("prefer", "labels", "scale")


def condense(
    K: Any, f: Any = None, rows: Any = None, D: Any = None, x: ArrayLike | None = None
) -> tuple[sp.csr_matrix, Any, NDArray[Any], tuple[IntArray, Callable[[Any], Any]]]:
    r"""Condense a system by constraint rows into what ``skfem.solve`` takes.

    Parameters
    ----------
    K : sparse matrix, shape (n, n)
        Stiffness [force/length].
    f : ndarray, shape (n,), or sparse matrix, shape (n, n), optional
        Load [force], default zero; or the mass matrix of an eigenproblem.
    rows : object with attributes `C` and `b`, or tuple (C, b), optional
        Constraint rows; its attributes `labels`, `prefer` and `scale` are passed to `eliminate`
        where it has them.
    D : ndarray of int, DofsView or dict of DofsView, optional
        Prescribed DOFs.
    x : ndarray, shape (n,), optional
        Their values.

    Returns
    -------
    tuple
        ``(T'KT, T'(f - Kc), zeros(n), (arange(n), lambda z: T @ z + c))``, for a mass matrix M
        ``(T'KT, T'MT, zeros(n), (arange(n), lambda z: T @ z))``.

    Notes
    -----
    ``solver_iter_pcg()`` at its default tolerance leaves an error of 1e-6 or so; pass `rtol`.

    Examples
    --------
    >>> from skfem import solve
    >>> K = sp.csr_matrix([[2.0, -1.0, 0.0], [-1.0, 2.0, -1.0], [0.0, -1.0, 1.0]])
    >>> solve(*condense(K, np.array([0.0, 0.0, 1.0]), ([[-0.5, 1.0, -0.5]], [0.0])))
    array([1., 2., 3.])
    """
    K = sparse_matrix("K", K)
    n = K.shape[0]
    if not np.isfinite(K.data).all():
        raise InputError("K has NaN or inf entries. Check the form it is assembled from.")
    rows = (sp.csr_matrix((0, n)), np.zeros(0)) if rows is None else rows
    if not (isinstance(rows, tuple) and len(rows) == 2) and not (
        hasattr(rows, "C") and hasattr(rows, "b")
    ):
        raise InputError(f"rows is {shown(rows)}; give contact_rows(...), or a pair (C, b)")
    C, b = rows if isinstance(rows, tuple) else (rows.C, rows.b)
    options = {name: getattr(rows, name) for name in OPTIONS if hasattr(rows, name)}
    constraint = eliminate(C, b, D, x, **options)
    is_mass: bool = sp.issparse(f)
    if is_mass:
        M = sp.csr_matrix(f)
        if not np.isfinite(M.data).all():
            raise InputError("The mass matrix has NaN or inf entries.")
        K_r, M_r = constraint.reduce(K)[0], constraint.reduce(M)[0]
        zeros = np.zeros(n, dtype=np.result_type(K_r, M_r, float))
        return K_r, M_r, zeros, (np.arange(n), _Modes(constraint.T, zeros.dtype))
    K_r, f_r = constraint.reduce(K, f)
    zeros = np.zeros(n, dtype=np.result_type(K_r, f_r, float))
    return K_r, f_r, zeros, (np.arange(n), constraint.expand)


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
