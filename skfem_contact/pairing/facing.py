"""Normals of both sides at the points of a pairing: what they enclose is the tilt of an interface.

A pairing takes its frames from one side. Where the sides are curved their normals differ as long as
a gap is open between them, and with small sliding the frame stays what it was then: `frames` makes of
both the normal of the loaded interface. At a corner of 45 degrees or more, and at a kink in a
straight side (`kinks`), a side has no normal: there that of the other side stands for both.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from skfem_contact.bodies.normals import angle_between, unit
from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.digits import SOLVED
from skfem_contact.pairing.moments import Moments
from skfem_contact.pairing.thresholds import COINCIDENT, KINK, SAME_NORMAL, SPREAD
from skfem_contact.pairing.vectors import dot

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
    secondary: ContactSurface, primary: ContactSurface, moments: Moments, A: Array, own: Array
) -> tuple[Array, Array]:
    """Normals of both sides in the weighted mean of dual multipliers, from primary to secondary.

    The primary's field of normals is weighted with the multipliers like its displacements: exact for
    a field that is linear over each facet of the secondary, so the same as the secondary's on
    matching meshes.

    Parameters
    ----------
    secondary, primary : ContactSurface
    moments : Moments
    A : ndarray, shape (nf, k, k)
        The multipliers of each facet in its shape functions.
    own : ndarray, shape (m, d)
        Normals at the nodes of the secondary, turned round.

    Returns
    -------
    of_secondary, of_primary : ndarray, shape (m, d)
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
    # an edge of the secondary, if its covered facets have several normals there
    covered = np.unique(moments.e)
    turned, node = np.zeros(len(own)), secondary.facets[covered]
    np.maximum.at(turned, node, angle_between(secondary.facet_node_normals[covered], -own[node]))
    sharp = ((turned > SAME_NORMAL) | (secondary.kinks > KINK))[:, None]
    return np.where(sharp & ~corner, of_primary, own), of_primary
