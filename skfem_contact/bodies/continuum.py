r"""The equations of a body from its material.

The material is asked for stress P and tangent A at all points of integration, some elements at a
time. With *mean dilatation* (Simo, Taylor and Pister 1985) the part of the energy that depends on the
change of volume J takes its mean over the element, with initial volume V:

    ``W = ∫ W_iso(F) + V U(Jm)``,     ``Jm = 1/V ∫ J``

so that ``P = P_iso + U'(Jm) ∂J/∂F``, and the tangent has besides the usual terms that of the mean,
``U''(Jm)/V g g'`` with ``g = ∫ ∂J/∂F : ∂F/∂u``. With small strains J is ``1 + tr H``: this is B-bar.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skfem_contact.bodies.gradients import Gradients
from skfem_contact.bodies.linearizable import Linearized, State
from skfem_contact.bodies.thresholds import BYTES_AT_ONCE
from skfem_contact.digits import GIVEN
from skfem_contact.errors import InputError, MaterialError
from skfem_contact.materials.material import Material
from skfem_contact.materials.tensors import trace
from skfem_contact.sealed import sealed_matrix

Array = NDArray[np.float64]


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
        self.mean_dilatation = mean_dilatation
        self.finite_strain = material.finite_strain
        self.initial_state = material.initial_state(gradients.elements, gradients.points)

    def linearize(self, u: Array, state: State) -> Linearized:
        """Stiffness, internal forces and internal variables."""
        on = self.gradients
        H = on.of(u)
        K, f, states = [], [], []
        for some in self._parts():
            P, A, new, mean = self._answer(H[:, :, some], part_of(state, some), some)
            Ke = on.stiffness(A, some)
            if mean is not None:
                g = on.forces(mean[1], some)
                Ke += mean[0][:, None, None] * g[:, :, None] * g[:, None]
            K.append(Ke)
            f.append(on.forces(P, some))
            states.append(new)
        Ke, fe = np.concatenate(K), np.concatenate(f)
        new = {key: np.concatenate([s[key] for s in states], axis=-2) for key in states[0]}
        return Linearized(sealed_matrix(on.summed(symmetrised(Ke, self.whose))), on.scattered(fe), new)

    def _parts(self) -> Iterator[slice]:
        """Elements that are looked at together: tangents fill the memory."""
        k, d = self.gradients.G.shape[1], self.gradients.G.shape[2]
        each = 8 * (self.gradients.points * d**4 * (2 + k) + 2 * (k * d) ** 2)
        count = max(1, BYTES_AT_ONCE // each)
        for first in range(0, self.gradients.elements, count):
            yield slice(first, min(first + count, self.gradients.elements))

    def _answer(self, H: Array, state: State, some: slice) -> tuple[Array, Array, State, Any]:
        """Stress, tangent, new state, and of the mean dilatation ``U''/V`` and ``∂J/∂F``."""
        try:
            if not self.mean_dilatation:
                P, A, new = self.material(H, state)
                return *self._checked(P, A, new, H, state), None
            P, A, new = self.material.isochoric(H, state)
            dx = self.gradients.dx[some]
            J, slope, bend = dilatation(H, self.material.finite_strain)
            volume = dx.sum(axis=1)
            _, p, dp = self.material.volumetric((J * dx).sum(axis=1) / volume)
            d = len(H)
            P = P[:d, :d] + p[:, None] * slope
            if bend is not None:
                A = A + p[:, None] * bend
            return P, A, new, (dp / volume, slope)
        except MaterialError as error:
            element = None if error.element is None else error.element + some.start
            where = "" if element is None else f", element {element}"
            raise MaterialError(f"{self.whose}{where}: {error}", element) from None

    def _checked(self, P: Any, A: Any, new: Any, H: Array, state: State) -> tuple[Any, Any, Any]:
        """Refuse what a user's function returns in another shape."""
        P, A, d, at = np.asarray(P), np.asarray(A), len(H), H.shape[2:]
        for what, T, rank in (("stress", P, 2), ("tangent", A, 4)):
            if T.shape[:rank] not in ((d,) * rank, (3,) * rank) or T.ndim != rank + 2:
                wanted = (d,) * rank + at
                raise InputError(
                    f"{what} of the material of {self.whose} has shape {T.shape}, not {wanted}: "
                    "components come first, then elements and points of integration"
                )
        if not np.isfinite(P).all() or not np.isfinite(A).all():
            bad = np.argwhere(~np.isfinite(P.sum(axis=(0, 1)) + A.sum(axis=(0, 1, 2, 3))))
            raise MaterialError("stress or tangent is NaN or infinite", int(bad[0, 0]))
        if not isinstance(new, dict) or set(new) != set(state):
            raise InputError(
                f"the material of {self.whose} returns the internal variables {sorted(new or ())}, "
                f"and was given {sorted(state)}"
            )
        return P, A, new


def part_of(state: State, some: slice) -> dict[str, Array]:
    """Internal variables of some elements."""
    return {name: value[..., some, :] for name, value in state.items()}


def dilatation(H: Array, finite: bool) -> tuple[Array, Array, Array | None]:
    """Return J (e, q), its derivative by H (d, d, e, q), and the second one; None if it is zero."""
    d = len(H)
    one = np.eye(d)[:, :, None, None]
    if not finite:
        return 1.0 + trace(H), np.broadcast_to(one, H.shape), None
    F = H + one
    J = np.linalg.det(np.moveaxis(F, (0, 1), (-2, -1)))
    G = np.moveaxis(np.linalg.inv(np.moveaxis(F, (0, 1), (-1, -2))), (-2, -1), (0, 1))
    cofactor = J * G
    bend = np.einsum("ij...,kl...->ijkl...", cofactor, G)
    return J, cofactor, bend - bend.transpose(0, 3, 2, 1, 4, 5)


def symmetrised(K: Array, whose: str) -> Array:
    """Element matrices that are symmetric to the last digit; others are refused."""
    transpose = K.swapaxes(1, 2)
    largest, scale = np.abs(K - transpose).max(), np.abs(K).max()
    if largest > GIVEN * scale:
        raise InputError(
            f"the tangent of {whose} is not symmetric: the largest entry of K - K' of an element is "
            f"{largest:.3g}, of K {scale:.3g}. Non-associated plasticity and the like are not for "
            "this method; or the tangent is not the derivative of the stress"
        )
    return np.asarray(0.5 * (K + transpose))
