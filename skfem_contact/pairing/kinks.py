r"""Kinks: straight sides and flats that turn, by less than a corner does, and means over them.

At less than 45 degrees a surface has one normal at a node, averaged, and the multipliers of mortar
contact reach over it: both right for curves, whose facets turn by like angles one after the other.
A chamfer beside a flat is no curve. Its node is known by what the surface does next to it: on one
side at least it goes straight on (`bodies.kinks.kink_angles`). There

* the normal is that of the other side of the interface (`facing`): it meets one of the two parts;
* the gap of a mortar row is no less than the least distance in its support. A dual multiplier is
  negative in parts, and where these are over a chamfer, which is open by the size of a facet, the
  weighted gap is an overlap many times deeper than any displacement. Motions keep the weights.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from skfem_contact.bodies.thresholds import BENT
from skfem_contact.pairing.pieces import Pieces

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Mask = NDArray[np.bool_]


def least_gaps(pieces: Pieces, acts: Mask, smooth: Array | None = None) -> Array | None:
    """Least distance in the support of each mortar row that reaches over a kink, shape (m,) [length].

    Parameters
    ----------
    pieces : Pieces
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
