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

Beyond yield and about to buckle bodies move far under small forces. Displacements that follow from
forces then have few digits, and so have gaps and slips. They are solved for once more, and looked at
(`refined`). What is an answer may be one that no body stays in, and on surfaces that are no longer
where contact is: that is said (`remarks`).
"""

from __future__ import annotations

import logging
from contextlib import suppress
from dataclasses import field, replace
from typing import TYPE_CHECKING, NamedTuple, TypeAlias

import numpy as np
from scipy.linalg import LinAlgError
from scipy.sparse import block_diag, csr_matrix

from skfem_contact.answers.answer import Iteration, Placed, point_forces
from skfem_contact.answers.validity.validity import A_TENTH
from skfem_contact.arrays import Array, size_of
from skfem_contact.bodies.body import Body
from skfem_contact.bodies.normal_field import CORNER
from skfem_contact.bodies.selection import written
from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.conditions.discretisation import pair
from skfem_contact.conditions.friction_rule import friction_bound
from skfem_contact.conditions.kinematics import Kinematics
from skfem_contact.conditions.state import OPEN, STICK, LoadCase
from skfem_contact.digits import COMPUTED, GIVEN, SINGLE, SOLVED
from skfem_contact.errors import (
    ContactError,
    InputError,
    LinearSolveError,
    MaterialError,
    SingularMatrix,
)
from skfem_contact.history.equilibrium import ARRIVED, CORNERS, EquilibriumSearch, Verdict, at_corners
from skfem_contact.history.load_step import Advance, Attempt, LoadStep, Recovery
from skfem_contact.history.stepper import NOISE, Stepper
from skfem_contact.history.stepping import AIM, LONGER, WHOLE_TURN, Bisection, settled, travelled
from skfem_contact.linalg.krylov import Anderson
from skfem_contact.linalg.multifrontal import MultifrontalCholesky
from skfem_contact.loops.active_set import DECREASE, HALVINGS
from skfem_contact.problem.seam import Workspace
from skfem_contact.records import copied, dataclass, sealed

if TYPE_CHECKING:
    from skfem_contact.history.equilibrium import Known
    from skfem_contact.history.neutral_equilibrium import Rest

# Iterations of contact on one linearisation of bodies that are not linear, after the first of a step:
# three took as many linearisations as an exact solution of contact each time, and two fewer of ten.
CONTACT_ITERATIONS = 3

# Shares of the undeformed tangents that are added where an iterate has no answer: in the sixth digit
# what flows resists; beside once and ten times of them the pressures of rubber that keeps its volume
# are small. Five squeezed cylinders took 714 iterates (1 079 without the two; 744 with the last alone).
SHIFTS = (1e-6, 1.0, 10.0)

logger = logging.getLogger("skfem_contact")

#: A pairing, and the displacements (n,) that it was made at; None where contact never changes.
Pairing: TypeAlias = "tuple[Kinematics, Array] | None"

NO_NEARER = "no step from an iterate comes nearer to equilibrium"
NONE_NEAR = "contact has no answer near an iterate"
NO_DESCENT = (
    "No smaller part of the step is in equilibrium near what was reached: usually a limit point, where "
    "bodies yield as a whole, buckle or snap. Prescribe displacements instead of forces to go beyond "
    "it, or take smaller steps. "
)
LOOSE = (
    "Iterates come to equilibrium but for round-off, which moves a body far: its tangents are nearly "
    "singular with contact as it is. Usually a layer resists shear or bending by less than a millionth "
    "of what its neighbours do: make it stiffer there, or hold it by D. "
)

#: Routes whose linear problems are iterated.
ROUGH = "iterated", "multigrid"
#: What a linear problem raises that has no answer, or none that is found.
UNSOLVED = SingularMatrix, LinearSolveError, LinAlgError

UNSTABLE = (
    "The answer is in equilibrium, but not stable: its tangent stiffness is not positive definite with "
    "contact as it is, and the least disturbance lets the bodies go elsewhere. Usually a slender part "
    "is beyond its buckling load, or one is about to snap. To see where it goes, add a small "
    "disturbance: a load of a millionth of the others, or nodes that are moved by as little."
)
TURNED = (
    "The surfaces of contact '{}' have {}, and sliding=\"small\" keeps contact as it "
    "is on the undeformed ones: gaps, normals and areas are those of before. Say "
    'Contact(..., sliding="finite") for contact on the deformed surfaces.'
)


def refined(attempt: Attempt, u: Array, at: Placed) -> tuple[Attempt, Array]:
    """An attempt and its displacements (n,), with points closed and in place as far as digits go.

    Where displacements follow from forces on a body that is about to flow, or to buckle, their
    round-off moves it far. What is wrong with gaps, slips and friction then is solved for once more,
    with the same points closed (iterative refinement); where the linear problem itself was iterated,
    with the forces that are missing to its equilibrium as well.
    """
    problem, rough = attempt.problem, attempt.model.route in ROUGH
    answer, given = attempt.outcome.iterate.response, attempt.outcome.iterate.conditions
    if not (rough or problem.source(attempt.load, answer).forces):
        return attempt, u
    kin, f = problem.kin, np.zeros(len(u))
    if rough:
        f = attempt.case.f - at.internal - block_diag(at.stiffness) @ (u - at.u)
        f += point_forces(kin, attempt.local)
        f[attempt.model.system.D] = 0.0
    gap = kin.B_n @ u + attempt.seen.gap0
    slip = (kin.B_t @ u).reshape(answer.slip.shape) + attempt.seen.slip0 - given.anchor
    law = given.offset + given.coupling * answer.normal_force[:, None] - answer.tangential_force
    case = copied(attempt.seen, f=f, x=np.zeros(len(u)), gap0=gap, slip0=slip)
    load = problem.load(case)
    conditions = replace(given, anchor=np.zeros(slip.shape), offset=law, rough=False)
    try:
        left = problem.solve(conditions, load)
    except UNSOLVED:  # what is left is round-off of iterated problems
        return attempt, u
    more = replace(Recovery.of(attempt), found=problem.source(load, left), components=load.components)
    du = replace(more, case=case, shift=None)()
    local, dofs = attempt.local, attempt.model.geometry.surface_dofs
    closed = local.status != OPEN
    modelled = attempt.model.interface.slipping[:, None]  # of others slips are no unknowns
    slip = local.slip + np.where(modelled, left.slip + given.anchor - answer.slip, 0.0)
    local = replace(
        local,
        gap=np.where(closed, local.gap, left.gap),
        slip=slip,
        reference=np.where(closed[:, None], local.reference, slip),
        normal_force=local.normal_force + np.where(closed, left.normal_force, 0.0),
        tangential_force=local.tangential_force + np.where(closed[:, None], left.tangential_force, 0.0),
        surface=local.surface + du[dofs] if len(local.surface) else local.surface,
    )
    return replace(attempt, local=local), u + du


def usable(attempt: Attempt, u: Array) -> bool:
    """Return whether displacements (n,) may be gone on from.

    They follow from matrices that may have no digits, where bodies flow or buckle. What is seen
    through springs comes to its place by and by, in the iterates that follow.
    """
    ends = attempt.outcome.converged and attempt.problem.springs is None
    return bool(np.isfinite(u).all()) and (not ends or holds(attempt, u))


def holds(attempt: Attempt, u: Array) -> bool:
    """Return whether displacements (n,) have the gaps and slips of the points that carry forces."""
    kin, local, seen = attempt.problem.kin, attempt.local, attempt.seen
    closed = local.status != OPEN
    wrong = (kin.B_n @ u)[closed] + seen.gap0[closed] - local.gap[closed]
    slip = (kin.B_t @ u).reshape(seen.slip0.shape) + seen.slip0 - local.slip
    wrong = np.append(wrong, slip[local.tangential_force != 0])
    return size_of(wrong) <= SOLVED * max(attempt.model.system.extent, size_of(u))


def remarks(attempt: Attempt, placed: Placed) -> dict[str, str]:
    """Return what is to be said, in words, by what it is about: each is said once in a history."""
    found = {"unstable": UNSTABLE} if unstable(attempt, placed) else {}
    interface = attempt.model.interface
    for i, (contact, part) in enumerate(zip(interface.contacts, interface.point_slices, strict=True)):
        if contact.sliding != "small" or not attempt.local.normal_force[part].any():
            continue
        angle, change = turned(attempt, placed, i), stretched(attempt, placed, i)
        if angle > A_TENTH:
            found[f"turned {i}"] = TURNED.format(contact.name or i + 1, f"turned by {angle:.2g} rad")
        if abs(change) > A_TENTH:
            how = f"changed their area, and friction by stress with it by {100 * change:+.2g} %"
            found[f"stretched {i}"] = TURNED.format(contact.name or i + 1, how)
    return found


def unstable(attempt: Attempt, placed: Placed) -> bool:
    """Whether the tangents at an answer are not positive definite with its points closed and sticking.

    Asked only where the tangent of a body was none of a stable body by itself, or nobody has looked:
    other bodies, and contact, may hold it. Springs against what contact holds, far stiffer than the
    bodies, leave Cholesky's method pivots that are negative only if a motion is left that nothing
    resists.
    """
    model = attempt.model
    parts = [part for part in model.substructures if part is not None and part.body.nonlinear]
    if model.route != "full" and not any(part.shaky for part in parts):
        return False
    if not all(isinstance(body, Body) for body in model.system.bodies):
        return False
    kin, local = attempt.problem.kin, attempt.local
    closed = local.status != OPEN
    sticks = np.repeat((local.status == STICK) & model.interface.slipping, kin.tangents)
    B = csr_matrix(kin.B_n[closed]), csr_matrix(kin.B_t[sticks])
    stiff = max(model.stiffest) / GIVEN
    K = csr_matrix(block_diag(placed.stiffness)) + stiff * sum(rows.T @ rows for rows in B)
    free = np.setdiff1d(np.arange(model.system.n), model.system.D)
    points = np.concatenate([body.dof_points for body in model.system.bodies])
    try:
        MultifrontalCholesky(csr_matrix(csr_matrix(K)[free][:, free]), points[free])
    except SingularMatrix:
        return True
    return False


def turned(attempt: Attempt, placed: Placed, i: int) -> float:
    """By how much the normals of a contact with small sliding have turned, where points press [rad].

    Of two bodies one of which may strain and turn by any amount: others have bounds of their own.
    """
    contact, part = attempt.model.interface.contacts[i], attempt.model.interface.point_slices[i]
    sides = [s for s in (contact.secondary, contact.primary) if isinstance(s, ContactSurface)]
    if len(sides) < 2 or not any(side.body.finite_strain for side in sides):
        return 0.0
    system = attempt.model.system
    try:
        there = pair(contact, moved=[placed.u[system.slice(side.body)] for side in sides])
    except ContactError:  # they are folded over: no normal
        return 0.0
    both = (attempt.local.normal_force[part] != 0) & np.isfinite(there.gap)
    along = np.einsum("id,id->i", there.normal, attempt.problem.kin.normal[part])[both]
    return float(np.max(np.arccos(np.clip(along, -1.0, 1.0)), initial=0.0))


def stretched(attempt: Attempt, placed: Placed, i: int) -> float:
    """By which part friction would be larger on the deformed area, under small sliding.

    Of bodies of finite strain, by what facets that press have grown: laws by stress take the area
    before, as pressures do.
    """
    model = attempt.model
    contact, part = model.interface.contacts[i], model.interface.point_slices[i]
    side, local, laws = contact.secondary, attempt.local, model.interface.laws
    bound = friction_bound(laws, local)[part].sum() if side.body.finite_strain else 0.0
    if not bound > 0:
        return 0.0
    own = (local.normal_force[part] != 0)[side.facets].any(axis=1)
    moved = side.moved(placed.u[model.system.slice(side.body)])
    before, now = (float(on.shares[own].sum()) for on in (side, moved))
    grown = replace(local, area=local.area * (now / before if before > 0 else 1.0))
    return float(friction_bound(laws, grown)[part].sum() / bound - 1.0)


class NoAnswer(Exception):
    """A part of a load step has no answer: why, what to try, and the attempt that ended it."""

    def __init__(
        self, why: str, verdict: Verdict | None = None, attempt: Attempt | None = None
    ) -> None:
        super().__init__(why)
        self.verdict, self.attempt = verdict, attempt
        self.travel = 0.0 if attempt is None else attempt.travel
        self.stopped = attempt is not None and attempt.stopped


class Reached(NamedTuple):
    """Where an iterate has come to, and how far that is from equilibrium.

    Attributes
    ----------
    placed : Placed
    forces : ndarray, shape (n,)
        Of contact, on the DOFs [force].
    share : float
        Of the way to the answer of the linear problem.
    norm, most : float
        Of the forces that are missing; and the largest of them [force].
    limit, scale : float
        What counts as none, and the largest force that acts [force].
    """

    placed: Placed
    forces: Array
    share: float
    norm: float
    most: float
    limit: float
    scale: float


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
        What is to be said of the answer, see `remarks`.
    recovery : Recovery
        The displacements, which are known.
    settled, places
        Of the `EquilibriumSearch` for the last linear problem that was looked into.
    """

    stepper: Stepper
    step: LoadStep
    start: Known
    advance: Advance = field(init=False)
    placed: Placed = field(init=False)
    newton: list[Iteration] = field(default_factory=list)
    remarks: dict[str, str] = field(default_factory=dict)
    recovery: Recovery = field(init=False)
    settled: Rest | None = None
    places: tuple[str, ...] = ()
    _now: Reached | None = None  # the last iterate beyond `placed`, of `advance.attempt`
    _led: Attempt | None = None  # the first of a part that leads a point around a corner

    def find(self) -> Verdict:
        """Find the answer, in parts of the step where it does not come at once."""
        model, options = self.stepper.model, self.stepper.options
        if model.interface.wear:
            raise InputError(WEAR)
        self.advance = way = Advance(np.zeros((2, len(model.interface.names))))
        self.placed = Placed.of_start(model.system, model.stiffness, self.start)
        parts = Bisection(options.max_cuts, LONGER**-options.max_cuts)
        part = self.step
        while True:
            part = parts.of(self.step, part)
            try:
                attempt = self._newton(part, parts.aim)
            except NoAnswer as none:
                if parts.spent or none.stopped:
                    return self._refused(none, parts.done)
                way.cuts += 1
                # what slides too far in equal parts, as few as may be
                parts.cut(AIM * np.ceil(none.travel / AIM) if none.travel > 1.0 else 0.0)
                if none.travel > 1.0 and self._now is not None:  # too far, but on the way
                    trend = sealed((self._now.placed.u - self.placed.u) / part.share)
                    self.placed = replace(self.placed, trend=trend)
                logger.info("step cut to %.4g of its size: %s", parts.share, none)
                continue
            if model.interface.laws:
                way.energy += attempt.energy
            if parts.aim >= 1.0:
                return ARRIVED
            part = replace(part, state=attempt.state, before=part.target, known=attempt.state)
            way.substeps += 1
            parts.go_on(attempt.travel)

    def _newton(self, part: LoadStep, aim: float) -> Attempt:
        """Solve one part of the load step; only where it arrives is `placed` another."""
        options, base = self.stepper.options, self.stepper.model
        now, own = self._forecast(part), None
        step, secant = replace(part, pairing=self._pairing(part, now.placed.u)), Anderson()
        exact, closing, shift, left, most = True, False, 0.0, np.inf, 0.0
        self._led = None
        for number in range(1, options.max_placements + 1):
            try:
                attempt, u = self._solve(step, now.placed.stiffened(base.stiffness, shift), exact)
                there = self._stepped(part.target, now, attempt, u)
            except NoAnswer as none:
                stiffer = [share for share in SHIFTS if share > shift]
                if not stiffer or none.stopped or number == options.max_placements:
                    raise
                exact, shift = True, stiffer[0]
                continue
            nearer, left = there.share == 1.0 and there.norm < left, there.norm
            self._now = now = there
            u, shift = now.placed.u, min(shift, SHIFTS[0])
            most = max(most, now.norm)
            contact = len(attempt.outcome.trace)
            self.newton.append(Iteration(number, aim, now.most / now.scale, now.share, contact))
            logger.debug("%s", self.newton[-1])
            balanced = now.share == 1.0 and now.most <= now.limit and holds(attempt, u)
            self.advance.attempt = attempt
            attempt, own = self._judged(step, attempt, u, balanced)
            self.advance.attempt = attempt
            if balanced and attempt.good:
                self._come_to(attempt, part.target, now.placed, part.share)
                self.remarks = remarks(attempt, now.placed)
                return attempt
            # a pairing that has settled stays, and Newton's method is quick again; so does one on which
            # bodies have yet to come nearer: nothing bounds what is left where both change
            at, dofs = attempt.problem.u, base.geometry.surface_dofs
            if at is not None and own is not None and attempt.failure and (nearer or balanced):
                # residuals on two pairings are two things: no smaller one is asked for, but none that
                # is larger than all before: without this a ball deep in a block ran away
                now, ahead = now._replace(norm=most), np.array(u)
                ahead[dofs] = secant.next(at[dofs], own[1][dofs])
                step = replace(step, pairing=self._pairing(step, ahead) if secant.active else own)
            closing = closing or balanced  # contact alone is left, and is solved to its end from now on
            exact, step = closing, replace(step, known=attempt.state)
        why = f"{options.max_placements} iterates left {now.most / now.scale:.1e} of the largest force"
        raise NoAnswer(f"{why}; {attempt.failure}" if attempt.failure else why, attempt=attempt)

    def _pairing(self, step: LoadStep, u: Array) -> Pairing:
        """The pairing at displacements u (n,), from the one before; None where it never changes."""
        geometry = self.stepper.model.geometry
        if not geometry.follows:
            return None
        u = geometry.predicted(u[geometry.surface_dofs], step.target)
        before, _ = step.pairing or (None, None)
        return geometry.at(u, step.target, before), u

    def _judged(
        self, step: LoadStep, attempt: Attempt, u: Array, balanced: bool
    ) -> tuple[Attempt, Pairing]:
        """The attempt beside the pairing of its own answer, where contact slides far; that pairing."""
        by, geometry = self.stepper, self.stepper.model.geometry
        if step.pairing is None:
            return attempt, None
        attempt = travelled(by, attempt)
        asked, spun = geometry.turned(step.pairing[1], u)
        if not attempt.failure and (own := self._pairing(step, asked)) is not None:
            old, new, local = both = attempt.problem.kin, own[0], attempt.local
            # where forces balance, areas too are to be those of the answer: laws are by them
            apart, grown = geometry.mismatch(*both, by.barred), balanced * geometry.stretched(*both)
            mismatch = max(apart, spun, float(grown.max(initial=0.0)))
            if mismatch > by.options.placement_tolerance:
                partner = apart == mismatch
                point = geometry.least_settled(*both) if partner else int(np.argmax(grown))
                words = by.model.interface.point_words(point, new.points[point])
                words += " meets another partner" if partner else " bears its force on another area"
                words = WHOLE_TURN if spun == mismatch else words
                failure = f"the pairing moves by {mismatch:.1e}: {words}"
                culprit = point if partner else -1
                attempt = replace(attempt, mismatch=mismatch, failure=failure, culprit=culprit)
                turns = local.normal_force[point] and old.normal[point] @ new.normal[point] < CORNER
                self._led = self._led or (attempt if turns else None)
                return attempt, own
            attempt = settled(by, attempt, new, mismatch)
            if not attempt.failure:
                return attempt, own
        raise NoAnswer(attempt.failure, attempt=attempt)

    def _forecast(self, part: LoadStep) -> Reached:
        """Where bodies are linearised first: on the way of the step before, or a little way back."""
        begin, system, kin = self.placed, self.stepper.model.system, self.stepper.model.kin
        moved, way = (part.target.x - part.before.x)[system.D], begin.trend[system.D]
        if way.any() and moved.any():
            ratio = float(moved @ way / (way @ way))
        else:
            ratio = part.share * float(np.sign(_work(part, kin, begin.trend)))
        # a little way back what yielded is elastic again; just here, round-off would decide
        ratio = min(ratio, LONGER) if ratio > 0 else -GIVEN
        for ahead in (ratio * begin.trend, 0.0 * begin.trend):
            with suppress(MaterialError):
                placed = begin.moved(system, begin.u + ahead, part.target.apart)
                forces = point_forces(kin, part.state.along(kin))
                # the first step is whole: before it the supports have not moved
                return self._missing(part.target, placed, forces, 1.0)._replace(norm=np.inf)
        raise NoAnswer("the bodies have no answer where the step begins")

    def _solve(self, step: LoadStep, at: Placed, exact: bool) -> tuple[Attempt, Array]:
        """The linear problem near an iterate, exactly for contact or nearly; and its displacements."""
        base, options = self.stepper.model, self.stepper.options
        model = base.with_tangents(at.stiffness)
        by = replace(self.stepper, model=model, options=replace(options, max_cuts=0))
        target = copied(step.target, factor=None)
        step = replace(step, target=target, workspace=Workspace(), origin=at.origin(base))
        # in space directions of friction turn, which takes more than a few: the next begins anew; and
        # where linear problems are iterated, the first of a few are rough
        turns = model.kin.tangents > 1 and bool(model.interface.laws)
        if not (exact or turns or at.rims is not None or model.motions.k or model.route in ROUGH):
            few = replace(by, options=replace(by.options, max_iterations=CONTACT_ITERATIONS))
            problem = model.problem_on(*(step.pairing or (None, None)))
            with suppress(*UNSOLVED):  # exactly, then
                attempt = few.attempt(step, problem, "warm")
                if np.isfinite(attempt.outcome.iterate.residual):
                    attempt, u = refined(attempt, Recovery.of(attempt)(), at)
                    if usable(attempt, u):
                        return self._ended(attempt), u
        turned, secant = np.zeros(len(at.u)), Anderson()
        for _ in range(options.max_placements):
            search, verdict = EquilibriumSearch(by, step, self.start), SINGULAR
            with suppress(*UNSOLVED):
                verdict = search.find()
            if verdict.reached:
                attempt = self._ended(search.advance.attempt)
            if verdict is not ARRIVED:
                raise NoAnswer(NONE_NEAR, verdict)
            self.settled, self.places, u = search.settled, search.places, search.recovery()
            if attempt.model is model:  # and no springs hold it
                attempt, u = refined(attempt, u, at)
            if not usable(attempt, u):
                raise NoAnswer(NONE_NEAR, SINGULAR)
            if at.rims is None:
                break
            # linear problems are symmetric: what turns with the rims of fluids follows from answers
            found = at.rims @ (u - at.u)
            if size_of(found - turned) <= COMPUTED * size_of(target.f):
                break
            turned = secant.next(turned, found)
            step = replace(step, target=copied(target, f=target.f + turned), known=attempt.state)
        return attempt, u

    def _ended(self, attempt: Attempt) -> Attempt:
        """An attempt at a linear problem, which the user's callback may have stopped."""
        self.advance.trace.extend(attempt.outcome.trace)
        if attempt.stopped:
            self.advance.attempt = attempt
            raise NoAnswer(attempt.reason, attempt=attempt)
        return attempt

    def _stepped(self, case: LoadCase, last: Reached, attempt: Attempt, u: Array) -> Reached:
        """As far towards the answer u (n,) of a linear problem as the forces that are missing fall."""
        system, at, share, why = self.stepper.model.system, last.placed.u, 1.0, NO_NEARER
        forces = point_forces(attempt.problem.kin, attempt.local)
        for _ in range(HALVINGS):
            way, acting = u, forces
            if share < 1.0:
                way, acting = at + share * (u - at), last.forces + share * (forces - last.forces)
            try:
                placed = self.placed.moved(system, way, case.apart)
            except MaterialError as error:
                why = str(error)
            else:
                there = self._missing(case, placed, acting, share)
                if there.norm <= max((1.0 - DECREASE * share) * last.norm, there.limit):
                    return there
            share *= 0.5
        raise NoAnswer(why)

    def _missing(self, case: LoadCase, placed: Placed, forces: Array, share: float) -> Reached:
        """How far bodies and forces of contact are from equilibrium."""
        system = self.stepper.model.system
        missing = placed.internal - case.f - forces
        acting = [np.max(np.abs(part), initial=0.0) for part in (case.f, forces, missing[system.D])]
        missing[system.D] = 0.0  # supports bear it
        # where nothing acts in the end, round-off is that of what the step began with
        size = np.maximum(np.abs(placed.u), np.abs(self.placed.u))
        moved = [float(np.max(size[system.slice(body)])) for body in system.bodies]
        noise = NOISE * float(np.max(np.multiply(self.stepper.model.stiffest, moved)))
        scale = float(max(*acting, noise, np.finfo(float).tiny))
        limit = max(self.stepper.options.tolerance * scale, noise)
        norm, most = float(np.linalg.norm(missing)), float(np.max(np.abs(missing)))
        return Reached(placed, forces, share, norm, most, limit, scale)

    def _come_to(self, attempt: Attempt, case: LoadCase, there: Placed, share: float) -> None:
        """Take what was found of a part of the step: from here on the bodies remember it."""
        light = self.stepper.model.with_tangents(there.stiffness)  # condensed only if asked for
        self.recovery = replace(Recovery.of(attempt), model=light, components=None, u=there.u)
        self.advance.attempt = replace(attempt, case=case)
        self.placed, self._now = replace(there, trend=sealed((there.u - self.placed.u) / share)), None

    def _refused(self, none: NoAnswer, share: float) -> Verdict:
        """Why there is no answer, with the share of the step that was reached."""
        attempt, why, verdict = vars(self.advance).get("attempt"), str(none), none.verdict
        if verdict is None:
            now, advice = self._now, NO_DESCENT
            if none.attempt is not None and none.attempt.culprit >= 0:
                advice = CORNERS if at_corners(none.attempt) else NO_DESCENT
            elif self._led is not None:
                why, advice = f"{why}; {self._led.failure}", CORNERS
            elif attempt and now and attempt.good and now.most <= SINGLE * now.scale:
                advice = LOOSE  # near to equilibrium, to half of the digits
            verdict = Verdict(advice=advice)
        if attempt is not None:
            failed = replace(attempt, failure=why)
            self._come_to(failed, self.step.target, (self._now or self).placed, 1.0)
        if attempt is None and self.start is None and verdict is SINGULAR:
            return replace(SINGULAR, advice=self._soft() or SINGULAR.advice)
        carries, before = f"The bodies bear up to {share:.4g} of this step", self.step.before.scale[0]
        if before is not None and (target := self.step.target.factor) is not None:
            carries += f" (a load factor of {before + share * (target - before):.4g})"
        return replace(verdict, carries=carries + ". ", reached=attempt is not None)

    def _soft(self) -> str:
        """Say which body has DOFs that resist nothing where Newton's method begins; else nothing."""
        system, diagonals = self.stepper.model.system, self.stepper.model.diagonals
        for body, name, of_K in zip(system.bodies, system.names, diagonals, strict=True):
            lost = np.setdiff1d(np.flatnonzero(of_K <= COMPUTED * of_K.max(initial=0.0)), body.D)
            if body.nonlinear and len(lost):
                return NO_STIFFNESS.format(name, len(lost), written(body.dof_points[lost[0]]))
        return ""


def _work(part: LoadStep, kin: Kinematics, trend: Array) -> float:
    """Return what changes of loads and obstacles would do on the way of the step before [energy]."""
    state, before, target = part.state.along(kin), part.before, part.target
    pressed = state.normal_force != 0
    pushed = (before.gap0[pressed] - target.gap0[pressed]) @ state.normal_force[pressed]
    rubbed = np.vdot((target.slip0 - before.slip0)[pressed], state.tangential_force[pressed])
    return float((target.f - before.f) @ trend + pushed + rubbed)


WEAR = (
    "A contact with wear has a body that is not linear: what wears off is not solved together with the "
    "deformation of such bodies. Leave out wear=..., or make the bodies linear."
)
NO_STIFFNESS = (
    "Body {!r} has no stiffness in its initial state, where Newton's method begins, at {} free DOFs, "
    "the first at {}: add some to the stress and the tangent of its material, or hold them by D. "
)
SINGULAR = Verdict(
    advice="The tangents of the bodies and contact are singular together: usually a limit load is "
    "reached, and the bodies give way without bearing more. Prescribe displacements to go beyond it, "
    "or give the material hardening. ",
    reached=False,
)
