"""Strain and rotation of a body, by its displacements."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import skfem
from numpy.typing import NDArray

from skfem_contact.answers.thresholds import ELEMENTS_AT_ONCE
from skfem_contact.bodies.body import Body

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
    for basis in _integrating(body.basis):
        size, turn, volume = _strained(body, basis, u)
        square += float(np.sum(size**2 * volume))
        cubed += float(np.sum(size**3 * volume))
        turned += float(np.sum(turn * volume))
        whole += float(np.sum(volume))
        largest = float(np.maximum(largest, np.max(size)))  # keeps NaN
    return (cubed / square if square > 0 else 0.0), largest, float(np.sqrt(turned / whole))


def _integrating(basis: Any) -> Iterator[Any]:
    """The basis itself; of one that has the numbering alone, others with points on some elements."""
    if basis.X.shape[1]:
        yield basis
        return
    for first in range(0, basis.nelems, ELEMENTS_AT_ONCE):
        some = np.arange(first, min(first + ELEMENTS_AT_ONCE, basis.nelems))
        mapping = basis.mapping
        yield skfem.Basis(basis.mesh, basis.elem, mapping=mapping, intorder=2, elements=some)


def _strained(body: Body, basis: Any, u: Array) -> tuple[Array, Array, Array]:
    """Largest principal strain, squared rotation and volume at all points of a basis."""
    gradient, volume = np.asarray(basis.interpolate(u).grad), basis.dx
    if body.dim == 3:
        G = np.moveaxis(gradient, (0, 1), (2, 3))
        other = np.swapaxes(G, 2, 3)
        size = np.abs(np.linalg.eigvalsh(0.5 * (G + other))).max(axis=2)
        # half of the squares of a skew matrix are those of its vector
        return size, np.sum((0.5 * (G - other)) ** 2, axis=(2, 3)) / 2, volume
    (a, b), (c, d) = gradient
    middle, radius = 0.5 * (a + d), np.sqrt(0.25 * (a - d) ** 2 + 0.25 * (b + c) ** 2)
    size = np.abs(middle) + radius
    if body.axisymmetric:
        x = np.asarray(basis.global_coordinates())
        hoop = np.asarray(basis.interpolate(u))[0] / np.maximum(x[0], np.finfo(float).tiny)
        size, volume = np.maximum(size, np.abs(hoop)), volume * x[0]
    return size, 0.25 * (c - b) ** 2, volume
