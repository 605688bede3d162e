"""Normals of both sides at the points of a pairing: what they enclose is the tilt of an interface.

A pairing takes its frames from one side. Where the sides are curved their normals differ as long as
a gap is open between them, and with small sliding the frame stays what it was then: `frames` makes of
both the normal of the loaded interface. At a corner of 45 degrees or more, and at a kink in a
straight side (`kinks`), a side has no normal: there that of the other side stands for both.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from skfem_contact.bodies.normals import unit
from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.digits import SOLVED
from skfem_contact.pairing.segmentation import Quadrature
from skfem_contact.pairing.thresholds import COINCIDENT, KINK, SPREAD
from skfem_contact.pairing.vectors import dot, turned

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Mask = NDArray[np.bool_]


def sharp_nodes(surface: ContactSurface) -> Mask:
    """Nodes where facets meet at 45 degrees or more, or straight parts at a kink, shape (m,)."""
    return np.asarray(surface.sharp_points | (surface.kinks > KINK))


def node_normals(
    secondary: ContactSurface,
    primary: ContactSurface,
    point: Index,
    feet: Array,
    weights: Array,
    nodes: Index,
) -> tuple[Array, Array]:
    """Normals of both sides where nodes stand above feet, from primary to secondary.

    Parameters
    ----------
    secondary, primary : ContactSurface
    point : ndarray of int, shape (p,)
        Nodes that have a foot.
    feet : ndarray, shape (p, d)
        Normals of the primary at the feet.
    weights, nodes : ndarray, shape (p, k)
        Shape functions at the feet, and the primary's nodes that they belong to.

    Returns
    -------
    of_secondary, of_primary : ndarray, shape (p, d)
    """
    own = -secondary.normals[point]
    corner = sharp_nodes(secondary)[point, None]
    at_corner = np.any(sharp_nodes(primary)[nodes] & (weights >= 1 - COINCIDENT), axis=1)
    # beside a kink the field of normals is on its way to the mean of both parts
    at_corner = (at_corner | np.any(primary.kinks[nodes] > KINK, axis=1))[:, None]
    return np.where(corner & ~at_corner, feet, own), np.where(at_corner & ~corner, own, feet)


def mortar_normals(
    secondary: ContactSurface, primary: ContactSurface, quadrature: Quadrature, A: Array, own: Array
) -> tuple[Array, Array]:
    """Normals of both sides in the weighted mean of dual multipliers, from primary to secondary.

    The primary's field of normals is weighted with the multipliers like its displacements: exact for
    a field that is linear over each facet of the secondary, so the same as the secondary's on
    matching meshes.

    Parameters
    ----------
    secondary, primary : ContactSurface
    quadrature : Quadrature
    A : ndarray, shape (nf, k, k)
        The multipliers of each facet in its shape functions.
    own : ndarray, shape (m, d)
        Normals at the nodes of the secondary, turned round.

    Returns
    -------
    of_secondary, of_primary : ndarray, shape (m, d)
    """
    m = len(secondary.points)
    e, f, N = quadrature.secondary_facet, quadrature.primary_facet, quadrature.secondary_shape
    node = secondary.facets[e]
    field = np.einsum("qk,qkd->qd", quadrature.primary_shape, primary.facet_node_normals[f])
    phi = quadrature.weight[:, None] * np.einsum("qik,qk->qi", A[e], N)
    total = np.zeros_like(own)
    np.add.at(total, node, phi[:, :, None] * field[:, None, :])
    of_primary = np.where(_long(total), total, own)
    # angles of the primary's normals around the node's own: a corner, if they spread
    angle = np.arctan2(dot(field[:, None], turned(own[node])), dot(field[:, None], own[node]))
    low, high = np.full(m, np.inf), np.full(m, -np.inf)
    np.minimum.at(low, node, angle)
    np.maximum.at(high, node, angle)
    beside = np.any(primary.kinks[primary.facets[f]] > KINK, axis=1)
    kinked = np.zeros(m, dtype=bool)
    kinked[node[beside]] = True
    corner = (kinked | (high - low > SPREAD))[:, None]
    covered = np.unique(e)
    both = np.bincount(secondary.facets[covered].ravel(), minlength=m) > 1
    sharp = (sharp_nodes(secondary) & both)[:, None]
    of_primary = unit(np.where(corner, own, of_primary))
    return np.where(sharp & ~corner, of_primary, own), of_primary


def _long(vectors: Array) -> NDArray[np.bool_]:
    """Vectors that have a direction, shape (m, 1)."""
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    return np.asarray(length > SOLVED * np.max(length, initial=0.0))
