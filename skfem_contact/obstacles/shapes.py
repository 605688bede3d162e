"""Rigid planes, cylinders and spheres."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from skfem_contact.arguments import check_switch, number, take, with_known_keywords
from skfem_contact.arrays import Array
from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.digits import COMPUTED
from skfem_contact.errors import InputError
from skfem_contact.obstacles.motion import MotionLike, rigid_motion
from skfem_contact.obstacles.obstacle import (
    Obstacle,
    check_dimension,
    direction,
    facing,
    location,
)
from skfem_contact.records import dataclass

Paired = NDArray[np.bool_]


@with_known_keywords()
@dataclass(frozen=True, eq=False, init=False)
class RigidPlane(Obstacle):
    """A rigid half-space.

    Parameters
    ----------
    point : array, shape (d,)
        Any point of its surface [length].
    normal : array, shape (d,)
        Direction out of it, towards the body; of any length.
    name : str, optional

    Examples
    --------
    >>> floor = RigidPlane(point=(0, 0), normal=(0, 2))
    >>> floor.normal.tolist(), floor.moved((0.0, -0.1)).point.tolist()
    ([0.0, 1.0], [0.0, -0.1])
    """

    point: Array
    normal: Array
    name: str | None = None
    _kind = "rigid plane"

    def __init__(self, point: ArrayLike, normal: ArrayLike, name: str | None = None) -> None:
        take(self, point=point, normal=normal, name=name)

    def __post_init__(self) -> None:
        point = location(self.point, "point", self)
        normal = direction(self.normal, "normal", self)
        if point.shape != normal.shape:
            raise InputError(
                f"point has {len(point)} coordinates, normal {len(normal)} in {self.label!r}"
            )
        vars(self).update(point=point, normal=normal)

    @property
    def reference(self) -> Array:
        """The point that it was given by."""
        return self.point

    @property
    def bend(self) -> Array:
        """The curvature of a plane, see `Obstacle.bend`: (d, d) zeros."""
        return np.zeros((len(self.point), len(self.point)))

    def moved(self, motion: MotionLike) -> RigidPlane:
        """Return the plane after a rigid motion, see `Obstacle.moved`."""
        turn, shift = rigid_motion(motion, len(self.point))
        return replace(self, point=turn @ self.point + shift, normal=turn @ self.normal)

    def distance(self, surface: ContactSurface) -> tuple[Array, Array, Paired]:
        """Signed distances, normals and partners, see `Obstacle.distance`."""
        check_dimension(surface, len(self.point), self)
        gap = (surface.points - self.point) @ self.normal
        return gap, np.tile(self.normal, (len(gap), 1)), np.ones(len(gap), dtype=bool)


class Round(Obstacle):
    """An obstacle that is round about a centre or an axis: at one distance of it.

    Attributes
    ----------
    centre : ndarray, shape (d,)
        Centre, or any point of the axis [length].
    radius : float
        [length]
    axis : ndarray, shape (3,), or None
        Direction of the axis, where there is one.
    hollow : bool
        The body is inside.
    """

    centre: Array
    radius: float
    axis: Array | None = None
    hollow: bool

    def __post_init__(self) -> None:
        centre = location(self.centre, "centre", self)
        check_switch(self.hollow, f"{type(self).__name__}: hollow")
        radius = number(self.radius, f"radius of {self.label!r}", "give a length > 0")
        if not 0 < radius < np.inf:
            raise InputError(
                f"radius={self.radius!r} of {self.label!r} must be positive and finite"
                + ("; for a body inside a round hole use hollow=True" if radius < 0 else "")
            )
        vars(self).update(centre=centre, radius=radius)

    @property
    def reference(self) -> Array:
        """Its centre, or the point of its axis."""
        return self.centre

    @property
    def bend(self) -> Array:
        """The curvature, (d, d): one over its radius across the axis, negative in a hole [1/length]."""
        across = np.eye(len(self.centre))
        if self.axis is not None:
            across = across - np.outer(self.axis, self.axis)
        return (-across if self.hollow else across) / self.radius

    def turns_in_itself(self, about: Array) -> bool:
        """About its centre, in the plane."""
        return len(about) == 2 and bool(np.all(about == self.centre))

    def distance(self, surface: ContactSurface) -> tuple[Array, Array, Paired]:
        """Signed distances, normals and partners, see `Obstacle.distance`."""
        check_dimension(surface, len(self.centre), self)
        arm = surface.points - self.centre
        if self.axis is not None:
            arm = arm - np.outer(arm @ self.axis, self.axis)
        distance = np.linalg.norm(arm, axis=1)
        off_centre = distance > COMPUTED * self.radius  # at the centre no direction is the closest
        outward = arm / np.where(off_centre, distance, 1.0)[:, None]
        sign = -1.0 if self.hollow else 1.0
        normal = sign * outward
        return sign * (distance - self.radius), normal, off_centre & facing(normal, surface)


@with_known_keywords()
@dataclass(frozen=True, eq=False, init=False)
class RigidCylinder(Round):
    """A rigid cylinder, in 2-D a disc; hollow: a round hole with the body in it.

    Parameters
    ----------
    centre : array, shape (d,)
        Centre, or any point of the axis [length].
    radius : float
        [length]
    axis : array, shape (3,), optional
        Direction of the axis, in 3-D only.
    hollow : bool, optional
        The body is inside.
    name : str, optional

    Examples
    --------
    >>> RigidCylinder(centre=(0, 1), radius=1.0).moved((0.5, 0)).centre.tolist()
    [0.5, 1.0]
    """

    centre: Array
    radius: float
    axis: Array | None = None
    hollow: bool = False
    name: str | None = None
    _kind = "rigid cylinder"

    def __init__(
        self,
        centre: ArrayLike,
        radius: float,
        axis: ArrayLike | None = None,
        hollow: bool = False,
        name: str | None = None,
    ) -> None:
        take(self, centre=centre, radius=radius, axis=axis, hollow=hollow, name=name)

    def __post_init__(self) -> None:
        super().__post_init__()
        if (self.axis is None) != (len(self.centre) == 2):
            raise InputError(f"axis of {self.label!r}: needed in 3-D, and only there")
        if self.axis is not None:
            object.__setattr__(self, "axis", direction(self.axis, "axis", self))

    def moved(self, motion: MotionLike) -> RigidCylinder:
        """Return the cylinder after a rigid motion, see `Obstacle.moved`."""
        turn, shift = rigid_motion(motion, len(self.centre))
        axis = None if self.axis is None else turn @ self.axis
        return replace(self, centre=turn @ self.centre + shift, axis=axis)


@with_known_keywords()
@dataclass(frozen=True, eq=False, init=False)
class RigidSphere(Round):
    """A rigid sphere, in 2-D a disc; hollow: a round cavity with the body in it.

    With an axisymmetric body the disc is a sphere, if its centre is on the axis.

    Parameters
    ----------
    centre : array, shape (d,)
        [length]
    radius : float
        [length]
    hollow : bool, optional
        The body is inside.
    name : str, optional

    Examples
    --------
    >>> import skfem_contact as sc
    >>> ball = sc.RigidSphere((0, 0, 2), 1.0, name="ball")
    >>> moved = ball.moved((0, 0, -0.1))
    >>> moved.centre.tolist(), moved.radius
    ([0.0, 0.0, 1.9], 1.0)
    """

    centre: Array
    radius: float
    hollow: bool = False
    name: str | None = None
    _kind = "rigid sphere"

    def __init__(
        self, centre: ArrayLike, radius: float, hollow: bool = False, name: str | None = None
    ) -> None:
        take(self, centre=centre, radius=radius, hollow=hollow, name=name)

    def moved(self, motion: MotionLike) -> RigidSphere:
        """Return the sphere after a rigid motion, see `Obstacle.moved`."""
        turn, shift = rigid_motion(motion, len(self.centre))
        return replace(self, centre=turn @ self.centre + shift)
