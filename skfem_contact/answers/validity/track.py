r"""`ContactWatch`: what one contact shows of the bounds of the model at an answer, see `Drift`.

Its `Track` is where points with small sliding may be led by their slip. With the slip vector s of a
point, the curvature of the other side as a tensor K (``K t`` is the change of the normal along t) and
the width w of the closed part, the root of its area in space: normals are off by ``|K s|``, gaps by
``|s.K s| / 2``, and forces act by ``|s| / w`` of the contact beside their place. At obstacles normals
and gaps are compared with those where the obstacle and the points are.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from copy import copy
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skfem_contact.answers.answer import Answer
from skfem_contact.answers.validity.chords import curvatures, drawn_off, sagittas
from skfem_contact.answers.validity.deformed_boundaries import Edges, Rim, sharp_edges_of
from skfem_contact.answers.validity.support import (
    Support,
    beyond_round_off,
    pressed_in,
    with_elastic_approach,
)
from skfem_contact.answers.validity.validity import Drift
from skfem_contact.arrays import Array, Index, Mask, angle_between, dot, size_of
from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.conditions.contact import Contact
from skfem_contact.conditions.geometry import Geometry
from skfem_contact.conditions.rows import as_motion
from skfem_contact.conditions.state import OPEN, LoadCase, Motion
from skfem_contact.digits import COMPUTED
from skfem_contact.obstacles.obstacle import Obstacle
from skfem_contact.obstacles.rigid_body import shape_of
from skfem_contact.pairing.closest import signed_distances
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

    def slip(
        self, vectors: Array, given: Array | None, dragged: Array, closed: Mask
    ) -> tuple[Array, float]:
        """Slips from vectors (m, d), less what obstacles give along the tangents, (m, d-1).

        And by how much those of closed points differ, what supports drag them by taken off [length].
        """
        slip = self.tangential(vectors)
        if given is not None:
            slip = slip - np.einsum("mk,mkd->md", given, self.tangent)
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

    def drift(self, closed: Mask, slip: Array, force: Array, approach: float) -> dict[str, Any]:
        """The numbers of `Drift` that slips (m, d) of closed points have, under normal forces (m,).

        Over what the bodies take up elastically, the approach [length].
        """
        if not np.count_nonzero(closed):
            return {}
        way = np.linalg.norm(slip, axis=1)
        breadth, longest = self.breadth(closed), float(way[closed].max(initial=0.0))
        found = {"slip": longest, "widths": longest / breadth if breadth > 0 else np.inf}
        if isinstance(self.primary, Obstacle):
            return found
        found["facets"] = float((way / self.facet)[closed].max(initial=0.0))
        if self.turns:
            turned = np.einsum("mde,me->md", self.bends, slip)[closed]
            error = float(np.max(0.5 * np.abs(dot(turned, slip[closed]))))
            found["tilt"] = float(np.linalg.norm(turned, axis=1).max())
            found |= {"gap_error": error, "gap_share": error / approach if approach > 0 else 0.0}
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


class ContactWatch(Track):
    """The part of the look at one contact that does not change from answer to answer.

    Parameters
    ----------
    geometry : Geometry
    i : int
        The contact.
    supports : sequence of Support
        Of all bodies.
    diagonals : sequence of ndarray
        Of the stiffness of every body [force/length].
    known : callable
        Gives the DOFs whose displacements are known without the interior; called only where bodies that
        nothing holds along a frictionless contact may slide on it.

    Attributes
    ----------
    soft : float
        What a force on a point presses it in [length/force].
    spared : ndarray, shape (m,), or None
        What of `soft` points do not feel, because supports take up their force on one side.
    motions : list of ndarray, shape (m, d, r)
        How far motions of each body move points.
    by_force, held : bool
        Whether no support holds the secondary along the normals, against an obstacle; and whether
        supports hold both sides.
    loose : list of Support, or None
        Motions of bodies where neither friction nor supports say how they slide.
    inside : bool
        Whether some of these show in the interior alone.
    asks : bool
        Whether displacements at the contact DOFs are asked for.
    """

    def __init__(
        self,
        geometry: Geometry,
        i: int,
        supports: Sequence[Support],
        diagonals: Sequence[Array],
        known: Callable[[], Index],
    ) -> None:
        self.geometry, self.i, self.system = geometry, i, geometry.system
        self.contact, self.part = geometry.contacts[i], geometry.point_slices[i]
        contact, pairing = self.contact, geometry.pairings[i]
        super().__init__(contact, pairing, geometry.kin.gap0[self.part], geometry.interference[i])
        self.dim = self.points.shape[1]
        self.small = contact.sliding == "small"
        self.rigid, self.tool = contact.rigid, contact.rigid_body is not None
        self.of_triangles = of_triangles(contact)
        sides = self.sides
        self.bodies = [self.system.index(side.body) for side in sides]
        # the diagonal of K at a surface is of the order of the modulus, whatever the mesh; in 3-D
        # of half of it times the size of a face. Its mean over the axes is the same in all axes
        stiff = [diagonals[b][s.dofs].mean(axis=1) for b, s in zip(self.bodies, sides, strict=True)]
        self.extent = sum(supports[b].arm for b in self.bodies)
        size = [1.0 if self.dim == 2 else 0.5 * float(np.median(side.lengths)) for side in sides]
        self.soft, self.spared = pressed_in(pairing, sides, stiff, size)
        if contact.rigid_body is not None:  # it takes up nothing, but it moves
            self.bodies.append(self.system.index(contact.rigid_body))
        held_by = [supports[b] for b in self.bodies]
        self.motions = [s.unit_at(self.points) for s in held_by]
        by = [(s, unit[self.paired]) for s, unit in zip(held_by, self.motions, strict=True)]
        holds = [s.holds(unit, self.normal[self.paired]) for s, unit in by]
        self.by_force, self.held = contact.rigid and not holds[0], all(holds)
        self.inside, self.loose = False, None
        if self.small and contact.friction is None and not contact.tied:
            along = np.moveaxis(self.tangent[self.paired], 1, 0)
            if not all(s.holds(unit, way) for s, unit in by for way in along):
                self.loose = [self._free(b, known()) for b in self.bodies]
        self.asks = self.of_triangles or self.loose is not None or self.of_pieces
        self.asks |= self.tool and self.small

    def carried(self) -> ContactWatch:
        """What an answer takes along, without what steps alone look with: it comes from the bodies."""
        out = copy(self)
        steps = "geometry motions loose soft spared by_force held inside asks"
        for name in steps.split():
            delattr(out, name)
        return out

    def _free(self, b: int, known: Index) -> Support:
        """Return how a body moves as a whole, by what is known of its displacements."""
        start, end = self.system.offsets[b : b + 2]
        known = known[(known >= start) & (known < end)] - start
        body = self.system.bodies[b]
        found = Support.of(body, int(start), np.union1d(known, body.D), self.system.extent)
        if not found.free.shape[1]:
            return found
        # frictionless contact along an axis knows no displacements across it: those of all DOFs say it
        self.inside = True
        return Support.of(body, int(start), np.arange(body.n), self.system.extent)

    def _apart(self, motions: Sequence[Array]) -> Array:
        """Return how far points move against each other by the motions (r,) of its bodies, (m, d)."""
        own = self.motions[0] @ motions[0]
        return np.asarray(own - self.motions[1] @ motions[1] if len(motions) > 1 else own)

    def look(self, result: Answer, motions: Sequence[Array], u: Array) -> Drift:
        """Return how far the contact has drifted at an answer, as far as a step knows.

        Parameters
        ----------
        result : Answer
        motions : sequence of ndarray
            Of the supports of all bodies.
        u : ndarray, shape (n,)
            Displacements, where `asks` says so.
        """
        contact, state, case, part = self.contact, result.state, result.case, self.part
        closed, sagitta = result.closed(self.i), self._sagitta(result, u)
        count = int(np.count_nonzero(closed))
        if not count and not (self.small and self.rigid):
            return Drift(sagitta=sagitta, by_force=self.by_force)
        force = state.normal_force[part]
        if self.stretched:  # glue may twist
            force = np.hypot(force, np.linalg.norm(state.tangential_force[part], axis=1))
        (approach, strain), slip = self._pressed(closed, force), None
        if self.small:
            by_supports, slip = self.split(self._apart([motions[b] for b in self.bodies]))
            if self.held and count:
                worn = (case.gap0[part] + state.wear[part])[closed]
                lifted = worn - result.gap[part][closed] + by_supports[closed]
                elastic = size_of(lifted)
                approach, strain = max(approach, elastic), max(strain, elastic / self.extent)
            if contact.friction is not None or contact.tied:
                given = self.geometry.kin.slip_along(case.slip0[part], part) if self.rigid else None
                # a belt is pressed in by its stretch along the drum
                slip, spread = self.slip(state.slip[part], given, slip, closed)
                approach = max(approach, spread)
            elif self.loose is not None:
                slip = self.tangential(self._apart([body.motion(u) for body in self.loose]))
        approach = beyond_round_off(approach, self.extent)
        found = {} if slip is None else self.numbers(result, closed, slip, approach, u)
        found |= {"sagitta": sagitta, "by_force": self.by_force}
        return Drift(count, approach=approach, strain=strain, **found)

    def numbers(
        self, result: Answer, closed: Mask, slip: Array, approach: float, u: Array
    ) -> dict[str, Any]:
        """The numbers of `Drift` that are those of small sliding, at obstacles and between bodies.

        Parameters
        ----------
        result : Answer
        closed : ndarray of bool, shape (m,)
        slip : ndarray, shape (m, d)
            Of the secondary relative to a deformable primary [length].
        approach : float
            [length]
        u : ndarray, shape (n,)
            Displacements, which a rigid body is moved by.
        """
        force, found = result.state.normal_force[self.part], dict[str, Any]()
        if self.rigid:
            motion, carried = self._motion(result.case, u)
            found = self._at_obstacle(result, closed, slip + carried, approach, motion)
            if self.stretched and self.tool:
                off = motion.shift(self.points) - carried
                error = float(np.max(np.linalg.norm(off[closed], axis=1), initial=0.0))
                found |= {"gap_error": error, "gap_share": error / approach if approach > 0 else 0.0}
                found["stretch_share"] = self._stretching(result, off, carried - motion.translation)
            if not self.tool:  # else it is part of the slip
                slip = slip - self.tangential(_slid(motion, self.points))
                if self.contact.friction is not None:
                    found["off_arc"] = self._off_arc(motion, np.where(closed, force, 0.0))
        return found | self.drift(closed, slip, force, approach)

    def obstacle(self, case: LoadCase, u: Array) -> Obstacle:
        """The obstacle at its place; a rigid body's by displacements u (n,)."""
        assert isinstance(self.primary, Obstacle)
        return shape_of(self.primary).moved(self._motion(case, u)[0].as_argument())

    def _motion(self, case: LoadCase, u: Array) -> tuple[Motion, Array]:
        """Motion of the obstacle, and the linear displacement (m, d) its DOFs give points on it."""
        body = self.contact.rigid_body
        if body is None:
            return case.motion[self.i], np.zeros((1, 1))
        motion = Motion(*as_motion(self.system, body, u))
        arm = np.where(self.paired[:, None], self.feet, self.points) - body.about
        if arm.shape[1] == 3:
            return motion, motion.translation + np.cross(motion.angle, arm)
        turned = motion.angle * np.column_stack([-arm[:, 1], arm[:, 0]])
        return motion, motion.translation + turned

    def _at_obstacle(
        self, result: Answer, closed: Mask, slip: Array, approach: float, motion: Motion
    ) -> dict[str, Any]:
        """Normals and gaps against those of the obstacle, where it and the points are now."""
        from skfem_contact.obstacles.shapes import RigidPlane

        assert isinstance(self.primary, Obstacle)
        obstacle = shape_of(self.primary)
        moved = np.linalg.norm(motion.shift(self.points), axis=1)
        found = {"motion": float(np.max(moved[closed], initial=0.0))}
        if not self.follows or (isinstance(obstacle, RigidPlane) and not motion.turns):
            return found
        # without a partner there is none
        both = result.gap, result.worn_case.gap0
        gap, begun = (np.where(self.paired, known[self.part], 0.0) for known in both)
        u = self.normal * (gap - begun)[:, None] + slip
        u[~self.paired] = 0.0
        at = replace(self.secondary, points=self.points + u)
        distance, normal, facing = distances(obstacle.moved(motion.as_argument()), at)
        true = distance + self.gap_added(result)
        compared = closed & self.by_node
        angle = angle_between(self.normal, normal)
        found["tilt"] = float(np.max(angle[compared], initial=0.0))
        # where nothing presses no force is lost by a gap
        error = (true - gap)[compared]
        error = np.abs(error) if approach > 0 else -error
        sunk, noise = ~closed & facing & self.paired, COMPUTED * float(np.max(np.abs(at.points)))
        worst = float(max(np.max(error, initial=0.0), np.max(-true[sunk], initial=0.0)))
        worst = worst if worst > noise else 0.0
        # where nothing touches any more all of the force is lost
        share = worst / max(approach, worst) if worst else 0.0
        return found | {"gap_error": worst, "gap_share": share}

    def _stretching(self, result: Answer, off: Array, turned: Array) -> float:
        """`Drift.stretch_share`, by what a turn that is linear is off, and moves points by, (m, d).

        The one is a square of the turn: as this grows its forces do work at twice its own rate.
        """
        state, part = result.state, self.part
        force = state.normal_force[part, None] * self.normal - state.tangential_force[part]
        whole = float(np.abs(dot(force, turned)).sum())
        return 2.0 * abs(float(dot(force, off).sum())) / whole if whole > 0 else 0.0

    def _off_arc(self, motion: Motion, force: Array) -> float:
        """`Drift.off_arc`, under normal forces (m,).

        Where it is carried along as well, the centre has been half way in the mean.
        """
        if not motion.turns:
            return 0.0
        arc = _slid(motion, self.points + 0.5 * motion.translation)
        off = self.tangential(arc - motion.shift(self.points))
        whole = float(force @ np.linalg.norm(self.tangential(arc), axis=1))
        return float(force @ np.linalg.norm(off, axis=1)) / whole if whole > 0 else 0.0

    def _pressed(self, closed: NDArray[np.bool_], force: Array) -> tuple[float, float]:
        """Approach [length] and strain under normal forces (m,), by the diagonal of K."""
        pressing, width = np.abs(force[closed]), self.breadth(closed)
        pressed = float(pressing.sum() * self.soft)
        if self.spared is not None:
            pressed = max(pressed - float(pressing @ self.spared[closed]), 0.0)
        if self.dim == 3:  # a force over a length, where in 2-D it is over the thickness
            pressed = pressed / width if width else 0.0
        return pressed, pressed / width if width else 0.0

    def _sagitta(self, result: Answer, u: Array) -> float:
        if not self.curved:
            return 0.0
        force = result.state.normal_force[self.part]
        force = np.where(result.state.status[self.part] != OPEN, force, 0.0)
        if self.of_pieces:
            outline = self.obstacle(result.case, u).outline
            assert outline is not None
            return self.sagitta(force, (self._placed(u, self.secondary), outline.points, outline))
        if self.small or not isinstance(self.primary, ContactSurface):
            return self.sagitta(force)
        u = result.at_surfaces()
        one, other = (self._placed(u, side) for side in (self.secondary, self.primary))
        return self.sagitta(force, (one, other, self.primary))

    def _placed(self, u: Array, side: ContactSurface) -> Array:
        return np.asarray(side.points + u[self.system.slice(side.body)][side.dofs])

    @property
    def sides(self) -> list[ContactSurface]:
        """Its sides that are bodies."""
        return [side for side in (self.secondary, self.primary) if isinstance(side, ContactSurface)]

    @cached_property
    def chords(self) -> list[float]:
        """How far what is drawn of both sides, which are bodies, stands off them [length]."""
        return [drawn_off(side) for side in self.sides]

    @cached_property
    def edges(self) -> list[Edges]:
        """Edges of both sides, which are solids."""
        return [sharp_edges_of(side) for side in self.sides]

    def gap_added(self, result: Answer) -> Array:
        """What the user has the gaps be larger than the meshes say, (m,) [length]."""
        return np.asarray(self.added - result.worn_case.interference[self.part])

    def seems_coarse(self, result: Answer, drift: Drift) -> bool:
        """Whether facets seem too long; by displacements where forces alone say how far sides give way.

        They tell too little of it where points slide far, a force moves a tool, or no support holds a
        body against one.
        """
        told = not self.small or self.tool or self.by_force
        if not (told and drift.facets_too_long):
            return drift.facets_too_long
        u = result.u if self.small else result.at_surfaces()
        return with_elastic_approach(result, self.i, drift, u).facets_too_long


def _slid(motion: Motion, points: Array) -> Array:
    """How far an obstacle's surface has come along under points, the whole turn counted, (m, d)."""
    return motion.slid(Motion.none(len(motion.centre)), points)


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


def signed_distance(obstacle: Obstacle, surface: ContactSurface, points: Array) -> Array:
    """Signed distances of any points, whether they face the obstacle or not."""
    # these points are none of the nodes that the facets of the surface are made of
    outline = obstacle.outline
    if outline is not None:
        return signed_distances(outline, points)
    at = replace(surface, points=points, normals=np.zeros_like(points))
    return distances(obstacle, at)[0]


def distances(obstacle: Obstacle, surface: ContactSurface) -> tuple[Array, Array, Mask]:
    """Distances, normals and partners of `Obstacle.distance`, of a level set to first order."""
    from skfem_contact.obstacles.shapes import LevelSet

    if not isinstance(obstacle, LevelSet):
        return obstacle.distance(surface)
    return obstacle.first_order(surface)


def of_triangles(contact: Contact) -> bool:
    """Return whether it is a solid on an obstacle of triangles, whose normals may lean."""
    outline = contact.primary.outline if isinstance(contact.primary, Obstacle) else None
    rigid = outline is not None and outline.dim == 3
    return rigid and not contact.bilateral and contact.gap is None
