"""Nodes of the primary that stand in the secondary between its nodes, where no node presses."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.pairing.faces.node import node_to_face
from skfem_contact.pairing.node import Pairing
from skfem_contact.pairing.thresholds import LEAN
from skfem_contact.pairing.vectors import dot
from skfem_contact.trees import Tree

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Unseen:
    """Overlaps that no node of the secondary tells.

    Attributes
    ----------
    count : int
        Nodes of the primary.
    depth : float
        By how much the deepest is deeper than the nodes round it say [length].
    place : ndarray, shape (3,)
        Where it is [length].
    """

    count: int
    depth: float
    place: Array


def unseen_overlaps(
    secondary: ContactSurface, primary: ContactSurface, pairing: Pairing
) -> Unseen | None:
    """Corners, edges and other nodes of the primary that overlap faces of the secondary; None if none.

    An overlap counts where it is deeper than that interpolated between the nodes of the face by `LEAN`
    of the face's size, and by what the faces of curved sides stand off the curves between their nodes.
    """
    _, near = Tree(secondary.points).query(primary.points)
    depth = dot(secondary.points[near] - primary.points, secondary.normals[near])
    least = np.zeros(len(secondary.points))
    np.maximum.at(least, secondary.facets, LEAN * secondary.lengths[:, None])
    if not np.any(depth > least[near]):  # what nearly all scenes answer, without another search
        return None
    back = node_to_face(primary, secondary)
    gaps = np.where(pairing.paired, pairing.gap, 0.0)
    told = np.maximum(-(back.primary_weights @ gaps), 0.0)
    facet = np.where(back.paired, back.facet, 0)
    chords = _sagittas(secondary)[facet] + _largest_around(primary, _sagittas(primary))
    hidden = np.where(back.paired, -back.gap - told - chords, 0.0)
    found = np.flatnonzero(hidden > LEAN * secondary.lengths[facet])
    if not len(found):
        return None
    deepest = found[np.argmax(hidden[found])]
    return Unseen(len(found), float(hidden[deepest]), primary.points[deepest])


def past_ends(
    secondary: ContactSurface, primary: ContactSurface, paired: NDArray[np.bool_], least: float
) -> Unseen | None:
    """Nodes at the end of the primary that stand in faces whose own nodes are past it; None if none.

    A node of the secondary that has slid off the primary has no partner. Its face, which still
    covers the end of the primary, is held by the nodes on the other side alone, or by none.
    `least` is the depth from which it counts [length].
    """
    lost = ~paired[secondary.facets].all(axis=1)
    if not lost.any():
        return None
    back = node_to_face(primary, secondary)
    facet = np.where(back.paired, back.facet, 0)
    chords = _sagittas(secondary)[facet] + _largest_around(primary, _sagittas(primary))
    depth = np.where(back.paired & lost[facet], -back.gap - chords, 0.0)
    found = np.flatnonzero(depth > least)
    if not len(found):
        return None
    deepest = found[np.argmax(depth[found])]
    return Unseen(len(found), float(depth[deepest]), primary.points[deepest])


def _sagittas(surface: ContactSurface) -> Array:
    """How far smooth boundaries stand off faces between their nodes, by the turn of normals, (nf,)."""
    corner = surface.facet_node_normals[:, : surface.kind.corners]
    cosine = np.einsum("fcd,fd->fc", corner, surface.facet_normals).min(axis=1)
    return np.asarray(surface.lengths * np.arccos(np.clip(cosine, -1.0, 1.0)) / 4)


def _largest_around(surface: ContactSurface, values: Array) -> Array:
    """The largest value of the faces round every node, (m,)."""
    largest = np.zeros(len(surface.points))
    np.maximum.at(largest, surface.facets, values[:, None])
    return largest
