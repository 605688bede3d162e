"""Each contact paired by its discretisation: node by node, dual mortar, or a rigid obstacle."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.sparse import csr_matrix

from skfem_contact.arguments import shown
from skfem_contact.arrays import Array, Index, Mask, entries
from skfem_contact.bodies.selection import written
from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.conditions.contact import Contact
from skfem_contact.digits import COMPUTED, DECIMALS, SOLVED
from skfem_contact.errors import InputError
from skfem_contact.obstacles.obstacle import MotionLike, Obstacle
from skfem_contact.pairing.corners import Names, corner_contacts
from skfem_contact.pairing.frames import along_supports, guided_tangents, held_tangents, loaded_frames
from skfem_contact.pairing.mortar import dual_mortar
from skfem_contact.pairing.node import Pairing, at_control_points, gap_vectors, node_to_segment


def pair(
    contact: Contact,
    *,
    moved: Sequence[Array] = (),
    motion: MotionLike | None = None,
    known: Names = frozenset(),
) -> Pairing:
    """Find the partner of every point of the secondary surface.

    Parameters
    ----------
    contact : Contact
    moved : pair of ndarray, optional
        Displacements of the secondary and the primary body, for the deformed geometry [length].
    motion : optional
        Motion of a rigid obstacle: translation (d,), or (translation, angle, centre).
    known : frozenset
        Vertices that carried in a round before, `Pairing.corners`.
    """
    secondary, primary = contact.secondary, contact.primary
    if len(moved):
        secondary = secondary.moved(moved[0])
    partner: ContactSurface | None
    if isinstance(primary, Obstacle):
        placed = primary if motion is None else primary.moved(motion)
        partner = placed.outline
    else:
        partner = primary.moved(moved[1]) if len(moved) else primary
    if partner is None:
        pairing = _by_distance(contact, secondary, placed)
    elif partner.dim != secondary.dim:
        raise _unlike(contact, partner.dim)
    else:
        pairing = _pair_surfaces(contact, secondary, partner, known)
        if contact.sliding == "small" and not contact.tied and not len(moved):
            pairing = loaded_frames(secondary, partner, pairing)
        pairing = _without_nodes(pairing) if contact.rigid else pairing
    if secondary.dim == 2:  # there is one tangent only
        return pairing
    tangent = along_supports(pairing.tangent, pairing.normal, secondary.held)
    pairing = replace(pairing, tangent=tangent)
    if partner is None:
        return pairing
    pairing = held_tangents(secondary, partner, pairing)
    return guided_tangents(secondary, partner, pairing) if contact.tied else pairing


def _unlike(contact: Contact, d: int) -> InputError:
    """The error for a plane body and a solid: the primary is of d dimensions."""
    kind = "surface " if not contact.rigid else ""
    return InputError(
        f"contact {contact.label}: surface {contact.secondary.label!r} is {contact.secondary.dim}-D, "
        f"{kind}{contact.primary.label!r} {d}-D"
    )


def _by_distance(contact: Contact, secondary: ContactSurface, obstacle: Obstacle) -> Pairing:
    """Pair nodes with an obstacle that is known by its distances."""
    pairing = _near(contact, obstacle.pair(secondary))
    away = np.where(pairing.paired, pairing.gap, 0.0)[:, None] * pairing.normal
    return _with_signs(contact, secondary, pairing, away)


def _pair_surfaces(
    contact: Contact, secondary: ContactSurface, primary: ContactSurface, known: Names
) -> Pairing:
    """Pair surfaces of two bodies, or one and the edges or triangles of an obstacle node by node."""
    if callable(contact.method) and not contact.rigid:
        pairing = contact.method(secondary, primary, reach=contact.reach)
        return _without_idle(contact, _checked(contact, secondary, primary, pairing))
    mortar = contact.method == "mortar" and not contact.rigid
    extended = contact.sliding == "finite"
    if secondary.dim == 3:
        if mortar:
            return dual_mortar(secondary, primary, reach=contact.reach)
        pairing = node_to_segment(secondary, primary, reach=contact.reach, extended=extended)
        away = gap_vectors(secondary, primary, pairing.secondary_weights, pairing.primary_weights)
        return _with_signs(contact, secondary, pairing, away)
    corners, reach = None, contact.reach
    if not contact.bilateral:
        # with small sliding only what corners overlap now
        small = contact.sliding == "small"
        corners = corner_contacts(secondary, primary, reach=reach, only_overlaps=small, known=known)
    if mortar:
        pressed = None if corners is None else corners.pressed
        pairing = dual_mortar(secondary, primary, reach=reach, pressed=pressed)
        pairing = held_tangents(secondary, primary, pairing)
    else:
        pairing = node_to_segment(secondary, primary, reach=reach, extended=extended)
    pairing = pairing if corners is None else corners.rows(pairing, every=mortar)
    return pairing if mortar else _without_idle(contact, pairing)


def _checked(
    contact: Contact, secondary: ContactSurface, primary: ContactSurface, pairing: Any
) -> Pairing:
    """Refuse what a discretisation of the user's returns if forces would not be in balance by it."""
    whose = f"Contact {contact.label}: method={contact.method_name}"
    if not isinstance(pairing, Pairing):
        raise InputError(f"{whose} returns {shown(pairing)}, not a skfem_contact.pairing.node.Pairing")
    m, d = secondary.points.shape
    shapes = {
        "points": (m, d),
        "normal": (m, d),
        "tangent": (m, d - 1, d),
        "gap": (m,),
        "area": (m,),
        "secondary_weights": (m, m),
        "primary_weights": (m, len(primary.points)),
        "paired": (m,),
        "miss": (m,),
        "facet": (m,),
    }
    for name, shape in shapes.items():
        value = getattr(pairing, name)
        if np.shape(value) != shape:
            raise InputError(f"{whose} returns {name} of shape {np.shape(value)}; it has to be {shape}")
    at = np.asarray(pairing.paired, dtype=bool)
    sums = [csr_matrix(w)[at].sum(axis=1) for w in (pairing.secondary_weights, pairing.primary_weights)]
    rules = {
        "weights of both sides that add up to one in each row": [np.ravel(s) - 1 for s in sums],
        "normals of length one": [np.linalg.norm(pairing.normal[at], axis=1) - 1],
        "finite gaps where points are paired": [0.0 * pairing.gap[at]],
    }
    for rule, errors in rules.items():
        wrong = ~np.all([np.abs(error) <= SOLVED for error in errors], axis=0)
        if wrong.any():
            i = int(np.flatnonzero(at)[np.argmax(wrong)])
            raise InputError(
                f"{whose} has to return {rule}; point {i} at {written(pairing.points[i])} has not"
            )
    return pairing


def _with_signs(contact: Contact, secondary: ContactSurface, pairing: Pairing, away: Array) -> Pairing:
    """The pairing of nodes with rows whose forces are as pressures are; glued, nodes will do."""
    if contact.tied:
        return pairing
    return _without_idle(contact, at_control_points(secondary, pairing, away))


def _near(contact: Contact, pairing: Pairing) -> Pairing:
    """The pairing less points whose partner is out of reach."""
    if contact.reach is None:
        return pairing
    far = ~(np.abs(pairing.gap) <= contact.reach)
    return replace(_without(pairing, far), miss=np.where(far, np.inf, pairing.miss))


def _without_nodes(pairing: Pairing) -> Pairing:
    """The pairing with edges of a rigid obstacle, which has no nodes that move."""
    m = len(pairing.gap)
    return replace(
        pairing,
        primary_weights=csr_matrix((m, 0)),
        facet=np.full(m, -1),
        secondary_normal=None,
        primary_normal=None,
    )


def _without_idle(contact: Contact, pairing: Pairing) -> Pairing:
    """The pairing less points whose force has nothing to do with the pressure.

    The end of a quadratic facet on the axis of symmetry has no area: its force vanishes with any
    constant pressure, and the sign of what is left is not that of the pressure. Glued, it may stay.
    """
    idle = _idle_points(contact.secondary, pairing.area)
    if contact.tied or not (idle & pairing.paired).any():
        return pairing
    return _without(pairing, idle)


def _without(pairing: Pairing, left_out: Mask) -> Pairing:
    """The pairing less some points."""
    gap = np.where(left_out, np.inf, pairing.gap)
    return replace(pairing, paired=pairing.paired & ~left_out, gap=gap)


def _idle_points(surface: ContactSurface, area: Array) -> Mask:
    """Points whose shape function has integral zero, shape (m,)."""
    middle = np.zeros(len(surface.points))
    np.maximum.at(middle, surface.facets, area[surface.facets].max(axis=1)[:, None])
    return np.asarray(area <= COMPUTED * middle)


def carriers(surface: ContactSurface, pairing: Pairing) -> Index:
    """The point whose pressure holds at each point, shape (m,).

    It is the point itself, except that a node merged by `dual_mortar` takes that of its heir, and
    one without area that of the middle of its facet. Of several heirs it is the one with the largest
    weight, of equal ones the one with the smaller gap: numbers of nodes have no say in it.
    """
    heir: Index = np.arange(len(pairing.gap))
    if surface.dim == 2 and surface.quadratic:
        at, middle = surface.facets, heir.copy()
        middle[at[:, :2]] = at[:, 2:]
        lonely = _idle_points(surface, surface.area) & ~pairing.paired
        heir = np.where(lonely, middle, heir)
    row, col, weight = entries(pairing.secondary_weights)
    lent = ~pairing.paired[col] & (row != col)
    row, col, weight = row[lent], col[lent], weight[lent]
    order = np.lexsort((-pairing.gap[row], np.round(weight, DECIMALS)))
    # of those written to one place the last stays, with the largest weight
    heir[col[order]] = row[order]
    return heir
