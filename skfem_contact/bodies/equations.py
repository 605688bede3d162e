r"""The equations of a body that yields or stretches: from its material, or from forms.

The material is asked for stress P and tangent A at all points of integration, some elements at a
time. With *mean dilatation* (Simo, Taylor and Pister 1985) the part of the energy that depends on the
change of volume J takes its mean over the element, with initial volume V:

    ``W = ∫ W_iso(F) + V U(Jm)``,     ``Jm = 1/V ∫ J``

so that ``P = P_iso + U'(Jm) ∂J/∂F``, and the tangent has besides the usual terms that of the mean,
``U''(Jm)/V g g'`` with ``g = ∫ ∂J/∂F : ∂F/∂u``. With small strains J is ``1 + tr H``: this is B-bar.

Forms are scikit-fem's own, or differentiated by JAX. The displacements at points of integration are
``w["u"]`` there, as in scikit-fem's examples, and internal variables at the beginning of the step
``w["prev"]``, by name: ``w["prev"].hardening``.
"""

from __future__ import annotations

from collections import namedtuple
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import csr_matrix
from skfem.assembly import BilinearForm, LinearForm
from skfem.assembly.form.form import FormExtraParams

from skfem_contact.arguments import shown
from skfem_contact.arrays import Array, runs
from skfem_contact.bodies.gradients import Gradients
from skfem_contact.bodies.inputs import stiffness_of
from skfem_contact.bodies.linearizable import Linearized, State
from skfem_contact.digits import GIVEN
from skfem_contact.errors import InputError, MaterialError
from skfem_contact.materials.material import Material, Split, deformation, dilatation, everywhere
from skfem_contact.materials.tensors import solid
from skfem_contact.sealed import sealed_matrix


class Continuum:
    """The equations of a body of one material, see `Linearizable`.

    Parameters
    ----------
    material : Material
    gradients : Gradients
    mean_dilatation : bool
    whose : str
        The body in words.
    """

    def __init__(
        self, material: Material, gradients: Gradients, mean_dilatation: bool, whose: str
    ) -> None:
        self.material, self.gradients, self.whose = material, gradients, whose
        self.split = material if mean_dilatation and isinstance(material, Split) else None
        self.finite_strain = material.finite_strain
        self.initial_state = material.initial_state(gradients.elements, gradients.points)

    @property
    def mean_dilatation(self) -> bool:
        """Return whether the change of volume is the mean of the element."""
        return self.split is not None

    def linearize(self, u: Array, state: State) -> Linearized:
        """Stiffness, internal forces and internal variables."""
        on = self.gradients
        H, size = on.of(u), on.G.shape[0] * on.d
        K, f = np.empty((size, size, on.elements)), np.empty((size, on.elements))
        new = {name: np.empty_like(value) for name, value in state.items()}
        for some in self._parts():
            P, A, after, slope, stiff = self._response(H[:, :, some], state, some)
            Ke, f[:, some] = on.stiffness(A, some), on.forces(P, some)
            if slope is not None:
                g = on.forces(slope, some)
                Ke += stiff * g[:, None] * g
            K[..., some] = Ke
            for name, value in after.items():
                new[name][..., some, :] = value
        return Linearized(sealed_matrix(on.summed(K)), on.scattered(f), new)

    def stress(self, u: Array, state: State) -> Array:
        """Cauchy's stress (3, 3, e, q), by internal variables of before or after the step."""
        H, found = self.gradients.of(u), []
        for some in self._parts():
            P = solid(self._response(H[:, :, some], state, some)[0])
            if self.finite_strain:
                F, J, _ = deformation(H[:, :, some])
                P = np.einsum("im...,jm...->ij...", P, F) / J
            found.append(P)
        return np.concatenate(found, axis=2)

    def energy(self, u: Array, state: State) -> tuple[float, float]:
        """Energy stored and dissipated until now, of accepted internal variables."""
        H, dx = self.gradients.of(u), self.gradients.dx
        stored, dissipated = self.material.energy(H, state)
        if self.split is not None:
            growth, U = dilatation(H, self.finite_strain)[0], self.split.volumetric
            stored = stored - U(growth)[0] + U(self._mean(growth, slice(None)))[0]
        return float(np.sum(stored * dx)), float(np.sum(dissipated * dx))

    def _parts(self) -> list[slice]:
        """Elements that are looked at together: tangents fill the memory."""
        k, d = self.gradients.G.shape[:2]
        each = 8 * (self.gradients.points * d**3 * (8 * d + k) + 2 * (k * d) ** 2)
        return runs(self.gradients.elements, each)

    def _response(self, H: Array, state: State, some: slice) -> tuple[Any, ...]:
        """Ask the material, with means of the change of volume if wanted, see `Split.averaged`."""
        state = {name: value[..., some, :] for name, value in state.items()}
        try:
            if self.split is None:
                return (*self._checked(self.material(H, state), H, state), None, None)
            means = self.split.averaged(H, state, lambda growth: self._mean(growth, some))
        except MaterialError as error:
            element = None if error.element is None else error.element + some.start
            where = "" if element is None else f", element {element}"
            raise MaterialError(f"{self.whose}{where}: {error}", element) from None
        return (*means[:4], means[4][:, 0] / self.gradients.dx[some].sum(axis=1))

    def _mean(self, values: Array, some: slice) -> Array:
        """Return means over elements of values at their points (e, q), (e, 1)."""
        dx = self.gradients.dx[some]
        return np.asarray((values * dx).sum(axis=1, keepdims=True) / dx.sum(axis=1, keepdims=True))

    def _checked(self, answer: Any, H: Array, state: State) -> tuple[Array, Array, State]:
        """Refuse what a user's function returns in another shape."""
        P, A, new = answer
        P, A, d, at = np.asarray(P), np.asarray(A), len(H), H.shape[2:]
        for what, T, rank in (("stress", P, 2), ("tangent", A, 4)):
            if T.shape[:rank] not in ((d,) * rank, (3,) * rank) or T.ndim != rank + 2:
                raise InputError(
                    f"{what} of the material of {self.whose} has shape {T.shape}, not "
                    f"{(d,) * rank + at}: components first, then elements and points of integration"
                )
        bad = np.argwhere(~np.isfinite(P.sum(axis=(0, 1)) + A.sum(axis=(0, 1, 2, 3))))
        if len(bad):
            raise MaterialError("stress or tangent is NaN or infinite", int(bad[0, 0]))
        largest, scale = np.abs(A - A.transpose(2, 3, 0, 1, 4, 5)).max(), np.abs(A).max()
        if largest > GIVEN * scale:
            raise InputError(
                f"the tangent of the material of {self.whose} is not symmetric: the largest entry of "
                f"A_ijkl - A_klij is {largest:.3g}, of A {scale:.3g}. Non-associated plasticity and "
                "the like are not for this method; or it is not the derivative of the stress"
            )
        if not isinstance(new, dict) or set(new) != set(state):
            raise InputError(
                f"the material of {self.whose} returns the internal variables {sorted(new or ())}, "
                f"and was given {sorted(state)}"
            )
        return np.broadcast_to(P, P.shape[:2] + at), A, new


class Forms:
    """The equations of a body from its residual and tangent, see `NonlinearBody`."""

    def __init__(
        self,
        basis: Any,
        residual: Any,
        tangent: Any,
        state: Callable[..., Any] | None,
        initial: Mapping[str, ArrayLike] | None,
        finite_strain: bool,
        whose: str,
    ) -> None:
        for name, form, kind in (
            ("residual", residual, LinearForm),
            ("tangent", tangent, BilinearForm),
        ):
            if not isinstance(form, kind):
                raise InputError(
                    f"{name} of {whose} is {shown(form)}, not a skfem.{kind.__name__}: give both "
                    "residual and tangent; or energy=, or as residual a plain function of u, v and w, "
                    "which JAX differentiates"
                )
        if (state is None) != (initial is None):
            raise InputError(
                f"internal variables of {whose} need both: initial, a dict of their first values at a "
                "point, and state, a function of w that returns a dict of their new values"
            )
        wrong = [name for name in initial or {} if not name.isidentifier() or name.startswith("_")]
        if wrong:
            raise InputError(
                f"internal variables of {whose} are named {wrong}; forms read w['prev'].name, so that "
                "names are words without blanks and without _ at their beginning"
            )
        self.basis, self.whose, self.finite_strain = basis, whose, finite_strain
        self.residual, self.tangent, self.state = residual, tangent, state
        self.initial_state = everywhere(initial or {}, basis.nelems, basis.X.shape[1])

    def linearize(self, u: Array, state: State) -> Linearized:
        """Stiffness, internal forces and internal variables."""
        fields: dict[str, Any] = {"u": self.basis.interpolate(u)}
        if state:
            fields["prev"] = namedtuple("Previous", list(state))(*state.values())
        new: State = {}
        if self.state is not None:
            new = self.state(FormExtraParams({**self.basis.default_parameters(), **fields}))
            if not isinstance(new, dict) or set(new) != set(state):
                raise InputError(
                    f"state of {self.whose} returns {shown(new)}, not a dict of {sorted(state)}"
                )
        K = self.tangent.assemble(self.basis, **fields)
        f = self.residual.assemble(self.basis, **fields)
        return Linearized(checked(K, f, self.basis, self.whose), f, new)


class Differentiated:
    """The equations of a body from its energy or residual, by `skfem.autodiff`."""

    initial_state: Mapping[str, Any] = {}

    def __init__(self, basis: Any, energy: Any, residual: Any, finite_strain: bool, whose: str) -> None:
        try:
            from skfem.autodiff import NonlinearForm
        except ImportError as error:
            raise InputError(
                f"{whose} is given by {'an energy' if energy else 'a residual alone'}, "
                "which JAX differentiates, and it is not installed: pip install "
                "skfem-contact[autodiff]; or give residual and tangent as forms, or a material"
            ) from error
        self.basis, self.whose, self.finite_strain = basis, whose, finite_strain
        self.form = NonlinearForm(energy, hessian=True) if energy else NonlinearForm(residual)
        self.density = energy

    def linearize(self, u: Array, state: State) -> Linearized:
        """Stiffness and internal forces; there are no internal variables."""
        K, minus = self.form.assemble(self.basis, x=u)
        return Linearized(checked(K, minus, self.basis, self.whose), -minus, {})

    def energy(self, u: Array, state: State) -> tuple[float, float]:
        """Energy stored and dissipated."""
        if self.density is None:
            raise InputError(f"{self.whose} is given by a residual: its energy is not known")
        w = FormExtraParams(self.basis.default_parameters())
        density = np.asarray(self.density(self.basis.interpolate(u), w))
        return float(np.sum(density * self.basis.dx)), 0.0


def checked(K: csr_matrix, f: Array, basis: Any, whose: str) -> csr_matrix:
    """A tangent that is symmetric; others, and NaN, are refused."""
    if not np.isfinite(f).all() or not np.isfinite(K.data).all():
        raise MaterialError(f"{whose}: internal forces or tangent are NaN or infinite")
    return stiffness_of(K, basis, whose)
