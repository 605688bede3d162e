"""The loops: solve for a set of statuses, let the answer correct the set; and their driver.

``newton``      semismooth Newton: the friction force of a slipping point follows the normal force
                within the linear solve.
``direct``      [M] fig. 4b: a slipping point carries the friction force of the last iterate as a load.
``fictitious``  [M] fig. 4a, an initial-stress method: every closed point keeps its spring, and what a
                friction force exceeds its limit by returns as a load. One factorisation serves as long
                as the set of closed points does not change.

A loop is a generator of iterates. It solves one load step: which points are closed, which of them
slip, and how large the friction forces are. It yields every iterate with a record and never stops by
itself except when it has converged; `drive` counts, logs, stops and raises. Loops keep nothing between
calls.

All reach the same solution. Open and closed points change by the same rule: a closed point in tension
opens, an open one that penetrates closes. How far an iteration goes is told by `LineSearch`. The
tangential stiffness that each loop needs is `STIFFNESS` of `skfem_contact.conditions.interface`.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial

import numpy as np

from skfem_contact.arguments import number, with_known_keywords
from skfem_contact.conditions.state import OPEN, SLIP, STICK
from skfem_contact.digits import GIVEN
from skfem_contact.errors import InputError, SingularMatrix
from skfem_contact.linalg.krylov import Anderson
from skfem_contact.loops.active_set import NO_VIOLATION, Projection, active_set, largest_force
from skfem_contact.loops.multipliers import Iteration, through_springs
from skfem_contact.loops.step import Guess, Iterate, Record, Step, stabilise
from skfem_contact.problem.points import Conditions
from skfem_contact.records import dataclass

# Iterations that Newton may take where another loop begins from its answer.
NEWTON_ITERATIONS = 80

logger = logging.getLogger("skfem_contact")


def newton(step: Step, guess: Guess, tolerance: float) -> Iterator[Iterate]:
    """Semismooth Newton with the consistent derivative of the return map."""
    return _until_rested(partial(active_set, coupled=True), step, guess, tolerance)


def direct(step: Step, guess: Guess, tolerance: float) -> Iterator[Iterate]:
    """[M] fig. 4b: slipping points carry the friction force of the last iterate."""
    return _until_rested(partial(active_set, coupled=False), step, guess, tolerance)


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
    # by what the law is exceeded where the guess presses: none where nothing is known
    trial = step.trial(guess.slip)
    mapped, _, _ = step.friction.project(trial, guess.normal_force, guess.slip)
    known = step.frictional & (guess.normal_force > 0)
    excess = np.where(known[:, None], mapped - trial, 0.0)
    mixing = Anderson(depth=7)
    current = guess
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
        mapped, slips, _ = step.friction.project(trial, response.normal_force, response.slip)
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
        # not before the friction of the present set has settled, or a point could open and close for
        # ever because of friction forces that lag behind
        if wrong.any() and residual <= GIVEN:
            mixing = Anderson(depth=7)  # another set is another fixed-point problem
            excess = image
            status = np.where(proposal.status == OPEN, OPEN, STICK)
        else:
            excess = mixing.next(excess.ravel(), image.ravel()).reshape(excess.shape)
        current = replace(proposal, status=status)


NOTHING_HOLDS = "no equilibrium: nothing holds a rigid motion"
JAMMED = (
    "points that stick contradict others that are closed, and friction bears whatever forces hold them "
    "together: these grow without end"
)


@with_known_keywords(
    max_candidates="write max_dense_bytes, the memory of the dense contact problem",
    loop="write ContactSolver(..., loop=...)",
    linear="write ContactSolver(..., linear=...)",
)
@dataclass(frozen=True)
class Options:
    """Settings of the nonlinear loop and of load stepping; the defaults need no tuning.

    `fast`, `balanced` (the defaults) and `accurate` are chosen from what was measured
    (docs/checks/trade.md).

    Attributes
    ----------
    tolerance : float
        Largest violation of the friction law that is accepted, over the largest contact force.
    max_iterations : int or None
        Per attempt of a load step; by default 80 for `newton`, 150 for `direct` and 2000 for
        `fictitious`, whose convergence is linear.
    max_cuts : int
        How often in a row a load step that fails may be cut: halved, with finite sliding, wear or
        iterated forces, or to the share that `max_travel` tells, which does not count towards the
        smallest share ``0.5**max_cuts``. With 0 its load is not pulled through a spring either.
    max_dense_bytes : int
        Memory up to which ``linear="auto"``, or ``PETSc("direct")``, forms the dense contact problem
        [bytes]; ``print(solver)`` says how much it will take.
    max_factor_bytes : int
        Memory up to which ``linear="auto"`` factorises the bodies [bytes]; beyond it takes multigrid,
        as ``linear=AMG()`` does.
    placement_tolerance : float
        With ``sliding="finite"``: how far the pairing of a load step may be from that of its own
        answer: gaps of closed points over the extent of the bodies, and change of the contact
        forces' distribution over the largest of them. Where rounds run out, `tolerance` will do: the
        forces are known no better.
    max_placements : int
        How often a load step may be paired anew before it is cut.
    max_travel : float
        With ``sliding="finite"``: how far a closed point may slide in one step, in facet lengths of
        its own surface (their mean, also where they differ); steps that exceed it are cut to the
        share that the distance tells, and substeps grow and shrink with it. ``inf`` for steps as
        given, as they are on a `RigidPlane`, which is the same all along the way.

    Examples
    --------
    >>> Options(tolerance=1e-8).max_cuts
    6
    """

    tolerance: float = 1e-10
    max_iterations: int | None = None
    max_cuts: int = 6
    max_dense_bytes: int = 3_000_000_000
    max_factor_bytes: int = 6_000_000_000
    placement_tolerance: float = 1e-4
    max_placements: int = 20
    max_travel: float = 1.0

    @classmethod
    def fast(cls) -> Options:
        """Return options for fast finite sliding: pairings are iterated to 1e-3 of the largest force.

        It saves time where ``sliding="finite"`` pairs anew, above all with mortar; the times and errors
        are in docs/checks/trade.md and docs/checks/performance.md. The pairing of small sliding is
        given, and `newton` ends with round-off: nothing changes there. ``tolerance=1e-4`` is for the
        loops `direct` and `fictitious`.
        """
        return cls(tolerance=1e-4, placement_tolerance=1e-3)

    @classmethod
    def balanced(cls) -> Options:
        """The defaults: ``Options.balanced() == Options()``.

        With them the errors are those of the meshes; docs/checks/trade.md shows it.
        """
        return cls()

    @classmethod
    def accurate(cls) -> Options:
        """Return options for accurate finite sliding, to compare answers: pairings to 1e-8.

        Errors stay those of the mesh, forces move in the sixth digit, at up to twice the time
        (docs/checks/trade.md, docs/checks/performance.md). Nothing changes with small sliding, see
        `fast`.
        """
        return cls(placement_tolerance=1e-8)

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if name == "max_iterations" and value is None:
                continue
            whole = name.startswith("max_") and name != "max_travel"
            usage = f"give a {'whole number' if whole else 'number'} >= 0"
            found = number(value, f"Options: {name}", usage)
            endless = whole and (found == np.inf or found != np.floor(found))
            if not found >= 0 or endless or isinstance(value, bool | np.bool_):
                raise InputError(f"Options: {name} = {value!r} is out of range; {usage}.")


@dataclass(eq=False)
class Outcome:
    """The end of a loop: its last iterate, the log, and the reason in words.

    `note` is what the log does not show of its start, in words.
    """

    iterate: Iterate
    trace: tuple[Record, ...]
    converged: bool
    message: str
    free: np.ndarray | None = None
    stopped: bool = False
    note: str = ""


def converged_words(count: int) -> str:
    """
    >>> converged_words(1), converged_words(2)
    ('converged in 1 iteration', 'converged in 2 iterations')
    """
    return f"converged in {count} iteration{'' if count == 1 else 's'}"


def drive(
    loop: Callable[[Step, Guess, float], Iterator[Iterate]],
    step: Step,
    guess: Guess,
    tolerance: float,
    limit: int,
    callback: Callable[[Record], object] | None = None,
    patience: int | None = None,
) -> Outcome:
    """Run a loop until it converges, stalls, finds no equilibrium, or exceeds its count.

    A `StopIteration` raised by `callback` ends the run where it stands, as in SciPy. With `patience`
    it ends after so many iterations in which neither fewer points changed than ever before nor the
    law came twice as close to being satisfied, nor the loop says that it came nearer.

    Raises
    ------
    SingularMatrix
        In the first iteration; later it ends the run.
    """
    trace: list[Record] = []
    unheld: set[bytes] = set()
    suspect: np.ndarray | None = None
    progress = Stagnation()
    message = f"no convergence in {limit} iterations"
    iterates = loop(step, guess, tolerance)
    while True:
        try:
            iterate = next(iterates)
        except SingularMatrix:
            if not trace:
                raise
            message = "points that hold a body too weakly were left closed"
            break
        record = _record(len(trace) + 1, step, iterate)
        trace.append(record)
        logger.debug("%s", record)
        if not (math.isfinite(iterate.residual) and np.isfinite(iterate.response.solution).all()):
            message = "the linear solve returned numbers that are not finite"
            break
        if iterate.converged:
            return Outcome(iterate, tuple(trace), True, converged_words(len(trace)))
        if iterate.jammed:
            return Outcome(iterate, tuple(trace), False, JAMMED)
        if iterate.held is not None:
            key = iterate.status.tobytes()
            if key in unheld:
                # the same set needs the same help again: nothing else holds the body. While the
                # limits of the loop `direct` still move this is a suspicion only
                suspect = iterate.held
                if iterate.residual <= tolerance:
                    return Outcome(iterate, tuple(trace), False, NOTHING_HOLDS, suspect)
            unheld.add(key)
        if callback is not None:
            try:
                callback(record)
            except StopIteration:
                last = "stopped by the callback"
                return Outcome(iterate, tuple(trace), False, last, stopped=True)
        if len(trace) >= limit:
            break
        if patience is not None and progress.stalled(record, patience, iterate.nearer):
            if iterate.residual <= NO_VIOLATION:  # less was asked for than round-off leaves at a tie
                return Outcome(iterate, tuple(trace), True, converged_words(len(trace)))
            message = f"no progress in {patience} iterations"
            break
    law = "friction law" if step.friction.laws else "law of contact"
    last = f"{record.changes} points still change and the {law} is violated by "
    last += f"{record.residual:.1e} of the largest force"
    return Outcome(iterate, tuple(trace), False, f"{message}; {last}", suspect)


@dataclass
class Stagnation:
    """The best a run has come to, and how long ago."""

    changes: int = np.iinfo(int).max
    residual: float = np.inf
    waited: int = 0

    def stalled(self, record: Record, patience: int, nearer: bool = False) -> bool:
        """Return whether the last improvement is too long ago; `nearer` as of an iterate."""
        self.waited = 0 if nearer else self.waited + 1
        if record.changes < self.changes or record.residual < 0.5 * self.residual:
            self.changes = min(self.changes, record.changes)
            self.residual = min(self.residual, record.residual)
            self.waited = 0
        return self.waited >= patience


def _record(number: int, step: Step, iterate: Iterate) -> Record:
    paired = iterate.status if step.all_paired else iterate.status[step.paired]
    opened, stick, slip = np.bincount(paired, minlength=3).tolist()
    last = iterate.changes, iterate.residual, iterate.note
    return Record(number, opened, stick, slip, *last)


@dataclass(frozen=True)
class Loop:
    """A loop and its limits.

    Attributes
    ----------
    iterates : callable
        ``iterates(step, guess, tolerance)``, the generator.
    most : int
        Iterations that an attempt may take where `Options` do not say.
    patience : int or None
        Iterations without progress after which an attempt is given up.
    """

    iterates: Callable[[Step, Guess, float], Iterator[Iterate]]
    most: int
    patience: int | None


LOOPS = {
    "newton": Loop(newton, NEWTON_ITERATIONS, 30),
    "direct": Loop(direct, 150, 30),
    # its convergence is linear: it creeps, but to halve the violation so rarely leads nowhere
    "fictitious": Loop(fictitious, 2000, 300),
}
