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
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skfem_contact.assemblies.thresholds import NEARLY, OPPOSITE, TOWARDS_RIM, UNSURE
from skfem_contact.bodies.body import Body
from skfem_contact.bodies.facet_kinds import node_positions
from skfem_contact.bodies.normals import across, sizes, unit
from skfem_contact.bodies.pieces import pieces as pieces_of
from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.digits import COMPUTED, GIVEN
from skfem_contact.pairing.search import FacetTree, Nodes
from skfem_contact.pairing.vectors import dot, ragged
from skfem_contact.records import dataclass

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Mask = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Sights:
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

    @classmethod
    def from_facets(
        cls, surfaces: Sequence[ContactSurface], numbers: Index, some: list[Index], rim: bool
    ) -> Sights:
        """From the middles of some facets of each surface, or from places near their rim.

        `numbers` are those of the first facets of the surfaces.
        """
        columns: list[tuple[Array, ...]] = []
        for surface, facets, first in zip(surfaces, some, numbers, strict=False):
            at, normal, bulge = _places(surface, facets, rim)
            of = np.repeat(facets + first, bulge.shape[1])
            d = surface.dim
            columns.append((at.reshape(-1, d), normal.reshape(-1, d), bulge.ravel(), of))
        return cls(*(np.concatenate(column) for column in zip(*columns, strict=True)))

    def some(self, which: Index) -> Sights:
        """Some of these places."""
        return Sights(*(part.take(which, axis=0) for part in vars(self).values()))


@dataclass(frozen=True, eq=False)
class Boundaries:
    """The boundaries of all bodies: their facets one after the other, and the patches these make.

    A patch is what hangs together without a corner (`ContactSurface.sharp_edges`).

    Attributes
    ----------
    surfaces : tuple of ContactSurface
        The whole boundary of each body.
    first : ndarray of int, shape (number of bodies + 1,)
        Numbers of the facets with which they begin.
    body, piece, patch : ndarray of int, shape (nf,)
        Of each facet: the body, the connected part of the mesh, and the patch.
    rim : ndarray of bool, shape (nf,)
        Facets on the rim of their patch.
    middles : Sights
        From the middle of each facet.
    lower, upper : ndarray, shape (nf, d)
        Boxes around the nodes of facets.
    """

    surfaces: tuple[ContactSurface, ...]
    first: Index
    body: Index
    piece: Index
    patch: Index
    rim: Mask
    middles: Sights
    lower: Array
    upper: Array

    @classmethod
    def of(cls, bodies: Sequence[Body]) -> Boundaries:
        """Take the boundaries of bodies, and cut them into patches."""
        surfaces = tuple(body.surface(None, name="boundary") for body in bodies)
        counts = [len(surface.facets) for surface in surfaces]
        first = np.concatenate([[0], np.cumsum(counts)])
        pieces, patches, rims = [], [], []
        for body, surface in zip(bodies, surfaces, strict=True):
            smooth = (surface.twins >= 0) & ~surface.sharp_edges
            joined = np.array([np.nonzero(smooth)[0], surface.neighbours[smooth]])
            patches.append(pieces_of(joined, len(smooth)))
            piece = pieces_of(surface.facets.T, len(surface.points))[surface.facets[:, 0]]
            if piece.any():  # around a hollow, or of another part
                mesh = body.basis.mesh
                piece = pieces_of(mesh.t, mesh.nvertices)[mesh.facets[0, surface.mesh_facets]]
            pieces.append(piece)
            rims.append(~smooth.all(axis=1))
        return cls(
            surfaces,
            first,
            np.repeat(np.arange(len(surfaces)), counts),
            _apart(pieces),
            _apart(patches),
            np.concatenate(rims),
            Sights.from_facets(surfaces, first, [*map(np.arange, counts)], rim=False),
            *(np.concatenate(ends) for ends in zip(*map(_boxes, surfaces), strict=True)),
        )

    @cached_property
    def boxes(self) -> tuple[Array, Array]:
        """Around the bodies, lower and upper corners, (number of bodies, d) each."""
        start = self.first[:-1]
        return np.minimum.reduceat(self.lower, start), np.maximum.reduceat(self.upper, start)

    def near_others(self, reach: float) -> list[Index]:
        """Facets of each surface with a node in the box of another body, `reach` larger."""
        found, boxes = [], self.boxes
        low, high = boxes[0] - reach, boxes[1] + reach
        for i, (first, last) in enumerate(pairwise(self.first)):
            lower, upper = self.lower[first:last], self.upper[first:last]
            close = np.all((boxes[1][i] >= low) & (boxes[0][i] <= high), axis=1)
            # parts of one body may touch as well: then all of it is asked
            close[i] = np.ptp(self.piece[first:last]) > 0
            near = np.zeros(len(lower), dtype=bool)
            for k in np.flatnonzero(close):
                near |= np.all((upper >= low[k]) & (lower <= high[k]), axis=1)
            found.append(np.flatnonzero(near))
        return found


@dataclass(frozen=True, eq=False)
class Pieces:
    """Lines or triangles between the nodes of facets, and a tree over these facets.

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

    corners: Array
    normals: Array
    area: Array
    dual: Array
    of: Index
    first: Index
    count: Index
    tree: FacetTree

    @classmethod
    def cut(cls, bounds: Boundaries, near: list[Index]) -> Pieces:
        """Cut some facets of each surface into pieces."""
        d, every = bounds.surfaces[0].dim, numbered(bounds, near)
        corners, normals, count = [], [], []
        for surface, some in zip(bounds.surfaces, near, strict=True):
            kind, facets = surface.kind, surface.facets[some]
            pieces = np.array(kind.parts) if kind.dim == 1 else kind.cut
            corners.append(surface.points.take(facets[:, pieces], axis=0).reshape(-1, d, d))
            normals.append(_smooth_normals(surface, some).take(pieces, axis=1).reshape(-1, d, d))
            count.append(np.full(len(some), len(pieces)))
        x, counts = np.concatenate(corners), np.concatenate(count)
        edges = x[:, 1:] - x[:, :1]
        dual = np.linalg.solve(edges @ edges.transpose(0, 2, 1), edges)
        tree = FacetTree.over(bounds.lower[every], bounds.upper[every])
        known = np.concatenate(normals), across(edges), dual, np.repeat(every, counts)
        return cls(x, *known, np.cumsum(counts) - counts, counts, tree)


def numbered(bounds: Boundaries, some: list[Index]) -> Index:
    """Facets of each surface by the numbers of all boundaries."""
    return np.concatenate([mine + first for mine, first in zip(some, bounds.first, strict=False)])


def _apart(parts: list[Index]) -> Index:
    """Numbers of pieces of each surface, no two of them alike."""
    starts = np.cumsum([0, *(part.max() + 1 for part in parts)])
    return np.concatenate([part + start for part, start in zip(parts, starts, strict=False)])


def _boxes(surface: ContactSurface) -> tuple[Array, Array]:
    x = node_positions(surface.points, surface.facets)
    return x.min(axis=1), x.max(axis=1)


def _places(surface: ContactSurface, facets: Any, rim: bool) -> tuple[Array, Array, Array]:
    """Places on facets (n, q, d), normals there, and how far the boundary stands out, (n, q)."""
    kind = surface.kind
    xi = kind.middle[None]
    if rim:
        ends = kind.locations[: kind.corners]
        around = (
            ends if kind.dim == 1 else np.concatenate([ends, (ends + np.roll(ends, 1, axis=0)) / 2])
        )
        xi = xi + TOWARDS_RIM * (around - xi)
    N, dN = kind.shapes(xi)
    nodes = node_positions(surface.points, surface.facets[facets])
    at = np.einsum("qk,fkd->fqd", N, nodes)
    normal = unit(across(np.einsum("qki,fkd->fqid", dN, nodes)))
    if kind.quadratic:  # facets with middle nodes are the boundary themselves
        return at, normal, np.zeros(at.shape[:2])
    away = nodes[:, None] - at[:, :, None]
    bulge = 0.5 * np.einsum("qk,fqkd,fkd->fq", N, away, _smooth_normals(surface, facets))
    return at, normal, bulge


def _smooth_normals(surface: ContactSurface, facets: Any) -> Array:
    """Normals of the smooth boundary at the nodes of facets, (n, k, d); their own beside a kink."""
    averaged = surface.facet_node_normals[facets]
    if not surface.kinks.any():
        return averaged
    kinked = surface.kinks[surface.facets[facets]] > 0
    own = surface.facet_normals[facets][:, None]
    return np.where(kinked[..., None], own, averaged)


@dataclass(frozen=True, eq=False)
class Views:
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
    if not any(map(len, near)):
        return Views(*(np.zeros(0, dtype=np.intp),) * 2, *(np.zeros(0),) * 2)
    pieces = Pieces.cut(bounds, near)
    middles = _seen(bounds, bounds.middles.some(numbered(bounds, near)), pieces, reach)
    # where the middle sees nothing near, other places may
    blind = np.ones(len(bounds.body), dtype=bool)
    blind[middles.facet[np.abs(middles.gap) <= within]] = False
    rest = [some[blind[some + first]] for some, first in zip(near, bounds.first, strict=False)]
    around = Sights.from_facets(bounds.surfaces, bounds.first, rest, rim=True)
    others = _seen(bounds, around, pieces, reach)
    both = zip(vars(middles).values(), vars(others).values(), strict=True)
    return Views(*(np.concatenate(pair) for pair in both))


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
    for item, facet in pieces.tree.descend(len(sights.of), met, _together(sights, pieces, reach)):
        count = pieces.count[facet]
        piece = ragged(pieces.first[facet], count)
        found.append(_crossings(sights, pieces, np.repeat(item, count), piece, reach))
    item, piece, distance, bulge, facing = (np.concatenate(c) for c in zip(*found, strict=True))
    mine, other = sights.of[item], pieces.of[piece]
    partner = (facing > OPPOSITE) & (bounds.piece[mine] != bounds.piece[other])
    views = []
    for ahead in (distance >= -scale, distance <= scale):
        some = np.flatnonzero(ahead)
        # of what is equally near a partner comes first
        far = np.where(np.abs(distance[some]) <= scale, 0.0, np.abs(distance[some]))
        order = some[np.lexsort((~partner[some], far, item[some]))]
        first = order[np.append(True, np.diff(item[order]) > 0)[: len(order)]]
        views.append(first[partner[first]])
    # outward and inward: the nearer one
    both = np.concatenate(views)
    order = both[np.lexsort((np.abs(distance[both]), item[both]))]
    best = order[np.append(True, np.diff(item[order]) > 0)[: len(order)]]
    own = sights.bulge[item[best]]
    slack = UNSURE * (np.abs(own) + np.abs(bulge[best])) + scale
    return Views(mine[best], other[best], distance[best] - own - bulge[best], slack)


def _together(sights: Sights, pieces: Pieces, reach: float) -> tuple[int, Index, Index]:
    """Where sights begin to descend: what nodes that hold them, and few others, have near them."""
    levels, order = pieces.tree.levels, pieces.tree.order
    level = len(levels) // 4  # of a hundred thousand facets sixteen go together
    held = levels[level]

    def close(own: Index, nodes: Nodes) -> Mask:
        away = nodes.centre - held.centre.take(own, axis=0)
        limit = nodes.radius + held.radius.take(own) + reach
        return np.asarray(dot(away, away) <= limit**2)

    pairs = FacetTree(levels[level:], None).descend(len(held.radius), close)
    own, node = (np.concatenate(c) for c in zip(*pairs, strict=True))
    # sights by the nodes that hold their facets
    facet = np.searchsorted(pieces.of[pieces.first], sights.of)
    holder = (facet if order is None else np.argsort(order)[facet]) >> level
    order = np.argsort(holder, kind="stable")
    count = np.bincount(holder, minlength=len(held.radius))
    item = order[ragged((np.cumsum(count) - count)[own], count[own])]
    return level, item, np.repeat(node, count[own])


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
