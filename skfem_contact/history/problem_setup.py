"""`ProblemSetup`: what a solver is made of, whatever the loads; and what it says before it solves."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from skfem_contact.arguments import check_kind, known_keywords, members
from skfem_contact.bodies.inputs import Loads
from skfem_contact.bodies.member import Member
from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.bodies.system import stack
from skfem_contact.carried import carried
from skfem_contact.conditions.checks import check_passes, warn_unfelt_wear
from skfem_contact.conditions.contact import Contact, number_of
from skfem_contact.conditions.friction import FrictionLaw
from skfem_contact.conditions.geometry import Geometry
from skfem_contact.conditions.interface import contact_names, interface
from skfem_contact.conditions.motions import rigid_motions
from skfem_contact.errors import InputError
from skfem_contact.history.read import StepReader
from skfem_contact.history.solve_step import StepSolver
from skfem_contact.history.stepper import Stepper
from skfem_contact.linalg.multifrontal.fronts import FactorSize
from skfem_contact.linalg.resources import Limits
from skfem_contact.loops.active_set import LOOPS
from skfem_contact.loops.driver import Options
from skfem_contact.obstacles.rigid_body import RigidBody
from skfem_contact.problem.model import LinearModel
from skfem_contact.problem.substructure import Substructure
from skfem_contact.sealed import sealed

if TYPE_CHECKING:
    from skfem_contact.problem.model import AnyBodies

S = TypeVar("S", bound="ProblemSetup")


class ProblemSetup:
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
    ) -> None:
        start = time.perf_counter()
        if not isinstance(loop, str) or loop not in LOOPS:
            raise InputError(f"loop = {loop!r} is not one of {tuple(LOOPS)}.")
        if options is not None:
            check_kind(options, Options, "options", "give Options(tolerance=...) and the like")
        self.options = options or Options()
        self.loop, self.linear = loop, linear
        self.system = stack(bodies)
        usage = "make each by Contact(surface, other, ...)"
        self.contacts = tuple(members(contacts, Contact, "contacts", usage))
        self.names = contact_names(self.contacts)
        check_passes(self.contacts, self.names)
        warn_unfelt_wear(self.contacts, self.names)
        self._stiffness, self._own_f = self.system.linearize()
        for surface in (s for c in self.contacts for s in (c.secondary, c.primary)):
            # refuses what is no body of this solver
            if isinstance(surface, ContactSurface | RigidBody):
                self.system.index(surface if isinstance(surface, RigidBody) else surface.body)
        self.geometry = Geometry(self.system, self.contacts)
        self.kin = self.geometry.kin
        self._reader = self._new_reader()
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
        self._answering = self._new_step_solver()

    def _copied(self: S) -> S:
        twin = object.__new__(type(self))
        vars(twin).update(vars(self))
        return twin

    def __getstate__(self) -> dict[str, Any]:
        return {**vars(self), "linear": carried(self.linear, "linear")}

    def _new_reader(self) -> StepReader:
        return StepReader(self.system, self.contacts, self.names, self.geometry, self._own_f)

    def _new_step_solver(self) -> StepSolver:
        return StepSolver(Stepper(self.linear_model, self.loop, self.options), self._reader)

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
        self.linear_model.prepare()
        return self


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
        own_f[self.system.slice(own)] = own.load(f, f"f of body {name!r}") / self.system.scale(own)
        twin = self._copied()
        twin._own_f = sealed(own_f)
        twin._reader = twin._new_reader()
        twin._answering = twin._new_step_solver()
        return twin

    @known_keywords()
    def with_stiffness(self: V, body: Member | str, K: Any) -> V:
        """A solver with another stiffness of one body; only that body is condensed again.

        The way in for bodies whose stiffness changes: a Newton loop of the user's own around this
        solver, with the tangent stiffness and ``f = f_ext - f_int(u) + K u`` of each iterate.

        Parameters
        ----------
        body : Body, RigidBody or str
        K : sparse matrix (n_body, n_body) or BilinearForm
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
        K : sparse matrix (n_body, n_body) or BilinearForm, optional
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
