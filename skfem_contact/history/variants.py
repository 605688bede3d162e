"""`Variants`: solvers for another friction law, load or stiffness that share what has been computed."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, TypeVar

import numpy as np

from skfem_contact.arguments import known_keywords
from skfem_contact.bodies.inputs import Loads
from skfem_contact.bodies.member import Member
from skfem_contact.conditions.contact import Contact, number_of
from skfem_contact.conditions.friction import FrictionLaw
from skfem_contact.conditions.interface import interface
from skfem_contact.errors import InputError
from skfem_contact.history.problem_setup import ProblemSetup
from skfem_contact.sealed import sealed

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
        twin._answering = twin._new_answering()
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
        twin._answering = twin._new_answering()
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
