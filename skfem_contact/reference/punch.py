"""Flat punches: frictionless, bonded, and the stick zone of frictional indentation."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy  # its parts are imported when they are used
from numpy.typing import ArrayLike, NDArray

from skfem_contact.arguments import not_negative, poisson, positive

Array = NDArray[np.float64]


def flat_punch_pressure(x: ArrayLike, P: float, a: float) -> Array:
    """Pressure ``P / (π sqrt(a² - x²))`` under a smooth rigid flat punch on a half plane [stress].

    Source: Johnson eq. (2.64). `P` per unit thickness; zero outside ``|x| < a``.

    Examples
    --------
    >>> print(f"{float(flat_punch_pressure(0.0, P=1.0, a=1.0)):.6f}")
    0.318310
    """
    positive(a=a)
    rest = a**2 - np.asarray(x, dtype=float) ** 2
    return np.where(rest > 0, P / (math.pi * np.sqrt(np.where(rest > 0, rest, 1.0))), 0.0)


def round_punch_pressure(r: ArrayLike, P: float, a: float) -> Array:
    """Pressure ``P / (2 π a sqrt(a² - r²))`` under a smooth rigid round punch [stress].

    Source: Johnson eq. (3.34). Zero outside ``r < a``.

    Examples
    --------
    >>> import numpy as np
    >>> print(round_punch_pressure([0.0, 0.6, 1.0], P=2 * np.pi, a=1.0))
    [1.   1.25 0.  ]
    """
    return flat_punch_pressure(r, P, a) / (2 * a)


def round_punch_load(indentation: float, a: float, E_star: float) -> float:
    """Load ``2 E* a d`` of a smooth rigid round punch pressed in by `indentation` [force].

    Examples
    --------
    >>> round_punch_load(0.1, a=1.0, E_star=10.0)
    2.0
    """
    positive(a=a, E_star=E_star)
    return 2 * E_star * a * indentation


def bonded_round_punch_ratio(nu: float) -> float:
    """Stiffness of a bonded over that of a smooth round punch (Mossakovskii; Spence 1968).

    ``(1 - ν) ln(3 - 4ν)/(1 - 2ν)``, which is 1 for the incompressible half space.

    Examples
    --------
    >>> print([round(bonded_round_punch_ratio(nu), 6) for nu in (0.0, 0.3, 0.4, 0.5)])
    [1.098612, 1.028627, 1.009417, 1.0]
    """
    poisson(nu)
    b = 1 - 2 * nu
    return (1 - nu) * (math.log1p(2 * b) / b if b > 0 else 2.0)


@dataclass(frozen=True, eq=False)
class BondedPunch:
    """Tractions under a rigid flat punch bonded to a half plane (plane strain).

    Attributes
    ----------
    P, a, nu : float
        Load per unit thickness [force/length], half width [length], Poisson's ratio.

    Examples
    --------
    >>> punch = bonded_flat_punch(P=10.0, a=1.0, nu=0.3)
    >>> print(f"{float(punch.pressure(0.0)):.4f}")
    3.3216
    """

    P: float
    a: float
    nu: float

    @property
    def exponent(self) -> float:
        """Oscillation exponent ``ln(3 - 4ν)/(2π)``."""
        return math.log(3 - 4 * self.nu) / (2 * math.pi)

    @property
    def scale(self) -> float:
        """``2 (1 - ν)/sqrt(3 - 4ν)``: pressure in the middle over that of the smooth punch."""
        return 2 * (1 - self.nu) / math.sqrt(3 - 4 * self.nu)

    def _parts(self, x: ArrayLike) -> tuple[Array, Array]:
        x = np.asarray(x, dtype=float)
        smooth = self.scale * flat_punch_pressure(x, self.P, self.a)
        return smooth, self.exponent * 2 * np.arctanh(x / self.a)

    def pressure(self, x: ArrayLike) -> Array:
        """Pressure at ``|x| < a`` [stress]."""
        amplitude, phase = self._parts(x)
        return amplitude * np.cos(phase)

    def shear(self, x: ArrayLike) -> Array:
        """Traction on the half plane along x at ``|x| < a``:  [stress].

        The surface under a smooth punch moves inwards, so the bonded punch pulls it outwards.
        """
        amplitude, phase = self._parts(x)
        return amplitude * np.sin(phase)


def bonded_flat_punch(P: float, a: float, nu: float) -> BondedPunch:
    """Rigid flat punch bonded to a half plane (Muskhelishvili; Johnson eq. 2.69).

    ``p + i q = 2(1-ν)/sqrt(3-4ν) P/(π sqrt(a²-x²)) exp(i η ln((a+x)/(a-x)))``,
    ``η = ln(3-4ν)/(2π)``.

    Examples
    --------
    >>> for nu in (0.0, 0.3):
    ...     print(f"{bonded_flat_punch(1.0, 1.0, nu).scale:.5f}")
    1.15470
    1.04350
    """
    positive(P=P, a=a)
    poisson(nu)
    return BondedPunch(P, a, nu)


def dundurs_beta_rigid(nu: float) -> float:
    """``β = (1 - 2ν)/(2 (1 - ν))``, Dundurs' constant of a half plane under a rigid punch.

    Examples
    --------
    >>> print(f"{dundurs_beta_rigid(0.3):.6f}")
    0.285714
    """
    poisson(nu)
    return (1 - 2 * nu) / (2 * (1 - nu))


def _modulus(z: float) -> tuple[float, float]:
    """``(k, k')`` with ``k² + k'² = 1`` from ``z = ln(k/k')``: neither end loses digits."""
    return (1 + math.exp(-2 * z)) ** -0.5, (1 + math.exp(2 * z)) ** -0.5


def _solve_modulus(equation: Callable[[float], float]) -> float:
    """Return k of the root of an increasing function of ``z = ln(k/k')``."""
    low, high = -340.0, 340.0
    if equation(low) >= 0:
        return 0.0
    if equation(high) <= 0:
        return 1.0
    return _modulus(scipy.optimize.brentq(equation, low, high, xtol=1e-14))[0]


def stick_ratio_plane(mu: float, nu: float) -> float:
    r"""Stick half width over contact half width in frictional indentation, plane strain.

    ``K(c/a)/K'(c/a) = μ/β``, ``K'(k) = K(sqrt(1-k²))``: the effect of friction on the pressure is
    neglected. Rigid flat punch or cylinder pressed monotonically (Spence 1973: the same ratio).
    The coupled ratio is smaller: 0.689 against 0.744 at ``mu = nu = 0.3``.

    Parameters
    ----------
    mu : float
        Coefficient of friction; zero sticks nowhere.
    nu : float
        Poisson's ratio; at 0.5 all sticks.

    Examples
    --------
    >>> print([round(stick_ratio_plane(mu, 0.3), 4) for mu in (0.1, 0.2, 0.3, 0.5)])
    [0.045, 0.4058, 0.7438, 0.9678]
    """
    not_negative(mu=mu)
    beta = dundurs_beta_rigid(nu)
    if beta == 0:
        return 1.0 if mu > 0 else 0.0

    def equation(z: float) -> float:
        k, k1 = _modulus(z)
        return float(scipy.special.ellipkm1(k1**2) / scipy.special.ellipkm1(k**2)) - mu / beta

    return _solve_modulus(equation)


def stick_ratio_axisymmetric(mu: float, nu: float) -> float:
    r"""Stick radius over contact radius in frictional indentation of a half space.

    ``(a/2c) ln((a+c)/(a-c)) = (μ/β) K'(c/a)`` (Spence 1975), the effect of friction on the
    pressure neglected; flat punch or sphere pressed monotonically.

    Examples
    --------
    >>> print([round(stick_ratio_axisymmetric(mu, 0.3), 4) for mu in (0.1, 0.2, 0.3, 0.5)])
    [0.224, 0.7334, 0.9186, 0.9917]
    """
    not_negative(mu=mu)
    beta = dundurs_beta_rigid(nu)
    if beta == 0 or mu == 0:
        return 1.0 if mu > 0 else 0.0

    def equation(z: float) -> float:
        k, k1 = _modulus(z)
        # atanh(k) with 1 - k taken from k', exact also where k rounds to 1
        atanh = math.log1p(k) - math.log(k1) if z > 0 else math.atanh(k)
        return atanh / k / float(scipy.special.ellipkm1(k**2)) - mu / beta

    return _solve_modulus(equation)
