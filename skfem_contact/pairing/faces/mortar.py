r"""Dual mortar between faces: the rows of `pairing.mortar`, in space.

    g_i = n_i . (D x_s - M x_m)_i / a_i,    D_ij = int phi_i N_j,    M_ij = int phi_i N_j^primary,

with the multipliers of `dual` on the pieces of `segmentation`. ``D`` is diagonal where faces are whole
and linear or have nine nodes; what is merged, and the corners in the rows of the middles of edges
of the other quadratic faces, stand beside the diagonal.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix

from skfem_contact.bodies.normals import angle_between, tangents, unit
from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.digits import GIVEN, SOLVED
from skfem_contact.errors import InputError
from skfem_contact.pairing.bulges import Bulges, Parts, bulged
from skfem_contact.pairing.faces.dual import DualBasis, dual_basis, node_rows, positive_functions
from skfem_contact.pairing.faces.kinks import least_gaps
from skfem_contact.pairing.faces.segmentation import Segmentation, segment
from skfem_contact.pairing.faces.supports import Supports, find_supports, slip_rows
from skfem_contact.pairing.mortar_rows import (
    divided,
    main_facets,
    node_directions,
    overhang,
    shared_nodes,
    weighted_gaps,
)
from skfem_contact.pairing.node import Pairing
from skfem_contact.pairing.smooth import Place, curved_pairs
from skfem_contact.pairing.supports import FREE, MET, without_multiplier
from skfem_contact.pairing.thresholds import KINK, NO_WEIGHT, SAME_NORMAL, SHARE_KEPT, SPREAD
from skfem_contact.pairing.vectors import dot

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Mask = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Moments:
    """Integrals of products of shape functions over the pieces of an interface.

    Attributes
    ----------
    e, f : ndarray of int, shape (p,)
        Faces of the secondary and of the primary that each piece is part of.
    own : ndarray, shape (nf, k, k)
        ``int N_i N_j`` over the covered part of each face of the secondary [area].
    inside : ndarray, shape (p, k, k)
        The same over each piece [area].
    cross : ndarray, shape (p, k, k')
        ``int N_i N_j^primary`` over each piece [area].
    """

    e: Index
    f: Index
    own: Array
    inside: Array
    cross: Array

    @classmethod
    def of(cls, parts: Segmentation) -> Moments:
        """Integrate over all pieces."""
        e, f = parts.cells[0].facet[parts.e], parts.cells[1].facet[parts.f]
        nf, k = parts.secondary.facets.shape
        p, k_other = len(e), parts.primary.facets.shape[1]
        own, across = np.zeros((p, k * k)), np.zeros((p, k * k_other))
        for piece, points, weight in parts.points():
            add = csr_matrix(
                (np.ones(len(piece)), (piece, np.arange(len(piece)))), shape=(p, len(piece))
            )
            weighted = np.swapaxes(points.N * weight[..., None], 1, 2)
            own += add @ (weighted @ points.N).reshape(len(piece), -1)
            across += add @ (weighted @ points.M).reshape(len(piece), -1)
        of_face = csr_matrix((np.ones(p), (e, np.arange(p))), shape=(nf, p))
        whole = np.asarray(of_face @ own).reshape(nf, k, k)
        return cls(e, f, whole, own.reshape(p, k, k), across.reshape(p, k, k_other))


def dual_mortar(
    secondary: ContactSurface, primary: ContactSurface, *, reach: float | None = None
) -> Pairing:
    """Pair two surfaces of faces in the weighted mean, with dual multipliers on the secondary.

    Parameters
    ----------
    secondary : ContactSurface
        Carries the multipliers: best the finer, or the softer, of the two.
    primary : ContactSurface
    reach : float, optional
        Parts of the surfaces farther apart than this along the normal do not meet [length].

    Returns
    -------
    Pairing
        As that of `pairing.mortar.dual_mortar`, where all words of its notes hold as well.
    """
    if reach is not None and not reach > 0:
        raise InputError(f"reach={reach!r} must be a positive length")
    parts = segment(secondary, primary, reach)
    moments = Moments.of(parts)
    whole = whole_shares(secondary)
    supports = find_supports(parts)
    basis = _bases(secondary, moments, whole, supports)
    owner, exchange = _own_rows(secondary, primary, supports, basis)
    D, area, normal = _secondary_matrix(secondary, basis.share, owner)
    M, facet = _primary_matrix(secondary, primary, moments, basis.A)
    of_secondary, of_primary = normals_of_sides(secondary, primary, moments, basis.A, normal)
    M = M + exchange
    paired = (area > 0) & ~shared_nodes(secondary, primary)
    W_s = divided(D, area, paired)
    sums = np.asarray(M.sum(axis=1), dtype=float).ravel()
    W_m = divided(M, sums, paired)
    for W in (W_s, W_m):
        W.data[np.abs(W.data) < NO_WEIGHT] = 0.0
    W_m.eliminate_zeros()
    bulges, apart, nearest_parts = _bulges(parts, moments)
    change, smooth, bulge = bulged(secondary, primary, bulges, apart, basis.A, normal, (sums, paired))
    least = least_gaps(parts, np.asarray(basis.A.any(axis=2)), nearest_parts)
    gap = weighted_gaps(secondary, primary, normal, (W_s, W_m), change, least)
    handed = np.zeros(len(paired), dtype=bool)
    if supports is not None:
        handed[secondary.facets[supports.rank != FREE]] = True
    miss, nearest = overhang(secondary, primary, paired | handed, reach)
    nominal = np.bincount(secondary.facets.ravel(), whole.ravel(), len(paired))
    return Pairing(
        points=secondary.points,
        normal=normal,
        tangent=tangents(normal),
        gap=np.where(paired, gap, np.inf),
        area=np.where(paired, area, nominal),
        secondary_weights=W_s,
        primary_weights=W_m,
        paired=paired,
        miss=miss,
        facet=np.where(paired, facet, nearest),
        secondary_normal=of_secondary,
        primary_normal=of_primary,
        primary_bulge=bulge,
        smooth=smooth,
        least_gap=least,
        slip_weights=None if supports is None else slip_rows(parts, supports),
    )


def _bulges(parts: Segmentation, moments: Moments) -> tuple[Parts, tuple[Index, Array], Array]:
    """What smooth boundaries change on the pieces that have some, see `bulges.bulged`.

    The last are the least gaps of the pieces, infinite where faces are all there is, (p,).
    """
    secondary, primary, cells = parts.secondary, parts.primary, parts.cells[0]
    some = np.flatnonzero(curved_pairs(secondary, primary, moments.e, moments.f))
    e, f = moments.e[some], moments.f[some]
    apart = moments.inside[some] @ secondary.points[secondary.facets[e]]
    apart -= moments.cross[some] @ primary.points[primary.facets[f]]
    found, least = [], np.full(len(parts.e), np.inf)
    place = np.zeros(len(parts.e), dtype=np.intp)
    place[some] = np.arange(len(some))
    for piece, met, weight in parts.points(some, heights=True):
        turn = cells.axes[parts.e[piece]]
        v = np.broadcast_to(met.normal, (*met.N.shape[:2], 3)) @ turn
        v = v / np.linalg.norm(v, axis=2, keepdims=True)
        places = Place(secondary, met.e, met.N), Place(primary, met.f, met.M)
        pieces, part = Bulges.of(piece, places, v, met.gap, weight)
        found.append((place[pieces], part))
        least[pieces] = np.minimum(least[pieces], part.least)
    return found, (e, apart), least


def normals_of_sides(
    secondary: ContactSurface,
    primary: ContactSurface,
    moments: Moments,
    A: Array,
    own: Array,
) -> tuple[Array, Array]:
    """Normals of both sides in the weighted mean of the multipliers, as `facing.mortar_normals`.

    On a sharp edge or corner, and at a kink, a side has no normal: there that of the other side stands
    for both.

    Parameters
    ----------
    secondary, primary : ContactSurface
    moments : Moments
    A : ndarray, shape (nf, k, k)
        The multipliers in the shape functions of the secondary's faces.
    own : ndarray, shape (m, 3)
        Normals at the nodes of the secondary, turned round.

    Returns
    -------
    of_secondary, of_primary : ndarray, shape (m, 3)
    """
    node, field = secondary.facets[moments.e], primary.facet_node_normals[moments.f]
    total = np.zeros_like(own)
    np.add.at(total, node, A[moments.e] @ moments.cross @ field)
    length = np.linalg.norm(total, axis=1, keepdims=True)
    there = length > SOLVED * length.max(initial=0.0)
    of_primary = np.where(there, total / np.where(there, length, 1.0), own)
    # a corner of the primary, if the mean normals of its pieces spread about theirs
    mean = unit(moments.cross.sum(axis=1)[:, None] @ field)[:, 0]
    along = np.ones(len(own))
    np.minimum.at(along, node, dot(of_primary[node], mean[:, None]))
    corner = along < np.cos(0.5 * SPREAD)
    beside = np.any(primary.kinks[primary.facets[moments.f]] > KINK, axis=1)
    corner[node[beside]] = True
    corner = corner[:, None]
    of_primary = np.where(corner, own, of_primary)
    # an edge of the secondary, if its covered faces have several normals there
    covered = np.unique(moments.e)
    turned, node = np.zeros(len(own)), secondary.facets[covered]
    np.maximum.at(turned, node, angle_between(secondary.facet_node_normals[covered], -own[node]))
    sharp = ((turned > SAME_NORMAL) | (secondary.kinks > KINK))[:, None]
    return np.where(sharp & ~corner, of_primary, own), of_primary


def whole_shares(surface: ContactSurface) -> Array:
    """Integrals of what the multipliers are dual to over whole faces, shape (nf, k) [area]."""
    kind, nodes = surface.kind, surface.points[surface.facets]
    at, weight = kind.quadrature(2 * kind.degree)
    N, dN = kind.shapes(at)
    along = np.swapaxes(dN, 1, 2) @ nodes[:, None]
    area = np.linalg.norm(np.cross(along[..., 0, :], along[..., 1, :]), axis=-1) * weight
    if surface.body.measure is not None:
        area = area * surface.body.measure(np.moveaxis(N @ nodes, -1, 0))
    return np.asarray(area @ N @ positive_functions(kind).T)


def _bases(
    surface: ContactSurface, moments: Moments, whole: Array, supports: Supports | None
) -> DualBasis:
    """Multipliers of all faces; zero where nothing is covered."""
    nf, k = surface.facets.shape
    covered = np.unique(moments.e)
    share = moments.own.sum(axis=2) @ positive_functions(surface.kind).T
    total = np.bincount(surface.facets.ravel(), share.ravel(), len(surface.points))[surface.facets]
    without = None if supports is None else without_multiplier(supports.rank)[covered]
    some = dual_basis(surface.kind, moments.own[covered], whole[covered], total[covered], without)
    A, S, share = np.zeros((nf, k, k)), np.zeros((nf, k, k)), np.zeros((nf, k))
    A[covered], S[covered], share[covered] = some.A, some.S, some.share
    return DualBasis(A, S, share)


def _own_rows(
    secondary: ContactSurface, primary: ContactSurface, supports: Supports | None, basis: DualBasis
) -> tuple[Array, csr_matrix]:
    """S of the rows of the secondary, and what rule 2 of `pairing.supports` changes in ``M``.

    Nodes held on both sides get their share back, with a row of node-to-segment contact.
    """
    shape = (len(secondary.points), len(primary.points))
    if supports is None:
        return basis.S, csr_matrix(shape)
    faces, owner = secondary.facets[supports.facet], basis.S.copy()
    S, share = basis.S[supports.facet], basis.share[supports.facet]
    own = np.einsum("hii->hi", S)
    back = (own == 0) & (share > 0) & (supports.rank[supports.facet] == MET)
    lent = np.where(back[:, None, :], S * share[:, None, :], 0.0)  # to row, of node
    # what is left of the rows that lent it must be rows
    total = np.bincount(secondary.facets.ravel(), (basis.S @ basis.share[..., None]).ravel(), shape[0])
    given = np.bincount(faces.ravel(), lent.sum(axis=2).ravel(), shape[0])
    poor = (total - given < SHARE_KEPT * (1 - GIVEN) * given)[faces]
    back &= ~np.any((lent > 0) & poor[:, :, None], axis=1)
    lent = np.where(back[:, None, :], lent, 0.0)
    h, i = np.nonzero(back)
    owner[supports.facet[h], :, i] = 0.0
    owner[supports.facet[h], i, i] = 1.0
    change = -lent
    change[h, i, i] += share[h, i]
    change = change @ node_rows(secondary.kind)
    data = change[..., None] * supports.weight[:, None]  # (h, row, node, k')
    row = np.broadcast_to(faces[:, :, None, None], data.shape)
    column = np.broadcast_to(supports.opposite[:, None], data.shape)
    return owner, csr_matrix((data.ravel(), (row.ravel(), column.ravel())), shape=shape)


def _secondary_matrix(
    surface: ContactSurface, share: Array, S: Array
) -> tuple[csr_matrix, Array, Array]:
    """Assemble ``D``, the areas ``int phi_i``, and the normals of the primary at the nodes."""
    m, k = len(surface.points), surface.facets.shape[1]
    data = (S * share[:, None, :]) @ node_rows(surface.kind)
    row = np.repeat(surface.facets, k, axis=1).reshape(data.shape)
    col = np.broadcast_to(surface.facets[:, None, :], data.shape)
    D = csr_matrix((data.ravel(), (row.ravel(), col.ravel())), shape=(m, m))
    D.eliminate_zeros()
    part = data.sum(axis=2)
    area = np.asarray(np.bincount(surface.facets.ravel(), part.ravel(), m), dtype=float)
    total = np.zeros_like(surface.points)
    np.add.at(total, surface.facets, part[:, :, None] * surface.facet_node_normals)
    return D, area, -node_directions(surface, total, area)


def _primary_matrix(
    secondary: ContactSurface, primary: ContactSurface, moments: Moments, A: Array
) -> tuple[csr_matrix, Index]:
    """Assemble ``M``; and for each node the primary face where its shape function weighs most."""
    e, f = moments.e, moments.f
    data = A[e] @ moments.cross
    row = np.broadcast_to(secondary.facets[e][:, :, None], data.shape)
    col = np.broadcast_to(primary.facets[f][:, None, :], data.shape)
    shape = (len(secondary.points), len(primary.points))
    M = csr_matrix((data.ravel(), (row.ravel(), col.ravel())), shape=shape)
    return M, main_facets(secondary, primary, e, f, moments.cross.sum(axis=2))
