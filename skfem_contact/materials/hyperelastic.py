r"""Rubber: hyperelastic materials at any strain, with the deformation gradient ``F = 1 + H``.

Energies by initial volume are sums of ``c J^a I(F)``, with the invariants ``I1 = F : F`` and ``I2`` of
``C = F' F``, and of a function of ``J = det F``. Stresses and tangents are their derivatives.
See Holzapfel, Nonlinear Solid Mechanics (2000), chapter 6.
"""

from __future__ import annotations

from abc import abstractmethod
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skfem_contact.arguments import PrintedAsCall, number, take
from skfem_contact.errors import InputError, MaterialError
from skfem_contact.materials.elastic import check_moduli
from skfem_contact.materials.material import Material, State
from skfem_contact.materials.tensors import double, isotropic, solid, trace, unit
from skfem_contact.records import dataclass

Array = NDArray[np.float64]


class Hyperelastic(Material):
    """What the materials here have in common."""

    finite_strain = True

    @abstractmethod
    def _terms(self) -> tuple[tuple[float, float, int], ...]:
        """Terms ``c J^a (I_k - 3)`` of the energy: c, a and the number k of the invariant."""

    def isochoric(self, H: Array, state: State) -> tuple[Array, Array, State]:
        F, J, G = deformation(H)
        d = len(H)
        P, A = np.zeros_like(F), np.zeros((d,) * 4 + J.shape)
        for c, a, invariant in self._terms():
            value, slope, bend = INVARIANTS[invariant](F, d)
            scale = c * J**a
            P += scale * (slope + a * value * G)
            A += scale * bend
            if a:
                g, s = G[:d, :d], slope[:d, :d]
                mixed = np.einsum("ij...,kl...->ijkl...", s, g)
                A += scale * a * (mixed + mixed.transpose(2, 3, 0, 1, 4, 5))
                both = np.einsum("ij...,kl...->ijkl...", g, g)
                A += scale * a * value * (a * both - both.transpose(0, 3, 2, 1, 4, 5))
        return P, A, {}

    def __call__(self, H: Array, state: State) -> tuple[Array, Array, State]:
        P, A, _ = self.isochoric(H, state)
        _, J, G = deformation(H)
        _, p, dp = self.volumetric(J)
        P += p * J * G
        g = G[: len(H), : len(H)]
        both = np.einsum("ij...,kl...->ijkl...", g, g)
        A += J * ((p + dp * J) * both - p * both.transpose(0, 3, 2, 1, 4, 5))
        return P, A, {}

    def energy(self, H: Array, state: State) -> tuple[Array, Array]:
        F, J, _ = deformation(H)
        stored = self.volumetric(J)[0]
        for c, a, invariant in self._terms():
            stored = stored + c * (J**a * INVARIANTS[invariant](F, 0)[0] - 3.0)
        return stored, np.zeros_like(J)


@dataclass(frozen=True, eq=False, init=False)
class NeoHooke(PrintedAsCall, Hyperelastic):
    r"""Compressible neo-Hooke: ``W = mu/2 (I1 - 3) - mu ln J + lambda/2 (ln J)^2``.

    Plane strain, axisymmetric, solid. ``lambda = bulk - 2/3 shear``: small strains are those of linear
    elasticity with these moduli. For rubber that keeps its volume take `MooneyRivlin` with ``C01=0``.

    Parameters
    ----------
    shear, bulk : float
        Moduli at small strains [stress].

    Examples
    --------
    >>> import skfem_contact as sc
    >>> foam = sc.NeoHooke.of(E=1.0, nu=0.25)
    >>> foam.shear, round(foam.bulk, 4)
    (0.4, 0.6667)
    >>> stress, _, _ = foam(np.diag([0.5, 0.0, 0.0])[:, :, None, None], {})
    >>> stress[0, 0].round(4).tolist()
    [[0.4415]]
    """

    shear: float
    bulk: float

    def __init__(self, shear: float, bulk: float) -> None:
        take(
            self,
            shear=number(shear, "shear", "give the shear modulus > 0"),
            bulk=number(bulk, "bulk", "give the bulk modulus > 2/3 shear"),
        )

    def __post_init__(self) -> None:
        if not 0.0 < self.shear < np.inf or not 0.0 < self.bulk < np.inf:
            raise InputError(f"shear = {self.shear}, bulk = {self.bulk}: moduli are finite and > 0")

    @classmethod
    def of(cls, E: float, nu: float) -> NeoHooke:
        """The material with these moduli at small strains."""
        check_moduli(E, nu)
        return cls(E / (2.0 * (1.0 + nu)), E / (3.0 * (1.0 - 2.0 * nu)))

    def _terms(self) -> tuple[tuple[float, float, int], ...]:
        return ((0.5 * self.shear, 0.0, 1),)

    def volumetric(self, J: Array) -> tuple[Array, Array, Array]:
        mu, lam, log = self.shear, self.bulk - 2.0 / 3.0 * self.shear, np.log(J)
        p = (lam * log - mu) / J
        return (0.5 * lam * log - mu) * log, p, (lam - lam * log + mu) / J**2


@dataclass(frozen=True, eq=False, init=False)
class MooneyRivlin(PrintedAsCall, Hyperelastic):
    r"""Rubber that nearly keeps its volume.

    ``W = C10 (J^-2/3 I1 - 3) + C01 (J^-4/3 I2 - 3) + bulk/2 (J - 1)^2``. Plane strain, axisymmetric,
    solid. On quadrilaterals and hexahedra of first order the change of volume is the mean of the
    element, and they do not lock; of triangles and tetrahedra take those of second order.

    Parameters
    ----------
    C10, C01 : float
        Half of the shear modulus, in two parts [stress]. ``C01=0`` is neo-Hooke.
    bulk : float
        Bulk modulus [stress]; of rubber some 1000 times C10.

    Examples
    --------
    >>> import skfem_contact as sc
    >>> rubber = sc.MooneyRivlin(0.293, 0.177, bulk=1410.0)
    >>> rubber.shear
    0.94
    """

    C10: float
    C01: float
    bulk: float

    mean_dilatation = True

    def __init__(self, C10: float, C01: float = 0.0, *, bulk: float) -> None:
        take(
            self,
            C10=number(C10, "C10", "give a modulus"),
            C01=number(C01, "C01", "give a modulus"),
            bulk=number(bulk, "bulk", "give the bulk modulus > 0"),
        )

    def __post_init__(self) -> None:
        if not 0.0 < self.shear < np.inf or not 0.0 < self.bulk < np.inf:
            raise InputError(
                f"C10 = {self.C10}, C01 = {self.C01}, bulk = {self.bulk}: the shear modulus "
                "2 (C10 + C01) and the bulk modulus are finite and > 0"
            )

    @property
    def shear(self) -> float:
        """Shear modulus at small strains [stress]."""
        return 2.0 * (self.C10 + self.C01)

    def _terms(self) -> tuple[tuple[float, float, int], ...]:
        terms = (self.C10, -2.0 / 3.0, 1), (self.C01, -4.0 / 3.0, 2)
        return tuple(term for term in terms if term[0])

    def volumetric(self, J: Array) -> tuple[Array, Array, Array]:
        k = self.bulk
        return 0.5 * k * (J - 1.0) ** 2, k * (J - 1.0), np.full_like(J, k)


@dataclass(frozen=True, eq=False, init=False)
class SaintVenantKirchhoff(PrintedAsCall, Material):
    """Linear elasticity of Green's strain, ``W = lambda/2 (tr E)^2 + mu E : E``.

    For metals and others that turn by large angles and strain little: under strong pressure it
    collapses.

    Parameters
    ----------
    E : float
        Young's modulus [stress].
    nu : float
        Poisson's ratio.

    Examples
    --------
    >>> from skfem_contact.materials import SaintVenantKirchhoff
    >>> turned = np.array([[0.0, -1.0], [1.0, 0.0]]) - np.eye(2)
    >>> stress, _, _ = SaintVenantKirchhoff(210e3, 0.3)(turned[:, :, None, None], {})
    >>> float(abs(stress).max())
    0.0
    """

    E: float
    nu: float

    finite_strain = True

    def __init__(self, E: float, nu: float) -> None:
        take(self, E=number(E, "E", "give Young's modulus > 0"), nu=number(nu, "nu", "give Poisson's"))

    def __post_init__(self) -> None:
        check_moduli(self.E, self.nu)

    def _stress(self, F: Array) -> tuple[Array, Array]:
        """Green's strain and the second Piola-Kirchhoff stress, (3, 3, ...)."""
        strain = 0.5 * (np.einsum("mi...,mj...->ij...", F, F) - unit(F.ndim - 2))
        lam, mu = self.E * self.nu / (1 + self.nu) / (1 - 2 * self.nu), 0.5 * self.E / (1 + self.nu)
        return strain, 2.0 * mu * strain + lam * trace(strain) * unit(F.ndim - 2)

    def __call__(self, H: Array, state: State) -> tuple[Array, Array, State]:
        d, F = len(H), deformation(H)[0]
        S = self._stress(F)[1]
        C = isotropic(self.E / 3.0 / (1 - 2 * self.nu), 0.5 * self.E / (1 + self.nu), d)
        f = F[:d, :d]
        A = np.einsum("im...,mjnl,kn...->ijkl...", f, C, f, optimize=True)
        A += np.einsum("ik,lj...->ijkl...", np.eye(d), S[:d, :d])
        return np.einsum("im...,mj...->ij...", F, S), A, {}

    def energy(self, H: Array, state: State) -> tuple[Array, Array]:
        strain, S = self._stress(deformation(H)[0])
        stored = 0.5 * double(strain, S)
        return stored, np.zeros_like(stored)


def deformation(H: Array) -> tuple[Array, Array, Array]:
    """Return F (3, 3, e, q), its determinant (e, q), which has to be positive, and F^-T."""
    F = solid(H) + unit(H.ndim - 2)
    cofactor = np.cross(F[:, [1, 2, 0]], F[:, [2, 0, 1]], axis=0)
    J = np.einsum("i...,i...->...", F[:, 0], cofactor[:, 0])
    if not (J > 0).all():  # or NaN
        raise MaterialError(
            f"an element is turned inside out: det F = {np.nanmin(J):.3g}",
            int(np.argwhere(~(J > 0))[0, 0]),
        )
    return F, J, cofactor / J


def _first(F: Array, d: int) -> tuple[Array, Array, Array]:
    """``I1 = F : F``, its derivative, and d rows of the second."""
    one = np.eye(d)
    bend = 2.0 * np.einsum("ik,jl->ijkl", one, one)
    return double(F, F), 2.0 * F, bend[..., None, None]


def _second(F: Array, d: int) -> tuple[Array, Array, Array]:
    """``I2 = (I1^2 - C : C) / 2``, its derivative, and d rows of the second."""
    C, B = np.einsum("mi...,mj...->ij...", F, F), np.einsum("im...,jm...->ij...", F, F)
    I1, f, one = double(F, F), F[:d, :d], np.eye(d)
    both = np.einsum("ij...,kl...->ijkl...", f, f)
    bend = 2.0 * both - both.transpose(0, 3, 2, 1, *range(4, both.ndim))
    bend += np.einsum("ik,jl...->ijkl...", one, I1 * one[:, :, None, None] - C[:d, :d])
    bend -= np.einsum("ik...,jl->ijkl...", B[:d, :d], one)
    slope = 2.0 * (I1 * F - np.einsum("im...,mj...->ij...", F, C))
    return 0.5 * (I1**2 - double(C, C)), slope, 2.0 * bend


INVARIANTS: dict[int, Any] = {1: _first, 2: _second}
