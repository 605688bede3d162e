"""Nested dissection: an elimination order from the positions of the DOFs.

A box of nodes is halved across its longest side. The nodes of one half that touch the other half
are the separator: eliminated after both halves, they keep the fill-in within the halves. Halving
on gives a binary tree of boxes, each of which owns its separator; a box of few nodes, a leaf,
owns all of them. Positions only guide the cut, separators are read from the pattern of the matrix,
so that any mesh, element and order of approximation will do.
"""

from __future__ import annotations

from collections.abc import Iterable
from itertools import pairwise
from typing import Any

import numpy as np

from skfem_contact.linalg.dense_factors import blocks
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
    for rows in blocks(A.shape[0]):  # of all at once there is more than memory for the matrix
        begins = A.indptr[rows.start : rows.stop + 1]
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
