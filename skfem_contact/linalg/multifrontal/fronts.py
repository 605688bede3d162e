"""What every front of a multifrontal factorisation holds, found before any number is computed.

Front f eliminates the DOFs of one box of a nested dissection, its pivots. Its border is what
these are coupled with further up the tree: by entries of the matrix, or through what the children
of the box left over. The last front holds the DOFs that are kept and eliminates nothing.

Positions count DOFs in the order of elimination, deepest boxes first, so that the pivots of
front f are the positions ``start[f]`` to ``start[f + 1]`` and all of its border comes later.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from skfem_contact.linalg.multifrontal.ordering import dissect, distinct


class Entries(NamedTuple):
    """Stored entries of a matrix on or below the diagonal in its columns that are eliminated.

    Attributes
    ----------
    which : ndarray of int
        Where they are stored.
    row, column : ndarray of int
        Positions in the order of elimination.
    far : ndarray of int
        Those of them whose row is no pivot of the front that eliminates their column.
    """

    which: np.ndarray
    row: np.ndarray
    column: np.ndarray
    far: np.ndarray


@dataclass(frozen=True, eq=False)
class Fronts:
    """The fronts of a matrix; `nf` of them, the last one being what is kept.

    Attributes
    ----------
    order : ndarray of int, shape (n,)
        DOF at each position; the DOFs kept come last, as they were given.
    position : ndarray of int, shape (n,)
        Its inverse.
    start : ndarray of int, shape (nf + 1,)
        First pivot of each front.
    parent : ndarray of int, shape (nf,)
        The front that takes over the border of each front; `nf` for the last one.
    first : ndarray of int, shape (nf + 1,)
        Where the border of each front begins in `border`, `keys` and `target`.
    border : ndarray of int
        Positions in all borders, ascending within each.
    keys : ndarray of int
        ``front * n + position``, ascending: to look up a position in a border.
    target : ndarray of int
        Row of each border position in the parent front, which lists its pivots, then its border.
    panel : ndarray of int, shape (nf + 1,)
        Where the factor of each front begins in the storage of all: ``L11``, then ``L21``.
    schedule : list of int
        All fronts, each subtree in one go: so few leftovers wait for their parents at a time.
    """

    order: np.ndarray
    position: np.ndarray
    start: np.ndarray
    parent: np.ndarray
    first: np.ndarray
    border: np.ndarray
    keys: np.ndarray
    target: np.ndarray
    panel: np.ndarray
    schedule: list[int]

    @property
    def owner(self) -> np.ndarray:
        """The front that each position is a pivot of, (n,)."""
        return np.repeat(np.arange(self.parent.size), np.diff(self.start))

    @property
    def children(self) -> list[list[int]]:
        """The fronts that leave their borders to each front."""
        children: list[list[int]] = [[] for _ in self.parent]
        for front, parent in enumerate(self.parent[:-1].tolist()):
            children[parent].append(front)
        return children

    @property
    def nbytes(self) -> int:
        """Memory of the indices [bytes]; the factors take ``8 * panel[-1]``."""
        per_dof, per_entry = (self.order, self.position), (self.border, self.keys, self.target)
        return sum(array.nbytes for array in per_dof + per_entry)

    @property
    def flops(self) -> float:
        """Multiplications and additions of the factorisation."""
        p, b = np.diff(self.start)[:-1].astype(float), np.diff(self.first)[:-1].astype(float)
        return float(np.sum(p**3 / 3 + p**2 * b + p * b**2))

    @property
    def odd(self) -> list[bool]:
        """Whether the way from each front to the last one has an odd number of steps."""
        odd = [False] * self.parent.size
        for front in range(self.parent.size - 2, -1, -1):
            odd[front] = not odd[self.parent[front]]
        return odd

    @property
    def waiting(self) -> int:
        """Most entries of leftovers that wait for their parents at a time, that in work included."""
        left = np.diff(self.first) ** 2
        waiting = most = 0
        children = self.children
        for front in self.schedule:
            waiting += int(left[front])
            most = max(most, waiting)
            waiting -= sum(int(left[child]) for child in children[front])
        return most

    @property
    def peak(self) -> int:
        """Largest memory that factors and leftovers take together [bytes]."""
        return 8 * (int(self.panel[-1]) + self.waiting) + self.nbytes


def analyse(
    K: Any, points: np.ndarray, keep: np.ndarray, leaf: int, free: np.ndarray | None = None
) -> Fronts:
    """Find the fronts of a matrix.

    Parameters
    ----------
    K : csr_matrix, shape (N, N)
        Symmetric; only the pattern counts.
    points : ndarray, shape (n, d)
        Position of each DOF [length].
    keep : ndarray of int, shape (nk,)
        DOFs that are not eliminated.
    free : ndarray of int, shape (n,), optional
        The rows and columns of `K` that are DOFs, if not all.
    leaf : int
        DOFs in the boxes that are not divided further.

    Returns
    -------
    Fronts
    """
    return analyse_entries(K, points, keep, leaf, free)[0]


def analyse_entries(
    K: Any, points: np.ndarray, keep: np.ndarray, leaf: int, free: np.ndarray | None = None
) -> tuple[Fronts, Entries]:
    """The fronts of a matrix, and its `lower_entries`, which take as long to find again."""
    n = len(points)
    rows = np.arange(n) if free is None else free
    inside = np.ones(n, dtype=bool)
    inside[keep] = False
    interior = np.flatnonzero(inside)
    tree = dissect(K, points[interior], leaf, rows[interior])
    last = tree.parent.size
    order = np.concatenate((interior[np.lexsort((tree.along, tree.owner))], keep))
    position = np.empty(n, dtype=np.int64)
    position[order] = np.arange(n)
    pivots = np.append(np.bincount(tree.owner, minlength=last), len(keep))
    start = np.concatenate(([0], np.cumsum(pivots)))
    parent = np.append(tree.parent, last + 1)

    of_row = np.full(
        K.shape[0], -1, dtype=K.indices.dtype
    )  # narrower than most: there are many entries
    of_row[rows] = position
    entries = lower_entries(K, of_row, start)
    keys = _borders(n, entries, start, parent, tree.levels)
    first = np.searchsorted(keys, np.arange(last + 2) * n)
    front, border = np.divmod(keys, n)
    up = parent[front]
    target = border - start[up]
    far = border >= start[up + 1]
    at = np.searchsorted(keys, up[far] * n + border[far])
    target[far] = pivots[up[far]] + at - first[up[far]]
    panel = np.concatenate(([0], np.cumsum(pivots * (pivots + np.diff(first)))))
    schedule = _depth_first(parent)
    fronts = Fronts(order, position, start, parent, first, border, keys, target, panel, schedule)
    return fronts, entries


def lower_entries(K: Any, position: np.ndarray, start: np.ndarray) -> Entries:
    """What is stored on or below the diagonal in the columns of the fronts that are eliminated.

    Rows and columns without position, -1, are left out.
    """
    i, j = np.repeat(position, np.diff(K.indptr)), position.take(K.indices)
    which = np.flatnonzero((i >= j) & (j >= 0) & (j < start[-2]))
    i, j = i[which], j[which]
    end = np.repeat(start[1:], np.diff(start))  # of the pivots, for each column
    return Entries(which, i, j, np.flatnonzero(i >= end.take(j)))


def find_runs(fronts: Fronts) -> list[list[tuple[int, int, int]]]:
    """For each front, where its border is consecutive in the parent: runs of the border and their rows.

    A run ``(a, b, i)`` is the border from a to b, which are the rows from i on in the parent: all of
    them pivots there, or none.
    """
    size, pivots = np.diff(fronts.first), np.diff(fronts.start)
    begins = np.ones(fronts.target.size, dtype=bool)
    begins[1:] = np.diff(fronts.target) != 1
    begins[fronts.first[:-1][size > 0]] = True
    begins |= fronts.target == np.repeat(np.append(pivots, 0)[fronts.parent], size)
    cuts = np.append(np.flatnonzero(begins), fronts.target.size)
    bounds = np.searchsorted(cuts, fronts.first)
    begin, end, row = cuts[:-1], cuts[1:], fronts.target[cuts[:-1]]
    offset = np.repeat(fronts.first[:-1], np.diff(bounds))
    local = (begin - offset).tolist(), (end - offset).tolist(), row.tolist()
    runs = list(zip(*local, strict=True))
    return [runs[a:b] for a, b in pairwise(bounds.tolist())]


def _borders(
    n: int, entries: Entries, start: np.ndarray, parent: np.ndarray, levels: np.ndarray
) -> np.ndarray:
    """All borders as keys ``front * n + position``, the fronts of one level at a time."""
    key = np.repeat(np.arange(parent.size) * n, np.diff(start))  # of the front of each column
    own = distinct(key.take(entries.column[entries.far]) + entries.row[entries.far])
    bounds = np.searchsorted(own, levels * n)
    keys, inherited = [], np.empty(0, dtype=np.int64)
    for begin, end in pairwise(bounds.tolist()):
        here = distinct(np.concatenate((own[begin:end], inherited)))
        keys.append(here)
        front, i = np.divmod(here, n)
        up = parent[front]
        further = i >= start[up + 1]
        inherited = up[further] * n + i[further]
    return np.concatenate(keys)


def _depth_first(parent: np.ndarray) -> list[int]:
    """All fronts, children before parents and every subtree without interruption."""
    # a front comes after its children and all below them: place by the sizes of the subtrees
    size = [1] * parent.size
    for front, up in enumerate(parent[:-1].tolist()):
        size[up] += size[front]
    free = [0] * parent.size  # the first place of each subtree still to be given away
    schedule = [0] * parent.size
    for front in range(parent.size - 1, -1, -1):
        up = int(parent[front])
        if up < parent.size:
            free[front] = free[up]
            free[up] += size[front]
        schedule[free[front] + size[front] - 1] = front
    return schedule
