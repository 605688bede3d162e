r"""The three nonlinear loops as generators of iterates.

Each loop solves one load step: which points are closed, which of them slip, and how large the
friction forces are. It yields every iterate with a record and never stops by itself except when it
has converged; one driver (`skfem_contact.solver`) counts, logs, stops and raises. The loops keep
nothing between calls.

``newton``      semismooth Newton: the friction force of a slipping point follows the normal force
                within the linear solve.
``direct``      [M] fig. 4b: a slipping point carries the friction force of the last iterate as a load.
``fictitious``  [M] fig. 4a: every closed point keeps its spring; the excess over the friction limit
                returns as an unbalanced load (an initial-stress method). One factorisation serves
                as long as the set of closed points does not change.

All three reach the same solution. Open and closed points change by the same rule: a closed point in
tension opens, an open one that penetrates closes.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from skfem_contact.friction import FrictionLaw, return_map
from skfem_contact.rigid import RigidMotions
from skfem_contact.spaces import Conditions, Load, Response, Space

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

OPEN, STICK, SLIP = 0, 1, 2

# Round-off of a force or a gap relative to the largest one: a violation below it is no violation.
# Condensation loses some digits to the condition number of the bodies (1e-16 times 1e3 or so).
ROUND_OFF = 1e-11


@dataclass(frozen=True, eq=False)
class State:
    """What friction remembers of the last load step; the path dependence lives here.

    Attributes
    ----------
    status : ndarray of int, shape (m,)
    slip : ndarray, shape (m, d-1)
        Relative tangential displacement since the undeformed state [length].
    tangential_force : ndarray, shape (m, d-1)
        Force that resists the slip; zero at open points [force].
    normal_force : ndarray, shape (m,)
    reference : ndarray, shape (m, d-1)
        Slip at which the point closed [length].
    surface, trend : ndarray
        Displacements of the surfaces that slide far, and their change in the last load step: where
        the pairing of the next one begins. Empty for small sliding [length].
    """

    status: NDArray[np.intp]
    slip: Array
    tangential_force: Array
    normal_force: Array
    reference: Array
    surface: Array
    trend: Array


@dataclass(frozen=True, eq=False)
class Step:
    """One load step as a loop sees it: a linear world, a load, the laws and the history."""

    space: Space
    load: Load
    motions: RigidMotions
    area: Array
    paired: Mask
    tied: Mask
    laws: tuple[tuple[slice, FrictionLaw], ...]
    frictional: Mask
    stiffness: Array
    last: State

    def limit(self, normal_force: Array, slip: Array) -> Array:
        """Friction bound of every point; zero where there is no law."""
        return self._law("limit", np.maximum(normal_force, 0.0), slip)

    def slope(self, normal_force: Array, slip: Array) -> Array:
        """Derivative of the bound by the normal force."""
        return self._law("slope", np.maximum(normal_force, 0.0), slip)

    def _law(self, method: str, normal_force: Array, slip: Array) -> Array:
        out = np.zeros_like(normal_force)
        counted = slip - self.last.reference
        for part, law in self.laws:
            out[part] = getattr(law, method)(normal_force[part], self.area[part], counted[part])
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
    changes: int
    residual: float
    converged: bool
    note: str = ""
    held: Array | None = None


Loop = Callable[[Step, "Guess", float], Iterator[Iterate]]


@dataclass(frozen=True, eq=False)
class Guess:
    """Starting values of a loop; never part of the answer."""

    status: NDArray[np.intp]
    direction: Array
    normal_force: Array
    tangential_force: Array
    slip: Array


def newton(step: Step, guess: Guess, tolerance: float) -> Iterator[Iterate]:
    """Semismooth Newton with the consistent derivative of the return map."""
    return _active_set(step, guess, tolerance, coupled=True)


def direct(step: Step, guess: Guess, tolerance: float) -> Iterator[Iterate]:
    """[M] fig. 4b: slipping points carry the friction force of the last iterate."""
    return _active_set(step, guess, tolerance, coupled=False)


def _active_set(step: Step, guess: Guess, tolerance: float, coupled: bool) -> Iterator[Iterate]:
    """Solve for a set of statuses, let the answer correct the set, until it agrees."""
    current = guess
    # the limits of `direct` settle over several iterations: until then its sets may well change
    pace = Pace(patience=4 if coupled else 15)
    while True:
        status, held = hold(step, current)
        current = replace(current, status=status)
        response = step.space.solve(_conditions(step, current, coupled), step.load)
        proposal = propose(step, current, response)
        wrong = disagreement(current, proposal)
        residual = law_residual(step, status, current.direction, response)
        kept = np.zeros_like(wrong) if held is None else wrong & held.points
        done = not (wrong & ~kept).any() and residual <= tolerance
        yield Iterate(
            status,
            current.direction,
            response,
            int(wrong.sum()),
            residual,
            converged=done and not kept.any(),
            note=pace.note(),
            held=None if held is None or not kept.any() else held.motion,
        )
        current = pace.advance(step, current, proposal, wrong & ~kept, response)


@dataclass
class Pace:
    """How many points may change at once (block principal pivoting of Judice and Pires, 1994).

    Whole sets change as long as their number falls; after a few iterations without progress, one
    point at a time, by the largest index, until there is progress again. On problems with unique
    solutions this ends; where it does not, the driver's count does.
    """

    patience: int
    best: int = np.iinfo(int).max
    left: int = 0
    single: bool = False

    def note(self) -> str:
        return "one point at a time" if self.single else ""

    def advance(
        self, step: Step, current: Guess, proposal: Guess, wrong: Mask, response: Response
    ) -> Guess:
        count = int(wrong.sum())
        if count < self.best:
            self.best, self.left, self.single = count, self.patience, False
        elif self.left > 0:
            self.left -= 1
        else:
            self.single = True
        take = wrong
        if self.single and count:
            take = np.zeros_like(wrong)
            take[np.flatnonzero(wrong)[-1]] = True
        return replace(
            proposal,
            status=np.where(take, proposal.status, current.status),
            direction=np.where(take[:, None], proposal.direction, current.direction),
        )


def _conditions(step: Step, current: Guess, coupled: bool) -> Conditions:
    closed = current.status != OPEN
    slips = (current.status == SLIP) & step.frictional
    exact = np.isinf(step.stiffness)
    stick = (current.status == STICK) & (exact & step.frictional | step.tied)
    limit = step.limit(current.normal_force, current.slip)
    t = current.direction.shape[1]
    coupling = np.zeros_like(current.direction)
    if coupled:
        slope = step.slope(current.normal_force, current.slip)
        coupling[slips] = (slope[:, None] * current.direction)[slips]
        limit = limit - slope * np.maximum(current.normal_force, 0.0)
    offset = np.where(slips[:, None], limit[:, None] * current.direction, 0.0)
    elastic = (current.status == STICK) & step.frictional & ~exact
    offset[elastic] = step.trial(np.zeros_like(offset))[elastic]
    spring = np.zeros((len(closed), t, t))
    spring[elastic] = step.stiffness[elastic, None, None] * np.eye(t)
    return Conditions(closed, stick, step.last.slip, spring, offset, coupling)


def propose(step: Step, current: Guess, response: Response) -> Guess:
    """The set that the answer asks for: Signorini's conditions and the friction law, point by point."""
    force_scale = np.max(np.abs(response.normal_force), initial=0.0)
    force_scale = max(force_scale, np.max(np.abs(response.tangential_force), initial=0.0))
    was_open = current.status == OPEN
    finite = np.isfinite(response.gap)
    gap_scale = np.max(np.abs(response.gap[finite] - step.load.gap0[finite]), initial=0.0)
    penetrates = was_open & (response.gap < -ROUND_OFF * gap_scale) & step.paired
    pulls = ~was_open & (response.normal_force < -ROUND_OFF * force_scale) & ~step.tied

    limit = step.limit(response.normal_force, response.slip)
    slips, direction = _slip_rule(step, current, response, limit, force_scale, penetrates)
    status = np.where(slips, SLIP, STICK)
    status = np.where(was_open & ~penetrates | pulls, OPEN, status)
    status = np.where(step.tied & step.paired, STICK, status)
    return Guess(status, direction, response.normal_force, response.tangential_force, response.slip)


def _slip_rule(
    step: Step,
    current: Guess,
    response: Response,
    limit: Array,
    force_scale: float,
    closes: Mask,
) -> tuple[Mask, Array]:
    """Which points slip that are closed or just close, and in which direction friction then acts."""
    exact = np.isinf(step.stiffness)
    trial = np.where(exact[:, None], response.tangential_force, step.trial(response.slip))
    size = np.linalg.norm(trial, axis=1)
    beyond = size > limit + ROUND_OFF * force_scale
    was_slip = current.status == SLIP
    # an exactly sticking point has no trial force while it slips: it goes on slipping as long as
    # the slip of this step follows the friction
    step_slip = response.slip - step.last.slip
    slip_scale = np.max(np.abs(step_slip), initial=0.0)
    forward = np.sum(step_slip * current.direction, axis=1) >= -ROUND_OFF * slip_scale
    slips = np.where(exact & was_slip, forward, beyond) & step.frictional
    unit = trial / np.where(size > 0, size, 1.0)[:, None]
    # where the slip turns back the point sticks first, or forward and backward slip alternate
    slips &= ~was_slip | (np.sum(unit * current.direction, axis=1) >= 0) | exact
    # a coefficient of zero: no force can stick, not even the round-off of one
    if force_scale > 0:
        slips |= (step.limit(np.full_like(size, force_scale), response.slip) == 0) & step.frictional
    keep = exact & was_slip
    direction = np.where(keep[:, None], current.direction, unit)
    # a point that closes slips if it moves sideways by more than it sinks in allows: the trial
    # force r (s - s_n) against the limit under the trial pressure -r g (Alart and Curnier, 1991),
    # with an r that makes the largest slip the largest force. If it stuck, it could be in tension,
    # open, and close again without end
    r = force_scale / slip_scale if slip_scale > 0 else 0.0
    distance = np.linalg.norm(step_slip, axis=1)
    pressed = step.limit(-r * np.where(closes, response.gap, 0.0), response.slip)
    sideways = closes & step.frictional & (r * distance > pressed)
    along = step_slip / np.where(distance > 0, distance, 1.0)[:, None]
    slips = np.where(current.status == OPEN, sideways, slips)
    direction = np.where(sideways[:, None], along, direction)
    return slips, np.where(slips[:, None], direction, 0.0)


def disagreement(current: Guess, proposal: Guess) -> Mask:
    """Points whose status or slip direction changes."""
    turned = np.sum(np.abs(current.direction - proposal.direction), axis=1) > 1.0
    return (current.status != proposal.status) | (turned & (proposal.status == SLIP))


def law_residual(step: Step, status: NDArray[np.intp], direction: Array, response: Response) -> float:
    """Largest distance of a slipping point's friction force from the law, over the largest force."""
    scale = np.max(np.abs(response.normal_force), initial=0.0)
    scale = max(scale, np.max(np.abs(response.tangential_force), initial=0.0))
    if scale == 0.0:
        return 0.0
    limit = step.limit(response.normal_force, response.slip)
    slips = (status == SLIP) & (response.normal_force >= 0)
    error = np.abs(response.tangential_force - limit[:, None] * direction)
    return float(np.max(error[slips], initial=0.0) / scale)


@dataclass(frozen=True, eq=False)
class Held:
    """Points kept closed or sticking because a body would be free without them."""

    points: Mask
    motion: Array


def hold(step: Step, current: Guess) -> tuple[NDArray[np.intp], Held | None]:
    """Keep just so many points closed and sticking that no rigid motion is free.

    A body that only contact and friction hold makes the matrix singular while all its points are
    open or all slip, even if the answer is neither. The points nearest to what is needed are kept:
    those farthest below their friction limit, then those with the smallest gap. If the answer goes
    on contradicting them, there is no equilibrium; the driver says so.
    """
    status, motions = current.status, step.motions
    if motions.k == 0:
        return status, None
    holds = step.frictional | step.tied
    free = motions.free(status != OPEN, (status == STICK) & holds)
    if free.shape[1] == 0:
        return status, None
    status, first = status.copy(), free
    points = np.zeros(len(status), dtype=bool)
    limit = step.limit(current.normal_force, current.slip)
    excess = np.linalg.norm(current.tangential_force, axis=1) - limit
    order = np.concatenate([_by(excess, status == SLIP), _by(step.load.gap0, status == OPEN)])
    for i in order:
        if free.shape[1] == 0:
            break
        if not step.paired[i]:
            continue
        resists = np.abs(motions.normal[i] @ free).max(initial=0.0) > 1e-6
        turns = holds[i] and np.abs(motions.tangential[i] @ free).max(initial=0.0) > 1e-6
        if (status[i] == OPEN and resists) or turns:
            status[i] = STICK
            points[i] = True
            free = motions.free(status != OPEN, (status == STICK) & holds)
    return status, Held(points, first)


def _by(value: Array, mask: Mask) -> NDArray[np.intp]:
    chosen = np.flatnonzero(mask)
    return chosen[np.argsort(value[chosen], kind="stable")]


def fictitious(step: Step, guess: Guess, tolerance: float) -> Iterator[Iterate]:
    """[M] fig. 4a: the method of fictitious friction forces, accelerated by Anderson's mixing.

    Every closed point keeps its spring G. The friction force that the linear solve gives,
    ``tau_n + G (s - s_n) + e``, is compared with the return map of the elastic predictor, and the
    excess ``e`` is corrected until the two agree. The plain iteration contracts by a factor that
    tends to one as G grows; the acceleration shortens it but does not lift that limit.
    """
    excess = np.zeros_like(guess.direction)
    mixing = Anderson()
    current = guess
    while True:
        closed_as_stick = np.where(current.status == OPEN, OPEN, STICK)
        status, held = hold(step, replace(current, status=closed_as_stick))
        elastic = (status == STICK) & step.frictional
        offset = np.where(elastic[:, None], step.trial(np.zeros_like(excess)) + excess, 0.0)
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
        response = step.space.solve(conditions, step.load)
        trial = step.trial(response.slip)
        limit = step.limit(response.normal_force, response.slip)
        mapped, slips = return_map(trial, limit)
        error = np.where(elastic[:, None], mapped - response.tangential_force, 0.0)
        scale = max(
            np.max(np.abs(response.normal_force), initial=0.0),
            np.max(np.abs(response.tangential_force), initial=0.0),
        )
        residual = float(np.max(np.abs(error), initial=0.0) / scale) if scale > 0 else 0.0

        proposal = propose(step, replace(current, status=status), response)
        wrong = (proposal.status == OPEN) != (status == OPEN)
        unit = mapped / np.where(limit > 0, limit, 1.0)[:, None]
        shown = np.where(elastic & slips & (response.normal_force > 0), SLIP, status)
        kept = held is not None and bool((wrong & held.points).any())
        yield Iterate(
            shown,
            np.where((shown == SLIP)[:, None], unit, 0.0),
            response,
            int(wrong.sum()),
            residual,
            converged=not wrong.any() and residual <= tolerance,
            note=mixing.note(),
            held=held.motion if held is not None and kept else None,
        )
        if wrong.any():
            mixing = Anderson()  # another set is another fixed-point problem
            excess = np.where(elastic[:, None], mapped - trial, 0.0)
        else:
            excess = mixing.advance(excess, np.where(elastic[:, None], mapped - trial, 0.0))
        current = replace(proposal, status=np.where(proposal.status == OPEN, OPEN, STICK))


class Anderson:
    """Anderson's acceleration of a fixed-point iteration ``x <- g(x)`` (Walker and Ni, 2011)."""

    def __init__(self, window: int = 8) -> None:
        self.window = window
        self.x: list[Array] = []
        self.f: list[Array] = []

    def note(self) -> str:
        return "accelerated" if len(self.x) > 1 else ""

    def advance(self, x: Array, g: Array) -> Array:
        """The next iterate from the last one and its image."""
        self.x.append(x.ravel())
        self.f.append((g - x).ravel())
        self.x, self.f = self.x[-self.window :], self.f[-self.window :]
        if len(self.x) == 1:
            return g
        dF = np.diff(np.array(self.f), axis=0).T
        dX = np.diff(np.array(self.x), axis=0).T
        gamma = np.linalg.lstsq(dF, self.f[-1], rcond=1e-10)[0]
        mixed = self.x[-1] + self.f[-1] - (dX + dF) @ gamma
        return mixed.reshape(x.shape)
