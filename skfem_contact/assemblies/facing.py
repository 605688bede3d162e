r"""Where boundaries of bodies face each other: lines of sight along normals, both ways.

Every facet looks along its normal, outwards for what it may touch and inwards for what it overlaps. Of
all that a line of sight meets the nearest counts, whatever it is: what stands behind something else, or
behind the body's own material, is no partner. A partner looks back, `OPPOSITE`.

Facets are chords of curved boundaries. How far the smooth boundary stands out at a place is known by
the normals n_k at the nodes x_k (half of the height of the tangents, exact on parabolas)::

    b(x) = 1/2 sum_k N_k (x_k - x) . n_k            gap = distance - b(x) - b(y)

so a shank in a bore of equal radius has no gap, however coarse the two meshes are.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from skfem_contact.arrays import Array, Index, Mask, across, dot, ragged, sizes, unit
from skfem_contact.bodies.body import Body
from skfem_contact.bodies.facet_kinds import node_positions
from skfem_contact.bodies.selection import pieces as pieces_of
from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.digits import COMPUTED, GIVEN
from skfem_contact.pairing.search import FacetTree, Nodes

# Least cosine between a normal and the opposite of the other: half a right angle, beyond which two
# surfaces stand beside each other rather than opposite.
OPPOSITE = float(np.cos(np.pi / 4))

# Where a facet is asked beside its middle: this part of the way to its corners and the middles of its
# edges. There themselves lines of sight run along edges, and would find what lies beside.
TOWARDS_RIM = 0.85

# Which part of the chord heights of two facets a gap may be wrong by: a ball comes nearer between the
# places that are asked by .2 of a facet off, .16 of the height; at rims half of a height is missing.
UNSURE = 0.25

# What is farther apart than `within`, but not than this times it, is told as near and not taken.
NEARLY = 2.0


class Sights(NamedTuple):
    """Places on facets that look along normals.

    Attributes
    ----------
    at, normal : ndarray, shape (n, d)
    bulge : ndarray, shape (n,)
        How far the smooth boundary stands out of the facet there [length].
    of : ndarray of int, shape (n,)
        Facets, by the numbers of all boundaries.
    """

    at: Array
    normal: Array
    bulge: Array
    of: Index


class Boundaries:
    """The boundaries of all bodies: their facets one after the other, and the patches these make.

    A patch is what hangs together without a corner (`ContactSurface.sharp_edges`).

    Attributes
    ----------
    surfaces : list of ContactSurface
        The whole boundary of each body.
    first : ndarray of int, shape (number of bodies + 1,)
        Numbers of the facets with which they begin.
    body, piece, patch : ndarray of int, shape (nf,)
        Of each facet: the body, the connected part of the mesh, and the patch.
    rim : ndarray of bool, shape (nf,)
        Facets on the rim of their patch.
    lower, upper : ndarray, shape (nf, d)
        Boxes around the nodes of facets.
    low, high : ndarray, shape (number of bodies, d)
        Boxes around bodies.
    middles : Sights
        From the middle of each facet.
    """

    def __init__(self, bodies: Sequence[Body]) -> None:
        self.surfaces = [body.surface(None, name="boundary") for body in bodies]
        counts = [len(surface.facets) for surface in self.surfaces]
        self.first = np.concatenate([[0], np.cumsum(counts)])
        self.body = np.repeat(np.arange(len(counts)), counts)
        pieces, patches, rims, boxes = [], [], [], []
        for body, surface in zip(bodies, self.surfaces, strict=True):
            smooth = (surface.twins >= 0) & ~surface.sharp_edges
            joined = np.array([np.nonzero(smooth)[0], surface.neighbours[smooth]])
            patches.append(pieces_of(joined, len(smooth)))
            piece = pieces_of(surface.facets.T, len(surface.points))[surface.facets[:, 0]]
            if piece.any():  # around a hollow, or of another part
                mesh = body.basis.mesh
                piece = pieces_of(mesh.t, mesh.nvertices)[mesh.facets[0, surface.mesh_facets]]
            pieces.append(piece)
            rims.append(~smooth.all(axis=1))
            x = node_positions(surface.points, surface.facets)
            boxes.append((x.min(axis=1), x.max(axis=1)))
        self.piece, self.patch, self.rim = _apart(pieces), _apart(patches), np.concatenate(rims)
        self.lower, self.upper = map(np.concatenate, zip(*boxes, strict=True))
        self.low = np.minimum.reduceat(self.lower, self.first[:-1])
        self.high = np.maximum.reduceat(self.upper, self.first[:-1])
        self.middles = self.sights(self.body >= 0, rim=False)

    def by_surface(self, which: Mask) -> list[Index]:
        """Facets by their places in each surface, from a mask over all, (nf,)."""
        return [*map(np.flatnonzero, np.split(which, self.first[1:-1]))]

    def sights(self, which: Mask, rim: bool) -> Sights:
        """From the middles of some facets, or from places near their rim."""
        columns: list[tuple[Array, ...]] = []
        for surface, facets, first in zip(
            self.surfaces, self.by_surface(which), self.first, strict=False
        ):
            kind, d, xi = surface.kind, surface.dim, surface.kind.middle[None]
            if rim:
                ends = kind.locations[: kind.corners]
                edges = [(ends + np.roll(ends, 1, axis=0)) / 2] if d == 3 else []
                xi = xi + TOWARDS_RIM * (np.concatenate([ends, *edges]) - xi)
            N, dN = kind.shapes(xi)
            nodes = node_positions(surface.points, surface.facets[facets])
            at = np.einsum("qk,fkd->fqd", N, nodes)
            normal = unit(across(np.einsum("qki,fkd->fqid", dN, nodes)))
            bulge = np.zeros(len(facets) * len(xi))
            if not kind.quadratic:  # facets with middle nodes are the boundary themselves
                away = nodes[:, None] - at[:, :, None]
                smooth = _smooth_normals(surface, facets)
                bulge = 0.5 * np.einsum("qk,fqkd,fkd->fq", N, away, smooth).ravel()
            of = np.repeat(facets + first, len(xi))
            columns.append((at.reshape(-1, d), normal.reshape(-1, d), bulge, of))
        return Sights(*map(np.concatenate, zip(*columns, strict=True)))

    def near_others(self, reach: float) -> Mask:
        """Facets with a node in the box of another body, `reach` larger, (nf,)."""
        near = np.zeros(len(self.body), dtype=bool)
        low, high = self.low - reach, self.high + reach
        for i, mine in enumerate(map(slice, self.first[:-1], self.first[1:])):
            close = np.all((self.high[i] >= low) & (self.low[i] <= high), axis=1)
            # parts of one body may touch as well: then all of it is asked
            close[i] = np.ptp(self.piece[mine]) > 0
            for k in np.flatnonzero(close):
                inside = (self.upper[mine] >= low[k]) & (self.lower[mine] <= high[k])
                near[mine] |= np.all(inside, axis=1)
        return near


class Pieces:
    """Lines or triangles between the nodes of facets near others, (nf,), and a tree over these facets.

    Attributes
    ----------
    corners : ndarray, shape (n, d, d)
    normals : ndarray, shape (n, d, d)
        Of the smooth boundary at the corners.
    area : ndarray, shape (n, d)
        Their own outward normals, as long as their size.
    dual : ndarray, shape (n, d-1, d)
        ``dual @ (x - x_0)`` are the last barycentric coordinates of x.
    of : ndarray of int, shape (n,)
        The facets that they are parts of, by the numbers of all boundaries.
    first, count : ndarray of int, shape (facets of the tree,)
        The pieces of each facet of the tree.
    tree : FacetTree
    """

    def __init__(self, bounds: Boundaries, near: Mask) -> None:
        found: list[tuple[Array, ...]] = []
        for surface, some in zip(bounds.surfaces, bounds.by_surface(near), strict=True):
            kind, d, facets = surface.kind, surface.dim, surface.facets[some]
            pieces = np.array(kind.parts) if kind.dim == 1 else kind.cut
            corners = surface.points.take(facets[:, pieces], axis=0).reshape(-1, d, d)
            normals = _smooth_normals(surface, some).take(pieces, axis=1).reshape(-1, d, d)
            found.append((corners, normals, np.full(len(some), len(pieces))))
        self.corners, self.normals, self.count = map(np.concatenate, zip(*found, strict=True))
        edges = self.corners[:, 1:] - self.corners[:, :1]
        self.area = across(edges)
        self.dual = np.linalg.solve(edges @ edges.transpose(0, 2, 1), edges)
        self.of = np.repeat(np.flatnonzero(near), self.count)
        self.first = np.cumsum(self.count) - self.count
        self.tree = FacetTree.over(bounds.lower[near], bounds.upper[near])


def _apart(parts: list[Index]) -> Index:
    """Numbers of pieces of each surface, no two of them alike."""
    starts = np.cumsum([0, *(part.max() + 1 for part in parts)])
    return np.concatenate([part + start for part, start in zip(parts, starts, strict=False)])


def _smooth_normals(surface: ContactSurface, facets: Any) -> Array:
    """Normals of the smooth boundary at the nodes of facets, (n, k, d); their own beside a kink."""
    averaged = surface.facet_node_normals[facets]
    if not surface.kinks.any():
        return averaged
    kinked = surface.kinks[surface.facets[facets]] > 0
    own = surface.facet_normals[facets][:, None]
    return np.where(kinked[..., None], own, averaged)


class Views(NamedTuple):
    """What facets see: the nearest facet of all along each line of sight, where it looks back.

    Attributes
    ----------
    facet, seen : ndarray of int, shape (n,)
        By the numbers of all boundaries.
    gap : ndarray, shape (n,)
        Between the smooth boundaries; negative where they overlap [length].
    slack : ndarray, shape (n,)
        By how much the gap may be wrong [length].
    """

    facet: Index
    seen: Index
    gap: Array
    slack: Array


def look(bounds: Boundaries, within: float) -> Views:
    """Return what the facets of all bodies see of others, up to `NEARLY` times a distance both ways."""
    # distances of chords are larger than those of the boundary
    reach = NEARLY * within + 2 * float(np.abs(bounds.middles.bulge).max())
    near = bounds.near_others(reach)
    if not near.any():
        return Views(*(np.zeros(0, dtype=np.intp),) * 2, *(np.zeros(0),) * 2)
    pieces = Pieces(bounds, near)
    at, normal, bulge, of = bounds.middles
    some = Sights(at[near], normal[near], bulge[near], of[near])
    middles = _seen(bounds, some, pieces, reach)
    # where the middle sees nothing near, other places may
    near[middles.facet[np.abs(middles.gap) <= within]] = False
    others = _seen(bounds, bounds.sights(near, rim=True), pieces, reach)
    both: Any = zip(middles, others, strict=True)
    return Views(*map(np.concatenate, both))


def _seen(bounds: Boundaries, sights: Sights, pieces: Pieces, reach: float) -> Views:
    """Return what is nearest along each line of sight, either way."""
    scale = COMPUTED * max(float(np.abs(bounds.lower).max()), float(np.abs(bounds.upper).max()))

    def met(item: Index, nodes: Nodes) -> Mask:
        away = nodes.centre - sights.at.take(item, axis=0)
        normal = sights.normal.take(item, axis=0)
        along = dot(away, normal)
        aside = dot(away, away) - along**2
        limit = nodes.radius
        return np.asarray((np.abs(along) <= reach + limit) & (aside <= limit**2))

    found: list[tuple[Any, ...]] = [(np.zeros(0, dtype=np.intp),) * 2 + (np.zeros(0),) * 3]
    for item, facet in pieces.tree.descend(len(sights.of), met):
        count = pieces.count[facet]
        piece = ragged(pieces.first[facet], count)
        found.append(_crossings(sights, pieces, np.repeat(item, count), piece, reach))
    item, piece, distance, bulge, facing = (np.concatenate(c) for c in zip(*found, strict=True))
    mine, other = sights.of[item], pieces.of[piece]
    partner = (facing > OPPOSITE) & (bounds.piece[mine] != bounds.piece[other])
    far = np.where(np.abs(distance) <= scale, 0.0, np.abs(distance))

    def nearest(some: Index, *keys: Array) -> Index:
        order = some[np.lexsort((*(key[some] for key in keys), item[some]))]
        return np.asarray(order[np.append(True, np.diff(item[order]) > 0)[: len(order)]])

    # of what is equally near a partner comes first
    ways = distance >= -scale, distance <= scale
    ends = np.concatenate([nearest(np.flatnonzero(way), ~partner, far) for way in ways])
    # outward and inward: the nearer one
    best = nearest(ends[partner[ends]], np.abs(distance))
    own = sights.bulge[item[best]]
    slack = UNSURE * (np.abs(own) + np.abs(bulge[best])) + scale
    return Views(mine[best], other[best], distance[best] - own - bulge[best], slack)


def _crossings(
    sights: Sights, pieces: Pieces, item: Index, piece: Index, reach: float
) -> tuple[Any, ...]:
    """Lines of sight and the pieces that they cross, with distance, bulge and how these face."""
    apart = sights.of[item] != pieces.of[piece]
    item, piece = item[apart], piece[apart]
    # `take` gathers rows in a fraction of the time of an index
    at, normal = (part.take(item, axis=0) for part in (sights.at, sights.normal))
    tables = pieces.area, pieces.corners, pieces.dual
    area, corners, dual = (part.take(piece, axis=0) for part in tables)
    across_it = dot(area, normal)
    there = np.abs(across_it) > GIVEN * sizes(area)
    distance = dot(area, corners[:, 0] - at) / np.where(there, across_it, 1.0)
    place = at + distance[:, None] * normal
    rest = np.einsum("nij,nj->ni", dual, place - corners[:, 0])
    shape = np.column_stack([1 - rest.sum(axis=1), rest])
    there &= (shape.min(axis=1) >= -GIVEN) & (np.abs(distance) <= reach)
    some = np.flatnonzero(there)
    away = corners[some] - place[some][:, None]
    bulge = 0.5 * np.einsum("nk,nkd,nkd->n", shape[some], away, pieces.normals[piece[some]])
    facing = -across_it[some] / sizes(area[some])
    return item[some], piece[some], distance[some], bulge, facing
