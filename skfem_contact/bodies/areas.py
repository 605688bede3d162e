"""Area elements of facets, their own normals, and the areas that belong to the nodes."""

from __future__ import annotations

from typing import Any

import numpy as np

from skfem_contact.arguments import numbers
from skfem_contact.arrays import Array, Index
from skfem_contact.bodies.facet_kinds import FacetKind, node_positions
from skfem_contact.bodies.normals import across, sizes
from skfem_contact.digits import SOLVED
from skfem_contact.errors import InputError


def area_elements(points: Array, facets: Index, kind: FacetKind, xi: Array) -> Array:
    """Outward normals with the length of the line or area element, (nf, q, d), at (q, d-1)."""
    element = _elements(points, facets, kind, kind.shapes(xi)[1])
    return np.broadcast_to(element, (len(facets), len(xi), points.shape[1]))


def _elements(points: Array, facets: Index, kind: FacetKind, dN: Array) -> Array:
    """`area_elements` for derivatives (q, k, d-1); of straight facets only one, (nf, 1, d)."""
    if kind.straight:  # the same all over, so it is computed once
        x = points.T.take(facets.T, axis=1)
        return across((x[:, 1:] - x[:, :1]).T)[:, None]
    return across(np.einsum("qki,fkd->fqid", dN, node_positions(points, facets), order="F"))


def facet_sizes(points: Array, facets: Index, kind: FacetKind) -> Array:
    """Lengths of lines, areas of faces, shape (nf,)."""
    _, dN, weight = kind.gauss
    density = sizes(_elements(points, facets, kind, dN))
    return density[:, 0] * weight.sum() if kind.straight else density @ weight


def own_normals(points: Array, facets: Index, kind: FacetKind) -> tuple[Array, Array]:
    """The facets' own outward unit normals at their nodes, (nf, k, d), and in the middle, (nf, d).

    At a node where the facet has no tangents, as at a quarter point, that of the middle.
    """
    element = _elements(points, facets, kind, kind.derivatives)
    size = sizes(element)[..., None]
    middle = element[:, -1] / size[:, -1]
    if kind.straight:
        return np.repeat(middle[:, None], kind.nodes, axis=1), middle
    size, least = size[:, :-1], SOLVED * size[:, -1:]
    if size.min() > least.max():
        return element[:, :-1] / size, middle
    there = size > least
    return np.where(there, element[:, :-1] / np.where(there, size, 1.0), middle[:, None]), middle


def tributary_areas(points: Array, facets: Index, kind: FacetKind, measure: Any, label: str) -> Array:
    """Integrals of the shape functions, times the measure, over the surface, shape (m,)."""
    N, dN, weight = kind.gauss
    density = sizes(_elements(points, facets, kind, dN)) * weight
    if measure is not None:
        density = density * weights_of(measure, np.einsum("qk,fkd->dfq", N, points[facets]), label)
    return np.asarray(np.bincount(facets.ravel(), (density @ N).ravel(), len(points)), dtype=float)


def area_integrals(points: Array, facets: Index, kind: FacetKind, measure: Any) -> tuple[Array, Array]:
    """``int N n dA`` with the measure of the body, (m, d), and ``int |N| dA`` without, (m,)."""
    N, dN, weight = kind.gauss
    element = _elements(points, facets, kind, dN) * weight[:, None]
    size = sizes(element)
    if measure is not None:
        x = np.einsum("qk,fkd->dfq", N, points[facets])
        element = element * np.asarray(measure(x))[..., None]
    area, total = np.zeros_like(points), np.zeros(len(points))
    np.add.at(area, facets, np.einsum("qk,fqd->fkd", N, element))
    np.add.at(total, facets, size @ np.abs(N))
    return area, total


def weights_of(measure: Any, x: Array, label: str) -> Array:
    """The measure of a body at positions (d, nf, q) of a surface, checked."""
    usage = "return one positive number for each position, as in lambda x: 2 * np.pi * x[0]"
    factor = numbers(measure(x), f"measure on surface {label!r}", usage)
    if factor.shape not in ((), x.shape[1:]):
        raise InputError(
            f"measure on surface {label!r} has shape {factor.shape} for positions of shape "
            f"{x.shape}; {usage}"
        )
    factor = np.broadcast_to(factor, x.shape[1:])
    if not np.all(np.isfinite(factor)) or factor.min() < 0 or factor.max() <= 0:
        raise InputError(
            f"measure is {factor.min():.3g} to {factor.max():.3g} on surface {label!r}; a "
            "weight of the area is positive and finite (an axisymmetric mesh lies at x[0] >= 0)"
        )
    return factor
