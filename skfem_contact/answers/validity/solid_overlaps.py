r"""Where solids overlap and no row of the contact sees it: vertices, edges and sides, after every step.

Conditions hold at the nodes of the secondary, or in the mean over its faces. A vertex of the primary
that stands in the middle of a face of the secondary, as the tip of a dome does or the corner of a box,
lies between the nodes, and a vertex of either side may leave the mean open. Two edges that cross each
other meet between the nodes of both. Both are looked for on the deformed surfaces:

* nodes of each side under faces of the other, by the closest point of the face;
* sharp edges of both sides that cross (`answers.validity.unseen`);
* where solids slide far, nodes behind sides of the other body that no contact has.

Overlaps are compared with what smooth boundaries stand off the faces of the secondary, and with what
the bodies take up elastically: a part of that changes forces by as little. Where contact does not slide
far, nodes that are in no row have displacements that only the interior knows (`Extrapolation`). What
seems to overlap is looked at again with all displacements before anything is said. Where such a node is
over a face of the other side, or a corner of a face that a node is under, its place is too uncertain to
see an overlap: then too, once for every doubling of the approach.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from skfem_contact.answers.answer import Answer
from skfem_contact.answers.thresholds import A_TENTH, ALONE, CHORDS, STANDING
from skfem_contact.answers.validity.chords import heights
from skfem_contact.answers.validity.support import Extrapolation
from skfem_contact.answers.validity.track import Track
from skfem_contact.answers.validity.unseen import crossings, sharp_edges_of
from skfem_contact.answers.validity.validity import Drift, HiddenOverlap
from skfem_contact.answers.validity.words import hidden_words
from skfem_contact.bodies.facets import area_vectors
from skfem_contact.bodies.surface import ContactSurface, extract_surface
from skfem_contact.conditions.contact import Contact
from skfem_contact.conditions.geometry import Geometry
from skfem_contact.conditions.loads import LoadCase
from skfem_contact.conditions.state import OPEN, State
from skfem_contact.digits import SOLVED
from skfem_contact.errors import InputError
from skfem_contact.pairing.projection import project
from skfem_contact.pairing.thresholds import COINCIDENT
from skfem_contact.pairing.vectors import dot
from skfem_contact.trees import Tree

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Mask = NDArray[np.bool_]


class SolidOverlaps:
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
            i: SolidPair(contact, self.system.extent)
            for i, contact in enumerate(geometry.contacts)
            if _looked_at(contact)
        }
        small = {i for i in self.each if geometry.contacts[i].sliding == "small"}
        self.asks = bool(small)  # for displacements at the contact DOFs
        at_contact, on_surfaces = (np.zeros(self.system.n, dtype=bool) for _ in range(2))
        if small:
            at_contact[known()] = True
        on_surfaces[geometry.surface_dofs] = True
        for there in (at_contact, on_surfaces):
            there[self.system.D] = True
        self.unknown = {
            i: [
                Extrapolation(self.system, side, at_contact if i in small else on_surfaces)
                for side in one.sides
            ]
            for i, one in self.each.items()
        }
        self.flanks = {i: self._flanks(self.each[i], on_surfaces) for i in self.each if i not in small}

    def look(
        self,
        state: State,
        case: LoadCase,
        u: Array,
        tracks: Sequence[Track],
        drifts: Sequence[Drift],
    ) -> dict[int, HiddenOverlap]:
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
        for i, one in self.each.items():
            known, approach = u, drifts[i].approach
            if i in self.flanks:
                known = self.geometry.spread(state.surface)
                known[self.system.D] = case.x[self.system.D]
            parts = [unknown.filled(known) for unknown in self.unknown[i]]
            overlap = self._look(i, parts, case, tracks, approach)
            if overlap is None and i in self.flanks:
                overlap = self._beside_surfaces(i, parts, known, approach)
            elif overlap is None:
                overlap = one.unsure(parts, [unknown.nodes for unknown in self.unknown[i]], approach)
            if overlap is not None:
                found[i] = overlap
        return found

    def sure(self, i: int, result: Answer, drift: Drift) -> str:
        """What to say of one contact, with the displacements of whole bodies; empty for nothing."""
        one = self.each[i]
        parts = [result.displacement(side.body) for side in one.sides]
        found = self._look(i, parts, result.worn_case, result.diagnostics.tracks, drift.approach)
        if found is None and i in self.flanks:
            found = self._beside_surfaces(i, parts, None, drift.approach)
        if found is None or (found.what == "touch" and not self._beside(i, result, found)):
            return ""
        return hidden_words(found, one.secondary.label, one.primary.label, one.contact.method)

    def _flanks(self, one: SolidPair, there: Mask) -> list[tuple[Flanks, Extrapolation]]:
        """The sides beside both surfaces of a contact, and what is not known of their places."""
        found = []
        for selected, own in ((one.primary, one.secondary), (one.secondary, one.primary)):
            whole = boundary(selected)
            if whole is not None:
                found.append((Flanks(whole, selected, own), Extrapolation(self.system, whole, there)))
        return found

    def _beside_surfaces(
        self, i: int, parts: Sequence[Array], known: Array | None, approach: float
    ) -> HiddenOverlap | None:
        """What is in a side of the other body; with all displacements where nothing is `known`."""
        one, best = self.each[i], None
        least = max(one.noise, STANDING * approach)
        for flanks, unknown in self.flanks[i]:
            k = 0 if flanks.own is one.secondary else 1
            u = parts[1 - k] if known is None else unknown.filled(known)
            found = flanks.look(u, parts[k], least)
            if found and (best is None or found.depth > best.depth):
                best = replace(found, what="flank of primary" if k == 0 else "flank of secondary")
        return best

    def _beside(self, i: int, result: Answer, found: HiddenOverlap) -> bool:
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
        return bool(along < np.cos(3 * A_TENTH))  # edges lean with the strains of their bodies

    def _look(
        self, i: int, parts: Sequence[Array], case: LoadCase, tracks: Sequence[Track], approach: float
    ) -> HiddenOverlap | None:
        added = tracks[i].added - case.interference[self.geometry.point_slices[i]]
        return self.each[i].look(parts, added, approach)


class SolidPair:
    """What is known beforehand of one contact of two solids."""

    def __init__(self, contact: Contact, extent: float) -> None:
        assert isinstance(contact.primary, ContactSurface)
        self.contact, self.secondary, self.primary = contact, contact.secondary, contact.primary
        self.sides = self.secondary, self.primary
        self.noise = SOLVED * extent
        self.chords = [CHORDS * heights(side) for side in self.sides]
        self.near = [Nearby(self.secondary), Nearby(self.primary)]
        self.edges = [sharp_edges_of(side) for side in self.sides]

    def look(self, u: Sequence[Array], added: Array, approach: float) -> HiddenOverlap | None:
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
        x = [side.points + v[side.dofs] for side, v in zip(self.sides, u, strict=True)]
        # of nearly all answers this is all that is asked
        pairs = [self.near[0].under(x[0], x[1], least), self.near[1].under(x[1], x[0], least)]
        found = None
        if len(pairs[0][0]) + len(pairs[1][0]):
            moved = self.secondary.moved(u[0]), self.primary.moved(u[1])
            found = self._vertices(*moved, pairs, added, approach)
        return found or self._edges(x, added, max(self.noise, STANDING * approach))

    def unsure(
        self, u: Sequence[Array], unknown: Sequence[Index], approach: float
    ) -> HiddenOverlap | None:
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
        for near, own in zip(self.near, (1, 0), strict=True):
            if not (len(unknown[0]) or len(unknown[1])) or approach <= self.noise:
                continue
            x = [side.points + v[side.dofs] for side, v in zip(self.sides, u, strict=True)]
            node, face = near.under(x[1 - own], x[own], -approach)
            hangs: Mask = np.any(np.isin(self.sides[1 - own].facets, unknown[1 - own]), axis=1)
            mine = np.isin(node, unknown[own]) | hangs[face]
            if not mine.any():
                continue
            moved = [side.moved(v) for side, v in zip(self.sides, u, strict=True)]
            over = nodes_in_faces(moved[1 - own], moved[own], node[mine], face[mine], -approach)
            if len(over[0]):
                k = int(np.argmax(over[2]))
                place = moved[own].points[over[0][k]]
                return HiddenOverlap(len(over[0]), float(over[2][k]), place, "unknown")
        return None

    def _vertices(
        self,
        secondary: ContactSurface,
        primary: ContactSurface,
        pairs: Sequence[tuple[Index, Index]],
        added: Array,
        approach: float,
    ) -> HiddenOverlap | None:
        """The deepest vertex of either side in the other one."""
        best: HiddenOverlap | None = None
        least, most = (max(self.noise, share * approach) for share in (ALONE, STANDING))
        for what, meshed, own, other, chords, pair in (
            ("primary", self.primary, primary, secondary, self.chords[0], pairs[0]),
            ("secondary", self.secondary, secondary, primary, self.chords[1], pairs[1]),
        ):
            node, face, depth = nodes_in_faces(other, own, *pair, least)
            if added.any() and len(node):
                nearest = Tree(secondary.points).nearest(own.points[node])
                depth = depth - added[nearest]
            between = np.flatnonzero((depth > least + chords[face]) & (depth <= most + chords[face]))
            alone = falls_away(meshed, node[between], other.facet_normals[face[between]], approach)
            hidden = depth > most + chords[face]
            hidden[between] = alone
            if not hidden.any() or (best and depth[hidden].max() <= best.depth):
                continue
            deepest = np.argmax(np.where(hidden, depth, 0.0))
            place = own.points[node[deepest]]
            best = HiddenOverlap(int(hidden.sum()), float(depth[deepest]), place, what)
        return best

    def _edges(self, points: Sequence[Array], added: Array, least: float) -> HiddenOverlap | None:
        """The deepest crossing of two edges; or the nearest one, where they only touch."""
        if not all(len(edges.ends) for edges in self.edges):
            return None
        one, other = (edges.at(x) for edges, x in zip(self.edges, points, strict=True))
        # what touches has been moved aside by no more than the approach, twice what is allowed
        depth, place, across = crossings(one, other, apart=least / STANDING)
        if added.any() and len(depth):
            depth = depth - added[Tree(points[0]).nearest(place)]
        if not len(depth):
            return None
        i, count = int(np.argmax(depth)), int(np.count_nonzero(depth > least))
        what = "edges" if count else "touch"
        return HiddenOverlap(max(count, 1), float(depth[i]), place[i], what, across[i])


def _looked_at(contact: Contact) -> bool:
    """Whether two solids press each other where the meshes say."""
    secondary, primary = contact.secondary, contact.primary
    if secondary.dim != 3 or not isinstance(primary, ContactSurface):
        return False
    if contact.bilateral or contact.gap is not None:
        return False
    return secondary.body is not primary.body and secondary.dofs.shape[1] == 3


class Nearby:
    """Nodes of one surface near the faces of another; searched again where they have moved.

    Parameters
    ----------
    other : ContactSurface
        With the faces.
    """

    def __init__(self, other: ContactSurface) -> None:
        self.corners = other.facets[:, : other.kind.corners]
        self.facets = other.facets
        x = other.points[other.facets]
        middle = x[:, : other.kind.corners].mean(axis=1, keepdims=True)
        # to the corners, and so much more that a node below one of them is found
        self.reach = 1.5 * np.linalg.norm(x - middle, axis=2).max(axis=1)
        self.slack = 0.1 * float(self.reach.min())
        # where both surfaces were, and which nodes were near which faces there
        self._found: tuple[Array, Array, Index, Index] | None = None

    def around(self, other: Array, own: Array) -> tuple[Index, Index]:
        """Pairs (node, face) of nodes near faces, by the places of all nodes of both, (m, 3)."""
        found = self._found
        if found is None or max(_farthest(other, found[0]), _farthest(own, found[1])) > self.slack:
            found = self._found = other, own, *self._search(other, own)
        return found[2:]

    def under(self, other: Array, own: Array, least: float) -> tuple[Index, Index]:
        """Those of the pairs `around` whose node is deeper than `least` under the plane of the face.

        What is curved or warped stands off its plane by a part of its size.
        """
        node, face = self.around(other, own)
        x = other[self.facets]
        middle = x[:, : self.corners.shape[1]].mean(axis=1)
        across = area_vectors(other[self.corners])
        across /= np.linalg.norm(across, axis=1, keepdims=True)
        highest = dot(x - middle[:, None], across[:, None]).max(axis=1)
        away = own[node] - middle[face]
        under = dot(away, across[face]) < highest[face] - least
        node, face = node[under], face[under]
        reached = np.linalg.norm(away[under], axis=1) <= self.reach[face]
        return node[reached], face[reached]

    def __getstate__(self) -> dict[str, object]:
        return {**vars(self), "_found": None}  # it is found again

    def _search(self, other: Array, own: Array) -> tuple[Index, Index]:
        x = other[self.facets]
        middle, reach = x[:, : self.corners.shape[1]].mean(axis=1), self.reach + 2 * self.slack
        low, high = middle.min(axis=0) - reach.max(), middle.max(axis=0) + reach.max()
        near = np.flatnonzero(((own >= low) & (own <= high)).all(axis=1))
        if not len(near):
            return near, near
        found = Tree(own[near]).query_ball_point(middle, reach)
        count = np.array([len(some) for some in found])
        node = near[np.concatenate([np.asarray(some, dtype=np.intp) for some in found])]
        return node, np.repeat(np.arange(len(middle)), count)


def nodes_in_faces(
    other: ContactSurface, own: ContactSurface, node: Index, face: Index, least: float
) -> tuple[Index, Index, Array]:
    """Nodes of one surface that lie in the body of the other, under a face that looks at them.

    Parameters
    ----------
    other, own : ContactSurface
        With the faces, and with the nodes.
    node, face : ndarray of int, shape (q,)
        Pairs to look at.
    least : float
        What is less deep need not be found [length].

    Returns
    -------
    node, face : ndarray of int, shape (p,)
        A node may lie under several faces; it is listed with the nearest.
    depth : ndarray, shape (p,)
        Distances from these faces, > 0 [length].
    """
    looks = dot(own.normals[node], other.facet_normals[face]) < 0
    node, face = node[looks], face[looks]
    if not len(node):
        return node, face, np.zeros(0)
    feet = project(other, face, own.points[node])
    depth = -dot(own.points[node] - feet.foot, feet.own)
    within = feet.over <= COINCIDENT * other.lengths[face]
    there = np.flatnonzero(within & (depth > least))
    order = there[np.lexsort((depth[there], node[there]))]
    first = np.r_[True, np.diff(node[order]) != 0] if len(order) else np.zeros(0, dtype=bool)
    order = order[first]
    return node[order], face[order], depth[order]


def falls_away(own: ContactSurface, node: Index, across: Array, by: float) -> Mask:
    """Nodes from which every face of their surface falls away by more than a length, (p,).

    Parameters
    ----------
    own : ContactSurface
        As it is meshed: faces that lie on the other side are deformed by the contact.
    node : ndarray of int, shape (p,)
    across : ndarray, shape (p, 3)
        Unit normals of what each is pressed on, towards the node.
    by : float
        [length]
    """
    found = np.zeros(len(node), dtype=bool)
    for k, (i, normal) in enumerate(zip(node, across, strict=True)):
        faces = own.facets[(own.facets == i).any(axis=1)]
        heights = (own.points[faces] - own.points[i]) @ normal
        found[k] = (heights.max(axis=1) > by).all()
    return found


def _farthest(points: Array, before: Array) -> float:
    return float(np.sqrt(np.max(np.sum((points - before) ** 2, axis=1), initial=0.0)))


class Flanks:
    """The sides of a body beside one of its contact surfaces, which no contact has.

    The nodes of a contact surface are looked for behind the sides of the other body that are not
    selected. One is in there if the nearest of all faces of that body is such a side, and the node
    behind it: next to the rim of a surface the nearest face is that which it is pressed on.

    Parameters
    ----------
    whole, selected : ContactSurface
        All of the boundary, and the contact surface.
    own : ContactSurface
        Of the other body, whose nodes are looked for.
    """

    def __init__(self, whole: ContactSurface, selected: ContactSurface, own: ContactSurface) -> None:
        self.whole, self.own = whole, own
        self.beside = ~np.isin(whole.mesh_facets, selected.mesh_facets)
        self.near = Nearby(whole)

    def look(self, u: Array, u_own: Array, least: float) -> HiddenOverlap | None:
        """The node that is deepest in, if it is deeper than a length.

        Parameters
        ----------
        u, u_own : ndarray
            Displacements of both bodies, right on the boundary and on the surface [length].
        least : float
            [length]
        """
        points = self.own.points + u_own[self.own.dofs]
        places = self.whole.points + u[self.whole.dofs]
        node, face = self.near.under(places, points, least)
        asked = np.unique(node[self.beside[face]])
        if not len(asked):
            return None
        whole = self.whole.moved(u)
        node, face = self.near.around(places, points)
        mine = np.isin(node, asked)
        node, face = node[mine], face[mine]
        feet = project(whole, face, points[node])
        away = points[node] - feet.foot
        depth = -dot(away, feet.own)
        # the nearest faces of each node; several where it is nearest to an edge between them, which
        # in a body is a hollow one: then the node is behind all of them
        distance = np.linalg.norm(away, axis=1)
        nearest, lowest = np.full(len(points), np.inf), np.full(len(points), np.inf)
        np.minimum.at(nearest, node, distance)
        same = distance <= nearest[node] + COINCIDENT * whole.lengths[face]
        np.minimum.at(lowest, node[same], depth[same])
        inside = same & (lowest[node] > 0)
        hidden = np.flatnonzero(inside & (depth > least) & self.beside[face])
        if not len(hidden):
            return None
        deepest = hidden[np.argmax(depth[hidden])]
        return HiddenOverlap(
            len(np.unique(node[hidden])), float(depth[deepest]), points[node[deepest]], "flank"
        )


def boundary(surface: ContactSurface) -> ContactSurface | None:
    """All of the boundary of the body of a surface; None where some of it has no sides to speak of."""
    try:
        return extract_surface(surface.body, None)
    except InputError:  # faces that fold over, far from the contact
        return None
