"""The friction rule at the points: the laws of all contacts as one, every value of theirs checked.

Laws may be the user's own. NaN compares as nothing, so a point whose bound is NaN would stick like
glue; a negative bound would drive the body. All that asks a law goes through `CheckedLaw`: the
certificate, the pictures; and the loops, which ask for all points at once by `FrictionRule`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import cached_property, partial
from typing import Any, Protocol

import numpy as np

from skfem_contact.arguments import numbers
from skfem_contact.arrays import Array, Index, Mask, lengths, unit_vectors
from skfem_contact.bodies.selection import written
from skfem_contact.conditions.friction import (
    BEYOND,
    Coulomb,
    Derivatives,
    FrictionLaw,
    Mapped,
    Tresca,
    map_by_bound,
    mapped_arrays,
    radial_return,
    unlawful,
)
from skfem_contact.conditions.orthotropic import OrthotropicCoulomb
from skfem_contact.digits import COMPUTED, SINGLE
from skfem_contact.errors import InputError
from skfem_contact.records import dataclass
from skfem_contact.sealed import ByFields

# Coefficients from here on are larger than those of any pair of materials, sticky rubber (3) included.
STEEP = 5.0


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

    @property
    def is_linear(self) -> bool:
        """See `FrictionLaw.is_linear`."""
        return self.law.is_linear

    @cached_property
    def steady(self) -> bool:
        """The law is one of this package, whose parameters were checked when it was made.

        Its bounds need no check, and are piecewise linear in the normal force, without the slip.
        """
        return type(self.law) in (Coulomb, OrthotropicCoulomb, Tresca)

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
            at = None if self.steady else partial(self.limit, normal_force, area)
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


Laws = tuple[tuple[slice, CheckedLaw], ...]


class FrictionRule:
    """Friction at all points: the laws of all contacts, asked as one; zero where there is none.

    It alone answers what friction makes of a trial force (`project`), how that changes (`mapped`),
    which points slip, and by how much a force is off the law (`excess`).

    Parameters
    ----------
    laws : tuple of (slice, CheckedLaw)
        The points of each law.
    area : ndarray, shape (m,)
        Tributary areas [area].
    reference : ndarray, shape (m, d-1)
        Slip at which each point closed, from which laws count it [length].

    Attributes
    ----------
    steady : bool
        Whether no bound changes with the slip: see `CheckedLaw.steady`.
    by_bound : bool
        Whether all laws are given by their bounds.

    Examples
    --------
    >>> law = CheckedLaw(Coulomb(0.5), "joint", np.zeros((1, 2)))
    >>> rule = FrictionRule(((slice(0, 1), law),), np.ones(1), np.zeros((1, 1)))
    >>> rule.project(np.array([[-3.0]]), np.array([2.0]), np.zeros((1, 1)))
    (array([[-1.]]), array([ True]))
    """

    def __init__(self, laws: Laws, area: Array, reference: Array) -> None:
        self.laws, self.area, self.reference = laws, area, reference
        self._only = laws[0][1] if len(laws) == 1 and laws[0][0] == slice(0, len(area)) else None
        self.steady = all(law.steady for _, law in laws)
        self.by_bound = all(law.by_bound for _, law in laws)
        self._asked: tuple[Array, Array, Array] | None = None

    def since(self, reference: Array) -> FrictionRule:
        """The same laws at points that closed at other slips (m, d-1)."""
        rule = object.__new__(FrictionRule)
        vars(rule).update(vars(self), reference=reference, _asked=None)
        return rule

    def bound(self, normal_force: Array, slip: Array) -> Array:
        """Bound of the friction force of every point, (m,) [force]; an iteration asks twice of one."""
        known = self._asked
        if known is None or known[0] is not normal_force or known[1] is not slip:
            found, only = self._counted(normal_force, slip), self._only
            bound = self._all("limit", *found) if only is None else only.limit(*found)
            known = self._asked = normal_force, slip, bound
        return known[2]

    def slope(self, normal_force: Array, slip: Array) -> Array:
        """Derivative of the bound by the normal force, (m,)."""
        found, only = self._counted(normal_force, slip), self._only
        return self._all("slope", *found) if only is None else only.slope(*found)

    def project(self, trial: Array, normal_force: Array, slip: Array) -> tuple[Array, Mask]:
        """Friction forces (m, d-1) that trial forces come back to, and which points slip, (m,)."""
        if self._only is not None and self._only.by_bound:
            return radial_return(trial, self.bound(normal_force, slip))
        force, slips = np.zeros(trial.shape), np.zeros(len(trial), dtype=bool)
        for part, law, counted in self._parts(*self._counted(normal_force, slip)):
            force[part], slips[part] = law.force(trial[part], *counted)
        return force, slips

    def mapped(self, trial: Array, normal_force: Array, slip: Array) -> Mapped:
        """The same forces and points, and the derivatives of the forces."""
        if self._only is not None:
            return self._only.return_map(trial, *self._counted(normal_force, slip))
        m, t = trial.shape
        force, slips = np.zeros((m, t)), np.zeros(m, dtype=bool)
        by = Derivatives(np.zeros((m, t, t)), np.zeros((m, t)), np.zeros((m, t, t)))
        for part, law, counted in self._parts(*self._counted(normal_force, slip)):
            force[part], slips[part], own_by = law.return_map(trial[part], *counted)
            for whole, values in zip(by, own_by, strict=True):
                whole[part] = values
        return force, slips, by

    def slipping(
        self, direction: Array, size: Array | float, normal_force: Array, slip: Array
    ) -> Mapped:
        """As `mapped`, of points that slip under trial forces of a size, (m, 1), along `direction`."""
        if direction.shape[1] > 1 or not self.steady:
            return self.mapped(size * direction, normal_force, slip)
        # along the only tangent the force is the bound, whatever the trial force is
        still = np.zeros((len(direction), 1, 1))
        by = Derivatives(still, self.slope(normal_force, slip)[:, None] * direction, still)
        return direction * self.bound(normal_force, slip)[:, None], direction[:, 0] != 0, by

    def hardens(self, direction: Array, normal_force: Array, slip: Array) -> Mask:
        """Points whose bound grows with slip along `direction`: a spring along it, (m,)."""
        if self.steady:
            return np.zeros(len(direction), dtype=bool)
        return grows(self.mapped(BEYOND * direction, normal_force, slip)[2])

    def excess(self, trial: Array, normal_force: Array, slip: Array) -> Array:
        """Return the distance of trial forces (m, d-1) from the forces they are mapped to, (m,)."""
        if self.by_bound:
            return np.maximum(lengths(trial) - self.bound(normal_force, slip), 0.0)
        return lengths(trial - self.project(trial, normal_force, slip)[0])

    def _all(self, method: str, force: Array, area: Array, slip: Array) -> Array:
        """Collect the values of a method of the laws at all points, (m,)."""
        out = np.zeros(force.shape)
        for part, law, counted in self._parts(force, area, slip):
            out[part] = getattr(law, method)(*counted)
        return out

    def _parts(
        self, force: Array, area: Array, slip: Array
    ) -> Iterator[tuple[slice, CheckedLaw, tuple[Array, Array, Array]]]:
        """The points of each law, and what its bound depends on."""
        for part, law in self.laws:
            yield part, law, (force[part], area[part], slip[part])

    def _counted(self, normal_force: Array, slip: Array) -> tuple[Array, Array, Array]:
        """Return what bounds depend on at all points: normal force, area, slip since they closed."""
        if not self.steady:
            slip = slip - self.reference
        return np.maximum(normal_force, 0.0), self.area, slip


def grows(by: Derivatives) -> Mask:
    """Points whose bound grows with the slip, (m,)."""
    return np.asarray(np.einsum("ikk->i", by.slip) > 0)


def steep_words(law: FrictionLaw | None) -> str:
    """Say by how much friction exceeds the normal force, for coefficients that no material has.

    Such a coefficient may stand for points that hardly ever slip, or be an angle in degrees, or per
    cent. That is not told by its value, so nothing is warned of; what is said is true of all three,
    and shows which it is.

    >>> steep_words(Coulomb(30)), steep_words(Coulomb(0.5))
    ('up to 88.1 degrees off the normal (mu = 30)', '')
    """
    if not isinstance(law, Coulomb | OrthotropicCoulomb):
        return ""
    mu = float(np.max(np.asarray(law.mu), initial=0.0))
    if mu < STEEP:
        return ""
    return f"up to {np.degrees(np.arctan(mu)):.3g} degrees off the normal (mu = {mu:.6g})"


class Slid(Protocol):
    """A state of friction at the points along the tangents of a pairing; see `state.LocalState`."""

    status: Index
    area: Array
    reference: Array
    slip: Array
    normal_force: Array
    tangential_force: Array


def friction_bound(laws: Laws, state: Slid) -> Array:
    """Bound of the friction force in a state by the present laws; zero at open points, (m,)."""
    rule = FrictionRule(laws, state.area, state.reference)
    closed = state.status > 0
    return np.where(closed, rule.bound(state.normal_force, state.slip), 0.0)


def resisting_slips(laws: Laws, state: Slid, slips: Mask) -> Mask:
    """Those of points that slip against a bound that grows with the slip: a spring along it, (m,)."""
    rule = FrictionRule(laws, state.area, state.reference)
    if rule.steady:
        return np.zeros(len(slips), dtype=bool)
    direction = unit_vectors(state.tangential_force)
    return slips & rule.hardens(direction, state.normal_force, state.slip)


def jumps_open(laws: Laws, area: Array, tangents: int, opens: Mask) -> bool:
    """Whether some friction bound is not zero where nothing presses: it jumps where a point opens."""
    still, none = np.zeros((len(area), tangents)), np.zeros(len(area))
    return bool(np.any(FrictionRule(laws, area, still).bound(none, still)[opens] > 0))
