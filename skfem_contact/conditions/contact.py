"""`Contact`: what may touch what, and how; the user's settings of one interface."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import KW_ONLY
from functools import cached_property
from typing import Any, Literal, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from skfem_contact.arguments import (
    PrintedAsCall,
    check_name,
    check_switch,
    number,
    numbers,
    shown,
    with_known_keywords,
)
from skfem_contact.arrays import Array
from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.conditions.friction import Archard, FrictionLaw
from skfem_contact.conditions.orthotropic import OrthotropicCoulomb
from skfem_contact.errors import InputError
from skfem_contact.obstacles.obstacle import Obstacle
from skfem_contact.obstacles.rigid_body import RigidBody
from skfem_contact.records import carried, dataclass, kept

Field: TypeAlias = "ArrayLike | Callable[[Array], ArrayLike]"

NO_SLIP = (
    "Contact: wear=... needs the slip, and without friction nothing tangential is modelled. Give it a "
    "coefficient that is small but not zero, friction=Coulomb(1e-6)."
)
#: For each law of a contact what it has to be, in words too, and what to write in place of it on glue.
LAWS = {
    "friction": (
        FrictionLaw,
        "not a friction law; write friction=Coulomb(0.3), or derive your own from FrictionLaw",
        "; a bond that slips is separation=False, friction=...",
    ),
    "wear": (Archard, "no law of wear; write Archard(k)", "."),
}
LAW = "it belongs to the law, friction=Coulomb(mu, ...)"


@with_known_keywords(
    mu=LAW,
    tau_max=LAW,
    cohesion=LAW,
    stiffness=LAW,
    slave="write secondary",
    master="write primary",
    bonded="write tied=True, or separation=False for a bond that may slip",
    no_separation="write separation=False",
)
@dataclass(frozen=True, eq=False)
class Contact(PrintedAsCall):
    """Contact between two surfaces, or between a surface and a rigid obstacle.

    Parameters
    ----------
    secondary : ContactSurface
        The surface whose points are constrained (slave, in older texts): as a rule the finer one,
        or the one of the softer body.
    primary : ContactSurface, obstacle or RigidBody
        The surface that the points are projected onto (master).
    friction : FrictionLaw, optional
        None is frictionless: then nothing tangential is modelled at all.
    method : {"mortar", "node"} or callable
        Dual mortar, or node-to-segment, which errs by some percent in the pressure where meshes do
        not match, at no lower cost (docs/methods.md). A function ``method(secondary, primary,
        reach=...)`` that returns a `Pairing` is a discretisation of your own (docs/extending.md).
        Obstacles are met node by node in each case.
    interference : float, ndarray (m,) or callable
        Overlap added to the geometry, positive where the bodies are too large for each other (a
        press fit) [length]. A callable takes component-first positions ``x``.
    gap : float, ndarray (m,) or callable, optional
        Replaces the initial gap measured on the meshes [length]. Where `tied` or `separation` hold the
        surfaces together, that of the meshes counts as closed, and one that is given here is pulled
        shut.
    adjust : float
        Initial gaps and overlaps up to this length are taken as closed, free of strain [length].
    reach : float, optional
        How far a point looks for its partner, outwards and inwards [length]; by default any distance.
    outside : {"open", "error"}
        What happens to points that miss the primary surface.
    sliding : {"small", "finite"}
        Whether the pairing is that of the undeformed meshes, or follows the motion.
    tied : bool
        Both surfaces are glued: no gap, no slip, also in tension.
    separation : bool
        False is contact that never opens ("no separation" elsewhere): the surfaces are held together as
        they are meshed, in tension too, and slide on each other as `friction` lets them. With
        `Tresca`, a bond that carries shear whatever the pressure. Points without partner are open.
    wear : Archard, optional
        Law by which the secondary surface wears as it slips; it needs friction, if only a little.
    name : str, optional

    Raises
    ------
    InputError
        If a setting is not one of those above.

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
    >>> foot.friction, foot.tied, foot.sliding
    (Coulomb(mu=0.3), False, 'small')
    >>> sc.ContactSolver(block, foot).solve().status.tolist()  # two points slip
    [2, 1, 1, 1, 2]
    """

    secondary: ContactSurface
    primary: ContactSurface | Obstacle
    _: KW_ONLY
    friction: FrictionLaw | None = None
    method: Literal["node", "mortar"] | Callable[..., Any] = "mortar"
    interference: Field = 0.0
    gap: Field | None = None
    adjust: float = 0.0
    reach: float | None = None
    outside: Literal["open", "error"] = "open"
    sliding: Literal["small", "finite"] = "small"
    tied: bool = False
    separation: bool = True
    wear: Archard | None = None
    name: str | None = None

    def __post_init__(self) -> None:
        self._check_sides()
        choices = {
            "method": ("node", "mortar"),
            "outside": ("open", "error"),
            "sliding": ("small", "finite"),
        }
        for name, allowed in choices.items():
            value = getattr(self, name)
            if name == "method" and callable(value):
                continue
            if not isinstance(value, str) or value not in allowed:
                own = ", nor a function that returns a Pairing" if name == "method" else ""
                raise InputError(f"Contact: {name} = {shown(value)} is not one of {allowed}{own}.")
        check_switch(self.tied, "Contact: tied")
        check_switch(self.separation, "Contact: separation")
        for name in ("interference", "gap"):
            object.__setattr__(self, name, kept(getattr(self, name)))
        check_name(self.name, "Contact: name")
        self._check_laws()
        for name in ("adjust", "reach"):
            value = getattr(self, name)
            if value is None and name == "reach":
                continue
            bound = "> 0" if name == "reach" else ">= 0"  # within no reach there is no partner
            length = number(value, f"Contact: {name}", f"give a length {bound}")
            # no limit to `reach` is what it has without; every gap closed is never what is meant
            if not length >= 0 or length == {"adjust": np.inf, "reach": 0.0}[name]:
                raise InputError(f"Contact: {name} = {value} has to be a length {bound}.")

    def __getstate__(self) -> dict[str, Any]:
        known = dict(vars(self))
        for name in ("interference", "gap", "method"):
            known[name] = carried(known[name], f"{name} of contact {self.label}")
        return known

    def _check_laws(self) -> None:
        """Refuse what is no law, or one of slip where there is none; take directions at the points."""
        for name, (kind, words, instead) in LAWS.items():
            law = getattr(self, name)
            if law is not None and not isinstance(law, kind):
                raise InputError(f"Contact: {name} = {shown(law)} is {words}.")
            if law is not None and self.tied:
                raise InputError(
                    f"Contact: tied=True and {name}=... exclude each other: glued surfaces do not "
                    f"slip. Leave one of them out{instead}"
                )
        if self.wear is not None and self.friction is None:
            raise InputError(NO_SLIP)
        if isinstance(self.friction, OrthotropicCoulomb):
            surface = self.secondary
            if surface.dim == 2 or surface.dofs.shape[1] == 1:
                known = "one only in the plane" if surface.dim == 2 else "none of a scalar field"
                raise InputError(
                    "Contact: OrthotropicCoulomb tells directions along a surface apart, and there is "
                    f"{known}: give Coulomb(mu) with the coefficient along it."
                )
            object.__setattr__(self, "friction", self.friction.on(surface.points))

    def _check_sides(self) -> None:
        """Refuse what can not be in contact; a surface against itself: its points would be partners."""
        if isinstance(self.secondary, RigidBody):
            both = isinstance(self.primary, Obstacle)
            raise InputError(
                f"Contact: secondary is a rigid body ({self.secondary.label!r}). "
                + (
                    "Two rigid sides do not touch: their forces would not be unique, as nothing gives "
                    "way. Make one of the two a Body with a mesh, stiff as it may be."
                    if both
                    else "It has no points that could be constrained: it can only be the primary, swap "
                    "the two."
                )
            )
        if not isinstance(self.secondary, ContactSurface):
            what = "an obstacle" if isinstance(self.secondary, Obstacle) else "no surface"
            raise InputError(
                f"Contact: secondary is {what} ({type(self.secondary).__name__}). The secondary "
                "side is a boundary of a body, body.surface('name'); a rigid obstacle can only be "
                "the primary: swap the two."
            )
        if not isinstance(self.primary, ContactSurface | Obstacle):
            raise InputError(
                f"Contact: primary is a {type(self.primary).__name__}; it has to be a surface, "
                "body.surface('name'), an obstacle such as RigidPlane(point, normal), or a RigidBody."
            )
        primary = self.primary
        if not isinstance(primary, ContactSurface) or primary.body is not self.secondary.body:
            return
        shared = np.intersect1d(self.secondary.mesh_facets, primary.mesh_facets)
        if len(shared):
            raise InputError(
                f"Contact: secondary {self.secondary.label!r} and primary {primary.label!r} share "
                f"{len(shared)} facets of one body. A surface in contact with itself is not "
                "supported: the two sides must be known beforehand. Tag them as two boundaries "
                "without common facets, for example the two flanks of a slot."
            )

    @cached_property
    def bilateral(self) -> bool:
        """The contact pulls as well as it presses: its points never open."""
        return self.tied or not self.separation

    @property
    def method_name(self) -> str:
        """The method in words; a function by its name."""
        if isinstance(self.method, str):
            return self.method
        return getattr(self.method, "__name__", type(self.method).__name__)

    @cached_property
    def rigid(self) -> bool:
        """The primary side is a rigid obstacle."""
        return not isinstance(self.primary, ContactSurface)

    @cached_property
    def rigid_body(self) -> RigidBody | None:
        """The primary side, where it is an obstacle with DOFs of its own."""
        return self.primary if isinstance(self.primary, RigidBody) else None

    @property
    def label(self) -> str:
        """The two sides in words, for messages."""
        primary = self.primary.label
        return f"{self.secondary.label} on {primary}"


def number_of(contact: object, contacts: Sequence[Contact]) -> int | None:
    """Number of a contact among those of a solver; None if it is none of them.

    Between the same two sides it is the same contact, whatever its friction: a solver from
    `with_friction` has one of its own, which nobody else has.
    """
    for i, own in enumerate(contacts):
        if own is contact:
            return i
    if isinstance(contact, Contact):
        for i, own in enumerate(contacts):
            if own.secondary is contact.secondary and own.primary is contact.primary:
                return i
    return None


def field_values(field: Field, points: Array, what: str) -> Array:
    """A number, array or callable of component-first positions as one value per point."""
    given = field(points.T) if callable(field) else field
    usage = "give one number, one value per point, or a callable of component-first positions x"
    values = numbers(given, what, usage)
    try:
        values = np.broadcast_to(values, (len(points),))
    except ValueError:
        raise InputError(
            f"{what} has shape {np.shape(values)}, but there are {len(points)} contact points. "
            "Give one number, one value per point of the secondary surface, or a callable of "
            "component-first positions x."
        ) from None
    if not np.isfinite(values).all():
        raise InputError(f"{what} has NaN or infinite values; give finite lengths.")
    return np.array(values)
