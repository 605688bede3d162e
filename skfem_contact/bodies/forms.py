"""The equations of a body from forms: scikit-fem's own, or differentiated by JAX.

The displacements at points of integration are ``w["u"]``, as in scikit-fem's examples, and internal
variables at the beginning of the step ``w["prev"]``, by name: ``w["prev"].hardening``.
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
from skfem_contact.arrays import Array
from skfem_contact.bodies.inputs import stiffness_of
from skfem_contact.bodies.linearizable import Linearized, State
from skfem_contact.errors import InputError, MaterialError
from skfem_contact.materials.material import everywhere


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
