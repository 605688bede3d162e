r"""The active set: what a state asks its points to change to, and the linear conditions of a set.

Signorini's conditions and the friction law are one projection (Alart and Curnier, 1991).
With each point's own resistance rho against being moved, a state of gaps, slips and forces satisfies
both where, point by point,

    lambda = max(a, 0),                       a = lambda - rho_n g,
    tau = P(t) if a > 0, else 0,              t = tau + rho_t (s - s_n),

with P the return map of the friction law under the normal force a. Any positive rho will do: it only
says how gaps and slips count beside forces. A point with a finite tangential stiffness G has its
elastic trial force ``t = tau_n + G (s - s_n)`` instead. Where supports make a point slip along one of
its tangents exact sticking gives way, and t is any force along ``s - s_n`` that is beyond the bound.
Points that never open have ``lambda = a``, and laws are asked with ``max(a, 0)``.

`Projection` answers for a state what it asks every point to change to (`proposal`), which points are
not as it asks, and how far off (`violations`), and how much is left of both equations (`left`).

In the plane ``d = t / |t|`` is a side, and a point slips to one or to the other by the same rule.

Where all DOFs of a tangential row are prescribed, the row has no equation to enter: whatever the
friction, supports balance it. The law gives it all the same, from the slip that they prescribe, and
what is reported as friction, its resultant and its energy are those of the law.

**The linear conditions of one iteration** are those of the statuses, with the derivative of the return
map. At a point that slips, friction is ``tau = P(t, lambda, s)``, with the return map P under a trial
force t. A finite tangential stiffness G makes it ``t = tau_n + G (s - s_n)``. Where sticking is exact
it is that of `complementarity`, ``t = tau + rho (s - s_n)``, with tau itself in it, for which the
linear equation is solved,

    tau = P + J (t' - t) + ...   =>   (1 - J) tau = rho J (s - s_n) + ...

With ``P = L d``, ``d = t / |t|``, ``b = L / |t|`` this is a spring across the direction of friction,
``rho b / (1 - b) (1 - d d')``: symmetric and positive semidefinite, at the answer
``L / |s - s_n| (1 - d d')`` whatever rho is. With one tangent it is zero.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import cached_property

import numpy as np

from skfem_contact.arrays import Array, Index, Mask, lengths
from skfem_contact.conditions.friction_rule import BEYOND, grows
from skfem_contact.conditions.state import OPEN, SLIP, STICK, LocalState
from skfem_contact.digits import COMPUTED, GIVEN, SINGLE
from skfem_contact.loops.step import Guess, Iterate, Step, stabilise
from skfem_contact.problem.points import Conditions, Resistance, Response, odd_round_off
from skfem_contact.records import dataclass


def active_set(step: Step, guess: Guess, tolerance: float, coupled: bool) -> Iterator[Iterate]:
    """Solve for a set of statuses, let the answer correct the set, until it agrees."""
    current = guess
    # the limits of `direct` settle over several iterations: until then its sets may well change
    search = LineSearch(whole=not coupled)
    settled, motions = False, step.motions
    while True:
        status, held = current.status, None
        if motions.k and not motions.held(status != OPEN, (status == STICK) & step.resisting, SINGLE):
            status, held = stabilise(step, current, coupled)
            current = replace(current, status=status)
        rough = held is None and not settled
        conditions = linear_conditions(step, current, coupled, rough)
        response = step.problem.solve(conditions, step.load)
        at = Projection(step, response)
        wrong, residual = at.violations(current, tolerance)
        changing = wrong if held is None else wrong & ~held.points
        kept = held is not None and np.count_nonzero(wrong & held.points) > 0
        yield Iterate(
            status,
            current.direction,
            response,
            conditions,
            int(np.count_nonzero(wrong)),
            residual,
            converged=not (np.count_nonzero(changing) or kept or response.rough)
            and (residual <= tolerance or search.settled),
            note=search.note,
            held=held.motion if held is not None and kept else None,
            # a zone that travels is as far from its end with one tangent as it has points to go
            nearer=search.nearer and not step.turns,
        )
        search.whole = not coupled or _falls(step, current)
        current = search.advance(current, at, changing)
        settled = not np.count_nonzero(changing)


def _falls(step: Step, current: Guess) -> bool:
    """Return whether some bound falls with the slip in the plane: it lags behind, see `_slipping`."""
    if step.turns or step.friction.steady:
        return False
    slips = (current.status == SLIP) & step.frictional
    if not np.count_nonzero(slips):
        return False
    by = step.friction.slipping(current.direction, BEYOND, current.normal_force, current.slip)[2]
    return bool(np.any(slips & np.any(by.slip != 0, axis=(1, 2)) & ~grows(by)))


def linear_conditions(step: Step, current: Guess, coupled: bool, rough: bool = False) -> Conditions:
    """Return the conditions that a set of statuses puts on every point.

    Parameters
    ----------
    step : Step
    current : Guess
    coupled : bool
        Whether friction follows the normal force within the linear solve, or its limit lags.
    rough : bool
        Whether an answer with fewer digits will do on the way.
    """
    closed = current.status != OPEN
    slips = (current.status == SLIP) & step.frictional
    sticks = current.status == STICK
    stick = sticks & step.gripped
    m, t = current.direction.shape
    offset, coupling = np.zeros((m, t)), np.zeros((m, t))
    spring = np.zeros((m, t, t))
    if np.count_nonzero(slips):
        force, spring, coupling = _slipping(step, current, slips, coupled)
        offset = np.where(slips[:, None], force, 0.0)
    elastic = None if step.all_exact else sticks & step.frictional & ~step.exact
    if elastic is not None and np.count_nonzero(elastic):
        offset[elastic] = step.last.tangential_force[elastic]
        spring[elastic] = step.stiffness[elastic, None, None] * np.eye(t)
    return Conditions(closed, stick, step.last.slip, spring, offset, coupling, rough)


def _slipping(step: Step, current: Guess, slips: Mask, coupled: bool) -> tuple[Array, Array, Array]:
    """Friction of points that slip as ``offset + spring (s - s_n) + coupling lambda``."""
    reach = BEYOND if current.reach is None else current.reach[:, None]
    normal_force, slip = current.normal_force, current.slip
    force, beyond, by = step.friction.slipping(current.direction, reach, normal_force, slip)
    coupling, spring = np.zeros(force.shape), np.zeros(by.slip.shape)
    if coupled:
        follows = slips
        if step.closed_for_good is not None:  # the bound of a bond under tension does not
            follows = slips & ~(step.bilateral & (current.normal_force < 0))
        coupling = np.where(follows[:, None], by.normal_force, 0.0)
        force -= coupling * np.maximum(current.normal_force, 0.0)[:, None]
        if np.count_nonzero(by.slip):
            # a bound that falls with the slip lags: it would take stiffness away from the bodies
            rising = slips & grows(by)
            spring[rising] = by.slip[rising]
            force -= np.einsum("ikl,il->ik", spring, current.slip - step.last.slip)
    if step.turns:
        turning = np.where((slips & beyond)[:, None, None], by.trial, 0.0)
        return _turning(step, current, reach * current.direction, turning, (force, spring, coupling))
    return force, spring, coupling


def _turning(
    step: Step, current: Guess, trial: Array, J: Array, friction: tuple[Array, Array, Array]
) -> tuple[Array, Array, Array]:
    """The same with the derivative J by the trial force, which is solved for where it has tau in it."""
    assert step.resistance is not None
    force, spring, coupling = friction
    exact = with_force = step.exact
    k = np.where(exact, step.resistance.tangential, step.stiffness)[:, None]
    if current.driven is not None:  # the trial force of these is along the slip alone
        driven, slip = current.driven, lengths(current.slip - step.last.slip)
        k = np.where(driven, lengths(trial) / np.where(driven, slip, 1.0), k[:, 0])[:, None]
        with_force = exact & ~driven
    still = np.where(exact[:, None], 0.0, step.last.tangential_force)
    force = force + np.einsum("ikl,il->ik", J, still - trial)
    spring = spring + k[:, :, None] * J
    solved = np.linalg.inv(np.eye(J.shape[1]) - np.where(with_force[:, None, None], J, 0.0))
    force, spring = np.einsum("ikl,il->ik", solved, force), solved @ spring
    # springs that count as symmetric are: of two halves that differ the solver reads one
    odd = odd_round_off(spring)
    return (
        force + np.einsum("ikl,il->ik", odd, current.slip - step.last.slip),
        spring - odd,
        np.einsum("ikl,il->ik", solved, coupling),
    )


# Round-off of a force or a gap relative to the largest one: a violation below it is no violation.
# Condensation loses some digits to the condition number of the bodies (1e-16 times 1e3 or so).
NO_VIOLATION = 1e-11


# The part of slips that are the same but for round-off (`same_slip`) which a solve itself
# leaves, as a rule: what a stiffness makes of it stays below the forces. With ten times as much the
# friction of a ring that is turned by far more than it strains is off.
SOLVED_SLIP = 0.1


# Armijo's rule: the decrease that is asked for over that of the linear model, and how often a step is
# halved for it; as often as the way to the largest share of a load (`pulled`): three digits.
DECREASE, HALVINGS = 1e-4, 10


# That of a single number.
EPS = float(np.finfo(float).eps)


class Projection:
    """The projection above at one state of a load step.

    Parameters
    ----------
    step : Step
    response : Response
        Gaps, slips and forces of the state.
    """

    def __init__(self, step: Step, response: Response) -> None:
        self.step, self.response = step, response
        # the slip of this step, (m, d-1) [length]
        self.moved = response.slip - step.last.slip
        self.force_scale = largest_force(response)
        self.rho = rho = step.resistance or self._alike()
        self.gap_scale = approach(step, response)
        # the normal force ``a`` that the state asks for, negative where it asks for none, (m,)
        self.pressing = response.normal_force - rho.normal * response.gap

    def _alike(self) -> Resistance:
        """A resistance by which gaps and slips count as much as forces, where nobody knows another."""
        force, moved = self.force_scale, self.slip_scale
        alike = np.full(len(self.response.gap), force / moved if force > 0 and moved > 0 else 1.0)
        return Resistance(alike, alike)

    @cached_property
    def slip_scale(self) -> float:
        """The largest slip of this step [length]."""
        return longest(self.moved)

    @property
    def nothing(self) -> float:
        """Forces up to this are round-off [force]."""
        return max(NO_VIOLATION * self.force_scale, self.step.noise)

    @cached_property
    def closed(self) -> tuple[Mask, Array]:
        """Points that the state asks to be closed, and their normal forces, (m,) each."""
        closed = (self.pressing > 0) & self.step.paired
        if self.step.closed_for_good is not None:
            closed |= self.step.closed_for_good
        return closed, np.where(closed, self.pressing, 0.0)

    @cached_property
    def driven(self) -> Mask | None:
        """Points that exact sticking does not hold, as supports move them along a tangent, (m,).

        None where there are no such supports.
        """
        along = self.step.slip_prescribed_along
        if along is None:
            return None
        moved = lengths(np.where(along, self.moved, 0.0))
        return self.step.exact & (moved > same_slip(self.step, self.response))

    @cached_property
    def pushing(self) -> Array:
        """The trial friction force ``t``, (m, d-1) [force]."""
        return self._pushing(self.rho.tangential)

    def _pushing(self, resistance: Array) -> Array:
        step, response, moved = self.step, self.response, self.moved
        trial = response.tangential_force + resistance[:, None] * moved
        if self.driven is not None:
            along = moved / np.where(self.driven, lengths(moved), 1.0)[:, None]
            trial = np.where(self.driven[:, None], BEYOND * along, trial)
        if step.all_exact:
            return trial
        return np.where(step.exact[:, None], trial, step.trial(response.slip))

    @cached_property
    def bound(self) -> Array:
        """The bound of friction under the normal forces of `closed`, (m,) [force]."""
        return self.step.friction.bound(self.closed[1], self.response.slip)

    # -- what the state asks for ----------------------------------------------

    def proposal(self, current: Guess) -> Guess:
        """The set that the state asks for, point by point.

        Where round-off would decide, a point keeps the status that it has in `current`.
        """
        step, response, force = self.step, self.response, self.pressing
        was_open = current.status == OPEN
        penetrates = (
            was_open & (force > self.rho.normal * (NO_VIOLATION * self.gap_scale)) & step.paired
        )
        pulls = ~was_open & (force < -self.nothing)
        if step.closed_for_good is not None:
            pulls &= ~step.bilateral
        direction, reach, driven = np.zeros(response.slip.shape), None, None
        status = np.full(len(was_open), STICK)
        if step.friction.laws:
            slips, direction, reach = self._slipping(current)
            driven = self.driven
            if driven is not None:
                slips |= driven
            slips &= ~was_open | penetrates
            direction = direction * slips[:, None]
            status[slips] = SLIP
        status[was_open & ~penetrates | pulls] = OPEN
        if step.closed_for_good is not None:
            status[step.tied & step.paired] = STICK
        forces = self.closed[1], response.tangential_force
        return Guess(status, direction, *forces, response.slip, reach=reach, driven=driven)

    def _slipping(self, current: Guess) -> tuple[Mask, Array, Array | None]:
        """Find the points that slip if they are closed, their directions, and their trial forces.

        These say what friction resists across its direction, which there is not with one tangent.
        """
        step, response, trial = self.step, self.response, self.pushing
        was_stick, was_slip = current.status == STICK, current.status == SLIP
        bound = self.bound
        if np.count_nonzero(was_slip):
            # along its direction the friction of a point that slips is the bound, also where a bound
            # that is not linear, or lags, has given another
            along = products(response.tangential_force, current.direction)
            missing = np.where(was_slip & step.exact, bound - along, 0.0)
            trial = trial + missing[:, None] * current.direction
        size = lengths(trial)
        # what is open has no status to keep; what slips back by more than the round-off of slips sticks
        back = NO_VIOLATION * self.slip_scale * self.rho.tangential + 4 * EPS * bound
        back = np.where(step.exact, np.minimum(self.nothing, back), self.nothing)
        slack = self.nothing * was_stick - back * was_slip
        if not step.all_exact:
            slack -= np.where(was_slip, trial_round_off(step, response), 0.0)
        slips = (size > bound + slack) & step.frictional
        unit = trial / np.where(size > 0, size, 1.0)[:, None]
        # where the slip turns back the point sticks first, or forward and backward slip alternate
        slips &= ~was_slip | (products(unit, current.direction) >= 0)
        # where nothing presses, forces are round-off and decide nothing: what slips goes on, for stuck
        # it would press by friction again, and be let go again
        if self.force_scale <= step.noise:
            slips &= ~was_stick
        keep, direction = was_slip & (size <= self.nothing), unit
        if np.count_nonzero(keep):
            direction = np.where(keep[:, None], current.direction, unit)
        if trial.shape[1] == 1:
            return slips, direction, None
        # across its direction a slipping point has bound / (reach - bound) of its stiffness: up to 1e6
        reach = np.where(bound > 0, np.maximum(size, bound / (1 - GIVEN)), BEYOND)
        return slips, direction, reach

    # -- how far it is off ------------------------------------------------------

    @cached_property
    def left_over(self) -> tuple[Array, Array]:
        """Return what is left of both equations at every point, (m,) and (m, d-1) [force]."""
        return self.response.normal_force - self.closed[1], self._left_along()

    def _left_along(self, resistance: Array | None = None) -> Array:
        """What is left along the tangents, (m, d-1); by other resistances where they are given."""
        step, response = self.step, self.response
        if not (step.friction.laws or step.closed_for_good is not None):
            return np.zeros(response.slip.shape)
        trial = self.pushing if resistance is None else self._pushing(resistance)
        closed, force = self.closed
        friction, _, self.bound = step.friction.project(trial, force, response.slip)
        if step.closed_for_good is not None:
            friction = np.where(step.tied[:, None], trial, friction)
        tangential = response.tangential_force - np.where(closed[:, None], friction, 0.0)
        return np.where(step.modelled[:, None], tangential, 0.0)

    @cached_property
    def left(self) -> float:
        """Size of what is left over at all points together [force]."""
        normal, tangential = self.left_over
        return float(np.sqrt(np.sum(normal**2) + np.sum(tangential**2)))

    def violations(self, current: Guess, tolerance: float) -> tuple[Mask, float]:
        """Points that violate the projection, and the largest violation over the largest force.

        What is within the tolerance is no violation, nor is what may be round-off of gaps and slips. A
        finite stiffness enlarges that of slips, but a force beyond its bound is one all the same. Where
        none is left, slips count as in the certificate: the largest of them as much as the largest
        force. Beside resistances small slips would count for nothing, and friction be off their
        direction.
        """
        step, response, rho, scale = self.step, self.response, self.rho, self.force_scale
        normal, tangential = np.abs(self.left_over[0]), _sizes(self.left_over[1])
        slip_scale = self.slip_scale
        allowed = max(step.noise, tolerance * scale)
        known = NO_VIOLATION * np.maximum(rho.normal * self.gap_scale, rho.tangential * slip_scale)
        wrong = normal > np.maximum(known, allowed)
        if not step.all_exact:
            known = np.maximum(known, trial_round_off(step, response))
            sticks = (current.status == STICK) & step.frictional & ~step.exact
            bound = step.friction.bound(response.normal_force, response.slip)
            wrong |= sticks & (lengths(response.tangential_force) - bound > allowed)
        wrong |= tangential > np.maximum(known, allowed)
        left = np.maximum(normal, tangential)
        if scale <= step.noise:
            return wrong, 0.0
        if slip_scale > 0.0 and not np.count_nonzero(wrong):
            turned = self._left_along(np.maximum(rho.tangential, scale / slip_scale))
            left = np.maximum(left, _sizes(turned))
        return wrong, float(left.max(initial=0.0) / scale)


@dataclass
class LineSearch:
    """Armijo's rule on what the projection leaves over: a step is halved until less is left.

    Between two states lie those whose gaps, slips and forces are the same mean of theirs: bodies are
    linear, so that they are in equilibrium too. Before the first state none is known, and the step to
    it is whole. `whole`: all are. Limits that lag lead to another fixed point in every iteration, and
    not straight down to that of the step.
    """

    whole: bool
    settled: bool = False
    nearer: bool = False
    at: Response | None = None
    left: float = np.inf
    note: str = ""

    def advance(self, current: Guess, new: Projection, wrong: Mask) -> Guess:
        """The set for the next iterate, by the state at the best share of the way to the new one."""
        # one more iteration tells round-off from what is left of a step
        self.settled = not wrong.any() and (new.left >= self.left or not self.whole)
        there, share, tries = new, 1.0, 0
        while not (falls := there.left <= (1.0 - DECREASE * share) * self.left):
            if self.at is None or self.whole or tries == HALVINGS:
                break
            share, tries = 0.5 * share, tries + 1
            there = Projection(new.step, _between(self.at, new.response, share))
        self.note = f"{share:.2g} of a step" if tries else ""
        self.nearer = falls and there.left > 0.0
        self.at, self.left = there.response, there.left
        return there.proposal(current)


def _between(a: Response, b: Response, share: float) -> Response:
    """The state at a share of the way from `a` to `b`; points without partner have no gap in either."""
    finite = np.isfinite(b.gap)
    gap = np.where(finite, 0.0, b.gap)
    gap[finite] = _mean(a.gap[finite], b.gap[finite], share)
    return Response(
        gap,
        _mean(a.slip, b.slip, share),
        _mean(a.normal_force, b.normal_force, share),
        _mean(a.tangential_force, b.tangential_force, share),
        _mean(a.solution, b.solution, share),
    )


def _mean(a: Array, b: Array, share: float) -> Array:
    return a + share * (b - a)


def products(a: Array, b: Array) -> Array:
    """Scalar products of vectors (m, d-1), (m,); in half the time of a sum."""
    return np.asarray(np.einsum("ik,ik->i", a, b))


def _sizes(vectors: Array) -> Array:
    """Lengths of vectors (m, d-1), (m,), where squares below the smallest number do not matter."""
    return np.asarray(np.sqrt(products(vectors, vectors)))


def longest(vectors: Array) -> float:
    """The length of the longest vector (m, d-1), zero of none."""
    return float(np.sqrt(products(vectors, vectors).max(initial=0.0)))


def largest_force(response: Response | LocalState) -> float:
    """The largest normal or tangential force at a point [force]."""
    pressing = float(np.abs(response.normal_force).max(initial=0.0))
    return max(pressing, longest(response.tangential_force))


def approach(step: Step, response: Response) -> float:
    """The largest change of a gap since nothing was carried, of points with a partner [length]."""
    finite = np.isfinite(response.gap)
    return float(np.abs(response.gap[finite] - step.load.gap0[finite]).max(initial=0.0))


def same_slip(step: Step, response: Response) -> float:
    """A slip up to this may be the round-off of prescribed displacements [length]."""
    slips = max(longest(response.slip), longest(step.last.slip))
    return COMPUTED * max(step.far, approach(step, response), slips)


def trial_round_off(step: Step, response: Response) -> Array:
    """Return what a finite stiffness makes of the round-off of slips, (m,)."""
    return np.where(step.exact, 0.0, step.stiffness) * (SOLVED_SLIP * same_slip(step, response))


def friction_of_prescribed_slip(
    step: Step, slip_prescribed: Mask, status: Index, response: Response
) -> tuple[Index, Array]:
    """Status (m,) and friction (m, d-1) of the answer, by the law where the slip is prescribed.

    In `step` these points are none with friction: there is no equation for it.
    """
    at = slip_prescribed & (status != OPEN)
    if not np.count_nonzero(at):
        return status, response.tangential_force
    moved = response.slip - step.last.slip
    size = lengths(moved)
    moves = size > same_slip(step, response)
    along = moved / np.where(moves, size, 1.0)[:, None]
    # exact sticking gives way to any slip
    exact = np.where(moves[:, None], BEYOND * along, step.last.tangential_force)
    trial = np.where(step.exact[:, None], exact, step.trial(response.slip))
    force, slips, _ = step.friction.project(trial, response.normal_force, response.slip)
    slips |= moves & step.exact
    return (
        np.where(at, np.where(slips, SLIP, STICK), status),
        np.where(at[:, None], force, response.tangential_force),
    )
