"""One attempt at a load, the way of attempts to it, and the work that friction does on it."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skfem_contact.driver import Outcome
from skfem_contact.geometry import Placement
from skfem_contact.interface import Interface
from skfem_contact.loads import LoadCase
from skfem_contact.states import OPEN, Record, State

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Attempt:
    """One attempt at a load: how the loop ended, and on which pairing."""

    outcome: Outcome
    placement: Placement
    load: Any
    case: LoadCase
    seen: LoadCase
    state: State
    gap: Array
    mismatch: float = 0.0
    failure: str = ""
    travel: float = 0.0  # of the point that slid furthest, over what is allowed

    @property
    def good(self) -> bool:
        """Whether the load was reached."""
        return self.outcome.converged and not self.failure

    @property
    def stopped(self) -> bool:
        """Whether the user's callback ended it."""
        return self.outcome.stopped


@dataclass(eq=False)
class Walk:
    """The way from a state to a load, so far."""

    state: State
    case: LoadCase
    dissipation: Array
    trace: list[Record] = field(default_factory=list)
    cuts: int = 0
    substeps: int = 1
    share: float = 1.0  # of the step that is attempted next

    @property
    def words(self) -> str:
        """How the step was cut, for messages."""
        if not self.cuts:
            return ""
        return f", step cut {self.cuts} times, substep {self.substeps}"


def friction_work(interface: Interface, last: State, new: State) -> Array:
    """Trapezoidal work of friction on the plastic slip, per contact [energy].

    The rule that closes the energy balance of a step whose external work is trapezoidal too.
    """
    G = interface.stiffness[:, None]
    elastic = np.where(np.isfinite(G), (new.tangential_force - last.tangential_force) / G, 0.0)
    mean = 0.5 * (last.tangential_force + new.tangential_force)
    work = np.sum(mean * (new.slip - last.slip - elastic), axis=1)
    # a point that opens slides under a force that falls to zero, so it counts as well
    touched = (new.status != OPEN) | (last.status != OPEN)
    work = np.where(interface.frictional & touched, work, 0.0)
    return np.array([work[part].sum() for part in interface.parts])
