"""`FromFelupe`: small-strain materials with the signature that felupe's `MaterialStrain` takes."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from skfem_contact.arrays import Array
from skfem_contact.materials.material import Material, State, everywhere
from skfem_contact.materials.tensors import solid, symmetric


class FromFelupe(Material):
    """A material ``(strain increment, strain, stress, state variables) -> tangent, stress, variables``.

    Old values are those at the beginning of the step. Arrays are (3, 3, q, e), points of integration
    before cells; the function also gets ``tangent=True``.

    Parameters
    ----------
    function : callable
    statevars : sequence of tuple, optional
        Shapes of the state variables.
    **parameters
        Passed to the function, such as its moduli.

    Examples
    --------
    >>> import numpy as np
    >>> from skfem_contact.materials import FromFelupe
    >>> def elastic(de, e, s, z, mu, tangent):
    ...     one = np.eye(3)
    ...     A = np.einsum("ik,jl->ijkl", one, one) + np.einsum("il,jk->ijkl", one, one)
    ...     return mu * A[..., None, None], s + 2 * mu * de, z
    >>> law = FromFelupe(elastic, mu=0.5)
    >>> stress, tangent, state = law(np.ones((2, 2, 5, 4)), law.initial_state(5, 4))
    >>> stress.shape, sorted(state)
    ((3, 3, 5, 4), ['strain', 'stress'])
    """

    def __init__(
        self,
        function: Callable[..., Any],
        statevars: tuple[tuple[int, ...], ...] = (),
        **parameters: Any,
    ) -> None:
        self.function, self.statevars, self.parameters = function, tuple(statevars), parameters

    def initial_state(self, elements: int, points: int) -> dict[str, Array]:
        shapes: dict[str, tuple[int, ...]] = {"strain": (3, 3), "stress": (3, 3)}
        shapes |= {f"statevar_{i + 1}": tuple(shape) for i, shape in enumerate(self.statevars)}
        return everywhere({name: np.zeros(shape) for name, shape in shapes.items()}, elements, points)

    def __call__(self, H: Array, state: State) -> tuple[Array, Array, State]:
        strain = symmetric(solid(H))
        e, s, *z = (value.swapaxes(-1, -2) for value in state.values())
        A, stress, new = self.function(
            strain.swapaxes(-1, -2) - e, e, s, z, tangent=True, **self.parameters
        )
        d = len(H)
        stress = np.asarray(stress).swapaxes(-1, -2)
        names = [name for name in state if name.startswith("statevar")]
        after = {name: np.asarray(z).swapaxes(-1, -2) for name, z in zip(names, new, strict=True)}
        tangent = np.asarray(A).swapaxes(-1, -2)[:d, :d, :d, :d]
        return stress, tangent, {"strain": strain, "stress": stress, **after}
