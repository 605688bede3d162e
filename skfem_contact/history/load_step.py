"""A load step, one attempt at it, and how far it has come."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from skfem_contact.conditions.loads import LoadCase
from skfem_contact.conditions.state import LocalState, State
from skfem_contact.history.energy import Energy, friction_bound, friction_energy, plastic_slip
from skfem_contact.loops.driver import Outcome
from skfem_contact.loops.pulled import Carried
from skfem_contact.loops.step import Record
from skfem_contact.problem.model import LinearModel
from skfem_contact.problem.response import Load
from skfem_contact.problem.seam import ContactProblem, Workspace

Array = NDArray[np.float64]


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
    """

    state: State
    before: LoadCase
    target: LoadCase
    known: State | None
    callback: Callable[[Record], object] | None = None
    share: float = 1.0
    workspace: Workspace = field(default_factory=Workspace, repr=False)


@dataclass(eq=False)
class Attempt:
    """One attempt at a load: how the loop ended, from which state, and on which pairing.

    `start` and `local` are the states before and after it, both along the tangents of its pairing;
    `own_action` is where the forces act on the pairing of its answer, if that is another, (m, d).
    `stateless` are shares of the bounds of points that have no state, where there are any, (m,); see
    `loops.proximal.steeply`. `carried`: how much of the load is carried at most, where that is known.
    """

    outcome: Outcome
    model: LinearModel
    problem: ContactProblem
    load: Load
    case: LoadCase
    seen: LoadCase
    start: LocalState
    local: LocalState
    mismatch: float = 0.0
    failure: str = ""
    travel: float = 0.0  # of the point that slid furthest, over what is allowed
    own_action: Array | None = None
    culprit: int = -1  # the point whose partner or way made the attempt fail
    stateless: Array | None = None
    carried: Carried | None = None

    @cached_property
    def state(self) -> State:
        """What is remembered of it."""
        return self.local.in_space(self.problem.kin)

    @property
    def action(self) -> Array:
        """Where the forces of the points act at its end, (m, d) [length]."""
        return self.problem.kin.action if self.own_action is None else self.own_action

    @cached_property
    def plastic_slip(self) -> Array:
        """What friction acts on, see `energy.plastic_slip`, (m, d-1) [length]."""
        return plastic_slip(self.model.interface, self.start, self.local)

    @cached_property
    def friction_bound(self) -> Array:
        """Of the friction forces at its end; zero at open points, (m,) [force]."""
        return friction_bound(self.model.interface, self.local)

    @property
    def energy(self) -> Energy:
        """What friction takes on its way."""
        interface, bound = self.model.interface, self.friction_bound
        return friction_energy(interface, self.start, self.local, self.plastic_slip, bound)

    @property
    def good(self) -> bool:
        """Whether the load was reached."""
        return self.outcome.converged and not self.failure

    @property
    def at_limit(self) -> bool:
        """Whether the bodies move on without carrying the load, friction at its bound included."""
        return self.carried is not None and self.carried.limit

    @property
    def stopped(self) -> bool:
        """Whether the user's callback ended it."""
        return self.outcome.stopped


@dataclass(eq=False)
class Advance:
    """How far a load step has come, and the last attempt, which says whether it has arrived.

    `carried` is the largest share of it that a loading machine has come to, where it did not arrive.
    """

    energy: Energy
    attempt: Attempt = field(init=False)
    trace: list[Record] = field(default_factory=list)
    cuts: int = 0
    substeps: int = 1
    carried: float | None = None

    @property
    def words(self) -> str:
        """What else it took, for messages: cuts of the step."""
        if not self.cuts:
            return ""
        times = "once" if self.cuts == 1 else f"{self.cuts} times"
        return f", step cut {times}, substep {self.substeps}"
