"""What small sliding does not follow where solids meet obstacles: measured at the obstacle itself."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from skfem_contact.answers.thresholds import GAP
from skfem_contact.answers.validity.flats import leaning_faces, leaning_words
from skfem_contact.answers.validity.meeting import distances
from skfem_contact.answers.validity.track import gaps_at_obstacle
from skfem_contact.bodies.selection import written
from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.conditions.contact import Contact
from skfem_contact.conditions.geometry import Geometry
from skfem_contact.conditions.lever import as_motion
from skfem_contact.conditions.loads import LoadCase
from skfem_contact.conditions.state import OPEN, State
from skfem_contact.digits import COMPUTED
from skfem_contact.obstacles.motion import MotionLike
from skfem_contact.obstacles.obstacle import Obstacle
from skfem_contact.pairing.faces.unseen import past_ends, unseen_overlaps

Array = NDArray[np.float64]


def looked_at(contact: Contact) -> bool:
    """Whether it is a solid on an obstacle whose partners stay what they are."""
    solid = contact.secondary.dim == 3 and contact.rigid
    return solid and contact.sliding == "small" and not contact.tied


def obstacle_drift(
    geometry: Geometry, i: int, state: State, gap: Array, case: LoadCase, u: Array, approach: float
) -> dict[str, float]:
    """Normals and gaps of one contact against those at the obstacle, where it and the points are.

    Gaps are compared at nodes that have a row of their own.

    Parameters
    ----------
    geometry : Geometry
    i : int
        The contact.
    state, gap, case
        Of the answer.
    u : ndarray, shape (n,)
        Displacements, right at the contact DOFs [length].
    approach : float
        That the bodies take up elastically [length].

    Returns
    -------
    dict
        `tilt`, `gap_error`, `gap_share` and `motion` of `Drift`.
    """
    contact, part, pairing = geometry.contacts[i], geometry.point_slices[i], geometry.pairings[i]
    surface, obstacle = contact.secondary, contact.primary
    assert isinstance(obstacle, Obstacle)
    moved = u[geometry.system.slice(surface.body)][surface.dofs]
    at = replace(surface, points=surface.points + moved)
    distance, normal, facing = distances(obstacle.moved(_motion(geometry, i, case, u)), at)
    closed = (state.status[part] != OPEN) & pairing.paired
    # what a given or adjusted gap adds to the measured one, and an interference takes away
    first = np.where(pairing.paired, geometry.kin.gap0[part], 0.0) + geometry.interference[i]
    added = first - np.where(pairing.paired, pairing.gap, 0.0) - case.interference[part]
    rows = np.diff(pairing.secondary_weights.tocsr().indptr) == 1
    true = distance + added
    known = np.where(pairing.paired, gap[part], 0.0)
    sunk = ~closed & facing & pairing.paired & rows  # where nothing presses
    noise = COMPUTED * float(np.max(np.abs(at.points)))
    cosine = np.einsum("md,md->m", pairing.normal, normal)
    across = np.linalg.norm(np.cross(pairing.normal, normal), axis=1)
    shift = np.linalg.norm(case.motion[i].shift(surface.points)[closed], axis=1)
    return {
        "tilt": float(np.max(np.arctan2(across, cosine)[closed], initial=0.0)),
        "motion": float(np.max(shift, initial=0.0)),
        **gaps_at_obstacle(true, known, closed & rows, sunk, approach, noise),
    }


def of_triangles(contact: Contact) -> bool:
    """Whether it is a solid on an obstacle of triangles, whose corners may stand between its nodes."""
    outline = contact.primary.outline if isinstance(contact.primary, Obstacle) else None
    rigid = outline is not None and outline.dim == 3
    return rigid and not contact.bilateral and contact.gap is None


def triangle_words(
    geometry: Geometry, i: int, state: State, gap: Array, case: LoadCase, u: Array
) -> str:
    """What to say of an obstacle of triangles: corners that no row sees, normals that lean on flats.

    Parameters are those of `obstacle_drift`; empty where there is nothing.
    """
    contact = geometry.contacts[i]
    surface, obstacle = contact.secondary, contact.primary
    assert isinstance(obstacle, Obstacle)
    outline = obstacle.moved(_motion(geometry, i, case, u)).outline
    assert outline is not None
    words = _unseen_words(geometry, i, gap, case, u, outline)
    leaning = leaning_faces(surface, outline)
    if words or not leaning.any():
        return words
    return leaning_words(geometry, i, state, outline, leaning, u)


def _unseen_words(
    geometry: Geometry, i: int, gap: Array, case: LoadCase, u: Array, outline: ContactSurface
) -> str:
    """What to say of corners and edges of triangles that stand in a solid between its nodes."""
    contact, part = geometry.contacts[i], geometry.point_slices[i]
    surface, obstacle = contact.secondary, contact.primary
    if case.interference[part].any():
        return ""
    known = np.isfinite(gap[part])
    met = replace(geometry.pairings[i], gap=np.where(known, gap[part], 0.0), paired=known)
    at = surface.moved(u[geometry.system.slice(surface.body)])
    found = unseen_overlaps(at, outline, met)
    if found is None:
        return ""
    return (
        f"{found.count} corners of {obstacle.label!r} stand in {surface.label!r} between its nodes, "
        f"the deepest, at {written(found.place)}, by {found.depth:.3g} more than the nodes around it. "
        "Node by node nothing presses there: refine the surface, to facets smaller than what presses."
    )


def slides_off(contact: Contact) -> bool:
    """Whether nodes of a solid may slide off another one, and are let go."""
    solids = contact.secondary.dim == 3 and not contact.rigid
    node = contact.sliding == "finite" and contact.method == "node"
    return solids and node and not contact.tied and contact.gap is None


def past_words(
    geometry: Geometry, i: int, gap: Array, case: LoadCase, u: Array, approach: float
) -> str:
    """What to say of ends of a solid that stand in another one, whose nodes have slid past them.

    Parameters are those of `obstacle_drift`; empty where there are none.
    """
    contact, part = geometry.contacts[i], geometry.point_slices[i]
    one, other = contact.secondary, contact.primary
    assert isinstance(other, ContactSurface)
    paired = np.isfinite(gap[part])
    if paired.all() or case.interference[part].any():
        return ""
    least = max(GAP * approach, COMPUTED * float(np.abs(one.points).max()))
    at, end = (side.moved(u[geometry.system.slice(side.body)]) for side in (one, other))
    found = past_ends(at, end, paired, least)
    if found is None:
        return ""
    size = f", {100 * found.depth / approach:.3g} % of the elastic approach" if approach > 0 else ""
    return (
        f"nodes of {one.label!r} have slid past the end of {other.label!r}, which stands in its faces "
        f"by up to {found.depth:.3g}{size}, at {written(found.place)}. Node by node nothing presses "
        "there, and forces are wrong by as much. Take method='mortar', which follows faces to the end, "
        "or let the surface that reaches beyond the other one be the primary."
    )


def _motion(geometry: Geometry, i: int, case: LoadCase, u: Array) -> MotionLike:
    """Where the obstacle of a contact is, as obstacles take it."""
    body = geometry.contacts[i].rigid_body
    return case.motion[i].as_argument() if body is None else as_motion(geometry.system, body, u)
