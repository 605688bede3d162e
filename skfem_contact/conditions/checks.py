"""Checks of a contact problem that need no solution, with what is wrong in words.

Axisymmetric bodies that meet must have the same idea of a ring: the weights that they count forces by.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import structural_rank

from skfem_contact.arrays import Array, Mask
from skfem_contact.bodies.member import Meshed
from skfem_contact.bodies.selection import written
from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.bodies.system import System
from skfem_contact.conditions.contact import Contact
from skfem_contact.conditions.interface import Interface
from skfem_contact.conditions.kinematics import Kinematics, prescribed_rows
from skfem_contact.conditions.state import LoadCase
from skfem_contact.digits import GIVEN, SOLVED
from skfem_contact.errors import ConstraintError, InputError, warn
from skfem_contact.obstacles.obstacle import Obstacle
from skfem_contact.pairing.diagnosis import NEVER, diagnose, look_alike, say_wrong_side
from skfem_contact.pairing.node import Pairing

# An overlap of this share of a body is no interference fit: small strains end long before.
HUGE = 0.1

# Gaps that differ by this share of a body are no layer of glue, and none is an inexactness of a mesh.
BRIDGED = 0.3


def check_passes(contacts: Sequence[Contact], names: Sequence[str]) -> None:
    """Refuse two contacts over one interface: the same pair again, or once in each direction.

    Raises
    ------
    InputError
    """
    for (i, one), (j, other) in itertools.combinations(enumerate(contacts), 2):
        rigid = one.primary is other.primary and _shared(one.secondary, other.secondary)
        again = _shared(one.secondary, other.secondary) and _shared(one.primary, other.primary)
        back = _shared(one.secondary, other.primary) and _shared(one.primary, other.secondary)
        if not (rigid or again or back):
            continue
        raise InputError(
            f"contacts '{names[i]}' ({one.label}) and '{names[j]}' ({other.label}) pair the same "
            f"facets{', the one from one side and the other from the other' if back else ''}. "
            "The force between two surfaces would be shared out among both, and nothing tells how "
            "much each has. One contact holds both sides, with method='mortar' also between its nodes: "
            "leave one of the two out, or give each its own part of the surface."
        )


def warn_unfelt_wear(contacts: Sequence[Contact], names: Sequence[str]) -> None:
    """Warn of a surface that wears in one contact and is in another one, which has it unworn.

    Warns
    -----
    ContactWarning
    """
    for (i, one), (j, other) in itertools.permutations(enumerate(contacts), 2):
        sides = (other.secondary, other.primary)
        if one.wear is None or not any(_shared(one.secondary, side) for side in sides):
            continue
        if j < i and other.wear is not None and _shared(one.secondary, other.secondary):
            continue  # said of the two already
        warn(
            f"'{one.secondary.label}' wears in contact '{names[i]}' and is in contact '{names[j]}' as "
            "well, which does not feel that: the depth worn off belongs to a contact, and gaps of the "
            "other one are those of the unworn surface. Where both touch the same place, their wear is "
            "wrong; give each its own part of the surface."
        )


def _shared(one: Any, other: Any) -> bool:
    """Return whether two sides are surfaces of one body with common facets."""
    if not (isinstance(one, ContactSurface) and isinstance(other, ContactSurface)):
        return False
    return one.body is other.body and bool(np.isin(one.mesh_facets, other.mesh_facets).any())


def check_pairing(contact: Contact, pairing: Pairing, undeformed: bool = False) -> None:
    """Refuse a contact none of whose points has a partner, or one too few for ``outside="error"``.

    What slides far may come to its partner, but not where both sides look the same way; glue holds what
    is together in the undeformed meshes.

    Raises
    ------
    InputError
    """
    lonely = pairing.miss > 0  # a node that handed its multiplier on has a partner
    stays = contact.sliding == "small" or (undeformed and contact.bilateral)
    nobody = not pairing.paired.any()
    if nobody and not stays:
        nobody = undeformed and look_alike(contact.secondary, contact.primary)
    if not nobody and not (lonely.any() and contact.outside == "error"):
        return
    found = diagnose(pairing, contact.secondary, contact.primary)
    missed = [line for line in found if not line.startswith("The primary surface")]
    words = " ".join(missed).replace(NEVER, "")
    if contact.outside == "error" and not nobody:
        words += ' They are an error because of outside="error"; outside="open" leaves them out.'
    raise InputError(words)


def warn_redundant_glue(contact: Contact, pairing: Pairing) -> None:
    """Warn of prescribed points glued to fewer nodes: the force has no unique share among them.

    Warns
    -----
    ContactWarning
    """
    primary = contact.primary
    if not (contact.bilateral and isinstance(primary, ContactSurface)):
        return
    prescribed = contact.secondary.held.all(axis=1)
    if not prescribed.any():
        return
    moving = abs(csr_matrix(pairing.secondary_weights)) @ (~prescribed).astype(float)
    free = ~primary.held.all(axis=1)
    W = csr_matrix(pairing.primary_weights)[pairing.paired & (moving == 0.0)][:, free]
    W = W[np.diff(W.indptr) > 0]
    if W.shape[0] == 0 or structural_rank(W) == W.shape[0]:
        return
    nodes = len(np.unique(W.indices))
    warn(
        f"Contact {contact.label}: {W.shape[0]} glued points of '{contact.secondary.label}' are "
        f"prescribed altogether and hold {nodes} free nodes of '{primary.label}'. The displacements "
        "are those of the glue, but how its force is shared out among too many points is not unique, "
        "and tractions there may be far too large. Take the surface whose nodes are free as the "
        "secondary one: swap the two."
    )


def warn_bridged(contact: Contact, pairing: Pairing) -> None:
    """Warn of glue that holds near and far points or too few, and of gaps that `adjust` takes for none.

    Without `reach` glue holds all that faces the other side. At one distance all over it is a link, and
    on an obstacle a rigid arm: both may be meant. Points beyond the end of the other side have no
    partner in many a joint; of those that nothing faces at all somebody has thought that they are held.

    Warns
    -----
    ContactWarning
    """
    gap = pairing.gap[pairing.paired]
    if not (contact.tied or contact.adjust) or not len(gap):
        return
    size = _smaller_extent(contact)
    if contact.tied and not contact.rigid and np.ptp(gap) > BRIDGED * size:
        warn(
            f"Contact {contact.label} glues points that are {gap.min():.6g} to {gap.max():.6g} off the "
            f"other side, where the extent of the smaller body is {size:.6g}: all that faces it is "
            "held as it is meshed, far or near. Usually only what is near is to be glued: give "
            "`reach`, the largest distance of what is, or the part of the boundary."
        )
    elif contact.tied and contact.reach is None and np.isinf(pairing.miss).any():
        lost = np.flatnonzero(np.isinf(pairing.miss))
        warn(
            f"Contact {contact.label} glues {len(gap)} of {len(pairing.gap)} points, and nothing of "
            f"the other side faces {len(lost)}, which are free; the first is point {lost[0]} at "
            f"{written(contact.secondary.points[lost[0]])}. Usually the two sides are not the same "
            "shape in the same place, or the boundary has facets that are not meant: give the part of "
            "it that is, or `reach`, the largest distance of what is."
        )
    closed = np.abs(gap[np.abs(gap) <= contact.adjust])
    if contact.adjust and len(closed) and closed.max() > BRIDGED * size:
        warn(
            f"Contact {contact.label}: adjust = {contact.adjust:.6g} takes gaps and overlaps of up to "
            f"{closed.max():.6g} for none, {closed.max() / size:.2g} times the extent of the smaller "
            f"body ({size:.6g}). It is meant for the inexactness of meshes: usually a unit is wrong."
        )


def check_side(contact: Contact, pairing: Pairing) -> None:
    """Refuse an obstacle whose normal is the wrong way round; glue may be on either side.

    Raises
    ------
    InputError
    """
    if contact.rigid and not contact.tied:
        wrong = say_wrong_side(pairing, contact.secondary, contact.primary)
        if wrong:
            raise InputError(wrong)


def check_loads(
    system: System,
    interface: Interface,
    kin: Kinematics,
    fixed: Mask,
    case: LoadCase,
    said: frozenset[tuple[str, str]] = frozenset(),
) -> frozenset[tuple[str, str]]:
    """Say where prescribed displacements or an interference leave contact no right answer.

    `fixed` are the points of `kin` whose gap is prescribed. An overlap is said once in a history, and
    again where it has doubled: `said` is what has been, and returned with what is said here.

    Warns
    -----
    ContactWarning
        Prescribed displacements push points into one another; an overlap is huge.

    Raises
    ------
    ConstraintError
        Tied points whose relative displacement is prescribed otherwise.
    """
    prescribed = np.count_nonzero(fixed) or np.count_nonzero(kin.bilateral)
    if prescribed:
        x = np.zeros(system.n)
        x[system.D] = case.x[system.D]
        gap = np.where(fixed, np.where(fixed, case.gap0, 0.0) + kin.B_n @ x, np.inf)
        small = SOLVED * max(system.extent, float(np.max(np.abs(x), initial=0.0)))
    for contact, name, part in zip(
        interface.contacts, interface.names, interface.point_slices, strict=True
    ):
        if contact.bilateral:
            _check_tied(system, contact, name, part, kin, case, x, small)
        elif prescribed and np.min(gap[part], initial=np.inf) < -small:
            doubled = int(np.floor(np.log2(-np.min(gap[part]) / small)))
            keys = {("prescribed", f"{name} {k}") for k in range(doubled + 1)}
            if not keys <= said:
                _warn_penetration(contact, name, gap[part], small)
            said = said | keys
        _warn_overlap(contact, name, kin.gap0[part], case.interference[part])
    return said


def _check_tied(
    system: System,
    contact: Contact,
    name: str,
    part: slice,
    kin: Kinematics,
    case: LoadCase,
    x: Array,
    small: float,
) -> None:
    """Points held together that are prescribed on both sides have to be prescribed alike."""
    held = [(kin.B_n, np.where(kin.paired, case.gap0, 0.0) + kin.B_n @ x, 1)]
    if contact.tied:
        held.append((kin.B_t, kin.B_t @ x, kin.tangents))
    words = "ties" if contact.tied else "holds together"
    for B, jump, per_point in held:
        rows = slice(part.start * per_point, part.stop * per_point)
        fixed = prescribed_rows(B[rows], system.D) & np.repeat(kin.paired[part], per_point)
        torn = np.flatnonzero(fixed & (np.abs(jump[rows]) > small))
        if len(torn):
            worst = torn[np.argmax(np.abs(jump[rows])[torn])] // per_point
            raise ConstraintError(
                f"contact '{name}' {words} {len(torn)} points of surface {contact.secondary.label!r} "
                "all of whose DOFs are prescribed, on both sides, with different displacements: "
                f"they differ by {np.max(np.abs(jump[rows])[torn]):.6g} at point {worst} at "
                f"{written(contact.secondary.points[worst])}. Prescribe one side only (D=...), or "
                "both with the same x.",
                torn // per_point,
            )


def _warn_penetration(contact: Contact, name: str, gap: Array, small: float) -> None:
    worst = int(np.argmin(gap))
    warn(
        f"contact '{name}': prescribed displacements push {np.sum(gap < -small)} of {len(gap)} "
        f"points of surface {contact.secondary.label!r} into {contact.primary.label!r}, deepest "
        f"point {worst} at {written(contact.secondary.points[worst])} by {-gap[worst]:.6g}. Prescribed "
        "displacements win: the overlap stays, and the force there is a reaction of D, not a "
        "contact force. Leave these DOFs out of D, or correct x."
    )


def _warn_overlap(contact: Contact, name: str, gap: Array, interference: Array) -> None:
    """Overlaps, by the meshes or an interference, as large as the bodies."""
    deepest = float(np.maximum(-gap, interference).max(initial=0.0))
    if deepest == 0.0:
        return
    size = _smaller_extent(contact)
    if deepest > HUGE * size:
        warn(
            f"contact '{name}' starts with an overlap of {deepest:.6g}, {deepest / size:.2g} "
            f"times the extent of the smaller body ({size:.6g}). The answer is linear, but "
            "strains of this size are not small. Usually a unit or the sign of interference is "
            f"wrong, or {_far_side(contact)}."
        )


def _far_side(contact: Contact) -> str:
    """In words how a primary comes to lie on the wrong side."""
    primary = contact.primary
    outline = primary.outline if isinstance(primary, Obstacle) else None
    if outline is not None and outline.dim == 2:
        return "the points of the polyline run the wrong way round: it is solid on their left"
    return "the primary surface is on the far side of its body"


def _smaller_extent(contact: Contact) -> float:
    """Extent of the smaller of the bodies in contact [length]."""
    bodies = [s.body for s in (contact.secondary, contact.primary) if isinstance(s, ContactSurface)]
    return min(float(np.ptp(body.basis.mesh.p, axis=1).max()) for body in bodies)


def warn_measures(contacts: Sequence[Contact]) -> None:
    """Warn of rings whose stiffness has none or that meet no like ones, and of thick secondaries.

    Warns
    -----
    ContactWarning
    """
    bodies: list[Meshed] = []
    for contact in contacts:
        sides = [s for s in (contact.secondary, contact.primary) if isinstance(s, ContactSurface)]
        bodies += [side.body for side in sides if not any(side.body is known for known in bodies)]
        if len(sides) == 2:
            _compare(contact, *sides)
    for body in bodies:
        if body.axisymmetric and not _has_rings(body):
            warn(
                f"measure of body {body.name!r} grows with x[0], as that of an axisymmetric body, but "
                "K does not resist a growth along x[0]: there are no hoop strains in it, as in that of "
                "a plane body. Pressures are forces over the areas of rings, which those of a plane "
                "body do not act on. Assemble K with hoop strains and the weight 2 pi x[0], or leave "
                "out measure."
            )


def _has_rings(body: Meshed) -> bool:
    """Return whether the stiffness resists that all points move away from the axis."""
    away = (body.dof_component == 0).astype(float)
    forces = np.linalg.norm(body.K @ away)
    return bool(forces > SOLVED * np.linalg.norm(body.K.diagonal() * away))


def _compare(contact: Contact, one: ContactSurface, other: ContactSurface) -> None:
    rings = [side.body.axisymmetric for side in (one, other)]
    if any(rings) and not all(rings):
        plane, ring = (other, one) if rings[0] else (one, other)
        warn(
            f"Contact {contact.label}: {ring.label!r} is of an axisymmetric body (its measure grows "
            f"with x[0]), {plane.label!r} is not: forces on whole rings meet those on a plane body. "
            "All bodies of an axisymmetric problem have the measure, and a K with it."
        )
        return
    x = one.points.T
    measures = [side.body.measure for side in (one, other)]
    weights = [np.broadcast_to(measure(x), x[0].shape) for measure in measures if measure]
    if len(weights) < 2:
        return  # a plane body without a thickness may stand for a wide tool
    differ = np.abs(weights[0] - weights[1]) > GIVEN * np.max(np.abs(weights))
    if all(rings) and differ.any():
        far = int(np.argmax(x[0]))
        ratio = weights[0][far] / weights[1][far]
        warn(
            f"Contact {contact.label}: the measure of {one.label!r} is {ratio:.6g} times that of "
            f"{other.label!r} at the same place: the one may be of a whole ring (2 pi x[0]), and the "
            "other of one radian (x[0]). Forces and stiffnesses of the two are not of the same ring."
        )
    elif not contact.tied and (differ & (weights[0] > weights[1])).any():
        thick, thin = (weight[np.argmax(weights[0] - weights[1])] for weight in weights)
        warn(
            f"Contact {contact.label}: {one.label!r} has the thickness {thick:.6g}, and meets "
            f"{other.label!r} over {thin:.6g} of it. Pressures, stresses of friction and wear are by "
            "the thickness of the secondary: take the thinner side as secondary."
        )
