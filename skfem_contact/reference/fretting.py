"""Contacts that slip in part, and the energy that they lose.

Tangential loading of smooth contacts (Cattaneo and Mindlin, reversals, sliding as a whole) is between
elastically similar bodies, identical or both incompressible, so that friction does not change the
pressure. Energy is lost by smooth contacts in a cycle, a layered cantilever, a bar between planes.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol, TypeVar

import numpy as np
import scipy  # its parts are imported when they are used
from numpy.typing import ArrayLike, NDArray

from skfem_contact.arguments import not_negative, positive
from skfem_contact.errors import InputError
from skfem_contact.reference.hertz import HertzLine, HertzPoint

Array = NDArray[np.float64]


def tangential_shift_line(contact: HertzLine, mu: float, Q: float, distance: float) -> float:
    """Tangential shift ``μ [δ(P) - δ(P - Q/μ)]`` of a Hertz line on first loading [length].

    Relative to a surface point at `distance`, as the normal approach ``δ`` (Jäger, Ciavarella).
    The loop it makes under a cycle of Q has the area of the dissipation for distant points only,
    to ``(a/distance)²``.

    Examples
    --------
    >>> from skfem_contact.reference import hertz_line
    >>> line = hertz_line(P=1.0, R=1.0, E_star=1.0)
    >>> print(f"{tangential_shift_line(line, mu=0.4, Q=0.4, distance=10 * line.a):.4f}")
    0.8899
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

    Examples
    --------
    >>> beams = layered_cantilever(L=20.0, h=1.0, E=1e5, mu=0.3, p=1.0)
    >>> print(f"{beams.tau} {beams.slip_force:.2f}")
    0.3 0.40
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

    Examples
    --------
    >>> bar = bar_between_planes(half_height=1.0, E=100.0, mu=0.5, p=2.0)
    >>> print(f"{bar.tau} {bar.slip_length(10.0):.1f}")
    1.0 10.0
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


Self = TypeVar("Self", bound="NormalContact")


class NormalContact(Protocol):
    """Normal contact as the theorem of Ciavarella and Jäger needs it, for three shapes."""

    @property
    def P(self) -> float:
        """Load."""

    @property
    def a(self) -> float:
        """Half width or radius of contact."""

    def with_load(self: Self, P: float) -> Self:
        """Return the same profile under another load."""

    def pressure(self, x: ArrayLike, /) -> Array:
        """Pressure at the distance `x` from the middle."""


@dataclass(frozen=True, eq=False)
class PartialSlip:
    """Contact under constant normal and varying tangential force.

    Attributes
    ----------
    contact : HertzLine, HertzPoint or QuarticLine
        The normal contact.
    mu : float
        Coefficient of friction.
    path : tuple of float
        Tangential force [force] from zero through the turning points to the present value.

    Examples
    --------
    >>> from skfem_contact.reference import hertz_line
    >>> line = hertz_line(P=1.0, R=1.0, E_star=1.0)
    >>> partial = cattaneo_mindlin(line, mu=0.4, Q=0.3)
    >>> print(f"{partial.Q} {partial.c / line.a:.4f}")
    0.3 0.5000
    """

    contact: NormalContact
    mu: float
    path: tuple[float, ...]

    @property
    def Q(self) -> float:
        """Present tangential force."""
        return self.path[-1]

    @property
    def c(self) -> float:
        """Half width (or radius) of the zone that has stuck since the last turning point.

        ``c/a = sqrt(1 - Q/(μP))`` for a first loading of a Hertz line, exponents 1/3 for the point
        and 1/4 for the quartic. After a reversal by ``ΔQ`` the front of the counter-slip stands
        at ``sqrt(1 - ΔQ/(2 μP))``.
        """
        return self._reduced(len(self.path) - 2).a

    def _reduced(self, k: int) -> NormalContact:
        """Return the normal contact under ``P - |ΔQ|/(n μ)``, n = 1 virgin, 2 thereafter."""
        share = abs(self.path[k + 1] - self.path[k]) / (1 if k == 0 else 2)
        return self.contact.with_load(max(self.contact.P - share / self.mu, 0.0))

    def traction(self, x: ArrayLike) -> Array:
        """Shear traction in the direction of positive `Q` [stress].

        Sum over the branches of the path of ``± n μ (p_P - p_(P - ΔQ/(n μ)))``, n = 1 for the
        first and 2 for the later ones: for one reversal ``q = q0 - 2 μ [p_P - p_(P - ΔQ/(2 μ))]``.
        """
        q = np.zeros(np.shape(x))
        full = self.contact.pressure(x)
        for k, (before, now) in enumerate(zip(self.path, self.path[1:], strict=False)):
            factor = (1 if k == 0 else 2) * self.mu * np.sign(now - before)
            q = q + factor * (full - self._reduced(k).pressure(x))
        return q


def cattaneo_mindlin(
    contact: NormalContact, mu: float, Q: float, *, after: tuple[float, ...] = ()
) -> PartialSlip:
    r"""Tangential force on a normally loaded contact of similar bodies.

    Cattaneo (1938), Mindlin (1949) for Hertz contacts:
    ``q = μ p0 [sqrt(1 - x²/a²) - (c/a) sqrt(1 - x²/c²)]``, ``c/a = sqrt(1 - Q/(μP))`` (line);
    Jäger (1997), Ciavarella (1998) for any profile: ``q = μ [p_P - p_(P - Q/μ)]``. Johnson (1985),
    sections 7.2 and 7.4.

    Parameters
    ----------
    contact : HertzLine, HertzPoint or QuarticLine
        Normal contact, loaded first and kept.
    mu : float
        Coefficient of friction.
    Q : float
        Present tangential force, any sign [force].
    after : tuple of float
        Turning points passed on the way from zero to `Q`; each range must lie within the one
        before (a wider one forgets it: leave the forgotten points out).

    Raises
    ------
    InputError
        If ``|Q|`` exceeds ``μ P`` or the turning points are not nested.

    Examples
    --------
    >>> from skfem_contact.reference import hertz_line
    >>> h = hertz_line(P=1.0, R=1.0, E_star=1.0)
    >>> print(f"{cattaneo_mindlin(h, mu=0.4, Q=0.2).c / h.a:.6f}")
    0.707107

    Unloaded to zero from 0.2, the contact keeps a self-balanced traction:

    >>> back = cattaneo_mindlin(h, mu=0.4, Q=0.0, after=(0.2,))
    >>> print(f"{back.c / h.a:.6f} {float(back.traction(0.0)):.4f}")
    0.866025 0.0056
    """
    positive(mu=mu)
    path = (0.0, *after, Q)
    steps = np.diff(path)
    limit = mu * contact.P
    # a relative round-off is granted, so that Q = mu*P computed by the user is full slip
    if abs(path[1]) > limit * (1 + 1e-12):
        raise InputError(f"Q = {path[1]} is more than mu*P = {limit}: there is no equilibrium.")
    widths = np.abs(steps)
    if len(steps) > 1:
        bound = np.concatenate([[2 * widths[0]], widths[1:-1]]) * (1 + 1e-12)
        if np.any(widths[1:] > bound) or np.any(steps[:-1] * steps[1:] > 0):
            raise InputError(
                f"after = {after} and Q = {Q} are not nested turning points: every branch must"
                " turn back and stay within the one before."
            )
    return PartialSlip(contact, mu, path)


def cattaneo_mindlin_slip(contact: HertzLine, mu: float, Q: float, x: ArrayLike) -> Array:
    """Slip along the direction of `Q` on first loading of a Hertz line [length].

    ``μ [D_c(x) - D_a(x)]``: difference of the normal surface displacements under ``P - Q/μ`` and
    ``P``, relative to the middle; zero in the stick zone. Meaningful for ``|x| <= a``.

    Examples
    --------
    >>> from skfem_contact.reference import hertz_line
    >>> h = hertz_line(P=1.0, R=1.0, E_star=1.0)
    >>> print(cattaneo_mindlin_slip(h, 0.4, 0.2, [0.5, h.a]).round(6))
    [0.       0.067843]
    """
    q = cattaneo_mindlin(contact, mu, Q)
    inner = contact.with_load(max(contact.P - abs(q.Q) / mu, 0.0))
    slip = mu * (inner.surface_displacement(x) - contact.surface_displacement(x))
    # inside c both terms are the same parabola: exactly zero, not a difference of round-offs
    return np.sign(Q) * np.where(np.abs(x) <= inner.a, 0.0, slip)


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

    Examples
    --------
    >>> from skfem_contact.reference import hertz_line
    >>> line = hertz_line(P=1.0, R=1.0, E_star=1.0)
    >>> slides = capped_sliding(line, mu=1.0, tau_max=0.5 * line.p0)
    >>> print(f"{float(slides.traction(0.0)) / line.p0:.2f} {slides.capped / line.a:.6f}")
    0.50 0.866025
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
    """Torque that turns a Hertz point contact, ``(3π/16) μ P a`` [force length].

    Examples
    --------
    >>> from skfem_contact.reference import hertz_point
    >>> ball = hertz_point(P=4 / 3, R=1.0, E_star=1.0)
    >>> print(f"{sphere_torsion_capacity(ball, mu=0.4):.6f}")
    0.314159
    """
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
