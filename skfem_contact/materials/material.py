"""`Material`: what a body asks of what it is made of; `FromFunction`: one's own."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from skfem_contact.arguments import check_switch, shown
from skfem_contact.errors import InputError

Array = NDArray[np.float64]
State = Mapping[str, Array]


class Material(ABC):
    r"""Stress, tangent and internal variables at points of integration.

    All arrays have components first, then elements and points of integration: a displacement gradient
    is ``H[i, j, e, q]``, the derivative of the displacement i by the coordinate j. In plane strain d
    is 2; solids and axisymmetric bodies have 3, the third axis of the latter being the hoop direction
    with ``H[2, 2] = u_r / r``.

    Attributes
    ----------
    finite_strain : bool
        False: strain is the symmetric part of H, stress is Cauchy's. True: ``F = 1 + H`` may be large,
        and stress is the first Piola-Kirchhoff stress, force by initial area.
    mean_dilatation : bool
        Whether `NonlinearBody` should take means of the change of volume over elements of first order,
        which lock otherwise. Such materials have `isochoric` and `volumetric`.
    """

    finite_strain: bool = False
    mean_dilatation: bool = False

    @abstractmethod
    def __call__(self, H: Array, state: State) -> tuple[Array, Array, State]:
        """Stress, its derivative by H, and internal variables after the step.

        Parameters
        ----------
        H : ndarray, shape (d, d, e, q)
            Displacement gradient at the end of the step.
        state : dict of ndarray
            Internal variables at its beginning, each of shape (..., e, q).

        Returns
        -------
        stress : ndarray, shape (d, d, e, q) or (3, 3, e, q)
        tangent : ndarray, shape (d, d, d, d, e, q) or what broadcasts to it
            ``tangent[i, j, k, l]`` is the derivative of ``stress[i, j]`` by ``H[k, l]``.
        state : dict of ndarray
            New arrays with the names of those that were given.

        Raises
        ------
        MaterialError
            Where there is no answer.
        """

    def initial_state(self, elements: int, points: int) -> dict[str, Array]:
        """Internal variables of the virgin material; none."""
        return {}

    def energy(self, H: Array, state: State) -> tuple[Array, Array]:
        """Energy by initial volume, stored and dissipated until now, each of shape (e, q).

        Raises
        ------
        NotImplementedError
            If the material does not say.
        """
        raise NotImplementedError(f"{type(self).__name__} does not say its energy")

    def isochoric(self, H: Array, state: State) -> tuple[Array, Array, State]:
        """The part of `__call__` that does not depend on the change of volume."""
        raise NotImplementedError

    def volumetric(self, J: Array) -> tuple[Array, Array, Array]:
        """Energy by initial volume of a change of volume J = 1 + tr H or det F, and two derivatives."""
        raise NotImplementedError


class FromFunction(Material):
    """A material from a function of the displacement gradient and the internal variables.

    Parameters
    ----------
    function : callable
        ``(H, state) -> stress, tangent, state``, see `Material`.
    initial : dict of number or ndarray, optional
        Initial values of internal variables at one point.
    finite_strain : bool, optional
        Whether H is taken as it is, and stress is the first Piola-Kirchhoff stress.

    Examples
    --------
    Linear elasticity without lateral contraction:

    >>> from skfem_contact.materials import FromFunction
    >>> one = np.eye(2)
    >>> A = 0.5 * (np.einsum("ik,jl->ijkl", one, one) + np.einsum("il,jk->ijkl", one, one))
    >>> A = A[..., None, None]
    >>> law = FromFunction(lambda H, state: (0.5 * (H + H.swapaxes(0, 1)), A, state))
    >>> stress, _, _ = law(np.ones((2, 2, 3, 4)), {})
    >>> stress.shape
    (2, 2, 3, 4)
    """

    def __init__(
        self,
        function: Callable[[Array, State], tuple[Any, Any, Any]],
        initial: Mapping[str, ArrayLike] | None = None,
        *,
        finite_strain: bool = False,
    ) -> None:
        if not callable(function):
            raise InputError(
                f"material is {shown(function)}, not a function (H, state) -> stress, tangent, state, "
                "or one of skfem_contact.materials"
            )
        check_switch(finite_strain, "finite_strain")
        self.function, self.finite_strain = function, finite_strain
        self.initial = {name: np.array(value, dtype=float) for name, value in (initial or {}).items()}

    def __call__(self, H: Array, state: State) -> tuple[Array, Array, State]:
        stress, tangent, new = self.function(H, state)
        return stress, tangent, new

    def initial_state(self, elements: int, points: int) -> dict[str, Array]:
        return {
            name: np.multiply.outer(value, np.ones((elements, points)))
            for name, value in self.initial.items()
        }
