"""Energy lost by slip: of smooth contacts in a cycle, of a layered cantilever, of a bar between planes.

As in `partial_slip`, smooth contacts are between elastically similar bodies.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import scipy  # its parts are imported when they are used

from skfem_contact.errors import InputError
from skfem_contact.reference._check import not_negative, positive
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


@dataclass(frozen=True, eq=False)
class LayeredCantilever:
    """Two equal beams clamped together by pressure, loaded at the tip.

    Attributes
    ----------
    L, h, E : float
        Length, depth of each beam [length], modulus [stress].
    tau : float
        Traction at which the interface slips, ``min(μ p, tau_max)`` [stress].
    """

    L: float
    h: float
    E: float
    tau: float

    @property
    def slip_force(self) -> float:
        """Tip force ``(4/3) tau h`` at which the whole interface slips [force/length]."""
        return 4 / 3 * self.tau * self.h

    @property
    def stiffness(self) -> float:
        """Tip stiffness ``2 E h³/L³`` before slip (Bernoulli); a quarter of it in slip."""
        return 2 * self.E * self.h**3 / self.L**3

    def shear_stiffness(self, nu: float) -> float:
        """Tip stiffness before slip of Timoshenko's beam, shear factor 6/5."""
        G = self.E / (2 * (1 + nu))
        return 1 / (1 / self.stiffness + 1.2 * self.L / (G * 2 * self.h))

    def tip(self, force: float) -> float:
        """Deflection of the tip on first loading, ``2 L³ (F - tau h)/(E h³)`` in slip [length]."""
        if abs(force) <= self.slip_force:
            return force / self.stiffness
        sign = 1 if force > 0 else -1
        rest = force - sign * self.tau * self.h
        return 2 * self.L**3 * rest / (self.E * self.h**3)

    def dissipation(self, force: float) -> float:
        """Energy lost per cycle ``-force ... force``, ``12 F_s (F - F_s)/k`` [energy/length]."""
        excess = max(abs(force) - self.slip_force, 0.0)
        return 12 * self.slip_force * excess / self.stiffness


def layered_cantilever(
    L: float, h: float, E: float, mu: float, p: float, tau_max: float = float("inf")
) -> LayeredCantilever:
    """Slip damping of two clamped beams (Goodman & Klumpp 1956), per unit thickness, nu = 0.

    Parameters
    ----------
    L, h : float
        Length of the beams, depth of each [length].
    E : float
        Modulus [stress].
    mu, p, tau_max : float
        Coefficient of friction, uniform clamping pressure [stress], cap of the traction [stress].

    Examples
    --------
    >>> beams = layered_cantilever(L=20.0, h=1.0, E=1e5, mu=0.3, p=1.0)
    >>> print(f"{beams.slip_force:.2f} {beams.stiffness:.1f} {beams.shear_stiffness(0.0):.4f}")
    0.40 25.0 24.8509
    >>> print(f"{beams.tip(0.8):.4f} {beams.dissipation(0.8):.6f}")
    0.0800 0.076800
    """
    positive(L=L, h=h, E=E)
    not_negative(mu=mu, p=p, tau_max=tau_max)
    return LayeredCantilever(L, h, E, min(mu * p, tau_max))


@dataclass(frozen=True, eq=False)
class BarBetweenPlanes:
    """Long bar between two rough rigid planes, pulled at its end (shear lag).

    Attributes
    ----------
    half_height, E : float
        Half height of the bar [length], modulus [stress].
    tau : float
        Traction ``μ p`` on each plane [stress].
    """

    half_height: float
    E: float
    tau: float

    def slip_length(self, force: float) -> float:
        """Length ``F/(μ p)`` of bar that slips; `force` per half height and thickness [length]."""
        return abs(force) / self.tau

    def pull(self, force: float, turned_at: float | None = None) -> float:
        """Displacement of the end [length].

        ``δ(F) = F |F|/(2 μ p E h)`` on first loading; after a turn at `turned_at` the branch
        ``δ(F0) - 2 δ((F0 - F)/2)``, which leaves half the displacement at ``F = 0``.
        """
        scale = 2 * self.tau * self.E * self.half_height
        if turned_at is None:
            return force * abs(force) / scale
        if abs(force) > abs(turned_at):
            raise InputError(f"force = {force} lies outside the turning point {turned_at}.")
        return self.pull(turned_at) - 2 * self.pull((turned_at - force) / 2)

    def dissipation(self, force: float) -> float:
        """Energy lost per cycle ``-F ... F``, ``(4/3) F³/(2 μ p E h)`` (half model) [energy]."""
        return 4 / 3 * abs(force) * abs(self.pull(force))


def bar_between_planes(half_height: float, E: float, mu: float, p: float) -> BarBetweenPlanes:
    """Bar gripped by rough planes, uniform pressure, nu = 0; error ``O(half_height/slip_length)``.

    Examples
    --------
    >>> bar = bar_between_planes(half_height=1.0, E=100.0, mu=0.5, p=2.0)
    >>> print(bar.slip_length(10.0), bar.pull(10.0), bar.pull(0.0, turned_at=10.0))
    10.0 0.5 0.25
    >>> print(round(bar.dissipation(10.0), 6))
    6.666667
    """
    positive(half_height=half_height, E=E, mu=mu, p=p)
    return BarBetweenPlanes(half_height, E, mu * p)
