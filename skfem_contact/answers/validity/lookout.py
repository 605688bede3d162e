"""Looks after every step for vertices and edges of solids that overlap where no row sees it.

Overlaps (`standing`) are compared with what smooth boundaries stand off the faces of the secondary, and
with what the bodies take up elastically: a part of that changes forces by as little. Where contact does
not slide far, nodes that are in no row have displacements that only the interior knows: they follow
the rigid motion of what is known, and the nearest node that is known. What seems to overlap is looked
at again with all displacements before anything is said. Where such a node is over a face of the other
side, or a corner of a face that a node is under, its place is too uncertain to see an overlap: then
too, once for every doubling of the approach.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from skfem_contact.answers.answer import Answer
from skfem_contact.answers.thresholds import ALONE, CHORDS, STANDING, TILT
from skfem_contact.answers.validity.drift import Drift
from skfem_contact.answers.validity.face_chords import face_bends
from skfem_contact.answers.validity.flanks import Flanks, boundary
from skfem_contact.answers.validity.standing import Nearby, Standing, falls_away, standing_nodes
from skfem_contact.answers.validity.support import Support
from skfem_contact.answers.validity.track import Track
from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.conditions.contact import Contact
from skfem_contact.conditions.geometry import Geometry
from skfem_contact.conditions.loads import LoadCase
from skfem_contact.conditions.state import OPEN, State
from skfem_contact.digits import SOLVED
from skfem_contact.pairing.faces.edges import crossings, sharp_edges_of
from skfem_contact.trees import Tree

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Mask = NDArray[np.bool_]


class Lookouts:
    """What is known beforehand of all contacts of two solids.

    Parameters
    ----------
    geometry : Geometry
    known : callable
        Gives the DOFs whose displacements are known without the interior.
    """

    def __init__(self, geometry: Geometry, known: Callable[[], Index]) -> None:
        self.geometry, self.system = geometry, geometry.system
        self.each = {
            i: Lookout(contact, self.system.extent)
            for i, contact in enumerate(geometry.contacts)
            if _looked_out_for(contact)
        }
        small = [i for i in self.each if geometry.contacts[i].sliding == "small"]
        self.asks = bool(small)  # for displacements at the contact DOFs
        there = np.zeros(self.system.n, dtype=bool)
        if small:
            there[known()] = True
            there[self.system.D] = True
        sides = {i: (self.each[i].secondary, self.each[i].primary) for i in small}
        self.missing = {i: [self._missing(side, there) for side in sides[i]] for i in small}
        far = [i for i in self.each if i not in small]
        there[:] = False
        there[geometry.surface_dofs] = True
        there[self.system.D] = True
        self.flanks = {i: self._flanks(self.each[i], there) for i in far}

    def look(
        self,
        state: State,
        case: LoadCase,
        u: Array,
        tracks: Sequence[Track],
        drifts: Sequence[Drift],
    ) -> dict[int, Standing]:
        """Overlaps that seem to be too deep, by the number of the contact.

        Parameters
        ----------
        state, case : State, LoadCase
        u : ndarray, shape (n,)
            Displacements that are right at the contact DOFs; empty where nothing `asks` for them.
        tracks, drifts : sequence of Track and Drift
            Of every contact.
        """
        found = {}
        for i in self.each:
            if self.geometry.contacts[i].sliding == "small":
                parts = [self._part(missing, u) for missing in self.missing[i]]
            else:
                known = self.geometry.spread(state.surface)
                known[self.system.D] = case.x[self.system.D]
                sides = self.each[i].secondary, self.each[i].primary
                parts = [known[self.system.slice(side.body)] for side in sides]
            standing = self._look(i, parts, case, tracks, drifts[i].approach)
            if standing is None and i in self.missing:
                unknown = [missing.nodes for missing in self.missing[i]]
                standing = self.each[i].unsure(parts, unknown, drifts[i].approach)
            if standing is None and i in self.flanks:
                standing = self._beside_surfaces(i, parts, known, drifts[i].approach)
            if standing is not None:
                found[i] = standing
        return found

    def sure(self, i: int, result: Answer, drift: Drift) -> str:
        """What to say of one contact, with the displacements of whole bodies; empty for nothing."""
        one = self.each[i]
        parts = [result.displacement(side.body) for side in (one.secondary, one.primary)]
        found = self._look(i, parts, result.worn_case, result.watched.tracks, drift.approach)
        if found is None and i in self.flanks:
            found = self._beside_surfaces(i, parts, None, drift.approach)
        if found is None or (found.what == "touch" and not self._beside(i, result, found)):
            return ""
        return found.words(one.secondary.label, one.primary.label, one.contact.method)

    def _flanks(self, one: Lookout, there: Mask) -> list[tuple[Flanks, Missing]]:
        """The sides beside both surfaces of a contact, and what is not known of their places."""
        found = []
        for selected, own in ((one.primary, one.secondary), (one.secondary, one.primary)):
            whole = boundary(selected)
            if whole is not None:
                found.append((Flanks(whole, selected, own), self._missing(whole, there)))
        return found

    def _beside_surfaces(
        self, i: int, parts: Sequence[Array], known: Array | None, approach: float
    ) -> Standing | None:
        """What is in a side of the other body; with all displacements where nothing is `known`."""
        one, best = self.each[i], None
        least = max(one.noise, STANDING * approach)
        for flanks, missing in self.flanks[i]:
            k = 0 if flanks.own is one.secondary else 1
            u = parts[1 - k] if known is None else missing.filled(parts[1 - k], known)
            found = flanks.look(u, parts[k], least)
            if found and (best is None or found.depth > best.depth):
                best = replace(found, what="flank of primary" if k == 0 else "flank of secondary")
        return best

    def _beside(self, i: int, result: Answer, found: Standing) -> bool:
        """Whether the point that presses where two edges touch does so in another direction."""
        assert found.across is not None
        part, side = self.geometry.point_slices[i], self.each[i].secondary
        closed = np.flatnonzero(result.state.status[part] != OPEN)
        if not len(closed):
            return False
        apart = np.linalg.norm(side.points[closed] - found.place, axis=1)
        nearest = closed[np.argmin(apart)]
        if apart.min() > side.lengths.max():
            return False
        along = abs(float(result.kin.normal[part][nearest] @ found.across))
        return bool(along < np.cos(3 * TILT))  # edges lean with the strains of their bodies

    def _look(
        self, i: int, parts: Sequence[Array], case: LoadCase, tracks: Sequence[Track], approach: float
    ) -> Standing | None:
        added = tracks[i].added - case.interference[self.geometry.point_slices[i]]
        return self.each[i].look(parts, added, approach)

    def _missing(self, side: ContactSurface, there: Mask) -> Missing:
        start = int(self.system.slice(side.body).start)
        return Missing(side, start, np.flatnonzero(there[self.system.slice(side.body)]))

    def _part(self, missing: Missing, u: Array) -> Array:
        return missing.filled(u[self.system.slice(missing.side.body)], u)


class Missing:
    """Nodes of a surface whose displacements are not known without the interior."""

    def __init__(self, side: ContactSurface, start: int, known: Index) -> None:
        self.side = side
        there = np.isin(side.dofs, known).all(axis=1)
        self.nodes, known_nodes = np.flatnonzero(~there), np.flatnonzero(there)
        if not len(self.nodes):
            return
        self.support = Support.of(side.body, start, known)
        self.beside = known_nodes[:0]
        if len(known_nodes):
            nearest = Tree(side.points[known_nodes]).query(side.points[self.nodes])[1]
            self.beside = known_nodes[nearest]

    def filled(self, part: Array, u: Array) -> Array:
        """Displacements of the body, with those of the missing nodes as near as one can say."""
        if not len(self.nodes):
            return part
        x, dofs = self.side.points, self.side.dofs
        motion = self.support.motion(u)
        moved = self.support.at(x[self.nodes], motion)
        if len(self.beside):
            moved += part[dofs[self.beside]] - self.support.at(x[self.beside], motion)
        part = part.copy()
        part[dofs[self.nodes]] = moved
        return part


class Lookout:
    """What is known beforehand of one contact of two solids."""

    def __init__(self, contact: Contact, extent: float) -> None:
        assert isinstance(contact.primary, ContactSurface)
        self.contact, self.secondary, self.primary = contact, contact.secondary, contact.primary
        self.noise = SOLVED * extent
        self.chords = [CHORDS * _heights(side) for side in (self.secondary, self.primary)]
        self.near = [Nearby(self.secondary), Nearby(self.primary)]
        self.edges = [sharp_edges_of(side) for side in (self.secondary, self.primary)]

    def look(self, u: Sequence[Array], added: Array, approach: float) -> Standing | None:
        """The deepest overlap that no row sees and that is too deep.

        Parameters
        ----------
        u : two of ndarray
            Displacements of the bodies of both sides, right on their surfaces [length].
        added : ndarray, shape (m,)
            What the user has the gaps be larger than the meshes say, at the secondary's nodes [length].
        approach : float
            What the bodies take up elastically [length].
        """
        least = max(self.noise, ALONE * approach)
        sides = self.secondary, self.primary
        x = [side.points + v[side.dofs] for side, v in zip(sides, u, strict=True)]
        # of nearly all answers this is all that is asked
        pairs = [self.near[0].under(x[0], x[1], least), self.near[1].under(x[1], x[0], least)]
        found = None
        if len(pairs[0][0]) + len(pairs[1][0]):
            moved = self.secondary.moved(u[0]), self.primary.moved(u[1])
            found = self._vertices(*moved, pairs, added, approach)
        return found or self._edges(x, added, max(self.noise, STANDING * approach))

    def unsure(self, u: Sequence[Array], unknown: Sequence[Index], approach: float) -> Standing | None:
        """Nodes that may stand in faces of the other side, where one of their places is not known.

        These are as uncertain as the approach: faces with unknown corners are pressed in as well.

        Parameters
        ----------
        u : two of ndarray
            Displacements of the bodies of both sides [length].
        unknown : two of ndarray of int
            Nodes of both sides.
        approach : float
            [length]
        """
        sides = self.secondary, self.primary
        for near, own in zip(self.near, (1, 0), strict=True):
            if not (len(unknown[0]) or len(unknown[1])) or approach <= self.noise:
                continue
            x = [side.points + v[side.dofs] for side, v in zip(sides, u, strict=True)]
            node, face = near.under(x[1 - own], x[own], -approach)
            hangs: Mask = np.any(np.isin(sides[1 - own].facets, unknown[1 - own]), axis=1)
            mine = np.isin(node, unknown[own]) | hangs[face]
            if not mine.any():
                continue
            moved = [side.moved(v) for side, v in zip(sides, u, strict=True)]
            over = standing_nodes(moved[1 - own], moved[own], node[mine], face[mine], -approach)
            if len(over[0]):
                k = int(np.argmax(over[2]))
                place = moved[own].points[over[0][k]]
                return Standing(len(over[0]), float(over[2][k]), place, "unknown")
        return None

    def _vertices(
        self,
        secondary: ContactSurface,
        primary: ContactSurface,
        pairs: Sequence[tuple[Index, Index]],
        added: Array,
        approach: float,
    ) -> Standing | None:
        """The deepest vertex of either side in the other one."""
        best: Standing | None = None
        least, most = (max(self.noise, share * approach) for share in (ALONE, STANDING))
        for what, meshed, own, other, chords, pair in (
            ("primary", self.primary, primary, secondary, self.chords[0], pairs[0]),
            ("secondary", self.secondary, secondary, primary, self.chords[1], pairs[1]),
        ):
            node, face, depth = standing_nodes(other, own, *pair, least)
            if added.any() and len(node):
                nearest = Tree(secondary.points).query(own.points[node])[1]
                depth = depth - added[nearest]
            between = np.flatnonzero((depth > least + chords[face]) & (depth <= most + chords[face]))
            alone = falls_away(meshed, node[between], other.facet_normals[face[between]], approach)
            hidden = depth > most + chords[face]
            hidden[between] = alone
            if not hidden.any() or (best and depth[hidden].max() <= best.depth):
                continue
            deepest = np.argmax(np.where(hidden, depth, 0.0))
            place = own.points[node[deepest]]
            best = Standing(int(hidden.sum()), float(depth[deepest]), place, what)
        return best

    def _edges(self, points: Sequence[Array], added: Array, least: float) -> Standing | None:
        """The deepest crossing of two edges; or the nearest one, where they only touch."""
        if not all(len(edges.ends) for edges in self.edges):
            return None
        one, other = (edges.at(x) for edges, x in zip(self.edges, points, strict=True))
        # what touches has been moved aside by no more than the approach, twice what is allowed
        depth, place, across = crossings(one, other, apart=least / STANDING)
        if added.any() and len(depth):
            depth = depth - added[Tree(points[0]).query(place)[1]]
        if not len(depth):
            return None
        i, count = int(np.argmax(depth)), int(np.count_nonzero(depth > least))
        what = "edges" if count else "touch"
        return Standing(max(count, 1), float(depth[i]), place[i], what, across[i])


def _looked_out_for(contact: Contact) -> bool:
    """Whether two solids press each other where the meshes say."""
    secondary, primary = contact.secondary, contact.primary
    if secondary.dim != 3 or not isinstance(primary, ContactSurface):
        return False
    if contact.bilateral or contact.gap is not None:
        return False
    return secondary.body is not primary.body and secondary.dofs.shape[1] == 3


def _heights(surface: ContactSurface) -> Array:
    """How far the smooth boundary stands off the middles of faces, shape (nf,) [length]."""
    bend, edges = face_bends(surface)
    spread = np.einsum("fcd,fce->fde", edges, edges) / (9 if surface.kind.triangle else 8)
    return np.asarray(0.5 * np.abs(np.einsum("fde,fde->f", bend, spread)))
