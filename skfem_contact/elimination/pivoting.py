r"""Choice of the DOF that each constraint row gives up, however the rows are coupled.

Rows ``A u = b`` are solved for their pivots, ``u_p = A_p^-1 (b - A_f u_f)``, so the square matrix
``A_p`` of pivot columns has to be invertible, well conditioned and sparse. Every row proposes the
entry it likes best. Rows that know each other's pivots then form a directed graph: row i depends
on row j if it contains the pivot of j. Its strong components are the blocks on the diagonal of
``A_p``, which is block triangular in between:

* no dependence at all (contact without conflicts): ``A_p`` is diagonal;
* chains (a primary node that is secondary elsewhere): blocks of size one, still triangular;
* normal and tangential row of one node: many blocks of size two or three, treated as a batch;
* coincident pivots, cycles, redundant rows: a block whose proposal is singular chooses again, by
  complete pivoting over all its columns. If a new pivot couples it with other blocks, they merge
  and choose again. Blocks only ever grow, so this ends, at worst with one block of all rows.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.sparse.csgraph import connected_components

from skfem_contact.arrays import Array, Mask, entries
from skfem_contact.records import dataclass

# Rows agree if they do so to this part of the largest of |b| + |C||x| (rows scaled to a largest
# coefficient of one): that is how exactly redundant rows are known to be redundant; and what is left of
# a row after elimination counts as nothing below it. Round-off of coordinates (1e-16) and of normals
# computed from small facets (1e-16 * size / facet) is far below, angles that mean anything above.
AGREEMENT = 1e-10


# An entry counts as a pivot if it is at least this part of the largest one: the coefficients of T
# are quotients by the pivot, so that a looser rule would cost more than one digit and spoil the
# condition of T'KT; a stricter one would leave the secondary side already at a normal 80 degrees
# off the only free direction, and couple rows for no gain.
WORTH_PIVOTING = 0.1


# Proposed pivots of a block are taken as they are if its smallest singular value exceeds this
# (three digits lost at most); otherwise the block chooses again.
WELL_CONDITIONED = 1e-3


IntArray = NDArray[np.integer[Any]]
FloatArray = Array


@dataclass(frozen=True, eq=False)
class Pivots:
    """Pivots of independent rows and the inverse of the pivot columns.

    Attributes
    ----------
    rows : ndarray, shape (r,)
        Rows kept, ascending; r is the rank.
    columns : ndarray, shape (r,)
        The pivot column of each kept row.
    inverse : csr_matrix, shape (r, r)
        Inverse of ``A[rows][:, columns]``.
    """

    rows: IntArray
    columns: IntArray
    inverse: sp.csr_matrix


def find_pivots(A: sp.csr_matrix, prefer: Mask | None = None) -> Pivots:
    """Choose a pivot for every independent row of `A`.

    Parameters
    ----------
    A : csr_matrix, shape (k, n)
        Rows, each scaled so that its largest coefficient (before anything was removed from it) is
        one; no duplicate entries.
    prefer : ndarray of bool, shape (n,), optional
        Columns preferred as pivots. By default the columns that the fewest rows contain.

    Examples
    --------
    Two independent rows whose largest components coincide, and their sum:

    >>> A = np.array([[0.8, 0.6, 0.0], [1.0, 0.5, 0.0], [1.0, 0.6, 0.0]])
    >>> pivots = find_pivots(sp.csr_matrix(A))
    >>> len(pivots.rows), sorted(pivots.columns.tolist())
    (2, [0, 1])
    """
    pivot = _best_entries(A, prefer)
    block: IntArray = np.arange(A.shape[0])
    while True:
        coupled = _coupled_rows(A, pivot, block)
        live = pivot >= 0
        # rows of one block stay together, so a block has changed if its component is larger
        before = np.bincount(block[live], minlength=len(block))[block]
        after = np.bincount(coupled[live], minlength=len(block))[coupled]
        changed = np.flatnonzero(live & (after > before))
        block = coupled
        if len(changed) == 0:
            break
        pivot = _choose_again(A, pivot, block, changed, prefer)
    rows = np.flatnonzero(pivot >= 0)
    return Pivots(rows, pivot[rows], _inverse(A[rows], pivot[rows], block[rows]))


def _owner(pivot: IntArray, n: int) -> IntArray:
    """The row that has each column as its pivot; -1 where none has."""
    owner = np.full(n, -1)
    live = np.flatnonzero(pivot >= 0)
    owner[pivot[live]] = live
    return owner


def row_maximum(A: sp.csr_matrix, values: NDArray[Any]) -> NDArray[Any]:
    """Largest of the nonnegative `values` of the entries in each row, 0 where a row is empty."""
    top = np.zeros(A.shape[0], dtype=values.dtype)
    filled = np.flatnonzero(np.diff(A.indptr))
    if len(filled):
        top[filled] = np.maximum.reduceat(values, A.indptr[filled])
    return top


def _best_entries(A: sp.csr_matrix, prefer: Mask | None) -> IntArray:
    """Column each row proposes as pivot; -1 where (nearly) nothing is left of the row."""
    row = entries(A)[0]
    score = np.abs(A.data)
    largest = row_maximum(A, score)
    if prefer is None:
        # as Markowitz: a column of few rows couples few rows
        count = np.bincount(A.indices, minlength=A.shape[1])[A.indices]
        worth = score >= WORTH_PIVOTING * largest[row]
        rarity = np.where(worth, 1.0 / count, 0.0)
        score = score + np.where(worth & (rarity == row_maximum(A, rarity)[row]), 1.0, 0.0)
    else:
        # relative to the row as it was given (scaled to 1), not to what a roller left of it
        score = score + np.where(prefer[A.indices] & (score >= WORTH_PIVOTING), 1.0, 0.0)
    best = np.flatnonzero(score == row_maximum(A, score)[row])
    pivot = np.full(A.shape[0], -1)
    pivot[row[best[::-1]]] = A.indices[best[::-1]]  # reversed: of equals, the first stays
    pivot[largest <= AGREEMENT] = -1
    return pivot


def _coupled_rows(A: sp.csr_matrix, pivot: IntArray, block: IntArray) -> IntArray:
    """Strong components of "row i contains the pivot of row j"; blocks stay together."""
    k = A.shape[0]
    row, owner = entries(A)[0], _owner(pivot, A.shape[1])
    to = owner[A.indices]
    edge = (to >= 0) & (to != row) & (pivot[row] >= 0)
    live = np.flatnonzero(pivot >= 0)
    shared = live[owner[pivot[live]] != live]  # a column can have one owner only
    first = np.full(k, -1)
    first[block[live[::-1]]] = live[::-1]
    bound = live[first[block[live]] != live]
    if not edge.any() and len(bound) == 0:
        return np.arange(k)
    start = (row[edge], owner[pivot[shared]], bound, first[block[bound]])
    end = (to[edge], shared, first[block[bound]], bound)
    i, j = np.concatenate(start), np.concatenate(end)
    graph = sp.csr_matrix((np.ones(len(i), dtype=np.int8), (i, j)), shape=(k, k))
    component: IntArray = connected_components(graph, directed=True, connection="strong")[1]
    return component


def _by_size(block: IntArray, rows: IntArray) -> Iterator[IntArray]:
    """The `rows` block by block: one array (blocks, size) for every size of block."""
    order = rows[np.argsort(block[rows], kind="stable")]
    label = block[order]
    start = np.flatnonzero(np.append(True, label[1:] != label[:-1]))
    size = np.diff(np.append(start, len(order)))
    for s in np.unique(size):
        yield order[start[size == s][:, None] + np.arange(s)]


def _pivot_blocks(A: sp.csr_matrix, rows: IntArray, owner: IntArray) -> FloatArray:
    """Dense pivot columns (blocks, size, size) of blocks of `rows` (blocks, size)."""
    count, size = rows.shape
    place = np.full(A.shape[0] + 1, -1)  # the last place is that of no row (-1)
    place[rows.ravel()] = np.arange(rows.size)
    sub = A[rows.ravel()]
    i, j = entries(sub)[0], place[owner[sub.indices]]
    inside = (j >= 0) & (j // size == i // size)
    i, j = i[inside], j[inside]
    dense = np.zeros((count, size, size))
    dense[i // size, i % size, j % size] = sub.data[inside]
    return dense


def _choose_again(
    A: sp.csr_matrix, pivot: IntArray, block: IntArray, changed: IntArray, prefer: Mask | None
) -> IntArray:
    """Pivots with those of the blocks of the rows `changed` replaced where they do not serve."""
    owner, new = _owner(pivot, A.shape[1]), pivot.copy()
    count = np.bincount(A.indices, minlength=A.shape[1])
    for rows in _by_size(block, changed):
        # rows that share a pivot show as a zero column, that is, a zero singular value
        smallest = np.linalg.svd(_pivot_blocks(A, rows, owner), compute_uv=False)[:, -1]
        rows = rows[smallest < WELL_CONDITIONED]
        if len(rows) == 0:
            continue
        dense, column = _dense_blocks(A, rows)
        own = column >= 0
        holder = owner[column]
        foreign = own & (holder >= 0) & (block[holder] != block[rows[:, :1]])
        private = own & (np.count_nonzero(dense, axis=1) == count[column])
        wanted = private if prefer is None else own & prefer[column]
        # a pivot of another block merges the two: last choice; a private column couples nothing
        rank = 4 * (own & ~foreign) + 2 * wanted + 1 * private
        chosen = _complete_pivoting(dense, rank)
        new[rows] = np.where(chosen >= 0, np.take_along_axis(column, chosen, axis=1), -1)
    return new


def _dense_blocks(A: sp.csr_matrix, rows: IntArray) -> tuple[FloatArray, IntArray]:
    """Blocks (blocks, size, q) over all columns they contain, and these (blocks, q), -1 padded."""
    count, size = rows.shape
    sub = A[rows.ravel()]
    at = entries(sub)[0]
    key, local = np.unique(
        at // size * np.int64(A.shape[1]) + sub.indices,  # sorted by block, then by column
        return_inverse=True,
    )
    key_block = key // A.shape[1]
    width = np.bincount(key_block, minlength=count)
    first = np.cumsum(width) - width
    column = np.full((count, int(width.max())), -1)
    column[key_block, np.arange(len(key)) - first[key_block]] = key % A.shape[1]
    dense = np.zeros((count, size, column.shape[1]))
    dense[at // size, at % size, local - first[at // size]] = sub.data
    return dense, column


def _complete_pivoting(blocks: FloatArray, rank: IntArray) -> IntArray:
    """Pivot column (blocks, size) of each row by Gaussian elimination; -1: the row is redundant.

    Of the entries worth it, those in columns of the highest `rank` (blocks, q) go first, and of
    these the largest. All blocks take a step at a time.
    """
    rest = blocks.copy()
    count, size, q = rest.shape
    chosen = np.full((count, size), -1)
    work = np.arange(count)
    for _ in range(size):
        entry = np.abs(rest[work])
        top = entry.max(axis=(1, 2))
        work, entry, top = (v[top > AGREEMENT] for v in (work, entry, top))
        if len(work) == 0:
            break
        entry /= top[:, None, None]
        entry += np.where(entry >= WORTH_PIVOTING, 2.0 * rank[work][:, None, :], 0.0)
        row, column = np.divmod(entry.reshape(len(work), -1).argmax(axis=1), q)
        chosen[work, row] = column
        pivot_row = rest[work, row]
        factor = rest[work, :, column] / pivot_row[np.arange(len(work)), column][:, None]
        rest[work] -= factor[:, :, None] * pivot_row[:, None, :]
        rest[work, row] = 0.0
        rest[work, :, column] = 0.0
    return chosen


def _inverse(A: sp.csr_matrix, pivot: IntArray, block: IntArray) -> sp.csr_matrix:
    """Inverse of ``A[:, pivot]``, block triangular: the blocks' own, then the chains."""
    k = A.shape[0]
    owner = _owner(pivot, A.shape[1])
    row: list[IntArray] = [np.arange(0)]
    column: list[IntArray] = [np.arange(0)]
    value: list[FloatArray] = [np.zeros(0)]
    for rows in _by_size(block, np.arange(k)) if k else ():
        dense = _pivot_blocks(A, rows, owner)
        shape = dense.shape
        row.append(np.broadcast_to(rows[:, :, None], shape).ravel())
        column.append(np.broadcast_to(rows[:, None, :], shape).ravel())
        value.append(np.ravel(1.0 / dense if shape[1] == 1 else np.linalg.inv(dense)))
    place = np.concatenate(row), np.concatenate(column)
    inverse = sp.csr_matrix((np.concatenate(value), place), shape=(k, k))
    i, j = entries(A)[0], owner[A.indices]
    outside = (j >= 0) & (block[i] != block[j])
    if not outside.any():
        return inverse
    chain = sp.csr_matrix((A.data[outside], (i[outside], j[outside])), shape=(k, k))
    # A_p = inverse^-1 (I - N) with N nilpotent: (I - N)^-1 = (I + N)(I + N^2)(I + N^4)...
    power = -(inverse @ chain)
    while power.nnz:
        inverse = inverse + power @ inverse
        power = power @ power
    return inverse
