"""Tangents where rollers or planes of symmetry go through a contact."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from skfem_contact.bodies.normals import unit
from skfem_contact.pairing.thresholds import SHARE_FREE

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]


def along_supports(tangent: Array, normal: Array, held: Mask) -> Array:
    """Tangents (m, 2, 3) turned about the normal so that what supports hold is one of them.

    A roller or a plane of symmetry through the contact takes one direction from the slip. It has to be
    along a tangent: else both rows would be half held, and stand for the one direction that is left
    together.

    Parameters
    ----------
    tangent : ndarray, shape (m, 2, 3)
    normal : ndarray, shape (m, 3)
    held : ndarray of bool, shape (m, 3)
        Prescribed components of the nodes.

    Examples
    --------
    >>> frame = np.array([[[0.6, 0.8, 0.0], [-0.8, 0.6, 0.0]]])
    >>> turned = along_supports(frame, np.array([[0.0, 0.0, 1.0]]), np.array([[True, False, False]]))
    >>> turned.tolist()
    [[[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]]
    """
    count = held.sum(axis=1)
    # the only one that is held, or the only one that is free
    axis = np.where(count == 1, np.argmax(held, axis=1), np.argmin(held, axis=1))
    across = np.eye(3)[axis] - normal[np.arange(len(normal)), axis][:, None] * normal
    some = ((count == 1) | (count == 2)) & (np.linalg.norm(across, axis=1) > SHARE_FREE)
    first = unit(np.where(some[:, None], across, tangent[:, 0]))
    frame = np.stack([first, np.cross(normal, first)], axis=1)
    return np.where(some[:, None, None], frame, tangent)
