"""Layers: where a line meets the primary more than once, the meeting closest to the secondary counts.

Pieces of one cell whose faces hang together, by common vertices, are one sheet and do not overlap.
Only where a cell of the secondary sees several sheets are their pieces cut at each other's edges:
what two have in common is left to the nearer one.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from skfem_contact.pairing.faces.clipping import Polygons, cut, stacked

Array = NDArray[np.float64]
Index = NDArray[np.intp]

#: Gaps (p,) of pieces at places (p, 2) in the planes of their cells.
Gaps = Callable[[Index, Array], Array]


def several_sheets(e: Index, vertices: Index) -> list[tuple[int, Index]]:
    """Pieces with rivals: parts of other sheets over the same cell.

    Parameters
    ----------
    e : ndarray of int, shape (p,)
        The cell of the secondary that each piece is part of.
    vertices : ndarray of int, shape (p, c)
        Vertices of the primary's faces.

    Returns
    -------
    list of (int, ndarray of int)
        Pieces, and their rivals.

    Examples
    --------
    Two triangles with a common edge, and one apart from them:

    >>> over = several_sheets(np.array([7, 7, 7]), np.array([[0, 1, 2], [1, 2, 3], [4, 5, 6]]))
    >>> [(piece, rivals.tolist()) for piece, rivals in over]
    [(0, [2]), (1, [2]), (2, [0, 1])]
    """
    p, c = vertices.shape
    corner = e[:, None] * (1 + vertices.max(initial=0)) + vertices
    _, corner = np.unique(corner, return_inverse=True)
    pairs = np.repeat(np.arange(p), c), p + corner.ravel()
    size = p + corner.max(initial=0) + 1
    graph = coo_matrix((np.ones(p * c), pairs), shape=(size, size))
    _, sheet = connected_components(graph, directed=False)
    sheet = sheet[:p]
    order = np.lexsort((sheet, e))
    start = np.flatnonzero(np.diff(e[order], prepend=-1))
    last = np.append(start[1:], p)[: len(start)] - 1
    several = sheet[order[start]] != sheet[order[last]]
    found = [order[i : j + 1] for i, j in zip(start[several], last[several], strict=True)]
    rivals = [(i, group[sheet[group] != sheet[i]]) for group in found for i in np.sort(group)]
    return [(int(i), np.sort(others)) for i, others in rivals]


def nearest_parts(
    pieces: Polygons, rivals: list[tuple[int, Index]], gaps: Gaps
) -> tuple[Index, Polygons]:
    """Pieces without what rivals are nearer to: the piece that each part is of, and the parts."""
    contested = np.array([piece for piece, _ in rivals])
    free = np.setdiff1d(np.arange(len(pieces.count)), contested)
    of, parts = contested, pieces.some(contested)
    opponents = dict(rivals)
    for turn in range(max(len(others) for _, others in rivals)):
        faced = np.array([opponents[i][turn] if turn < len(opponents[i]) else -1 for i in of])
        busy = np.flatnonzero(faced >= 0)
        done = np.flatnonzero(faced < 0)
        whose, mine, kept = [of[done]], of[busy], [parts.some(done)]
        inside, against = parts.some(busy), faced[busy]
        rival = pieces.some(against)
        for k in range(rival.corners.shape[1]):
            start = rival.corners[:, k]
            following = np.where(k + 1 < rival.count, k + 1, 0)
            along = rival.corners[np.arange(len(following)), following] - start
            edge = (k < rival.count)[:, None]
            # the edges that a rival does not have cut nothing off
            beyond = cut(inside, start, np.where(edge, -along, np.nan))
            inside = inside.where(~edge[:, 0], cut(inside, start, along))
            whose.append(mine)
            kept.append(beyond)
        middle = inside.middles
        own, theirs = np.abs(gaps(mine, middle)), np.abs(gaps(against, middle))
        nearer = (own < theirs) | ((own == theirs) & (mine < against))
        whose.append(mine[nearer])
        kept.append(inside.some(np.flatnonzero(nearer)))
        of, parts = np.concatenate(whose), stacked(kept)
        there = np.flatnonzero(parts.count > 2)
        of, parts = of[there], parts.some(there)
    return np.concatenate([free, of]), stacked([pieces.some(free), parts])
