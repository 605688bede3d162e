r"""Fields on a contact surface between its nodes: interpolation, the edge of contact, its area.

**Where does contact end?** A node knows only whether it is closed, which leaves an uncertainty of
one facet. But next to the edge of any contact between smooth surfaces, at the distance ``r``, the
pressure vanishes like ``r**(1/2)`` and the gap opens like ``r**(3/2)``: the leading term of the
elastic field, whatever the bodies and loads. So ``h = gap**(2/3)`` is a straight function of the
distance from the edge. At the nodes around the edge it is replaced by what its values at open nodes
near by say, along the tangents of the node, by least squares with weights 1/distance^4: a line or a
plane, on faces bent along the edge by a parabola, through what lies ahead of the node. Open nodes next
to closed ones are not among these values if there are enough others: their gaps are so small that they
are mostly the error of the mesh. So h has a sign on both sides of the edge. It is interpolated linearly
over pieces of curves and triangles, and its zero is the edge: points, or segments across the triangles
(marching triangles). On Hertz contact this is within .1 of the distance between nodes, wherever the
edge lies; the area of a round contact is found to 2 % with 3 faces to the radius, to 1 % with 6.

Quadratic facets are cut along their nodes, quadrilaterals into the triangles round their centre, so
that no diagonal is preferred. The edge is looked for between the first open node and halfway from
the last closed one to the next; where contact ends because the other surface does, at the last closed
node. Where closed nodes have no others behind them, or too few open ones around, it is in the middle.
Ends of the secondary surface that are closed are no edges.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np
from scipy.sparse import csr_matrix

from skfem_contact.arrays import Array, Index, Mask, across, sizes, tangents, unit_vectors
from skfem_contact.bodies.facet_kinds import positive_functions
from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.digits import COMPUTED, GIVEN
from skfem_contact.pairing.projection import project
from skfem_contact.records import dataclass
from skfem_contact.trees import Tree

#: Open nodes up to so many faces away tell where contact ends: two beyond those next to closed ones.
REACH = 3


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
    few = min(4, len(surface.facets))
    middle = surface.points[surface.facets].mean(axis=1)
    near = np.asarray(Tree(middle).query(points, k=few)[1]).reshape(len(points), few)
    several = np.repeat(points, few, axis=0)
    feet = project(surface, near.ravel(), several)
    distance = np.linalg.norm(several - feet.foot, axis=1)
    best = np.arange(len(points)) * few + distance.reshape(-1, few).argmin(axis=1)
    facet, N = near.ravel()[best], feet.shape[best]
    return np.einsum("pk,pk...->p...", N, np.asarray(values)[surface.facets[facet]])


@dataclass(frozen=True, eq=False)
class Contour:
    """The ends of contact, and its size.

    Attributes
    ----------
    segments : ndarray, shape (s, d - 1, d)
        The edge, in the order of the facets: points on curves, segments on faces [length].
    area : float
        Within it [area].
    heights : ndarray, shape (m,)
        Negative inside, see the function `heights`.
    """

    segments: Array
    area: float
    heights: Array


def contour(
    surface: ContactSurface,
    closed: Mask,
    gap: Array,
    placed: ContactSurface | None = None,
    cover: Array | float = 1.0,
) -> Contour:
    """The edge of contact and the area within.

    Parameters
    ----------
    surface : ContactSurface
    closed : ndarray of bool, shape (m,)
    gap : ndarray, shape (m,)
        ``inf`` where a point has no partner [length].
    placed : ContactSurface, optional
        The surface that has the area, where it is not the same.
    cover : ndarray, shape (nf,), optional
        Share of each facet that may be in contact.
    """
    corners, d = surface.kind.simplices, surface.dim
    h = heights(surface, closed, gap)
    height = with_centres(surface, h)[:, corners].reshape(-1, d)
    x = with_centres(surface, surface.points)[:, corners].reshape(-1, d, d)
    part, segments = _cut(height, x)
    areas = (part * simplex_areas(placed or surface)).reshape(len(surface.facets), -1)
    return Contour(segments, float(np.sum(areas.sum(axis=1) * cover)), h)


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
    mean = beside @ np.where(first, out, 0.0) / np.maximum(beside @ first.astype(float), 1.0)
    lonely = last & ~(fitted & ((fit < 0) | _touched(beside, behind)))
    out[lonely] = -np.maximum(mean[lonely], tiny)
    # where the edge is before the last closed node it is less than halfway to the one behind
    outside = np.where(last, np.maximum(out, 0.0), 0.0)
    most = beside.multiply(outside).tocsr().max(axis=1).toarray().ravel()
    out[behind] = np.minimum(np.where(fitted, fit, -scale)[behind], -np.maximum(most[behind], tiny))
    return out


def neighbours(surface: ContactSurface) -> csr_matrix:
    """Return which nodes share a facet, or a part of a quadratic one, as a matrix of ones (m, m)."""
    m, beside = len(surface.points), csr_matrix((len(surface.points),) * 2)
    for part in surface.kind.parts:
        nodes = surface.facets[:, part]
        of_facet = np.repeat(np.arange(len(nodes)), nodes.shape[1])
        entries = np.ones(nodes.size), (of_facet, nodes.ravel())
        of_parts = csr_matrix(entries, shape=(len(nodes), m))
        beside = beside + of_parts.T @ of_parts
    beside = csr_matrix(beside)
    beside.data[:] = 1.0
    return beside


def weighed_areas(surface: ContactSurface) -> Array:
    """Areas of the facets with the measure of the body, (nf,)."""
    return surface.facet_areas if surface.body.measure is None else surface.shares.sum(axis=1)


def simplex_areas(surface: ContactSurface) -> Array:
    """Areas of the pieces or triangles of all facets, which add up to the facets', (t,)."""
    corners, d, measure = surface.kind.simplices, surface.dim, surface.body.measure
    x = with_centres(surface, surface.points)[:, corners].reshape(-1, d, d)
    area = sizes(across(x[:, 1:] - x[:, :1])) / (d - 1)
    whole = weighed_areas(surface)
    if measure is not None:
        at = with_centres(surface, surface.measured_at)[:, corners].reshape(-1, d, d)
        area = area * measure(at.mean(axis=1).T)
    area = area.reshape(len(surface.facets), -1)
    total = area.sum(axis=1)  # of a facet on the axis of symmetry nothing
    scale = np.divide(whole, total, out=np.zeros_like(total), where=total > 0)
    return np.asarray(area * scale[:, None]).ravel()


def covers(surface: ContactSurface, area: Array, heir: Index, partner: Mask) -> Array:
    """The share of each facet that multipliers with these areas (m,) are on, (nf,).

    The primary covers facets at the end of a mortar interface in part. A multiplier that was handed
    on to its `heir` is a part of that one's area; facets with nodes without a `partner` (m,) have none.
    The shares add up to the areas of all multipliers.
    """
    shares = surface.shares @ positive_functions(surface.kind).T
    shares = np.where(partner[surface.facets].all(axis=1)[:, None], shares, 0.0)
    owner = heir[surface.facets]
    total = np.bincount(owner.ravel(), shares.ravel(), len(area))
    ratio = np.divide(area, total, out=np.zeros_like(total), where=total > 0)
    covered, whole = np.sum(shares * ratio[owner], axis=1), surface.shares.sum(axis=1)
    return np.divide(covered, whole, out=np.zeros_like(whole), where=whole > 0)


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
    slope = unit_vectors(fit[row, 1:])
    ahead = np.einsum("pk,pk->p", along, slope)
    aside = np.linalg.norm(along - ahead[:, None] * slope, axis=1)
    # points of regular faces lie at 45 degrees to the slope: round-off must not choose among them
    weight = np.where(ahead > (1.0 - GIVEN) * aside, weight, 0.0)
    straight, some = least_squares(plane, weight, h[node], row, len(here))
    parabola = np.column_stack([plane, aside**2])
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
    """Negative share (t,) of simplices with these heights (t, d), and where it ends, (s, d - 1, d)."""
    d, inside = x.shape[2], height < 0
    count = inside.sum(axis=1)
    part, ends, met = np.where(count == d, 1.0, 0.0), x[:, 1:].copy(), (count > 0) & (count < d)
    for k in range(d):  # the corner that is alone on its side
        alone = met & (inside[:, k] == (count == 1)) & ((d == 3) | inside[:, k])
        others = np.arange(k + 1, k + d) % d
        h, tip = height[alone][:, [k]], x[alone][:, k]
        other = height[alone][:, others]
        with np.errstate(invalid="ignore"):
            way = h / (h - other)
        # the edge is at the closed node where the open one has no partner
        way = np.where(np.isinf(other), 0.0, np.where(np.isinf(h), 1.0, way))
        ends[alone] = tip[:, None] + way[..., None] * (x[alone][:, others] - tip[:, None])
        own = way.prod(axis=1)
        part[alone] = np.where(count[alone] == 1, own, 1.0 - own)
    met &= (d == 2) | np.any(ends[:, 0] != ends[:, -1], axis=1)
    return part, ends[met]


def _touched(beside: csr_matrix, marked: Mask) -> Mask:
    return np.asarray(beside @ marked.astype(float) > 0)
