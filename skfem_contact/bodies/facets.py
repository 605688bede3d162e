"""Facets of a contact surface: corners seen from outside, what lies across edges, checks."""

from __future__ import annotations

from typing import Any

import numpy as np

from skfem_contact.arrays import Array, Index
from skfem_contact.bodies.areas import area_elements
from skfem_contact.bodies.facet_kinds import FacetKind, node_positions
from skfem_contact.bodies.normals import across, sizes
from skfem_contact.bodies.selection import written
from skfem_contact.digits import COMPUTED, GIVEN
from skfem_contact.errors import InputError
from skfem_contact.trees import pairs_within


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
