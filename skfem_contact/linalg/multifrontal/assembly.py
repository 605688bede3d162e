"""Numbers in the fronts of a multifrontal factorisation: where they are kept, and how fronts add up."""

from __future__ import annotations

from typing import Any

import numpy as np

from skfem_contact.errors import InputError
from skfem_contact.linalg.multifrontal.fronts import Entries, Fronts
from skfem_contact.linalg.thresholds import SYMMETRIC_TO


def checked_matrix(
    K: Any, points: np.ndarray, keep: Any, free: np.ndarray | None = None
) -> tuple[Any, np.ndarray, np.ndarray]:
    K = K.tocsr()
    if not K.has_canonical_format:
        K = K.copy()
        K.sum_duplicates()
    points, keep = np.asarray(points, dtype=float), np.asarray(keep, dtype=np.int64).ravel()
    n = K.shape[0] if free is None else len(free)
    if K.shape[0] != K.shape[1] or points.ndim != 2 or len(points) != n:
        raise InputError(
            f"K of shape {K.shape} and points of shape {points.shape} do not belong together: "
            "needed are (n, n) and (n, d), a position for each DOF."
        )
    if keep.size and (keep.min() < 0 or keep.max() >= n or np.unique(keep).size < keep.size):
        raise InputError(f"keep must name DOFs from 0 to {n - 1}, each once.")
    x, y = np.zeros((2, K.shape[0]))
    rows = slice(None) if free is None else free
    x[rows], y[rows] = np.random.default_rng(0).standard_normal((2, n))
    # x'Ky of random x and y is about as large as the Frobenius norm; cheaper than K - K.T
    difference, size = abs(x @ (K @ y) - y @ (K @ x)), np.linalg.norm(K.data)
    if difference > SYMMETRIC_TO * size:
        raise InputError(
            f"K is not symmetric: x'Ky and y'Kx differ by {difference / size:.1e} of |K| "
            "for random x and y. Both triangles must be stored; otherwise use another solver."
        )
    return K, points, keep


def gather(K: Any, fronts: Fronts, entries: Entries) -> np.ndarray:
    """Storage for all factors, with the entries of `K` in their places."""
    which, i, j, far = entries
    front, pivots, size = fronts.owner, np.diff(fronts.start), np.diff(fronts.first)
    start, panel, p = fronts.start[front], fronts.panel[front], pivots[front]
    column = np.arange(front.size) - start  # in its front
    # of each column: where row 0 would be if all rows were pivots, and if all were of the border
    near = panel + column * p - start
    beyond = panel + p * p + column * size[front] - fronts.first[front]
    place = near.take(j) + i
    i, j = i[far], j[far]
    place[far] = beyond.take(j) + np.searchsorted(fronts.keys, front.take(j) * front.size + i)
    data = np.zeros(fronts.panel[-2])
    data[place] = K.data[which]
    return data


def dense_block(K: Any, keep: np.ndarray) -> np.ndarray:
    """``K[keep][:, keep]`` as dense array, (nk, nk), which SciPy finds by two more matrices."""
    place = np.full(K.shape[0], -1)
    place[keep] = np.arange(keep.size)
    size = np.diff(K.indptr)[keep]
    row = np.repeat(np.arange(keep.size), size)
    # the rows kept follow each other here, in K they begin elsewhere
    stored = np.arange(row.size) + np.repeat(K.indptr[keep] - np.cumsum(size) + size, size)
    column = place.take(K.indices[stored])
    inside = np.flatnonzero(column >= 0)
    block = np.zeros((keep.size, keep.size))
    block[row[inside], column[inside]] = K.data[stored[inside]]
    return block


def panels(data: np.ndarray, fronts: Fronts) -> list[tuple[np.ndarray, np.ndarray]]:
    """Views of ``F11`` and ``F21``, transposed, in the storage of all factors."""
    begin = fronts.panel.tolist()
    sizes = zip(np.diff(fronts.start).tolist(), np.diff(fronts.first).tolist(), strict=True)
    return [
        (data[o : o + p * p].reshape(p, p), data[o + p * p : o + p * (p + b)].reshape(p, b))
        for o, (p, b) in zip(begin[:-2], sizes, strict=False)  # without what is kept
    ]


class Leftovers:
    """Memory of what fronts leave to their parents: one array for all, filled from both ends.

    Fronts of even depth take from its beginning, those of odd depth from its end. So the children of
    a front, which are given back when it is done, are always the last ones taken at their end, and
    memory is touched for the first time once, not in every front: that took as long as the additions.
    """

    def __init__(self, fronts: Fronts) -> None:
        self._sizes = np.diff(fronts.first).tolist()
        self._odd = fronts.odd
        self._memory = np.empty(fronts.waiting)
        self._used = [0, 0]  # entries at either end

    def take(self, front: int) -> np.ndarray:
        """A square for the border of a front, with whatever was there."""
        b, odd = self._sizes[front], self._odd[front]
        begin = self._used[odd] if not odd else self._memory.size - self._used[odd] - b * b
        self._used[odd] += b * b
        return self._memory[begin : begin + b * b].reshape(b, b)

    def give_back(self, children: list[int]) -> None:
        """What the children of one front took is free again."""
        for child in children:
            self._used[self._odd[child]] -= self._sizes[child] ** 2


def extend_add(
    F11: np.ndarray,
    F21: np.ndarray,
    F22: np.ndarray,
    C: np.ndarray,
    rows: np.ndarray,
    runs: list[tuple[int, int, int]],
    first: bool,
) -> None:
    """Add what a child left over; only the lower triangles count (here: upper, transposed).

    With the `first` child of a front `F22` holds zeros as yet: it is written, which is quicker.
    """
    p = len(F11)
    if 6 * (len(runs) + 1) > len(rows):  # scattered: one by one
        k = int(rows.searchsorted(p))
        near, far = rows[:k], rows[k:] - p
        F11[near[:, None], near] += C[:k, :k]
        F21[near[:, None], far] += C[:k, k:]
        F22[far[:, None], far] += C[k:, k:]
        return
    pivots = [run for run in runs if run[2] < p]
    border = [(a, b, i - p) for a, b, i in runs[len(pivots) :]]
    for number, (a, b, i) in enumerate(pivots):
        for c, d, j in pivots[number:]:
            F11[i : i + b - a, j : j + d - c] += C[a:b, c:d]
        for c, d, j in border:
            F21[i : i + b - a, j : j + d - c] += C[a:b, c:d]
    for number, (a, b, i) in enumerate(border):
        for c, d, j in border[number:]:
            if first:
                F22[i : i + b - a, j : j + d - c] = C[a:b, c:d]
            else:
                F22[i : i + b - a, j : j + d - c] += C[a:b, c:d]


def mirror(S: np.ndarray, block: int = 256) -> None:
    """Copy the upper triangle of a square array onto the lower one, in place."""
    for begin in range(0, len(S), block):
        end = begin + block
        square = S[begin:end, begin:end]
        np.copyto(square, square.T, where=np.tri(len(square), k=-1, dtype=bool))
        S[end:, begin:end] = S[begin:end, end:].T
