r"""One loop for bodies that are not linear and their contact: Newton's method on both.

Near displacements ``u_k`` a body answers with its tangent ``K`` and its internal forces, from what it
remembers of the beginning of the step. The linear problem

    ``K u = f_ext - f_int(u_k) + K u_k + B' lambda``

is one of bodies and contact, and solved as such: only bodies whose tangent is another one are condensed
again. The first of a step is solved exactly for contact, as a tangent beyond yield may be singular
without the right points closed; those after it take a few iterations of contact each, as it has hardly
changed. Where contact slides far, they are on pairings that approach that of their own answer.

At a limit load of perfect plasticity tangents are singular in the motions of plastic flow. Where the
residual does not fall, the tangents of the undeformed bodies are added in the sixth digit: such motions
stay finite then, and the others come as near with every iterate as before, but for that digit. Rubber
that keeps its volume has large pressures at iterates, and tangents that are not positive definite: for
one iterate as much of the undeformed ones is added, or ten times that, and it ends nearer.

A step may lead too far. It is halved until the residual of equilibrium of all bodies has become
smaller, with contact forces between those of both ends. Where that fails, the load step is cut, here
alone: in the linear problem of an iterate ``f`` is no load, and parts of it mean nothing. What a body
remembers is a value that is passed on from one accepted part to the next, so that a cut changes nothing
of it.
"""

from __future__ import annotations

import logging
from dataclasses import field, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from skfem_contact.answers.placed import Iteration, Placed, point_forces
from skfem_contact.arrays import Array
from skfem_contact.carried import copied
from skfem_contact.conditions.kinematics import Kinematics
from skfem_contact.conditions.loads import LoadCase
from skfem_contact.digits import GIVEN
from skfem_contact.errors import InputError, MaterialError
from skfem_contact.history.equilibrium import (
    ARRIVED,
    CORNERS,
    EquilibriumSearch,
    Verdict,
    has_corners,
)
from skfem_contact.history.load_step import Advance, Attempt, LoadStep, Recovery
from skfem_contact.history.refined import ROUGH, UNSOLVED, holds, refined, usable
from skfem_contact.history.remarks import remarks
from skfem_contact.history.stepper import Stepper
from skfem_contact.history.stepping import Bisection, settled, travelled
from skfem_contact.history.thresholds import (
    CONTACT_ITERATIONS,
    FAR,
    LONGER,
    NOISE,
    SHIFTS,
    SHORTER,
)
from skfem_contact.linalg.krylov import Anderson
from skfem_contact.loops.thresholds import DECREASE, HALVINGS
from skfem_contact.problem.seam import Workspace
from skfem_contact.records import dataclass
from skfem_contact.sealed import sealed

if TYPE_CHECKING:
    from skfem_contact.history.equilibrium import Known


logger = logging.getLogger("skfem_contact")

NO_DESCENT = (
    "No smaller part of the step is in equilibrium near what was reached: usually a limit point, where "
    "bodies yield as a whole, buckle or snap. Prescribe displacements instead of forces to go beyond "
    "it, or take smaller steps; "
)


@dataclass(eq=False)
class Solved:
    """The linear problem of an iterate as it was solved.

    Attributes
    ----------
    attempt : Attempt or None
    u : ndarray, shape (n,)
        Displacements of all bodies [length].
    verdict : Verdict
    """

    attempt: Attempt | None
    u: Array
    verdict: Verdict = ARRIVED

    @cached_property
    def forces(self) -> Array:
        """Of contact, on the DOFs, (n,) [force]."""
        assert self.attempt is not None
        return point_forces(self.attempt.problem.kin, self.attempt.local)


@dataclass(eq=False)
class NonlinearSearch:
    """Looks for the answer to one load step of bodies that are not linear; see `EquilibriumSearch`.

    Attributes
    ----------
    stepper : Stepper
        Its model has the tangents of the undeformed bodies.
    step : LoadStep
    start : Answer, SavedState or None
    advance : Advance
    placed : Placed
        Where the bodies have come to, and what they remember of it.
    newton : list of Iteration
        Of all iterates, those of parts that failed included.
    remarks : dict of str
        What is to be said of the answer, see `remarks.remarks`.
    recovery : Recovery
        The displacements, which are known.
    last : EquilibriumSearch
        For the answer of the last linear problem that was looked into.
    """

    stepper: Stepper
    step: LoadStep
    start: Known
    advance: Advance = field(init=False)
    placed: Placed = field(init=False)
    newton: list[Iteration] = field(default_factory=list)
    remarks: dict[str, str] = field(default_factory=dict)
    recovery: Recovery = field(init=False)
    last: EquilibriumSearch = field(init=False)
    _reached: Placed | None = None
    _why: str = ""

    def find(self) -> Verdict:
        """Find the answer, in parts of the step where it does not come at once."""
        model, options = self.stepper.model, self.stepper.options
        if model.interface.wear:
            raise InputError(WEAR)
        self.advance = Advance(np.zeros((2, len(model.interface.names))))
        self.last = EquilibriumSearch(self.stepper, self.step, self.start)
        self.placed = Placed.of_start(model.system, model.stiffness, self.start)
        parts = Bisection(options.max_cuts, SHORTER**options.max_cuts)
        part = self.step
        while True:
            if parts.share < 1.0:
                part = parts.of(self.step, part)
            verdict = self._newton(part, parts)
            way = self.advance
            if verdict.arrived:
                attempt = way.attempt
                if model.interface.laws:
                    way.energy += attempt.energy
                if parts.aim >= 1.0:
                    return verdict
                part = replace(part, state=attempt.state, before=part.target, known=attempt.state)
                way.substeps += 1
                parts.go_on(attempt.travel)
                continue
            attempted = vars(way).get("attempt")
            if parts.spent or (attempted is not None and attempted.stopped):
                return self._refused(verdict, parts)
            way.cuts += 1
            parts.cut(0.0 if attempted is None else attempted.travel)
            logger.info("step cut to %.4g of its size: %s", parts.share, self._why)

    def _newton(self, part: LoadStep, parts: Bisection) -> Verdict:
        """Solve one part of the load step; only where it arrives is `placed` another."""
        begin, options, base = self.placed, self.stepper.options, self.stepper.model
        try:
            at = self._forecast(part)
        except MaterialError as error:  # at what was an answer
            self._why = str(error)
            return self._gives_up()
        left, most, forces, exact, closing, shift = np.inf, 0.0, None, True, False, 0.0
        reached = np.inf  # the norm of what the last iterate left
        step, secant = replace(part, pairing=self._pairing(part, at.u)), Anderson()
        for number in range(1, options.max_placements + 1):
            solved = self._solve(step, at.stiffened(base.stiffness, shift), exact)
            if solved.attempt is not None:
                self.advance.trace.extend(solved.attempt.outcome.trace)
                if solved.attempt.stopped:
                    self.advance.attempt, self._why = solved.attempt, solved.attempt.reason
                    return self._gives_up()
            there, share, norm = self._stepped(part, begin, (at, forces, left), solved)
            if there is None or solved.attempt is None:
                stiffer = [share for share in SHIFTS if share > shift]
                if not stiffer:
                    return self._gives_up(solved.verdict)
                exact, shift = True, stiffer[0]
                continue
            shift = min(shift, SHIFTS[0])
            attempt = solved.attempt
            forces = solved.forces if forces is None else forces + share * (solved.forces - forces)
            missing, limit, scale = self._residual(part.target, there, forces)
            most_missing = float(np.max(np.abs(missing)))
            residual = most_missing / scale
            record = Iteration(number, parts.aim, residual, share, len(attempt.outcome.trace))
            self.newton.append(record)
            logger.debug("%s", record)
            nearer, reached = share == 1.0 and norm < reached, norm
            at, left, most, self._reached = there, norm, max(most, norm), there
            on, own = step.pairing, self._pairing(step, there.u)
            attempt = self._judged(step, attempt, own, FAR if number == 1 else 1.0)
            self.advance.attempt = attempt
            if attempt.travel > 1.0 and attempt.failure:
                self._why = attempt.failure
                return self._gives_up()
            balanced = share == 1.0 and most_missing <= limit and holds(solved.attempt, there.u)
            if balanced and attempt.good:
                self._arrive(part, attempt, there)
                return ARRIVED
            # a pairing that has settled stays, and Newton's method is quick again; so does one on which
            # bodies have yet to come nearer: nothing bounds what is left where both change
            if attempt.failure and (nearer or balanced):
                left = most  # residuals on two pairings are two things: no smaller one is asked for
                if share < 1.0:  # no answer on the pairing before, which secants are of
                    secant = Anderson()
                step = self._next(step, there.u, secant)
            closing = closing or balanced  # contact alone is left, and is solved to its end from now on
            exact, step = closing, replace(step, known=attempt.state)
        self._why = f"{options.max_placements} iterates left {residual:.1e} of the largest force"
        return self._alternates(on, own, attempt)

    def _alternates(
        self,
        on: tuple[Kinematics, Array] | None,
        own: tuple[Kinematics, Array] | None,
        attempt: Attempt,
    ) -> Verdict:
        """No answer, where pairings may lead to each other: then the point is named."""
        geometry, interface = self.stepper.model.geometry, self.stepper.model.interface
        if on is None or own is None or attempt.mismatch <= self.stepper.options.placement_tolerance:
            return self._gives_up()
        point = geometry.least_settled(on[0], own[0], attempt.local)
        self._why += f"; {interface.point_words(point, own[0].points[point])} meets another partner"
        corners = has_corners(interface.contacts[interface.contact_of(point)])
        return self._gives_up(advice=CORNERS if corners else NO_DESCENT)

    def _gives_up(self, verdict: Verdict = ARRIVED, advice: str = NO_DESCENT) -> Verdict:
        """No answer to a part of the step, which may be cut."""
        if not verdict.arrived:
            return verdict
        return Verdict(advice=advice, reached="attempt" in vars(self.advance))

    def _pairing(self, step: LoadStep, u: Array) -> tuple[Kinematics, Array] | None:
        """The pairing at displacements u (n,), from the one before; None where it never changes."""
        geometry = self.stepper.model.geometry
        if not geometry.follows:
            return None
        u = geometry.predicted(u[geometry.surface_dofs], step.target)
        before = None if step.pairing is None else step.pairing[0]
        return geometry.at(u, step.target, before), u

    def _next(self, step: LoadStep, u: Array, secant: Anderson) -> LoadStep:
        """The step on another pairing: where secants lead from those of the last answers."""
        if step.pairing is None:
            return step
        dofs = self.stepper.model.geometry.surface_dofs
        ahead = np.array(u)
        ahead[dofs] = secant.next(step.pairing[1][dofs], u[dofs])
        return replace(step, pairing=self._pairing(step, ahead))

    def _judged(
        self, step: LoadStep, attempt: Attempt, own: tuple[Kinematics, Array] | None, far: float
    ) -> Attempt:
        """The attempt beside the pairing of its own answer, where contact slides far."""
        if own is None or step.pairing is None:
            return attempt
        by, geometry = self.stepper, self.stepper.model.geometry
        attempt = travelled(by, attempt, far)
        if attempt.failure:
            return attempt
        mismatch = geometry.mismatch(step.pairing[0], own[0], attempt.local, by.barred)
        if mismatch > by.options.placement_tolerance:
            return replace(attempt, mismatch=mismatch, failure=f"the pairing moves by {mismatch:.1e}")
        return settled(by, attempt, own[0], mismatch)

    def _forecast(self, part: LoadStep) -> Placed:
        """Where bodies are linearised first: on the way of the step before, or a little way back."""
        begin, system = self.placed, self.stepper.model.system
        moved, way = (part.target.x - part.before.x)[system.D], begin.trend[system.D]
        if way.any() and moved.any():
            ratio = float(moved @ way / (way @ way))
        else:
            ratio = part.share * float(np.sign(_work(part, self.stepper.model.kin, begin.trend)))
        if begin.trend.any():
            try:
                # a little way back what yielded is elastic again; just here, round-off would decide
                ratio = min(ratio, LONGER) if ratio > 0 else -GIVEN
                return begin.moved(system, begin.u + ratio * begin.trend, part.target.fluid)
            except MaterialError:
                pass
        return begin.moved(system, begin.u, part.target.fluid)

    def _solve(self, step: LoadStep, at: Placed, exact: bool) -> Solved:
        """The linear problem near an iterate: contact exactly, or with a few iterations."""
        base, options = self.stepper.model, self.stepper.options
        model = base.with_tangents(at.stiffness)
        by = replace(self.stepper, model=model, options=replace(options, max_cuts=0))
        target = copied(step.target, factor=None)
        step = replace(step, target=target, workspace=Workspace(), origin=at.origin(base))
        # in space directions of friction turn, which takes more than a few: the next begins anew; and
        # where linear problems are iterated, the first of a few are rough
        turns = model.kin.tangents > 1 and bool(model.interface.laws)
        if not (exact or turns or model.motions.k or model.route in ROUGH):
            few = replace(by, options=replace(by.options, max_iterations=CONTACT_ITERATIONS))
            problem = model.problem_on(*(step.pairing or (None, None)))
            try:
                attempt = few.attempt(step, problem, "cold" if step.known is None else "warm")
                if np.isfinite(attempt.outcome.iterate.residual):
                    attempt, u = refined(attempt, Recovery.of(attempt)(), at)
                    if usable(attempt, u):
                        return Solved(attempt, u)
            except UNSOLVED:
                pass  # exactly, then
        search = EquilibriumSearch(by, step, self.start)
        try:
            verdict = search.find()
        except UNSOLVED as error:
            self._why = str(error)
            return Solved(None, at.u, Verdict(advice=SINGULAR, reached=False))
        if not verdict.arrived:
            return Solved(search.advance.attempt if verdict.reached else None, at.u, verdict)
        self.last, attempt, u = search, search.advance.attempt, search.recovery()
        if attempt.model is model:  # and no springs hold it
            attempt, u = refined(attempt, u, at)
        if not usable(attempt, u):
            return Solved(None, at.u, Verdict(advice=SINGULAR, reached=False))
        return Solved(attempt, u)

    def _stepped(
        self, part: LoadStep, begin: Placed, last: tuple[Placed, Array | None, float], solved: Solved
    ) -> tuple[Placed | None, float, float]:
        """As far towards the answer of a linear problem as the residual falls: where, share, residual.

        The first step of a part is whole, as before it the supports have not moved.
        """
        at, forces, left = last
        if not solved.verdict.arrived:
            self._why = "contact has no answer near an iterate"
            return None, 0.0, left
        system, share = self.stepper.model.system, 1.0
        for _ in range(HALVINGS):
            u = solved.u if share == 1.0 else at.u + share * (solved.u - at.u)
            try:
                there = begin.moved(system, u, part.target.fluid)
            except MaterialError as error:
                self._why = str(error)
            else:
                reached = solved.forces
                if forces is not None and share < 1.0:
                    reached = forces + share * (solved.forces - forces)
                missing, limit, _ = self._residual(part.target, there, reached)
                norm = float(np.linalg.norm(missing))
                if norm <= max((1.0 - DECREASE * share) * left, limit):
                    return there, share, norm
            share *= 0.5
        self._why = self._why or "no step from an iterate comes nearer to equilibrium"
        return None, share, left

    def _residual(self, case: LoadCase, there: Placed, forces: Array) -> tuple[Array, float, float]:
        """What is missing to equilibrium (n,), what counts as none, and the largest force that acts."""
        system = self.stepper.model.system
        missing = there.internal - case.f - forces
        acting = [np.max(np.abs(part), initial=0.0) for part in (case.f, forces, missing[system.D])]
        missing[system.D] = 0.0  # supports bear it
        # where nothing acts in the end, round-off is that of what the step began with
        size = np.maximum(np.abs(there.u), np.abs(self.placed.u))
        moved = [float(np.max(size[system.slice(body)])) for body in system.bodies]
        noise = NOISE * float(np.max(np.multiply(self.stepper.model.stiffest, moved)))
        scale = max(*acting, noise, np.finfo(float).tiny)
        return missing, max(self.stepper.options.tolerance * scale, noise), float(scale)

    def _arrive(self, part: LoadStep, attempt: Attempt, there: Placed) -> None:
        """Take a part of the step as it was found; from here on the bodies remember it."""
        light = self.stepper.model.with_tangents(there.stiffness)  # condensed only if asked for
        found = Recovery.of(attempt)
        self.recovery = replace(found, model=light, components=None, u=there.u)
        self.advance.attempt = replace(attempt, case=part.target)
        self.remarks = remarks(attempt, there)
        trend = sealed((there.u - self.placed.u) / part.share)
        self.placed = replace(there, trend=trend)

    def _refused(self, verdict: Verdict, parts: Bisection) -> Verdict:
        """Why there is no answer, with the load that was reached."""
        attempt = vars(self.advance).get("attempt")
        reached = attempt is not None
        if attempt is not None:
            self.placed = self._reached or self.placed
            self.recovery = replace(Recovery.of(attempt), u=self.placed.u)
            self.advance.attempt = replace(attempt, failure=self._why, case=self.step.target)
        share = parts.done
        carries = f"The bodies bear up to {share:.4g} of this step" + _load(self.step, share) + ". "
        return replace(verdict, carries=carries, reached=reached)


def _work(part: LoadStep, kin: Kinematics, trend: Array) -> float:
    """Return what changes of loads and obstacles would do on the way of the step before [energy]."""
    state, before, target = part.state.along(kin), part.before, part.target
    pressed = state.normal_force != 0
    pushed = (before.gap0[pressed] - target.gap0[pressed]) @ state.normal_force[pressed]
    rubbed = np.vdot((target.slip0 - before.slip0)[pressed], state.tangential_force[pressed])
    return float((target.f - before.f) @ trend + pushed + rubbed)


def _load(step: LoadStep, share: float) -> str:
    """The load factor at a share of a step, in words, where both ends have one."""
    before, target = step.before.scale[0], step.target.factor
    if target is None or before is None:
        return ""
    return f" (a load factor of {before + share * (target - before):.4g})"


WEAR = (
    "A contact with wear has a body that is not linear: what wears off is not solved together with the "
    "deformation of such bodies. Leave out wear=..., or make the bodies linear."
)
SINGULAR = (
    "The tangents of the bodies and contact are singular together: usually a limit load is reached, "
    "and the bodies give way without bearing more. Prescribe displacements to go beyond it, or give "
    "the material hardening; "
)
