"""Facets of a contact surface: corners seen from outside, what lies across edges, checks."""

from __future__ import annotations

from typing import Any

import numpy as np

from skfem_contact.arguments import numbers
from skfem_contact.arrays import Array, Index, across, sizes
from skfem_contact.bodies.facet_kinds import FacetKind, node_positions
from skfem_contact.bodies.selection import written
from skfem_contact.digits import COMPUTED, GIVEN, SOLVED
from skfem_contact.errors import InputError
from skfem_contact.trees import pairs_within


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


def node_shares(
    points: Array, facets: Index, kind: FacetKind, measure: Any, label: str, places: Array | None = None
) -> Array:
    """Integrals of the shape functions, times the measure, over each facet, shape (nf, k).

    The measure is that of the nodes' `places` (m, d), where it is not that of the points.
    """
    N, dN, weight = kind.gauss
    density = sizes(_elements(points, facets, kind, dN)) * weight
    if measure is not None:
        at = (points if places is None else places)[facets]
        density = density * weights_of(measure, np.einsum("qk,fkd->dfq", N, at), label)
    return np.asarray(density @ N)


def tributary_areas(points: Array, facets: Index, *given: Any) -> Array:
    """`node_shares` of all facets together, shape (m,)."""
    shares = node_shares(points, facets, *given)
    return np.asarray(np.bincount(facets.ravel(), shares.ravel(), len(points)), dtype=float)


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
    occurrence = np.zeros(len(values), dtype=np.intp)
    order = np.argsort(values, kind="stable")
    ordered = values[order]
    again = ordered[1:] == ordered[:-1]
    if again.any():
        position = np.arange(len(values))
        first = np.where(np.concatenate([[True], ~again]), position, 0)
        occurrence[order] = position - np.maximum.accumulate(first)
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


def seen_from_outside(mesh: Any, numbers: Index) -> tuple[Index, Index]:
    """Facets of the boundary and their vertices: of lines with the body on the left, of faces
    counter-clockwise seen from outside.

    Returns
    -------
    numbers : ndarray of int, shape (nf,)
        Lines as they are, faces in the order of their elements.
    vertices : ndarray of int, shape (nf, c)
    """
    element, d = mesh.f2t[0].take(numbers), len(mesh.p)
    if d == 3:
        order = np.argsort(element, kind="stable")
        numbers, element = numbers[order], element[order]
    vertices = mesh.facets.take(numbers, axis=1).T.astype(np.intp)
    x, c = node_positions(mesh.p.T, vertices), vertices.shape[1]
    outward = x.mean(axis=1) - mesh.p.take(mesh.t.take(element, axis=1), axis=1).mean(axis=1).T
    wrong = np.einsum("fd,fd->f", area_vectors(x), outward) < 0
    backward = (3 - d - np.arange(c)) % c  # the first corner of a face stays the first
    return numbers, np.where(wrong[:, None], vertices[:, backward], vertices)


def area_vectors(corners: Array) -> Array:
    """Mean normals of facets (..., c, d), warped ones too, as long as they or twice their area."""
    if corners.shape[-1] == 2:
        return across(corners[..., 1:, :] - corners[..., :1, :])
    return across(corners[..., [2, -1], :] - corners[..., [0, 1], :])


def check_facets(
    points: Array, facets: Index, kind: FacetKind, numbers: Index, mesh: Any, label: str
) -> None:
    """Refuse facets without length or area, faces that fold over, and facets given twice.

    Raises
    ------
    InputError
    """
    facet, size, slit = ("facets", "length", "slit") if kind.dim == 1 else ("faces", "area", "crack")
    corners = node_positions(points, facets[:, : kind.corners])
    middle = corners.mean(axis=1)
    side = sizes(corners - corners[:, np.arange(kind.corners) - 1])
    # coordinates carry 16 digits of the mesh's extent; anything near that has no direction
    small = COMPUTED * np.ptp(mesh.doflocs, axis=1).max()
    none, folded = side.min(axis=1) <= small, np.zeros(0, dtype=bool)
    if kind.dim == 2:
        area = area_elements(points, facets, kind, np.vstack([kind.locations, kind.middle]))
        none |= sizes(area[:, -1]) <= small * side.max(axis=1)
        folded = np.einsum("fqd,fd->fq", area, area[:, -1]).min(axis=1) <= 0
    bad = np.flatnonzero(none)
    if bad.size:
        raise InputError(
            f"surface {label!r}: {bad.size} {facet} have no {size}, the first is mesh facet "
            f"{numbers[bad[0]]} at {written(points[facets[bad[0], 0]])}; remove the degenerate "
            "elements from the mesh"
        )
    bad = np.flatnonzero(folded)
    if bad.size:
        raise InputError(
            f"surface {label!r}: {bad.size} faces fold over, the first is mesh facet "
            f"{numbers[bad[0]]} at {written(middle[bad[0]])}: at one of its nodes it "
            "looks into the body. Usually an element is turned inside out, or middle nodes are far off "
            "the middles of their edges; correct the mesh"
        )
    pairs = pairs_within(middle, max(small, GIVEN * side.min()))
    if len(pairs):
        i, j = pairs[0]
        raise InputError(
            f"surface {label!r}: {len(pairs)} {facet} lie twice at the same place, for example "
            f"mesh facets {numbers[i]} and {numbers[j]} at {written(middle[i])}. Both lips of a "
            f"{slit} can not be one surface: select each by its own boundary name or facet numbers"
        )
