"""From one state to the next: a load step, cut into smaller ones where it fails.

A step is tried whole, from the last state's contact zone; if that fails, from a cold
start, then from complementary pivoting (Lemke's method); if all fail it is halved. Where contact
slides far, every attempt is solved again on the pairing of its own answer until the two agree
(a fixed point, which secants reach in half the rounds); and if a point slid too far in it, the step
is cut to the share that the distance tells.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skfem_contact.conditions.geometry import Geometry
from skfem_contact.conditions.interface import Interface
from skfem_contact.conditions.kinematics import Kinematics
from skfem_contact.conditions.loads import LoadCase
from skfem_contact.conditions.motions import RigidMotions
from skfem_contact.conditions.state import OPEN, LocalState, State
from skfem_contact.errors import ConstraintError
from skfem_contact.history.attempt import Attempt, Walk, friction_energy, nothing
from skfem_contact.linalg.singular import SingularMatrix
from skfem_contact.linalg.threads import single_threaded
from skfem_contact.loops.anderson import Anderson
from skfem_contact.loops.driver import Options, Outcome, drive
from skfem_contact.loops.guided import guided_friction
from skfem_contact.loops.starts import admissible, possible_starts, starting_values
from skfem_contact.loops.step import Record, Step
from skfem_contact.loops.table import LOOPS
from skfem_contact.problem.model import LinearModel
from skfem_contact.problem.seam import ContactProblem

Array = NDArray[np.float64]
logger = logging.getLogger("skfem_contact")

# What a step is cut to, of the distance that points may slide; and from which multiple of it on the
# first round, on a pairing that is only predicted, is believed.
AIM, FAR = 0.95, 1.3
# Rounds of plain repetition, which suffice where pressures are small against the modulus.
PLAIN = 3
# Round from which on a point that has left the primary surface is not taken back in the same step:
# at its very end there is no pairing that is that of its own answer.
EDGE = 5
# Round-off of contact forces over the terms that cancel where nothing presses.
NOISE = 10 * float(np.finfo(float).eps)
# What may be left of the forces along a free motion: they balance to the digits of the contact problem,
# 1e-8 with moduli 1e6 apart, and where a body ran away nothing of them does.
BALANCE = 1e-4
# And of forces across a motion, where moduli are 1e6 apart: their round-off along it.
ACROSS = 1e-10
# Where supports move, stiff bodies move with them, and the round-off of their forces may be more: it is
# excused up to this share of the forces across a motion.
CARRIED = 1e-7
RAN_AWAY = (
    "loads and contact forces do not balance along a motion that supports leave free: it is hardly "
    "held, and ran away until round-off carried the load"
)
# A point that slides over just one facet per step does so up to this.
ROUND_OFF = 1e-9


@dataclass(eq=False)
class Stepper:
    """Advances states along load steps; what it keeps does not depend on them.

    Parameters
    ----------
    interface : Interface
    geometry : Geometry
    model : LinearModel
        The bodies, which it gives the contact problem on each pairing of.
    loop : str
    options : Options
    barred : ndarray of bool, shape (m,), optional
        Points that are left out.
    """

    interface: Interface
    geometry: Geometry
    model: LinearModel
    loop: str
    options: Options
    barred: NDArray[np.bool_] | None = None  # points that stay open whatever happens

    def advance(
        self,
        state: State,
        case: LoadCase,
        target: LoadCase,
        warm: State | None,
        callback: Callable[[Record], object] | None,
        doubt: Callable[[bool], bool] | None = None,
        begin: list[str] | None = None,
    ) -> tuple[Attempt, Walk]:
        """Go from a state under `case` to `target`; the last attempt says whether it arrived.

        `doubt(False)` is asked where the whole step has failed, whether to leave it at that, and
        `doubt(True)` where smaller steps have failed as well. `begin` are the starts of the first
        attempt, by default all that there are.
        """
        walk = Walk(state, case, nothing(self.interface))
        known = warm
        starts = begin or [s for s in self.starts() if known is not None or s != "warm"]
        done, share, fails = 0.0, 1.0, 0
        smallest = 0.5**self.options.max_cuts
        while True:
            aim = min(1.0, done + share)
            here, walk.share = case.towards(target, aim), aim - done
            try:
                attempt = self._attempt(walk, here, starts[0], known or walk.state, callback)
            except ConstraintError:
                # contacts that share a node and can not all close there are no contradiction yet
                if starts == ["apart"]:
                    raise
                starts = ["apart"]
                continue
            except SingularMatrix:
                # not of the bodies, if another set of points can be solved for
                if len(starts) == 1:
                    raise
                starts.pop(0)
                continue
            walk.trace.extend(attempt.outcome.trace)
            last = len(starts) == 1 or attempt.failure == RAN_AWAY  # wherever it begins
            lost = not attempt.good and not attempt.stopped and last
            if lost and doubt is not None and share == 1.0 and doubt(False):
                return attempt, walk
            if attempt.good:
                if self.interface.laws:
                    energy = friction_energy(self.interface, attempt.start, attempt.local)
                    walk.energy = walk.energy + energy
                walk.state, walk.case, done = attempt.state, here, aim
                if done >= 1.0:
                    return attempt, walk
                known, starts, fails = walk.state, self.starts(), 0
                walk.substeps += 1
                share = min(grown(share, attempt.travel), 1.0 - done)
            elif attempt.outcome.free is not None and "pivoting" in starts and self._complete:
                # smaller steps would end there too
                if starts == ["pivoting"]:
                    return attempt, walk
                starts = ["pivoting"]
            elif len(starts) > 1 and not attempt.failure and not attempt.stopped:
                starts.pop(0)  # before cutting: begin elsewhere
            elif share <= smallest or fails >= self.options.max_cuts or attempt.stopped:
                if doubt is not None and not attempt.stopped:
                    doubt(True)
                return attempt, walk
            else:
                shorter = 0.5
                if attempt.travel > 1.0:  # no fault of the step's but its size: measured, not tried
                    shorter = AIM / attempt.travel
                    smallest *= shorter
                share *= shorter
                walk.cuts += 1
                fails += 1
                reason = attempt.failure or attempt.outcome.message
                logger.info("step cut to %.4g of its size: %s", share, reason)
                known, starts = walk.state, self.starts()

    def starts(self) -> list[str]:
        """Where attempts may begin, in this order."""
        return possible_starts(len(self.interface.stiffness), self.loop)

    @property
    def _complete(self) -> bool:
        """Whether pivoting finds what there is: for linear laws in 2-D and a given pairing."""
        linear = all(law.is_linear for _, law in self.interface.laws)
        return linear and not self.geometry.follows

    def _attempt(
        self,
        walk: Walk,
        case: LoadCase,
        start: str,
        known: State,
        callback: Callable[[Record], object] | None,
    ) -> Attempt:
        """Solve one load; where contact slides far, on the pairing of its own answer."""
        geometry, options = self.geometry, self.options
        if not geometry.follows:
            return self._solve(walk, case, self.model.problem_on(None, None), start, known, callback)
        at = walk.state.surface + walk.share * walk.state.trend
        u = geometry.spread(at)
        problem = self.model.problem_on(geometry.at(u, case), u)
        trace: tuple[Record, ...] = ()
        secant, lost = Anderson(), np.zeros(len(geometry.finite), dtype=bool)
        for number in range(options.max_placements):
            attempt = self._solve(walk, case, problem, start, known, callback)
            trace += attempt.outcome.trace
            outcome = replace(attempt.outcome, trace=trace)
            attempt = replace(attempt, outcome=outcome)
            if not attempt.good:
                return attempt
            attempt = self._travelled(attempt, 1.0 if number else FAR)
            if attempt.failure:
                return attempt
            there = attempt.local.surface
            plain = number < PLAIN
            at = there if plain else secant.next(at, there)
            u = geometry.spread(at)
            next_kin = without_points(geometry.at(u, case, problem.kin), lost)
            if number >= EDGE:
                lost = lost | (problem.kin.paired & ~next_kin.paired)
            mismatch = geometry.mismatch(problem.kin, next_kin, attempt.local, self.barred)
            if mismatch <= options.placement_tolerance:
                # so far only the next pairing is alike: what counts is that of the answer itself
                own = next_kin
                if not plain:
                    own = geometry.at(geometry.spread(there), case, next_kin)
                    own = without_points(own, lost)
                    mismatch = geometry.mismatch(problem.kin, own, attempt.local, self.barred)
                if mismatch <= options.placement_tolerance:
                    return self._settled(attempt, own, mismatch)
            start, known = "warm", attempt.state
            problem = self.model.problem_on(next_kin, u)
        point = geometry.least_settled(problem.kin, next_kin, attempt.local)
        words = f"the pairing did not settle in {options.max_placements} rounds ({mismatch:.1e}): "
        words += self.interface.point_words(point, next_kin.points[point])
        words += " meets another partner in every round"
        return replace(attempt, mismatch=mismatch, failure=words, culprit=point)

    def _settled(self, attempt: Attempt, own: Kinematics, mismatch: float) -> Attempt:
        """The attempt whose pairing is that of its own answer, with the gaps of that."""
        local = attempt.local
        gap = np.where(self.geometry.finite & (local.status == OPEN), own.gap0, local.gap)
        attempt = replace(attempt, mismatch=mismatch, local=replace(local, gap=gap))
        return self._travelled(attempt, 1.0)

    def _travelled(self, attempt: Attempt, limit: float) -> Attempt:
        """Measure how far points slid, over what is allowed; refuse what is beyond a limit."""
        last, new = attempt.start, attempt.local
        closed = (new.status != OPEN) & (last.status != OPEN) & self.geometry.finite
        slid = np.linalg.norm(new.slip - last.slip, axis=1)
        travel, culprit = 0.0, -1
        for contact, part in zip(self.interface.contacts, self.interface.point_slices, strict=True):
            way = np.where(closed[part], slid[part], 0.0)
            share = np.max(way) / (self.options.max_travel * np.mean(contact.secondary.lengths))
            if not share <= travel:  # a NaN as well
                travel, culprit = float(share), part.start + int(np.argmax(way))
        if travel > max(limit, 1.0 + ROUND_OFF):
            words = self.interface.point_words(culprit, attempt.problem.kin.points[culprit])
            words += f" slid {travel:.3g} times as far as max_travel allows"
            return replace(attempt, failure=words, travel=travel, culprit=culprit)
        return replace(attempt, travel=travel)

    def _solve(
        self,
        walk: Walk,
        case: LoadCase,
        problem: ContactProblem,
        start: str,
        known: State,
        callback: Callable[[Record], object] | None,
    ) -> Attempt:
        interface, options, kin = self.interface, self.options, problem.kin
        # a vertex brings its history along to the point that carries its row now
        last = walk.state.handed_on(kin.vertex, interface.point_slices).along(kin)
        begin = last
        if known is not walk.state:
            begin = known.handed_on(kin.vertex, interface.point_slices).along(kin)
        with single_threaded():
            seen = self.geometry.case(problem.kin, problem.u, case, last, walk.case)
            load = problem.load(seen)
            paired = kin.paired & (interface.tied | problem.able)
            if self.barred is not None:
                paired &= ~self.barred
            guided = problem.guided if interface.laws else np.zeros_like(paired)
            step = Step(
                problem=problem,
                load=load,
                motions=problem.motions,
                area=kin.area,
                paired=paired,
                tied=interface.tied & paired,
                laws=interface.laws,
                frictional=interface.frictional & paired & ~guided,
                stiffness=interface.stiffness,
                last=last,
                rank=self.geometry.rank,
                noise=NOISE * self._force_terms(case),
            )
            dense = step
            if start == "pivoting" and (points := self.model.on_points(problem)) is not problem:
                dense = replace(step, problem=points, load=points.load(seen))
            guess, spent = starting_values(start, begin, step, kin, options.tolerance, self.loop, dense)
            guess = admissible(guess, step)
            loop = LOOPS[self.loop]
            limit = options.max_iterations or loop.most
            outcome = drive(
                loop.iterates, step, guess, options.tolerance, limit, callback, loop.patience
            )
            trace = (*(spent.trace if spent else ()), *outcome.trace)
            if spent and spent.converged and not outcome.converged and not outcome.stopped:
                # the same equations and tolerance: limits that lag ran away from their solution
                outcome = replace(spent, note=" of the loop 'newton'")
            elif spent and spent.free is not None and not outcome.converged:
                outcome = replace(outcome, free=spent.free)  # its limits do not lag
            note = outcome.note or (" after complementary pivoting" if guess.pivoted else "")
            outcome = replace(outcome, trace=trace, note=note)
            local = self._state(step, outcome, walk.share, problem, load, case, seen)
        carried = NOISE * max(self.model.stiffest) * self._moved(case)
        fine = balanced(problem.motions, case.f, local, step.noise, carried)
        failure = "" if fine else RAN_AWAY
        return Attempt(outcome, self.model, problem, load, case, seen, last, local, failure=failure)

    def _force_terms(self, case: LoadCase) -> float:
        """Largest load, or what moves of D make of the softest body's stiffness [force]."""
        softest = min(self.model.stiffest)  # the bodies' own K may have been replaced
        return max(case.largest_force, softest * self._moved(case))

    def _moved(self, case: LoadCase) -> float:
        """How far supports are moved [length]."""
        return float(np.max(np.abs(case.x[self.geometry.system.D]), initial=0.0))

    def _state(
        self,
        step: Step,
        outcome: Outcome,
        share: float,
        problem: ContactProblem,
        load: Any,
        case: LoadCase,
        seen: LoadCase,
    ) -> LocalState:
        it, last = outcome.iterate, step.last
        response = it.response
        status, friction = it.status, response.tangential_force
        if step.laws:
            guided = problem.guided & self.interface.frictional
            status, friction = guided_friction(step, guided, status, response)
        opened = (status == OPEN)[:, None]
        surface, slip = last.surface, response.slip
        if self.geometry.follows:
            dofs = self.geometry.surface_dofs
            source = problem.source(load, response)
            surface = problem.surface(source, case)[dofs]
            slip = self.geometry.slip(problem.kin, seen, surface, slip, self.interface.slipping)
        return LocalState(
            status,
            slip,
            np.where(opened, 0.0, friction),
            np.where(opened[:, 0], 0.0, response.normal_force),
            np.where(opened, slip, last.reference),
            response.gap,
            problem.kin.area,
            surface,
            (surface - last.surface) / share,
            problem.kin.vertex,
        )


def balanced(
    motions: RigidMotions, f: Array, state: LocalState, noise: float, carried: float = 0.0
) -> bool:
    """Whether loads and contact forces balance along the motions that supports leave free.

    A body that is hardly held may move by 1e10 of its size: then the round-off of its ``K u`` carries
    any load, equilibrium is met to all digits of that, and nothing balances the load. `noise` and
    `carried` are round-off of the forces in the softest and in the stiffest body that moves no further
    than supports do [force].
    """
    if motions.k == 0:
        return True
    closed = state.status != OPEN
    force, friction = state.normal_force[closed], state.tangential_force[closed]
    parts = [(motions.normal[closed], force), (motions.modes, f)]
    if friction.any():
        parts.append((motions.tangential[closed].reshape(-1, motions.k), -friction.ravel()))
    left = np.abs(sum(rows.T @ values for rows, values in parts))
    # along a motion that nothing pushes there is only the round-off of what acts across it; the largest
    # displacement of each motion is one
    if np.all(left <= ACROSS * np.abs(force).sum()):  # nearly always: the rest need not be looked at
        return True
    across = sum(float(np.abs(values).sum()) for _, values in parts)
    size = sum(np.abs(rows).T @ np.abs(values) for rows, values in parts)
    least = np.maximum(BALANCE * size, max(ACROSS * across, noise * len(f)))
    least = np.maximum(least, min(carried, CARRIED * across))
    return bool(np.all(left <= least))


def grown(share: float, travel: float) -> float:
    """The share to try after a success: twice as much, but no further than points may slide."""
    return share * min(2.0, AIM / travel if travel > 0 else 2.0)


def without_points(kin: Kinematics, lost: NDArray[np.bool_]) -> Kinematics:
    """The pairing with some points open for good."""
    if not lost.any():
        return kin
    return replace(kin, paired=kin.paired & ~lost, gap0=np.where(lost, np.inf, kin.gap0))
