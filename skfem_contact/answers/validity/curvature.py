"""How surfaces curve, by their normals at the nodes, and what straight facets are off such a curve."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from skfem_contact.answers.thresholds import NEEDLE, NO_LENGTH
from skfem_contact.bodies.surface import ContactSurface, FaceSurface
from skfem_contact.pairing.faces.projection import project

Array = NDArray[np.float64]
Index = NDArray[np.intp]


def curvatures(surface: ContactSurface) -> Array:
    """Of every facet, by the normals at its ends: averaged, except over corners, (nf,) [1/length]."""
    normal = surface.facet_node_normals
    return np.asarray(np.linalg.norm(normal[:, 1] - normal[:, 0], axis=1) / surface.lengths)


def chord_gaps(surface: ContactSurface, facet: Index, points: Array) -> Array:
    """How far straight facets are below the smooth curve through their nodes, where points are, (m,).

    Nothing at their nodes and for quadratic facets; in between a parabola through the sagitta.
    """
    if surface.quadratic:
        return np.zeros(len(points))
    a, b = surface.points[surface.facets[facet, 0]], surface.points[surface.facets[facet, 1]]
    length = surface.lengths[facet]
    part = np.clip(np.einsum("md,md->m", points - a, b - a) / length**2, 0.0, 1.0)
    return np.asarray(curvatures(surface)[facet] * length**2 * part * (1 - part) / 2)


def curvature_tensors(surface: ContactSurface) -> Array:
    """How normals change along each face, by the averaged ones at its corners, (nf, 3, 3) [1/length].

    >>> import numpy as np
    >>> import skfem as fem
    >>> from skfem_contact.bodies.body import Body
    >>> mesh = fem.MeshHex.init_tensor(*3 * [np.linspace(0, 1, 4)]).with_defaults()
    >>> basis = fem.Basis(mesh, fem.ElementVector(fem.ElementHex1()), intorder=2)
    >>> cube = Body(basis, np.eye(basis.N)).surface("top")
    >>> bool(curvature_tensors(cube).any())
    False
    """
    c = surface.kind.corners
    x = surface.points[surface.facets[:, :c]]
    n = surface.facet_node_normals[:, :c]
    if np.max(np.abs(n - surface.facet_normals[:, None])) < NO_LENGTH**0.5:
        return np.zeros((len(x), 3, 3))
    x, n = x - x.mean(axis=1, keepdims=True), n - n.mean(axis=1, keepdims=True)
    square = np.einsum("fkd,fke->fde", x, x)
    change = np.einsum("fkd,fke->fde", n, x)
    K = change @ np.linalg.pinv(square, rcond=NEEDLE, hermitian=True)
    across = surface.facet_normals
    plane = np.eye(3) - across[:, :, None] * across[:, None, :]
    K = plane @ K @ plane
    return np.asarray(0.5 * (K + np.swapaxes(K, 1, 2)))


def face_gaps(surface: FaceSurface, facet: Index, points: Array, tensors: Array) -> Array:
    """How far linear faces are off the smooth surface through their nodes, where points are, (m,).

    `tensors`: those of the facets, (m, 3, 3).
    """
    if surface.quadratic:
        return np.zeros(len(facet))
    feet = project(surface, facet, points)
    away = surface.points[surface.facets[facet]] - feet.foot[:, None]
    heights = np.einsum("mkd,mde,mke->mk", away, tensors, away)
    return np.asarray(0.5 * np.abs(np.sum(feet.shape * heights, axis=1)))
