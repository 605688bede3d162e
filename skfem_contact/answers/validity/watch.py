"""Looks at every load step for what the model does not follow, and says so once in a history."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from skfem_contact.answers.answer import Answer
from skfem_contact.answers.thresholds import LARGE, SECOND_ORDER
from skfem_contact.answers.validity.contact_watch import ContactWatch
from skfem_contact.answers.validity.drift import Drift
from skfem_contact.answers.validity.intrusion import Intrusions
from skfem_contact.answers.validity.lookout import Lookouts
from skfem_contact.answers.validity.rotation import leaning_words, rigid_rotations, rotation_words
from skfem_contact.answers.validity.solids import of_triangles, past_words, slides_off, triangle_words
from skfem_contact.answers.validity.support import Support
from skfem_contact.answers.validity.watched import Said, Watched
from skfem_contact.answers.validity.words import facet_words, sliding_words, strain_words
from skfem_contact.conditions.geometry import Geometry
from skfem_contact.conditions.interface import Interface
from skfem_contact.conditions.loads import LoadCase
from skfem_contact.conditions.state import State
from skfem_contact.errors import warn

Array = NDArray[np.float64]
Index = NDArray[np.intp]

ONCE = " (Said once in a history, at the first step beyond the bound; result.validity has the numbers.)"


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
        self.of_triangles = {i for i, contact in enumerate(self.contacts) if of_triangles(contact)}
        self.slides_off = {i for i, contact in enumerate(self.contacts) if slides_off(contact)}
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
        count = len(self.contacts)
        self.watches = [
            ContactWatch(geometry, i, self.supports, diagonals, known) for i in range(count)
        ]
        self.tracks, self.soft = [w.track for w in self.watches], [w.soft for w in self.watches]
        # whether motions of bodies that slide freely show in the interior alone
        self.inside = any(watch.inside for watch in self.watches)
        # whether displacements at the contact DOFs are asked for
        self.asks = any(c.rigid_body and c.sliding == "small" for c in self.contacts)
        self.asks |= bool(self.of_triangles | self.slides_off)
        self.asks |= any(watch.on_obstacle or watch.loose is not None for watch in self.watches)
        self.asks |= self.lookouts is not None and self.lookouts.asks
        # the supports of bodies that turn as their prescribed DOFs say; rigid ones may turn
        solids = self.system.solids
        self.turning = [
            (name, b)
            for b, (name, support) in enumerate(zip(self.system.names, self.supports, strict=True))
            if len(support.dofs) and name in solids
        ]
        self._moved: tuple[Array, list[Array]] | None = None  # see `_followed`

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
        drifts = tuple([watch.drift(state, gap, case, u) for watch in self.watches])
        turns = {}
        for name, b in self.turning:
            turn = motions[b][2] if self.dim == 2 else np.linalg.norm(motions[b][3:])
            turns[name] = float(turn) / self.supports[b].arm
        turns |= rigid_rotations(self.system, self.contacts, state.surface)
        overlaps = self.intrusions.look(state, case, self.tracks, self.soft, mismatch)
        unseen = {}
        if self.of_triangles or self.slides_off:
            words = {
                i: triangle_words(self.geometry, i, state, gap, case, u) for i in self.of_triangles
            }
            for i in self.slides_off:
                words[i] = past_words(self.geometry, i, gap, case, u, drifts[i].approach)
            unseen = {i: text for i, text in words.items() if text}
        for i, watch in enumerate(self.watches):
            if not drifts[i].closed and i not in unseen:
                text = watch.untouched(gap)
                unseen |= {i: text} if text else {}
        found = Watched(drifts, turns, said, tuple(self.tracks), overlaps, unseen)
        if self.lookouts is None:
            return found
        return replace(found, standing=self.lookouts.look(state, case, u, self.tracks, drifts))

    def _followed(self, x: Array) -> list[Array]:
        """The motions of the supports under prescribed values x (n,); those of the last x are known."""
        if self._moved is None or self._moved[0] is not x:
            motions = [support.motion(x) for support in self.supports]
            for watch in self.watches:
                watch.follow(motions)
            self._moved = x, motions
        return self._moved[1]

    def warn(self, result: Answer) -> Watched:
        """Say what is beyond the bounds and has not been said in this history.

        Warns
        -----
        ContactWarning
            One for each contact and body, with the numbers and the setting to change.
        """
        watched = result.watched
        new: set[tuple[str, str]] = set()
        for i, drift in enumerate(watched.drifts):
            contact, name = self.contacts[i], self.interface.names[i]
            seen = self._seen(i, name, drift, result)
            found = self._beyond(i, name, drift, result, look=not seen & watched.said)
            new |= seen | {(kind, name) for kind, _ in found}
            if found:
                text = f"Contact {name!r} ({contact.label}): " + " ".join(words for _, words in found)
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

    def _seen(self, i: int, name: str, drift: Drift, result: Answer) -> Said:
        """Vertices of which too little is known are looked at once each doubling of the approach."""
        standing = result.watched.standing.get(i)
        if self.lookouts is None or standing is None or standing.what != "unknown":
            return frozenset()
        return frozenset({("seen", f"{name} {np.floor(np.log2(drift.approach)):.0f}")})

    def _beyond(
        self, i: int, name: str, drift: Drift, result: Answer, look: bool
    ) -> list[tuple[str, str]]:
        """What of one contact is beyond its bounds and has not been said: kind and words of each.

        `look`: whether vertices that seem to stand where no row sees it are looked at.
        """
        told = {kind for kind, of in result.watched.said if of == name}
        found = []
        if "overlap" not in told:
            found += [("overlap", words) for words in self._overlaps(i, drift, result, look)]
        if "sliding" not in told and not drift.small_sliding_holds:
            found.append(("sliding", sliding_words(drift)))
        if "facets" not in told:
            sure = self.watches[i].sure(result, drift)
            if sure.facets_too_long:
                found.append(("facets", facet_words(sure, self.contacts[i].rigid)))
        if drift.strain > LARGE and "strain" not in told:
            found.append(("strain", strain_words(drift)))
        return found

    def _overlaps(self, i: int, drift: Drift, result: Answer, look: bool) -> list[str]:
        """What contact conditions do not see of one contact, in words."""
        watched, words = result.watched, []
        if i in watched.intrusions:
            overlap = self.intrusions.sure(i, result, self.soft)
            if overlap and overlap.excessive:
                words.append(overlap.words(self.intrusions.reasons(i, result.state)))
        if i in watched.unseen:
            words.append(watched.unseen[i])
        asked = look and self.lookouts is not None and i in watched.standing and not words
        # facets that are too long, and slips that are not followed, are the reason already
        if asked and not drift.facets_too_long and drift.small_sliding_holds:
            assert self.lookouts is not None
            words += filter(None, [self.lookouts.sure(i, result, drift)])
        return words
