"""`State`: what friction remembers from one load step to the next, and the status of contact points.

`Identity` is what bodies and contacts it belongs to: two meshes may share all numbers of DOFs.

Slips and friction forces are remembered as vectors in global axes, because a frame is a matter of the
pairing: its tangents are another choice wherever the pairing is renewed. The loops work with components
along the tangents of one pairing, `LocalState`; `State.along` and `LocalState.in_space` lead from the
one to the other.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skfem_contact.arrays import Array, Index
from skfem_contact.bodies.body import Body
from skfem_contact.bodies.member import Member
from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.bodies.system import System
from skfem_contact.conditions.contact import Contact
from skfem_contact.conditions.interface import contact_names
from skfem_contact.conditions.kinematics import Kinematics
from skfem_contact.digits import COMPUTED, SOLVED
from skfem_contact.errors import InputError
from skfem_contact.obstacles.rigid_body import RigidBody
from skfem_contact.records import dataclass

OPEN, STICK, SLIP = range(3)
STATUS = ("open", "stick", "slip")


def transport(vectors: Array, old: Array, new: Array) -> Array:
    r"""Tangential vectors turned by the smallest rotation that takes the old normals to the new ones.

    ``v - (n + n') (n' . v) / (1 + n . n')`` for ``v`` across ``n``: it is across ``n'`` and as long as
    `v`. In the plane it is the only rotation there is, so that components along tangents stay what
    they are. Where normals are opposite many rotations are equally small: vectors are turned round,
    which in the plane is the rotation again.

    Parameters
    ----------
    vectors : ndarray, shape (..., m, d)
        Across the unit normals `old`.
    old, new : ndarray, shape (m, d)

    Returns
    -------
    ndarray, shape (..., m, d)
        Across the unit normals `new`.

    Examples
    --------
    A slope of 3 to 4 that has come to lie flat:

    >>> transport(np.array([[4.0, 3.0]]), np.array([[-0.6, 0.8]]), np.array([[0.0, 1.0]]))
    array([[5., 0.]])
    """
    cosine = np.einsum("id,id->i", old, new)
    across = np.einsum("...id,id->...i", vectors, new)
    opposite = cosine <= COMPUTED - 1.0
    share = across / np.where(opposite, 1.0, 1.0 + cosine)
    turned = vectors - share[..., None] * (old + new)
    return np.where(opposite[:, None], -vectors, turned)


@dataclass(eq=False)
class _History:
    """The common fields of `State`, with vectors (m, d), and `LocalState`, with components (m, d-1)."""

    status: Index
    slip: Array
    tangential_force: Array
    normal_force: Array
    reference: Array
    gap: Array
    area: Array
    surface: Array
    trend: Array
    vertex: Index
    wear: Array
    worn: Array

    @property
    def _friction(self) -> Array:
        """Slip, friction and reference, one after the other, (3, m, ...)."""
        return np.array((self.slip, self.tangential_force, self.reference))

    def _with(self, friction: Array) -> dict[str, Any]:
        """The fields of a history with other arrays of friction."""
        slip, force, reference = friction
        return vars(self) | {"slip": slip, "tangential_force": force, "reference": reference}


def _each(kin: Kinematics, to_space: bool) -> Array:
    """Vectors for slip, friction and reference, (3, m, d-1, d); (m, d-1, d) where they are the same.

    Slips are combined of duals and measured along axes, friction the other way round.
    """
    if kin.scaled is None:
        return kin.axes
    slips, friction = (kin.duals, kin.axes) if to_space else (kin.axes, kin.duals)
    return np.stack([slips, friction, slips])


@dataclass(eq=False)
class LocalState(_History):
    """A state along the tangents of one pairing: the history of a load step, and its answer.

    The attributes are those of `State`, with components of shape (m, d-1) for ``slip``,
    ``tangential_force`` and ``reference``.
    """

    def in_space(self, kin: Kinematics) -> State:
        """Return the state as vectors in space; `kin` is the pairing that it belongs to."""
        components = self._friction
        basis = _each(kin, to_space=True)
        if kin.tangents == 1:  # in every step: sums over so few are dear to einsum
            vectors = components * basis[..., 0, :]
        else:
            vectors = np.zeros((*components.shape[:2], kin.normal.shape[1]))
            for k in range(kin.tangents):
                vectors += components[:, :, k, None] * basis[..., k, :]
        return State(**self._with(vectors), normal=kin.normal)


@dataclass(eq=False)
class State(_History):
    """The memory of friction between load steps; all path dependence lives here.

    Attributes
    ----------
    status : ndarray of int, shape (m,)
    slip : ndarray, shape (m, d)
        Relative tangential displacement since the undeformed state, in global axes [length].
    tangential_force : ndarray, shape (m, d)
        Force that resists the slip, in global axes; zero at open points [force].
    normal_force : ndarray, shape (m,)
    reference : ndarray, shape (m, d)
        Slip at which the point closed, in global axes [length].
    gap, area : ndarray, shape (m,)
        Gap; tributary area, which follows the pairing [length], [area].
    surface, trend : ndarray
        Displacements of the surfaces that slide far, and their change in the last load step: where
        the pairing of the next one begins. Empty for small sliding [length].
    vertex : ndarray of int, shape (m,)
        The vertex of the primary whose row a point carries, or -1, see `Kinematics.vertex`.
    wear, worn : ndarray, shape (m,)
        Depth and volume worn off so far [length], [volume].
    normal : ndarray, shape (m, d)
        Unit normals that the vectors are across.
    """

    normal: Array

    def along(self, kin: Kinematics) -> LocalState:
        """Components along the tangents of a pairing, after `transport` to its normals."""
        vectors = self._friction
        if self.normal is not kin.normal and not np.array_equal(self.normal, kin.normal):
            vectors = transport(vectors, self.normal, kin.normal)
        basis = _each(kin, to_space=False)
        if kin.tangents == 1:
            x, y = vectors[..., 0], vectors[..., 1]
            components = (x * basis[..., 0, 0] + y * basis[..., 0, 1])[..., None]
        else:
            components = np.zeros((*vectors.shape[:2], kin.tangents))
            for k in range(kin.tangents):
                for j in range(vectors.shape[2]):
                    components[:, :, k] += vectors[:, :, j] * basis[..., k, j]
        known = self._with(components)
        del known["normal"]
        return LocalState(**known)

    def handed_on(self, vertex: Index, point_slices: Sequence[slice]) -> State:
        """The state with the history of every vertex at the point that carries its row now.

        A vertex of the primary that slides along the secondary goes from point to point, and its slip
        and friction go with it; the point that it leaves takes the history of the one it comes to.

        Parameters
        ----------
        vertex : ndarray of int, shape (m,)
            That of the pairing to come.
        point_slices : sequence of slice
            The points of each contact.
        """
        if self.vertex is vertex or np.array_equal(self.vertex, vertex):
            return self
        source = np.arange(len(vertex))
        for part in point_slices:
            old, new = self.vertex[part], vertex[part]
            _, before, after = np.intersect1d(
                np.where(old >= 0, old, -1), np.where(new >= 0, new, -2), return_indices=True
            )
            moved = before != after
            before, after = before[moved], after[moved]
            source[part.start + after] = part.start + before
            left = np.setdiff1d(before, after)
            source[part.start + left] = part.start + np.setdiff1d(after, before)
        known = ("surface", "trend", "vertex", "wear", "worn")  # wear stays with the surface
        names = [field.name for field in fields(self) if field.name not in known]
        return replace(self, **{name: getattr(self, name)[source] for name in names}, vertex=vertex)


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
