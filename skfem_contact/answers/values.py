"""`ContactValues`: pressure, traction, gap and slip on the secondary surface of one contact.

`ErrorEstimate` has what is estimated of their errors, by its sources. Where a result has one contact,
the properties of its values stand on the result itself (`OfTheContact`).
"""

from __future__ import annotations

import textwrap
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import field, fields
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from skfem_contact.answers.answer import moment
from skfem_contact.answers.fields import Contour, contour, covers, interpolate
from skfem_contact.arguments import NamesAttributes, numbers
from skfem_contact.arrays import Array
from skfem_contact.bodies.selection import written
from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.conditions.contact import Contact
from skfem_contact.conditions.friction import steep_words
from skfem_contact.conditions.state import OPEN, SLIP, STATUS, STICK
from skfem_contact.digits import SOLVED
from skfem_contact.errors import InputError
from skfem_contact.records import dataclass, seal, sealed

#: Energy that the balance of a step misses, over the energy lost, from which on it is said: the loss of
#: the README's scene, pressed and released, is then wrong by a third of that.
COARSE = 0.05

#: Errors are told relative to the computed traction, from what it shows beside its edges. Up to this
#: share of it they are within a factor of three; beyond, points are too few to say by how much.
ESTIMATED = 0.3


@dataclass(frozen=True, eq=False, repr=False)
class ContactValues(NamesAttributes):
    r"""The answer on the secondary surface of one contact, over all its m points.

    ``traction = pressure * normal + tangential_force * tangent / area`` acts on the secondary body,
    in global axes.

    ``print(values)`` shows them in a few lines.

    Attributes
    ----------
    name : str
    contact : Contact
        Whose values these are.
    points, normal : ndarray, shape (m, d)
        Position on the undeformed secondary surface; unit normal from primary to secondary.
    tangent : ndarray, shape (m, d-1, d)
        Unit tangents, a matter of choice in 3-D: `slip_vector` and `tangential_force_vector` do not
        depend on it. In 2-D the normal turned by +90 degrees.
    gap : ndarray, shape (m,)
        Positive where open; ``inf`` where a point has no partner [length].
    lost : ndarray of bool, shape (m,)
        With ``sliding="finite"``: points that had a partner on the undeformed bodies and have none,
        beside points that press. Contact ends there within a facet.
    status : ndarray of int, shape (m,)
        0 open, 1 stick, 2 slip. Closed points of a frictionless contact are 2.
    normal_force : ndarray, shape (m,)
        Compressive force [force]; for a tied scalar field, the flow into the secondary.
    tangential_force : ndarray, shape (m, d-1)
        Friction on the secondary along the tangents [force].
    area : ndarray, shape (m,)
        Tributary area; zero at points without one of their own, see `pressure`. With
        ``sliding="finite"`` that of the deformed surface, if the body is one of finite strain or the
        method ``"mortar"``; else that of the undeformed one. A thickness (`measure`) goes with the
        body, rings are as long as they are now [area].
    surface : ContactSurface
        The secondary surface, undeformed.
    heir : ndarray of int, shape (m,)
        The point whose pressure and traction hold at each point; itself in general.
    action : ndarray, shape (m, d)
        Where the force of each point acts; its position in general. On the undeformed bodies, and with
        ``sliding="finite"`` where they are after the step [length].
    dissipation, dissipation_total : float
        Energy lost by friction in this step, and since the start of the history [energy]: the mean
        of the friction bounds at both ends of the step times the slip. Never negative, and exact
        whatever the step where the pressure is constant or grows in proportion with the slip.
    energy_residual : float
        What the energy balance of this step misses: trapezoidal work of loads, supports and
        obstacles, less elastic energy gained, less `dissipation` [energy]. Zero where forces and
        slips follow a straight path; beside the dissipation it tells how coarse the step is, and
        falls with the square of its size. With ``sliding="finite"`` without what turning frames
        add, which is of second order too. Not measured without friction. Wear takes energy besides:
        the mean force at both ends of the step on the depth that it wears off.
    wear_depth : ndarray, shape (m,)
        Depth worn off so far by `Archard`; `gap` is that of the worn surface [length].
    worn_volume : float
        Volume worn off so far [volume]: `k` times force times way, summed over points and steps.

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
    >>> values = result["foot"]
    >>> values.pressure.shape, values.traction.shape, values.slip.shape
    ((5,), (5, 2), (5, 1))
    >>> import numpy as np
    >>> bool(np.allclose(values.integrate(values.traction), values.force))
    True

    The block slips to the right, against the tangent, and friction on it acts to the left:

    >>> values.tangent[0, 0].tolist()
    [-1.0, 0.0]
    >>> i = int(np.argmax(np.abs(values.slip)))
    >>> bool(values.slip[i, 0] < 0), bool(values.slip_vector[i, 0] > 0)
    (True, True)
    >>> bool(values.tangential_force[i, 0] > 0), bool(values.traction[i, 0] < 0)
    (True, True)
    """

    name: str
    contact: Contact
    points: Array
    normal: Array
    tangent: Array
    gap: Array
    lost: NDArray[np.bool_]
    status: NDArray[np.intp]
    normal_force: Array
    tangential_force: Array
    area: Array
    surface: ContactSurface
    heir: NDArray[np.intp]
    action: Array
    dissipation: float
    dissipation_total: float
    energy_residual: float
    wear_depth: Array
    worn_volume: float
    assess: Callable[[ContactValues], ErrorEstimate]
    slips: Callable[[], Array]
    placed: Callable[[], ContactSurface]

    def __post_init__(self) -> None:
        seal(self)

    def __repr__(self) -> str:
        return f"<{self.name}: {status_words(self)}>"

    def __str__(self) -> str:
        return "\n".join(contact_lines(self, estimate=False))

    @cached_property
    def slip(self) -> Array:
        """Slip of the secondary relative to the primary since the point closed, (m, d-1) [length].

        The component along `tangent`: in 2-D that is `normal`, which points from the primary to the
        secondary, turned counter-clockwise, so that on a primary that faces upwards a slip to the
        left is positive. `slip_vector` is the same in global axes.

        Without friction nothing tangential is solved for: the slip is then measured on the
        displacements of all bodies, which are recovered for it when first asked for.
        """
        return sealed(self.slips())

    @property
    def slip_vector(self) -> Array:
        """The `slip` in global axes, shape (m, d) [length].

        Where the contact slides far it has turned with the normal of the point: what it was at the
        start of a step is brought into the tangent plane of the next pairing with its length.
        """
        return np.einsum("ik,ikd->id", self.slip, self._along)

    @property
    def tangential_force_vector(self) -> Array:
        """Friction on the secondary in global axes, shape (m, d) [force]."""
        return np.einsum("ik,ikd->id", self.tangential_force, self._along)

    @property
    def _along(self) -> Array:
        """The tangents that there are components along: none of a field with one component."""
        return self.tangent[:, : self.tangential_force.shape[1]]

    @property
    def pressure(self) -> Array:
        """Normal force over tributary area, positive in compression, shape (m,) [stress].

        By the deformed or the undeformed area, as `area` is: of bodies of large strain with
        ``sliding="small"`` it is force by initial area.
        Negative in tension, which contact without separation bears. With ``method="mortar"`` these
        are the coefficients of the multiplier; node by node, the pressure that has these nodal
        forces to second order in the size of the facets, averaged with the shape function of the
        node. Points without an area of their own have the value of their `heir`: nodes merged by the
        mortar method, and the node of a quadratic facet that is on the axis of symmetry.
        """
        return self._over_area(self.normal_force)

    @property
    def friction_stress(self) -> Array:
        """Friction over `area` along the tangents, shape (m, d-1) [stress]."""
        return self._over_area(self.tangential_force)

    def _over_area(self, force: Array) -> Array:
        area = self.area[self.heir].reshape(-1, *[1] * (force.ndim - 1))
        force = force[self.heir]
        return np.divide(force, area, out=np.zeros(force.shape), where=area > 0)

    @property
    def forces(self) -> Array:
        """Force on the secondary at each point, in global axes, shape (m, d) [force]."""
        return self.normal_force[:, None] * self.normal + self.tangential_force_vector

    @property
    def traction(self) -> Array:
        """Stress vector on the secondary by `area`, in global axes, shape (m, d) [stress]."""
        return self._over_area(self.forces)

    @property
    def force(self) -> Array:
        """Resultant on the secondary body, shape (d,) [force]."""
        return self.forces.sum(axis=0)

    @property
    def force_on_primary(self) -> Array:
        """Resultant on the other side, a body or a rigid obstacle, shape (d,) [force]."""
        return -self.force

    def moment(self, about: ArrayLike | None = None) -> Any:
        """Moment of the forces on the secondary about a point, the origin if none is given.

        Forces act at `action`: of bodies that slide far where they are after the step, else on the
        undeformed ones. Those of a ring have no moment: NaN of axisymmetric bodies.

        Parameters
        ----------
        about : array, shape (d,), optional
            [length]

        Returns
        -------
        float, or ndarray (3,) in 3-D
            [force length]

        Examples
        --------
        A block of unit width, pressed by 1 % and pushed aside: its forces lie ahead of the middle.

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
        >>> f"{result.moment():.4f}, {result.moment((0.5, 0.0)):.4f}"
        '0.0065, 0.0015'
        """
        return moment(self.action, self.forces, about, self.surface.body.axisymmetric)

    @cached_property
    def contact_edges(self) -> Array:
        """Return where contact ends, within a facet: points (k, 2), in 3-D segments (s, 2, 3) [length].

        There ``gap**(2/3)``, extrapolated from the open side, vanishes; see `fields`.
        In the order of the points or faces; ends of the surface that are closed are no edges.
        """
        edges = sealed(self._contour.segments)
        return edges if self.surface.dim == 3 else edges[:, 0]

    @cached_property
    def contact_area(self) -> float:
        """Area in contact, up to `contact_edges` [area]: of the same surface as `area`.

        With ``method="mortar"`` without the parts of facets that the primary does not cover.
        """
        return self._contour.area

    @property
    def _contour(self) -> Contour:
        """The edge of contact, and the area within."""
        placed = self.placed()
        cover: Array | float = 1.0
        if self.contact.method == "mortar" and not self.contact.rigid:
            cover = covers(placed, self.area, self.heir, np.isfinite(self.gap))
        return contour(self.surface, self.status != OPEN, self.gap, placed, cover)

    @cached_property
    def error_estimate(self) -> ErrorEstimate:
        """Estimated error of pressure and friction by the mesh; see `estimate`."""
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
        >>> result.interpolate(result.pressure, [(0.5, 0.0)]).shape
        (1,)
        """
        d = self.points.shape[1]
        at = numbers(points, "points", f"give positions (p, {d})")
        if at.ndim != 2 or at.shape[1] != d or not np.isfinite(at).all():
            raise InputError(
                f"points have shape {at.shape}, or are not finite; give positions (p, {d})"
            )
        return interpolate(self.surface, self._at_points(values), at)

    def integrate(self, values: ArrayLike) -> Any:
        """Integral of a field over the points by `area`; of `traction` it is `force`, to round-off.

        Parameters
        ----------
        values : ndarray, shape (m, ...)

        Returns
        -------
        float, or ndarray of shape (...)
        """
        total = np.tensordot(self.area, self._at_points(values), axes=1)
        return float(total) if total.ndim == 0 else total

    def _at_points(self, values: ArrayLike) -> Array:
        """A field over the points, checked."""
        field = numbers(values, "values", "give a number for each contact point")
        if field.shape[:1] != self.area.shape:
            raise InputError(
                f"values have shape {field.shape}, but contact {self.name!r} has "
                f"{len(self.area)} points: give a value for each"
            )
        return field


def status_words(values: ContactValues) -> str:
    """The law, and how many points are open, stick and slip."""
    contact, count = values.contact, [int(np.sum(values.status == k)) for k in (OPEN, STICK, SLIP)]
    if contact.tied:
        return f"{count[STICK]} points tied, {count[OPEN]} without partner"
    law = "frictionless" if contact.friction is None else type(contact.friction).__name__
    if not contact.separation:
        law = f"no separation, {law}"
    lonely = "" if np.isfinite(values.gap).any() else ", none with a partner"
    if values.lost.any():
        lonely = f", {np.count_nonzero(values.lost)} past the end of the primary beside what presses"
    if contact.friction is None:
        return f"{law}: {count[STICK] + count[SLIP]} points closed, {count[OPEN]} open{lonely}"
    counts = ", ".join(f"{n} {name}" for n, name in zip(count, STATUS, strict=True))
    return f"{law}: {counts}{lonely}"


def contact_lines(values: ContactValues, estimate: bool) -> list[str]:
    """The lines of one contact; `estimate`: also its estimated error, which takes a moment."""
    contact = values.contact
    lines = [f"{values.name}: {contact.label}", f"  {status_words(values)}"]
    lines.append(f"  force on the secondary   {written(values.force)}")
    lines.append(f"  contact area             {values.contact_area:.6g}")
    if np.any(values.status != OPEN):
        # glue pulls as well as it presses
        size = np.linalg.norm(values.traction, axis=1) if contact.tied else values.pressure
        what, peak = "traction" if contact.tied else "pressure", int(np.argmax(size))
        where = written(values.points[values.heir[peak]])  # not beyond an edge, see `pressure`
        if size[peak] > 0 or contact.separation:
            lines.append(f"  {f'largest {what}':<24s} {size[peak]:.6g} at {where}")
        lowest = int(np.argmin(values.pressure))
        if not (contact.tied or contact.separation) and values.pressure[lowest] < 0:
            where = written(values.points[lowest])
            lines.append(f"  largest tension          {-values.pressure[lowest]:.6g} at {where}")
    if contact.friction is not None:
        lines += _friction_lines(values)
    if values.worn_volume:
        deepest = int(np.argmax(values.wear_depth))
        where = f"{values.wear_depth[deepest]:.6g} deep at {written(values.points[deepest])}"
        lines.append(f"  worn off                 {values.worn_volume:.6g}, {where}")
    if estimate and np.any(values.status != OPEN):
        lines += _error_lines(values)
    open_gaps = values.gap[(values.status == OPEN) & np.isfinite(values.gap)]
    if len(open_gaps):
        lines.append(f"  smallest open gap        {open_gaps.min():.6g}")
    return lines


def _friction_lines(values: ContactValues) -> list[str]:
    size = np.linalg.norm(values.tangential_force, axis=1)
    lines = [
        f"  largest slip             {np.max(np.linalg.norm(values.slip, axis=1), initial=0.0):.6g}"
    ]
    if values.contact.separation:  # else the normal forces may cancel
        lines.append(f"  friction force / normal  {_share(size.sum(), values.normal_force.sum())}")
    if steep := steep_words(values.contact.friction):
        lines.append(f"  friction holds           {steep}")
    lines += [
        f"  energy lost by friction  {values.dissipation:.6g} in this step, "
        f"{values.dissipation_total:.6g} in all"
    ]
    if abs(values.energy_residual) > COARSE * values.dissipation:
        lines.append(
            f"  energy balance misses    {values.energy_residual:.3g} in this step: the load step is "
            "long, shorter ones tell the loss better"
        )
    return lines


def _error_lines(values: ContactValues) -> list[str]:
    error = values.error_estimate
    found = error.words
    if found.startswith("pressure"):
        found = f"pressure {percent(error.pressure.total)}"
        if values.friction_stress.any():
            found += f", with friction {percent(error.traction.total)}"
        found += " in L2"
    lines = [f"  estimated error          {found}"]
    return lines + [f"    {line}" for line in textwrap.wrap(error.advice, 92)]


def _share(part: float, whole: float) -> str:
    return f"{part / whole:.4f}" if whole > 0 else "-"


# -- errors ----------------------------------------------------------------------------------------


Elements = tuple[NDArray[np.intp], Array]


@dataclass(frozen=True)
class ErrorSources:
    """Parts of an estimated error, relative to the L2 norm of the traction; their squares add up.

    Attributes
    ----------
    edges, facets, scatter, bodies, stiffness, chords : float
        See the top of the module `estimate`. `bodies` is NaN where a body was given a matrix instead
        of a `BilinearForm`: then there is no measure of energy, and it is left out. Where another one
        is NaN the answer is not rated, and `total` is NaN, too.

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
    >>> parts = result.error_estimate.pressure
    >>> parts.chords, parts.stiffness, bool(parts.total >= parts.facets)
    (0.0, 0.0, True)
    """

    edges: float = 0.0
    facets: float = 0.0
    scatter: float = 0.0
    bodies: float = 0.0
    stiffness: float = 0.0
    chords: float = 0.0

    @property
    def total(self) -> float:
        """Root of the sum of squares; NaN where more is missing than `bodies`."""
        return float(np.sqrt(sum(size**2 for size in self._known().values())))

    @property
    def missing(self) -> tuple[str, ...]:
        """Names of the parts that are not estimated."""
        return tuple(f.name for f in fields(self) if np.isnan(getattr(self, f.name)))

    @property
    def largest(self) -> str:
        """Name of the largest part."""
        known = self._known()
        return max(known, key=lambda name: np.inf if np.isnan(known[name]) else known[name])

    def _known(self) -> dict[str, float]:
        """The parts; without `bodies` where it is not known. NaN in any other is a defect, and seen."""
        parts = {f.name: float(getattr(self, f.name)) for f in fields(self)}
        return {k: v for k, v in parts.items() if not (k == "bodies" and np.isnan(v))}


@dataclass(frozen=True, eq=False)
class ErrorEstimate(NamesAttributes):
    """Estimated discretisation error of the tractions of one contact.

    Attributes
    ----------
    pressure, traction : ErrorSources
        Of the pressure, over the L2 norm of the pressure; and of pressure and friction together.
    indicator : ndarray, shape (m,)
        Share of every point in the squared error of the traction that comes from the surface (edges,
        facets, scatter); adds up to one where there is any.
    elements : dict of (ndarray of int, ndarray)
        By name of the body: elements around the contact, and the share of each in the energy error.
    points_across : int or None
        Points across the narrowest zone of contact, or of sticking, that has edges; 0 without edges.
        None in 3-D.
    advice : str
        What would improve the answer most.
    unrated : str
        Why the answer can not be rated; empty where it is. Then the totals are NaN.

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
    >>> error = result.error_estimate
    >>> error.pressure.largest, bool(0 < error.pressure.total < 1)
    ('edges', True)
    """

    pressure: ErrorSources
    traction: ErrorSources
    indicator: Array = field(repr=False)
    elements: dict[str, Elements] = field(repr=False)
    points_across: int | None
    advice: str
    unrated: str = ""

    def __str__(self) -> str:
        if self.unrated:
            return f"not rated: {self.unrated}"
        parts = ", ".join(
            f"{f.name} {percent(getattr(self.traction, f.name))}"
            for f in fields(self.traction)
            if getattr(self.traction, f.name) != 0
        )
        return f"{self.words} of the L2 norm ({parts or 'no part'}); {self.advice}"

    @property
    def words(self) -> str:
        """The totals of pressure and traction, in percent up to what can be estimated."""
        if self.unrated:
            return "not rated"
        if max(self.pressure.total, self.traction.total) > ESTIMATED:
            return f"more than {percent(ESTIMATED)}, beyond what can be estimated"
        return f"pressure {percent(self.pressure.total)}, traction {percent(self.traction.total)}"


def percent(share: float) -> str:
    """A share in percent, with two digits."""
    if np.isnan(share):
        return "not known"
    return f"{100 * share:.2g} %" if share > SOLVED else "0 %"


class _Its(property):
    """A property of the only contact of a result, by its own name, of the annotated type."""

    def __set_name__(self, owner: type, name: str) -> None:
        def only(result: OfTheContact) -> Any:
            return getattr(result._only(name), name)

        only.__doc__ = f"The `{name}` of the only contact, see `ContactValues.{name}`."
        only.__annotations__["return"] = owner.__annotations__[name]
        super().__init__(only)


def its() -> Any:
    """For type checkers a value of the annotated type."""
    return _Its()


class OfTheContact(NamesAttributes, ABC):
    """Properties of the contact itself, for results with one contact.

    With several contacts they are AttributeErrors that name the contacts: nothing is joined.
    """

    @abstractmethod
    def _only(self, name: str) -> ContactValues:
        """The values of the only contact; `name` is the property that is asked for."""

    points: Array = its()
    normal: Array = its()
    tangent: Array = its()
    area: Array = its()
    gap: Array = its()
    slip: Array = its()
    slip_vector: Array = its()
    status: NDArray[np.intp] = its()
    pressure: Array = its()
    traction: Array = its()
    friction_stress: Array = its()
    normal_force: Array = its()
    tangential_force: Array = its()
    tangential_force_vector: Array = its()
    forces: Array = its()
    force: Array = its()
    force_on_primary: Array = its()
    moment: Callable[..., Any] = its()
    contact_area: float = its()
    wear_depth: Array = its()
    worn_volume: float = its()
    contact_edges: Array = its()
    error_estimate: ErrorEstimate = its()
    interpolate: Callable[[ArrayLike, ArrayLike], Array] = its()
    integrate: Callable[[ArrayLike], Any] = its()
