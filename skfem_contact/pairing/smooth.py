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

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from skfem_contact.bodies.bare import NoBody
from skfem_contact.bodies.normals import tangents, unit
from skfem_contact.bodies.quadrics import corner_weights
from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.pairing.vectors import dot

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Mask = NDArray[np.bool_]


class Place(NamedTuple):
    """n places on each of p facets of a surface: facets (p,) and shape functions (p, n, k)."""

    surface: ContactSurface
    facet: Index
    shape: Array


class Local(NamedTuple):
    """The smooth boundary of one side at n places on each of p facets.

    ``value`` (p, n), ``slope`` (p, n, d) and ``bend`` (p, n, d, d) are f, its gradient and second
    derivatives there, times ``known`` (p, n), the share of nodes that have a quadric; ``spread``
    (p, n, d, d) is C of linear facets, ``mean`` (p, d, d) the mean of K, and ``strain``
    (p, d, d) that of facets that have moved.
    """

    value: Array
    slope: Array
    bend: Array
    known: Array
    spread: Array | None
    mean: Array
    strain: Array | None = None


@dataclass(frozen=True, eq=False)
class Heights:
    """Heights at n places of each of p pieces, and what moves them.

    Attributes
    ----------
    h : ndarray, shape (p, n)
        By how much the smooth boundaries are closer than the facets, along v [length].
    spread : ndarray, shape (p, n, d, d), or None
        ``C_s - C_p``; None where h does not move with the nodes.
    common, ways : ndarray, shape (p, d, d)
        c, and how the surfaces bend, ``K_s^2 + K_p^2``: along that goes what h has more than tr(T).
    alike : ndarray, shape (p,)
        eta, by how much curvatures agree.
    """

    h: Array
    spread: Array | None
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
    v : ndarray, shape (p, n, d)
        Unit vectors from the secondary to the primary.
    gap : ndarray, shape (p, n)
        Of the facets along v [length].
    beyond : ndarray, shape (p, n, d), optional
        From the places of the primary to points on the line along v, where these are not it [length].
    """
    one, two = _local(own), _local(other, beyond)
    ahead, back = _root(one, v), _root(two, v)
    if beyond is not None:
        back = back + dot(beyond, v)
    # the primary's parallel surface where the secondary is: to close the gap is no bending
    apart = (gap - ahead + back).mean(axis=1)[:, None, None]
    across = tangents(unit(v.mean(axis=1)))
    plane = np.swapaxes(across, 1, 2) @ across
    bends = [plane @ K @ plane for K in (one.mean, two.mean - apart * two.mean @ two.mean)]
    common, alike = _common(bends[0], -bends[1], across)
    ways = one.mean @ one.mean + two.mean @ two.mean
    h = np.zeros_like(gap)
    for side, height, bend, shared in ((one, ahead, bends[0], common), (two, -back, bends[1], -common)):
        if side.spread is None:
            h += height
            continue
        h += _trace(side.spread, shared)
        rest = alike[:, None] * (height - _trace(side.spread, bend))
        h += rest
        if side.strain is not None:  # as the facet has stretched
            h += _trace(side.spread, side.strain @ shared)
            h += rest * np.einsum("pde,pde->p", of_trace_one(ways), side.strain)[:, None]
    spread = None if one.spread is None or two.spread is None else one.spread - two.spread
    return Heights(h, spread, common, ways, alike)


def of_trace_one(K: Array) -> Array:
    """Tensors (..., d, d) over their traces; zero where these are."""
    trace = np.trace(K, axis1=-2, axis2=-1)[..., None, None]
    return np.divide(K, trace, out=np.zeros_like(K), where=trace > 0)


def _common(one: Array, other: Array, T: Array) -> tuple[Array, Array]:
    """The curvature (p, d, d) that both sides are said to have, along tangents T (p, d-1, d); and eta.

    By the principal directions of the sum of both tensors: the other one's, at most twice one's own,
    zero where signs differ.
    """
    a, whole = (T @ K @ np.swapaxes(T, 1, 2) for K in (one, other))
    _, Q = np.linalg.eigh(a + whole)
    a, b = (np.einsum("pai,pab,pbi->pi", Q, K, Q) for K in (a, whole))
    fits, size = a * b > 0, (np.abs(a), np.abs(b))
    shared = np.where(fits, np.sign(a) * np.minimum(2 * size[0], size[1]), 0.0)
    larger = np.maximum(*(np.sum(k * k, axis=1) for k in size))
    least = np.sum(np.where(fits, np.minimum(*size), 0.0) ** 2, axis=1)
    alike = np.sqrt(np.divide(least, larger, out=np.zeros_like(larger), where=larger > 0))
    common = whole - (Q * (b - shared)[:, None]) @ np.swapaxes(Q, 1, 2)
    return np.swapaxes(T, 1, 2) @ common @ T, alike


def _trace(spread: Array, K: Array) -> Array:
    """``tr(C K)`` of C (p, n, d, d) at places and K (p, d, d) of pieces, (p, n)."""
    p, n = spread.shape[:2]
    return np.asarray((spread.reshape(p, n, -1) @ K.reshape(p, -1, 1))[..., 0])


def _root(side: Local, v: Array) -> Array:
    """The smaller root tau of ``f(x + tau v)``; zero without a quadric, or where v never meets it."""
    slope = dot(side.slope, v)
    bend = 0.5 * dot((side.bend @ v[..., None])[..., 0], v)
    root = np.sqrt(np.maximum(slope**2 - 4 * side.value * bend, 0.0))
    below = slope + np.where(slope < 0, -root, root)
    meets = (side.known > 0) & (below != 0)
    return np.divide(-2 * side.value, below, out=np.zeros_like(below), where=meets)


def _local(place: Place, beyond: Array | None = None) -> Local:
    """Blend the quadrics of the nodes of facets at places, or beside them."""
    surface, facet, N = place
    d, first = surface.dim, surface.original
    facets, which = np.unique(facet, return_inverse=True)
    (known, value, slope, bend), x = _table(first, facets)
    strain = None
    if surface is not first:
        turn, strains = _moved(surface, facets, x)
        back = np.swapaxes(turn, 1, 2)
        x, strain = x @ back, strains[which]
        slope, bend = slope @ back, turn[:, None] @ bend @ back[:, None]
    k = x.shape[1]
    parts = [known[..., None], value[..., None], slope, bend.reshape(len(facets), k, d * d), x]
    if not surface.quadratic:
        parts.append((x[..., :, None] * x[..., None, :]).reshape(len(facets), k, d * d))
    found = N @ np.concatenate(parts, axis=2)[which]
    known, value = found[..., 0], found[..., 1]
    slope, bend = found[..., 2 : 2 + d], found[..., 2 + d : 2 + d + d * d].reshape(*N.shape[:2], d, d)
    at, spread = found[..., 2 + d + d * d :][..., :d], None
    if not surface.quadratic:
        squares = found[..., -d * d :].reshape(*N.shape[:2], d, d)
        spread = 0.5 * (squares - at[..., :, None] * at[..., None, :])
    if beyond is not None:
        at = at + beyond
    curve = (bend @ at[..., None])[..., 0]
    value = value + dot(slope + 0.5 * curve, at)
    share = known.mean(axis=1)[:, None, None]
    mean = np.divide(bend.mean(axis=1), share, out=np.zeros_like(bend[:, 0]), where=share > 0)
    return Local(value, slope + curve, bend, known, spread, mean, strain)


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
