"""Rigid planes, cylinders and spheres; and what a function says, found by Newton's method."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from skfem_contact.arguments import check_name, check_switch, number, numbers, take, with_known_keywords
from skfem_contact.arrays import Array
from skfem_contact.bodies.normal_field import BENT
from skfem_contact.bodies.selection import written
from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.digits import COMPUTED, SINGLE, SOLVED
from skfem_contact.errors import InputError
from skfem_contact.obstacles.obstacle import (
    MotionLike,
    Obstacle,
    check_dimension,
    direction,
    facing,
    location,
    rigid_motion,
)
from skfem_contact.records import carried, dataclass

Paired = NDArray[np.bool_]
Moved = TypeVar("Moved", bound="Round")


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

    def moved(self: Moved, motion: MotionLike) -> Moved:
        """Return the obstacle after a rigid motion, see `Obstacle.moved`."""
        turn, shift = rigid_motion(motion, len(self.centre))
        axis = {} if self.axis is None else {"axis": turn @ self.axis}
        return replace(self, centre=turn @ self.centre + shift, **axis)  # type: ignore[type-var]

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


# -- functions -------------------------------------------------------------------------------------


#: Steps of central differences, as fractions of the size of the surface: roots of round-off, where it
#: and the error of the quotient are as large. Those of differences again only steer Newton's steps.
FIRST, SECOND = np.finfo(float).eps ** (1 / np.array([3.0, 4.0]))


@with_known_keywords()
@dataclass(frozen=True, eq=False)
class LevelSet(Obstacle):
    """A rigid obstacle given by a function that is negative inside and positive outside.

    Parameters
    ----------
    function : callable
        Function of the component-first position, ``(d, m) -> (m,)``; it need not be a distance.
    gradient : callable, optional
        Its gradient, ``(d, m) -> (d, m)``; central differences if not given. Its direction is checked
        against them; its length is free.
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

    function: Callable[[Array], Array]
    gradient: Callable[[Array], Array] | None = None
    name: str | None = None

    def __getstate__(self) -> dict[str, Any]:
        known = dict(vars(self))
        for key in ("function", "gradient"):
            known[key] = carried(known[key], f"{key} of {self.label!r}")
        return known

    def __post_init__(self) -> None:
        check_name(self.name, "name of a LevelSet")
        for key in ("function", "gradient"):
            value = getattr(self, key)
            if not (callable(value) or (key == "gradient" and value is None)):
                raise InputError(
                    f"{key} of {self.label!r} is a {type(value).__name__}, not a function of the "
                    "component-first position, as in lambda x: x[1] - x[0] ** 2"
                )

    def moved(self, motion: MotionLike) -> LevelSet:
        """Return the obstacle after a rigid motion, see `Obstacle.moved`."""
        turn, shift = rigid_motion(motion, _dimension(motion))
        function, gradient = self.function, self.gradient

        def back(x: Array) -> Array:
            return np.tensordot(turn.T, x - shift.reshape(-1, *[1] * (x.ndim - 1)), axes=1)

        return replace(
            self,
            function=lambda x: function(back(x)),
            gradient=gradient and (lambda x: np.tensordot(turn, gradient(back(x)), axes=1)),
        )

    def distance(self, surface: ContactSurface) -> tuple[Array, Array, NDArray[np.bool_]]:
        """Signed distances, normals and partners, see `Obstacle.distance`."""
        x = surface.points
        size = float(np.linalg.norm(np.ptp(x, axis=0)))
        self._check_gradient(x, size)
        y, converged = self._closest(x, size)
        self._check_gradient(y[converged], size)
        normal, _, looks = self._normals(y, surface, size)
        gap = np.einsum("md,md->m", normal, x - y)
        return gap, normal, converged & looks & (gap >= -0.5 * size)

    def first_order(self, surface: ContactSurface) -> tuple[Array, Array, NDArray[np.bool_]]:
        """Return `distance` by the value over the gradient, which is right near the obstacle."""
        x = surface.points
        normal, steep, looks = self._normals(x, surface, float(np.linalg.norm(np.ptp(x, axis=0))))
        return self._value(x) / steep, normal, looks

    def _normals(
        self, y: Array, surface: ContactSurface, size: float
    ) -> tuple[Array, Array, NDArray[np.bool_]]:
        """Unit normals at positions, how steep the function is, and which nodes look at them.

        Where nothing is steep the normal is zero, and no node looks at it.
        """
        gradient = self._gradient(y, size)
        steep = np.linalg.norm(gradient, axis=1)
        steep = np.where(steep > 0, steep, 1.0)
        normal = gradient / steep[:, None]
        return normal, steep, facing(normal, surface)

    def _value(self, x: Array) -> Array:
        return self._asked(
            "function", self.function, x, (len(x),), "one finite number for each position"
        )

    def _gradient(self, x: Array, size: float) -> Array:
        if self.gradient is None:
            return _central(lambda p: self._value(p)[:, None], x, FIRST * size)[:, 0]
        what = "as many finite numbers, component-first"
        return self._asked("gradient", self.gradient, x, x.T.shape, what).T

    def _asked(
        self, name: str, function: Callable[[Array], Array], x: Array, shape: Any, what: str
    ) -> Array:
        """Call a user's function at positions (m, d); the answer must have this shape and be finite."""
        usage = f"it must return {what}"
        found = numbers(function(x.T), f"what the {name} of {self.label!r} returned", usage)
        if found.shape != shape or not np.isfinite(found).all():
            raise InputError(
                f"{name} of {self.label!r} returned an array of shape {found.shape} with "
                f"{np.count_nonzero(~np.isfinite(found))} NaN or infinite values for positions of "
                f"shape {x.T.shape}; {usage}"
            )
        return found

    def _check_gradient(self, x: Array, size: float) -> None:
        """Refuse a gradient that points elsewhere than the function grows.

        Where the two one-sided quotients differ the function has a kink, or noise, and no gradient.
        """
        if self.gradient is None or not len(x):
            return
        step = FIRST * size
        here = self._value(x)
        shifts = step * np.eye(x.shape[1])
        ahead = np.stack([self._value(x + h) - here for h in shifts], axis=1) / step
        behind = np.stack([here - self._value(x - h) for h in shifts], axis=1) / step
        grows, given = 0.5 * (ahead + behind), self._gradient(x, size)
        lengths = np.linalg.norm(grows, axis=1), np.linalg.norm(given, axis=1)
        smooth = np.linalg.norm(ahead - behind, axis=1) <= BENT * lengths[0]
        units = [
            v / np.where(n > 0, n, 1.0)[:, None] for v, n in zip((grows, given), lengths, strict=True)
        ]
        off = np.where(smooth & (lengths[0] > 0), np.linalg.norm(units[0] - units[1], axis=1), 0.0)
        worst = int(np.argmax(off))
        # no round-off explains it: differences have some nine digits; curvature tells one-sided ones
        # apart by 1e-5
        if off[worst] > BENT:
            raise InputError(
                f"gradient of {self.label!r} is not that of its function: at {written(x[worst])} it is "
                f"{written(given[worst])}, but the function grows by {written(grows[worst])} per "
                f"length, another direction. Correct it, or leave gradient out: differences do as well."
            )

    def _closest(self, x: Array, size: float) -> tuple[Array, NDArray[np.bool_]]:
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
            second = _central(lambda p: self._gradient(p, size), y, SECOND * size)
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
            if length.max() <= COMPUTED * size:
                break
        steep = np.linalg.norm(gradient, axis=1)
        on_surface = np.abs(self._value(y)) <= SOLVED * size * steep
        across = y - x + multiplier[:, None] * gradient
        stationary = np.linalg.norm(across, axis=1) <= SINGLE * (size + np.linalg.norm(y - x, axis=1))
        return y, on_surface & stationary


def _dimension(motion: Any) -> int:
    """Of space, by the translation of a motion: a level set itself has none."""
    several = isinstance(motion, tuple | list) and len(motion) > 0 and np.ndim(motion[0]) > 0
    return 3 if np.shape(motion[0] if several else motion) == (3,) else 2


def _central(function: Callable[[Array], Array], x: Array, step: float) -> Array:
    """Derivatives (m, k, d) of a function (m, d) -> (m, k) by central differences."""
    shifts = step * np.eye(x.shape[1])
    return np.stack([(function(x + h) - function(x - h)) / (2 * step) for h in shifts], axis=2)
