r"""`Track`: where the points of one contact with small sliding may be led by their slip, see `Drift`.

With the slip vector s of a point, the curvature of the other side as a tensor K (``K t`` is the change
of the normal along t) and the width w of the closed part, the root of its area in space: normals are
off by ``|K s|``, gaps by ``|s.K s| / 2``, and forces act by ``|s| / w`` of the contact beside their
place. At obstacles normals and gaps are compared with those where the obstacle and the points are.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from skfem_contact.answers.validity.chords import curvatures, sagittas
from skfem_contact.answers.validity.deformed_boundaries import distances
from skfem_contact.arrays import Array, Mask, angle_between, dot, largest, off_segments
from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.bodies.system import System
from skfem_contact.conditions.contact import Contact
from skfem_contact.conditions.rows import as_motion
from skfem_contact.conditions.state import LoadCase, Motion
from skfem_contact.digits import COMPUTED, SOLVED
from skfem_contact.obstacles.obstacle import Obstacle
from skfem_contact.obstacles.rigid_body import shape_of
from skfem_contact.pairing.node import Pairing
from skfem_contact.trees import Tree

#: What `Track.drift` says where nothing has slid past an end.
NONE_PAST = {"beyond": 0, "overhang": 0.0, "beyond_share": 0.0}


class Track:
    """The places to which the points of one contact with small sliding may be led by their slip.

    Slips are vectors in global axes, in the tangent plane of each point, (m, d).

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
    width : ndarray, shape (m,)
        That, twice at the ends of curves, where the surface has only half of it.
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
    of_pieces : bool
        Whether a rigid obstacle of straight pieces is met, whose heights depend on where it is.
    bend : ndarray, shape (d, d), or None
        How a rigid obstacle curves, where that is known and its gaps are measured [1/length].
    room : ndarray, shape (m,)
        Slips up to this leave a point with all of its share above the surface [length].
    by_node : ndarray of bool, shape (m,)
        Points whose row is of the node that they stand for, and of no corner.
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
        self.spacing = self.width = node_lengths(self.secondary, pairing)
        if self.secondary.dim == 2:
            self.width = self.spacing.copy()
            self.width[self.secondary.facets[:, :2][self.secondary.twins < 0]] *= 2.0
        self.added = np.where(self.paired, gap0 + own - gap, 0.0)
        self.follows, self.nodal = not contact.tied, contact.method == "node"
        # a turn that is linear stretches what is glued: linear bodies do not feel it
        self.stretched = contact.tied and getattr(self.secondary.body, "finite_strain", False)
        self.by_node = _by_node(pairing)
        self.curved = self.of_pieces = False
        # a gap that is given, or zero as meshed, knows the curves
        measured = contact.gap is None and not contact.adjust and not contact.bilateral
        self.bend = None
        if measured and isinstance(self.primary, Obstacle):
            self.bend = self.primary.bend
            self.curved = self.of_pieces = self.primary.outline is not None
            self.unlike = 1.0
        if self.bend is not None:
            self.sagittas = sagittas(self.secondary, self.bend)
            self.curved = bool(self.sagittas.any())
        if isinstance(self.primary, ContactSurface):
            facet = np.where(self.paired, pairing.facet, 0)
            self.facet = self.primary.lengths[facet]
            self.bends = curvatures(self.primary)[facet] * float(self.follows)
            self.turns = bool(self.bends.any())
            self.rim = Rim.of(self.primary)
            self.room = self.rim.at_least(self.feet) - 0.5 * self.width
            # gaps of boundaries that fit are those of the curves, whatever the facets
            self.unlike = 1.0 if pairing.smooth is None else 1.0 - pairing.smooth
            self.sagittas = np.zeros(len(self.points))
            if measured:
                self.sagittas = sagittas(self.secondary, self.primary, facet, self.nodal) * self.unlike
            self.curved = measured and bool(self.sagittas.any())

    def sagitta(self, force: Array, moved: tuple[Array, Array, ContactSurface] | None = None) -> float:
        """Height of the curves over one facet where normal forces act, their mean [length].

        Parameters
        ----------
        force : ndarray, shape (m,)
            Of closed points; zero elsewhere.
        moved : (ndarray, ndarray, ContactSurface), optional
            Where partners are found anew, the places of both sides' nodes [length], and the primary.
        """
        force = np.abs(force)
        total = float(force.sum())
        if not (self.curved and total > 0):
            return 0.0
        if moved is None:
            return float(force @ self.sagittas / total)
        points, others, primary = moved
        middles = others[primary.facets[:, : primary.kind.corners]].mean(axis=1)
        there = Tree(middles).query(points)[1]
        heights = sagittas(self.secondary, primary, there, self.nodal) * self.unlike
        return float(force @ heights / total)

    def breadth(self, closed: Mask) -> float:
        """Length of the closed part, in space the root of its area [length]."""
        if self.points.shape[1] == 2:
            return float(self.spacing.dot(closed))
        return float(np.sqrt(np.sum(self.spacing[closed] ** 2)))

    def slip(self, vectors: Array, given: Array, dragged: Array, closed: Mask) -> tuple[Array, float]:
        """Slips from vectors (m, d), less what obstacles give along the tangents, (m, d-1).

        And by how much those of closed points differ, what supports drag them by taken off [length].
        """
        slip = self.tangential(vectors) - np.einsum("mk,mkd->md", given, self.tangent)
        return slip, self._spread(slip - dragged, closed) if closed.any() else 0.0

    def split(self, vectors: Array) -> tuple[Array, Array]:
        """The part of vectors (m, d) along the normal of each point, (m,), and that in its plane."""
        along = dot(vectors, self.normal)
        return along, np.asarray(vectors - along[:, None] * self.normal)

    def tangential(self, vectors: Array) -> Array:
        """The part of vectors (m, d) in the tangent plane of each point."""
        return self.split(vectors)[1]

    def _spread(self, stretch: Array, closed: Mask) -> float:
        """By how much slips (m, d) of closed points differ; in the plane along the surface [length]."""
        if stretch.shape[1] == 2:
            return float(np.ptp(dot(stretch, self.tangent[:, 0])[closed]))
        stretch = stretch[closed]
        end = stretch.mean(axis=0)
        for _ in range(2):  # the one that differs most from the mean, and that which does from it
            away = np.linalg.norm(stretch - end, axis=1)
            end = stretch[np.argmax(away)]
        return float(away.max())

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
        slip : ndarray, shape (m, d)
            Of the secondary relative to a deformable primary [length].
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
            slip = slip - self.tangential(slid(case.motion[i], self.points))
        if not np.count_nonzero(closed):
            return found
        way = np.linalg.norm(slip, axis=1)
        breadth = self.breadth(closed)
        found["slip"] = largest(way[closed])
        found["widths"] = found["slip"] / breadth if breadth > 0 else np.inf
        if on_obstacle:
            return found
        found["facets"] = largest((way / self.facet)[closed])
        if self.turns:
            turned = np.einsum("mde,me->md", self.bends, slip)[closed]
            error = float(np.max(0.5 * np.abs(dot(turned, slip[closed]))))
            found["tilt"] = float(np.linalg.norm(turned, axis=1).max())
            found["gap_error"] = error
            found["gap_share"] = error / approach if approach > 0 else 0.0
        far = closed & (way >= self.room)
        if not np.count_nonzero(far):
            return found | NONE_PAST
        return found | self._past_end(closed, far, slip, np.abs(force))

    def _past_end(self, closed: Mask, far: Mask, slip: Array, force: Array) -> dict[str, Any]:
        """Return what of `far` points has slid past the end of the primary."""
        share = self.width[far]
        before = self.rim.beyond(self.feet[far])
        past = self.rim.beyond(self.feet[far] + slip[far])
        beyond = (past >= 0.5 * self.spacing[far]) & (past > before)
        # of the share of a point, as much as was above the surface and is no more
        above = np.clip(0.5 * share - before, 0.0, share)
        now = np.clip(0.5 * share - past, 0.0, above)
        there = above > 0
        lost = np.where(there, 1 - now / np.where(there, above, 1.0), 0.0)
        total = max(float(force[closed].sum()), np.finfo(float).tiny)
        return {
            "beyond": int(beyond.sum()),
            "overhang": float(np.max(past[beyond], initial=0.0)),
            "beyond_share": float(lost @ force[far] / total),
        }

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
        """Against the obstacle itself, where it and the points are now."""
        from skfem_contact.obstacles.shapes import RigidPlane

        assert isinstance(self.primary, Obstacle)
        motion, carried = tool or (case.motion[i], np.zeros((1, 1)))
        obstacle = shape_of(self.primary)
        found: dict[str, Any] = {}
        moved = np.linalg.norm(motion.shift(self.points), axis=1)
        found["motion"] = float(np.max(moved[closed], initial=0.0))
        if self.stretched and tool is not None:
            off = np.linalg.norm(motion.shift(self.points) - carried, axis=1)
            error = float(np.max(off[closed], initial=0.0))
            found |= {"gap_error": error, "gap_share": error / approach if approach > 0 else 0.0}
        if not self.follows or (isinstance(obstacle, RigidPlane) and not motion.turns):
            return found
        gap = np.where(self.paired, gap, 0.0)  # without a partner there is none
        lifted = gap - np.where(self.paired, case.gap0[part], 0.0)
        u = self.normal * lifted[:, None] + slip + carried
        u[~self.paired] = 0.0
        added = self.added - case.interference[part]
        at = replace(self.secondary, points=self.points + u)
        distance, normal, facing = distances(obstacle.moved(motion.as_argument()), at)
        true = distance + added
        compared = closed & self.by_node
        angle = angle_between(self.normal, normal)
        found["tilt"] = float(np.max(angle[compared], initial=0.0))
        sunk, noise = ~closed & facing & self.paired, COMPUTED * float(np.max(np.abs(at.points)))
        return found | _gaps_at_obstacle(true, gap, compared, sunk, approach, noise)


def _by_node(pairing: Pairing) -> Mask:
    """Points whose row is of the node that they stand for, and of no corner."""
    own = np.diff(pairing.secondary_weights.tocsr().indptr) == 1
    own[[node for side, node in pairing.corners if side == 0]] = False
    if pairing.vertex is not None:
        own &= pairing.vertex < 0
    return np.asarray(own)


def node_lengths(surface: ContactSurface, pairing: Pairing) -> Array:
    """The share of every node in the surface, as a length, shape (m,) [length]."""
    if surface.dim == 3:
        return np.sqrt(np.maximum(pairing.area, 0.0))
    share = np.array([0.5, 0.5] if surface.facets.shape[1] == 2 else [0.25, 0.25, 0.5])
    length = (surface.lengths[:, None] * share).ravel()
    return np.asarray(np.bincount(surface.facets.ravel(), length, len(surface.points)), dtype=float)


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


def _gaps_at_obstacle(
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


class Rim:
    """The rim of a surface: the end points of a curve, or the edges of faces.

    Attributes
    ----------
    corners : ndarray, shape (e, d - 1, d)
        Ends of curves, or of the chords of edges [length].
    outward : ndarray, shape (e, d)
        Unit vectors out of the surface, in the plane of the facet.
    """

    def __init__(self, corners: Array, outward: Array) -> None:
        self.corners = corners
        self.outward = outward / np.linalg.norm(outward, axis=1, keepdims=True)
        middle = corners.mean(axis=1)
        self.tree = Tree(middle) if len(corners) else None
        self.half = float(np.max(np.linalg.norm(corners[:, 0] - middle, axis=1), initial=0.0))

    @classmethod
    def of(cls, surface: ContactSurface) -> Rim:
        """Say that of a surface."""
        x, c = surface.points, surface.kind.corners
        facet, edge = np.nonzero(surface.twins < 0)
        ends = x[surface.facets[facet[:, None], np.column_stack([edge, (edge + 1) % c])]]
        if surface.dim == 2:
            return cls(ends[:, :1], ends[:, 0] - ends[:, 1])
        return cls(ends, np.cross(ends[:, 1] - ends[:, 0], surface.facet_normals[facet]))

    def at_least(self, points: Array) -> Array:
        """What points are away from the rim at least, (m,); ``inf`` where there is none [length]."""
        if self.tree is None:
            return np.full(len(points), np.inf)
        return np.maximum(self.tree.distances(points) - self.half, 0.0)

    def beyond(self, points: Array) -> Array:
        """How far points lie beyond the rim along the surface, negative above it, (p,) [length]."""
        if self.tree is None:
            return np.full(len(points), -np.inf)
        few = min(8, len(self.corners))
        near = np.asarray(self.tree.query(points, k=few)[1]).reshape(len(points), few)
        start, end = self.corners[near, 0], self.corners[near, -1]
        away = off_segments(points[:, None], start, end - start)
        distance = np.linalg.norm(away, axis=2)
        # where two edges meet at the nearest corner the sum of both tells, of notches and holes as well
        out = np.sum(away * self.outward[near], axis=2)
        nearest = distance <= distance.min(axis=1, keepdims=True) * (1 + SOLVED)
        out = np.sum(out, axis=1, where=nearest)
        return np.where(out > 0, 1.0, -1.0) * distance.min(axis=1)
