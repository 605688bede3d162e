"""`LoadCase`: the loads of one step over all bodies and contact points."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field, replace
from functools import cached_property
from typing import Any

import numpy as np

from skfem_contact.arrays import Array, Mask, largest
from skfem_contact.obstacles.obstacle import rotation_matrix, spin
from skfem_contact.records import dataclass
from skfem_contact.sealed import ByFields


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
        length of the arc. In space the turn is the spin on the way between both.
        """
        step = np.tile(self.translation - before.about(self.centre).translation, (len(points), 1))
        turn = self.angle - before.angle
        if not np.any(turn):
            return step
        arm = points - self.centre - self.translation
        if np.ndim(turn):
            return np.asarray(step + np.cross(spin(before.angle, self.angle), arm))
        step += turn * np.column_stack([-arm[:, 1], arm[:, 0]])
        return step

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
    factor : float or None
        The number of the load step, where it was one.
    bolts : BoltLoads or None
        What holds the bolts, where there are any.
    fluid : dict of ndarray
        Pressures on all facets of bodies, by their number: `f` has their load on the undeformed
        boundary, and the deformed one another [stress].
    """

    f: Array
    x: Array
    gap0: Array
    slip0: Array
    interference: Array
    motion: tuple[Motion, ...]
    own: tuple[bool, ...] = ()
    scale: tuple[float | None, float | None] = (None, None)
    factor: float | None = None
    bolts: BoltLoads | None = None
    fluid: Mapping[int, Array] = field(default_factory=dict)

    @property
    def applied(self) -> Array:
        """The load without that of bolts, (n,) [force]."""
        bolts = self.bolts
        return self.f if bolts is None or bolts.applied is None else bolts.applied

    @cached_property
    def largest_force(self) -> float:
        """Largest entry of the load; asked for by all that tells forces from round-off [force]."""
        return largest(np.abs(self.f))

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
            fluid={
                i: np.asarray((1 - share) * self.fluid.get(i, 0.0) + share * other.fluid.get(i, 0.0))
                for i in {*self.fluid, *other.fluid}
            },
        )
