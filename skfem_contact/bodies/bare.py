"""Surfaces that belong to no body: outlines of rigid obstacles, for the searches of contact."""

from __future__ import annotations

import numpy as np

from skfem_contact.bodies.facet_kinds import kind_of
from skfem_contact.bodies.facets import twin_edges
from skfem_contact.bodies.surface import ContactSurface, surface_of


class NoBody:
    """In place of a body: it does not give way, and no other surface belongs to it."""

    name = None
    measure = None
    D = np.zeros(0, dtype=np.int64)

    def __init__(self, d: int) -> None:
        self.dim = self.components = d


def bare_surface(points: np.ndarray, facets: np.ndarray, name: str) -> ContactSurface:
    """A surface of given facets: lines with the solid on the left, one after the other, or faces.

    It is the polygon or polyhedron that it is, no piece of a curve.

    Parameters
    ----------
    points : ndarray, shape (m, d)
        [length]
    facets : ndarray of int, shape (nf, k)
        Corners of faces counter-clockwise seen from outside.
    name : str

    Examples
    --------
    >>> points = np.array([[0, 0], [1, 0], [1, 1], [0, 1.0]])
    >>> square = bare_surface(points, np.array([[0, 1], [1, 2], [2, 3], [3, 0]]), "square")
    >>> square.facet_normals.tolist()[0]
    [0.0, -1.0]
    >>> points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0.0]])
    >>> bare_surface(points, np.array([[0, 1, 2]]), "floor").facet_normals.tolist()
    [[0.0, 0.0, 1.0]]
    """
    dofs, count = np.arange(points.size).reshape(points.shape), len(facets)
    twins = twin_edges(facets[:, : kind_of(points.shape[1], facets.shape[1]).corners])
    given = {"mesh_facets": np.arange(count), "slopes": np.zeros((count, 2))}
    return surface_of(NoBody(points.shape[1]), name, points, dofs, facets, twins, **given)
