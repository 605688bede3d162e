"""`ContactSolver`: sets the problem up once, then solves load steps and histories.

`ProblemSetup` is what it is made of, whatever the loads; `Variants` what makes other solvers of it.
"""

from __future__ import annotations

import logging
import math
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from skfem_contact.answers.answer import Answer, answer_of
from skfem_contact.answers.result import ContactResult
from skfem_contact.arguments import (
    NamesAttributes,
    check_kind,
    check_switch,
    known_keywords,
    members,
    shown,
    with_known_keywords,
)
from skfem_contact.arrays import Array
from skfem_contact.assemblies.bolt import Bolt, Bolts, bolted
from skfem_contact.assemblies.joints import LoadCases
from skfem_contact.bodies.inputs import Loads
from skfem_contact.bodies.member import Member
from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.bodies.system import stack
from skfem_contact.conditions.checks import check_passes, warn_unfelt_wear
from skfem_contact.conditions.contact import Contact, number_of
from skfem_contact.conditions.friction import FrictionLaw
from skfem_contact.conditions.geometry import Geometry
from skfem_contact.conditions.interface import contact_names, interface
from skfem_contact.conditions.motions import rigid_motions
from skfem_contact.conditions.state import LoadCase
from skfem_contact.errors import InputError, LinearSolveError
from skfem_contact.history.load_step import recover_all
from skfem_contact.history.read import KEYS, PartialResults, StepReader
from skfem_contact.history.solve_step import StepSolver
from skfem_contact.history.stepper import Stepper
from skfem_contact.linalg.dense_factors import Limits
from skfem_contact.linalg.fronts import FactorSize
from skfem_contact.loops.driver import LOOPS, Options
from skfem_contact.loops.step import Record
from skfem_contact.obstacles.rigid_body import RigidBody
from skfem_contact.problem.model import LinearModel
from skfem_contact.problem.substructure import Substructure
from skfem_contact.records import Lock, carried, sealed

if TYPE_CHECKING:
    from skfem_contact.answers.tangent.derivatives import Asked, Gradient, Jacobian
    from skfem_contact.answers.tangent.modes import Damping, Modes
    from skfem_contact.history.checkpoint import SavedState
    from skfem_contact.history.equilibrium import Known
    from skfem_contact.problem.model import AnyBodies

S = TypeVar("S", bound="ProblemSetup")


class ProblemSetup(NamesAttributes):
    """Bodies, contacts, their pairing, and the linear problem that is put upon them.

    The parameters are those of `ContactSolver`, which is this with loads. What belongs to the pairing
    is made at once; what follows from the stiffness by `_set_stiffness`, and again for another one.
    Bodies are condensed when the first load step asks for them.

    Attributes
    ----------
    system : System
    contacts, names : tuple
    geometry : Geometry
        The pairing, which `kin` has as rows over the DOFs.
    interface : Interface
        Friction laws and glue at the points.
    linear_model : LinearModel
    """

    def __init__(
        self,
        bodies: Sequence[Member] | Member,
        contacts: Sequence[Contact] | Contact,
        loop: str,
        linear: Any,
        options: Options | None,
        bolts: Sequence[Bolt] | Bolt = (),
    ) -> None:
        start = time.perf_counter()
        if not isinstance(loop, str) or loop not in LOOPS:
            raise InputError(f"loop = {loop!r} is not one of {tuple(LOOPS)}.")
        if options is not None:
            check_kind(options, Options, "options", "give Options(tolerance=...) and the like")
        self.options = options or Options()
        self.loop, self.linear = loop, linear
        self.system, self._bolts, self._bolt_names = bolted(stack(bodies), bolts)
        usage = "make each by Contact(surface, other, ...)"
        self.contacts = tuple(members(contacts, Contact, "contacts", usage))
        self.names = contact_names(self.contacts)
        check_passes(self.contacts, self.names)
        warn_unfelt_wear(self.contacts, self.names)
        self._stiffness, self._own_f = self.system.linearize()
        own = {
            i: b.pressures if b.finite_strain else b.thermal for i, b in enumerate(self.system.bodies)
        }
        self._own_apart = {i: part for i, part in own.items() if part is not None}
        for surface in (s for c in self.contacts for s in (c.secondary, c.primary)):
            # refuses what is no body of this solver
            if isinstance(surface, ContactSurface | RigidBody):
                self.system.index(surface if isinstance(surface, RigidBody) else surface.body)
        self.geometry = Geometry(self.system, self.contacts)
        self.kin = self.geometry.kin
        self._reader, self._lock = self._new_reader(), Lock()
        self.timings = {"setup": 0.0}
        self._set_stiffness()
        self.timings["setup"] = time.perf_counter() - start

    def _set_stiffness(self, reuse: Sequence[Substructure | None] = ()) -> None:
        """Everything that follows from the stiffness and is cheap; condensation waits until needed."""
        self.interface = interface(self.contacts, self.kin, self._stiffness, self.loop)
        self.linear_model = LinearModel(
            self.geometry,
            self.interface,
            self._stiffness,
            rigid_motions(self.system, self.kin, self._stiffness),
            self.linear,
            Limits(self.options.max_dense_bytes, self.options.max_factor_bytes),
            self.timings,
            reuse,
        )
        self._tightened = Bolts(self._bolts, self._bolt_names, self.system, self._stiffness)
        self._answering = self._new_step_solver()

    def _copied(self: S) -> S:
        twin = object.__new__(type(self))
        vars(twin).update(vars(self))
        return twin

    def __getstate__(self) -> dict[str, Any]:
        return {**vars(self), "linear": carried(self.linear, "linear")}

    def _new_reader(self) -> StepReader:
        mine = self.system, self.contacts, self.names, self.geometry
        return StepReader(*mine, self._own_f, self._own_apart, self._bolt_names)

    def _new_step_solver(self) -> StepSolver:
        stepper = Stepper(self.linear_model, self.loop, self.options)
        return StepSolver(stepper, self._reader, self._tightened)

    @property
    def model(self) -> AnyBodies:
        """The linear problem of the bodies without contact; condensed when first asked for."""
        return self.linear_model.bodies

    def sizes(self) -> dict[str, FactorSize]:
        """What the factorisation of each body in contact will take, before anything is computed."""
        return self.linear_model.choice.sizes()

    def __repr__(self) -> str:
        bodies, contacts = ", ".join(self.system.names), ", ".join(self.names)
        return f"<ContactSolver: bodies {bodies}; contacts {contacts}; loop {self.loop!r}>"

    def __str__(self) -> str:
        from skfem_contact.history.dry_run import dry_run  # not needed for a solution

        return dry_run(self)

    def _repr_html_(self) -> str:
        from html import escape  # for notebooks alone

        return f"<pre>{escape(str(self))}</pre>"

    def prepare(self: S) -> S:
        """Do now what the first load step would do once: condense the bodies. Returns the solver."""
        self._expect(math.inf)
        self.linear_model.prepare()
        return self

    def _expect(self, steps: float) -> None:
        """Let more load steps be known before they come: how many there are decides on the route."""
        with self._lock:
            model = self.linear_model.expecting(steps)
            if model is not self.linear_model:
                self.linear_model = model
                self._answering = self._new_step_solver()

    def _answered(self, target: LoadCase, before: Known, known: Known, *how: Any) -> Answer:
        """The answer to the next load step; by factors where multigrid has few digits or no end."""
        answering = self._answering  # another thread may have had factors made meanwhile
        try:
            return answering.solve(target, before, known, *how)
        except LinearSolveError as error:
            if not answering.stepper.model.choice.few_steps:
                raise
            logger.info("factors are made after all: %s", error)
        self._expect(math.inf)
        return self._answering.solve(target, before, known, *how)


V = TypeVar("V", bound="Variants")


class Variants(ProblemSetup):
    """The part of a solver that makes others of it."""

    @known_keywords(mu="write friction=Coulomb(mu)")
    def with_friction(self: V, friction: FrictionLaw | None, contact: Contact | str | None = None) -> V:
        """A solver for another friction law that shares all that has been computed.

        For parameter studies: pairing and condensation do not depend on the law. The two solvers
        are independent otherwise; results of one may be the `start` of the other.

        Parameters
        ----------
        friction : FrictionLaw or None
        contact : Contact or str, optional
            The contact that gets it, itself or by name; by default all but tied ones.

        Notes
        -----
        From frictionless to frictional contact or back the contact points keep other DOFs, and the
        new solver condenses for itself.

        Examples
        --------
        A block pulled over a plane, with more and less friction:

        >>> import numpy as np
        >>> import skfem as fem
        >>> import skfem_contact as sc
        >>> from skfem.models.elasticity import linear_elasticity
        >>> basis = fem.Basis(
        ...     fem.MeshQuad().refined(2).with_defaults(), fem.ElementVector(fem.ElementQuad1())
        ... )
        >>> move = basis.project(lambda x: np.stack([0.2 + 0 * x[0], -0.01 + 0 * x[0]]))
        >>> block = sc.Body(basis, linear_elasticity(0.0, 0.5), D="top", x=move, name="block")
        >>> floor = sc.RigidPlane((0, 0), (0, 1))
        >>> rough = sc.Contact(block.surface("bottom"), floor, friction=sc.Coulomb(0.4))
        >>> solver = sc.ContactSolver([block], [rough])
        >>> for mu in (0.1, 0.2):
        ...     force = solver.with_friction(sc.Coulomb(mu)).solve().force
        ...     print(f"{-force[0] / force[1]:.9f}")
        0.100000000
        0.200000000
        """
        chosen = range(len(self.contacts)) if contact is None else [self._position(contact)]
        contacts = list(self.contacts)
        for i in chosen:
            if contact is not None or not contacts[i].tied:
                contacts[i] = replace(contacts[i], friction=friction)
        twin = self._copied()
        twin.contacts = tuple(contacts)
        twin.geometry = self.geometry.with_laws(contacts)
        twin.kin = twin.geometry.kin
        twin._reader = twin._new_reader()
        twin.timings = {"setup": 0.0}
        twin.interface = interface(twin.contacts, twin.kin, twin._stiffness, self.loop)
        twin.linear_model = self.linear_model.with_interface(
            twin.interface, twin.timings, twin.geometry
        )
        twin._answering = twin._new_step_solver()
        return twin

    @known_keywords()
    def with_load(self: V, body: Member | str, f: Loads) -> V:
        """A solver with another own load of one body that shares all that has been computed.

        Parameters
        ----------
        body : Body, RigidBody or str
        f : ndarray (n_body,), LinearForm, or tractions by boundary name
            The body's own load, see `Body`, of which numeric load steps are multiples [force].

        Raises
        ------
        InputError
            As for `Body`: wrong shapes, NaN.
        """
        i = self.system.index(body)
        own, name = self.system.bodies[i], self.system.names[i]
        own_f = np.array(self._own_f)
        load = own.load(f, f"f of body {name!r}")
        own_f[self.system.slice(own)] = load / self.system.scale(own)
        twin = self._copied()
        twin._own_f = sealed(own_f)
        parts = self._own_apart | {i: own.apart(f, load)}
        twin._own_apart = {k: part for k, part in parts.items() if part is not None}
        twin._reader = twin._new_reader()
        twin._answering = twin._new_step_solver()
        return twin

    @known_keywords()
    def with_stiffness(self: V, body: Member | str, K: Any) -> V:
        """A solver with another stiffness of one body; only that body is condensed again.

        Loads stay as they are, that of a temperature too: give it anew by `with_load`.

        The way in for bodies whose stiffness changes: a Newton loop of the user's own around this
        solver, with the tangent stiffness and ``f = f_ext - f_int(u) + K u`` of each iterate.

        Parameters
        ----------
        body : Body, RigidBody or str
        K : sparse matrix (n_body, n_body), BilinearForm or Elastic
            [force/length]

        Raises
        ------
        InputError
            As for `Body`: wrong shapes, NaN.

        Examples
        --------
        Pressed by the same displacement, a block twice as stiff bears twice the force:

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
        >>> for factor in (1.0, 2.0):
        ...     result = solver.with_stiffness("block", factor * block.K).solve()
        ...     print(f"{result.force[1]:.6f}")
        0.010000
        0.020000
        """
        i = self.system.index(body)
        own, name = self.system.bodies[i], self.system.names[i]
        stiffness = list(self._stiffness)
        stiffness[i] = self.system.scaled(own, own.stiffness(K, f"body {name!r}"))
        twin = self._copied()
        twin._stiffness, twin.timings = stiffness, {"setup": 0.0}
        twin._set_stiffness(
            [None if k == i else part for k, part in enumerate(self.linear_model.substructures)]
        )
        return twin

    @known_keywords()
    def update(self, body: Member | str, *, K: Any = None, f: Loads | None = None) -> None:
        """Replace the stiffness or the load of one body in this solver itself.

        What `with_load` and `with_stiffness` do, which leave the solver as it is and are to be
        preferred. Results that it has returned stay as they are, and good to go on from; a history
        that is under way takes the new stiffness, and the new load from the next step on that is a
        number. Where several threads use this solver, it changes under all of them: take the others.

        Parameters
        ----------
        body : Body, RigidBody or str
        K : sparse matrix (n_body, n_body), BilinearForm or Elastic, optional
            [force/length]
        f : ndarray (n_body,), LinearForm, or tractions by boundary name, optional
            The body's own load from now on, see `Body` [force].

        Raises
        ------
        InputError
            As for `Body`: wrong shapes, NaN.
        """
        self.system.index(body)  # refuses what is none
        twin = self
        if f is not None:
            twin = twin.with_load(body, f)
        if K is not None:
            twin = twin.with_stiffness(body, K)
        self.__dict__.update(vars(twin))

    def _position(self, contact: Contact | str) -> int:
        if isinstance(contact, str) and contact in self.names:
            return self.names.index(contact)
        i = number_of(contact, self.contacts)
        if i is not None:
            return i
        known = ", ".join(map(repr, self.names))
        raise InputError(
            f"contact = {contact!r} is not one of this solver: it has {known}. Pass the name, or "
            "the object the solver was made with."
        )


logger = logging.getLogger("skfem_contact")

# What to write for keywords that belong elsewhere.
IN_OPTIONS = {name: f"it belongs to options=Options({name}=...)" for name in Options.__annotations__}
IN_OPTIONS["tol"] = "it belongs to options=Options(tolerance=...)"
IN_STEPS = dict.fromkeys(("f", "x", "start", "guess", "callback"), "it belongs to solver.solve(...)")
OF_SOLVER = {name: f"{words} of ContactSolver(...)" for name, words in IN_OPTIONS.items()}
OF_SOLVER |= dict.fromkeys(("loop", "linear", "options"), "it belongs to ContactSolver(...)")
OF_SOLVER |= dict.fromkeys(("mu", "friction"), "write solver.with_friction(Coulomb(mu))")


@with_known_keywords(
    mu="it belongs to Contact(..., friction=Coulomb(mu))",
    friction="it belongs to Contact(..., friction=Coulomb(mu))",
    **IN_OPTIONS,
    **IN_STEPS,
)
class ContactSolver(Variants):
    """Contact and friction between deformable bodies, reusable over many loads.

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
        anything that scikit-fem takes as ``solver(A, b)``. "auto" takes one of the first three by the
        memory of each, and by the load steps that are known to come; ``print(solver)`` says why.
    options : Options
    bolts : sequence of Bolt
        That load steps may tighten.

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
        bolts: Sequence[Bolt] | Bolt = (),
    ) -> None:
        super().__init__(bodies, contacts, loop, linear, options, bolts)

    @known_keywords(**OF_SOLVER)
    def solve(
        self,
        f: ArrayLike | Mapping[str, Any] | None = None,
        x: ArrayLike | Mapping[str, Any] | None = None,
        *,
        interference: Mapping[str, Any] | None = None,
        motion: Mapping[str, Any] | None = None,
        bolt: Mapping[str, Any] | None = None,
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
        interference, motion, bolt : dict, optional
            By the names of contacts, obstacles and bolts, as in the steps of `history`.
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
        before, known, target = self._answering.begin(start, guess)
        given = {"f": f, "x": x, "interference": interference, "motion": motion, "bolt": bolt}
        named = {what: value for what, value in given.items() if value is not None}
        if named:
            target = self._reader.read(named, target)
        self._expect(1)
        return ContactResult(self._answered(target, before, known, callback, throw))

    @known_keywords(
        **OF_SOLVER,
        **{name: f"it belongs to the steps, [{{{name!r}: ...}}]" for name in KEYS},
        **dict.fromkeys(("callback", "throw"), "it belongs to solver.solve(...)"),
    )
    def history(
        self,
        steps: Iterable[Any],
        *,
        start: ContactResult | SavedState | None = None,
        guess: ContactResult | SavedState | None = None,
        progress: bool = False,
    ) -> Iterator[ContactResult]:
        """Solve load steps one after the other, each from the state of the one before.

        Parameters
        ----------
        steps : iterable
            A number is the factor on all bodies' own f and x. A dict replaces just what it names:
            ``f`` and ``x`` (dict by body name; an array, a number as a factor on the body's own, or
            a dict by boundary name, see below), ``interference`` (by contact name), ``motion`` (by
            obstacle name: total translation (d,), or (translation, angle, centre)), ``bolt`` (by name
            of the bolt: ``{"force": ...}`` or ``{"stretch": ...}``). What a step does not name stays
            as it was; bolts are locked.
        start : ContactResult, optional
            The state to continue from, or one from `load_state`, as in `solve`.
        guess : ContactResult, optional
            Starting values of the first step only.
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
        what ``LinearForm(lambda v, w: -5.0 * v[1])`` is there (one number, ``{"top": 5.0}``, is a
        pressure against the normals), and all of the load of the body:
        other boundaries of the body carry none (loads of a `RigidBody` go by its DOFs, and those that
        are not named stay). ``{"x": {"punch": {"top": (0.0, -0.01)}}}`` is a
        constant displacement [length] of prescribed DOFs; those of other boundaries stay as they
        were. None stands for a component that is free there.

        Examples
        --------
        A block that is pressed, and pushed aside until it slips:

        >>> import skfem as fem
        >>> import skfem_contact as sc
        >>> basis = fem.Basis(
        ...     fem.MeshQuad().refined(2).with_defaults(), fem.ElementVector(fem.ElementQuad1())
        ... )
        >>> block = sc.Body(basis, sc.Elastic(1.0, 0.0), D="top", name="block")
        >>> floor = sc.RigidPlane((0, 0), (0, 1), name="floor")
        >>> foot = sc.Contact(block.surface("bottom"), floor, friction=sc.Coulomb(0.3), name="foot")
        >>> solver = sc.ContactSolver(block, foot)
        >>> steps = [{"x": {"block": {"top": (push, -0.01)}}} for push in (0.0, 0.001, 0.02)]
        >>> for result in solver.history(steps):
        ...     print(f"{result.force[0]:.4f}", result.status.tolist())
        0.0000 [1, 1, 1, 1, 1]
        -0.0003 [1, 1, 1, 1, 1]
        -0.0030 [2, 2, 2, 2, 2]
        """
        check_switch(progress, "history: progress")
        before, known, target = self._answering.begin(start, guess)
        single = isinstance(steps, str | bytes | Mapping) or getattr(steps, "shape", None) == ()
        if single or not isinstance(steps, Iterable):
            raise InputError(
                f"steps is {shown(steps)}, not a list of load steps; for a single one write [step]"
            )
        # of a generator it is not known, nor of what is refused where it is read
        yielded, total = PartialResults(), None
        with suppress(TypeError):
            total = len(steps)  # type: ignore[arg-type]
        self._expect(math.inf if total is None else total)
        shown_as = None
        if progress:
            from skfem_contact.history.dry_run import Progress

            shown_as = Progress(total, self.linear_model.prepare)
        try:
            for i, step in enumerate(steps, start=1):
                logger.debug("step %d begins", i)
                target = self._reader.read(step, target)
                before = self._answered(target, before, known, None, True)
                known = None
                if logger.isEnabledFor(logging.INFO):
                    from skfem_contact.history.dry_run import line

                    logger.info("%s", line(i, total, before))
                result = ContactResult(before)
                yielded.add(before, result, self._reader)
                if shown_as is not None:
                    shown_as.shows(before)
                yield result
        except (Exception, KeyboardInterrupt) as error:
            error.results = yielded.all()  # type: ignore[union-attr]
            if isinstance(error, KeyboardInterrupt) and hasattr(error, "add_note"):
                from skfem_contact.history.dry_run import reached

                error.add_note(reached(len(error.results), total))  # type: ignore[attr-defined]
            raise
        finally:
            if shown_as is not None:
                shown_as.close()

    @known_keywords(**OF_SOLVER)
    def cases(
        self, steps: Mapping[str, Any], *, start: ContactResult | SavedState | None = None
    ) -> LoadCases:
        """Solve several load cases, each from the same state, such as that of an assembly tightened.

        Parameters
        ----------
        steps : dict
            By the name of the case a load step, as in `history`.
        start : ContactResult, optional
            The state that each begins from, or one from `load_state`.

        Returns
        -------
        LoadCases
            A table that prints; ``cases["name"]`` is the `ContactResult`.

        Raises
        ------
        NotConverged, NoEquilibrium
            Of the first case that has no answer.

        Examples
        --------
        A block that is pressed, or pushed aside as well:

        >>> import skfem as fem
        >>> import skfem_contact as sc
        >>> basis = fem.Basis(
        ...     fem.MeshQuad().refined(2).with_defaults(), fem.ElementVector(fem.ElementQuad1())
        ... )
        >>> block = sc.Body(basis, sc.Elastic(1.0, 0.0), D="top", name="block")
        >>> floor = sc.RigidPlane((0, 0), (0, 1), name="floor")
        >>> foot = sc.Contact(block.surface("bottom"), floor, friction=sc.Coulomb(0.3), name="foot")
        >>> solver = sc.ContactSolver(block, foot)
        >>> ways = {"pressed": (0.0, -0.01), "pushed": (0.02, -0.01)}
        >>> cases = solver.cases({name: {"x": {"block": {"top": way}}} for name, way in ways.items()})
        >>> [f"{cases[name].force[0]:.4f}" for name in ways]
        ['0.0000', '-0.0030']
        """
        if not isinstance(steps, Mapping) or not steps:
            raise InputError(f"cases are {shown(steps)}; give a dict, {{'name': step, ...}}")
        return LoadCases({case: next(self.history([s], start=start)) for case, s in steps.items()})

    def _own(self, result: Any) -> Answer:
        """The answer of a result of these bodies and contacts."""
        check_kind(result, ContactResult, "result", "give one of solve() or history()")
        self._answering.known(result, "result")
        return result._answer

    @known_keywords(**OF_SOLVER)
    def modes(self, result: ContactResult, n: int = 10, *, slipping: str = "stuck") -> Modes:
        """Modes of vibration about a result: closed points stay closed.

        Bodies need a mass, ``Body(..., mass=density)``. They may be free, and bolts are locked. With
        ``sliding="finite"`` the points are those of the deformed bodies. Normals stay as they are: what
        a force does as they turn, as with a ball that rolls in a bowl, is not in the stiffness.

        Parameters
        ----------
        result : ContactResult
            Of this solver. Where it has open points they stay open.
        n : int
            How many, the lowest first.
        slipping : {"stuck", "free", "steady"}
            Points that slip in the result stick in a small vibration, as a rule. "free": they move
            along the surface without resistance, and points that stick in the result stick: for
            joints without any friction solve with a contact that has none. "steady": they slide on, by
            more than they vibrate, and their friction follows the pressure. Then modes may grow, as
            where brakes squeal.

        Returns
        -------
        Modes

        Raises
        ------
        InputError
            No convergence, no mass or a singular one, or more modes than DOFs.

        Examples
        --------
        A square that is pressed on a floor, and sticks:

        >>> import numpy as np
        >>> import skfem as fem
        >>> import skfem_contact as sc
        >>> basis = fem.Basis(
        ...     fem.MeshQuad().refined(3).with_defaults(), fem.ElementVector(fem.ElementQuad1())
        ... )
        >>> steel = sc.Elastic(210e9, 0.3, density=7850.0)
        >>> block = sc.Body(basis, steel, f={"top": (0.0, -1e6)}, name="block")
        >>> floor = sc.RigidPlane((0, 0), (0, 1), name="floor")
        >>> foot = sc.Contact(block.surface("bottom"), floor, friction=sc.Coulomb(0.3), name="foot")
        >>> solver = sc.ContactSolver(block, foot)
        >>> print(solver.modes(solver.solve(), 2))
        2 modes, slipping points stuck
            0  565.191
            1  1376.18
        """
        from skfem_contact.answers.tangent.modes import modes

        answer = self._own(result)
        # with bolts locked; of bodies that are not linear the tangent where a step from here begins:
        # in a small vibration nothing flows on
        stiffness = answer.stiffness
        if answer.placed is not None and any(answer.material):
            stiffness = answer.placed.moved(self.system, answer.u, answer.case.apart).stiffness
        pairs = zip(self.system.bodies, self._stiffness, stiffness, strict=True)
        return modes(answer, [K if body.nonlinear else own for body, own, K in pairs], n, slipping)

    @known_keywords(**OF_SOLVER)
    def damping(
        self,
        result: ContactResult,
        modes: Modes,
        amplitudes: ArrayLike,
        *,
        mode: int = 0,
        steps: int = 8,
        cycles: int = 20,
    ) -> Damping:
        """Frequency and damping of a mode against its amplitude, by friction in the joints.

        Load steps put on the inertia forces of the mode, up and down until the loop closes
        (quasi-static modal analysis). It holds while the mode keeps its shape and others do not answer.

        Parameters
        ----------
        result : ContactResult
            Of this solver, such as that of an assembly tightened; each amplitude begins from it.
        modes : Modes
            About this result.
        amplitudes : sequence of float
            Of the component that moves most, as it would be without slip; with slip it is larger
            [length].
        mode : int
            Which one, counted from zero.
        steps : int
            Load steps from peak to peak.
        cycles : int
            After so many that do not close a loop is given up, with a warning.

        Returns
        -------
        Damping

        Raises
        ------
        InputError
            A mode that is complex or has no frequency, an amplitude that is not positive.
        NotConverged, NoEquilibrium
            A joint can not carry the inertia forces: it slips as a whole, or opens.

        Warns
        -----
        ContactWarning
            A loop did not close.
        """
        from skfem_contact.answers.tangent.modes import damping

        self._own(result)
        return damping(self, result, modes, amplitudes, mode, steps, cycles)

    @known_keywords(**OF_SOLVER)
    def gradient(
        self, objective: Asked, steps: Iterable[Any], *, by: Any, start: ContactResult | None = None
    ) -> Gradient:
        """Derivatives of one number that follows from a history, by any number of parameters.

        Parameters
        ----------
        objective : callable
            ``results -> (value, derivatives)``: of the results of the history, one per step, a number,
            and for each result a dict of its derivatives by ``pressure``, ``normal_force``, ``gap``
            (each (m,)), ``slip``, ``tangential_force`` ((m, d-1)), ``force`` (d,), ``dissipation``
            (a number), ``u`` (n,) or ``displacement`` (a dict by body); with several contacts
            ``{"name of the contact": {"pressure": ...}}``. None for a result that does not count.
        steps, start
            As of `history`.
        by : Parameter, str, or list of them

        Returns
        -------
        Gradient

        Raises
        ------
        InputError
            There is no derivative; the message says why.

        Examples
        --------
        A pressed block is to bear a force of 0.02; how does the interference change the square of what
        is missing?

        >>> import skfem as fem
        >>> import skfem_contact as sc
        >>> from skfem.models.elasticity import linear_elasticity
        >>> basis = fem.Basis(
        ...     fem.MeshQuad().refined(2).with_defaults(), fem.ElementVector(fem.ElementQuad1())
        ... )
        >>> block = sc.Body(basis, linear_elasticity(0.0, 0.5), D="top", name="block")
        >>> floor = sc.RigidPlane((0, 0), (0, 1))
        >>> foot = sc.Contact(block.surface("bottom"), floor, interference=0.01)
        >>> def missing(results):
        ...     off = results[-1].force[1] - 0.02
        ...     return off**2, [{"force": (0.0, 2 * off)}]
        >>> found = sc.ContactSolver(block, foot).gradient(missing, [1.0], by="interference")
        >>> f"{found.value:.6f}, {found.parts[0]:.6f}"
        '0.000100, -0.020000'
        """
        from skfem_contact.answers.tangent.derivatives import gradient

        return gradient(lambda: self.history(steps, start=start), objective, by, self.recover)

    @known_keywords(**OF_SOLVER)
    def jacobian(
        self,
        observe: Asked,
        steps: Iterable[Any],
        *,
        by: Any,
        start: ContactResult | None = None,
        side: int = 0,
    ) -> Jacobian:
        """Derivatives of many values that follow from a history, by a few numbers.

        Parameters
        ----------
        observe : callable
            ``results -> (values, derivatives)``: values (r,), and for each result a dict from the
            numbers of the values that depend on it to their derivatives by it, each as for `gradient`:
            ``{3: {"force": (1.0, 0.0)}}``.
        steps, start
            As of `history`.
        by : Parameter, str, or list of them
        side : {0, 1, -1}
            As for `ContactResult.sensitivity`.

        Returns
        -------
        Jacobian
            ``matrix`` is what ``jac`` of `scipy.optimize.least_squares` gives, ``values`` what it is
            of; ``words`` says which parameters the values do not tell.

        Raises
        ------
        InputError
            There is no derivative; the message says why.

        Examples
        --------
        How does the force of a block that sticks, then slips, depend on the coefficient of friction?

        >>> import skfem as fem
        >>> import skfem_contact as sc
        >>> basis = fem.Basis(
        ...     fem.MeshQuad().refined(2).with_defaults(), fem.ElementVector(fem.ElementQuad1())
        ... )
        >>> block = sc.Body(basis, sc.Elastic(1.0, 0.0), D="top", name="block")
        >>> floor = sc.RigidPlane((0, 0), (0, 1), name="floor")
        >>> foot = sc.Contact(block.surface("bottom"), floor, friction=sc.Coulomb(0.3), name="foot")
        >>> solver = sc.ContactSolver(block, foot)
        >>> steps = [{"x": {"block": {"top": (push, -0.01)}}} for push in (0.0, 0.001, 0.02)]
        >>> def observe(results):
        ...     values = [result.force[0] for result in results]
        ...     return values, [{i: {"force": (1.0, 0.0)}} for i in range(len(results))]
        >>> solver.jacobian(observe, steps, by="friction").matrix.round(12).tolist()
        [[0.0], [0.0], [-0.01]]
        """
        from skfem_contact.answers.tangent.derivatives import jacobian

        return jacobian(lambda: self.history(steps, start=start), observe, by, side, self.recover)

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

        Examples
        --------
        A block that is pushed, and in another program lifted:

        >>> import skfem as fem
        >>> import skfem_contact as sc
        >>> basis = fem.Basis(
        ...     fem.MeshQuad().refined(2).with_defaults(), fem.ElementVector(fem.ElementQuad1())
        ... )
        >>> block = sc.Body(basis, sc.Elastic(1.0, 0.0), D="top", name="block")
        >>> floor = sc.RigidPlane((0, 0), (0, 1), name="floor")
        >>> foot = sc.Contact(block.surface("bottom"), floor, friction=sc.Coulomb(0.3), name="foot")
        >>> solver = sc.ContactSolver(block, foot)
        >>> result = solver.solve(x={"block": {"top": (0.02, -0.01)}})
        >>> from tempfile import TemporaryDirectory
        >>> with TemporaryDirectory() as folder:
        ...     path = solver.save_state(f"{folder}/pushed", result)
        ...     known = solver.load_state(path)
        >>> lifted = solver.solve(x={"block": {"top": (0.02, 0.001)}}, start=known)
        >>> path.name, lifted.status.tolist()
        ('pushed.npz', [0, 0, 0, 0, 0])
        """
        known = self._answering.known(result, "result")
        if known is None:
            raise InputError("result is None; give what solve(...) returned")
        from skfem_contact.history.checkpoint import save_state

        return save_state(path, known)

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

        Examples
        --------
        >>> import skfem as fem
        >>> import skfem_contact as sc
        >>> basis = fem.Basis(
        ...     fem.MeshQuad().refined(2).with_defaults(), fem.ElementVector(fem.ElementQuad1())
        ... )
        >>> block = sc.Body(basis, sc.Elastic(1.0, 0.0), D="top", name="block")
        >>> floor = sc.RigidPlane((0, 0), (0, 1), name="floor")
        >>> foot = sc.Contact(block.surface("bottom"), floor, friction=sc.Coulomb(0.3), name="foot")
        >>> solver = sc.ContactSolver(block, foot)
        >>> steps = [{"x": {"block": {"top": (push, -0.01)}}} for push in (0.0, 0.001, 0.02)]
        >>> results = list(solver.history(steps))
        >>> [u.shape for u in solver.recover(results)]
        [(50,), (50,), (50,)]
        """
        results = members(results, ContactResult, "results", "give results of this solver")
        recover_all([answer_of(r) for r in results])
        return [r.u for r in results]
