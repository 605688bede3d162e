"""Motions of rigid obstacles, as users write them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from skfem_contact.arguments import numbers, shown
from skfem_contact.errors import InputError
from skfem_contact.obstacles.rotation import rotation_matrix

Array = NDArray[np.float64]
#: What users write: a translation, or (translation, angle, centre).
MotionLike = ArrayLike | Sequence[Any]


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
    if d == 2:
        turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    else:
        turn = rotation_matrix(angle)
    return turn, translation + centre - turn @ centre


def _number(part: Any) -> bool:
    """Whether a part of a motion is a number, so that the whole is a translation."""
    return not isinstance(part, tuple | list) and np.ndim(part) == 0
