"""Numbers in the fronts of a multifrontal factorisation: where they are kept, and how fronts add up."""

from __future__ import annotations

from typing import Any

import numpy as np

from skfem_contact.errors import InputError
from skfem_contact.linalg.multifrontal.fronts import Entries, Fronts
from skfem_contact.linalg.thresholds import SYMMETRIC_TO


def checked_matrix(K: Any, points: np.ndarray, keep: Any) -> tuple[Any, np.ndarray, np.ndarray]:
    K = K.tocsr()
    if not K.has_canonical_format:
        K = K.copy()
        K.sum_duplicates()
    points, keep = np.asarray(points, dtype=float), np.asarray(keep, dtype=np.int64).ravel()
    n = K.shape[0]
    if K.shape != (n, n) or points.ndim != 2 or len(points) != n:
        raise InputError(
            f"K of shape {K.shape} and points of shape {points.shape} do not belong together: "
            "needed are (n, n) and (n, d), a position for each DOF."
        )
    if keep.size and (keep.min() < 0 or keep.max() >= n or np.unique(keep).size < keep.size):
        raise InputError(f"keep must name DOFs from 0 to {n - 1}, each once.")
    x, y = np.random.default_rng(0).standard_normal((2, n))
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
    lower, i, j = entries
    front = np.repeat(np.arange(fronts.parent.size), np.diff(fronts.start))[j]
    pivots = np.diff(fronts.start)[front]
    row, column = i - fronts.start[front], j - fronts.start[front]
    place = fronts.panel[front] + column * pivots + row
    far = row >= pivots
    f = front[far]
    at = np.searchsorted(fronts.keys, f * fronts.order.size + i[far]) - fronts.first[f]
    columns = pivots[far] ** 2 + column[far] * np.diff(fronts.first)[f]
    place[far] = fronts.panel[f] + columns + at
    data = np.zeros(fronts.panel[-2])
    data[place] = K.data[lower]
    return data


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


@np.errstate(all="ignore")  # the triangles that do not count hold whatever was in memory
def extend_add(
    F11: np.ndarray,
    F21: np.ndarray,
    F22: np.ndarray,
    C: np.ndarray,
    rows: np.ndarray,
    cuts: Any,
    first: bool,
) -> None:
    """Add what a child left over; only the lower triangles count (here: upper, transposed).

    With the `first` child of a front `F22` holds nothing yet: it is written, and zeros beside it.
    """
    p = len(F11)
    if 12 * len(cuts) > len(rows):  # scattered: one by one
        if first:
            F22.fill(0.0)
        k = int(rows.searchsorted(p))
        near, far = rows[:k], rows[k:] - p
        F11[near[:, None], near] += C[:k, :k]
        F21[near[:, None], far] += C[:k, k:]
        F22[far[:, None], far] += C[k:, k:]
        return
    begin = rows[cuts[:-1]].tolist()
    cuts = cuts.tolist()
    pieces = list(zip(cuts[:-1], cuts[1:], begin, strict=True))
    if first:
        _zero_beside(F22, [(i - p, i - p + b - a) for a, b, i in pieces if i >= p])
    for number, (a, b, i) in enumerate(pieces):
        for c, d, j in pieces[number:]:
            if j < p:
                F11[i : i + b - a, j : j + d - c] += C[a:b, c:d]
            elif i < p:
                F21[i : i + b - a, j - p : j - p + d - c] += C[a:b, c:d]
            elif first:
                F22[i - p : i - p + b - a, j - p : j - p + d - c] = C[a:b, c:d]
            else:
                F22[i - p : i - p + b - a, j - p : j - p + d - c] += C[a:b, c:d]


def _zero_beside(F22: np.ndarray, covered: list[tuple[int, int]]) -> None:
    """Zeros in the upper triangle of a front's border, but for what the first child will write."""
    end = len(F22)
    stops = [begin for begin, _ in covered[1:]] + [end]
    F22[: covered[0][0] if covered else end] = 0.0
    for number, (begin, stop) in enumerate(covered):
        for (_, here), there in zip(covered[number:], stops[number:], strict=True):
            F22[begin:stop, here:there] = 0.0
        F22[stop : stops[number], stop:] = 0.0


def mirror(S: np.ndarray, block: int = 256) -> None:
    """Copy the upper triangle of a square array onto the lower one, in place."""
    for begin in range(0, len(S), block):
        end = begin + block
        square = np.triu(S[begin:end, begin:end])
        S[begin:end, begin:end] = square + np.triu(square, 1).T
        S[end:, begin:end] = S[begin:end, end:].T
