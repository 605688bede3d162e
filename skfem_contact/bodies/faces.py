"""Faces of solids: their corners seen from outside, what lies across each edge, and checks."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from skfem_contact.bodies.face_normals import area_elements
from skfem_contact.bodies.facet_kinds import FacetKind, node_positions
from skfem_contact.bodies.selection import written
from skfem_contact.bodies.thresholds import NO_EXTENT, SAME_FACET
from skfem_contact.errors import InputError
from skfem_contact.trees import pairs_within

Array = NDArray[np.float64]
Index = NDArray[np.intp]


def seen_from_outside(mesh: Any, numbers: Index) -> tuple[Index, Index]:
    """Facets of the boundary and their vertices, counter-clockwise seen from outside.

    Returns
    -------
    numbers : ndarray of int, shape (nf,)
        The facets in the order of their elements.
    vertices : ndarray of int, shape (nf, c)
    """
    element = mesh.f2t[0, numbers]
    order = np.argsort(element, kind="stable")
    numbers, element = numbers[order], element[order]
    vertices = mesh.facets[:, numbers].T.astype(np.intp)
    x = np.transpose(mesh.p[:, vertices], (1, 2, 0))
    outward = x.mean(axis=1) - mesh.p[:, mesh.t[:, element]].mean(axis=1).T
    wrong = np.einsum("fd,fd->f", area_vectors(x), outward) < 0
    vertices[wrong, 1:] = vertices[wrong, :0:-1]
    return numbers, vertices


def area_vectors(corners: Array) -> Array:
    """Twice the area times the mean normal of faces (..., c, 3), warped ones included, (..., 3)."""
    first = corners[..., 2, :] - corners[..., 0, :]
    second = corners[..., 3 if corners.shape[-2] == 4 else 2, :] - corners[..., 1, :]
    return np.cross(first, second)


def twin_edges(corners: Index) -> Index:
    """The same edge in the facet across it, shape (nf, c); -1 where the surface ends.

    Edge i of facet f, from corner i to the next, has the number ``c f + i``. Where more than two
    facets share an edge (two corners touch along it), the k-th that has it in one direction is joined
    to the k-th in the other.

    Examples
    --------
    Two triangles of a square:

    >>> twin_edges(np.array([[0, 1, 2], [0, 2, 3]])).tolist()
    [[-1, -1, 3], [2, -1, -1]]
    """
    start, end = corners.ravel(), np.roll(corners, -1, axis=1).ravel()
    forward = start < end
    ends = np.minimum(start, end) * (1 + corners.max(initial=0)) + np.maximum(start, end)
    _, edge = np.unique(ends, return_inverse=True)
    order = np.lexsort((np.arange(len(edge)), forward, edge))
    first = np.r_[True, np.diff(2 * edge[order] + forward[order]) != 0]
    place = np.arange(len(edge))
    rank = np.empty_like(place)
    rank[order] = place - np.maximum.accumulate(np.where(first, place, 0))
    key = edge * (1 + rank.max(initial=0)) + rank
    ahead, back = np.flatnonzero(forward), np.flatnonzero(~forward)
    _, one, other = np.intersect1d(key[ahead], key[back], assume_unique=True, return_indices=True)
    twins = np.full(len(edge), -1)
    twins[ahead[one]], twins[back[other]] = back[other], ahead[one]
    return twins.reshape(corners.shape)


def check_faces(
    points: Array, facets: Index, kind: FacetKind, numbers: Index, mesh: Any, label: str
) -> None:
    """Refuse faces without area, faces that fold over, and faces given twice.

    Raises
    ------
    InputError
    """
    corners = node_positions(points, facets[:, : kind.corners])
    side = np.linalg.norm(corners - np.roll(corners, -1, axis=1), axis=2)
    # coordinates carry 16 digits of the mesh's extent; anything near that has no direction
    extent = np.abs(mesh.doflocs - mesh.doflocs.mean(axis=1, keepdims=True)).max()
    small = NO_EXTENT * extent
    area = area_elements(points, facets, kind, np.vstack([kind.locations, kind.middle]))
    up = np.einsum("fqd,fd->fq", area, area[:, -1])
    flat = (side.min(axis=1) <= small) | (
        np.linalg.norm(area[:, -1], axis=1) <= small * side.max(axis=1)
    )
    bad = np.flatnonzero(flat)
    if bad.size:
        raise InputError(
            f"surface {label!r}: {bad.size} faces have no area, the first is mesh facet "
            f"{numbers[bad[0]]} at {written(points[facets[bad[0], 0]])}; remove the degenerate "
            "elements from the mesh"
        )
    bad = np.flatnonzero(up.min(axis=1) <= 0)
    if bad.size:
        raise InputError(
            f"surface {label!r}: {bad.size} faces fold over, the first is mesh facet "
            f"{numbers[bad[0]]} at {written(corners[bad[0]].mean(axis=0))}: at one of its nodes it "
            "looks into the body. Usually an element is turned inside out, or middle nodes are far off "
            "the middles of their edges; correct the mesh"
        )
    middle = corners.mean(axis=1)
    pairs = pairs_within(middle, max(small, SAME_FACET * side.min()))
    if len(pairs):
        i, j = pairs[0]
        raise InputError(
            f"surface {label!r}: {len(pairs)} faces lie twice at the same place, for example "
            f"mesh facets {numbers[i]} and {numbers[j]} at {written(middle[i])}. Both lips of a "
            "crack can not be one surface: select each by its own boundary name or facet numbers"
        )
