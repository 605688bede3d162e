r"""Kinks: straight sides that turn, by less than a corner does, and means over them.

At less than 45 degrees a surface has one normal at a node, averaged, and the multipliers of mortar
contact reach over it: both right for curves, whose facets turn by like angles one after the other.
A chamfer beside a flat is no curve. Its node is known by what the surface does next to it: on one
side at least it goes straight on. There

* the normal is that of the other side of the interface (`facing`): it meets one of the two parts;
* the gap of a mortar row is no less than the least distance in its support. A dual multiplier is
  negative in parts, and where these are over a chamfer, which is open by the size of a facet, the
  weighted gap is an overlap many times deeper than any displacement. Motions keep the weights.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.bodies.thresholds import BENT
from skfem_contact.pairing.segmentation import Quadrature, points_per_segment
from skfem_contact.pairing.vectors import dot

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Mask = NDArray[np.bool_]


def least_gaps(
    secondary: ContactSurface,
    primary: ContactSurface,
    quadrature: Quadrature,
    A: Array,
    smooth: Array,
) -> Array | None:
    """Least distance in the support of each mortar row that reaches over a kink, shape (m,) [length].

    Parameters
    ----------
    secondary, primary : ContactSurface
    quadrature : Quadrature
    A : ndarray, shape (nf, k, k)
        The multipliers of each facet in its shape functions.
    smooth : ndarray, shape (p,)
        Least gaps of the segments between smooth boundaries; infinite where there are none [length].

    Returns
    -------
    ndarray, shape (m,), or None
        Minus infinity for all other rows; None if there is no kink.
    """
    sides = secondary, primary
    bent = [((s.kinks > BENT) | s.sharp_points)[s.facets[:, :2]].any(axis=1) for s in sides]
    e, f = quadrature.secondary_facet, quadrature.primary_facet
    over = bent[0][e] | bent[1][f]
    if not over.any():
        return None
    m = len(secondary.points)
    node = secondary.facets[e]
    acts = np.any(A[e] != 0, axis=2)
    distance = _distances(secondary, primary, quadrature)
    between = np.repeat(smooth, len(distance) // max(len(smooth), 1))
    distance = np.where(np.isfinite(between), between, distance)
    least, reaches = np.full(m, np.inf), np.zeros(m, dtype=bool)
    np.minimum.at(least, node[acts], np.broadcast_to(distance[:, None], node.shape)[acts])
    reaches[node[acts & over[:, None]]] = True
    return np.where(reaches, least, -np.inf)


def _distances(secondary: ContactSurface, primary: ContactSurface, quadrature: Quadrature) -> Array:
    """The least distance along the normals on the segment of each quadrature point, shape (q,)."""
    e, N = quadrature.secondary_facet, quadrature.secondary_shape
    normal = np.einsum("qk,qkd->qd", N, secondary.facet_node_normals[e])
    x = np.einsum("qk,qkd->qd", N, secondary.points[secondary.facets[e]])
    nodes = primary.points[primary.facets[quadrature.primary_facet]]
    y = np.einsum("qk,qkd->qd", quadrature.primary_shape, nodes)
    at = points_per_segment(secondary, primary)
    gap = (dot(y - x, normal) / np.linalg.norm(normal, axis=1)).reshape(-1, len(at))
    # linear on straight facets: continued from the outer points to the ends of the segment
    beyond = at[0] / (at[-1] - at[0]) * np.abs(gap[:, -1] - gap[:, 0])
    return np.repeat(gap.min(axis=1) - beyond, len(at))
