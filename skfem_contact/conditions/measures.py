"""Whether bodies that meet have the same idea of a ring: the weights of axisymmetric bodies."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from skfem_contact.bodies.member import Meshed
from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.conditions.contact import Contact
from skfem_contact.digits import GIVEN, SOLVED
from skfem_contact.errors import warn


def warn_measures(contacts: Sequence[Contact]) -> None:
    """Warn of axisymmetric bodies whose stiffness has no rings, or that meet bodies of another kind.

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
    """Whether the stiffness resists that all points move away from the axis."""
    away = (body.dof_component == 0).astype(float)
    forces = np.linalg.norm(body.K @ away)
    return bool(forces > SOLVED * np.linalg.norm(body.K.diagonal() * away))


def _compare(contact: Contact, one: ContactSurface, other: ContactSurface) -> None:
    rings = [side.body.axisymmetric for side in (one, other)]
    if not any(rings):
        return  # plane bodies may have thicknesses of their own
    if not all(rings):
        plane, ring = (other, one) if rings[0] else (one, other)
        warn(
            f"Contact {contact.label}: {ring.label!r} is of an axisymmetric body (its measure grows "
            f"with x[0]), {plane.label!r} is not: forces on whole rings meet those on a plane body. "
            "All bodies of an axisymmetric problem have the measure, and a K with it."
        )
        return
    x = one.points.T
    weights = [
        np.asarray(side.body.measure(x), dtype=float) for side in (one, other) if side.body.measure
    ]
    if np.max(np.abs(weights[0] - weights[1])) > GIVEN * np.max(np.abs(weights)):
        far = int(np.argmax(x[0]))
        ratio = (
            np.broadcast_to(weights[0], x[0].shape)[far] / np.broadcast_to(weights[1], x[0].shape)[far]
        )
        warn(
            f"Contact {contact.label}: the measure of {one.label!r} is {ratio:.6g} times that of "
            f"{other.label!r} at the same place: the one may be of a whole ring (2 pi x[0]), and the "
            "other of one radian (x[0]). Forces and stiffnesses of the two are not of the same ring."
        )
