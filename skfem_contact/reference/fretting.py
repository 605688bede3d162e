"""Tangential shift of smooth contacts, and the energy that a cycle of it costs.

As in `partial_slip`, contacts are between elastically similar bodies.
"""

from __future__ import annotations

import math

import numpy as np
import scipy  # its parts are imported when they are used

from skfem_contact.errors import InputError
from skfem_contact.reference._check import positive
from skfem_contact.reference.hertz import HertzLine, HertzPoint
from skfem_contact.reference.partial_slip import NormalContact


def tangential_shift_line(contact: HertzLine, mu: float, Q: float, distance: float) -> float:
    """Tangential shift ``μ [δ(P) - δ(P - Q/μ)]`` of a Hertz line on first loading [length].

    Relative to a surface point at `distance`, as the normal approach ``δ`` (Jäger, Ciavarella).
    The loop it makes under a cycle of Q has the area of the dissipation for distant points only,
    to ``(a/distance)²``.
    """
    _load_ratio(contact, mu, Q)
    inner = contact.with_load(max(contact.P - abs(Q) / mu, 0.0))
    lost = inner.approach(distance) if inner.P > 0 else 0.0
    return math.copysign(mu * (contact.approach(distance) - lost), Q)


def _load_ratio(contact: NormalContact, mu: float, Q: float) -> float:
    """``x = |Q|/(μP)``, at most 1; more is refused, for there is no equilibrium."""
    positive(mu=mu)
    x = abs(Q) / (mu * contact.P)
    if x > 1 + 1e-12:
        raise InputError(f"|Q| = {abs(Q)} is more than mu*P = {mu * contact.P}.")
    return min(x, 1.0)


def fretting_dissipation_line(contact: HertzLine, mu: float, Q0: float) -> float:
    r"""Energy lost per cycle ``-Q0 ... Q0`` in a Hertz line contact [force length/length].

    ``W = (4/π) (μP)²/E* [x - x²/2 + (1 - x) ln(1 - x)]``, ``x = Q0/(μP)``: twice the integral of
    traction times slip; independent of the logarithmic constant of the half plane.

    Examples
    --------
    >>> from skfem_contact.reference import hertz_line
    >>> h = hertz_line(P=1.0, R=1.0, E_star=1.0)
    >>> print([round(fretting_dissipation_line(h, 1.0, Q), 8) for Q in (0.2, 0.4, 0.6, 0.8, 1.0)])
    [0.00189096, 0.01719462, 0.06809757, 0.20131498, 0.63661977]
    """
    x = _load_ratio(contact, mu, Q0)
    if x < 0.1:  # the bracket cancels to x³/6 + x⁴/12 + ...
        k = np.arange(3, 25)
        bracket = float(np.sum(x**k / (k * (k - 1))))
    else:
        bracket = x - x**2 / 2 + float(scipy.special.xlogy(1 - x, 1 - x))
    return 4 / math.pi * (mu * contact.P) ** 2 / contact.E_star * bracket


def mindlin_compliance(G1: float, nu1: float, G2: float = math.inf, nu2: float = 0.0) -> float:
    """``(2 - nu1)/G1 + (2 - nu2)/G2``, the tangential compliance of two spheres [1/stress].

    Examples
    --------
    >>> print(f"{mindlin_compliance(1.0, 0.3, 1.0, 0.3):.1f}")
    3.4
    """
    positive(G1=G1, G2=G2)
    return (2 - nu1) / G1 + (2 - nu2) / G2


def mindlin_shift(contact: HertzPoint, mu: float, Q: float, compliance: float) -> float:
    """Tangential shift of two spheres on first loading [length].

    ``3 μ P/(16 a) S [1 - (1 - x)^(2/3)]``, ``x = Q/(μP)``, ``S`` from `mindlin_compliance`.
    Mindlin (1949); Johnson eq. (7.42). Neglects the small slip across the direction of Q.

    Examples
    --------
    >>> from skfem_contact.reference import hertz_point
    >>> h = hertz_point(P=4 / 3, R=1.0, E_star=1.0)
    >>> print(f"{mindlin_shift(h, 0.5, 2 / 3, compliance=4.0):.4f}")
    0.5000
    """
    x = _load_ratio(contact, mu, Q)
    full = 3 * mu * contact.P / (16 * contact.a) * compliance
    # 1 - (1-x)^(2/3) without cancellation for small x
    share = 1.0 if x == 1 else -math.expm1(2 / 3 * math.log1p(-x))
    return math.copysign(full * share, Q)


def mindlin_dissipation(contact: HertzPoint, mu: float, Q0: float, compliance: float) -> float:
    r"""Energy lost per cycle ``-Q0 ... Q0`` between two spheres [force length].

    ``9 (μP)²/(10 a) S {1 - (1-x)^(5/3) - (5x/6) [1 + (1-x)^(2/3)]}``; for small ``Q0``
    ``S Q0³/(36 a μ P)``. Mindlin & Deresiewicz (1953); Johnson eq. (7.57). Prints differ in the
    prefactor: this one is the Masing loop of `mindlin_shift`.

    Examples
    --------
    >>> from skfem_contact.reference import hertz_point
    >>> h = hertz_point(P=4 / 3, R=1.0, E_star=1.0)
    >>> print(f"{mindlin_dissipation(h, 0.75, 0.01, compliance=4.0) / (4e-6 / 36):.4f}")
    1.0067
    """
    x = _load_ratio(contact, mu, Q0)
    if x < 0.1:  # binomial series: the bracket cancels to (5/162) x³ + ...
        k = np.arange(3, 25)
        bracket = float(np.sum(5 / 6 * (-x) ** k * scipy.special.binom(2 / 3, k - 1) * (1 - 2 / k)))
    else:
        y = 1 - x
        bracket = 1 - y ** (5 / 3) - 5 * x / 6 * (1 + y ** (2 / 3))
    return 9 * (mu * contact.P) ** 2 / (10 * contact.a) * compliance * bracket
