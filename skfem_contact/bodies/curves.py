"""Boundaries of plane bodies: their nodes in order along the curve, and by how much the ends turn."""

from __future__ import annotations

from typing import Any

import numpy as np

from skfem_contact.bodies.facets import oriented
from skfem_contact.bodies.normals import normals_at
from skfem_contact.digits import GIVEN


def end_turns(
    basis: Any, points: np.ndarray, facets: np.ndarray, vertices: np.ndarray, neighbours: np.ndarray
) -> np.ndarray:
    """By how much the boundary of the mesh turns at the ends of a surface, (nf, 2) [rad]."""
    turns = np.zeros(vertices.shape)
    ends = np.nonzero(neighbours < 0)
    if not len(ends[0]):
        return turns
    mesh = basis.mesh
    # of the whole boundary only what is next to the ends
    at_end = np.zeros(mesh.p.shape[1], dtype=bool)
    at_end[vertices[ends]] = True
    boundary = mesh.boundary_facets()
    boundary = boundary[at_end[mesh.facets[:, boundary]].any(axis=0)]
    numbers, all_ends = oriented(mesh, boundary)
    nodes = np.transpose(mesh.p[:, all_ends], (1, 2, 0))
    if basis.facet_dofs.size > 0:
        middle = basis.doflocs[:, basis.facet_dofs[0, numbers]].T
        nodes = np.concatenate([nodes, middle[:, None]], axis=1)
    there = normals_at(
        nodes.reshape(-1, nodes.shape[2]),
        np.arange(nodes[..., 0].size).reshape(nodes.shape[:2]),
        np.array([0.0, 1.0]),
    )[0]
    own = normals_at(points, facets, np.array([0.0, 1.0]))[0]
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
