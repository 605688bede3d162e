"""Closest points of single facets to points, and the normal there."""

from __future__ import annotations

import numpy as np

from skfem_contact.bodies.facets import facet_shapes
from skfem_contact.bodies.normals import unit
from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.bodies.thresholds import LEAST_SLOPE, NEAREST


def project(
    surface: ContactSurface, facet: np.ndarray, points: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Closest points of facets to points, one facet for each point.

    Parameters
    ----------
    surface : ContactSurface
    facet : ndarray of int, shape (p,)
    points : ndarray, shape (p, d)

    Returns
    -------
    xi : ndarray, shape (p,)
        Local coordinate, in [0, 1].
    foot : ndarray, shape (p, d)
        The closest point.
    over : ndarray, shape (p,)
        By how much the point lies beyond the nearer end, along the tangent there [length]; else 0.
    """
    # `take` gathers rows in a tenth of the time of an index
    corners = surface.points.take(surface.facets.take(facet, axis=0), axis=0)
    k = corners.shape[1]
    chord = corners[:, 1] - corners[:, 0]
    xi = np.einsum("pd,pd->p", points - corners[:, 0], chord) / np.einsum("pd,pd->p", chord, chord)
    xi = np.clip(xi, 0.0, 1.0)
    if k == 3:
        xi = _newton(corners, points, xi)
        N, dN = facet_shapes(xi, k)
        foot = np.einsum("pk,pkd->pd", N, corners)
        along = np.einsum("pk,pkd->pd", dN, corners)
    else:
        foot = (1 - xi)[:, None] * corners[:, 0] + xi[:, None] * corners[:, 1]
        along = chord
    along = unit(along)
    beyond = np.einsum("pd,pd->p", points - foot, along)
    over = np.where(xi >= 1, beyond, np.where(xi <= 0, -beyond, 0.0))
    return xi, foot, np.maximum(over, 0.0)


def _newton(corners: np.ndarray, points: np.ndarray, xi: np.ndarray) -> np.ndarray:
    """Minimise the distance to quadratic facets: projected Newton steps, best of six starts."""
    fixed = np.broadcast_to(np.linspace(0.0, 1.0, 5)[:, None], (5, len(xi)))
    starts = np.vstack([fixed, xi])
    where = np.einsum("spk,pkd->spd", facet_shapes(starts, 3)[0], corners)
    best = np.argmin(np.sum((where - points) ** 2, axis=2), axis=0)
    xi = starts[best, np.arange(len(xi))]
    second = 4 * corners[:, 0] + 4 * corners[:, 1] - 8 * corners[:, 2]
    for _ in range(12):
        N, dN = facet_shapes(xi, 3)
        apart = np.einsum("pk,pkd->pd", N, corners) - points
        first = np.einsum("pk,pkd->pd", dN, corners)
        squared = np.einsum("pd,pd->p", first, first)
        # beyond the centre of curvature the second derivative is negative: keep descending
        slope = np.maximum(squared + np.einsum("pd,pd->p", apart, second), LEAST_SLOPE * squared)
        new = np.clip(xi - np.einsum("pd,pd->p", apart, first) / slope, 0.0, 1.0)
        change, xi = np.abs(new - xi).max(initial=0.0), new
        if change <= NEAREST:
            break
    return xi


def interpolated_normals(surface: ContactSurface, facet: np.ndarray, xi: np.ndarray) -> np.ndarray:
    """Continuous unit normal field at local coordinates `xi` of facets, shape (len(facet), d)."""
    ends = surface.facet_node_normals.take(facet, axis=0)
    return unit((1 - xi)[:, None] * ends[:, 0] + xi[:, None] * ends[:, 1])
