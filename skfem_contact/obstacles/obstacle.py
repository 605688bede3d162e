"""The base of all rigid obstacles: they have no DOFs, they are paired and they move.

Those made of straight facets, edges or triangles, are paired as meshes are. Motions are as users
write them; rotations in space are by rotation vectors: along the axis, as long as the angle [rad].
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from functools import cached_property
from math import factorial
from typing import Any, ClassVar, TypeAlias, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import csr_matrix, identity

from skfem_contact.arguments import PrintedAsCall, check_kind, check_name, numbers, shown
from skfem_contact.arrays import Array, Index, sizes, tangents
from skfem_contact.bodies.facet_kinds import area_vectors
from skfem_contact.bodies.surface import ContactSurface, bare_surface
from skfem_contact.errors import InputError
from skfem_contact.pairing.closest import signed_distances
from skfem_contact.pairing.node import Pairing, gap_vectors, node_to_segment
from skfem_contact.pairing.search import FACING
from skfem_contact.records import sealed

#: Weights of the corners, for the corners of new facets, and these; None where none is cut.
Cut = tuple[csr_matrix, Index] | None
Moved = TypeVar("Moved", bound="Faceted")


class Obstacle(PrintedAsCall, ABC):
    """A rigid obstacle; subclasses give the signed distance.

    The normal of an obstacle points out of it, to the side on which the body is.
    """

    name: str | None
    _kind: ClassVar[str] = "rigid obstacle"

    @property
    def label(self) -> str:
        """Name for messages."""
        return self.name or self._kind

    @property
    def reference(self) -> Array | None:
        """A point of its own (d,), about which a rigid body of this shape turns [length]."""
        return None

    @property
    def outline(self) -> ContactSurface | None:
        """Its edges or triangles, if given by those: it is then paired as a surface of a body is."""
        return None

    @property
    def bend(self) -> Array | None:
        """The curvature of its surface, (d, d): ``x' B x`` along x, positive in a bulge [1/length].

        Known of shapes that curve alike everywhere; None of others.
        """
        return None

    def turns_in_itself(self, about: Array) -> bool:
        """A rotation about a point leaves its shape where it is; known of discs alone."""
        return False

    def pair(self, surface: ContactSurface, *, motion: MotionLike | None = None) -> Pairing:
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
        gap, normal, paired = self.distance(surface)
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
    def moved(self, motion: MotionLike) -> Obstacle:
        """Return the obstacle after a rigid motion.

        Parameters
        ----------
        motion : array, shape (d,), or (translation, angle, centre)
            A translation [length]; or a rotation by `angle` [rad] about `centre`, followed by the
            translation. The angle is counterclockwise in 2-D, and a rotation vector (3,) in 3-D: along
            the axis, as long as the angle. Motions are total, from the obstacle as it was made.
        """

    @abstractmethod
    def distance(self, surface: ContactSurface) -> tuple[Array, Array, NDArray[np.bool_]]:
        """Find where the nodes of a surface are, seen from the obstacle.

        Parameters
        ----------
        surface : ContactSurface

        Returns
        -------
        gap : ndarray, shape (m,)
            Signed distance, positive outside [length].
        normal : ndarray, shape (m, d)
            Unit normals out of the obstacle.
        paired : ndarray of bool, shape (m,)
            Which nodes have a partner.
        """


def location(value: Any, what: str, obstacle: Obstacle) -> Array:
    check_name(obstacle.name, f"name of a {type(obstacle).__name__}")
    array = numbers(value, f"{what} of {obstacle.label!r}", "give 2 or 3 finite coordinates")
    if array.shape not in ((2,), (3,)) or not np.isfinite(array).all():
        raise InputError(f"{what}={value!r} of {obstacle.label!r} is not a finite point in 2-D or 3-D")
    return sealed(array)


def direction(value: Any, what: str, obstacle: Obstacle) -> Array:
    array = location(value, what, obstacle)
    length = np.linalg.norm(array)
    if length == 0:
        raise InputError(f"{what}={value!r} of {obstacle.label!r} is zero, it has no direction")
    return sealed(array / length)


def check_dimension(surface: ContactSurface, dim: int, obstacle: Obstacle) -> None:
    if surface.dim != dim:
        raise InputError(f"surface {surface.label!r} is {surface.dim}-D, {obstacle.label!r} is {dim}-D")


def facing(normal: Array, surface: ContactSurface) -> NDArray[np.bool_]:
    """Nodes of a surface that look at the obstacle, whose normals (m, d) these are there, (m,)."""
    return np.asarray(np.einsum("md,md->m", normal, surface.normals) < -FACING)


class Faceted(Obstacle):
    """A rigid obstacle that is paired as a mesh is; subclasses, dataclasses, give its facets.

    Attributes
    ----------
    points : ndarray, shape (n, d)
        Corners [length].
    """

    points: Array
    #: Flats of the outline cut beside its bends.
    _cut_flats: ClassVar[staticmethod[..., Cut]]

    @property
    @abstractmethod
    def facets(self) -> Index:
        """Numbers of the points of all edges or triangles, seen from outside, shape (nf, d)."""

    @cached_property
    def outline(self) -> ContactSurface:
        """Its facets with their normals, as surfaces of bodies have them.

        Flats are cut along the bends beside them, see `faceted`.
        """
        if self._cut is None:
            return self._plain
        weights, facets = self._cut
        return bare_surface(weights @ self.points, facets, self.label)

    @cached_property
    def _plain(self) -> ContactSurface:
        return bare_surface(self.points, self.facets, self.label)

    @cached_property
    def _cut(self) -> Cut:
        return self._cut_flats(self._plain)

    def moved(self: Moved, motion: MotionLike) -> Moved:
        """Return the obstacle after a rigid motion, see `Obstacle.moved`."""
        turn, shift = rigid_motion(motion, self.points.shape[1])
        # as good as it was: nothing is checked again, and flats are cut alike however they are turned
        twin, known = object.__new__(type(self)), {"_cut": self._cut, **vars(self)}
        placed = {name: value for name, value in known.items() if name not in ("outline", "_plain")}
        vars(twin).update(placed, points=sealed(self.points @ turn.T + shift))
        return twin

    @property
    def reference(self) -> Array:
        """The centroid of what it encloses; of an open one, of its edges or triangles."""
        x, d = self.points[self.facets], self.points.shape[1]
        out = area_vectors(x)
        if np.all(self._plain.twins >= 0):
            share = np.einsum("fd,fd->f", x[:, 0], out)
            return np.asarray(x.sum(axis=1).T @ share / ((d + 1) * share.sum()))
        share = sizes(out)
        return np.asarray(x.mean(axis=1).T @ share / share.sum())

    def distance(self, surface: ContactSurface) -> tuple[Array, Array, NDArray[np.bool_]]:
        """Signed distances, normals and partners, see `Obstacle.distance`.

        The normals are those of the obstacle; at its edges and corners, which have none, those of the
        surface. Nodes without a partner have the distance of the closest point.
        """
        check_dimension(surface, self.points.shape[1], self)
        pairing = node_to_segment(surface, self.outline)
        normal = pairing.normal if pairing.primary_normal is None else pairing.primary_normal
        weights = pairing.secondary_weights, pairing.primary_weights
        gap = np.einsum("md,md->m", normal, gap_vectors(surface, self.outline, *weights))
        if not pairing.paired.all():
            gap = np.where(pairing.paired, gap, signed_distances(self.outline, surface.points))
        return gap, normal, pairing.paired

    def signed_distance(self, points: ArrayLike) -> Array:
        """Distances of points (p, d) from it, negative inside, shape (p,) [length]."""
        d = self.points.shape[1]
        usage = f"give positions of shape (p, {d})"
        x = numbers(points, f"points for {self.label!r}", usage)
        if x.ndim != 2 or x.shape[1] != d:
            raise InputError(f"points for {self.label!r} have shape {x.shape}; {usage}")
        return signed_distances(self.outline, x)


def volume(points: Array, facets: Index) -> float:
    """Return the volume within closed facets, an area in the plane; negative if seen from inside."""
    x = points[facets] - points[facets].reshape(-1, points.shape[1]).mean(axis=0)
    return float(np.einsum("fd,fd->", x[:, 0], area_vectors(x))) / factorial(points.shape[1])


# -- how motions are written -----------------------------------------------------------------------


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
    axis = np.cross(np.eye(3), angle / size)
    return np.asarray(np.eye(3) + np.sin(size) * axis + 2 * np.sin(size / 2) ** 2 * (axis @ axis))


def spin_rate(vector: Array) -> Array:
    r"""The angular velocity per change of a rotation vector, shape (3, 3).

    With ``\dot R = [w] R``, ``w = (1 + (1 - cos a) / a^2 [v] + (a - sin a) / a^3 [v]^2) \dot v`` for
    ``R(v)`` and ``a = |v|``. Singular after a whole turn, except about the same axis.
    """
    cross, angle = np.cross(np.eye(3), vector), float(np.linalg.norm(vector))
    first = 0.5 * np.sinc(angle / (2 * np.pi)) ** 2
    # the digits that it loses where angles are small are those that [v]^2 takes off
    second = (1 - np.sinc(angle / np.pi)) / angle**2 if angle**2 > 0 else 0.0
    return np.asarray(np.eye(3) + first * cross + second * (cross @ cross))


def spin(start: Array, end: Array) -> Array:
    """The angular velocity integrated from one rotation vector straight to another, shape (3,).

    About a fixed axis it is the difference, any number of turns.
    """
    change, total = end - start, np.zeros(3)
    if not np.any(change):  # every pairing with a tool that slides far asks
        return total
    for at, weight in zip(0.5 * (NODES + 1), 0.5 * WEIGHTS, strict=True):
        total += weight * (spin_rate(start + at * change) @ change)
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
