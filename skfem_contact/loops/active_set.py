"""The loops: solve for a set of statuses, let the answer correct the set.

``newton``      semismooth Newton: the friction force of a slipping point follows the normal force
                within the linear solve.
``direct``      [M] fig. 4b: a slipping point carries the friction force of the last iterate as a load.
``fictitious``  [M] fig. 4a, an initial-stress method: every closed point keeps its spring, and what a
                friction force exceeds its limit by returns as a load. One factorisation serves as long
                as the set of closed points does not change.

A loop is a generator of iterates. It solves one load step: which points are closed, which of them
slip, and how large the friction forces are. It yields every iterate with a record and never stops by
itself except when it has converged; one driver (`skfem_contact.loops.driver`) counts, logs, stops and
raises. Loops keep nothing between calls.

All reach the same solution. Open and closed points change by the same rule: a closed point in tension
opens, an open one that penetrates closes. How far an iteration goes is told by `LineSearch`. The
tangential stiffness that each loop needs is `STIFFNESS` of `skfem_contact.conditions.interface`.

**The linear conditions of one iteration** are those of the statuses, with the derivative of the return
map. At a point that slips, friction is ``tau = P(t, lambda, s)``, with the return map P under a trial
force t. A finite tangential stiffness G makes it ``t = tau_n + G (s - s_n)``. Where sticking is exact
it is that of `complementarity`, ``t = tau + rho (s - s_n)``, with tau itself in it, for which the
linear equation is solved,

    tau = P + J (t' - t) + ...   =>   (1 - J) tau = rho J (s - s_n) + ...

With ``P = L d``, ``d = t / |t|``, ``b = L / |t|`` this is a spring across the direction of friction,
``rho b / (1 - b) (1 - d d')``: symmetric and positive semidefinite, at the answer
``L / |s - s_n| (1 - d d')`` whatever rho is. With one tangent it is zero.

A body that only contact and friction hold makes the matrix singular while all its points are open or
all slip, even if the answer is neither: `stabilise` keeps just so many closed and sticking.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import partial

import numpy as np

from skfem_contact.arrays import Array, Index, Mask, lengths
from skfem_contact.conditions.friction_rule import BEYOND, grows
from skfem_contact.conditions.state import OPEN, SLIP, STICK
from skfem_contact.digits import DECIMALS, GIVEN, ROUND_OFF, SINGLE
from skfem_contact.linalg.krylov import Anderson
from skfem_contact.loops.multipliers import Iteration, through_springs
from skfem_contact.loops.step import Guess, Iterate, LineSearch, Projection, Step, largest_force
from skfem_contact.problem.points import Conditions, odd_round_off
from skfem_contact.records import dataclass

# In the loop `fictitious` points open and close freely so often; after that only once the friction of
# the present set has settled (to `GIVEN` of the largest force), or a point could open and close for
# ever because of friction forces that lag behind.
FREE_CHANGES = 12

# Where in a unit of the last of `DECIMALS` by which points are told apart one number begins and the
# other ends: at no fraction that meshes have. At a half it is at 2^-10, among others, and round-off
# tells equal points apart.
BETWEEN = (3 - 5**0.5) / 2


def newton(step: Step, guess: Guess, tolerance: float) -> Iterator[Iterate]:
    """Semismooth Newton with the consistent derivative of the return map."""
    return _until_rested(partial(_active_set, coupled=True), step, guess, tolerance)


def direct(step: Step, guess: Guess, tolerance: float) -> Iterator[Iterate]:
    """[M] fig. 4b: slipping points carry the friction force of the last iterate."""
    return _until_rested(partial(_active_set, coupled=False), step, guess, tolerance)


def _until_rested(loop: Iteration, step: Step, guess: Guess, tolerance: float) -> Iterator[Iterate]:
    """A loop; once more, again and again, where points are seen through springs that have a strain.

    Some problems find out on the way that rows depend on each other.
    """
    known: list[Iterate] = []
    if not guess.near or step.problem.springs is None:
        for iterate in loop(step, guess, tolerance):
            if iterate.converged and step.problem.springs is not None:
                known = [iterate]
                break
            yield iterate
    yield from through_springs(loop, step, guess, tolerance, known)


def _active_set(step: Step, guess: Guess, tolerance: float, coupled: bool) -> Iterator[Iterate]:
    """Solve for a set of statuses, let the answer correct the set, until it agrees."""
    current = guess
    # the limits of `direct` settle over several iterations: until then its sets may well change
    search = LineSearch(whole=not coupled)
    settled = False
    while True:
        status, held = stabilise(step, current, coupled)
        if held is not None:
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


def _follows(step: Step, current: Guess, slips: Mask) -> Mask:
    """Points that slip and whose bound follows the normal force, (m,)."""
    if step.closed_for_good is None:
        return slips
    # under tension, which only a bond can have, the bound does not
    return slips & ~(step.bilateral & (current.normal_force < 0))


def _slipping(step: Step, current: Guess, slips: Mask, coupled: bool) -> tuple[Array, Array, Array]:
    """Friction of points that slip as ``offset + spring (s - s_n) + coupling lambda``."""
    reach = BEYOND if current.reach is None else current.reach[:, None]
    normal_force, slip = current.normal_force, current.slip
    force, beyond, by = step.friction.slipping(current.direction, reach, normal_force, slip)
    coupling, spring = np.zeros(force.shape), np.zeros(by.slip.shape)
    if coupled:
        coupling = np.where(_follows(step, current, slips)[:, None], by.normal_force, 0.0)
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


@dataclass(frozen=True, eq=False)
class Stabilised:
    """Points kept closed or sticking because a body would be free without them."""

    points: Mask
    motion: Array


def stabilise(step: Step, current: Guess, coupled: bool = True) -> tuple[Index, Stabilised | None]:
    """Keep just so many points closed and sticking that no rigid motion is free.

    A body that only contact and friction hold makes the matrix singular while all its points are
    open or all slip, even if the answer is neither. The points nearest to what is needed are kept:
    those farthest below their friction limit, then those with the smallest gap. If the answer goes
    on contradicting them, there is no equilibrium; the driver says so. Friction that grows with the
    slip holds as well where it does so within the linear solve, `coupled`.
    """
    status, motions = current.status, step.motions
    if motions.k == 0:
        return status, None
    holds = step.resisting
    if motions.held(status != OPEN, (status == STICK) & holds, SINGLE):
        return status, None

    springs = np.zeros(len(status), dtype=bool)
    if coupled and np.count_nonzero(rubs := (status == SLIP) & step.frictional):
        springs = rubs & step.friction.hardens(current.direction, current.normal_force, current.slip)

    def still_free() -> Array:
        closed, stick = status != OPEN, (status == STICK) & holds | springs
        return motions.free(closed, stick, SINGLE, _across(step, current, status))

    free = still_free()
    if free.shape[1] == 0:
        return status, None
    status, first = status.copy(), free
    points = np.zeros(len(status), dtype=bool)
    limit = step.friction.bound(current.normal_force, current.slip)
    excess = lengths(current.tangential_force) - limit
    # a gap is no more exact than the coordinates that it is a difference of
    known = ROUND_OFF * float(np.abs(motions.kin.points).max(initial=0.0))
    slipping = _by(excess, status == SLIP, step)
    opened = _by(step.load.gap0, status == OPEN, step, known)
    order = np.concatenate([slipping, opened])
    for i in order:
        if free.shape[1] == 0:
            break
        resists = np.abs(motions.normal[i] @ free).max(initial=0.0) > GIVEN
        slid = motions.tangential[i] @ free
        turns = holds[i] and np.sqrt((slid**2).sum(axis=0)).max(initial=0.0) > GIVEN
        if (status[i] == OPEN and resists) or turns:
            status[i] = STICK
            points[i] = True
            free = still_free()
    return status, Stabilised(points, first)


def _across(step: Step, current: Guess, status: Index) -> Array | None:
    """Rows (r, k) by which slipping points hold rigid motions, across the direction of friction."""
    if not step.turns or current.reach is None:
        return None
    at = (status == SLIP) & step.frictional & (current.reach < BEYOND)
    d = current.direction[at]
    bound = step.friction.bound(current.normal_force, current.slip)[at]
    share = bound / current.reach[at]
    firm = np.sqrt(np.minimum(share / (1 - share), 1.0))  # stiffnesses are squares of rows
    across = np.eye(d.shape[1]) - d[:, :, None] * d[:, None, :]
    return ((firm[:, None, None] * across) @ step.motions.tangential[at]).reshape(-1, step.motions.k)


def _by(value: Array, mask: Mask, step: Step, known: float = 0.0) -> Index:
    """Points from the smallest value to the largest; those alike up to round-off by their rank.

    `known`: what values are uncertain by, however small they are.
    """
    chosen = np.flatnonzero(mask & step.paired)
    largest = max(float(np.max(np.abs(value[chosen]), initial=0.0)), known * 10**DECIMALS)
    share = value[chosen] / largest if largest > 0 else value[chosen]
    alike = np.floor(share * 10.0**DECIMALS + BETWEEN)
    return chosen[np.lexsort((step.rank[chosen], alike))]


def fictitious(step: Step, guess: Guess, tolerance: float) -> Iterator[Iterate]:
    """[M] fig. 4a: the method of fictitious friction forces, accelerated by Anderson's mixing."""
    return _until_rested(_fictitious, step, guess, tolerance)


def _fictitious(step: Step, guess: Guess, tolerance: float) -> Iterator[Iterate]:
    """The same without the springs through which points may be seen.

    Every closed point keeps its spring G. The friction force that the linear solve gives,
    ``tau_n + G (s - s_n) + e``, is compared with the return map of the elastic predictor, and the
    excess ``e`` is corrected until the two agree. The plain iteration contracts by a factor that
    tends to one as G grows; the acceleration shortens it but does not lift that limit.
    """
    excess = _excess(step, guess)
    mixing = Anderson(depth=7)
    current, free_changes = guess, FREE_CHANGES
    while True:
        closed_as_stick = np.where(current.status == OPEN, OPEN, STICK)
        status, held = stabilise(step, replace(current, status=closed_as_stick))
        elastic = (status == STICK) & step.frictional
        offset = np.where(elastic[:, None], step.last.tangential_force + excess, 0.0)
        spring = np.zeros((*offset.shape, offset.shape[1]))
        spring[elastic] = step.stiffness[elastic, None, None] * np.eye(offset.shape[1])
        conditions = Conditions(
            closed=status != OPEN,
            stick=(status != OPEN) & step.tied,
            anchor=step.last.slip,
            spring=spring,
            offset=offset,
            coupling=np.zeros_like(offset),
        )
        response = step.problem.solve(conditions, step.load)
        trial = step.trial(response.slip)
        mapped, slips = step.friction.project(trial, response.normal_force, response.slip)
        error = np.where(elastic[:, None], mapped - response.tangential_force, 0.0)
        scale = largest_force(response)
        residual = float(np.max(np.abs(error), initial=0.0) / scale) if scale > 0 else 0.0

        proposal = Projection(step, response).proposal(replace(current, status=status))
        wrong = (proposal.status == OPEN) != (status == OPEN)
        size = np.linalg.norm(mapped, axis=1)
        unit = mapped / np.where(size > 0, size, 1.0)[:, None]
        carries = (response.normal_force > 0) | step.bilateral
        shown = np.where(elastic & slips & carries, SLIP, status)
        kept = held is not None and bool((wrong & held.points).any())
        yield Iterate(
            shown,
            np.where((shown == SLIP)[:, None], unit, 0.0),
            response,
            conditions,
            int(wrong.sum()),
            residual,
            converged=not wrong.any() and residual <= tolerance,
            note="accelerated" if mixing.active else "",
            held=held.motion if held is not None and kept else None,
        )
        image = np.where(elastic[:, None], mapped - trial, 0.0)
        if wrong.any() and (free_changes > 0 or residual <= GIVEN):
            free_changes -= 1
            mixing = Anderson(depth=7)  # another set is another fixed-point problem
            excess = image
            status = np.where(proposal.status == OPEN, OPEN, STICK)
        else:
            excess = mixing.next(excess.ravel(), image.ravel()).reshape(excess.shape)
        current = replace(proposal, status=status)


def _excess(step: Step, guess: Guess) -> Array:
    """By what the law is exceeded where the guess presses, (m, d-1): none where nothing is known."""
    trial = step.trial(guess.slip)
    mapped, _ = step.friction.project(trial, guess.normal_force, guess.slip)
    known = step.frictional & (guess.normal_force > 0)
    return np.where(known[:, None], mapped - trial, 0.0)
