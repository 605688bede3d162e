"""The order of elimination and the fronts of a multifrontal factorisation, found before any number.

Nested dissection: a box of nodes is halved across its longest side. The nodes of one half that touch
the other half are the separator: eliminated after both halves, they keep the fill-in within the halves.
Halving on gives a binary tree of boxes, each of which owns its separator; a box of few nodes, a leaf,
owns all of them. Positions only guide the cut, separators are read from the pattern of the matrix,
so that any mesh, element and order of approximation will do.

Front f eliminates the DOFs of one box of the tree, its pivots. Its border is what
these are coupled with further up the tree: by entries of the matrix, or through what the children
of the box left over. The last front holds the DOFs that are kept and eliminates nothing.

Positions count DOFs in the order of elimination, deepest boxes first, so that the pivots of
front f are the positions ``start[f]`` to ``start[f + 1]`` and all of its border comes later.

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
from skfem_contact.linalg.dense_factors import ROWS_AT_ONCE
from skfem_contact.records import dataclass

# DOFs: below, the calls cost more than the arithmetic; above, the fill-in.
LEAF = 120


@dataclass(frozen=True, eq=False)
class Dissection:
    """Tree of boxes, numbered so that children come before their parents, level by level.

    Attributes
    ----------
    owner : ndarray of int, shape (n,)
        The box that eliminates each DOF.
    parent : ndarray of int, shape (nb,)
        Parent of each box; `nb` for the last box, the top of the tree.
    levels : ndarray of int, shape (nl + 1,)
        Boxes ``levels[k]`` to ``levels[k + 1]`` are equally deep; the deepest come first.
    along : ndarray, shape (n,)
        Where each DOF lies along the longest side of what its box owns, from 0 to 1.
    """

    owner: np.ndarray
    parent: np.ndarray
    levels: np.ndarray
    along: np.ndarray


def dissect(A: Any, points: np.ndarray, leaf: int, inside: np.ndarray | None = None) -> Dissection:
    """Divide the DOFs of a matrix by nested dissection.

    Parameters
    ----------
    A : sparse matrix, shape (n, n)
        Only the pattern counts, made symmetric.
    points : ndarray, shape (n, d)
        Position of each DOF [length]. DOFs at one point stay together.
    leaf : int
        Boxes of at most so many DOFs are not divided further.
    inside : ndarray of int, optional
        The DOFs that are divided, if not all; `points` and results are of them, in their order.

    Returns
    -------
    Dissection

    Examples
    --------
    Seven DOFs in a row: the middle one separates the others, which are halved once more.

    >>> import numpy as np
    >>> import scipy.sparse as sp
    >>> A = sp.diags_array([np.ones(6), np.ones(6)], offsets=[-1, 1])
    >>> tree = dissect(A, np.arange(7.0)[:, None], leaf=1)
    >>> tree.owner.tolist(), tree.parent.tolist()
    ([3, 5, 2, 6, 1, 4, 0], [4, 4, 5, 5, 6, 6, 7])
    """
    node, centres = nodes_of(points)
    count, of_all = centres.shape[1], node
    if inside is not None:
        of_all = np.full(A.shape[0], -1)
        of_all[inside] = node
    a, b = _edges(A, of_all, count)
    limit = max(1, leaf * count // max(1, node.size))
    nodes, box = np.arange(count), np.zeros(count, dtype=np.int64)  # sorted by box throughout
    owner = np.zeros(count, dtype=np.int64)  # here the boxes are numbered from the top
    parents, first = [np.array([-1])], 0
    label = np.empty(count, dtype=np.int64)  # the half in which a node lies; -1: has an owner
    while nodes.size:
        owner[nodes] = first + box  # final for the leaves and the separators of this level
        divided = (np.bincount(box, minlength=len(parents[-1])) > limit)[box]
        label[nodes] = -1
        nodes, box = nodes[divided], box[divided]
        if not nodes.size:
            break
        nodes, half = _halves(nodes, box, centres)
        label[nodes] = half
        label[_separators(a, b, label, 2 * len(parents[-1]))] = -1
        side = label.take(a)
        within = np.flatnonzero((side == label.take(b)) & (side >= 0))
        a, b = a.take(within), b.take(within)
        nodes = nodes[label.take(nodes) >= 0]
        start, box = _groups(label.take(nodes))
        parents.append(first + label[nodes[start]] // 2)
        first += len(parents[-2])
    return _from_below(owner, parents, node, centres)


def dissection_order(A: Any, points: np.ndarray) -> np.ndarray:
    """Elimination order by nested dissection, for a sparse factorisation of ``A[p][:, p]``.

    Parameters are those of `dissect`; the order is returned as ndarray of int, shape (n,).
    """
    tree = dissect(A, points, leaf=60)
    return np.lexsort((tree.along, tree.owner))


def borders(
    n: int,
    entries: Iterable[tuple[np.ndarray, ...]],
    start: np.ndarray,
    parent: np.ndarray,
    levels: np.ndarray,
) -> np.ndarray:
    """The borders of all fronts, see `Fronts`, as keys ``front * n + position``; level by level.

    Parameters
    ----------
    n : int
        DOFs, those that are kept included.
    entries : iterable of tuples of ndarray
        As of `lower_entries`.
    start, parent, levels : ndarray of int
        As of `Fronts` and `Dissection`.
    """
    key = np.repeat(np.arange(parent.size) * n, np.diff(start))  # of the front of each column
    top = (parent.size - 2) * n + np.arange(start[-2], n)  # its border is all that is kept
    beyond = [_distinct(key.take(j[far]) + i[far]) for _, i, j, far in entries]
    own = _distinct(np.concatenate([*beyond, top]))
    bounds = np.searchsorted(own, levels * n)
    keys, inherited = [], np.empty(0, dtype=np.int64)
    for begin, end in pairwise(bounds.tolist()):
        here = _distinct(np.concatenate((own[begin:end], inherited)))
        keys.append(here)
        front, i = np.divmod(here, n)
        up = parent[front]
        further = i >= start[up + 1]
        inherited = up[further] * n + i[further]
    return np.concatenate(keys)


def _distinct(x: np.ndarray) -> np.ndarray:
    """The distinct values of `x` in ascending order; twice as fast as ``np.unique`` on keys."""
    # keys come in runs, one for each row of a matrix: merging them takes half of the time of sorting
    x = np.sort(x, kind="stable")
    return x.take(np.flatnonzero(_changes(x)))


def _changes(x: np.ndarray) -> np.ndarray:
    """Mark what differs from the entry before it."""
    change = np.ones(x.size, dtype=bool)
    np.not_equal(x[1:], x[:-1], out=change[1:])
    return change


def _groups(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """First entry of each run of equal values, and the number of its run for each entry."""
    change = _changes(x)
    return np.flatnonzero(change), np.cumsum(change) - 1


def nodes_of(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Node of each DOF and positions of the nodes, (d, nodes); a node is the DOFs at one point."""
    # One number per point sorts faster than its coordinates. Should two points share a number,
    # they are treated as one node: a slightly worse cut, never a wrong one.
    number = np.zeros(len(points))
    for axis, x in enumerate(points.T):
        number += np.sqrt(axis + 2.0) * x
    _, first, node = np.unique(number, return_index=True, return_inverse=True)
    return node, np.ascontiguousarray(points[first].T)


def _edges(A: Any, node: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Pairs of nodes that the matrix couples, each once; DOFs without node, -1, are left out."""
    A = A.tocsr()
    node, keys = node.astype(A.indices.dtype), [np.zeros(0, dtype=np.int64)]  # narrower than most
    for begin in range(0, A.shape[0], ROWS_AT_ONCE):  # all take more memory than the matrix
        rows = slice(begin, begin + ROWS_AT_ONCE)
        begins = A.indptr[begin : rows.stop + 1]
        i, j = np.repeat(node[rows], np.diff(begins)), node.take(A.indices[begins[0] : begins[-1]])
        # the DOFs of a node are mostly neighbours: less to sort
        once = np.flatnonzero((_changes(j) | _changes(i)) & (i != j) & (np.minimum(i, j) >= 0))
        i, j = i.take(once), j.take(once)
        keys.append(_distinct(np.minimum(i, j) * np.int64(count) + np.maximum(i, j)))
    key = _distinct(np.concatenate(keys))
    return np.divmod(key, max(1, count))


def _halves(nodes: np.ndarray, box: np.ndarray, centres: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Sort the nodes of each box along its longest side and cut in the middle.

    Returns the nodes in their new order and the half ``2 * box + (0 or 1)`` of each. Nodes that
    are level with the middle stay together: on structured meshes that makes a straight cut. No half is
    empty: a box that is cut has two nodes at least, at two places.
    """
    start, local = _groups(box)
    size = np.bincount(local)
    place = 2 * local + _along(centres.take(nodes, axis=1), start, local)
    order = np.argsort(place)
    place = place.take(order)
    middle = place[start + size // 2]
    below, upto = np.searchsorted(place, middle), np.searchsorted(place, middle, side="right")
    cut = np.where(below + upto <= 2 * start + size, upto, below)  # whichever halves are more alike
    return nodes.take(order), 2 * box + (np.arange(nodes.size) >= cut.take(local))


def _along(x: np.ndarray, start: np.ndarray, local: np.ndarray) -> np.ndarray:
    """Position from 0 to 1 along the longest side of each group of consecutive points x, (d, n)."""
    low = np.minimum.reduceat(x, start, axis=1)
    side = np.maximum.reduceat(x, start, axis=1) - low
    axis, group = np.argmax(side, axis=0), np.arange(start.size)
    low, side = low[axis, group], side[axis, group]
    side[side == 0.0] = 1.0
    return (x[axis.take(local), np.arange(local.size)] - low.take(local)) / side.take(local)


def _separators(a: np.ndarray, b: np.ndarray, label: np.ndarray, halves: int) -> np.ndarray:
    """Nodes of one half with a neighbour in the other half, from whichever half has fewer."""
    cross = np.flatnonzero(label.take(a) != label.take(b))
    mark = np.zeros(label.size, dtype=bool)
    mark[a.take(cross)] = mark[b.take(cross)] = True
    touched = np.flatnonzero(mark)
    half = label[touched]
    number = np.bincount(half, minlength=halves).reshape(-1, 2)
    return touched[half % 2 == (number[:, 1] < number[:, 0])[half // 2]]


def _from_below(
    owner: np.ndarray, parents: list[np.ndarray], node: np.ndarray, centres: np.ndarray
) -> Dissection:
    """Number the boxes from the deepest level up, and place the nodes along their separators."""
    parent = np.concatenate(parents)
    owner = parent.size - 1 - owner
    along = np.zeros(owner.size)
    if owner.size:
        order = np.argsort(owner)
        along[order] = _along(centres.take(order, axis=1), *_groups(owner[order]))
    return Dissection(
        owner=owner[node],
        parent=(parent.size - 1 - parent)[::-1],
        levels=np.cumsum([0] + [len(level) for level in parents[::-1]]),
        along=along[node],
    )


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
    # children before parents, and every subtree without interruption
    tree = csr_matrix((np.ones(last), (parent[:-1], np.arange(last))), shape=(last + 1, last + 1))
    schedule = depth_first_order(tree, last, return_predecessors=False)[::-1].tolist()
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
    for begin in range(0, K.shape[0], ROWS_AT_ONCE):
        rows = slice(begin, begin + ROWS_AT_ONCE)
        begins = K.indptr[begin : rows.stop + 1]
        i = np.repeat(of_row[rows], np.diff(begins))
        j = of_row.take(K.indices[begins[0] : begins[-1]])
        which = np.flatnonzero((i >= j) & (j >= 0) & (j < start[-2]))
        i, j = i[which], j[which]
        yield which + begins[0], i, j, i >= end.take(j)


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
