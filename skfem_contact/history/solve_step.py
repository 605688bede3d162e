"""From a load case to an answer: solved, looked at, warned of, or refused in words.

Rigid bodies roll and lean: small sliding leaves out moments of second order (`second_order`). A tool
that moves by v carries its loads along, and contact forces act at points that have moved by u. So it
turns under ``sum (u - v) x F`` besides: the moment that lets a roller roll on and a tower topple,
P-delta to builders. Small sliding has the arms of the undeformed place, and so an equilibrium for a
roller that anything sets rolling. Here the moment is put on the answer, once and with every point as
it is; how much the tool then moves beside how much it did says what the answer is worth.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from skfem_contact.answers.answer import Answer, Newton, Placed
from skfem_contact.answers.certificate import certified
from skfem_contact.answers.result import ContactResult
from skfem_contact.answers.validity.assess import Watch
from skfem_contact.answers.validity.validity import A_TENTH, Issued
from skfem_contact.arguments import check_kind
from skfem_contact.arrays import Array, Mask, cross
from skfem_contact.assemblies.bolt import Bolts
from skfem_contact.conditions.checks import check_loads
from skfem_contact.conditions.state import LoadCase
from skfem_contact.digits import COMPUTED, SOLVED
from skfem_contact.errors import InputError, LinearSolveError, SingularMatrix, warn
from skfem_contact.history.equilibrium import ARRIVED, EquilibriumSearch, Verdict
from skfem_contact.history.load_step import Attempt, LoadStep
from skfem_contact.history.read import StepReader
from skfem_contact.history.stepper import Stepper
from skfem_contact.linalg.dense_factors import single_threaded
from skfem_contact.loops.driver import NOTHING_HOLDS, converged_words
from skfem_contact.loops.starts import natural_state
from skfem_contact.loops.step import Record
from skfem_contact.obstacles.rigid_body import RigidBody
from skfem_contact.problem.seam import Workspace
from skfem_contact.records import ByFields, dataclass, once

if TYPE_CHECKING:
    from skfem_contact.history.checkpoint import SavedState
    from skfem_contact.history.equilibrium import Known
    from skfem_contact.history.nonlinear import NonlinearSearch

# Sway and turn of a tool over the way that it moves, below which what changes them is compared with
# this part of the way: a press down by 1 with a shift of 0.001 is one without.
HARDLY_MOVES = 0.01


@dataclass(frozen=True, eq=False)
class StepSolver(ByFields):
    """The maker of answers to load cases: one for all load steps of a solver."""

    stepper: Stepper
    reader: StepReader
    bolts: Bolts

    def solve(
        self,
        target: LoadCase,
        start: Known,
        guess: Known,
        callback: Callable[[Record], object] | None,
        throw: bool,
    ) -> Answer:
        """The answer under these loads; see `ContactSolver.solve` for the other arguments."""
        bolts = target.bolts
        solver = self if bolts is None or not bolts.given.any() else self._loosened(bolts.given)
        with Workspace() as workspace, single_threaded:
            return solver._solved(target, start, guess, callback, throw, workspace)

    def _loosened(self, given: Mask) -> StepSolver:
        """The solver of steps that give forces to some bolts: their sections slide."""
        model, key = self.stepper.model, b"bolts" + given.tobytes()
        other = model.with_other(key, lambda: self.bolts.loosened(given, model.stiffness))
        known: dict[bytes, StepSolver] = self._variants
        if key not in known or known[key].stepper.model is not other:
            stepper = Stepper(other, self.stepper.loop, self.stepper.options)
            known[key] = StepSolver(stepper, self.reader, self.bolts)
        return known[key]

    @once
    def _variants(self) -> dict[bytes, StepSolver]:
        """Solvers with other bolts loose, as far as they were needed."""
        return {}

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
        if start is None:
            before = self.reader.unloaded()
            state = natural_state(kin, len(geometry.surface_dofs))
            state = replace(state, gap=before.gap0)  # without interference
        else:
            state, before = start.state, self.left(start)
        if self.bolts.names:
            told = (lambda: start.tightness) if start is not None else dict
            before, target = self.bolts.step(before, target, told)
        # what has been warned of in the history so far: a file does not know
        issued = start.diagnostics.issued if isinstance(start, Answer) else Issued()
        issued = check_loads(model.system, model.interface, kin, fixed, target, issued)
        warm = guess or start
        known = None if warm is None else warm.state
        step = LoadStep(state, before, target, known, callback, workspace=workspace)
        found: EquilibriumSearch | NonlinearSearch
        if any(body.nonlinear for body in model.system.bodies):
            from skfem_contact.history.nonlinear import NonlinearSearch  # many jobs have none

            found = NonlinearSearch(self.stepper, step, start)
        else:
            found = EquilibriumSearch(self.stepper, step, start)
        verdict = found.find()
        if not verdict.reached:
            raise verdict.error(self.stepper.loop, None)
        result = self._answer(found, verdict, time.perf_counter() - begin)
        arrived = verdict is ARRIVED
        if arrived:
            # multigrid ends at a share of the load, which is large where supports move bodies far
            if model.choice.few_steps and (left := certified(result).equilibrium) > SOLVED:
                raise LinearSolveError(f"forces are balanced to {left:.1e} of the largest")
            leaning = second_order(found.advance.attempt) if found.settled is None else {}
            self.watch.look(result, issued, leaning)
            _tell(result, getattr(found, "remarks", {}))
        if arrived or not throw:
            return result
        raise verdict.error(self.stepper.loop, ContactResult(result))

    def begin(self, start: Any, guess: Any) -> tuple[Known, Known, LoadCase]:
        """The states to go on from and to begin iterations with, and the loads to go on from."""
        before = self.known(start, "start")
        return before, self.known(guess, "guess"), self.loads(before)

    def loads(self, start: Known) -> LoadCase:
        """The loads that steps go on from, see `StepReader.resumed`."""
        if start is None:
            return self.reader.initial()
        here = isinstance(start, Answer) and start.model.geometry is self.stepper.model.geometry
        return self.reader.resumed(start.case, self.left(start).x, here)

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

    @cached_property
    def watch(self) -> Watch:
        """Return what is looked at after every step, made in the first."""
        model = self.stepper.model
        return Watch(model.geometry, model.diagonals, lambda: model.known)

    def known(self, given: Any, what: str) -> Known:
        """The state of a result or a file; one of other bodies and contacts is refused."""
        if given is None:
            return None
        start: Answer | SavedState
        if isinstance(given, ContactResult):
            start = given._answer
        else:
            from skfem_contact.history.checkpoint import SavedState

            usage = "give what solve(...) returned, or load_state(...)"
            check_kind(given, (ContactResult, SavedState), what, usage)
            start = given
        own = self._own(start)
        if not own:
            self.stepper.model.geometry.identity.refuse(start.identity, what)
        if what == "start" and not start.converged:
            raise InputError(
                f"start did not converge ({start.message}): forces and slips of a state that is no "
                "equilibrium are no history. Go on from the last result that did (the last one in "
                "`.results` of the exception) in smaller steps; as starting values alone this one can "
                "be the `guess` of solve(...)."
            )
        strange = [] if own else sorted(set(start.bolt_names) - set(self.bolts.names))
        if strange:
            raise InputError(
                f"{what} is a state with bolts {', '.join(map(repr, strange))}, which this solver does "
                "not have: pass the same bolts=[...], with the same names"
            )
        if what == "start" and not own:
            words = self.reader.other_interference(start.case)
            if words:
                warn(words)
        return start

    def _own(self, start: Answer | SavedState) -> bool:
        """Return whether a state is of the very bodies and contacts that are solved for here."""
        geometry = self.stepper.model.geometry
        if isinstance(start, Answer) and start.model.geometry is geometry:
            return True  # before finding out what tells them from others
        return start.identity is geometry.identity

    def _answer(
        self, found: EquilibriumSearch | NonlinearSearch, verdict: Verdict, seconds: float
    ) -> Answer:
        way = found.advance
        attempt, recovery = way.attempt, found.recovery
        # of bodies that are not linear a model of their own, with the tangents of this answer
        placed: Placed | None = getattr(found, "placed", None)
        model = self.stepper.model if placed is None else recovery.model
        before = np.zeros(len(model.interface.contacts))
        start = found.start
        if start is not None:
            before = start.dissipation_before + start.dissipation_by_contact
        newton, good = Newton(getattr(found, "newton", ())), verdict is ARRIVED
        message = "" if good else attempt.reason
        if good:  # with all rounds, attempts and substeps that came before the last one
            message = converged_words(len(way.trace)) + attempt.outcome.note
            message += f" of contact, {len(newton)} of the bodies" if newton else ""
        elif verdict.free is not None:
            message = NOTHING_HOLDS
        if way.cuts:
            times = "once" if way.cuts == 1 else f"{way.cuts} times"
            message += f", step cut {times}, substep {way.substeps}"
        return Answer(
            model=model,
            contacts=model.interface.contacts,
            kin=attempt.problem.kin,
            case=attempt.case,
            seen=attempt.seen,
            state=attempt.state,
            gap=attempt.local.gap,
            action=attempt.action,
            plastic_slip=attempt.plastic_slip,
            mismatch=attempt.mismatch,
            converged=good,
            message=message,
            trace=tuple(way.trace),
            timings={**model.timings, "loop": seconds},
            dissipation_by_contact=way.energy[0],
            residual_by_contact=way.energy[1],
            dissipation_before=before,
            recover=recovery,
            conditions=attempt.outcome.iterate.conditions,
            factor=found.step.target.factor,
            linear=model.choice.said,
            indifferent=found.places,
            before=attempt.start,
            parts=way.substeps,
            springs=attempt.problem.springs is not None,
            bolts=self.bolts,
            placed=placed,
            newton=newton,
        )


def _tell(result: Answer, remarks: dict[str, str]) -> None:
    """Say what has not been said in this history: of places that are indifferent, and of bodies.

    `remarks` are sentences on bodies that are not linear, by what they are about.
    """
    issued = known = result.diagnostics.issued
    new = [words for words in result.indifferent if ("place", words) not in known]
    if new and np.any(result.u):
        warn(
            " ".join(new)
            + " Prescribe a DOF (D=...) if the place matters, or the load should hold it. "
            "(Said once in a history; result.indifferent has it in every step.)"
        )
        issued |= {("place", words) for words in new}
    for about, words in remarks.items():
        if ("remark", about) not in known:
            warn(words + " (Said once in a history.)")
            issued |= {("remark", about)}
    if issued is not known:
        result.diagnostics = replace(result.diagnostics, issued=issued)


def second_order(attempt: Attempt) -> dict[str, float]:
    """What moments of second order change of the motion of rigid bodies, over that motion, by name.

    Of bodies that may turn, in contacts with small sliding.
    """
    model = attempt.model
    system, contacts = model.system, model.interface.contacts
    tools = dict.fromkeys(c.rigid_body for c in contacts if c.sliding == "small")  # once, in order
    leaning = [b for b in tools if isinstance(b, RigidBody) and np.setdiff1d(b.rotations, b.D).size]
    if not leaning:
        return {}
    problem, seen = attempt.problem, attempt.seen
    load, response = attempt.load, attempt.outcome.iterate.response
    source = problem.source(load, response)
    u = problem.surface(source, attempt.posed(seen))
    origin = 0.0 if attempt.origin is None else attempt.origin.u
    f, found = np.array(seen.f), dict[RigidBody, tuple[float, Array]]()
    for body in leaning:
        moment, arm, along = _moment(attempt, body, u + origin)
        dofs = system.slice(body).start + body.rotations
        f[dofs] += moment / system.extent
        found[body] = arm, along
    if np.array_equal(f, seen.f):
        return {}
    turned = attempt.posed(replace(seen, f=f))
    again = problem.load(turned)
    if problem.springs is not None:  # which have no strain in the answer, and are none here
        again = problem.at_forces(again, response.normal_force, response.tangential_force)
    try:
        other = problem.solve(attempt.outcome.iterate.conditions, again)
    except (SingularMatrix, LinearSolveError):
        return {}
    change = problem.surface(problem.source(again, other), turned) - u
    shares = {}
    for body, (arm, along) in found.items():
        part = system.slice(body)
        ways = [_sway(body, v[part], arm / system.extent, along) for v in (u, change)]
        least = HARDLY_MOVES * float(np.linalg.norm(u[part][: body.dim]))
        least = max(least, COMPUTED * system.extent)
        shares[system.names[system.index(body)]] = ways[1] / max(ways[0], least, np.finfo(float).tiny)
    return shares


def _moment(attempt: Attempt, body: RigidBody, u: Array) -> tuple[Array, float, Array]:
    """Of second order, by rotation (zero where it is prescribed).

    Then the longest arm of a force, and the direction in which the body is pressed, zero for none.
    """
    model, kin, local = attempt.model, attempt.problem.kin, attempt.local
    system, d = model.system, body.dim
    v = u[system.slice(body)][:d]
    moment, arm = np.zeros(len(body.rotations)), 0.0
    total, sizes = np.zeros(d), 0.0
    for contact, part in zip(model.interface.contacts, model.interface.point_slices, strict=True):
        if contact.rigid_body is not body or contact.sliding != "small":
            continue
        side = contact.secondary
        forces = -local.normal_force[part][:, None] * kin.normal[part]
        forces += np.einsum("ik,ikd->id", local.tangential_force[part], kin.axes[part])
        moved = u[system.slice(side.body)][side.dofs] - v
        moment += cross(moved, forces).sum(axis=0)
        size = np.linalg.norm(forces, axis=1)
        total, sizes = total + forces.sum(axis=0), sizes + float(size.sum())
        away = np.linalg.norm(side.points[size > 0] - body.about, axis=1)
        arm = max(arm, float(np.max(away, initial=0.0)))
    moment[np.isin(body.rotations, body.D)] = 0.0
    size = float(np.linalg.norm(total))
    # between two jaws forces cancel, and no direction is that of pressing
    along = total / size if size > A_TENTH * sizes else np.zeros(d)
    return moment, arm, along


def _sway(body: RigidBody, way: Array, arm: float, along: Array) -> float:
    """The largest of a motion but for the way it is pressed in; turns at the end of the longest arm."""
    v = way[: body.dim]
    across = v - along * (along @ v)
    return max(float(np.linalg.norm(across)), arm * float(np.linalg.norm(way[body.dim :])))
