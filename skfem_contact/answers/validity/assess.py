"""The look at every load step, and the verdict on the model at an answer.

`Watch` sees every step, at nearly no cost, and suspects; `Assessment` has the measures, with the
displacements of whole bodies, each taken where it is first asked for. A step asks it for what it has
cause to suspect, and says so once in a history; `result.validity` asks for all: what a step warns of
and what `validity` says are the same findings.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import replace
from functools import cache
from itertools import product

import numpy as np

from skfem_contact.answers.answer import Answer
from skfem_contact.answers.validity.deformed_boundaries import boundary
from skfem_contact.answers.validity.overlaps import (
    Overlaps,
    at_obstacle,
    between,
    crossing,
    of_two_bodies,
    pressed_aside,
    sides_of,
    unselected_words,
)
from skfem_contact.answers.validity.strain import displaced_far, lockable, locked, strains
from skfem_contact.answers.validity.support import (
    Support,
    fitted,
    leaning,
    rigid_rotations,
    surface_turns,
    turned,
    with_elastic_approach,
)
from skfem_contact.answers.validity.track import ContactWatch
from skfem_contact.answers.validity.validity import (
    A_TENTH,
    ContactValidity,
    Diagnostics,
    Drift,
    Issued,
    Meeting,
    Validity,
    crossing_words,
    displacement_words,
    facet_words,
    locking_words,
    overlap_words,
    prescribed_words,
    rotation_words,
    sliding_words,
    strain_words,
)
from skfem_contact.arrays import Array, Index
from skfem_contact.bodies.body import Body, may_lock
from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.conditions.contact import Contact
from skfem_contact.conditions.geometry import Geometry
from skfem_contact.conditions.orthotropic import OrthotropicCoulomb
from skfem_contact.conditions.state import OPEN
from skfem_contact.digits import SOLVED
from skfem_contact.errors import warn

#: What may be wrong with a contact, in the order in which it is told.
OF_CONTACTS = ("sliding", "overlap", "facets")

#: Of a bound, from which on a step measures strains and rotations. Mean pressure over modulus and
#: approach over extent are .8 times the strain where the energy is, or more, and .9 of the turn of a
#: cantilever; what supports and surfaces are off a rigid motion is .3 of the turn of a beam that is
#: bent on three points.
PRESSED, SUSPECTED = 0.5, 0.25

#: What takes a look at whole bodies of its own.
LOOKED = frozenset({"displacement", "locking"})

ONCE = " (Said once in a history, at the first step beyond the bound; result.validity has the numbers.)"


class Watch:
    """The look at the bounds of the model after every load step; made once for a solver.

    Parameters
    ----------
    geometry : Geometry
    diagonals : sequence of ndarray
        Of the stiffness of every body [force/length].
    known : callable
        Gives the DOFs whose displacements are known without the interior; called only where bodies that
        nothing holds along a frictionless contact may slide on it.
    """

    def __init__(
        self, geometry: Geometry, diagonals: Sequence[Array], known: Callable[[], Index]
    ) -> None:
        self.contacts, self.system, kin = geometry.contacts, geometry.system, geometry.kin
        self.moves = kin.tangents == kin.points.shape[1] - 1
        if not self.moves:  # a scalar field
            return
        names, bodies, starts = self.system.names, self.system.bodies, self.system.offsets
        self.supports = [
            Support.of(body, int(start), arm=self.system.extent)
            for body, start in zip(bodies, starts[:-1], strict=True)
        ]
        self.tracks = tuple(
            ContactWatch(geometry, i, self.supports, diagonals, known)
            for i in range(len(self.contacts))
        )
        self.overlaps = Overlaps(geometry, self.tracks, known)
        # whether motions of bodies that slide freely show in the interior alone
        self.inside = any(track.inside for track in self.tracks)
        # what follows large strains and turns has no bounds of them
        solids = self.system.solids
        self.bounded = [n for n, b in solids.items() if b.components > 1 and not b.finite_strain]
        # where supports do not hold a body against contact, only its surfaces tell how it is strained
        loose = {b for track in self.tracks if not track.held for b in track.bodies}
        self.floating = {
            names[b]: Support.of(bodies[b], int(starts[b]), self._known(b))
            for b in sorted(loose)
            if names[b] in self.bounded and self.supports[b].free.shape[1]
        }
        # whether displacements at the contact DOFs are asked for
        self.asks = bool(self.floating) or any(track.asks for track in self.tracks)
        # the supports of bodies that turn as their prescribed DOFs say; rigid ones may turn
        self.turning = {
            name: b
            for b, (name, support) in enumerate(zip(names, self.supports, strict=True))
            if len(support.dofs) and name in solids
        }
        self.may_lock = any(map(may_lock, solids.values()))  # whatever the answer is
        # modulus times volume, of the box of all nodes [force length]
        linear = [n for n in self.bounded if not solids[n].nonlinear]
        boxes = {n: np.prod(np.ptp(solids[n].basis.mesh.p, axis=1)) for n in linear}
        firm = {n: boxes[n] * 2 * m.shear.mean() for n in linear if (m := solids[n].moduli)}
        self.firm = {n: float(own) for n, own in firm.items() if own > 0}

    def _known(self, b: int) -> Index:
        """DOFs of a body at its supports and contacts."""
        body = self.system.bodies[b]
        sides = [side for c in self.contacts for side in (c.secondary, c.primary)]
        own = [s.dofs.ravel() for s in sides if isinstance(s, ContactSurface) and s.body is body]
        return np.unique(np.concatenate([body.D, *own])).astype(np.intp)

    def look(self, result: Answer, issued: Issued, leaning: dict[str, float]) -> None:
        """See an answer, note in it what is seen, and say what is beyond the bounds.

        What has been said in its history is not said again. What a step suspects is measured by an
        `Assessment`, which has the last word.

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
            One for each contact, and body and kind, with the numbers and the setting to change.
        """
        result.diagnostics = Diagnostics(issued=issued, leaning=leaning)
        if self.moves:
            result.diagnostics = self._seen(result)
            result.diagnostics = self._warned(result)

    def _seen(self, result: Answer) -> Diagnostics:
        """What a step knows, added to what has been said before."""
        x, u, known = result.case.x, np.zeros(0), result.diagnostics
        if self.asks:  # where bodies slide along an axis their contact DOFs do not tell
            u = result.u if self.inside else result.recover.at_contact()
        motions, off, turned_by = fitted(self.supports, x)
        drifts = tuple(track.look(result, motions, u) for track in self.tracks)
        turns = {
            name: float(m[2] if len(m) == 3 else np.linalg.norm(m[3:])) / self.supports[b].arm
            for name, b in self.turning.items()
            for m in [motions[b]]
        }
        stretches = {name: off[b] for name, b in self.turning.items()}
        rigid = {name: turned_by[b] for name, b in self.turning.items()}
        if self.floating:
            _, bent, turned_by = fitted(list(self.floating.values()), u)
            stretches |= dict(zip(self.floating, bent, strict=True))
            rigid |= dict(zip(self.floating, turned_by, strict=True))
        if len(result.state.surface):  # of what slides far
            moved = surface_turns(self.system, self.contacts, result.state.surface)
            turns |= rigid_rotations(moved)
        else:
            moved = {name: turn for name, turn in rigid.items() if turn is not None}
        shares = known.leaning
        if moved:
            shares = shares | turned(result, moved, self.supports, [d.approach for d in drifts])
        undetected = {
            i: text
            for i, (track, drift) in enumerate(zip(self.tracks, drifts, strict=True))
            if track.rigid and (text := self.overlaps.undetected(track, result, u, drift))
        }
        return replace(
            known,
            drifts=drifts,
            turns=turns,
            tracks=self.tracks,
            intrusions=self.overlaps.look_far(result, drifts) if self.overlaps.far else frozenset(),
            undetected=undetected,
            leaning=shares,
            stretches=stretches,
        )

    def _warned(self, result: Answer) -> Diagnostics:
        """Say what is beyond the bounds and has not been said in this history."""
        known = result.diagnostics
        suspected, looked = self._suspected(result)
        bodies, seen = self._strained(result)
        looked |= seen
        leans = known.leaning and leaning(self.system, known.leaning, known.issued)
        if not (suspected or bodies or looked or leans):
            return known
        measured = Assessment(result)
        problems = measured.problems(suspected, bodies, known.issued)
        new = {key: words for key, words in problems.items() if key not in known.issued}
        for i in suspected:  # one warning for all of a contact
            own = [new.pop((kind, result.names[i]), "") for kind in OF_CONTACTS]
            if any(own):
                warn(measured.label(i) + " ".join(filter(None, own)) + ONCE)
        for words in new.values():
            warn(words + ONCE)
        return replace(known, issued=known.issued | looked | set(problems), meetings=measured.meetings)

    def _suspected(self, result: Answer) -> tuple[dict[int, set[str]], Issued]:
        """What seems to be wrong with contacts and has not been said, by kind; looks that are kept.

        Where corners and edges may stand between points that press, overlaps are looked for at the
        first step, and once for each doubling of the approach; before anything presses, of the motion.
        """
        known, case, names = result.diagnostics, result.case, result.model.interface.names
        found: dict[int, set[str]] = {}
        looked = Issued()
        for i, drift in enumerate(known.drifts):
            name, overlaps = names[i], i in known.intrusions
            if self.tracks[i].of_triangles or i in self.overlaps.near:
                # sizes of vectors: the same in whatever axes
                moved = max(float(np.linalg.norm(v)) for v in (case.x, case.motion[i].translation))
                seen = _look("overlap", name, drift.approach or moved, known.issued)
                looked |= seen
                near = i in self.overlaps.near
                overlaps |= bool(seen) and not (near and not self.overlaps.look_near(i, result, drift))
            beyond = {
                "sliding": not drift.small_sliding_holds,
                "facets": self.tracks[i].seems_coarse(result, drift),
                "overlap": (overlaps or i in known.undetected) and not known.prescribed(name),
            }
            kinds = {kind for kind in beyond if beyond[kind] and (kind, name) not in known.issued}
            if kinds:
                found[i] = kinds
        return found, looked

    def _strained(self, result: Answer) -> tuple[list[str], Issued]:
        """Bodies that seem to be strained, to turn or to lock, and have not been said to.

        With looks that are kept: whether a body locks does not depend on the size of its load, and is
        looked at once each doubling of its approach, as is what bends.
        """
        found, looked = list[str](), Issued()
        known, lock = result.diagnostics, lockable(result) if self.may_lock else []
        size = dict.fromkeys(self.bounded, (0.0, 0.0, 0.0))
        for drift, watch in zip(known.drifts, self.tracks, strict=True):
            done = float(np.abs(result.state.normal_force[watch.part]).sum()) * drift.approach
            for name in {self.system.names[b] for b in watch.bodies} & set(size):
                strain, approach, work = size[name]
                size[name] = max(strain, drift.strain), max(approach, drift.approach), work + done
        for name, (strain, approach, work) in size.items():
            turn, stretch = abs(known.turns.get(name, 0.0)), known.stretches.get(name, 0.0)
            # where a body yields, pressures tell no strain, and measuring it costs little of a step
            yields = self.system.solids[name].nonlinear
            strained = yields or max(strain / PRESSED, stretch / SUSPECTED) > A_TENTH
            beyond = {
                "strain": strained,
                "rotation": strained or turn > SUSPECTED * A_TENTH,
                "locking": name in lock,
                "displacement": self._bends(name, approach, work),
            }
            kinds = {kind for kind in beyond if beyond[kind] and (kind, name) not in known.issued}
            look = bool(kinds & LOOKED)
            seen = _look("volumes", name, approach, known.issued) if look else Issued()
            looked |= seen
            if seen or kinds - LOOKED:
                found.append(name)
        return found, looked

    def _bends(self, name: str, approach: float, work: float) -> bool:
        """Whether a body seems to turn in itself by more than its strain allows, see `displaced_far`.

        As a beam on three points does, by what its mean strain leaves of the approach: a block that is
        compressed does not bend. `work` is that of its contact forces.
        """
        if not (work > 0 and name in self.firm):
            return False
        strain = float(np.sqrt(work / self.firm[name]))
        arm = self.supports[self.system.names.index(name)].arm
        return (2 * max(approach / arm - strain, 0.0)) ** 2 > A_TENTH * strain


def _look(what: str, name: str, approach: float, issued: Issued) -> Issued:
    """What is kept of a look at an approach, twice or half of all that were looked at; else nothing."""
    kind = f"seen {what}"
    before = [of.rpartition(" ") for key, of in issued if key == kind]
    for size in (float(size) for of, _, size in before if of == name):
        if size == approach or max(size, approach) < 2.0 * (1 - SOLVED) * min(size, approach):
            return Issued()
    return Issued({(kind, f"{name} {approach:.17g}")})


def assess(result: Answer) -> Validity:
    """Measure the validity of a result; needs the displacements of all bodies.

    Warns
    -----
    ContactWarning
        What is beyond its bound, unless its history has said so before.
    """
    measured = Assessment(result)
    contacts = (
        range(len(result.names)) if result.diagnostics.tracks else ()
    )  # scalar fields move nothing
    problems = measured.problems(dict.fromkeys(contacts, OF_CONTACTS), measured.bounded)
    for i, kind in product(contacts, OF_CONTACTS):
        if (key := (kind, result.names[i])) in problems:
            problems[key] = measured.label(i) + problems[key]
    for (kind, name), text in problems.items():
        issued = (kind, name) in result.diagnostics.issued
        issued |= kind == "overlap" and result.diagnostics.prescribed(name)
        if result.converged and not issued:
            warn(text)
    size, largest, rotation = (
        {name: measured.strains(name)[k] for name in measured.bounded} for k in range(3)
    )
    return Validity(
        {result.names[i]: measured.contact(i) for i in contacts},
        size,
        largest,
        rotation,
        problems,
        dict(result.diagnostics.leaning),
        {name: locked(result, name) for name in measured.lockable},
        tuple(key for key in result.diagnostics.beyond if key not in problems),
        {name: measured.displaced(name) for name in measured.bounded},
    )


class Assessment:
    """The measures of one answer, each taken when it is first asked for.

    Parameters
    ----------
    result : Answer
    """

    def __init__(self, result: Answer) -> None:
        self.result, self.system = result, result.system
        self.solids: dict[str, Body] = {n: b for n, b in self.system.solids.items() if b.components > 1}
        # those that strains and turns have bounds of: materials of finite strain follow them
        self.bounded = [name for name, body in self.solids.items() if not body.finite_strain]
        self.lockable = lockable(result)
        self.meetings = dict(result.diagnostics.meetings)
        # each measure once
        self.strains = cache(lambda name: strains(self.solids[name], result.stretched(name)))
        self.displaced = cache(self._displaced)
        self.boundary = cache(lambda name: boundary(self.solids[name], result.displacement(name)))
        self.drift, self.contact = cache(self._drift), cache(self._contact)

    def problems(
        self,
        contacts: Mapping[int, Collection[str]],
        bodies: Sequence[str],
        told: Collection[tuple[str, str]] = (),
    ) -> dict[tuple[str, str], str]:
        """Return what is beyond its bound, in words by kind and name.

        Parameters
        ----------
        contacts : mapping
            Kinds that are asked for, by the contact's number.
        bodies : sequence of str
            Names of bodies.
        told : collection of (str, str)
            What has been said before.
        """
        found: dict[tuple[str, str], str] = {}
        for i, kinds in contacts.items():
            words = self.of_contact(i, kinds)
            found |= {(kind, self.result.names[i]): words[kind] for kind in words}
        for name in bodies:
            found |= {(kind, name): words for kind, words in self.of_body(name).items()}
        return found | leaning(self.system, self.result.diagnostics.leaning, {*told, *found})

    def label(self, i: int) -> str:
        """Return which contact sentences are about."""
        return f"Contact {self.result.names[i]!r} ({self.result.contacts[i].label}): "

    # -- bodies -------------------------------------------------------------------------------

    def of_body(self, name: str) -> dict[str, str]:
        """Return what is beyond its bound of one body, in words by kind.

        Bending and shear turn parts of a body by as much as they strain it, or by more. What is not
        more than the strain is told by it.
        """
        found = {}
        strain, _, rotation, _ = self.strains(name)
        if strain > A_TENTH:
            found["strain"] = strain_words(name, strain, self.solids[name].nonlinear)
        if rotation > max(A_TENTH, strain):
            found["rotation"] = rotation_words(name, rotation)
        told = self.result.diagnostics.leaning.get(name, 0.0)
        if not found and self.displaced(name) > max(A_TENTH, told):
            found["displacement"] = displacement_words(name, self.displaced(name))
        if name in self.lockable:
            words = locking_words(name, self.solids[name], locked(self.result, name))
            found |= {"locking": words} if words else {}
        return found

    def _displaced(self, name: str) -> float:
        strain, _, _, rotation = self.strains(name)
        return displaced_far(self.result, name, strain, rotation)

    # -- contacts -----------------------------------------------------------------------------

    def of_contact(self, i: int, kinds: Collection[str]) -> dict[str, str]:
        """Return what is beyond its bound of one contact, in words by kind; of the kinds asked for."""
        found, drift, contact = {}, self.drift(i), self.result.contacts[i]
        if not drift.small_sliding_holds:
            found["sliding"] = sliding_words(drift, self._turning(i))
        elif "overlap" in kinds:  # small sliding that does not follow is the reason already
            found["overlap"] = self._overlap(i)
        if drift.facets_too_long:
            found["facets"] = facet_words(drift, contact)
        return {kind: words for kind, words in found.items() if words and kind in kinds}

    def _turning(self, i: int) -> list[str]:
        """Names of linear bodies that turn so far that torques are off where contact slides far."""
        contact, system = self.result.contacts[i], self.system
        sides = contact.secondary, contact.primary
        names = {system.names[system.index(s.body)] for s in sides if isinstance(s, ContactSurface)}
        most = A_TENTH * min(_coefficient(contact), 1.0)
        return [
            n for n in self.bounded if n in names and self.strains(n)[2] > max(most, self.strains(n)[0])
        ]

    def _contact(self, i: int) -> ContactValidity:
        """All that is measured of one contact."""
        result, meeting = self.result, self.meeting(i)
        tilt = result.kin.tilt[result.slices()[i]][result.closed(i)]
        angle = float(np.max(tilt, initial=0.0))
        mu = _coefficient(result.contacts[i])
        share = angle / mu if mu > 0 else np.nan
        seen = meeting.overlap, meeting.chords, meeting.unseen, meeting.opening
        return ContactValidity(self.drift(i), *seen, angle, share)

    def _overlap(self, i: int) -> str:
        """Return what contact conditions do not see of one contact, in words; empty for nothing."""
        result, drift, contact = self.result, self.drift(i), self.result.contacts[i]
        if i in result.diagnostics.undetected:
            return result.diagnostics.undetected[i]
        part = self.contact(i)
        if part.excess > 1.0:
            if result.diagnostics.prescribed(result.names[i]):
                return prescribed_words(part)
            way = unselected_words(result, i)
            return overlap_words(part, contact, self.meeting(i), way)
        # facets that are too long are the reason already
        if drift.facets_too_long or not (contact.secondary.dim == 3 and of_two_bodies(contact)):
            return ""
        return self._crossing(i)

    def _crossing(self, i: int) -> str:
        """Return what edges of two solids do that cross, in words; empty for nothing."""
        result, sides = self.result, sides_of(self.result.contacts[i])
        track, places = result.diagnostics.tracks[i], [result.moved(side) for side in sides]
        given = track.gap_added(result), self.drift(i).approach, SOLVED * self.system.extent
        found = crossing(track, places, *given)
        closed = np.flatnonzero(result.state.status[track.part] != OPEN)
        normal = result.kin.normal[track.part]
        if found is None or not (found.count or pressed_aside(found, sides[0], normal, closed)):
            return ""
        return crossing_words(found, *(side.label for side in sides))

    def meeting(self, i: int) -> Meeting:
        """Return how the deformed boundaries meet; the step may have measured it."""
        if i not in self.meetings:
            self.meetings[i] = self._met(i)
        return self.meetings[i]

    def _met(self, i: int) -> Meeting:
        contact, names = self.result.contacts[i], self.system.names
        name = names[self.system.index(contact.secondary.body)]
        if not isinstance(contact.primary, ContactSurface):
            return at_obstacle(self.result, i, lambda: self.boundary(name))
        if contact.primary.body is contact.secondary.body:
            return Meeting()
        other = names[self.system.index(contact.primary.body)]
        return between(self.result, i, self.boundary(name), self.boundary(other))

    def _drift(self, i: int) -> Drift:
        """Return how far a contact has drifted, with the slips of the displacements."""
        result, drift = self.result, self.result.diagnostics.drifts[i]
        if result.contacts[i].sliding != "small":
            return with_elastic_approach(result, i, drift)
        t, part = result.kin.tangents, result.slices()[i]
        slip = result.kin.B_t[part.start * t : part.stop * t] @ result.u
        slip = np.einsum("mk,mkd->md", slip.reshape(-1, t), result.kin.duals[part])
        track = result.diagnostics.tracks[i]
        drift = replace(
            drift, **track.numbers(result, result.closed(i), slip, drift.approach, result.u)
        )
        if drift.facets_too_long and result.contacts[i].rigid:
            # forces alone say too little of how far bodies are pressed in, where they move most of all
            return with_elastic_approach(result, i, drift)
        return drift


def _coefficient(contact: Contact) -> float:
    """The largest coefficient of friction of a contact; NaN without one."""
    law = contact.friction
    coefficient = law.smaller if isinstance(law, OrthotropicCoulomb) else getattr(law, "mu", np.nan)
    return float(np.max(coefficient))
