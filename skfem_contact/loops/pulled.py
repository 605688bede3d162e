"""A load step pulled through a spring: the answer, or the largest share of it that contact carries.

A load that contact can not carry leaves Newton's method no answer to go to, and steps that are halved
come to the limit from below one by one. A loading machine goes past it: what it has come to is given,
and the load follows (`LoadingMachine`). It goes on until the whole load is carried, and from there the
step itself is solved; or until the bodies move on without carrying more.

The loading machine pulls through a spring.
A dead load beyond what contact can carry has no answer. Pulled through a spring it always has one: the
machine yields. With h the change of the load in a step, as forces on gaps and slips, and k the
stiffness of the machine,

    (S + k h h') z = f + k h d + p,

where the machine has come to d. The share of the step that the bodies then carry is ``k (d - h'z)``.
"""

from __future__ import annotations

from dataclasses import replace
from typing import cast

import numpy as np

from skfem_contact.arrays import Array
from skfem_contact.conditions.motions import RigidMotions
from skfem_contact.conditions.state import OPEN
from skfem_contact.digits import GIVEN, ROUND_OFF, SOLVED
from skfem_contact.errors import SingularMatrix
from skfem_contact.loops.active_set import HALVINGS, Projection
from skfem_contact.loops.driver import Outcome, drive, newton
from skfem_contact.loops.step import Guess, Record, Step
from skfem_contact.problem.points import Conditions, Load, PointSpace, Resistance, Response
from skfem_contact.problem.seam import ContactProblem, on_rows
from skfem_contact.records import dataclass

# Iterations for a problem with springs in series or on the machine, and for the step itself from there.
# With 30 the chain has come to its end before its answer in one of 180 histories with coefficients of
# 3 to 100 (`verification/test_friction_cone.py`).
IN_SERIES = 25


class LoadingMachine:
    """Gaps and slips of a load step that is pulled through a spring.

    The spring is as stiff as the points themselves are under the change of the load. Gaps and slips
    that supports prescribe are those of the end of the step from the beginning on.

    Parameters
    ----------
    space : PointSpace
    before, target : Load
        Where the step begins and ends.
    own : Resistance
        What each point resists by itself.

    Attributes
    ----------
    pulls : bool
        Whether anything else changes. Else there is no machine.
    """

    springs = None  # points are not seen through any

    def __init__(self, space: PointSpace, before: Load, target: Load, own: Resistance) -> None:
        gap0 = np.where(space.normal_rows < 0, target.gap0, before.gap0)
        slip0 = np.where(space.tangential_rows < 0, target.slip0, before.slip0)
        self._space = space
        tangential = np.broadcast_to(own.tangential[:, None], space.tangential_rows.shape)
        resists = self._on_rows(own.normal, tangential)
        # gaps and slips that obstacles change are changes of the load too: S times them
        moved = self._on_rows(_changed(gap0, target.gap0), _changed(slip0, target.slip0))
        force = space.force(before)
        self._along = space.force(target) - force + space.S @ moved
        self._before = replace(before, force=force, gap0=gap0, slip0=slip0)
        gives = float(np.sum(self._along**2 / resists))
        self.pulls = gives > 0
        self._stiffness = 1.0 / gives if self.pulls else 0.0
        if self.pulls:
            S = space.S + self._stiffness * np.outer(self._along, self._along)
            self.points = PointSpace(S, space.normal_rows, space.tangential_rows)

    def begin_at(self, gap: Array, slip: Array) -> None:
        """Let the machine have no force at these gaps and slips, (m,) and (m, d-1) [length]."""
        gap = np.where(np.isfinite(gap), gap, 0.0)
        gap0 = np.where(np.isfinite(self._before.gap0), self._before.gap0, 0.0)
        z = self._on_rows(gap - gap0, slip - self._before.slip0)
        self._origin = float(self._along @ z)

    def at(self, pull: float) -> Load:
        """The load where the machine has come to: the share that it would hold if nothing moved."""
        d = pull + self._stiffness * self._origin
        return replace(self._before, force=self._before.force + d * self._along)

    def share(self, pull: float, response: Response) -> float:
        """The share of the step that the bodies carry."""
        yielded = float(self._along @ response.solution) - self._origin
        return pull - self._stiffness * yielded

    def leaves(self, motions: RigidMotions) -> RigidMotions:
        """The rigid motions that supports and the machine leave free."""
        if not motions.k:
            return motions
        n = motions.kin.m
        rows = [
            self._on_rows(motions.normal[:, i], motions.tangential[:, :, i]) for i in range(motions.k)
        ]
        work = np.array(rows) @ self._along
        if np.max(np.abs(work)) <= ROUND_OFF * np.linalg.norm(self._along) * np.sqrt(n):
            return motions
        left = np.linalg.qr(work[:, None], mode="complete")[0][:, 1:]
        modes = motions.modes @ left
        return replace(motions, modes=modes / np.max(np.abs(modes), axis=0, initial=0.0))

    def at_forces(self, load: Load, normal_force: Array, tangential_force: Array) -> Load:
        """The load itself: there are no springs to be without strain."""
        return load

    def solve(self, conditions: Conditions, load: Load) -> Response:
        """Gaps, slips and forces under these conditions."""
        return self.points.solve(conditions, load)

    def _on_rows(self, normal: Array, tangential: Array) -> Array:
        """Values of points and their tangents, on the rows that there are."""
        space = self._space
        return on_rows((normal, tangential), space.normal_rows, space.tangential_rows, len(space.S))


def _changed(before: Array, target: Array) -> Array:
    """The difference of two vectors; zero where there is no point."""
    known = np.isfinite(before) & np.isfinite(target)
    return np.where(known, np.where(known, target, 0.0) - np.where(known, before, 0.0), 0.0)


@dataclass(frozen=True)
class Carried:
    """The largest share of a load step that is carried, on the way of a loading machine.

    Attributes
    ----------
    share : float
    limit : bool
        Whether the bodies move on from there without carrying more. Else no more was found, or, with a
        share of one, no way from there to the step itself.
    """

    share: float
    limit: bool


@dataclass(eq=False)
class At:
    """A state that the machine has come to, and the share of the load that the bodies carry there."""

    pull: float
    share: float
    guess: Guess
    gap: Array


class Pull:
    """A load step on a loading machine.

    Parameters
    ----------
    step : Step
    machine : LoadingMachine
    tolerance : float
    """

    def __init__(self, step: Step, machine: LoadingMachine, tolerance: float) -> None:
        self.step, self.machine, self.tolerance = step, machine, tolerance
        self.motions = machine.leaves(step.motions)
        self.trace: list[Record] = []

    def to(self, pull: float, start: Guess) -> At | None:
        """The state with the machine there; None where none is found."""
        load = self.machine.at(pull)
        step = replace(self.step, problem=self.machine, load=load, motions=self.motions)
        found = self._drive(step, start, IN_SERIES, "pulled")
        if found is None:
            return None
        there = found.iterate.response
        return At(pull, self.machine.share(pull, there), after(step, found), there.gap)

    def answer(self, start: Guess) -> Outcome | None:
        """The step itself from a state that carries all of it; None where that is not found."""
        return self._drive(self.step, start, IN_SERIES, "")

    def _drive(self, step: Step, start: Guess, most: int, note: str) -> Outcome | None:
        try:
            found = drive(newton, step, start, self.tolerance, most)
        except SingularMatrix:
            return None
        self.trace += [replace(record, note=note or record.note) for record in found.trace]
        return found if found.converged else None

    def all_of_it(self, low: At, high: At) -> Outcome | None:
        """The answer between a state that carries too little and one that carries enough."""
        for _ in range(HALVINGS):
            found = self.answer(high.guess)
            if found is not None or high.share <= 1.0 + self.tolerance:
                return found
            part = (1.0 - low.share) / (high.share - low.share)
            at = self.to(low.pull + part * (high.pull - low.pull), low.guess)
            if at is None:
                return None
            low, high = (low, at) if at.share >= 1.0 - self.tolerance else (at, high)
        return None

    def peak(self, low: At, top: At, high: At) -> At:
        """The state that carries most, near one that carries more than those before and after it."""
        for _ in range(HALVINGS):
            before = top.pull - low.pull > high.pull - top.pull  # the longer side
            at = self.to(0.5 * (top.pull + (low if before else high).pull), top.guess)
            if at is None:
                break
            if at.share > top.share:
                low, top, high = (low, at, top) if before else (top, at, high)
            else:
                low, high = (at, high) if before else (low, at)
        return top

    def meets(self, last: At, at: At) -> float:
        """Return how far the machine goes on until an open point meets its partner."""
        opened = (at.guess.status == OPEN) & np.isfinite(at.gap) & self.step.paired
        nearer = (last.gap[opened] - at.gap[opened]) / (at.pull - last.pull)
        comes = nearer > GIVEN * np.max(np.abs(nearer), initial=0.0)
        return float(np.min(at.gap[opened][comes] / nearer[comes], initial=np.inf))


def pulled(
    step: Step, before: Load, guess: Guess, tolerance: float
) -> tuple[Guess, Outcome | None, Carried | None]:
    """Starting values that carry the whole load, how the step ended from there, or what is carried.

    Parameters
    ----------
    step : Step
        On gaps and slips, whose rows do not depend on each other; for others there is no machine.
    before : Load
        Where the step begins.
    guess : Guess
        Where the iterations begin.
    tolerance : float
    """
    problem = cast(ContactProblem, step.problem)
    if problem.points is None or problem.springs is not None:  # springs that have to lose their strain
        return guess, None, None
    machine = LoadingMachine(problem.points, before, step.load, problem.resistance)
    if not machine.pulls:
        return guess, None, None
    machine.begin_at(step.last.gap, step.last.slip)
    way = Pull(step, machine, tolerance)
    found, carried = _go(way, At(0.0, 0.0, guess, before.gap0))
    if found is None:
        return guess, None, carried
    return after(step, found), replace(found, trace=tuple(way.trace)), None


def _go(way: Pull, start: At) -> tuple[Outcome | None, Carried | None]:
    """Pull twice as far from state to state: the answer, or how much is carried."""
    come, farther, best = [start], 1.0, start
    while (at := way.to(come[-1].pull + farther, come[-1].guess)) is not None:
        last, top = come[-1], at
        if len(come) > 1 and at.share < last.share >= come[-2].share:
            top = way.peak(come[-2], last, at)
        best = max(best, top, key=lambda state: state.share)
        if top.share >= 1.0 - way.tolerance:
            found = way.all_of_it(come[-2] if top is not at else last, top)
            return found, None if found else Carried(1.0, limit=False)
        if abs(at.share - last.share) <= GIVEN * best.share + SOLVED * at.pull:
            meets = way.meets(last, at)
            if meets == np.inf:
                return None, Carried(best.share, limit=True)
            farther = max(farther, meets)
        come, farther = [last, at], 2.0 * farther
    return None, Carried(best.share, limit=False)


def after(step: Step, found: Outcome) -> Guess:
    """Starting values from what was found; open points carry nothing."""
    it, there = found.iterate, found.iterate.response
    opened = it.status == OPEN
    normal = np.where(opened, 0.0, there.normal_force)
    tangential = np.where(opened[:, None], 0.0, there.tangential_force)
    return Projection(step, there).proposal(
        Guess(it.status, it.direction, normal, tangential, there.slip)
    )
