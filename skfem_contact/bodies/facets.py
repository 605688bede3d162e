"""Facets of a contact surface: shape functions, neighbours, order along the surface, checks."""

from __future__ import annotations

from typing import Any

import numpy as np

from skfem_contact.bodies.selection import written
from skfem_contact.bodies.thresholds import NO_EXTENT, SAME_FACET
from skfem_contact.errors import InputError
from skfem_contact.trees import pairs_within


def facet_shapes(xi: np.ndarray, k: int) -> tuple[np.ndarray, np.ndarray]:
    """Shape functions of a facet and their derivatives at local coordinates.

    Parameters
    ----------
    xi : ndarray, shape (...)
        Local coordinate, 0 at the start and 1 at the end of the facet.
    k : int
        2 (start, end) or 3 (start, end, middle).

    Returns
    -------
    N, dN : ndarray, shape (..., k)

    Examples
    --------
    >>> facet_shapes(np.array([0.0, 0.5]), 3)[0].tolist()
    [[1.0, -0.0, 0.0], [0.0, 0.0, 1.0]]
    """
    xi = np.asarray(xi, dtype=float)
    if k == 2:
        return np.stack([1 - xi, xi], -1), np.stack([-np.ones_like(xi), np.ones_like(xi)], -1)
    N = np.stack([(1 - xi) * (1 - 2 * xi), xi * (2 * xi - 1), 4 * xi * (1 - xi)], -1)
    return N, np.stack([4 * xi - 3, 4 * xi - 1, 4 - 8 * xi], -1)


def facet_neighbours(facets: np.ndarray) -> np.ndarray:
    """Facets before and after each facet, shape (nf, 2); -1 where the surface ends.

    Where more than two facets share a point (two corners touch), the k-th that ends there is
    followed by the k-th that starts there.

    >>> facet_neighbours(np.array([[0, 1], [1, 2], [5, 6]])).tolist()
    [[-1, 1], [0, -1], [-1, -1]]
    """
    start, end = facets[:, 0], facets[:, 1]
    count = len(facets) + 1
    _, ends, starts = np.intersect1d(
        end * count + _occurrence(end),
        start * count + _occurrence(start),
        assume_unique=True,
        return_indices=True,
    )
    neighbours = np.full((len(facets), 2), -1)
    neighbours[starts, 0] = ends
    neighbours[ends, 1] = starts
    return neighbours


def _occurrence(values: np.ndarray) -> np.ndarray:
    """How often each value has appeared before: [7, 3, 7] gives [0, 0, 1]."""
    occurrence = np.zeros(len(values), dtype=np.int64)
    order = np.argsort(values, kind="stable")
    ordered = values[order]
    again = ordered[1:] == ordered[:-1]
    if again.any():
        position = np.arange(len(values))
        first = np.where(np.concatenate([[True], ~again]), position, 0)
        occurrence[order] = position - np.maximum.accumulate(first)
    return occurrence


def order_along(facets: np.ndarray) -> np.ndarray:
    """Order of facets along the surface, piece by piece: that with the first of all facets first."""
    before, after = facet_neighbours(facets).T.tolist()
    order: list[int] = []
    placed = [False] * len(facets)
    for facet in range(len(facets)):
        if placed[facet]:
            continue
        begin = facet
        while before[begin] >= 0:
            begin = before[begin]
            if begin == facet:  # a closed curve begins at the facet that the mesh numbers first
                break
        along = begin
        while along >= 0 and not placed[along]:
            placed[along] = True
            order.append(along)
            along = after[along]
    return np.array(order, dtype=np.intp)


def oriented(mesh: Any, numbers: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Vertices (start, end) of facets, turned so that their element is on the left."""
    ends = mesh.facets[:, numbers].T.astype(np.int64)
    element = mesh.f2t[0, numbers]
    centre = mesh.p.take(mesh.t.take(element, axis=1), axis=1).mean(axis=1)
    start = mesh.p.take(ends[:, 0], axis=1)
    along, inward = mesh.p.take(ends[:, 1], axis=1) - start, centre - start
    left = along[0] * inward[1] - along[1] * inward[0] > 0
    return numbers, np.where(left[:, None], ends, ends[:, ::-1])


def check_facets(
    points: np.ndarray, facets: np.ndarray, numbers: np.ndarray, mesh: Any, label: str
) -> None:
    ends = points.take(facets, axis=0)
    chord = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    # coordinates carry 16 digits of the mesh's extent; anything near that has no direction
    small = NO_EXTENT * np.abs(mesh.doflocs - mesh.doflocs.mean(axis=1, keepdims=True)).max()
    bad = np.flatnonzero(chord <= small)
    if bad.size:
        raise InputError(
            f"surface {label!r}: {bad.size} facets have no length, the first is mesh facet "
            f"{numbers[bad[0]]} at {written(points[facets[bad[0], 0]])}; remove the degenerate "
            "elements from the mesh"
        )
    middle = ends.mean(axis=1)
    pairs = pairs_within(middle, max(small, SAME_FACET * chord.min()))
    if len(pairs):
        i, j = pairs[0]
        raise InputError(
            f"surface {label!r}: {len(pairs)} facets lie twice at the same place, for example "
            f"mesh facets {numbers[i]} and {numbers[j]} at {written(middle[i])}. Both lips of a "
            "slit can not be one surface: select each by its own boundary name or facet numbers"
        )
