"""Structures that lose energy by slip: layered cantilever, bar between rough planes."""

from __future__ import annotations

from dataclasses import dataclass

from skfem_contact.errors import InputError
from skfem_contact.reference._check import not_negative, positive


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
