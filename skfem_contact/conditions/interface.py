"""`Interface`: the friction laws and masks of all contacts over one numbering of points.

`Identity` is what bodies and contacts a state belongs to: two meshes may share all numbers of DOFs.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix

from skfem_contact.arguments import names_of
from skfem_contact.arrays import Array, Index, Mask
from skfem_contact.bodies.body import Body
from skfem_contact.bodies.member import Member
from skfem_contact.bodies.selection import written
from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.bodies.system import System, slices
from skfem_contact.conditions.contact import NO_SLIP, Contact
from skfem_contact.conditions.friction import (
    Archard,
    CheckedLaw,
    Coulomb,
    FrictionLaw,
    Tresca,
    check_points,
)
from skfem_contact.conditions.kinematics import Kinematics
from skfem_contact.conditions.rows import compliance_scale
from skfem_contact.digits import SOLVED
from skfem_contact.errors import InputError
from skfem_contact.obstacles.rigid_body import RigidBody
from skfem_contact.records import dataclass

# The tangential stiffness that a loop takes where the law gives none, over K's diagonal at the
# point: exact sticking; an error of 1e-3 in the slip of sticking points; one that still converges.
STIFFNESS = {"newton": np.inf, "direct": 1e3, "fictitious": 1.0}


@dataclass(frozen=True, eq=False)
class Interface:
    """The laws at the contact points, which do not depend on the pairing.

    Attributes
    ----------
    contacts : tuple of Contact
    names : tuple of str
    point_slices : tuple of slice
        The points of each contact.
    laws : tuple of (slice, CheckedLaw)
    frictional, tied, bilateral : ndarray of bool, shape (m,)
        Points with friction; glued ones; those that never open, glued ones too.
    slipping : ndarray of bool, shape (m,)
        Points with tangential rows: without friction or glue nothing tangential is modelled.
    stiffness : ndarray, shape (m,)
        Tangential stiffness of sticking points [force/length]; ``inf`` is exact.
    wear : tuple of (slice, Archard)
        Of the contacts that wear.
    """

    contacts: tuple[Contact, ...]
    names: tuple[str, ...]
    point_slices: tuple[slice, ...]
    laws: tuple[tuple[slice, CheckedLaw], ...]
    frictional: Mask
    tied: Mask
    bilateral: Mask
    slipping: Mask
    stiffness: Array
    wear: tuple[tuple[slice, Archard], ...] = ()

    def contact_of(self, point: int) -> int:
        """The number of the contact that a point belongs to."""
        return next(k for k, part in enumerate(self.point_slices) if part.start <= point < part.stop)

    def point_words(self, point: int, position: Array) -> str:
        """A contact point in words, with the place where it is now."""
        i = self.contact_of(point)
        number = point - self.point_slices[i].start
        return f"point {number} of contact {self.names[i]!r}, now at {written(position)},"


def point_slices(contacts: Sequence[Contact]) -> tuple[slice, ...]:
    """The points of each contact in the joint numbering."""
    return tuple(slices(np.cumsum([0, *(len(c.secondary.points) for c in contacts)])))


def contact_names(contacts: Sequence[Contact]) -> tuple[str, ...]:
    """Names of the contacts; a missing one is numbered, a repeated one refused."""
    return names_of(contacts, "contact", "contacts")


def can_carry(law: FrictionLaw | None, m: int) -> Mask:
    """Points at which a law can give any friction, (m,): a coefficient that is round-off is none.

    Nothing tangential is modelled at the others, as without a law: a point that may stick, if only
    with a force of zero, would hold a body that nothing holds.

    Examples
    --------
    >>> can_carry(Coulomb(1e-17), 2), can_carry(Tresca([0.0, 1.0]), 2)
    (array([False, False]), array([False,  True]))
    """
    if law is None:
        return np.zeros(m, dtype=bool)
    if type(law) not in (Coulomb, Tresca):
        return np.ones(m, dtype=bool)  # what a user's own law gives is its own affair
    one = np.ones(m)
    carries = np.broadcast_to(law.limit(one, one, np.zeros((m, 1))) > 0, m)
    if isinstance(law, Coulomb):
        carries = carries & (
            (np.asarray(law.mu) > np.finfo(float).eps) | (np.asarray(law.cohesion) > 0)
        )
    return np.asarray(carries)


def interface(
    contacts: tuple[Contact, ...], kin: Kinematics, stiffness: Sequence[csr_matrix], loop: str
) -> Interface:
    """Collect the laws of all contacts, each with the tangential stiffness that the loop needs."""
    points_of, names = point_slices(contacts), contact_names(contacts)
    m = kin.m
    frictional, tied, G = np.zeros(m, dtype=bool), np.zeros(m, dtype=bool), np.full(m, np.inf)
    own = np.zeros(m)
    wanted = any(c.friction is not None and c.friction.stiffness is None for c in contacts)
    if wanted and kin.tangents and np.isfinite(STIFFNESS[loop]):
        diagonal = np.concatenate([K.diagonal() for K in stiffness])
        own = compliance_scale(kin.B_t, diagonal).reshape(m, -1).min(axis=1)
    typical = np.median(own[own > 0]) if (own > 0).any() else 1.0
    laws, wear = [], []
    for contact, part, name in zip(contacts, points_of, names, strict=True):
        tied[part] = contact.tied
        law = contact.friction
        if law is None:
            continue
        if kin.tangents == 0:
            raise InputError(
                f"contact '{contact.label}': a scalar field has no tangential direction, so there "
                "is no friction; leave friction out."
            )
        count, whose = part.stop - part.start, f"contact '{contact.label}'"
        if isinstance(law, Coulomb | Tresca):  # what a user's own law keeps is its own affair
            check_points(law, ("mu", "cohesion", "tau_max", "stiffness"), count, whose)
        carries = can_carry(law, count)
        if contact.wear is not None:
            if not carries.all():  # of what does not slip nothing is known
                raise InputError(f"{whose}: friction is zero at {np.sum(~carries)} points. {NO_SLIP}")
            check_points(contact.wear, ("k",), count, whose)
            wear.append((part, contact.wear))
        if not carries.any():
            continue
        laws.append((part, CheckedLaw(law, name, contact.secondary.points)))
        frictional[part] = carries
        default = STIFFNESS[loop] * np.where(own[part] > 0, own[part], typical)
        G[part] = default if law.stiffness is None else law.stiffness
        if loop == "fictitious" and np.isinf(G[part]).any():
            raise InputError(
                f"contact '{contact.label}': the loop 'fictitious' needs a finite tangential "
                f"stiffness, but the law has stiffness={law.stiffness}. Leave stiffness out for "
                "the automatic one, or use loop='newton' for exact sticking."
            )
    points = frictional, tied, kin.bilateral, frictional | tied
    return Interface(contacts, names, points_of, tuple(laws), *points, G, tuple(wear))


def point_labels(contact: Contact, m: int) -> NDArray[np.object_]:
    """The points of a contact in words."""
    label = contact.label
    return np.array([f"point {i} of {label}" for i in range(m)], dtype=object)


@dataclass(frozen=True, eq=False)
class Identity:
    """The parts of a problem that have to be the same for a state to be carried over.

    Not in it: names, supports, loads, stiffness, friction and interference, which may change from one
    part of a history to the next, and where rigid obstacles are.

    Attributes
    ----------
    bodies, contacts : ndarray of str, shapes (b,) and (k,)
        Names, for messages.
    sizes, elements : ndarray, shape (b,)
        DOFs of each body; a digest of the DOFs of its elements.
    places : ndarray, shape (b, 3)
        Two sums of coordinates with weights that differ from node to node, and the largest [length].
    points, sides : ndarray, shape (k,)
        Points of each contact; a digest of the DOFs on its two sides and of whether it slides far.
    """

    bodies: NDArray[Any]
    contacts: NDArray[Any]
    sizes: Index
    elements: NDArray[Any]
    places: Array
    points: Index
    sides: NDArray[Any]

    @classmethod
    def of(cls, system: System, contacts: Sequence[Contact]) -> Identity:
        """Say that of some bodies and contacts; takes about as long as to read the meshes once."""
        return cls(
            bodies=np.array(system.names),
            contacts=np.array(contact_names(tuple(contacts))),
            sizes=np.array([body.n for body in system.bodies]),
            elements=np.array([_elements(body) for body in system.bodies]),
            places=np.array([_places(body.dof_points) for body in system.bodies]),
            points=np.array([len(contact.secondary.points) for contact in contacts]),
            sides=np.array([_sides(system, contact) for contact in contacts]),
        )

    def refuse(self, other: Identity, what: str) -> None:
        """Raise an `InputError` that says what is another, where something is.

        Parameters
        ----------
        other : Identity
            Of the state.
        what : str
            The state in words, the beginning of the message.
        """
        words = self._difference(other)
        if words:
            raise InputError(
                f"{what} {words}. A state can be carried over only between solvers of the same bodies "
                "and contacts, in the same order; loads, supports, stiffness and friction may differ."
            )

    def _difference(self, other: Identity) -> str:
        mine, theirs = (self.sizes.sum(), self.points.sum()), (other.sizes.sum(), other.points.sum())
        counts = len(self.sizes), len(self.points)
        if mine != theirs or counts != (len(other.sizes), len(other.points)):
            return (
                f"is a state of {theirs[0]} DOFs, {theirs[1]} contact points and {len(other.points)} "
                f"contacts; this solver has {mine[0]}, {mine[1]} and {counts[1]}"
            )
        scale = np.max(self.places[:, 2], initial=0.0)
        moved = np.any(np.abs(self.places - other.places) > SOLVED * scale, axis=1)
        other_mesh = (self.sizes != other.sizes) | (self.elements != other.elements)
        for i in np.flatnonzero(moved | other_mesh):
            kind = "another mesh" if other_mesh[i] else "a mesh whose nodes are elsewhere"
            return (
                f"has the same counts, but belongs to {kind}: body {str(other.bodies[i])!r} there "
                f"is not body {str(self.bodies[i])!r} here"
            )
        for i in np.flatnonzero((self.points != other.points) | (self.sides != other.sides)):
            return (
                f"belongs to the same meshes, but contact {str(other.contacts[i])!r} there is not "
                f"contact {str(self.contacts[i])!r} here: it has other surfaces, or another sliding"
            )
        return ""


def digest(numbers: Any) -> str:
    """A short name of some integers, equal on all machines.

    >>> digest([1, 2]) == digest(np.array([1, 2], dtype=np.int32)), digest([1, 2]) == digest([2, 1])
    (True, False)
    """
    array = np.ascontiguousarray(numbers, dtype="<i8")
    return hashlib.blake2b(array.tobytes() + str(array.shape).encode(), digest_size=12).hexdigest()


def _elements(body: Member) -> str:
    """A digest of the DOFs of a body's elements; a rigid body is one."""
    return digest(body.basis.dofs.element_dofs if isinstance(body, Body) else np.arange(body.n))


def _places(points: Array) -> Array:
    """Sums that any displacement of a node changes by about as much, told to round-off."""
    number, along = np.arange(len(points)), points @ np.linspace(1.0, 0.6, points.shape[1])
    return np.array([np.cos(number) @ along, np.sin(number) @ along, np.max(np.abs(points))])


def _sides(system: System, contact: Contact) -> str:
    words: list[str] = [contact.sliding]
    for surface in (contact.secondary, contact.primary):
        if isinstance(surface, ContactSurface):
            words.append(f"{digest(surface.dofs)} of body {system.index(surface.body)}")
        elif isinstance(surface, RigidBody):
            words.append(f"body {system.index(surface)}")
        else:
            words.append("rigid")
    return ", ".join(words)
