"""How far the sides of a contact give under its forces, by the diagonal of K."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.pairing.node import Pairing

Array = NDArray[np.float64]


def soft(size: float, stiff: Array) -> float:
    """Approach of a side under a force, from the diagonal of its K; zero of a rigid one."""
    return float(size / np.median(stiff[stiff > 0])) if (stiff > 0).any() else 0.0


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
