"""Tangential loading of smooth contacts: Cattaneo and Mindlin, reversals, and sliding as a whole.

Contacts that slip in part are between elastically similar bodies (identical, or both incompressible),
so that friction does not change the pressure.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from skfem_contact.errors import InputError
from skfem_contact.reference._check import not_negative, positive
from skfem_contact.reference.hertz import HertzLine, HertzPoint

Array = NDArray[np.float64]
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
