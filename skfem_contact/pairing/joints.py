"""Joints of facets: the rim, and the directions that lead along the surface from edges and corners."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from skfem_contact.bodies.facet_kinds import node_positions
from skfem_contact.bodies.normals import cross, unit
from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.pairing.projection import OUT, Feet
from skfem_contact.pairing.vectors import dot, ragged, turned
from skfem_contact.records import dataclass

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Mask = NDArray[np.bool_]


def rim_points(surface: ContactSurface, mirrored: bool = True) -> Mask:
    """Nodes on edges where the surface ends, shape (m,).

    `mirrored`: also where it only ends on a plane of symmetry, square to it: the edge lies in a plane
    across an axis, that component of its nodes is prescribed, and their normals have none of it.
    """
    edges = surface.facets[:, surface.kind.edges][surface.twins < 0]
    if not mirrored:
        edges = edges[~surface.mirrored_rim.any(axis=1)]
    rim = np.zeros(len(surface.points), dtype=bool)
    rim[edges] = True
    return rim


@dataclass(frozen=True, eq=False)
class Joints:
    """The joints at the corners of faces, which tell whether a corner is the closest point of all.

    Attributes
    ----------
    first : ndarray of int, shape (m + 1,)
        Point i has the rows ``first[i]`` to ``first[i + 1]`` of `row`.
    row : ndarray of int, shape (nf c,)
        Numbers ``c f + i`` of the corners of faces at each point.
    leaving, arriving : ndarray, shape (nf c, 3)
        Unit vectors from the corner along the edges that start and that end there.
    outward : ndarray, shape (nf c, 2, 3)
        Across the edges that start and end there, out of the surface where it ends, and not on a plane
        of symmetry; else zero.
    """

    first: Index
    row: Index
    leaving: Array
    arriving: Array
    outward: Array

    @classmethod
    def of(cls, surface: ContactSurface) -> Joints:
        """Collect the corners of a surface by its points."""
        c = surface.kind.corners
        corners = surface.facets[:, :c]
        row = np.argsort(corners.ravel(), kind="stable")
        count = np.bincount(corners.ravel(), minlength=len(surface.points))
        start, end = edge_tangents(surface)
        leaving, arriving = start, -np.roll(end, 1, axis=1)
        normal = surface.own_normals[:, :c]
        rim = ((surface.twins < 0) & ~surface.mirror_edges.any(axis=2))[..., None]
        before = np.where(np.roll(rim, 1, axis=1), cross(-arriving, normal), 0.0)
        outward = np.stack([np.where(rim, cross(leaving, normal), 0.0), before], axis=2)
        return cls(
            np.concatenate([[0], np.cumsum(count)]),
            row,
            leaving.reshape(-1, 3),
            arriving.reshape(-1, 3),
            outward.reshape(-1, 2, 3),
        )

    def leads_off(self, point: Index, apart: Array, least: Array) -> Mask:
        """Return whether some face at points comes nearer than they, or the surface ends on the way.

        Parameters
        ----------
        point : ndarray of int, shape (p,)
            Points of the surface.
        apart : ndarray, shape (p, 3)
            From there to what they are the closest point to [length].
        least : ndarray, shape (p,)
            What counts as round-off [length].
        """
        count = self.first[point + 1] - self.first[point]
        row = self.row[ragged(self.first[point], count)]
        item = np.repeat(np.arange(len(point)), count)
        away = apart[item]
        along = np.maximum(dot(self.leaving[row], away), dot(self.arriving[row], away))
        beyond = np.einsum("rsd,rd->rs", self.outward[row], away).max(axis=1)
        off = np.zeros(len(point), dtype=bool)
        off[item[np.maximum(along, beyond) > least[item]]] = True
        return off


def edge_tangents(surface: ContactSurface) -> tuple[Array, Array]:
    """Unit vectors along each edge at its start and its end, each (nf, c, 3)."""
    kind, c = surface.kind, surface.kind.corners
    at = kind.locations[:c]
    way = np.roll(at, -1, axis=0) - at
    _, dN = kind.shapes(at)
    x = node_positions(surface.points, surface.facets)
    start = np.einsum("cki,ci,fkd->fcd", dN, way, x, order="F")
    end = np.einsum("cki,ci,fkd->fcd", np.roll(dN, -1, axis=0), way, x, order="F")
    return unit(start), unit(end)


def across_edges(surface: ContactSurface, feet: Feet, number: Index) -> tuple[Array, Array]:
    """Out of the facets across the edges that feet are on, and their own normals, at the feet.

    Parameters
    ----------
    surface : ContactSurface
    feet : Feet
        On edges.
    number : ndarray of int, shape (p,)
        The same edges in the facets across, ``c f + i`` of edge i of facet f.

    Returns
    -------
    outward, normal : ndarray, shape (p, d)
        Unit vectors.
    """
    kind, c = surface.kind, surface.kind.corners
    facet, edge = number // c, number % c
    if kind.dim == 1:
        normal = surface.own_normals[facet, edge]
        return OUT[edge][:, None] * turned(normal), normal
    at = kind.locations[:c]
    ways = np.roll(at, -1, axis=0) - at
    # the way along the edge is the same, from the other end
    part = dot(feet.xi - at[feet.place], ways[feet.place]) / np.sum(ways**2, axis=1)[feet.place]
    way = ways[edge]
    _, dN = kind.shapes(np.asfortranarray(at[edge] + (1.0 - part)[:, None] * way))
    along = np.einsum("pki,pkd->pid", dN, node_positions(surface.points, surface.facets[facet]))
    normal = unit(cross(along[:, 0], along[:, 1]))
    tangent = unit(np.einsum("pi,pid->pd", way, along))
    return cross(tangent, normal), normal
