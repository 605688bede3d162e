r"""Elastic materials: linear ones, for linear bodies and others, and rubber at any strain.

With the deformation gradient ``F = 1 + H`` energies of rubber by initial volume are sums of
``c J^a I(F)``, with the invariants ``I1 = F : F`` and ``I2`` of ``C = F' F``, and of a function of
``J = det F``. Stresses and tangents are their derivatives.
See Holzapfel, Nonlinear Solid Mechanics (2000), chapter 6.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable
from dataclasses import field
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike
from skfem.assembly import BilinearForm, LinearForm
from skfem.helpers import ddot, trace

from skfem_contact.arguments import PrintedAsCall, numbers, shown, with_known_keywords
from skfem_contact.arrays import Array
from skfem_contact.errors import InputError
from skfem_contact.materials.material import (
    Material,
    Split,
    State,
    deformation,
    deviator,
    dilatation,
    first_piola,
    green,
    isotropic,
    small,
    squared,
    take_numbers,
    unit,
)
from skfem_contact.records import dataclass

#: Weight of the area, as for `Body`.
Measure: TypeAlias = Callable[[Array], Array] | None


@dataclass(frozen=True, eq=False)
class Isotropic(PrintedAsCall, Material):
    """Hooke's law of the small strain or of Green's, by Young's modulus and Poisson's ratio."""

    E: float
    nu: float

    def __post_init__(self) -> None:
        take_numbers(self, E="give Young's modulus > 0", nu="give Poisson's ratio, -1 < nu < 0.5")
        if not self.E > 0.0:
            raise InputError(f"E = {self.E} is no modulus; it is finite and > 0.")
        if not -1.0 < self.nu < 0.5:
            raise InputError(
                f"nu = {self.nu} is no Poisson's ratio of linear elasticity; it is > -1 and < 0.5."
            )

    @property
    def bulk(self) -> float:
        """Bulk modulus [stress]."""
        return self.E / (3.0 * (1.0 - 2.0 * self.nu))

    @property
    def shear(self) -> float:
        """Shear modulus [stress]."""
        return self.E / (2.0 * (1.0 + self.nu))

    def hooke(self, strain: Array) -> Array:
        """Stress of a strain, both (3, 3, ...), by Hooke's law [stress]."""
        return 2.0 * self.shear * deviator(strain) + self.bulk * trace(strain) * unit(strain.ndim - 2)

    def __call__(self, H: Array, state: State) -> tuple[Array, Array, State]:
        tangent = isotropic(self.bulk, self.shear, len(H))[..., None, None]
        stress = self.hooke(self._strain(H))
        if self.finite_strain:
            stress, tangent = first_piola(deformation(H)[0], stress, tangent)
        return stress, tangent, {}

    def energy(self, H: Array, state: State) -> tuple[Array, Array]:
        strain = self._strain(H)
        energy = 0.5 * ddot(self.hooke(strain), strain)
        return energy, np.zeros_like(energy)

    def _strain(self, H: Array) -> Array:
        """Green's strain, or the small one, (3, 3, ...)."""
        return green(H) if self.finite_strain else small(H)


@with_known_keywords(
    plane="it is plane strain in 2-D; for plane stress see docs/recipes/plane_stress.md",
    rho="write density",
    alpha="write expansion",
)
@dataclass(frozen=True, eq=False)
class Elastic(Isotropic):
    r"""Linear isotropic elasticity: ``sigma = lambda tr(eps - eps_T) 1 + 2 mu (eps - eps_T)``.

    Plane strain, axisymmetric, solid. `Body` takes it in the place of a form, `NonlinearBody` as a
    material.

    Parameters
    ----------
    E : float
        Young's modulus [stress].
    nu : float
        Poisson's ratio.
    density : float, optional
        Mass by volume; for `weight`.
    expansion : float, optional
        Thermal strain by temperature; for `warmed`.

    Examples
    --------
    >>> import skfem as fem
    >>> import skfem_contact as sc
    >>> steel = sc.Elastic(210e3, 0.3, expansion=12e-6)
    >>> basis = fem.Basis(fem.MeshQuad().with_defaults(), fem.ElementVector(fem.ElementQuad1()))
    >>> block = sc.Body(basis, steel, f=steel.warmed(100.0), D="bottom")
    >>> strain = np.diag([1e-3, 0.0])[:, :, None, None]
    >>> steel.stress(strain)[:, :, 0, 0].round(2).diagonal().tolist()
    [282.69, 121.15, 121.15]
    """

    density: float = field(default=0.0, kw_only=True)
    expansion: float = field(default=0.0, kw_only=True)

    def __post_init__(self) -> None:
        super().__post_init__()
        take_numbers(
            self, density="give the mass by volume", expansion="give the thermal strain by temperature"
        )

    def stress(self, u: Any, temperature: ArrayLike = 0.0) -> Array:
        """Stress (3, 3, ...) of a displacement gradient (d, d, ...), or of a field with it as `grad`.

        Parameters
        ----------
        u : ndarray or skfem.DiscreteField
        temperature : number or ndarray of the shape of the points, optional
            Above that without stress.
        """
        strain = small(np.asarray(getattr(u, "grad", u), dtype=float))
        thermal = self.expansion * np.asarray(temperature, dtype=float)
        return self.hooke(strain - thermal * unit(strain.ndim - 2))

    def form(self, measure: Measure = None, *, axisymmetric: bool = False) -> BilinearForm:
        """The stiffness form.

        Parameters
        ----------
        measure : callable, optional
            Weight of the area, as for `Body`.
        axisymmetric : bool, optional
            With the hoop strain ``u_r / r``.

        Notes
        -----
        A body that takes the form weighs it by its own measure.

        Examples
        --------
        >>> import skfem as fem
        >>> import skfem_contact as sc
        >>> basis = fem.Basis(fem.MeshQuad(), fem.ElementVector(fem.ElementQuad1()))
        >>> K = sc.Elastic(1.0, 0.0).form().assemble(basis)
        >>> K.shape, bool(abs(K @ basis.ones()).max() < 1e-15)
        ((8, 8), True)
        """
        lam, mu = self.bulk - 2.0 / 3.0 * self.shear, self.shear

        def energy(u: Any, v: Any, w: Any, axisymmetric: bool) -> Any:
            a, b = (_strain(field, w, axisymmetric) for field in (u, v))
            return lam * trace(a) * trace(b) + 2.0 * mu * ddot(a, b)

        return VolumeStiffness(energy, measure, axisymmetric)

    def weight(self, acceleration: Any, measure: Measure = None) -> LinearForm:
        """The load of the weight under an acceleration (d,), such as ``(0, -9.81)``.

        Or under a function of the component-first position that returns its d components. A body that
        takes the form weighs it by its own measure.

        Examples
        --------
        A cube of steel weighs 77 kN [m, kg, s]:

        >>> import skfem as fem
        >>> import skfem_contact as sc
        >>> steel = sc.Elastic(210e9, 0.3, density=7850.0)
        >>> basis = fem.Basis(fem.MeshHex().with_defaults(), fem.ElementVector(fem.ElementHex1()))
        >>> cube = sc.Body(basis, steel, f=steel.weight((0.0, 0.0, -9.81)), D="bottom")
        >>> f"{cube.f.sum():.0f}"
        '-77008'

        Spun about the y axis at 100 rad/s:

        >>> spin = steel.weight(lambda x: (100.0**2 * x[0], 0 * x[1], 100.0**2 * x[2]))
        >>> wheel = sc.Body(basis, steel, f=spin, D="bottom")
        >>> f"{wheel.f[wheel.dof_component == 0].sum():.0f}"
        '39250000'
        """
        if not self.density:
            raise InputError(f"{self} has no density, and no weight: give Elastic(..., density=...)")

        def load(v: Any, w: Any, axisymmetric: bool) -> Any:
            given = acceleration(np.asarray(w.x)) if callable(acceleration) else acceleration
            usage, d = "give its components, or a function of the position that returns them", len(w.x)
            g = [
                numbers(part, "acceleration", usage)
                for part in (given if np.iterable(given) else [given])
            ]
            if len(g) != d or any(part.shape not in ((), w.x.shape[1:]) for part in g):
                raise InputError(f"acceleration {shown(given)} of a body in {d}-D: {usage}")
            return self.density * sum(part * v[i] for i, part in enumerate(g))

        return VolumeLoad(load, measure, axisymmetric=False)

    def warmed(
        self, temperature: Any, measure: Measure = None, *, axisymmetric: bool = False
    ) -> LinearForm:
        """The load of a temperature: a number, or a function of the component-first position.

        Of values T at the nodes, as of a heat problem, it is ``basis.interpolator(T)``.

        A body that takes the form weighs it by its own measure.
        """
        if not self.expansion:
            raise InputError(f"{self} does not expand: give Elastic(..., expansion=...)")

        def holding(x: Array) -> Any:
            given = temperature(x) if callable(temperature) else temperature
            usage = (
                "give a number, or a function of the position; of values at nodes basis.interpolator(T)"
            )
            T = numbers(given, "temperature", usage)
            if T.shape not in ((), x.shape[1:]):
                raise InputError(f"temperature of shape {T.shape}: {usage}")
            return 3.0 * self.bulk * self.expansion * T

        def load(v: Any, w: Any, axisymmetric: bool) -> Any:
            return holding(w.x) * trace(_strain(v, w, axisymmetric))

        return VolumeLoad(load, measure, axisymmetric, holding)


class OfMaterial:
    """A form of a material by volume, which a body weighs as its own area.

    Parameters
    ----------
    work : callable
        Of the fields of the form, and whether the body is axisymmetric.
    measure : callable or None
        Weight of the area for those who assemble the form themselves.
    axisymmetric : bool
    holding : callable or None
        Of a load that stands for strains without stress, such as those of a temperature: the pressure
        by position that would hold them back [stress].
    """

    def __init__(self, work: Any, measure: Measure, axisymmetric: bool, holding: Any = None) -> None:
        def weighed(*fields: Any) -> Any:
            found = work(*fields, axisymmetric)
            return found if measure is None else found * measure(fields[-1].x)

        super().__init__(weighed)  # type: ignore[call-arg]
        self._work, self.holding = work, holding

    def on(self, measure: Measure, axisymmetric: bool) -> Any:
        """The same form of a body with this measure; as it is where the body has none."""
        if measure is None:
            return self
        return type(self)(self._work, measure, axisymmetric, self.holding)


class VolumeLoad(OfMaterial, LinearForm):
    """The load of a material by volume."""


class VolumeStiffness(OfMaterial, BilinearForm):
    """The stiffness of a material."""


def _strain(u: Any, w: Any, axisymmetric: bool) -> Array:
    """Strain (3, 3, ...) of a field in a form."""
    strain = small(np.asarray(u.grad))
    if axisymmetric:
        strain[2, 2] = np.asarray(u)[0] / w.x[0]
    return strain


@with_known_keywords()
@dataclass(frozen=True, eq=False)
class SaintVenantKirchhoff(Isotropic):
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

    finite_strain = True


# -- rubber ----------------------------------------------------------------------------------------

Invariant: TypeAlias = Callable[[Array, int], tuple[Array, Any, Any]]


def first(C: Array, d: int) -> tuple[Array, Any, Any]:
    """``I1 = tr C``, its derivative by Green's strain, and d rows of the second."""
    return trace(C), 2.0 * unit(2), np.zeros((d,) * 4 + (1, 1))


def second(C: Array, d: int) -> tuple[Array, Any, Any]:
    """``I2 = (I1^2 - C : C) / 2``, its derivative by Green's strain, and d rows of the second."""
    I1 = trace(C)
    bend = isotropic(8.0 / 3.0, -2.0, d)[..., None, None]
    return 0.5 * (I1**2 - ddot(C, C)), 2.0 * (I1 * unit(2) - C), bend


class Hyperelastic(PrintedAsCall, Split):
    """What the materials here have in common."""

    finite_strain = True

    def __post_init__(self) -> None:
        own: Any = self
        take_numbers(self, **dict.fromkeys(own.__dataclass_fields__, "give a modulus of the energy"))
        if not (own.shear > 0.0 and own.bulk > 0.0):
            moduli = f"the shear modulus is {own.shear}, the bulk modulus {own.bulk}"
            raise InputError(f"{moduli}: both have to be > 0")

    @abstractmethod
    def _terms(self) -> tuple[tuple[float, float, Invariant], ...]:
        """Terms ``c J^a (I - 3)`` of the energy: c, a and the invariant I."""

    def isochoric(self, H: Array, state: State) -> tuple[Array, Array, State]:
        F, J, G = deformation(H)
        d, C, inverse = len(H), squared(F), squared(G)
        S, D = np.zeros_like(F), np.zeros((d,) * 4 + J.shape)
        for c, a, invariant in self._terms():
            value, slope, bend = invariant(C, d)
            scale = c * J**a
            S += scale * slope
            D += scale * bend
            if a:  # the derivative of J^a is a J^a C^-1
                S += scale * a * value * inverse
                g = inverse[:d, :d]
                mixed = np.einsum("ij...,kl...->ijkl...", slope[:d, :d], g)
                D += scale * a * (mixed + mixed.transpose(2, 3, 0, 1, 4, 5))
                both = np.einsum("ij...,kl...->ijkl...", g, g)
                turned = both.transpose(0, 2, 1, 3, 4, 5) + both.transpose(0, 2, 3, 1, 4, 5)
                D += scale * a * value * (a * both - turned)
        return (*first_piola(F, S, D), {})

    def energy(self, H: Array, state: State) -> tuple[Array, Array]:
        F, J, _ = deformation(H)
        stored = self.volumetric(dilatation(H, True)[0])[0]
        for c, a, invariant in self._terms():
            stored = stored + c * (J**a * invariant(squared(F), 0)[0] - 3.0)
        return stored, np.zeros_like(J)


@with_known_keywords(**dict.fromkeys(("E", "nu"), "write NeoHooke.of(E, nu)"))
@dataclass(frozen=True, eq=False)
class NeoHooke(Hyperelastic):
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

    def _terms(self) -> tuple[tuple[float, float, Invariant], ...]:
        return ((0.5 * self.shear, 0.0, first),)

    def volumetric(self, growth: Array) -> tuple[Array, Array, Array]:
        mu, lam, log = self.shear, self.bulk - 2.0 / 3.0 * self.shear, np.log1p(growth)
        J = 1.0 + growth
        p = (lam * log - mu) / J
        return (0.5 * lam * log - mu) * log, p, (lam - lam * log + mu) / J**2


@with_known_keywords()
@dataclass(frozen=True, eq=False)
class MooneyRivlin(Hyperelastic):
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

    def _terms(self) -> tuple[tuple[float, float, Invariant], ...]:
        terms = (self.C10, -2.0 / 3.0, first), (self.C01, -4.0 / 3.0, second)
        return tuple(term for term in terms if term[0])

    def volumetric(self, growth: Array) -> tuple[Array, Array, Array]:
        k = self.bulk
        return 0.5 * k * growth**2, k * growth, np.full_like(growth, k)
