r"""Derivatives of displacements at the nodes, by projection in L2 on the continuous elements.

Of a scalar field the projection solves ``M g = G_k u`` with

    M_ij = ∫ N_i N_j,     G_k,ij = ∫ N_i ∂_k N_j,     H_ij = ∫ N_i N_j / r,

integrated by the quadrature of the body's basis: what `skfem.CellBasis.project` gives. The matrices are
those of the mesh alone, so they are assembled once, whatever is asked of the body later.

M is solved with by conjugate gradients, preconditioned by its diagonal: the condition is then bounded
by a number that depends on the element and not on the mesh (Wathen 1987), so some 20 to 60 products
reach round-off, and nothing has to be factorised.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
import skfem
from numpy.typing import NDArray
from scipy.sparse import csr_matrix
from skfem.assembly import BilinearForm

from skfem_contact.bodies.body import Body
from skfem_contact.output.thresholds import PRODUCTS, PROJECTED

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Projection:
    """The matrices of one basis of displacements; `of` has them ready.

    Attributes
    ----------
    scalar : skfem.CellBasis
        The scalar element on the same mesh.
    """

    scalar: Any

    @classmethod
    def of(cls, body: Body) -> Projection:
        """Those of a body; bodies on one basis share them."""
        basis = body.basis
        if basis not in _KNOWN:
            scalar = basis.with_element(basis.elem.elem)
            if scalar.X.shape[1] < scalar.Nbfun:  # too few points to tell the functions apart
                scalar = skfem.Basis(basis.mesh, basis.elem.elem, mapping=basis.mapping)
            _KNOWN[basis] = cls(scalar)
        return _KNOWN[basis]

    def gradient(self, values: Array) -> Array:
        """Derivatives (nodes, c, d) of fields with values (nodes, c) at the nodes."""
        right = np.concatenate([G @ values for G in self._gradients], axis=1)
        along = self._solved(right).reshape(len(values), -1, values.shape[1])
        return np.swapaxes(along, 1, 2)

    def over_radius(self, values: Array) -> Array:
        """The quotient (nodes,) of a field (nodes,) and the first coordinate."""
        return self._solved((self._by_radius @ values)[:, None])[:, 0]

    @cached_property
    def _mass(self) -> csr_matrix:
        return BilinearForm(lambda u, v, w: u * v).assemble(self.scalar)

    @cached_property
    def _gradients(self) -> list[csr_matrix]:
        forms = [lambda u, v, w, k=k: u.grad[k] * v for k in range(self.scalar.mesh.dim())]
        return [BilinearForm(form).assemble(self.scalar) for form in forms]

    @cached_property
    def _by_radius(self) -> csr_matrix:
        # Gauss points are never on the axis
        return BilinearForm(lambda u, v, w: u * v / w.x[0]).assemble(self.scalar)

    def _solved(self, b: Array) -> Array:
        """``M^-1 b`` for b of shape (nodes, r), all columns at once."""
        M, scale = self._mass, 1.0 / self._mass.diagonal()[:, None]
        x = scale * b
        r = b - M @ x
        z = scale * r
        p, rz = z, np.einsum("ik,ik->k", r, z)
        least = PROJECTED**2 * np.einsum("ik,ik->k", b, scale * b)
        for _ in range(PRODUCTS):
            if np.all(rz <= least):
                break
            Mp = M @ p
            pMp = np.einsum("ik,ik->k", p, Mp)
            step = np.divide(rz, pMp, out=np.zeros_like(rz), where=pMp > 0)
            x, r = x + step * p, r - step * Mp
            z = scale * r
            rz, before = np.einsum("ik,ik->k", r, z), rz
            p = z + np.divide(rz, before, out=np.zeros_like(rz), where=before > 0) * p
        else:  # cells with hardly any volume
            return np.asarray(skfem.solve(M, b))
        return x


_KNOWN: WeakKeyDictionary[Any, Projection] = WeakKeyDictionary()
