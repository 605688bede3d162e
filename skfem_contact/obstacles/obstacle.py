"""What every rigid obstacle does: obstacles have no DOFs, they are paired and they move."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix, identity

from skfem_contact.arguments import PrintedAsCall, check_kind, check_name, numbers
from skfem_contact.bodies.normals import tangents
from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.errors import InputError
from skfem_contact.obstacles.motion import MotionLike
from skfem_contact.pairing.node import Pairing
from skfem_contact.pairing.thresholds import FACING
from skfem_contact.sealed import sealed

Array = NDArray[np.float64]


class Obstacle(PrintedAsCall, ABC):
    """What all rigid obstacles can do; subclasses give the signed distance.

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
        """How its surface curves, (d, d): ``x' B x`` along x, positive where it bulges [1/length].

        Known of shapes that curve alike everywhere; None of others.
        """
        return None

    def turns_in_itself(self, about: Array) -> bool:
        """Whether a rotation about a point leaves its shape where it is; known of discs alone."""
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
        """Where the nodes of a surface are, seen from the obstacle.

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
