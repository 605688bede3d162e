"""`Elastic`: linear isotropic elasticity, for linear bodies and others."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from skfem.assembly import BilinearForm, LinearForm

from skfem_contact.arguments import PrintedAsCall, with_known_keywords
from skfem_contact.arrays import Array
from skfem_contact.materials.material import Isotropic, State, take_numbers
from skfem_contact.materials.tensors import double, isotropic, solid, symmetric, trace, unit
from skfem_contact.records import dataclass


@with_known_keywords(
    plane="it is plane strain in 2-D; for plane stress see docs/recipes/plane_stress.md",
    rho="write density",
    alpha="write expansion",
)
@dataclass(frozen=True, eq=False)
class Elastic(PrintedAsCall, Isotropic):
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

    E: float
    nu: float
    density: float = field(default=0.0, kw_only=True)
    expansion: float = field(default=0.0, kw_only=True)

    def __post_init__(self) -> None:
        super().__post_init__()
        take_numbers(
            self, density="give the mass by volume", expansion="give the thermal strain by temperature"
        )

    def __call__(self, H: Array, state: State) -> tuple[Array, Array, State]:
        tangent = isotropic(self.bulk, self.shear, len(H))[..., None, None]
        return self.stress(H), tangent, {}

    def energy(self, H: Array, state: State) -> tuple[Array, Array]:
        stored = 0.5 * double(self.stress(H), solid(symmetric(H)))
        return stored, np.zeros_like(stored)

    def stress(self, u: Any, temperature: ArrayLike = 0.0) -> Array:
        """Stress (3, 3, ...) of a displacement gradient (d, d, ...), or of a field with it as `grad`.

        Parameters
        ----------
        u : ndarray or skfem.DiscreteField
        temperature : number or ndarray of the shape of the points, optional
            Above that without stress.
        """
        strain = symmetric(solid(np.asarray(getattr(u, "grad", u), dtype=float)))
        thermal = self.expansion * np.asarray(temperature, dtype=float)
        spherical = (self.bulk - 2.0 / 3.0 * self.shear) * trace(strain) - 3.0 * self.bulk * thermal
        return 2.0 * self.shear * strain + spherical * unit(strain.ndim - 2)

    def form(
        self, measure: Callable[[Array], Array] | None = None, *, axisymmetric: bool = False
    ) -> BilinearForm:
        """The stiffness form.

        Parameters
        ----------
        measure : callable, optional
            Weight of the area, as for `Body`.
        axisymmetric : bool, optional
            With the hoop strain ``u_r / r``.
        """
        lam, mu = self.bulk - 2.0 / 3.0 * self.shear, self.shear

        def energy(u: Any, v: Any, w: Any) -> Any:
            a, b = (_strain(field, w, axisymmetric) for field in (u, v))
            density = lam * trace(a) * trace(b) + 2.0 * mu * double(a, b)
            return density if measure is None else density * measure(w.x)

        return BilinearForm(energy)

    def weight(
        self, acceleration: ArrayLike, measure: Callable[[Array], Array] | None = None
    ) -> LinearForm:
        """The load of the weight under an acceleration (d,), such as ``(0, -9.81)``."""
        g = np.asarray(acceleration, dtype=float)

        def load(v: Any, w: Any) -> Any:
            force = self.density * sum(g[i] * v[i] for i in range(len(g)))
            return force if measure is None else force * measure(w.x)

        return LinearForm(load)

    def warmed(
        self,
        temperature: Any,
        measure: Callable[[Array], Array] | None = None,
        *,
        axisymmetric: bool = False,
    ) -> LinearForm:
        """The load of a temperature: a number, or a function of the component-first position."""

        def load(v: Any, w: Any) -> Any:
            T = temperature(w.x) if callable(temperature) else temperature
            stress = 3.0 * self.bulk * self.expansion * T
            work = stress * trace(_strain(v, w, axisymmetric))
            return work if measure is None else work * measure(w.x)

        return LinearForm(load)


def _strain(u: Any, w: Any, axisymmetric: bool) -> Array:
    """Strain (3, 3, ...) of a field in a form."""
    strain = symmetric(solid(np.asarray(u.grad)))
    if axisymmetric:
        strain[2, 2] = np.asarray(u)[0] / w.x[0]
    return strain
