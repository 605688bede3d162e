"""`Answer`: what one load step has come to, as the modules of this library see it.

Users have a `ContactResult`, which holds one and shows what is theirs; `answer_of` takes it out. The
forces of contacts on the DOFs follow from it, and those of supports: what equilibrium misses there.
`Placed` says where bodies that are not linear are, what they resist with, and what they remember.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import field, replace
from functools import cached_property
from typing import Any

import numpy as np
from scipy.sparse import block_diag, csr_matrix

from skfem_contact.answers.validity.validity import Diagnostics
from skfem_contact.arguments import numbers
from skfem_contact.arrays import Array, Mask, cross, size_of
from skfem_contact.assemblies.bolt import Bolts
from skfem_contact.bodies.body import Body, body_nodes
from skfem_contact.bodies.member import Member
from skfem_contact.bodies.member import State as Internal
from skfem_contact.bodies.selection import boundary_dofs
from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.bodies.system import System
from skfem_contact.conditions.contact import Contact
from skfem_contact.conditions.friction import CheckedLaw
from skfem_contact.conditions.friction_rule import friction_bound
from skfem_contact.conditions.interface import Identity, point_slices
from skfem_contact.conditions.kinematics import Kinematics
from skfem_contact.conditions.state import OPEN, LoadCase, LocalState, State
from skfem_contact.digits import COMPUTED
from skfem_contact.errors import InputError
from skfem_contact.loops.step import Record
from skfem_contact.problem.model import LinearModel
from skfem_contact.problem.points import Conditions
from skfem_contact.records import copied, dataclass, once, seal, sealed


@dataclass(frozen=True, eq=False)
class Placed:
    """All bodies at some displacements.

    Attributes
    ----------
    u : ndarray, shape (n,)
        [length]
    stiffness : tuple of csr_matrix
        The tangent of each body; of linear ones the very matrix that they always have.
    internal : ndarray, shape (n,)
        Internal forces, less `beyond` [force].
    beyond : ndarray, shape (n,)
        By how much the load of fluids is another than on the undeformed boundary [force].
    material : tuple of bodies.member.State
        Internal variables of each body there; none of linear ones.
    trend : ndarray, shape (n,)
        How the displacements changed in the last part of a load step, over its share of it [length].
    rims : csr_matrix, shape (n, n), or None
        The part of the derivative of the load of fluids that is not symmetric: it belongs to the rims
        of the pressed surfaces. Without what supports bear; None where nothing is left.
    """

    u: Array
    stiffness: tuple[csr_matrix, ...]
    internal: Array
    beyond: Array
    material: tuple[Internal, ...]
    trend: Array
    rims: csr_matrix | None = None

    @classmethod
    def of_start(cls, system: System, stiffness: Sequence[csr_matrix], start: Any) -> Placed:
        """Where a load step begins: undeformed, or at the end of a step before; not linearised yet."""
        states = tuple(body.initial_state for body in system.bodies)
        u = trend = zero = np.zeros(system.n)
        if start is not None:
            u, states, trend = start.u, start.material, start.trend
            if not states:
                raise InputError(
                    "start has no internal variables of the bodies that are not linear here: it is a "
                    "state of linear ones. Begin without start, or with a state of this kind of bodies."
                )
        return cls(u, tuple(stiffness), zero, zero, states, trend)

    def moved(self, system: System, u: Array, apart: Mapping[int, Array]) -> Placed:
        """The bodies at other displacements, from what they remember here, pressed by fluids.

        Raises
        ------
        MaterialError
            A body has no answer.
        """
        stiffness, states = list(self.stiffness), list(self.material)
        internal, beyond = np.zeros((2, system.n))
        bodies: tuple[Any, ...] = system.bodies
        odd = [csr_matrix((body.n, body.n)) for body in bodies]
        for i, body in enumerate(bodies):
            part = system.slice(body)
            if body.nonlinear:
                stiffness[i], internal[part], states[i] = body.linearize(u[part], self.material[i])
            else:
                internal[part] = stiffness[i] @ u[part]
            if body.finite_strain and i in apart:
                beyond[part], slope = fluid_beyond(body, apart[i], u[part])
                stiffness[i] = csr_matrix(stiffness[i] - 0.5 * (slope + slope.T))
                odd[i] = _of_rims(body, slope)
        rims = csr_matrix(block_diag(odd)) if any(half.nnz for half in odd) else None
        forces = sealed(internal - beyond), sealed(beyond)
        return Placed(sealed(u), tuple(stiffness), *forces, tuple(states), self.trend, rims)

    def stiffened(self, undeformed: Sequence[csr_matrix], share: float) -> Placed:
        """With a share of the tangents of the undeformed bodies added to those of here."""
        if not share:
            return self
        pairs = zip(self.stiffness, undeformed, strict=True)
        stiffness = tuple(K if K is own else csr_matrix(K + share * own) for K, own in pairs)
        return replace(self, stiffness=stiffness)

    def origin(self, model: LinearModel) -> Placed:
        """What the unknowns of the linear problem near here count from.

        Here: what is left near an answer is small, and so is its round-off, however far bodies have
        come and however soft their tangents are. Of linear condensed bodies zero, which remember what
        their loads do: that is the same in all iterates.
        """
        system = model.system
        u, forces = np.array(self.u), np.array(self.internal)
        for body in system.bodies:
            if not body.nonlinear and model.route == "condensed":
                u[system.slice(body)] = forces[system.slice(body)] = 0.0
        return replace(self, u=u, internal=forces)

    def seen(self, case: LoadCase, kin: Kinematics, model: LinearModel) -> LoadCase:
        """A load case for what is beyond here; springs that a model has besides resist `u` as well."""
        forces = self.internal.copy()
        parts = model.system.spans, self.stiffness, model.stiffness
        for part, own, other in zip(*parts, strict=True):
            if own is not other and self.u[part].any():
                forces[part] += (other - own) @ self.u[part]
        slipped = (kin.B_t @ self.u).reshape(case.slip0.shape)
        slipped[~model.interface.slipping] = 0.0  # their slips are no unknowns
        gap, slip = case.gap0 + kin.B_n @ self.u, case.slip0 + slipped
        return copied(case, f=case.f - forces, x=case.x - self.u, gap0=gap, slip0=slip)


def fluid_beyond(body: Any, pressures: Array, u: Array) -> tuple[Array, csr_matrix]:
    """What a fluid has on the boundary at u beyond its load on the undeformed one; the derivative."""
    load, slope = body.pressed(pressures, u)
    return load - body.pressed(pressures)[0], slope


def _of_rims(body: Any, slope: csr_matrix) -> csr_matrix:
    """The half of the derivative of a body's load that is not symmetric, but what supports bear."""
    odd = csr_matrix(0.5 * (slope - slope.T))
    row = np.repeat(np.arange(body.n), np.diff(odd.indptr))
    least = COMPUTED * size_of(slope.data)
    odd.data[np.isin(row, body.D) | (np.abs(odd.data) <= least)] = 0.0
    odd.eliminate_zeros()
    return odd


def point_forces(kin: Kinematics, state: LocalState) -> Array:
    """Forces of all contacts on the DOFs, ``B_n' lambda - B_t' tau``, shape (n,) [force]."""
    contact: Array = kin.B_n.T @ state.normal_force
    if state.tangential_force.any():
        contact = contact - kin.B_t.T @ state.tangential_force.ravel()
    return contact


# -- the log of a load step ------------------------------------------------------------------------


@dataclass(frozen=True)
class Iteration:
    """One linearisation of the bodies, and the step that it led to.

    Attributes
    ----------
    number : int
        Within its part of the load step.
    aim : float
        Share of the load step at the end of that part; 1 where it was not cut.
    residual : float
        Largest force that is missing to equilibrium after it, over the largest force that acts.
    step : float
        Share of the step that was taken: 1 where the residual fell at once.
    contact : int
        Iterations of contact.
    """

    number: int
    aim: float
    residual: float
    step: float
    contact: int

    def __str__(self) -> str:
        words = f"{self.number:3d}  residual {self.residual:8.1e}  contact {self.contact:3d}"
        words += "" if self.step == 1.0 else f"  {self.step:.3g} of a step"
        return words + ("" if self.aim == 1.0 else f"  to {self.aim:.4g} of the load step")


class Newton(tuple[Iteration, ...]):
    """The linearisations of a load step, in their order; printed, a line for each.

    Examples
    --------
    >>> print(Newton([Iteration(1, 1.0, 2e-3, 1.0, 4), Iteration(2, 1.0, 5e-12, 1.0, 1)]))
      1  residual  2.0e-03  contact   4
      2  residual  5.0e-12  contact   1
    """

    __slots__ = ()

    def __str__(self) -> str:
        return "\n".join(map(str, self))


@dataclass(eq=False)
class Answer:
    """The numbers of an answer, over the points of all contacts, one contact after the other.

    Attributes
    ----------
    model : LinearModel
        What was solved for: bodies, pairing, stiffness.
    contacts : tuple of Contact
        With the laws that the answer is judged by; a test may judge it by others.
    mismatch : float
        How far the pairing is from that of the answer itself.
    trace : tuple of Record
        Of all attempts at the load step and its parts.
    factor : float or None
        The number of the load step, where it was one.
    action : ndarray, shape (m, d)
        Where the force of each point acts on the secondary, see `Kinematics`; of bodies that slide far
        at the end of the step [length].
    plastic_slip : ndarray, shape (m, d-1)
        What friction acts on: slip of this step, or of its last part where it was cut, less what a
        finite tangential stiffness gives back; positive as the resisting force is [length].
    conditions : Conditions
        What the last linear solve held every point to: with it the answer can be differentiated.
    linear : str
        How linear problems were solved, and why, where bodies or surfaces are large; else empty.
    indifferent : tuple of str
        A sentence per motion that nothing loads and nothing holds.
    before : LocalState or None
        The state that the load step began from, along the tangents of its pairing.
    parts : int
        Into how many parts it was cut.
    springs : bool
        Whether contact rows depend on each other, so that points were seen through springs.
    bolts : Bolts or None
        Of the solver.
    placed : Placed or None
        Where bodies that are not linear are, and what they remember; None where all are linear.
    newton : Newton
        Their linearisations.
    diagnostics : Diagnostics
        What every step tells of the bounds of the model, set once it has been looked at; `validity` has
        more.
    """

    model: LinearModel
    contacts: tuple[Contact, ...]
    kin: Kinematics
    case: LoadCase
    seen: LoadCase
    state: State
    gap: Array = field(repr=False)
    action: Array = field(repr=False)
    plastic_slip: Array = field(repr=False)
    mismatch: float
    converged: bool
    message: str
    trace: tuple[Record, ...]
    timings: dict[str, float]
    dissipation_by_contact: Array
    dissipation_before: Array
    residual_by_contact: Array
    recover: Any = field(repr=False)
    conditions: Conditions = field(repr=False)
    factor: float | None = None
    linear: str = ""
    indifferent: tuple[str, ...] = ()
    before: LocalState | None = field(default=None, repr=False)
    parts: int = 1
    springs: bool = False
    bolts: Bolts | None = field(default=None, repr=False)
    placed: Placed | None = field(default=None, repr=False)
    newton: Newton = field(default_factory=Newton, repr=False)
    diagnostics: Diagnostics = field(default_factory=Diagnostics, repr=False)

    def __post_init__(self) -> None:
        # points without a multiplier of their own show the gap of the point that has it
        self.gap = self.gap[self.kin.heir]
        self._seal()

    def _seal(self) -> None:
        seal(self, self.state, self.case, self.seen, self.conditions, self.model.interface)

    def __getstate__(self) -> dict[str, Any]:
        """All that reports and pictures need, without the factors of the bodies and functions."""
        self.u  # noqa: B018 (recovered before the factors stay behind)
        self.bound_before  # noqa: B018 (all that is asked of the state before)
        tracks = tuple(track.carried() for track in self.diagnostics.tracks)
        diagnostics = replace(self.diagnostics, tracks=tracks)
        return {**vars(self), "before": None, "diagnostics": diagnostics}

    def __setstate__(self, known: dict[str, Any]) -> None:
        vars(self).update(known)
        self._seal()
        seal(self.kin)  # a pairing that is solved on has been

    @property
    def system(self) -> System:
        """The bodies."""
        return self.model.system

    @property
    def names(self) -> tuple[str, ...]:
        """Of the contacts."""
        return self.model.interface.names

    @property
    def stiffness(self) -> tuple[Any, ...]:
        """Of each body."""
        return self.model.stiffness

    @property
    def tangential_stiffness(self) -> Array:
        """Of sticking points, ``inf`` where they stick exactly, (m,) [force/length]."""
        return self.model.interface.stiffness

    @property
    def iterations(self) -> int:
        """Of the load step, with all its attempts and parts."""
        return len(self.trace)

    @property
    def material(self) -> tuple[Internal, ...]:
        """Internal variables of each body; empty where all are linear."""
        return () if self.placed is None else self.placed.material

    @property
    def trend(self) -> Array:
        """Return how the displacements changed last, of bodies that are not linear; see `Placed`."""
        return np.zeros(self.system.n) if self.placed is None else self.placed.trend

    @property
    def load(self) -> Array:
        """Return the load on all bodies, that of fluids on the deformed boundary, (n,) [force]."""
        return self.case.f if self.placed is None else self.case.f + self.placed.beyond

    @cached_property
    def internal(self) -> Array:
        """Internal forces of all bodies, (n,) [force]: ``K u`` of linear ones."""
        if self.placed is not None:
            return self.placed.internal + self.placed.beyond
        parts = [
            K @ self.u[self.system.slice(body)]
            for body, K in zip(self.system.bodies, self.stiffness, strict=True)
        ]
        return np.concatenate(parts)

    @cached_property
    def measured(self) -> dict[tuple[str, str], float]:
        """Return what has been measured of bodies, by kind and name, for all who ask for it."""
        return {}

    @cached_property
    def bound_before(self) -> Array:
        """Bounds of friction that the load step began with, zero at open points, (m,) [force]."""
        if self.before is None:
            return np.zeros(len(self.gap))
        return sealed(friction_bound(self.model.interface.laws, self.before))

    @cached_property
    def local(self) -> LocalState:
        """The state along the tangents of the pairing that the answer was found on."""
        return self.state.along(self.kin)

    @once
    def u(self) -> Array:
        """Displacements of all bodies, shape (n,) [length]; recovered when first asked for."""
        return sealed(self.recover())

    @property
    def worn_case(self) -> LoadCase:
        """The loads, with the gaps that a depth worn off leaves."""
        return self.case.worn(self.state.wear)

    def closed(self, i: int) -> Mask:
        """The points of a contact that are closed and have a partner, (m_i,)."""
        part = self.model.interface.point_slices[i]
        return np.asarray((self.state.status[part] != OPEN) & self.kin.paired[part])

    def at_surfaces(self) -> Array:
        """Displacements (n,) of surfaces that slide far and at supports, zero elsewhere [length]."""
        u, D = self.model.geometry.spread(self.state.surface), self.system.D
        u[D] = self.case.x[D]
        return u

    def displacement(self, body: Any) -> Array:
        """Displacements of one body, by name or itself, as its basis numbers them, (n_body,)."""
        return self.u[self.system.slice(body)]

    def moved(self, side: ContactSurface) -> Array:
        """Where the nodes of a surface are, (m, d) [length]."""
        return np.asarray(side.points + self.displacement(side.body)[side.dofs])

    @property
    def bolt_names(self) -> tuple[str, ...]:
        """Of the bolts."""
        return () if self.bolts is None else self.bolts.names

    @once
    def tightness(self) -> dict[str, tuple[float, float]]:
        """Shift and force of each bolt by name, from all displacements [length], [force]."""
        bolts = self.bolts
        return {} if bolts is None or not bolts.names else bolts.found(self.case, self.u)

    def stretched(self, body: Member | str) -> Array:
        """Displacements (n_body,) that have the strains of a body: with its bolts drawn together."""
        u, known = self.displacement(body), self.tightness
        if self.bolts is None or not known:
            return u
        return self.bolts.stretched(self.u, known)[self.system.slice(body)]

    def slices(self) -> list[slice]:
        """The points of each contact in the joint numbering."""
        return list(point_slices(self.contacts))

    def frictional(self) -> Iterator[tuple[Contact, slice, str, CheckedLaw]]:
        """Contacts with friction, their points, names, and the laws that the answer is judged by."""
        for contact, part, name in zip(self.contacts, self.slices(), self.names, strict=True):
            if contact.friction is not None:
                yield contact, part, name, CheckedLaw(contact.friction, name, contact.secondary.points)

    @property
    def identity(self) -> Identity:
        """The bodies and contacts that this is a state of."""
        return self.model.geometry.identity


def answer_of(result: Any) -> Answer:
    """The answer that a `ContactResult` holds; an answer is its own."""
    found: Answer = result if isinstance(result, Answer) else result._answer
    return found


def contact_forces(answer: Answer) -> Array:
    """Forces of all contacts on the DOFs, ``B_n' lambda - B_t' tau``, shape (n,) [force]."""
    return point_forces(answer.kin, answer.local)


def support_forces(answer: Answer, body: Member | str, boundary: str | None) -> Array:
    """``K u - f`` less the contact forces at prescribed DOFs of a body; zero elsewhere, (n_body,).

    Parameters
    ----------
    answer : Answer
    body : Body, RigidBody or str
    boundary : str or None
        Of the body's mesh; None for all of it.
    """
    i, span = answer.system.index(body), answer.system.slice(body)
    own, name = answer.system.bodies[i], answer.system.names[i]
    where = own.D
    if boundary is not None and not isinstance(own, Body):
        raise InputError(f"rigid body {name!r} has no boundary {boundary!r}: its supports are its D")
    if boundary is not None and isinstance(own, Body):
        where = np.intersect1d(where, boundary_dofs(own.basis, boundary, f"reaction of body {name!r}"))
    if not len(where):
        place = "" if boundary is None else f" on its boundary {boundary!r}"
        raise InputError(
            f"body {name!r} has no prescribed DOFs{place}, so no support pushes there. Forces of a "
            "contact are in result[contact].force."
        )
    residual = answer.internal[span] - answer.load[span]
    residual -= contact_forces(answer)[span]
    supports = np.zeros(own.n)
    supports[where] = residual[where]
    # of rigid bodies force and moment: rotations are lengths in the system, see `scale`
    return np.asarray(supports * answer.system.scale(own))


def reaction(answer: Answer, body: Member | str, boundary: str | None) -> Array:
    """See `ContactResult.reaction`."""
    forces = support_forces(answer, body, boundary)
    own = answer.system.bodies[answer.system.index(body)]
    if not isinstance(own, Body):
        return forces
    return np.array([forces[own.dof_component == k].sum() for k in range(own.components)])


def reaction_moment(answer: Answer, body: Member | str, boundary: str | None, about: Any) -> Any:
    """See `ContactResult.reaction_moment`."""
    system, forces = answer.system, support_forces(answer, body, boundary)
    i = system.index(body)
    own = system.bodies[i]
    if own.components < own.dim:
        raise InputError(f"body {system.names[i]!r} has a scalar field: flows have no moment")
    nodes = body_nodes(own) if isinstance(own, Body) else np.arange(own.dim)[None]
    at = own.dof_points[nodes[:, 0]]
    far = [c for c in answer.contacts if c.sliding == "finite"]
    sides = [c.secondary.body for c in far] + [getattr(c.primary, "body", c.primary) for c in far]
    if own.finite_strain or any(side is own for side in sides):
        at = at + answer.displacement(body)[nodes]
    total = moment(at, forces[nodes], about, any(b.axisymmetric for b in system.solids.values()))
    couple = forces[own.rotations]  # of a rigid body
    return total + (couple if own.dim == 3 else couple.sum()) if len(couple) else total


def moment(at: Array, forces: Array, about: Any, axisymmetric: bool) -> Any:
    """Moment of forces (k, d) about a point, the origin for None: a number in the plane, else (3,).

    NaN of axisymmetric bodies: those on the other side of a ring are not among the forces.
    """
    d = at.shape[1]
    centre = np.zeros(d) if about is None else numbers(about, "about", f"give {d} coordinates")
    if centre.shape != (d,):
        raise InputError(f"about has shape {centre.shape}; give a point of {d} coordinates")
    total = cross(at - centre, forces).sum(axis=0)
    if axisymmetric:
        return float("nan")
    return float(total[0]) if d == 2 else total
