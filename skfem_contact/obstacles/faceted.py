"""Rigid obstacles of straight facets: `RigidPolyline`, an outline; `RigidSurface`, triangles in space.

What they do as obstacles is that of `obstacle.Faceted`; their flats are cut beside the bends, where
normals turn. Normals are interpolated between the corners of an edge or a triangle, where they are
averaged with its neighbours unless they meet at a corner. On a piece of a curve or a curved
surface that is right. The flat of a tool with chamfers or fillets is none: over all of its few large
facets forces would lean by up to the angle of the bend. There normals turn over a narrow strip along
the bend.
"""

from __future__ import annotations

from dataclasses import field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import coo_matrix, csr_matrix, identity, vstack
from scipy.sparse.csgraph import connected_components

from skfem_contact.arguments import (
    check_name,
    check_switch,
    file_path,
    number,
    numbers,
    shown,
    take,
    with_known_keywords,
)
from skfem_contact.arrays import Array, Index, Mask, cross, sizes
from skfem_contact.bodies.facet_kinds import area_vectors
from skfem_contact.bodies.normal_field import BENT, STEEPEST, bends, end_slopes, twin_edges
from skfem_contact.bodies.selection import written
from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.digits import COMPUTED, ROUND_OFF, SINGLE, SOLVED
from skfem_contact.errors import InputError
from skfem_contact.obstacles.obstacle import Faceted, volume
from skfem_contact.pairing.search import FacetTree, Nodes
from skfem_contact.records import dataclass, sealed
from skfem_contact.trees import pairs_within

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


@with_known_keywords()
@dataclass(frozen=True, eq=False, init=False)
class RigidPolyline(Faceted):
    """A rigid obstacle in the plane with straight edges between points.

    Surfaces find their partners on it as they do on meshes: normals are continuous where edges meet
    at 22.5 degrees at most; else there is a corner, which also presses between two nodes. Corners of
    the body meet its edges. Edges that turn alike at both ends, two of them at least, stand for a
    curve, and normals turn all along them. Other edges are straight, such as a flat beside a fillet:
    normals turn within an eighth of them at such ends.

    Parameters
    ----------
    points : array, shape (n, 2)
        In order along the outline, with the solid on the left; of a closed one in either direction.
        It is closed if the first point is repeated at the end [length].
    closed : bool, optional
        Whether it goes back from the last point to the first.
    hollow : bool, optional
        Of a closed one: the body is inside.
    name : str, optional

    Raises
    ------
    InputError
        Too few points, edges without length, outlines that cross themselves.

    Notes
    -----
    Beyond the ends of an open polyline there is nothing to meet: where its end may touch, close it.

    Examples
    --------
    A wedge that points downwards:

    >>> wedge = RigidPolyline([(0, 0), (1, 2), (-1, 2)], closed=True, name="wedge")
    >>> wedge.moved((0.0, -0.5)).points.tolist()
    [[0.0, -0.5], [1.0, 1.5], [-1.0, 1.5]]
    >>> wedge.signed_distance([(0.0, 1.5), (0.0, -1.0)]).round(6).tolist()
    [-0.5, 1.0]
    """

    points: Array
    closed: bool = False
    hollow: bool = False
    name: str | None = None
    _kind = "rigid polyline"
    _cut_flats = staticmethod(cut_edges)

    def __init__(
        self, points: ArrayLike, closed: bool = False, hollow: bool = False, name: str | None = None
    ) -> None:
        take(self, points=points, closed=closed, hollow=hollow, name=name)

    def __post_init__(self) -> None:
        check_name(self.name, "name of a RigidPolyline")
        for key in ("closed", "hollow"):
            check_switch(getattr(self, key), f"RigidPolyline: {key}")
        points, closed = _points(self.points, self.closed, self.label)
        if self.hollow and not closed:
            raise InputError(
                f"hollow=True of {self.label!r}: an open polyline has no inside; list its points with "
                "the solid on the left"
            )
        _check_edges(points, closed, self.label)
        vars(self).update(points=sealed(points), closed=closed)
        if closed and (volume(points, self.facets) < 0) != self.hollow:
            vars(self).update(points=sealed(points[::-1].copy()))

    @property
    def facets(self) -> Index:
        """Its edges by the numbers of their points, in order, (ne, 2)."""
        count = len(self.points)
        start = np.arange(count if self.closed else count - 1)
        return np.column_stack([start, (start + 1) % count])


def _points(given: Any, closed: bool, label: str) -> tuple[Array, bool]:
    usage = "give at least 2 finite points (n, 2), 3 of a closed polyline"
    points = numbers(given, f"points of {label!r}", usage)
    if points.ndim == 2 and len(points) > 1 and np.array_equal(points[0], points[-1]):
        points, closed = points[:-1], True
    shape = points.ndim == 2 and points.shape[1:] == (2,) and len(points) >= (3 if closed else 2)
    if not shape or not np.isfinite(points).all():
        raise InputError(f"points of {label!r} have shape {points.shape}, or are not finite; {usage}")
    return points, closed


def _check_edges(points: Array, closed: bool, label: str) -> None:
    end = np.roll(points, -1, axis=0) if closed else points[1:]
    start = points if closed else points[:-1]
    length = np.linalg.norm(end - start, axis=1)
    short = np.flatnonzero(length <= COMPUTED * np.max(np.ptp(points, axis=0)))
    if len(short):
        raise InputError(
            f"{len(short)} edges of {label!r} have no length, the first from point {short[0]} at "
            f"{written(points[short[0]])}; leave out points that are given twice"
        )
    touching = ROUND_OFF * float(np.abs(points).max())
    i, j = _near_edges(start, end, touching)
    apart = (j - i > 1) & ~(closed & (i == 0) & (j == len(start) - 1))
    i, j = i[apart], j[apart]
    crossing = np.flatnonzero(_cross(start[i], end[i], start[j], end[j], touching))
    if len(crossing):
        k = crossing[0]
        raise InputError(
            f"{label!r} crosses itself: the edge from point {i[k]} at {written(start[i[k]])} and the "
            f"one from point {j[k]} at {written(start[j[k]])}; an outline has one inside. List the "
            "points in their order along it."
        )
    back = _turned_back(start, end, closed, touching)
    if len(back):
        raise InputError(
            f"{label!r} goes back on itself at point {back[0]} at {written(points[back[0]])}: there it "
            "has no inside"
        )


def _near_edges(start: Array, end: Array, touching: float) -> tuple[Index, Index]:
    """Pairs of edges near each other, all that meet among them; each once, the smaller number first."""
    radius = 0.5 * sizes(end - start) + touching
    middle = 0.5 * (start + end)

    def met(edge: Index, nodes: Nodes) -> Mask:
        reach = radius[edge] + nodes.radius + touching
        return np.asarray(sizes(middle[edge] - nodes.centre) <= reach)

    tree = FacetTree.over(np.minimum(start, end), np.maximum(start, end))
    i, j = (np.concatenate(part) for part in zip(*tree.descend(len(middle), met), strict=True))
    near = (i < j) & (sizes(middle[i] - middle[j]) <= radius[i] + radius[j])
    i, j = i[near], j[near]
    order = np.lexsort((j, i))
    return i[order], j[order]


def _cross(a: Array, b: Array, c: Array, d: Array, touching: float) -> NDArray[np.bool_]:
    """Return whether the edges from a to b and from c to d have a point in common, shape (p,).

    Points that are known to `touching` [length] only are on a line that they are no farther off.
    """

    def side(p: Array, q: Array, r: Array) -> Array:
        along, to = q - p, r - p
        across = cross(along, to)[:, 0]
        unsure = touching * (np.linalg.norm(along, axis=1) + np.linalg.norm(to, axis=1))
        return np.where(np.abs(across) > unsure, np.sign(across), 0.0)

    low = np.maximum(np.minimum(a, b), np.minimum(c, d))
    high = np.minimum(np.maximum(a, b), np.maximum(c, d))
    boxes = np.all(low <= high + touching, axis=1)
    apart = side(a, b, c) * side(a, b, d) > 0
    return np.asarray(boxes & ~apart & ~(side(c, d, a) * side(c, d, b) > 0))


def _turned_back(start: Array, end: Array, closed: bool, touching: float) -> Index:
    """Points at which an edge returns along the one before."""
    length = np.linalg.norm(end - start, axis=1)
    along = (end - start) / length[:, None]
    before = np.roll(along, 1, axis=0)
    across = cross(before, along)[:, 0]
    # ends that are known to `touching` say so much less of the direction of a short edge
    unsure = touching * (1 / length + 1 / np.roll(length, 1))
    back = (np.abs(across) <= COMPUTED + unsure) & (np.einsum("ed,ed->e", before, along) < 0)
    back[0] &= closed
    return np.flatnonzero(back)


#: How meshio calls faces that are no plain triangles, or curved ones.
OTHER_FACES = ("triangle", "quad", "polygon")


@with_known_keywords()
@dataclass(frozen=True, eq=False, init=False)
class RigidSurface(Faceted):
    """A rigid obstacle in space whose surface is made of triangles.

    Faces find their partners on it node by node, as on faces of solids: normals are continuous where
    triangles meet at less than 45 degrees. Triangles that turn alike to all sides, by 22.5 degrees at
    most, stand for a curved surface; others are flat, such as those of a die between its fillets:
    normals turn within an eighth of them along their bends.

    Parameters
    ----------
    points : array, shape (n, 3)
        Corners [length]. Those at one place are taken as one.
    triangles : array of int, shape (nt, 3)
        Numbers of points, counter-clockwise seen from outside; of closed surfaces either way round,
        but all of them alike.
    hollow : bool, optional
        Of a closed one: the body is inside.
    name : str, optional

    Attributes
    ----------
    closed : bool
        Whether it has no rim.

    Raises
    ------
    InputError
        Triangles without area, given twice, of unlike orientation, more than two at an edge; no rim and
        no volume.

    Notes
    -----
    Beyond the rim of an open surface there is nothing to meet. Whether it crosses itself is not
    looked at.

    Examples
    --------
    A tetrahedron:

    >>> corners = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)]
    >>> solid = RigidSurface(corners, [(0, 2, 1), (0, 1, 3), (1, 2, 3), (2, 0, 3)], name="tip")
    >>> solid.closed, solid.signed_distance([(0.1, 0.2, 0.3), (0.0, 0.0, -1.0)]).round(6).tolist()
    (True, [-0.1, 1.0])
    """

    points: Array
    triangles: Index
    hollow: bool = False
    name: str | None = None
    _kind = "rigid surface"
    _cut_flats = staticmethod(cut_triangles)

    @classmethod
    def from_file(
        cls, path: str | Path, *, scale: float = 1.0, hollow: bool = False, name: str | None = None
    ) -> RigidSurface:
        """The triangles of a file that meshio reads, such as STL.

        Parameters
        ----------
        path : str or Path
        scale : float, optional
            Of its unit of length: 1e-3 for millimetres where the bodies are in metres.
        hollow, name
            See `RigidSurface`; the name is that of the file, if not given.

        Raises
        ------
        InputError
            There is no such file, it can not be read, has no triangles, or faces that are none.
        """
        import meshio  # takes as long to import as all else together, and only files need it

        path = file_path(path)
        if not path.is_file():
            raise InputError(f"there is no file {str(path)!r} to read triangles from")
        try:
            with np.errstate(all="ignore"):  # meshio tries text as numbers first, which overflow
                mesh = meshio.read(path)
        except (meshio.ReadError, ValueError, OSError, KeyError, IndexError, SystemExit) as error:
            raise InputError(f"{str(path)!r} can not be read as a surface: {error}") from None
        found = [np.asarray(block.data) for block in mesh.cells if block.type == "triangle"]
        if not found or not sum(map(len, found)):
            kinds = ", ".join(sorted({block.type for block in mesh.cells})) or "nothing"
            raise InputError(f"{str(path)!r} has no triangles, only {kinds}; export its surface as STL")
        others = {block.type for block in mesh.cells if block.type.startswith(OTHER_FACES)} - {
            "triangle"
        }
        if others:
            raise InputError(
                f"{str(path)!r} has faces besides its triangles: {', '.join(sorted(others))}, and "
                "without them its surface has holes; export all of it as triangles, in STL for example"
            )
        size = number(scale, "scale", "give a number > 0")
        if not 0 < size < np.inf:
            raise InputError(f"scale is {shown(scale)}; give a finite number > 0")
        points = np.asarray(mesh.points, dtype=float) * size
        return cls(points, np.concatenate(found), hollow, name or path.stem)

    def __init__(
        self, points: ArrayLike, triangles: ArrayLike, hollow: bool = False, name: str | None = None
    ) -> None:
        take(self, points=points, triangles=triangles, hollow=hollow, name=name)

    def __post_init__(self) -> None:
        check_name(self.name, "name of a RigidSurface")
        check_switch(self.hollow, "RigidSurface: hollow")
        points, triangles = _given(self.points, self.triangles, self.label)
        points, triangles = _welded(points, triangles)
        _check_triangles(points, triangles, self.label)
        _check_rims(points, triangles, self.label)
        vars(self).update(points=sealed(points), triangles=sealed(triangles))
        if self.hollow and not self.closed:
            raise InputError(f"hollow=True of {self.label!r}: it has a rim, and so no inside")
        if self.closed:
            if (volume(points, triangles) < 0) != self.hollow:
                vars(self).update(triangles=sealed(triangles[:, ::-1].copy()))
            _check_shells(points, self.triangles, self.hollow, self.label)

    @cached_property
    def closed(self) -> bool:
        """The surface has no rim."""
        return bool(np.all(twin_edges(self.triangles) >= 0))

    @property
    def facets(self) -> Index:
        """Its triangles."""
        return self.triangles


def _given(points: Any, triangles: Any, label: str) -> tuple[Array, Index]:
    x = numbers(points, f"points of {label!r}", "give positions (n, 3)")
    cells = numbers(triangles, f"triangles of {label!r}", "give numbers of points (nt, 3)")
    if x.ndim != 2 or x.shape[1] != 3 or not np.isfinite(x).all():
        raise InputError(
            f"points of {label!r} have shape {x.shape}, or are not finite; give positions (n, 3)"
        )
    whole = cells.ndim == 2 and cells.shape[1] == 3 and len(cells) and np.all(cells == np.floor(cells))
    if not whole or cells.min() < 0 or cells.max() >= len(x):
        raise InputError(
            f"triangles of {label!r} have shape {cells.shape}, or numbers that are none of its "
            f"{len(x)} points; give numbers of points (nt, 3)"
        )
    return x, cells.astype(np.intp)


def _welded(points: Array, triangles: Index) -> tuple[Array, Index]:
    """Corners at one place as one, and only those that a triangle has."""
    near = SINGLE * float(np.max(np.ptp(points, axis=0)))
    _, first, equal = np.unique(points, axis=0, return_index=True, return_inverse=True)
    one, equal = points[first], equal.ravel()
    pairs = pairs_within(one, near)
    graph = coo_matrix((np.ones(len(pairs)), pairs.T), shape=(len(one), len(one)))
    _, group = connected_components(graph, directed=False)
    cells = group[equal[triangles]]
    used, cells = np.unique(cells, return_inverse=True)
    place = np.unique(group, return_index=True)[1]
    return one[place[used]], cells.reshape(triangles.shape)


def _check_triangles(points: Array, triangles: Index, label: str) -> None:
    x = points[triangles]
    sides = np.linalg.norm(x - np.roll(x, 1, axis=1), axis=2)
    longest = sides.max(axis=1)
    flat = np.flatnonzero(sizes(area_vectors(x)) <= SINGLE * longest**2)
    if len(flat):
        raise InputError(
            f"{len(flat)} triangles of {label!r} have no area, the first is number {flat[0]} at "
            f"{written(x[flat[0], 0])}; clean the surface in the program that made it"
        )
    _, first, count = np.unique(
        np.sort(triangles, axis=1), axis=0, return_index=True, return_counts=True
    )
    if np.any(count > 1):
        where = int(first[np.argmax(count > 1)])
        raise InputError(
            f"{int(np.sum(count - 1))} triangles of {label!r} are given twice, the first is number "
            f"{where} at {written(x[where, 0])}; leave them out"
        )


def _check_rims(points: Array, triangles: Index, label: str) -> None:
    """At each edge at most two triangles, that go along it in opposite directions."""
    edges = _edges(triangles)
    _, inverse, count = np.unique(
        np.sort(edges, axis=1), axis=0, return_inverse=True, return_counts=True
    )
    crowded = np.flatnonzero(count[inverse.ravel()] > 2)
    if len(crowded):
        a, b = points[edges[crowded[0]]]
        raise InputError(
            f"{int(np.sum(count > 2))} edges of {label!r} have more than two triangles, the first from "
            f"{written(a)} to {written(b)}: there it has no inside. Separate the solids that touch, or "
            "give each its own RigidSurface"
        )
    _, first, again = np.unique(edges, axis=0, return_index=True, return_counts=True)
    if np.any(again > 1):
        a, b = points[edges[first[np.argmax(again > 1)]]]
        raise InputError(
            f"at {int(np.sum(again > 1))} edges of {label!r}, the first from {written(a)} to "
            f"{written(b)}, two triangles look to opposite sides: orient all of them outwards"
        )


def _check_shells(points: Array, triangles: Index, hollow: bool, label: str) -> None:
    """Every closed part has a volume; of several those that look inwards are cavities, inside others.

    With `hollow` those are the cavities that look outwards.
    """
    edges = _edges(triangles)
    graph = coo_matrix((np.ones(len(edges)), edges.T), shape=(len(points), len(points)))
    count, part = connected_components(graph, directed=False)
    of = part[triangles[:, 0]]
    volumes = np.array([volume(points, triangles[of == k]) for k in range(count)])
    area = np.bincount(of, 0.5 * sizes(area_vectors(points[triangles])), count)
    low = np.array([points[part == k].min(axis=0) for k in range(count)])
    high = np.array([points[part == k].max(axis=0) for k in range(count)])
    # by the mean thickness: sheets that close together are one, as corners are
    flat = 2 * np.abs(volumes) <= SINGLE * np.linalg.norm(high - low, axis=1) * area
    if flat.any():
        first = written(points[part == np.argmax(flat)][0])
        raise InputError(
            f"{label!r} has no rim, and at {first} no volume either: there two sheets lie one upon the "
            "other, and nothing tells inside from outside. Leave out the triangles of one of them"
        )
    if count == 1:
        return
    solid = (volumes > 0) != hollow
    for k in np.flatnonzero(~solid):
        around = np.all((low[solid] <= low[k]) & (high[solid] >= high[k]), axis=1)
        if not around.any():
            first = written(points[part == k][0])
            raise InputError(
                f"{label!r} has {count} closed parts, and the one at {first} looks to the opposite "
                "side of the others without being a cavity inside one of them: orient all parts alike"
            )


def _edges(triangles: Index) -> Index:
    """Start and end of all edges, (3 nt, 2)."""
    return np.stack([triangles, np.roll(triangles, -1, axis=1)], axis=2).reshape(-1, 2)
