"""`Material`: what a body asks of what it is made of; `FromFunction`, `FromFelupe`: one's own."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from skfem_contact.arguments import check_switch, number, shown
from skfem_contact.arrays import Array
from skfem_contact.errors import InputError
from skfem_contact.materials.tensors import dilatation, small

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
    initial : dict of number or ndarray
        Internal variables of the virgin material at one point, by name; none.
    mean_dilatation : bool
        Whether `NonlinearBody` should take means of the change of volume over elements of first order,
        which lock otherwise; for materials that are `Split`.

    Examples
    --------
    A bed of springs that only resists a change of volume:

    >>> class Bed(Material):
    ...     def __call__(self, H, state):
    ...         one = np.eye(len(H))[..., None, None]
    ...         return np.trace(H) * one, np.einsum("ij...,kl...->ijkl...", one, one), state
    >>> Bed()(np.ones((2, 2, 1, 1)), {})[0][..., 0, 0].tolist()
    [[2.0, 0.0], [0.0, 2.0]]
    """

    finite_strain: bool = False
    mean_dilatation: bool = False
    initial: Mapping[str, ArrayLike] = {}

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
        """Internal variables of the virgin material."""
        return everywhere(self.initial, elements, points)

    def energy(self, H: Array, state: State) -> tuple[Array, Array]:
        """Energy by initial volume, stored and dissipated until now, each of shape (e, q).

        Raises
        ------
        InputError
            If the material does not say.
        """
        raise InputError(f"{type(self).__name__} does not say its energy: it needs `energy`")


class Split(Material):
    """A material whose energy is one of the shape and one of the volume, ``W_iso(F) + U(J)``.

    Examples
    --------
    >>> from skfem_contact.materials import NeoHooke
    >>> rubber = NeoHooke(shear=1.0, bulk=1000.0)
    >>> isinstance(rubber, Split), rubber.mean_dilatation
    (True, False)
    """

    @abstractmethod
    def isochoric(self, H: Array, state: State) -> tuple[Array, Array, State]:
        """Stress (3, 3, e, q), tangent and internal variables of the shape, as of `__call__`."""

    @abstractmethod
    def volumetric(self, growth: Array) -> tuple[Array, Array, Array]:
        """U by initial volume, and two derivatives, of ``det F - 1``, ``tr H`` at small strains."""

    def averaged(self, H: Array, state: State, mean: Callable[[Array], Array]) -> tuple[Any, ...]:
        """Stress, tangent and internal variables with a mean of the change of volume.

        The tangent is without that of the mean: then come ``dJ/dF`` and ``U''``, of which it is.
        """
        P, A, new = self.isochoric(H, state)
        growth, slope, bend = dilatation(H, self.finite_strain)
        _, p, dp = self.volumetric(mean(growth))
        A = A if bend is None else A + p * bend
        return P + p * slope, A, new, slope, dp

    def __call__(self, H: Array, state: State) -> tuple[Array, Array, State]:
        P, A, new, slope, dp = self.averaged(H, state, lambda growth: growth)
        s = slope[: len(H), : len(H)]
        return P, A + np.einsum("ij...,kl...->ijkl...", dp * s, s), new


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
        function: Callable[..., Any],
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
        self.initial = dict(initial or {})

    def __call__(self, H: Array, state: State) -> Any:
        return self.function(H, state)


class FromFelupe(FromFunction):
    """A material with the signature that felupe's `MaterialStrain` takes.

    ``(strain increment, strain, stress, state variables) -> tangent, stress, variables``.

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
        names = [f"statevar_{i + 1}" for i in range(len(statevars))]
        shapes = dict(zip(("strain", "stress", *names), ((3, 3), (3, 3), *statevars), strict=True))
        super().__init__(function, {name: np.zeros(shape) for name, shape in shapes.items()})
        self.parameters = parameters

    def __call__(self, H: Array, state: State) -> tuple[Array, Array, State]:
        strain, d = small(H), len(H)
        e, s, *z = (value.swapaxes(-1, -2) for value in state.values())
        increment = strain.swapaxes(-1, -2) - e
        A, stress, new = self.function(increment, e, s, z, tangent=True, **self.parameters)
        A, stress, *z = (np.asarray(value).swapaxes(-1, -2) for value in (A, stress, *new))
        return stress, A[:d, :d, :d, :d], dict(zip(state, (strain, stress, *z), strict=True))


def take_numbers(material: Any, **usage: str) -> None:
    """Check the parameters of these names, and keep them as numbers; what each is ends its message."""
    for name, use in usage.items():
        value = number(getattr(material, name), name, use)
        if not np.isfinite(value):
            raise InputError(f"{name} = {value} is not finite; {use}")
        vars(material)[name] = value


def everywhere(values: Mapping[str, ArrayLike], elements: int, points: int) -> dict[str, Array]:
    """Return internal variables of one point at all of them, arrays (..., e, q).

    >>> everywhere({"p": 0.5}, 1, 2)["p"].tolist()
    [[0.5, 0.5]]
    """
    ones = np.ones((elements, points))
    return {key: np.multiply.outer(np.array(value, dtype=float), ones) for key, value in values.items()}
