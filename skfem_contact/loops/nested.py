r"""Nested start: find the contact zone on few points first, then on twice as many, and so on.

From a cold start the zone of contact is unknown, and Newton's method on all points at once wanders:
points change in layers, and a body that nothing else holds turns on the wrong ones. On every eighth
point the same problem is small and settles in a few iterations; its answer, seen by twice as many
points, is nearly right there. The last level, the full problem, then needs a few iterations whatever
the number of points.

A level keeps some points; the others are free of force. In the dense contact space that is a Schur
complement, and the whole chain of levels costs about one factorisation.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import LinAlgError
from scipy.spatial import cKDTree

from skfem_contact.conditions.state import OPEN, STICK
from skfem_contact.linalg.singular import SingularMatrix
from skfem_contact.loops.driver import drive
from skfem_contact.loops.loops import Loop
from skfem_contact.loops.step import Guess, Iterate, Step
from skfem_contact.problem.points import PointSpace, Reduction

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
logger = logging.getLogger("skfem_contact")

# Points of the coarsest level, and iterations that a coarse level may take: it only starts the next.
COARSEST = 8
ATTEMPTS = 20


@dataclass(frozen=True, eq=False)
class Level:
    """A step restricted to some of its points."""

    step: Step
    gaps: Callable[[Array], Array]  # gaps of the finer level's points from this level's solution


def nested_guess(step: Step, guess: Guess, loop: Loop, points: Array, tolerance: float) -> Guess:
    """Starting values for all points from a chain of coarser problems.

    Parameters
    ----------
    step : Step
    guess : Guess
        Cold starting values.
    loop : callable
        The loop that solves a level.
    points : ndarray, shape (m, d)
        Positions, to choose every second point by.
    tolerance : float
    """
    levels = [Level(step, lambda z: step.load.gap0)]
    for keep in _halvings(step.paired & ~step.tied, points, step.rank):
        try:
            levels.append(_restrict(levels[-1].step, keep | step.tied & step.paired))
        except LinAlgError:  # the kept points can not hold the bodies: coarse enough
            break
    for level in levels[:0:-1]:
        allowed = level.step.paired
        status = np.where(allowed | step.tied, guess.status, OPEN)
        start = replace(guess, status=status, direction=guess.direction * allowed[:, None])
        try:
            outcome = drive(loop, level.step, start, tolerance, ATTEMPTS)
        except SingularMatrix:  # only a start: the next level begins without this one
            continue
        logger.debug("nested start on %d points: %s", allowed.sum(), outcome.message)
        coarse = guess.coarse + len(outcome.trace)
        guess = replace(_refine(outcome.iterate, level), coarse=coarse)
    return guess


def _halvings(candidates: Mask, points: Array, rank: NDArray[np.intp]) -> Iterator[Mask]:
    """Masks of every second, fourth, ... candidate, along an order in which neighbours are near."""
    chosen = np.flatnonzero(candidates)
    chosen = chosen[np.argsort(rank[chosen])]
    if len(chosen) == 0:
        return
    order = chosen[cKDTree(points[chosen], leafsize=1).indices]
    while len(order) > COARSEST:
        order = order[::2]
        mask = np.zeros(len(candidates), dtype=bool)
        mask[order] = True
        yield mask


def _restrict(step: Step, keep: Mask) -> Level:
    """The same step with the points outside `keep` free of force."""
    space, load = step.space, step.load
    if not isinstance(space, PointSpace):
        kept = replace(step, paired=step.paired & keep)
        return Level(kept, lambda z: np.zeros(0))
    reduction = Reduction(space, keep)
    if not reduction.good:
        raise LinAlgError("the kept points do not hold the bodies")

    def gaps(z: Array) -> Array:
        full = reduction.expand(z, load)
        moved = np.where(space.normal_rows >= 0, full[space.normal_rows], 0.0)
        return np.asarray(load.gap0 + moved)

    new = replace(step, space=reduction.space, load=reduction.load(load), paired=step.paired & keep)
    return Level(new, gaps)


def _refine(iterate: Iterate, level: Level) -> Guess:
    """Starting values on the finer level: closed is what was, and what then penetrates."""
    response = iterate.response
    gap = level.gaps(response.solution)
    gap = response.gap if len(gap) == 0 else gap
    status = np.where(iterate.status != OPEN, iterate.status, np.where(gap < 0, STICK, OPEN))
    return Guess(
        status, iterate.direction, response.normal_force, response.tangential_force, response.slip
    )
