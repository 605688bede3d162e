"""What smooth boundaries change of the rows of contact: their gaps, and what moves with the nodes.

The heights are those of `smooth`; here they are weighted as rows are, in the mean of multipliers or
node by node.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import bsr_matrix

from skfem_contact.bodies.normals import across, unit
from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.pairing.smooth import Heights, Place, curved_pairs, heights, of_trace_one
from skfem_contact.pairing.vectors import dot, without_round_off

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Mask = NDArray[np.bool_]


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
    move : ndarray, shape (p, k, k', d, d), or None
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
        v : ndarray, shape (t, n, d)
            Unit vectors from the secondary to the primary.
        gap, weight : ndarray, shape (t, n)
            Of the facets along v [length], and of the quadrature [area].
        beyond : ndarray, shape (t, n, d), optional
            See `heights`.
        node : ndarray of int, shape (p, 1), optional
            Weighted by one at the only place of its piece, in place of the nodes of facets.
        """
        own, other = places
        found = heights(own, other, v, gap, beyond)
        first = np.flatnonzero(np.diff(piece, prepend=-1))
        tests = own.shape if node is None else np.ones((len(piece), 1, 1))
        weighted = np.swapaxes(tests * weight[..., None], 1, 2)
        area = weight.sum(axis=1)
        both = np.add.reduceat(weighted @ np.stack([gap, found.h], axis=-1), first)
        alike, total = (np.add.reduceat(part, first) for part in (found.alike * area, area))
        least = np.minimum.reduceat((gap - found.h).min(axis=1), first)
        move = None
        if found.spreads is not None:
            move = _moves(other, v, found, (weighted, area), first)
        e, f = own.facet[first], other.facet[first]
        gaps, h = both[..., 0], both[..., 1]
        node = own.surface.facets[e] if node is None else node
        return piece[first], cls(node, e, f, gaps, h, alike, total, move, least)

    def blocks(self, primary: ContactSurface, A: Array | None = None) -> tuple[Index, Index, Array]:
        """Rows, columns and blocks (b, d, d) of the moving heights, one for each pair of nodes."""
        assert self.move is not None
        shape = self.move.shape
        G = self.move if A is None else A[self.e] @ self.move.reshape(*shape[:2], -1)
        row = np.broadcast_to(self.node[:, :, None], shape[:3]).ravel()
        column = np.broadcast_to(primary.facets[self.f][:, None], shape[:3]).ravel()
        return row, column, G.reshape(-1, *shape[3:])


#: The share of distances where heights count and curvatures have nothing in common.
TINY = float(np.finfo(float).tiny)

#: Parts of pieces, and the numbers of these.
Parts = Sequence[tuple[Index, Bulges]]


def _moves(place: Place, v: Array, found: Heights, weights: tuple[Array, Array], first: Index) -> Array:
    """``int N_i G_j`` of the nodes of the primary's facets over pieces, (p, k, k', d, d).

    With the gradients and the normal in the middle of a piece.

    Parameters
    ----------
    place : Place
        On the primary.
    v : ndarray, shape (t, n, d)
    found : Heights
    weights : (ndarray, ndarray), shapes (t, k, n) and (t,)
        Shape functions of the secondary times weights of the quadrature, and areas [area].
    first : ndarray of int, shape (p,)
        The first part of each piece.
    """
    assert found.spreads is not None
    weighted, area = weights
    d = v.shape[2]

    def summed(values: Array) -> Array:
        return np.asarray(np.add.reduceat(values, first))

    own, other = (spread.weighted(weighted) for spread in found.spreads)
    T = summed(found.common[:, None] @ (own - other))
    vector = summed(weighted @ (found.h[..., None] * v))
    middle = np.concatenate([place.shape.mean(axis=1), v.mean(axis=1)], axis=1)
    middle = summed(area[:, None] * middle) / summed(area)[:, None]
    M, v = middle[:, :-d], middle[:, -d:]
    g, normal = _gradients(Place(place.surface, place.facet[first], M))
    P = np.eye(d) - normal[:, :, None] * normal[:, None]
    T = P[:, None] @ T @ P[:, None]
    T = 0.5 * (T + np.swapaxes(T, -1, -2)) * dot(v, normal)[:, None, None, None]
    along = (vector @ normal[..., None])[..., 0]
    rest = along - np.trace(T, axis1=-2, axis2=-1)
    T += rest[..., None, None] * of_trace_one(P @ found.ways[first] @ P)[:, None]
    Tg = np.swapaxes(T @ np.swapaxes(g, 1, 2)[:, None], 2, 3)
    G = Tg[:, :, :, None] * normal[:, None, None, :, None]
    G -= (along[..., None, None] * g[:, None])[..., None] * normal[:, None, None, None]
    turned = vector @ np.swapaxes(g, 1, 2)
    for i in range(d):
        G[..., i, i] += turned
    return G


def _gradients(place: Place) -> tuple[Array, Array]:
    """Surface gradients (p, k, d) of shape functions at a place each, and unit normals (p, d)."""
    surface, facet, M = place
    kind, nodes = surface.kind, surface.points[surface.facets[facet]]
    slopes = kind.shapes(M @ kind.locations)[1]
    J = np.swapaxes(nodes, 1, 2) @ slopes
    metric = np.swapaxes(J, 1, 2) @ J
    return slopes @ np.linalg.solve(metric, np.swapaxes(J, 1, 2)), unit(across(np.swapaxes(J, 1, 2)))


def bulged(
    secondary: ContactSurface,
    primary: ContactSurface,
    parts: Parts,
    pieces: tuple[Index, Array],
    A: Array,
    normal: Array,
    rows: tuple[Array, Mask],
) -> tuple[Array | None, Array | None, bsr_matrix | None]:
    """What weighted gaps change by (m,), `Pairing.smooth`, and the movement; None where nothing does.

    As far as curvatures agree the weighted gap is the mean of distances, not of vectors whose
    directions differ.

    Parameters
    ----------
    secondary, primary : ContactSurface
    parts : sequence of (ndarray, Bulges)
        Parts of pieces, and the numbers of these.
    pieces : (ndarray, ndarray), shapes (p,) and (p, k, d)
        Facets of the secondary of the pieces, and ``int N_i (x_s - x_p)`` between facets.
    A : ndarray, shape (nf, k, k)
        The multipliers of each facet in its shape functions.
    normal : ndarray, shape (m, d)
    rows : (ndarray, ndarray), shape (m,)
        What rows are divided by [area], and which there are.
    """
    if not parts:
        return None, None, None
    (by, there), (e, apart) = rows, pieces
    m, count, faces = len(by), len(e), secondary.facets
    alike, area = (
        sum(np.bincount(piece, getattr(part, name), count) for piece, part in parts)
        for name in ("alike", "area")
    )
    alike = np.maximum(np.divide(alike, area, out=np.zeros(count), where=area > 0), TINY)
    vectors = dot(A[e] @ apart, normal[faces[e]])
    total = -np.bincount(faces[e].ravel(), (alike[:, None] * vectors).ravel(), m)
    for piece, part in parts:
        scalar = alike[piece, None] * part.gap - part.height
        total += np.bincount(part.node.ravel(), (A[part.e] @ scalar[..., None]).ravel(), m)
    change = np.divide(total, by, out=np.zeros(m), where=there)
    smooth = np.zeros(m)
    acts = A[e].any(axis=2)
    np.maximum.at(smooth, faces[e][acts], np.broadcast_to(alike[:, None], acts.shape)[acts])
    blocks = [part.blocks(primary, A) for _, part in parts if part.move is not None]
    bulge = block_matrix(blocks, (m, len(primary.points)), rows) if blocks else None
    return change, smooth, bulge


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
    node, f, M, v = point[some], facet[some], M[some, None], -normal[some, None]
    e = of[node]
    at = np.argmax(secondary.facets[e] == node[:, None], axis=1)
    own, other = Place(secondary, e, np.eye(k)[at][:, None]), Place(primary, f, M)
    foot = M @ primary.points[primary.facets[f]]
    away = secondary.points[node][:, None] - foot
    ones = np.ones((len(some), 1))
    _, part = Bulges.of(
        np.arange(len(some)), (own, other), v, gap[some, None], ones, away, node[:, None]
    )
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
    row, column, data = (np.concatenate(part) for part in zip(*parts, strict=True))
    by, there = rows
    here = there[row]
    row, column, data = row[here], column[here], data[here] / by[row[here], None, None]
    key = row * shape[1] + column
    order = np.argsort(key, kind="stable")
    first = np.flatnonzero(np.diff(key[order], prepend=-1))
    if not len(first):
        return None
    d = data.shape[1]
    blocks = np.add.reduceat(data[order], first, axis=0)
    row, column = row[order][first], column[order][first]
    start = np.searchsorted(row, np.arange(shape[0] + 1))
    return bsr_matrix((blocks, column, start), shape=(shape[0] * d, shape[1] * d))
