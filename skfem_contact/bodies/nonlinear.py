"""`NonlinearBody`: a body whose internal forces are not proportional to its displacements."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import field
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray
from skfem.assembly import CellBasis

from skfem_contact.arguments import check_switch, with_known_keywords
from skfem_contact.arrays import check_finite, check_size, rectangular
from skfem_contact.bodies.body import Body
from skfem_contact.bodies.continuum import Continuum
from skfem_contact.bodies.gradients import Gradients
from skfem_contact.bodies.inputs import Dofs, Loads, Values, check_points
from skfem_contact.bodies.linearizable import Linearized, State
from skfem_contact.bodies.quadrature import LINEAR, scalar_element
from skfem_contact.errors import InputError
from skfem_contact.materials.material import FromFunction, Material
from skfem_contact.records import dataclass

Array = NDArray[np.float64]


@with_known_keywords(load="write f")
@dataclass(frozen=True, eq=False, init=False)
class NonlinearBody(Body):
    """A body that yields or strains by large amounts.

    Parameters
    ----------
    basis : skfem.CellBasis
        Basis of an `ElementVector`, as for `Body`.
    material : Material or callable
        One of `skfem_contact.materials`, or a function ``(H, state) -> stress, tangent, state`` of
        small strain without internal variables; see `FromFunction` for others.
    f, D, x, measure, name
        As for `Body`.

    Attributes
    ----------
    K : csr_matrix, shape (n, n)
        The tangent of the undeformed body.
    material : Material
    """

    nonlinear: ClassVar[bool] = True  # type: ignore[misc]
    material: Any = field(init=False)
    equations: Any = field(init=False, repr=False)

    def __init__(
        self,
        basis: CellBasis,
        material: Any,
        f: Loads | None = None,
        *,
        D: Dofs | None = None,
        x: Values | None = None,
        measure: Callable[[Array], Array] | None = None,
        mean_dilatation: bool | None = None,
        name: str | None = None,
    ) -> None:
        whose = self._place(basis, measure, name)
        if self.components == 1:
            raise InputError(f"{whose} is a scalar problem: NonlinearBody has displacements")
        check_points(basis, f"the internal force of {whose}")
        if not isinstance(material, Material):
            material = FromFunction(material)
        if mean_dilatation is None:
            first = isinstance(scalar_element(basis.elem), LINEAR)
            mean_dilatation = material.mean_dilatation and first
        check_switch(mean_dilatation, "mean_dilatation")
        gradients = Gradients(basis, measure, self.axisymmetric, whose)
        equations = Continuum(material, gradients, mean_dilatation, whose)
        for key, value in {"material": material, "equations": equations}.items():
            object.__setattr__(self, key, value)
        K = equations.linearize(np.zeros(self.n), equations.initial_state).K
        super().__init__(basis, K, f, D=D, x=x, measure=measure, name=name)

    @property
    def finite_strain(self) -> bool:  # type: ignore[override]
        """Whether the body may turn and strain by any amount (total Lagrangian)."""
        return bool(self.equations.finite_strain)

    @property
    def initial_state(self) -> State:
        """Internal variables of the undeformed body."""
        return dict(self.equations.initial_state)

    def linearize(self, u: Array | None = None, state: State | None = None) -> Linearized:
        """Tangent, internal forces and internal variables at displacements u, see `Linearizable`."""
        return self.equations.linearize(self._displacements(u), self._state(state))

    def _displacements(self, u: Any) -> Array:
        if u is None:
            return np.zeros(self.n)
        values = np.asarray(rectangular(u, "u", f"not a vector of {self.n} numbers"), dtype=float)
        check_size(values, self.n, "u", f"its body has {self.n} DOFs; take result.displacement(body)")
        check_finite(values, "u", "DOF")
        return values

    def _state(self, state: State | None) -> State:
        return self.initial_state if state is None else state
