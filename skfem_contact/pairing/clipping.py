r"""Convex polygons cut with convex polygons, all pairs at once, and their triangles; or intervals.

An interval on a line is a polygon of two corners, whose edges are its ends. Sutherland and Hodgman cut
a polygon by the half-planes of the edges of another one, one after the other. Here a cut works on all
pairs of polygons together, whatever their numbers of corners: arrays are as wide as the polygon with
the most corners, and shorter ones repeat their last corner. Areas of padded polygons need no mask, as
edges without length add nothing.

References
----------
I. E. Sutherland, G. W. Hodgman, Comm. ACM 17 (1974) 32-42.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from skfem_contact.arrays import Array, Index, dot, ragged, turned
from skfem_contact.records import dataclass


@dataclass(frozen=True, eq=False)
class Polygons:
    """Polygons in the plane, corners counter-clockwise, or intervals on a line, n = 2 and ascending.

    Attributes
    ----------
    corners : ndarray, shape (p, n, d-1)
        The last corner is repeated where a polygon has fewer than n.
    count : ndarray of int, shape (p,)
        Numbers of corners; 0 where nothing is left.
    """

    corners: Array
    count: Index

    @property
    def areas(self) -> Array:
        """Areas or lengths, shape (p,); negative where corners run clockwise."""
        return signed_areas(self.corners)

    @property
    def middles(self) -> Array:
        """Means of the corners, shape (p, d-1)."""
        there = np.arange(self.corners.shape[1]) < self.count[:, None]
        total = (self.corners * there[..., None]).sum(axis=1)
        return np.asarray(total / np.maximum(self.count, 1)[:, None])

    def beyond(self, points: Array) -> Array:
        """How far points (p, n, d-1) are beyond the edges of convex polygons, (p, n) [length]."""
        start, inward = sides(self.corners)
        size = np.linalg.norm(inward, axis=2)[:, None]
        inside = dot(inward[:, None], points[:, :, None] - start[:, None])
        return np.maximum((-inside / np.where(size > 0, size, np.inf)).max(axis=2), 0.0)

    def some(self, which: Index) -> Polygons:
        """These polygons, in this order."""
        return Polygons(self.corners[which], self.count[which])

    def plain(self, least: Array) -> Polygons:
        """Without corners that span no more than an area (p,) with both beside them.

        Where edges lie on each other round-off says whether there is a corner on them, or two at the
        same place: middles and triangles would depend on it.
        """
        out, place = self, np.arange(self.corners.shape[1])
        while self.corners.shape[2] == 2:
            there, last = place < out.count[:, None], out.count[:, None] - 1
            after, before = np.where(place < last, place + 1, 0), np.where(place > 0, place - 1, last)
            ahead, behind = (
                np.take_along_axis(out.corners, np.maximum(to, 0)[..., None], axis=1) - out.corners
                for to in (after, before)
            )
            flat = there & (np.abs(plane_cross(ahead, behind)) <= 2 * least[:, None])
            # of two at the same place one
            drop = flat & ~np.take_along_axis(flat, np.maximum(before, 0), axis=1)
            if not drop.any():
                break
            keep = there & ~drop
            order = np.argsort(~keep, axis=1, kind="stable")
            corners = np.take_along_axis(out.corners, order[..., None], axis=1)
            out = _padded(corners, keep.sum(axis=1))
        return out

    def simplices(self, round_middle: bool = False) -> tuple[Index, Array]:
        """Intervals, or triangles of polygons: whose they are (t,), and their corners (t, d, d-1).

        Triangles have the first corner of the polygon in common, or its middle: these are more, but
        smaller and of a better shape, for integrands that are no polynomials.
        """
        if self.corners.shape[2] == 1:
            return np.arange(len(self.count)), self.corners
        whole = self.count == 3 if round_middle else self.count < 0
        number = np.where(whole, 1, self.count if round_middle else np.maximum(self.count - 2, 0))
        whose = np.repeat(np.arange(len(number)), number)
        place = ragged(np.zeros(len(number), dtype=np.intp), number)
        last = self.count[whose] - 1
        if not round_middle:
            at = np.stack([np.zeros_like(place), place + 1, place + 2], axis=1)
            return whose, self.corners[whose[:, None], at]
        at = np.stack([place, np.where(place < last, place + 1, 0), last], axis=1)
        corners = self.corners[whose[:, None], at]
        cut = ~whole[whose]
        corners[cut, 2] = self.middles[whose[cut]]
        return whose, corners


def signed_areas(corners: Array) -> Array:
    """Areas of polygons (..., n, 2), or lengths (..., 2, 1); negative where corners run clockwise.

    >>> float(signed_areas(np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [0.0, 1.0]])))
    2.0
    """
    arm = corners[..., 1:, :] - corners[..., :1, :]  # from a corner: far from the origin, too
    if arm.shape[-1] == 1:
        return np.asarray(arm[..., 0, 0])
    return np.asarray(0.5 * np.sum(plane_cross(arm[..., :-1, :], arm[..., 1:, :]), axis=-1))


def plane_cross(v: Array, w: Array) -> Array:
    """The component out of the plane of the cross product of plane vectors."""
    return np.asarray(v[..., 0] * w[..., 1] - v[..., 1] * w[..., 0])


def sides(corners: Array) -> tuple[Array, Array]:
    """A point on each edge of polygons (..., n, d-1), and the vectors inward across it, as long.

    Of intervals the edges are the ends, and the vectors have the length one.
    """
    if corners.shape[-1] == 1:
        return corners, np.broadcast_to([[1.0], [-1.0]], corners.shape)
    return corners, turned(np.roll(corners, -1, axis=-2) - corners)


def clip(subject: Array, window: Array) -> Polygons:
    """Parts of polygons inside other polygons, pair by pair.

    Parameters
    ----------
    subject : ndarray, shape (p, n, d-1)
        Corners of polygons, or ends of intervals.
    window : ndarray, shape (p, k, d-1)
        Corners of convex polygons, counter-clockwise, or ends of intervals, ascending.

    Returns
    -------
    Polygons
        In the order of the pairs, corners in the direction of `subject`.

    Examples
    --------
    A unit square moved by (1/2, 1/2), in a unit square:

    >>> square = np.array([[[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]])
    >>> part = clip(square + 0.5, square)
    >>> part.corners[0].tolist(), part.areas.tolist()
    ([[0.5, 0.5], [1.0, 0.5], [1.0, 1.0], [0.5, 1.0]], [0.25])
    """
    p, n, dim = subject.shape
    if dim == 1:
        ends = np.clip(subject, window[:, :1], window[:, 1:])
        return Polygons(ends, np.where(signed_areas(ends) > 0, n, 0))
    alive, rest, (start, inward) = np.arange(p), Polygons(subject, np.full(p, n)), sides(window)
    for k in range(window.shape[1]):
        rest = cut(rest, start[alive, k], inward[alive, k])
        left = np.flatnonzero(rest.count > dim)
        alive, rest = alive[left], rest.some(left)
    parts = Polygons(np.zeros((p, rest.corners.shape[1], dim)), np.zeros(p, dtype=np.intp))
    parts.corners[alive], parts.count[alive] = rest.corners, rest.count
    return parts


def cut(polygons: Polygons, start: Array, inward: Array) -> Polygons:
    """Return what lies inward of the lines, or points, through `start`, (p, d-1) both."""
    corners, count = polygons.corners, polygons.count
    p, n, dim = corners.shape
    side = dot(inward[:, None], corners - start[:, None])
    if dim == 1:
        ends = np.where(side[..., None] >= 0, corners, start[:, None])
        return Polygons(ends, np.where(np.any(side > 0, axis=1), count, 0))
    place = np.arange(n)
    following = np.where(place + 1 < count[:, None], place + 1, 0)
    side_next = np.take_along_axis(side, following, axis=1)
    there = place < count[:, None]
    inside, inside_next = side >= 0, side_next >= 0
    # each edge gives its first corner, if inside, and then where it crosses the line
    given = np.empty((p, n, 2), dtype=bool)
    given[:, :, 0], given[:, :, 1] = there & inside, there & (inside != inside_next)
    rank = np.cumsum(given.reshape(p, 2 * n), axis=1)
    which, edge = np.nonzero(given[:, :, 1])
    here, ahead = corners[which, edge], corners[which, following[which, edge]]
    share = side[which, edge] / (side[which, edge] - side_next[which, edge])
    both = np.empty((p, n, 2, 2))
    both[:, :, 0] = corners
    both[which, edge, 1] = here + share[:, None] * (ahead - here)
    whose, slot = np.nonzero(given.reshape(p, 2 * n))
    out = np.zeros((p, max(3, int(rank[:, -1:].max(initial=0))), 2))
    out[whose, rank[whose, slot] - 1] = both.reshape(p, 2 * n, 2)[whose, slot]
    return _padded(out, rank[:, -1])


def stacked(parts: Sequence[Polygons]) -> Polygons:
    """All polygons of several groups, one after the other."""
    width = max(part.corners.shape[1] for part in parts)
    corners = [np.zeros((len(part.count), width, part.corners.shape[2])) for part in parts]
    for out, part in zip(corners, parts, strict=True):
        out[:, : part.corners.shape[1]] = part.corners
    return _padded(np.concatenate(corners), np.concatenate([part.count for part in parts]))


def _padded(corners: Array, count: Index) -> Polygons:
    """Polygons whose last corner fills the places behind it."""
    last = np.minimum(np.arange(corners.shape[1]), np.maximum(count - 1, 0)[:, None])
    return Polygons(np.take_along_axis(corners, last[:, :, None], axis=1), count)


#: Gaps (p,) of pieces at places (p, d-1) in the planes of their cells.
Gaps = Callable[[Index, Array], Array]


def several_sheets(e: Index, vertices: Index) -> list[tuple[int, Index]]:
    """Pieces with rivals: parts of other sheets over the same cell.

    Parameters
    ----------
    e : ndarray of int, shape (p,)
        The cell of the secondary that each piece is part of.
    vertices : ndarray of int, shape (p, c)
        Vertices of the primary's faces.

    Returns
    -------
    list of (int, ndarray of int)
        Pieces, and their rivals.

    Examples
    --------
    Two triangles with a common edge, and one apart from them:

    >>> over = several_sheets(np.array([7, 7, 7]), np.array([[0, 1, 2], [1, 2, 3], [4, 5, 6]]))
    >>> [(piece, rivals.tolist()) for piece, rivals in over]
    [(0, [2]), (1, [2]), (2, [0, 1])]
    """
    p, c = vertices.shape
    shared = np.any(vertices[1:, :, None] == vertices[:-1, None], axis=(1, 2))
    if np.all(shared | (e[1:] != e[:-1])):  # as on curves, whose facets follow each other
        return []
    corner = e[:, None] * (1 + vertices.max(initial=0)) + vertices
    _, corner = np.unique(corner, return_inverse=True)
    pairs = np.repeat(np.arange(p), c), p + corner.ravel()
    size = p + corner.max(initial=0) + 1
    graph = coo_matrix((np.ones(p * c), pairs), shape=(size, size))
    _, sheet = connected_components(graph, directed=False)
    sheet = sheet[:p]
    order = np.lexsort((sheet, e))
    start = np.flatnonzero(np.diff(e[order], prepend=-1))
    last = np.append(start[1:], p)[: len(start)] - 1
    several = sheet[order[start]] != sheet[order[last]]
    found = [order[i : j + 1] for i, j in zip(start[several], last[several], strict=True)]
    rivals = [(i, group[sheet[group] != sheet[i]]) for group in found for i in np.sort(group)]
    return [(int(i), np.sort(others)) for i, others in rivals]


def nearest_parts(
    pieces: Polygons, rivals: list[tuple[int, Index]], gaps: Gaps
) -> tuple[Index, Polygons]:
    """Pieces without what rivals are nearer to: the piece that each part is of, and the parts."""
    contested = np.array([piece for piece, _ in rivals])
    free = np.setdiff1d(np.arange(len(pieces.count)), contested)
    of, parts = contested, pieces.some(contested)
    opponents = dict(rivals)
    for turn in range(max(len(others) for _, others in rivals)):
        faced = np.array([opponents[i][turn] if turn < len(opponents[i]) else -1 for i in of])
        busy = np.flatnonzero(faced >= 0)
        done = np.flatnonzero(faced < 0)
        whose, mine, kept = [of[done]], of[busy], [parts.some(done)]
        inside, against = parts.some(busy), faced[busy]
        for start, inward in np.stack(sides(pieces.corners[against])).transpose(2, 0, 1, 3):
            # the edges that a rival does not have, of no length, cut nothing off
            outward = np.where(inward.any(axis=1, keepdims=True), -inward, np.nan)
            whose.append(mine)
            kept.append(cut(inside, start, outward))
            inside = cut(inside, start, inward)
        middle = inside.middles
        own, theirs = np.abs(gaps(mine, middle)), np.abs(gaps(against, middle))
        nearer = (own < theirs) | ((own == theirs) & (mine < against))
        whose.append(mine[nearer])
        kept.append(inside.some(np.flatnonzero(nearer)))
        of, parts = np.concatenate(whose), stacked(kept)
        there = np.flatnonzero(parts.count > parts.corners.shape[2])
        of, parts = of[there], parts.some(there)
    return np.concatenate([free, of]), stacked([pieces.some(free), parts])
