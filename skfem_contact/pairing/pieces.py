"""`Pieces`: parts of an interface on which one facet meets one facet, and what meets there.

`segmentation` finds them between curves, as intervals of a facet, `faces.segmentation` between faces,
as polygons in the plane of a cell. Whatever is integrated over them asks for no more than what is here.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from skfem_contact.bodies.normals import unit
from skfem_contact.bodies.surface import ContactSurface

Array = NDArray[np.float64]
Index = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class Meeting:
    """Points of the secondary and what their normals meet: n points for each of p pairs of facets.

    Attributes
    ----------
    e, f : ndarray of int, shape (p,)
        Facets of the secondary and of the primary.
    N, M : ndarray, shapes (p, n, k) and (p, n, k')
        Shape functions of their nodes; beyond the ends or edges of a facet they are continued.
    normal : ndarray, shape (p, n, d), or (p, 1, d)
        The normal field of the secondary, not of unit length.
    nodes : (ndarray, ndarray), shapes (p, k, d) and (p, k', d)
        Positions of the nodes of both [length].
    axes : ndarray, shape (p, d, d), or None
        Axes of the coordinates that `normal` and `nodes` are in; None for those of space.
    """

    e: Index
    f: Index
    N: Array
    M: Array
    normal: Array
    nodes: tuple[Array, Array]
    axes: Array | None

    @property
    def gap(self) -> Array:
        """Distance along the normal, > 0 open, shape (p, n) [length]."""
        away = self.M @ self.nodes[1] - self.N @ self.nodes[0]
        return np.asarray(np.sum(away * self.normal, axis=-1) / np.linalg.norm(self.normal, axis=-1))

    @property
    def directions(self) -> Array:
        """Unit vectors along the normals in the coordinates of space, shape (p, n, d)."""
        normal = self.normal if self.axes is None else self.normal @ self.axes
        return np.broadcast_to(unit(normal), (*self.N.shape[:2], normal.shape[-1]))


@dataclass(frozen=True, eq=False)
class Pieces(ABC):
    """Pieces of an interface, p in number.

    Attributes
    ----------
    secondary, primary : ContactSurface
        Both curves, or both faces.
    """

    secondary: ContactSurface
    primary: ContactSurface

    @property
    @abstractmethod
    def facets(self) -> tuple[Index, Index]:
        """Facets of the secondary and of the primary that each piece is part of, (p,) each."""

    @abstractmethod
    def points(
        self, some: Index | None = None, heights: bool = False
    ) -> Iterator[tuple[Index, Meeting, Array]]:
        """Yield quadrature points, those of some pieces at a time.

        Parameters
        ----------
        some : ndarray of int, optional
            Only of these pieces.
        heights : bool
            For integrals of heights (`smooth`), else for those of rows.

        Yields
        ------
        piece : ndarray of int, shape (t,)
            The piece that each of t parts of pieces belongs to; ascending.
        meeting : Meeting
            Of n points for each of them.
        weight : ndarray, shape (t, n)
            Weights times area, times the secondary body's ``measure`` [area].
        """

    @abstractmethod
    def corners(self, some: Index) -> Meeting:
        """What meets at the ends or corners of some pieces."""

    @abstractmethod
    def distances(self, some: Index) -> Array:
        """How far the nodes of the secondary's facets are from some pieces of them, shape (p, k)."""

    @abstractmethod
    def nodes(self, some: Index, local: Index) -> Meeting:
        """What the normals at nodes meet, one of the facet of each piece, if its partner went on."""
