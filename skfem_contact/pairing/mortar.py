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

1. `segmentation` of curves and `face_segmentation` find the `pieces` on which facet meets facet.
2. `pieces.Moments` integrates shape functions over them; all that follows is the same for both.
3. `dual` makes the basis of each facet: exact also where the primary covers it only in part, with
   the multipliers of what is cut short merged into their neighbours'. The row of an heir then holds
   both nodes, and a node left with no multiplier on any facet is not paired (it shows the heir's
   values: `discretisation.carriers`). Nodes that supports hold have no multiplier either: `supports`.
4. `mortar_rows` assembles ``D`` and ``M``; `bulges` and kinks change the gaps.

References
----------
B. I. Wohlmuth, SIAM J. Numer. Anal. 38 (2000) 989-1012: dual multipliers. A. Popp, M. W. Gee,
W. A. Wall, Int. J. Numer. Meth. Engng 79 (2009) 1354-1391: contact.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from skfem_contact.bodies.normals import tangents
from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.errors import InputError
from skfem_contact.pairing.bulges import bulged
from skfem_contact.pairing.face_segmentation import segment as segment_faces
from skfem_contact.pairing.mortar_rows import (
    divided,
    facet_bases,
    least_gaps,
    mortar_normals,
    overhang,
    own_rows,
    primary_matrix,
    secondary_matrix,
    shared_nodes,
    weighted_gaps,
)
from skfem_contact.pairing.node import Pairing
from skfem_contact.pairing.pieces import Moments, Pieces, bulges_of, whole_shares
from skfem_contact.pairing.segmentation import segment as segment_curves
from skfem_contact.pairing.supports import FREE, find_supports, slip_rows
from skfem_contact.pairing.thresholds import NO_WEIGHT

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
    if reach is not None and not reach > 0:
        raise InputError(f"reach={reach!r} must be a positive length")
    pieces = _segment(secondary, primary, reach)
    moments, whole = Moments.of(pieces), whole_shares(secondary)
    supports = find_supports(pieces)
    basis = facet_bases(secondary, moments, whole, supports, pressed)
    owner, exchange = own_rows(secondary, primary, supports, basis)
    D, area, normal = secondary_matrix(secondary, basis.share, owner)
    M, facet = primary_matrix(secondary, primary, moments, basis.A)
    of_secondary, of_primary = mortar_normals(secondary, primary, moments, basis.A, normal)
    M = M + exchange
    paired = (area > 0) & ~shared_nodes(secondary, primary)
    sums = np.asarray(M.sum(axis=1), dtype=float).ravel()
    W_s, W_m = weights = divided(D, area, paired), divided(M, sums, paired)
    for W in weights:
        W.data[np.abs(W.data) < NO_WEIGHT] = 0.0
    W_m.eliminate_zeros()  # those of the secondary name the heirs
    parts, apart, nearest_parts = bulges_of(pieces, moments)
    change, smooth, bulge = bulged(secondary, primary, parts, apart, basis.A, normal, (sums, paired))
    least = least_gaps(pieces, np.asarray(basis.A.any(axis=2)), nearest_parts)
    gap = weighted_gaps(secondary, primary, normal, weights, change, least)
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
        slip_weights=None if supports is None else slip_rows(pieces, supports, (W_s, W_m)),
    )


def _segment(secondary: ContactSurface, primary: ContactSurface, reach: float | None) -> Pieces:
    """Return the parts of two curves, or of two surfaces of faces, that meet."""
    if secondary.dim != primary.dim:
        raise InputError(
            f"Mortar contact between '{secondary.label}' in {secondary.dim}-D and '{primary.label}' in "
            f"{primary.dim}-D: both are curves, or both are faces of solids."
        )
    return (segment_curves if secondary.dim == 2 else segment_faces)(secondary, primary, reach)
