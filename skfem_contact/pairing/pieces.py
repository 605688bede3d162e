"""`Pieces`: parts of an interface on which one facet meets one facet, and the integrals over them.

`segmentation` finds them between curves, as intervals of a facet, `face_segmentation` between faces, as
polygons in the plane of a cell. `Moments` are the integrals of products of shape functions.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from skfem_contact.bodies.normals import unit
from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.pairing.bulges import Bulges, Parts
from skfem_contact.pairing.dual import positive_functions
from skfem_contact.pairing.smooth import Place, curved_pairs
from skfem_contact.pairing.thresholds import NO_WEIGHT
from skfem_contact.pairing.vectors import summed
from skfem_contact.records import dataclass

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
        """Return what meets at the ends or corners of some pieces."""

    @abstractmethod
    def distances(self, some: Index) -> Array:
        """Return how far the secondary's nodes are from some pieces of their facets, shape (p, k)."""

    @abstractmethod
    def nodes(self, some: Index, local: Index) -> Meeting:
        """Return what normals at nodes meet, one of the facet of each piece, if its partner went on."""


@dataclass(frozen=True, eq=False)
class Moments:
    """Integrals of products of shape functions over the pieces of an interface.

    Attributes
    ----------
    e, f : ndarray of int, shape (p,)
        Facets of the secondary and of the primary that each piece is part of.
    own : ndarray, shape (nf, k, k)
        ``int N_i N_j`` over the covered part of each facet of the secondary [area].
    inside : ndarray, shape (p, k, k)
        The same over each piece [area].
    cross : ndarray, shape (p, k, k')
        ``int N_i N_j^primary`` over each piece [area].
    """

    e: Index
    f: Index
    own: Array
    inside: Array
    cross: Array

    @classmethod
    def of(cls, pieces: Pieces) -> Moments:
        """Integrate over all pieces."""
        e, f = pieces.facets
        nf, k = pieces.secondary.facets.shape
        p, k_other = len(e), pieces.primary.facets.shape[1]
        own, across = np.zeros((p, k * k)), np.zeros((p, k * k_other))
        for piece, points, weight in pieces.points():
            weighted = np.swapaxes(points.N * weight[..., None], 1, 2)
            own += summed(piece, (weighted @ points.N).reshape(len(piece), k * k), p)
            across += summed(piece, (weighted @ points.M).reshape(len(piece), k * k_other), p)
        whole = summed(e, own, nf).reshape(nf, k, k)
        return cls(e, f, whole, own.reshape(p, k, k), across.reshape(p, k, k_other))


def whole_shares(surface: ContactSurface) -> Array:
    """Integrals of what the multipliers are dual to over whole facets, shape (nf, k) [area].

    Where one is zero, at the end of a quadratic line on the axis of symmetry, it is that of a facet of
    the same area off the axis: every share is a part of something.
    """
    kind, nodes = surface.kind, surface.points[surface.facets]
    at, weight = kind.quadrature(2 * kind.degree)
    N, dN = kind.shapes(at)
    along = np.moveaxis(np.tensordot(dN, nodes, (1, 1)), 1, 0)  # (d-1, q, nf, d)
    across = along[0] if kind.dim == 1 else np.cross(*along)
    area = np.linalg.norm(across, axis=-1) * weight[:, None]
    if surface.body.measure is not None:
        area = area * surface.body.measure(np.moveaxis(np.tensordot(N, nodes, (1, 1)), -1, 0))
    tests = N @ positive_functions(kind).T
    whole, plain = area.T @ tests, np.outer(area.sum(axis=0), positive_functions(kind) @ kind.shares)
    return np.asarray(np.where(whole > NO_WEIGHT * plain, whole, plain))


def bulges_of(pieces: Pieces, moments: Moments) -> tuple[Parts, tuple[Index, Array], Array]:
    """Return what smooth boundaries change on the pieces that have some, see `bulges.bulged`.

    The last are the least gaps of the pieces, infinite where facets are all there is, (p,).
    """
    secondary, primary, count = pieces.secondary, pieces.primary, len(moments.e)
    some = np.flatnonzero(curved_pairs(secondary, primary, moments.e, moments.f))
    e, f = moments.e[some], moments.f[some]
    apart = moments.inside[some] @ secondary.points[secondary.facets[e]]
    apart -= moments.cross[some] @ primary.points[primary.facets[f]]
    found, least = [], np.full(count, np.inf)
    place = np.zeros(count, dtype=np.intp)
    place[some] = np.arange(len(some))
    for piece, met, weight in pieces.points(some, heights=True) if len(some) else ():
        # components first: long sums in place of many short ones
        N, M, v, gap, weight = (
            np.ascontiguousarray(x.T) for x in (met.N, met.M, met.directions, met.gap, weight)
        )
        places = Place(secondary, met.e, N), Place(primary, met.f, M)
        mine, part = Bulges.of(piece, places, v, gap, weight)
        found.append((place[mine], part))
        least[mine] = np.minimum(least[mine], part.least)
    return found, (e, apart), least
