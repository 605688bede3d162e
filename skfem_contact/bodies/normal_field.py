r"""Normals at the nodes of facets, averaged so that they are continuous where the surface is smooth.

A facet's own normal is exact at its middle, so of two neighbours the nearer, smaller one counts more.
At the nodes of lines the weights are one over the length: exact on a circle, and of second order on any
smooth curve. At a vertex of faces they are ``sin(alpha) / (|a| |b|)`` of the two edges a, b that a face
has there: exact if the nodes lie on a sphere, whatever the faces round the vertex (N. Max, J. Graphics
Tools 4 (1999) 1-6). Facets take part that can be reached round the node over edges which bend by no
more than a corner does (`CORNER`). An edge of a line is its end, see `facets.twin_edges`.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from skfem_contact.arrays import Array, Index, Mask
from skfem_contact.bodies.areas import facet_sizes, own_normals
from skfem_contact.bodies.facet_kinds import FacetKind
from skfem_contact.bodies.normals import cross, sizes, unit
from skfem_contact.bodies.pieces import pieces
from skfem_contact.bodies.thresholds import CORNER, FADES
from skfem_contact.digits import GIVEN, SOLVED


def sizes_and_normals(
    points: Array, facets: Index, kind: FacetKind, held: Mask, twins: Index
) -> dict[str, Any]:
    """Sizes and normals of facets: what changes when the surface moves.

    Parameters
    ----------
    points : ndarray, shape (m, d)
    facets : ndarray of int, shape (nf, k)
    kind : FacetKind
    held : ndarray of bool, shape (m, d)
        Prescribed components.
    twins : ndarray of int, shape (nf, c)
        From `facets.twin_edges`.
    """
    area, c = facet_sizes(points, facets, kind), kind.corners
    own, middle = own_normals(points, facets, kind)
    corners = facets[:, :c]
    weight = area.min() / area[:, None] if kind.dim == 1 else _weights(points[corners])
    weight = np.broadcast_to(weight, corners.shape)
    weighted, piece = weight[..., None] * own[:, :c], _pieces(own[:, :c], twins)
    averaged = own.copy()
    averaged[:, :c] = _means(weighted, piece, weight, own[:, :c])
    mirrored = _on_symmetry(points, corners, held, twins, kind, middle, averaged[:, :c])
    if mirrored.any():
        # with the mirror image across a plane of symmetry, without which the last node would be
        # constrained along the normals of chords
        image = np.zeros((piece.max() + 1, points.shape[1]), dtype=bool)
        for at_end in (piece, np.roll(piece, -1, axis=1))[: kind.dim]:
            np.logical_or.at(image, at_end, mirrored)
        weighted = np.where(image[piece], 0.0, weighted)
        averaged[:, :c] = _means(weighted, piece, weight, own[:, :c])
    if kind.quadratic and kind.dim == 2:
        averaged[:, c : 2 * c] = _at_edges(own[:, c : 2 * c], area, twins, mirrored)

    total = _summed(corners, weighted, len(points))
    if kind.quadratic:
        np.add.at(total, facets[:, c:], averaged[:, c:])
    # facets back to back (a crack tip) cancel: then the one met last decides
    size = np.bincount(corners.ravel(), weight.ravel(), len(points))
    lost = sizes(total) <= SOLVED * size
    if lost.any():
        fallback = np.zeros_like(points)
        fallback[facets] = averaged
        total[lost] = fallback[lost]
    return {
        "facet_normals": middle,
        "normals": unit(total),
        "facet_node_normals": averaged,
        "lengths": area if kind.dim == 1 else np.sqrt(area),
    }


def _weights(x: Array) -> Array:
    """Weights ``sin(alpha) / (|a| |b|)`` of faces (nf, c, 3) at their corners, (nf, c)."""
    ahead, back = np.roll(x, -1, axis=1) - x, np.roll(x, 1, axis=1) - x
    scale = np.sum(ahead**2, axis=2).min()  # powers of lengths stay numbers in all units
    squared = np.sum(ahead**2, axis=2) / scale * np.sum(back**2, axis=2) / scale
    return np.asarray(sizes(cross(ahead, back)) / scale / squared)


def _pieces(own: Array, twins: Index) -> Index:
    """The smooth piece round a node that each corner of a facet belongs to, shape (nf, c).

    Corners are one piece that are on an end of one edge; lines have one at each.
    """
    nf, c, d = own.shape
    number, twin = np.arange(nf * c), twins.ravel()
    flat = own.reshape(-1, d)
    if d == 2:
        smooth = (twin >= 0) & (np.einsum("pd,pd->p", flat, flat.take(twin, axis=0)) >= CORNER)
        return np.where(smooth & (twin < number), twin, number).reshape(nf, c)
    following = np.roll(number.reshape(nf, c), -1, axis=1).ravel()
    edge = np.flatnonzero(twin > number)  # each edge once, of its two facets
    twin = twin[edge]
    one, other = np.concatenate([edge, following[edge]]), np.concatenate([following[twin], twin])
    smooth = np.einsum("pd,pd->p", flat[one], flat[other]) >= CORNER
    return pieces(np.array([one[smooth], other[smooth]]), nf * c).reshape(nf, c)


def _means(weighted: Array, piece: Index, weight: Array, own: Array) -> Array:
    """Unit vectors of the sums over the pieces, (nf, c, d); `own` where nothing is left."""
    total = _summed(piece, weighted, piece.max() + 1)
    return _unit_or(total.take(piece, axis=0), own, weight[..., None])


def _summed(place: Index, vectors: Array, count: int) -> Array:
    """Sums (count, d) of vectors (..., d) by their places."""
    total, place = np.empty((count, vectors.shape[-1])), place.ravel()
    for i in range(vectors.shape[-1]):
        total[:, i] = np.bincount(place, vectors[..., i].ravel(), count)
    return total


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
    """Components that a smooth surface loses at its edges on planes of symmetry, (nf, c, d).

    Such an edge lies in a plane across an axis, that component of its ends is prescribed, and the
    normals of its facet have less of it the nearer they are to the edge: in proportion to the distance,
    as on a surface that goes on as its mirror image. A plane facet that meets a roller at an angle is
    not meant: its normal stays as it is.
    """
    c = kind.corners
    mirrored = np.zeros((*twins.shape, points.shape[1]), dtype=bool)
    if not held.any():
        return mirrored
    facet, edge = np.nonzero(twins < 0)
    ends = np.take_along_axis(corners[facet], kind.edges[edge, : kind.dim], axis=1)
    both: Mask = np.all(held[ends], axis=1)
    way = np.ptp(points[ends], axis=1)
    both &= way <= GIVEN * np.linalg.norm(way, axis=1, keepdims=True)
    both &= ~np.all(both, axis=1)[:, None]
    some = np.any(both, axis=1)
    if not some.any():
        return mirrored
    facet, edge, both = facet[some], edge[some], both[some]
    plane = points[ends[some]].mean(axis=1)
    # where the facet's own normal is that of a sphere through its corners, and the corners beyond
    own, near = middle[facet], _centres(points[corners[facet]], kind) - plane
    inner = (edge[:, None] + np.arange(kind.dim, c)) % c
    there = averaged[facet[:, None], inner].mean(axis=1)
    far = points[corners[facet[:, None], inner]].mean(axis=1) - plane
    with np.errstate(divide="ignore", invalid="ignore"):
        fades = np.abs(own - there * near / far) < FADES * np.abs(own - there)
    mirrored[facet, edge] = both & fades
    return mirrored


def _centres(x: Array, kind: FacetKind) -> Array:
    """Centres of the circles round flat triangles (f, 3, 3); middles of other facets, (f, d)."""
    if not (kind.triangle and kind.straight):
        return np.asarray(x.mean(axis=1))
    one, other = x[:, 1] - x[:, 0], x[:, 2] - x[:, 0]
    up = np.cross(one, other)
    squares = np.sum(one**2, axis=1)[:, None], np.sum(other**2, axis=1)[:, None]
    arm = np.cross(up, one) * squares[1] + np.cross(other, up) * squares[0]
    return np.asarray(x[:, 0] + arm / (2 * np.sum(up**2, axis=1)[:, None]))


def _unit_or(vectors: Array, other: Array, size: Array) -> Array:
    """Unit vectors; those of `other` where next to nothing is left of `size`."""
    length = sizes(vectors)[..., None]
    there = length > SOLVED * size
    if there.all():
        return vectors / length
    return np.where(there, vectors / np.where(there, length, 1.0), other)
