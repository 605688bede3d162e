"""`Track`: where the points of one contact with small sliding may be led by their slip, see `drift`.

This is what curves and faces have in common; how they measure is in `curve_track` and `face_track`.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skfem_contact.answers.validity.chords import sagittas
from skfem_contact.answers.validity.tool_chords import tool_sagittas
from skfem_contact.arrays import largest
from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.bodies.system import System
from skfem_contact.conditions.contact import Contact
from skfem_contact.conditions.loads import LoadCase, Motion
from skfem_contact.conditions.rows import as_motion
from skfem_contact.obstacles.obstacle import Obstacle
from skfem_contact.pairing.node import Pairing
from skfem_contact.trees import Tree

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Mask = NDArray[np.bool_]

#: What `Track.drift` says where nothing has slid past an end.
NONE_PAST = {"beyond": 0, "overhang": 0.0, "beyond_share": 0.0}


class Track(ABC):
    """Where the points of one contact with small sliding may be led by their slip.

    Parameters
    ----------
    contact : Contact
    pairing : Pairing
        Of the undeformed bodies.
    gap0 : ndarray, shape (m,)
        Initial gaps with the contact's own interference [length].
    own : ndarray, shape (m,), or 0.0
        That interference [length].

    Attributes
    ----------
    feet : ndarray, shape (m, d)
        Of the points on the primary; the points themselves where there is none.
    spacing : ndarray, shape (m,)
        The share of each point in the surface, as a length.
    added : ndarray, shape (m,)
        What a given or adjusted gap adds to the measured one, interference apart [length].
    follows : bool
        Whether anything is wrong with gaps: nothing is with those of glued points.
    nodal : bool
        Whether only nodes see the primary.
    facet : ndarray, shape (m,)
        Length of the facet that each point meets.
    turns : bool
        Whether the primary curves.
    sagittas : ndarray, shape (m,)
        Heights of curves over one facet [length].
    unlike : ndarray, shape (m,), or float
        The part of these heights that gaps do not know, see `Pairing.smooth`.
    curved : bool
        Whether there are such heights.
    bend : ndarray, shape (d, d), or None
        How a rigid obstacle curves, where that is known and its gaps are measured [1/length].
    room : ndarray, shape (m,)
        Slips up to this leave a point with all of its share above the surface [length].
    """

    facet: Array
    room: Array
    turns: bool
    sagittas: Array
    unlike: Array | float

    def __init__(
        self, contact: Contact, pairing: Pairing, gap0: Array, own: Array | float = 0.0
    ) -> None:
        self.secondary, self.primary = contact.secondary, contact.primary
        self.points, self.paired = contact.secondary.points, pairing.paired
        self.normal, self.tangent = pairing.normal, pairing.tangent
        gap = np.where(pairing.paired, pairing.gap, 0.0)
        self.feet = self.points - gap[:, None] * pairing.normal
        self.spacing = self._spacing(pairing)
        self.added = np.where(self.paired, gap0 + own - gap, 0.0)
        self.follows, self.nodal = not contact.tied, contact.method == "node"
        self.curved = False
        # a gap that is given, or zero as meshed, knows the curves
        measured = contact.gap is None and not contact.adjust and not contact.bilateral
        self.bend = None
        if measured and isinstance(self.primary, Obstacle):
            self.bend = self.primary.bend
        if self.bend is not None:
            self.sagittas = tool_sagittas(self.secondary, self.bend)
            self.curved = bool(self.sagittas.any())
        if isinstance(self.primary, ContactSurface):
            facet = np.where(self.paired, pairing.facet, 0)
            self.facet = self.primary.lengths[facet]
            self._look_at_primary(self.primary, facet)
            # gaps of boundaries that fit are those of the curves, whatever the facets
            self.unlike = 1.0 if pairing.smooth is None else 1.0 - pairing.smooth
            self.sagittas = np.zeros(len(self.points))
            if measured:
                self.sagittas = sagittas(self.secondary, self.primary, facet, self.nodal) * self.unlike
                self.sagittas[self._on_one_surface(gap)] = 0.0
            self.curved = measured and bool(self.sagittas.any())

    def _on_one_surface(self, gap: Array) -> Mask:
        """Points around which both sides are known to be one surface, by their gaps (m,)."""
        return np.zeros(len(gap), dtype=bool)

    def sagitta(self, force: Array, moved: tuple[Array, Array] | None) -> float:
        """Height of the curves over one facet where normal forces act, their mean [length].

        Parameters
        ----------
        force : ndarray, shape (m,)
            Of closed points; zero elsewhere.
        moved : pair of ndarray, optional
            Where points slide far, the places of both sides' nodes [length].
        """
        force = np.abs(force)
        total = float(force.sum())
        if not (self.curved and total > 0):
            return 0.0
        heights = self.sagittas
        if moved is not None and isinstance(self.primary, ContactSurface):
            corners = self.primary.facets[:, : self.primary.kind.corners]
            middles = moved[1][corners].mean(axis=1)
            there = Tree(middles).query(moved[0])[1]
            heights = sagittas(self.secondary, self.primary, there, self.nodal) * self.unlike
        return float(force @ heights / total)

    def drift(
        self,
        closed: Mask,
        slip: Array,
        gap: Array,
        force: Array,
        approach: float,
        case: LoadCase,
        i: int,
        part: slice,
        tool: tuple[Motion, Array] | None = None,
    ) -> dict[str, Any]:
        """The numbers of `Drift` that are those of small sliding.

        Parameters
        ----------
        closed : ndarray of bool, shape (m,)
        slip : ndarray, shape (m,), of solids (m, 3)
            Displacement of the secondary along the tangents, relative to a deformable primary [length].
        gap : ndarray, shape (m,)
            Of the answer [length].
        force : ndarray, shape (m,)
            Normal forces.
        approach : float
            [length]
        case : LoadCase
        i, part : int, slice
            The contact, and its points.
        tool : pair of Motion and ndarray, optional
            Of a rigid body, see `tool_motion`.
        """
        found: dict[str, Any] = {}
        on_obstacle = isinstance(self.primary, Obstacle)
        if on_obstacle:
            found = self._at_obstacle(closed, slip, gap, approach, case, i, part, tool)
        if on_obstacle and tool is None:  # else it is part of the slip
            slip = slip - self._along_tangents(slid(case.motion[i], self.points))
        if not np.count_nonzero(closed):
            return found
        way = self._size(slip)
        breadth = self.breadth(closed)
        found["slip"] = largest(way[closed])
        found["widths"] = found["slip"] / breadth if breadth > 0 else np.inf
        if on_obstacle:
            return found
        found["facets"] = largest((way / self.facet)[closed])
        if self.turns:
            found["tilt"], error = self._off_by_curvature(closed, slip)
            found["gap_error"] = error
            found["gap_share"] = error / approach if approach > 0 else 0.0
        far = closed & (way >= self.room)
        if not np.count_nonzero(far):
            return found | NONE_PAST
        return found | self._past_end(closed, far, slip, np.abs(force))

    @abstractmethod
    def breadth(self, closed: Mask) -> float:
        """Of the contact [length]."""

    @abstractmethod
    def slip(self, vectors: Array, given: Array) -> Array:
        """Displacements along the tangents from slips (m, d), less given ones (m, d-1)."""

    @abstractmethod
    def tangential(self, vectors: Array) -> Array:
        """What of the rows of motions is along the tangents."""

    @abstractmethod
    def spread(self, stretch: Array) -> float:
        """By how much slips differ from point to point [length]."""

    @abstractmethod
    def _spacing(self, pairing: Pairing) -> Array:
        """`spacing`."""

    @abstractmethod
    def _look_at_primary(self, primary: ContactSurface, facet: Index) -> None:
        """Curvature and ends where points meet these facets."""

    @abstractmethod
    def _along_tangents(self, vectors: Array) -> Array:
        """The part of vectors (m, d) along the tangents, as slips are."""

    @abstractmethod
    def _size(self, slip: Array) -> Array:
        """Of slips, shape (m,) [length]."""

    @abstractmethod
    def _off_by_curvature(self, closed: Mask, slip: Array) -> tuple[float, float]:
        """Largest angle [rad] and error of gaps [length] that slips along a curved primary bring."""

    @abstractmethod
    def _past_end(self, closed: Mask, far: Mask, slip: Array, force: Array) -> dict[str, Any]:
        """What of `far` points has slid past the end of the primary."""

    def _at_obstacle(
        self,
        closed: Mask,
        slip: Array,
        gap: Array,
        approach: float,
        case: LoadCase,
        i: int,
        part: slice,
        tool: tuple[Motion, Array] | None,
    ) -> dict[str, Any]:
        """Against the obstacle itself, where it and the points are now; of solids see `solids`."""
        return {}


def tool_motion(
    system: System, contact: Contact, track: Track, u: Array
) -> tuple[Motion, Array] | None:
    """Motion of a contact's rigid body, and the linear displacement (m, d) it gives points on it.

    By displacements u of the system (n,); None where the primary is none.
    """
    body = contact.rigid_body
    if body is None:
        return None
    motion = Motion(*as_motion(system, body, u))
    arm = np.where(track.paired[:, None], track.feet, track.points) - body.about
    if arm.shape[1] == 3:
        return motion, motion.translation + np.cross(motion.angle, arm)
    turned = motion.angle * np.column_stack([-arm[:, 1], arm[:, 0]])
    return motion, motion.translation + turned


def gaps_at_obstacle(
    true: Array, gap: Array, closed: Mask, open_: Mask, approach: float, noise: float
) -> dict[str, float]:
    """`gap_error` and `gap_share` of `Drift` at an obstacle.

    Parameters
    ----------
    true, gap : ndarray, shape (m,)
        Gaps as they are, and as small sliding has them [length].
    closed, open_ : ndarray of bool, shape (m,)
        Points that are compared, and those that may be sunk in.
    approach : float
        That the bodies take up elastically; where nothing presses no force is lost by a gap [length].
    noise : float
        Round-off of gaps [length].
    """
    error = (true - gap)[closed]
    error = np.abs(error) if approach > 0 else -error
    worst = float(max(np.max(error, initial=0.0), np.max(-true[open_], initial=0.0)))
    worst = worst if worst > noise else 0.0
    # where nothing touches any more all of the force is lost
    return {"gap_error": worst, "gap_share": worst / max(approach, worst) if worst else 0.0}


def off_arc(motion: Motion, track: Track, force: Array) -> float:
    """`Drift.off_arc`, under normal forces (m,).

    Where it is carried along as well, the centre has been half way in the mean.
    """
    if not motion.turns:
        return 0.0
    arc = slid(motion, track.points + 0.5 * motion.translation)
    off = arc - motion.shift(track.points)
    arc, off = (v - np.sum(v * track.normal, axis=1)[:, None] * track.normal for v in (arc, off))
    whole = float(force @ np.linalg.norm(arc, axis=1))
    return float(force @ np.linalg.norm(off, axis=1)) / whole if whole > 0 else 0.0


def slid(motion: Motion, points: Array) -> Array:
    """How far an obstacle's surface has come along under points, the whole turn counted, (m, d)."""
    return motion.slid(Motion.none(len(motion.centre)), points)
