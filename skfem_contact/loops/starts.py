"""Where the iterations of a load step begin: warm, cold, by another loop or another problem."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from skfem_contact.conditions.kinematics import Kinematics
from skfem_contact.conditions.state import OPEN, SLIP, STICK, LocalState, State
from skfem_contact.loops.active_set import newton
from skfem_contact.loops.driver import Outcome, drive
from skfem_contact.loops.lemke import lemke_guess
from skfem_contact.loops.proximal import proximal
from skfem_contact.loops.step import Guess, Step
from skfem_contact.loops.thresholds import MOST_POINTS, NEWTON_ITERATIONS

Array = NDArray[np.float64]

# Where an attempt at a load step begins, in this order.
STARTS = ("warm", "cold", "newton", "pivoting", "pulled", "proximal")
# Of these the ones that ask for the problem on gaps and slips, where there is one.
DENSE = ("pivoting", "pulled", "proximal")


def possible_starts(points: int, loop: str, turns: bool, pulled: bool = False) -> list[str]:
    """Where attempts may begin.

    Newton for the loops whose friction lags behind the normal forces, which settles slowly near gross
    slip, and never where both drive each other; pivoting only on problems small enough for its tableau,
    and where directions of friction do not turn. `pulled`: by a loading machine, where the way of a
    step is one on one pairing and told from its ends. The proximal point is the last in the plane, too.
    """
    few = points <= MOST_POINTS and not turns
    useful = {"newton": loop != "newton", "pivoting": few, "pulled": pulled}
    return [start for start in STARTS if useful.get(start, True)]


def starting_values(
    start: str, known: LocalState, step: Step, kin: Kinematics, tolerance: float, loop: str, dense: Step
) -> tuple[Guess, Outcome | None]:
    """Starting values, and how another loop came to them.

    Parameters
    ----------
    start : {"warm", "cold", "newton", "pivoting", "proximal"}
    known : LocalState
        The last known state, which a warm start repeats.
    step : Step
    kin : Kinematics
    tolerance : float
        To which other loops are run.
    loop : str
        The loop that begins here. Before `direct`, whose lagged limits run away from an answer that
        is not exact, Newton takes the round-off out of what pivoting has found.
    dense : Step
        The same step with gaps and slips as unknowns, for the starts in `DENSE`.
    """
    if start == "warm":
        return as_guess(known), None
    if start == "newton":
        return _by_newton(as_guess(known), step, tolerance)
    if start == "proximal":
        return proximal(dense, admissible(as_guess(known), dense), tolerance)
    if start == "pivoting":
        pivoted = lemke_guess(dense, as_guess(known))
        if pivoted is not None:
            return _by_newton(pivoted, step, tolerance) if loop == "direct" else (pivoted, None)
    return _cold(step, kin), None


def _by_newton(guess: Guess, step: Step, tolerance: float) -> tuple[Guess, Outcome]:
    first = admissible(guess, step)
    found = drive(newton, step, first, tolerance, NEWTON_ITERATIONS)
    it, there = found.iterate, found.iterate.response
    forces = there.normal_force, there.tangential_force
    return Guess(it.status, it.direction, *forces, there.slip), found


def _cold(step: Step, kin: Kinematics) -> Guess:
    """Nothing known: points that touch are closed and stick."""
    zero = np.zeros((kin.m, kin.tangents))
    touching = step.paired & (step.load.gap0 <= 0)
    status = np.where(touching | step.bilateral & step.paired, STICK, OPEN)
    return Guess(status, zero, np.zeros(kin.m), zero, zero)


def natural_state(kin: Kinematics, surface: int) -> State:
    """Before any load: nothing is known to touch, no slip, no friction."""
    zero = np.zeros((kin.m, kin.tangents))
    none, status = np.zeros(surface), np.zeros(kin.m, dtype=int)
    force = np.zeros(kin.m)
    local = LocalState(
        status, zero, zero, force, zero, kin.gap0, kin.area, none, none, kin.vertex, force, force
    )
    return local.in_space(kin)


def as_guess(state: LocalState) -> Guess:
    """Starting values from a state."""
    status, direction = state.status.copy(), np.zeros(state.slip.shape)
    slipped = status == SLIP
    if np.count_nonzero(slipped):
        # slip may go on in any direction: until that is known, nothing slips
        if state.slip.shape[1] == 1:
            direction = np.where(slipped[:, None], np.sign(state.tangential_force), 0.0)
            slipped &= direction[:, 0] == 0  # without friction there is none
        status[slipped] = STICK
    return Guess(status, direction, state.normal_force, state.tangential_force, state.slip)


def admissible(guess: Guess, step: Step) -> Guess:
    """The guess without points that have lost their partner, and with all that never open."""
    status = guess.status.copy()
    if not step.all_paired:
        status[~step.paired] = OPEN
    closed = step.closed_for_good
    if closed is not None:
        status[closed & (status == OPEN) | step.tied] = STICK
    slips = status == SLIP
    rubs = slips & step.frictional
    status[slips ^ rubs] = STICK
    direction = np.where(rubs[:, None], guess.direction, 0.0)
    forces = guess.normal_force, guess.tangential_force
    return Guess(status, direction, *forces, guess.slip, guess.pivoted, guess.reach, near=guess.near)
