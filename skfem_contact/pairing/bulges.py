"""Smooth boundaries in the rows of contact: their gaps, and how these move with the nodes.

The heights are those of `smooth`; here they are weighted as rows are, in the mean of multipliers or
node by node.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.sparse import bsr_matrix

from skfem_contact.arrays import Array, Index, Mask, across, unit
from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.pairing.smooth import Heights, Place, curved_pairs, heights
from skfem_contact.pairing.vectors import assembled, without_round_off
from skfem_contact.records import dataclass


@dataclass(frozen=True, eq=False)
class Bulges:
    """Integrals over pieces of what the smooth boundaries change of gaps, to be weighted as rows are.

    Attributes
    ----------
    node : ndarray of int, shape (p, k)
        Nodes of the secondary whose functions N_i weight, as many as the pieces have each.
    e, f : ndarray of int, shape (p,)
        Facets of the two sides.
    gap, height : ndarray, shape (p, k)
        ``int N_i g`` and ``int N_i h``.
    alike, area : ndarray, shape (p,)
        By how much curvatures agree, integrated, and areas.
    move : ndarray, shape (k, k', d, d, p), or None
        ``int N_i G_j`` where h moves.
    least : ndarray, shape (p,)
        The least gap of a piece [length].
    """

    node: Index
    e: Index
    f: Index
    gap: Array
    height: Array
    alike: Array
    area: Array
    move: Array | None
    least: Array

    @classmethod
    def of(
        cls,
        piece: Index,
        places: tuple[Place, Place],
        v: Array,
        gap: Array,
        weight: Array,
        beyond: Array | None = None,
        node: Index | None = None,
    ) -> tuple[Index, Bulges]:
        """Integrate over pieces, given by t parts of them; and which pieces they are (p,).

        Parameters
        ----------
        piece : ndarray of int, shape (t,)
            Whose parts they are, ascending.
        places : (Place, Place)
            n of each part, on the secondary and on the primary.
        v : ndarray, shape (d, n, t)
            Unit vectors from the secondary to the primary.
        gap, weight : ndarray, shape (n, t)
            Of the facets along v [length], and of the quadrature [area].
        beyond : ndarray, shape (d, n, t), optional
            See `heights`.
        node : ndarray of int, shape (p, 1), optional
            Weighted by one at the only place of its piece, in place of the nodes of facets.
        """
        own, other = places
        found = heights(own, other, v, gap, beyond)
        first = np.flatnonzero(np.diff(piece, prepend=-1))
        weighted = own.shape * weight if node is None else weight[None]
        area = weight.sum(axis=0)

        def summed(values: Array) -> Array:
            return np.asarray(np.add.reduceat(values, first, axis=-1))

        gaps, h = (summed(np.einsum("knt,nt->kt", weighted, x)).T for x in (gap, found.h))
        alike, total = summed(found.alike * area), summed(area)
        least = np.minimum.reduceat((gap - found.h).min(axis=0), first)
        move = None
        if found.spreads is not None:
            move = _moves(other, v, found, (weighted, area), first)
        e, f = own.facet[first], other.facet[first]
        node = own.surface.facets[e] if node is None else node
        return piece[first], cls(node, e, f, gaps, h, alike, total, move, least)

    def blocks(self, primary: ContactSurface, A: Array | None = None) -> tuple[Index, Index, Array]:
        """Rows, columns and blocks (d, d, b) of the moving heights, one for each pair of nodes."""
        assert self.move is not None
        G = self.move
        if A is not None:
            mine = np.take(A.transpose(1, 2, 0), self.e, axis=-1)
            G = np.einsum("ikp,kjabp->ijabp", mine, G)
        k, j, d, _, p = G.shape
        row = np.broadcast_to(self.node.T[:, None], (k, j, p)).ravel()
        column = np.broadcast_to(primary.facets[self.f].T, (k, j, p)).ravel()
        return row, column, G.transpose(2, 3, 0, 1, 4).reshape(d, d, -1)


#: The share of distances where heights count and curvatures have nothing in common.
TINY = float(np.finfo(float).tiny)


def _moves(place: Place, v: Array, found: Heights, weights: tuple[Array, Array], first: Index) -> Array:
    """``int N_i G_j`` of the nodes of the primary's facets over pieces, (k, k', d, d, p).

    With the gradients and the normal in the middle of a piece.

    Parameters
    ----------
    place : Place
        On the primary.
    v : ndarray, shape (d, n, t)
    found : Heights
    weights : (ndarray, ndarray), shapes (k, n, t) and (t,)
        Shape functions of the secondary times weights of the quadrature, and areas [area].
    first : ndarray of int, shape (p,)
        The first part of each piece.
    """
    assert found.spreads is not None
    weighted, area = weights

    def summed(values: Array) -> Array:
        return np.asarray(np.add.reduceat(values, first, axis=-1))

    own, other = (spread.weighted(weighted) for spread in found.spreads)
    T = summed(np.einsum("dep,kefp->kdfp", found.common, own - other))
    vector = summed(np.einsum("knp,dnp->kdp", weighted, found.h * v))
    # of all its parts: which is the first depends on the numbering
    places = place.shape.mean(axis=1), v.mean(axis=1), found.ways
    M, v, ways = (summed(area * x) / summed(area) for x in places)
    g, n = _gradients(Place(place.surface, place.facet[first], M))
    facing = np.einsum("dp,dp->p", v, n)
    along = np.einsum("kdp,dp->kp", vector, n)
    T, trace = _in_plane(0.5 * facing * (T + np.swapaxes(T, 1, 2)), n)
    ways, size = _in_plane(ways, n)
    share = np.divide(along - trace, size, out=np.zeros_like(along), where=size > 0)
    T += share[:, None, None] * ways
    Tg = np.einsum("kabp,jbp->kjap", T, g)
    G = n[:, None] * Tg[:, :, None]
    G -= (along[:, None, None] * g)[:, :, :, None] * n
    turned = np.einsum("kdp,jdp->kjp", vector, g)
    for i in range(len(n)):
        G[:, :, i, i] += turned
    return G


def _in_plane(T: Array, n: Array) -> tuple[Array, Array]:
    """Symmetric tensors (..., d, d, p) in the planes across normals n (d, p), and their traces."""
    P = np.eye(len(n))[:, :, None] - n[:, None] * n
    T = np.einsum("...abp,bcp->...acp", np.einsum("abp,...bcp->...acp", P, T), P)
    return T, np.einsum("...aap->...p", T)


def _gradients(place: Place) -> tuple[Array, Array]:
    """Surface gradients (k, d, p) of shape functions at a place each, and unit normals (d, p)."""
    surface, facet, M = place
    kind, nodes = surface.kind, surface.points[surface.facets[facet]]
    slopes = kind.shapes(M.T @ kind.locations)[1]
    J = np.swapaxes(nodes, 1, 2) @ slopes
    normal = unit(across(np.swapaxes(J, 1, 2)))
    slopes, J = (np.ascontiguousarray(x.transpose(1, 2, 0)) for x in (slopes, J))
    metric = np.einsum("dap,dbp->abp", J, J)
    if len(metric) == 1:
        inverse = 1 / metric
    else:
        (a, b), (_, c) = metric
        inverse = np.array([[c, -b], [-b, a]]) / (a * c - b * b)
    dual = np.einsum("abp,dbp->adp", inverse, J)
    return np.einsum("kap,adp->kdp", slopes, dual), np.ascontiguousarray(normal.T)


def bulged_nodes(
    secondary: ContactSurface,
    primary: ContactSurface,
    feet: tuple[Index, Index, Array],
    normal: Array,
    gap: Array,
) -> tuple[Array, Array | None, bsr_matrix | None]:
    """Gaps of nodes above feet to the smooth boundary (p,), `Pairing.smooth`, and the movement.

    Parameters
    ----------
    secondary, primary : ContactSurface
    feet : (ndarray, ndarray, ndarray), shapes (p,), (p,) and (p, k)
        Nodes of the secondary, facets of the primary and shape functions at the feet.
    normal : ndarray, shape (p, d)
        From the primary to the secondary.
    gap : ndarray, shape (p,)
        Along the normals to the facets [length].
    """
    point, facet, M = feet
    m, k = len(secondary.points), secondary.facets.shape[1]
    of = np.empty(m, dtype=np.intp)
    curved = secondary.quadrics.curved
    for mine in (np.flatnonzero(~curved), np.flatnonzero(curved)):  # best one that is curved
        of[secondary.facets[mine]] = mine[:, None]
    some = np.flatnonzero(curved_pairs(secondary, primary, of[point], facet))
    if not len(some):
        return gap, None, None
    node, f, M = point[some], facet[some], M[some]
    e = of[node]
    at = np.argmax(secondary.facets[e] == node[:, None], axis=1)
    away = secondary.points[node] - np.einsum("pk,pkd->pd", M, primary.points[primary.facets[f]])
    # one place each
    N, M, v, away = (
        np.ascontiguousarray(x.T[:, None]) for x in (np.eye(k)[at], M, -normal[some], away)
    )
    places, ones = (Place(secondary, e, N), Place(primary, f, M)), np.ones((1, len(some)))
    _, part = Bulges.of(np.arange(len(some)), places, v, gap[None, some], ones, away, node[:, None])
    gap, smooth, changed = gap.copy(), np.zeros(m), np.zeros(len(gap), dtype=bool)
    smooth[node] = np.maximum(part.alike, TINY)
    gap[some] -= part.height[:, 0]
    changed[some] = True
    gap = without_round_off(gap, secondary, primary, changed)
    if part.move is None:
        return gap, smooth, None
    every = np.ones(m)
    bulge = block_matrix([part.blocks(primary)], (m, len(primary.points)), (every, every > 0))
    return gap, smooth, bulge


def block_matrix(
    parts: Sequence[tuple[Index, Index, Array]], shape: tuple[int, int], rows: tuple[Array, Mask]
) -> bsr_matrix | None:
    """Sums of blocks by row and column, divided by the areas of the rows that are there."""
    row, column, data = (np.concatenate(part, axis=-1) for part in zip(*parts, strict=True))
    by, there = rows
    here = there[row]
    row, column, data = (np.compress(here, x, axis=-1) for x in (row, column, data))
    return assembled((row, column), data / by[row], shape) if len(row) else None
