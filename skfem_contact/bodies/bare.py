"""Surfaces that belong to no body: outlines of rigid obstacles, for the searches of contact."""

from __future__ import annotations

from typing import Any

import numpy as np

from skfem_contact.bodies.face_kinks import kink_angles as face_kinks
from skfem_contact.bodies.face_normals import areas_and_normals, face_areas
from skfem_contact.bodies.faces import twin_edges
from skfem_contact.bodies.facet_kinds import kind_of
from skfem_contact.bodies.facets import facet_neighbours
from skfem_contact.bodies.normals import kink_angles, lengths_and_normals, tributary_areas
from skfem_contact.bodies.surface import CurveSurface, FaceSurface
from skfem_contact.sealed import seal


class NoBody:
    """In place of a body: it does not give way, and no other surface belongs to it."""

    name = None
    measure = None
    D = np.zeros(0, dtype=np.int64)

    def __init__(self, d: int) -> None:
        self.dim = self.components = d


def bare_curve(points: np.ndarray, facets: np.ndarray, name: str) -> CurveSurface:
    """A surface of straight facets, listed along it with the solid on the left.

    Parameters
    ----------
    points : ndarray, shape (m, 2)
        [length]
    facets : ndarray of int, shape (nf, 2)
    name : str

    Examples
    --------
    >>> points = np.array([[0, 0], [1, 0], [1, 1], [0, 1.0]])
    >>> square = bare_curve(points, np.array([[0, 1], [1, 2], [2, 3], [3, 0]]), "square")
    >>> square.facet_normals.tolist()[0]
    [0.0, -1.0]
    """
    nobody: Any = NoBody(2)
    neighbours = facet_neighbours(facets)
    held = np.zeros(points.shape, dtype=bool)
    surface = CurveSurface(
        body=nobody,
        name=name,
        points=points,
        dofs=np.arange(points.size).reshape(points.shape),
        facets=facets,
        area=tributary_areas(points, facets, None, name),
        mesh_facets=np.arange(len(facets)),
        slopes=np.zeros(facets.shape),
        end_turns=np.zeros(facets.shape),
        kinks=kink_angles(points, facets, neighbours),
        **lengths_and_normals(points, facets, held, neighbours),
    )
    seal(surface)
    return surface


def bare_faces(points: np.ndarray, facets: np.ndarray, name: str) -> FaceSurface:
    """A surface of triangles, whose corners are counter-clockwise seen from outside.

    Parameters
    ----------
    points : ndarray, shape (m, 3)
        [length]
    facets : ndarray of int, shape (nf, 3)
    name : str

    Examples
    --------
    >>> points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0.0]])
    >>> bare_faces(points, np.array([[0, 1, 2]]), "floor").facet_normals.tolist()
    [[0.0, 0.0, 1.0]]
    """
    nobody: Any = NoBody(3)
    kind, held, twins = kind_of(3, 3), np.zeros(points.shape, dtype=bool), twin_edges(facets)
    surface = FaceSurface(
        body=nobody,
        name=name,
        points=points,
        dofs=np.arange(points.size).reshape(points.shape),
        facets=facets,
        area=face_areas(points, facets, kind, None, name),
        mesh_facets=np.arange(len(facets)),
        kinks=face_kinks(points, facets, kind, twins),
        twins=twins,
        **areas_and_normals(points, facets, kind, held, twins),
    )
    seal(surface)
    return surface
