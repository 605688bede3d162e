"""`ProblemSetup`: what a solver is made of, whatever the loads; and what it says before it solves."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Any, TypeVar

from skfem_contact.arguments import check_kind, members
from skfem_contact.bodies.member import Member
from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.bodies.system import stack
from skfem_contact.carried import carried
from skfem_contact.conditions.contact import Contact
from skfem_contact.conditions.diagnosis import check_passes, warn_unfelt_wear
from skfem_contact.conditions.geometry import Geometry
from skfem_contact.conditions.interface import contact_names, interface
from skfem_contact.conditions.motions import rigid_motions
from skfem_contact.errors import InputError
from skfem_contact.history.answering import Answering
from skfem_contact.history.dry_run import dry_run
from skfem_contact.history.read import StepReader
from skfem_contact.history.stepper import Stepper
from skfem_contact.linalg.multifrontal.fronts import FactorSize
from skfem_contact.linalg.resources import Limits
from skfem_contact.loops.active_set import LOOPS
from skfem_contact.loops.driver import Options
from skfem_contact.obstacles.rigid_body import RigidBody
from skfem_contact.problem.model import AnyBodies, LinearModel
from skfem_contact.problem.substructure import Substructure

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
        self._answering = self._new_answering()

    def _copied(self: S) -> S:
        twin = object.__new__(type(self))
        vars(twin).update(vars(self))
        return twin

    def __getstate__(self) -> dict[str, Any]:
        return {**vars(self), "linear": carried(self.linear, "linear")}

    def _new_reader(self) -> StepReader:
        return StepReader(self.system, self.contacts, self.names, self.geometry, self._own_f)

    def _new_answering(self) -> Answering:
        return Answering(Stepper(self.linear_model, self.loop, self.options), self._reader)

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
        return dry_run(self)

    def _repr_html_(self) -> str:
        from html import escape  # for notebooks alone

        return f"<pre>{escape(str(self))}</pre>"

    def prepare(self: S) -> S:
        """Do now what the first load step would do once: condense the bodies. Returns the solver."""
        self.linear_model.prepare()
        return self
