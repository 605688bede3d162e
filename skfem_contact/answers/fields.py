r"""Fields on a contact surface between its nodes: interpolation, the edge of contact, its area.

**Where does contact end?** A node knows only whether it is closed, which leaves an uncertainty of
one facet. But next to the edge of any contact between smooth surfaces, at the distance ``r``, the
pressure vanishes like ``r**(1/2)`` and the gap opens like ``r**(3/2)``: the leading term of the
elastic field, whatever the bodies and loads. So ``gap**(2/3)`` is a straight line, and it is
drawn through the second and third open node (the first is so close to the edge that its gap is
mostly the error of the mesh); with fewer open nodes, through the first two, or midway. The edge
is looked for between half a facet inside the last closed node and the first open one. On Hertz
contact this is within .1 of the distance between nodes, wherever the edge lies.

Where contact ends because the other surface does, the last closed node is the edge. Ends of the
secondary surface that are closed are no edges.

**In 3-D** it ends along lines on faces. There too ``h = gap**(2/3)`` is a straight function of the
distance from the edge. At the nodes around the edge it is replaced by what its values at open nodes
near by say, in the tangent plane of the node, by least squares with weights 1/distance^4: a plane,
bent along the edge by a parabola, through what lies ahead of the node. Open nodes next to closed
ones are not among these values if there are enough others: their gaps are so small that they are
mostly the error of the mesh. So h has a sign on both sides of the edge. It is interpolated linearly
over triangles, and its zero is the edge: segments across the triangles (marching triangles). On the
gap of Hertz' contact, the area is found to 2 % with 3 faces to the radius, to 1 % with 6.

Quadratic faces are cut along their nodes, quadrilaterals into the triangles round their centre, so
that no diagonal is preferred. The edge is looked for between the first open node and halfway from
the last closed one to the next, where contact ends because the other surface does at the last
closed node. Where closed nodes have no others behind them, or too few open ones around, it is in
the middle.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix

from skfem_contact.answers.thresholds import REACH
from skfem_contact.bodies.normals import tangents
from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.digits import COMPUTED, GIVEN
from skfem_contact.errors import InputError
from skfem_contact.pairing.projection import project
from skfem_contact.records import dataclass
from skfem_contact.trees import Tree

Array = NDArray[np.float64]
Index = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class Segments:
    """A surface in 2-D as segments from node to node: the facets, or halves of quadratic ones.

    Attributes
    ----------
    start, end : ndarray of int, shape (s,)
        Nodes.
    length : ndarray, shape (s,)
        Along the surface [length].
    area : ndarray, shape (s,)
        Length times the `measure` of the body [area].
    """

    start: Index
    end: Index
    length: Array
    area: Array

    @classmethod
    def of(cls, surface: ContactSurface) -> Segments:
        """The segments of a surface, in the order of its facets."""
        if surface.points.shape[1] != 2:
            raise InputError(
                f"surface {surface.label!r}: edges of contact, and estimates of errors that go by "
                "them, are not implemented in 3-D yet"
            )
        chain = surface.facets[:, [0, 1] if surface.facets.shape[1] == 2 else [0, 2, 1]]
        start, end = chain[:, :-1], chain[:, 1:]
        chord = np.linalg.norm(surface.points[end] - surface.points[start], axis=2)
        length = chord * (surface.lengths / chord.sum(axis=1))[:, None]
        middle = 0.5 * (surface.points[start] + surface.points[end])
        measure = surface.body.measure
        weight = 1.0 if measure is None else measure(np.moveaxis(middle, -1, 0))
        return cls(start.ravel(), end.ravel(), length.ravel(), (length * weight).ravel())

    def after(self, forward: bool, m: int) -> Index:
        """The segment that leaves each of m nodes along (or against) the surface; -1 where it ends."""
        segment = np.full(m, -1)
        segment[self.start if forward else self.end] = np.arange(len(self.start))
        return segment


@dataclass(frozen=True, eq=False)
class Edges:
    """The ends of contact.

    Attributes
    ----------
    inside, outside : ndarray of int, shape (k,)
        Closed node and its open neighbour.
    segment : ndarray of int, shape (k,)
        The segment between them.
    part : ndarray, shape (k,)
        Of the way from the closed to the open node, in [-0.5, 1].
    """

    inside: Index
    outside: Index
    segment: Index
    part: Array


def find_edges(segments: Segments, closed: NDArray[np.bool_], gap: Array) -> Edges:
    """Locate the edges of contact by the rule of this module.

    Parameters
    ----------
    segments : Segments
    closed : ndarray of bool, shape (m,)
    gap : ndarray, shape (m,)
        ``inf`` where a point has no partner [length].

    Examples
    --------
    A gap that opens as ``(x - 1.3)**(3/2)`` over nodes at 0, 1, 2, ...:

    >>> x = np.arange(6)
    >>> segments = Segments(x[:-1], x[1:], np.ones(5), np.ones(5))
    >>> edges = find_edges(segments, x < 2, np.maximum(x - 1.3, 0.0) ** 1.5)
    >>> print(edges.inside, edges.outside, edges.part.round(12))
    [1] [2] [0.3]
    """
    ways = [_edges_along(segments, closed, gap, forward) for forward in (True, False)]
    names = ("inside", "outside", "segment", "part")
    columns = {k: np.concatenate([getattr(way, k) for way in ways]) for k in names}
    order = np.lexsort((columns["outside"], columns["inside"]))
    return Edges(**{name: column[order] for name, column in columns.items()})


def _edges_along(segments: Segments, closed: NDArray[np.bool_], gap: Array, forward: bool) -> Edges:
    segment = segments.after(forward, len(closed))
    far_end = segments.end if forward else segments.start
    open_next = (segment >= 0) & ~closed[far_end[segment]]
    inside = np.flatnonzero(closed & open_next)
    # the nodes beyond, their distances from the closed one, and whether they are open and known
    node, reach, known = [inside], [np.zeros(len(inside))], [np.ones(len(inside), dtype=bool)]
    for _ in range(3):
        via = segment[node[-1]]
        node.append(far_end[via])
        reach.append(reach[-1] + segments.length[via])
        known.append(known[-1] & (via >= 0) & ~closed[node[-1]] & np.isfinite(gap[node[-1]]))
    height = [
        np.maximum(np.where(there, gap[n], 0.0), 0.0) ** (2 / 3)
        for n, there in zip(node, known, strict=True)
    ]
    place = np.where(known[1], 0.5 * reach[1], 0.0)
    for i, j in ((1, 2), (2, 3)):
        rise = height[j] - height[i]
        rises = known[j] & (rise > 0)
        run = np.divide(reach[j] - reach[i], rise, out=np.zeros(len(inside)), where=rises)
        place = np.where(rises, reach[i] - run * height[i], place)
    part = np.clip(place / reach[1], -0.5, 1.0)
    return Edges(inside, node[1], segment[inside], part)


def edge_positions(surface: ContactSurface, closed: NDArray[np.bool_], gap: Array) -> Array:
    """Positions of the edges of contact, in the order of the points of the surface, (k, d)."""
    edges = find_edges(Segments.of(surface), closed, gap)
    part = edges.part[:, None]
    return (1 - part) * surface.points[edges.inside] + part * surface.points[edges.outside]


def closed_area(surface: ContactSurface, closed: NDArray[np.bool_], gap: Array) -> float:
    """Area in contact, up to the edges [area]."""
    segments = Segments.of(surface)
    whole = closed[segments.start] & closed[segments.end]
    edges = find_edges(segments, closed, gap)
    return max(float(segments.area[whole].sum() + edges.part @ segments.area[edges.segment]), 0.0)


def interpolate(surface: ContactSurface, values: Array, points: Array) -> Array:
    """Nodal values at other points of a surface, by the shape functions of its facets.

    Parameters
    ----------
    surface : ContactSurface
    values : ndarray, shape (m, ...)
    points : ndarray, shape (p, d)
        Points on the surface; others are projected onto it.

    Returns
    -------
    ndarray, shape (p, ...)
    """
    points = np.atleast_2d(np.asarray(points, dtype=float))
    if points.ndim != 2 or points.shape[1] != surface.points.shape[1]:
        raise InputError(
            f"points have shape {points.shape}; give positions (p, {surface.points.shape[1]})"
        )
    few = min(4, len(surface.facets))
    middle = surface.points[surface.facets].mean(axis=1)
    near = np.asarray(Tree(middle).query(points, k=few)[1]).reshape(len(points), few)
    several = np.repeat(points, few, axis=0)
    feet = project(surface, near.ravel(), several)
    distance = np.linalg.norm(several - feet.foot, axis=1)
    best = np.arange(len(points)) * few + distance.reshape(-1, few).argmin(axis=1)
    facet, N = near.ravel()[best], feet.shape[best]
    return np.einsum("pk,pk...->p...", N, np.asarray(values)[surface.facets[facet]])


def displaced(surface: ContactSurface, points: Array) -> ContactSurface:
    """The surface with its nodes at other positions, for the functions above."""
    return replace(surface, points=points)


Mask = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Contour:
    """The ends of contact on faces, and its size.

    Attributes
    ----------
    segments : ndarray, shape (s, 2, 3)
        The edge, in pieces in the order of the faces [length].
    area : float
        Within it [area].
    heights : ndarray, shape (m,)
        Negative inside, see the function `heights`.
    """

    segments: Array
    area: float
    heights: Array


def contour(surface: ContactSurface, closed: Mask, gap: Array) -> Contour:
    """The edge of contact and the area within.

    Parameters
    ----------
    surface : ContactSurface
    closed : ndarray of bool, shape (m,)
    gap : ndarray, shape (m,)
        ``inf`` where a point has no partner [length].
    """
    corners = surface.kind.simplices
    h = heights(surface, closed, gap)
    height = with_centres(surface, h)[:, corners].reshape(-1, 3)
    x = with_centres(surface, surface.points)[:, corners].reshape(-1, 3, 3)
    part, segments = _cut(height, x)
    return Contour(segments, float(part @ simplex_areas(surface, x)), h)


def contact_edge(surface: ContactSurface, closed: Mask, gap: Array) -> tuple[Array, Array]:
    """The edge of contact, and how far from it nodes are, on curves and faces alike.

    Returns
    -------
    pieces : ndarray, shape (s, 2, d)
        In the plane points, as pieces without a length [length].
    heights : ndarray, shape (m,)
        Negative inside, and zero on the edge where they are interpolated.
    """
    if surface.dim == 3:
        found = contour(surface, closed, gap)
        return found.segments, found.heights
    edges = find_edges(Segments.of(surface), closed, gap)
    x, inside, part = surface.points, edges.inside, edges.part[:, None]
    ends = (1 - part) * x[inside] + part * x[edges.outside]
    if not len(ends):
        return np.zeros((0, 2, 2)), np.where(closed, -1.0, 1.0)
    outer = ~closed
    outer[inside[edges.part < 0]] = True
    return np.stack([ends, ends], axis=1), np.where(outer, 1.0, -1.0) * Tree(ends).distances(x)


def heights(surface: ContactSurface, closed: Mask, gap: Array) -> Array:
    """``gap**(2/3)`` continued into the contact: negative inside, positive outside, (m,).

    ``inf`` at points without a partner.
    """
    beside = neighbours(surface)
    opened = ~closed & np.isfinite(gap)
    # where the surfaces touch without a force the gap is round-off, which must not draw an edge
    gap = np.where(gap > COMPUTED * np.abs(surface.points).max(), gap, 0.0)
    h = np.where(opened, np.maximum(np.where(opened, gap, 0.0), 0.0) ** (2 / 3), 0.0)
    last, first = closed & _touched(beside, opened), opened & _touched(beside, closed)
    behind = closed & ~last & _touched(beside, last)
    here = np.flatnonzero(last | first | behind)
    row, node = _around(beside, here)
    far, known, _ = _continued(surface, here, row, node, opened & ~first, h)
    near, some, any_ = _continued(surface, here, row, node, opened, h)
    fit = np.zeros(len(h))
    fit[here] = np.where(known, far, near)
    fitted = np.zeros(len(h), dtype=bool)
    fitted[here] = known | some | any_

    scale = float(h.max(initial=0.0)) or 1.0
    tiny = COMPUTED * scale
    out = np.where(closed, -scale, np.where(opened, np.maximum(h, tiny), np.inf))
    out[first & fitted] = np.maximum(fit[first & fitted], tiny)
    out[last] = fit[last]
    # halfway to the first open nodes where nothing better is known
    mean = _mean_of(beside, np.where(first, out, 0.0), first)
    lonely = last & ~(fitted & ((fit < 0) | _touched(beside, behind)))
    out[lonely] = -np.maximum(mean[lonely], tiny)
    # where the edge is before the last closed node it is less than halfway to the one behind
    outside = np.where(last, np.maximum(out, 0.0), 0.0)
    most = _largest_of(beside, outside)
    out[behind] = np.minimum(np.where(fitted, fit, -scale)[behind], -np.maximum(most[behind], tiny))
    return out


def neighbours(surface: ContactSurface) -> csr_matrix:
    """Return which nodes share a face, each with itself, as a matrix of ones (m, m)."""
    nf, k = surface.facets.shape
    entries = np.ones(nf * k), (np.repeat(np.arange(nf), k), surface.facets.ravel())
    of_faces = csr_matrix(entries, shape=(nf, len(surface.points)))
    beside = csr_matrix(of_faces.T @ of_faces)
    beside.data[:] = 1.0
    return beside


def simplex_areas(surface: ContactSurface, x: Array) -> Array:
    """Areas of the pieces or triangles x (t, d, d) of all facets, which add up to the facets', (t,)."""
    side = x[:, 1:] - x[:, :1]
    across = side[:, 0] if surface.dim == 2 else 0.5 * np.cross(side[:, 0], side[:, 1])
    area = np.linalg.norm(across, axis=1)
    area = area.reshape(len(surface.facets), -1)
    area = (area * (surface.facet_areas / area.sum(axis=1))[:, None]).ravel()
    measure = surface.body.measure
    return area if measure is None else area * measure(x.mean(axis=1).T)


def _around(beside: csr_matrix, here: Index) -> tuple[Index, Index]:
    """Pairs of the place of a node in `here` and of another node near to it."""
    reached = beside[here]
    for _ in range(REACH - 1):
        reached = reached @ beside
    pairs = csr_matrix(reached).tocoo()
    others = here[pairs.row] != pairs.col
    return pairs.row[others], pairs.col[others]


def _continued(
    surface: ContactSurface, here: Index, row: Index, node: Index, sample: Mask, h: Array
) -> tuple[Array, Mask, Mask]:
    """Return what open nodes near by say of h at some nodes; whether enough were ahead, or on any side.

    Parameters
    ----------
    here : ndarray of int, shape (k,)
    row, node : ndarray of int
        Of `_around`.
    sample : ndarray of bool, shape (m,)
        Nodes with a value that counts.
    """
    kept = sample[node]
    row, node = row[kept], node[kept]
    away = surface.points[node] - surface.points[here][row]
    square = np.sum(away**2, axis=1)
    along = np.einsum("pd,pkd->pk", away, tangents(surface.normals[here])[row])
    size = np.sqrt(square.max(initial=0.0)) or 1.0  # numbers of order one in all units
    along, weight = along / size, (size**2 / square) ** 2
    plane = np.column_stack([np.ones(len(row)), along])
    fit, enough = least_squares(plane, weight, h[node], row, len(here))
    # only what lies ahead, within 45 degrees: on the far side of a small contact h falls again;
    # where the edge is round so is h: a parabola along the edge
    slope = fit[row, 1:]
    slope /= np.maximum(np.linalg.norm(slope, axis=1), np.finfo(float).tiny)[:, None]
    ahead = np.einsum("pk,pk->p", along, slope)
    across = along[:, 0] * slope[:, 1] - along[:, 1] * slope[:, 0]
    # points of regular faces lie at 45 degrees to the slope: round-off must not choose among them
    weight = np.where(ahead > (1.0 - GIVEN) * np.abs(across), weight, 0.0)
    straight, some = least_squares(plane, weight, h[node], row, len(here))
    parabola = np.column_stack([plane, across**2])
    bent, more = least_squares(parabola, weight, h[node], row, len(here))
    at = np.where(more, bent[:, 0], np.where(some, straight[:, 0], fit[:, 0]))
    return at, some, enough


def least_squares(terms: Array, weight: Array, values: Array, row: Index, n: int) -> tuple[Array, Mask]:
    """Coefficients (n, k) by the values of many rows each; whether these determine them, (n,)."""
    normal = NormalEquations(terms, weight, row, n)
    return normal.fit(values), normal.enough


@dataclass(frozen=True, eq=False)
class NormalEquations:
    """Least squares of n points, each by many rows, for any values.

    Attributes
    ----------
    terms : ndarray, shape (p, k)
    weight : ndarray, shape (p,)
    row : ndarray of int, shape (p,)
        The point that each row belongs to.
    n : int
    """

    terms: Array
    weight: Array
    row: Index
    n: int

    @cached_property
    def _weighted(self) -> Array:
        return self.weight * self.terms.T  # (k, p)

    @cached_property
    def _matrices(self) -> Array:
        k = self.terms.shape[1]
        A = np.empty((self.n, k, k))
        for i in range(k):
            for j in range(i + 1):
                A[:, i, j] = np.bincount(self.row, self._weighted[i] * self.terms[:, j], self.n)
                A[:, j, i] = A[:, i, j]
        return A

    @cached_property
    def enough(self) -> Mask:
        """Return whether the rows determine the coefficients, (n,)."""
        A = self._matrices
        diagonal = np.sqrt(np.maximum(np.einsum("nii->ni", A), np.finfo(float).tiny))
        # both directions alike: points on a line along one of the axes do not span a plane
        diagonal[:, 1:3] = np.sqrt(np.mean(diagonal[:, 1:3] ** 2, axis=1, keepdims=True))
        scaled = A / (diagonal[:, :, None] * diagonal[:, None, :])
        return np.asarray(np.linalg.eigvalsh(scaled)[:, 0] > GIVEN)

    def fit(self, values: Array) -> Array:
        """Coefficients (n, k) by values (p,); zero where they are not determined."""
        b = np.stack([np.bincount(self.row, w * values, self.n) for w in self._weighted], axis=1)
        out, enough = np.zeros(b.shape), self.enough
        out[enough] = np.linalg.solve(self._matrices[enough], b[enough, :, None])[..., 0]
        return out


def with_centres(surface: ContactSurface, values: Array) -> Array:
    """Values at the nodes of each face, and at its centre where that is no node, (nf, k or k + 1, ...).

    The mean of the four nodes nearest to it; none where two or more of these have none.
    """
    of_faces = values[surface.facets]
    if not surface.kind.centreless:
        return of_faces
    near = of_faces[:, -4:]
    known = np.isfinite(near)
    count = known.sum(axis=1)
    mean = np.where(known, near, 0.0).sum(axis=1) / np.maximum(count, 1)
    return np.concatenate([of_faces, np.where(count >= 3, mean, np.inf)[:, None]], axis=1)


def _cut(height: Array, x: Array) -> tuple[Array, Array]:
    """Negative share (t,) of triangles with these heights (t, 3), and the segments where it ends."""
    inside = height < 0
    count = inside.sum(axis=1)
    part = np.where(count == 3, 1.0, 0.0)
    segments = np.zeros((len(height), 2, 3))
    for k in range(3):  # the corner that is alone on its side
        alone = ((count == 1) & inside[:, k]) | ((count == 2) & ~inside[:, k])
        others = [(k + 1) % 3, (k + 2) % 3]
        h, tip = height[alone][:, [k]], x[alone][:, k]
        other = height[alone][:, others]
        with np.errstate(invalid="ignore"):
            way = h / (h - other)
        # the edge is at the closed node where the open one has no partner
        way = np.where(np.isinf(other), 0.0, np.where(np.isinf(h), 1.0, way))
        segments[alone] = tip[:, None] + way[..., None] * (x[alone][:, others] - tip[:, None])
        own = way.prod(axis=1)
        part[alone] = np.where(count[alone] == 1, own, 1.0 - own)
    long = np.any(segments[:, 0] != segments[:, 1], axis=1)
    return part, segments[long]


def _touched(beside: csr_matrix, marked: Mask) -> Mask:
    return np.asarray(beside @ marked.astype(float) > 0)


def _mean_of(beside: csr_matrix, values: Array, marked: Mask) -> Array:
    return np.asarray(beside @ values / np.maximum(beside @ marked.astype(float), 1.0))


def _largest_of(beside: csr_matrix, values: Array) -> Array:
    """The largest of the values, not negative, of each node and those beside it."""
    return np.asarray(beside.multiply(values).tocsr().max(axis=1).toarray().ravel())
