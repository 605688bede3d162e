"""`ContactResult`: the answer of one load step, per contact and for all bodies, and its certificate."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from skfem_contact.certificate import Certificate, certify
from skfem_contact.contact import Contact
from skfem_contact.errors import InputError
from skfem_contact.estimate import ErrorEstimate, estimate
from skfem_contact.fields import closed_area, displaced, edge_positions, interpolate
from skfem_contact.inputs import suggest
from skfem_contact.interface import point_slices
from skfem_contact.kinematics import Kinematics
from skfem_contact.loads import LoadCase
from skfem_contact.rotation import rigid_rotations
from skfem_contact.states import State
from skfem_contact.surface import ContactSurface
from skfem_contact.system import System
from skfem_contact.uniqueness import Uniqueness, uniqueness

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Record:
    """What one iteration did: a line of the log."""

    iteration: int
    open: int
    stick: int
    slip: int
    changes: int
    residual: float
    note: str = ""

    def __str__(self) -> str:
        return (
            f"{self.iteration:4d}  open {self.open:5d}  stick {self.stick:5d}  slip {self.slip:5d}"
            f"  changes {self.changes:5d}  law {self.residual:8.1e}  {self.note}".rstrip()
        )


@dataclass(frozen=True, eq=False)
class ContactValues:
    r"""The answer on the secondary surface of one contact, over all its m points.

    ``traction = pressure * normal + tangential_force * tangent / area`` acts on the secondary body,
    in global axes.

    Attributes
    ----------
    points, normal : ndarray, shape (m, d)
        Position on the undeformed secondary surface; unit normal from primary to secondary.
    tangent : ndarray, shape (m, d-1, d)
    gap : ndarray, shape (m,)
        Positive where open; ``inf`` where a point has no partner [length].
    slip : ndarray, shape (m, d-1)
        Of the secondary relative to the primary, since the point closed [length].
    status : ndarray of int, shape (m,)
        0 open, 1 stick, 2 slip. Closed points of a frictionless contact are 2.
    normal_force : ndarray, shape (m,)
        Compressive force [force]; for a tied scalar field, the flow into the secondary.
    tangential_force : ndarray, shape (m, d-1)
        Friction on the secondary along the tangents [force].
    area : ndarray, shape (m,)
        Tributary area; zero at points without one of their own, see `pressure`.
    surface : ContactSurface
        The secondary surface, undeformed.
    heir : ndarray of int, shape (m,)
        The point whose pressure and traction hold at each point; itself in general.
    action : ndarray, shape (m, d)
        Where the force of each point acts; its position in general.
    dissipation, dissipation_total : float
        Energy lost by friction in this step, and since the start of the history [energy]. The mean
        of the forces at both ends of a step times the slip, which closes the energy balance with
        the trapezoidal work of the loads; a step that turns gross sliding round in one go counts
        as nothing, so take several.
    """

    name: str
    points: Array
    normal: Array
    tangent: Array
    gap: Array
    slip: Array
    status: NDArray[np.intp]
    normal_force: Array
    tangential_force: Array
    area: Array
    surface: ContactSurface
    heir: NDArray[np.intp]
    action: Array
    dissipation: float
    dissipation_total: float
    assess: Callable[[ContactValues], ErrorEstimate] = field(repr=False)

    @property
    def pressure(self) -> Array:
        """Normal force over tributary area, not negative in compression, shape (m,) [stress].

        With ``method="mortar"`` these are the coefficients of the multiplier; node by node, the
        pressure that has these nodal forces to second order in the size of the facets, averaged
        with the shape function of the node. Points without an area of their own have the value of
        their `heir`: nodes merged by the mortar method, and the node of a quadratic facet that is
        on the axis of symmetry.
        """
        return self._over_area(self.normal_force)

    @property
    def friction_stress(self) -> Array:
        """Friction over tributary area along the tangents, shape (m, d-1) [stress]."""
        return self._over_area(self.tangential_force)

    def _over_area(self, force: Array) -> Array:
        area = self.area[self.heir].reshape(-1, *[1] * (force.ndim - 1))
        force = force[self.heir]
        return np.divide(force, area, out=np.zeros_like(force), where=area > 0)

    @property
    def forces(self) -> Array:
        """Force on the secondary at each point, in global axes, shape (m, d) [force]."""
        along = np.einsum("ik,ikd->id", self.tangential_force, self.tangent)
        return self.normal_force[:, None] * self.normal + along

    @property
    def traction(self) -> Array:
        """Stress vector on the secondary, in global axes, shape (m, d) [stress]."""
        return self._over_area(self.forces)

    @property
    def force(self) -> Array:
        """Resultant on the secondary body, shape (d,) [force]."""
        return self.forces.sum(axis=0)

    @property
    def force_on_primary(self) -> Array:
        """Resultant on the other side, a body or a rigid obstacle, shape (d,) [force]."""
        return -self.force

    def moment(self, about: ArrayLike = (0.0, 0.0)) -> float | Array:
        """Moment of the forces on the secondary about a point [force length]."""
        arm = self.action - np.asarray(about, dtype=float)
        F = self.forces
        if self.points.shape[1] == 2:
            return float(np.sum(arm[:, 0] * F[:, 1] - arm[:, 1] * F[:, 0]))
        return np.cross(arm, F).sum(axis=0)

    @cached_property
    def contact_edges(self) -> Array:
        """Where contact ends, located within a facet, shape (k, d) [length]; in 2-D.

        There ``gap**(2/3)``, extrapolated from the open side, vanishes; see `fields`. In the order
        of the points; ends of the surface that are closed are no edges.
        """
        return edge_positions(self._placed, self.status != 0, self.gap)

    @cached_property
    def contact_area(self) -> float:
        """Area in contact, in 2-D up to `contact_edges`; else that of the closed points [area]."""
        if self.points.shape[1] != 2:
            return float(self.area[self.status != 0].sum())
        return closed_area(self._placed, self.status != 0, self.gap)

    @cached_property
    def error_estimate(self) -> ErrorEstimate:
        """Estimated discretisation error of pressure and friction; see `estimate`. In 2-D."""
        return self.assess(self)

    def interpolate(self, values: ArrayLike, points: ArrayLike) -> Array:
        """A field over the points (``pressure``, ``traction``, ``slip``, ...) between them.

        Parameters
        ----------
        values : ndarray, shape (m, ...)
        points : ndarray, shape (p, d)
            Positions on the secondary surface; others are projected onto it [length].

        Returns
        -------
        ndarray, shape (p, ...)
        """
        values = np.asarray(values, dtype=float)
        if values.shape[:1] != self.area.shape:
            raise InputError(
                f"values have shape {values.shape}, but contact {self.name!r} has "
                f"{len(self.area)} points: give a value for each"
            )
        return interpolate(self._placed, values, np.asarray(points, dtype=float))

    def integrate(self, values: ArrayLike) -> float | Array:
        """Integral of a field over the points; of `traction` it is `force`, to round-off.

        Parameters
        ----------
        values : ndarray, shape (m, ...)
        """
        total = np.tensordot(self.area, np.asarray(values, dtype=float), axes=1)
        return float(total) if total.ndim == 0 else total

    @property
    def _placed(self) -> ContactSurface:
        return displaced(self.surface, self.points)


@dataclass(frozen=True, eq=False)
class ContactResult:
    """The answer of one load step.

    What a contact knows (`ContactValues`: pressure, traction, slip, status, ...) is reached by
    ``result[contact]`` or ``result["name"]``, and directly on the result when there is one contact.

    Attributes
    ----------
    converged : bool
    message : str
    iterations : int
    trace : tuple of Record
    timings : dict
        Seconds by stage.
    tangential_stiffness : ndarray, shape (m,)
        Of sticking points, ``inf`` where they stick exactly [force/length].
    factor : float or None
        The number of the load step, where it was one.
    settings : Settings
        The loads in force, from which the next step of a history begins.
    """

    system: System
    contacts: tuple[Contact, ...]
    names: tuple[str, ...]
    kin: Kinematics
    stiffness: tuple[Any, ...]
    case: LoadCase
    seen: LoadCase
    state: State
    gap: Array = field(repr=False)
    mismatch: float
    converged: bool
    message: str
    iterations: int
    trace: tuple[Record, ...]
    timings: dict[str, float]
    tangential_stiffness: Array = field(repr=False)
    dissipation_by_contact: Array
    dissipation_before: Array
    recover: Any = field(repr=False)
    settings: Any = field(repr=False)
    factor: float | None = None

    def __post_init__(self) -> None:
        # points without a multiplier of their own show the gap of the point that has it
        object.__setattr__(self, "gap", self.gap[self.kin.heir])

    @cached_property
    def u(self) -> Array:
        """Displacements of all bodies, shape (n,) [length]; recovered when first asked for."""
        return self.recover()

    def displacement(self, body: Any) -> Array:
        """Displacements of one body, by name or itself, as its basis numbers them, (n_body,)."""
        return self.u[self.system.slice(body)]

    def slices(self) -> list[slice]:
        """The points of each contact in the joint numbering."""
        return list(point_slices(self.contacts))

    def __getitem__(self, key: Contact | str | int) -> ContactValues:
        return self.values[self._position(key)]

    def _position(self, key: Contact | str | int) -> int:
        if isinstance(key, str):
            if key in self.names:
                return self.names.index(key)
            raise InputError(f"there is no contact {key!r}{suggest(key, self.names, 'contacts')}")
        if isinstance(key, int):
            if not -len(self.names) <= key < len(self.names):
                raise InputError(f"there is no contact number {key}, only {len(self.names)} from 0 on")
            return range(len(self.names))[key]
        for i, contact in enumerate(self.contacts):
            if contact is key:
                return i
        raise InputError("this contact is not one of those of the solver: pass the same object")

    @cached_property
    def values(self) -> tuple[ContactValues, ...]:
        """The answer of every contact, in the order given."""
        return tuple(self._values(i, part) for i, part in enumerate(self.slices()))

    def _values(self, i: int, part: slice) -> ContactValues:
        kin, state = self.kin, self.state
        t = kin.tangents
        slip = (state.slip - state.reference)[part]
        contact = self.contacts[i]
        status = state.status[part]
        if contact.friction is None and not contact.tied and t:
            rows = slice(part.start * t, part.stop * t)
            slip = (kin.B_t[rows] @ self.u).reshape(-1, t) + self.seen.slip0[part]
            slip = np.where(status[:, None] != 0, slip, 0.0)
            status = np.where(status != 0, 2, 0)
        heir = kin.heir[part] - part.start
        own = heir == np.arange(len(heir))
        return ContactValues(
            name=self.names[i],
            points=contact.secondary.points,  # those of kin have moved, where contact slides far
            normal=kin.normal[part],
            tangent=kin.tangent[part],
            gap=self.gap[part][heir],
            slip=slip[heir],
            status=status[heir],
            normal_force=state.normal_force[part],
            tangential_force=-state.tangential_force[part],
            area=np.where(own, kin.area[part], 0.0),
            surface=contact.secondary,
            heir=heir,
            action=kin.action[part],
            dissipation=float(self.dissipation_by_contact[i]),
            dissipation_total=float(self.dissipation_before[i] + self.dissipation_by_contact[i]),
            assess=lambda values: estimate(self, values),
        )

    @property
    def dissipation(self) -> float:
        """Energy lost by friction in this step, all contacts [energy]."""
        return float(self.dissipation_by_contact.sum())

    @property
    def dissipation_total(self) -> float:
        """Energy lost by friction since the start of the history, all contacts [energy]."""
        return float(self.dissipation_before.sum() + self.dissipation_by_contact.sum())

    @cached_property
    def rotations(self) -> dict[str, float]:
        """Mean rotation of the surfaces that slide far, by body [rad]; empty for small sliding.

        Linear bodies are good for rotations well below 0.1 rad.
        """
        return rigid_rotations(self.system, self.contacts, self.state.surface)

    @cached_property
    def certificate(self) -> Certificate:
        """Dimensionless numbers measured from the answer, for all degrees of freedom."""
        return certify(self)

    @cached_property
    def uniqueness(self) -> Uniqueness | None:
        """Whether this load, or loads like it, have other answers; computed when first asked for.

        The critical friction of every point, and the index of this answer, see `Uniqueness`. None
        where it is not computed: on the sparse route, and where contact rows depend on each other.
        """
        return uniqueness(self)

    def __getattr__(self, name: str) -> Any:
        # only reached when the result itself has no such attribute
        if name.startswith("_") or name not in FORWARDED:
            raise AttributeError(f"ContactResult has no attribute {name!r}")
        if len(self.names) != 1:
            raise AttributeError(
                f"'{name}' belongs to a contact and there are {len(self.names)} of them "
                f"({', '.join(self.names)}): write result['{self.names[0]}'].{name}"
            )
        return getattr(self.values[0], name)

    def __str__(self) -> str:
        from skfem_contact.report import (
            report,
        )  # the report is about results, and stands after them

        return report(self)


FORWARDED = frozenset(
    {
        "area",
        "contact_area",
        "contact_edges",
        "error_estimate",
        "force",
        "force_on_primary",
        "forces",
        "friction_stress",
        "integrate",
        "interpolate",
        "moment",
        "normal",
        "normal_force",
        "points",
        "pressure",
        "slip",
        "status",
        "tangent",
        "tangential_force",
        "traction",
    }
)
