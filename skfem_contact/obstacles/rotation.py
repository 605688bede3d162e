"""Rotations in space by rotation vectors: along the axis, as long as the angle [rad]."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Angles below this have their factors by series: what the quotients lose of their digits.
SMALL = 1e-2
#: Five Gauss points on [0, 1]: over half a turn the spin is integrated to 1e-8, about a fixed axis
#: it is constant.
NODES, WEIGHTS = (np.polynomial.legendre.leggauss(5)[k] for k in range(2))


def skew(vector: Array) -> Array:
    """The matrix of ``vector x``.

    >>> skew(np.array([0.0, 0.0, 1.0])) @ np.array([1.0, 0.0, 0.0])
    array([0., 1., 0.])
    """
    x, y, z = vector
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def rotation_matrix(vector: Array) -> Array:
    """The rotation (3, 3) by a rotation vector, by Rodrigues' formula.

    >>> rotation_matrix(np.array([0.0, 0.0, np.pi / 2])).round(12) @ np.array([1.0, 0.0, 0.0])
    array([0., 1., 0.])
    """
    angle = float(np.linalg.norm(vector))
    if angle == 0.0:
        return np.eye(3)
    axis = skew(vector / angle)
    return np.asarray(np.eye(3) + np.sin(angle) * axis + 2 * np.sin(angle / 2) ** 2 * (axis @ axis))


def spin(start: Array, end: Array) -> Array:
    r"""The angular velocity integrated from one rotation vector straight to another, shape (3,).

    With ``\dot R = [w] R``, ``w = (1 + (1 - cos a) / a^2 [v] + (a - sin a) / a^3 [v]^2) \dot v`` for
    ``R(v)`` and ``a = |v|``. About a fixed axis it is the difference, any number of turns.
    """
    change = end - start
    total = np.zeros(3)
    for at, weight in zip(0.5 * (NODES + 1), 0.5 * WEIGHTS, strict=True):
        vector = start + at * change
        angle = float(np.linalg.norm(vector))
        square = angle**2
        first, second = 0.5 - square / 24, 1 / 6 - square / 120
        if angle > SMALL:
            first, second = (1 - np.cos(angle)) / square, (angle - np.sin(angle)) / angle**3
        once = np.cross(vector, change)
        total += weight * (change + first * once + second * np.cross(vector, once))
    return total
