"""Where a function is zero: lines in the plane, triangles in space, found on a grid.

Rectangles are cut into triangles and bricks into tetrahedra, so that no case is ambiguous; the function
is taken as linear in each of them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import permutations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Index = NDArray[np.intp]


def zero_lines(function: Callable[[Array], Array], axes: Sequence[Array]) -> tuple[Array, Index]:
    """Points (p, 2) and lines (s, 2) where a function is zero; it is negative on their left.

    >>> points, lines = zero_lines(lambda x: x[1] - 0.5, [np.linspace(0, 1, 2)] * 2)
    >>> points[lines].round(6).tolist()
    [[[0.5, 0.5], [0.0, 0.5]], [[1.0, 0.5], [0.5, 0.5]]]
    """
    values, x = _on_simplices(function, axes)
    found = []
    for k in range(3):
        inside = values < 0
        one = inside[:, k] & (inside.sum(axis=1) == 1)
        two = ~inside[:, k] & (inside.sum(axis=1) == 2)
        a, b = (k + 1) % 3, (k + 2) % 3
        for some, ends in ((one, (a, b)), (two, (b, a))):
            found.append(np.stack([_crossing(values[some], x[some], k, j) for j in ends], axis=1))
    pieces = np.concatenate(found)
    # counter-clockwise triangles: with the corner k inside, from its edge to a to that to b, it is left
    pieces = pieces[np.any(pieces[:, 0] != pieces[:, 1], axis=1)]
    return pieces.reshape(-1, 2), np.arange(2 * len(pieces)).reshape(-1, 2)


def zero_triangles(function: Callable[[Array], Array], axes: Sequence[Array]) -> tuple[Array, Index]:
    """Points (p, 3) and triangles (t, 3) where a function is zero, seen from where it is positive.

    >>> points, triangles = zero_triangles(lambda x: x[2] - 0.5, [np.linspace(0, 1, 2)] * 3)
    >>> x = points[triangles]
    >>> normal = np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0])
    >>> bool(np.all(normal[:, 2] > 0)), float(normal[:, 2].sum() / 2)
    (True, 1.0)
    """
    values, x = _on_simplices(function, axes)
    inside = values < 0
    count, found = inside.sum(axis=1), []
    for k in range(4):  # one corner on its side: a triangle
        alone = ((count == 1) & inside[:, k]) | ((count == 3) & ~inside[:, k])
        others = [j for j in range(4) if j != k]
        found.append(np.stack([_crossing(values[alone], x[alone], k, j) for j in others], axis=1))
    for i, j in ((0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)):  # two and two: a quadrilateral
        both = (count == 2) & inside[:, i] & inside[:, j]
        a, b = (k for k in range(4) if k not in (i, j))
        corners = [_crossing(values[both], x[both], *edge) for edge in ((i, a), (i, b), (j, b), (j, a))]
        found += [np.stack([corners[0], corners[m], corners[m + 1]], axis=1) for m in (1, 2)]
    pieces = np.concatenate(found)
    normal = np.cross(pieces[:, 1] - pieces[:, 0], pieces[:, 2] - pieces[:, 0])
    pieces, normal = (part[np.any(normal != 0, axis=1)] for part in (pieces, normal))
    if len(pieces):  # looking to where the function grows
        step = 1e-3 * min(float(np.diff(axis).min()) for axis in axes)
        middle, ahead = pieces.mean(axis=1), step * normal / np.linalg.norm(normal, axis=1)[:, None]
        ahead = function((middle + ahead).T) - function((middle - ahead).T)
        pieces[ahead < 0] = pieces[ahead < 0][:, ::-1]
    return pieces.reshape(-1, 3), np.arange(3 * len(pieces)).reshape(-1, 3)


def _on_simplices(function: Callable[[Array], Array], axes: Sequence[Array]) -> tuple[Array, Array]:
    """Values (t, d+1) and places (t, d+1, d) of the corners of triangles or tetrahedra on a grid."""
    d = len(axes)
    grid = np.stack(np.meshgrid(*axes, indexing="ij"))
    with np.errstate(all="ignore"):  # where it has no value there is nothing to draw
        values = np.asarray(function(grid.reshape(d, -1)), dtype=float).reshape(grid.shape[1:])
    number = np.arange(values.size).reshape(values.shape)
    corners = []
    for order in permutations(range(d)):  # Kuhn's simplices: from one corner to the opposite one
        at, ways = np.zeros(d, dtype=int), [np.zeros(d, dtype=int)]
        for axis in order:
            at = at + np.eye(d, dtype=int)[axis]
            ways.append(at)
        shifted = [_shifted(number, way) for way in ways]
        if d == 2 and order == (1, 0):
            shifted = [shifted[0], shifted[2], shifted[1]]  # counter-clockwise as the other
        corners.append(np.stack(shifted, axis=1))
    cells = np.concatenate(corners)
    signs, known = values.ravel()[cells] < 0, np.isfinite(values.ravel()[cells]).all(axis=1)
    cells = cells[signs.any(axis=1) & ~signs.all(axis=1) & known]
    return values.ravel()[cells], grid.reshape(d, -1).T[cells]


def _shifted(number: Index, way: Index) -> Index:
    """Numbers of the grid's nodes that are one step along some axes from the first of every cell."""
    for axis, step in enumerate(way):
        number = np.moveaxis(
            np.moveaxis(number, axis, 0)[step : number.shape[axis] - 1 + step], 0, axis
        )
    return number.ravel()


def _crossing(values: Array, x: Array, i: int, j: int) -> Array:
    """The place of the zero between the corners i and j of simplices."""
    way = values[:, i] / (values[:, i] - values[:, j])
    return x[:, i] + way[:, None] * (x[:, j] - x[:, i])
