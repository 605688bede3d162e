"""Rigid planes, cylinders, spheres, level sets: obstacles without DOFs."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.sparse import csr_matrix, identity

from skfem_contact.arguments import check_kind, check_name, check_switch, number, numbers
from skfem_contact.errors import InputError
from skfem_contact.pairing import FACING, Pairing, tangents
from skfem_contact.surface import ContactSurface

#: Steps of central differences, as fractions of the size of the surface: for gradients (the cube
#: root of round-off) and for second derivatives, which only steer the Newton steps.
STEP = (1e-5, 1e-4)


class Obstacle(ABC):
    """What all rigid obstacles can do; subclasses give the signed distance.

    The normal of an obstacle points out of it, to the side on which the body is.
    """

    name: str | None

    @property
    def label(self) -> str:
        """Name for messages."""
        return self.name or {
            "RigidPlane": "rigid plane",
            "RigidCylinder": "rigid cylinder",
            "RigidSphere": "rigid sphere",
        }.get(type(self).__name__, "rigid obstacle")

    def pair(self, surface: ContactSurface, *, motion: Any = None) -> Pairing:
        """Pair every node of a surface with its closest point on the obstacle.

        Parameters
        ----------
        surface : ContactSurface
            The secondary surface.
        motion : array, shape (d,), or (translation, angle, centre), optional
            Total motion of the obstacle, see `moved`.

        Returns
        -------
        Pairing
            `primary_weights` has no columns. Nodes that look away from the obstacle are not paired
            (a plane takes every node).
        """
        check_kind(surface, ContactSurface, "surface", "take one by body.surface('name')")
        if motion is not None:
            return self.moved(motion).pair(surface)
        points, m = surface.points, len(surface.points)
        gap, normal, paired = self._distance(surface)
        normal = np.where(paired[:, None], normal, -surface.normals)
        return Pairing(
            points=points,
            normal=normal,
            tangent=tangents(normal),
            gap=np.where(paired, gap, np.inf),
            area=surface.area,
            secondary_weights=identity(m, format="csr"),
            primary_weights=csr_matrix((m, 0)),
            paired=paired,
            miss=np.where(paired, 0.0, np.inf),
            facet=np.full(m, -1),
        )

    @abstractmethod
    def moved(self, motion: Any) -> Obstacle:
        """Return the obstacle after a rigid motion.

        Parameters
        ----------
        motion : array, shape (d,), or (translation, angle, centre)
            A translation [length]; or in 2-D a rotation by `angle` [rad, counterclockwise] about
            `centre`, followed by the translation. Motions are total, from the obstacle as it was
            made.
        """

    @abstractmethod
    def _distance(self, surface: ContactSurface) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Signed distances (m,), unit normals (m, d), and which nodes have a partner (m,)."""


@dataclass(frozen=True, eq=False)
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

    point: np.ndarray
    normal: np.ndarray
    name: str | None = None

    def __post_init__(self) -> None:
        point = _place(self.point, "point", self)
        normal = _direction(self.normal, "normal", self)
        if point.shape != normal.shape:
            raise InputError(
                f"point has {len(point)} coordinates, normal {len(normal)} in {self.label!r}"
            )
        object.__setattr__(self, "point", point)
        object.__setattr__(self, "normal", normal)

    def moved(self, motion: Any) -> RigidPlane:
        """Return the plane after a rigid motion, see `Obstacle.moved`."""
        turn, shift = _motion(motion, len(self.point))
        return replace(self, point=turn @ self.point + shift, normal=turn @ self.normal)

    def _distance(self, surface: ContactSurface) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        _same_dimension(surface, len(self.point), self)
        gap = (surface.points - self.point) @ self.normal
        return gap, np.tile(self.normal, (len(gap), 1)), np.ones(len(gap), dtype=bool)


@dataclass(frozen=True, eq=False)
class RigidCylinder(Obstacle):
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

    centre: np.ndarray
    radius: float
    axis: np.ndarray | None = None
    hollow: bool = False
    name: str | None = None

    def __post_init__(self) -> None:
        centre = _place(self.centre, "centre", self)
        check_switch(self.hollow, "RigidCylinder: hollow")
        object.__setattr__(self, "centre", centre)
        object.__setattr__(self, "radius", _radius(self.radius, self))
        if (self.axis is None) != (len(centre) == 2):
            raise InputError(f"axis of {self.label!r}: needed in 3-D, and only there")
        if self.axis is not None:
            object.__setattr__(self, "axis", _direction(self.axis, "axis", self))

    def moved(self, motion: Any) -> RigidCylinder:
        """Return the cylinder after a rigid motion, see `Obstacle.moved`."""
        turn, shift = _motion(motion, len(self.centre))
        axis = None if self.axis is None else turn @ self.axis
        return replace(self, centre=turn @ self.centre + shift, axis=axis)

    def _distance(self, surface: ContactSurface) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        _same_dimension(surface, len(self.centre), self)
        arm = surface.points - self.centre
        if self.axis is not None:
            arm = arm - np.outer(arm @ self.axis, self.axis)
        return _round(arm, self.radius, self.hollow, surface)


@dataclass(frozen=True, eq=False)
class RigidSphere(Obstacle):
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
    """

    centre: np.ndarray
    radius: float
    hollow: bool = False
    name: str | None = None

    def __post_init__(self) -> None:
        check_switch(self.hollow, "RigidSphere: hollow")
        object.__setattr__(self, "centre", _place(self.centre, "centre", self))
        object.__setattr__(self, "radius", _radius(self.radius, self))

    def moved(self, motion: Any) -> RigidSphere:
        """Return the sphere after a rigid motion, see `Obstacle.moved`."""
        turn, shift = _motion(motion, len(self.centre))
        return replace(self, centre=turn @ self.centre + shift)

    def _distance(self, surface: ContactSurface) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        _same_dimension(surface, len(self.centre), self)
        return _round(surface.points - self.centre, self.radius, self.hollow, surface)


@dataclass(frozen=True, eq=False)
class LevelSet(Obstacle):
    """A rigid obstacle given by a function that is negative inside and positive outside.

    Parameters
    ----------
    function : callable
        Function of the component-first position, ``(d, m) -> (m,)``; it need not be a distance.
    gradient : callable, optional
        Its gradient, ``(d, m) -> (d, m)``; central differences if not given.
    name : str, optional

    Notes
    -----
    The closest point `y` to a node `x` satisfies ``y - x + l grad F(y) = 0``, ``F(y) = 0``; it is
    found by Newton's method, started where the steepest descent from `x` meets the obstacle. A
    node for which that does not converge has no partner. Overlaps up to half the diagonal of the
    box around the surface are considered.

    Examples
    --------
    >>> bowl = LevelSet(lambda x: x[1] - x[0] ** 2, name="bowl")
    """

    function: Callable[[np.ndarray], np.ndarray]
    gradient: Callable[[np.ndarray], np.ndarray] | None = None
    name: str | None = None

    def __post_init__(self) -> None:
        check_name(self.name, "name of a LevelSet")
        for key in ("function", "gradient"):
            value = getattr(self, key)
            if not (callable(value) or (key == "gradient" and value is None)):
                raise InputError(
                    f"{key} of {self.label!r} is a {type(value).__name__}, not a function of the "
                    "component-first position, as in lambda x: x[1] - x[0] ** 2"
                )

    def moved(self, motion: Any) -> LevelSet:
        """Return the obstacle after a rigid motion, see `Obstacle.moved`."""
        turn, shift = _motion(motion, 2)
        function, gradient = self.function, self.gradient

        def back(x: np.ndarray) -> np.ndarray:
            return np.tensordot(turn.T, x - shift.reshape(-1, *[1] * (x.ndim - 1)), axes=1)

        return replace(
            self,
            function=lambda x: function(back(x)),
            gradient=gradient and (lambda x: np.tensordot(turn, gradient(back(x)), axes=1)),
        )

    def _distance(self, surface: ContactSurface) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        x = surface.points
        size = float(np.linalg.norm(np.ptp(x, axis=0)))
        y, converged = self._closest(x, size)
        gradient = self._gradient(y, size)
        steep = np.linalg.norm(gradient, axis=1)
        normal = gradient / np.where(steep > 0, steep, 1.0)[:, None]
        gap = np.einsum("md,md->m", normal, x - y)
        facing = np.einsum("md,md->m", normal, surface.normals) < -FACING
        return gap, normal, converged & (steep > 0) & facing & (gap >= -0.5 * size)

    def _value(self, x: np.ndarray) -> np.ndarray:
        usage = "it must return one finite number for each position"
        value = numbers(self.function(x.T), f"what the function of {self.label!r} returned", usage)
        if value.shape != (len(x),) or not np.isfinite(value).all():
            raise InputError(
                f"function of {self.label!r} returned an array of shape {value.shape} with "
                f"{np.count_nonzero(~np.isfinite(value))} NaN or infinite values for positions of "
                f"shape {x.T.shape}; it must return one finite number for each position"
            )
        return value

    def _gradient(self, x: np.ndarray, size: float) -> np.ndarray:
        if self.gradient is None:
            return _central(lambda p: self._value(p)[:, None], x, STEP[0] * size)[:, 0]
        usage = "it must return as many numbers as the positions have"
        gradient = numbers(self.gradient(x.T), f"what the gradient of {self.label!r} returned", usage)
        if gradient.shape != x.T.shape or not np.isfinite(gradient).all():
            raise InputError(
                f"gradient of {self.label!r} returned an array of shape {gradient.shape} with "
                f"{np.count_nonzero(~np.isfinite(gradient))} NaN or infinite values for positions "
                f"of shape {x.T.shape}; it must return as many finite numbers, component-first"
            )
        return gradient.T

    def _closest(self, x: np.ndarray, size: float) -> tuple[np.ndarray, np.ndarray]:
        m, d = x.shape
        y = x.copy()
        for _ in range(5):  # along the steepest descent onto the obstacle
            gradient = self._gradient(y, size)
            steep = np.maximum(np.sum(gradient**2, axis=1), np.finfo(float).tiny)
            y = y - (self._value(y) / steep)[:, None] * gradient
        gradient = self._gradient(y, size)
        steep = np.maximum(np.sum(gradient**2, axis=1), np.finfo(float).tiny)
        multiplier = np.einsum("md,md->m", x - y, gradient) / steep
        for _ in range(20):
            second = _central(lambda p: self._gradient(p, size), y, STEP[1] * size)
            matrix = np.zeros((m, d + 1, d + 1))
            matrix[:, :d, :d] = np.eye(d) + multiplier[:, None, None] * second
            matrix[:, :d, d] = matrix[:, d, :d] = gradient
            residual = np.column_stack([y - x + multiplier[:, None] * gradient, self._value(y)])
            # the pseudo-inverse stands also where the gradient vanishes (such a node does not
            # converge)
            step = np.einsum("mij,mj->mi", np.linalg.pinv(matrix), residual)
            length = np.linalg.norm(step[:, :d], axis=1)
            shorter = np.minimum(1.0, 0.5 * size / np.maximum(length, 0.5 * size))
            y = y - shorter[:, None] * step[:, :d]
            multiplier = multiplier - shorter * step[:, d]
            gradient = self._gradient(y, size)
            if length.max() <= 1e-12 * size:
                break
        steep = np.linalg.norm(gradient, axis=1)
        on_surface = np.abs(self._value(y)) <= 1e-9 * size * steep
        across = y - x + multiplier[:, None] * gradient
        # central differences give normals with some nine digits
        stationary = np.linalg.norm(across, axis=1) <= 1e-7 * (size + np.linalg.norm(y - x, axis=1))
        return y, on_surface & stationary


def _central(function: Callable[[np.ndarray], np.ndarray], x: np.ndarray, step: float) -> np.ndarray:
    """Derivatives (m, k, d) of a function (m, d) -> (m, k) by central differences."""
    shifts = step * np.eye(x.shape[1])
    return np.stack([(function(x + h) - function(x - h)) / (2 * step) for h in shifts], axis=2)


def _round(
    arm: np.ndarray, radius: float, hollow: bool, surface: ContactSurface
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    distance = np.linalg.norm(arm, axis=1)
    off_centre = distance > 1e-12 * radius  # at the centre no direction is the closest
    outward = arm / np.where(off_centre, distance, 1.0)[:, None]
    sign = -1.0 if hollow else 1.0
    normal = sign * outward
    facing = np.einsum("md,md->m", normal, surface.normals) < -FACING
    return sign * (distance - radius), normal, off_centre & facing


def _motion(motion: Any, dim: int) -> tuple[np.ndarray, np.ndarray]:
    """Rotation matrix and shift of a motion: ``x -> turn @ x + shift``."""
    usage = (
        "a motion is a translation of shape (d,), or in 2-D (translation, angle, centre), total, "
        "with the angle in radians"
    )
    if not isinstance(motion, tuple | list) or not motion or _flat(motion[0]):
        shift = numbers(motion, "motion", usage)
        turn = np.eye(dim)
    else:
        if len(motion) != 3 or dim != 2:
            raise InputError(f"motion of {len(motion)} parts in {dim}-D; {usage}")
        angle = number(motion[1], "angle of the motion", usage)
        centre = numbers(motion[2], "centre of the motion", usage)
        first = numbers(motion[0], "translation of the motion", usage)
        turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        if centre.shape != (dim,):
            raise InputError(f"centre of the motion has shape {centre.shape}, not ({dim},); {usage}")
        if first.shape != (dim,):
            raise InputError(
                f"translation of the motion has shape {first.shape}, not ({dim},); {usage}"
            )
        shift = first + centre - turn @ centre
    if shift.shape != (dim,) or not (np.isfinite(shift).all() and np.isfinite(turn).all()):
        raise InputError(f"motion={motion!r} in {dim}-D; {usage}")
    return turn, shift


def _flat(part: Any) -> bool:
    """Whether a part of a motion is a number, so that the whole is a translation."""
    return not isinstance(part, tuple | list) and np.ndim(part) == 0


def _place(value: Any, what: str, obstacle: Obstacle) -> np.ndarray:
    check_name(obstacle.name, f"name of a {type(obstacle).__name__}")
    array = numbers(value, f"{what} of {obstacle.label!r}", "give 2 or 3 finite coordinates")
    if array.shape not in ((2,), (3,)) or not np.isfinite(array).all():
        raise InputError(f"{what}={value!r} of {obstacle.label!r} is not a finite point in 2-D or 3-D")
    return array


def _direction(value: Any, what: str, obstacle: Obstacle) -> np.ndarray:
    array = _place(value, what, obstacle)
    length = np.linalg.norm(array)
    if length == 0:
        raise InputError(f"{what}={value!r} of {obstacle.label!r} is zero, it has no direction")
    return array / length


def _radius(value: Any, obstacle: Obstacle) -> float:
    radius = number(value, f"radius of {obstacle.label!r}", "give a length > 0")
    if not 0 < radius < np.inf:
        raise InputError(
            f"radius={value!r} of {obstacle.label!r} must be positive and finite"
            + ("; for a body inside a round hole use hollow=True" if radius < 0 else "")
        )
    return radius


def _same_dimension(surface: ContactSurface, dim: int, obstacle: Obstacle) -> None:
    if surface.dim != dim:
        raise InputError(f"surface {surface.label!r} is {surface.dim}-D, {obstacle.label!r} is {dim}-D")
