r"""Gaps of mortar rows over kinks of faces, see `bodies.kinks` and `pairing.kinks`.

Multipliers of mortar contact reach over a kink as over any other edge. There the gap of a row is no
less than the least distance in its support, and the normal is that of the other side (`mortar`).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from skfem_contact.bodies.thresholds import BENT
from skfem_contact.pairing.faces.meeting import meet
from skfem_contact.pairing.faces.segmentation import Segmentation

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Mask = NDArray[np.bool_]


def least_gaps(parts: Segmentation, acts: Mask, smooth: Array | None = None) -> Array | None:
    """Least distance in the support of each mortar row that reaches over a kink, shape (m,) [length].

    Parameters
    ----------
    parts : Segmentation
    acts : ndarray of bool, shape (nf, k)
        Nodes that have a multiplier on each face of the secondary.
    smooth : ndarray, shape (p,), optional
        Least gaps of the pieces between smooth boundaries; infinite where there are none [length].

    Returns
    -------
    ndarray, shape (m,), or None
        Minus infinity for all other rows; None if there is no kink.
    """
    surfaces, cells = (parts.secondary, parts.primary), (parts.e, parts.f)
    face = [own.facet[cell] for own, cell in zip(parts.cells, cells, strict=True)]
    over = np.zeros(len(parts.e), dtype=bool)
    for surface, facet in zip(surfaces, face, strict=True):
        bent = (surface.kinks > BENT) | surface.sharp_points
        over |= np.any(bent[surface.facets], axis=1)[facet]
    if not over.any():
        return None
    node, m = parts.secondary.facets[face[0]], len(parts.secondary.points)
    reaches = np.zeros(m, dtype=bool)
    reaches[node[acts[face[0]] & over[:, None]]] = True
    mine = np.flatnonzero(np.any(reaches[node] & acts[face[0]], axis=1))
    # linear on plane faces: least at the corners of a piece
    X = parts.pieces.corners[mine]
    gap = meet(*surfaces, parts.cells, parts.e[mine], parts.f[mine], X).gap.min(axis=1)
    if smooth is not None:
        gap = np.where(np.isfinite(smooth[mine]), smooth[mine], gap)
    least = np.full(m, np.inf)
    on = acts[face[0]][mine]
    np.minimum.at(least, node[mine][on], np.broadcast_to(gap[:, None], on.shape)[on])
    return np.where(reaches, least, -np.inf)
