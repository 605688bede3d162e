r"""Areas and outward normals of faces, and normals at their nodes that are continuous where faces are.

At a vertex the faces' own normals are averaged with the weights ``sin(alpha) / (|a| |b|)`` of the two
edges a, b that a face has there: exact if the nodes lie on a sphere, whatever the faces round the
vertex (N. Max, J. Graphics Tools 4 (1999) 1-6), and what ``1 / length`` is for curves. Faces take part
that can be reached round the vertex over edges which bend by no more than a corner does (`CORNER`).
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from skfem_contact.bodies.facet_kinds import FacetKind, node_positions
from skfem_contact.bodies.normals import cross, unit, weights_of
from skfem_contact.bodies.thresholds import CORNER
from skfem_contact.digits import GIVEN, SOLVED

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Mask = NDArray[np.bool_]


def area_elements(points: Array, facets: Index, kind: FacetKind, xi: Array) -> Array:
    """Outward normals of faces with the length of the area element, (nf, q, 3), at (q, 2)."""
    _, dN = kind.shapes(xi)
    along = np.einsum("qki,fkd->fqid", dN, node_positions(points, facets), order="F")
    return cross(along[:, :, 0], along[:, :, 1]) + 0.0  # + 0.0 turns -0.0 into 0.0


def areas_and_normals(
    points: Array, facets: Index, kind: FacetKind, held: Mask, twins: Index
) -> dict[str, Any]:
    """Sizes and normals of faces: what changes when the surface moves.

    Parameters
    ----------
    points : ndarray, shape (m, 3)
    facets : ndarray of int, shape (nf, k)
    kind : FacetKind
    held : ndarray of bool, shape (m, 3)
        Prescribed components.
    twins : ndarray of int, shape (nf, c)
        From `faces.twin_edges`.
    """
    at, weight = kind.quadrature()
    area = np.linalg.norm(area_elements(points, facets, kind, at), axis=2) @ weight
    own = area_elements(points, facets, kind, np.vstack([kind.locations, kind.middle]))
    middle = unit(own[:, -1])
    own = _unit_or(own[:, :-1], middle[:, None], np.linalg.norm(own[:, -1:], axis=2, keepdims=True))
    c = kind.corners
    corners = facets[:, :c]
    weighted, piece = _pieces(points, corners, own[:, :c], twins)
    averaged = own.copy()
    averaged[:, :c] = _means(weighted, piece, own[:, :c])
    mirrored = _on_symmetry(points, corners, held, twins, kind, middle, averaged[:, :c])
    if mirrored.any():
        # with the mirror image across a plane of symmetry, without which the last node would be
        # constrained along the normals of chords
        image = np.zeros((piece.max() + 1, 3), dtype=bool)
        for at_end in (piece, np.roll(piece, -1, axis=1)):
            np.logical_or.at(image, at_end, mirrored)
        weighted = np.where(image[piece], 0.0, weighted)
        averaged[:, :c] = _means(weighted, piece, own[:, :c])
    if kind.quadratic:
        averaged[:, c : 2 * c] = _at_edges(own[:, c : 2 * c], area, twins, mirrored)

    total = np.zeros_like(points)
    np.add.at(total, facets[:, :c], weighted)
    if kind.quadratic:
        np.add.at(total, facets[:, c:], averaged[:, c:])
    # faces back to back (the front of a crack) cancel: then the one met last decides
    size = np.zeros(len(points))
    np.add.at(size, facets[:, :c], np.linalg.norm(weighted, axis=2))
    lost = np.linalg.norm(total, axis=1) <= SOLVED * size
    fallback = np.zeros_like(points)
    fallback[facets] = averaged
    total[lost] = fallback[lost]
    return {
        "facet_normals": middle,
        "normals": unit(total),
        "facet_node_normals": averaged,
        "lengths": np.sqrt(area),
    }


def face_areas(points: Array, facets: Index, kind: FacetKind, measure: Any, label: str) -> Array:
    """Integrals of the shape functions, times the measure, over faces, shape (m,)."""
    at, weight = kind.quadrature()
    N, _ = kind.shapes(at)
    density = np.linalg.norm(area_elements(points, facets, kind, at), axis=2) * weight
    if measure is not None:
        density = density * weights_of(measure, np.einsum("qk,fkd->dfq", N, points[facets]), label)
    return np.asarray(np.bincount(facets.ravel(), (density @ N).ravel(), len(points)), dtype=float)


def _pieces(points: Array, corners: Index, own: Array, twins: Index) -> tuple[Array, Index]:
    """Normals at the corners (nf, c, 3) with their weights, and the smooth pieces they belong to."""
    nf, c = corners.shape
    x = points[corners]
    ahead, back = np.roll(x, -1, axis=1) - x, np.roll(x, 1, axis=1) - x
    scale = np.sum(ahead**2, axis=2).min()  # powers of lengths stay numbers in all units
    squared = np.sum(ahead**2, axis=2) / scale * np.sum(back**2, axis=2) / scale
    sine = np.linalg.norm(np.cross(ahead, back), axis=2) / scale

    # corners of faces that are one smooth piece round a vertex: those on both ends of every edge
    number = np.arange(nf * c).reshape(nf, c)
    following = np.roll(number, -1, axis=1).ravel()
    edge = np.flatnonzero(twins.ravel() >= 0)
    twin = twins.ravel()[edge]
    one, other = np.concatenate([edge, following[edge]]), np.concatenate([following[twin], twin])
    flat = own.reshape(-1, 3)
    smooth = np.einsum("pd,pd->p", flat[one], flat[other]) >= CORNER
    graph = coo_matrix((np.ones(smooth.sum()), (one[smooth], other[smooth])), shape=(nf * c,) * 2)
    _, piece = connected_components(graph, directed=False)
    return (sine / squared)[..., None] * own, piece.reshape(nf, c).astype(np.intp)


def _means(weighted: Array, piece: Index, own: Array) -> Array:
    """Unit vectors of the sums over the pieces, (nf, c, 3); `own` where nothing is left."""
    parts = weighted.reshape(-1, 3).T
    total: Array = np.stack([np.bincount(piece.ravel(), part) for part in parts], axis=1).astype(float)
    return _unit_or(total[piece], own, np.linalg.norm(weighted, axis=2, keepdims=True))


def _at_edges(own: Array, area: Array, twins: Index, mirrored: Mask) -> Array:
    """Averaged normals at the middles of edges, (nf, c, 3): of the two faces, the smaller more."""
    nf, c = twins.shape
    flat, other = own.reshape(-1, 3), twins.ravel()
    size = np.repeat(area, c)
    smooth = (other >= 0) & (np.einsum("pd,pd->p", flat, flat[other]) >= CORNER)
    mean = size[other, None] * flat + size[:, None] * flat[other]
    averaged = np.where(smooth[:, None], mean, flat)
    averaged = np.where(mirrored.reshape(-1, 3), 0.0, averaged)
    return _unit_or(averaged, flat, np.linalg.norm(mean, axis=1)[:, None]).reshape(nf, c, 3)


def _on_symmetry(
    points: Array,
    corners: Index,
    held: Mask,
    twins: Index,
    kind: FacetKind,
    middle: Array,
    averaged: Array,
) -> Mask:
    """Components that a smooth surface loses at its edges on planes of symmetry, (nf, c, 3).

    Such an edge lies in a plane across an axis, that component of its ends is prescribed, and the
    normals of its face have less of it the nearer they are to the edge: in proportion to the distance,
    as on a curve that goes on as its mirror image. A plane face that meets a roller at an angle is not
    meant: its normal stays as it is.
    """
    c = kind.corners
    mirrored = np.zeros((*twins.shape, 3), dtype=bool)
    facet, edge = np.nonzero(twins < 0)
    ends = corners[facet, edge], corners[facet, (edge + 1) % c]
    way = np.abs(points[ends[1]] - points[ends[0]])
    in_plane = way <= GIVEN * np.linalg.norm(way, axis=1, keepdims=True)
    both: Mask = np.asarray(held[ends[0]] & held[ends[1]] & in_plane)
    both &= ~np.all(both, axis=1)[:, None]
    some = np.any(both, axis=1)
    if not some.any():
        return mirrored
    facet, edge, both = facet[some], edge[some], both[some]
    plane = 0.5 * (points[ends[0][some]] + points[ends[1][some]])
    # where the face's own normal is that of a sphere through its corners, and the corners beyond
    own, near = middle[facet], np.abs(_centres(points[corners[facet]], kind) - plane)
    inner = (edge[:, None] + np.arange(2, c)) % c
    there = averaged[facet[:, None], inner].mean(axis=1)
    far = np.abs(points[corners[facet[:, None], inner]].mean(axis=1) - plane)
    with np.errstate(divide="ignore", invalid="ignore"):
        fades = np.abs(own - there * near / far) < 0.5 * np.abs(own - there)
    mirrored[facet, edge] = both & fades
    return mirrored


def _centres(x: Array, kind: FacetKind) -> Array:
    """Centres of the circles round flat triangles (f, 3, 3); middles of other faces, (f, 3)."""
    if kind.name != "tri3":
        return np.asarray(x.mean(axis=1))
    one, other = x[:, 1] - x[:, 0], x[:, 2] - x[:, 0]
    up = np.cross(one, other)
    squares = np.sum(one**2, axis=1)[:, None], np.sum(other**2, axis=1)[:, None]
    arm = np.cross(up, one) * squares[1] + np.cross(other, up) * squares[0]
    return np.asarray(x[:, 0] + arm / (2 * np.sum(up**2, axis=1)[:, None]))


def _unit_or(vectors: Array, other: Array, size: Array) -> Array:
    """Unit vectors; those of `other` where next to nothing is left of `size`."""
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    there = length > SOLVED * size
    return np.where(there, vectors / np.where(there, length, 1.0), other)
