r"""How far bodies have turned as a whole: the limit of linear bodies under finite sliding.

With finite sliding the frames of the contact points turn with the surfaces; the linear bodies do
not. Their stiffness and loads keep their directions, and a rotation by :math:`\theta` is a strain
:math:`\cos\theta - 1` to them. Forces that contact passes on are off by about :math:`\theta`.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from skfem_contact.answers.thresholds import SECOND_ORDER
from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.bodies.system import System
from skfem_contact.conditions.contact import Contact
from skfem_contact.conditions.geometry import surface_dofs

Array = NDArray[np.float64]


def rigid_rotations(system: System, contacts: Sequence[Contact], surface: Array) -> dict[str, float]:
    """Mean rotation of the surfaces that slide far, by body name [rad], counterclockwise.

    The angle of the rigid motion that is closest to the displacements of all nodes of a body that
    belong to such a surface; in 3-D the size of its rotation vector. Bodies without such a surface are
    left out.

    Parameters
    ----------
    system : System
    contacts : sequence of Contact
    surface : ndarray
        Displacements of the surfaces, in the order of `surface_dofs` [length].
    """
    if not len(surface):  # nothing slides far
        return {}
    dofs = surface_dofs(system, contacts)
    nodes: dict[int, list[tuple[Array, Array]]] = {}
    for contact in contacts:
        for side in (contact.secondary, contact.primary):
            if contact.sliding == "small" or not isinstance(side, ContactSurface):
                continue
            if side.dofs.shape[1] != side.dim:
                continue
            i = system.index(side.body)
            u = surface[np.searchsorted(dofs, system.offsets[i] + side.dofs)]
            nodes.setdefault(i, []).append((side.points, u))
    angles = {}
    for i, pairs in sorted(nodes.items()):
        x = np.concatenate([points for points, _ in pairs])
        y = x + np.concatenate([u for _, u in pairs])
        x, y = x - x.mean(axis=0), y - y.mean(axis=0)
        if x.shape[1] == 3:
            angles[system.names[i]] = _angle(x, y)
            continue
        turned = np.sum(x[:, 0] * y[:, 1] - x[:, 1] * y[:, 0])
        angles[system.names[i]] = float(np.arctan2(turned, np.sum(x * y)))
    return angles


def _angle(x: Array, y: Array) -> float:
    """Of the rotation that brings points (m, 3) closest to others: the polar factor of y'x [rad].

    >>> x = np.array([[1.0, 0, 0], [0, 1, 0], [-1, -1, 0]])
    >>> y = np.array([[0.0, 1, 0], [-1, 0, 0], [1, -1, 0]])
    >>> round(_angle(x, y) / np.pi, 12)
    0.5
    """
    left, _, right = np.linalg.svd(y.T @ x)
    left[:, -1] *= np.sign(np.linalg.det(left) * np.linalg.det(right))  # no mirror image
    turn = left @ right
    vector = np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]])
    return float(np.arctan2(np.linalg.norm(vector), np.trace(turn) - 1))


def leaning(shares: dict[str, float]) -> dict[tuple[str, str], str]:
    """What moments of second order change of rigid bodies' motion, beyond its bound, in words."""
    far = {name: share for name, share in shares.items() if share > SECOND_ORDER}
    return {("second order", name): leaning_words({name: share}) for name, share in far.items()}


def leaning_words(far: dict[str, float]) -> str:
    """That the loads of rigid bodies go along with them further than small sliding has it."""
    listed = " and ".join(f"{name!r} by {100 * share:.3g} %" for name, share in far.items())
    return (
        "Rigid bodies carry their loads along, and contact forces act where the points have moved to: "
        "small sliding, which has the arms of the undeformed place, leaves out the moment of that. It "
        f"would change the motion of {listed} at first, and without end where a body rolls off or "
        "topples. Give its contacts sliding='finite', or hold its rotation by D."
    )


def rotation_words(far: dict[str, float]) -> str:
    """That bodies have turned further than linear elasticity follows, and what to do.

    Parameters
    ----------
    far : dict
        Rotations by body name [rad].
    """
    worst = max(abs(angle) for angle in far.values())
    listed = " and ".join(
        f"'{name}' has turned by {angle:.3g} rad ({np.degrees(angle):.3g} degrees)"
        for name, angle in far.items()
    )
    strain = 1 - np.cos(worst)
    return (
        f"Body {listed}, on the whole. Bodies are linear: "
        f"their stiffness and loads do not turn with them, so a rotation is a strain of {strain:.1g} "
        f"to them, and contact forces, whose directions do turn, are off by about {100 * worst:.0f} %. "
        "Sliding may be large, rotations of deformable bodies may not. Turn the rigid obstacle "
        "instead (motion=...), or rebuild the body in its turned position and continue there."
    )
