"""`LoadStep`: one load step, from the state before it to the result that the user gets."""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from skfem_contact.answers.answer import Answer, answer_of
from skfem_contact.answers.result import ContactResult
from skfem_contact.answers.validity.watch import Watch
from skfem_contact.answers.validity.watched import Said
from skfem_contact.arguments import check_kind
from skfem_contact.bodies.surface import CurveSurface
from skfem_contact.conditions.diagnosis import check_loads
from skfem_contact.conditions.interface import Interface
from skfem_contact.conditions.loads import LoadCase
from skfem_contact.conditions.motions import no_equilibrium
from skfem_contact.conditions.state import State
from skfem_contact.conditions.statics import drives, escape
from skfem_contact.errors import ContactWarning, InputError, NoEquilibrium, NotConverged
from skfem_contact.history.attempt import Attempt, Walk, nothing, plastic_slip, rough_at_rest
from skfem_contact.history.checkpoint import SavedState
from skfem_contact.history.indifference import Grip, Indifference, Rest, pins
from skfem_contact.history.read import StepReader
from skfem_contact.history.recovery import Recovery
from skfem_contact.history.stepping import Stepper
from skfem_contact.linalg.singular import SingularMatrix
from skfem_contact.loops.driver import converged_words
from skfem_contact.loops.starts import natural_state
from skfem_contact.loops.step import Record
from skfem_contact.pairing.corners import Corners
from skfem_contact.problem.model import EVEN_CLOSED, LinearModel

Known = Answer | SavedState | None
JUMPS = (
    "Friction that is not zero without pressure (Tresca, cohesion) is lost all at once where a point "
    "opens, and such a point may have no state at all: closed it is pulled, open it overlaps. A bound "
    "that begins at zero, Coulomb(mu, tau_max=...) with a large mu, is free of that. "
)
CAN_CARRY = "with the forces that contact can carry"


@dataclass(frozen=True, eq=False)
class Way:
    """From where to where a load step goes, and what is known beforehand."""

    state: State
    case: LoadCase
    target: LoadCase
    known: State | None
    callback: Callable[[Record], object] | None


@dataclass(frozen=True, eq=False)
class Found:
    """What came out: the last attempt and the way to it; `rest` where it leaves motions free.

    `refuted`: a motion (k,) by which statics alone shows that there is no equilibrium. `grip`: what
    holds the bodies of an attempt that was good, where supports do not. `driven`: where strains alone
    drive a motion, what it takes to hold it.
    """

    attempt: Attempt
    walk: Walk
    rest: Rest | None = None
    refuted: np.ndarray | None = None
    grip: Grip | None = None
    driven: Rest | None = None


@dataclass(frozen=True, eq=False)
class LoadStep:
    """Reads the loads, advances the state, and makes a result or an error of what came out."""

    model: LinearModel
    stepper: Stepper
    reader: StepReader

    def solve(
        self,
        target: LoadCase,
        start: Known,
        guess: Known,
        callback: Callable[[Record], object] | None,
        throw: bool,
    ) -> Answer:
        """The answer under these loads; see `ContactSolver.solve` for the other arguments."""
        begin = time.perf_counter()
        geometry, interface = self.model.geometry, self.model.interface
        system, kin = geometry.system, geometry.kin
        fixed = geometry.prescribed
        said = check_loads(system, interface, kin, fixed, target, _said(start))
        if start is None:
            case = self.reader.unloaded()
            state = natural_state(kin, len(geometry.surface_dofs))
            state = replace(state, gap=case.gap0)  # without interference
        else:
            state, case = start.state, start.case
        warm = guess or start
        way = Way(state, case, target, None if warm is None else warm.state, callback)
        found = self._find(way, start)
        result = self._result(found, start, target, time.perf_counter() - begin)
        if result.converged:
            watched = self.watch.look(
                result.state,
                result.gap,
                result.case,
                said,
                result.recover.at_contact,
                result.mismatch,
            )
            result.watch(watched)
            result.watch(self.watch.warn(result))
            self._warn(result)
        if result.converged or not throw:
            return result
        raise self._failure(found, result)

    def _find(self, way: Way, start: Known) -> Found:
        """The answer to a load; where it leaves motions free, at the place that moves least."""
        model, f = self.model, way.target.f
        if model.loose.shape[1] and drives(model.motions, f, model.loose):
            raise no_equilibrium(model.motions, model.loose, EVEN_CLOSED, f, shown=True)
        base = self._base
        settled: list[Rest | None] = []
        refuted: list[np.ndarray] = []

        def doubt(last: bool) -> bool:
            """After a failure: is there no equilibrium, or one that leaves a motion free?"""
            kin = model.kin
            if not model.geometry.follows:  # other points may meet
                c = escape(model.motions, self.interface, kin.paired, f)
                refuted.extend([] if c is None else [c])
            if not refuted:
                settled.append(self._try_settle(way, start, last))
            return bool(refuted) or (settled[-1] is not None and not settled[-1].pull)

        may_float = bool(model.motions.k)
        try:
            attempt, walk = base.advance(
                way.state, way.case, way.target, way.known, way.callback, doubt if may_float else None
            )
        except SingularMatrix as error:  # round-off decides whether a free motion makes it so
            if not may_float:
                raise
            return self._freed(way, start, error)
        grip = Grip.of(model, attempt, self.interface) if attempt.good and may_float else None
        if grip is not None and grip.idles:
            other = self._pressed(way)
            if other is not None:
                attempt, grip = other[0], other[2]
                walk = replace(other[1], trace=walk.trace + other[1].trace)
        if grip is not None and (model.loose.shape[1] or grip.idles):
            settled.append(self._try_settle(way, start))
        rest = settled[-1] if settled else None
        if rest is not None and not rest.pull:
            rest.walk.trace[:0] = walk.trace
            return Found(rest.attempt, rest.walk, rest)
        return Found(attempt, walk, None, refuted[0] if refuted else None, grip, rest)

    def _pressed(self, way: Way) -> tuple[Attempt, Walk, Grip] | None:
        """An answer that holds all bodies where they were pressed before; None if there is none.

        A block between inclined sides may stand loose as well as squeezed by friction. From squeezed it
        comes to loose by no small step, but iterations may jump there: pivoting has no such jumps.
        """
        base = self._base
        if "pivoting" not in base.starts() or not np.any(way.state.normal_force > 0):
            return None
        once = replace(base, options=replace(base.options, max_cuts=0))
        given = way.state, way.case, way.target, way.known, way.callback
        try:
            attempt, walk = once.advance(*given, begin=["pivoting"])
        except SingularMatrix:  # where it leads leaves a motion free as well
            return None
        if not attempt.good:
            return None
        grip = Grip.of(self.model, attempt, self.interface)
        return None if grip.idles else (attempt, walk, grip)

    def _freed(self, way: Way, start: Known, error: SingularMatrix) -> Found:
        """The answer where a set of points left a motion free; no answer is no equilibrium.

        Where DOFs that hold the motion do not help, the matrix is singular of itself: `error`.
        """
        try:
            rest = self._settle(way, start, True)
        except SingularMatrix:
            raise error from None
        motions, kin = self.model.motions, self.model.kin
        if rest is not None and rest.pull:
            raise no_equilibrium(motions, rest.free, CAN_CARRY, pull=rest.pull) from error
        if rest is not None:
            return Found(rest.attempt, rest.walk, rest)
        free = motions.free(kin.paired, kin.paired & self.interface.slipping)
        free = free if free.shape[1] else np.eye(motions.k)
        raise no_equilibrium(motions, free, CAN_CARRY, way.target.f) from error

    def _places(self, found: Found) -> tuple[str, ...]:
        """What is to be said of bodies that may stand elsewhere."""
        rest, grip = found.rest, found.grip
        if rest is not None and rest.free.shape[1]:
            return self.model.motions.indifferent(rest.free, rest.why)
        if rest is not None:  # found on weak springs, and held by what carries
            grip = Grip.of(self.model, rest.attempt, self.interface)
        return () if grip is None else grip.adrift(self.interface)

    def _settle(self, way: Way, start: Known, last: bool) -> Rest | None:
        u_last = np.zeros(self.model.system.n) if start is None else start.u
        walk = Walk(way.state, way.case, nothing(self.interface))
        return self._indifference.settle(walk, way.target, u_last, last)

    def _try_settle(self, way: Way, start: Known, last: bool = False) -> Rest | None:
        try:
            return self._settle(way, start, last)
        except SingularMatrix:  # springs as weak as these do not hold a body everywhere
            return None

    @property
    def interface(self) -> Interface:
        """Laws and masks of the contact points."""
        return self.stepper.interface

    @cached_property
    def _indifference(self) -> Indifference:
        return Indifference(self.model, self.stepper)

    @cached_property
    def _base(self) -> Stepper:
        """The stepper; where motions stay free whatever contact does, with as many DOFs held."""
        loose = self.model.loose
        if not loose.shape[1]:
            return self.stepper
        held = self.model.with_springs(pins(self.model, loose))
        return replace(self.stepper, model=held)

    def _warn(self, result: Answer) -> None:
        """Warn of places that are indifferent and have not been said to be so in this history."""
        watched = result.watched
        new = [words for words in result.indifferent if ("place", words) not in watched.said]
        if not new or not np.any(result.u):
            return
        warnings.warn(
            " ".join(new)
            + " Prescribe a DOF (D=...) if the place matters, or the load should hold it. "
            "(Said once in a history; result.indifferent has it in every step.)",
            ContactWarning,
            stacklevel=4,
        )
        result.watch(replace(watched, said=watched.said | {("place", words) for words in new}))

    @cached_property
    def watch(self) -> Watch:
        """What is looked at after every step, made in the first."""
        model = self.model
        return Watch(model.geometry, self.stepper.interface, model.diagonals, lambda: model.known)

    def known(self, given: Any, what: str) -> Known:
        """The state of a result or a file; one of other bodies and contacts is refused."""
        if given is None:
            return None
        usage = "give what solve(...) returned, or load_state(...)"
        check_kind(given, (ContactResult, SavedState), what, usage)
        start = given if isinstance(given, SavedState) else answer_of(given)
        if start.identity is not self.model.geometry.identity:
            self.model.geometry.identity.refuse(start.identity, what)
        if what == "start" and not start.converged:
            raise InputError(
                f"start did not converge ({start.message}): forces and slips of a state that is no "
                "equilibrium are no history. Go on from the last result that did (the last one in "
                "`.results` of the exception) in smaller steps; as starting values alone this one can "
                "be the `guess` of solve(...)."
            )
        if what == "start":
            words = self.reader.other_interference(start.case)
            if words:
                warnings.warn(words, ContactWarning, stacklevel=3)
        return start

    def _result(
        self,
        found: Found,
        start: Known,
        target: LoadCase,
        seconds: float,
    ) -> Answer:
        interface, attempt, walk, rest = self.model.interface, found.attempt, found.walk, found.rest
        before = np.zeros(len(interface.contacts))
        if start is not None:
            before = start.dissipation_before + start.dissipation_by_contact
        message = attempt.failure or attempt.outcome.message
        if attempt.good:  # with all rounds, attempts and substeps that came before the last one
            message = converged_words(len(walk.trace)) + attempt.outcome.note
        case = attempt.case
        return Answer(
            system=self.model.system,
            contacts=interface.contacts,
            names=interface.names,
            kin=attempt.problem.kin,
            stiffness=self.model.stiffness,
            case=case,
            seen=attempt.seen,
            state=attempt.state,
            gap=attempt.local.gap,
            plastic_slip=plastic_slip(interface, attempt.start, attempt.local),
            mismatch=attempt.mismatch,
            converged=attempt.good,
            message=message + walk.words,
            iterations=len(walk.trace),
            trace=tuple(walk.trace),
            timings={**self.model.timings, "loop": seconds},
            tangential_stiffness=interface.stiffness,
            dissipation_by_contact=walk.energy.lost,
            residual_by_contact=walk.energy.residual,
            dissipation_before=before,
            recover=Recovery.of(attempt) if rest is None else rest.recover,
            conditions=attempt.outcome.iterate.conditions,
            factor=target.factor,
            indifferent=self._places(found),
        )

    def _failure(self, found: Found, answer: Answer) -> NoEquilibrium | NotConverged:
        attempt, result = found.attempt, ContactResult(answer)
        motions, free = attempt.problem.motions, attempt.outcome.free
        if found.driven is not None:
            motions, driven = self.model.motions, found.driven
            return no_equilibrium(motions, driven.free, CAN_CARRY, None, result, pull=driven.pull)
        if free is None and found.refuted is not None:
            motions, free = self.model.motions, found.refuted[:, None]
        if free is not None:
            shown = found.refuted is not None
            return no_equilibrium(motions, free, CAN_CARRY, attempt.case.f, result, shown)
        usually = (
            "Usually the load has no equilibrium or several (a large coefficient of friction), or the "
            "step is too large for its path. Try smaller load steps in history(...), another loop, or "
            "a smaller mu; "
        )
        if attempt.culprit >= 0 and self._has_corners(attempt.culprit):
            usually = (
                "Its surfaces have sharp corners. Usually a face gives way to the next one there: the "
                "body snaps from the one to the other, and between them there is no equilibrium, "
                "however small the step. Round the corners by an arc of a few facets, push "
                "less deep, or lead the bodies apart and together again behind the corner; "
            )
        elif attempt.outcome.iterate.changes and rough_at_rest(self.interface, attempt.local):
            usually = JUMPS + usually
        return NotConverged(
            f"The loop '{self.stepper.loop}' did not converge: {result.message}. {usually}"
            "the last state is in `.result` of this exception, the steps before it in `.results`.",
            result,
        )

    def _has_corners(self, point: int) -> bool:
        """Whether the surfaces of a point's contact have convex corners, their ends included."""
        contact = self.interface.contacts[self.interface.contact_of(point)]
        sides = [s for s in (contact.secondary, contact.primary) if isinstance(s, CurveSurface)]
        return any(len(Corners.of(side).node) for side in sides)


def _said(start: Known) -> Said:
    """What has been warned of in the history so far; a file does not know."""
    return start.watched.said if isinstance(start, Answer) else frozenset()
