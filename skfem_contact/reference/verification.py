"""Problems to verify programs with: one contact node, a manufactured solution, published benchmarks.

Of one node all equilibria are found by enumeration, and when there is only one of them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from skfem_contact.arguments import not_negative, positive
from skfem_contact.errors import InputError

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Equilibrium:
    """One solution of the contact problem of one node.

    Attributes
    ----------
    status : str
        "open", "stick" or "slip".
    u, reaction : ndarray, shape (2,)
        Displacement, and force of the obstacle on the node: tangential, normal.

    Examples
    --------
    >>> held, *others = one_node_equilibria([[2.0, 0.0], [0.0, 1.0]], [0.1, -1.0], mu=0.3)
    >>> print(held.status, held.u, held.reaction, len(others))
    stick [0. 0.] [-0.1  1. ] 0
    """

    status: str
    u: Array
    reaction: Array


def triangle_stiffness(points: ArrayLike, E: float, nu: float) -> Array:
    """Stiffness (2, 2) of the first node of a linear triangle, the others clamped; plane strain.

    Parameters
    ----------
    points : array_like, shape (3, 2)
        Corners in either sense of rotation; unit thickness.

    Examples
    --------
    >>> print(triangle_stiffness(ONE_NODE_TRIANGLE, 1.0, 0.3).round(8))
    [[0.5982906  0.39974972]
     [0.39974972 1.13247863]]
    """
    positive(E=E)
    x = np.asarray(points, dtype=float)
    edges = x[1:] - x[0]
    double_area = abs(np.linalg.det(edges))
    if double_area == 0:
        raise InputError(f"points = {x.tolist()} lie on one line.")
    # gradient of the first shape function: minus the sum of those of the other two
    gradient = -np.linalg.solve(edges, np.ones(2))
    lam, G = E * nu / ((1 + nu) * (1 - 2 * nu)), E / (2 * (1 + nu))
    outer = np.outer(gradient, gradient)
    return double_area / 2 * ((lam + G) * outer + G * gradient @ gradient * np.eye(2))


# first node on the obstacle y >= 0; E = 1, nu = 0.3 gives the example of the docstrings
ONE_NODE_TRIANGLE = (
    (0.0, 0.0),
    (1.3533216244792285, 0.4105125828971653),
    (-0.4105125828971653, 1.3533216244792285),
)


def one_node_equilibria(K: ArrayLike, f: ArrayLike, mu: float) -> list[Equilibrium]:
    """Return every equilibrium of one node above an obstacle, found branch by branch.

    From the unloaded state, no slip before: ``K u = f + r``; open (``r = 0``, ``u_n > 0``),
    stick (``u = 0``, ``|r_t| <= μ r_n``), slip either way (``u_n = 0``,
    ``r_t = -μ r_n sign(u_t)``).

    Parameters
    ----------
    K : array_like, shape (2, 2)
        Stiffness, tangential component first.
    f : array_like, shape (2,)
        Load.
    mu : float
        Coefficient of friction.

    Examples
    --------
    Three answers to one question (friction is above the critical value 1.497):

    >>> K = triangle_stiffness(ONE_NODE_TRIANGLE, 1.0, 0.3)
    >>> for answer in one_node_equilibria(K, [-1.75, -1.0], mu=2.0):
    ...     print(answer.status, answer.u.round(8) + 0.0)
    open [-3.05568975 0.1955985 ]
    stick [0. 0.]
    slip [-1.24249012 0. ]
    """
    not_negative(mu=mu)
    K, f = np.asarray(K, dtype=float), np.asarray(f, dtype=float)
    found = []
    u = np.linalg.solve(K, f)
    if u[1] > 0:
        found.append(Equilibrium("open", u, np.zeros(2)))
    if f[1] <= 0 and abs(f[0]) <= -mu * f[1]:
        found.append(Equilibrium("stick", np.zeros(2), -f))
    for sign in (1.0, -1.0):
        stiffness = K[0, 0] + sign * mu * K[1, 0]
        if stiffness == 0:
            continue
        u_t = (f[0] + sign * mu * f[1]) / stiffness
        r_n = K[1, 0] * u_t - f[1]
        if sign * u_t > 0 and r_n >= 0:
            reaction = np.array([-sign * mu * r_n, r_n])
            found.append(Equilibrium("slip", np.array([u_t, 0.0]), reaction))
    return found


def critical_friction(K: ArrayLike) -> float:
    """Friction ``K_tt/|K_tn|`` below which one node has one equilibrium for every load.

    Examples
    --------
    >>> K = triangle_stiffness(ONE_NODE_TRIANGLE, 1.0, 0.3)
    >>> print(f"{critical_friction(K):.10f}")
    1.4966629547
    """
    K = np.asarray(K, dtype=float)
    return float("inf") if K[0, 1] == 0 else float(K[0, 0] / abs(K[0, 1]))


def worst_triangle_friction(nu: float) -> float:
    """Least critical friction of any linear triangle, ``2 sqrt(2 (1-ν) (1-2ν))`` (plane strain).

    Examples
    --------
    >>> print([round(worst_triangle_friction(nu), 3) for nu in (0.0, 0.3, 0.45, 0.49)])
    [2.828, 1.497, 0.663, 0.286]
    """
    return 2 * math.sqrt(2 * (1 - nu) * (1 - 2 * nu))


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


@dataclass(frozen=True)
class RaousBlock:
    """Block pressed on a rigid plane and pushed sideways, proportionally (Raous, GRECO).

    Half of a block, 40 mm x 40 mm in plane strain, lies on the rigid plane y = 0. The face x = 0
    is a plane of symmetry (u_x = 0), a pressure acts on the face x = 40 mm and another on the top.
    SI units.

    Attributes
    ----------
    side, E, nu, mu : float
        Side of the half block, modulus, Poisson's ratio, coefficient of friction.
    lateral_pressure, top_pressure : float
        Loads.
    points : tuple of float
        Abscissas on the contact line of the points A, B, C, D, E.
    published : tuple of float
        Their size of u_x, mean of the codes of the benchmark, tolerance 5 % (Raous; Feijóo,
        Barbosa & Zouain; printed in Code_Aster SSNV128).
    code_aster : tuple of float
        Code_Aster SSNV209a, linear quadrilaterals.
    converged : tuple of float
        64 x 64 eight-node elements, an independent solver with nodal contact. The
        abscissas of B to E were identified by matching this solution with the published values.
    normal_force, friction_force : float
        Resultants per metre of thickness; the first is exact, the second converged (the node on
        the plane of symmetry left out).
    stick_end, contact_end : float
        Abscissas where slip and separation begin, to about one element of 0.6 mm.

    Examples
    --------
    >>> RAOUS.normal_force == RAOUS.top_pressure * RAOUS.side
    True
    """

    side: float = 0.04
    E: float = 1.3e11
    nu: float = 0.2
    mu: float = 1.0
    lateral_pressure: float = 15e7
    top_pressure: float = 5e7
    points: tuple[float, ...] = (0.04, 0.03875, 0.035, 0.0325, 0.02875)
    published: tuple[float, ...] = (2.86e-5, 2.72e-5, 2.28e-5, 1.98e-5, 1.5e-5)
    code_aster: tuple[float, ...] = (2.84594e-5, 2.70792e-5, 2.27403e-5, 1.97271e-5, 1.53642e-5)
    converged: tuple[float, ...] = (2.86018e-5, 2.72245e-5, 2.28676e-5, 1.98072e-5, 1.54137e-5)
    normal_force: float = 2.0e6
    friction_force: float = 1.40536e6
    stick_end: float = 0.0103
    contact_end: float = 0.0368


RAOUS = RaousBlock()
