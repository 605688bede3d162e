"""Surfaces that belong to no body: outlines of rigid obstacles, for the searches of contact."""

from __future__ import annotations

from typing import Any

import numpy as np

from skfem_contact.bodies.facets import facet_neighbours
from skfem_contact.bodies.normals import kink_angles, lengths_and_normals, tributary_areas
from skfem_contact.bodies.surface import CurveSurface
from skfem_contact.sealed import seal


class NoBody:
    """In place of a body: no node moves, and no other surface belongs to it."""

    name = None
    measure = None

    def __init__(self, points: np.ndarray) -> None:
        self.dim = self.components = points.shape[1]
        self.D = np.arange(points.size)


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
    nobody: Any = NoBody(points)
    neighbours = facet_neighbours(facets)
    held = np.ones(points.shape, dtype=bool)
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
