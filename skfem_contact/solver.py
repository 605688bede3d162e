"""`ContactSolver`: sets the problem up once, then solves load steps and histories."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skfem_contact import loops
from skfem_contact.body import Body, stack
from skfem_contact.condensation import Condensed, LoadCase, Substructure
from skfem_contact.contact import Contact
from skfem_contact.driver import Options, Outcome, drive
from skfem_contact.errors import InputError, NoEquilibrium, NotConverged
from skfem_contact.friction import FrictionLaw
from skfem_contact.kinematics import (
    compliance_scale,
    join,
    kinematics,
    pair,
    point_labels,
    secondary_dofs,
)
from skfem_contact.linear import single_threaded
from skfem_contact.nested import nested_guess
from skfem_contact.loops import OPEN, SLIP, STICK, Guess, State, Step
from skfem_contact.result import ContactResult, Record
from skfem_contact.rigid import rigid_motions
from skfem_contact.sparse_route import FullSystem
from skfem_contact.steps import Settings, StepReader
from skfem_contact.surface import ContactSurface

Array = NDArray[np.float64]
logger = logging.getLogger("skfem_contact")

LOOPS = {"newton": loops.newton, "direct": loops.direct, "fictitious": loops.fictitious}
ITERATIONS = {"newton": 80, "direct": 150, "fictitious": 2000}
# The tangential stiffness that a loop takes where the law gives none, over K's diagonal at the
# point: exact sticking; an error of 1e-3 in the slip of sticking points; one that still converges.
STIFFNESS = {"newton": np.inf, "direct": 1e3, "fictitious": 1.0}


class ContactSolver:
    """Contact and friction between linear elastic bodies, reusable over many loads.

    Parameters
    ----------
    bodies : sequence of Body
    contacts : sequence of Contact
    loop : {"newton", "direct", "fictitious"}
        How friction is iterated; all reach the same solution.
    linear : "auto", "condensed", a backend such as `Direct()` or `AMG()`, or a solver callable
        Where the linear problems are solved. "condensed" eliminates everything but the contact
        points once; a backend solves ``T'KT`` with all DOFs in every iteration. A callable is
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

    >>> import skfem as fem
    >>> import skfem_contact as sc
    >>> from skfem.models.elasticity import linear_elasticity
    >>> basis = fem.Basis(fem.MeshQuad().refined(2).with_defaults(),
    ...                   fem.ElementVector(fem.ElementQuad1()))
    >>> down = basis.project(lambda x: [0 * x[0], -0.01 + 0 * x[0]])
    >>> block = sc.Body(basis, linear_elasticity(0.0, 0.5), D="top", x=down, name="block")
    >>> floor = sc.RigidPlane((0, 0), (0, 1))
    >>> solver = sc.ContactSolver([block], [sc.Contact(block.surface("bottom"), floor)])
    >>> result = solver.solve()
    >>> bool(abs(result.pressure - 0.01).max() < 1e-14)
    True
    """

    def __init__(
        self,
        bodies: Sequence[Body] | Body,
        contacts: Sequence[Contact] | Contact,
        *,
        loop: str = "newton",
        linear: Any = "auto",
        options: Options | None = None,
    ) -> None:
        start = time.perf_counter()
        if loop not in LOOPS:
            raise InputError(f"loop = {loop!r} is not one of {tuple(LOOPS)}.")
        self.options = options or Options()
        self.loop, self.linear = loop, linear
        self.system = stack([bodies] if isinstance(bodies, Body) else list(bodies))
        self.contacts = tuple([contacts] if isinstance(contacts, Contact) else contacts)
        self.names = _contact_names(self.contacts)
        self._stiffness = [body.K for body in self.system.bodies]
        self._check()
        self.pairings = [pair(contact) for contact in self.contacts]
        self._kins = [
            kinematics(self.system, contact, pairing)
            for contact, pairing in zip(self.contacts, self.pairings, strict=True)
        ]
        self.kin = join(self._kins)
        self._own_f = np.array(self.system.f)
        self._reader = StepReader(self.system, self.contacts, self.names, self.kin, self._own_f)
        self._setup_friction()
        self.motions = rigid_motions(self.system, self.kin, self._stiffness)
        self.timings = {"setup": time.perf_counter() - start}
        self._model: Condensed | FullSystem | None = None
        self._parts: list[Substructure | None] = []

    # -- setting up ---------------------------------------------------------------------------

    def _check(self) -> None:
        for contact in self.contacts:
            sides = [contact.secondary]
            if isinstance(contact.primary, ContactSurface):
                sides.append(contact.primary)
            for surface in sides:
                self.system.index(surface.body)

    def _setup_friction(self) -> None:
        self._laws: list[tuple[slice, FrictionLaw]] = []
        m = self.kin.m
        self._frictional = np.zeros(m, dtype=bool)
        self._G = np.full(m, np.inf)
        diagonal = np.concatenate([K.diagonal() for K in self._stiffness])
        own = compliance_scale(self.kin.B_t, diagonal).reshape(m, -1).min(axis=1, initial=np.inf)
        for contact, part in zip(self.contacts, self._reader.parts, strict=True):
            law = contact.friction
            if law is None:
                continue
            self._laws.append((part, law))
            self._frictional[part] = self.kin.paired[part]
            default = STIFFNESS[self.loop] * np.where(own[part] > 0, own[part], 1.0)
            self._G[part] = default if law.stiffness is None else law.stiffness
            if self.loop == "fictitious" and np.isinf(self._G[part]).any():
                raise InputError(
                    f"contact '{contact.label}': the loop 'fictitious' needs a finite tangential "
                    f"stiffness, but the law has stiffness={law.stiffness}. Leave stiffness out "
                    "for the automatic one, or use loop='newton' for exact sticking."
                )
        self._slipping = self._frictional | (self.kin.tied & self.kin.paired)

    @property
    def model(self) -> Condensed | FullSystem:
        """The linear side of the problem: what depends on the stiffness alone."""
        if self._model is None:
            self._check_support()
            start = time.perf_counter()
            with single_threaded():
                self._model = self._build()
            self.timings["condensation"] = time.perf_counter() - start
        return self._model

    def _build(self) -> Condensed | FullSystem:
        labels = np.concatenate(
            [point_labels(c, k.m) for c, k in zip(self.contacts, self._kins, strict=True)]
        )
        prefer = secondary_dofs(self.system, self.contacts)
        active = self.kin.paired
        if self._condensed():
            model = Condensed(
                self.system,
                self._stiffness,
                self.kin,
                active,
                self._slipping,
                prefer,
                labels,
                reuse=self._parts,
            )
            self._parts = list(model.parts)
            return model
        return FullSystem(
            self.system, self._stiffness, self.kin, self._slipping, prefer, labels, self.linear
        )

    def _condensed(self) -> bool:
        if isinstance(self.linear, str):
            if self.linear not in ("auto", "condensed"):
                raise InputError(
                    f"linear = {self.linear!r} is neither 'auto' nor 'condensed'; a backend is "
                    "given as an object, Direct() or AMG(), or as a callable solver(A, b)."
                )
            few = len(np.unique(self.kin.B_n.indices)) * 2 <= self.options.max_candidates
            return self.linear == "condensed" or few
        return False

    def _check_support(self) -> None:
        free = self.motions.free(self.kin.paired, self._slipping)
        if free.shape[1]:
            raise self._no_equilibrium(free, "even with every contact point closed")

    def _no_equilibrium(self, free: Array, when: str) -> NoEquilibrium:
        bodies, motion = self.motions.describe(free[:, 0])
        names = " and ".join(f"'{name}'" for name in bodies)
        verb = "is" if len(bodies) == 1 else "are together"
        return NoEquilibrium(
            f"Body {names} {verb} free to move: {motion}, {when}. Usually a support is missing, "
            "the load pulls the bodies apart, or friction is too weak for the load. Prescribe a "
            "DOF (D=...), press the bodies together first, add friction, or hold the body with "
            "weak springs in K.",
            bodies,
            motion,
        )

    def __str__(self) -> str:
        from skfem_contact.report import dry_run  # the report is about solvers, and stands after them

        return dry_run(self)

    # -- solving ------------------------------------------------------------------------------

    def solve(
        self,
        f: Any = None,
        x: Any = None,
        *,
        start: ContactResult | None = None,
        guess: ContactResult | None = None,
        callback: Callable[[Record], object] | None = None,
        throw: bool = True,
    ) -> ContactResult:
        """Solve one load step.

        Parameters
        ----------
        f, x : dict by body name, or ndarray (n,), optional
            Load [force] and prescribed displacements [length]; by default the bodies' own.
        start : ContactResult, optional
            The state to continue from; friction remembers it. It may come from another solver over
            the same bodies and contacts.
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
        own = self._reader.initial()
        settings = replace(
            own,
            f=self._reader.vector("f", f, own.f, self._own_f),
            x=self._reader.vector("x", x, own.x, self.system.x),
            factor=own.factor if f is None and x is None else None,
        )
        return self._step(settings, start, guess, callback, throw)

    def history(
        self,
        steps: Iterable[Any],
        *,
        start: ContactResult | None = None,
        progress: bool = False,
    ) -> Iterator[ContactResult]:
        """Solve load steps one after the other, each from the state of the one before.

        Parameters
        ----------
        steps : iterable
            A number is the factor on all bodies' own f and x. A dict replaces just what it names:
            ``f`` and ``x`` (dict by body name; an array, or a number as a factor on the body's
            own), ``interference`` (by contact name), ``motion`` (by obstacle name: total translation
            (d,), or (translation, angle, centre)). What a step does not name stays as it was.
        start : ContactResult, optional
            The state to continue from.
        progress : bool
            Show a progress bar; needs tqdm (the extra ``progress``).

        Yields
        ------
        ContactResult
            One per step. A step that does not converge is cut and recovered; the substeps are not
            yielded, their dissipation is summed.
        """
        settings = self._reader.initial()
        before = start
        for step in _with_progress(steps, progress):
            settings = self._reader.read(step, settings)
            before = self._step(settings, before, before, None, True)
            logger.info("step %s: %s", step if np.ndim(step) == 0 else "", before.message)
            yield before

    def _step(
        self,
        settings: Settings,
        start: ContactResult | None,
        guess: ContactResult | None,
        callback: Callable[[Record], object] | None,
        throw: bool,
    ) -> ContactResult:
        """Advance to the target load, cutting the way there into parts where it fails."""
        begin = time.perf_counter()
        target = self._reader.case(settings)
        state = start.state if start is not None else self._natural()
        case = start.case if start is not None else self._reader.unloaded()
        warm = guess or start
        current = self._guess(warm.state) if warm is not None else None
        total = np.zeros(len(self.contacts))
        done, share, trace = 0.0, 1.0, []
        while True:
            aim = min(1.0, done + share)
            here = case.towards(target, aim)
            outcome, load = self._attempt(state, here, current, callback)
            trace.extend(outcome.trace)
            if not outcome.converged:
                if share <= 0.5**self.options.max_cuts or "callback" in outcome.message:
                    return self._failed(
                        outcome, state, here, load, start, total, trace, settings, begin, throw
                    )
                if current is not None:  # before cutting: forget where it started from
                    current = None
                    continue
                share *= 0.5
                logger.info("step cut to %.4g of its size: %s", share, outcome.message)
                current = self._guess(state)
                continue
            new = self._state(outcome, state)
            total = total + self._dissipation(state, new)
            state, done = new, aim
            if done >= 1.0:
                return self._result(
                    outcome, state, here, load, start, total, trace, settings, begin
                )
            current = self._guess(state)
            share = min(2 * share, 1.0 - done)

    def _attempt(
        self,
        state: State,
        case: LoadCase,
        guess: Guess | None,
        callback: Callable[[Record], object] | None,
    ) -> tuple[Outcome, Any]:
        model = self.model
        with single_threaded():
            load = model.load(case)
            step = Step(
                space=model.space,
                load=load,
                motions=self.motions,
                area=self.kin.area,
                paired=self.kin.paired,
                tied=self.kin.tied & self.kin.paired,
                laws=tuple(self._laws),
                frictional=self._frictional,
                stiffness=self._G,
                last=state,
            )
            limit = self.options.max_iterations or ITERATIONS[self.loop]
            run, tolerance = LOOPS[self.loop], self.options.tolerance
            if guess is None:
                guess = self._cold(step, case)
            return drive(run, step, guess, tolerance, limit, callback), load

    def update(self, body: Body | str, *, K: Any = None, f: Any = None) -> None:
        """Replace the stiffness or the load of one body; only that body is condensed again.

        The way in for bodies whose stiffness changes: a Newton loop of the user's own around this
        solver, with the tangent stiffness and ``f = f_ext - f_int(u) + K u`` of each iterate.

        Parameters
        ----------
        body : Body or str
        K : sparse matrix (n_body, n_body) or BilinearForm, optional
            [force/length]
        f : ndarray (n_body,) or LinearForm, optional
            The body's own load from now on [force].

        Raises
        ------
        InputError
            As for `Body`: wrong shapes, NaN.
        """
        i = self.system.index(body)
        old = self.system.bodies[i]
        part = self.system.slice(old)
        checked = Body(
            old.basis,
            self._stiffness[i] if K is None else K,
            self._own_f[part] if f is None else f,
            old.D,
            measure=old.measure,
            name=old.name,
        )
        self._own_f[part] = checked.f
        if K is None:
            return
        self._stiffness[i] = checked.K
        self._setup_friction()
        self.motions = rigid_motions(self.system, self.kin, self._stiffness)
        if self._parts:
            self._parts[i] = None
        self._model = None

    def recover(self, results: Iterable[ContactResult]) -> list[Array]:
        """Displacements of all bodies for many results of this solver in one go.

        Each result then has its ``u`` without further work; one solve with many right-hand sides
        is several times cheaper than as many solves.

        Returns
        -------
        list of ndarray, shape (n,)
        """
        results = list(results)
        missing = [r for r in results if "u" not in r.__dict__ and r.recover.model is self._model]
        if missing:
            with single_threaded():
                u = self.model.recover(
                    [r.recover.load for r in missing],
                    [r.case for r in missing],
                    np.column_stack([r.recover.solution for r in missing]),
                )
            for result, column in zip(missing, u.T, strict=True):
                result.__dict__["u"] = np.array(column)
        return [r.u for r in results]

    # -- states and results ---------------------------------------------------------------------

    def _natural(self) -> State:
        m, t = self.kin.m, self.kin.tangents
        zero = np.zeros((m, t))
        return State(np.zeros(m, dtype=int), zero, zero, np.zeros(m), zero)

    def _cold(self, step: Step, case: LoadCase) -> Guess:
        """Nothing known: points that touch are closed and stick; where few do, a nested start."""
        m, t = self.kin.m, self.kin.tangents
        touching = self.kin.paired & (case.gap0 <= 0)
        status = np.where(touching | step.tied, STICK, OPEN)
        zero = np.zeros((m, t))
        guess = Guess(status, zero, np.zeros(m), zero, zero)
        if touching.sum() > 0.5 * self.kin.paired.sum():
            return guess
        # the coarse levels only look for the zone: exact sticking, whatever the loop
        exact = replace(step, stiffness=np.full(m, np.inf))
        return nested_guess(exact, guess, loops.newton, self.kin.points, self.options.tolerance)

    def _guess(self, state: State) -> Guess:
        size = np.linalg.norm(state.tangential_force, axis=1)
        slips = (state.status == SLIP) & (size > 0)
        status = np.where((state.status == SLIP) & ~slips, STICK, state.status)
        unit = state.tangential_force / np.where(slips, size, 1.0)[:, None]
        direction = np.where(slips[:, None], unit, 0.0)
        return Guess(status, direction, state.normal_force, state.tangential_force, state.slip)

    def _state(self, outcome: Outcome, last: State) -> State:
        it = outcome.iterate
        opened = it.status == OPEN
        response = it.response
        reference = np.where(opened[:, None], response.slip, last.reference)
        return State(
            it.status,
            response.slip,
            np.where(opened[:, None], 0.0, response.tangential_force),
            np.where(opened, 0.0, response.normal_force),
            reference,
        )

    def _dissipation(self, last: State, new: State) -> Array:
        """Trapezoidal work of friction on the plastic slip, per contact [energy].

        The rule that closes the energy balance of a step whose external work is trapezoidal too.
        """
        change = new.slip - last.slip
        elastic = np.where(
            np.isfinite(self._G)[:, None],
            (new.tangential_force - last.tangential_force) / self._G[:, None],
            0.0,
        )
        mean = 0.5 * (last.tangential_force + new.tangential_force)
        work = np.sum(mean * (change - elastic), axis=1)
        work = np.where(self._frictional & (new.status != OPEN), work, 0.0)
        return np.array([work[part].sum() for part in self._reader.parts])

    def _result(
        self,
        outcome: Outcome,
        state: State,
        case: LoadCase,
        load: Any,
        start: ContactResult | None,
        total: Array,
        trace: list[Record],
        settings: Settings,
        begin: float,
    ) -> ContactResult:
        before = np.zeros(len(self.contacts))
        if start is not None:
            before = start.dissipation_before + start.dissipation_by_contact

        cuts = "" if len(trace) == len(outcome.trace) else ", with a cut step"
        return ContactResult(
            system=self.system,
            contacts=self.contacts,
            names=self.names,
            kin=self.kin,
            stiffness=tuple(self._stiffness),
            case=case,
            state=state,
            gap=outcome.iterate.response.gap,
            converged=outcome.converged,
            message=outcome.message + cuts,
            iterations=len(trace),
            trace=tuple(trace),
            timings={**self.timings, "loop": time.perf_counter() - begin},
            dissipation_by_contact=total,
            dissipation_before=before,
            recover=Recovery(self.model, load, case, outcome.iterate.response.solution),
            factor=settings.factor,
        )

    def _failed(
        self,
        outcome: Outcome,
        state: State,
        case: LoadCase,
        load: Any,
        start: ContactResult | None,
        total: Array,
        trace: list[Record],
        settings: Settings,
        begin: float,
        throw: bool,
    ) -> ContactResult:
        new = self._state(outcome, state)
        result = self._result(outcome, new, case, load, start, total, trace, settings, begin)
        if not throw:
            return result
        if outcome.free is not None:
            error = self._no_equilibrium(outcome.free, "with the forces that contact can carry")
            error.result = result
            raise error
        raise NotConverged(
            f"The loop '{self.loop}' did not converge: {result.message}. The step was cut "
            f"{self.options.max_cuts} times. Usually the load has no equilibrium or several (a large "
            "coefficient of friction), or the step is too large for its path. Try smaller load "
            "steps in history(...), another loop, or a smaller mu; the last state is in "
            "`.result` of this exception.",
            result,
        )


@dataclass(frozen=True, eq=False)
class Recovery:
    """What it takes to recover the displacements of all bodies for one result, when asked for."""

    model: Condensed | FullSystem
    load: Any
    case: LoadCase
    solution: Array

    def __call__(self) -> Array:
        with single_threaded():
            return self.model.recover([self.load], [self.case], self.solution[:, None])[:, 0]


def _contact_names(contacts: tuple[Contact, ...]) -> tuple[str, ...]:
    names = tuple(c.name or f"contact {i + 1}" for i, c in enumerate(contacts))
    for name in names:
        if names.count(name) > 1:
            raise InputError(f"two contacts are called {name!r}: give each its own name=...")
    return names


def _with_progress(steps: Iterable[Any], progress: bool) -> Iterable[Any]:
    if not progress:
        return steps
    try:
        from tqdm.auto import tqdm
    except ImportError:
        raise InputError(
            "progress=True needs tqdm, which is not installed: pip install 'skfem-contact[progress]'"
        ) from None
    return tqdm(steps, unit="step")  # type: ignore[no-any-return]


