"""The nodes round every node of a surface, as an osculating quadric is fitted to them (`quadrics`)."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix, diags

from skfem_contact.arrays import Array, Index, Mask
from skfem_contact.bodies.facet_kinds import FacetKind
from skfem_contact.bodies.thresholds import ENOUGH
from skfem_contact.digits import GIVEN


def around(facets: Index, kind: FacetKind, bowed: Mask, m: int) -> csr_matrix:
    """Return which nodes share a facet, (m, m); those of `bowed` facets share the part between them.

    Parameters
    ----------
    facets : ndarray of int, shape (nf, k)
    kind : FacetKind
    bowed : ndarray of bool, shape (nf,)
        Facets that are curved themselves; of others the corners count.
    m : int
        Number of nodes.
    """
    whole = [list(range(kind.corners))]
    rows, columns = [np.zeros(0, dtype=np.intp)], [np.zeros(0, dtype=np.intp)]
    for some, parts in ((facets[~bowed], whole), (facets[bowed], kind.parts)):
        for part in parts:
            for shift in range(1, len(part)):
                rows.append(some[:, part].ravel())
                columns.append(some[:, np.roll(part, shift)].ravel())
    row, column = np.concatenate(rows), np.concatenate(columns)
    shared = csr_matrix((np.ones(len(row)), (row, column)), shape=(m, m))
    shared.sum_duplicates()
    return shared


def mirrors(points: Array, edges: Index, held: Mask, normals: Array) -> Mask:
    """Components across which a surface goes on as its mirror image, where it ends, shape (r, d).

    There it ends in a plane across an axis, that component is prescribed, and the normals have none
    of it.

    Parameters
    ----------
    points : ndarray, shape (m, d)
    edges : ndarray of int, shape (r, d-1)
        Where the surface ends: nodes in the plane, edges in space.
    held : ndarray of bool, shape (m, d)
    normals : ndarray, shape (m, d)
    """
    across = np.ptp(points[edges], axis=1)
    in_plane = across <= GIVEN * np.linalg.norm(across, axis=1, keepdims=True)
    ends = held[edges] & (np.abs(normals[edges]) <= GIVEN)
    clamped = np.all(held[edges], axis=(1, 2), keepdims=True)[:, 0]
    return np.asarray(in_plane & ends.all(axis=1) & ~clamped)


def rings(
    points: Array, shared: csr_matrix, passable: Mask, mirrored: Mask, chosen: Index
) -> tuple[Array, Mask]:
    """Return the neighbours of nodes, seen from them, and their neighbours where these are few.

    Parameters
    ----------
    points : ndarray, shape (m, d)
    shared : csr_matrix, shape (m, m)
        From `around`.
    passable : ndarray of bool, shape (m,)
        Nodes beyond which a surface is the same piece; not those at edges and kinks.
    mirrored : ndarray of bool, shape (m, d)
        Components across which the surface goes on as its mirror image at a node.
    chosen : ndarray of int, shape (q,)
        Nodes that are asked for.

    Returns
    -------
    away : ndarray, shape (q, r, d)
        Padded with zeros [length].
    there : ndarray of bool, shape (q, r)
    """
    away, there = _offsets(points, shared, mirrored, chosen)
    few = np.flatnonzero(there.sum(axis=1) < ENOUGH[points.shape[1]])
    if len(few):
        own = shared[chosen[few]]
        second = own + own @ diags(passable.astype(float)) @ shared
        wider, more = _offsets(points, csr_matrix(second), mirrored, chosen[few], rows=True)
        r = max(away.shape[1], wider.shape[1])
        away, there = _padded(away, r), _padded(there, r)
        away[few], there[few] = _padded(wider, r), _padded(more, r)
    return away, there


def _offsets(
    points: Array, shared: csr_matrix, mirrored: Mask, chosen: Index, rows: bool = False
) -> tuple[Array, Mask]:
    """Offsets of the columns of rows, and of their images; `rows`: one row for each node chosen."""
    matrix = shared if rows else shared[chosen]
    count = np.diff(matrix.indptr)
    r = int(count.max(initial=0))
    place = np.arange(matrix.nnz) - np.repeat(matrix.indptr[:-1], count)
    row = np.repeat(np.arange(len(chosen)), count)
    away = np.zeros((len(chosen), r, points.shape[1]))
    there = np.zeros((len(chosen), r), dtype=bool)
    away[row, place] = points[matrix.indices] - points[chosen[row]]
    there[row, place] = matrix.indices != chosen[row]
    away[~there] = 0.0
    for axis in np.flatnonzero(mirrored[chosen].any(axis=0)):
        sign = np.where(np.arange(points.shape[1]) == axis, -1.0, 1.0)
        size = np.abs(away).max(axis=(1, 2), initial=0.0)[:, None]
        image = there & mirrored[chosen, axis, None] & (np.abs(away[..., axis]) > GIVEN * size)
        away = np.concatenate([away, np.where(image[..., None], sign * away, 0.0)], axis=1)
        there = np.concatenate([there, image], axis=1)
    return away, there


def _padded(values: NDArray[Any], r: int) -> NDArray[Any]:
    """An array (q, r', ...) with zeros up to r columns."""
    out = np.zeros((len(values), r, *values.shape[2:]), dtype=values.dtype)
    out[:, : values.shape[1]] = values
    return out
