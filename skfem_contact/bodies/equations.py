r"""The equations of a body that yields or stretches: from its material, or from forms.

The material is asked for stress P and tangent A at all points of integration, some elements at a
time. With *mean dilatation* (Simo, Taylor and Pister 1985) the part of the energy that depends on the
change of volume J takes its mean over the element, with initial volume V:

    ``W = ∫ W_iso(F) + V U(Jm)``,     ``Jm = 1/V ∫ J``

so that ``P = P_iso + U'(Jm) ∂J/∂F``, and the tangent has besides the usual terms that of the mean,
``U''(Jm)/V g g'`` with ``g = ∫ ∂J/∂F : ∂F/∂u``. With small strains J is ``1 + tr H``: this is B-bar.

Displacement gradients are sums over the scalar shape functions N_a with ``G_aj = ∂_j N_a``,

    ``H_ij = u_ai G_aj``,    ``f_ai = ∫ G_aj P_ij``,    ``K_(ai)(bk) = ∫ G_aj A_ijkl G_bl``.

An axisymmetric body has the third direction j = 2, with ``G_a2 = N_a / r``, for the radial component
alone: ``H_22 = u_r / r``. Elements are the last axis of arrays there, so that each product is one of
long vectors: forms that are called for every two shape functions take twice as long.

Forms are scikit-fem's own, or differentiated by JAX. The displacements at points of integration are
``w["u"]`` there, as in scikit-fem's examples, and internal variables at the beginning of the step
``w["prev"]``, by name: ``w["prev"].hardening``.
"""

from __future__ import annotations

from collections import namedtuple
from collections.abc import Callable, Mapping
from functools import cached_property
from itertools import combinations_with_replacement
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import csr_matrix
from skfem.assembly import BilinearForm, LinearForm
from skfem.assembly.form.form import FormExtraParams

from skfem_contact.arguments import check_kind, shown
from skfem_contact.arrays import Array, runs
from skfem_contact.bodies.assembly import (
    NeedsMore,
    check_numbering,
    pattern,
    point_volumes,
    scalar_element,
    shape_gradients,
)
from skfem_contact.bodies.inputs import stiffness_of
from skfem_contact.bodies.member import Linearized, State
from skfem_contact.digits import GIVEN
from skfem_contact.errors import InputError, MaterialError
from skfem_contact.materials.material import deformation, dilatation, everywhere, solid
from skfem_contact.records import sealed_matrix


class Gradients:
    """Gradients on a basis of displacements.

    Parameters
    ----------
    basis : skfem.CellBasis
    measure : callable or None
        Weight of the area by position.
    axisymmetric : bool

    Attributes
    ----------
    G : ndarray, shape (k, j, q, e)
        Gradients of the shape functions [1/length].
    dx : ndarray, shape (e, q)
        Weights of the points of integration, with the measure.
    slots : list
        For each component its directions j of G, and the entry of a tensor for each of them.
    """

    def __init__(self, basis: Any, measure: Any, axisymmetric: bool, whose: str) -> None:
        try:
            check_numbering(basis)
        except NeedsMore as error:
            raise InputError(f"the basis of {whose}: {error}; take skfem.Basis") from error
        self.basis, self.axisymmetric = basis, axisymmetric
        self.d = int(basis.mesh.dim())
        self.slots = [[(j, i, j) for j in range(self.d)] for i in range(self.d)]
        G = shape_gradients(basis, basis.tind).transpose(2, 1, 3, 0)
        self.dx = point_volumes(basis, basis.tind)
        x = np.asarray(basis.mapping.F(basis.X, basis.tind))
        if measure is not None:
            self.dx = self.dx * measure(x)
        if axisymmetric:
            element = scalar_element(basis.elem)
            N = np.stack([element.lbasis(basis.X, a)[0] for a in range(len(G))])  # (k, q)
            G = np.concatenate([G, (N[:, :, None] / x[0].T)[:, None]], axis=1)
            self.slots[0].append((2, 2, 2))
        self.G = np.ascontiguousarray(G)

    def of(self, u: Array) -> Array:
        """Displacement gradient (d, d, e, q) of displacements (n,); of three rows if axisymmetric."""
        values = u[self.basis.element_dofs].reshape(len(self.G), self.d, -1)
        H = np.ascontiguousarray(np.einsum("aie,ajqe->ijqe", values, self.G).swapaxes(2, 3))
        if self.axisymmetric:
            H, hoop = solid(H[:, :2]), H[0, 2]
            H[2, 2] = hoop
        return H

    def forces(self, P: Array, some: slice = slice(None)) -> Array:
        """``∫ G_aj P_ij`` of a stress (d, d, e, q) on some elements, shape (k d, e)."""
        G, dx = self.G[..., some], self.dx[some]
        out = np.zeros((len(G), self.d, len(dx)))
        for i in range(self.d):
            for j, row, column in self.slots[i]:
                weighted = np.ascontiguousarray((P[row, column] * dx).T)
                out[:, i] += np.einsum("aqe,qe->ae", G[:, j], weighted)
        return out.reshape(-1, len(dx))

    def stiffness(self, A: Array, some: slice = slice(None)) -> Array:
        """``∫ G_aj A_ijkl G_bl`` of a tangent (d, d, d, d, e, q), symmetric, shape (k d, k d, e)."""
        G, dx = self.G[..., some], self.dx[some]
        n, d = len(G), self.d
        K = np.empty((n, d, n, d, len(dx)))
        for i, k in combinations_with_replacement(range(d), 2):
            block = np.zeros((n, n, len(dx)))
            for j, r, s in self.slots[i]:
                along = np.zeros((n, *G.shape[2:]))  # A_ijkl G_bl
                for l, t, v in self.slots[k]:
                    along += np.ascontiguousarray((A[r, s, t, v] * dx).T) * G[:, l]
                block += np.einsum("aqe,bqe->abe", G[:, j], along)
            other = block.swapaxes(0, 1)
            if i == k:  # symmetric, to the last digit
                block = 0.5 * (block + other)
                other = block
            K[:, i, :, k], K[:, k, :, i] = block, other
        return K.reshape(n * d, n * d, len(dx))

    @cached_property
    def _pattern(self) -> tuple[Any, Any, Any]:
        starts, columns, place = pattern(self.basis.element_dofs, self.basis.N)
        return starts, columns, np.ascontiguousarray(place.transpose(1, 2, 0)).ravel()

    def summed(self, K: Array) -> csr_matrix:
        """The matrix (n, n) of all element matrices (k d, k d, e)."""
        starts, columns, place = self._pattern
        data = np.bincount(place, K.ravel(), minlength=len(columns))
        out = csr_matrix((data, columns, starts), shape=(self.basis.N,) * 2)
        out.has_canonical_format = True
        return out


def scattered(f: Array, basis: Any) -> Array:
    """The vector (n,) of all element vectors (k d, e)."""
    return np.bincount(basis.element_dofs.ravel(), f.ravel(), minlength=basis.N).astype(float)


class Continuum:
    """The equations of a body of one material, see `Member`.

    Parameters
    ----------
    material : Material
        With mean dilatation one that is `Split`.
    gradients : Gradients
    mean_dilatation : bool
    whose : str
        The body in words.
    """

    def __init__(self, material: Any, gradients: Gradients, mean_dilatation: bool, whose: str) -> None:
        self.material, self.gradients, self.whose = material, gradients, whose
        self.mean_dilatation, self.finite_strain = mean_dilatation, material.finite_strain
        self.initial_state = material.initial_state(*gradients.dx.shape)

    def linearize(self, u: Array, state: State) -> Linearized:
        """Stiffness, internal forces and internal variables."""
        on = self.gradients
        H, size, elements = on.of(u), len(on.G) * on.d, len(on.dx)
        K, f = np.empty((size, size, elements)), np.empty((size, elements))
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
        return Linearized(sealed_matrix(on.summed(K)), scattered(f, on.basis), new)

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
        if self.mean_dilatation:
            growth, U = dilatation(H, self.finite_strain)[0], self.material.volumetric
            stored = stored - U(growth)[0] + U(self._mean(growth, slice(None)))[0]
        return float(np.sum(stored * dx)), float(np.sum(dissipated * dx))

    def _parts(self) -> list[slice]:
        """Elements that are looked at together: tangents fill the memory."""
        k, d = self.gradients.G.shape[:2]
        elements, points = self.gradients.dx.shape
        return runs(elements, 8 * (points * d**3 * (8 * d + k) + 2 * (k * d) ** 2))

    def _response(self, H: Array, state: State, some: slice) -> tuple[Any, ...]:
        """Ask the material, with means of the change of volume if wanted, see `Split.averaged`."""
        state = {name: value[..., some, :] for name, value in state.items()}
        try:
            if not self.mean_dilatation:
                return (*self._checked(self.material(H, state), H, state), None, None)
            means = self.material.averaged(H, state, lambda growth: self._mean(growth, some))
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
        if not isinstance(answer, list | tuple) or len(answer) != 3:
            raise InputError(
                f"the material of {self.whose} returned {shown(answer)}; it has to return three, "
                "(stress, tangent, state), the last {} without internal variables"
            )
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
        check_names(new, state, f"the material of {self.whose}")
        return np.broadcast_to(P, P.shape[:2] + at), A, new


class Forms:
    """The equations of a body from its residual and tangent, see `NonlinearBody`."""

    material, mean_dilatation = None, False

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
        usage = (
            "give both residual and tangent; or energy=, or as residual a plain function of u, v and "
            "w, which JAX differentiates"
        )
        check_kind(residual, LinearForm, f"residual of {whose}", usage, "skfem.LinearForm")
        check_kind(tangent, BilinearForm, f"tangent of {whose}", usage, "skfem.BilinearForm")
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
            check_names(new, state, f"state of {self.whose}")
        K, f = self._assembled(u, fields)
        if not np.isfinite(f).all() or not np.isfinite(K.data).all():
            raise MaterialError(f"{self.whose}: internal forces or tangent are NaN or infinite")
        return Linearized(stiffness_of(K, self.basis, self.whose), f, new)

    def _assembled(self, u: Array, fields: Mapping[str, Any]) -> tuple[Any, Array]:
        """Tangent and internal forces."""
        return tuple(form.assemble(self.basis, **fields) for form in (self.tangent, self.residual))


class Differentiated(Forms):
    """The equations of a body from its energy or residual, by `skfem.autodiff`."""

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
        self.density, self.state, self.initial_state = energy, None, {}

    def _assembled(self, u: Array, fields: Mapping[str, Any]) -> tuple[Any, Array]:
        K, minus = self.form.assemble(self.basis, x=u)
        return K, -minus

    def energy(self, u: Array, state: State) -> tuple[float, float]:
        """Energy stored and dissipated."""
        if self.density is None:
            raise InputError(f"{self.whose} is given by a residual: its energy is not known")
        w = FormExtraParams(self.basis.default_parameters())
        density = np.asarray(self.density(self.basis.interpolate(u), w))
        return float(np.sum(density * self.basis.dx)), 0.0


def check_names(new: Any, known: State, what: str) -> None:
    """Refuse what a user's function returns in the place of new internal variables."""
    if not isinstance(new, dict) or set(new) != set(known):
        given = sorted(new) if isinstance(new, dict) else shown(new)
        raise InputError(
            f"{what} returns the internal variables {given}, not a dict of {sorted(known)}"
        )
