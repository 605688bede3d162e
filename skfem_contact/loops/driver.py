"""The loops by name, and their driver: it counts, logs, stops and says why."""

from __future__ import annotations

import logging
import math
from collections.abc import Callable, Iterator

import numpy as np

from skfem_contact.arguments import number, with_known_keywords
from skfem_contact.errors import InputError, SingularMatrix
from skfem_contact.loops.active_set import direct, fictitious, newton
from skfem_contact.loops.step import Guess, Iterate, Record, Step
from skfem_contact.records import dataclass

# Iterations that Newton may take where another loop begins from its answer.
NEWTON_ITERATIONS = 80

logger = logging.getLogger("skfem_contact")

NOTHING_HOLDS = "no equilibrium: nothing holds a rigid motion"
JAMMED = (
    "points that stick contradict others that are closed, and friction bears whatever forces hold them "
    "together: these grow without end"
)


@with_known_keywords(max_candidates="write max_dense_bytes, the memory of the dense contact problem")
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
        given.

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
            message = f"no progress in {patience} iterations"
            break
    last = f"{record.changes} points still change and the friction law is violated by "
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
