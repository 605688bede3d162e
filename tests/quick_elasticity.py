"""The form of linear elasticity, assembled quickly: tests do little else as often.

scikit-fem asks a form for every two functions of an element, 6561 times for a hexahedron of order two.
Here all of them in space are one product of matrices, over the same points of integration. In the
plane they are few, and asked one by one: entries of K that are alike are so to the last bit then, and
tests of very slender elements count on rigid motions that cost nothing, to more digits than K has.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import skfem as fem


class QuickElasticity(fem.BilinearForm):
    """``skfem.models.elasticity.linear_elasticity``: and its integrand for whoever asks."""

    def __init__(self, lam: float, mu: float) -> None:
        def form(u: Any, v: Any, w: Any) -> Any:
            a, b = u.grad, v.grad
            d = range(len(a))
            volume = sum(a[i, i] for i in d) * sum(b[i, i] for i in d)
            return lam * volume + mu * sum(a[i, j] * (b[i, j] + b[j, i]) for i in d for j in d)

        super().__init__(form)
        self.moduli = lam, mu

    def _assemble(self, ubasis: Any, vbasis: Any = None, **kwargs: Any) -> Any:
        if vbasis not in (None, ubasis) or kwargs or ubasis.mesh.dim() == 2:
            return super()._assemble(ubasis, vbasis, **kwargs)
        lam, mu = self.moduli
        gradient = np.stack([field.grad for (field,) in ubasis.basis])  # (n, d, d, elements, points)
        n, d, _, elements, points = gradient.shape
        strain = 0.5 * (gradient + gradient.swapaxes(1, 2))
        weighted = 2 * mu * strain * ubasis.dx
        volume = lam * np.einsum("niieq->neq", gradient) * ubasis.dx
        for i in range(d):
            weighted[:, i, i] += volume
        left, right = (
            np.moveaxis(part, 3, 0).reshape(elements, n, d * d * points) for part in (weighted, strain)
        )
        local = left @ right.swapaxes(1, 2)
        local = 0.5 * (local + local.swapaxes(1, 2))  # the same digits on both sides of the diagonal
        dofs = ubasis.element_dofs
        rows = np.broadcast_to(dofs[None, :], (n, n, elements)).ravel()
        columns = np.broadcast_to(dofs[:, None], (n, n, elements)).ravel()
        data = np.moveaxis(local, 0, 2).ravel()
        return np.stack([rows, columns]), data, (ubasis.N, ubasis.N), (n, n)


def linear_elasticity(Lambda: float = 1.0, Mu: float = 1.0) -> Any:
    """The form for Lamé's parameters [stress], in two or three dimensions."""
    return QuickElasticity(Lambda, Mu)
