"""Flats of obstacles made of large triangles: normals that lean towards the bends beside them.

Normals turn from a flat into a chamfer over a strip along the bend (`obstacles.bends`). Forces on what
stands there, and not on the flat, lean by up to half of the angle of the bend.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from skfem_contact.answers.thresholds import TILT
from skfem_contact.answers.validity.face_chords import kinked_faces
from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.conditions.geometry import Geometry
from skfem_contact.conditions.state import OPEN, State
from skfem_contact.pairing.faces.node import node_to_face

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

#: Triangles this many times as large as the faces that meet them: smaller ones are a bend themselves.
LARGER = 2.0


def leaning_faces(secondary: ContactSurface, outline: ContactSurface) -> Mask:
    """Large triangles that are no pieces of a curve, and whose normals lean nevertheless, shape (nf,).

    A flat that turns alike at both ends, by less than 16 sides to a circle do, may be a piece of one.
    """
    size = LARGER * float(np.median(secondary.lengths))
    corners = outline.facet_node_normals[:, : outline.kind.corners]
    off = np.linalg.norm(corners - outline.facet_normals[:, None], axis=2).max(axis=1)
    return kinked_faces(outline) & (off > TILT) & (outline.lengths > size)


def leaning_words(
    geometry: Geometry, i: int, state: State, outline: ContactSurface, leaning: Mask, u: Array
) -> str:
    """What to say of forces that lean on flats; empty if they do not, or hardly.

    Parameters
    ----------
    geometry : Geometry
    i : int
        The contact, on an obstacle of triangles.
    state : State
        Of the answer.
    outline : ContactSurface
        Of the obstacle where it is.
    leaning : ndarray of bool, shape (nf,)
        See `leaning_faces`.
    u : ndarray, shape (n,)
        Displacements, right at the contact DOFs [length].
    """
    contact, part = geometry.contacts[i], geometry.point_slices[i]
    surface = contact.secondary
    force = np.where(state.status[part] != OPEN, np.abs(state.normal_force[part]), 0.0)
    if not force.any():
        return ""
    pairing = node_to_face(surface.moved(u[geometry.system.slice(surface.body)]), outline)
    on_flat = pairing.paired & leaning[np.where(pairing.paired, pairing.facet, 0)]
    facet = np.where(on_flat, pairing.facet, 0)
    off = (pairing.normal - outline.facet_normals[facet]) * (force * on_flat)[:, None]
    lean = float(np.linalg.norm(off.sum(axis=0)) / force.sum())
    if lean <= TILT:
        return ""
    return (
        f"normals of {contact.primary.label!r} lean by {lean:.2g} rad in the mean from those of its "
        "triangles, which are large and flat beside bends of less than 45 degrees, and so do the "
        "forces. Along a bend normals turn over an eighth of a triangle; where that is too wide, give "
        "the flat narrow triangles along it."
    )
