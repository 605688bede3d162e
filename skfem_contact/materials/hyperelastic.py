r"""Rubber: hyperelastic materials at any strain, with the deformation gradient ``F = 1 + H``.

Energies by initial volume are sums of ``c J^a I(F)``, with the invariants ``I1 = F : F`` and ``I2`` of
``C = F' F``, and of a function of ``J = det F``. Stresses and tangents are their derivatives.
See Holzapfel, Nonlinear Solid Mechanics (2000), chapter 6.
"""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import field
from typing import Any

import numpy as np

from skfem_contact.arguments import PrintedAsCall, with_known_keywords
from skfem_contact.arrays import Array
from skfem_contact.errors import InputError
from skfem_contact.materials.elastic import Elastic
from skfem_contact.materials.material import Isotropic, Split, State, take_numbers
from skfem_contact.materials.tensors import deformation, dilatation, double, green, isotropic
from skfem_contact.records import dataclass


class Hyperelastic(Split):
    """What the materials here have in common."""

    finite_strain = True

    def __post_init__(self) -> None:
        own: Any = self
        take_numbers(self, **dict.fromkeys(own.__dataclass_fields__, "give a modulus of the energy"))
        if not (own.shear > 0.0 and own.bulk > 0.0):
            moduli = f"the shear modulus is {own.shear}, the bulk modulus {own.bulk}"
            raise InputError(f"{moduli}: both have to be > 0")

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

    def energy(self, H: Array, state: State) -> tuple[Array, Array]:
        F, J, _ = deformation(H)
        stored = self.volumetric(dilatation(H, True)[0])[0]
        for c, a, invariant in self._terms():
            stored = stored + c * (J**a * INVARIANTS[invariant](F, 0)[0] - 3.0)
        return stored, np.zeros_like(J)


@with_known_keywords()
@dataclass(frozen=True, eq=False)
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
    >>> foam = sc.materials.NeoHooke.of(E=1.0, nu=0.25)
    >>> foam.shear, round(foam.bulk, 4)
    (0.4, 0.6667)
    >>> stress, _, _ = foam(np.diag([0.5, 0.0, 0.0])[:, :, None, None], {})
    >>> stress[0, 0].round(4).tolist()
    [[0.4415]]
    """

    shear: float
    bulk: float

    @classmethod
    def of(cls, E: float, nu: float) -> NeoHooke:
        """The material with these moduli at small strains."""
        small = Elastic(E, nu)
        return cls(small.shear, small.bulk)

    def _terms(self) -> tuple[tuple[float, float, int], ...]:
        return ((0.5 * self.shear, 0.0, 1),)

    def volumetric(self, growth: Array) -> tuple[Array, Array, Array]:
        mu, lam, log = self.shear, self.bulk - 2.0 / 3.0 * self.shear, np.log1p(growth)
        J = 1.0 + growth
        p = (lam * log - mu) / J
        return (0.5 * lam * log - mu) * log, p, (lam - lam * log + mu) / J**2


@with_known_keywords()
@dataclass(frozen=True, eq=False)
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
    >>> rubber = sc.materials.MooneyRivlin(0.293, 0.177, bulk=1410.0)
    >>> rubber.shear
    0.94
    """

    C10: float
    C01: float = 0.0
    bulk: float = field(kw_only=True)

    mean_dilatation = True

    @property
    def shear(self) -> float:
        """Shear modulus at small strains [stress]."""
        return 2.0 * (self.C10 + self.C01)

    def _terms(self) -> tuple[tuple[float, float, int], ...]:
        terms = (self.C10, -2.0 / 3.0, 1), (self.C01, -4.0 / 3.0, 2)
        return tuple(term for term in terms if term[0])

    def volumetric(self, growth: Array) -> tuple[Array, Array, Array]:
        k = self.bulk
        return 0.5 * k * growth**2, k * growth, np.full_like(growth, k)


@with_known_keywords()
@dataclass(frozen=True, eq=False)
class SaintVenantKirchhoff(PrintedAsCall, Isotropic):
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

    def __call__(self, H: Array, state: State) -> tuple[Array, Array, State]:
        d, F, S = len(H), deformation(H)[0], self.hooke(green(H))
        f = F[:d, :d]
        A = np.einsum(
            "im...,mjnl,kn...->ijkl...", f, isotropic(self.bulk, self.shear, d), f, optimize=True
        )
        A += np.einsum("ik,lj...->ijkl...", np.eye(d), S[:d, :d])
        return np.einsum("im...,mj...->ij...", F, S), A, {}

    def energy(self, H: Array, state: State) -> tuple[Array, Array]:
        return self.stored(green(H))


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
