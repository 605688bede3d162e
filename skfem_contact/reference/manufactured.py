"""Manufactured solution with a stick and a slip zone, for rates of convergence."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np


def _positive_part(z: Any) -> Any:
    """``max(z, 0)``, also for the complex step (real part decides)."""
    return np.where(np.real(z) > 0, z, 0 * z)


@dataclass(frozen=True, eq=False)
class ManufacturedSlip:
    r"""Unit square on the rigid plane y = 0, sticking for ``x < x0`` and sliding to +x beyond.

    With ``<z> = max(z, 0)``, ``S = c <x-x0>⁴``, ``p = p0 (1 + x/2)``,
    ``A = (p + λ S')/(λ + 2G)``, ``T = (μ/G) p [1 - 0.8 <1 - x/x0>⁴]`` the displacement is

        u_x = S + y T,        u_y = -A y        (plane strain)

    so that on y = 0 the pressure is ``p``, the shear traction ``G T <= μ p``, with equality
    exactly where the slip ``S`` is not zero. Prescribe the displacement on the other three sides;
    one load step from zero. All points are component first, ``x[0], x[1]`` of any shape, as
    scikit-fem gives them to forms.

    Examples
    --------
    >>> m = ManufacturedSlip()
    >>> print(m.displacement(np.array([0.5, 0.5])).round(9))
    [ 0.006502 -0.00466 ]
    >>> print(f"{m.displacement(np.array([0.7, 0.0]))[0]:.4e} {m.normal_force:.4f}")
    1.6200e-04 0.0125
    >>> print(f"{m.friction_force:.9e} {m.dissipation:.5e}")
    4.735466667e-03 9.02016e-07
    """

    E: float = 1.0
    nu: float = 0.3
    mu: float = 0.4
    x0: float = 0.4
    c: float = 0.02
    p0: float = 0.01

    @property
    def lam(self) -> float:
        """Lamé's first constant."""
        return self.E * self.nu / ((1 + self.nu) * (1 - 2 * self.nu))

    @property
    def G(self) -> float:
        """Shear modulus."""
        return self.E / (2 * (1 + self.nu))

    def _S(self, x: Any, derivative: int = 0) -> Any:
        factor = (1, 4, 12, 24)[derivative]
        return factor * self.c * _positive_part(x - self.x0) ** (4 - derivative)

    def _A(self, x: Any, derivative: int = 0) -> Any:
        p = (self.p0 * (1 + x / 2), self.p0 / 2, 0.0)[derivative]
        return (p + self.lam * self._S(x, derivative + 1)) / (self.lam + 2 * self.G)

    def _T(self, x: Any, derivative: int = 0) -> Any:
        z, k, p = _positive_part(1 - x / self.x0), 1 / self.x0, self.p0 * (1 + x / 2)
        grip = 1 - 0.8 * z**4
        slope, bend = 3.2 * k * z**3, -9.6 * k**2 * z**2
        ways = (p * grip, self.p0 / 2 * grip + p * slope, self.p0 * slope + p * bend)
        return self.mu / self.G * ways[derivative]

    def displacement(self, x: Any) -> Any:
        """Displacement, shape (2, ...) [length]."""
        return np.array([self._S(x[0]) + x[1] * self._T(x[0]), -self._A(x[0]) * x[1]])

    def stress(self, x: Any) -> Any:
        """Stress tensor, shape (2, 2, ...) [stress]."""
        X, y = x[0], x[1]
        stretch, press = self._S(X, 1) + y * self._T(X, 1), self._A(X)
        xx = (self.lam + 2 * self.G) * stretch - self.lam * press
        yy = self.lam * stretch - (self.lam + 2 * self.G) * press
        xy = self.G * (self._T(X) - y * self._A(X, 1))
        return np.array([[xx, xy], [xy, yy]])

    def body_force(self, x: Any) -> Any:
        """Body force ``-div σ``, shape (2, ...) [force/volume]."""
        X, y, lam, G = x[0], x[1], self.lam, self.G
        f_x = -(lam + 2 * G) * (self._S(X, 2) + y * self._T(X, 2)) + (lam + G) * self._A(X, 1)
        f_y = -G * (self._T(X, 1) - y * self._A(X, 2)) - lam * self._T(X, 1)
        return np.array([f_x, f_y])

    def pressure(self, x: Any) -> Any:
        """Contact pressure on y = 0 [stress]."""
        return self.p0 * (1 + x[0] / 2)

    def traction(self, x: Any) -> Any:
        """Size of the shear traction on y = 0; it acts on the square towards -x [stress]."""
        return self.G * self._T(x[0])

    def slip(self, x: Any) -> Any:
        """Slip on y = 0, towards +x [length]."""
        return self._S(x[0])

    @property
    def normal_force(self) -> float:
        """Resultant pressure ``1.25 p0``."""
        return 1.25 * self.p0

    @property
    def friction_force(self) -> float:
        """Resultant shear traction."""
        lost = 0.8 * self.mu * self.p0 * (self.x0 / 5 + self.x0**2 / 60)
        return self.mu * self.normal_force - lost

    @property
    def dissipation(self) -> float:
        """Energy lost if all loads grow in proportion, ``½ ∫ μ p S dx``."""
        z = 1 - self.x0
        integral = (1 + self.x0 / 2) * z**5 / 5 + z**6 / 12
        return self.mu * self.p0 * self.c * integral / 2
