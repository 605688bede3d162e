"""A load step, one attempt at it, how far it has come, and the displacements that follow from it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import field
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from skfem_contact.answers.answer import Answer, Placed
from skfem_contact.arrays import Array
from skfem_contact.conditions.friction_rule import FrictionRule, friction_bound
from skfem_contact.conditions.interface import Interface
from skfem_contact.conditions.kinematics import Kinematics
from skfem_contact.conditions.state import LoadCase, LocalState, State
from skfem_contact.linalg.dense_factors import single_threaded
from skfem_contact.loops.driver import Outcome
from skfem_contact.loops.step import Record
from skfem_contact.problem.condensed import Condensed
from skfem_contact.problem.model import LinearModel
from skfem_contact.problem.points import Load, PointSpace, Response
from skfem_contact.problem.seam import ContactProblem, Source, Workspace
from skfem_contact.records import dataclass, sealed

if TYPE_CHECKING:
    from skfem_contact.loops.pulled import Carried


def friction_energy(
    interface: Interface, last: LocalState, new: LocalState, plastic: Array, bounds: Array
) -> Array:
    r"""Energy that friction takes between two states, and what the balance misses, (2, contacts).

    On its plastic slip ``s_p`` a point loses the mean of its friction bounds at both ends,

        ``D = (L_n + L_n+1) / 2 |s_p|``,      ``L = 0`` where it is open,

    never less than nothing; exact where the bound is constant, also if the slip turns round, and
    where bound and slip grow in proportion. The forces themselves do other work in steps so large
    that they do not follow their bounds, and so do the pressures of points that close or open: with
    the loads' work ``W`` by the trapezoidal rule and the elastic energy ``U``,

        ``W = U_n+1 - U_n + D + residual``.

    Friction and opening make the residual: it is of second order in the step, and takes no ``K u``.
    Overlaps of the meshes count as misfit that the loads' work has in it. `plastic` is the
    `plastic_slip` between the two, `bounds` the sum of the `friction_bound` of both.
    """
    way = np.linalg.norm(plastic, axis=1)
    friction = last.tangential_force + new.tangential_force
    pressing = last.normal_force + new.normal_force
    found = lost, residual = np.zeros((2, len(interface.point_slices)))
    for k, part in enumerate(interface.point_slices):  # the means are halves of sums
        lost[k] = 0.5 * bounds[part].dot(way[part])
        residual[k] = 0.5 * np.vdot(friction[part], plastic[part]) - lost[k]
    opens = (pressing != 0) & ((new.gap > 0) | (last.gap > 0))
    if np.count_nonzero(opens):
        # points without partner have no gap, also one that finds or loses it between the two states
        opens &= np.isfinite(new.gap) & np.isfinite(last.gap)
        moved = np.zeros(len(opens))
        moved[opens] = np.maximum(new.gap[opens], 0.0) - np.maximum(last.gap[opens], 0.0)
        for k, part in enumerate(interface.point_slices):
            residual[k] -= 0.5 * (pressing[part] @ moved[part])
    return found


def plastic_slip(interface: Interface, last: LocalState, new: LocalState) -> Array:
    """Slip between two states that a finite tangential stiffness does not give back, (m, d-1)."""
    G = interface.stiffness[:, None]
    elastic = (new.tangential_force - last.tangential_force) / G  # zero where sticking is exact
    return np.where(interface.frictional[:, None], new.slip - last.slip - elastic, 0.0)


@dataclass(eq=False)
class LoadStep:
    """From where to where: a step of the user's, or the part of one that is attempted.

    Attributes
    ----------
    state : State
        What friction remembers where it begins.
    before, target : LoadCase
        The loads there, and those to be reached.
    known : State or None
        Starting values of the iterations.
    callback : callable or None
        Called with the `Record` of every iteration.
    share : float
        Of the user's step.
    workspace : Workspace
        What the solve of the user's step remembers from attempt to attempt.
    pairing : pair of Kinematics and ndarray, or None
        The pairing that it is solved on, and the displacements (n,) of the surfaces that it was made
        at, where contact slides far and somebody else renews it.
    origin : Placed or None
        What the unknowns count from; zero without one.
    """

    state: State
    before: LoadCase
    target: LoadCase
    known: State | None
    callback: Callable[[Record], object] | None = None
    share: float = 1.0
    workspace: Workspace = field(default_factory=Workspace, repr=False)
    pairing: tuple[Kinematics, Array] | None = None
    origin: Placed | None = None


@dataclass(eq=False)
class Attempt:
    """One attempt at a load: how the loop ended, from which state, and on which pairing.

    `start` and `local` are the states before and after it, both along the tangents of its pairing;
    `action`: where the forces act, on the pairing of its answer, (m, d). `terms`: the largest load, or
    product of stiffness and prescribed displacement [force].
    `stateless` are shares of the bounds of points that have no state, where there are any, (m,); see
    `loops.starts.from_regularised`. `carried`: how much of the load is carried at most, where known.
    """

    outcome: Outcome
    model: LinearModel
    problem: ContactProblem
    load: Load
    case: LoadCase
    seen: LoadCase
    start: LocalState
    local: LocalState
    action: Array
    terms: float
    friction: FrictionRule  # on its pairing
    mismatch: float = 0.0
    failure: str = ""
    travel: float = 0.0  # of the point that slid furthest, over what is allowed
    culprit: int = -1  # the point whose partner or way made the attempt fail
    stateless: Array | None = None
    carried: Carried | None = None
    origin: Placed | None = None

    def posed(self, case: LoadCase) -> LoadCase:
        """A load case as its problem counts it."""
        return case if self.origin is None else self.origin.seen(case, self.problem.kin, self.model)

    @cached_property
    def state(self) -> State:
        """Return what is remembered of it."""
        return self.local.in_space(self.problem.kin)

    @cached_property
    def plastic_slip(self) -> Array:
        """Return what friction acts on, see `plastic_slip`, (m, d-1) [length]."""
        return plastic_slip(self.model.interface, self.start, self.local)

    @cached_property
    def friction_bound(self) -> Array:
        """Of the friction forces at its end; zero at open points, (m,) [force]."""
        return friction_bound(self.model.interface.laws, self.local, self.friction)

    @property
    def energy(self) -> Array:
        """Return what friction takes on its way."""
        interface = self.model.interface
        bounds = friction_bound(interface.laws, self.start, self.friction) + self.friction_bound
        return friction_energy(interface, self.start, self.local, self.plastic_slip, bounds)

    @property
    def good(self) -> bool:
        """Return whether the load was reached."""
        return self.outcome.converged and not self.failure

    @property
    def reason(self) -> str:
        """Return how it ended, in words."""
        return self.failure or self.outcome.message

    @property
    def at_limit(self) -> bool:
        """Whether the bodies move on without carrying the load, friction at its bound included."""
        return self.carried is not None and self.carried.limit

    @property
    def stopped(self) -> bool:
        """Return whether the user's callback ended it."""
        return self.outcome.stopped


@dataclass(eq=False)
class Advance:
    """The way that a load step has come, and the last attempt, which says whether it has arrived.

    `energy` is the `friction_energy` of all parts together, (2, contacts).
    `unsettled` is the last attempt whose pairing did not settle, since a part of the step was reached:
    of smaller parts, which begin on its pairing, the loop may fail before they come to pair anew.
    `carried` is the largest share of it that a loading machine has come to, where it did not arrive.
    """

    energy: Array
    attempt: Attempt = field(init=False)
    good: bool = False
    unsettled: Attempt | None = None
    trace: list[Record] = field(default_factory=list)
    cuts: int = 0
    substeps: int = 1
    carried: float | None = None

    def came_to(self, attempt: Attempt, done: float, aim: float) -> bool:
        """Whether the last attempt has arrived, at the part of the step between two shares of it."""
        self.attempt, self.good = attempt, attempt.good
        self.trace.extend(attempt.outcome.trace)
        if self.good:
            self.unsettled = None
            if attempt.model.interface.laws:
                self.energy += attempt.energy
        elif attempt.culprit >= 0 and attempt.travel <= 1.0:
            self.unsettled = attempt
        if attempt.carried is not None:
            self.carried = done + (aim - done) * attempt.carried.share
        return self.good


@dataclass(eq=False)
class Recovery:
    """The means to recover the displacements of all bodies for one result, when asked for.

    Vectors over the contact DOFs, and the bodies that all results of a solver share. The dense
    contact problem on the pairing of the result is none of it: where contact slides far, every result
    would keep one of its own.

    Attributes
    ----------
    model : LinearModel
    found : Source, or pair of Load and Response
        What all displacements follow from; on the pairing of the undeformed bodies, which the model
        keeps, the answer that `source` makes it from when somebody asks.
    components : tuple or None
        What the bodies remember of the load; None where they remember nothing.
    case : LoadCase
    moved : bool
        Whether the pairing is another than that of the undeformed bodies.
    unknowns : int
        Gaps and slips of the contact problem; zero where it is not on these.
    shift : ndarray, shape (n,), optional
        Along motions that nothing resists, see `neutral_equilibrium`, and `origin` [length].
    u : ndarray, shape (n,), optional
        The displacements, where they are known: of bodies that are not linear [length].
    """

    model: LinearModel
    found: Source | tuple[Load, Response]
    components: tuple[Any, ...] | None
    case: LoadCase
    moved: bool
    unknowns: int
    shift: Array | None = None
    u: Array | None = None

    @classmethod
    def of(cls, attempt: Attempt, shift: Array | None = None) -> Recovery:
        """Say that of the last iterate of an attempt."""
        problem, load, response = attempt.problem, attempt.load, attempt.outcome.iterate.response
        moved, case, origin = problem.u is not None, attempt.case, attempt.origin
        if origin is not None:
            case = attempt.posed(case)
            shift = origin.u if shift is None else origin.u + shift
        return cls(
            model=attempt.model,
            found=problem.source(load, response) if moved else (load, response),
            components=load.components,
            case=case,
            moved=moved,
            unknowns=problem.unknowns,
            shift=shift,
        )

    @cached_property
    def source(self) -> Source:
        """Return what all displacements follow from."""
        if isinstance(self.found, Source):
            return self.found
        source: Source = self.model.base.source(*self.found)
        return source

    def __call__(self) -> Array:
        return _recovered([self])[0] if self.u is None else self.u

    def at_contact(self) -> Array:
        """Displacements (n,) known without the interior: contact DOFs and prescribed ones."""
        if self.u is not None:
            return self.u
        u = self.model.bodies.surface(self.source, self.case)
        return u if self.shift is None else u + self.shift

    def space(self, kin: Any) -> tuple[PointSpace, bool] | None:
        """The contact problem on gaps and slips, and whether supports hold all bodies.

        None where it is not on these. Where contact slides far it is computed anew.
        """
        if not self.unknowns:
            return None
        bodies = self.model.bodies
        with single_threaded:
            points = self.model.problem_on(kin if self.moved else None, None).points
        held = isinstance(bodies, Condensed) and bodies.P.shape[1] == 0
        return None if points is None else (points, held)

    def __getstate__(self) -> dict[str, Any]:
        # elsewhere the bodies are condensed anew, and remember no loads
        return {**vars(self), "found": self.source, "components": None}


def recover_all(answers: Sequence[Answer]) -> None:
    """Recover the displacements of many answers, with one solve per model for all of them."""
    waiting = [r for r in answers if "u" not in r.__dict__]
    _find_sources([answer.recover for answer in waiting])
    groups: dict[tuple[int, bool], list[Answer]] = {}
    for answer in waiting:
        key = id(answer.recover.model), answer.recover.source.forces
        groups.setdefault(key, []).append(answer)
    for group in groups.values():
        for answer, u in zip(group, _recovered([r.recover for r in group]), strict=True):
            vars(answer).setdefault("u", sealed(u))  # another thread may have come first


def _find_sources(some: Sequence[Recovery]) -> None:
    """What the displacements follow from, for all that are on the pairing of the undeformed bodies."""
    groups: dict[int, list[Recovery]] = {}
    for recovery in some:
        if not isinstance(recovery.found, Source) and "source" not in vars(recovery):
            groups.setdefault(id(recovery.model), []).append(recovery)
    for group in groups.values():
        problem = group[0].model.base
        sources = problem.sources([r.found for r in group if not isinstance(r.found, Source)])
        for recovery, source in zip(group, sources, strict=True):
            vars(recovery).setdefault("source", source)


def _recovered(some: Sequence[Recovery]) -> list[Array]:
    """Displacements of all bodies for recoveries of one model and kind."""
    bodies = some[0].model.bodies
    with single_threaded:
        sources = Source(np.column_stack([r.source.values for r in some]), some[0].source.forces)
        components = [r.components for r in some]
        u: list[Array] = bodies.recover(sources, components, [r.case for r in some])
    return [v if r.shift is None else v + r.shift for v, r in zip(u, some, strict=True)]
