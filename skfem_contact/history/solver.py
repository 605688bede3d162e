"""`ContactSolver`: sets the problem up once, then solves load steps and histories."""

from __future__ import annotations

import logging
import weakref
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import field, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from skfem_contact.answers.answer import Answer, answer_of
from skfem_contact.answers.result import ContactResult
from skfem_contact.answers.values import status_words
from skfem_contact.arguments import (
    check_switch,
    known_keywords,
    members,
    shown,
    with_known_keywords,
)
from skfem_contact.bodies.member import Member
from skfem_contact.carried import copied
from skfem_contact.conditions.contact import Contact
from skfem_contact.conditions.loads import LoadCase
from skfem_contact.errors import InputError
from skfem_contact.history.load_step import recover_all
from skfem_contact.history.problem_setup import Variants
from skfem_contact.history.read import StepReader
from skfem_contact.loops.driver import Options
from skfem_contact.loops.step import Record
from skfem_contact.records import dataclass

if TYPE_CHECKING:
    from skfem_contact.history.checkpoint import SavedState

Array = NDArray[np.float64]
logger = logging.getLogger("skfem_contact")


# What to write for keywords that belong elsewhere.
NAMES = [f.name for f in fields(Options)]
IN_OPTIONS = {name: f"it belongs to options=Options({name}=...)" for name in NAMES}
IN_OPTIONS["tol"] = "it belongs to options=Options(tolerance=...)"
IN_STEPS = dict.fromkeys(("f", "x", "start", "guess", "callback"), "it belongs to solver.solve(...)")
OF_SOLVER = {name: f"{words} of ContactSolver(...)" for name, words in IN_OPTIONS.items()}
OF_SOLVER |= dict.fromkeys(("loop", "linear", "options"), "it belongs to ContactSolver(...)")
OF_SOLVER |= dict.fromkeys(("mu", "friction"), "write solver.with_friction(Coulomb(mu))")
OF_STEP = {
    name: f"it belongs to a step, solver.history([{{{name!r}: ...}}])"
    for name in ("interference", "motion")
}


@with_known_keywords(
    mu="it belongs to Contact(..., friction=Coulomb(mu))",
    friction="it belongs to Contact(..., friction=Coulomb(mu))",
    **IN_OPTIONS,
    **IN_STEPS,
)
class ContactSolver(Variants):
    """Contact and friction between linear elastic bodies, reusable over many loads.

    Parameters
    ----------
    bodies : sequence of Body and RigidBody
    contacts : sequence of Contact
    loop : {"newton", "direct", "fictitious"}
        How friction is iterated; all reach the same solution.
    linear : "auto", "condensed", "iterated", a backend such as `AMG()`, or a solver callable
        Where the linear problems are solved. "condensed" eliminates everything but the contact
        points once; "iterated", for more points than dense matrices have room for, finds their forces
        by GMRES, with products through the factors of the bodies; `AMG()`, for bodies too large to be
        factorised, finds displacements and forces together; `PETSc("direct")` condenses, or iterates,
        over MPI ranks. Another backend solves ``T'KT`` with all DOFs in every iteration. A callable is
        anything that scikit-fem takes as ``solver(A, b)``.
    options : Options

    Raises
    ------
    InputError
        If bodies, contacts or settings do not fit together.
    NoEquilibrium
        If a body could move freely even with every point closed.

    Examples
    --------
    A square pressed onto a rigid plane by 1 % of its height:

    >>> import numpy as np
    >>> import skfem as fem
    >>> import skfem_contact as sc
    >>> from skfem.models.elasticity import linear_elasticity
    >>> basis = fem.Basis(
    ...     fem.MeshQuad().refined(2).with_defaults(), fem.ElementVector(fem.ElementQuad1())
    ... )
    >>> down = basis.project(lambda x: np.stack([0 * x[0], -0.01 + 0 * x[0]]))
    >>> block = sc.Body(basis, linear_elasticity(0.0, 0.5), D="top", x=down, name="block")
    >>> floor = sc.RigidPlane((0, 0), (0, 1))
    >>> solver = sc.ContactSolver([block], [sc.Contact(block.surface("bottom"), floor)])
    >>> result = solver.solve()
    >>> bool(abs(result.pressure - 0.01).max() < 1e-14)
    True

    Several threads may use one solver: each solves its own load steps and histories, the bodies are
    factorised once, and answers are those of one thread to round-off.

    >>> from concurrent.futures import ThreadPoolExecutor
    >>> with ThreadPoolExecutor(2) as pool:
    ...     results = list(pool.map(lambda share: solver.solve(x=share * down), (0.5, 1.0, 2.0)))
    >>> [f"{result.force[1]:.4f}" for result in results]
    ['0.0050', '0.0100', '0.0200']
    """

    def __init__(
        self,
        bodies: Sequence[Member] | Member,
        contacts: Sequence[Contact] | Contact,
        *,
        loop: str = "newton",
        linear: Any = "auto",
        options: Options | None = None,
    ) -> None:
        super().__init__(bodies, contacts, loop, linear, options)

    @known_keywords(**OF_SOLVER, **OF_STEP)
    def solve(
        self,
        f: ArrayLike | Mapping[str, Any] | None = None,
        x: ArrayLike | Mapping[str, Any] | None = None,
        *,
        start: ContactResult | SavedState | None = None,
        guess: ContactResult | SavedState | None = None,
        callback: Callable[[Record], object] | None = None,
        throw: bool = True,
    ) -> ContactResult:
        """Solve one load step.

        Parameters
        ----------
        f, x : dict by body name, or ndarray (n,), optional
            Load [force] and prescribed displacements [length], as in the steps of `history`; what is
            not named is the bodies' own, or with `start` what it is in that state.
        start : ContactResult, optional
            The state to continue from, or one from `load_state`: friction remembers it, and what is
            not named stays as it is there; loads that are a multiple of the bodies' own, that multiple
            of what they are in this solver. It may come from another one over the same meshes and
            contacts. Supports that it had not hold the bodies where they find them if steps have named
            displacements; else they go to the bodies' own `x`, zero where there is none.
        guess : ContactResult, optional
            Starting values only.
        callback : callable, optional
            Called with a `Record` after every iteration; raising StopIteration ends the loop.
        throw : bool
            Whether to raise when there is no convergence, or to return the last state.

        Raises
        ------
        NotConverged, NoEquilibrium
            Carrying the last result.
        """
        before = self._answering.known(start, "start")
        known = self._answering.known(guess, "guess")
        target = self._begin(before)
        named = {what: given for what, given in (("f", f), ("x", x)) if given is not None}
        if named:
            target = self._reader.read(named, target)
        return ContactResult(self._answering.solve(target, before, known, callback, throw))

    @known_keywords(
        **OF_SOLVER,
        **OF_STEP,
        **dict.fromkeys(("f", "x"), "it belongs to the steps, [{'f': ..., 'x': ...}]"),
        **dict.fromkeys(("guess", "callback", "throw"), "it belongs to solver.solve(...)"),
    )
    def history(
        self,
        steps: Iterable[Any],
        *,
        start: ContactResult | SavedState | None = None,
        progress: bool = False,
    ) -> Iterator[ContactResult]:
        """Solve load steps one after the other, each from the state of the one before.

        Parameters
        ----------
        steps : iterable
            A number is the factor on all bodies' own f and x. A dict replaces just what it names:
            ``f`` and ``x`` (dict by body name; an array, a number as a factor on the body's own, or
            a dict by boundary name, see below), ``interference`` (by contact name), ``motion`` (by
            obstacle name: total translation (d,), or (translation, angle, centre)). What a step does
            not name stays as it was.
        start : ContactResult, optional
            The state to continue from, or one from `load_state`, as in `solve`.
        progress : bool
            Show a bar with the load factor, the iterations of the last step, and the time left, by the
            mean of the steps before. The condensation of the bodies comes first and is not counted.
            Needs tqdm (the extra ``progress``).

        Yields
        ------
        ContactResult
            One per step. A step that does not converge is cut and recovered; the substeps are not
            yielded, their dissipation is summed. If a step fails for good, all results before it
            have been yielded, and are in ``results`` of the exception: the history can go on from
            the last of them. So they are if you interrupt it by Ctrl-C.

        Warns
        -----
        ContactWarning
            A body has turned by more than linear elasticity follows.

        Notes
        -----
        By boundary name, ``{"f": {"punch": {"top": (0.0, -5.0)}}}`` is a uniform traction [stress],
        what ``LinearForm(lambda v, w: -5.0 * v[1])`` is there, and all of the load of the body:
        other boundaries of the body carry none (loads of a `RigidBody` go by its DOFs, and those that
        are not named stay). ``{"x": {"punch": {"top": (0.0, -0.01)}}}`` is a
        constant displacement [length] of prescribed DOFs; those of other boundaries stay as they
        were. None stands for a component that is free there.
        """
        check_switch(progress, "history: progress")
        before = self._answering.known(start, "start")
        target = self._begin(before)
        single = isinstance(steps, str | bytes | Mapping) or getattr(steps, "shape", None) == ()
        if single or not isinstance(steps, Iterable):
            raise InputError(
                f"steps is {shown(steps)}, not a list of load steps; for a single one write [step]"
            )
        yielded, total = PartialResults(), count(steps)
        shown_as = Progress(steps, self.prepare) if progress else Silent()
        try:
            for i, step in enumerate(steps, start=1):
                logger.debug("step %d begins", i)
                target = self._reader.read(step, target)
                before = self._answering.solve(target, before, None, None, True)
                if logger.isEnabledFor(logging.INFO):
                    logger.info("%s", line(i, total, before))
                result = ContactResult(before)
                yielded.add(result, self._reader)
                shown_as.shows(before)
                yield result
        except (Exception, KeyboardInterrupt) as error:
            error.results = yielded.all()  # type: ignore[union-attr]
            if isinstance(error, KeyboardInterrupt) and hasattr(error, "add_note"):
                error.add_note(reached(len(error.results), total))  # type: ignore[attr-defined]
            raise
        finally:
            shown_as.close()

    @known_keywords()
    def save_state(self, path: str | Path, result: ContactResult | SavedState) -> Path:
        """Write the state of a result to an ``.npz`` file, for `load_state`.

        Everything that the next step depends on is kept, to the last bit: friction, the surfaces
        where contact slides far, loads, the energy lost so far, and all displacements: a body that
        nothing holds stays where it was left.

        Parameters
        ----------
        path : str or Path
            ``.npz`` is added where it is missing.
        result : ContactResult
            Of this solver, or of another one over the same bodies and contacts.

        Returns
        -------
        Path
            Of the file written.

        Raises
        ------
        InputError
            If the result is one of other bodies and contacts, there is no such folder, or the file
            can not be written.

        Warns
        -----
        ContactWarning
            The result did not converge: no history can go on from it.
        """
        known = self._answering.known(result, "result")
        if known is None:
            raise InputError("result is None; give what solve(...) returned")
        from skfem_contact.history.checkpoint import save_state

        return save_state(path, known)

    def _begin(self, start: Answer | SavedState | None) -> LoadCase:
        if start is None:
            return self._reader.initial()
        return self._reader.resumed(start.case, self._answering.left(start).x)

    @known_keywords()
    def load_state(self, path: str | Path) -> SavedState:
        """A state written by `save_state`, as the ``start`` of ``solve`` or ``history``.

        Parameters
        ----------
        path : str or Path

        Raises
        ------
        InputError
            If the file is none of `save_state`, or of other bodies and contacts.

        Examples
        --------
        A history writes a checkpoint per step, and another one goes on from it::

            for result in solver.history(steps):
                solver.save_state("last.npz", result)

            start = solver.load_state("last.npz")
            for result in solver.history(rest_of_the_steps, start=start):
                ...
        """
        from skfem_contact.history.checkpoint import load_state

        return load_state(path, self.geometry.identity)

    def recover(self, results: Iterable[ContactResult]) -> list[Array]:
        """Displacements of all bodies for many results of this solver in one go.

        Each result then has its ``u`` without further work; one solve with many right-hand sides
        is several times cheaper than as many solves.

        Returns
        -------
        list of ndarray, shape (n,)
        """
        results = members(results, ContactResult, "results", "give results of this solver")
        recover_all([answer_of(r) for r in results])
        return [r.u for r in results]


class Progress:
    """A bar of tqdm; the time that is left is that of the steps behind, in the mean.

    Parameters
    ----------
    steps : iterable
        With a length there is an estimate.
    prepare : callable
        What is done once, before the first step: it is no step, and not counted in the estimate.
    """

    def __init__(self, steps: Any, prepare: Callable[[], object]) -> None:
        try:
            from tqdm.auto import tqdm
        except ImportError:
            raise InputError(
                "progress=True needs tqdm, which is not installed: "
                "pip install 'skfem-contact[progress]'"
            ) from None
        total = count(steps)
        # smoothing=0: the mean of all steps, since the last is no better guess for the rest
        self.bar = tqdm(total=total, unit="step", smoothing=0, desc="condensing the bodies")
        try:
            prepare()
        except BaseException:
            self.bar.close()
            raise
        self.bar.set_description("load steps", refresh=False)
        self.bar.reset(total=total)

    def shows(self, answer: Answer) -> None:
        """One step more."""
        self.bar.set_postfix_str(words(answer), refresh=False)
        self.bar.update()

    def close(self) -> None:
        """The bar stays as it is."""
        self.bar.close()


class Silent:
    """In place of a bar."""

    def shows(self, answer: Answer) -> None:
        """Nothing."""

    def close(self) -> None:
        """Nothing."""


def count(steps: Any) -> int | None:
    """How many steps there are, where that is known."""
    try:
        return len(steps)
    except TypeError:  # a generator; or what is no list of steps, which is refused where it is read
        return None


def words(answer: Answer) -> str:
    """The load and how it was found."""
    load = "" if answer.factor is None else f"load factor {answer.factor:g}, "
    return f"{load}{answer.iterations} iteration{'s' if answer.iterations != 1 else ''}"


def line(number: int, total: int | None, answer: Answer) -> str:
    """A line of the log: which step, how it ended, and what every contact does."""
    of = "" if total is None else f" of {total}"
    load = "" if answer.factor is None else f", load factor {answer.factor:g}"
    contacts = (f"{values.name}: {status_words(values)}" for values in ContactResult(answer))
    return "; ".join([f"step {number}{of}{load}: {answer.message}", *contacts])


def reached(number: int, total: int | None) -> str:
    """For an exception that ends a history: how far it came, and where that is."""
    of = "" if total is None else f" of {total}"
    steps = "step was" if number == 1 else "steps were"
    return (
        f"{number}{of} load {steps} finished before: their results are in `.results` of this exception "
        "(sys.last_value.results in an interactive session)"
    )


NONE = np.zeros(0)


@dataclass(eq=False)
class PartialResults:
    """Results of one history, in their order."""

    _light: list[tuple[Answer, StepReader]] = field(default_factory=list)
    _alive: list[weakref.ref[ContactResult]] = field(default_factory=list)

    def add(self, result: ContactResult, reader: StepReader) -> None:
        """Keep a result; `reader` knows the loads that a number stands for."""
        answer = answer_of(result)
        light = copied(answer) if answer.factor is None else _with_loads(answer, NONE, NONE)
        self._light.append((light, reader))
        self._alive.append(weakref.ref(result))

    def all(self) -> tuple[ContactResult, ...]:
        """The results themselves where they are still held by somebody, and equal ones elsewhere."""
        found = []
        for (light, reader), alive in zip(self._light, self._alive, strict=True):
            result = alive()
            if result is None:
                if light.factor is not None:
                    loads = reader.read(light.factor, light.case)
                    light = _with_loads(light, loads.f, loads.x)
                result = ContactResult(light)
            found.append(result)
        return tuple(found)


def _with_loads(answer: Answer, f: Array, x: Array) -> Answer:
    """The same answer with other vectors of loads, and without what it remembers."""
    case = copied(answer.case, f=f, x=x)
    seen = case if answer.seen is answer.case else copied(answer.seen, f=f, x=x)
    return copied(answer, case=case, seen=seen, recover=copied(answer.recover, case=case))
