"""Overlaps that contact conditions do not see, by signed distance between deformed boundaries.

The points of both surfaces, and those between them, are looked for in the whole body on the other
side, by what a step knows of displacements: those of contact surfaces and supports, extrapolated to the
rest of the boundary (`Extrapolation`). That is a suspicion: the verdict is that of `between`, with all
displacements. Where bodies slide far anything may come to overlap in any step; with small sliding
overlaps of solids grow as forces do, and `assess` looks once for every doubling.

Edges of solids that cross inside each other are overlaps that the nodes of neither boundary tell. Where
they only touch, node by node, forces act along normals of faces and not across both edges.

What obstacles hide goes by kinds that each have a shape for it:

* a surface that begins where its obstacle is solid, and does not touch it: `hollow` by mistake;
* a round tool that stands in a facet between nodes;
* flats of large triangles whose normals lean towards the bends beside them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache, cached_property

import numpy as np

from skfem_contact.answers.answer import Answer
from skfem_contact.answers.validity.chords import bends, kinked_edges
from skfem_contact.answers.validity.deformed_boundaries import (
    Boundary,
    BoundaryNodes,
    Rim,
    crossings,
    within,
)
from skfem_contact.answers.validity.support import Extrapolation
from skfem_contact.answers.validity.track import ContactWatch, signed_distance
from skfem_contact.answers.validity.validity import A_TENTH, OVERLAP, SAGITTA, Crossing, Drift, Meeting
from skfem_contact.arrays import Array, Index, Mask, first_largest
from skfem_contact.bodies.body import Body
from skfem_contact.bodies.selection import written
from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.conditions.contact import Contact
from skfem_contact.conditions.geometry import Geometry
from skfem_contact.conditions.state import OPEN
from skfem_contact.digits import SOLVED
from skfem_contact.obstacles.obstacle import Obstacle
from skfem_contact.obstacles.rigid_body import shape_of
from skfem_contact.pairing.corners import unselected_sides
from skfem_contact.pairing.node import node_to_segment
from skfem_contact.trees import Tree


class Overlaps:
    """The facts that are known beforehand of all contacts between two bodies that may overlap.

    Parameters
    ----------
    geometry : Geometry
    tracks : sequence of ContactWatch
        Of every contact.
    known : callable
        Gives the DOFs whose displacements are known without the interior.

    Attributes
    ----------
    far, near : list of int
        Contacts that slide far, to be looked at after every step, and solids with small sliding.
    """

    def __init__(
        self, geometry: Geometry, tracks: Sequence[ContactWatch], known: Callable[[], Index]
    ) -> None:
        self.geometry, self.system, self.contacts = geometry, geometry.system, geometry.contacts
        self.tracks, self.known = tracks, known
        self.depth_in_solid = cache(depth_in_solid)  # of the undeformed bodies
        self.held = np.asarray(self.system.D)
        two = [i for i, c in enumerate(self.contacts) if of_two_bodies(c)]
        self.far = [i for i in two if self.contacts[i].sliding == "finite"]
        self.near = [i for i in two if i not in self.far and self.contacts[i].secondary.dim == 3]

    @cached_property
    def nodes(self) -> dict[int, BoundaryNodes]:
        """The boundaries of all bodies that are looked at, by number."""
        sides = [side for i in self.far + self.near for side in sides_of(self.contacts[i])]
        bodies = {self.system.index(side.body): side.body for side in sides}
        return {b: BoundaryNodes.of(body) for b, body in bodies.items() if isinstance(body, Body)}

    #: What is not known of them by surfaces that slide far, and by all contacts without the interior.
    beside_surfaces = cached_property(lambda self: self._beside(self.geometry.surface_dofs))
    beside_contacts = cached_property(lambda self: self._beside(self.known()))

    def _beside(self, dofs: Index) -> dict[int, Extrapolation]:
        known = np.zeros(self.system.n, dtype=bool)
        known[dofs] = True
        known[self.held] = True
        return {b: Extrapolation(self.system, nodes, known) for b, nodes in self.nodes.items()}

    def look_far(self, result: Answer, drifts: Sequence[Drift]) -> frozenset[int]:
        """Numbers of contacts that slide far and seem to overlap by more than their bounds.

        By the drifts of all contacts, as far as a step knows them.
        """
        parts = self._filled(self.beside_surfaces, result.at_surfaces())
        return frozenset(i for i in self.far if self._seems(i, parts, result, drifts[i]))

    def look_near(self, i: int, result: Answer, drift: Drift) -> bool:
        """Whether solids with small sliding seem to, by displacements of contacts and supports."""
        if self._hidden(self.tracks[i]):
            return True
        parts = self._filled(self.beside_contacts, result.recover.at_contact())
        return self._seems(i, parts, result, drift)

    @staticmethod
    def _filled(beside: dict[int, Extrapolation], u: Array) -> dict[int, Array]:
        return {b: unknown.filled(u) for b, unknown in beside.items()}

    def _hidden(self, track: ContactWatch) -> bool:
        """Whether nodes in no row lie among those that are: only the interior knows their places."""
        known = np.zeros(self.system.n, dtype=bool)
        known[self.known()] = known[self.held] = True
        x = np.concatenate([track.points[track.paired], track.feet[track.paired]])
        if not len(x):
            return True
        room = float(np.max(np.abs(track.points - track.feet))) + float(np.max(track.sagittas))
        room += SOLVED * self.system.extent
        box = x.min(axis=0) - room, x.max(axis=0) + room
        return any(
            within(side.points[~known[self.system.slice(side.body)][side.dofs].all(axis=1)], box).any()
            for side in sides_of(track.contact)
        )

    def _seems(self, i: int, parts: dict[int, Array], result: Answer, drift: Drift) -> bool:
        """Whether points of a side or edges lie in the other body, by displacements of both bodies.

        The bound is that of `ContactValidity.excess`, with what is known of the approach; a lower one
        where small sliding of solids is looked at, seldom and by what is known of the displacements.
        """
        track, sides = self.tracks[i], sides_of(self.contacts[i])
        added, noise = np.nan_to_num(track.gap_added(result)), SOLVED * self.system.extent
        numbers = [self.system.index(side.body) for side in sides]
        places = [s.points + parts[b][s.dofs] for s, b in zip(sides, numbers, strict=True)]
        others = [self.nodes[b].displaced(parts[b]) for b in numbers[::-1]]
        allowed = (A_TENTH if i in self.near else OVERLAP) * drift.approach
        for side, nodes, other, chords in zip(sides, places, others, track.chords[::-1], strict=True):
            # what supports hold in the other body is warned of as that
            free: Mask = np.logical_not(np.all(side.held, axis=1))
            ends = side.facets[free[side.facets].all(axis=1)]
            amid = np.einsum("pk,fkd->pfd", side.kind.between, nodes[ends]).reshape(-1, side.dim)
            for points, explained in ((nodes[free], chords), (amid, sum(track.chords))):
                bound = max(explained + allowed, noise)
                points, depth = other.inner(points, bound + float(np.min(added, initial=0.0)))
                depth = less_added(depth, points, places[0], added)
                if np.max(depth, initial=0.0) > bound:
                    return True
        given = places, added, drift.approach, noise
        return track.dim == 3 and crossing(track, *given) is not None

    def undetected(self, track: ContactWatch, result: Answer, u: Array, drift: Drift) -> str:
        """Return what contact conditions do not see of an obstacle, in words; or nothing.

        Parameters are those of `ContactWatch.look`, and what it has found.
        """
        words = leaning_words(track, result, u) if track.of_triangles else ""
        if words or drift.closed or track.contact.bilateral:
            return words
        # nothing touches; what finds partners that it did not have has come to another place
        gap, depth = result.gap[track.part], self.depth_in_solid(track)
        if depth and (track.paired.any() or not np.isfinite(gap).any()):
            return in_solid_words(track.contact, depth)
        found = None if track.bend is None else pierced(track.secondary, track.bend, gap)
        return pierced_words(track.secondary, *found, track.primary.label) if found else ""


def less_added(depth: Array, points: Array, nodes: Array, added: Array) -> Array:
    """Depths (p,) at points less what is added to the gaps (m,) of the nodes nearest to them."""
    return depth - added[Tree(nodes).nearest(points)] if len(points) and added.any() else depth


def unselected_words(result: Answer, i: int) -> str:
    """Where a surface in the plane ends and the other body lies on the side beyond, held by nothing."""
    contacts, contact, u = result.contacts, result.contacts[i], result.at_surfaces()
    if contact.sliding == "small" or contact.secondary.dim == 3 or not of_two_bodies(contact):
        return ""
    sides = [side.moved(u[result.system.slice(side.body)]) for side in sides_of(contact)]
    others = [s for c in contacts for s in (c.secondary, c.primary)]
    words = []
    for own, other in (sides, sides[::-1]):
        shared = [s for s in others if isinstance(s, ContactSurface) and s.body is own.body]
        for node, depth in unselected_sides(own, other):
            dofs = own.dofs[node, 0]
            if sum(dofs in s.dofs[:, 0] for s in shared) > 1:
                continue  # the side belongs to another contact
            words.append(
                f"point {node} at {written(own.points[node])}, where surface {own.label!r} ends, "
                f"lies {depth:.3g} inside the body of {other.label!r}, which presses on a side "
                f"that does not belong to {own.label!r}: nothing holds it there. Take that side "
                "into the surface, or make a second contact with it."
            )
    return " ".join(words)


def of_two_bodies(contact: Contact) -> bool:
    """Return whether two bodies press each other where the meshes say.

    In one and the same body inside and outside are not told apart. Where the user gives the gap, the
    meshes are not the shapes that touch, and their overlaps are what the user knows of.
    """
    secondary, primary = contact.secondary, contact.primary
    if not isinstance(primary, ContactSurface) or contact.tied or contact.gap is not None:
        return False
    return primary.body is not secondary.body and secondary.dofs.shape[1] == secondary.dim


def sides_of(contact: Contact) -> tuple[ContactSurface, ContactSurface]:
    """Both surfaces of a contact of two bodies."""
    assert isinstance(contact.primary, ContactSurface)
    return contact.secondary, contact.primary


def between(result: Answer, i: int, secondary: Boundary, primary: Boundary) -> Meeting:
    """How two deformed bodies meet, all of their boundaries.

    Nodes are on the boundary that is meshed: that they overlap only chords of the other side explain.
    """
    track, nodes = result.diagnostics.tracks[i], result.moved(result.contacts[i].secondary)
    chords, added, noise = track.chords, track.gap_added(result), SOLVED * result.system.extent
    paired = result.kin.paired[track.part]
    # with an interference bodies may overlap before their meshes do: this shows at the nodes
    true = np.full(len(nodes), np.inf)
    true[paired] = primary.signed(nodes[paired]) + added[paired]
    deepest = first_largest(-true)
    best = Meeting(0.0, chords=sum(chords))
    if true[deepest] < -noise:
        best = Meeting(-float(true[deepest]), chords=chords[1], place=nodes[deepest])
    for k, (one, other) in enumerate(((secondary, primary), (primary, secondary))):
        own = one.nodes[within(one.nodes, other.box)]  # the others lie outside
        samples = one.samples(other.box)
        for points, explained in ((own, chords[1 - k]), (samples, sum(chords))):
            depth = other.depth(points)
            points, depth = points[depth > noise], depth[depth > noise]
            depth = less_added(depth, points, nodes[paired], added[paired])
            beyond = float(np.max(depth, initial=0.0)) - explained
            # of two sides that symmetry makes alike round-off chooses none
            if len(points) and depth.max() > 0 and beyond * (1 - SOLVED) > best.overlap - best.chords:
                worst = first_largest(depth)
                best = Meeting(float(depth[worst]), 0, 0.0, explained, points[worst], k)
    lonely = primary.depth(nodes[~paired]) > max(sum(chords), noise)
    opening = float(np.max(true[result.closed(i)], initial=0.0))
    return replace(best, unseen=int(lonely.sum()), opening=opening)


def at_obstacle(result: Answer, i: int, body: Callable[[], Boundary]) -> Meeting:
    """How a deformed surface, its nodes and points between them, meets the obstacle at its place.

    And corners of the obstacle, which may stand in the deformed body between its nodes.
    """
    contact, track = result.contacts[i], result.diagnostics.tracks[i]
    # the obstacle is exact: where facets are too long to meet it, nothing explains the overlap
    surface, (chords,), added = contact.secondary, track.chords, track.gap_added(result)
    obstacle, noise = track.obstacle(result.case, result.u), SOLVED * result.system.extent
    nodes = result.moved(surface)
    at_nodes = signed_distance(obstacle, surface, nodes) + added
    ends = surface.facets
    between = [
        signed_distance(obstacle, surface, np.einsum("k,fkd->fd", w, nodes[ends])) + added[ends] @ w
        for w in surface.kind.between
    ]
    deepest = -float(np.min(np.concatenate([at_nodes, *between])))
    lonely = -at_nodes[~result.kin.paired[track.part]] > max(chords, noise)
    opening = float(np.max(at_nodes[result.closed(i)], initial=0.0))
    found = Meeting(deepest if deepest > noise else 0.0, int(lonely.sum()), opening, chords)
    if obstacle.outline is None or contact.bilateral or contact.gap is not None:
        return found
    corners = obstacle.outline.points
    depth = body().depth(corners)
    inside = np.flatnonzero(depth)
    if not len(inside):
        return found
    depth = depth[inside] - added[Tree(nodes).nearest(corners[inside])]
    k = first_largest(depth)
    if depth[k] - chords <= max(found.overlap - found.chords, 0.0):
        return found
    return replace(found, overlap=float(depth[k]), chords=chords, place=corners[inside[k]], side=1)


# -- edges of solids -----------------------------------------------------------------------------------


def crossing(
    track: ContactWatch, points: Sequence[Array], added: Array, approach: float, noise: float
) -> Crossing | None:
    """Measure how edges of two solids cross.

    Parameters
    ----------
    track : ContactWatch
    points : two of ndarray, shape (m, 3)
        Where their nodes are [length].
    added : ndarray, shape (m,)
        What the user has the gaps be larger than the meshes say, at the secondary's nodes [length].
    approach, noise : float
        What the bodies take up elastically, and round-off of places [length].
    """
    one, other = (own.at(x) for own, x in zip(track.edges, points, strict=True))
    # what touches has been moved aside by no more than the approach
    depth, place, across = crossings(one, other, apart=max(noise, approach))
    if not len(depth):
        return None
    depth = less_added(depth, place, points[0], added)
    i, count = first_largest(depth), int(np.count_nonzero(depth > max(noise, OVERLAP * approach)))
    return Crossing(count, float(depth[i]), place[i], across[i])


def pressed_aside(found: Crossing, side: ContactSurface, normal: Array, closed: Index) -> bool:
    """Return whether the point that presses where two edges touch does so in another direction.

    Parameters
    ----------
    found : Crossing
    side : ContactSurface
        The secondary, as it is meshed.
    normal : ndarray, shape (m, 3)
        Along which its points press.
    closed : ndarray of int
        Those that do.
    """
    if not len(closed):
        return False
    apart = np.linalg.norm(side.points[closed] - found.place, axis=1)
    if apart.min() > side.lengths.max():
        return False
    along = abs(float(normal[closed[np.argmin(apart)]] @ found.across))
    return bool(along < np.cos(3 * A_TENTH))  # edges lean with the strains of their bodies


# -- a surface in the solid of its obstacle -------------------------------------------------------


def depth_in_solid(track: ContactWatch) -> float:
    """How deep a surface lies in the solid of its obstacle, all of it and unseen; zero if it does not.

    Finite sliding looks for partners anew in every step, so a point without one is no mistake: it may
    come to meet the obstacle yet. But where all of a surface is in the solid from the beginning, and
    nothing of it finds what it could touch, the obstacle is taken for its own inverse. (With small
    sliding points that find nobody are refused.) A closed outline may offer its far side instead: its
    gaps are open, where the points are in the solid.
    """
    contact, pairing = track.contact, track.geometry.pairings[track.i]
    obstacle, surface = _shape(contact), contact.secondary
    outline, paired = obstacle.outline, pairing.paired
    known = contact.gap is not None or contact.adjust
    if paired.any() and (outline is None or known or np.any(pairing.gap[paired] <= 0)):
        return 0.0  # what overlaps is seen
    distance = signed_distance(obstacle, surface, surface.points)
    if outline is not None and np.any(abs(distance) >= abs(Rim.of(outline).beyond(surface.points))):
        return 0.0  # on which side of an open outline points beyond its ends are is not known
    noise = SOLVED * float(np.max(np.ptp(surface.points, axis=0)))
    deepest = -float(distance.min())
    return deepest if deepest > noise and np.all(distance <= noise) else 0.0


def in_solid_words(contact: Contact, depth: float) -> str:
    """Say that a surface lies in the solid of its obstacle, and what to do."""
    shape = _shape(contact)
    hollow = getattr(shape, "hollow", None)
    way = "turn the sign of its function" if hollow is None else f"give it hollow={not hollow}"
    if not getattr(shape, "closed", True):
        way = "give its points, or the corners of its triangles, the other way round"
    return (
        f"nothing touches. From the beginning all of {contact.secondary.label!r} lies where "
        f"{contact.primary.label!r} is solid{', which is round its hole' if hollow else ''}, by up to "
        f"{depth:.3g}, and finds nothing there that it could touch. If the body is meant to be on the "
        f"other side, {way}; else the obstacle is in the wrong place."
    )


def _shape(contact: Contact) -> Obstacle:
    primary = contact.primary
    assert isinstance(primary, Obstacle)
    return shape_of(primary)


# -- round tools between nodes --------------------------------------------------------------------


def pierced(surface: ContactSurface, bend: Array, gap: Array) -> tuple[float, Array] | None:
    """Return where a round tool stands in a facet none of whose nodes it touches, and how deep.

    Parameters
    ----------
    surface : ContactSurface
    bend : ndarray, shape (d, d)
        Of the obstacle.
    gap : ndarray, shape (m,)
        Of the answer, all open; `inf` without a partner [length].

    Returns
    -------
    (depth, place) or None
        If it stands in a facet by more than a fifth of its height over the facet.
    """
    if np.trace(bend) <= 0:  # planes and holes have no part that reaches between nodes
        return None
    chords = _pieces(surface)
    x = surface.points
    along = x[chords[:, 1]] - x[chords[:, 0]]
    rise = np.einsum("cd,de,ce->c", along, bend, along)
    # of sides that fit, such as a pin in a hole of many sides, the smooth boundaries count
    own = np.repeat(bends(surface)[0], len(along) // len(surface.facets), axis=0)
    rise = np.minimum(rise, rise + np.einsum("cd,cde,ce->c", along, own, along))
    found = np.isfinite(gap)[chords].all(axis=1) & (rise > 0)
    chords, rise = chords[found], rise[found]
    a, b = gap[chords].T
    between = np.abs(a - b) < 0.5 * rise  # the lowest place of the parabola
    if not between.any():
        return None
    a, b, rise, chords = a[between], b[between], rise[between], chords[between]
    depth = rise / 8 - 0.5 * (a + b) + 0.5 * (a - b) ** 2 / rise
    worst = first_largest(depth)
    if depth[worst] <= SAGITTA * rise[worst] / 8:
        return None
    part = 0.5 + (a[worst] - b[worst]) / rise[worst]
    return float(depth[worst]), (1 - part) * x[chords[worst, 0]] + part * x[chords[worst, 1]]


def _pieces(surface: ContactSurface) -> Index:
    """Nodes at the ends of chords between which there is no node, (c, 2)."""
    facets, kind, k = surface.facets, surface.kind, surface.kind.corners
    if kind.quadratic:  # along the edges; in the middle of a face there may be a node
        edges = [(i, k + i) for i in range(k)] + [(k + i, (i + 1) % k) for i in range(k)]
        pairs = [(0, 2), (2, 1)] if surface.dim == 2 else edges
    else:
        pairs = [(i, j) for j in range(k) for i in range(j)]
    return facets[:, pairs].reshape(-1, 2)


def pierced_words(surface: ContactSurface, depth: float, place: Array, label: str) -> str:
    """Say that a tool stands between nodes and presses on nothing, and what to do."""
    return (
        f"{label!r} stands in {surface.label!r} by {depth:.3g} at {written(place)}, between nodes that "
        "it does not touch, and presses on nothing: facets are too long for so light a contact. Refine "
        "the surface where the tool touches, to four nodes or more under it."
    )


# -- obstacles of triangles -----------------------------------------------------------------------


def leaning_faces(secondary: ContactSurface, outline: ContactSurface) -> Mask:
    """Large triangles that are no pieces of a curve, and whose normals lean nevertheless, shape (nf,).

    Larger than the faces that meet them: smaller ones are a bend themselves.

    Normals turn from a flat into a chamfer over a strip along the bend (`obstacles.faceted`). Forces on
    what stands there, and not on the flat, lean by up to half of the angle of the bend.
    A flat that turns alike at both ends, by less than 16 sides to a circle do, may be a piece of one.
    """
    size = float(np.median(secondary.lengths))
    corners = outline.facet_node_normals[:, : outline.kind.corners]
    off = np.linalg.norm(corners - outline.facet_normals[:, None], axis=2).max(axis=1)
    return kinked_edges(outline).any(axis=1) & (off > A_TENTH) & (outline.lengths > size)


def leaning_words(track: ContactWatch, result: Answer, u: Array) -> str:
    """Say what to say of forces that lean on flats of triangles; empty if they do not, or hardly.

    By displacements u (n,) that are right at the contact DOFs.
    """
    contact, part, state = track.contact, track.part, result.state
    surface, outline = contact.secondary, track.obstacle(result.case, u).outline
    assert outline is not None
    leaning = leaning_faces(surface, outline)
    force = np.where(state.status[part] != OPEN, np.abs(state.normal_force[part]), 0.0)
    if not (leaning.any() and force.any()):
        return ""
    pairing = node_to_segment(surface.moved(u[result.system.slice(surface.body)]), outline)
    on_flat = pairing.paired & leaning[np.where(pairing.paired, pairing.facet, 0)]
    facet = np.where(on_flat, pairing.facet, 0)
    off = (pairing.normal - outline.facet_normals[facet]) * (force * on_flat)[:, None]
    lean = float(np.linalg.norm(off.sum(axis=0)) / force.sum())
    if lean <= A_TENTH:
        return ""
    return (
        f"normals of {contact.primary.label!r} lean by {lean:.2g} rad in the mean from those of its "
        "triangles, which are large and flat beside bends of less than 45 degrees, and so do the "
        "forces. Along a bend normals turn over an eighth of a triangle; where that is too wide, "
        "round the bend by a fillet, or divide the long triangles, most of all near a tip."
    )
