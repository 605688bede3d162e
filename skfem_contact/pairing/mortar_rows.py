"""What the rows of mortar contact have in common, of curves and of faces."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix, csr_matrix

from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.digits import SOLVED
from skfem_contact.pairing.closest import search_range
from skfem_contact.pairing.node import gap_vectors
from skfem_contact.pairing.vectors import without_round_off
from skfem_contact.trees import Tree

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Mask = NDArray[np.bool_]


def divided(matrix: csr_matrix, by: Array, paired: NDArray[np.bool_]) -> csr_matrix:
    """Rows divided by their sums, entries that are zero kept; no rows where not paired."""
    rows = matrix.tocoo()
    keep = paired[rows.row]
    row, col = rows.row[keep], rows.col[keep]
    out = csr_matrix((rows.data[keep] / by[row], (row, col)), shape=matrix.shape)
    out.sum_duplicates()
    return out


def shared_nodes(secondary: ContactSurface, primary: ContactSurface) -> NDArray[np.bool_]:
    """Nodes that are on both surfaces (the tip of a slit) and can not meet themselves."""
    if secondary.body is not primary.body:
        return np.zeros(len(secondary.points), dtype=bool)
    return np.isin(secondary.dofs[:, 0], primary.dofs[:, 0])


def main_facets(
    secondary: ContactSurface, primary: ContactSurface, e: Index, f: Index, part: Array
) -> Index:
    """For each node the primary facet where its shape function weighs most, (m,); -1 where none.

    Parameters
    ----------
    secondary, primary : ContactSurface
    e, f : ndarray of int, shape (p,)
        Facets that meet.
    part : ndarray, shape (p, k)
        Weights of the nodes of facet e over what it has in common with f.
    """
    shape = (len(secondary.points), len(primary.facets))
    node, opposite = secondary.facets[e].ravel(), np.repeat(f, part.shape[1])
    parts = coo_matrix((part.ravel(), (node, opposite)), shape=shape).tocsr().tocoo()
    facet = np.full(shape[0], -1)
    order = np.argsort(parts.data, kind="stable")  # the last written is the largest
    facet[parts.row[order]] = parts.col[order]
    return facet


def node_directions(surface: ContactSurface, total: Array, area: Array) -> Array:
    """Unit vectors along weighted sums of normals (m, d), whose weights add up to the areas (m,)."""
    length = np.linalg.norm(total, axis=1, keepdims=True)
    # opposite sides cancel at no corner but a crack tip; there the node's own will do
    known = length > SOLVED * area[:, None]
    return np.divide(total, length, out=surface.normals.copy(), where=known)


def weighted_gaps(
    secondary: ContactSurface,
    primary: ContactSurface,
    normal: Array,
    weights: tuple[csr_matrix, csr_matrix],
    change: Array | None,
    least: Array | None,
) -> Array:
    """Gaps along the normals by the weights of both sides, no less than `least`, (m,).

    `change` is what smooth boundaries make of them (`smooth`).
    """
    gap = np.sum(normal * gap_vectors(secondary, primary, *weights), axis=1)
    if change is not None:
        gap += change
    if least is not None:
        gap = np.maximum(gap, least)
    curved = np.zeros(len(gap), dtype=bool) if change is None else change != 0
    return without_round_off(gap, secondary, primary, curved)


def overhang(
    secondary: ContactSurface,
    primary: ContactSurface,
    paired: NDArray[np.bool_],
    reach: float | None,
) -> tuple[Array, Index]:
    """How far points are beside the primary, across their normal [length], and of which facet."""
    outside, inside = search_range(secondary, primary, reach)
    _, nearest = Tree(primary.points).query(secondary.points)
    away = primary.points[nearest] - secondary.points
    normal = secondary.normals
    along = np.sum(away * normal, axis=1)
    across = np.linalg.norm(away - along[:, None] * normal, axis=1)
    facing = np.sum(normal * primary.normals[nearest], axis=1) < 0
    beside = facing & (along <= outside) & (along >= -inside)
    facet_of = np.empty(len(primary.points), dtype=np.intp)
    facet_of[primary.facets] = np.arange(len(primary.facets))[:, None]
    miss = np.select([paired, beside], [0.0, across], np.inf)
    return miss, np.where(beside, facet_of[nearest], -1)
