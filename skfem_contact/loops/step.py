"""What the loops pass around: steps, guesses, iterates and records."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from skfem_contact.conditions.checked_law import CheckedLaw
from skfem_contact.conditions.motions import RigidMotions
from skfem_contact.conditions.state import LocalState
from skfem_contact.problem.response import Conditions, Load, Response
from skfem_contact.problem.seam import ContactProblem

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Step:
    """One load step as a loop sees it: a linear world, a load, the laws and the history.

    `noise`: forces up to this are round-off of loads and stiffness, whatever the contact forces are;
    where nothing presses it is all there is. `rank`: a number for every point that does not depend on
    the order in which bodies, contacts and nodes were given; where points have to be taken one after
    the other, or two are alike, it decides.
    """

    problem: ContactProblem
    load: Load
    motions: RigidMotions
    area: Array
    paired: Mask
    tied: Mask
    laws: tuple[tuple[slice, CheckedLaw], ...]
    frictional: Mask
    stiffness: Array
    last: LocalState
    rank: NDArray[np.intp]
    noise: float = 0.0

    def limit(self, normal_force: Array, slip: Array) -> Array:
        """Friction bound of every point; zero where there is no law."""
        return self._ask("limit", normal_force, slip)

    def slope(self, normal_force: Array, slip: Array) -> Array:
        """Derivative of the bound by the normal force."""
        return self._ask("slope", normal_force, slip)

    def hardening(self, normal_force: Array, slip: Array, direction: Array) -> Array:
        """By how much the bound grows with a slip along `direction` [force/length]."""
        return self._ask("hardening", normal_force, slip, direction)

    def _ask(self, method: str, normal_force: Array, slip: Array, *more: Array) -> Array:
        out = np.zeros_like(normal_force)
        force, counted = np.maximum(normal_force, 0.0), slip - self.last.reference
        for part, law in self.laws:
            rest = (array[part] for array in (self.area, counted, *more))
            out[part] = getattr(law, method)(force[part], *rest)
        return out

    def trial(self, slip: Array) -> Array:
        """Elastic predictor ``tau_n + G (s - s_n)`` of points with a finite stiffness."""
        G = np.where(np.isfinite(self.stiffness), self.stiffness, 0.0)[:, None]
        return self.last.tangential_force + G * (slip - self.last.slip)


@dataclass(frozen=True, eq=False)
class Iterate:
    """One iterate of a loop.

    Attributes
    ----------
    status : ndarray of int, shape (m,)
        The set that was solved for: 0 open, 1 stick, 2 slip.
    direction : ndarray, shape (m, d-1)
        Unit friction direction of slipping points.
    response : Response
    conditions : Conditions
        What the linear solve held every point to: at the answer its derivative is that of this solve.
    changes : int
        Points whose status or slip direction the iterate itself contradicts.
    residual : float
        Largest violation of the friction law, relative to the largest contact force.
    converged : bool
    note : str
        What the loop did besides its rule: damping, a point held, acceleration.
    held : ndarray
        Combination of rigid modes that only a held point resists, shape (k, j).
    """

    status: NDArray[np.intp]
    direction: Array
    response: Response
    conditions: Conditions
    changes: int
    residual: float
    converged: bool
    note: str = ""
    held: Array | None = None


@dataclass(frozen=True, eq=False)
class Guess:
    """Starting values of a loop; never part of the answer.

    `pivoted` says whether complementary pivoting found the values: work that the iterations of the loop
    do not count.
    """

    status: NDArray[np.intp]
    direction: Array
    normal_force: Array
    tangential_force: Array
    slip: Array
    pivoted: bool = False


@dataclass(frozen=True)
class Record:
    """What one iteration did: a line of the log."""

    iteration: int
    open: int
    stick: int
    slip: int
    changes: int
    residual: float
    note: str = ""

    def __str__(self) -> str:
        return (
            f"{self.iteration:4d}  open {self.open:5d}  stick {self.stick:5d}  slip {self.slip:5d}"
            f"  changes {self.changes:5d}  law {self.residual:8.1e}  {self.note}".rstrip()
        )
