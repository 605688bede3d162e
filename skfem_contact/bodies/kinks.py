"""Turns of a surface: sharp edges, kinks beside a flat, the ends of a curve, the slopes of an arc.

At a sharp edge facets meet at 45 degrees or more. At any other edge the surface has one normal,
averaged, which is right for curved surfaces. A chamfer beside a flat is none: it is known by what the
surface does next to the edge. On one side at least it goes straight on. (An edge of a line is its end.)
"""

from __future__ import annotations

from typing import Any

import numpy as np

from skfem_contact.arrays import Array, Index, Mask
from skfem_contact.bodies.areas import own_normals
from skfem_contact.bodies.facet_kinds import FacetKind, kind_of
from skfem_contact.bodies.facets import seen_from_outside
from skfem_contact.bodies.normals import angle_between
from skfem_contact.bodies.thresholds import ALIKE, BENT, CORNER, STEEPEST, STRAIGHT
from skfem_contact.digits import GIVEN


def sharp_edges(normals: Array, twins: Index) -> Mask:
    """Edges (nf, c) where facets meet at 45 degrees or more, at one end at least.

    Parameters
    ----------
    normals : ndarray, shape (nf, c, d)
        Their own unit normals at the corners.
    twins : ndarray of int, shape (nf, c)
        From `facets.twin_edges`.
    """
    turns = [np.einsum("fcd,fcd->fc", *pair) for pair in _both_sides(normals, twins)]
    return np.asarray((np.min(turns, axis=0) < CORNER) & (twins >= 0))


def kink_angles(points: Array, facets: Index, kind: FacetKind, twins: Index) -> Array:
    """Angle by which a surface turns at nodes on an edge beside a flat, shape (m,); else 0 [rad].

    Flat is a facet on whose far side, at the other end of a line, the opposite edge of a quadrilateral
    or the opposite vertex of a triangle, the surface turns by less than a quarter of that: on curved
    surfaces turns are alike, and where a curve ends at a tangent the last is half of the others. Beyond
    the end of a surface nothing is known, and no facet there is flat; none before a corner is.

    Parameters
    ----------
    points : ndarray, shape (m, d)
    facets : ndarray of int, shape (nf, k)
    kind : FacetKind
    twins : ndarray of int, shape (nf, c)
        From `facets.twin_edges`.

    Examples
    --------
    >>> points = np.array([[3, 0], [2, 0], [1, 0], [0, 0.5], [-1, 1]])
    >>> facets = np.array([[0, 1], [1, 2], [2, 3], [3, 4]])
    >>> twins = np.array([[-1, 2], [1, 4], [3, 6], [5, -1]])
    >>> np.degrees(kink_angles(points, facets, kind_of(2, 2), twins)).round(2).tolist()
    [0.0, 0.0, 26.57, 0.0, 0.0]
    """
    turn, known = _turns(own_normals(points, facets, kind)[0][:, : kind.corners], twins), twins >= 0
    kinks = np.zeros(len(points))
    if not np.any(turn > BENT):
        return kinks
    if kind.triangle:
        far, there = _at_far_vertices(points, facets[:, :3], twins, turn)
    else:
        opposite = np.arange(kind.corners) - kind.corners // 2
        far, there = turn[:, opposite], known[:, opposite]
    bend = _without_corners(turn)
    kinked = known & there & (bend > BENT) & (far < STRAIGHT * bend)
    kinked |= np.where(known, kinked.ravel()[twins], False)
    if kind.dim == 2:
        kinked &= _in_lines(facets[:, kind.edges[:, :2]], twins, kinked, len(points))
    nodes = facets[:, kind.edges][kinked]
    np.maximum.at(kinks, nodes, np.broadcast_to(bend[kinked][:, None], nodes.shape))
    return kinks


def _in_lines(ends: Index, twins: Index, kinked: Mask, m: int) -> Mask:
    """Edges (nf, c) at both ends of which there is another kinked one, or the surface ends.

    On shaken meshes of curves some edge turns and the opposite one happens not to.
    """
    count, rim = np.zeros(m, dtype=np.intp), np.zeros(m, dtype=bool)
    np.add.at(count, ends[kinked], 1)  # each edge twice, by both its faces
    rim[ends[twins < 0]] = True
    return np.asarray(np.all((count[ends] > 2) | rim[ends], axis=2))


def bends(normals: Array, twins: Index) -> Array:
    """Mean angle between normals (nf, c, d) of two facets along each edge; 0 at rims and corners."""
    return _without_corners(_turns(normals, twins))


def _turns(normals: Array, twins: Index) -> Array:
    """Mean angle between normals (nf, c, d) of two facets along each edge; 0 at rims."""
    angles = [angle_between(*pair) for pair in _both_sides(normals, twins)]
    return np.where(twins >= 0, sum(angles) / len(angles), 0.0)


def _without_corners(turn: Array) -> Array:
    return np.where(turn <= np.arccos(CORNER), turn, 0.0)


def _both_sides(normals: Array, twins: Index) -> list[tuple[Array, Array]]:
    """Normals of the two facets at the start of each edge, and at its end, (nf, c, d) each.

    At the ends of lines there is one pair.
    """
    c = twins.shape[1]
    own = normals.reshape(-1, normals.shape[2])
    if normals.shape[2] == 2:
        return [(normals, own.take(twins, axis=0))]
    begin = twins // c * c + (twins + 1) % c  # the edge across starts where this one ends
    return [(normals, own[begin]), (np.roll(normals, -1, axis=1), own[twins])]


def _at_far_vertices(points: Array, corners: Index, twins: Index, turn: Array) -> tuple[Array, Mask]:
    """Largest turn at the vertex opposite to each edge of triangles, and if the surface goes on."""
    most = np.zeros(len(points))
    following = np.roll(corners, -1, axis=1)
    for ends in (corners, following):
        np.maximum.at(most, ends, turn)
    along = points[following] - points[corners]
    along /= np.linalg.norm(along, axis=2, keepdims=True)
    # the surface ends along the edge, not across it, where the rim at the vertex is parallel to it
    rim = twins < 0
    tensor = np.zeros((len(points), 3, 3))
    for ends in (corners, following):
        np.add.at(tensor, ends[rim], along[rim][:, :, None] * along[rim][:, None, :])
    far = np.roll(corners, 1, axis=1)
    parallel = np.einsum("fci,fcij,fcj->fc", along, tensor[far], along)
    return most[far], parallel < 0.5


def end_turns(basis: Any, points: Array, facets: Index, vertices: Index, twins: Index) -> Array:
    """By how much the boundary of the mesh turns at the ends of a curve, (nf, 2) [rad].

    Parameters
    ----------
    basis : skfem.CellBasis
    points, facets : ndarray
        Of the curve.
    vertices : ndarray of int, shape (nf, 2)
        Its facets by the vertices of the mesh.
    twins : ndarray of int, shape (nf, 2)
    """
    turns = np.zeros(vertices.shape)
    ends = np.nonzero(twins < 0)
    if not len(ends[0]):
        return turns
    mesh = basis.mesh
    # of the whole boundary only what is next to the ends
    at_end = np.zeros(mesh.p.shape[1], dtype=bool)
    at_end[vertices[ends]] = True
    boundary = mesh.boundary_facets()
    boundary = boundary[at_end[mesh.facets[:, boundary]].any(axis=0)]
    numbers, all_ends = seen_from_outside(mesh, boundary)
    nodes = np.transpose(mesh.p[:, all_ends], (1, 2, 0))
    if basis.facet_dofs.size > 0:
        middle = basis.doflocs[:, basis.facet_dofs[0, numbers]].T
        nodes = np.concatenate([nodes, middle[:, None]], axis=1)
    kind, every = kind_of(2, nodes.shape[1]), np.arange(nodes[..., 0].size).reshape(nodes.shape[:2])
    there = own_normals(nodes.reshape(-1, 2), every, kind)[0]
    own = own_normals(points, facets, kind)[0]
    for facet, side in zip(*ends, strict=True):
        # the facet that begins where this one ends, or ends where it begins; corners that touch
        # have several
        onward = np.flatnonzero(all_ends[:, 1 - side] == vertices[facet, side])
        if len(onward) != 1:
            continue
        first, second = own[facet, side], there[onward[0], 1 - side]
        if side == 0:
            first, second = second, first
        turn = np.arctan2(first[0] * second[1] - first[1] * second[0], first @ second)
        # two lips of a slit are back to back: its tip is no corner that could touch anything
        turns[facet, side] = turn if turn < np.pi - GIVEN else -turn
    return turns


def end_slopes(points: Array, facets: Index, averaged: Array) -> Array:
    """Slopes of the smooth boundary through the nodes against the chords, shape (nf, 2).

    Parameters
    ----------
    points, facets : ndarray
    averaged : ndarray, shape (nf, k, d)
        Normals at start and end of each facet, averaged with the neighbours.

    Returns
    -------
    ndarray, shape (nf, 2)
        At start and end; positive and negative where the boundary bulges outward. Zero on straight
        and on quadratic lines, on those that are no piece of a curve (`STEEPEST`, `ALIKE`), and on
        faces.
    """
    slopes = np.zeros((len(facets), 2))
    if facets.shape[1] != 2:
        return slopes
    _, chord = own_normals(points, facets, kind_of(2, 2))
    chord, averaged = chord[:, None], averaged[:, :2]
    forward = np.stack([-averaged[..., 1], averaged[..., 0]], axis=2)
    across = np.einsum("fsd,fsd->fs", forward, np.broadcast_to(chord, forward.shape))
    along = chord[..., 0] * forward[..., 1] - chord[..., 1] * forward[..., 0]
    slopes = across / along
    start, end = slopes[:, 0], -slopes[:, 1]
    least, most = np.minimum(np.abs(start), np.abs(end)), np.maximum(np.abs(start), np.abs(end))
    curve = (start * end > 0) & (most <= STEEPEST) & (least >= ALIKE * most)
    return np.where(curve[:, None], slopes, 0.0)
