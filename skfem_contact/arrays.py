"""Checks of vectors and DOF numbers that users pass, each with one wording; quick work on arrays.

Sums and entries of matrices stand in the middle; tangents, angles and products of vectors
in the plane and in space at the end.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import bsr_matrix, csr_matrix

from skfem_contact.arguments import check_unmasked, shown
from skfem_contact.digits import SOLVED
from skfem_contact.errors import InputError

#: Of numbers, of numbers of nodes and the like, and of what is chosen among them.
Array = NDArray[np.float64]
Index = NDArray[np.intp]
Mask = NDArray[np.bool_]

#: Memory of what is worked on at once [bytes], a small part of what a stiffness takes. Gradients of
#: shape functions take the same time between 256 kB and 128 MB; 15 625 elements that yield take 64 ms
#: with 8 MB, 71 with 32, which leave the caches, and 90 with 1.
AT_ONCE = 8_000_000


def runs(count: int, bytes_each: int) -> list[slice]:
    """Items in runs that take `AT_ONCE` of memory.

    >>> runs(5, AT_ONCE // 2)
    [slice(0, 2, None), slice(2, 4, None), slice(4, 5, None)]
    """
    step = max(1, AT_ONCE // max(1, bytes_each))
    return [slice(first, min(first + step, count)) for first in range(0, count, step)]


def rectangular(value: Any, what: str, wanted: str) -> NDArray[Any]:
    """An array of whatever type; lists that are nested to different depths make none.

    >>> rectangular([[1], 2], "f", "not a vector of 2 numbers")
    Traceback (most recent call last):
        ...
    skfem_contact.errors.InputError: f is [[1], 2] (list), not a vector of 2 numbers
    """
    check_unmasked(value, what)
    try:
        return np.asarray(value)
    except ValueError:
        raise InputError(f"{what} is {shown(value)}, {wanted}") from None


def same(one: NDArray[Any], other: NDArray[Any]) -> bool:
    """Return whether two arrays of one shape are equal; half the time of ``np.array_equal``.

    >>> same(np.zeros(2), np.zeros(2)), same(np.zeros(2), np.ones(2))
    (True, False)
    """
    return bool(np.count_nonzero(one == other) == one.size)


def first_largest(values: NDArray[np.float64]) -> int:
    """Number of the first of the largest: of places that symmetry makes alike, round-off chooses none.

    >>> first_largest(np.array([1.0, 3.0, 3.0 + 1e-12]))
    1
    """
    most = values.max()
    return int(np.argmax(values >= most - SOLVED * abs(most)))


def off_segments(points: Array, start: Array, along: Array) -> Array:
    """Vectors (..., d) from the nearest places of segments to points; segments may be points.

    >>> off_segments(np.array([3.0, 1.0]), np.zeros(2), np.array([2.0, 0.0])).tolist()
    [1.0, 1.0]
    """
    away = points - start
    square = np.maximum(np.einsum("...d,...d->...", along, along), np.finfo(float).tiny)
    part = np.clip(np.einsum("...d,...d->...", away, along) / square, 0.0, 1.0)
    return np.asarray(away - part[..., None] * along)


def summed(place: Index, values: Array, count: int) -> Array:
    """Sums of values (..., j) by their places (...), in their order, shape (count, j).

    >>> summed(np.array([1, 1]), np.array([[1.0, 2.0], [3.0, 4.0]]), 2).tolist()
    [[0.0, 0.0], [4.0, 6.0]]
    """
    j = values.shape[-1]
    cell = place[..., None] * j + np.arange(j)
    total = np.bincount(cell.ravel(), values.ravel(), count * j)
    return np.asarray(total.reshape(count, j), dtype=np.float64)


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


def check_size(array: NDArray[Any], n: int, what: str, why: str) -> None:
    """A vector of n entries; `why` it needs so many ends the message."""
    if array.shape != (n,):
        raise InputError(f"{what} has shape {array.shape}, {why}")


def check_type(array: Any, what: str, why: str, kinds: str = "fiub") -> None:
    """Entries that are numbers of these kinds (NumPy's letters), of an array or a sparse matrix."""
    if array.dtype.kind not in kinds:
        raise InputError(f"{what} has entries of type {array.dtype}, {why}")


def check_finite(
    values: NDArray[Any], what: str, unit: str = "entry", number: NDArray[Any] | None = None
) -> None:
    """No NaN, no infinity; the first is named by its `number`, by default its position.

    >>> check_finite(np.array([0.0, np.nan]), "f")
    Traceback (most recent call last):
        ...
    skfem_contact.errors.InputError: f holds NaN or infinite numbers: 1 of 2 entries, ...
    """
    finite = np.isfinite(values)
    if np.count_nonzero(finite) < finite.size:
        bad = np.flatnonzero(~finite)
        first = bad[0] if number is None else number[bad[0]]
        raise InputError(
            f"{what} holds NaN or infinite numbers: {bad.size} of {values.size} entries, the first "
            f"in {unit} {first}"
        )


def dof_numbers(
    numbers: NDArray[Any], n: int, what: str, usage: str = "", others: str = ""
) -> NDArray[np.int64]:
    """Sorted DOF numbers, from a vector of them or a mask over all n.

    `usage` ends the message about what are no numbers, `others` that about numbers out of range.

    >>> dof_numbers(np.array([2, 0, 2]), 3, "D").tolist()
    [0, 2]
    >>> dof_numbers(np.array([3]), 3, "D")
    Traceback (most recent call last):
        ...
    skfem_contact.errors.InputError: D has numbers from 3 to 3, but there are DOFs 0 to 2
    """
    if numbers.dtype == bool and numbers.shape == (n,):
        return np.flatnonzero(numbers)
    if numbers.size and (numbers.dtype.kind not in "iu" or numbers.ndim != 1):
        raise InputError(
            f"{what} is an array of {numbers.dtype}, shape {numbers.shape}, not of DOF numbers{usage}"
        )
    numbers = np.unique(numbers.astype(np.int64))
    if numbers.size and (numbers[0] < 0 or numbers[-1] >= n):
        raise InputError(
            f"{what} has numbers from {numbers[0]} to {numbers[-1]}, but there are DOFs 0 to {n - 1}"
            f"{others}"
        )
    return numbers


def size_of(values: NDArray[np.float64]) -> float:
    """The largest absolute value, zero where there is none."""
    return float(np.abs(values).max(initial=0.0))


def tangents(normal: np.ndarray) -> np.ndarray:
    """Unit tangents (m, d-1, d) to normals (m, d).

    In 2-D the normal rotated by +90 degrees. In 3-D the projection of the axis that the normal has
    least of, and what makes a right-handed frame with both: a choice on which no answer depends.

    >>> tangents(np.array([[0.0, 1.0]])).tolist()
    [[[-1.0, 0.0]]]
    >>> tangents(np.array([[0.0, 0.0, 1.0]])).tolist()
    [[[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]]
    """
    if normal.shape[1] == 3:
        axis = np.eye(3)[np.argmin(np.abs(normal), axis=1)]
        first = unit(axis - np.einsum("md,md->m", axis, normal)[:, None] * normal)
        return np.stack([first, np.cross(normal, first)], axis=1) + 0.0
    return np.stack([-normal[:, 1], normal[:, 0]], axis=1)[:, None, :]


def angle_between(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Angles between unit vectors (..., d), shape (...) [rad]; exact also where they are small."""
    along = np.einsum("...d,...d->...", one, other)
    product = cross(one, other)
    across = sizes(product) if one.shape[-1] == 3 else np.abs(product[..., 0])
    return np.asarray(np.arctan2(across, along))


def cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Vector products: (..., 3) in space, laid out as these are; in the plane the one number, (..., 1).

    What `numpy.cross` returns, at a third of the time where one component follows the other.

    >>> cross(np.array([[2.0, 0.0, 0.0]]), np.array([[0.0, 3.0, 0.0]])).tolist()
    [[0.0, 0.0, 6.0]]
    >>> cross(np.array([[2.0, 0.0]]), np.array([[0.0, 3.0]])).tolist()
    [[6.0]]
    """
    if a.shape[-1] == 2:
        return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])[..., None]
    out = np.empty_like(a)
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        np.multiply(a[..., j], b[..., k], out=out[..., i])
        out[..., i] -= a[..., k] * b[..., j]
    return out


def across(along: np.ndarray) -> np.ndarray:
    """Outward normals to tangents (..., d-1, d), as long as these, or as their parallelogram is large.

    The body is on the left of a curve, so outward is to the right of the direction of travel.

    >>> across(np.array([[2.0, 0.0]])).tolist(), across(2 * np.eye(3)[:2]).tolist()
    ([0.0, -2.0], [0.0, 0.0, 4.0])
    """
    if along.shape[-1] == 3:
        return cross(along[..., 0, :], along[..., 1, :]) + 0.0  # + 0.0 turns -0.0 into 0.0
    out = np.empty_like(along[..., 0, :])
    np.add(along[..., 0, 1], 0.0, out=out[..., 0])
    np.subtract(0.0, along[..., 0, 0], out=out[..., 1])
    return out


def lengths(vectors: Array) -> Array:
    """Lengths of vectors (m, d), shape (m,); in every iteration, so it is quick."""
    if vectors.shape[1] == 1:
        return np.abs(vectors[:, 0])
    return np.asarray(np.linalg.norm(vectors, axis=1))


def unit_vectors(vectors: Array) -> Array:
    """Vectors (k, d) over their lengths; those of length zero stay.

    >>> unit_vectors(np.array([[3.0, 4.0], [0.0, 0.0]])).tolist()
    [[0.6, 0.8], [0.0, 0.0]]
    """
    if vectors.shape[1] == 1:
        return np.sign(vectors)
    size = lengths(vectors)
    return np.asarray(vectors / np.where(size > 0, size, 1.0)[:, None])


def sizes(vectors: np.ndarray) -> np.ndarray:
    """Lengths of vectors (..., d), shape (...).

    Those of NumPy to the last digit, in a quarter of its time, nearly all of which are passes over two
    or three components.

    >>> sizes(np.array([[3.0, 4.0]])).tolist()
    [5.0]
    """
    squares = vectors[..., 0] ** 2 + vectors[..., 1] ** 2
    if vectors.shape[-1] == 3:
        squares += vectors[..., 2] ** 2
    return np.asarray(np.sqrt(squares))


def unit(vectors: np.ndarray) -> np.ndarray:
    return vectors / sizes(vectors)[..., None]


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


def ragged(start: Index, count: Index) -> Index:
    """``start[0], start[0] + 1, ...`` (count[0] of them), ``start[1], ...``.

    >>> ragged(np.array([5, 0]), np.array([2, 3]))
    array([5, 6, 0, 1, 2])
    """
    before = np.cumsum(count) - count
    return np.arange(count.sum()) + np.repeat(start - before, count)
