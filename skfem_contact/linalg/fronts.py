"""The contents of every front of a multifrontal factorisation, found before any number.

Front f eliminates the DOFs of one box of a nested dissection, its pivots. Its border is what
these are coupled with further up the tree: by entries of the matrix, or through what the children
of the box left over. The last front holds the DOFs that are kept and eliminates nothing.

Positions count DOFs in the order of elimination, deepest boxes first, so that the pivots of
front f are the positions ``start[f]`` to ``start[f + 1]`` and all of its border comes later.

Numbers: where they are kept in the fronts.

From the pattern alone it is known how large a factorisation will be.
"""

from __future__ import annotations

import weakref
from collections.abc import Iterable, Iterator
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import depth_first_order

from skfem_contact.digits import SOLVED
from skfem_contact.errors import InputError
from skfem_contact.linalg.dense_factors import blocks
from skfem_contact.linalg.ordering import LEAF, borders, dissect
from skfem_contact.records import dataclass


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
        """Return whether the way from each front to the last one has an odd number of steps."""
        odd = [False] * self.parent.size
        for front in range(self.parent.size - 2, -1, -1):
            odd[front] = not odd[self.parent[front]]
        return odd

    @property
    def waiting(self) -> int:
        """Most entries of leftovers that are there at a time, see `Leftovers`."""
        left = (np.diff(self.first) ** 2).tolist()
        taken, now, most = set(self.schedule[-2:]), 0, 0  # what the top leaves is S
        for front in self.schedule[:-2]:
            for new in {front, int(self.parent[front])} - taken:
                taken.add(new)
                now += left[new]
            most = max(most, now)
            now -= left[front]
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

    entries = lower_entries(K, position, start, free)
    keys = borders(n, entries, start, parent, tree.levels)
    first = np.searchsorted(keys, np.arange(last + 2) * n)
    front, border = np.divmod(keys, n)
    up = parent[front]
    target = border - start[up]
    far = border >= start[up + 1]
    at = np.searchsorted(keys, up[far] * n + border[far])
    target[far] = pivots[up[far]] + at - first[up[far]]
    panel = np.concatenate(([0], np.cumsum(pivots * (pivots + np.diff(first)))))
    schedule = _depth_first(parent)
    return Fronts(order, position, start, parent, first, border, keys, target, panel, schedule)


def lower_entries(
    K: Any, position: np.ndarray, start: np.ndarray, free: np.ndarray | None
) -> Iterator[tuple[np.ndarray, ...]]:
    """What is stored on or below the diagonal in the columns that are eliminated, some rows at a time.

    Of each entry where it is stored, the positions of its row and its column in the order of
    elimination, and whether its row is no pivot of the front that eliminates its column. All of them at
    once would take more memory than K. Rows and columns that are not free are left out.
    """
    of_row = np.full(K.shape[0], -1, dtype=K.indices.dtype)  # narrower than most
    of_row[slice(None) if free is None else free] = position
    end = np.repeat(start[1:], np.diff(start))  # of the pivots, for each column
    for rows in blocks(K.shape[0]):
        begins = K.indptr[rows.start : rows.stop + 1]
        i = np.repeat(of_row[rows], np.diff(begins))
        j = of_row.take(K.indices[begins[0] : begins[-1]])
        which = np.flatnonzero((i >= j) & (j >= 0) & (j < start[-2]))
        i, j = i[which], j[which]
        yield which + begins[0], i, j, i >= end.take(j)


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


def _depth_first(parent: np.ndarray) -> list[int]:
    """All fronts, children before parents and every subtree without interruption."""
    last = parent.size - 1
    tree = csr_matrix((np.ones(last), (parent[:-1], np.arange(last))), shape=(last + 1, last + 1))
    found: list[int] = depth_first_order(tree, last, return_predecessors=False)[::-1].tolist()
    return found


def checked_matrix(
    K: Any, points: np.ndarray, keep: Any, free: np.ndarray | None = None
) -> tuple[Any, np.ndarray, np.ndarray]:
    K = csr_matrix(K)
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
    if difference > SOLVED * size:
        raise InputError(
            f"K is not symmetric: x'Ky and y'Kx differ by {difference / size:.1e} of |K| "
            "for random x and y. Both triangles must be stored; otherwise use another solver."
        )
    return K, points, keep


class Pattern(NamedTuple):
    """The places of the entries of a matrix, whatever they are, as a factorisation needs them.

    Attributes
    ----------
    fronts : Fronts
    places : iterable of pairs of ndarray of int
        Where entries that factors begin with are in the matrix, and where in the storage of all
        factors; some rows at a time. An iterator serves one matrix, a list many.
    spare : list of ndarray
        Storage of factors that nobody has any more: new memory takes the system as long as the factors.
    """

    fronts: Fronts
    places: Iterable[tuple[np.ndarray, np.ndarray]]
    spare: list[Any]

    @classmethod
    def of(
        cls, K: Any, points: np.ndarray, keep: np.ndarray, leaf: int, free: np.ndarray | None
    ) -> Pattern:
        """Say that of one matrix; parameters are those of `MultifrontalCholesky`."""
        fronts = analyse(K, points, keep, leaf, free)
        places = _places(fronts, lower_entries(K, fronts.position, fronts.start, free))
        return cls(fronts, places, [])

    def gather(self, K: Any) -> np.ndarray:
        """Storage for all factors, with the entries of `K` in their places."""
        try:
            memory = self.spare.pop()
            memory[:] = 0.0
        except IndexError:
            memory = np.zeros(self.fronts.panel[-2])
        data = np.frombuffer(memoryview(memory))  # which all views keep alive, and not the memory alone
        weakref.finalize(data, self.spare.append, memory)
        for which, place in self.places:
            data[place] = K.data[which]
        return data


def _places(
    fronts: Fronts, entries: Iterable[tuple[np.ndarray, ...]]
) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Yield where entries are stored in the matrix, and in the storage of all factors."""
    front, pivots, size = fronts.owner, np.diff(fronts.start), np.diff(fronts.first)
    start, panel, p = fronts.start[front], fronts.panel[front], pivots[front]
    column = np.arange(front.size) - start  # in its front
    # of each column: where row 0 would be if all rows were pivots, and if all were of the border
    near = panel + column * p - start
    beyond = panel + p * p + column * size[front] - fronts.first[front]
    for which, i, j, far in entries:
        place = near.take(j) + i
        i, j = i[far], j[far]
        place[far] = beyond.take(j) + np.searchsorted(fronts.keys, front.take(j) * front.size + i)
        yield which, place


def panels(data: np.ndarray, fronts: Fronts) -> list[tuple[np.ndarray, np.ndarray]]:
    """Views of ``F11`` and ``F21``, transposed, in the storage of all factors."""
    begin = fronts.panel.tolist()
    sizes = zip(np.diff(fronts.start).tolist(), np.diff(fronts.first).tolist(), strict=True)
    return [
        (data[o : o + p * p].reshape(p, p), data[o + p * p : o + p * (p + b)].reshape(p, b))
        for o, (p, b) in zip(begin[:-2], sizes, strict=False)  # without what is kept
    ]


@dataclass(frozen=True)
class FactorSize:
    """Size of a factorisation, known before it is computed.

    Attributes
    ----------
    n, kept : int
        DOFs in all and kept.
    memory, peak : int
        What the factors and S take, and what is needed at most meanwhile [bytes].
    flops : float
        Multiplications and additions.
    """

    n: int
    kept: int
    memory: int
    peak: int
    flops: float


def factor_size(
    K: Any, points: np.ndarray, keep: Any = (), *, free: np.ndarray | None = None, leaf: int = LEAF
) -> FactorSize:
    """Size of ``MultifrontalCholesky(K, points, keep, free=free)``, at a fraction of its cost.

    Examples
    --------
    >>> import numpy as np
    >>> import scipy.sparse as sp
    >>> K = sp.diags_array([-np.ones(6), np.full(7, 2.0), -np.ones(6)], offsets=[-1, 0, 1])
    >>> size = factor_size(K, np.arange(7.0)[:, None], keep=[0], leaf=1)
    >>> size.n, size.kept, size.memory < size.peak
    (7, 1, True)
    """
    fronts = analyse(*checked_matrix(K, points, keep, free), leaf, free)
    kept = int(fronts.start[-1] - fronts.start[-2])
    return FactorSize(
        n=fronts.order.size,
        kept=kept,
        memory=8 * int(fronts.panel[-1]) + fronts.nbytes,
        peak=fronts.peak,
        flops=fronts.flops,
    )
