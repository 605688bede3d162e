"""Motions of rigid obstacles, as users write them.

Rotations in space are by rotation vectors: along the axis, as long as the angle [rad].
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from skfem_contact.arguments import numbers, shown
from skfem_contact.errors import InputError

Array = NDArray[np.float64]


#: Angles below this have their factors by series: what the quotients lose of their digits.
SMALL = 1e-2
#: Five Gauss points on [0, 1]: over half a turn the spin is integrated to 1e-8, about a fixed axis
#: it is constant.
NODES, WEIGHTS = (np.polynomial.legendre.leggauss(5)[k] for k in range(2))


def rotation_matrix(angle: Any) -> Array:
    """The rotation (d, d) by an angle in the plane, or by a rotation vector: Rodrigues' formula.

    >>> rotation_matrix(np.array([0.0, 0.0, np.pi / 2])).round(12) @ np.array([1.0, 0.0, 0.0])
    array([0., 1., 0.])
    """
    if np.ndim(angle) == 0:
        return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    size = float(np.linalg.norm(angle))
    if size == 0.0:
        return np.eye(3)
    x, y, z = angle / size
    axis = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.asarray(np.eye(3) + np.sin(size) * axis + 2 * np.sin(size / 2) ** 2 * (axis @ axis))


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


#: What users write: a translation, or (translation, angle, centre).
MotionLike: TypeAlias = "ArrayLike | Sequence[Any]"


def read_motion(motion: Any, d: int, what: str = "motion") -> tuple[Array, Any, Array]:
    """Translation (d,) [length], angle [rad] and centre (d,) [length] of a motion.

    Parameters
    ----------
    motion : array, shape (d,), or (translation, angle, centre), or None
        None is no motion. The angle is a number in the plane and a rotation vector (3,) in space.
    d : int
    what : str
        What it is the motion of, for messages.

    Returns
    -------
    tuple
        In space the angle is a vector, (3,).

    Examples
    --------
    >>> read_motion((0, 1), 2)
    (array([0., 1.]), 0.0, array([0., 0.]))
    >>> read_motion(((0, 0, 1), (0.1, 0, 0), (0, 0, 0)), 3)[1]
    array([0.1, 0. , 0. ])
    """
    several = isinstance(motion, tuple | list) and len(motion) > 0 and not _number(motion[0])
    given = tuple(motion) if several else (np.zeros(d) if motion is None else motion, 0.0, np.zeros(d))
    try:
        translation, centre = numbers(given[0], "", ""), numbers(given[2], "", "")
        angle = numbers(given[1], "", "")
        finite = np.isfinite([*translation.flat, *angle.flat, *centre.flat]).all()
        shapes = len(given) == 3 and translation.shape == centre.shape == (d,)
        if shapes and finite and d == 2 and angle.shape == ():
            return translation, float(angle), centre
        if shapes and finite and d == 3 and (angle.shape == (3,) or (angle.shape == () and angle == 0)):
            return translation, np.zeros(3) + angle, centre
    except (InputError, IndexError):
        pass
    turn = {
        2: "(translation, angle, centre) with the angle in radians",
        3: "(translation, rotation vector, centre) with the vector along the axis and as long as the "
        "angle in radians",
    }[d]
    raise InputError(
        f"{what} is {shown(motion)}; give a translation of {d} numbers, or {turn}: finite, and counted "
        "from the start"
    )


def rigid_motion(motion: MotionLike | None, d: int) -> tuple[Array, Array]:
    """Rotation matrix and shift of a motion: ``x -> turn @ x + shift``."""
    translation, angle, centre = read_motion(motion, d)
    turn = rotation_matrix(angle)
    return turn, translation + centre - turn @ centre


def _number(part: Any) -> bool:
    """Return whether a part of a motion is a number, so that the whole is a translation."""
    return not isinstance(part, tuple | list) and np.ndim(part) == 0
