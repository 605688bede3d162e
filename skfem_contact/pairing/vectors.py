"""Vectors in the plane, ragged ranges, entries of weights: as all pairings use them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix

from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.digits import COMPUTED

Array = NDArray[np.float64]
Index = NDArray[np.intp]


def dot(v: Array, w: Array) -> Array:
    """Scalar products along the last axis; of plane vectors in half the time of a sum."""
    if v.shape[-1] == 2:
        return np.asarray(v[..., 0] * w[..., 0] + v[..., 1] * w[..., 1])
    return np.einsum("...d,...d->...", v, w)


def ahead(v: Array, normal: Array) -> Array:
    """Components of plane vectors (..., 2) along normals turned by +90 degrees, the ways of travel.

    >>> ahead(np.array([2.0, 3.0]), np.array([0.0, 1.0])).tolist()
    -2.0
    """
    return np.asarray(v[..., 1] * normal[..., 0] - v[..., 0] * normal[..., 1])


def turned(v: Array) -> Array:
    """Vectors turned by +90 degrees: outward normals become the direction of travel."""
    return np.stack([-v[..., 1], v[..., 0]], axis=-1)


def ragged(start: Index, count: Index) -> Index:
    """``start[0], start[0] + 1, ...`` (count[0] of them), ``start[1], ...``.

    >>> ragged(np.array([5, 0]), np.array([2, 3]))
    array([5, 6, 0, 1, 2])
    """
    before = np.cumsum(count) - count
    return np.arange(count.sum()) + np.repeat(start - before, count)


def entries(weights: csr_matrix) -> tuple[Index, Index, Array]:
    """Rows, columns and values of the entries of a matrix, row by row; much faster than SciPy's own.

    >>> [part.tolist() for part in entries(csr_matrix([[0.0, 2.0], [3.0, 4.0]]))]
    [[0, 1, 1], [1, 0, 1], [2.0, 3.0, 4.0]]
    """
    W = csr_matrix(weights)
    return np.repeat(np.arange(W.shape[0]), np.diff(W.indptr)), W.indices, W.data


def cross(a: Array, b: Array) -> Array:
    """Vector products (m, d) x (m, d): shape (m, 3) in space, in the plane the one number, (m, 1).

    >>> cross(np.array([[2.0, 0.0]]), np.array([[0.0, 3.0]]))
    array([[6.]])
    """
    if a.shape[-1] == 3:
        return np.cross(a, b)
    return (a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])[..., None]


def without_round_off(gap: Array, secondary: ContactSurface, primary: ContactSurface) -> Array:
    """Gaps (m,) that are zero where they are round-off of coordinates, or of smooth boundaries.

    Whether surfaces that touch are closed is not for the last digit to say: it would not be the same
    when the bodies are turned.
    """
    scale = max(np.abs(surface.points).max() for surface in (secondary, primary))
    return np.where(np.abs(gap) <= COMPUTED * scale, 0.0, gap)
