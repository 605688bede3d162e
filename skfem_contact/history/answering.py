"""From a load case to an answer: solved, looked at, warned of, or refused in words."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from skfem_contact.answers.answer import Answer, answer_of
from skfem_contact.answers.result import ContactResult
from skfem_contact.answers.validity.watch import Watch
from skfem_contact.answers.validity.watched import Said
from skfem_contact.arguments import check_kind
from skfem_contact.carried import ByFields
from skfem_contact.conditions.diagnosis import check_loads
from skfem_contact.conditions.loads import LoadCase
from skfem_contact.digits import SOLVED
from skfem_contact.errors import InputError, warn
from skfem_contact.history.checkpoint import SavedState
from skfem_contact.history.failure import failure
from skfem_contact.history.finding import Finding, Known
from skfem_contact.history.grip import Grip
from skfem_contact.history.load_step import LoadStep
from skfem_contact.history.read import StepReader
from skfem_contact.history.recovery import Recovery
from skfem_contact.history.second_order import second_order
from skfem_contact.history.stepper import Stepper
from skfem_contact.loops.driver import converged_words
from skfem_contact.loops.starts import natural_state
from skfem_contact.loops.step import Record
from skfem_contact.once import once
from skfem_contact.problem.seam import Workspace


@dataclass(frozen=True, eq=False)
class Answering(ByFields):
    """What makes answers of load cases: one for all load steps of a solver."""

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
        with Workspace() as workspace:
            return self._solved(target, start, guess, callback, throw, workspace)

    def _solved(
        self,
        target: LoadCase,
        start: Known,
        guess: Known,
        callback: Callable[[Record], object] | None,
        throw: bool,
        workspace: Workspace,
    ) -> Answer:
        begin = time.perf_counter()
        model = self.stepper.model
        geometry, kin = model.geometry, model.kin
        fixed = geometry.prescribed
        said = check_loads(model.system, model.interface, kin, fixed, target, _said(start))
        if start is None:
            before = self.reader.unloaded()
            state = natural_state(kin, len(geometry.surface_dofs))
            state = replace(state, gap=before.gap0)  # without interference
        else:
            state, before = start.state, self.left(start)
        warm = guess or start
        known = None if warm is None else warm.state
        step = LoadStep(state, before, target, known, callback, workspace=workspace)
        found = Finding(self.stepper, step, start)
        found.find()
        result = self._answer(found, time.perf_counter() - begin)
        if result.converged:
            watched = self.watch.look(
                result.state,
                result.gap,
                result.worn_case,
                said,
                result.recover.at_contact,
                lambda: result.u,
            )
            leaning = second_order(found.advance.attempt) if found.settled is None else {}
            if leaning:
                watched = replace(watched, leaning=leaning)
            result.watch(watched)
            result.watch(self.watch.warn(result))
            _warn(result)
        if result.converged or not throw:
            return result
        raise failure(found, result)

    def left(self, start: Answer | SavedState) -> LoadCase:
        """The loads of a state to go on from, with the places that new supports find DOFs at.

        They hold from there on, also in parts of a step: not from zero.
        """
        model, case = self.stepper.model, start.case
        if self._own(start):
            return case
        D = model.system.D
        found, x = start.u[D], np.array(case.x)
        elsewhere = np.abs(found - x[D]) > SOLVED * np.max(np.abs(start.u), initial=0.0)
        if not elsewhere.any():
            return case
        x[D[elsewhere]] = found[elsewhere]
        return replace(case, x=x)

    @once
    def watch(self) -> Watch:
        """What is looked at after every step, made in the first."""
        model = self.stepper.model
        return Watch(model.geometry, model.interface, model.diagonals, lambda: model.known)

    def known(self, given: Any, what: str) -> Known:
        """The state of a result or a file; one of other bodies and contacts is refused."""
        if given is None:
            return None
        usage = "give what solve(...) returned, or load_state(...)"
        check_kind(given, (ContactResult, SavedState), what, usage)
        start = given if isinstance(given, SavedState) else answer_of(given)
        if not self._own(start):
            self.stepper.model.geometry.identity.refuse(start.identity, what)
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
                warn(words)
        return start

    def _own(self, start: Answer | SavedState) -> bool:
        """Whether a state is of the very bodies and contacts that are solved for here."""
        geometry = self.stepper.model.geometry
        if isinstance(start, Answer) and start.recover.model.geometry is geometry:
            return True  # before finding out what tells them from others
        return start.identity is geometry.identity

    def _answer(self, found: Finding, seconds: float) -> Answer:
        model, rest, way = self.stepper.model, found.settled, found.advance
        interface, attempt = model.interface, way.attempt
        before = np.zeros(len(interface.contacts))
        start = found.start
        if start is not None:
            before = start.dissipation_before + start.dissipation_by_contact
        message = attempt.failure or attempt.outcome.message
        if attempt.good:  # with all rounds, attempts and substeps that came before the last one
            message = converged_words(len(way.trace)) + attempt.outcome.note
        case = attempt.case
        return Answer(
            system=model.system,
            contacts=interface.contacts,
            names=interface.names,
            kin=attempt.problem.kin,
            stiffness=model.stiffness,
            case=case,
            seen=attempt.seen,
            state=attempt.state,
            gap=attempt.local.gap,
            action=attempt.action,
            plastic_slip=attempt.plastic_slip,
            mismatch=attempt.mismatch,
            converged=attempt.good,
            message=message + way.words,
            iterations=len(way.trace),
            trace=tuple(way.trace),
            timings={**model.timings, "loop": seconds},
            tangential_stiffness=interface.stiffness,
            dissipation_by_contact=way.energy.lost,
            residual_by_contact=way.energy.residual,
            dissipation_before=before,
            recover=Recovery.of(attempt) if rest is None else rest.recover,
            conditions=attempt.outcome.iterate.conditions,
            factor=found.step.target.factor,
            linear=model.choice.said,
            indifferent=self._places(found),
            springs=attempt.problem.springs is not None,
        )

    def _places(self, found: Finding) -> tuple[str, ...]:
        """What is to be said of bodies that may stand elsewhere."""
        model, rest, grip = self.stepper.model, found.settled, found.grip
        if rest is not None and rest.free.shape[1]:
            return model.motions.indifferent(rest.free, rest.why)
        if rest is not None:  # found on weak springs, and held by what carries
            grip = Grip.of(model, rest.advance.attempt)
        return () if grip is None else grip.adrift(model.interface)


def _warn(result: Answer) -> None:
    """Warn of places that are indifferent and have not been said to be so in this history."""
    watched = result.watched
    new = [words for words in result.indifferent if ("place", words) not in watched.said]
    if not new or not np.any(result.u):
        return
    warn(
        " ".join(new) + " Prescribe a DOF (D=...) if the place matters, or the load should hold it. "
        "(Said once in a history; result.indifferent has it in every step.)"
    )
    result.watch(replace(watched, said=watched.said | {("place", words) for words in new}))


def _said(start: Known) -> Said:
    """What has been warned of in the history so far; a file does not know."""
    return start.watched.said if isinstance(start, Answer) else frozenset()
