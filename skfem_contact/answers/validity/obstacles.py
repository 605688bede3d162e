"""Obstacles that contact conditions do not see all of, measured by signed distance from them.

A deformed surface is met where its nodes and points between them are too deep, or a corner of the
obstacle stands in the body. What obstacles hide goes by kinds that each have a shape for it:

* a surface that begins where its obstacle is solid, and does not touch it: `hollow` by mistake;
* a round tool that stands in a facet between nodes;
* flats of large triangles whose normals lean towards the bends beside them.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from skfem_contact.answers.answer import Answer
from skfem_contact.answers.validity.chords import bends, kinked_edges
from skfem_contact.answers.validity.deformed_boundaries import Boundary, Rim
from skfem_contact.answers.validity.validity import A_TENTH, SAGITTA, Meeting
from skfem_contact.arrays import Array, Index, Mask
from skfem_contact.bodies.selection import written
from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.conditions.contact import Contact
from skfem_contact.conditions.rows import as_motion
from skfem_contact.conditions.state import OPEN
from skfem_contact.digits import SOLVED
from skfem_contact.obstacles.obstacle import Obstacle
from skfem_contact.obstacles.rigid_body import shape_of
from skfem_contact.pairing.closest import signed_distances
from skfem_contact.pairing.node import Pairing, node_to_segment
from skfem_contact.trees import Tree

#: Triangles this many times as large as the faces that meet them: smaller ones are a bend themselves.
LARGER = 2.0


def moved_obstacle(result: Answer, i: int, u: Array) -> Obstacle:
    """The obstacle of a contact at its place; a rigid body's by displacements u (n,)."""
    contact = result.contacts[i]
    assert isinstance(contact.primary, Obstacle)
    motion = result.case.motion[i].as_argument()
    if contact.rigid_body is not None:
        motion = as_motion(result.system, contact.rigid_body, u)
    return contact.primary.moved(motion)


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
    return Meeting(deepest if deepest > noise else 0.0, int(lonely.sum()), opening, chords)


def with_corners(
    found: Meeting, body: Boundary, corners: Array, chords: float, nodes: Array, added: Array
) -> Meeting:
    """Return how an obstacle is met, whose corners may stand in the body between its nodes.

    Parameters
    ----------
    found : Meeting
        What the body's own points say.
    body : Boundary
    corners : ndarray, shape (p, d)
        Of the obstacle at its place [length].
    chords : float
        How far what is drawn of the body stands off it [length].
    nodes, added
        As in `between`.
    """
    depth = body.depth(corners)
    inside = np.flatnonzero(depth)
    if not len(inside):
        return found
    depth = depth[inside] - added[Tree(nodes).nearest(corners[inside])]
    i = int(np.argmax(depth))
    if depth[i] - chords <= max(found.overlap - found.chords, 0.0):
        return found
    return replace(found, overlap=float(depth[i]), chords=chords, place=corners[inside[i]], side=1)


def signed_distance(obstacle: Obstacle, surface: ContactSurface, points: Array) -> Array:
    """Signed distances of any points, whether they face the obstacle or not."""
    # these points are none of the nodes that the facets of the surface are made of
    outline = obstacle.outline
    if outline is not None:
        return signed_distances(outline, points)
    at = replace(surface, points=points, normals=np.zeros_like(points))
    return distances(obstacle, at)[0]


def distances(obstacle: Obstacle, surface: ContactSurface) -> tuple[Array, Array, Mask]:
    """Distances, normals and partners of `Obstacle.distance`, of a level set to first order."""
    from skfem_contact.obstacles.shapes import LevelSet

    if not isinstance(obstacle, LevelSet):
        return obstacle.distance(surface)
    return obstacle.first_order(surface)


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
    known = contact.gap is not None or contact.adjust
    if paired.any() and (outline is None or known or np.any(pairing.gap[paired] <= 0)):
        return 0.0  # what overlaps is seen
    distance = signed_distance(obstacle, surface, surface.points)
    if outline is not None and np.any(abs(distance) >= abs(Rim.of(outline).beyond(surface.points))):
        return 0.0  # on which side of an open outline points beyond its ends are is not known
    noise = SOLVED * float(np.max(np.ptp(surface.points, axis=0)))
    deepest = -float(distance.min())
    return deepest if deepest > noise and np.all(distance <= noise) else 0.0


def in_solid_words(contact: Contact, depth: float) -> str:
    """Say that a surface lies in the solid of its obstacle, and what to do."""
    shape = _shape(contact)
    hollow = getattr(shape, "hollow", None)
    way = "turn the sign of its function" if hollow is None else f"give it hollow={not hollow}"
    if not getattr(shape, "closed", True):
        way = "give its points, or the corners of its triangles, the other way round"
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


def outline_of(result: Answer, i: int, u: Array) -> ContactSurface:
    """Return the straight pieces of the obstacle of a contact at their place."""
    outline = moved_obstacle(result, i, u).outline
    assert outline is not None
    return outline


def leaning_faces(secondary: ContactSurface, outline: ContactSurface) -> Mask:
    """Large triangles that are no pieces of a curve, and whose normals lean nevertheless, shape (nf,).

    Normals turn from a flat into a chamfer over a strip along the bend (`obstacles.bends`). Forces on
    what stands there, and not on the flat, lean by up to half of the angle of the bend.
    A flat that turns alike at both ends, by less than 16 sides to a circle do, may be a piece of one.
    """
    size = LARGER * float(np.median(secondary.lengths))
    corners = outline.facet_node_normals[:, : outline.kind.corners]
    off = np.linalg.norm(corners - outline.facet_normals[:, None], axis=2).max(axis=1)
    return kinked_edges(outline).any(axis=1) & (off > A_TENTH) & (outline.lengths > size)


def leaning_words(result: Answer, i: int, u: Array) -> str:
    """Say what to say of forces that lean on flats of triangles; empty if they do not, or hardly.

    By displacements u (n,) that are right at the contact DOFs.
    """
    contact, part = result.contacts[i], result.slices()[i]
    surface, outline, state = contact.secondary, outline_of(result, i, u), result.state
    leaning = leaning_faces(surface, outline)
    force = np.where(state.status[part] != OPEN, np.abs(state.normal_force[part]), 0.0)
    if not (leaning.any() and force.any()):
        return ""
    pairing = node_to_segment(surface.moved(u[result.system.slice(surface.body)]), outline)
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
