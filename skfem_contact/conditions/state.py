"""The two ends of a load step: `LoadCase`, the loads in force, and `State`, what friction remembers.

Slips and friction forces are remembered as vectors in global axes, because a frame is a matter of the
pairing: its tangents are another choice wherever the pairing is renewed. The loops work with components
along the tangents of one pairing, `LocalState`; `State.along` and `LocalState.in_space` lead from the
one to the other.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import field, fields, replace
from typing import Any

import numpy as np

from skfem_contact.arrays import Array, Index, Mask
from skfem_contact.conditions.kinematics import Kinematics
from skfem_contact.digits import COMPUTED
from skfem_contact.obstacles.obstacle import rotation_matrix, spin
from skfem_contact.records import ByFields, dataclass

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

    def along(self, kin: Kinematics, point_slices: Sequence[slice] = ()) -> LocalState:
        """Components along the tangents of a pairing, after `transport` to its normals.

        With the points of each contact a vertex brings its history along, see `handed_on`.
        """
        if point_slices:
            return self.handed_on(kin.vertex, point_slices).along(kin)
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


def swept(turn: Any, arm: Array) -> Array:
    """How far arms (m, d) sweep in a turn, linear in it: a number, or a vector (3,) in space."""
    if not np.any(turn):
        return np.zeros(arm.shape)
    if np.ndim(turn):
        return np.asarray(np.cross(turn, arm))
    return np.asarray(turn * np.column_stack([-arm[:, 1], arm[:, 0]]))


@dataclass(frozen=True, eq=False)
class Motion:
    """Motion of a rigid obstacle since the start: a turn about a centre, then a translation.

    Attributes
    ----------
    translation, centre : ndarray, shape (d,)
        [length]
    angle : float, or ndarray (3,) in space
        Counterclockwise; a rotation vector [rad].
    """

    translation: Array
    angle: Any
    centre: Array

    @classmethod
    def none(cls, d: int) -> Motion:
        """No motion in d dimensions."""
        return cls(np.zeros(d), np.zeros(3) if d == 3 else 0.0, np.zeros(d))

    @property
    def turns(self) -> bool:
        """The motion is more than a translation."""
        return bool(np.any(self.angle))

    def towards(self, other: Motion, share: float) -> Motion:
        """The motion on the straight way to another one: steady turn, steady path of its centre.

        In space rotation vectors go straight: about a fixed axis that is a steady turn.
        """
        here = self.about(other.centre)
        return Motion(
            here.translation + share * (other.translation - here.translation),
            here.angle + share * (other.angle - here.angle),
            other.centre,
        )

    def about(self, centre: Array) -> Motion:
        """The same motion as a turn about another centre."""
        return Motion(self.shift(centre[None])[0], self.angle, centre)

    def slid(self, before: Motion, points: Array) -> Array:
        """Return how far the obstacle's surface has moved along itself at points, (m, d).

        Linear in the turn: over a point of contact the surface of a spinning roller passes with the
        length of the arc. In space the turn is the spin on the way between both. Of points that move
        it takes the places halfway: what turns with the obstacle then does not slip.
        """
        start, end = before.about(self.centre).translation, self.translation
        turn = spin(before.angle, self.angle) if np.ndim(self.angle) else self.angle - before.angle
        return end - start + swept(turn, points - self.centre - 0.5 * (start + end))

    def shift(self, points: Array) -> Array:
        """Displacement of the obstacle at some points, shape (m, d)."""
        moved = np.tile(self.translation, (len(points), 1))
        if self.turns:
            moved += (points - self.centre) @ (rotation_matrix(self.angle).T - np.eye(len(self.centre)))
        return moved

    def as_argument(self) -> tuple[Array, Any, Array]:
        """In the form that obstacles take."""
        return self.translation, self.angle, self.centre


@dataclass(frozen=True, eq=False)
class BoltLoads:
    """What holds the bolts of a load case: either a shift or a force of each, NaN for the other.

    Both are NaN where a step does not name the bolt, which is locked then.

    Attributes
    ----------
    shift : ndarray, shape (b,)
        By how much each bolt is drawn shorter than it was made [length].
    force : ndarray, shape (b,)
        [force]
    applied : ndarray, shape (n,), or None
        The load of the case without that of its bolts; None while that is not in it [force].
    kept : ndarray of bool, shape (b,), or None
        Bolts that the step does not name; None before it is known what holds them.
    """

    shift: Array
    force: Array
    applied: Array | None = None
    kept: Mask | None = None

    @property
    def given(self) -> Mask:
        """Bolts that have a given force, (b,)."""
        return ~np.isnan(self.force)

    def towards(self, other: BoltLoads, share: float) -> BoltLoads:
        """The same bolts on the straight way to other values."""
        shift = self.shift + share * (other.shift - self.shift)
        force = self.force + share * (other.force - self.force)
        if self.applied is None or other.applied is None:
            return BoltLoads(shift, force)
        applied = self.applied + share * (other.applied - self.applied)
        return BoltLoads(shift, force, applied, other.kept)


@dataclass(eq=False)
class LoadCase(ByFields):
    """The loads in force over all bodies and contact points.

    What a step does not name stays as the step before left it, so that each follows from the last.

    Attributes
    ----------
    f, x : ndarray, shape (n,)
        Load [force] and prescribed displacements [length].
    gap0 : ndarray, shape (m,)
        Initial gap less interference and obstacle motion [length].
    slip0 : ndarray, shape (m, d-1)
        Slip by obstacle motion alone [length].
    interference : ndarray, shape (m,)
        Already part of `gap0` [length].
    motion : tuple of Motion
        Of the primary side of every contact; zero for deformable bodies.
    own : tuple of bool
        Of which contacts the interference is the contact's own, and not that of a step.
    scale : tuple of (float or None)
        Of which multiple of the bodies' own f and x these are; None where they were named.
    multiples : ndarray, shape (2, bodies), or None
        Where they were named: by which number steps multiply what is a body's own; None for ones.
    factor : float or None
        The number of the load step, where it was one.
    bolts : BoltLoads or None
        What holds the bolts, where there are any.
    apart : dict of ndarray
        What is known of loads by the number of their body, see `Member.apart`: pressures on all facets,
        of which `f` has the load on the undeformed boundary, or those of temperatures.
    """

    f: Array
    x: Array
    gap0: Array
    slip0: Array
    interference: Array
    motion: tuple[Motion, ...]
    own: tuple[bool, ...] = ()
    scale: tuple[float | None, float | None] = (None, None)
    multiples: Array | None = None
    factor: float | None = None
    bolts: BoltLoads | None = None
    apart: Mapping[int, Array] = field(default_factory=dict)

    def multiple(self, i: int, of_x: bool) -> float:
        """By which number the step multiplies the own f, or x, of a body."""
        scale = self.scale[of_x]
        if scale is not None:
            return scale
        return 1.0 if self.multiples is None else float(self.multiples[int(of_x), i])

    @property
    def applied(self) -> Array:
        """The load without that of bolts, (n,) [force]."""
        bolts = self.bolts
        return self.f if bolts is None or bolts.applied is None else bolts.applied

    def worn(self, depth: Array) -> LoadCase:
        """The same loads with gaps that are wider by a depth worn off, (m,)."""
        if not np.count_nonzero(depth):
            return self
        return replace(self, gap0=self.gap0 + depth, interference=self.interference - depth)

    def towards(self, other: LoadCase, share: float) -> LoadCase:
        """The load on the straight way from this one to another."""
        if share == 1.0:
            return other
        gap0 = np.where(np.isinf(other.gap0), np.inf, self.gap0)
        change = np.where(np.isinf(gap0), 0.0, other.gap0 - np.where(np.isinf(gap0), 0.0, gap0))
        return LoadCase(
            self.f + share * (other.f - self.f),
            self.x + share * (other.x - self.x),
            gap0 + share * change,
            self.slip0 + share * (other.slip0 - self.slip0),
            self.interference + share * (other.interference - self.interference),
            tuple(a.towards(b, share) for a, b in zip(self.motion, other.motion, strict=True)),
            other.own,
            bolts=other.bolts and self.bolts and self.bolts.towards(other.bolts, share),
            apart={
                i: np.asarray((1 - share) * self.apart.get(i, 0.0) + share * other.apart.get(i, 0.0))
                for i in {*self.apart, *other.apart}
            },
        )
