r"""Displacement gradients at points of integration, and the sums over elements that belong to them.

With the scalar shape functions N_a and ``G_aj = ∂_j N_a``,

    ``H_ij = u_ai G_aj``,    ``f_ai = ∫ G_aj P_ij``,    ``K_(ai)(bk) = ∫ G_aj A_ijkl G_bl``.

An axisymmetric body has the third direction j = 2, with ``G_a2 = N_a / r``, for the radial component
alone: ``H_22 = u_r / r``. All elements at once are products of small matrices, in half of the time of
forms that are called for every two shape functions.
"""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix

from skfem_contact.bodies.assembly import NeedsMore, check_numbering, pattern
from skfem_contact.bodies.quadrature import point_volumes, scalar_element, shape_gradients
from skfem_contact.errors import InputError
from skfem_contact.materials.tensors import solid

Array = NDArray[np.float64]


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
    G : ndarray, shape (e, k, j, q)
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
        G = shape_gradients(basis, None).transpose(0, 2, 1, 3)
        self.dx = point_volumes(basis, None)
        if measure is not None or axisymmetric:
            x = np.asarray(basis.mapping.F(basis.X, None))
        if measure is not None:
            self.dx = self.dx * measure(x)
        if axisymmetric:
            element = scalar_element(basis.elem)
            N = np.stack([element.lbasis(basis.X, a)[0] for a in range(G.shape[1])])  # (k, q)
            G = np.concatenate([G, (N / x[0][:, None])[:, :, None]], axis=2)
        self.G = np.ascontiguousarray(G)

    @property
    def elements(self) -> int:
        return len(self.G)

    @property
    def points(self) -> int:
        """Points of integration of an element."""
        return int(self.G.shape[-1])

    @cached_property
    def _flat(self) -> Array:
        """The gradients, (e, k, j q)."""
        return self.G.reshape(*self.G.shape[:2], -1)

    def of(self, u: Array) -> Array:
        """Displacement gradient (d, d, e, q) of displacements (n,); of three rows if axisymmetric."""
        e, k, J, q = self.G.shape
        values = u[self.basis.element_dofs.T].reshape(e, k, self.d)
        H = np.ascontiguousarray(
            (values.swapaxes(1, 2) @ self._flat).reshape(e, self.d, J, q).transpose(1, 2, 0, 3)
        )
        if not self.axisymmetric:
            return H
        out = solid(H[:, :2])
        out[2, 2] = H[0, 2]
        return out

    def _by_slot(self, T: Array, i: int, j: int) -> Any:
        """Entry of a tensor for the component i and the direction j of G; None if there is none."""
        if j < self.d:
            return T[i, j]
        return T[2, 2] if i == 0 else None

    def forces(self, P: Array, some: slice = slice(None)) -> Array:
        """``∫ G_aj P_ij`` of a stress (d, d, e, q) on some elements, shape (e, k d)."""
        G, dx = self._flat[some], self.dx[some]
        e, k, J, q = self.G[some].shape
        slots = np.zeros((e, J, q, self.d))
        for i, j in np.ndindex(self.d, J):
            part = self._by_slot(P, i, j)
            if part is not None:
                np.multiply(part, dx, out=slots[..., i][:, j])
        return (G @ slots.reshape(e, J * q, self.d)).reshape(e, k * self.d)

    def stiffness(self, A: Array, some: slice = slice(None)) -> Array:
        """``∫ G_aj A_ijkl G_bl`` of a tangent (d, d, d, d, e, q), shape (e, k d, k d)."""
        G, dx = self.G[some], self.dx[some]
        e, n, J, q = G.shape
        along = np.zeros((e, self.d, self.d, n, J, q))  # A_ijkl G_bl
        weighted = G * dx[:, None, None]
        for i, j, k, l in np.ndindex(self.d, J, self.d, J):
            rows = self._by_slot(A, i, j)
            part = None if rows is None else self._by_slot(rows, k, l)
            if part is not None:
                along[:, i, k, :, j] += np.asarray(part)[:, None] * weighted[:, :, l]
        K = self._flat[some] @ along.reshape(e, -1, J * q).swapaxes(1, 2)  # (e, a, i k b)
        K = K.reshape(e, n, self.d, self.d, n).transpose(0, 1, 2, 4, 3)
        return K.reshape(e, n * self.d, n * self.d)

    @cached_property
    def _pattern(self) -> tuple[Any, Any, Any]:
        return pattern(self.basis.element_dofs, self.basis.N)

    def summed(self, K: Array) -> csr_matrix:
        """The matrix (n, n) of all element matrices."""
        starts, columns, place = self._pattern
        data = np.bincount(place.ravel(), K.ravel(), minlength=len(columns))
        out = csr_matrix((data, columns, starts), shape=(self.basis.N,) * 2)
        out.has_canonical_format = True
        return out

    def scattered(self, f: Array) -> Array:
        """The vector (n,) of all element vectors (e, k d)."""
        dofs = self.basis.element_dofs.T
        return np.asarray(np.bincount(dofs.ravel(), f.ravel(), minlength=self.basis.N), dtype=float)
