"""Signed distances of points from a surface in space, whichever way anything looks."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.pairing.faces.projection import Feet, project
from skfem_contact.pairing.faces.search import FaceNodes, FaceTree
from skfem_contact.pairing.vectors import dot
from skfem_contact.trees import Tree

Array = NDArray[np.float64]
Index = NDArray[np.intp]


def signed_distances(surface: ContactSurface, points: Array) -> Array:
    """Distances of points (p, 3) from a surface, negative where its body is, shape (p,) [length].

    At an edge the sum of both faces' normals tells the sides apart, at a corner the sum over its faces
    weighted by their angles: J. A. Baerentzen, H. Aanaes, IEEE Trans. Vis. Comput. Graph. 11 (2005)
    243-253.
    """
    middles = Tree(surface.points[surface.facets].mean(axis=1))
    guess = np.asarray(middles.query(points)[1])
    bound = np.linalg.norm(points - project(surface, guess, points).foot, axis=1)

    def in_reach(point: Index, nodes: FaceNodes) -> NDArray[np.bool_]:
        away = np.linalg.norm(points[point] - nodes.centre, axis=1)
        return np.asarray(away - nodes.radius <= bound[point])

    found = FaceTree.build(surface).descend(len(points), in_reach)
    point, facet = (np.concatenate(column) for column in zip(*found, strict=True))
    feet = project(surface, facet, points[point])
    distance = np.linalg.norm(points[point] - feet.foot, axis=1)
    order = np.lexsort((facet, distance, point))
    first = order[np.unique(point[order], return_index=True)[1]]
    apart = points - feet.foot[first]
    outward = _outward(surface, facet[first], feet, first)
    return np.where(dot(apart, outward) < 0, -1.0, 1.0) * distance[first]


def _outward(surface: ContactSurface, facet: Index, feet: Feet, chosen: Index) -> Array:
    """A direction that tells outside from inside at feet, (p, 3)."""
    c, place = surface.kind.corners, feet.place[chosen]
    outward = feet.own[chosen].copy()
    on_edge = (place >= 0) & (place < c)
    other = surface.neighbours[facet, np.where(on_edge, place, 0)]
    both = on_edge & (other >= 0)
    outward[both] += surface.facet_normals[other[both]]
    at_corner = place >= c
    node = surface.facets[facet, np.where(at_corner, place - c, 0)]
    outward[at_corner] = _corner_normals(surface)[node[at_corner]]
    return outward


def _corner_normals(surface: ContactSurface) -> Array:
    """Sums of the faces' normals at each node, weighted by their angles there, (m, 3)."""
    corners = surface.facets[:, : surface.kind.corners]
    x = surface.points[corners]
    ahead, back = np.roll(x, -1, axis=1) - x, np.roll(x, 1, axis=1) - x
    angle = np.arctan2(np.linalg.norm(np.cross(ahead, back), axis=2), dot(ahead, back))
    total = np.zeros_like(surface.points)
    np.add.at(total, corners, angle[..., None] * surface.own_normals[:, : surface.kind.corners])
    return total
