"""Starts of the iterations of a load step: warm, cold, by another loop or another problem.

The proximal point is a way to the answer where Newton's method finds none.
Large coefficients of friction on uneven surfaces leave Newton's steps no way down. The same problem
with a soft spring in series with every point has one: nearly every point is then by itself. Springs
without strain at the forces of the last such problem change nothing where these are the answer. They
are made stiffer from one problem to the next, and from near enough the problem itself is solved.
(R. T. Rockafellar, SIAM J. Control Optim. 14 (1976); with friction nothing is proved.)

Cohesion and Tresca's law have a bound ``L`` where nothing presses, and none where a point is open. Such
a point may have no state: with all of its friction it is pulled, without it overlaps. With the bound

    ``min(L(lambda), k lambda)``

in its place there is one (`from_regularised`). Where k is large, the answer is that of the law
itself, unless points slip under no more than a part of ``L`` and hardly any pressure, however large k
is: these have no state nearby.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import cast

import numpy as np

from skfem_contact.arrays import Array
from skfem_contact.conditions.friction import FrictionLaw
from skfem_contact.conditions.friction_rule import FrictionRule
from skfem_contact.conditions.kinematics import Kinematics
from skfem_contact.conditions.state import OPEN, SLIP, STICK, LocalState, State
from skfem_contact.digits import GIVEN, SOLVED
from skfem_contact.errors import SingularMatrix
from skfem_contact.loops.driver import NEWTON_ITERATIONS, Outcome, drive, newton
from skfem_contact.loops.pulled import IN_SERIES, Carried, after, pulled
from skfem_contact.loops.step import Guess, Record, Step
from skfem_contact.problem.points import Load, Resistance
from skfem_contact.problem.seam import ContactProblem
from skfem_contact.records import dataclass

# More points than this are left to step cutting: the tableau has 4 m rows and 8 m columns.
MOST_POINTS = 250

# Softness of the springs in series over that of the points: at first; and what it is divided by after
# each answer. Where one is not found it is multiplied by the root of that, and divided by no more from
# then on. On 168 load steps with coefficients of 3, 10 and 100 that Newton had failed at, values of
# twice and half as much do as well.
SOFTEST, EASED = 30.0, 4.0

# Share by which forces change at most from one problem to the next before the problem itself is tried;
# and iterations for the whole chain, which took 100 on the mean and more than this in two of those load
# steps. Where no softness helps, nothing is to be found: without an end to it a block that slides away
# is refused after twice as many iterations.
NEAR, MOST_IN_SERIES, TOO_SOFT = 0.1, 600, 1e4

# Friction over the normal force where bounds that jump are made to rise: pressures on the rise are a
# thousandth of the bound, and where an answer is found from there, a hundred thousandth.
RISES = (1e3, 1e5)

# Where an attempt at a load step begins, in this order.
STARTS = ("warm", "cold", "newton", "pivoting", "pulled", "proximal")
# Where one begins once all these have failed, with friction that jumps.
REGULARISED = "regularised"
# Of these the ones that ask for the problem on gaps and slips, where there is one.
DENSE = ("pivoting", "pulled", "proximal", REGULARISED)


@dataclass(eq=False)
class Start:
    """A start of the iterations of a load step, with what was found out on the way there.

    Attributes
    ----------
    guess : Guess
    spent : Outcome or None
        How another loop came to it.
    stateless : ndarray, shape (m,), or None
        Shares of the bounds of points that have no state, where there are any; see `from_regularised`.
    carried : Carried or None
        How much of the load is carried at most.
    """

    guess: Guess
    spent: Outcome | None = None
    stateless: Array | None = None
    carried: Carried | None = None

    def ended(self, outcome: Outcome, same: bool) -> Outcome:
        """Note how a step ended that began here; `same` where both loops had the same equations."""
        spent = self.spent
        trace = (*spent.trace, *outcome.trace) if spent else outcome.trace
        if same and spent and spent.converged and not outcome.converged and not outcome.stopped:
            # the same equations and tolerance: limits that lag ran away from their solution
            outcome = replace(spent, note=" of the loop 'newton'")
        elif spent and spent.free is not None and not outcome.converged:
            outcome = replace(outcome, free=spent.free)  # its limits do not lag
        note = outcome.note or (" after complementary pivoting" if self.guess.pivoted else "")
        if trace is outcome.trace and not note:
            return outcome
        return replace(outcome, trace=trace, note=note)


def possible_starts(points: int, loop: str, turns: bool, pulled: bool = False) -> list[str]:
    """List the starts that attempts may take.

    Newton for the loops whose friction lags behind the normal forces, which settles slowly near gross
    slip, and never where both drive each other; pivoting only on problems small enough for its tableau,
    and where directions of friction do not turn. `pulled`: by a loading machine, where the way of a
    step is one on one pairing and told from its ends. The proximal point is the last in the plane, too.
    """
    few = points <= MOST_POINTS and not turns
    useful = {"newton": loop != "newton", "pivoting": few, "pulled": pulled}
    return [start for start in STARTS if useful.get(start, True)]


def starting_values(
    start: str,
    known: LocalState,
    step: Step,
    tolerance: float,
    loop: str,
    dense: Step,
    before: Callable[[], Load] | None = None,
) -> Start:
    """Starting values by one of the starts.

    Parameters
    ----------
    start : str
        Of `STARTS`, or `REGULARISED`.
    known : LocalState
        The last known state, which a warm start repeats.
    step : Step
    tolerance : float
        To which other loops are run.
    loop : str
        The loop that begins here. Before `direct`, whose lagged limits run away from an answer that
        is not exact, Newton takes the round-off out of what pivoting has found.
    dense : Step
        The same step with gaps and slips as unknowns, for the starts in `DENSE`.
    before : callable, optional
        Gives the load at which the step begins, for ``"pulled"``.
    """
    found, guess = None, as_guess(known)
    if start == "warm":
        found = Start(guess)
    elif start == "newton":
        found = Start(*_by_newton(guess, step, tolerance))
    elif start == "pivoting":
        from skfem_contact.loops.lemke import lemke_guess  # few steps come to this start

        pivoted = lemke_guess(dense, guess)
        if pivoted is not None:
            found = Start(*_by_newton(pivoted, step, tolerance)) if loop == "direct" else Start(pivoted)
    elif start == "proximal":
        found = Start(*proximal(dense, admissible(guess, dense), tolerance))
    elif start == "pulled" and before is not None:
        guess, spent, carried = pulled(dense, before(), admissible(guess, dense), tolerance)
        found = Start(guess, spent, carried=carried)
    elif start == REGULARISED:
        guess, shares = from_regularised(dense, admissible(guess, dense), tolerance)
        found = Start(guess, stateless=shares if shares.any() else None)
    found = found or Start(_cold(step))
    found.guess = admissible(found.guess, step)
    return found


def _by_newton(guess: Guess, step: Step, tolerance: float) -> tuple[Guess, Outcome]:
    first = admissible(guess, step)
    found = drive(newton, step, first, tolerance, NEWTON_ITERATIONS)
    it, there = found.iterate, found.iterate.response
    forces = there.normal_force, there.tangential_force
    return Guess(it.status, it.direction, *forces, there.slip), found


def _cold(step: Step) -> Guess:
    """Nothing known: points that touch are closed and stick."""
    zero = np.zeros(step.last.slip.shape)
    touching = step.paired & (step.load.gap0 <= 0)
    status = np.where(touching | step.bilateral & step.paired, STICK, OPEN)
    return Guess(status, zero, np.zeros(len(status)), zero, zero)


def natural_state(kin: Kinematics, surface: int) -> State:
    """Before any load: nothing is known to touch, no slip, no friction."""
    zero, none, status = np.zeros(kin.normal.shape), np.zeros(surface), np.zeros(kin.gap0.shape, int)
    force = np.zeros(kin.gap0.shape)
    still = status, zero, zero, force, zero, kin.gap0, kin.area, none, none, kin.vertex, force, force
    return State(*still, normal=kin.normal)


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


@np.errstate(over="ignore", invalid="ignore")  # forces that grow without end are given up
def proximal(step: Step, guess: Guess, tolerance: float) -> tuple[Guess, Outcome | None]:
    """Starting values from a chain of easier problems, and how the last of them ended.

    Parameters
    ----------
    step : Step
    guess : Guess
        Where the first of the problems begins.
    tolerance : float
        Of the problem itself.
    """
    softness, eased = SOFTEST, EASED
    trace: list[Record] = []
    found = None
    while len(trace) < MOST_IN_SERIES and SOLVED < softness < TOO_SOFT:
        try:
            found = drive(newton, _in_series(step, softness, guess), guess, tolerance, IN_SERIES)
        except SingularMatrix:  # beside a law of 1e12 times their stiffness springs are round-off
            break
        trace += [replace(record, note="springs in series") for record in found.trace]
        if not found.converged:
            eased = EASED**0.5
            softness *= eased
            continue
        before, guess = guess, replace(after(step, found), near=True)
        if _change(before, guess) < NEAR:
            found = drive(newton, step, guess, tolerance, IN_SERIES)
            trace += found.trace
            if found.converged:
                guess, found = _of_least_pressure(step, found, tolerance, trace)
                return guess, replace(found, trace=tuple(trace))
        softness /= eased
    if found is None:
        return guess, None
    return guess, replace(found, trace=tuple(trace), converged=False, free=None)


def _of_least_pressure(
    step: Step, found: Outcome, tolerance: float, trace: list[Record]
) -> tuple[Guess, Outcome]:
    """Return the answer to which springs come from no forces, where many answers exist."""
    guess = after(step, found)
    if step.problem.springs is None:
        return guess, found
    least = drive(newton, step, guess, tolerance, IN_SERIES)
    trace += least.trace
    return (after(step, least), least) if least.converged else (replace(guess, near=True), found)


def _in_series(step: Step, softness: float, guess: Guess) -> Step:
    """The step with a spring in series with every point, `softness` times as soft as the point itself.

    They have no strain at the forces of the guess.
    """
    whole = cast(ContactProblem, step.problem)  # no springs in series twice
    own = step.resistance or whole.resistance
    springs = Resistance(own.normal / softness, own.tangential / softness)
    together = Resistance(own.normal / (1 + softness), own.tangential / (1 + softness))
    problem = whole.in_series(springs)
    load = problem.at_forces(step.load, guess.normal_force, guess.tangential_force)
    return replace(step, problem=problem, load=load, resistance=together)


def _change(before: Guess, after: Guess) -> float:
    """Change of the forces over their size."""
    one, other = (np.column_stack([g.normal_force, g.tangential_force]) for g in (before, after))
    size = np.linalg.norm(other)
    return float(np.linalg.norm(other - one) / size) if size > 0 else 0.0


@dataclass(frozen=True, eq=False)
class RegularisedLaw(FrictionLaw):
    """Another law, whose bound begins at zero.

    Parameters
    ----------
    law : FrictionLaw
    rise : float
        Friction over the normal force where that is small.

    Examples
    --------
    >>> from skfem_contact.conditions.friction import Tresca
    >>> one, none = np.ones(2), np.zeros((2, 1))
    >>> RegularisedLaw(Tresca(3.0), 1000.0).limit(np.array([0.001, 1.0]), one, none)
    array([1., 3.])
    """

    law: FrictionLaw
    rise: float

    def limit(self, normal_force: Array, area: Array, slip: Array) -> Array:
        return np.minimum(self.law.limit(normal_force, area, slip), self.rise * normal_force)

    def slope(self, normal_force: Array, area: Array, slip: Array) -> Array:
        rising = self.rise * normal_force < self.law.limit(normal_force, area, slip)
        return np.where(rising, self.rise, self.law.slope(normal_force, area, slip))


def from_regularised(step: Step, guess: Guess, tolerance: float) -> tuple[Guess, Array]:
    """Starting values from laws that rise steeply, and the points that have no state nearby.

    Parameters
    ----------
    step : Step
        With the resistance of its points.
    guess : Guess
    tolerance : float

    Returns
    -------
    guess : Guess
        The given one, where nothing is found.
    shares : ndarray, shape (m,)
        Of their bound by which such points slip without pressure; zero at all others.
    """
    shares = np.zeros(len(step.paired))
    for rise in RISES:
        laws = tuple(
            (part, replace(law, law=RegularisedLaw(law.law, rise))) for part, law in step.friction.laws
        )
        rule = FrictionRule(laws, step.friction.area, step.last.reference)
        steep = replace(step, friction=rule)
        found, outcome = proximal(steep, guess, tolerance)
        if outcome is None or not outcome.converged:
            break
        guess, status, there = found, outcome.iterate.status, outcome.iterate.response
        full = step.friction.bound(there.normal_force, there.slip)
        bound = steep.friction.bound(there.normal_force, there.slip)
        partly = (status == SLIP) & (bound < (1 - GIVEN) * full)
        shares = np.where(partly, bound / np.where(partly, full, 1.0), 0.0)
    return guess, shares
