r"""How far contact has drifted from where ``sliding="small"`` takes it: what costs nearly nothing.

Small sliding keeps the partner, the frame and the gap of the undeformed bodies. With the slip ``s`` of
a point, the curvature ``k`` of the other side and the width ``w`` of the contact, that lets through

* forces that act by ``s`` beside their place: the share ``s/w`` of the contact, which is less than the
  mesh resolves below one facet;
* normals off by ``k s``, and so the directions of forces;
* gaps off by ``k s^2 / 2``, or what the true distance to a rigid obstacle at its place says, against
  the approach that the bodies take up elastically;
* points that press where the other surface has ended.

Linear bodies let through errors of the order of their strains and rotations. All of this is told from
what a load step knows: gaps, slips, forces and prescribed displacements; vectors of the size of the
contact, no displacement of the interior, no search. What is not known is estimated: without friction
the way along the surface is that of the supports, as a rigid motion. `validity` measures the rest.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skfem_contact.answers.thresholds import BEYOND, FACETS, GAP, NO_LENGTH, SAGITTA, TILT, WIDTH
from skfem_contact.answers.validity.chords import sagittas
from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.bodies.system import System
from skfem_contact.conditions.contact import Contact
from skfem_contact.conditions.lever import as_motion
from skfem_contact.conditions.loads import LoadCase, Motion
from skfem_contact.obstacles.level_set import LevelSet
from skfem_contact.obstacles.obstacle import Obstacle
from skfem_contact.obstacles.rigid_body import RigidBody
from skfem_contact.obstacles.shapes import RigidPlane
from skfem_contact.pairing.node import Pairing
from skfem_contact.trees import kd_tree

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class Drift:
    """How far one contact has drifted at an answer; largest values over its closed points.

    Attributes
    ----------
    closed : int
        Closed points.
    slip : float
        Since the undeformed state; that of a rigid obstacle's spin is the length of the arc [length].
    facets : float
        Slip over the length of the primary facet; 0 for obstacles, which have no mesh.
    widths : float
        Slip over the width of the contact.
    tilt : float
        Angle between the normals that are used and those where the points are [rad].
    gap_error : float
        By how much the gaps of small sliding are wrong; at rigid obstacles also overlaps of open
        points [length].
    gap_share : float
        That over the elastic approach.
    beyond : int
        Closed points that lie, with all of their share of the surface, beyond the end of the primary.
    overhang : float
        By how much the farthest of them does [length].
    beyond_share : float
        Normal force that acts beyond the end over that of the contact, points counted by the part of
        their share of the surface that has slid past it.
    motion : float
        By how much a rigid obstacle has moved where points are closed [length].
    approach : float
        What the bodies take up elastically between their supports and the contact [length].
    strain : float
        The approach over the extent of the bodies, or the mean pressure over the modulus.
    sagitta : float
        Height of the curves over one facet, the mean over the normal forces (`chords`) [length].

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
    >>> drift = result.validity.contacts["foot"].drift
    >>> (
    ...     bool(drift.widths < 0.1),
    ...     drift.beyond,
    ... )  # slip over the width of the contact, points past the end
    (True, 0)
    """

    closed: int = 0
    slip: float = 0.0
    facets: float = 0.0
    widths: float = 0.0
    tilt: float = 0.0
    gap_error: float = 0.0
    gap_share: float = 0.0
    beyond: int = 0
    overhang: float = 0.0
    beyond_share: float = 0.0
    motion: float = 0.0
    approach: float = 0.0
    strain: float = 0.0
    sagitta: float = 0.0

    @property
    def sagitta_share(self) -> float:
        """The height of the curves over one facet, over the elastic approach.

        Zero where the approach is round-off of that height: nothing presses, whatever touches.
        """
        return self.sagitta / self.approach if self.approach > NO_LENGTH * self.sagitta else 0.0

    @property
    def facets_too_long(self) -> bool:
        """Whether contact ends within the facets, so that their chords are not the curves."""
        return self.sagitta_share > SAGITTA

    @property
    def slides_far(self) -> bool:
        """Whether points have left the facets and the zone that they are held against."""
        return self.facets > FACETS and self.widths > WIDTH

    @property
    def small_sliding_holds(self) -> bool:
        """Whether small sliding is a good model at this answer."""
        off = self.tilt > TILT or self.gap_share > GAP
        return not (self.slides_far or self.passes_end or off)

    @property
    def passes_end(self) -> bool:
        """Whether much of the force acts beyond the end; the mesh resolves whole shares of points."""
        return self.beyond > 0 and self.beyond_share > BEYOND


class Track:
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
    """

    nodal = False  # whether only nodes see the primary; matters for faces

    def __init__(
        self, contact: Contact, pairing: Pairing, gap0: Array, own: Array | float = 0.0
    ) -> None:
        secondary, primary = contact.secondary, contact.primary
        self.secondary, self.primary = secondary, primary
        self.points, self.paired = secondary.points, pairing.paired
        self.normal, self.tangent = pairing.normal, pairing.tangent[:, 0]
        gap = np.where(pairing.paired, pairing.gap, 0.0)
        # rows of corners are not of the nodes that they stand for
        self.by_node = np.ones(len(gap), dtype=bool)
        self.by_node[[node for side, node in pairing.corners if side == 0]] = False
        if pairing.vertex is not None:
            self.by_node &= pairing.vertex < 0
        self.feet = self.points - gap[:, None] * pairing.normal  # on the primary
        self.spacing = node_lengths(secondary)
        # of an end node the surface has only half of the share
        ends = secondary.facets[:, :2][secondary.neighbours < 0]
        self.width = self.spacing.copy()
        self.width[ends] *= 2.0
        # what a given or adjusted gap adds to the measured one, interference apart
        self.added = np.where(self.paired, gap0 + own - gap, 0.0)
        # nothing is wrong with gaps of glued points
        self.follows = not contact.tied
        self.chord, self.curved = np.zeros(len(self.points)), False
        if isinstance(primary, ContactSurface):
            facet = np.where(self.paired, pairing.facet, 0)
            self.facet = primary.lengths[facet]
            self.curvature = np.where(self.follows, curvatures(primary)[facet], 0.0)
            self.turns = bool(self.curvature.any())
            # a gap that is given, or zero as meshed, knows the curves
            measured = contact.gap is None and not contact.adjust and not contact.bilateral
            if measured and contact.method == "node" and contact.sliding == "small":
                self.chord = np.where(self.paired, chord_gaps(primary, facet, self.points), 0.0)
            # of a node beyond the end at the start, the facet before it is in contact
            behind, ahead = ways_to_ends(primary, facet, self.points)
            self.behind, self.ahead = np.maximum(behind, 0.0), np.maximum(ahead, 0.0)
            # slips up to this leave a point with all of its share above the surface
            self.room = np.minimum(self.behind, self.ahead) - 0.5 * self.width
            self.curved = measured
            self.sagittas = sagittas(self.secondary, primary, facet) if self.curved else self.chord
            self.curved = self.curved and bool(self.sagittas.any())

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
            there = kd_tree(middles).query(moved[0])[1]
            heights = sagittas(self.secondary, self.primary, there, self.nodal)
        return float(force @ heights / total)

    def breadth(self, closed: Mask) -> float:
        """Of the contact [length]."""
        return float(self.spacing[closed].sum())

    def slip(self, vectors: Array, given: Array) -> Array:
        """Displacements along the tangents (m,) from slips (m, d), less given ones (m, d-1)."""
        x, y = vectors.T, self.tangent.T
        return np.asarray(x[0] * y[0] + x[1] * y[1] - given[:, 0])

    def tangential(self, vectors: Array) -> Array:
        """What is along the tangents; in 2-D rows of motions are already."""
        return vectors

    def spread(self, stretch: Array) -> float:
        """By how much slips differ from point to point [length]."""
        return float(stretch.max() - stretch.min())

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
        slip : ndarray, shape (m,)
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
        if isinstance(self.primary, Obstacle):
            motion, carried = tool or (case.motion[i], np.zeros((1, 1)))
            gap = np.where(self.paired, gap, 0.0)  # without a partner there is none
            lifted = gap - np.where(self.paired, case.gap0[part], 0.0)
            u = self.normal * lifted[:, None] + self.tangent * slip[:, None] + carried
            u[~self.paired] = 0.0
            added = self.added - case.interference[part]
            shape = self.primary.obstacle if isinstance(self.primary, RigidBody) else self.primary
            found = self._at_obstacle(shape, closed, u, gap, added, approach, motion)
            if tool is None:  # else it is part of the slip
                slip = slip - np.einsum("md,md->m", self.tangent, slid(motion, self.points))
        way = np.abs(slip[closed])
        if len(way):
            found["slip"] = float(way.max())
            found["widths"] = found["slip"] / self.breadth(closed)
        if isinstance(self.primary, Obstacle) or not len(way):
            return found
        found["facets"] = float((way / self.facet[closed]).max())
        if self.turns:
            curvature = self.curvature[closed]
            found["tilt"] = float(np.max(curvature * way))
            found["gap_error"] = error = float(np.max(0.5 * curvature * way**2))
            found["gap_share"] = error / approach if approach > 0 else 0.0
        if (way < self.room[closed]).all():
            return found | {"beyond": 0, "overhang": 0.0, "beyond_share": 0.0}
        return found | self._past_ends(closed, slip[closed], np.abs(force[closed]))

    def _past_ends(self, closed: Mask, slip: Array, force: Array) -> dict[str, Any]:
        """What has slid past the ends of the primary, by slip and force of closed points."""
        ahead, behind, share = self.ahead[closed], self.behind[closed], self.width[closed]
        past = np.maximum(slip - ahead, -slip - behind)
        beyond = past >= 0.5 * self.spacing[closed]
        # of the share of a point, as much as was above the surface and is no more
        lost = np.zeros(len(past))
        for way_there, way_on in ((ahead, slip), (behind, -slip)):
            above = np.minimum(0.5 * share + way_there, share)
            now = np.clip(0.5 * share + way_there - way_on, 0.0, above)
            lost = np.maximum(lost, 1 - now / above)
        return {
            "beyond": int(beyond.sum()),
            "overhang": float(np.max(past[beyond], initial=0.0)),
            "beyond_share": float(lost @ force / max(force.sum(), np.finfo(float).tiny)),
        }

    def _at_obstacle(
        self,
        obstacle: Obstacle,
        closed: Mask,
        u: Array,
        gap: Array,
        added: Array,
        approach: float,
        motion: Motion,
    ) -> dict[str, Any]:
        """Against the obstacle itself, where it and the points are now."""
        found = {}
        moved = np.linalg.norm(motion.shift(self.points), axis=1)
        found["motion"] = float(np.max(moved[closed], initial=0.0))
        if not self.follows or (isinstance(obstacle, RigidPlane) and not motion.turns):
            return found
        at = replace(self.secondary, points=self.points + u)
        distance, normal, facing = distances(obstacle.moved(motion.as_argument()), at)
        true = distance + added
        error = np.abs(true - gap)[closed & self.by_node]
        deepest = np.max(-true[~closed & facing & self.paired], initial=0.0)
        worst = float(max(np.max(error, initial=0.0), deepest))
        if worst <= NO_LENGTH * float(np.max(np.abs(at.points))):
            worst = 0.0
        cross = self.normal[:, 0] * normal[:, 1] - self.normal[:, 1] * normal[:, 0]
        angle = np.arctan2(np.abs(cross), np.einsum("md,md->m", self.normal, normal))
        found["tilt"] = float(np.max(angle[closed & self.by_node], initial=0.0))
        found["gap_error"] = worst
        # where nothing touches any more all of the force is lost
        found["gap_share"] = worst / max(approach, worst) if worst else 0.0
        return found


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


def distances(obstacle: Obstacle, surface: ContactSurface) -> tuple[Array, Array, Mask]:
    """Distances, normals and partners of `Obstacle.distance`, of a level set to first order."""
    if not isinstance(obstacle, LevelSet):
        return obstacle.distance(surface)
    return obstacle.first_order(surface)


def slid(motion: Motion, points: Array) -> Array:
    """How far an obstacle's surface has come along under points, the whole turn counted, (m, d)."""
    return motion.slid(Motion.none(len(motion.centre)), points)


def node_lengths(surface: ContactSurface) -> Array:
    """The share of every node in the length of the surface, shape (m,) [length]."""
    share = np.array([0.5, 0.5] if surface.facets.shape[1] == 2 else [0.25, 0.25, 0.5])
    length = (surface.lengths[:, None] * share).ravel()
    return np.asarray(np.bincount(surface.facets.ravel(), length, len(surface.points)), dtype=float)


def curvatures(surface: ContactSurface) -> Array:
    """Of every facet, by the normals at its ends: averaged, except over corners, (nf,) [1/length]."""
    normal = surface.facet_node_normals
    return np.asarray(np.linalg.norm(normal[:, 1] - normal[:, 0], axis=1) / surface.lengths)


def chord_gaps(surface: ContactSurface, facet: Index, points: Array) -> Array:
    """How far straight facets are below the smooth curve through their nodes, where points are, (m,).

    Nothing at their nodes and for quadratic facets; in between a parabola through the sagitta.
    """
    if surface.quadratic:
        return np.zeros(len(points))
    a, b = surface.points[surface.facets[facet, 0]], surface.points[surface.facets[facet, 1]]
    length = surface.lengths[facet]
    part = np.clip(np.einsum("md,md->m", points - a, b - a) / length**2, 0.0, 1.0)
    return np.asarray(curvatures(surface)[facet] * length**2 * part * (1 - part) / 2)


def ways_to_ends(surface: ContactSurface, facet: Index, points: Array) -> tuple[Array, Array]:
    """Along the surface from points above facets to where it begins and ends; ``inf`` if it is closed.

    Parameters
    ----------
    surface : ContactSurface
    facet : ndarray of int, shape (m,)
    points : ndarray, shape (m, d)
    """
    number, before = np.arange(len(surface.facets)), surface.neighbours[:, 0]
    first = before != number - 1
    first[0] = True
    piece = np.cumsum(first) - 1
    total = np.bincount(piece, surface.lengths)
    start = np.cumsum(surface.lengths) - surface.lengths
    start = start - start[np.flatnonzero(first)][piece]
    closed = np.ones(len(total), dtype=bool)
    closed[piece[(surface.neighbours < 0).any(axis=1)]] = False
    a, b = surface.points[surface.facets[facet, 0]], surface.points[surface.facets[facet, 1]]
    along = (b - a) / np.linalg.norm(b - a, axis=1)[:, None]
    place = start[facet] + np.einsum("md,md->m", points - a, along)
    endless = closed[piece[facet]]
    return (
        np.where(endless, np.inf, place),
        np.where(endless, np.inf, total[piece[facet]] - place),
    )
