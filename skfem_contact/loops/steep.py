"""Friction that is lost all at once where a point opens, by friction that is lost steeply.

Cohesion and Tresca's law have a bound ``L`` where nothing presses, and none where a point is open. Such
a point may have no state: with all of its friction it is pulled, without it overlaps. With the bound

    ``min(L(lambda), k lambda)``

in its place there is one. Where k is large, the answer is that of the law itself, unless points slip
under no more than a part of ``L`` and hardly any pressure, however large k is: these are the ones
that have no state nearby.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from skfem_contact.conditions.friction import FrictionLaw
from skfem_contact.conditions.friction_rule import FrictionRule
from skfem_contact.conditions.state import SLIP
from skfem_contact.loops.proximal import proximal
from skfem_contact.loops.step import Guess, Step
from skfem_contact.loops.thresholds import FULL_BOUND, STEEP

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Steep(FrictionLaw):
    """Another law, whose bound begins at zero.

    Parameters
    ----------
    law : FrictionLaw
    rise : float
        Friction over the normal force where that is small.

    Examples
    --------
    >>> from skfem_contact.conditions.friction import Tresca
    >>> one, none = np.ones(2), np.zeros((2, 1))
    >>> Steep(Tresca(3.0), 1000.0).limit(np.array([0.001, 1.0]), one, none)
    array([1., 3.])
    """

    law: FrictionLaw
    rise: float

    def limit(self, normal_force: Array, area: Array, slip: Array) -> Array:
        return np.minimum(self.law.limit(normal_force, area, slip), self.rise * normal_force)

    def slope(self, normal_force: Array, area: Array, slip: Array) -> Array:
        rising = self.rise * normal_force < self.law.limit(normal_force, area, slip)
        return np.where(rising, self.rise, self.law.slope(normal_force, area, slip))


def steeply(step: Step, guess: Guess, tolerance: float) -> tuple[Guess, Array]:
    """Starting values from laws that rise steeply, and the points that have no state nearby.

    Parameters
    ----------
    step : Step
        With the resistance of its points.
    guess : Guess
    tolerance : float

    Returns
    -------
    guess : Guess
        The given one, where nothing is found.
    shares : ndarray, shape (m,)
        Of their bound by which such points slip without pressure; zero at all others.
    """
    shares = np.zeros(len(step.paired))
    for rise in STEEP:
        laws = tuple((part, replace(law, law=Steep(law.law, rise))) for part, law in step.friction.laws)
        rule = FrictionRule(laws, step.friction.area, step.last.reference)
        steep = replace(step, friction=rule)
        found, outcome = proximal(steep, guess, tolerance)
        if not outcome.converged:
            break
        guess, status, there = found, outcome.iterate.status, outcome.iterate.response
        full = step.friction.bound(there.normal_force, there.slip)
        bound = steep.friction.bound(there.normal_force, there.slip)
        partly = (status == SLIP) & (bound < FULL_BOUND * full)
        shares = np.where(partly, bound / np.where(partly, full, 1.0), 0.0)
    return guess, shares
