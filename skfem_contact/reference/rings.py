"""Concentric rings (Lamé): press fits and external pressure; torque; Persson's pin in a hole."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy  # its parts are imported when they are used
from numpy.typing import ArrayLike, NDArray

from skfem_contact.arguments import not_negative, poisson, positive
from skfem_contact.errors import InputError
from skfem_contact.reference.hertz import effective_modulus

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Ring:
    """Elastic ring ``a <= r <= b`` under pressure on both rims (Lamé 1852).

    Attributes
    ----------
    a, b : float
        Radii; ``a = 0`` is a solid disc [length].
    p_a, p_b : float
        Pressures on the inner and outer rim [stress].
    E, nu : float
        Constants of plane stress; for plane strain ``E/(1-ν²)`` and ``ν/(1-ν)``.

    Examples
    --------
    >>> ring = Ring(a=1.0, b=2.0, p_a=3.0, p_b=0.0, E=100.0, nu=0.3)
    >>> print(ring.hoop_stress(1.0), ring.radial_stress(1.0))
    5.0 -3.0
    """

    a: float
    b: float
    p_a: float
    p_b: float
    E: float
    nu: float

    def _constants(self) -> tuple[float, float]:
        """``σ_r = c0 - c1/r²``."""
        area = self.b**2 - self.a**2
        c0 = (self.p_a * self.a**2 - self.p_b * self.b**2) / area
        return c0, (self.p_a - self.p_b) * self.a**2 * self.b**2 / area

    def displacement(self, r: ArrayLike) -> Array:
        """Radial displacement ``[(1-ν) c0 r + (1+ν) c1/r]/E`` [length]."""
        r = np.asarray(r, dtype=float)
        c0, c1 = self._constants()
        return ((1 - self.nu) * c0 * r + (1 + self.nu) * _over(c1, r)) / self.E

    def radial_stress(self, r: ArrayLike) -> Array:
        """Radial stress, tension positive [stress]."""
        c0, c1 = self._constants()
        return c0 - _over(c1, np.asarray(r, dtype=float) ** 2)

    def hoop_stress(self, r: ArrayLike) -> Array:
        """Hoop stress, tension positive [stress]."""
        c0, c1 = self._constants()
        return c0 + _over(c1, np.asarray(r, dtype=float) ** 2)


def _over(c1: float, power: Array) -> Array:
    """``c1 / power``, zero for the solid disc, also in its centre."""
    return np.zeros_like(power) if c1 == 0 else c1 / power


@dataclass(frozen=True, eq=False)
class ConcentricRings:
    """Two rings in contact at ``r = Rc``.

    Attributes
    ----------
    inner, outer : Ring
        The rings with all their pressures; displacements and stresses are theirs.
    pressure : float
        Contact pressure, zero if the rings do not touch [stress].
    gap : float
        Clearance left, zero if they touch [length].

    Examples
    --------
    >>> steel = (200e3, 0.3)
    >>> fit = lame_rings(1.0, 2.0, 3.0, steel, steel, interference=2e-3)
    >>> print(f"{fit.outer.hoop_stress(2.0) / fit.pressure:.2f} {fit.gap}")
    2.60 0.0
    """

    inner: Ring
    outer: Ring
    pressure: float
    gap: float


def lame_rings(
    Ri: float,
    Rc: float,
    Ro: float,
    inner: Sequence[float],
    outer: Sequence[float],
    *,
    interference: float = 0.0,
    p_inner: float = 0.0,
    p_outer: float = 0.0,
    plane: str = "strain",
) -> ConcentricRings:
    r"""Contact of two concentric rings of any two materials, by Lamé's solution.

    The pressure is ``(interference + u_in - u_out)/(c_in + c_out)`` with the displacements at
    ``Rc`` that the rim pressures cause without contact, and the compliances ``u/p`` at ``Rc``.

    Parameters
    ----------
    Ri, Rc, Ro : float
        Bore (0: solid shaft), contact and outer radius [length].
    inner, outer : (E, nu)
        Material of each ring.
    interference : float
        Radial interference; negative for a clearance [length].
    p_inner, p_outer : float
        Pressure in the bore and on the outer rim [stress].
    plane : {"strain", "stress"}
        Plane strain means no axial strain at all, also in axisymmetric models.

    References
    ----------
    Timoshenko & Goodier, Theory of Elasticity (1970), section 28.

    Examples
    --------
    Interference fit of equal materials:

    >>> steel = (200e3, 0.3)
    >>> fit = lame_rings(1.0, 2.0, 3.0, steel, steel, interference=2e-3)
    >>> print(f"{fit.pressure:.6f} {fit.inner.displacement(1.0):.6f}")
    51.510989 -0.000625
    >>> fit = lame_rings(1.0, 2.0, 3.0, steel, steel, interference=2e-3, plane="stress")
    >>> print(f"{fit.pressure:.3f}")
    46.875

    Rings under external pressure:

    >>> rings = lame_rings(0.2, 0.6, 1.0, (1e9, 0.2), (1e9, 0.2), p_outer=1e6, plane="stress")
    >>> print(f"{rings.pressure:.4f}")
    925925.9259
    """
    if not 0 <= Ri < Rc < Ro:
        raise InputError(f"The radii {Ri}, {Rc}, {Ro} must satisfy 0 <= Ri < Rc < Ro.")
    if plane not in ("strain", "stress"):
        raise InputError(f"plane = {plane!r} is not known: use 'strain' or 'stress'.")
    materials = []
    for E, nu in (inner, outer):
        positive(E=E)
        poisson(nu)
        materials.append((effective_modulus(E, nu), nu / (1 - nu)) if plane == "strain" else (E, nu))

    if math.isinf(inner[0]) and math.isinf(outer[0]):
        raise InputError("Both rings are rigid: at least one E must be finite.")

    def pair(p: float, bore: float, rim: float) -> tuple[Ring, Ring]:
        return Ring(Ri, Rc, bore, p, *materials[0]), Ring(Rc, Ro, p, rim, *materials[1])

    free_in, free_out = (float(ring.displacement(Rc)) for ring in pair(0.0, p_inner, p_outer))
    unit_in, unit_out = (float(ring.displacement(Rc)) for ring in pair(1.0, 0.0, 0.0))
    overlap = interference + free_in - free_out
    p = max(overlap / (unit_out - unit_in), 0.0)
    return ConcentricRings(*pair(p, p_inner, p_outer), pressure=p, gap=max(-overlap, 0.0))


def torque_capacity(mu: float, pressure: float, Rc: float) -> float:
    """Torque ``2 π μ p Rc²`` per unit thickness at which a press fit turns [force].

    Examples
    --------
    >>> print(f"{torque_capacity(0.15, 51.51098901, 2.0):.6f}")
    194.191854
    """
    not_negative(mu=mu, pressure=pressure)
    positive(Rc=Rc)
    return 2 * math.pi * mu * pressure * Rc**2


def ring_twist(torque: float, Ri: float, Rc: float, Ro: float, G_inner: float, G_outer: float) -> float:
    """Angle of the bore against the outer rim under a torque, nothing slipping [rad].

    ``T/(4π) [(1/Ri² - 1/Rc²)/G_inner + (1/Rc² - 1/Ro²)/G_outer]``, T per unit thickness.

    Examples
    --------
    >>> G = 200e3 / 2.6
    >>> print(f"{ring_twist(194.191854, 1.0, 2.0, 3.0, G, G):.6e}")
    1.785714e-04
    """
    positive(Ri=Ri, G_inner=G_inner, G_outer=G_outer)
    parts = (Ri**-2 - Rc**-2) / G_inner + (Rc**-2 - Ro**-2) / G_outer
    return torque / (4 * math.pi) * parts


# --- pin in a hole ---------------------------------------------------------------------------


def persson_load_number(half_angle: float) -> float:
    """Load number ``E' ΔR/Q`` at which a pin touches its hole up to `half_angle` [rad].

    ``[2 - ln(1+b²) - 2b⁴]/[π b² (1+b²)]``, ``b = tan(half_angle/2)``: pin and infinite plate of
    the same material, no friction, load Q per unit thickness in the centre of the pin,
    ``ΔR`` the clearance (negative: interference), ``E' = E/(1-ν²)`` (plane strain) or ``E``.
    Persson (1964); Ciavarella & Decuzzi (2001).

    Examples
    --------
    >>> import math
    >>> print(f"{persson_load_number(2 * math.atan(0.4)):.5f}")
    3.08771
    """
    if not 0 < half_angle < math.pi:
        raise InputError(f"half_angle = {half_angle} must lie between 0 and pi (radians).")
    b2 = math.tan(half_angle / 2) ** 2
    return (2 - math.log1p(b2) - 2 * b2**2) / (math.pi * b2 * (1 + b2))


def persson_half_angle(load_number: float) -> float:
    """Half angle of contact of a pin in a hole for a given ``E' ΔR/Q`` [rad].

    Zero is the perfect fit, whose contact does not depend on the load.

    Examples
    --------
    >>> import math
    >>> print(f"{math.degrees(persson_half_angle(0.0)):.3f}")
    84.828
    """
    # the relation falls from +inf to -2/pi; beyond, pin and hole touch all around
    if load_number <= -2 / math.pi:
        raise InputError(
            f"E' dR/Q = {load_number} is below -2/pi = {-2 / math.pi:.4f}: the interference is"
            " so large that pin and hole touch all around."
        )

    # in ln b both ends of the range, touching at a point or nearly all around, are far away
    def equation(log_b: float) -> float:
        return persson_load_number(2 * math.atan(math.exp(log_b))) - load_number

    return 2 * math.atan(math.exp(scipy.optimize.brentq(equation, -17.0, 17.0, xtol=1e-14)))


def persson_pressure(angle: ArrayLike, half_angle: float, Q: float, R: float) -> Array:
    r"""Pressure between pin and hole at the `angle` from the line of load [stress].

    With ``y = tan(angle/2)``, ``s = sqrt(b²-y²)``, ``r = sqrt(1+b²)``:
    ``p R/Q = (2/π) s/(r (1+y²)) + 1/(2π b² (1+b²)) ln[(r+s)/(r-s)]``.

    Examples
    --------
    A small arc under a clearance is nearly Hertz', ``2Q/(π a)`` with ``a = R half_angle``:

    >>> print(f"{float(persson_pressure(0.0, 0.01, 1.0, 1.0)) * 0.01:.4f}")
    0.6366
    """
    positive(half_angle=half_angle, R=R)
    b2 = math.tan(half_angle / 2) ** 2
    y2 = np.tan(np.clip(np.abs(angle), 0, half_angle) / 2) ** 2
    s, r = np.sqrt(np.maximum(b2 - y2, 0)), math.sqrt(1 + b2)
    # ln((r+s)/(r-s)) = 2 atanh(s/r)
    log = 2 * np.arctanh(s / r)
    return Q / R * (2 / math.pi * s / (r * (1 + y2)) + log / (2 * math.pi * b2 * (1 + b2)))
