"""Deformed bodies against each other and against obstacles: true overlaps, gaps and strains."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from skfem_contact.answers.thresholds import PIECES
from skfem_contact.answers.validity.hull import Hull
from skfem_contact.answers.validity.overlap import Outline
from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.digits import SOLVED
from skfem_contact.obstacles.level_set import LevelSet
from skfem_contact.obstacles.obstacle import Obstacle
from skfem_contact.pairing.closest import signed_distances
from skfem_contact.pairing.faces.distance import signed_distances as distances_from_faces
from skfem_contact.trees import Tree

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class Meeting:
    """How two sides meet, seen from outside.

    Attributes
    ----------
    overlap : float
        Deepest overlap, less gaps given by the user and with interferences [length].
    unseen : int
        Points of the secondary without a partner that overlap by more than chords explain.
    opening : float
        Largest true gap of a closed point [length].
    """

    overlap: float = np.nan
    unseen: int = 0
    opening: float = np.nan


def between(
    secondary: Outline | Hull,
    primary: Outline | Hull,
    chords: float,
    extent: float,
    nodes: Array,
    added: Array,
    closed: Mask,
    paired: Mask,
) -> Meeting:
    """Two deformed bodies, all of their boundaries.

    Parameters
    ----------
    secondary, primary : Outline or Hull
    chords, extent : float
        Overlap by chords, extent of the bodies [length].
    nodes : ndarray, shape (m, d)
        Of the secondary surface, displaced [length].
    added : ndarray, shape (m,)
        What the user has the gaps be larger than the meshes say [length].
    closed, paired : ndarray of bool, shape (m,)
    """
    noise = SOLVED * extent
    deepest = 0.0
    for one, other in ((secondary, primary), (primary, secondary)):
        points = one.samples(other.box)  # the others lie outside
        depth = other.depth(points)
        inside = depth > noise
        if inside.any() and added[paired].any():
            depth[inside] -= added[paired][Tree(nodes[paired]).query(points[inside])[1]]
        deepest = max(deepest, float(np.max(depth[inside], initial=0.0)))
    lonely = primary.depth(nodes[~paired]) > max(chords, noise)
    # with an interference bodies may overlap before their meshes do: this shows at the nodes
    true = np.full(len(nodes), np.inf)
    true[paired] = primary.signed(nodes[paired]) + added[paired]
    sunk = float(np.max(-true[paired], initial=0.0))
    deepest = max(deepest, sunk if sunk > noise else 0.0)
    return Meeting(deepest, int(lonely.sum()), float(np.max(true[closed], initial=0.0)))


def at_obstacle(
    obstacle: Obstacle,
    surface: ContactSurface,
    chords: float,
    nodes: Array,
    added: Array,
    closed: Mask,
    paired: Mask,
) -> Meeting:
    """A deformed surface, its nodes and points between them, against an obstacle at its place."""
    noise = SOLVED * float(np.max(np.ptp(surface.points, axis=0)))
    at_nodes = signed_distance(obstacle, surface, nodes) + added
    ends = surface.facets
    between = [
        signed_distance(obstacle, surface, np.einsum("k,fkd->fd", w, nodes[ends])) + added[ends] @ w
        for w in surface.kind.between
    ]
    deepest = -float(np.min(np.concatenate([at_nodes, *between])))
    lonely = -at_nodes[~paired] > max(chords, noise)
    opening = float(np.max(at_nodes[closed], initial=0.0))
    return Meeting(deepest if deepest > noise else 0.0, int(lonely.sum()), opening)


def signed_distance(obstacle: Obstacle, surface: ContactSurface, points: Array) -> Array:
    """Signed distances of any points, whether they face the obstacle or not."""
    # these points are none of the nodes that the facets of the surface are made of
    outline = obstacle.outline
    if outline is not None:
        return (signed_distances if outline.dim == 2 else distances_from_faces)(outline, points)
    at = replace(surface, points=points, normals=np.zeros_like(points))
    return distances(obstacle, at)[0]


def distances(obstacle: Obstacle, surface: ContactSurface) -> tuple[Array, Array, Mask]:
    """Distances, normals and partners of `Obstacle.distance`, of a level set to first order."""
    if not isinstance(obstacle, LevelSet):
        return obstacle.distance(surface)
    return obstacle.first_order(surface)


def drawn_off(surface: ContactSurface) -> float:
    """Largest distance between a surface and the straight pieces that stand for it where it is drawn.

    Second-order facets are parabolas: over one of n pieces by the nth part squared as high as over
    the whole. Straight ones on a curve are off it by the height of their chords.
    """
    if not surface.quadratic:
        return sagitta(surface, surface.facet_node_normals)
    x = surface.points[surface.facets]
    chords, parts = ([(0, 1, 2)], PIECES) if surface.dim == 2 else (surface.kind.edges, 2)
    heights = [np.linalg.norm(x[:, k] - 0.5 * (x[:, i] + x[:, j]), axis=1) for i, j, k in chords]
    return max(float(np.max(heights) / parts**2), _chord_height(surface))


def _chord_height(surface: ContactSurface) -> float:
    """Height of the smooth boundary over straight facets, by the curvature at their corners."""
    quadrics = surface.quadrics
    corners = surface.facets[quadrics.curved & ~quadrics.bowed, : surface.kind.corners]
    if not len(corners):
        return 0.0
    edges = surface.points[np.roll(corners, -1, axis=1)] - surface.points[corners]
    heights = [
        np.abs(np.einsum("fed,fedc,fec->fe", edges, quadrics.tensor[ends], edges)) / 8
        for ends in (corners, np.roll(corners, -1, axis=1))
    ]
    return float(np.max(heights))


def sagitta(surface: ContactSurface, normals: Array) -> float:
    """Largest distance between straight facets and the curve with these normals at their ends.

    Parameters
    ----------
    surface : ContactSurface
    normals : ndarray, shape (nf, k, d)
    """
    if surface.quadratic:
        return 0.0
    x, n = surface.points[surface.facets], normals
    pairs = [(i, j) for i in range(surface.kind.corners) for j in range(i)]
    heights = [
        np.linalg.norm(n[:, i] - n[:, j], axis=1) * np.linalg.norm(x[:, i] - x[:, j], axis=1)
        for i, j in pairs
    ]
    return float(np.max(heights) / 8)
