"""Looks at every load step for what the model does not follow, and says so once in a history."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skfem_contact.answers.answer import Answer
from skfem_contact.answers.thresholds import LARGE, PRESSED, SUSPECTED
from skfem_contact.answers.validity.assess import Assessment
from skfem_contact.answers.validity.contact_watch import ContactWatch
from skfem_contact.answers.validity.obstacles import (
    of_triangles,
    past_words,
    slides_off,
    triangle_words,
)
from skfem_contact.answers.validity.plane_overlaps import Intrusions
from skfem_contact.answers.validity.solid_overlaps import Lookouts
from skfem_contact.answers.validity.strain import leaning, lockable, rigid_rotations
from skfem_contact.answers.validity.support import Support
from skfem_contact.answers.validity.validity import Said, Watched
from skfem_contact.bodies.surface import ContactSurface
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
        self.tracks = [w.track for w in self.watches]
        # whether motions of bodies that slide freely show in the interior alone
        self.inside = any(watch.inside for watch in self.watches)
        # whether displacements at the contact DOFs are asked for
        self.asks = any(c.rigid_body and c.sliding == "small" for c in self.contacts)
        self.asks |= bool(self.of_triangles | self.slides_off)
        self.asks |= any(watch.loose is not None for watch in self.watches)
        self.asks |= self.lookouts is not None and self.lookouts.asks
        self.solids = [n for n, body in self.system.solids.items() if body.components > 1]
        # where supports do not hold a body against contact, only its surfaces tell how it is strained
        loose = {b for watch in self.watches if not watch.held for b in watch.bodies}
        self.floating = {
            self.system.names[b]: Support.of(
                self.system.bodies[b], int(self.system.offsets[b]), self._known(b)
            )
            for b in sorted(loose)
            if self.system.names[b] in self.solids and self.supports[b].free.shape[1]
        }
        self.asks |= bool(self.floating)
        # the supports of bodies that turn as their prescribed DOFs say; rigid ones may turn
        solids = self.system.solids
        self.turning = [
            (name, b)
            for b, (name, support) in enumerate(zip(self.system.names, self.supports, strict=True))
            if len(support.dofs) and name in solids
        ]
        self._moved: tuple[Array, list[Array], list[Any]] | None = None  # see `_followed`

    def look(
        self,
        state: State,
        gap: Array,
        case: LoadCase,
        said: Said,
        displacement: Callable[[], Array],
        everywhere: Callable[[], Array],
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
        """
        if not self.moves:
            return Watched(said=said)
        u = (everywhere if self.inside else displacement)() if self.asks else np.zeros(0)
        motions, followed = self._followed(case.x)
        drifts = tuple(
            [
                watch.drift(state, gap, case, u, moved)
                for watch, moved in zip(self.watches, followed, strict=True)
            ]
        )
        turns, stretches = {}, {}
        for name, b in self.turning:
            turn = motions[b][2] if self.dim == 2 else np.linalg.norm(motions[b][3:])
            turns[name] = float(turn) / self.supports[b].arm
            stretches[name] = self._stretch(self.supports[b], case.x)
        stretches |= {name: self._stretch(known, u) for name, known in self.floating.items()}
        turns |= rigid_rotations(self.system, self.contacts, state.surface)
        overlaps = self.intrusions.look(state, case, self.tracks, drifts)
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
        found = Watched(drifts, turns, said, tuple(self.tracks), overlaps, unseen, stretches=stretches)
        if self.lookouts is None:
            return found
        return replace(found, standing=self.lookouts.look(state, case, u, self.tracks, drifts))

    def _known(self, b: int) -> Index:
        """DOFs of a body at its supports and contacts."""
        body = self.system.bodies[b]
        sides = [side for c in self.contacts for side in (c.secondary, c.primary)]
        own = [s.dofs.ravel() for s in sides if isinstance(s, ContactSurface) and s.body is body]
        return np.unique(np.concatenate([body.D, *own])).astype(np.intp)

    def _stretch(self, known: Support, u: Array) -> float:
        """How far known displacements are off a rigid motion, over the extent of their body."""
        if not len(known.dofs):
            return 0.0
        rigid = known.unit @ known.motion(u)
        return float(np.max(np.abs(u[known.dofs] - rigid))) / known.arm

    def _followed(self, x: Array) -> tuple[list[Array], list[Any]]:
        """The motions of the supports under prescribed values x (n,), and what every watch follows.

        Those of the last x are known.
        """
        known = self._moved
        if known is None or known[0] is not x:
            motions = [support.motion(x) for support in self.supports]
            followed = [watch.followed(motions) for watch in self.watches]
            known = self._moved = x, motions, followed
        return known[1:]

    def warn(self, result: Answer) -> Watched:
        """Say what is beyond the bounds and has not been said in this history.

        What a step suspects is measured by `assess`, which has the last word.

        Warns
        -----
        ContactWarning
            One for each contact and body, with the numbers and the setting to change.
        """
        watched = result.watched
        suspected, bodies = self._suspected(result), self._strained(result)
        measured = None
        if suspected or bodies:
            measured = Assessment(result, self.lookouts, self.intrusions)
        new: set[tuple[str, str]] = set()
        for i, (kinds, seen) in suspected.items():
            assert measured is not None
            contact, name = self.contacts[i], self.interface.names[i]
            found = measured.of_contact(i, kinds)
            new |= seen | {(kind, name) for kind in found}
            if found:
                text = f"Contact {name!r} ({contact.label}): " + " ".join(found.values())
                warn(text + ONCE)
        problems = leaning(watched.leaning)
        for name, seen in bodies.items():
            assert measured is not None
            new |= seen
            problems |= {(kind, name): words for kind, words in measured.of_body(name).items()}
        problems = {key: words for key, words in problems.items() if key not in watched.said}
        for words in problems.values():
            warn(words + ONCE)
        new |= set(problems)
        return replace(watched, said=watched.said | new) if new else watched

    def _suspected(self, result: Answer) -> dict[int, tuple[set[str], Said]]:
        """What seems to be wrong with contacts and has not been said, by kind; what is to be kept.

        Vertices of which too little is known are looked at once each doubling of the approach.
        """
        watched = result.watched
        found: dict[int, tuple[set[str], Said]] = {}
        for i, drift in enumerate(watched.drifts):
            name, standing, seen = self.interface.names[i], watched.standing.get(i), Said()
            if standing is not None and standing.what == "unknown":
                seen = _seen("vertices", name, drift.approach)
            stands = standing is not None and not seen & watched.said
            overlaps = i in watched.intrusions or i in watched.unseen or stands
            beyond = {
                "sliding": not drift.small_sliding_holds,
                "facets": self.watches[i].seems_coarse(result, drift),
                "overlap": overlaps and not watched.prescribed(name),
            }
            kinds = {
                kind for kind, there in beyond.items() if there and (kind, name) not in watched.said
            }
            if kinds:
                found[i] = kinds, seen
        return found

    def _strained(self, result: Answer) -> dict[str, Said]:
        """Bodies that seem to be strained, to turn or to lock, and have not been said to.

        With what is to be kept: whether a body locks does not depend on the size of its load, and is
        looked at once each doubling of its approach.
        """
        found: dict[str, Said] = {}
        if not self.moves:
            return found
        watched, may_lock = result.watched, lockable(result)
        size = dict.fromkeys(self.solids, (0.0, 0.0))
        for drift, watch in zip(watched.drifts, self.watches, strict=True):
            for name in {self.system.names[b] for b in watch.bodies} & set(size):
                strain, approach = size[name]
                size[name] = max(strain, drift.strain), max(approach, drift.approach)
        for name, (strain, approach) in size.items():
            turn, stretch = abs(watched.turns.get(name, 0.0)), watched.stretches.get(name, 0.0)
            strained = strain > PRESSED * LARGE or stretch > SUSPECTED * LARGE
            beyond = {
                "strain": strained,
                "rotation": strained or turn > SUSPECTED * LARGE,
                "locking": name in may_lock,
            }
            beyond = {
                kind: there and (kind, name) not in watched.said for kind, there in beyond.items()
            }
            seen = _seen("volumes", name, approach) if beyond["locking"] else Said()
            beyond["locking"] &= not seen & watched.said
            if any(beyond.values()):
                found[name] = seen
        return found


def _seen(what: str, name: str, approach: float) -> Said:
    """What is kept of a look that is taken once each doubling of an approach."""
    doublings = np.floor(np.log2(approach)) if approach > 0 else None
    return Said({(f"seen {what}", f"{name} {doublings}")})
