r"""Facets that are long for a light contact with a round tool, or with a plane: `chords` for obstacles.

A rigid cylinder, sphere or plane is met node by node. Between two nodes it stands off the chord by the
sagitta e of the gap's parabola, with the curvatures of the tool and of the smooth boundary that the
facets of the surface stand for. Where the bodies are pressed in by a given d that is not large beside
e, forces depend on where the nodes are: on a disc that is pressed into a block by up to 15 % at
``e / d = .25``, 30 % at .5 (`tests/verification/test_coarse_tools.py`). And a tool that stands between
nodes presses on nothing at all.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from skfem_contact.answers.thresholds import SAGITTA
from skfem_contact.answers.validity.chords import bends
from skfem_contact.answers.validity.face_chords import face_bends, heights_over
from skfem_contact.bodies.selection import written
from skfem_contact.bodies.surface import ContactSurface

Array = NDArray[np.float64]
Index = NDArray[np.intp]


def tool_sagittas(surface: ContactSurface, bend: Array) -> Array:
    """Height of the gap's parabola over the longest facet at each node, shape (m,) [length].

    Parameters
    ----------
    surface : ContactSurface
        The secondary surface.
    bend : ndarray, shape (d, d)
        Of the obstacle.

    Returns
    -------
    ndarray, shape (m,)
        Zero where neither side is a curve. What curved faces of quadratic elements leave is not known.
    """
    m, facets = len(surface.points), surface.facets
    out = np.zeros(m)
    if surface.dim == 2:
        own, length = bends(surface)
        total = np.abs(own + _along_chords(surface, bend))
        np.maximum.at(out, facets, (total * length**2)[:, None])
        return out / 8
    faces, edges = face_bends(surface)
    if surface.quadratic:
        if faces.any():
            return out
        edges = 0.5 * edges
    both = faces + bend
    over = heights_over(edges, both, bend[None], surface.kind.triangle)
    np.maximum.at(out, facets, over[:, None])
    return out / 8


def _along_chords(surface: ContactSurface, bend: Array) -> Array:
    """Curvature of the obstacle along facets (nf,) [1/length]."""
    along = surface.points[surface.facets[:, 1]] - surface.points[surface.facets[:, 0]]
    along /= np.linalg.norm(along, axis=1)[:, None]
    return np.asarray(np.einsum("fd,de,fe->f", along, bend, along))


def pierced(surface: ContactSurface, bend: Array, gap: Array) -> tuple[float, Array] | None:
    """Where a round tool stands in a facet none of whose nodes it touches, and how deep.

    Parameters
    ----------
    surface : ContactSurface
    bend : ndarray, shape (d, d)
        Of the obstacle.
    gap : ndarray, shape (m,)
        Of the answer, all open; `inf` without a partner [length].

    Returns
    -------
    (depth, place) or None
        If it stands in a facet by more than a fifth of its height over the facet.
    """
    if np.trace(bend) <= 0:  # planes and holes have no part that reaches between nodes
        return None
    chords = _pieces(surface)
    x = surface.points
    along = x[chords[:, 1]] - x[chords[:, 0]]
    rise = np.einsum("cd,de,ce->c", along, bend, along)
    # of sides that fit, such as a pin in a hole of many sides, the smooth boundaries count
    rise = np.minimum(rise, rise + _own_rises(surface, along))
    found = np.isfinite(gap)[chords].all(axis=1) & (rise > 0)
    chords, rise = chords[found], rise[found]
    a, b = gap[chords].T
    between = np.abs(a - b) < 0.5 * rise  # the lowest place of the parabola
    if not between.any():
        return None
    a, b, rise, chords = a[between], b[between], rise[between], chords[between]
    depth = rise / 8 - 0.5 * (a + b) + 0.5 * (a - b) ** 2 / rise
    worst = int(np.argmax(depth))
    if depth[worst] <= SAGITTA * rise[worst] / 8:
        return None
    part = 0.5 + (a[worst] - b[worst]) / rise[worst]
    return float(depth[worst]), (1 - part) * x[chords[worst, 0]] + part * x[chords[worst, 1]]


def _pieces(surface: ContactSurface) -> Index:
    """Nodes at the ends of chords between which there is no node, (c, 2)."""
    facets, kind = surface.facets, surface.kind
    if surface.dim == 2:
        return facets if not surface.quadratic else facets[:, [0, 2, 2, 1]].reshape(-1, 2)
    if kind.quadratic:  # along the edges; in the middle there may be a node
        k = kind.corners
        edges = [[i, k + i] for i in range(k)] + [[k + i, (i + 1) % k] for i in range(k)]
        return facets[:, edges].reshape(-1, 2)
    pairs = [(i, j) for j in range(kind.corners) for i in range(j)]
    return facets[:, pairs].reshape(-1, 2)


def _own_rises(surface: ContactSurface, along: Array) -> Array:
    """Curvature of a smooth boundary along chords (c, d), times their length squared."""
    each = len(along) // len(surface.facets)
    if surface.dim == 2:
        own = np.repeat(bends(surface)[0], each)
        return np.asarray(own * np.sum(along**2, axis=1))
    return np.einsum("cd,cde,ce->c", along, np.repeat(face_bends(surface)[0], each, axis=0), along)


def pierced_words(surface: ContactSurface, depth: float, place: Array, label: str) -> str:
    """That a tool stands between nodes and presses on nothing, and what to do."""
    return (
        f"{label!r} stands in {surface.label!r} by {depth:.3g} at {written(place)}, between nodes that "
        "it does not touch, and presses on nothing: facets are too long for so light a contact. Refine "
        "the surface where the tool touches, to four nodes or more under it."
    )
