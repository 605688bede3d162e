"""Flats of outlines and of surfaces made of triangles: cut beside the bends, where normals turn.

Normals are interpolated between the corners of an edge or a triangle, where they are averaged with its
neighbours unless they meet at a corner. On a piece of a curve or a curved surface that is
right. The flat of a tool with chamfers or fillets is none: over all of its few large facets forces
would lean by up to the angle of the bend. There normals turn over a narrow strip along the bend.
"""

from __future__ import annotations

from dataclasses import field
from functools import cached_property

import numpy as np
from scipy.sparse import coo_matrix, csr_matrix, identity, vstack
from scipy.sparse.csgraph import connected_components

from skfem_contact.arrays import Array, Index, Mask
from skfem_contact.bodies.normal_field import BENT, STEEPEST, bends, end_slopes
from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.digits import SINGLE, SOLVED
from skfem_contact.records import dataclass

#: Part of a flat edge, or of the height of a triangle, over which its normals turn towards a bend at
#: its end. Longer, and friction on flats leans by the bend; shorter, and points that pass it meet a
#: corner.
ROUNDED = 1 / 8
#: A piece of a curved surface bends to all sides: what is left of the sum of its bends, each along the
#: way across its edge, is less than this part of them. Beside one chamfer it is all of them.
ONE_SIDED = 0.8
#: A flat is wider than what it bends into, by more than neighbours differ on a curved surface.
WIDER = 4.0


def cut_edges(outline: ContactSurface) -> tuple[csr_matrix, Index] | None:
    """Short edges beside the smooth bends at the ends of straight ones.

    Returns
    -------
    weights : csr_matrix, shape (n, m)
        Of the points (m,), for the points of the edges, which are in order along the outline.
    edges : ndarray of int, shape (ne, 2)
        None where there is no flat beside a bend.
    """
    before, after = outline.neighbours.T
    own, there = outline.facet_normals, outline.facet_node_normals
    alike = np.abs(end_slopes(outline.points, outline.facets, there)).max(axis=1) > 0
    edge, side = np.nonzero(outline.neighbours >= 0)
    beside = outline.neighbours[edge, side]
    rim = np.asarray((outline.neighbours < 0).any(axis=1))
    curved = stand_for_curves(alike, rim, edge, beside, np.ones(len(edge), dtype=bool))
    # averaged with a neighbour, and not in line with it
    bent = np.linalg.norm(there - own[:, None], axis=2) > SOLVED
    cut = bent & ~curved[:, None]
    if not cut.any():
        return None
    # no longer than half of the chamfer
    room = np.minimum(ROUNDED, 0.5 * outline.lengths[outline.neighbours] / outline.lengths[:, None])
    nothing, closed = np.zeros(len(own)), before[0] >= 0
    at_end = (after < 0) & ~closed
    edge, which = np.nonzero(np.column_stack([nothing == 0, cut, at_end]))
    share = np.column_stack([nothing, room[:, 0], 1 - room[:, 1], nothing + 1])[edge, which]
    row, n = np.arange(len(edge)), len(edge)
    ends, parts = outline.facets[edge].T.ravel(), np.concatenate([1 - share, share])
    weights = csr_matrix((parts, (np.tile(row, 2), ends)), shape=(n, len(outline.points)))
    start = row if closed else row[:-1]
    return weights, np.column_stack([start, (start + 1) % n])


def stand_for_curves(alike: Mask, last: Mask, facet: Index, beside: Index, like: Mask) -> Mask:
    """Flat facets that are pieces of a curve or a curved surface; the others are meant to be flat.

    A flat between two chamfers turns alike to its sides, too, but has no like beside it.

    Parameters
    ----------
    alike : ndarray of bool, shape (n,)
        Facets that turn alike to all sides.
    last : ndarray of bool, shape (n,)
        Those that may be where a curve ends, if most of what is beside them is inside of it.
    facet, beside : ndarray of int, shape (p,)
        All pairs of neighbours, each in both orders.
    like : ndarray of bool, shape (p,)
        Pairs in which the first is not much wider than the second.
    """
    inner = alike & (np.bincount(facet, like & alike[beside], len(alike)) > 0)
    inside = np.bincount(facet, like & inner[beside], len(alike))
    return np.asarray(inner | last & (2 * inside > np.bincount(facet, minlength=len(alike))))


@dataclass(eq=False)
class Patches:
    """Triangles in one plane that join, and how a surface bends at their edges.

    Attributes
    ----------
    of : ndarray of int, shape (nf,)
        The patch of each triangle.
    bend : ndarray, shape (nf, 3)
        Angle across each edge; 0 within a patch, at rims, and at 45 degrees or more [rad].
    inside : ndarray of bool, shape (nf, 3)
        Edges within a patch.
    heights : ndarray, shape (nf, 3)
        Of the triangles over each of their edges [length].
    """

    surface: ContactSurface
    of: Index = field(init=False)
    bend: Array = field(init=False)
    inside: Mask = field(init=False)
    heights: Array = field(init=False)

    def __post_init__(self) -> None:
        surface = self.surface
        angle = bends(np.repeat(surface.facet_normals[:, None], 3, axis=1), surface.twins)
        self.bend = np.where(angle > BENT, angle, 0.0)
        self.inside = (surface.twins >= 0) & (self.bend == 0) & ~surface.sharp_edges
        one, edge = np.nonzero(self.inside)
        other = surface.twins[one, edge] // 3
        graph = coo_matrix((np.ones(len(one)), (one, other)), shape=(len(self.bend),) * 2)
        self.of = connected_components(graph, directed=False)[1].astype(np.intp)
        self.length = np.linalg.norm(self._along, axis=2)
        self.heights = 2 * surface.facet_areas[:, None] / self.length

    @property
    def _along(self) -> Array:
        x = self.surface.points[self.surface.facets]
        return np.roll(x, -1, axis=1) - x

    @cached_property
    def corners(self) -> Index:
        """Numbers of the corners of triangles, one for all corners of a patch at one point, (nf, 3)."""
        key = self.of[:, None] * len(self.surface.points) + self.surface.facets
        number = np.unique(key, return_inverse=True)[1]
        return np.asarray(number.reshape(key.shape), dtype=np.intp)

    def curved(self) -> Mask:
        """Triangles that stand for a piece of a curved surface, (nf,)."""
        count, f, e = int(self.of.max()) + 1, *np.nonzero(self.bend)
        patch, there = self.of[f], self.surface.twins[f, e] // 3
        turned = self.length[f, e] * self.bend[f, e]
        normal = self.surface.facet_normals
        out = np.cross(self._along[f, e], normal[f]) / self.length[f, e, None]
        outward = np.sign(np.einsum("ed,ed->e", out, normal[there]))
        sums = [np.bincount(patch, turned * outward * part, count) for part in out.T]
        turning = np.bincount(patch, turned, count)
        steepest = np.zeros(count)
        np.maximum.at(steepest, patch, self.bend[f, e])
        # with fewer than 16 sides to the circle edges are meant
        gentle = (steepest > 0) & (steepest <= 2 * np.arctan(STEEPEST))
        alike = gentle & (np.linalg.norm(sums, axis=0) <= ONE_SIDED * turning)
        border = np.bincount(patch, self.length[f, e], count)
        area = np.bincount(self.of, self.surface.facet_areas, count)
        width = np.divide(2 * area, border, out=np.full(count, np.inf), where=border > 0)

        other = self.of[there]
        like = width[patch] <= WIDER * width[other]
        # where a curved surface ends, and among slivers, it bends to one side
        return np.asarray(stand_for_curves(alike, gentle, patch, other, like)[self.of])


def cut_triangles(surface: ContactSurface) -> tuple[csr_matrix, Index] | None:
    """Narrow triangles along the bends beside flats.

    Returns
    -------
    weights : csr_matrix, shape (n, m)
        Of the points (m,), for the points of the triangles; the first m are the points themselves.
    triangles : ndarray of int, shape (nt, 3)
        None where there is no flat beside a bend.
    """
    patches = Patches(surface)
    if not patches.bend.any():
        return None
    straight = ~patches.curved()
    leans = _leaning(patches) & straight[:, None]
    if not leans.any():
        return None
    return _Cut(patches, leans).cut()


def _leaning(patches: Patches) -> Mask:
    """Corners of triangles where the normal is not that of their patch, (nf, 3)."""
    surface = patches.surface
    off = surface.facet_node_normals[:, :3] - surface.facet_normals[:, None]
    leans = np.linalg.norm(off, axis=2) > 0.5 * BENT
    corner = patches.corners
    return np.asarray(np.bincount(corner.ravel(), leans.ravel())[corner] > 0)


class _Cut:
    """The cutting of all triangles with a corner that leans.

    What is left of a triangle in the middle has the normal of the flat. Along each edge where the patch
    ends there is a strip; within the patch, edges are divided near the corners that lean, alike from
    both sides.
    """

    def __init__(self, patches: Patches, leans: Mask) -> None:
        self.patches, self.leans = patches, leans
        self.facets, self.m = patches.surface.facets, len(patches.surface.points)
        self.share = self._shares()
        self.rows: list[tuple[list[int], list[float]]] = []
        self.known: dict[tuple[int, int, int], int] = {}
        self.made: list[list[int]] = []

    def _shares(self) -> Array:
        """Part of the way from each corner of a triangle that strips end at, (nf, 3)."""
        patches, corner = self.patches, self.patches.corners
        f, e = np.nonzero(patches.bend)
        beyond = patches.heights.ravel()[patches.surface.twins[f, e]]
        most = np.full(corner.max() + 1, ROUNDED)
        for end in (e, (e + 1) % 3):  # no wider than half of the chamfer
            np.minimum.at(most, corner[f, end], 0.5 * beyond / patches.heights[f, e])
        # triangles beside slivers keep a height, in the digits of a file as well
        return np.asarray(np.maximum(most, SINGLE)[corner])

    def cut(self) -> tuple[csr_matrix, Index]:
        """See `cut_triangles`."""
        some = self.leans.any(axis=1)
        for f in np.flatnonzero(some).tolist():
            self._triangle(f)
        row = np.repeat(np.arange(len(self.rows)), [len(at) for at, _ in self.rows])
        column = np.concatenate([at for at, _ in self.rows])
        value = np.concatenate([parts for _, parts in self.rows])
        new = csr_matrix((value, (row, column)), shape=(len(self.rows), self.m))
        triangles = np.vstack([self.facets[~some], np.array(self.made, dtype=self.facets.dtype)])
        return csr_matrix(vstack([identity(self.m), new])), triangles

    def _point(self, at: list[int], parts: list[float]) -> int:
        self.rows.append((at, parts))
        return self.m + len(self.rows) - 1

    def _on_edge(self, f: int, i: int, j: int) -> int:
        """The point of an edge within a patch near corner i of a triangle, on the way to corner j."""
        a, b = int(self.facets[f, i]), int(self.facets[f, j])
        key = int(self.patches.of[f]), a, b
        if key not in self.known:
            share = float(self.share[f, i])
            self.known[key] = self._point([a, b], [1 - share, share])
        return self.known[key]

    def _triangle(self, f: int) -> None:
        corners, inside = self.facets[f].tolist(), self.patches.inside[f].tolist()
        leans = self.leans[f].tolist()
        # edges with a strip: those where the patch ends, if a normal leans at one of their ends
        strip = [not inside[e] and (leans[e] or leans[(e + 1) % 3]) for e in range(3)]
        middle: list[int] = []  # what is left
        first, last = [0, 0, 0], [0, 0, 0]  # its corners on the ways there and on
        for i in range(3):
            before, after = (i + 2) % 3, (i + 1) % 3
            if not leans[i]:
                mine = [corners[i]]
            elif strip[before] and strip[i]:
                s = float(self.share[f, i])
                mine = [self._point([corners[i], corners[before], corners[after]], [1 - 2 * s, s, s])]
            elif strip[before] or strip[i]:
                mine = [self._on_edge(f, i, after if strip[before] else before)]
            else:
                mine = [self._on_edge(f, i, before), self._on_edge(f, i, after)]
                self.made.append([corners[i], mine[1], mine[0]])
            first[i], last[i] = mine[0], mine[-1]
            middle += mine
        self._fan(middle)
        for e in range(3):
            if strip[e]:
                j = (e + 1) % 3
                around = [corners[e], corners[j], first[j], last[e]]
                self._fan(list(dict.fromkeys(around)))

    def _fan(self, around: list[int]) -> None:
        """Triangles of a convex polygon."""
        for k in range(1, len(around) - 1):
            self.made.append([around[0], around[k], around[k + 1]])
