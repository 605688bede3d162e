r"""Laws of friction and wear: bounds and volumes, and the check of what a law gives.

A law of friction bounds the force of a point, ``|tau| <= L(lambda)``; the point sticks below the
bound and slips on it. Internally ``tau`` is the force that resists a positive slip, so that the
friction on the secondary surface is ``-tau`` ([M] eqs. (6), (7), (11); [M] is V. L. Marchenko,
2014). Forces are per contact point, stresses are forces divided by the tributary area. What a law
makes of a trial force is the return map of `skfem_contact.conditions.friction_rule`.

Laws may be the user's own. NaN compares as nothing, so a point whose bound is NaN would stick like
glue; a negative bound would drive the body. All that asks such a law goes through `CheckedLaw`.

Archard's law says that the volume worn off is ``k F s``, with the force F that presses and the way s
that it slides; at each point of a surface the depth grows by ``k p ds``. It opens the gap. In a load
step both are those of its end and its beginning (trapezoidal rule, as for the energy that friction
takes): where friction is Coulomb's the volume is ``k / mu`` times that energy, to round-off.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import KW_ONLY
from functools import cached_property, partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from skfem_contact.arguments import PrintedAsCall, number, numbers, shown, take, with_known_keywords
from skfem_contact.arrays import Array, Mask
from skfem_contact.bodies.selection import written
from skfem_contact.conditions.friction_rule import (
    Derivatives,
    LinearBound,
    Mapped,
    map_by_bound,
    radial_return,
)
from skfem_contact.digits import COMPUTED, SINGLE, SOLVED
from skfem_contact.errors import InputError
from skfem_contact.records import ByFields, dataclass, kept, sealed

#: Why a bound is not negative, and what to do where nothing is to slip.
NO_SIGN = (
    "It bounds the size of the friction force, whose direction follows from the slip; give a value "
    ">= 0."
)
NEVER_SLIPS = (
    "For surfaces that never slip use Contact(tied=True), or a large finite {} if they may separate."
)


# Coefficients from here on are larger than those of any pair of materials, sticky rubber (3) included.
STEEP = 5.0


@dataclass(frozen=True, eq=False)
class FrictionLaw(PrintedAsCall):
    r"""Base of all friction laws; a user's own law overrides `limit`.

    Parameters
    ----------
    stiffness : float, optional
        The tangential stiffness G of a sticking point [force/length]; ``inf`` is exact sticking.
        By default exact for the loop ``newton`` and a multiple of the bodies' own stiffness at the
        point for the loops ``direct`` and ``fictitious``.

    Notes
    -----
    `slope` is the derivative of the limit with respect to the normal force. It speeds up the
    loop ``newton`` and does not change the answer; the base class takes a difference quotient.
    That with respect to the slip is always a difference quotient, unless a law has its own
    `return_map`, which gives the friction forces themselves and all their derivatives.

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


@dataclass(frozen=True, eq=False)
class LinearLaw(FrictionLaw):
    """Base of the laws of this package, whose bound is a line in the normal force, up to a cap."""

    def by_pressure(self, area: Array) -> LinearBound:
        """The line and its cap at points with these areas, (m,)."""
        raise NotImplementedError

    def limit(self, normal_force: Array, area: Array, slip: Array) -> Array:
        return self.by_pressure(area).at(normal_force)

    def slope(self, normal_force: Array, area: Array, slip: Array) -> Array:
        return self.by_pressure(area).slope(normal_force)


@with_known_keywords(f="the coefficient of friction is mu", coefficient="write mu")
@dataclass(frozen=True, eq=False, init=False)
class Coulomb(LinearLaw):
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

    def by_pressure(self, area: Array) -> LinearBound:
        # inf * 0 is nan: an area of zero has no cap either
        cap = np.inf if self.tau_max == np.inf else self.tau_max * area
        return LinearBound(self.mu, self.cohesion * area, cap)


@with_known_keywords(limit="write tau_max", k="write tau_max")
@dataclass(frozen=True, eq=False, init=False)
class Tresca(LinearLaw):
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

    def by_pressure(self, area: Array) -> LinearBound:
        return LinearBound(0.0, self.tau_max * area, np.inf)


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


@dataclass(frozen=True, eq=False)
class CheckedLaw(ByFields):
    """The friction law of one contact, whose values are finite, not negative, and one per point.

    Parameters
    ----------
    law : FrictionLaw
    contact : str
        Name of the contact, for messages.
    points : ndarray, shape (m, d)
        Positions of its points, for messages.

    Examples
    --------
    >>> law = CheckedLaw(Coulomb(0.5), "joint", np.zeros((1, 2)))
    >>> law.limit(np.array([2.0]), np.array([1.0]), np.array([[0.0]]))
    array([1.])
    """

    law: FrictionLaw
    contact: str
    points: Array

    @cached_property
    def steady(self) -> bool:
        """The law is one of this package, whose parameters were checked when it was made.

        Its bounds need no check, and are `LinearBound`. Who derives from one may have changed them.
        """
        return "by_pressure" in vars(type(self.law))

    def limit(self, normal_force: Array, area: Array, slip: Array) -> Array:
        """Bounds, shape (m,); see `FrictionLaw.limit`. Zero at points without area.

        Raises
        ------
        InputError
            The law returned something else than one finite bound >= 0 for each point.
        """
        if self.steady:
            # areas of points that carry nothing, vertices of quadratic faces by mortar, may be negative
            return np.maximum(self.law.limit(normal_force, area, slip), 0.0)
        bounds, known = self._ask(self.law.limit, "limit", normal_force, area, slip)
        good = known & np.isfinite(bounds)
        largest = max(np.max(part[good], initial=0.0) for part in (normal_force, bounds))
        good &= bounds >= -COMPUTED * largest
        if not good[known].all():
            self._refuse("limit", known & ~good, bounds, normal_force, slip)
        return np.maximum(bounds, 0.0)

    def slope(self, normal_force: Array, area: Array, slip: Array) -> Array:
        """Derivatives by the normal force, shape (m,); see `FrictionLaw.slope`.

        A point without force is about to get one like the others: if the chord to it is flatter than
        the tangent, the chord is taken. The tangent of a power of the pressure is infinite there.
        """
        if self.steady:
            return self.law.slope(normal_force, area, slip)
        slopes, known = self._ask(self.law.slope, "slope", normal_force, area, slip)
        largest = float(np.max(normal_force[known], initial=0.0))
        bare = known & (normal_force <= SINGLE * largest)
        if largest > 0 and bare.any():
            rise = self.limit(np.where(bare, largest, normal_force), area, slip)
            rise -= self.limit(normal_force, area, slip)
            slopes[bare] = np.fmin(slopes[bare], rise[bare] / largest)
        good = np.isfinite(slopes)
        if not good[known].all():
            self._refuse("slope", known & ~good, slopes, normal_force, slip)
        return slopes

    def force(self, trial: Array, normal_force: Array, area: Array, slip: Array) -> tuple[Array, Mask]:
        """Friction forces (m, d-1) by the return map, and which points slip (m,)."""
        if self.by_bound:
            return radial_return(trial, self.limit(normal_force, area, slip))
        return self._own_map(trial, normal_force, area, slip)[:2]

    def return_map(self, trial: Array, normal_force: Array, area: Array, slip: Array) -> Mapped:
        """Forces, which points slip, and derivatives; see `FrictionLaw.return_map`.

        Raises
        ------
        InputError
            A law with a map of its own returned something else than finite numbers of these shapes,
            or forces of another size than its own bound.
        """
        if self.by_bound:
            given = normal_force, area, slip
            at = partial(self.limit, normal_force, area)
            return map_by_bound(trial, self.limit(*given), self.slope(*given), slip, at)
        return self._own_map(trial, normal_force, area, slip)

    @cached_property
    def by_bound(self) -> bool:
        """The law is given by its bound, and has no return map of its own."""
        return type(self.law).return_map is FrictionLaw.return_map

    def _own_map(self, trial: Array, normal_force: Array, area: Array, slip: Array) -> Mapped:
        """Ask the law's own return map, and check what it gives against the bound."""
        found, idle = self._answer(self.law.return_map, trial, normal_force, area, slip)
        force, slips, derivatives = mapped_arrays(found, self._name("return_map"), trial)
        force = np.where(idle[:, None], 0.0, force)
        slips = np.where(idle, trial.any(axis=1), slips)
        # a sticking force is the trial force, which needs no formula; a point without area has none
        stuck = np.eye(trial.shape[1]) * ~slips[:, None, None]
        own = slips & ~idle
        by = Derivatives(
            np.where(own[:, None, None], derivatives.trial, stuck),
            np.where(own[:, None], derivatives.normal_force, 0.0),
            np.where(own[:, None, None], derivatives.slip, 0.0),
        )
        known = np.isfinite(np.column_stack([normal_force, slip, trial])).all(axis=1)
        limit = self.limit(normal_force, area, slip)
        wrong = known & unlawful(trial, limit, force, slips, by)
        if wrong.any():
            i = int(np.argmax(wrong))
            raise InputError(
                f"{self._name('return_map')} returned the force {written(force[i])}, "
                f"{'slipping' if slips[i] else 'sticking'}, at point {i} at {written(self.points[i])}, "
                f"for the trial force {written(trial[i])} and its own limit {limit[i]:.6g}; "
                f"derivatives by it {by.trial[i].tolist()}. It must be the trial force itself where "
                "that is within the limit, and else a force as large as the limit; and all numbers "
                "finite. For a limit that depends on the direction see OrthotropicCoulomb."
            )
        return force, slips, by

    def _ask(
        self, method: Callable[..., Any], what: str, normal_force: Array, area: Array, slip: Array
    ) -> tuple[Array, Mask]:
        """Call the law, and return with its values the points that have to get a number."""
        found, idle = self._answer(method, normal_force, area, slip)
        usage = "it must return an array with one number for each contact point"
        values = numbers(found, f"what {self._name(what)} returned", usage)
        if values.shape != normal_force.shape:
            raise InputError(
                f"{self._name(what)} returned an array of shape {values.shape} for "
                f"{len(normal_force)} points, where it must have shape {normal_force.shape}. It is "
                f"given normal forces and areas of shape {normal_force.shape} and slips of shape "
                f"{slip.shape}: np.linalg.norm(slip, axis=1) is the size of the slip, one number per "
                "point."
            )
        known = np.isfinite(np.column_stack([normal_force, slip])).all(axis=1) & ~idle
        return np.where(idle, 0.0, values), known

    def _answer(self, method: Callable[..., Any], *given: Array) -> tuple[Any, Mask]:
        """Evaluate the law at forces, areas and slips; points without area carry no force."""
        *forces, area, slip = given
        idle = area <= COMPUTED * np.max(area, initial=0.0)
        # the law's own copies, as it may work in place; divisions by zero are found by their result
        asked = *(force.copy() for force in forces), np.where(idle, 1.0, area), slip.copy()
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            return method(*asked), np.asarray(idle)

    def _name(self, method: str) -> str:
        return f"contact '{self.contact}': {type(self.law).__name__}.{method}"

    def _refuse(self, what: str, bad: Mask, values: Array, normal_force: Array, slip: Array) -> None:
        i, count = int(np.argmax(bad)), int(bad.sum())
        many = "" if count == 1 else f" ({count} of {len(bad)} points, of which this is the first)"
        words = (
            f"{self._name(what)} returned {values[i]:.6g} at point {i} at {written(self.points[i])}, "
            f"where the normal force is {normal_force[i]:.6g} and the slip {written(slip[i])}{many}. "
        )
        if what == "slope":
            words += "The derivative of the bound has to be finite; leave slope out for a quotient."
        elif values[i] < 0:
            words += (
                "A bound is the size of the friction force, whose direction follows from the slip: "
                "it has to be >= 0."
            )
        elif normal_force[i] == 0:
            words += (
                "A law needs a bound also where nothing presses. With a power of the pressure write "
                "the bound itself as a power, c * p**(2/3) instead of c * p**(-1/3) * p, or bound p "
                "from below."
            )
        else:
            words += "A bound has to be finite; for surfaces that never slip use Contact(tied=True)."
        raise InputError(words)


def steep_words(law: FrictionLaw | None) -> str:
    """Say by how much friction exceeds the normal force, for coefficients that no material has.

    Such a coefficient may stand for points that hardly ever slip, or be an angle in degrees, or per
    cent. That is not told by its value, so nothing is warned of; what is said is true of all three,
    and shows which it is.

    >>> steep_words(Coulomb(30)), steep_words(Coulomb(0.5))
    ('up to 88.1 degrees off the normal (mu = 30)', '')
    """
    mu = float(np.max(law.by_pressure(np.ones(1)).mu)) if isinstance(law, LinearLaw) else 0.0
    if mu < STEEP:
        return ""
    return f"up to {np.degrees(np.arctan(mu)):.3g} degrees off the normal (mu = {mu:.6g})"
