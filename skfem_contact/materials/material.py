r"""What a body asks of what it is made of, one's own materials, and tensors at many points.

Second-order tensors are arrays (3, 3, ...), components first. A law of small strains holds at large
ones if its strain is the logarithmic one (Hencky's),

    ``E = 1/2 ln F'F``,    ``S_ab = f(l_a, l_b) T_ab``

Stress T belongs to E by the law of small strains, in the principal axes of ``C = F'F``, whose
eigenvalues are l and ``f`` the divided differences of the logarithm; S is the second Piola-Kirchhoff
stress. The trace of E is ``ln det F``, so that flow without a trace keeps the volume, at any strain;
work is that of the small law, ``T : dE``, and a tangent that is symmetric stays so. Principal axes that
turn within a step are turned with exactly: all follows from F at its end.

See Miehe, Apel and Lambrecht, Comput. Methods Appl. Mech. Engrg. 191 (2002) 5383-5425.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from skfem.helpers import ddot, det, inv, trace, transpose

from skfem_contact.arguments import check_switch, number, shown
from skfem_contact.arrays import Array
from skfem_contact.digits import GIVEN
from skfem_contact.errors import InputError, MaterialError

State = Mapping[str, Array]


def solid(H: Array) -> Array:
    """Return a tensor (d, d, ...) with its third row and column, zeros in plane strain.

    >>> solid(np.ones((2, 2, 1, 1)))[:, :, 0, 0].tolist()
    [[1.0, 1.0, 0.0], [1.0, 1.0, 0.0], [0.0, 0.0, 0.0]]
    """
    if len(H) == 3:
        return H
    out = np.zeros((3, 3, *H.shape[2:]))
    out[:2, :2] = H
    return out


def unit(points: Any) -> Array:
    """Return the unit tensor (3, 3, 1, 1, ...) for arrays of points of this many axes."""
    return np.eye(3).reshape(3, 3, *[1] * points)


def small(H: Array) -> Array:
    """Return the small strain (3, 3, ...) of a displacement gradient (d, d, ...)."""
    H = solid(H)
    return 0.5 * (H + H.swapaxes(0, 1))


def deviator(T: Array) -> Array:
    """Return a tensor (3, 3, ...) less its mean on the diagonal."""
    return T - trace(T) / 3.0 * unit(T.ndim - 2)


def isotropic(bulk: float, shear: float, d: int) -> Array:
    """Return ``bulk 1 x 1 + 2 shear I_dev`` of d rows, I_dev symmetric.

    Examples
    --------
    >>> isotropic(1.0, 0.5, 2)[0, 0, 0, 0].round(3), isotropic(1.0, 0.5, 2)[0, 1, 1, 0]
    (np.float64(1.667), np.float64(0.5))
    """
    one = np.eye(d)
    both = np.einsum("ik,jl->ijkl", one, one) + np.einsum("il,jk->ijkl", one, one)
    return (bulk - 2.0 / 3.0 * shear) * np.multiply.outer(one, one) + shear * both


def green(H: Array) -> Array:
    """Return Green's strain ``(F'F - 1) / 2`` (3, 3, ...) of a displacement gradient (d, d, ...).

    Without the 1, of whose round-off strains are far from where a body yields.
    """
    return small(H) + 0.5 * squared(solid(H))


def squared(F: Array) -> Array:
    """Return ``F'F``."""
    return np.asarray(np.einsum("mi...,mj...->ij...", F, F))


def first_piola(F: Array, S: Array, D: Array) -> tuple[Array, Array]:
    """Return the first Piola-Kirchhoff stress F S, and its derivative by F.

    Parameters
    ----------
    F, S : ndarray, shape (3, 3, e, q)
        Deformation gradient and second Piola-Kirchhoff stress.
    D : ndarray, shape (d, d, d, d, e, q) or what broadcasts to it
        The derivative of S by Green's strain.
    """
    d = len(D)
    f = F[:d, :d]
    A = np.einsum("ik,jl...->ijkl...", np.eye(d), S[:d, :d])
    if D.any():  # not so of neo-Hooke's law
        A += np.einsum("im...,mjnl...,kn...->ijkl...", f, D, f, optimize=True)
    return np.einsum("im...,mj...->ij...", F, S), A


def deformation(H: Array) -> tuple[Array, Array, Array]:
    """Return F (3, 3, e, q), its determinant (e, q), which has to be positive, and F^-T."""
    F = solid(H) + unit(H.ndim - 2)
    J = det(F)
    if not (J > 0).all():  # or NaN
        raise MaterialError(
            f"an element is turned inside out: det F = {np.nanmin(J):.3g}",
            int(np.argwhere(~(J > 0))[0, 0]),
        )
    return F, J, transpose(inv(F))


def dilatation(H: Array, finite: bool) -> tuple[Array, Array, Any]:
    """Return ``J - 1`` (e, q), its derivative (3, 3, e, q), and d rows of the second one, if not zero.

    Without the one, beside which small strains lose their digits: far from a small contact stresses
    of that round-off act on large areas.
    """
    small = trace(H)
    if not finite:
        return small, np.broadcast_to(unit(2), (3, 3, *H.shape[2:])), None
    _, J, G = deformation(H)
    g = G[: len(H), : len(H)]
    bend = np.einsum("ij...,kl...->ijkl...", J * g, g)
    h = solid(H)
    growth = small + 0.5 * (small**2 - ddot(h, transpose(h))) + det(h)
    return growth, J * G, bend - bend.transpose(0, 3, 2, 1, 4, 5)


# -- logarithmic strain ---------------------------------------------------------------------


def logarithmic(
    law: Callable[..., Any], H: Array, state: Mapping[str, Array]
) -> tuple[Array, Array, Mapping[str, Array]]:
    """First Piola-Kirchhoff stress, its derivative by H, and internal variables.

    Parameters
    ----------
    law : callable
        An isotropic one of small strains, ``(H, state) -> stress, tangent, state``.
    H : ndarray, shape (d, d, e, q)
        Displacement gradient, of any size.
    state : dict of ndarray
        Those of shape (3, 3, e, q) are tensors of the undeformed axes.
    """
    d = len(H)
    F = deformation(H)[0]
    values, N, strain = principal(H)
    back = N.swapaxes(0, 1)
    turned = {key: _turned(N, X) if X.ndim == 4 else X for key, X in state.items()}
    T, A, new = law(strain[:d, :d], turned)
    first, second = _first(values[:, None], values), _second(values[:d])
    # dS_ac = 1/2 D_acbd dC_bd: of the law, and of principal axes and stretches that change
    f, t, one = first[:d, :d], T[:d, :d], np.eye(d)
    g = np.einsum("acb...,ab...->abc...", second, t)
    turns = np.einsum("abc...,cd->acbd...", g, one)
    turns = turns + turns.swapaxes(0, 1)
    D = f[:, :, None, None] * f * A + turns + turns.swapaxes(2, 3)
    n = N[:d, :d]
    turn = np.einsum("ia...,jc...->ijac...", n, n)
    D = np.einsum("ijac...,acbd...,klbd...->ijkl...", turn, D, turn, optimize=True)
    stress, tangent = first_piola(F, _turned(back, first * T), D)
    return stress, tangent, {k: _turned(back, X) if X.ndim == 4 else X for k, X in new.items()}


def principal(H: Array) -> tuple[Array, Array, Array]:
    """Squared stretches (3, ...), their axes as columns (3, 3, ...), and E (3, 3, ...) in these."""
    d, beyond = len(H), 2.0 * green(H)
    x, N, strain = np.zeros(beyond.shape[1:]), np.zeros_like(beyond), np.zeros_like(beyond)
    N[2, 2] = 1.0
    found, axes = np.linalg.eigh(np.moveaxis(beyond[:d, :d], (0, 1), (-2, -1)))
    x[:d], N[:d, :d] = np.moveaxis(found, -1, 0), np.moveaxis(axes, (-2, -1), (0, 1))
    strain[range(d), range(d)] = 0.5 * np.log1p(x[:d])
    return 1.0 + x, N, strain


def undeformed_axes(H: Array) -> Array:
    """The logarithmic strain (3, 3, e, q) in the axes of the undeformed body."""
    _, N, strain = principal(H)
    return _turned(N.swapaxes(0, 1), strain)


def _turned(N: Array, X: Array) -> Array:
    """A tensor in other axes, the columns of N."""
    return np.asarray(np.einsum("ia...,ij...,jb...->ab...", N, X, N, optimize=True))


def _second(values: Array) -> Array:
    """Second divided differences of the logarithm at values (d, ...) that ascend, (d, d, d, ...).

    Of values that are alike by a Taylor polynomial: it is wrong by the square of their spread, and
    differences by round-off over it.
    """
    low, mid, high = values[np.sort(np.indices((len(values),) * 3), axis=0)]
    spread = high - low
    with np.errstate(invalid="ignore", divide="ignore"):
        apart = (_first(mid, high) - _first(low, mid)) / spread
    near = -0.5 * (3.0 / (low + mid + high)) ** 2
    return np.where(spread > GIVEN * low, apart, near)


def _first(a: Array, b: Array) -> Array:
    """First divided differences of the logarithm."""
    x = (a - b) / b
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray(np.where(x == 0.0, 1.0, np.log1p(x) / x) / b)


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
