r"""Smooth boundaries between facets that do not match: how far they are from each other.

Facets cut off what curves bulge. A pin and its hole, a shaft and its hub have one and the same
boundary, and gaps are small against its height above the facets: measured between facets that do not
match, they are gaps between chords. And as bodies strain so do the heights: rows that know the
chords only let a uniform pressure ripple from node to node, by an error of first order in the size of
the facets.

The smooth boundary of either side is ``f = 0`` with the quadrics of its nodes (`bodies.quadrics`).
Where the line along the secondary's unit normal v meets the facets, at x_s and at ``x_p = x_s + g v``,
it is at the heights tau along v,

    f_s(x_s + tau_s v) = 0,    f_p(x_p + tau_p v) = 0.

In terms of tau f is quadratic, and tau its root. With the spread ``C = sum_i<j N_i N_j e_ij e_ij' / 2``
of a linear facet, e the vectors between its nodes, the boundary of the tensor K is by ``tr(K C)`` above
it, but for terms of fourth order.

**What fits.** Two meshes of one surface have no gap: there facets are closer by ``tau_s - tau_p``. A
ball on a flat touches within some facets: there a boundary that bulges above a facet would open light
contacts, and facets are the better model. In between the same contact has to come out for a given
difference of the curvatures, which is all that it depends on (Hertz). So both sides are given one
curvature c in common, along each principal direction that of the primary's parallel surface,
``-K_p' = gap K_p^2 - K_p`` (concentric circles do not differ), if K_s has the same sign, and then

    h = tr(c (C_s - C_p)) + eta (tau_s - tr(K_s C_s) - tau_p - tr(K_p' C_p)),

and the gap is ``g - h``. What the sides have beyond c their facets have, too: the primary none, the
secondary the difference, as if its partner was flat. It is at most its own curvature, for |c| is
limited to ``2 |K_s|``: the facets of a flat secondary see those of a ball. The last term is of fourth
order, and eta the smaller over the larger curvature, 1 where boundaries fit: these are met exactly.
(Quadratic facets bend with the load: all of their own heights counts.)

**Displacements.** The vector ``h v`` moves with the primary's nodes (rows keep one node of the
secondary: what slips strains alike but for the gradient of the slip), by ``sum_k G_k u_k``,

    G_k = (g_k . h v) I - (h v . n) g_k n' + (v . n) n (T g_k)',

where g is the surface gradient of the shape functions and n the normal of the facet. The first two
turn the vector with the facet, the last one stretches it: T is the symmetric part of
``c (C_s - C_p)`` with the trace h. So rows are exact for rigid motions and for a uniform
dilatation, hence for the uniform pressure of round bodies. (Of quadratic facets h is small or, where
they are straight, not known as well; there it does not move.)
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.sparse import bsr_matrix

from skfem_contact.arrays import Array, Index, Mask, across, assembled, dot, tangents, unit
from skfem_contact.bodies.quadrics import corner_weights, principal
from skfem_contact.bodies.surface import ContactSurface, NoBody
from skfem_contact.digits import COMPUTED, ROUND_OFF
from skfem_contact.records import dataclass


class Place(NamedTuple):
    """n places on each of p facets of a surface: facets (p,) and shape functions (k, n, p)."""

    surface: ContactSurface
    facet: Index
    shape: Array


class Spread(NamedTuple):
    """``C = sum_i<j N_i N_j e_ij e_ij' / 2`` at n places on each of p linear facets.

    ``shares`` (q, n, p) are the products ``N_i N_j`` of the q pairs of nodes of a facet, and
    ``squares`` (q, d, d, p) half the ``e_ij e_ij'`` of the vectors between them.
    """

    shares: Array
    squares: Array

    def trace(self, K: Array) -> Array:
        """``tr(C K)`` with K (d, d, p), shape (n, p)."""
        by_pairs = np.einsum("qdep,dep->qp", self.squares, K)
        return np.asarray(np.einsum("qnp,qp->np", self.shares, by_pairs))

    def weighted(self, weights: Array) -> Array:
        """Sums of C over the places, (k, d, d, p), by each of k weights (k, n, p)."""
        by_pairs = np.einsum("knp,qnp->kqp", weights, self.shares)
        return np.asarray(np.einsum("kqp,qdep->kdep", by_pairs, self.squares))


class Local(NamedTuple):
    """The smooth boundary of one side at n places on each of p facets.

    ``height`` (n, p) is tau, zero without a quadric; ``spread`` is C of linear facets, ``mean``
    (d, d, p) the mean of K, and ``strain`` (d, d, p) that of facets that have moved.
    """

    height: Array
    spread: Spread | None
    mean: Array
    strain: Array | None = None


@dataclass(frozen=True, eq=False)
class Heights:
    """Heights at n places of each of p pieces, and what moves them.

    Attributes
    ----------
    h : ndarray, shape (n, p)
        By how much the smooth boundaries are closer than the facets, along v [length].
    spreads : (Spread, Spread), or None
        Of both sides; None where h does not move with the nodes.
    common, ways : ndarray, shape (d, d, p)
        c, and how the surfaces bend, ``K_s^2 + K_p^2``: along that goes what h has more than tr(T).
    alike : ndarray, shape (p,)
        eta, by how much curvatures agree.
    """

    h: Array
    spreads: tuple[Spread, Spread] | None
    common: Array
    ways: Array
    alike: Array


def curved_pairs(secondary: ContactSurface, primary: ContactSurface, e: Index, f: Index) -> Mask:
    """Pairs of facets that are not all there is of their boundaries, (p,): see *What fits*."""
    if isinstance(primary.body, NoBody):
        return np.zeros(len(e), dtype=bool)
    own, other = secondary.quadrics.curved[e], primary.quadrics.curved[f]
    return np.asarray((own & other) | (own & secondary.quadratic) | (other & primary.quadratic))


def heights(own: Place, other: Place, v: Array, gap: Array, beyond: Array | None = None) -> Heights:
    """Heights where places of the secondary meet places of the primary.

    Parameters
    ----------
    own, other : Place
        Of the secondary and of the primary.
    v : ndarray, shape (d, n, p)
        Unit vectors from the secondary to the primary.
    gap : ndarray, shape (n, p)
        Of the facets along v [length].
    beyond : ndarray, shape (d, n, p), optional
        From the places of the primary to points on the line along v, where these are not it [length].
    """
    one, two = _local(own, v), _local(other, v, beyond)
    # the primary's parallel surface where the secondary is: to close the gap is no bending
    apart = (gap - one.height + two.height).mean(axis=0)
    squares = [np.einsum("dep,efp->dfp", K, K) for K in (one.mean, two.mean)]
    T = np.ascontiguousarray(tangents(unit(v.mean(axis=1).T)).transpose(1, 2, 0))
    bends = [
        np.einsum("adp,bdp->abp", T, np.einsum("bep,dep->bdp", T, K))
        for K in (one.mean, two.mean - apart * squares[1])
    ]
    shared, alike = _common(bends[0], -bends[1])
    common, ways = _in_space(shared, T), squares[0] + squares[1]
    h = np.zeros_like(gap)
    for side, sign, bend in ((one, 1.0, bends[0]), (two, -1.0, bends[1])):
        height = sign * side.height
        if side.spread is None:
            h += height
            continue
        shared, rest = sign * common, alike
        if side.strain is not None:  # as the facet has stretched
            shared = shared + np.einsum("dep,efp->dfp", side.strain, shared)
            along, trace = np.einsum("dep,dep->p", ways, side.strain), np.einsum("dd...->...", ways)
            rest = rest * (1 + np.divide(along, trace, out=np.zeros_like(along), where=trace > 0))
        h += side.spread.trace(shared - rest * _in_space(bend, T)) + rest * height
    spreads = None if one.spread is None or two.spread is None else (one.spread, two.spread)
    return Heights(h, spreads, common, ways, alike)


def _in_space(k: Array, T: Array) -> Array:
    """Tensors (d, d, p) of curvatures k (d-1, d-1, p) along tangents T (d-1, d, p)."""
    return np.asarray(np.einsum("adp,aep->dep", T, np.einsum("abp,bep->aep", k, T)))


def _common(one: Array, other: Array) -> tuple[Array, Array]:
    """The curvature (d-1, d-1, p) that both sides are said to have, and eta.

    By the principal directions of the sum of both tensors: the other one's, at most twice one's own,
    zero where signs differ.
    """
    Q = principal(one + other)
    a, b = (np.einsum("dap,dap->ap", Q, np.einsum("dep,eap->dap", K, Q)) for K in (one, other))
    fits, size = a * b > 0, (np.abs(a), np.abs(b))
    shared = np.where(fits, np.sign(a) * np.minimum(2 * size[0], size[1]), 0.0)
    larger = np.maximum(*(np.sum(k * k, axis=0) for k in size))
    least = np.sum(np.where(fits, np.minimum(*size), 0.0) ** 2, axis=0)
    alike = np.sqrt(np.divide(least, larger, out=np.zeros_like(larger), where=larger > 0))
    return other - np.einsum("dap,eap->dep", Q * (b - shared), Q), alike


def _local(place: Place, v: Array, beyond: Array | None = None) -> Local:
    """Blend the quadrics of the nodes of facets at places, or beside them, and cut them along v."""
    surface, facet, N = place
    d, first = surface.dim, surface.original
    used = np.zeros(len(surface.facets), dtype=bool)
    used[facet] = True
    facets, which = np.flatnonzero(used), np.cumsum(used)[facet] - 1
    (known, value, slope, bend), x = _table(first, facets)
    strain = None
    if surface is not first:
        turn, strains = _moved(surface, facets, x)
        back = np.swapaxes(turn, 1, 2)
        x, strain = x @ back, np.take(strains.transpose(1, 2, 0), which, axis=-1)
        slope, bend = slope @ back, turn[:, None] @ bend @ back[:, None]
    one, other = np.triu_indices(d)
    table = np.concatenate(
        [known[..., None], value[..., None], slope, bend[..., one, other], x], axis=2
    )
    # component by component: as many long sums as there are components
    table = np.take(np.ascontiguousarray(table.transpose(1, 2, 0)), which, axis=-1)
    blended = np.einsum("knp,kcp->cnp", N, table)
    known, value, slope = blended[0], blended[1], blended[2 : 2 + d]
    number = np.zeros((d, d), dtype=np.intp)
    number[one, other] = number[other, one] = np.arange(len(one))
    entries, at = blended[2 + d : -d], blended[-d:]
    K = entries[number]
    if beyond is not None:
        at = at + beyond
    curve = np.einsum("abnp,bnp->anp", K, at)
    value = value + np.einsum("anp,anp->np", slope + 0.5 * curve, at)
    slope = np.einsum("anp,anp->np", slope + curve, v)
    half = 0.5 * np.einsum("anp,anp->np", np.einsum("abnp,bnp->anp", K, v), v)
    height = _root(value, slope, half, known > 0)
    if beyond is not None:
        height = height + np.einsum("anp,anp->np", beyond, v)
    mean, share = entries.mean(axis=1), known.mean(axis=0)
    mean = np.divide(mean, share, out=np.zeros_like(mean), where=share > 0)[number]
    spread = None if surface.quadratic else _spread(table[:, -d:], N)
    return Local(height, spread, mean, strain)


def _root(value: Array, slope: Array, half: Array, known: Mask) -> Array:
    """The smaller root of ``value + slope tau + half tau^2``; zero without one, or where not known."""
    root = np.sqrt(np.maximum(slope**2 - 4 * value * half, 0.0))
    below = slope + np.copysign(root, slope)
    return np.divide(-2 * value, below, out=np.zeros_like(below), where=known & (below != 0))


def _spread(x: Array, N: Array) -> Spread:
    """C at places with shape functions N (k, n, p) on facets with nodes x (k, d, p)."""
    i, j = np.triu_indices(len(N), 1)
    e = x[i] - x[j]
    return Spread(N[i] * N[j], 0.5 * e[:, :, None] * e[:, None])


def _table(surface: ContactSurface, facets: Index) -> tuple[tuple[Array, ...], Array]:
    """Coefficients of f seen from the middle of each facet, for each of its nodes, and the nodes there.

    Returns
    -------
    known, value, slope, bend : ndarray, shapes (nf, k), (nf, k), (nf, k, d) and (nf, k, d, d)
        1 where a node has a quadric; f, its gradient and K in the middle, zero where it has none.
    x : ndarray, shape (nf, k, d)
    """
    quadrics, kind = surface.quadrics, surface.kind
    node = surface.facets[facets]
    x = surface.points[node]
    x = x - x[:, : kind.corners].mean(axis=1, keepdims=True)
    known = quadrics.known[node].astype(float)
    n, K = quadrics.normal[node], quadrics.tensor[node]
    curve = (K @ x[..., None])[..., 0]
    table: tuple[Array, ...] = (
        known,
        known * (0.5 * dot(curve, x) - dot(n, x)),
        known[..., None] * (n - curve),
        known[..., None, None] * K,
    )
    straight = ~quadrics.bowed[facets]
    if kind.quadratic and straight.any():
        W = corner_weights(kind)
        table = tuple(_by_corners(part, straight, W) for part in table)
    return table, x


def _by_corners(values: Array, straight: Mask, weights: Array) -> Array:
    """Nodal values (nf, k, ...), of straight facets blended by the functions of the corners."""
    own = np.einsum("kc,fc...->fk...", weights, values[:, : weights.shape[1]])
    return np.where(straight.reshape(-1, *(1,) * (values.ndim - 1)), own, values)


def _moved(surface: ContactSurface, facets: Index, before: Array) -> tuple[Array, Array]:
    """Rotations of facets with their body, and their strains where they are now, both (nf, d, d).

    Parameters
    ----------
    surface : ContactSurface
        That has moved.
    facets : ndarray of int, shape (nf,)
    before : ndarray, shape (nf, k, d)
        Where their nodes were.
    """
    slopes = surface.kind.shapes(surface.kind.middle)[1]
    J, old = (np.swapaxes(x, 1, 2) @ slopes for x in (surface.points[surface.facets[facets]], before))
    n, known = surface.facet_normals[facets], surface.original.facet_normals[facets]
    U, _, V = np.linalg.svd(J @ np.linalg.pinv(old) + n[:, :, None] * known[:, None, :])
    turn = U @ V
    old = turn @ old
    gradient = (J - old) @ np.linalg.pinv(old)
    return turn, 0.5 * (gradient + np.swapaxes(gradient, 1, 2))


def without_round_off(
    gap: Array, secondary: ContactSurface, primary: ContactSurface, smooth: Mask
) -> Array:
    """Gaps (m,) that are zero where they are round-off of coordinates, or of `smooth` boundaries.

    Whether surfaces that touch are closed is not for the last digit to say: it would not be the same
    when the bodies are turned.
    """
    scale = max(np.abs(surface.points).max() for surface in (secondary, primary))
    return np.where(np.abs(gap) <= np.where(smooth, COMPUTED, ROUND_OFF) * scale, 0.0, gap)


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
    ways = np.swapaxes(slopes, 1, 2) @ nodes
    g = slopes @ np.linalg.solve(ways @ np.swapaxes(ways, 1, 2), ways)
    return np.ascontiguousarray(g.transpose(1, 2, 0)), np.ascontiguousarray(unit(across(ways)).T)


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
