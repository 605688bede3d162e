"""Looks at every load step for what the model does not follow, and says so once in a history."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from skfem_contact.answers.answer import Answer
from skfem_contact.answers.thresholds import A_TENTH, PRESSED, SUSPECTED
from skfem_contact.answers.validity.assess import Assessment
from skfem_contact.answers.validity.contact_watch import ContactWatch
from skfem_contact.answers.validity.overlaps import Overlaps
from skfem_contact.answers.validity.strain import lockable, may_lock
from skfem_contact.answers.validity.support import Support, off_rigid
from skfem_contact.answers.validity.turned import leaning, rigid_rotations, surface_turns, turned
from skfem_contact.answers.validity.validity import Diagnostics, Issued
from skfem_contact.arrays import Array, Index
from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.conditions.geometry import Geometry
from skfem_contact.conditions.interface import Interface
from skfem_contact.digits import SOLVED
from skfem_contact.errors import warn

ONCE = " (Said once in a history, at the first step beyond the bound; result.validity has the numbers.)"


class Watch:
    """The look at the bounds of the model after every load step; made once for a solver.

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
        self.moves = kin.tangents == self.dim - 1
        if not self.moves:  # a scalar field
            return
        self.overlaps = Overlaps(geometry, known)
        bodies = zip(self.system.bodies, self.system.offsets[:-1], strict=True)
        self.supports = [Support.of(b, int(start), arm=self.system.extent) for b, start in bodies]
        self.watches = [
            ContactWatch(geometry, i, self.supports, diagonals, known)
            for i in range(len(self.contacts))
        ]
        self.tracks = [w.track for w in self.watches]
        # whether motions of bodies that slide freely show in the interior alone
        self.inside = any(watch.inside for watch in self.watches)
        # what follows large strains and turns has no bounds of them
        solids = self.system.solids
        self.solids = [
            n for n, body in solids.items() if body.components > 1 and not body.finite_strain
        ]
        # where supports do not hold a body against contact, only its surfaces tell how it is strained
        loose = {b for watch in self.watches if not watch.held for b in watch.bodies}
        self.floating = {
            self.system.names[b]: Support.of(
                self.system.bodies[b], int(self.system.offsets[b]), self._known(b)
            )
            for b in sorted(loose)
            if self.system.names[b] in self.solids and self.supports[b].free.shape[1]
        }
        # whether displacements at the contact DOFs are asked for
        self.asks = bool(self.floating) or any(watch.asks for watch in self.watches)
        # the supports of bodies that turn as their prescribed DOFs say; rigid ones may turn
        self.turning = {
            name: b
            for b, (name, support) in enumerate(zip(self.system.names, self.supports, strict=True))
            if len(support.dofs) and name in solids
        }
        self.may_lock = any(map(may_lock, self.system.bodies))  # whatever the answer is
        self._moved: tuple[Array, list[Any], dict[str, float], dict[str, float]] | None = None

    def look(self, result: Answer, issued: Issued, leaning: dict[str, float]) -> None:
        """See an answer, note in it what is seen, and say what is beyond the bounds.

        What has been said in its history is not said again. What a step suspects is measured by
        `assess`, which has the last word.

        Parameters
        ----------
        result : Answer
        issued : frozenset
            What has been warned of before in its history.
        leaning : dict
            See `Diagnostics`.

        Warns
        -----
        ContactWarning
            One for each contact and body, with the numbers and the setting to change.
        """
        if self.moves:
            result.diagnostics = self._seen(result, issued, leaning)
            result.diagnostics = self._warned(result)
        else:
            result.diagnostics = Diagnostics(issued=issued, leaning=leaning)

    def _seen(self, result: Answer, issued: Issued, leaning: dict[str, float]) -> Diagnostics:
        state, gap, case, u = result.state, result.gap, result.worn_case, np.zeros(0)
        if self.asks:  # where bodies slide along an axis their contact DOFs do not tell
            u = result.u if self.inside else result.recover.at_contact()
        followed, turns, stretches = self._followed(case.x)
        drifts = [
            watch.drift(state, gap, case, u, moved)
            for watch, moved in zip(self.watches, followed, strict=True)
        ]
        if self.floating:
            stretches = stretches | off_rigid(self.floating, u)
        if len(state.surface):  # of what slides far
            far = surface_turns(self.system, self.contacts, state.surface)
            turns = turns | rigid_rotations(far)
            leaning = leaning | turned(result, far, self.supports, [d.approach for d in drifts])
        undetected = {
            watch.i: watch.undetected(state, gap, case, u, drift)
            for watch, drift in zip(self.watches, drifts, strict=True)
            if watch.on_obstacle
        }
        return Diagnostics(
            tuple(drifts),
            turns,
            issued,
            tuple(self.tracks),
            self.overlaps.look_far(state, case, self.tracks, drifts)
            if self.overlaps.far
            else frozenset(),
            {i: text for i, text in undetected.items() if text},
            leaning=leaning,
            stretches=stretches,
        )

    def _known(self, b: int) -> Index:
        """DOFs of a body at its supports and contacts."""
        body = self.system.bodies[b]
        sides = [side for c in self.contacts for side in (c.secondary, c.primary)]
        own = [s.dofs.ravel() for s in sides if isinstance(s, ContactSurface) and s.body is body]
        return np.unique(np.concatenate([body.D, *own])).astype(np.intp)

    def _followed(self, x: Array) -> tuple[list[Any], dict[str, float], dict[str, float]]:
        """What every watch follows under prescribed values x (n,); turns and stretches of supports.

        Those of the last x are known.
        """
        known = self._moved
        if known is None or known[0] is not x:
            motions = [support.motion(x) for support in self.supports]
            followed = [watch.followed(motions) for watch in self.watches]
            turns = {
                name: float(m[2] if self.dim == 2 else np.linalg.norm(m[3:])) / self.supports[b].arm
                for name, b in self.turning.items()
                for m in [motions[b]]
            }
            stretches = off_rigid({name: self.supports[b] for name, b in self.turning.items()}, x)
            known = self._moved = x, followed, turns, stretches
        return known[1:]

    def _warned(self, result: Answer) -> Diagnostics:
        """Say what is beyond the bounds and has not been said in this history."""
        known = result.diagnostics
        suspected, looked = self._suspected(result)
        bodies, seen = self._strained(result)
        new = set(looked | seen)
        beyond = leaning(self.system, known.leaning, known.issued)
        if not (suspected or bodies or beyond or new):
            return known
        measured = Assessment(result)
        for i, kinds in suspected.items():
            contact, name = self.contacts[i], self.interface.names[i]
            found = measured.of_contact(i, kinds)
            new |= {(kind, name) for kind in found}
            if found:
                warn(f"Contact {name!r} ({contact.label}): " + " ".join(found.values()) + ONCE)
        problems: dict[tuple[str, str], str] = {}
        for name in bodies:
            problems |= {(kind, name): words for kind, words in measured.of_body(name).items()}
        problems = {
            key: beyond[key] for key in beyond if ("rotation", key[1]) not in problems
        } | problems
        for key, words in problems.items():
            if key not in known.issued:
                new.add(key)
                warn(words + ONCE)
        return replace(known, issued=known.issued | new, meetings=measured.meetings)

    def _suspected(self, result: Answer) -> tuple[dict[int, set[str]], Issued]:
        """What seems to be wrong with contacts and has not been said, by kind; looks that are kept.

        Where corners and edges may stand between points that press, overlaps are looked for at the
        first step, and once for each doubling of the approach; before anything presses, of the motion.
        """
        known, case = result.diagnostics, result.case
        found: dict[int, set[str]] = {}
        looked = Issued()
        for i, drift in enumerate(known.drifts):
            name, overlaps = self.interface.names[i], i in known.intrusions
            if self.watches[i].of_triangles or i in self.overlaps.near:
                # sizes of vectors: the same in whatever axes
                moved = max(float(np.linalg.norm(v)) for v in (case.x, case.motion[i].translation))
                seen = _look("overlap", name, drift.approach or moved, known.issued)
                looked |= seen
                if seen and i in self.overlaps.near:
                    u = result.recover.at_contact()
                    at = result.worn_case, self.tracks, known.drifts
                    overlaps |= self.overlaps.look_near(i, u, *at)
                else:
                    overlaps |= bool(seen)
            beyond = {
                "sliding": not drift.small_sliding_holds,
                "facets": self.watches[i].seems_coarse(result, drift),
                "overlap": (overlaps or i in known.undetected) and not known.prescribed(name),
            }
            kinds = {kind for kind in beyond if beyond[kind] and (kind, name) not in known.issued}
            if kinds:
                found[i] = kinds
        return found, looked

    def _strained(self, result: Answer) -> tuple[list[str], Issued]:
        """Bodies that seem to be strained, to turn or to lock, and have not been said to.

        With looks that are kept: whether a body locks does not depend on the size of its load, and is
        looked at once each doubling of its approach.
        """
        found, looked = list[str](), Issued()
        known, lock = result.diagnostics, lockable(result) if self.may_lock else []
        size = dict.fromkeys(self.solids, (0.0, 0.0))
        for drift, watch in zip(known.drifts, self.watches, strict=True):
            for name in {self.system.names[b] for b in watch.bodies} & set(size):
                strain, approach = size[name]
                size[name] = max(strain, drift.strain), max(approach, drift.approach)
        for name, (strain, approach) in size.items():
            turn, stretch = abs(known.turns.get(name, 0.0)), known.stretches.get(name, 0.0)
            strained = max(strain / PRESSED, stretch / SUSPECTED) > A_TENTH
            beyond = {
                "strain": strained,
                "rotation": strained or turn > SUSPECTED * A_TENTH,
                "locking": name in lock,
            }
            kinds = {kind for kind in beyond if beyond[kind] and (kind, name) not in known.issued}
            look = "locking" in kinds
            seen = _look("volumes", name, approach, known.issued) if look else Issued()
            looked |= seen
            if seen or kinds - {"locking"}:
                found.append(name)
        return found, looked


def _look(what: str, name: str, approach: float, issued: Issued) -> Issued:
    """What is kept of a look at an approach, twice or half of all that were looked at; else nothing."""
    kind = f"seen {what}"
    before = [of.rpartition(" ") for key, of in issued if key == kind]
    for size in (float(size) for of, _, size in before if of == name):
        if size == approach or max(size, approach) < 2.0 * (1 - SOLVED) * min(size, approach):
            return Issued()
    return Issued({(kind, f"{name} {approach:.17g}")})
