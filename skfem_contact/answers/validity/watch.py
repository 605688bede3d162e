"""Looks at every load step for what the model does not follow, and says so once in a history."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from skfem_contact.answers.answer import Answer
from skfem_contact.answers.thresholds import GAP, LARGE, SECOND_ORDER, TILT
from skfem_contact.answers.validity.drift import Drift, Track, tool_motion
from skfem_contact.answers.validity.face_track import FaceTrack
from skfem_contact.answers.validity.give import soft, spared
from skfem_contact.answers.validity.intrusion import Intrusions, elastic_approach
from skfem_contact.answers.validity.lookout import Lookouts
from skfem_contact.answers.validity.rotation import leaning_words, rigid_rotations, rotation_words
from skfem_contact.answers.validity.solids import (
    looked_at,
    obstacle_drift,
    of_triangles,
    past_words,
    slides_off,
    unseen_words,
)
from skfem_contact.answers.validity.support import Support, unit_motions
from skfem_contact.answers.validity.watched import Said, Watched
from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.conditions.geometry import Geometry
from skfem_contact.conditions.interface import Interface
from skfem_contact.conditions.loads import LoadCase
from skfem_contact.conditions.state import OPEN, State
from skfem_contact.errors import warn

Array = NDArray[np.float64]
Index = NDArray[np.intp]


class Watch:
    """What is looked at after every load step; made once for a solver.

    Parameters
    ----------
    geometry : Geometry
    interface : Interface
    diagonals : sequence of ndarray
        Of the stiffness of every body [force/length].
    known : callable
        Gives the DOFs whose displacements are known without the interior; called only where bodies that
        nothing holds along a frictionless contact may slide on it.
    """

    lookouts: Lookouts | None = None  # of solids

    def __init__(
        self,
        geometry: Geometry,
        interface: Interface,
        diagonals: Sequence[Array],
        known: Callable[[], Index],
    ) -> None:
        self.interface, self.contacts, self.geometry = interface, interface.contacts, geometry
        self.system, kin = geometry.system, geometry.kin
        self.dim = kin.points.shape[1]
        self.on_obstacles = {i for i, contact in enumerate(self.contacts) if looked_at(contact)}
        self.of_triangles = {i for i, contact in enumerate(self.contacts) if of_triangles(contact)}
        self.slides_off = {i for i, contact in enumerate(self.contacts) if slides_off(contact)}
        self.small = [i for i, contact in enumerate(self.contacts) if contact.sliding == "small"]
        # prescribed values, the motions of supports under them, and how these move the points of each
        # contact with small sliding along their normals and tangents
        self._moved: tuple[Array, list[Array]] | None = None
        self._lifted: dict[int, Array] = {}
        self._dragged: dict[int, Array] = {}
        self.moves = kin.tangents == self.dim - 1
        if not self.moves:  # a scalar field
            return
        self.intrusions = Intrusions(geometry, self.contacts)
        if self.dim == 3:
            self.lookouts = Lookouts(geometry, known)
        self.supports = [
            Support.of(body, int(start), arm=self.system.extent)
            for body, start in zip(self.system.bodies, self.system.offsets[:-1], strict=True)
        ]
        self.inside = False  # whether some of these motions show in the interior alone
        self.tracks, self.bodies, self.held, self.extent, self.soft = [], [], [], [], []
        # what of `soft` points do not feel, because supports take up their force on one side
        self.spared: list[Array | None] = []
        # how far motions of the bodies move points along their normals and tangents
        self.normal_rows: list[list[Array]] = []
        self.tangential_rows: list[list[Array]] = []
        # motions of bodies where neither friction nor supports say how they slide
        self.loose: list[list[Support] | None] = []
        for contact, pairing, part, own in zip(
            self.contacts,
            geometry.pairings,
            interface.point_slices,
            geometry.interference,
            strict=True,
        ):
            make = Track if self.dim == 2 else FaceTrack
            track = make(contact, pairing, kin.gap0[part], own)
            self.tracks.append(track)
            sides = [s for s in (contact.secondary, contact.primary) if isinstance(s, ContactSurface)]
            bodies = [self.system.index(side.body) for side in sides]
            # the diagonal of K at a surface is of the order of the modulus, whatever the mesh; in 3-D
            # of half of it times the size of a face
            stiff = [diagonals[b][side.dofs] for b, side in zip(bodies, sides, strict=True)]
            self.extent.append(sum(self.supports[b].arm for b in bodies))
            if contact.rigid_body is not None:  # it takes up nothing, but it moves
                bodies.append(self.system.index(contact.rigid_body))
            size = [1.0 if self.dim == 2 else 0.5 * float(np.median(side.lengths)) for side in sides]
            self.soft.append(sum(soft(h, d) for h, d in zip(size, stiff, strict=True)))
            self.spared.append(spared(pairing, sides, stiff, size))
            at = contact.secondary.points[pairing.paired], pairing.normal[pairing.paired]
            self.bodies.append(bodies)
            supports = [self.supports[b] for b in bodies]
            self.normal_rows.append([s.along(track.points, track.normal) for s in supports])
            self.tangential_rows.append([self._along(s, track) for s in supports])
            self.held.append(all(support.holds(*at) for support in supports))
            along = np.moveaxis(pairing.tangent[pairing.paired], 1, 0)
            slides = contact.sliding == "small" and contact.friction is None and not contact.tied
            loose = slides and not all(
                support.holds(at[0], way) for support in supports for way in along
            )
            self.loose.append([self._free(b, known()) for b in bodies] if loose else None)
        # whether displacements at the contact DOFs are asked for
        self.asks = any(c.rigid_body and c.sliding == "small" for c in self.contacts)
        self.asks |= bool(self.on_obstacles | self.of_triangles | self.slides_off)
        self.asks |= any(loose is not None for loose in self.loose)
        self.asks |= self.lookouts is not None and self.lookouts.asks
        # the supports of bodies that turn as their prescribed DOFs say; rigid ones may turn
        solids = self.system.solids
        self.turning = [
            (name, b)
            for b, (name, support) in enumerate(zip(self.system.names, self.supports, strict=True))
            if len(support.dofs) and name in solids
        ]

    def _along(self, support: Support, track: Track) -> Array:
        """How motions move points along their tangents, (m, 3); in 3-D all of it, (m, 3, 6)."""
        if self.dim == 2:
            return support.along(track.points, track.tangent)
        return unit_motions(track.points, support.centre, support.arm)

    def _free(self, b: int, known: Index) -> Support:
        """How a body moves as a whole, by what is known of its displacements."""
        start, end = self.system.offsets[b : b + 2]
        known = known[(known >= start) & (known < end)] - start
        body = self.system.bodies[b]
        found = Support.of(body, int(start), np.union1d(known, body.D), self.system.extent)
        if not found.free.shape[1]:
            return found
        # frictionless contact along an axis knows no displacements across it: those of all DOFs say it
        self.inside = True
        return Support.of(body, int(start), np.arange(body.n), self.system.extent)

    def look(
        self,
        state: State,
        gap: Array,
        case: LoadCase,
        said: Said,
        displacement: Callable[[], Array],
        everywhere: Callable[[], Array],
        mismatch: float = 0.0,
    ) -> Watched:
        """See an answer.

        Parameters
        ----------
        state, gap, case
            Of the answer.
        said : frozenset
            What has been warned of before in its history.
        displacement : callable
            Gives displacements (n,) that are right at the contact DOFs; called only where bodies
            that nothing holds along a frictionless contact may slide on it, and for rigid bodies.
        everywhere : callable
            Gives displacements (n,) that are right at all DOFs; called where such bodies slide along an
            axis, so that their contact DOFs do not tell.
        mismatch : float
            Of the pairing, see `intrusion`.
        """
        if not self.moves:
            return Watched(said=said)
        u = (everywhere if self.inside else displacement)() if self.asks else np.zeros(0)
        motions = self._followed(case.x)
        drifts = tuple([self._drift(i, state, gap, case, u) for i in range(len(self.contacts))])
        turns = {}
        for name, b in self.turning:
            turn = motions[b][2] if self.dim == 2 else np.linalg.norm(motions[b][3:])
            turns[name] = float(turn) / self.supports[b].arm
        turns |= rigid_rotations(self.system, self.contacts, state.surface)
        overlaps = self.intrusions.look(state, case, self.tracks, self.soft, mismatch)
        unseen = {}
        if self.of_triangles or self.slides_off:
            words = {i: unseen_words(self.geometry, i, gap, case, u) for i in self.of_triangles}
            for i in self.slides_off:
                words[i] = past_words(self.geometry, i, gap, case, u, drifts[i].approach)
            unseen = {i: text for i, text in words.items() if text}
        found = Watched(drifts, turns, said, tuple(self.tracks), overlaps, unseen)
        if self.lookouts is None:
            return found
        return replace(found, standing=self.lookouts.look(state, case, u, self.tracks, drifts))

    def _followed(self, x: Array) -> list[Array]:
        """The motions of the supports under prescribed values x (n,); those of the last x are known."""
        if self._moved is None or self._moved[0] is not x:
            motions = [support.motion(x) for support in self.supports]
            for i in self.small:
                moved = [motions[b] for b in self.bodies[i]]
                self._lifted[i] = relative(self.normal_rows[i], moved)
                dragged = relative(self.tangential_rows[i], moved)
                self._dragged[i] = self.tracks[i].tangential(dragged)
            self._moved = x, motions
        return self._moved[1]

    def _drift(
        self,
        i: int,
        state: State,
        gap: Array,
        case: LoadCase,
        u: Array,
    ) -> Drift:
        contact, part, track = self.contacts[i], self.interface.point_slices[i], self.tracks[i]
        small = contact.sliding == "small"
        closed = state.status[part] != OPEN
        if small:  # the pairing at the start is no other's
            closed &= track.paired
        count = int(np.count_nonzero(closed))
        sagitta = self._sagitta(i, state)
        if not count and not (small and contact.rigid):
            return Drift(sagitta=sagitta)
        width = track.breadth(closed)
        pressing = np.abs(state.normal_force[part][closed])
        pressed = float(pressing.sum() * self.soft[i])
        too_much = self.spared[i]
        if too_much is not None:
            pressed = max(pressed - float(pressing @ too_much[closed]), 0.0)
        if self.dim == 3:  # a force over a length, where in 2-D it is one over the thickness
            pressed = pressed / width if width else 0.0
        strain = pressed / width if width else 0.0
        if not small:
            return Drift(count, approach=pressed, strain=strain, sagitta=sagitta)
        approach = pressed
        if self.held[i] and count:
            lifted = case.gap0[part][closed] - gap[part][closed]
            lifted += self._lifted[i][closed]
            elastic = float(np.abs(lifted).max())
            approach, strain = max(approach, elastic), max(strain, elastic / self.extent[i])
        if contact.friction is not None or contact.tied:
            given = self.geometry.kin.slip_along(case.slip0[part], part)
            slip = track.slip(state.slip[part], given)
            # a belt is pressed in by its stretch along the drum
            stretch = slip - self._dragged[i]
            approach = max(approach, track.spread(stretch[closed]) if count else 0.0)
        else:
            loose, slip = self.loose[i], self._dragged[i]
            if loose is not None:
                moved = [body.motion(u) for body in loose]
                slip = track.tangential(relative(self.tangential_rows[i], moved))
        force = state.normal_force[part]
        tool = tool_motion(self.system, contact, track, u)
        found = track.drift(closed, slip, gap[part], force, approach, case, i, part, tool)
        if i in self.on_obstacles:
            found |= obstacle_drift(self.geometry, i, state, gap, case, u, approach)
        return Drift(count, approach=approach, strain=strain, sagitta=sagitta, **found)

    def _sagitta(self, i: int, state: State) -> float:
        contact, part, track = self.contacts[i], self.interface.point_slices[i], self.tracks[i]
        if not track.curved or not isinstance(contact.primary, ContactSurface):
            return 0.0
        force, moved = np.where(state.status[part] != OPEN, state.normal_force[part], 0.0), None
        if contact.sliding == "finite":
            u = self.geometry.spread(state.surface)
            one, other = (
                s.points + u[self.system.slice(s.body)][s.dofs]
                for s in (track.secondary, contact.primary)
            )
            moved = one, other
        return track.sagitta(force, moved)

    def _sure(self, i: int, result: Answer, drift: Drift) -> Drift:
        """Where points slide far and facets seem too long: with the approach since the beginning."""
        if self.contacts[i].sliding == "small" or not drift.facets_too_long:
            return drift
        part = self.interface.point_slices[i]
        closed = (result.state.status[part] != OPEN) & result.kin.paired[part]
        u = self.geometry.spread(result.state.surface)
        u[self.system.D] = result.case.x[self.system.D]
        return replace(drift, approach=max(drift.approach, elastic_approach(result, i, closed, u)))

    def warn(self, result: Answer) -> Watched:
        """Say what is beyond the bounds and has not been said in this history.

        Warns
        -----
        ContactWarning
            One for each contact and body, with the numbers and the setting to change.
        """
        watched, new = result.watched, set()
        for i, (contact, name, drift) in enumerate(
            zip(self.contacts, self.interface.names, watched.drifts, strict=False)
        ):
            lines = []
            if i in watched.intrusions and ("overlap", name) not in watched.said:
                overlap = self.intrusions.sure(i, result, self.soft)
                if overlap and overlap.excessive:
                    new.add(("overlap", name))
                    lines.append(overlap.words(self.intrusions.reasons(i, result.state)))
            if i in watched.unseen and ("overlap", name) not in watched.said:
                new.add(("overlap", name))
                lines.append(watched.unseen[i])
            # facets that are too long, and slips that are not followed, are the reason already
            follows = drift.small_sliding_holds
            reason = drift.facets_too_long or not follows
            asked = self.lookouts is not None and i in watched.standing
            if asked and watched.standing[i].what == "unknown":
                doubling = ("seen", f"{name} {np.floor(np.log2(drift.approach)):.0f}")
                asked = doubling not in watched.said
                new.add(doubling)
            if asked and not reason and ("overlap", name) not in watched.said | new:
                assert self.lookouts is not None
                text = self.lookouts.sure(i, result, drift)
                if text:
                    new.add(("overlap", name))
                    lines.append(text)
            if not follows and ("sliding", name) not in watched.said:
                new.add(("sliding", name))
                lines.append(sliding_words(drift))
            if ("facets", name) not in watched.said:
                sure = self._sure(i, result, drift)
                if sure.facets_too_long:
                    new.add(("facets", name))
                    lines.append(facet_words(sure))
            if drift.strain > LARGE and ("strain", name) not in watched.said:
                new.add(("strain", name))
                lines.append(strain_words(drift))
            if lines:
                text = f"Contact {name!r} ({contact.label}): " + " ".join(lines)
                warn(text + ONCE)
        far = {
            name: turn
            for name, turn in watched.turns.items()
            if abs(turn) > LARGE and ("rotation", name) not in watched.said
        }
        if far:
            new |= {("rotation", name) for name in far}
            warn(rotation_words(far) + ONCE)
        leaning = {
            name: share
            for name, share in watched.leaning.items()
            if share > SECOND_ORDER and ("second order", name) not in watched.said
        }
        if leaning:
            new |= {("second order", name) for name in leaning}
            warn(leaning_words(leaning) + ONCE)
        return replace(watched, said=watched.said | new) if new else watched


def relative(rows: list[Array], motions: list[Array]) -> Array:
    """How far points move against each other, from the rows (m, r) or (m, d, r) and motions (r,)."""
    own = rows[0] @ motions[0]
    return np.asarray(own - rows[1] @ motions[1] if len(rows) > 1 else own)


ONCE = " (Said once in a history, at the first step beyond the bound; result.validity has the numbers.)"


def sliding_words(drift: Drift) -> str:
    """What small sliding does wrong, and what to do."""
    found = []
    if drift.slides_far:
        found.append(
            f"points have slid by up to {drift.slip:.3g}, {drift.facets:.3g} facets of the primary "
            f"and {drift.widths:.3g} times the width of the contact, and press where they began"
        )
    if drift.slides_far and drift.beyond:
        found.append(
            f"{drift.beyond} of {drift.closed} closed points lie beyond the end of the primary "
            f"surface, by up to {drift.overhang:.3g}"
        )
    if drift.passes_end:
        found.append(
            f"{100 * drift.beyond_share:.3g} % of the normal force acts beyond the end of the primary "
            f"surface (slip {drift.slip:.3g}, {drift.facets:.3g} facets)"
        )
    if drift.tilt > TILT:
        found.append(f"normals are off by up to {drift.tilt:.3g} rad, and so are the forces")
    if drift.gap_share > GAP:
        found.append(
            f"gaps are wrong by up to {drift.gap_error:.3g}, {100 * drift.gap_share:.3g} % of the "
            f"elastic approach of {drift.approach:.3g}, and forces by as much"
        )
    if drift.motion and not drift.slides_far:
        found.append(f"the obstacle has moved by {drift.motion:.3g}")
    return (
        "small sliding, which keeps partners, normals and gaps of the undeformed bodies, does not "
        "follow: " + "; ".join(found) + ". Give the contact sliding='finite'."
    )


def facet_words(drift: Drift) -> str:
    """What long facets on curves do to a light contact, and what to do."""
    # a body rests on one facet or on the next where it is pressed in by less than what they stand out
    several = "There may be several answers, one for each facet that can carry. "
    return (
        f"over the length of one facet the curves stand {drift.sagitta:.3g} off each other, "
        f"{100 * drift.sagitta_share:.3g} % of the elastic approach of {drift.approach:.3g}: contact "
        "ends within the facets, and polygons meet elsewhere than curves do. Pressures there are not "
        "resolved, and forces that follow from prescribed displacements may be wrong by a large "
        f"factor. {several if drift.sagitta_share > 1 else ''}Refine both surfaces where they touch."
    )


def strain_words(drift: Drift) -> str:
    """What linear elasticity does wrong, and what to do."""
    return (
        f"the bodies take up {drift.approach:.3g} elastically, a strain or rotation of about "
        f"{drift.strain:.2g}. Bodies are linear: errors are of that order, {100 * drift.strain:.0f} %. "
        "Check units, load and modulus; large strains need a body that is linearised in each step "
        "(solver.update)."
    )
