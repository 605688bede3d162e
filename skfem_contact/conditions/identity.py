"""What bodies and contacts a state belongs to; two meshes may share all numbers of DOFs."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skfem_contact.bodies.body import Body
from skfem_contact.bodies.member import Member
from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.bodies.system import System
from skfem_contact.conditions.contact import Contact
from skfem_contact.conditions.interface import contact_names
from skfem_contact.digits import SOLVED
from skfem_contact.errors import InputError
from skfem_contact.obstacles.rigid_body import RigidBody

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Identity:
    """What has to be the same for a state to be carried over.

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
    sizes: NDArray[np.intp]
    elements: NDArray[Any]
    places: Array
    points: NDArray[np.intp]
    sides: NDArray[Any]

    @classmethod
    def of(cls, system: System, contacts: Sequence[Contact]) -> Identity:
        """That of some bodies and contacts; takes about as long as to read the meshes once."""
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

    def as_arrays(self) -> dict[str, NDArray[Any]]:
        """By name, for a file."""
        return {field.name: getattr(self, field.name) for field in fields(self)}


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
