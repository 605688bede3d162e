r"""Laws of friction and wear, bounds and volumes, and the return map of friction.

A law of friction bounds the force of a point, ``|tau| <= L(lambda)``; the point sticks below the
bound and slips on it. Internally ``tau`` is the force that resists a positive slip, so that the
friction on the secondary surface is ``-tau`` ([M] eqs. (6), (7), (11); [M] is V. L. Marchenko,
2014). Forces are per contact point, stresses are forces divided by the tributary area.

The return map is what a law makes of a trial force ``t``: within the bound ``L`` it is the friction
force; beyond it is brought back onto the circle (in the plane: onto the interval) of radius ``L``,
along itself ([M] eq. (11)):

    tau = L d,   d = t / |t|,        d tau = L / |t| (1 - d d') dt + d dL,
                                     dL = dL/dlambda dlambda + dL/ds . ds .

With one tangent ``1 - d d'`` is zero: the direction of friction does not turn.

Archard's law says that the volume worn off is ``k F s``, with the force F that presses and the way s
that it slides; at each point of a surface the depth grows by ``k p ds``. It opens the gap. In a load
step both are those of its end and its beginning (trapezoidal rule, as for the energy that friction
takes): where friction is Coulomb's the volume is ``k / mu`` times that energy, to round-off.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import KW_ONLY
from functools import cached_property, partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from skfem_contact.arguments import PrintedAsCall, number, numbers, shown, take, with_known_keywords
from skfem_contact.arrays import Array, Mask, lengths
from skfem_contact.digits import SINGLE, SOLVED
from skfem_contact.errors import InputError
from skfem_contact.records import dataclass
from skfem_contact.sealed import kept, sealed

# A trial force beyond any bound, for points that slip in a known direction. A power of two, so that the
# force on the bound has no round-off; and its fourth power is still a number.
BEYOND = 2.0**250

#: Why a bound is not negative, and what to do where nothing is to slip.
NO_SIGN = (
    "It bounds the size of the friction force, whose direction follows from the slip; give a value "
    ">= 0."
)
NEVER_SLIPS = (
    "For surfaces that never slip use Contact(tied=True), or a large finite {} if they may separate."
)


@dataclass(frozen=True, eq=False)
class FrictionLaw(PrintedAsCall):
    r"""Base of all friction laws; a user's own law overrides :meth:`limit`.

    Parameters
    ----------
    stiffness : float, optional
        The tangential stiffness G of a sticking point [force/length]; ``inf`` is exact sticking.
        By default exact for the loop ``newton`` and a multiple of the bodies' own stiffness at the
        point for the loops ``direct`` and ``fictitious``.

    Notes
    -----
    :meth:`slope` is the derivative of the limit with respect to the normal force. It speeds up the
    loop ``newton`` and does not change the answer; the base class takes a difference quotient.
    That with respect to the slip is always a difference quotient, unless a law has its own
    :meth:`return_map`, which gives the friction forces themselves and all their derivatives.

    What a law returns is checked: a bound that is NaN, infinite or negative, at any point, is an
    `InputError`. A law is asked with a normal force of zero, too.

    Examples
    --------
    A law whose coefficient falls from ``mu`` to ``mu_end`` over a slip of ``length``:

    >>> from dataclasses import dataclass
    >>> import numpy as np
    >>> import skfem_contact as sc
    >>> @dataclass(frozen=True, eq=False)
    ... class Weakening(sc.conditions.FrictionLaw):
    ...     mu: float = 0.4
    ...     mu_end: float = 0.2
    ...     length: float = 1e-3
    ...
    ...     def limit(self, normal_force, area, slip):
    ...         drop = np.exp(-np.linalg.norm(slip, axis=1) / self.length)
    ...         return (self.mu_end + (self.mu - self.mu_end) * drop) * normal_force
    >>> Weakening().limit(np.array([10.0]), np.array([1.0]), np.array([[0.0]]))
    array([4.])
    """

    _: KW_ONLY
    stiffness: float | None = None

    def __post_init__(self) -> None:
        what, usage = f"{type(self).__name__}: stiffness", "give a force per length, or inf"
        if self.stiffness is not None and not number(self.stiffness, what, usage) > 0:
            raise InputError(
                f"{type(self).__name__}: stiffness = {self.stiffness} is not positive. It is the "
                "force per slip of a sticking point; leave it out for the automatic one, or give "
                "inf for exact sticking."
            )

    @property
    def is_linear(self) -> bool:
        """The bound is a linear function of the normal force alone."""
        return False

    def limit(self, normal_force: Array, area: Array, slip: Array) -> Array:
        """The friction bound L of each point.

        Parameters
        ----------
        normal_force : ndarray, shape (m,)
            Compressive, never negative [force].
        area : ndarray, shape (m,)
            Tributary area, deformed or not as `ContactValues.area` is [area].
        slip : ndarray, shape (m, d-1)
            Slip since the point closed [length].

        Returns
        -------
        ndarray, shape (m,)
            Not negative [force].
        """
        raise NotImplementedError(f"{type(self).__name__} does not define limit(...)")

    def slope(self, normal_force: Array, area: Array, slip: Array) -> Array:
        """Derivative of the limit with respect to the normal force, shape (m,)."""
        scale = float(np.max(normal_force, initial=0.0))
        if scale == 0.0:
            return np.zeros_like(normal_force)
        step = SINGLE * scale  # quotients only speed up the loops
        ahead = np.asarray(self.limit(normal_force + step, area, slip.copy()))
        return (ahead - np.asarray(self.limit(normal_force, area, slip))) / step

    def return_map(self, trial: Array, normal_force: Array, area: Array, slip: Array) -> Mapped:
        r"""Return the force of friction for a trial force: itself within the bound, else one on it.

        Made of `limit`, `slope` and difference quotients. A law may give it itself, for derivatives in
        closed form; the size of its forces is still what `limit` says, where they slip.

        Parameters
        ----------
        trial : ndarray, shape (m, d-1)
            The force that would resist if nothing slipped [force].
        normal_force, area : ndarray, shape (m,)
        slip : ndarray, shape (m, d-1)
            As for `limit`.

        Returns
        -------
        force : ndarray, shape (m, d-1)
            `trial` where it sticks; of the size of the bound where it slips [force].
        slips : ndarray of bool, shape (m,)
        derivatives : tuple of ndarray
            Of the force by the trial force, shape (m, d-1, d-1), by the normal force, (m, d-1), and
            by the slip, (m, d-1, d-1).

        Examples
        --------
        Two tangents: the force turns with the trial force, and grows with the normal force:

        >>> import numpy as np
        >>> import skfem_contact as sc
        >>> one = np.ones(1)
        >>> force, slips, by = sc.Coulomb(0.5).return_map(
        ...     np.array([[3.0, 4.0]]), 2 * one, one, np.zeros((1, 2))
        ... )
        >>> force, slips, by.normal_force
        (array([[0.6, 0.8]]), array([ True]), array([[0.3, 0.4]]))
        >>> by.trial[0].round(12)
        array([[ 0.128, -0.096],
               [-0.096,  0.072]])
        """
        given = normal_force, area, slip
        bounds = partial(self.limit, normal_force, area)
        return map_by_bound(trial, np.asarray(self.limit(*given)), self.slope(*given), slip, bounds)


@with_known_keywords(f="the coefficient of friction is mu", coefficient="write mu")
@dataclass(frozen=True, eq=False, init=False)
class Coulomb(FrictionLaw):
    r"""Coulomb friction with adhesion and a shear cap: ``L = min(mu lambda + c A, tau_max A)``.

    Parameters
    ----------
    mu : float or ndarray, shape (m,)
        Coefficient of friction.
    tau_max : float, optional
        Cap of the friction stress, for instance the shear yield stress of the softer body
        ([M] eq. (11)) [stress].
    cohesion : float or ndarray, shape (m,), optional
        Shear strength at zero pressure [stress].

    Raises
    ------
    InputError
        If a parameter is negative or NaN.

    Examples
    --------
    >>> import numpy as np
    >>> import skfem_contact as sc
    >>> law = sc.Coulomb(0.5, tau_max=3.0)
    >>> law.limit(np.array([2.0, 10.0]), np.array([1.0, 1.0]), np.zeros((2, 1)))
    array([1., 3.])
    """

    mu: float | Array
    tau_max: float = np.inf
    cohesion: float | Array = 0.0

    def __init__(
        self,
        mu: ArrayLike,
        tau_max: float = np.inf,
        cohesion: ArrayLike = 0.0,
        *,
        stiffness: float | None = None,
    ) -> None:
        take(self, mu=mu, tau_max=tau_max, cohesion=cohesion, stiffness=stiffness)

    def __post_init__(self) -> None:
        super().__post_init__()
        for name, several in (("mu", True), ("tau_max", False), ("cohesion", True)):
            finite = NEVER_SLIPS.format(name) if several else ""
            given = getattr(self, name)
            own = parameter("Coulomb", name, given, NO_SIGN, by_point=several, finite=finite)
            object.__setattr__(self, name, own)

    @property
    def is_linear(self) -> bool:
        return bool(np.all(np.isinf(np.asarray(self.tau_max, dtype=float))))

    def limit(self, normal_force: Array, area: Array, slip: Array) -> Array:
        bound = self._uncapped(normal_force, area)
        # inf * 0 is nan: an area of zero has no cap either
        return bound if self.tau_max == np.inf else np.minimum(bound, self.tau_max * area)

    def slope(self, normal_force: Array, area: Array, slip: Array) -> Array:
        steady = self.mu + np.zeros(normal_force.shape)
        if self.tau_max == np.inf:
            return steady
        return np.where(self._uncapped(normal_force, area) >= self.tau_max * area, 0.0, steady)

    def _uncapped(self, normal_force: Array, area: Array) -> Array:
        bound = np.asarray(self.mu * normal_force)
        return np.asarray(bound + self.cohesion * area) if self._coheres else bound

    @cached_property
    def _coheres(self) -> bool:
        return bool(np.any(self.cohesion))


@with_known_keywords(limit="write tau_max", k="write tau_max")
@dataclass(frozen=True, eq=False, init=False)
class Tresca(FrictionLaw):
    """Tresca friction: a bound that does not depend on the pressure, ``L = tau_max A``.

    The area of bodies of large strain is the deformed one with ``sliding="finite"``.

    Parameters
    ----------
    tau_max : float or ndarray, shape (m,)
        Bound of the friction stress, as the cap of `Coulomb` [stress].

    Examples
    --------
    >>> import numpy as np
    >>> import skfem_contact as sc
    >>> sc.Tresca(3.0).limit(np.array([0.0, 10.0]), np.array([1.0, 2.0]), np.zeros((2, 1)))
    array([3., 6.])
    """

    tau_max: float | Array

    def __init__(self, tau_max: ArrayLike, *, stiffness: float | None = None) -> None:
        take(self, tau_max=tau_max, stiffness=stiffness)

    def __post_init__(self) -> None:
        super().__post_init__()
        finite = NEVER_SLIPS.format("tau_max")
        own = parameter("Tresca", "tau_max", self.tau_max, NO_SIGN, finite=finite)
        object.__setattr__(self, "tau_max", own)

    @property
    def is_linear(self) -> bool:
        return True

    def limit(self, normal_force: Array, area: Array, slip: Array) -> Array:
        return self.tau_max * area

    def slope(self, normal_force: Array, area: Array, slip: Array) -> Array:
        return np.zeros_like(normal_force)


@with_known_keywords(
    K="write k, the coefficient over the hardness, K / H",
    H="write k, the coefficient over the hardness, K / H",
    hardness="write k, the coefficient over the hardness, K / H",
)
@dataclass(frozen=True, eq=False, init=False)
class Archard(PrintedAsCall):
    """Archard's law of wear: the volume worn off is `k` times the force times the way that it slides.

    It is the secondary surface that wears. With small sliding nothing tells it from wear of the primary
    surface, or of both, whose `k` is the sum of theirs.

    Parameters
    ----------
    k : float or ndarray, shape (m,)
        Volume per force and way, Archard's coefficient over the hardness [area/force].

    Raises
    ------
    InputError
        If it is negative, infinite or NaN.

    Examples
    --------
    A force of 2 on a way of 10:

    >>> import numpy as np
    >>> import skfem_contact as sc
    >>> sc.conditions.Archard(1e-6).volume(np.array([2.0]), np.array([10.0]))
    array([2.e-05])
    """

    k: float | Array

    def __init__(self, k: ArrayLike) -> None:
        take(self, k=k)

    def __post_init__(self) -> None:
        why = "It is the volume worn off per force and way; give a value >= 0."
        finite = "Give a finite volume per force and way."
        object.__setattr__(self, "k", parameter("Archard", "k", self.k, why, finite=finite))

    def volume(self, force: Array, way: Array) -> Array:
        """Volume worn off, shape (m,) [volume].

        Parameters
        ----------
        force : ndarray, shape (m,)
            That presses, not negative [force].
        way : ndarray, shape (m,)
            Length of the slip [length].
        """
        return np.asarray(self.k * force * way)


def parameter(
    law: str, name: str, given: Any, why: str, *, by_point: bool = True, finite: str = ""
) -> float | Array:
    """A parameter of a law, not negative, as it is kept: a number, or an array of one per point.

    Parameters
    ----------
    law, name : str
    given : float, or array (m,)
    why : str
        Why it is not negative, and what to give.
    by_point : bool
        Whether there may be one per point.
    finite : str
        What to do instead, where it can not be infinite.
    """
    value = kept(given)
    kind = "one number, or one per contact point" if by_point else "one number"
    array = numbers(value, f"{law}: {name}", f"give {kind}")
    if array.ndim > 1 or (array.ndim == 1 and (array.size == 0 or not by_point)):
        raise InputError(f"{law}: {name} has shape {array.shape}; it has to be {kind}.")
    if np.isnan(array).any() or (array < 0).any():
        raise InputError(f"{law}: {name} = {value!r} is negative or not a number. {why}")
    if finite and np.isinf(array).any():
        raise InputError(f"{law}: {name} is infinite. {finite}")
    return sealed(array) if isinstance(value, list | tuple) else value


def check_points(law: object, names: tuple[str, ...], m: int, whose: str) -> None:
    """Refuse parameters of a law that are given for another number of points than its contact has."""
    for name in names:
        size = np.shape(getattr(law, name, 0.0))
        if size not in ((), (1,), (m,)):
            raise InputError(
                f"{whose}: {name} of its {type(law).__name__} law has shape {size}, but the contact "
                f"has {m} points; give one number, or one per point of the secondary surface."
            )


class Derivatives(NamedTuple):
    """Derivatives of friction forces, component by component of the force.

    Attributes
    ----------
    trial : ndarray, shape (m, d-1, d-1)
        By the trial force.
    normal_force : ndarray, shape (m, d-1)
    slip : ndarray, shape (m, d-1, d-1)
        By the slip that the bound depends on [force/length].
    """

    trial: Array
    normal_force: Array
    slip: Array


Mapped = tuple[Array, Mask, Derivatives]


def radial_return(trial: Array, limit: Array) -> tuple[Array, Mask]:
    """Bring a trial friction force back onto the friction cone ([M] eq. (11)).

    Parameters
    ----------
    trial : ndarray, shape (m, d-1)
        Elastic predictor ``tau_n + G (s - s_n)`` [force].
    limit : ndarray, shape (m,)
        Friction bound [force].

    Returns
    -------
    tangential : ndarray, shape (m, d-1)
        `trial` where it is admissible, else its projection onto the circle of radius `limit`.
    slips : ndarray of bool, shape (m,)

    Examples
    --------
    >>> radial_return(np.array([[3.0, 4.0], [0.3, 0.4]]), np.array([1.0, 1.0]))
    (array([[0.6, 0.8],
           [0.3, 0.4]]), array([ True, False]))
    """
    if trial.shape[1] == 1:
        force = np.copysign(np.minimum(np.abs(trial), limit[:, None]), trial)
        return force, np.abs(trial[:, 0]) > limit
    size = lengths(trial)
    slips = size > limit
    kept = np.divide(limit, size, out=np.ones(len(trial)), where=slips)
    return trial * kept[:, None], slips


def map_by_bound(
    trial: Array, limit: Array, slope: Array, slip: Array, at: Callable[[Array], Array] | None
) -> Mapped:
    """The return map of a law that is given by its bound; see `FrictionLaw.return_map`.

    Parameters
    ----------
    trial, slip : ndarray, shape (m, d-1)
    limit, slope : ndarray, shape (m,)
        The bounds, and their derivatives by the normal force.
    at : callable or None
        Gives the bounds (m,) at a slip (m, d-1), if they depend on it.
    """
    if trial.shape[1] == 1:  # nothing turns: along the only tangent what slips has its bound
        force, slips = radial_return(trial, limit)
        direction, by_trial = np.sign(trial) * slips[:, None], (~slips)[:, None, None].astype(float)
    else:
        size = lengths(trial)
        slips = size > limit
        kept = np.divide(limit, size, out=np.ones(len(trial)), where=slips)[:, None]
        force = trial * kept
        direction = np.divide(trial, size[:, None], out=np.zeros(trial.shape), where=slips[:, None])
        by_trial = np.eye(trial.shape[1]) - direction[:, :, None] * direction[:, None, :]
        by_trial *= kept[:, :, None]
    by_normal = slope[:, None] * direction
    by_slip = np.zeros(by_trial.shape)
    if at is not None:
        by_slip = direction[:, :, None] * slip_gradient(at, limit, slip, direction)[:, None, :]
    return force, slips, Derivatives(by_trial, by_normal, by_slip)


def slip_gradient(limit: Callable[[Array], Array], here: Array, slip: Array, direction: Array) -> Array:
    """Derivative of a bound by the slip where points slip, shape (m, d-1): difference quotients.

    Along `direction` it is that ahead: where slip begins, a bound that depends on its size has a kink.
    Across it is the mean of both sides.

    Parameters
    ----------
    limit : callable
        Gives the bounds (m,) at a slip (m, d-1).
    here : ndarray, shape (m,)
        The bounds at `slip`.
    direction : ndarray, shape (m, d-1)
        Unit directions of friction; zero where nothing slips.
    """
    step = SINGLE * float(np.max(np.abs(slip), initial=0.0))
    if step == 0.0:
        return np.zeros_like(direction)
    ahead = np.asarray((limit(slip + step * direction) - here) / step)
    gradient = ahead[:, None] * direction
    if direction.shape[1] == 1:  # one tangent: nothing is across
        return gradient
    slides = np.linalg.norm(direction, axis=1) > 0
    for k, axis in enumerate(np.eye(direction.shape[1])):
        across = step * np.where(slides[:, None], axis - direction * direction[:, k, None], 0.0)
        difference = limit(slip + across) - limit(slip - across)
        gradient[:, k] += difference / (2 * step)
    return gradient


def mapped_arrays(found: Any, name: str, trial: Array) -> Mapped:
    """Return what a user's return map gave, as arrays of the shapes that they must have.

    Raises
    ------
    InputError
        It is something else.
    """
    m, t = trial.shape
    usage = "it must return (force, slips, (by_trial, by_normal_force, by_slip)), all of them arrays"
    what = f"what {name} returned"
    try:
        force, slips, (by_trial, by_normal, by_slip) = found
    except (TypeError, ValueError):
        raise InputError(f"{what} is {shown(found)}; {usage}") from None
    slips = np.asarray(slips)
    if slips.shape != (m,) or slips.dtype != bool:
        raise InputError(f"slips of {what} is {shown(slips)}, not one True or False for each point")
    given = {"force": force, "by_trial": by_trial, "by_normal_force": by_normal, "by_slip": by_slip}
    shapes = (m, t), (m, t, t), (m, t), (m, t, t)
    arrays = []
    for (part, value), shape in zip(given.items(), shapes, strict=True):
        array = numbers(value, f"{part} of {what}", usage)
        if array.shape != shape:
            raise InputError(
                f"{part} of {what} has shape {array.shape} for {m} points with {t} tangent"
                f"{'s' if t > 1 else ''}, where it must have shape {shape}; {usage}"
            )
        arrays.append(array)
    return arrays[0], slips, Derivatives(*arrays[1:])


def unlawful(trial: Array, limit: Array, force: Array, slips: Mask, by: Derivatives) -> Mask:
    """Points where a return map is none: off the bound where it slips, or not finite, (m,)."""
    size, wanted = np.linalg.norm(force, axis=1), np.linalg.norm(trial, axis=1)
    alike = SOLVED * np.max(limit[np.isfinite(limit)], initial=0.0)
    slides = (np.abs(size - limit) <= alike) & (wanted >= limit - alike)
    for array in by:
        slides &= np.isfinite(array).reshape(len(array), -1).all(axis=1)
    sticks = (np.linalg.norm(force - trial, axis=1) <= alike) & (wanted <= limit + alike)
    return ~np.where(slips, slides, sticks)
