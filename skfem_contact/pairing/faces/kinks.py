r"""Kinks of faces: flats that turn by less than a corner does, see `pairing.kinks`.

At an edge where faces meet at 45 degrees and less the surface has one normal, averaged, and the
multipliers of mortar contact reach over it: both right for curved surfaces. A chamfer beside a flat
is known by what the surface does next to the edge: on one side at least it goes straight on. There the
gap of a mortar row is no less than the least distance in its support, and the normal is that of the
other side.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from skfem_contact.bodies.surface import FaceSurface
from skfem_contact.bodies.thresholds import CORNER, STRAIGHT
from skfem_contact.pairing.faces.joints import sharp_points
from skfem_contact.pairing.faces.meeting import meet
from skfem_contact.pairing.faces.segmentation import Segmentation
from skfem_contact.pairing.facing import angle_between
from skfem_contact.pairing.thresholds import BENT

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Mask = NDArray[np.bool_]


def kink_angles(surface: FaceSurface) -> Array:
    """Angle by which a surface turns at nodes on an edge beside a flat, shape (m,); else 0 [rad].

    Flat is a face on whose far side, at the opposite edge of a quadrilateral or the opposite vertex of
    a triangle, the surface turns by less than a quarter of that: on curved surfaces turns are alike.
    Beyond the end of a surface nothing is known, and no face there is flat.
    """
    bend = _bends(surface)
    known = surface.twins >= 0
    if surface.kind.corners == 4:
        far, there = np.roll(bend, 2, axis=1), np.roll(known, 2, axis=1)
    else:
        far, there = _at_far_vertices(surface, bend)
    kinked = known & there & (bend > BENT) & (far < STRAIGHT * bend)
    kinks = np.zeros(len(surface.points))
    nodes = surface.facets[:, surface.kind.edges][kinked]
    np.maximum.at(kinks, nodes, np.repeat(bend[kinked], nodes.shape[1]).reshape(nodes.shape))
    return kinks


def _bends(surface: FaceSurface) -> Array:
    """Mean angle between the normals of two faces along each edge, (nf, c); 0 at rims and corners."""
    c = surface.kind.corners
    own = surface.own_normals[:, :c].reshape(-1, 3)
    here = np.arange(surface.twins.size).reshape(-1, c)
    ahead, there = np.roll(here, -1, axis=1), surface.twins
    begin = there // c * c + (there + 1) % c  # the edge across starts where this one ends
    pairs = (own[here], own[begin]), (own[ahead], own[there])
    bend = 0.5 * (angle_between(*pairs[0]) + angle_between(*pairs[1]))
    return np.where((there >= 0) & (bend <= np.arccos(CORNER)), bend, 0.0)


def _at_far_vertices(surface: FaceSurface, bend: Array) -> tuple[Array, Mask]:
    """Largest bend at the vertex opposite to each edge of triangles, and if the surface goes on."""
    corners = surface.facets[:, :3]
    turn = np.zeros(len(surface.points))
    following = np.roll(corners, -1, axis=1)
    for ends in (corners, following):
        np.maximum.at(turn, ends, bend)
    x = surface.points
    along = x[following] - x[corners]
    along /= np.linalg.norm(along, axis=2, keepdims=True)
    # the surface ends along the edge, not across it, where the rim at the vertex is parallel to it
    rim = surface.twins < 0
    tensor = np.zeros((len(x), 3, 3))
    for ends in (corners, following):
        np.add.at(tensor, ends[rim], along[rim][:, :, None] * along[rim][:, None, :])
    far = np.roll(corners, 1, axis=1)
    parallel = np.einsum("fci,fcij,fcj->fc", along, tensor[far], along)
    return turn[far], parallel < 0.5


def least_gaps(parts: Segmentation, kinks: tuple[Array, Array], acts: Mask) -> Array | None:
    """Least distance in the support of each mortar row that reaches over a kink, shape (m,) [length].

    Parameters
    ----------
    parts : Segmentation
    kinks : (ndarray, ndarray)
        `kink_angles` of both surfaces.
    acts : ndarray of bool, shape (nf, k)
        Nodes that have a multiplier on each face of the secondary.

    Returns
    -------
    ndarray, shape (m,), or None
        Minus infinity for all other rows; None if there is no kink.
    """
    surfaces, cells = (parts.secondary, parts.primary), (parts.e, parts.f)
    face = [own.facet[cell] for own, cell in zip(parts.cells, cells, strict=True)]
    over = np.zeros(len(parts.e), dtype=bool)
    for surface, angles, facet in zip(surfaces, kinks, face, strict=True):
        bent = (angles > BENT) | sharp_points(surface)
        over |= np.any(bent[surface.facets], axis=1)[facet]
    if not over.any():
        return None
    node, m = parts.secondary.facets[face[0]], len(parts.secondary.points)
    reaches = np.zeros(m, dtype=bool)
    reaches[node[acts[face[0]] & over[:, None]]] = True
    mine = np.flatnonzero(np.any(reaches[node] & acts[face[0]], axis=1))
    # linear on plane faces: least at the corners of a piece
    X = parts.pieces.corners[mine]
    gap = meet(*surfaces, parts.cells, parts.e[mine], parts.f[mine], X).gap.min(axis=1)
    least = np.full(m, np.inf)
    on = acts[face[0]][mine]
    np.minimum.at(least, node[mine][on], np.broadcast_to(gap[:, None], on.shape)[on])
    return np.where(reaches, least, -np.inf)
