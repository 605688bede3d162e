"""One attempt at a load, the way of attempts to it, and the energy that friction takes on it."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from skfem_contact.conditions.interface import Interface
from skfem_contact.conditions.loads import LoadCase
from skfem_contact.conditions.state import OPEN, LocalState, State
from skfem_contact.loops.driver import Outcome
from skfem_contact.loops.step import Record
from skfem_contact.problem.model import LinearModel
from skfem_contact.problem.response import Load
from skfem_contact.problem.seam import ContactProblem

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Attempt:
    """One attempt at a load: how the loop ended, from which state, and on which pairing.

    `start` and `local` are the states before and after it, both along the tangents of its pairing.
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
    culprit: int = -1  # the point whose partner or way made the attempt fail

    @cached_property
    def state(self) -> State:
        """What is remembered of it."""
        return self.local.in_space(self.problem.kin)

    @property
    def good(self) -> bool:
        """Whether the load was reached."""
        return self.outcome.converged and not self.failure

    @property
    def stopped(self) -> bool:
        """Whether the user's callback ended it."""
        return self.outcome.stopped


@dataclass(frozen=True, eq=False)
class Energy:
    """Energies of the way so far, per contact [energy].

    Attributes
    ----------
    lost : ndarray
        By friction, see `friction_energy`.
    residual : ndarray
        What the energy balance misses.
    """

    lost: Array
    residual: Array

    def __add__(self, other: Energy) -> Energy:
        return Energy(self.lost + other.lost, self.residual + other.residual)


@dataclass(eq=False)
class Walk:
    """The way from a state to a load, so far."""

    state: State
    case: LoadCase
    energy: Energy
    trace: list[Record] = field(default_factory=list)
    cuts: int = 0
    substeps: int = 1
    share: float = 1.0  # of the step that is attempted next

    @property
    def words(self) -> str:
        """What else it took, for messages: cuts of the step."""
        if not self.cuts:
            return ""
        return f", step cut {self.cuts} times, substep {self.substeps}"


def friction_energy(interface: Interface, last: LocalState, new: LocalState) -> Energy:
    r"""Energy that friction takes between two states, and what the energy balance misses.

    On its plastic slip ``s_p`` a point loses the mean of its friction bounds at both ends,

        ``D = (L_n + L_n+1) / 2 |s_p|``,      ``L = 0`` where it is open,

    never less than nothing; exact where the bound is constant, also if the slip turns round, and
    where bound and slip grow in proportion. The forces themselves do other work in steps so large
    that they do not follow their bounds, and so do the pressures of points that close or open: with
    the loads' work ``W`` by the trapezoidal rule and the elastic energy ``U``,

        ``W = U_n+1 - U_n + D + residual``.

    Friction and opening make the residual: it is of second order in the step, and takes no ``K u``.
    Overlaps of the meshes count as misfit that the loads' work has in it.
    """
    plastic = plastic_slip(interface, last, new)
    bound = 0.5 * (friction_bound(interface, last) + friction_bound(interface, new))
    lost = bound * np.linalg.norm(plastic, axis=1)
    work = np.sum(0.5 * (last.tangential_force + new.tangential_force) * plastic, axis=1)
    force = 0.5 * (last.normal_force + new.normal_force)
    # points without partner have no gap, also one that finds or loses it between the two states
    acts = (force != 0) & np.isfinite(new.gap) & np.isfinite(last.gap)
    moved = np.maximum(new.gap[acts], 0.0) - np.maximum(last.gap[acts], 0.0)
    residual = work - lost
    residual[acts] -= force[acts] * moved
    return Energy(
        np.array([lost[part].sum() for part in interface.point_slices]),
        np.array([residual[part].sum() for part in interface.point_slices]),
    )


def plastic_slip(interface: Interface, last: LocalState, new: LocalState) -> Array:
    """Slip between two states that a finite tangential stiffness does not give back, (m, d-1)."""
    G = interface.stiffness[:, None]
    elastic = np.where(np.isfinite(G), (new.tangential_force - last.tangential_force) / G, 0.0)
    return np.where(interface.frictional[:, None], new.slip - last.slip - elastic, 0.0)


def friction_bound(interface: Interface, state: LocalState) -> Array:
    """Bound of the friction force in a state by the present laws; zero at open points, (m,)."""
    bound = np.zeros(len(state.status))
    for part, law in interface.laws:
        pressing = np.maximum(state.normal_force[part], 0.0)
        slip = (state.slip - state.reference)[part]
        bound[part] = law.limit(pressing, state.area[part], slip)
    return np.where(state.status != OPEN, bound, 0.0)


def rough_at_rest(interface: Interface, state: LocalState) -> bool:
    """Whether some friction bound is not zero where nothing presses: it jumps where a point opens."""
    for part, law in interface.laws:
        slip = np.zeros_like(state.slip[part])
        if np.any(law.limit(np.zeros(len(slip)), state.area[part], slip) > 0):
            return True
    return False


def nothing(interface: Interface) -> Energy:
    """No energy lost."""
    zero = np.zeros(len(interface.point_slices))
    return Energy(zero, zero)
