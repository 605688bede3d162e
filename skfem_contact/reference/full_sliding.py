"""Contacts that slide or turn as a whole: friction with a cap, and the torque that they bear."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from skfem_contact.errors import InputError
from skfem_contact.reference._check import not_negative, positive
from skfem_contact.reference.hertz import HertzLine, HertzPoint

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class CappedSliding:
    """Sliding Hertz contact whose traction is limited, ``q = min(μ p, tau_max)``.

    Attributes
    ----------
    contact : HertzLine or HertzPoint
        The normal contact.
    mu, tau_max : float
        Coefficient of friction, largest traction [stress].
    Q : float
        Tangential force at full sliding [force].
    capped : float
        Half width or radius of the zone where the cap holds [length].
    """

    contact: HertzLine | HertzPoint
    mu: float
    tau_max: float
    Q: float
    capped: float

    def traction(self, x: ArrayLike) -> Array:
        """Traction ``min(μ p, tau_max)`` [stress]."""
        return np.minimum(self.mu * self.contact.pressure(x), self.tau_max)


def capped_sliding(contact: HertzLine | HertzPoint, mu: float, tau_max: float) -> CappedSliding:
    """Full sliding of a Hertz contact under Coulomb's law with a cap.

    With ``s = tau_max/(μ p0) < 1`` the cap holds up to ``a sqrt(1 - s²)`` and ``Q/(μP)`` is
    ``(2/π) (asin s + s sqrt(1 - s²))`` for the line, ``1.5 s - 0.5 s³`` for the point.

    Examples
    --------
    >>> from skfem_contact.reference import hertz_line, hertz_point
    >>> line, point = hertz_line(1.0, 1.0, 1.0), hertz_point(1.0, 1.0, 1.0)
    >>> print(f"{capped_sliding(line, 1.0, 0.5 * line.p0).Q:.6f}")
    0.608998
    >>> print(f"{capped_sliding(point, 1.0, 0.5 * point.p0).Q:.6f}")
    0.687500
    """
    positive(mu=mu)
    not_negative(tau_max=tau_max)
    s = min(tau_max / (mu * contact.p0), 1.0)
    root = math.sqrt(1 - s**2)
    if isinstance(contact, HertzLine):
        share = 2 / math.pi * (math.asin(s) + s * root)
    else:
        share = 1.5 * s - 0.5 * s**3
    return CappedSliding(contact, mu, tau_max, mu * contact.P * share, contact.a * root)


def sphere_torsion_capacity(contact: HertzPoint, mu: float) -> float:
    """Torque that turns a Hertz point contact, ``(3π/16) μ P a`` [force length]."""
    return 3 * math.pi / 16 * mu * contact.P * contact.a


def annulus_torsion_capacity(P: float, mu: float, Ri: float, Ro: float) -> float:
    """Torque that turns a uniformly loaded flat ring, ``(2/3) μ P (Ro³-Ri³)/(Ro²-Ri²)``.

    Examples
    --------
    >>> round(annulus_torsion_capacity(1.0, 1.0, 1.0, 2.0), 6)
    1.555556
    """
    if not 0 <= Ri < Ro:
        raise InputError(f"Ri = {Ri} must lie between 0 and Ro = {Ro}.")
    return 2 / 3 * mu * P * (Ro**3 - Ri**3) / (Ro**2 - Ri**2)
