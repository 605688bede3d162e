"""Points that are near each other: few are compared with all, for more SciPy's trees are imported.

That import takes as long as a thousand searches among few points. Both find the
same: where points are equally far, so that it is the tree's order that decides, the tree is asked.
"""

from __future__ import annotations

import sys
from functools import cached_property
from typing import Any

import numpy as np
import scipy  # its parts are imported when they are used: this one takes long
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
Index = NDArray[np.intp]

#: A direction that no mesh has rows along, so that points of a grid have different places on it.
ODD = np.array([0.5410, 0.6180, 0.5704])

# Pairs of points up to which all are compared: from some 20 000 on a tree is made and asked in less. So
# many are compared at a time where there are more: their distances stay in the cache.
FEW_PAIRS = 25_000

# Pairs compared in larger searches before the tree is imported for the next one: they have taken
# as long as the import, .09 s, by then. Whatever comes, no more than twice the least is spent.
WORTH_IMPORT = 10_000_000


class Tree:
    """Points (m, d) among which near ones are looked for.

    Examples
    --------
    >>> tree = Tree([(0.0, 0.0), (1.0, 0.0)])
    >>> [found.tolist() for found in tree.query([(0.75, 0.0), (0.0, 0.5)])]
    [[0.25, 0.5], [1, 0]]
    >>> tree.query_ball_point([(0.75, 0.0)], np.array([0.5]))[0].tolist()
    [1]
    """

    compared = 0  # pairs in larger searches without a tree, in this process so far

    def __init__(self, points: ArrayLike) -> None:
        self.points = np.ascontiguousarray(points, dtype=np.float64)

    @cached_property
    def _large(self) -> Any:
        """SciPy's tree."""
        return scipy.spatial.cKDTree(self.points)

    def _few(self, points: Array) -> bool:
        pairs = len(self.points) * len(points)
        if len(self.points) == 0 or pairs <= FEW_PAIRS:
            return len(self.points) > 0
        if "scipy.spatial" in sys.modules or Tree.compared + pairs > WORTH_IMPORT:
            return False
        Tree.compared += pairs
        return True

    def distances(self, points: ArrayLike) -> Array:
        """Of other points (p, d) from the nearest of the points, (p,)."""
        at = np.asarray(points, dtype=np.float64)
        if not self._few(at):
            return np.asarray(self._large.query(at)[0])
        nearest = [self._squares(at[some]).min(axis=1) for some in self._blocks(at)]
        return np.sqrt(np.concatenate([np.zeros(0), *nearest]))

    def query(self, points: ArrayLike, k: Any = 1, ordered: bool = True) -> tuple[Array, Index]:
        """Distances and numbers of the nearest of the points, as SciPy's trees tell them.

        Parameters
        ----------
        points : array_like, shape (p, d)
        k : int or sequence of int
            How many, at most m, or ``1, 2, ..., k``.
        ordered : bool
            Whether it matters in which order they are told where some are equally far.

        Returns
        -------
        distance, index : ndarray, shape (p,) for the number 1, else (p, k)
        """
        at = np.asarray(points, dtype=np.float64)
        most = k if isinstance(k, int) else len(k)
        found = self._nearest(at, most, ordered) if self._few(at) and most <= len(self.points) else None
        if found is None:
            distance, index = self._large.query(at, k=k)
            return distance, index.astype(np.intp, copy=False)
        distance, index = np.sqrt(found[0]), found[1]
        return (distance[:, 0], index[:, 0]) if isinstance(k, int) and k == 1 else (distance, index)

    def nearest(self, points: ArrayLike) -> Index:
        """Numbers of the nearest of the points, (p,); of some that are equally far any one.

        >>> Tree([(0.0, 0.0), (1.0, 0.0)]).nearest([(0.5, 0.0)]).shape
        (1,)
        """
        at = np.asarray(points, dtype=np.float64)
        if not self._few(at):
            return np.asarray(self._large.query(at)[1], dtype=np.intp)
        first = [self._squares(at[some]).argmin(axis=1) for some in self._blocks(at)]
        return np.concatenate([np.zeros(0, dtype=np.intp), *first])

    def _nearest(self, at: Array, k: int, ordered: bool) -> tuple[Array, Index] | None:
        """Squared distances and numbers of the k nearest; None where SciPy's tree has to say it."""
        m = len(self.points)
        index = np.empty((len(at), k), dtype=np.intp)
        square: Array = np.empty((len(at), k))
        for some in self._blocks(at):
            all_of = self._squares(at[some])
            if k == 1:
                first = all_of.argmin(axis=1)[:, None]
                nearest = np.take_along_axis(all_of, first, axis=1)
                if np.count_nonzero(all_of == nearest) > len(nearest):
                    return None
            else:
                # one more, which must not be as near as the last
                first = np.argpartition(all_of, min(k, m - 1), axis=1)[:, : k + 1]
                nearest = np.take_along_axis(all_of, first, axis=1)
                order = np.argsort(nearest, axis=1)
                first = np.take_along_axis(first, order, axis=1)
                nearest = np.take_along_axis(nearest, order, axis=1)
                alike = nearest[:, 1:] == nearest[:, :-1]
                if np.any(alike if ordered else alike[:, k - 1 :]):
                    return None
            if not np.all(np.isfinite(nearest)):
                return None
            index[some], square[some] = first[:, :k], nearest[:, :k]
        return square, index

    def query_ball_point(self, points: ArrayLike, radius: ArrayLike) -> list[Index]:
        """Numbers of the points that lie in balls around others, in their order, a list of (some,).

        Parameters
        ----------
        points : array_like, shape (p, d)
        radius : array_like, shape (p,)
        """
        at, reach = np.asarray(points, dtype=np.float64), np.asarray(radius, dtype=np.float64)
        if self._few(at):
            return [
                np.flatnonzero(row <= size**2)
                for some in self._blocks(at)
                for row, size in zip(self._squares(at[some]), reach[some], strict=True)
            ]
        return [np.asarray(row, dtype=np.intp) for row in self._large.query_ball_point(at, reach)]

    def pairs(self, others: ArrayLike, distance: float) -> tuple[Index, Index]:
        """Numbers of the points and of others (p, d) that are not farther apart, in their order."""
        at = np.asarray(others, dtype=np.float64)
        if self._few(at):
            near = self._squares(at) <= distance**2
            i, j = np.nonzero(near.T)
            return i, j
        found = self._large.sparse_distance_matrix(Tree(at)._large, distance, output_type="ndarray")
        order = np.lexsort((found["j"], found["i"]))
        return found["i"][order], found["j"][order]

    def _blocks(self, at: Array) -> list[slice]:
        step = max(FEW_PAIRS // len(self.points), 1)
        return [slice(first, first + step) for first in range(0, len(at), step)]

    def _squares(self, at: Array) -> Array:
        """Squared distances (p, m), summed in the order in which SciPy's trees do it."""
        square = np.zeros((len(at), len(self.points)))
        for own, other in zip(self.points.T, at.T, strict=True):
            along = other[:, None] - own
            along *= along
            square += along
        return square


def pairs_within(points: Array, distance: float) -> Index:
    """Pairs of points (m, d) that are not farther apart than a distance, shape (p, 2).

    Usually there are none, and places along one line show it without a tree.

    >>> pairs_within(np.array([(0.0, 0.0), (1.0, 0.0), (1.0, 1e-9)]), 1e-6).tolist()
    [[1, 2]]
    """
    places = np.sort(points @ ODD[: points.shape[1]])
    if np.all(np.diff(places) > distance):  # no line is longer along a direction of unit length
        return np.zeros((0, 2), dtype=np.intp)
    return np.asarray(scipy.spatial.cKDTree(points).query_pairs(distance, output_type="ndarray"))
