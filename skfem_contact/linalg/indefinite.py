"""Condensation of a stiffness that is not positive definite: the tangent of a body that is not stable.

Newton's method passes such tangents on its way, of bodies that soften or buckle. Cholesky's method has
no factors then. SuperLU has, and the condensed stiffness, which is symmetric, is solved with pivots.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import csc_matrix, csr_matrix
from scipy.sparse.linalg import splu

from skfem_contact.arrays import Array, Index
from skfem_contact.errors import SingularMatrix
from skfem_contact.linalg.backend import BodyFactor
from skfem_contact.linalg.multifrontal.ordering import dissection_order


class IndefiniteFactor(BodyFactor):
    """A symmetric stiffness with all DOFs but some eliminated, see `backend.BodyFactor`.

    Parameters
    ----------
    K : csr_matrix, shape (n, n)
        Symmetric [force/length].
    points : ndarray, shape (n, d)
        Position of each DOF [length]; they guide the order of elimination.
    keep : ndarray of int, shape (n_c,)
        DOFs that are not eliminated.

    Raises
    ------
    SingularMatrix
        The stiffness of the others is singular.

    Examples
    --------
    A spring in series with one that pushes away, which together resist by -2:

    >>> import scipy.sparse as sp
    >>> K = sp.csr_matrix([[1.0, -1.0, 0.0], [-1.0, 1.0 - 2 / 3, 2 / 3], [0.0, 2 / 3, -2 / 3]])
    >>> IndefiniteFactor(K, np.arange(3.0)[:, None], np.array([0, 2])).S.round(12)
    array([[-2.,  2.],
           [ 2., -2.]])
    """

    def __init__(self, K: csr_matrix, points: Array, keep: Index) -> None:
        interior = np.delete(np.arange(K.shape[0]), keep)
        A = csr_matrix(K[interior][:, interior])
        interior = interior[dissection_order(A, points[interior])]
        self.keep, self.order = keep, np.concatenate([interior, keep])
        self._from_kept = csc_matrix(K[interior][:, keep])
        A = csc_matrix(K[interior][:, interior])
        try:
            self._factor = splu(A, permc_spec="NATURAL", options={"SymmetricMode": True})
        except RuntimeError as error:  # "Factor is exactly singular"
            raise SingularMatrix(str(error)) from None
        self._follow = self._factor.solve(self._from_kept.toarray())
        S = K[keep][:, keep].toarray() - self._from_kept.T @ self._follow
        self.S = 0.5 * (S + S.T)

    @property
    def memory(self) -> int:
        """Bytes."""
        return int(12 * self._factor.nnz + self._follow.nbytes + self.S.nbytes)

    def take_S(self) -> Array:
        """`S` for the caller alone, who may change it."""
        return self.S.copy()

    def eliminate(self, f: Array) -> Array:
        """Loads (n,) or (n, r) with the interior eliminated, (n, r), in the order `order`."""
        f = f.reshape(len(f), -1)[self.order]
        inside = len(self.order) - len(self.keep)
        out = np.empty_like(f)
        out[:inside] = self._factor.solve(f[:inside])
        out[inside:] = f[inside:] - self._from_kept.T @ out[:inside]
        return out

    def substitute(self, u_keep: Array, eliminated: Array) -> Array:
        """Displacements (n, r), in the order `order`; `eliminated` is overwritten."""
        inside = len(self.order) - len(self.keep)
        u_keep = u_keep.reshape(len(self.keep), eliminated.shape[1])
        eliminated[:inside] -= self._follow @ u_keep
        eliminated[inside:] = u_keep
        return eliminated
