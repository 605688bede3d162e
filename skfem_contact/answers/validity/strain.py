"""Strain and rotation of a body, by its displacements."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from skfem_contact.bodies.body import Body
from skfem_contact.bodies.quadrature import (
    DeferredBasis,
    chunks,
    integrates,
    scalar_element,
    shape_gradients,
)

Array = NDArray[np.float64]


def strains(body: Body, u: Array) -> tuple[float, float, float]:
    """Strain and rotation of a body.

    Parameters
    ----------
    body : Body
    u : ndarray, shape (n_body,)
        [length]

    Returns
    -------
    mean : float
        Largest principal strain, averaged with its own square: where most of the energy is.
    largest : float
        In any point of integration.
    rotation : float
        Root of the mean square over the body [rad].
    """
    square = cubed = turned = whole = largest = 0.0
    basis = body.basis
    if not integrates(basis):  # it has the numbering alone
        basis = DeferredBasis(basis.mesh, basis.elem, mapping=basis.mapping, dofs=basis.dofs)
    for elements in chunks(basis, 8 * basis.Nbfun * basis.X.shape[1]):
        size, turn, volume = _strained(body, basis, u, elements)
        square += float(np.sum(size**2 * volume))
        cubed += float(np.sum(size**3 * volume))
        turned += float(np.sum(turn * volume))
        whole += float(np.sum(volume))
        largest = float(np.maximum(largest, np.max(size)))  # keeps NaN
    return (cubed / square if square > 0 else 0.0), largest, float(np.sqrt(turned / whole))


def _strained(body: Body, basis: Any, u: Array, elements: Any) -> tuple[Array, Array, Array]:
    """Largest principal strain, squared rotation and volume at the points of some elements, (e, q)."""
    d, X = body.dim, basis.X
    dofs = basis.dofs.element_dofs if elements is None else basis.dofs.element_dofs[:, elements]
    moved = u[dofs].reshape(-1, d, dofs.shape[1])  # (functions, components, elements)
    # (e, c, k) @ (e, k, q) for each coordinate j: derivatives by j of component c
    G = shape_gradients(basis, elements)
    moved_by = np.ascontiguousarray(np.moveaxis(moved, 2, 0).swapaxes(1, 2))
    gradient = np.stack([moved_by @ G[:, j] for j in range(d)], axis=2)  # (e, c, j, q)
    volume = np.abs(basis.mapping.detDF(X, elements)) * basis.W
    if d == 3:
        G = np.moveaxis(gradient, 3, 1)
        other = np.swapaxes(G, 2, 3)
        size = np.abs(np.linalg.eigvalsh(0.5 * (G + other))).max(axis=2)
        # half of the squares of a skew matrix are those of its vector
        return size, np.sum((0.5 * (G - other)) ** 2, axis=(2, 3)) / 2, volume
    (a, b), (c, e) = np.moveaxis(gradient, 0, 2)
    middle, radius = 0.5 * (a + e), np.sqrt(0.25 * (a - e) ** 2 + 0.25 * (b + c) ** 2)
    size = np.abs(middle) + radius
    if body.axisymmetric:
        x = basis.mapping.F(X, elements)[0]
        values = np.stack([scalar_element(basis.elem).lbasis(X, i)[0] for i in range(len(moved))])
        hoop = moved[:, 0].T @ values / np.maximum(x, np.finfo(float).tiny)
        size, volume = np.maximum(size, np.abs(hoop)), volume * x
    return size, 0.25 * (c - b) ** 2, volume
