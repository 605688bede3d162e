"""A surface that begins where its obstacle is solid, and does not touch it: `hollow` by mistake.

Finite sliding looks for partners anew in every step, so a point without one is no mistake: it may come
to meet the obstacle yet. But where all of a surface is in the solid from the beginning, and nothing of
it finds what it could touch, the obstacle is taken for its own inverse. (With small sliding points that
find nobody are refused.) A closed outline may offer its far side instead: its gaps are open, where the
points are in the solid.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from skfem_contact.answers.validity.meeting import signed_distance
from skfem_contact.conditions.contact import Contact
from skfem_contact.digits import SOLVED
from skfem_contact.obstacles.obstacle import Obstacle
from skfem_contact.obstacles.rigid_body import shape_of
from skfem_contact.pairing.node import Pairing

Array = NDArray[np.float64]


def depth_behind(contact: Contact, pairing: Pairing) -> float:
    """How deep a surface lies in the solid of its obstacle, all of it and unseen; zero if it does not.

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


def behind_words(contact: Contact, depth: float) -> str:
    """That a surface lies in the solid of its obstacle, and what to do."""
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
