r"""Normals at the nodes of facets, averaged so that they are continuous where the surface is smooth.

A facet's own normal is exact at its middle, so of two neighbours the nearer, smaller one counts more.
At the nodes of lines the weights are one over the length: exact on a circle, and of second order on any
smooth curve. At a vertex of faces they are ``sin(alpha) / (|a| |b|)`` of the two edges a, b that a face
has there: exact if the nodes lie on a sphere, whatever the faces round the vertex (N. Max, J. Graphics
Tools 4 (1999) 1-6). Facets take part that can be reached round the node over edges which bend by no
more than a corner does (`CORNER`). What lies across an edge, or the end of a line, is found
by `twin_edges`.

**Turns** of a surface: sharp edges, kinks beside a flat, the ends of a curve, the slopes of an arc.

At a sharp edge facets meet at 45 degrees or more. At any other edge the surface has one normal,
averaged, which is right for curved surfaces. A chamfer beside a flat is none: it is known by what the
surface does next to the edge. On one side at least it goes straight on. (An edge of a line is its end.)
"""

from __future__ import annotations

from typing import Any

import numpy as np

from skfem_contact.arrays import Array, Index, Mask, angle_between, cross, sizes, summed, unit
from skfem_contact.bodies.facet_kinds import FacetKind, facet_sizes, kind_of, own_normals
from skfem_contact.bodies.selection import pieces, seen_from_outside
from skfem_contact.digits import GIVEN, SOLVED

# Two facets that meet at 45 degrees or more form a corner: no normal is averaged over it. Chamfers of
# 45 degrees are common, and it is not left to round-off, of files in single precision neither.
CORNER = np.cos(np.pi / 4) * (1 + GIVEN)

# Facets to the circle that stand for it, at least: with fewer the polygon is meant, as it is of a
# chamfer of 30 degrees.
CIRCLE = 16

# A facet stands for a piece of a curve if the smooth boundary leaves it by no more than 11.25 degrees.
# Of 16 facets it is not left to round-off.
STEEPEST = np.tan(np.pi / CIRCLE) * (1 + SOLVED)

# Facets that turn by more are no pieces of a curve. A rigid outline of the plane, which is the polygon
# that it is, has corners there.
POLYGON = np.cos(2 * np.pi / CIRCLE * (1 + GIVEN))

# ... and by about as much at both ends: where a straight side passes into an arc, one end turns by
# half of the other, and beside a kink in a straight side one end does not turn at all.
ALIKE = 2 / 3

# A facet is straight beside a kink if the surface turns at its other end by less than this part. On
# curves of shaken meshes turns differ, but not by as much.
STRAIGHT = 0.02

# Turns by less [rad] are none: a weighted gap is then wrong by a ten thousandth of a facet.
BENT = 1e-3

# A surface ends on a plane of symmetry if its normal has none across it there: continued in proportion
# to the distance, this part of its change over the last facet at most. On an arc of 45 degrees a facet
# it is .08; a surface that ends askew by a tenth of the turn of a facet is taken for a mirrored one.
FADES = 0.1


def sizes_and_normals(
    points: Array, facets: Index, kind: FacetKind, held: Mask, twins: Index, corner: float = CORNER
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
        From `twin_edges`.
    corner : float
        Cosine of the turn from which on lines meet at a corner.
    """
    area, c = facet_sizes(points, facets, kind), kind.corners
    own, middle = own_normals(points, facets, kind)
    corners = facets[:, :c]
    weight = area.min() / area[:, None] if kind.dim == 1 else _weights(points[corners])
    weight = np.broadcast_to(weight, corners.shape)
    weighted, piece = weight[..., None] * own[:, :c], _pieces(own[:, :c], twins, corner)
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

    total = summed(corners, weighted, len(points))
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


def _pieces(own: Array, twins: Index, corner: float) -> Index:
    """The smooth piece round a node that each corner of a facet belongs to, shape (nf, c).

    Corners are one piece that are on an end of one edge; lines have one at each.
    """
    nf, c, d = own.shape
    number, twin = np.arange(nf * c), twins.ravel()
    flat = own.reshape(-1, d)
    if d == 2:
        smooth = (twin >= 0) & (np.einsum("pd,pd->p", flat, flat.take(twin, axis=0)) >= corner)
        return np.where(smooth & (twin < number), twin, number).reshape(nf, c)
    following = np.roll(number.reshape(nf, c), -1, axis=1).ravel()
    edge = np.flatnonzero(twin > number)  # each edge once, of its two facets
    twin = twin[edge]
    one, other = np.concatenate([edge, following[edge]]), np.concatenate([following[twin], twin])
    smooth = np.einsum("pd,pd->p", flat[one], flat[other]) >= CORNER
    return pieces(np.array([one[smooth], other[smooth]]), nf * c).reshape(nf, c)


def _means(weighted: Array, piece: Index, weight: Array, own: Array) -> Array:
    """Unit vectors of the sums over the pieces, (nf, c, d); `own` where nothing is left."""
    total = summed(piece, weighted, piece.max() + 1)
    return _unit_or(total.take(piece, axis=0), own, weight[..., None])


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


def sharp_edges(normals: Array, twins: Index, corner: float) -> Mask:
    """Edges (nf, c) where facets meet at a corner, at one end at least.

    Parameters
    ----------
    normals : ndarray, shape (nf, c, d)
        Their own unit normals at the corners.
    twins : ndarray of int, shape (nf, c)
        From `twin_edges`.
    corner : float
        As of `sizes_and_normals`.
    """
    turns = [np.einsum("fcd,fcd->fc", *pair) for pair in _both_sides(normals, twins)]
    return np.asarray((np.min(turns, axis=0) < corner) & (twins >= 0))


def kink_angles(points: Array, facets: Index, kind: FacetKind, twins: Index) -> Array:
    """Angle by which a surface turns at nodes on an edge beside a flat, shape (m,); else 0 [rad].

    Flat is a facet on whose far side, at the other end of a line, the opposite edge of a quadrilateral
    or the opposite vertex of a triangle, the surface turns by less than `STRAIGHT` of that: on curved
    surfaces turns are alike, and where a curve ends at a tangent the last is half of the others. Beyond
    the end of a surface nothing is known, and no facet there is flat; none before a corner is.

    Parameters
    ----------
    points : ndarray, shape (m, d)
    facets : ndarray of int, shape (nf, k)
    kind : FacetKind
    twins : ndarray of int, shape (nf, c)
        From `twin_edges`.

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
    return np.where(of_curves(slopes[:, 0], -slopes[:, 1])[:, None], slopes, 0.0)


def of_curves(start: Array, end: Array) -> Mask:
    """Return which facets stand for pieces of curves, which leave them by these slopes at both ends."""
    least, most = np.minimum(np.abs(start), np.abs(end)), np.maximum(np.abs(start), np.abs(end))
    return np.asarray((start * end > 0) & (most <= STEEPEST) & (least >= ALIKE * most))


def twin_edges(corners: Index) -> Index:
    """The same edge in the facet across it, shape (nf, c); -1 where the surface ends.

    Edge i of facet f has the number ``c f + i``: that of a face goes from corner i to the next, those
    of a line are its start and its end. Where more than two facets share an edge (two corners touch
    along it), the k-th that has it in one direction is joined to the k-th in the other.

    Examples
    --------
    Two triangles of a square, and three lines, of which the last is apart:

    >>> twin_edges(np.array([[0, 1, 2], [0, 2, 3]])).tolist()
    [[-1, -1, 3], [2, -1, -1]]
    >>> twin_edges(np.array([[0, 1], [1, 2], [5, 6]])).tolist()
    [[-1, 2], [1, -1], [-1, -1]]
    """
    c = corners.shape[1]
    if c == 2:
        key = corners.ravel()
        ahead = np.arange(1, len(key), 2)
        back = ahead - 1
    else:
        start, end = corners.ravel(), np.roll(corners, -1, axis=1).ravel()
        key = np.minimum(start, end) * (1 + corners.max(initial=0)) + np.maximum(start, end)
        ahead, back = np.flatnonzero(start < end), np.flatnonzero(start >= end)
    before = [_occurrence(key[edges]) for edges in (ahead, back)]
    count = 1 + max(int(times.max(initial=0)) for times in before)
    _, one, other = np.intersect1d(
        key[ahead] * count + before[0],
        key[back] * count + before[1],
        assume_unique=True,
        return_indices=True,
    )
    twins = np.full(len(key), -1)
    twins[ahead[one]], twins[back[other]] = back[other], ahead[one]
    return twins.reshape(corners.shape)


def _occurrence(values: Index) -> Index:
    """Count how often each value has appeared before: [7, 3, 7] gives [0, 0, 1]."""
    occurrence, order = np.empty(len(values), dtype=np.intp), np.argsort(values, kind="stable")
    ordered = values[order]
    occurrence[order] = np.arange(len(values)) - np.searchsorted(ordered, ordered)
    return occurrence


def order_along(lines: Index) -> Index:
    """Order of lines (nf, 2) along the curve, piece by piece: that with the first of all first."""
    before, after = (twin_edges(lines) // 2).T.tolist()
    order: list[int] = []
    placed = [False] * len(lines)
    for facet in range(len(lines)):
        if placed[facet]:
            continue
        begin = facet
        while before[begin] >= 0:
            begin = before[begin]
            if begin == facet:  # a closed curve begins at the facet that the mesh numbers first
                break
        along = begin
        while along >= 0 and not placed[along]:
            placed[along] = True
            order.append(along)
            along = after[along]
    return np.array(order, dtype=np.intp)
