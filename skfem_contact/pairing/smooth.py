r"""Two polygons for two curves that nearly fit: the smooth boundaries through their nodes.

Linear facets cut off what curves bulge. A pin and its hole, a shaft and its hub have one and the same
arc, and gaps are small against its height above the chords: measured between polygons that do not
match, they are gaps between chords. And as bodies strain so do the heights: rows that know the
chords only let a uniform pressure ripple from node to node, by an error of first order in the size of
the facets. With the slopes ``s`` of the averaged tangents against a chord of length L
(`normals.end_slopes`) the smooth boundary is

    x(xi) = N x + b(xi) n,      b = L (s_0 xi (1 - xi)^2 - s_1 xi^2 (1 - xi)).

As ``n = J (x_1 - x_0) / L`` with J, a turn by -90 degrees, this is linear in the positions once
``b / L`` is fixed, and so is the displacement

    u(xi) = N u + (b / L) J (u_1 - u_0) :

exact for translations, for linearised rotations and for a uniform dilatation, hence for the uniform
pressure of round bodies. What bending does to b is left out, as on flat facets. That is right where
curves *keep* their curvature when the gap closes; an arc pressed flat loses it, and its chords then
are the better boundary. So both sides have to be curves, and of nearly one curvature
(`CURVATURE_KEPT`).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix

from skfem_contact.bodies.surface import CurveSurface
from skfem_contact.pairing.segmentation import Quadrature
from skfem_contact.pairing.thresholds import CURVATURE_KEPT

Array = NDArray[np.float64]
Index = NDArray[np.intp]


def common_heights(
    secondary: CurveSurface, primary: CurveSurface, e: Index, f: Index, xi: Array, eta: Array
) -> Array:
    """By how much the smooth boundaries are closer to each other than the chords, shape (q,) [length].

    Parameters
    ----------
    secondary, primary : CurveSurface
    e, f : ndarray of int, shape (q,)
        Facets of the two sides that meet.
    xi, eta : ndarray, shape (q,)
        Coordinates on them.

    Returns
    -------
    ndarray, shape (q,)
        Zero where facets are straight, or not of nearly one curvature.
    """
    if not (secondary.slopes.any() and primary.slopes.any()):
        return np.zeros(len(e))
    bent = secondary.slopes[e], primary.slopes[f]
    length = secondary.lengths[e], primary.lengths[f]
    one, other = ((s[:, 0] - s[:, 1]) / at for s, at in zip(bent, length, strict=True))
    larger = np.maximum(np.abs(one), np.abs(other))
    fits = (one * other < 0) & (np.abs(one + other) <= CURVATURE_KEPT * larger)
    height = length[0] * relative_height(bent[0], xi) + length[1] * relative_height(bent[1], eta)
    return np.where(fits, height, 0.0)


def relative_height(slopes: Array, xi: Array) -> Array:
    """Height of the smooth boundary above the chord, over the length of the chord, shape (q,).

    >>> float(relative_height(np.array([[0.1, -0.1]]), np.array([0.5]))[0])
    0.025
    """
    start, end = slopes.T
    return np.asarray(xi * (1 - xi) * (start * (1 - xi) - end * xi))


def bulge_matrix(
    secondary: CurveSurface, primary: CurveSurface, quadrature: Quadrature, A: Array
) -> csr_matrix | None:
    """Assemble the heights of both smooth boundaries above their chords; None where there are none.

    Both in terms of the primary's facets, so that rows keep one node of the secondary (what slips
    strains alike but for the gradient of the slip); on matching meshes they cancel.
    """
    e, f = quadrature.secondary_facet, quadrature.primary_facet
    ends = quadrature.secondary_shape[:, 1], quadrature.primary_shape[:, 1]
    height = common_heights(secondary, primary, e, f, *ends)
    if not height.any():
        return None
    phi = quadrature.weight[:, None] * np.einsum("qik,qk->qi", A[e], quadrature.secondary_shape)
    turn = phi * (height / primary.lengths[f])[:, None]
    data = turn[:, :, None] * np.array([-1.0, 1.0])
    row = np.broadcast_to(secondary.facets[e][:, :, None], data.shape)
    col = np.broadcast_to(primary.facets[f][:, None, :2], data.shape)
    shape = (len(secondary.points), len(primary.points))
    return csr_matrix((data.ravel(), (row.ravel(), col.ravel())), shape=shape)
