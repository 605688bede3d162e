"""`ContactResult`: the answer of one load step as users see it, per contact and for all bodies."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skfem_contact.answers.answer import Answer
from skfem_contact.answers.by_contact import ByContact
from skfem_contact.answers.certificate import Certificate, certify
from skfem_contact.answers.reaction import reaction
from skfem_contact.answers.uniqueness import Uniqueness, undetermined, uniqueness
from skfem_contact.answers.validity.assess import assess
from skfem_contact.answers.validity.strain import rigid_rotations
from skfem_contact.answers.validity.validity import Validity
from skfem_contact.arguments import known_keywords
from skfem_contact.bodies.member import Member
from skfem_contact.bodies.system import System
from skfem_contact.conditions.state import OPEN
from skfem_contact.errors import InputError
from skfem_contact.loops.step import Record
from skfem_contact.obstacles.rigid_body import RigidBody
from skfem_contact.once import once
from skfem_contact.records import dataclass
from skfem_contact.sealed import sealed

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False, repr=False)
class ContactResult(ByContact):
    """The answer of one load step.

    What a contact knows (`ContactValues`: pressure, traction, slip, status, ...) is reached by
    ``result[contact]`` or ``result["name"]``, and directly on the result where there is one contact.
    ``for values in result`` goes through the contacts, ``len(result)`` counts them.

    ``print(result)`` shows what is known quickly: it recovers the displacements for the certificate.
    ``print(result.report())`` shows also how far the mesh may be off, whether the model holds, and
    whether there are other answers.

    Examples
    --------
    >>> import skfem as fem
    >>> import skfem_contact as sc
    >>> from skfem.models.elasticity import linear_elasticity
    >>> mesh = fem.MeshQuad().refined(2).with_defaults()
    >>> basis = fem.Basis(mesh, fem.ElementVector(fem.ElementQuad1()), intorder=2)
    >>> block = sc.Body(basis, linear_elasticity(), D="top", x={"top": (0.002, -0.01)}, name="block")
    >>> floor = sc.RigidPlane((0, 0), (0, 1), name="floor")
    >>> foot = sc.Contact(block.surface("bottom"), floor, friction=sc.Coulomb(0.3), name="foot")
    >>> result = sc.ContactSolver(block, foot).solve()
    >>> result
    <ContactResult: converged in ... iterations (load factor 1)
      foot: Coulomb: 0 open, 3 stick, 2 slip; force (..., ...)>
    >>> result.pressure.shape, result.displacement("block").shape == (basis.N,)
    ((5,), True)
    """

    _answer: Answer

    # -- how it ended -------------------------------------------------------------------------

    @property
    def converged(self) -> bool:
        """Whether this is an answer; see `message`."""
        return self._answer.converged

    @property
    def message(self) -> str:
        """How the iterations ended."""
        return self._answer.message

    @property
    def iterations(self) -> int:
        """Iterations of the load step, with all its attempts and parts."""
        return self._answer.iterations

    @property
    def trace(self) -> tuple[Record, ...]:
        """A record per iteration."""
        return self._answer.trace

    @property
    def timings(self) -> dict[str, float]:
        """Seconds by stage."""
        return dict(self._answer.timings)

    @property
    def factor(self) -> float | None:
        """The number of the load step, where it was one."""
        return self._answer.factor

    @property
    def indifferent(self) -> tuple[str, ...]:
        """A sentence per motion that nothing loads and nothing holds.

        The forces are those of every place along it, and the body stands where it has moved least
        since the last result.
        """
        return self._answer.indifferent

    @cached_property
    def undetermined(self) -> tuple[str, ...]:
        """A sentence per group of contacts whose forces are not unique.

        Where the conditions of points that press depend on each other, other forces fulfil them as
        well, with the same displacements: between contacts that share an edge, on a tool that supports
        hold and that is finer than what it presses. The forces of the result are those with the least
        square of friction over the surfaces, and of these the ones with the least of pressure; where
        points would pull then, or friction exceed its bound, the least square of both.
        """
        return undetermined(self._answer)

    # -- bodies -------------------------------------------------------------------------------

    @property
    def system(self) -> System:
        """The bodies, and where the DOFs of each are in `u`."""
        return self._answer.system

    @property
    def u(self) -> Array:
        """Displacements of all bodies, shape (n,) [length]; recovered when first asked for.

        Of a rigid body its translation and rotation [rad].
        """
        u, units = self._answer.u, self._answer.system.units
        return u if isinstance(units, float) else sealed(u / units)

    def displacement(self, body: Member | str) -> Array:
        """Displacements of one body, by name or itself, in its basis' numbering, (n_body,) [length].

        Of a rigid body its translation and rotation [rad].
        """
        u, scale = self._answer.displacement(body), self._answer.system.scale(body)
        return u if isinstance(scale, float) else sealed(u / scale)

    def motion(self, body: RigidBody | str) -> tuple[Array, Any, Array]:
        """How a rigid body has moved: translation (d,) [length], angle [rad] and the point `about`.

        As obstacles take it: ``die.obstacle.moved(result.motion("die"))`` is the die where it is now.
        """
        own = self.system.bodies[self.system.index(body)]
        if not isinstance(own, RigidBody):
            raise InputError(
                f"{own!r} is no rigid body; result.displacement(...) has what its nodes have moved by"
            )
        return own.motion(self.displacement(own))

    @known_keywords()
    def reaction(self, body: Member | str, boundary: str | None = None) -> Array:
        """Force of the supports on a body, without contact forces, shape (d,) [force].

        Parameters
        ----------
        body : Body, RigidBody or str
        boundary : str, optional
            Name of a boundary of its mesh: the supports of the prescribed DOFs on it; by default of
            all. A node at the corner of two boundaries counts for both.

        Returns
        -------
        ndarray, shape (d,)
            Of a scalar field, shape (1,), the flow into the body. Of a rigid body, shape (3,) or (6,),
            force and moment of its prescribed DOFs; its springs are none of them.

        Raises
        ------
        InputError
            There is no such body or boundary, or nothing is prescribed there.

        Examples
        --------
        A square of unit modulus, pressed onto a rigid plane by 1 % of its height:

        >>> import skfem as fem
        >>> import skfem_contact as sc
        >>> from skfem.models.elasticity import linear_elasticity
        >>> mesh = fem.MeshQuad().refined(2).with_defaults()
        >>> basis = fem.Basis(mesh, fem.ElementVector(fem.ElementQuad1()))
        >>> down = basis.project(lambda x: np.stack([0 * x[0], -0.01 + 0 * x[0]]))
        >>> block = sc.Body(basis, linear_elasticity(0.0, 0.5), D="top", x=down, name="block")
        >>> floor = sc.RigidPlane((0, 0), (0, 1))
        >>> result = sc.ContactSolver(block, sc.Contact(block.surface("bottom"), floor)).solve()
        >>> bool(np.allclose(result.reaction("block", "top"), [0.0, -0.01]))
        True
        """
        return reaction(self._answer, body, boundary)

    # -- energy -------------------------------------------------------------------------------

    @property
    def dissipation(self) -> float:
        """Energy lost by friction in this step, all contacts [energy]."""
        return float(self._answer.dissipation_by_contact.sum())

    @property
    def dissipation_total(self) -> float:
        """Energy lost by friction since the start of the history, all contacts [energy]."""
        answer = self._answer
        return float(answer.dissipation_before.sum() + answer.dissipation_by_contact.sum())

    @property
    def energy_residual(self) -> float:
        """What the energy balance of this step misses, all contacts [energy]; see `ContactValues`."""
        return float(self._answer.residual_by_contact.sum())

    # -- what an answer is worth --------------------------------------------------------------

    @cached_property
    def rotations(self) -> dict[str, float]:
        """Mean rotation of the surfaces that slide far, by body [rad]; empty for small sliding.

        Linear bodies are good for rotations well below 0.1 rad.
        """
        answer = self._answer
        return rigid_rotations(answer.system, answer.contacts, answer.state.surface)

    @cached_property
    def certificate(self) -> Certificate:
        """Dimensionless numbers measured from the answer, for all degrees of freedom."""
        return self._certified

    @cached_property
    def validity(self) -> Validity:
        """Whether the model holds at the answer; computed when first asked for, see `Validity`.

        Warns
        -----
        ContactWarning
            What is beyond its bound and has not been said in this history.
        """
        return self._assessed

    @cached_property
    def uniqueness(self) -> Uniqueness | None:
        """Whether this load, or loads like it, have other answers; computed when first asked for.

        The critical friction of every point, the index of this answer, and the friction up to which it
        is shown to be the only one, see `Uniqueness`. None where it is not computed: on the routes
        without a dense matrix, and where rows depend on each other.
        """
        return self._counted

    # of several threads that ask at once one computes, and warns

    @once
    def _certified(self) -> Certificate:
        return certify(self._answer)

    @once
    def _assessed(self) -> Validity:
        return assess(self._answer)

    @once
    def _counted(self) -> Uniqueness | None:
        return uniqueness(self._answer)

    # -- printed ------------------------------------------------------------------------------
    # reports are about results, and stand after them: hence the late imports

    def report(self) -> str:
        """All that is printed, and what takes a moment: error estimates, validity, other answers.

        Warns
        -----
        ContactWarning
            As `validity` does.
        """
        # what is printed of results stands after them, here and below
        from skfem_contact.answers.report import report

        return report(self)

    def __repr__(self) -> str:
        from skfem_contact.answers.report import short

        return short(self)

    def __str__(self) -> str:
        from skfem_contact.answers.report import summary

        return summary(self)

    def _repr_html_(self) -> str:
        from skfem_contact.answers.report import table

        return table(self)

    def __getstate__(self) -> dict[str, Any]:
        """All that reports and pictures need, computed before the functions stay behind."""
        for values in self.values:
            values.contact_area  # noqa: B018
            if np.any(values.status != OPEN):
                values.error_estimate  # noqa: B018
        return dict(vars(self))
