"""Frictionless contact of smooth profiles: Hertz line and point, the quartic profile.

Each contact object answers `pressure(x)` and `with_load(P)`; the theorem of Ciavarella and Jäger
(`fretting.cattaneo_mindlin`) builds tangential contact from these two alone.

A block of finite depth and width is no half plane: its far field adds a curvature to the surface
under the load. Under a line load P on a block of depth H,

    1/R_effective = 1/R + Σ C_i P / (E_i* H_i²),     E_i* = E_i / (1 - nu_i²)

summed over the deformable bodies. For a layer of infinite width C is a Fourier integral,
computed here; finite widths scale it by ratios that were tabulated once from plane finite
element solutions of the load on the block (sides free).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import scipy  # its parts are imported when they are used
from numpy.typing import ArrayLike, NDArray

from skfem_contact.arguments import not_negative, poisson, positive
from skfem_contact.errors import InputError

Array = NDArray[np.float64]


def effective_modulus(E1: float, nu1: float, E2: float = math.inf, nu2: float = 0.0) -> float:
    r"""Effective contact modulus, ``1/E* = (1 - nu1²)/E1 + (1 - nu2²)/E2`` [stress].

    The second body is rigid unless given. Source: Johnson, Contact Mechanics (1985), section 4.2.

    Examples
    --------
    Steel on steel and steel on a rigid plane:

    >>> round(effective_modulus(200e3, 0.3, 200e3, 0.3), 2)
    109890.11
    >>> round(effective_modulus(200e3, 0.3), 2)
    219780.22
    """
    positive(E1=E1, E2=E2)
    poisson(nu1, nu2)
    compliance = (1 - nu1**2) / E1 + (1 - nu2**2) / E2
    return 1 / compliance if compliance else math.inf


@dataclass(frozen=True, eq=False)
class HertzLine:
    """Hertz contact along a line (parallel cylinders, cylinder on a plane), per unit thickness.

    Attributes
    ----------
    P : float
        Load [force/length].
    R : float
        Relative radius, ``1/R = 1/R1 + 1/R2`` [length].
    E_star : float
        Effective modulus [stress].
    a : float
        Half width of contact ``sqrt(4 P R / (π E*))`` [length].

    Examples
    --------
    >>> line = hertz_line(P=1000.0, R=100.0, E_star=110e3)
    >>> print(f"{line.a:.4f} {line.p0:.2f} {float(line.pressure(0.5 * line.a)) / line.p0:.4f}")
    1.0759 591.73 0.8660
    """

    P: float
    R: float
    E_star: float
    a: float

    @property
    def p0(self) -> float:
        """Largest pressure ``E* a / (2 R) = 2 P / (π a)`` [stress]."""
        return self.E_star * self.a / (2 * self.R)

    @property
    def max_shear(self) -> float:
        """Largest shear stress, ``φ**-2.5 p0 = .3003 p0`` with the golden ratio φ [stress]."""
        return ((1 + math.sqrt(5)) / 2) ** -2.5 * self.p0

    @property
    def max_shear_depth(self) -> float:
        """Depth of the largest shear stress, ``φ**-0.5 a = .7862 a`` [length]."""
        return ((1 + math.sqrt(5)) / 2) ** -0.5 * self.a

    def with_load(self, P: float) -> HertzLine:
        """Return the same profile under another load, zero included."""
        return hertz_line(P, self.R, self.E_star)

    def pressure(self, x: ArrayLike) -> Array:
        """Pressure ``p0 sqrt(1 - x²/a²)`` at the distance `x` from the middle [stress]."""
        x = np.asarray(x, dtype=float)
        # written without a division by a, so that the unloaded contact (a = 0) is no exception
        return self.E_star / (2 * self.R) * np.sqrt(np.maximum(self.a**2 - x**2, 0))

    def surface_displacement(self, x: ArrayLike) -> Array:
        r"""Displacement of both surfaces at `x`, relative to the middle (<= 0) [length].

        ``-x²/(2R)`` inside; outside, with ``w = (|x| + sqrt(x² - a²))/a``,
        ``-2P/(π E*) (ln w + 1/(2 w²) + 1/2)``: the logarithmic potential of the semicircle.
        """
        r: Array = np.abs(np.asarray(x, dtype=float))
        if self.P == 0:
            return np.zeros_like(r)
        w = (np.maximum(r, self.a) + np.sqrt(np.maximum(r**2 - self.a**2, 0))) / self.a
        outside = -2 * self.P / (math.pi * self.E_star) * (np.log(w) + 0.5 / w**2 + 0.5)
        return np.where(r <= self.a, -(r**2) / (2 * self.R), outside)

    def approach(self, distance: float) -> float:
        """Indentation relative to a surface point at `distance` from the middle [length].

        Half planes have no approach of their own, it grows as the logarithm of `distance`: far
        away ``P/(π E*) (2 ln(2 distance/a) + 1)``.
        """
        positive(distance=distance)
        return float(-self.surface_displacement(distance))

    def compression(self, depth: float, E: float, nu: float) -> float:
        r"""Shortening of one body between its surface and `depth` on the axis [length].

        ``p0/E [(1-ν²) a asinh(d/a) - ν (1+ν) (d/a) (sqrt(a²+d²) - d)]`` (plane strain), the
        integral of the strain under the middle. For ``d >> a`` this is Johnson's
        ``P (1-ν²)/(π E) (2 ln(2d/a) - ν/(1-ν))``, section 5.6.

        Parameters
        ----------
        depth : float
            Depth below the surface [length].
        E, nu : float
            Elastic constants of this body (not E*).
        """
        positive(depth=depth, E=E)
        poisson(nu)
        if self.P == 0:
            return 0.0
        a, root = self.a, math.hypot(self.a, depth)
        # sqrt(a²+d²) - d without cancellation for deep points
        rest = a**2 / (root + depth)
        vertical = (1 - nu**2) * a * math.asinh(depth / a)
        return self.p0 / E * (vertical - nu * (1 + nu) * depth / a * rest)

    def axis_stresses(self, z: ArrayLike) -> tuple[Array, Array]:
        """Principal stresses (σ_x, σ_z) under the middle at the depth `z` [stress].

        Source: Johnson, section 4.2. Tension is positive.
        """
        z = np.asarray(z, dtype=float)
        a, root = self.a, np.hypot(self.a, z)
        sigma_x = -self.p0 / a * ((a**2 + 2 * z**2) / root - 2 * z)
        return sigma_x, -self.p0 * a / root


def hertz_line(P: float, R: float, E_star: float, *, added_curvature: float = 0.0) -> HertzLine:
    """Hertz line contact: ``a = sqrt(4 P R/(π E*))``, ``p0 = 2 P/(π a)``.

    Parameters
    ----------
    P : float
        Load per unit thickness [force/length]; zero gives the empty contact.
    R : float
        Relative radius [length].
    E_star : float
        Effective modulus, see `effective_modulus` [stress].
    added_curvature : float
        Sum over the bodies of `block_curvature`, for bodies of finite size [1/length]. The radius
        kept in the answer contains it.

    References
    ----------
    Johnson, Contact Mechanics (1985), section 4.2.

    Examples
    --------
    >>> h = hertz_line(P=1000.0, R=100.0, E_star=109890.10989)
    >>> print(f"{h.a:.6f} {h.p0:.4f} {h.max_shear:.2f} {h.max_shear_depth:.4f}")
    1.076405 591.4314 177.60 0.8462
    """
    not_negative(P=P)
    positive(R=R, E_star=E_star)
    R_effective = 1 / (1 / R + added_curvature)
    return HertzLine(P, R_effective, E_star, math.sqrt(4 * P * R_effective / (math.pi * E_star)))


@dataclass(frozen=True, eq=False)
class HertzPoint:
    """Hertz contact of spheres.

    Attributes
    ----------
    P, R, E_star : float
        Load [force], relative radius [length], effective modulus [stress].
    a : float
        Radius of contact, ``a³ = 3 P R / (4 E*)`` [length].

    Examples
    --------
    >>> ball = hertz_point(P=4 / 3, R=1.0, E_star=1.0)
    >>> print(f"{ball.a:.4f} {ball.approach:.4f} {ball.p0:.4f}")
    1.0000 1.0000 0.6366
    """

    P: float
    R: float
    E_star: float
    a: float

    @property
    def p0(self) -> float:
        """Largest pressure ``2 E* a / (π R) = 3 P / (2 π a²)`` [stress]."""
        return 2 * self.E_star * self.a / (math.pi * self.R)

    @property
    def approach(self) -> float:
        """Approach of distant points ``a²/R`` [length]."""
        return self.a**2 / self.R

    def with_load(self, P: float) -> HertzPoint:
        """Return the same profile under another load, zero included."""
        return hertz_point(P, self.R, self.E_star)

    def pressure(self, r: ArrayLike) -> Array:
        """Pressure ``p0 sqrt(1 - r²/a²)`` at the distance `r` from the axis [stress]."""
        r = np.asarray(r, dtype=float)
        scale = 2 * self.E_star / (math.pi * self.R)
        return scale * np.sqrt(np.maximum(self.a**2 - r**2, 0))


def hertz_point(P: float, R: float, E_star: float) -> HertzPoint:
    """Hertz point contact: ``a³ = 3 P R/(4 E*)``, ``p0 = 3 P/(2 π a²)``, approach ``a²/R``.

    References
    ----------
    Johnson, Contact Mechanics (1985), eqs. (4.22)-(4.24).

    Examples
    --------
    Sphere R = 8, E = 1000, nu = 0.3 on a rigid plane (ANSYS VM63, whose target is 1.010):

    >>> round(hertz_point(188.4956, 8.0, effective_modulus(1000.0, 0.3)).a, 4)
    1.0096
    """
    not_negative(P=P)
    positive(R=R, E_star=E_star)
    return HertzPoint(P, R, E_star, (3 * P * R / (4 * E_star)) ** (1 / 3))


@dataclass(frozen=True, eq=False)
class QuarticLine:
    """Line contact of the profile ``C x⁴``: two maxima of pressure, at ``x = ±a/sqrt(2)``.

    Attributes
    ----------
    P, C, E_star : float
        Load [force/length], coefficient of the profile [1/length³], effective modulus [stress].
    a : float
        Half width of contact, ``P = (3π/4) E* C a⁴`` [length].

    Examples
    --------
    >>> wave = quartic_line(P=10.0, C=1e-3, E_star=1e3)
    >>> print(f"{wave.a:.4f} {float(wave.pressure(0.0)) / wave.max_pressure:.4f}")
    1.4353 0.7071
    """

    P: float
    C: float
    E_star: float
    a: float

    @property
    def max_pressure(self) -> float:
        """Largest pressure ``sqrt(2) E* C a³`` [stress]."""
        return math.sqrt(2) * self.E_star * self.C * self.a**3

    def with_load(self, P: float) -> QuarticLine:
        """Return the same profile under another load, zero included."""
        return quartic_line(P, self.C, self.E_star)

    def pressure(self, x: ArrayLike) -> Array:
        """Pressure ``E* C sqrt(a² - x²) (a² + 2 x²)`` [stress]."""
        x = np.asarray(x, dtype=float)
        root = np.sqrt(np.maximum(self.a**2 - x**2, 0))
        return self.E_star * self.C * root * (self.a**2 + 2 * x**2)


def quartic_line(P: float, C: float, E_star: float) -> QuarticLine:
    """Line contact of the profile ``C x⁴`` (Steuermann; Johnson section 5.3, n = 2).

    Examples
    --------
    >>> import math
    >>> q = quartic_line(P=0.75 * math.pi, C=1.0, E_star=1.0)
    >>> print(f"{q.a:.4f} {float(q.pressure(0.0)):.4f} {q.max_pressure:.4f}")
    1.0000 1.0000 1.4142
    """
    not_negative(P=P)
    positive(C=C, E_star=E_star)
    return QuarticLine(P, C, E_star, (4 * P / (3 * math.pi * E_star * C)) ** 0.25)


# half width over depth, and C of the block over C of the infinite layer
WIDTHS = (1.0, 1.5, 2.0, 3.0, 5.0)
FIXED_NU_0 = tuple(c / 0.731 for c in (0.701, 0.728, 0.734, 0.731, 0.731))
FIXED_NU_3 = tuple(c / 0.912 for c in (0.983, 0.926, 0.913, 0.912, 0.912))
ROLLER = tuple(c / 0.663 for c in (0.561, 0.664, 0.669, 0.663, 0.663))


def _layer_compliance(xi: float, base: str, nu: float) -> float:
    """Surface compliance of a layer over that of the half plane, at wave number ``xi/H``."""
    e = math.exp(-2 * xi)
    if base == "roller":
        return (1 - e) ** 2 / (1 - e**2 + 4 * xi * e)
    kappa = 3 - 4 * nu
    numerator = kappa * (1 - e**2) - 4 * xi * e
    return numerator / (kappa * (1 + e**2) + (4 * xi**2 + 1 + kappa**2) * e)


def block_coefficient(base: str = "fixed", nu: float = 0.3, width: float = math.inf) -> float:
    r"""Coefficient C of the curvature that the finite size of a block adds, ``C P/(E* H²)``.

    Infinite layer: ``C = (2/π) ∫ ξ (1 - M(ξ)) dξ`` with the compliance ``M`` of a layer on a
    smooth or bonding rigid base relative to the half plane (Vorovich et al.; Johnson 5.8). The
    ratios for finite width are accurate to about 0.002, so ``a`` to 0.001 at ``a/H = 0.1``.

    Parameters
    ----------
    base : {"fixed", "roller"}
        Support of the bottom of the block; the sides are free.
    nu : float
        Poisson's ratio (plane strain); matters for the fixed base only.
    width : float
        Half width over depth, W/H >= 1. Below 3 on a fixed base `nu` is limited to 0...0.3,
        the range of the table.

    Raises
    ------
    InputError
        Outside the table, or for an unknown base.

    Examples
    --------
    >>> print(f"{block_coefficient('fixed', 0.3, 2.0):.3f} {block_coefficient('roller'):.3f}")
    0.913 0.663
    """
    poisson(nu)
    if base not in ("fixed", "roller"):
        raise InputError(f"base = {base!r} is not known: use 'fixed' or 'roller'.")
    if not width >= WIDTHS[0]:
        raise InputError(f"width W/H = {width} is below 1, where the table of C ends.")
    if base == "fixed" and width < 3 and not 0 <= nu <= 0.3:
        raise InputError(
            f"nu = {nu} with W/H = {width}: C on a fixed base is tabulated for nu from 0 to 0.3;"
            " a wider block (width >= 3) takes any nu."
        )
    # beyond xi = 40 the integrand is below the round-off of its integral
    layer = scipy.integrate.quad(
        lambda xi: xi * (1 - _layer_compliance(xi, base, nu)), 0, 40, limit=200
    )[0]
    w = min(width, WIDTHS[-1])
    if base == "roller":
        ratio = float(scipy.interpolate.PchipInterpolator(WIDTHS, ROLLER)(w))
    else:
        at_0, at_3 = scipy.interpolate.PchipInterpolator(
            WIDTHS, np.transpose([FIXED_NU_0, FIXED_NU_3])
        )(w)
        ratio = float(at_0 + (at_3 - at_0) * nu / 0.3) if width < 3 else 1.0
    return 2 / math.pi * layer * ratio


def block_curvature(
    P: float, H: float, E: float, nu: float, *, base: str = "fixed", width: float = math.inf
) -> float:
    """Curvature ``C P / (E* H²)`` that one block of depth `H` adds under a line load [1/length].

    Give the sum over both bodies to ``hertz_line(..., added_curvature=...)``. Good for
    ``a/H <= 0.2``: without it Hertz errs by ``π C/8 (a/H)²``.

    Examples
    --------
    The half width at ``a0/H = 0.1`` on a fixed block, ``(1 + C π/4 (a0/H)²)**-0.5`` of Hertz':

    >>> from skfem_contact.reference import effective_modulus, hertz_line
    >>> E_star = effective_modulus(1.0, 0.3)
    >>> P = 1e-4 * 3.141592653589793 / 4 * E_star
    >>> added = block_curvature(P, H=0.1, E=1.0, nu=0.3, width=2.0)
    >>> half_plane = hertz_line(P, 1.0, E_star)
    >>> block = hertz_line(P, 1.0, E_star, added_curvature=added)
    >>> print(f"{half_plane.a:.4f} {block.a / half_plane.a:.4f}")
    0.0100 0.9964
    """
    not_negative(P=P)
    positive(H=H, E=E)
    return block_coefficient(base, nu, width) * P * (1 - nu**2) / (E * H**2)
