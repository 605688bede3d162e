"""Where parts of a primary surface meet without being joined, and a node stands on the seam.

Two foundations side by side, or the lips of a slit, have nodes of their own at one place. A node whose
foot lies there is carried by all of them alike: by one of them alone, a symmetric scene would have
forces that are not.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix

from skfem_contact.bodies.normals import sizes
from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.pairing.thresholds import COINCIDENT, FACING
from skfem_contact.trees import ODD

Array = NDArray[np.float64]


def shared_at_seams(
    secondary: ContactSurface, primary: ContactSurface, weights: csr_matrix
) -> csr_matrix:
    """Weights of feet on seams shared evenly between the parts that meet there.

    Parameters
    ----------
    secondary, primary : ContactSurface
    weights : csr_matrix, shape (m, number of primary nodes)
        Shape functions of one facet each.
    """
    if secondary.body is primary.body:  # the tip of a slit belongs to both lips
        return weights
    place = _places(primary)
    if place is None:
        return weights
    shared = np.bincount(place)[place] > 1
    rows = weights.tolil()
    for i in np.flatnonzero(weights @ shared.astype(float) > 1.0 - COINCIDENT):
        nodes, parts = np.array(rows.rows[i]), np.array(rows.data[i])
        kept = np.abs(parts) > COINCIDENT
        nodes, parts = nodes[kept], parts[kept] / parts[kept].sum()
        if len(nodes) == primary.facets.shape[1]:
            continue  # inside a facet
        lips = _lips(primary, place, nodes)
        faces = primary.normals[lips].mean(axis=1) @ secondary.normals[i] < -FACING
        lips = lips[faces]
        if len(lips) > 1:
            rows[i] = 0.0
            for lip in lips:
                rows[i, lip] = parts / len(lips)
    return csr_matrix(rows)


def _places(surface: ContactSurface) -> NDArray[np.intp] | None:
    """The place of each node, by its number; None where no two nodes share one."""
    points, near = surface.points, COINCIDENT * float(np.min(surface.lengths))
    order = np.argsort(points @ ODD[: points.shape[1]])  # nodes at one place follow each other
    away = sizes(np.diff(points[order], axis=0))
    if not np.count_nonzero(away <= near):
        return None
    place = np.zeros(len(points), dtype=np.intp)
    place[order[1:]] = np.cumsum(away > near)
    return place


def _lips(
    surface: ContactSurface, place: NDArray[np.intp], nodes: NDArray[np.intp]
) -> NDArray[np.intp]:
    """Nodes (l, c) of single facets that are where the given ones (c,) are."""
    here = place[surface.facets][:, :, None] == place[nodes]  # (nf, k, c)
    facets = here.any(axis=1).all(axis=1)
    found = np.take_along_axis(surface.facets[facets], here[facets].argmax(axis=1), axis=1)
    return np.unique(found, axis=0)
