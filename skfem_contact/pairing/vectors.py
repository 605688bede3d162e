"""Vectors in the plane, ragged ranges, entries of weights: as all pairings use them."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.sparse import bsr_matrix, csr_matrix

from skfem_contact.arrays import Array, Index, Mask
from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.digits import COMPUTED, ROUND_OFF


def dot(v: Array, w: Array) -> Array:
    """Scalar products along the last axis; of plane vectors in half the time of a sum."""
    if v.shape[-1] == 2:
        return np.asarray(v[..., 0] * w[..., 0] + v[..., 1] * w[..., 1])
    return np.einsum("...d,...d->...", v, w)


def turned(v: Array) -> Array:
    """Vectors turned by +90 degrees: outward normals become the direction of travel."""
    out = np.empty_like(v)
    np.negative(v[..., 1], out=out[..., 0])
    out[..., 1] = v[..., 0]
    return out


def summed(place: Index, values: Array, count: int) -> Array:
    """Sums of values (..., j) by their places (...), in their order, shape (count, j).

    >>> summed(np.array([1, 1]), np.array([[1.0, 2.0], [3.0, 4.0]]), 2).tolist()
    [[0.0, 0.0], [4.0, 6.0]]
    """
    j = values.shape[-1]
    cell = place[..., None] * j + np.arange(j)
    total = np.bincount(cell.ravel(), values.ravel(), count * j)
    return np.asarray(total.reshape(count, j), dtype=np.float64)


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
    W = weights if type(weights) is csr_matrix else csr_matrix(weights)  # SciPy's copy takes long
    return np.repeat(np.arange(W.shape[0]), np.diff(W.indptr)), W.indices, W.data


def assembled(place: tuple[Index, Index], values: Array, shape: tuple[int, int]) -> Any:
    """The matrix of entries at rows and columns, summed where one is met again; zeros are kept.

    What SciPy makes of them, in half its time for the few entries of a contact. Values (n,) make a
    csr_matrix of that shape, blocks (d, d, n) a bsr_matrix of so many blocks.

    >>> print(assembled((np.array([1, 0, 1]), np.array([2, 0, 2])), np.ones(3), (2, 3)).toarray())
    [[1. 0. 0.]
     [0. 0. 2.]]
    """
    row, column = place
    cell = np.asarray(row, dtype=np.int64) * shape[1] + column
    order = np.argsort(cell, kind="stable")
    cell = cell.take(order)
    new = np.ones(len(cell), dtype=bool)
    np.not_equal(cell[1:], cell[:-1], out=new[1:])
    first = np.flatnonzero(new)
    row, column = np.divmod(cell.take(first), shape[1])
    start = np.searchsorted(row, np.arange(shape[0] + 1))
    values = np.take(values, order, axis=-1)
    values = np.add.reduceat(values, first, axis=-1) if len(first) else values
    if values.ndim == 3:
        size = shape[0] * len(values), shape[1] * len(values)
        return bsr_matrix((values.transpose(2, 0, 1), column, start), shape=size)
    index = np.int32 if max(*shape, len(first)) <= np.iinfo(np.int32).max else np.int64
    return csr_matrix((values, column.astype(index), start.astype(index)), shape=shape)


def cross(a: Array, b: Array) -> Array:
    """Vector products (m, d) x (m, d): shape (m, 3) in space, in the plane the one number, (m, 1).

    >>> cross(np.array([[2.0, 0.0]]), np.array([[0.0, 3.0]]))
    array([[6.]])
    """
    if a.shape[-1] == 3:
        return np.cross(a, b)
    return (a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])[..., None]


def without_round_off(
    gap: Array, secondary: ContactSurface, primary: ContactSurface, smooth: Mask
) -> Array:
    """Gaps (m,) that are zero where they are round-off of coordinates, or of `smooth` boundaries.

    Whether surfaces that touch are closed is not for the last digit to say: it would not be the same
    when the bodies are turned.
    """
    scale = max(np.abs(surface.points).max() for surface in (secondary, primary))
    return np.where(np.abs(gap) <= np.where(smooth, COMPUTED, ROUND_OFF) * scale, 0.0, gap)
