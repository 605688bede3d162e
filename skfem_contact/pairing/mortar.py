r"""Dual mortar rows ``D u_s - M u_m``: contact in the weighted mean instead of point by point.

With multipliers ``phi_i`` the gap at node i of the secondary is

    g_i = 1/a_i  int phi_i  n_i . (x_s - x_m),      a_i = int phi_i,

and with the positions interpolated by the shape functions ``N`` of both surfaces

    g_i = n_i . (D x_s - M x_m)_i / a_i,    D_ij = int phi_i N_j,    M_ij = int phi_i N_j^primary.

The *dual* basis is biorthogonal to the shape functions of the secondary, ``D_ij = a_i delta_ij``:
after division by ``a_i`` the row is one node of the secondary minus a mean over the primary, as
in node-to-segment contact, and elimination of the normal DOFs is as local. As the integrals are
exact, a uniform pressure passes between meshes that do not match (patch test).

The basis is that of `dual`: exact also where the primary covers facets only in part, with the
multipliers of what is cut short merged into their neighbours'. The row of an heir then holds both
nodes, and a node left with no multiplier on any facet is not paired (it shows the heir's values:
`discretisation.carriers`). Nodes that supports hold have no multiplier either: `supports`.

References
----------
B. I. Wohlmuth, SIAM J. Numer. Anal. 38 (2000) 989-1012: dual multipliers. A. Popp, M. W. Gee,
W. A. Wall, Int. J. Numer. Meth. Engng 79 (2009) 1354-1391: contact.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix, diags

from skfem_contact.bodies.normals import tangents
from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.digits import GIVEN
from skfem_contact.errors import InputError
from skfem_contact.pairing.bulges import Bulges, Parts, bulged
from skfem_contact.pairing.dual import WHOLE, dual_basis
from skfem_contact.pairing.facing import mortar_normals
from skfem_contact.pairing.kinks import least_gaps
from skfem_contact.pairing.mortar_rows import (
    divided,
    main_facets,
    node_directions,
    overhang,
    shared_nodes,
    weighted_gaps,
)
from skfem_contact.pairing.node import Pairing
from skfem_contact.pairing.segmentation import (
    Quadrature,
    facet_areas,
    interface_quadrature,
    points_per_segment,
)
from skfem_contact.pairing.smooth import Place, curved_pairs
from skfem_contact.pairing.supports import FREE, MET, Supports, find_supports, without_multiplier
from skfem_contact.pairing.thresholds import COVER_KEPT, NO_WEIGHT, SHARE_KEPT
from skfem_contact.pairing.vectors import dot

Array = NDArray[np.float64]
Index = NDArray[np.intp]


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
    reach : float, optional
        Parts of the surfaces farther apart than this along the normal do not meet [length].
        Without it, gaps are unlimited and overlaps go up to half the diagonal of the box around
        the smaller of the two surfaces.
    pressed : ndarray of int, optional
        Facets of the secondary that lean over a vertex of the primary: they have one multiplier, a
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
        If the surfaces are not curves in the plane, or `reach` is not positive.

    Notes
    -----
    ``normal`` is minus the nodal normal of the *secondary*: it is defined at the nodes, where the
    rows are, needs no projection, and is the field along which the surfaces are projected, so
    that the gap vector is parallel to it. It thus is the primary's normal where the two touch. For
    small sliding `frames.loaded_frames` turns it to the normal of the loaded interface.
    Forces balance to round-off, as the weights of either side sum to 1; moments do but for
    ``normal_force x (tangential part of the weighted gap vector)``, zero on flat interfaces.

    Where facets of a sharp corner (45 degrees or more) meet, the normal is the mean of those facets
    that the primary covers, weighted with the areas: of one facet in general. For contact on both
    sides of a corner make two contacts, each with one side.

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
    if secondary.points.shape[1] != 2:
        raise InputError(
            f"Mortar contact between '{secondary.label}' and '{primary.label}' in "
            f'{secondary.points.shape[1]}-D: it is available in 2-D. Use method="node".'
        )
    if reach is not None and not reach > 0:
        raise InputError(f"reach={reach!r} must be a positive length")
    quadrature = interface_quadrature(secondary, primary, reach)
    supports = find_supports(secondary, primary, quadrature)
    A, share, heir = _facet_bases(secondary, quadrature, supports, pressed)
    owner, exchange = _own_rows(secondary, primary, supports, share, heir)
    D, covered_area, normal = _secondary_matrix(secondary, share, owner)
    M, facet = _primary_matrix(secondary, primary, quadrature, A)
    bulges, apart, nearest_parts = _bulges(secondary, primary, quadrature)
    of_secondary, of_primary = mortar_normals(secondary, primary, quadrature, A, normal)
    M = M + exchange
    paired = (covered_area > 0) & ~shared_nodes(secondary, primary)
    W_s = divided(D, covered_area, paired)
    sums = np.asarray(M.sum(axis=1), dtype=float).ravel()
    W_m = divided(M, sums, paired)
    W_m.data[np.abs(W_m.data) < NO_WEIGHT] = 0.0
    W_m.eliminate_zeros()
    handed = np.zeros(len(paired), dtype=bool)
    if supports is not None:
        handed[secondary.facets[supports.rank != FREE]] = True
    miss, nearest = overhang(secondary, primary, paired | handed, reach)
    change, smooth, bulge = bulged(secondary, primary, bulges, apart, A, normal, (sums, paired))
    least = least_gaps(secondary, primary, quadrature, A, nearest_parts)
    gap = weighted_gaps(secondary, primary, normal, (W_s, W_m), change, least)
    return Pairing(
        points=secondary.points,
        normal=normal,
        tangent=tangents(normal),
        gap=np.where(paired, gap, np.inf),
        area=np.where(paired, covered_area, _nominal_area(secondary)),
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
        **_without_slip(supports, paired, W_s, W_m),
    )


def _bulges(
    secondary: ContactSurface, primary: ContactSurface, quadrature: Quadrature
) -> tuple[Parts, tuple[Index, Array], Array]:
    """What smooth boundaries change on the segments that have some, see `bulges.bulged`.

    The last are the least gaps of the segments, infinite where facets are all there is, (p,).
    """
    n = len(points_per_segment(secondary, primary))
    e, f = quadrature.secondary_facet[::n], quadrature.primary_facet[::n]
    some = np.flatnonzero(curved_pairs(secondary, primary, e, f))
    least = np.full(len(e), np.inf)
    if not len(some):
        return [], (e[some], np.zeros((0, secondary.facets.shape[1], 2))), least
    N, M = (
        shape.reshape(len(e), n, -1)[some]
        for shape in (quadrature.secondary_shape, quadrature.primary_shape)
    )
    weight = quadrature.weight.reshape(-1, n)[some]
    own, other = Place(secondary, e[some], N), Place(primary, f[some], M)
    v = N @ secondary.facet_node_normals[e[some]]
    v /= np.linalg.norm(v, axis=2, keepdims=True)
    away = M @ primary.points[primary.facets[f[some]]] - N @ secondary.points[secondary.facets[e[some]]]
    every, bulges = Bulges.of(np.arange(len(some)), (own, other), v, dot(away, v), weight)
    least[some] = bulges.least
    return (
        [(every, bulges)],
        (e[some], np.swapaxes(N * weight[..., None], 1, 2) @ -away),
        least,
    )


def _facet_bases(
    surface: ContactSurface,
    quadrature: Quadrature,
    supports: Supports | None,
    pressed: Index | None,
) -> tuple[Array, Array, Index]:
    """`dual_basis` of every facet; zero where not covered; one multiplier where pressed."""
    nf, k = surface.facets.shape
    N = quadrature.secondary_shape
    q = len(N)
    collect = csr_matrix((quadrature.weight, (quadrature.secondary_facet, np.arange(q))), shape=(nf, q))
    products = (N[:, :, None] * N[:, None, :]).reshape(q, k * k)
    mass = np.asarray(collect @ products).reshape(nf, k, k)
    A, share, heir = np.zeros_like(mass), np.zeros((nf, k)), np.tile(np.arange(k), (nf, 1))
    covered = np.unique(quadrature.secondary_facet)
    without = None if supports is None else without_multiplier(supports.rank)[covered]
    area = facet_areas(surface)
    if pressed is not None:
        area[pressed] *= 2 / COVER_KEPT  # never covered enough
    A[covered], share[covered], heir[covered] = dual_basis(mass[covered], area[covered], without)
    return A, share, heir


def _own_rows(
    secondary: ContactSurface,
    primary: ContactSurface,
    supports: Supports | None,
    share: Array,
    heir: Index,
) -> tuple[Index, csr_matrix]:
    """Whose row each node's share of a facet is in, and what rule 2 of `supports` changes in ``M``.

    Nodes held on both sides get their share back from the heir, with a row of node-to-segment.
    """
    shape = (len(secondary.points), len(primary.points))
    if supports is None:
        return heir, csr_matrix(shape)
    s, owner = supports, heir.copy()
    lent = heir[s.facet, s.local] != s.local
    part, to = share[s.facet, s.local], secondary.facets[s.facet, heir[s.facet, s.local]]
    back = lent & (s.rank[s.facet, s.local] == MET) & (part > 0)
    # the heir's row is divided by what it keeps
    total, given = np.zeros(shape[0]), np.zeros(shape[0])
    np.add.at(total, np.take_along_axis(secondary.facets, heir, axis=1), share)
    np.add.at(given, to[back], part[back])
    back &= (total - given >= SHARE_KEPT * (1 - GIVEN) * given)[to]
    owner[s.facet[back], s.local[back]] = s.local[back]
    data = part[back, None] * s.weight[back]
    row = np.repeat(np.concatenate([s.node[back], to[back]]), data.shape[1])
    column = np.tile(s.opposite[back].ravel(), 2)
    return owner, csr_matrix((np.concatenate([data, -data]).ravel(), (row, column)), shape=shape)


def _without_slip(
    supports: Supports | None, paired: NDArray[np.bool_], W_s: csr_matrix, W_m: csr_matrix
) -> dict[str, Any]:
    """`Pairing.still` by rule 3 of `supports`, and rows of node-to-segment contact for their slip."""
    if supports is None or not supports.still.any():
        return {}
    still = np.zeros(len(paired), dtype=bool)
    still[supports.node[supports.still]] = True
    node, first = np.unique(supports.node, return_index=True)
    node, first = node[(still & paired)[node]], first[(still & paired)[node]]
    others = diags(np.where(still, 0.0, 1.0))
    own = csr_matrix((np.ones(len(node)), (node, node)), shape=W_s.shape)
    weight, opposite = supports.weight[first], supports.opposite[first]
    row = np.repeat(node, weight.shape[1])
    there = csr_matrix((weight.ravel(), (row, opposite.ravel())), shape=W_m.shape)
    return {"slip_weights": (others @ W_s + own, others @ W_m + there), "still": still}


def _secondary_matrix(
    surface: ContactSurface, share: Array, owner: Index
) -> tuple[csr_matrix, Array, Array]:
    """Assemble ``D``, the areas ``int phi_i``, and the normals of the primary at the nodes.

    Merged nodes keep their entry in the heir's row even where it is zero, on the axis.
    """
    m = len(surface.points)
    row = np.take_along_axis(surface.facets, owner, axis=1)
    covered = np.any(share != 0, axis=1)
    data, at = share[covered].ravel(), (row[covered].ravel(), surface.facets[covered].ravel())
    D = csr_matrix((data, at), shape=(m, m))
    D.sum_duplicates()
    area = np.asarray(D.sum(axis=1), dtype=float).ravel()
    normals = np.take_along_axis(surface.facet_node_normals, owner[:, :, None], axis=1)
    total = np.zeros_like(surface.points)
    np.add.at(total, row, share[:, :, None] * normals)
    return D, area, -node_directions(surface, total, area)


def _primary_matrix(
    secondary: ContactSurface, primary: ContactSurface, quadrature: Quadrature, A: Array
) -> tuple[csr_matrix, Index]:
    """Assemble ``M``; and for each node the primary facet where its shape function weighs most."""
    e, f = quadrature.secondary_facet, quadrature.primary_facet
    m = len(secondary.points)
    N = quadrature.secondary_shape
    phi = quadrature.weight[:, None] * np.einsum("qik,qk->qi", A[e], N)
    data = phi[:, :, None] * quadrature.primary_shape[:, None, :]
    row = np.broadcast_to(secondary.facets[e][:, :, None], data.shape)
    col = np.broadcast_to(primary.facets[f][:, None, :], data.shape)
    M = csr_matrix((data.ravel(), (row.ravel(), col.ravel())), shape=(m, len(primary.points)))
    return M, main_facets(secondary, primary, e, f, quadrature.weight[:, None] * N**2)


def _nominal_area(surface: ContactSurface) -> Array:
    """Areas of points that carry nothing: the whole tributary area, positive also on the axis."""
    k = surface.facets.shape[1]
    share = np.zeros(len(surface.points))
    np.add.at(share, surface.facets, facet_areas(surface)[:, None] * WHOLE[k])
    return np.where(surface.area > NO_WEIGHT * share, surface.area, share)
