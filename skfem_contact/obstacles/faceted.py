"""Rigid obstacles made of straight facets, edges or triangles: they are paired as meshes are."""

from __future__ import annotations

from abc import abstractmethod
from functools import cached_property
from math import factorial
from typing import ClassVar, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import csr_matrix

from skfem_contact.arguments import numbers
from skfem_contact.bodies.bare import bare_surface
from skfem_contact.bodies.facets import area_vectors
from skfem_contact.bodies.normals import sizes
from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.errors import InputError
from skfem_contact.obstacles.motion import MotionLike, rigid_motion
from skfem_contact.obstacles.obstacle import Obstacle, check_dimension
from skfem_contact.pairing.node import Pairing, gap_vectors
from skfem_contact.sealed import sealed

Array = NDArray[np.float64]
Index = NDArray[np.intp]
#: Weights of the corners, for the corners of new facets, and these; None where none is cut.
Cut = tuple[csr_matrix, Index] | None
Moved = TypeVar("Moved", bound="Faceted")


class Faceted(Obstacle):
    """A rigid obstacle that is paired as a mesh is; subclasses, dataclasses, give its facets.

    Attributes
    ----------
    points : ndarray, shape (n, d)
        Corners [length].
    """

    points: Array
    #: The nodes of a surface on the outline; distances of points from it; flats cut beside its bends.
    _pair: ClassVar[staticmethod[..., Pairing]]
    _depths: ClassVar[staticmethod[..., Array]]
    _cut_flats: ClassVar[staticmethod[..., Cut]]

    @property
    @abstractmethod
    def facets(self) -> Index:
        """Numbers of the points of all edges or triangles, seen from outside, shape (nf, d)."""

    @cached_property
    def outline(self) -> ContactSurface:
        """Its facets with their normals, as surfaces of bodies have them.

        Flats are cut along the bends beside them, see `bends`.
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
        pairing = self._pair(surface, self.outline)
        normal = pairing.normal if pairing.primary_normal is None else pairing.primary_normal
        weights = pairing.secondary_weights, pairing.primary_weights
        gap = np.einsum("md,md->m", normal, gap_vectors(surface, self.outline, *weights))
        if not pairing.paired.all():
            gap = np.where(pairing.paired, gap, self._depths(self.outline, surface.points))
        return gap, normal, pairing.paired

    def signed_distance(self, points: ArrayLike) -> Array:
        """Distances of points (p, d) from it, negative inside, shape (p,) [length]."""
        d = self.points.shape[1]
        usage = f"give positions of shape (p, {d})"
        x = numbers(points, f"points for {self.label!r}", usage)
        if x.ndim != 2 or x.shape[1] != d:
            raise InputError(f"points for {self.label!r} have shape {x.shape}; {usage}")
        return self._depths(self.outline, x)


def volume(points: Array, facets: Index) -> float:
    """What closed facets enclose, an area in the plane; negative where they are seen from inside."""
    x = points[facets] - points[facets].reshape(-1, points.shape[1]).mean(axis=0)
    return float(np.einsum("fd,fd->", x[:, 0], area_vectors(x))) / factorial(points.shape[1])
