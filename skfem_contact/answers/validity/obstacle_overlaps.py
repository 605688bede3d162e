"""Obstacles that contact conditions do not see, or see wrongly: by kinds that each have a shape for it.

* a surface that begins where its obstacle is solid, and does not touch it: `hollow` by mistake;
* a round tool that stands in a facet between nodes;
* flats of large triangles whose normals lean towards the bends beside them.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from skfem_contact.answers.thresholds import A_TENTH, SAGITTA
from skfem_contact.answers.validity.chords import bends, kinked_faces
from skfem_contact.answers.validity.deformed_boundaries import signed_distance
from skfem_contact.bodies.selection import written
from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.conditions.contact import Contact
from skfem_contact.conditions.geometry import Geometry
from skfem_contact.conditions.loads import LoadCase
from skfem_contact.conditions.rows import as_motion
from skfem_contact.conditions.state import OPEN, State
from skfem_contact.digits import SOLVED
from skfem_contact.obstacles.motion import MotionLike
from skfem_contact.obstacles.obstacle import Obstacle
from skfem_contact.obstacles.rigid_body import shape_of
from skfem_contact.pairing.node import Pairing, node_to_segment

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Mask = NDArray[np.bool_]

#: Triangles this many times as large as the faces that meet them: smaller ones are a bend themselves.
LARGER = 2.0


# -- a surface in the solid of its obstacle -------------------------------------------------------


def depth_in_solid(contact: Contact, pairing: Pairing) -> float:
    """How deep a surface lies in the solid of its obstacle, all of it and unseen; zero if it does not.

    Finite sliding looks for partners anew in every step, so a point without one is no mistake: it may
    come to meet the obstacle yet. But where all of a surface is in the solid from the beginning, and
    nothing of it finds what it could touch, the obstacle is taken for its own inverse. (With small
    sliding points that find nobody are refused.) A closed outline may offer its far side instead: its
    gaps are open, where the points are in the solid.

    Parameters
    ----------
    contact : Contact
        On an obstacle.
    pairing : Pairing
        Of the undeformed bodies.
    """
    obstacle, surface = _shape(contact), contact.secondary
    outline, paired = obstacle.outline, pairing.paired
    if outline is not None and not getattr(obstacle, "closed", False):
        return 0.0  # of an open outline it is not known on which side points far from it are
    known = contact.gap is not None or contact.adjust
    if paired.any() and (outline is None or known or np.any(pairing.gap[paired] <= 0)):
        return 0.0  # what overlaps is seen
    distance = signed_distance(obstacle, surface, surface.points)
    noise = SOLVED * float(np.max(np.ptp(surface.points, axis=0)))
    deepest = -float(distance.min())
    return deepest if deepest > noise and np.all(distance <= noise) else 0.0


def in_solid_words(contact: Contact, depth: float) -> str:
    """Say that a surface lies in the solid of its obstacle, and what to do."""
    hollow = getattr(_shape(contact), "hollow", None)
    way = "turn the sign of its function" if hollow is None else f"give it hollow={not hollow}"
    return (
        f"nothing touches. From the beginning all of {contact.secondary.label!r} lies where "
        f"{contact.primary.label!r} is solid{', which is round its hole' if hollow else ''}, by up to "
        f"{depth:.3g}, and finds nothing there that it could touch. If the body is meant to be on the "
        f"other side, {way}; else the obstacle is in the wrong place."
    )


def _shape(contact: Contact) -> Obstacle:
    primary = contact.primary
    assert isinstance(primary, Obstacle)
    return shape_of(primary)


# -- round tools between nodes --------------------------------------------------------------------


def pierced(surface: ContactSurface, bend: Array, gap: Array) -> tuple[float, Array] | None:
    """Return where a round tool stands in a facet none of whose nodes it touches, and how deep.

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
    own = np.repeat(bends(surface)[0], len(along) // len(surface.facets), axis=0)
    rise = np.minimum(rise, rise + np.einsum("cd,cde,ce->c", along, own, along))
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
    facets, kind, k = surface.facets, surface.kind, surface.kind.corners
    if kind.quadratic:  # along the edges; in the middle of a face there may be a node
        edges = [(i, k + i) for i in range(k)] + [(k + i, (i + 1) % k) for i in range(k)]
        pairs = [(0, 2), (2, 1)] if surface.dim == 2 else edges
    else:
        pairs = [(i, j) for j in range(k) for i in range(j)]
    return facets[:, pairs].reshape(-1, 2)


def pierced_words(surface: ContactSurface, depth: float, place: Array, label: str) -> str:
    """Say that a tool stands between nodes and presses on nothing, and what to do."""
    return (
        f"{label!r} stands in {surface.label!r} by {depth:.3g} at {written(place)}, between nodes that "
        "it does not touch, and presses on nothing: facets are too long for so light a contact. Refine "
        "the surface where the tool touches, to four nodes or more under it."
    )


# -- obstacles of triangles -----------------------------------------------------------------------


def of_triangles(contact: Contact) -> bool:
    """Return whether it is a solid on an obstacle of triangles, whose normals may lean."""
    outline = contact.primary.outline if isinstance(contact.primary, Obstacle) else None
    rigid = outline is not None and outline.dim == 3
    return rigid and not contact.bilateral and contact.gap is None


def _motion(geometry: Geometry, i: int, case: LoadCase, u: Array) -> MotionLike:
    """Return where the obstacle of a contact is, as obstacles take it."""
    body = geometry.contacts[i].rigid_body
    return case.motion[i].as_argument() if body is None else as_motion(geometry.system, body, u)


def leaning_faces(secondary: ContactSurface, outline: ContactSurface) -> Mask:
    """Large triangles that are no pieces of a curve, and whose normals lean nevertheless, shape (nf,).

    Normals turn from a flat into a chamfer over a strip along the bend (`obstacles.bends`). Forces on
    what stands there, and not on the flat, lean by up to half of the angle of the bend.
    A flat that turns alike at both ends, by less than 16 sides to a circle do, may be a piece of one.
    """
    size = LARGER * float(np.median(secondary.lengths))
    corners = outline.facet_node_normals[:, : outline.kind.corners]
    off = np.linalg.norm(corners - outline.facet_normals[:, None], axis=2).max(axis=1)
    return kinked_faces(outline) & (off > A_TENTH) & (outline.lengths > size)


def leaning_words(geometry: Geometry, i: int, state: State, case: LoadCase, u: Array) -> str:
    """Say what to say of forces that lean on flats of triangles; empty if they do not, or hardly.

    Parameters
    ----------
    geometry : Geometry
    i : int
        The contact, on an obstacle of triangles.
    state, case
        Of the answer.
    u : ndarray, shape (n,)
        Displacements, right at the contact DOFs [length].
    """
    contact, part = geometry.contacts[i], geometry.point_slices[i]
    surface, obstacle = contact.secondary, contact.primary
    assert isinstance(obstacle, Obstacle)
    outline = obstacle.moved(_motion(geometry, i, case, u)).outline
    assert outline is not None
    leaning = leaning_faces(surface, outline)
    force = np.where(state.status[part] != OPEN, np.abs(state.normal_force[part]), 0.0)
    if not (leaning.any() and force.any()):
        return ""
    pairing = node_to_segment(surface.moved(u[geometry.system.slice(surface.body)]), outline)
    on_flat = pairing.paired & leaning[np.where(pairing.paired, pairing.facet, 0)]
    facet = np.where(on_flat, pairing.facet, 0)
    off = (pairing.normal - outline.facet_normals[facet]) * (force * on_flat)[:, None]
    lean = float(np.linalg.norm(off.sum(axis=0)) / force.sum())
    if lean <= A_TENTH:
        return ""
    return (
        f"normals of {contact.primary.label!r} lean by {lean:.2g} rad in the mean from those of its "
        "triangles, which are large and flat beside bends of less than 45 degrees, and so do the "
        "forces. Along a bend normals turn over an eighth of a triangle; where that is too wide, give "
        "the flat narrow triangles along it."
    )
