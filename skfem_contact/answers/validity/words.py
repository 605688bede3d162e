"""What is wrong where the model does not hold, and what to do: sentences of warnings and reports."""

from __future__ import annotations

from skfem_contact.answers.thresholds import GAP, TILT
from skfem_contact.answers.validity.drift import Drift
from skfem_contact.answers.validity.validity import ContactValidity
from skfem_contact.conditions.contact import Contact
from skfem_contact.obstacles.obstacle import Obstacle


def sliding_words(drift: Drift) -> str:
    """What small sliding does wrong, and what to do."""
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
    if drift.tilt > TILT:
        found.append(f"normals are off by up to {drift.tilt:.3g} rad, and so are the forces")
    if drift.off_arc > TILT:
        found.append(
            "the obstacle has turned, and slip, which is taken along the chord to where it has come, "
            f"is {100 * drift.off_arc:.3g} % off the arc that has passed under the points: friction "
            "points the wrong way"
        )
    if drift.gap_share > GAP:
        found.append(
            f"gaps are wrong by up to {drift.gap_error:.3g}, {100 * drift.gap_share:.3g} % of the "
            f"elastic approach of {drift.approach:.3g}, and forces by as much"
        )
    if drift.motion and not drift.slides_far:
        found.append(f"the obstacle has moved by {drift.motion:.3g}")
    return (
        "small sliding, which keeps partners, normals and gaps of the undeformed bodies, does not "
        "follow: " + "; ".join(found) + ". Give the contact sliding='finite'."
    )


def facet_words(drift: Drift, rigid: bool = False) -> str:
    """What long facets on curves do to a light contact, and what to do."""
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
    """What linear elasticity does wrong, and what to do."""
    return (
        f"Body {name!r} is strained by about {strain:.2g} where most of its energy is. Bodies are "
        f"linear: errors are of that order, {100 * strain:.0f} %. Check units, load and modulus; large "
        "strains need a body that is linearised in each step (solver.update)."
    )


def overlap_words(part: ContactValidity, contact: Contact, found: tuple[str, str] | None) -> str:
    """That bodies overlap where contact conditions do not see it, and what to do.

    `found`: where the deepest point lies, and what to do about it, where that is known.
    """
    place, way = found or ("", "")
    lonely = f", {part.unseen} points without partner among them" if part.unseen else ""
    return (
        f"the deformed bodies overlap by up to {part.overlap:.3g}{place}{lonely}, where chords explain "
        f"{part.chords:.2g} and the bodies take up {part.drift.approach:.3g}. Contact conditions do "
        f"not see it. {way or _way_out(part, contact) + '.'}"
    )


def prescribed_words(part: ContactValidity) -> str:
    """That supports push bodies into each other."""
    return (
        f"the deformed bodies overlap by up to {part.overlap:.3g}: prescribed displacements push them "
        "into each other, where contact can do nothing. Change the supports, or take their points out "
        "of the contact."
    )


def _way_out(part: ContactValidity, contact: Contact) -> str:
    """What to do about an overlap."""
    if contact.sliding == "finite":
        return (
            "Take smaller steps, a finer or quadratic mesh where the surfaces turn, and see that both "
            "surfaces cover all that may touch"
        )
    if part.unseen:
        far = "Enlarge `reach`, or give" if contact.reach is not None else "Give"
        return f"{far} the contact sliding='finite'"
    if isinstance(contact.primary, Obstacle):
        return "Refine the surface, whose facets are too long for what presses between their nodes"
    if part.drift.slip >= part.overlap:  # a slip goes no deeper than it is long
        return "Give the contact sliding='finite'"
    if contact.method == "node":
        return (
            "Nodes of the primary surface sink in between those of the secondary one where that is the "
            "coarser: swap the two, or take method='mortar'; and see that both surfaces cover all that "
            "may touch"
        )
    return "See that both surfaces cover all that may touch, and refine them where they do"
