"""How far the sides of a contact give under its forces: by the diagonal of K, or by displacements."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from skfem_contact.answers.answer import Answer
from skfem_contact.answers.thresholds import NO_APPROACH
from skfem_contact.answers.validity.support import Support
from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.pairing.node import Pairing

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]


def soft(size: float, stiff: Array) -> float:
    """Approach of a side under a force, from the diagonal of its K; zero of a rigid one."""
    return float(size / np.median(stiff[stiff > 0])) if (stiff > 0).any() else 0.0


def beyond_round_off(approach: float, extent: float) -> float:
    """An elastic approach, or zero where nothing presses and round-off is what there is [length]."""
    return approach if approach > NO_APPROACH * extent else 0.0


def spared(
    pairing: Pairing, sides: Sequence[ContactSurface], stiff: Sequence[Array], size: Sequence[float]
) -> Array | None:
    """What `soft` of both sides is too much at points whose nodes supports hold, (m,), or None."""
    too_much, any_held = np.zeros(len(pairing.gap)), False
    weights = pairing.secondary_weights, pairing.primary_weights
    for W, side, d, h in zip(weights, sides, stiff, size, strict=False):
        held = side.held.all(axis=1)
        if held.any():
            any_held = True
            total = np.asarray(abs(W).sum(axis=1)).ravel()
            share = np.asarray(abs(W) @ held) / np.where(total > 0, total, 1.0)
            too_much += share * soft(h, d)
    return too_much if any_held else None


def elastic_approach(result: Answer, i: int, closed: Mask, displacement: Array | None = None) -> float:
    """What bodies take up at closed points, less their supports' rigid motions; 0 where they float.

    Takes the displacements (n,) of all bodies, or some that are right on surfaces and at supports.

    The force over the diagonal of K, which is all that is known without the interior, is far less in
    bodies that are nearly incompressible.
    """
    contact, part, system = result.contacts[i], result.slices()[i], result.system
    sides = [contact.secondary] if contact.rigid else [contact.secondary, contact.primary]
    u = result.u if displacement is None else displacement
    elastic = np.array(u)
    for body in {id(side.body): side.body for side in sides}.values():  # type: ignore[union-attr]
        support = Support.of(body, 0)
        if not support.holds(contact.secondary.points[closed], result.kin.normal[part][closed]):
            return 0.0
        rigid = support.at(body.dof_points, support.motion(u[system.slice(body)]))
        elastic[system.slice(body)] -= rigid[np.arange(body.n), body.dof_component]
    if contact.rigid_body is not None:
        own = Support.of(contact.rigid_body, 0, arm=system.extent)
        if not own.holds(contact.secondary.points[closed], result.kin.normal[part][closed]):
            return 0.0
        elastic[system.slice(contact.rigid_body)] = 0.0
    lifted = (result.kin.B_n[part] @ elastic)[closed]
    return float(np.max(np.abs(lifted), initial=0.0))
