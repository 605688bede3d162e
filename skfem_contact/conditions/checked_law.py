"""`CheckedLaw`: the friction law of one contact, every value of which is checked before it is used.

Laws may be the user's own. NaN compares as nothing, so a point whose bound is NaN would stick like
glue; a negative bound would drive the body. All that asks a law goes through here: the loops,
complementary pivoting, the certificate, the pictures.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skfem_contact.arguments import numbers
from skfem_contact.bodies.selection import written
from skfem_contact.carried import ByFields
from skfem_contact.conditions.friction import Coulomb, FrictionLaw, Tresca
from skfem_contact.conditions.orthotropic import OrthotropicCoulomb
from skfem_contact.conditions.return_map import (
    Derivatives,
    Mapped,
    map_by_bound,
    mapped_arrays,
    return_map,
    unlawful,
)
from skfem_contact.conditions.thresholds import DIFFERENCE, NO_AREA
from skfem_contact.digits import COMPUTED
from skfem_contact.errors import InputError

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]


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
        """Whether the law is one of ours, whose parameters were checked when it was made.

        Its bounds need no check, and are piecewise linear in the normal force, without the slip.
        """
        return type(self.law) in (Coulomb, OrthotropicCoulomb, Tresca)

    @property
    def grips(self) -> bool:
        """Whether the bound is known to be a share of the normal force at all points, or more.

        Not one of a size that no force can tell from nothing, and whatever cohesion adds.
        """
        law = self.law
        if type(law) is not Coulomb or np.any(law.tau_max != np.inf):
            return False
        return bool(np.min(law.mu) > COMPUTED and np.min(law.cohesion) >= 0.0)

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
        bare = known & (normal_force <= DIFFERENCE * largest)
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
            return return_map(trial, self.limit(normal_force, area, slip))
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
            return map_by_bound(self, trial, normal_force, area, slip, hardens=not self.steady)
        return self._own_map(trial, normal_force, area, slip)

    @cached_property
    def by_bound(self) -> bool:
        """Whether the law is given by its bound, and has no return map of its own."""
        return type(self.law).return_map is FrictionLaw.return_map

    def _own_map(self, trial: Array, normal_force: Array, area: Array, slip: Array) -> Mapped:
        """What a return map of the law's own gives, checked against its bound."""
        idle = self._idle(area)
        asked = trial.copy(), normal_force.copy(), np.where(idle, 1.0, area), slip.copy()
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            found = self.law.return_map(*asked)
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
        known = (
            np.isfinite(normal_force) & np.isfinite(slip).all(axis=1) & np.isfinite(trial).all(axis=1)
        )
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
        """What the law returns, and for which points it was asked with numbers to be answered."""
        idle = self._idle(area)
        # the law's own copies, as it may work in place; divisions by zero are found by their result
        asked = normal_force.copy(), np.where(idle, 1.0, area), slip.copy()
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            found = method(*asked)
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
        known = np.isfinite(normal_force) & np.isfinite(slip).all(axis=1) & ~idle
        return np.where(idle, 0.0, values), known

    def _idle(self, area: Array) -> Mask:
        """Points without area, which carry nothing."""
        return np.asarray(area <= NO_AREA * np.max(area, initial=0.0))

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
