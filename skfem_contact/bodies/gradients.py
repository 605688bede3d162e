r"""Displacement gradients at points of integration, and the sums over elements that belong to them.

With the scalar shape functions N_a and ``G_aj = ∂_j N_a``,

    ``H_ij = u_ai G_aj``,    ``f_ai = ∫ G_aj P_ij``,    ``K_(ai)(bk) = ∫ G_aj A_ijkl G_bl``.

An axisymmetric body has the third direction j = 2, with ``G_a2 = N_a / r``, for the radial component
alone: ``H_22 = u_r / r``. Elements are the last axis of all arrays here, so that each product is one of
long vectors: forms that are called for every two shape functions take twice as long.
"""

from __future__ import annotations

from functools import cached_property
from itertools import combinations_with_replacement
from typing import Any

import numpy as np
from scipy.sparse import csr_matrix

from skfem_contact.arrays import Array
from skfem_contact.bodies.assembly import NeedsMore, check_numbering, pattern
from skfem_contact.bodies.quadrature import point_volumes, scalar_element, shape_gradients
from skfem_contact.errors import InputError
from skfem_contact.materials.tensors import solid


class Gradients:
    """Gradients on a basis of displacements.

    Parameters
    ----------
    basis : skfem.CellBasis
    measure : callable or None
        Weight of the area by position.
    axisymmetric : bool

    Attributes
    ----------
    G : ndarray, shape (k, j, q, e)
        Gradients of the shape functions [1/length].
    dx : ndarray, shape (e, q)
        Weights of the points of integration, with the measure.
    """

    def __init__(self, basis: Any, measure: Any, axisymmetric: bool, whose: str) -> None:
        try:
            check_numbering(basis)
        except NeedsMore as error:
            raise InputError(f"the basis of {whose}: {error}; take skfem.Basis") from error
        self.basis, self.axisymmetric = basis, axisymmetric
        self.d = int(basis.mesh.dim())
        G = shape_gradients(basis, None).transpose(2, 1, 3, 0)
        self.dx = point_volumes(basis, None)
        if measure is not None or axisymmetric:
            x = np.asarray(basis.mapping.F(basis.X, None))
        if measure is not None:
            self.dx = self.dx * measure(x)
        if axisymmetric:
            element = scalar_element(basis.elem)
            N = np.stack([element.lbasis(basis.X, a)[0] for a in range(len(G))])  # (k, q)
            G = np.concatenate([G, (N[:, :, None] / x[0].T)[:, None]], axis=1)
        self.G = np.ascontiguousarray(G)

    @property
    def elements(self) -> int:
        return int(self.G.shape[-1])

    @property
    def points(self) -> int:
        """Points of integration of an element."""
        return int(self.G.shape[2])

    def of(self, u: Array) -> Array:
        """Displacement gradient (d, d, e, q) of displacements (n,); of three rows if axisymmetric."""
        values = u[self.basis.element_dofs].reshape(len(self.G), self.d, -1)
        H = np.einsum("aie,ajqe->ijqe", values, self.G).swapaxes(2, 3)
        if not self.axisymmetric:
            return np.ascontiguousarray(H)
        out = solid(np.ascontiguousarray(H[:, :2]))
        out[2, 2] = H[0, 2]
        return out

    def _slots(self, i: int) -> list[tuple[int, int, int]]:
        """Directions j of G that the component i has, and the entry of a tensor for each."""
        plain = [(j, i, j) for j in range(self.d)]
        return [*plain, (2, 2, 2)] if self.axisymmetric and i == 0 else plain

    def forces(self, P: Array, some: slice = slice(None)) -> Array:
        """``∫ G_aj P_ij`` of a stress (d, d, e, q) on some elements, shape (k d, e)."""
        G, dx = self.G[..., some], self.dx[some]
        out = np.zeros((len(G), self.d, len(dx)))
        for i in range(self.d):
            for j, row, column in self._slots(i):
                weighted = np.ascontiguousarray((P[row, column] * dx).T)
                out[:, i] += np.einsum("aqe,qe->ae", G[:, j], weighted)
        return out.reshape(-1, len(dx))

    def stiffness(self, A: Array, some: slice = slice(None)) -> Array:
        """``∫ G_aj A_ijkl G_bl`` of a tangent (d, d, d, d, e, q), symmetric, shape (k d, k d, e)."""
        G, dx = self.G[..., some], self.dx[some]
        n, d = len(G), self.d
        K = np.empty((n, d, n, d, len(dx)))
        for i, k in combinations_with_replacement(range(d), 2):
            block = np.zeros((n, n, len(dx)))
            for j, r, s in self._slots(i):
                along = np.zeros((n, *G.shape[2:]))  # A_ijkl G_bl
                for l, t, v in self._slots(k):
                    along += np.ascontiguousarray((A[r, s, t, v] * dx).T) * G[:, l]
                block += np.einsum("aqe,bqe->abe", G[:, j], along)
            other = block.swapaxes(0, 1)
            if i == k:  # symmetric, to the last digit
                block = 0.5 * (block + other)
                other = block
            K[:, i, :, k], K[:, k, :, i] = block, other
        return K.reshape(n * d, n * d, len(dx))

    @cached_property
    def _pattern(self) -> tuple[Any, Any, Any]:
        starts, columns, place = pattern(self.basis.element_dofs, self.basis.N)
        return starts, columns, np.ascontiguousarray(place.transpose(1, 2, 0)).ravel()

    def summed(self, K: Array) -> csr_matrix:
        """The matrix (n, n) of all element matrices (k d, k d, e)."""
        starts, columns, place = self._pattern
        data = np.bincount(place, K.ravel(), minlength=len(columns))
        out = csr_matrix((data, columns, starts), shape=(self.basis.N,) * 2)
        out.has_canonical_format = True
        return out

    def scattered(self, f: Array) -> Array:
        """The vector (n,) of all element vectors (k d, e)."""
        dofs = self.basis.element_dofs.ravel()
        return np.asarray(np.bincount(dofs, f.ravel(), minlength=self.basis.N), dtype=float)
