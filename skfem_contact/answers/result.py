"""`ContactResult`: the answer of one load step as users see it, per contact and for all bodies.

Below it stand the answer split by contact, and what is printed: a few lines, what is quickly known, or
all; a table for notebooks.
"""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Iterator, Mapping
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from skfem_contact.answers.answer import Answer, Newton, reaction, reaction_moment
from skfem_contact.answers.certificate import Certificate, certified, undetermined
from skfem_contact.answers.validity.assess import assess
from skfem_contact.answers.validity.support import rigid_rotations, surface_turns
from skfem_contact.answers.validity.validity import Validity
from skfem_contact.answers.values import ContactValues, OfTheContact, contact_lines, status_words
from skfem_contact.arguments import known_keywords, suggest
from skfem_contact.arrays import Array
from skfem_contact.assemblies.bolt import BoltValues
from skfem_contact.assemblies.joints import Joint, Joints
from skfem_contact.bodies.member import Member
from skfem_contact.bodies.selection import written
from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.bodies.system import System
from skfem_contact.conditions.contact import Contact, number_of
from skfem_contact.conditions.state import OPEN, SLIP
from skfem_contact.errors import InputError
from skfem_contact.loops.step import Record
from skfem_contact.obstacles.rigid_body import RigidBody
from skfem_contact.records import dataclass, once, sealed

if TYPE_CHECKING:
    from skfem_contact.answers.tangent.derivatives import Sensitivity
    from skfem_contact.answers.tangent.tangent import Tangent
    from skfem_contact.answers.uniqueness import Uniqueness
    from skfem_contact.answers.values import ErrorEstimate

#: Printed reports look for other answers up to so many gaps and slips: three seconds at most.
MOST_ROWS = 2000


@dataclass(frozen=True, eq=False, repr=False)
class ContactResult(OfTheContact):
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

    # -- its contacts -------------------------------------------------------------------------

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the contacts, in the order given to the solver."""
        return self._answer.names

    @property
    def contacts(self) -> tuple[Contact, ...]:
        """The contacts themselves."""
        return self._answer.contacts

    @cached_property
    def values(self) -> tuple[ContactValues, ...]:
        """The answer of every contact, in the order given."""
        parts = enumerate(self._answer.model.interface.point_slices)
        return tuple(_values(self._answer, i, part) for i, part in parts)

    def __getitem__(self, key: Contact | str | int) -> ContactValues:
        return self.values[self._position(key)]

    def __iter__(self) -> Iterator[ContactValues]:
        return iter(self.values)

    def __len__(self) -> int:
        return len(self.names)

    def __bool__(self) -> bool:
        return True  # of a result with `if result:` nobody asks how many contacts it has

    def __contains__(self, key: object) -> bool:
        known = isinstance(key, str) and key in self.names
        return known or number_of(key, self.contacts) is not None or any(key is own for own in self)

    def _position(self, key: Contact | str | int) -> int:
        if isinstance(key, str):
            if key in self.names:
                return self.names.index(key)
            raise InputError(f"there is no contact {key!r}{suggest(key, self.names, 'contacts')}")
        if isinstance(key, int | np.integer):
            if not -len(self.names) <= key < len(self.names):
                raise InputError(f"there is no contact number {key}, only {len(self.names)} from 0 on")
            return range(len(self.names))[key]
        i = number_of(key, self.contacts)
        if i is None:
            raise InputError("this contact is not one of those of the solver: pass the same object")
        return i

    def _only(self, name: str) -> ContactValues:
        if len(self.names) != 1:
            raise AttributeError(
                f"'{name}' belongs to a contact and there are {len(self.names)} of them "
                f"({', '.join(self.names)}): write result['{self.names[0]}'].{name}"
            )
        return self.values[0]

    # -- how it ended -------------------------------------------------------------------------

    @property
    def converged(self) -> bool:
        """Return whether this is an answer; see `message`."""
        return self._answer.converged

    @property
    def message(self) -> str:
        """Return how the iterations ended."""
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
    def newton(self) -> Newton:
        """The linearisations of bodies that are not linear, with their residuals; printed, a line each.

        Empty where all bodies are linear.
        """
        return self._answer.newton

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
        """Return the motion of a rigid body: translation (d,) [length], angle [rad], point `about`.

        As obstacles take it: ``die.obstacle.moved(result.motion("die"))`` is the die where it is now.
        """
        own = self.system.bodies[self.system.index(body)]
        if not isinstance(own, RigidBody):
            raise InputError(
                f"{own!r} is no rigid body; result.displacement(...) has what its nodes have moved by"
            )
        return own.motion(self.displacement(own))

    @property
    def state(self) -> dict[str, Mapping[str, Any]]:
        """Internal variables of the bodies that are not linear, by name of the body.

        Each is a dict of arrays, with elements and points of integration as their last two axes; what
        they are is the material's matter.
        """
        named = zip(self.system.names, self._answer.material, strict=False)
        return {name: state for name, state in named if self.system.solids[name].nonlinear}

    @known_keywords()
    def stress(self, body: Member | str) -> Array:
        """Cauchy stress of a body with a material, (3, 3, elements, points of integration) [stress].

        At the nodes: `skfem_contact.output.nodal_field`. The strain of a temperature is taken off,
        where the load is the form ``steel.warmed(T)``; of a vector ``steel.stress(u, T)`` does.

        Raises
        ------
        InputError
            There is no such body, it keeps no material, or its stiffness was replaced.

        Examples
        --------
        A bar of unit modulus that is pressed by 1 % of its height:

        >>> import skfem as fem
        >>> import skfem_contact as sc
        >>> basis = fem.Basis(
        ...     fem.MeshQuad().refined(2).with_defaults(), fem.ElementVector(fem.ElementQuad1())
        ... )
        >>> block = sc.Body(basis, sc.Elastic(1.0, 0.0), D="top", name="block")
        >>> floor = sc.RigidPlane((0, 0), (0, 1), name="floor")
        >>> foot = sc.Contact(block.surface("bottom"), floor, friction=sc.Coulomb(0.3), name="foot")
        >>> solver = sc.ContactSolver(block, foot)
        >>> result = solver.solve(x={"block": {"top": (0.0, -0.01)}})
        >>> stress = result.stress("block")
        >>> stress.shape, f"{stress[1, 1].min():.4f}"
        ((3, 3, 16, 9), '-0.0100')
        """
        i = self.system.index(body)
        own, name = self.system.bodies[i], self.system.names[i]
        replaced = not own.nonlinear and self._answer.stiffness[i] is not own.K
        if getattr(own, "material", None) is None or replaced:
            raise InputError(
                f"body {name!r} keeps no material that would tell its stress: give sc.Elastic(E, nu) "
                "in the place of its stiffness, or use sc.nodal_stress(...)"
            )
        state = self._answer.material[i] if self._answer.material else {}
        stress = np.asarray(own.stress(self.stretched(own), state))  # type: ignore[attr-defined]
        known = self._answer.case.apart.get(i)
        if known is None or own.finite_strain:
            return stress
        return stress - np.eye(3)[:, :, None, None] * known[own.n :].reshape(stress.shape[2:])

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

    @known_keywords()
    def reaction_moment(
        self, body: Member | str, boundary: str | None = None, *, about: ArrayLike | None = None
    ) -> Any:
        """Moment of the forces of `reaction` about a point, the origin if none is given.

        Forces act where nodes are after the step, of bodies of finite strain and of those that slide
        far; else on the undeformed ones, as in `moment` of a contact. NaN of axisymmetric bodies.

        Parameters
        ----------
        body : Body, RigidBody or str
            Of a rigid body moments of its prescribed rotations count too.
        boundary : str, optional
            Name of a boundary of its mesh, as in `reaction`.
        about : array, shape (d,), optional
            [length]

        Returns
        -------
        float, or ndarray (3,) in 3-D
            [force length]

        Raises
        ------
        InputError
            As `reaction` does; or `about` is no point, or the body has a scalar field.

        Examples
        --------
        A bar with its end in a wall, under a force of 0.01 at a distance of 4 from it:

        >>> import skfem as fem
        >>> import skfem_contact as sc
        >>> x, y = np.linspace(0, 4, 17), np.linspace(0, 1, 5)
        >>> mesh = fem.MeshQuad.init_tensor(x, y).with_defaults()
        >>> basis = fem.Basis(mesh, fem.ElementVector(fem.ElementQuad1()), intorder=2)
        >>> load = {"right": (0, -0.01)}
        >>> bar = sc.Body(basis, sc.Elastic(1e3, 0.3), D="left", f=load, name="bar")
        >>> stop = sc.Contact(bar.surface("bottom"), sc.RigidPlane((0, -2), (0, 1)))  # far below
        >>> result = sc.ContactSolver(bar, stop).solve()
        >>> f"{result.reaction_moment('bar', 'left'):.4f}"
        '0.0400'
        """
        return reaction_moment(self._answer, body, boundary, about)

    @property
    def bolts(self) -> dict[str, BoltValues]:
        """Return what each bolt carries, by name; see `BoltValues`."""
        answer = self._answer
        known = answer.tightness
        return (
            answer.bolts.values(answer.case, answer.u, known)
            if answer.bolts is not None and known
            else {}
        )

    def joints(self) -> Joints:
        """A table of all contacts: force, moment, closed share, slip margin, pressure, energy lost.

        It prints, shows in notebooks, and gives a pandas frame by ``.to_frame()``; see `Joint`.

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
        >>> result = solver.solve(x={"block": {"top": (0.02, -0.01)}})
        >>> [(joint.name, f"{joint.slip_margin:.2f}") for joint in result.joints()]
        [('foot', '0.00')]
        """
        return Joints([Joint.of(values) for values in self.values])

    def stretched(self, body: Member | str) -> Array:
        """Displacements that have the strains of a body, in its basis' numbering, (n_body,) [length].

        Of a body with bolts those of `displacement` with the bolts drawn together: for stresses. Of
        any other body `displacement` itself.
        """
        own = self.system.index(body)
        return self._answer.stretched(body) if own in self.system.slides else self.displacement(body)

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
        """Residual of the energy balance of this step, all contacts [energy]; see `ContactValues`."""
        return float(self._answer.residual_by_contact.sum())

    # -- what an answer is worth --------------------------------------------------------------

    @cached_property
    def rotations(self) -> dict[str, float]:
        """Mean rotation of the surfaces that slide far, by body [rad]; empty for small sliding.

        Linear bodies are good for rotations well below 0.1 rad; those of large strains are left out.
        """
        answer = self._answer
        return rigid_rotations(surface_turns(answer.system, answer.contacts, answer.state.surface))

    @once
    def certificate(self) -> Certificate:
        """Dimensionless numbers measured from the answer, for all degrees of freedom."""
        return certified(self._answer)

    @once
    def validity(self) -> Validity:
        """Return whether the model holds at the answer; computed when first asked for, see `Validity`.

        Warns
        -----
        ContactWarning
            What is beyond its bound and has not been said in this history.
        """
        return assess(self._answer)

    @once
    def uniqueness(self) -> Uniqueness | None:
        """A statement on other answers to this load and to loads like it, computed when first read.

        The critical friction of every point, the index of this answer, and the friction up to which it
        is shown to be the only one, see `Uniqueness`. None where it is not computed: on the routes
        without a dense matrix, and where rows depend on each other.
        """
        from skfem_contact.answers.uniqueness import uniqueness

        return uniqueness(self._answer)

    # of several threads that ask at once for these one computes, and warns

    # -- derivatives --------------------------------------------------------------------------

    @once
    def linearized(self) -> Tangent:
        """The equations of contact and friction linearised at this answer, see `Tangent`.

        Raises
        ------
        InputError
            This answer has no derivatives; the message says why.
        """
        from skfem_contact.answers.tangent.tangent import Tangent

        return Tangent(self._answer)

    @known_keywords()
    def sensitivity(self, by: Any, *, after: Sensitivity | None = None, side: int = 0) -> Sensitivity:
        """Derivatives of all quantities of this result by one number.

        The statuses of all points stay what they are: see `linearized.margin` for how far that holds,
        and `linearized.kinks` for the points where derivatives are one-sided.

        Parameters
        ----------
        by : Parameter or str
            What to differentiate by; a kind alone is that of all bodies or contacts.
        after : Sensitivity, optional
            That of the result that this one goes on from, by the same number. Without it the state
            that this load step began from does not depend on the number.
        side : {0, 1, -1}
            1 and -1: the derivative for growing and for falling numbers, where the answer has a kink.

        Returns
        -------
        Sensitivity

        Raises
        ------
        InputError
            This answer has no derivatives, or none by this; the message says why.

        Examples
        --------
        A block that slips as a whole: its friction is proportional to the coefficient.

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
        >>> result.sensitivity("friction").force.round(9).tolist()
        [-0.01, -0.0]
        """
        from skfem_contact.answers.tangent.derivatives import sensitivity

        return sensitivity(self.linearized, by, after, side)

    # -- printed ------------------------------------------------------------------------------

    def report(self) -> str:
        """All that is printed, and what takes a moment: error estimates, validity, other answers.

        Warns
        -----
        ContactWarning
            As `validity` does.

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
        >>> result = solver.solve(x={"block": {"top": (0.02, -0.01)}})
        >>> print(result.report())
        Contact result: converged in ...
        <BLANKLINE>
        foot: block/bottom on floor
          Coulomb: 0 open, 0 stick, 5 slip
        ...
        """
        lines = [*_first_lines(self, estimate=True), "", _verdict(self)]
        lines += str(self.validity).splitlines()
        for text in self.validity.problems.values():
            lines += [f"  ! {textwrap.fill(text, 96, subsequent_indent='    ')}"]
        answer = self._answer
        from skfem_contact.answers.uniqueness import fall_lines, jump_lines

        other_answers = [*jump_lines(answer), *fall_lines(answer), *_uniqueness_lines(self)]
        lines += ["", *other_answers] if other_answers else []
        return "\n".join([*lines, *_last_lines(self)])

    def __repr__(self) -> str:
        lines = [f"<ContactResult: {_headline(self)}"]
        for values in self:
            lines.append(f"  {values.name}: {status_words(values)}; force {written(values.force)}")
        return "\n".join(lines) + ">"

    def __str__(self) -> str:
        lines = _first_lines(self, estimate=False)
        lines += ["", _verdict(self), *_last_lines(self), "", MORE]
        return "\n".join(lines)

    def _repr_html_(self) -> str:
        """The headline, a row per contact and the certificate, in HTML for notebooks."""
        from html import escape  # for notebooks alone

        heads = ("contact", "points", "force on the secondary", "largest pressure", "contact area")
        rows = []
        for values in self:
            peak = f"{np.max(values.pressure, initial=0.0):.6g}"
            row = f"{values.name}: {values.contact.label}", status_words(values), written(values.force)
            cells = "".join(f"<td>{escape(c)}</td>" for c in (*row, peak, f"{values.contact_area:.6g}"))
            rows.append(f"<tr>{cells}</tr>")
        head = "".join(f"<th>{name}</th>" for name in heads)
        return (
            f"<p><b>Contact result:</b> {escape(_headline(self))}</p>"
            f"<table><thead><tr>{head}</tr></thead><tbody>{''.join(rows)}</tbody></table>"
            f"<p>{escape(_verdict(self))}; "
            f"certificate: {self.certificate.worst:.1e} at worst</p>"
        )

    def __getstate__(self) -> dict[str, Any]:
        """All that reports and pictures need, computed before the functions stay behind."""
        for values in self.values:
            values.contact_area  # noqa: B018
            if np.any(values.status != OPEN):
                values.error_estimate  # noqa: B018
        return {name: value for name, value in vars(self).items() if name != "linearized"}


def _values(answer: Answer, i: int, part: slice) -> ContactValues:
    kin, state, contact = answer.kin, answer.local, answer.contacts[i]
    status, smooth = state.status[part], _smooth(answer, part)
    if np.count_nonzero(smooth):
        status = np.where(smooth & (status != OPEN), SLIP, status)
    heir = kin.heir[part] - part.start
    gap, wear, area = answer.gap[part], state.wear[part], kin.area[part]
    if kin.inherits:
        gap, wear, status = gap[heir], wear[heir], status[heir]
        area = np.where(heir == np.arange(len(heir)), area, 0.0)
    lost, before = answer.dissipation_by_contact[i], answer.dissipation_before[i]
    return ContactValues(
        name=answer.names[i],
        contact=contact,
        points=contact.secondary.points,  # those of kin have moved, where contact slides far
        normal=kin.normal[part],
        tangent=kin.tangent[part],
        gap=gap,
        lost=_lost(answer, i, part),
        status=status,
        normal_force=state.normal_force[part],
        tangential_force=-kin.friction_along(state.tangential_force[part], part),
        area=area,
        surface=contact.secondary,
        heir=heir,
        action=answer.action[part],
        dissipation=float(lost),
        dissipation_total=float(before + lost),
        energy_residual=float(answer.residual_by_contact[i]),
        wear_depth=wear,
        worn_volume=float(state.worn[part].sum()),
        assess=partial(_estimate, answer),
        slips=partial(_slip, answer, part),
        placed=partial(_placed, answer, contact),
    )


def _estimate(answer: Answer, values: ContactValues) -> ErrorEstimate:
    from skfem_contact.answers.estimate import estimate  # most results are never asked for it

    return estimate(answer, values)


def _placed(answer: Answer, contact: Contact) -> ContactSurface:
    """The secondary surface whose areas count: the deformed one, where strains may be large."""
    surface = contact.secondary
    if contact.sliding == "small" or not getattr(surface.body, "finite_strain", False):
        return surface
    return surface.moved(answer.displacement(surface.body))


def _smooth(answer: Answer, part: slice) -> NDArray[np.bool_]:
    """Points without friction or glue: nothing tangential is solved for."""
    slipping = answer.model.interface.slipping[part]
    return ~slipping if answer.kin.tangents else np.zeros(len(slipping), dtype=bool)


def _lost(answer: Answer, i: int, part: slice) -> NDArray[np.bool_]:
    """See `ContactValues.lost`."""
    contact, tracks = answer.contacts[i], answer.diagnostics.tracks
    if contact.sliding == "small" or not tracks:
        return np.zeros(part.stop - part.start, dtype=bool)
    # a node that handed its multiplier on has a partner
    own = answer.kin.heir[part] == np.arange(part.start, part.stop)
    gone = tracks[i].paired & ~answer.kin.paired[part] & own
    facets, presses = contact.secondary.facets, answer.state.normal_force[part] > 0
    beside = np.zeros(len(gone), dtype=bool)
    beside[facets[presses[facets].any(axis=1)]] = True
    return gone & beside


def _slip(answer: Answer, part: slice) -> Array:
    kin, state, t = answer.kin, answer.local, answer.kin.tangents
    slip, smooth = (state.slip - state.reference)[part], _smooth(answer, part)
    if np.count_nonzero(smooth):
        rows = slice(part.start * t, part.stop * t)
        moved = (kin.B_t[rows] @ answer.u).reshape(-1, t) + answer.seen.slip0[part]
        moved = np.where((state.status[part] != OPEN)[:, None], moved, 0.0)
        slip = np.where(smooth[:, None], moved, slip)
    slip = kin.slip_along(slip, part)
    return slip[kin.heir[part] - part.start] if kin.inherits else slip


#: What a printed result leaves to the report, and how to get it.
MORE = (
    "print(result.report()) adds the estimated error of the mesh, the validity of the model in\n"
    "numbers, and whether there are other answers."
)


def _headline(result: ContactResult) -> str:
    factor = "" if result.factor is None else f" (load factor {result.factor:g})"
    return result.message + factor


def _first_lines(result: ContactResult, estimate: bool) -> list[str]:
    lines = [f"Contact result: {_headline(result)}"]
    for values in result:
        lines += ["", *contact_lines(values, estimate)]
    if result.bolts:
        lines += ["", *map(str, result.bolts.values())]
    if result.rotations:
        turned = ", ".join(f"{name} {angle:.2g} rad" for name, angle in result.rotations.items())
        lines += ["", f"rotation of the contact surfaces (linear bodies follow to 0.1): {turned}"]
    said = [*result.indifferent, *result.undetermined]
    return lines + (["", *said] if said else [])


def _last_lines(result: ContactResult) -> list[str]:
    lines = ["", "Certificate (dimensionless; round-off where everything holds)"]
    lines += str(result.certificate).splitlines()
    seconds = ", ".join(f"{k} {v:.3g} s" for k, v in result.timings.items())
    linear = result._answer.linear
    lines += ["", f"linear problems: {linear}"] if linear else [""]
    return [*lines, f"{result.iterations} iteration{'s' if result.iterations != 1 else ''}; {seconds}"]


def _verdict(result: ContactResult) -> str:
    """Return whether the model holds, and what its history has warned of before, in a line."""
    validity = result.validity
    words = "Validity of the model: " + ("holds" if validity.holds else "DOES NOT HOLD")
    words += f" ({_listed(validity.problems)})" if validity.problems else ""
    before = f"; warned of before in this history: {_listed(validity.before)}"
    return words + (before if validity.before else "")


def _listed(keys: Iterable[tuple[str, str]]) -> str:
    return ", ".join(f"{kind} of {name!r}" for kind, name in sorted(keys))


def _shown(known: Uniqueness) -> str:
    """Return whether there is one answer, as far as that is shown."""
    if known.only_one:
        return "this load has no other answer" + (
            ""
            if np.isinf(known.unique_up_to)
            else f": shown for friction up to {known.unique_up_to:.3g} times this"
        )
    words = "whether this load has other answers is not known"
    if known.unique_up_to > 0:
        words += f"; that it has none is shown for friction up to {known.unique_up_to:.2g} times this"
    return words


def _uniqueness_lines(result: ContactResult) -> list[str]:
    """Say what a report says of other answers: in the plane nothing where none are to be feared."""
    answer = result._answer
    if not any(contact.friction for contact in result.contacts):
        return []
    solid = answer.kin.tangents == 2
    looked_at = 0 < answer.recover.unknowns <= MOST_ROWS
    known = result.uniqueness if looked_at else None
    if known is None:
        return ["whether this load has other answers is not looked at"] if solid else []
    end = ["this is the one found from the state before"]
    if known.index < 0 and known.held:
        return ["this load has at least two other answers (the index of this one is -1);", *end]
    if not known.may_be_several.any():
        return [_shown(known)] if solid else []
    over = np.where(known.may_be_several, known.friction / known.critical_friction, 0.0)
    i = int(np.argmax(over))
    mu, critical = known.friction[i], known.critical_friction[i]
    return [
        f"with mu = {mu:.3g} above {critical:.2f} at {written(answer.kin.points[i])} "
        "the load may have several answers;",
        *end,
    ]
