r"""Dual mortar rows ``D u_s - M u_m``: contact in the weighted mean instead of point by point.

With multipliers ``phi_i`` the gap at node i of the secondary is

    g_i = 1/a_i  int phi_i  n_i . (x_s - x_m),      a_i = int phi_i,

and with the positions interpolated by the shape functions ``N`` of both surfaces

    g_i = n_i . (D x_s - M x_m)_i / a_i,    D_ij = int phi_i N_j,    M_ij = int phi_i N_j^primary.

The *dual* basis is biorthogonal to the shape functions of the secondary, ``D_ij = a_i delta_ij``:
after division by ``a_i`` the row is one node of the secondary minus a mean over the primary, as
in node-to-segment contact, and elimination of the normal DOFs is as local. (The rows of the middles
of edges of faces with six and eight nodes hold corners, too.) As the integrals are exact, a uniform
pressure passes between meshes that do not match (patch test).

1. `segmentation` finds the pieces on which facet meets facet: intervals of curves, polygons of faces.
2. `segmentation.Moments` integrates shape functions over them.
3. `dual` makes the basis of each facet: exact also where the primary covers it only in part, with
   the multipliers of what is cut short merged into their neighbours'. The row of an heir then holds
   both nodes, and a node left with no multiplier on any facet is not paired (it shows the heir's
   values: `discretisation.carriers`). Nodes that supports hold have none either: `dual`.
4. The rows ``D`` and ``M`` are assembled; bulges (`smooth`) and kinks change the gaps.

Straight sides and flats may turn by less than a corner does. At less than 45 degrees a surface has one
normal at a node, averaged, and the multipliers reach over it: both right for curves, whose facets turn
by like angles one after the other. A chamfer beside a flat is no curve. Its node is known by what the
surface does next to it: on one side at least it goes straight on (`normal_field.kink_angles`). There

* the normal is that of the other side of the interface, which meets one of the two parts;
* the gap of a row is no less than the least distance in its support (`least_gaps`). A dual multiplier
  is negative in parts, and where these are over a chamfer, which is open by the size of a facet, the
  weighted gap is an overlap many times deeper than any displacement. Motions keep the weights.

References
----------
B. I. Wohlmuth, SIAM J. Numer. Anal. 38 (2000) 989-1012: dual multipliers. A. Popp, M. W. Gee,
W. A. Wall, Int. J. Numer. Meth. Engng 79 (2009) 1354-1391: contact.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import bsr_matrix, csr_matrix

from skfem_contact.arrays import (
    Array,
    Index,
    Mask,
    angle_between,
    assembled,
    dot,
    entries,
    summed,
    tangents,
    unit,
)
from skfem_contact.bodies.facet_kinds import positive_functions
from skfem_contact.bodies.normal_field import BENT, CORNER
from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.digits import GIVEN, ROUND_OFF, SOLVED
from skfem_contact.pairing.closest import LEAN, overhang, search_range
from skfem_contact.pairing.dual import (
    FREE,
    MET,
    DualBasis,
    Supports,
    dual_basis,
    find_supports,
    node_rows,
    slip_rows,
    without_multiplier,
)
from skfem_contact.pairing.node import SHARE_KEPT, Pairing, gap_vectors, whole_shares
from skfem_contact.pairing.segmentation import Moments, Segmentation, segment
from skfem_contact.pairing.smooth import (
    TINY,
    Bulges,
    Place,
    block_matrix,
    curved_pairs,
    without_round_off,
)

# The spread of normals at which a surface has a corner, 45 degrees [rad].
SPREAD = float(np.arccos(CORNER))


def dual_mortar(
    secondary: ContactSurface,
    primary: ContactSurface,
    *,
    reach: float | None = None,
    pressed: Index | None = None,
) -> Pairing:
    """Pair two surfaces in the weighted mean, with dual multipliers on the secondary.

    Parameters
    ----------
    secondary : ContactSurface
        Carries the multipliers: best the finer, or the softer, of the two.
    primary : ContactSurface
        Both are curves, or faces of solids.
    reach : float, optional
        Parts of the surfaces farther apart than this along the normal do not meet [length].
        Without it, gaps are unlimited and overlaps go up to half the diagonal of the box around
        the smaller of the two surfaces.
    pressed : ndarray of int, optional
        Facets of a curve that lean over a vertex of the primary: they have one multiplier, a
        mean that does not extrapolate beyond the vertex (see `corners`).

    Returns
    -------
    Pairing
        A point per node of the secondary. ``area`` is ``int phi_i`` including the ``measure`` of
        the secondary's body, so ``normal_force / area`` is the coefficient of the multiplier, the
        nodal pressure (the dual functions themselves jump between facets). ``gap`` is weighted.
        ``facet`` is the primary facet with the largest part in a row, or the nearest one where a
        point overhangs.

    Raises
    ------
    InputError
        If one surface is a curve and the other is of a solid, or `reach` is not positive.

    Notes
    -----
    ``normal`` is minus the nodal normal of the *secondary*: it is defined at the nodes, where the
    rows are, needs no projection, and is the field along which the surfaces are projected, so
    that the gap vector is parallel to it. It thus is the primary's normal where the two touch. For
    small sliding `frames.loaded_frames` turns it to the normal of the loaded interface.
    Forces balance to round-off, as the weights of either side sum to 1; moments do but for
    ``normal_force x (tangential part of the weighted gap vector)``, zero on flat interfaces.

    Where facets of a sharp corner or edge (45 degrees or more) meet, the normal is the mean of those
    facets that the primary covers, weighted with the areas: of one facet in general. For contact on
    both sides of a corner make two contacts, each with one side.

    Examples
    --------
    One facet under two, nothing matches, yet the rows hold the mean:

    >>> import skfem as fem
    >>> import skfem_contact as sc
    >>> from skfem.models.elasticity import linear_elasticity
    >>> e = fem.ElementVector(fem.ElementQuad1())
    >>> low = fem.MeshQuad().refined(1).with_defaults()
    >>> top = fem.MeshQuad().translated((0, 1)).with_defaults()
    >>> a = sc.Body(fem.Basis(low, e), linear_elasticity(0, 0.5))
    >>> b = sc.Body(fem.Basis(top, e), linear_elasticity(0, 0.5))
    >>> pairing = dual_mortar(b.surface("bottom"), a.surface("top"))
    >>> print(pairing.area, pairing.gap)
    [0.5 0.5] [0. 0.]
    >>> x = a.surface("top").points[:, 0]
    >>> print((1 + pairing.primary_weights @ x).round(12))  # a linear field at both nodes
    [1. 2.]
    """
    pieces = segment(secondary, primary, reach)
    moments, whole = Moments.of(pieces), whole_shares(secondary)
    supports = find_supports(pieces)
    basis = facet_bases(moments, whole, supports, pressed)
    owner, exchange = own_rows(secondary, primary, supports, basis)
    D, area, normal = secondary_matrix(secondary, basis.share, owner)
    M, facet = primary_matrix(moments, basis.A)
    of_secondary, of_primary = mortar_normals(moments, basis.A, normal)
    M = M if exchange is None else M + exchange
    paired = area > 0
    if secondary.body is primary.body:  # nodes on both (the tip of a slit) can not meet themselves
        paired &= ~np.isin(secondary.dofs[:, 0], primary.dofs[:, 0])
    sums = np.asarray(np.bincount(entries(M)[0], M.data, len(paired)), dtype=float)
    W_s, W_m = weights = divided(D, area, paired), divided(M, sums, paired)
    for W in weights:
        W.data[np.abs(W.data) < ROUND_OFF] = 0.0
    W_m.eliminate_zeros()  # those of the secondary name the heirs
    change, smooth, bulge, nearest = smooth_gaps(moments, basis.A, normal, (sums, paired))
    least = least_gaps(pieces, np.asarray(basis.A.any(axis=2)), nearest)
    gap = weighted_gaps(secondary, primary, normal, weights, change, least)
    miss, beside = overhang(secondary, primary, ~paired, *search_range(secondary, primary, reach))
    facet[~paired] = beside[~paired]
    if supports is not None:
        miss[secondary.facets[supports.rank != FREE]] = 0.0  # handed to others
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
        facet=facet,
        secondary_normal=of_secondary,
        primary_normal=of_primary,
        primary_bulge=bulge,
        smooth=smooth,
        least_gap=least,
        slip_weights=None if supports is None else slip_rows(pieces, supports, (W_s, W_m)),
    )


def facet_bases(
    moments: Moments, whole: Array, supports: Supports | None, pressed: Index | None
) -> DualBasis:
    """Multipliers of all facets: zero where nothing is covered, one each of those `pressed`."""
    surface = moments.pieces.secondary
    nf, k = surface.facets.shape
    covered = moments.covered
    share = moments.own.sum(axis=2) @ positive_functions(surface.kind).T
    total = np.bincount(surface.facets.ravel(), share.ravel(), len(surface.points))[surface.facets]
    without = None if supports is None else without_multiplier(supports.rank)[covered]
    constant = None if pressed is None else np.isin(covered, pressed)
    masses = moments.own[covered]
    some = dual_basis(surface.kind, masses, whole[covered], total[covered], without, constant)
    A, S, share = np.zeros((nf, k, k)), np.zeros((nf, k, k)), np.zeros((nf, k))
    A[covered], S[covered], share[covered] = some.A, some.S, some.share
    return DualBasis(A, S, share)


def own_rows(
    secondary: ContactSurface, primary: ContactSurface, supports: Supports | None, basis: DualBasis
) -> tuple[Array, csr_matrix | None]:
    """S of the rows of the secondary, and what rule 2 of `dual` changes in ``M``, if anything.

    Nodes held on both sides get their share back, with a row of node-to-segment contact.
    """
    shape = (len(secondary.points), len(primary.points))
    if supports is None:
        return basis.S, None
    nodes, owner = secondary.facets[supports.facet], basis.S.copy()
    S, share = basis.S[supports.facet], basis.share[supports.facet]
    own = np.einsum("hii->hi", S)
    back = (own == 0) & (share > 0) & (supports.rank[supports.facet] == MET)
    lent = np.where(back[:, None, :], S * share[:, None, :], 0.0)  # to row, of node
    # what is left of the rows that lent it must be rows
    total = np.bincount(secondary.facets.ravel(), (basis.S @ basis.share[..., None]).ravel(), shape[0])
    given = np.bincount(nodes.ravel(), lent.sum(axis=2).ravel(), shape[0])
    poor = (total - given < SHARE_KEPT * (1 - GIVEN) * given)[nodes]
    back &= ~np.any((lent > 0) & poor[:, :, None], axis=1)
    lent = np.where(back[:, None, :], lent, 0.0)
    h, i = np.nonzero(back)
    owner[supports.facet[h], :, i] = 0.0
    owner[supports.facet[h], i, i] = 1.0
    change = -lent
    change[h, i, i] += share[h, i]
    change = change @ node_rows(secondary.kind)
    data = change[..., None] * supports.weight[:, None]  # (h, row, node, k')
    row = np.broadcast_to(nodes[:, :, None, None], data.shape)
    column = np.broadcast_to(supports.opposite[:, None], data.shape)
    return owner, csr_matrix((data.ravel(), (row.ravel(), column.ravel())), shape=shape)


def secondary_matrix(
    surface: ContactSurface, share: Array, S: Array
) -> tuple[csr_matrix, Array, Array]:
    """Assemble ``D``, the areas ``int phi_i``, and the normals of the primary at the nodes.

    Merged nodes keep their entry in the heir's row even where it is zero, on the axis.
    """
    m, k = len(surface.points), surface.facets.shape[1]
    rows = node_rows(surface.kind)
    data = ((S * share[:, None, :]).reshape(-1, k) @ rows).reshape(S.shape)
    facet, i, j = np.nonzero((S.reshape(-1, k) @ np.abs(rows)).reshape(S.shape))
    at = surface.facets[facet, i], surface.facets[facet, j]
    D = assembled(at, data[facet, i, j], (m, m))
    part = data.sum(axis=2)
    area = np.asarray(np.bincount(surface.facets.ravel(), part.ravel(), m), dtype=float)
    total = summed(surface.facets, part[:, :, None] * surface.facet_node_normals, m)
    length = np.linalg.norm(total, axis=1, keepdims=True)
    # opposite sides cancel at no corner but a crack tip; there the node's own will do
    known = length > SOLVED * area[:, None]
    return D, area, -np.divide(total, length, out=surface.normals.copy(), where=known)


def primary_matrix(moments: Moments, A: Array) -> tuple[csr_matrix, Index]:
    """Assemble ``M``; and for each node the primary facet where its function weighs most, or -1."""
    secondary, primary, f = moments.pieces.secondary, moments.pieces.primary, moments.f
    data, nodes = A[moments.e] @ moments.cross, secondary.facets[moments.e]
    row = np.broadcast_to(nodes[:, :, None], data.shape)
    col = np.broadcast_to(primary.facets[f][:, None, :], data.shape)
    shape, nf = (len(secondary.points), len(primary.points)), len(primary.facets)
    M = assembled((row.ravel(), col.ravel()), data.ravel(), shape)
    pair, which = np.unique(nodes * nf + f[:, None], return_inverse=True)
    weight = np.bincount(which.ravel(), moments.cross.sum(axis=2).ravel())
    facet = np.full(shape[0], -1)
    pair = pair[np.argsort(weight, kind="stable")]  # the last written is the largest
    facet[pair // nf] = pair % nf
    return M, facet


def mortar_normals(moments: Moments, A: Array, own: Array) -> tuple[Array, Array]:
    """Normals of both sides in the weighted mean of dual multipliers, from primary to secondary.

    The primary's field of normals is weighted with the multipliers like its displacements: exact for
    a field that is linear over each facet of the secondary, so the same as the secondary's on
    matching meshes.

    Parameters
    ----------
    moments : Moments
    A : ndarray, shape (nf, k, k)
        The multipliers of each facet in its shape functions.
    own : ndarray, shape (m, d)
        Normals at the nodes of the secondary, turned round.

    Returns
    -------
    of_secondary, of_primary : ndarray, shape (m, d)
    """
    secondary, primary = moments.pieces.secondary, moments.pieces.primary
    node, field = secondary.facets[moments.e], primary.facet_node_normals[moments.f]
    total = summed(node, A[moments.e] @ moments.cross @ field, len(own))
    length = np.linalg.norm(total, axis=1, keepdims=True)
    there = length > SOLVED * length.max(initial=0.0)
    of_primary = np.where(there, total / np.where(there, length, 1.0), own)
    # a corner of the primary, if the mean normals of its pieces spread about theirs
    mean = unit(moments.cross.sum(axis=1)[:, None] @ field)[:, 0]
    along = np.ones(len(own))
    np.minimum.at(along, node, dot(of_primary[node], mean[:, None]))
    corner = along < np.cos(0.5 * SPREAD)
    beside = np.any(primary.kinks[primary.facets[moments.f]] > LEAN, axis=1)
    corner[node[beside]] = True
    corner = corner[:, None]
    of_primary = np.where(corner, own, of_primary)
    # an edge of the secondary, if its covered facets have several normals there
    covered = moments.covered
    turned, node = np.zeros(len(own)), secondary.facets[covered]
    np.maximum.at(turned, node, angle_between(secondary.facet_node_normals[covered], -own[node]))
    sharp = ((turned > GIVEN) | (secondary.kinks > LEAN))[:, None]
    return np.where(sharp & ~corner, of_primary, own), of_primary


def smooth_gaps(
    moments: Moments, A: Array, normal: Array, rows: tuple[Array, Mask]
) -> tuple[Array | None, Array | None, bsr_matrix | None, Array]:
    """Return what smooth boundaries change on the pieces that have some (`smooth`); None if nothing.

    As far as curvatures agree the weighted gap is the mean of distances, not of vectors whose
    directions differ.

    Parameters
    ----------
    moments : Moments
    A : ndarray, shape (nf, k, k)
        The multipliers of each facet in its shape functions.
    normal : ndarray, shape (m, d)
    rows : (ndarray, ndarray), shape (m,)
        What rows are divided by [area], and which there are.

    Returns
    -------
    change, smooth, bulge
        Of weighted gaps (m,) [length], `Pairing.smooth` and `Pairing.primary_bulge`.
    least : ndarray, shape (p,)
        Least gaps of the pieces, infinite where facets are all there is.
    """
    secondary, primary = moments.pieces.secondary, moments.pieces.primary
    least, (by, there), faces = np.full(len(moments.e), np.inf), rows, secondary.facets
    some = np.flatnonzero(curved_pairs(secondary, primary, moments.e, moments.f))
    if not len(some):
        return None, None, None, least
    e, f, m = moments.e[some], moments.f[some], len(by)
    apart = moments.inside[some] @ secondary.points[faces[e]]
    apart -= moments.cross[some] @ primary.points[primary.facets[f]]
    parts, alike, area = [], np.zeros(len(some)), np.zeros(len(some))
    for piece, met, weight in moments.pieces.points(some, heights=True):
        # components first: long sums in place of many short ones
        N, M, v, gap, weight = (
            np.ascontiguousarray(x.T) for x in (met.N, met.M, met.directions, met.gap, weight)
        )
        places = Place(secondary, met.e, N), Place(primary, met.f, M)
        mine, part = Bulges.of(piece, places, v, gap, weight)
        least[mine] = np.minimum(least[mine], part.least)
        mine = np.searchsorted(some, mine)
        parts.append((mine, part))
        alike[mine] += part.alike
        area[mine] += part.area
    alike = np.maximum(np.divide(alike, area, out=np.zeros(len(some)), where=area > 0), TINY)
    vectors = dot(A[e] @ apart, normal[faces[e]])
    total = -np.bincount(faces[e].ravel(), (alike[:, None] * vectors).ravel(), m)
    for mine, part in parts:
        scalar = alike[mine, None] * part.gap - part.height
        total += np.bincount(part.node.ravel(), (A[part.e] @ scalar[..., None]).ravel(), m)
    change = np.divide(total, by, out=np.zeros(m), where=there)
    smooth, acts = np.zeros(m), A[e].any(axis=2)
    np.maximum.at(smooth, faces[e][acts], np.broadcast_to(alike[:, None], acts.shape)[acts])
    blocks = [part.blocks(primary, A) for _, part in parts if part.move is not None]
    bulge = block_matrix(blocks, (m, len(primary.points)), rows) if blocks else None
    return change, smooth, bulge, least


def divided(matrix: csr_matrix, by: Array, paired: Mask) -> csr_matrix:
    """Rows divided by their sums, entries that are zero kept; no rows where not paired."""
    row, column, value = entries(matrix)
    keep = paired[row]
    start = np.concatenate([[0], np.cumsum(np.where(paired, np.diff(matrix.indptr), 0))])
    return csr_matrix((value[keep] / by[row[keep]], column[keep], start), shape=matrix.shape)


def weighted_gaps(
    secondary: ContactSurface,
    primary: ContactSurface,
    normal: Array,
    weights: tuple[csr_matrix, csr_matrix],
    change: Array | None,
    least: Array | None,
) -> Array:
    """Gaps along the normals by the weights of both sides, no less than `least`, (m,).

    `change` is what smooth boundaries make of them (`smooth`).
    """
    gap = np.sum(normal * gap_vectors(secondary, primary, *weights), axis=1)
    if change is not None:
        gap += change
    if least is not None:
        gap = np.maximum(gap, least)
    curved = np.zeros(len(gap), dtype=bool) if change is None else change != 0
    return without_round_off(gap, secondary, primary, curved)


def least_gaps(pieces: Segmentation, acts: Mask, smooth: Array | None = None) -> Array | None:
    """Least distance in the support of each mortar row that reaches over a kink, shape (m,) [length].

    Parameters
    ----------
    pieces : Segmentation
    acts : ndarray of bool, shape (nf, k)
        Nodes that have a multiplier on each facet of the secondary.
    smooth : ndarray, shape (p,), optional
        Least gaps of the pieces between smooth boundaries; infinite where there are none [length].

    Returns
    -------
    ndarray, shape (m,), or None
        Minus infinity for all other rows; None if there is no kink.
    """
    sides, facets = (pieces.secondary, pieces.primary), pieces.facets
    over = np.zeros(len(facets[0]), dtype=bool)
    for surface, facet in zip(sides, facets, strict=True):
        bent = (surface.kinks > BENT) | surface.sharp_points
        over |= np.any(bent[surface.facets], axis=1)[facet]
    if not over.any():
        return None
    node, on, m = sides[0].facets[facets[0]], acts[facets[0]], len(sides[0].points)
    reaches = np.zeros(m, dtype=bool)
    reaches[node[on & over[:, None]]] = True
    mine = np.flatnonzero(np.any(reaches[node] & on, axis=1))
    # linear on straight and plane facets: least at the ends or corners of a piece
    gap = pieces.corners(mine).gap.min(axis=1)
    if smooth is not None:
        gap = np.where(np.isfinite(smooth[mine]), smooth[mine], gap)
    least = np.full(m, np.inf)
    np.minimum.at(least, node[mine][on[mine]], np.broadcast_to(gap[:, None], on[mine].shape)[on[mine]])
    return np.where(reaches, least, -np.inf)
