"""`Outlined`: what obstacles do that are given by points, with edges or triangles between them."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import fields
from typing import ClassVar, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from skfem_contact.arguments import numbers
from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.errors import InputError
from skfem_contact.obstacles.motion import MotionLike, rigid_motion
from skfem_contact.obstacles.obstacle import Obstacle, check_dimension
from skfem_contact.pairing.node import Pairing, gap_vectors
from skfem_contact.sealed import sealed

Array = NDArray[np.float64]
Moved = TypeVar("Moved", bound="Outlined")


class Outlined(Obstacle):
    """A rigid obstacle that is paired as a mesh is; subclasses, dataclasses, say how.

    Attributes
    ----------
    points : ndarray, shape (n, d)
        Corners of the outline [length].
    """

    points: Array
    _dim: ClassVar[int]

    @property
    @abstractmethod
    def outline(self) -> ContactSurface:
        """Its edges or triangles with their normals, as surfaces of bodies have them."""

    @abstractmethod
    def _partners(self, surface: ContactSurface) -> Pairing:
        """The nodes of a surface on the outline."""

    @abstractmethod
    def _signed_distances(self, points: Array) -> Array:
        """From the outline, negative inside, shape (p,)."""

    def moved(self: Moved, motion: MotionLike) -> Moved:
        """Return the obstacle after a rigid motion, see `Obstacle.moved`."""
        turn, shift = rigid_motion(motion, self._dim)
        twin = object.__new__(type(self))  # as good as it was: nothing is checked again
        known = {f.name: getattr(self, f.name) for f in fields(self)}  # type: ignore[arg-type]
        vars(twin).update(known | {"points": sealed(self.points @ turn.T + shift)})
        return twin

    def distance(self, surface: ContactSurface) -> tuple[Array, Array, NDArray[np.bool_]]:
        """Signed distances, normals and partners, see `Obstacle.distance`.

        The normals are those of the obstacle; at its edges and corners, which have none, those of the
        surface. Nodes without a partner have the distance of the closest point.
        """
        check_dimension(surface, self._dim, self)
        pairing = self._partners(surface)
        normal = pairing.normal if pairing.primary_normal is None else pairing.primary_normal
        weights = pairing.secondary_weights, pairing.primary_weights
        gap = np.einsum("md,md->m", normal, gap_vectors(surface, self.outline, *weights))
        if not pairing.paired.all():
            gap = np.where(pairing.paired, gap, self._signed_distances(surface.points))
        return gap, normal, pairing.paired

    def signed_distance(self, points: ArrayLike) -> Array:
        """Distances of points (p, d) from it, negative inside, shape (p,) [length]."""
        usage = f"give positions of shape (p, {self._dim})"
        x = numbers(points, f"points for {self.label!r}", usage)
        if x.ndim != 2 or x.shape[1] != self._dim:
            raise InputError(f"points for {self.label!r} have shape {x.shape}; {usage}")
        return self._signed_distances(x)
