"""Sentences of warnings and reports: what is wrong where the model does not hold, what to do."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from skfem_contact.answers.thresholds import A_TENTH, LOCKED
from skfem_contact.answers.validity.deformed_boundaries import Meeting
from skfem_contact.answers.validity.edges import Crossing
from skfem_contact.answers.validity.validity import ContactValidity, Drift
from skfem_contact.bodies.body import Body
from skfem_contact.bodies.selection import written
from skfem_contact.conditions.contact import Contact
from skfem_contact.obstacles.obstacle import Obstacle


def sliding_words(drift: Drift, turning: Sequence[str] = ()) -> str:
    """Say what small sliding does wrong, and what to do; with linear bodies that turn."""
    found = []
    if drift.slides_far:
        found.append(
            f"points have slid by up to {drift.slip:.3g}, {drift.facets:.3g} facets of the primary "
            f"and {drift.widths:.3g} times the width of the contact, and press where they began"
        )
    if drift.slides_far and drift.beyond:
        found.append(
            f"{drift.beyond} of {drift.closed} closed points lie beyond the end of the primary "
            f"surface, by up to {drift.overhang:.3g}"
        )
    if drift.passes_end:
        found.append(
            f"{100 * drift.beyond_share:.3g} % of the normal force acts beyond the end of the primary "
            f"surface (slip {drift.slip:.3g}, {drift.facets:.3g} facets)"
        )
    if drift.tilt > A_TENTH:
        found.append(f"normals are off by up to {drift.tilt:.3g} rad, and so are the forces")
    if drift.off_arc > A_TENTH:
        found.append(
            "the obstacle has turned, and slip, which is taken along the chord to where it has come, "
            f"is {100 * drift.off_arc:.3g} % off the arc that has passed under the points: friction "
            "points the wrong way"
        )
    if drift.gap_share > A_TENTH:
        found.append(
            f"gaps are wrong by up to {drift.gap_error:.3g}, {100 * drift.gap_share:.3g} % of the "
            f"elastic approach of {drift.approach:.3g}, and forces by as much"
        )
    if drift.motion and not drift.slides_far:
        found.append(f"the obstacle has moved by {drift.motion:.3g}")
    out = "Give the contact sliding='finite'."
    if turning:
        names = ", ".join(map(repr, turning))
        out = (
            f"A linear body that turns, as {names} does, has wrong torques with sliding='finite' as "
            "well: take a NonlinearBody or a RigidBody in its place, and sliding='finite' in all of "
            "its contacts."
        )
    return (
        "small sliding, which keeps partners, normals and gaps of the undeformed bodies, does not "
        "follow: " + "; ".join(found) + f". {out}"
    )


def facet_words(drift: Drift, rigid: bool = False) -> str:
    """Say what long facets on curves do to a light contact, and what to do."""
    if rigid:
        return (
            f"over the length of one facet the two sides stand {drift.sagitta:.3g} off each other, "
            f"{100 * drift.sagitta_share:.3g} % of the elastic approach of {drift.approach:.3g}: the "
            "contact is about as small as a facet, and what it carries depends on where the nodes are. "
            "Pressures are not resolved, and forces that follow from prescribed displacements may be "
            f"wrong by {'a large factor' if drift.sagitta_share > 1 else 'tens of percent'}. Refine "
            "the surface where it touches, to four nodes or more under the contact."
        )
    # a body rests on one facet or on the next where it is pressed in by less than what they stand out
    several = "There may be several answers, one for each facet that can carry. "
    return (
        f"over the length of one facet the curves stand {drift.sagitta:.3g} off each other, "
        f"{100 * drift.sagitta_share:.3g} % of the elastic approach of {drift.approach:.3g}: contact "
        "ends within the facets, and polygons meet elsewhere than curves do. Pressures there are not "
        "resolved, and forces that follow from prescribed displacements may be wrong by a large "
        f"factor. {several if drift.sagitta_share > 1 else ''}Refine both surfaces where they touch."
    )


def strain_words(name: str, strain: float) -> str:
    """Say what linear elasticity does wrong, and what to do."""
    return (
        f"Body {name!r} is strained by about {strain:.2g} where most of its energy is. Its equations "
        f"are those of small strains: errors are of that order, {100 * strain:.0f} %. Check units, "
        "load and modulus; large strains need a NonlinearBody with a material of finite strain."
    )


def overlap_words(part: ContactValidity, contact: Contact, meeting: Meeting, way: str = "") -> str:
    """Say that bodies overlap where contact conditions do not see it, where, and what to do."""
    place = ""
    if meeting.place is not None:
        own, other = contact.secondary.label, contact.primary.label
        own, other = (own, other) if meeting.side == 0 else (other, own)
        place = f", at {written(meeting.place)}, where {own!r} lies in the body of {other!r}"
    lonely = f", {part.unseen} points without partner among them" if part.unseen else ""
    return (
        f"the deformed bodies overlap by up to {part.overlap:.3g}{place}{lonely}, where chords explain "
        f"{part.chords:.2g} and the bodies take up {part.drift.approach:.3g}. Contact conditions do "
        f"not see it. {way or _way_out(part, contact, meeting) + '.'}"
    )


def prescribed_words(part: ContactValidity) -> str:
    """Say that supports push bodies into each other."""
    return (
        f"the deformed bodies overlap by up to {part.overlap:.3g}: prescribed displacements push them "
        "into each other, where contact can do nothing. Change the supports, or take their points out "
        "of the contact."
    )


def _way_out(part: ContactValidity, contact: Contact, meeting: Meeting) -> str:
    """Return what to do about an overlap."""
    if contact.sliding == "finite":
        mortar = ", method='mortar'" if contact.method == "node" and not contact.rigid else ""
        return (
            f"Take smaller steps, a finer or quadratic mesh where the surfaces turn{mortar}, and see "
            "that both surfaces cover all that may touch"
        )
    if part.unseen:
        far = "Enlarge `reach`, or give" if contact.reach is not None else "Give"
        return f"{far} the contact sliding='finite'"
    if isinstance(contact.primary, Obstacle):
        finer = "Refine the surface, whose facets are too long for what presses between their nodes"
        if meeting.side == 0:
            return finer
        drawn = f"Where the straight pieces of {contact.primary.label!r} stand for a curve (STL), give it"
        return f"{drawn} shorter ones, four or more across the contact. Otherwise: {finer.lower()}"
    if part.drift.slip >= part.overlap:  # a slip goes no deeper than it is long
        return "Give the contact sliding='finite'"
    if contact.method == "node":
        return (
            "Nodes of the primary surface sink in between those of the secondary one where that is the "
            "coarser: swap the two, or take method='mortar'; and see that both surfaces cover all that "
            "may touch"
        )
    if meeting.outward is not None:
        way = "take method='node'" if meeting.side == 0 else "swap the two"
        return (
            "Conditions hold in the mean over facets, in which a node may stand: refine the larger "
            f"ones, or {way}, and see that both surfaces cover all that may touch"
        )
    return "See that both surfaces cover all that may touch, and refine them where they do"


def rotation_words(name: str, angle: float) -> str:
    """Say that a body has turned further than linear elasticity follows, and what to do."""
    return (
        f"Body {name!r} has turned by {angle:.3g} rad ({np.degrees(angle):.3g} degrees), on the whole. "
        "Bodies are linear: their stiffness and loads do not turn with them, so a rotation is a strain "
        f"of {1 - np.cos(angle):.1g} to them, and contact forces, whose directions do turn, are off by "
        f"about {100 * angle:.0f} %. Sliding may be large, rotations of deformable bodies may not. "
        "Turn the rigid obstacle instead (motion=...), or rebuild the body in its turned position and "
        "continue there."
    )


def locking_words(name: str, body: Body, share: float) -> str:
    """Say that a body locks, why, and what to do; empty where it does not."""
    if share <= LOCKED:
        return ""
    assert body.moduli is not None
    ratio = body.moduli.quotient
    where = (
        f"{100 * share:.0f} % of its energy is in changes of volume that take turns from one element, "
        "or point of integration, to the next"
    )
    factor = f"about {1 / (1 - min(share, 0.99)):.2g} times too large, or more"
    if share == 1.0:
        where = "pressure and shear take turns from one element to the next, and no volume changes"
        factor = "twice to a hundred times too large"
    return (
        f"Body {name!r} locks: {where}. Its material, of a bulk modulus {ratio:.3g} times the shear "
        "modulus, hardly changes its volume, and elements of first order keep theirs by hardly moving: "
        f"the forces of prescribed displacements are {factor}. Take elements of second order, or "
        "hexahedra (quadrilaterals) with the part of the bulk modulus integrated at one point."
    )


def crossing_words(found: Crossing, secondary: str, primary: str) -> str:
    """Say which edges of solids cross where no row sees it, and what to change."""
    at = written(found.place)
    if found.count:
        return (
            f"{found.count} edges of {secondary!r} and {primary!r} cross inside each other, by up "
            f"to {found.depth:.3g} at {at}: no condition holds where edges meet between their nodes, "
            "and nothing presses there. Refine both sides at the edges, so that nodes come close to "
            "where they cross, or round the edges off by faces that turn by less than 45 degrees."
        )
    return (
        f"edges of {secondary!r} and {primary!r} meet at {at}, where forces act along normals "
        "of faces and not across both edges: their size and direction are wrong. Round the "
        "edges off by faces that turn by less than 45 degrees, or take method='mortar'."
    )
