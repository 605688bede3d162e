r"""Frames of small sliding: the normal of the loaded interface, the same whichever side is secondary.

With small sliding a frame is made once and has to be that of the interface under load. Two bodies
whose boundaries have the slopes ``s_a``, ``s_b`` are deformed by one and the same pressure, so that
their slopes change by ``-c_a h`` and ``c_b h`` with a function h of the pressure and the compliances
``c = 1 / E*`` of two half-planes. Closed, both have the slope

    s = (c_b s_a + c_a s_b) / (c_a + c_b) :

the stiffer side keeps its shape. Equal bodies meet in the mean of both normals, a rigid one shows its
own. So friction, which acts along the interface, is as well resolved as with `sliding="finite"`,
where the frames are those of the deformed surfaces.

The compliance at a node is measured on K itself, see `compliances`. What it leaves out is of second
order in the answer: a weight that is wrong by a tenth turns the frame by a twentieth of the tilt.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from skfem_contact.bodies.normals import angle_between, tangents, unit
from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.pairing.compliances import compliances
from skfem_contact.pairing.node import Pairing, gap_vectors
from skfem_contact.pairing.thresholds import SAME_NORMAL
from skfem_contact.pairing.vectors import dot

Array = NDArray[np.float64]


def loaded_frames(secondary: ContactSurface, primary: ContactSurface, pairing: Pairing) -> Pairing:
    """The pairing in the frames of the loaded interface, its gaps measured along the new normals.

    Parameters
    ----------
    secondary, primary : ContactSurface
    pairing : Pairing
        With the normals of both sides.

    Returns
    -------
    Pairing
        The very same where the two sides have one normal, or a row has no direction.
    """
    of_secondary, of_primary = pairing.secondary_normal, pairing.primary_normal
    if of_secondary is None or of_primary is None or secondary.dofs.shape[1] != secondary.dim:
        return pairing
    apart = [angle_between(pairing.normal, side) for side in (of_secondary, of_primary)]
    turns = pairing.paired & (np.maximum(*apart) > SAME_NORMAL)
    if secondary.dim == 2:
        turns &= ~_mirrored(secondary)
    if not turns.any():
        return pairing
    soft_s = _mean(pairing.secondary_weights, compliances(secondary))
    soft_p = _mean(pairing.primary_weights, compliances(primary))
    both = soft_s + soft_p
    share = np.divide(soft_p, both, out=np.full_like(both, 0.5), where=both > 0)[:, None]
    mean = share * of_secondary + (1 - share) * of_primary
    if secondary.dim == 3:  # what stands across a plane of symmetry stays there
        mean = np.where(secondary.held & (np.abs(of_secondary) <= SAME_NORMAL), 0.0, mean)
    mean = unit(mean)
    normal = np.where(turns[:, None], mean, pairing.normal)
    weights = pairing.secondary_weights, pairing.primary_weights, pairing.primary_bulge
    away = gap_vectors(secondary, primary, *weights)
    measured = dot(normal, away)
    if pairing.smooth is not None:
        known = np.where(pairing.paired, pairing.gap, 0.0)
        # a distance between smooth boundaries, and not a part of the vector between facets
        measured = np.where(pairing.smooth > 0, known * dot(normal, pairing.normal), measured)
    measured = np.where(pairing.gap == 0.0, 0.0, measured)  # closed ones stay closed
    if pairing.least_gap is not None:
        measured = np.maximum(measured, np.minimum(pairing.least_gap, pairing.gap))
    gap = np.where(turns, measured, pairing.gap)
    return replace(pairing, normal=normal, tangent=tangents(normal), gap=gap)


def _mirrored(surface: ContactSurface) -> NDArray[np.bool_]:
    """Nodes on a line of symmetry, whose own normal lies in it exactly, shape (m,)."""
    across = np.abs(np.sum(surface.normals * surface.held, axis=1))
    return np.asarray((surface.held.sum(axis=1) == 1) & (across <= SAME_NORMAL))


def _mean(weights: object, values: Array) -> Array:
    """Means of nodal values over the rows of a pairing; zero where a row is empty."""
    size = abs(weights)  # type: ignore[arg-type, var-annotated]
    total = np.asarray(size.sum(axis=1)).ravel()
    return np.divide(size @ values, total, out=np.zeros_like(total), where=total > 0)
