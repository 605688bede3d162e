"""`Stepper`: what load steps are solved by, and one attempt at a load step on a given pairing."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from skfem_contact.conditions.friction import Tresca
from skfem_contact.conditions.loads import LoadCase
from skfem_contact.conditions.state import OPEN, LocalState
from skfem_contact.conditions.statics import balanced
from skfem_contact.history.grip import pins
from skfem_contact.history.load_step import Attempt, LoadStep
from skfem_contact.history.thresholds import NOISE
from skfem_contact.linalg.threads import single_threaded
from skfem_contact.loops.driver import Options, Outcome, drive
from skfem_contact.loops.guided import guided_friction
from skfem_contact.loops.starts import DENSE, admissible, possible_starts, starting_values
from skfem_contact.loops.step import Step
from skfem_contact.loops.table import LOOPS
from skfem_contact.problem.model import LinearModel
from skfem_contact.problem.response import Load
from skfem_contact.problem.seam import ContactProblem

RAN_AWAY = (
    "loads and contact forces do not balance along a motion that supports leave free: it is hardly "
    "held, and ran away until round-off carried the load"
)


@dataclass(frozen=True, eq=False)
class Stepper:
    """What load steps are solved by; nothing of it depends on them.

    Attributes
    ----------
    model : LinearModel
        The bodies, which it gives the contact problem on each pairing of.
    loop : str
    options : Options
    barred : ndarray of bool, shape (m,), optional
        Points that stay open whatever happens.
    """

    model: LinearModel
    loop: str
    options: Options
    barred: NDArray[np.bool_] | None = None

    @cached_property
    def held(self) -> Stepper:
        """Itself; where motions stay free whatever contact does, with as many DOFs held."""
        loose = self.model.loose
        if not loose.shape[1]:
            return self
        return replace(self, model=self.model.with_springs(pins(self.model, loose)))

    def starts(self) -> list[str]:
        """Where attempts may begin, in this order."""
        interface, turns = self.model.interface, self.model.kin.tangents > 1
        return possible_starts(len(interface.stiffness), self.loop, turns and bool(interface.laws))

    @property
    def complete(self) -> bool:
        """Whether pivoting finds what there is: for linear laws in 2-D and a given pairing.

        The bound of points that never open is not linear in a force that may pull, but for Tresca's.
        """
        interface = self.model.interface
        linear = all(
            law.is_linear and (isinstance(law.law, Tresca) or not interface.bilateral[part].any())
            for part, law in interface.laws
        )
        return linear and not self.model.geometry.follows

    def attempt(self, to: LoadStep, problem: ContactProblem, start: str) -> Attempt:
        """Solve a load step as it is, on one pairing, from one of the `starts`."""
        interface, geometry = self.model.interface, self.model.geometry
        options, kin = self.options, problem.kin
        # a vertex brings its history along to the point that carries its row now
        last = to.state.handed_on(kin.vertex, interface.point_slices).along(kin)
        begin = last
        if to.known is not None and to.known is not to.state:
            begin = to.known.handed_on(kin.vertex, interface.point_slices).along(kin)
        moved = self._moved(to.target)
        with single_threaded():
            seen = geometry.case(kin, problem.u, to.target, last, to.before)
            load = problem.load(seen)
            paired = kin.paired & (interface.bilateral | problem.able)
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
                bilateral=interface.bilateral & paired,
                laws=interface.laws,
                frictional=interface.frictional & paired & ~guided,
                stiffness=interface.stiffness,
                last=last,
                rank=geometry.rank,
                noise=NOISE * self._force_terms(to.target, moved),
                resistance=problem.resistance if interface.laws and kin.tangents > 1 else None,
            )
            dense = step
            if start in DENSE and (points := self.model.on_points(problem)) is not problem:
                dense = replace(step, problem=points, load=points.load(seen))
            guess, spent = starting_values(start, begin, step, kin, options.tolerance, self.loop, dense)
            guess = admissible(guess, step)
            loop = LOOPS[self.loop]
            limit = options.max_iterations or loop.most
            outcome = drive(
                loop.iterates, step, guess, options.tolerance, limit, to.callback, loop.patience
            )
            trace = (*spent.trace, *outcome.trace) if spent else outcome.trace
            if spent and spent.converged and not outcome.converged and not outcome.stopped:
                # the same equations and tolerance: limits that lag ran away from their solution
                outcome = replace(spent, note=" of the loop 'newton'")
            elif spent and spent.free is not None and not outcome.converged:
                outcome = replace(outcome, free=spent.free)  # its limits do not lag
            note = outcome.note or (" after complementary pivoting" if guess.pivoted else "")
            if trace is not outcome.trace or note:
                outcome = replace(outcome, trace=trace, note=note)
            local = self._state(step, outcome, to.share, problem, load, to.target, seen)
        carried = NOISE * max(self.model.stiffest) * moved
        fine = balanced(problem.motions, to.target.f, local, step.noise, carried)
        failure = "" if fine else RAN_AWAY
        return Attempt(
            outcome, self.model, problem, load, to.target, seen, last, local, failure=failure
        )

    def _force_terms(self, case: LoadCase, moved: float) -> float:
        """Largest load, or what moves of D make of the softest body's stiffness [force]."""
        softest = min(self.model.stiffest)  # the bodies' own K may have been replaced
        return max(case.largest_force, softest * moved)

    def _moved(self, case: LoadCase) -> float:
        """How far supports are moved [length]."""
        return float(np.abs(case.x[self.model.system.D]).max(initial=0.0))

    def _state(
        self,
        step: Step,
        outcome: Outcome,
        share: float,
        problem: ContactProblem,
        load: Load,
        case: LoadCase,
        seen: LoadCase,
    ) -> LocalState:
        it, last = outcome.iterate, step.last
        interface, geometry = self.model.interface, self.model.geometry
        response = it.response
        status, friction = it.status, response.tangential_force
        if step.laws:
            guided = problem.guided & interface.frictional
            status, friction = guided_friction(step, guided, status, response)
        opened = status == OPEN
        surface, slip = last.surface, response.slip
        if geometry.follows:
            dofs = geometry.surface_dofs
            source = problem.source(load, response)
            surface = problem.surface(source, case)[dofs]
            slip = geometry.slip(problem.kin, seen, surface, slip, interface.slipping)
        friction, normal_force = friction.copy(), response.normal_force.copy()
        friction[opened] = normal_force[opened] = 0.0
        reference = last.reference.copy()
        reference[opened] = slip[opened]
        return LocalState(
            status,
            slip,
            friction,
            normal_force,
            reference,
            response.gap,
            problem.kin.area,
            surface,
            (surface - last.surface) / share,
            problem.kin.vertex,
            last.wear,
            last.worn,
        )
