"""`LoadStep`: one load step, from the state before it to the result that the user gets."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from skfem_contact.arguments import check_kind
from skfem_contact.attempt import Attempt, Walk
from skfem_contact.checkpoint import SavedState
from skfem_contact.diagnosis import check_loads
from skfem_contact.errors import InputError, NoEquilibrium, NotConverged
from skfem_contact.linear_model import LinearModel
from skfem_contact.recovery import Recovery
from skfem_contact.result import ContactResult
from skfem_contact.rigid import no_equilibrium
from skfem_contact.rotation import warn_of_rotation
from skfem_contact.starts import natural_state
from skfem_contact.states import Record
from skfem_contact.stepping import Stepper
from skfem_contact.steps import Settings, StepReader

Known = ContactResult | SavedState | None


@dataclass(frozen=True, eq=False)
class LoadStep:
    """Reads the loads, advances the state, and makes a result or an error of what came out."""

    model: LinearModel
    stepper: Stepper
    reader: StepReader

    def solve(
        self,
        settings: Settings,
        start: Known,
        guess: Known,
        callback: Callable[[Record], object] | None,
        throw: bool,
    ) -> ContactResult:
        """The result under these loads; see `ContactSolver.solve` for the other arguments."""
        begin = time.perf_counter()
        geometry, interface = self.model.geometry, self.model.interface
        system, kin = geometry.system, geometry.kin
        target = self.reader.case(settings)
        fixed = geometry.prescribed
        check_loads(system, interface.contacts, interface.names, interface.parts, kin, fixed, target)
        if start is None:
            case = self.reader.unloaded()
            state = natural_state(kin, len(geometry.surface_dofs))
            state = replace(state, gap=case.gap0)  # without interference
        else:
            state, case = start.state, start.case
        warm = guess or start
        attempt, walk = self.stepper.advance(
            state, case, target, None if warm is None else warm.state, callback
        )
        result = self._result(attempt, walk, start, settings, time.perf_counter() - begin)
        warn_of_rotation(result.rotations)
        if result.converged or not throw:
            return result
        raise self._failure(attempt, result)

    def check_start(self, start: Known, what: str) -> None:
        """Refuse a state of other bodies and contacts, or something else altogether."""
        if start is None:
            return
        usage = "give what solve(...) returned, or load_state(...)"
        check_kind(start, (ContactResult, SavedState), what, usage)
        m, n = len(start.state.status), len(start.case.f)
        if m != self.model.kin.m or n != self.model.system.n:
            raise InputError(
                f"{what} has {m} contact points and {n} DOFs, this solver "
                f"{self.model.kin.m} and {self.model.system.n}. A state can be carried over only "
                "between solvers of the same bodies and contacts, in the same order."
            )

    def _result(
        self,
        attempt: Attempt,
        walk: Walk,
        start: Known,
        settings: Settings,
        seconds: float,
    ) -> ContactResult:
        interface = self.model.interface
        before = np.zeros(len(interface.contacts))
        if start is not None:
            before = start.dissipation_before + start.dissipation_by_contact
        message = attempt.failure or attempt.outcome.message
        case = attempt.case
        return ContactResult(
            system=self.model.system,
            contacts=interface.contacts,
            names=interface.names,
            kin=attempt.placement.kin,
            stiffness=self.model.stiffness,
            case=case,
            seen=attempt.seen,
            state=attempt.state,
            gap=attempt.state.gap,
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
            recover=Recovery(
                attempt.placement.rows,
                attempt.load,
                case,
                attempt.outcome.iterate.response.solution,
            ),
            settings=settings,
            factor=settings.factor,
        )

    def _failure(self, attempt: Attempt, result: ContactResult) -> NoEquilibrium | NotConverged:
        if attempt.outcome.free is not None:
            free, f = attempt.outcome.free, attempt.case.f
            when = "with the forces that contact can carry"
            return no_equilibrium(self.model.motions, free, when, f, result)
        return NotConverged(
            f"The loop '{self.stepper.loop}' did not converge: {result.message}. Usually the load has "
            "no equilibrium or several (a large coefficient of friction), or the step is too large "
            "for its path. Try smaller load steps in history(...), another loop, or a smaller mu; "
            "the last state is in `.result` of this exception.",
            result,
        )
