"""Where a surface turns at the edges of its faces: sharp edges, and kinks beside a flat.

At a sharp edge faces meet at 45 degrees or more. At any other edge the surface has one normal,
averaged, which is right for curved surfaces. A chamfer beside a flat is none: it is known by what the
surface does next to the edge. On one side at least it goes straight on. (`normals.kink_angles` is the
same of curves.)
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from skfem_contact.bodies.face_normals import area_elements
from skfem_contact.bodies.facet_kinds import FacetKind
from skfem_contact.bodies.normals import angle_between, unit
from skfem_contact.bodies.thresholds import BENT, CORNER, STRAIGHT

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Mask = NDArray[np.bool_]


def sharp_edges(normals: Array, twins: Index) -> Mask:
    """Edges (nf, c) where faces meet at 45 degrees or more, at one end at least.

    Parameters
    ----------
    normals : ndarray, shape (nf, c, 3)
        Their own unit normals at the corners.
    twins : ndarray of int, shape (nf, c)
        From `faces.twin_edges`.
    """
    (here, across), (ahead, beyond) = _both_ends(normals, twins)
    turns = [np.einsum("fcd,fcd->fc", *pair) for pair in ((here, across), (ahead, beyond))]
    return np.asarray((np.minimum(*turns) < CORNER) & (twins >= 0))


def kink_angles(points: Array, facets: Index, kind: FacetKind, twins: Index) -> Array:
    """Angle by which a surface turns at nodes on an edge beside a flat, shape (m,); else 0 [rad].

    Flat is a face on whose far side, at the opposite edge of a quadrilateral or the opposite vertex of
    a triangle, the surface turns by less than a quarter of that: on curved surfaces turns are alike.
    Beyond the end of a surface nothing is known, and no face there is flat.

    Parameters
    ----------
    points : ndarray, shape (m, 3)
    facets : ndarray of int, shape (nf, k)
    kind : FacetKind
    twins : ndarray of int, shape (nf, c)
        From `faces.twin_edges`.
    """
    bend = bends(unit(area_elements(points, facets, kind, kind.locations[: kind.corners])), twins)
    known = twins >= 0
    if kind.corners == 4:
        far, there = np.roll(bend, 2, axis=1), np.roll(known, 2, axis=1)
    else:
        far, there = _at_far_vertices(points, facets[:, :3], twins, bend)
    kinked = known & there & (bend > BENT) & (far < STRAIGHT * bend)
    kinked |= np.where(known, kinked.ravel()[twins], False)
    kinked &= _in_lines(facets[:, kind.edges[:, :2]], twins, kinked, len(points))
    kinks = np.zeros(len(points))
    nodes = facets[:, kind.edges][kinked]
    np.maximum.at(kinks, nodes, np.repeat(bend[kinked], nodes.shape[1]).reshape(nodes.shape))
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
    """Mean angle between the normals (nf, c, 3) of two faces along each edge; 0 at rims and corners."""
    pairs = _both_ends(normals, twins)
    bend = 0.5 * (angle_between(*pairs[0]) + angle_between(*pairs[1]))
    return np.where((twins >= 0) & (bend <= np.arccos(CORNER)), bend, 0.0)


def _both_ends(normals: Array, twins: Index) -> tuple[tuple[Array, Array], tuple[Array, Array]]:
    """Normals of two faces at the start of each edge, and at its end, four arrays (nf, c, 3)."""
    c = twins.shape[1]
    own = normals.reshape(-1, 3)
    begin = twins // c * c + (twins + 1) % c  # the edge across starts where this one ends
    return (normals, own[begin]), (np.roll(normals, -1, axis=1), own[twins])


def _at_far_vertices(points: Array, corners: Index, twins: Index, bend: Array) -> tuple[Array, Mask]:
    """Largest bend at the vertex opposite to each edge of triangles, and if the surface goes on."""
    turn = np.zeros(len(points))
    following = np.roll(corners, -1, axis=1)
    for ends in (corners, following):
        np.maximum.at(turn, ends, bend)
    along = points[following] - points[corners]
    along /= np.linalg.norm(along, axis=2, keepdims=True)
    # the surface ends along the edge, not across it, where the rim at the vertex is parallel to it
    rim = twins < 0
    tensor = np.zeros((len(points), 3, 3))
    for ends in (corners, following):
        np.add.at(tensor, ends[rim], along[rim][:, :, None] * along[rim][:, None, :])
    far = np.roll(corners, 1, axis=1)
    parallel = np.einsum("fci,fcij,fcj->fc", along, tensor[far], along)
    return turn[far], parallel < 0.5
