"""One contact as `watch` sees it: what is known of it beforehand, and its drift at every answer."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from skfem_contact.answers.answer import Answer
from skfem_contact.answers.validity.overlaps import (
    depth_in_solid,
    in_solid_words,
    leaning_words,
    of_triangles,
    outline_of,
    pierced,
    pierced_words,
)
from skfem_contact.answers.validity.support import (
    Support,
    beyond_round_off,
    elastic_approach,
    pressed_in,
)
from skfem_contact.answers.validity.track import Track, off_arc, tool_motion
from skfem_contact.answers.validity.validity import Drift
from skfem_contact.arrays import Array, Index, largest
from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.conditions.geometry import Geometry
from skfem_contact.conditions.state import OPEN, LoadCase, State
from skfem_contact.obstacles.obstacle import Obstacle


class ContactWatch:
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
    track : Track
    soft : float
        What a force on a point presses it in [length/force].
    spared : ndarray, shape (m,), or None
        What of `soft` points do not feel, because supports take up their force on one side.
    motions : list of ndarray, shape (m, d, r)
        How far motions of each body move points.
    held : bool
        Whether supports hold both sides along the normals.
    loose : list of Support, or None
        Motions of bodies where neither friction nor supports say how they slide.
    inside : bool
        Whether some of these show in the interior alone.
    asks : bool
        Whether displacements at the contact DOFs are asked for.
    on_obstacle : bool
        Whether the primary is an obstacle, which conditions may not see all of.
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
        self.dim = geometry.kin.points.shape[1]
        own = geometry.interference[i]
        self.track = Track(contact, pairing, geometry.kin.gap0[self.part], own)
        sides = [s for s in (contact.secondary, contact.primary) if isinstance(s, ContactSurface)]
        bodies = [self.system.index(side.body) for side in sides]
        # the diagonal of K at a surface is of the order of the modulus, whatever the mesh; in 3-D
        # of half of it times the size of a face. Its mean over the axes is the same in all axes
        stiff = [diagonals[b][side.dofs].mean(axis=1) for b, side in zip(bodies, sides, strict=True)]
        self.extent = sum(supports[b].arm for b in bodies)
        size = [1.0 if self.dim == 2 else 0.5 * float(np.median(side.lengths)) for side in sides]
        self.soft, self.spared = pressed_in(pairing, sides, stiff, size)
        tool = contact.rigid_body
        if tool is not None:  # it takes up nothing, but it moves
            bodies.append(self.system.index(tool))
        self.bodies = bodies
        held_by = [supports[b] for b in bodies]
        self.motions = [s.unit_at(self.track.points) for s in held_by]
        points, normal = contact.secondary.points[pairing.paired], pairing.normal[pairing.paired]
        self.borne, self.held = (
            all(s.holds(points, normal) for s in some) for some in (held_by[:1], held_by)
        )
        self.inside, self.loose = False, None
        if contact.sliding == "small" and contact.friction is None and not contact.tied:
            along = np.moveaxis(pairing.tangent[pairing.paired], 1, 0)
            if not all(s.holds(points, way) for s in held_by for way in along):
                self.loose = [self._free(b, known()) for b in bodies]
        self.of_triangles = of_triangles(contact)
        self.asks = self.of_triangles or self.loose is not None
        self.on_obstacle = isinstance(contact.primary, Obstacle)
        self.rigid, self.tool = contact.rigid, tool is not None
        self.asks |= (self.tool and contact.sliding == "small") or self.track.of_pieces

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

    def followed(self, motions: Sequence[Array]) -> tuple[Array, Array] | None:
        """How far supports of all bodies lift and drag the points; None where contact slides far."""
        if self.contact.sliding != "small":
            return None
        return self.track.split(self._apart([motions[b] for b in self.bodies]))

    def _apart(self, motions: Sequence[Array]) -> Array:
        """Return how far points move against each other by the motions (r,) of the bodies, (m, d)."""
        own = self.motions[0] @ motions[0]
        return np.asarray(own - self.motions[1] @ motions[1] if len(motions) > 1 else own)

    def drift(
        self,
        state: State,
        gap: Array,
        case: LoadCase,
        u: Array,
        followed: tuple[Array, Array] | None,
    ) -> Drift:
        """Return how far the contact has drifted at an answer.

        Parameters
        ----------
        state, gap, case
            Of the answer.
        u : ndarray, shape (n,)
            Displacements, where `Watch.look` asks for them.
        followed : tuple or None
            From `followed`.
        """
        contact, part, track = self.contact, self.part, self.track
        small = contact.sliding == "small"
        closed = state.status[part] != OPEN
        if small:  # the pairing at the start is no other's
            closed &= track.paired
        count = int(np.count_nonzero(closed))
        sagitta = self._sagitta(state, case, u)
        if not count and not (small and self.rigid):
            return Drift(sagitta=sagitta)
        force = state.normal_force[part]
        if track.stretched:  # glue may twist
            force = np.hypot(force, np.linalg.norm(state.tangential_force[part], axis=1))
        approach, strain = self._pressed(closed, force)
        if followed is None:
            approach = beyond_round_off(approach, self.extent)
            return Drift(count, approach=approach, strain=strain, sagitta=sagitta)
        by_supports, dragged = followed
        if self.held and count:
            lifted = case.gap0[part][closed] - gap[part][closed]
            lifted += by_supports[closed]
            elastic = largest(np.abs(lifted))
            approach, strain = max(approach, elastic), max(strain, elastic / self.extent)
        if contact.friction is not None or contact.tied:
            given = self.geometry.kin.slip_along(case.slip0[part], part)
            # a belt is pressed in by its stretch along the drum
            slip, spread = track.slip(state.slip[part], given, dragged, closed)
            approach = max(approach, spread)
        else:
            slip = dragged
            if self.loose is not None:
                slip = track.tangential(self._apart([body.motion(u) for body in self.loose]))
        approach = beyond_round_off(approach, self.extent)
        force = state.normal_force[part]
        tool = tool_motion(self.system, contact, track, u) if self.tool else None
        found = track.drift(closed, slip, gap[part], force, approach, case, self.i, part, tool)
        if self.rigid and tool is None and contact.friction is not None:
            found["off_arc"] = off_arc(case.motion[self.i], track, np.where(closed, force, 0.0))
        return Drift(count, approach=approach, strain=strain, sagitta=sagitta, **found)

    def _pressed(self, closed: NDArray[np.bool_], force: Array) -> tuple[float, float]:
        """Approach [length] and strain under normal forces (m,), by the diagonal of K."""
        pressing, width = np.abs(force[closed]), self.track.breadth(closed)
        pressed = float(pressing.sum() * self.soft)
        if self.spared is not None:
            pressed = max(pressed - float(pressing @ self.spared[closed]), 0.0)
        if self.dim == 3:  # a force over a length, where in 2-D it is one over the thickness
            pressed = pressed / width if width else 0.0
        return pressed, pressed / width if width else 0.0

    def _sagitta(self, state: State, case: LoadCase, u: Array) -> float:
        contact, part, track = self.contact, self.part, self.track
        # how far bodies that no support holds against a tool are pressed in is known from forces alone,
        # which tell too little of it
        force = np.where(state.status[part] != OPEN, state.normal_force[part], 0.0)
        if not track.curved or (self.rigid and not self.borne) or not force.any():
            return 0.0
        if track.of_pieces:
            outline = outline_of(self.geometry, self.i, case, u)
            return track.sagitta(force, (self._placed(u, track.secondary), outline.points, outline))
        if contact.sliding == "small" or not isinstance(contact.primary, ContactSurface):
            return track.sagitta(force)
        u = self.geometry.spread(state.surface)
        one, other = (self._placed(u, s) for s in (track.secondary, contact.primary))
        return track.sagitta(force, (one, other, contact.primary))

    def _placed(self, u: Array, side: ContactSurface) -> Array:
        return np.asarray(side.points + u[self.system.slice(side.body)][side.dofs])

    def undetected(self, state: State, gap: Array, case: LoadCase, u: Array, drift: Drift) -> str:
        """Return what contact conditions do not see of an obstacle, in words; or nothing.

        Parameters are those of `drift`, and what it has found.
        """
        words = ""
        if self.of_triangles:
            words = leaning_words(self.geometry, self.i, state, case, u)
        return words or ("" if drift.closed else self._untouched(gap[self.part]))

    def _untouched(self, gap: Array) -> str:
        """What is wrong where nothing touches an obstacle, in words; by the gaps of the answer."""
        contact, track = self.contact, self.track
        if contact.bilateral:
            return ""
        # what finds partners that it did not have has come to another place
        if self._depth_in_solid and (track.paired.any() or not np.isfinite(gap).any()):
            return in_solid_words(contact, self._depth_in_solid)
        if track.bend is None:
            return ""
        found = pierced(track.secondary, track.bend, gap)
        return pierced_words(track.secondary, *found, contact.primary.label) if found else ""

    @cached_property
    def _depth_in_solid(self) -> float:
        return depth_in_solid(self.contact, self.geometry.pairings[self.i])

    def seems_coarse(self, result: Answer, drift: Drift) -> bool:
        """Whether facets seem too long; by displacements where points slide far or a force moves it."""
        small = self.contact.sliding == "small"
        if (small and not self.tool) or not drift.facets_too_long:
            return drift.facets_too_long
        closed = (result.state.status[self.part] != OPEN) & result.kin.paired[self.part]
        u = np.array(result.u) if small else self.geometry.spread(result.state.surface)
        u[self.system.D] = result.case.x[self.system.D]
        elastic = beyond_round_off(elastic_approach(result, self.i, closed, u), self.extent)
        return replace(drift, approach=max(drift.approach, elastic)).facets_too_long
