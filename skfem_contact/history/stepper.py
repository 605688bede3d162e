"""`Stepper`: what load steps are solved by, and one attempt at a load step on a given pairing."""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property
from operator import mul

import numpy as np
from scipy.linalg import qr
from scipy.sparse import csr_matrix, vstack

from skfem_contact.arguments import NAMED
from skfem_contact.arrays import Array, Mask, size_of
from skfem_contact.conditions.friction import Tresca
from skfem_contact.conditions.friction_rule import FrictionRule, jumps_open
from skfem_contact.conditions.kinematics import prescribed_rows, prescribed_tangents
from skfem_contact.conditions.motions import balanced
from skfem_contact.conditions.state import OPEN, LoadCase, LocalState
from skfem_contact.errors import ConstraintError
from skfem_contact.history.load_step import Attempt, LoadStep
from skfem_contact.loops.active_set import friction_of_prescribed_slip
from skfem_contact.loops.driver import LOOPS, Options, Outcome, drive
from skfem_contact.loops.multipliers import Collision
from skfem_contact.loops.starts import DENSE, possible_starts, starting_values
from skfem_contact.loops.step import Step
from skfem_contact.problem.model import LinearModel
from skfem_contact.problem.points import Load
from skfem_contact.problem.seam import ContactProblem
from skfem_contact.records import ByFields, dataclass

# Round-off of contact forces over the terms that cancel where nothing presses.
NOISE = 10 * float(np.finfo(float).eps)

# Where contact slides far its normals turn by the strains of the surfaces: motions that points hold by
# no more than that may be free. Whether they are the reaction of the held DOFs says.
TURNED = 1e-2

RAN_AWAY = (
    "loads and contact forces do not balance along a motion that supports leave free: it is hardly "
    "held, and ran away until round-off carried the load"
)


@dataclass(frozen=True, eq=False)
class Stepper(ByFields):
    """The means by which load steps are solved; nothing of it depends on them.

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
    barred: Mask | None = None

    @cached_property
    def pinned(self) -> Stepper | None:
        """Where motions stay free whatever contact does, the same with as many DOFs held."""
        if not self.model.loose.shape[1]:
            return None
        return replace(self, model=self.model.with_springs(pins(self.model, self.model.loose)))

    @cached_property
    def starts(self) -> tuple[str, ...]:
        """Return where attempts may begin, in this order."""
        interface, turns = self.model.interface, self.model.kin.tangents > 1
        turns = turns and bool(interface.laws)
        # a loading machine is one on gaps and slips, along one way of a step on one pairing
        follows = self.model.geometry.follows or interface.wear
        one_way = self.model.choice.condenses and not follows and self.options.max_cuts > 0
        found = possible_starts(len(interface.stiffness), self.loop, turns, one_way)
        return tuple(found)

    @cached_property
    def jumps(self) -> bool:
        """Return whether friction jumps where points open, and can be made to rise steeply instead."""
        interface, kin = self.model.interface, self.model.kin
        if kin.tangents < 2 or not all(law.by_bound for _, law in interface.laws):
            return False
        return jumps_open(interface.laws, kin.area, kin.tangents, ~interface.bilateral)

    @property
    def complete(self) -> bool:
        """Return whether pivoting finds what there is: for linear laws in 2-D and a given pairing.

        The bound of points that never open is not linear in a force that may pull, but for Tresca's.
        """
        interface = self.model.interface
        linear = all(
            law.law.is_linear and (isinstance(law.law, Tresca) or not interface.bilateral[part].any())
            for part, law in interface.laws
        )
        return linear and not self.model.geometry.follows

    def attempt(self, to: LoadStep, problem: ContactProblem, start: str) -> Attempt:
        """Solve a load step as it is, on one pairing, from one of the `starts`."""
        interface, options = self.model.interface, self.options
        kin, target = problem.kin, to.target
        # a vertex brings its history along to the point that carries its row now
        last = to.state.along(kin, interface.point_slices)
        begin = last
        if to.known is not None and to.known is not to.state:
            begin = to.known.along(kin, interface.point_slices)
        # how far supports are moved, and what that makes of the softest body's stiffness; the bodies'
        # own K may have been replaced
        moves, stiffest = self.model.moves(target), self.model.stiffest
        moved = max(moves)
        pull = size_of(target.f)
        noise = NOISE * max(pull, min(stiffest) * moved)
        seen = self._seen(problem, target, last, to.before)
        counted = seen if to.origin is None else to.origin.seen(seen, kin, self.model)
        load = problem.load(counted)
        step = self._step(problem, load, last, noise, moved)
        dense = step
        points = self.model.on_points(problem) if start in DENSE else problem
        if points is not problem:
            dense = replace(step, problem=points, load=points.load(counted))
        loop = LOOPS[self.loop]
        limit = options.max_iterations or loop.most
        try:
            found = starting_values(
                start,
                begin,
                step,
                options.tolerance,
                self.loop,
                dense,
                lambda: points.load(self._seen(problem, to.before, last, to.before)),
            )
            given = step, found.guess, options.tolerance, limit, to.callback, loop.patience
            outcome = found.ended(drive(loop.iterates, *given), dense is step or start not in DENSE)
        except Collision as collision:
            raise self._contradiction(collision, problem, seen) from None
        local = self._state(step, outcome, to, problem, seen, counted)
        strained = NOISE * max(stiffest) * moved
        failure = "" if balanced(problem.motions, target.f, local, noise, strained) else RAN_AWAY
        ended = outcome, self.model, problem, load, target, seen, last, local, kin.action
        return Attempt(
            *ended,
            max(pull, *map(mul, stiffest, moves)),
            step.friction,
            failure=failure,
            stateless=found.stateless,
            carried=found.carried,
            origin=to.origin,
        )

    def _seen(
        self, problem: ContactProblem, case: LoadCase, last: LocalState, before: LoadCase
    ) -> LoadCase:
        """A load case from the pairing of a problem; that of the undeformed bodies is its own."""
        if problem.u is None:
            return case
        return self.model.geometry.case(problem.kin, problem.u, case, last, before)

    def _contradiction(
        self, collision: Collision, problem: ContactProblem, seen: LoadCase
    ) -> ConstraintError:
        """The error for points that can not all be closed, or glued, whatever carries them."""
        from skfem_contact.elimination.constraint import eliminate

        kin, labels = problem.kin, np.array(self.model.labels, dtype=object)
        glued = collision.slips.ravel()
        names = [*labels[collision.points], *np.repeat(labels, kin.tangents)[glued]]
        rows = csr_matrix(vstack([kin.B_n[collision.points], kin.B_t[glued]]))
        asked = np.concatenate([-seen.gap0[collision.points], -seen.slip0.ravel()[glued]])
        D = self.model.system.D
        try:
            eliminate(rows, asked, D, seen.x, labels=names, scale=0.0)
        except ConstraintError as error:
            return error
        listed = ", ".join(str(name) for name in names[:NAMED])
        return ConstraintError(
            f"Constraints contradict each other: {listed} can not all be closed: whatever the "
            "displacements are, forces that hold them together would grow without end. Usually a body "
            "is to be where there is no room for it. Change prescribed displacements, gaps or "
            "interferences."
        )

    def _step(
        self, problem: ContactProblem, load: Load, last: LocalState, noise: float, far: float
    ) -> Step:
        """A load step as loops see it; what belongs to the undeformed pairing is found out once."""
        known: Step | None = problem.steps.get(self)
        if known is not None:
            return known.under(load, last, noise, far)
        interface, kin = self.model.interface, problem.kin
        D = self.model.system.D
        # where a gap is prescribed D carries the force instead, and any friction where a slip is
        paired = kin.paired & (interface.bilateral | ~prescribed_rows(kin.B_n, D))
        if self.barred is not None:
            paired &= ~self.barred
        frictional, guided, slip_prescribed_along = interface.frictional & paired, None, None
        if interface.laws and np.count_nonzero(along := prescribed_tangents(kin, D)):
            # without tangents (scalar problems) there are no laws
            if np.count_nonzero(whole := along.all(axis=1)):
                guided, frictional = whole & interface.frictional, frictional & ~whole
            if np.count_nonzero(half := along & frictional[:, None]):
                slip_prescribed_along = half
        step = Step(
            problem=problem,
            load=load,
            motions=problem.motions,
            paired=paired,
            tied=interface.tied & paired,
            bilateral=interface.bilateral & paired,
            friction=FrictionRule(interface.laws, kin.area, last.reference),
            frictional=frictional,
            stiffness=interface.stiffness,
            last=last,
            rank=self.model.geometry.rank,
            noise=noise,
            far=far,
            resistance=problem.resistance,
            slip_prescribed=guided,
            slip_prescribed_along=slip_prescribed_along,
        )
        if problem.u is None:  # which the model keeps: those of other pairings are large
            problem.steps[self] = step
        return step

    def _state(
        self,
        step: Step,
        outcome: Outcome,
        to: LoadStep,
        problem: ContactProblem,
        seen: LoadCase,
        counted: LoadCase,
    ) -> LocalState:
        """Return where an attempt has ended, along the tangents of its pairing."""
        it, last = outcome.iterate, step.last
        interface, geometry = self.model.interface, self.model.geometry
        response = it.response
        status, friction = it.status, response.tangential_force
        if step.slip_prescribed is not None:
            status, friction = friction_of_prescribed_slip(step, step.slip_prescribed, status, response)
        opened = status == OPEN
        surface, trend, slip = last.surface, last.trend, response.slip
        if geometry.follows:
            dofs = geometry.surface_dofs
            source = problem.source(step.load, response)
            surface = problem.surface(source, counted)[dofs]
            if to.origin is not None:
                surface = surface + to.origin.u[dofs]
            trend = (surface - last.surface) / to.share
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
            trend,
            problem.kin.vertex,
            last.wear,
            last.worn,
        )


def pins(model: LinearModel, free: Array) -> Array:
    """Springs on as many single DOFs as there are motions (k, j) to hold, (n,)."""
    U = model.motions.modes @ free
    chosen = qr(U.T, mode="economic", pivoting=True)[2][: U.shape[1]]
    springs = np.zeros(len(U))
    diagonal = np.concatenate(model.diagonals)
    springs[chosen] = diagonal[chosen]
    return springs
