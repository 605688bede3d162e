r"""Segmentation of an interface: the pieces on which one facet meets one facet, and integrals there.

A point x of the secondary surface meets the point y of the primary that lies on the line along the
secondary's normal, interpolated between its corners like the position (`cells`). The field is
continuous, so the map is one to one: nothing of the primary is left out between two facets and nothing
counted twice, which it would be along the facets' own normals. On flat surfaces the two are the same.
At a corner or an edge of 45 degrees or more each facet keeps its own normal.

1. The corners of the primary's cells are moved along such lines into the plane of a secondary cell.
2. There the polygons (of curves: intervals) are cut with the cell (`clipping`). As all facets of the
   primary share the images of their corners, the pieces cover the cell without gaps, whatever the
   surfaces are.
3. The pieces are cut into triangles with Gauss points, which meet the primary along their own normal.

On flat interfaces pieces are exact. On curved ones the images of edges are curves, and straight lines
stand in for them: some points then meet the continuation of a face in place of its neighbour, which
are one and the same at their common edge. Their distance is of the second order in the size of a
face times that of the surfaces; zero where surfaces touch and faces are straight, and between curves.

Integrands are polynomials on lines, plane triangles and parallelograms with one normal, and the
quadrature is exact for them (degree 5, more for quadratic facets). On other quadrilaterals shape
functions have roots of polynomials in them: there triangles are smaller and the degree is 12, which
leaves an error of 1e-10 in the worst of those whose corners were moved by a quarter of their size. On
parts of curved facets all is nearly polynomial, and degree 10 leaves 1e-10.

Where a line meets the primary more than once (two layers), the meeting closest to the secondary counts.

References
----------
M. A. Puso, T. A. Laursen, Comput. Methods Appl. Mech. Engrg 193 (2004) 601-629: segments in planes.
B. Yang, T. A. Laursen, X. Meng, Int. J. Numer. Meth. Engng 62 (2005) 1183-1225: continuous normals.
M. A. Puso, T. A. Laursen, J. Solberg, Comput. Methods Appl. Mech. Engrg 197 (2008) 555-566: quadratic
faces in parts.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import cached_property

import numpy as np

from skfem_contact.arrays import Array, Index, cross, dot, runs, sizes, summed, unit
from skfem_contact.bodies.facet_kinds import KINDS, FacetKind
from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.digits import COMPUTED, NEWTON_STEPS, SINGLE
from skfem_contact.errors import InputError
from skfem_contact.pairing.cells import (
    AFFINE,
    PART,
    SKEW,
    Cells,
    cells_along_normals,
    local_coordinates,
)
from skfem_contact.pairing.clipping import (
    Polygons,
    clip,
    nearest_parts,
    plane_cross,
    several_sheets,
    signed_areas,
)
from skfem_contact.pairing.closest import search_range
from skfem_contact.pairing.search import FACING
from skfem_contact.records import dataclass

# Degrees of the quadrature: at least, in parts of curved facets, and by how much more than for
# polynomials on faces that are neither parallelograms nor triangles.
LEAST, CURVED, ROOTS = 5, 10, 7

# Degree of heights, squares of coordinates; they are integrated with linear or bilinear functions.
HEIGHTS = 2


@dataclass(frozen=True, eq=False)
class Meeting:
    """Points of the secondary and what their normals meet: n points for each of p pairs of cells.

    Attributes
    ----------
    e, f : ndarray of int, shape (p,)
        Facets of the secondary and of the primary.
    N, M : ndarray, shapes (p, n, k) and (p, n, k')
        Shape functions of their nodes; beyond the ends or edges of a facet they are continued.
    normal : ndarray, shape (p, n, d), or (p, 1, d)
        The normal field of the secondary, not of unit length, in the coordinates of its cells.
    nodes : (ndarray, ndarray), shapes (p, k, d) and (p, k', d)
        Positions of the nodes of both, in the same coordinates [length].
    axes : ndarray, shape (p, d, d)
        The axes of these coordinates.
    at : (ndarray, ndarray), shapes (p, n, c) and (p, n, c, d-1)
        Shape functions of the corners of the secondary's cells, and their derivatives.
    """

    e: Index
    f: Index
    N: Array
    M: Array
    normal: Array
    nodes: tuple[Array, Array]
    axes: Array
    at: tuple[Array, Array]

    @property
    def gap(self) -> Array:
        """Distance along the normal, > 0 open, shape (p, n) [length]."""
        away = self.M @ self.nodes[1] - self.N @ self.nodes[0]
        return np.asarray(np.sum(away * self.normal, axis=-1) / np.linalg.norm(self.normal, axis=-1))

    @property
    def directions(self) -> Array:
        """Unit vectors along the normals in the coordinates of space, shape (p, n, d)."""
        normal = self.normal @ self.axes
        return np.broadcast_to(unit(normal), (*self.N.shape[:2], normal.shape[-1]))


@dataclass(frozen=True, eq=False)
class Segmentation:
    """Polygons in the planes of the secondary's cells, each below one cell of the primary.

    Attributes
    ----------
    secondary, primary : ContactSurface
        Both curves, or both faces.
    cells : (Cells, Cells)
        Of both surfaces.
    e, f : ndarray of int, shape (p,)
        Cells of the secondary and of the primary.
    pieces : Polygons
        In the planes of the secondary's cells.
    """

    secondary: ContactSurface
    primary: ContactSurface
    cells: tuple[Cells, Cells]
    e: Index
    f: Index
    pieces: Polygons

    @property
    def facets(self) -> tuple[Index, Index]:
        """Facets of the secondary and of the primary that each piece is part of, (p,) each."""
        return self.cells[0].facet[self.e], self.cells[1].facet[self.f]

    def points(
        self, some: Index | None = None, heights: bool = False
    ) -> Iterator[tuple[Index, Meeting, Array]]:
        """Yield quadrature points, those of some pieces at a time, triangle by triangle.

        Those of heights are, between quadrilaterals, on triangles round the middles of pieces, which do
        not depend on the corner that a piece begins at.

        Parameters
        ----------
        some : ndarray of int, optional
            Only of these pieces.
        heights : bool
            For integrals of heights (`smooth`), else for those of rows.

        Yields
        ------
        piece : ndarray of int, shape (t,)
            The piece that each of t triangles, or intervals, belongs to; ascending.
        meeting : Meeting
            Of n points for each of them.
        weight : ndarray, shape (t, n)
            Weights times area, times the secondary body's ``measure`` [area].
        """
        shape = np.maximum(self.cells[0].shape[self.e], self.cells[1].shape[self.f])
        chosen = np.arange(len(shape)) if some is None else some
        if heights and not (self.secondary.kind.straight and self.primary.kind.straight):
            shape = np.full_like(shape, SKEW)
        for kind in (AFFINE, PART, SKEW):
            mine = chosen[shape[chosen] == kind]
            if not len(mine):
                continue
            whose, simplices = self.pieces.some(mine).simplices(round_middle=kind == SKEW)
            at, w = self._rule(kind, heights)
            for part in runs(len(whose), 500 * len(w)):  # what a point takes, about
                of, corners = mine[whose[part]], simplices[part]
                points = self.meet(of, at @ corners)
                yield of, points, signed_areas(corners)[:, None] * w * self._stretch(of, points)

    def corners(self, some: Index) -> Meeting:
        """Return what meets at the ends or corners of some pieces."""
        return self.meet(some, self.pieces.corners[some])

    def beyond(self, some: Index) -> Array:
        """Return how far nodes are beyond some pieces of their facets, in the planes, shape (p, k)."""
        return self.pieces.some(some).beyond(self._seen(some))

    def nodes(self, some: Index, local: Index) -> Meeting:
        """Return what normals at nodes meet, one of the facet of each piece, if its partner went on."""
        return self.meet(some, self._seen(some)[np.arange(len(some)), local][:, None])

    def _seen(self, some: Index) -> Array:
        """Nodes of the facets of some pieces in the planes of their cells, (p, k, d-1)."""
        x, own = self.secondary.points[self.secondary.facets[self.facets[0][some]]], self.cells[0]
        X = own.local(self.e[some], x)[..., :-1]
        if own.bow is not None:
            X[:, 2] -= own.bow[self.e[some], :-1]
        return X

    def some(self, chosen: Index) -> Segmentation:
        """These pieces, in this order."""
        of, pieces = (self.e[chosen], self.f[chosen]), self.pieces.some(chosen)
        return Segmentation(self.secondary, self.primary, self.cells, *of, pieces)

    def gaps(self, some: Index, X: Array) -> Array:
        """Gaps along the normals at places X (p, d-1) in the planes of some pieces, (p,) [length]."""
        return self.meet(some, X[:, None]).gap[:, 0]

    def meet(self, some: Index, X: Array) -> Meeting:
        """Return what normals at places X (p, n, d-1) in the planes of some pieces meet."""
        secondary, primary, (own, other) = self.secondary, self.primary, self.cells
        e, f = self.e[some], self.f[some]
        # `take` gathers rows in a fraction of the time of an index
        facets = own.facet[e], other.facet[f]
        nodes, opposite = (
            own.local(e, surface.points.take(surface.facets.take(facet, axis=0), axis=0))
            for surface, facet in zip((secondary, primary), facets, strict=True)
        )
        corners = own.corners.take(e, axis=0)[:, None, :, :-1]
        at, slopes = own.kind.shapes(local_coordinates(corners, X))
        N = at
        if secondary.kind.quadratic:
            N = secondary.kind.shapes(at @ own.reference[e])[0]
        # in the plane of the cell, as seen along the normal
        normal, slope = own.normals.take(e, axis=0), None
        if own.parallel[e].all():
            normal, x = normal[:, :1], (N @ nodes)[..., :-1] if secondary.kind.quadratic else X
        else:
            normal = at @ normal
            slope = normal[..., :-1] / normal[..., -1:]
            x = N @ nodes
            x = x[..., :-1] - x[..., -1:] * slope
        seen = _seen(opposite, slope)
        if not primary.kind.quadratic:
            eta = local_coordinates(seen, x)
        elif primary.dim == 2:
            eta = _on_parabola(seen[..., 0] - x)
        else:
            corners = _seen(own.local(e, other.positions.take(f, axis=0)), slope)
            M = other.kind.shapes(local_coordinates(corners, x))[0]
            eta = _solve(primary.kind, seen, x, M @ other.reference[f])
        M = primary.kind.shapes(eta)[0]
        axes = own.axes.take(e, axis=0)
        return Meeting(*facets, N, M, normal, (nodes, opposite), axes, (at, slopes))

    def _rule(self, shape: int, heights: bool) -> tuple[Array, Array]:
        """Barycentric coordinates (n, d) and weights (n,) of Gauss points of a simplex."""
        own, other = (surface.kind.order for surface in (self.secondary, self.primary))
        # products of two shape functions of the secondary, or of one and one of the primary, and a
        # `measure` linear in the position
        degree = max(LEAST, own + max(own, other) + 1)
        degree = {AFFINE: degree, PART: max(CURVED, degree), SKEW: degree + ROOTS}[shape]
        simplex = KINDS["line2" if self.secondary.dim == 2 else "tri3"]
        if heights:  # on intervals one more point is worth four digits of the gaps of circles
            degree = HEIGHTS + min(max(own, other), KINDS["quad4"].order)
            degree = max(LEAST, degree) if simplex.dim == 1 else degree
        xi, w = simplex.quadrature(degree)
        return simplex.shapes(xi)[0], w / w.sum()

    def _stretch(self, some: Index, points: Meeting) -> Array:
        """Area of facets, times the body's ``measure``, for the area in the planes of cells, (t, n)."""
        surface, own, cell = self.secondary, self.cells[0], self.e[some]
        out = np.ones(points.N.shape[:2])
        bent, measure = np.flatnonzero(~own.plane[cell]), surface.body.measure
        if len(bent):
            of, (at, slopes) = cell[bent], (part[bent] for part in points.at)
            dN, nodes = slopes, surface.points[surface.facets[own.facet[of]]]
            if surface.kind.quadratic:
                dN = surface.kind.shapes(at @ own.reference[of])[1]
            reference, plane = (
                _determinants(_slopes(slopes, x[of])) for x in (own.reference, own.corners[..., :-1])
            )
            ways = _slopes(dN, nodes)
            size = sizes(ways[0] if len(ways) == 1 else cross(*ways))
            out[bent] = size * reference / plane
        if measure is not None:
            nodes = surface.measured_at[surface.facets[own.facet[cell]]]
            out *= measure(np.moveaxis(points.N @ nodes, -1, 0))
        return out


def segment(
    secondary: ContactSurface, primary: ContactSurface, reach: float | None = None
) -> Segmentation:
    """Find all parts of the secondary that the primary covers.

    Parameters
    ----------
    secondary, primary : ContactSurface
    reach : float, optional
        Longest distance along the normal [length]. Without it gaps are unlimited, and overlaps go
        up to half the diagonal of the box around the smaller surface, as in `node_to_segment`.
    """
    if secondary.dim != primary.dim:
        raise InputError(
            f"Mortar contact between '{secondary.label}' in {secondary.dim}-D and '{primary.label}' in "
            f"{primary.dim}-D: both are curves, or both are faces of solids."
        )
    limits = search_range(secondary, primary, reach)
    cells = own, other = Cells.of(secondary), Cells.of(primary)
    e, f = cells_along_normals(own, primary, other, max(limits))
    # clockwise, as what faces the secondary is seen from there, turned round
    images = own.images(e, own.local(e, other.positions[f][:, ::-1]))
    windows = own.corners[e][:, :, :-1]
    there = signed_areas(images) > 0  # False for nan
    for axis in range(own.kind.dim):
        there &= images[..., axis].max(axis=1) > windows[..., axis].min(axis=1)
        there &= images[..., axis].min(axis=1) < windows[..., axis].max(axis=1)
    e, f, images, windows = e[there], f[there], images[there], windows[there]
    pieces = clip(images, windows)
    some = np.flatnonzero(pieces.areas > COMPUTED * own.areas[e])
    e, f, pieces = e[some], f[some], pieces.some(some).plain(COMPUTED * own.areas[e[some]])
    found = Segmentation(secondary, primary, cells, e, f, pieces)
    gap = found.gaps(np.arange(len(e)), pieces.middles)
    looks = dot(own.axes[e, -1], other.axes[f, -1])
    near = np.flatnonzero((looks < -FACING) & (gap <= limits[0]) & (gap >= -limits[1]))
    found = found.some(near)
    rivals = several_sheets(found.e, primary.facets[found.facets[1], : primary.kind.corners])
    if not rivals:
        return found
    of, pieces = nearest_parts(found.pieces, rivals, found.gaps)
    found = replace(found.some(of), pieces=pieces)
    return found.some(np.flatnonzero(pieces.areas > COMPUTED * own.areas[found.e]))


def _seen(points: Array, slope: Array | None) -> Array:
    """Points (p, k, d) moved into the plane along directions of slopes (p, n, d-1); (p, n, k, d-1)."""
    flat = points[:, None, :, :-1]
    return flat if slope is None else flat - points[:, None, :, -1:] * slope[:, :, None]


def _solve(kind: FacetKind, seen: Array, target: Array, eta: Array) -> Array:
    """Reference coordinates where facets with nodes ``seen`` (p, n, k, d-1) are at ``target``."""
    for _ in range(NEWTON_STEPS):
        M, dM = kind.shapes(eta)
        away = target - (M[..., None, :] @ seen)[..., 0, :]
        ways = list(np.moveaxis(np.swapaxes(dM, -1, -2) @ seen, -2, 0))
        # Cramer's rule: each way in turn gives place to what is missing
        other = [[*ways[:i], away, *ways[i + 1 :]] for i in range(kind.dim)]
        step = np.stack([_determinants(part) for part in other], axis=-1)
        step /= _determinants(ways)[..., None]
        # curved facets end where they fold; half a facet beyond the edge nothing is asked for
        new = np.clip(eta + step, -0.5, 1.5)
        change, eta = np.abs(new - eta).max(initial=0.0), new
        if change <= SINGLE:
            break
    return eta


def _on_parabola(c: Array) -> Array:
    """Reference coordinates at which quadratic lines with nodal values c (..., 3) are zero.

    Of ``a eta^2 + b eta + c0`` the root where it goes the way it goes from end to end, in the form
    without loss. Where the parabola ends before it is zero, its vertex.
    """
    c0, a = c[..., 0], 2 * (c[..., 0] + c[..., 1]) - 4 * c[..., 2]
    b = c[..., 1] - c0 - a
    root = np.sqrt(np.maximum(b**2 - 4 * a * c0, 0.0))
    surd = np.where(c[..., 1] >= c0, root, -root)
    with np.errstate(divide="ignore", invalid="ignore"):
        eta = np.where(b * surd > 0, -2 * c0 / (b + surd), (surd - b) / (2 * a))
    # half a facet beyond the end nothing is asked for
    return np.clip(np.where(np.isnan(eta), 0.5, eta), -0.5, 1.5)[..., None]


def _slopes(dN: Array, nodes: Array) -> list[Array]:
    """Derivatives of positions by each reference coordinate, (p, n, d) each, of nodes (p, k, d)."""
    return [np.ascontiguousarray(dN[..., i]) @ nodes for i in range(dN.shape[-1])]


def _determinants(ways: list[Array]) -> Array:
    """Lengths of one way on a line, (..., 1), areas between two in a plane, (..., 2); shape (...)."""
    return ways[0][..., 0] if len(ways) == 1 else plane_cross(*ways)


@dataclass(frozen=True, eq=False)
class Moments:
    """Integrals of products of shape functions over the pieces of an interface.

    Attributes
    ----------
    pieces : Segmentation
    e, f : ndarray of int, shape (p,)
        Facets of the secondary and of the primary that each piece is part of.
    own : ndarray, shape (nf, k, k)
        ``int N_i N_j`` over the covered part of each facet of the secondary [area].
    inside : ndarray, shape (p, k, k)
        The same over each piece [area].
    cross : ndarray, shape (p, k, k')
        ``int N_i N_j^primary`` over each piece [area].
    """

    pieces: Segmentation
    e: Index
    f: Index
    own: Array
    inside: Array
    cross: Array

    @cached_property
    def covered(self) -> Index:
        """Facets of the secondary with a part that is covered, ascending."""
        return np.flatnonzero(np.bincount(self.e, minlength=len(self.own)))

    @classmethod
    def of(cls, pieces: Segmentation) -> Moments:
        """Integrate over all pieces."""
        e, f = pieces.facets
        nf, k = pieces.secondary.facets.shape
        p, k_other = len(e), pieces.primary.facets.shape[1]
        own, across = np.zeros((p, k * k)), np.zeros((p, k * k_other))
        for piece, points, weight in pieces.points():
            weighted = np.swapaxes(points.N * weight[..., None], 1, 2)
            own += summed(piece, (weighted @ points.N).reshape(len(piece), k * k), p)
            across += summed(piece, (weighted @ points.M).reshape(len(piece), k * k_other), p)
        whole = summed(e, own, nf).reshape(nf, k, k)
        return cls(pieces, e, f, whole, own.reshape(p, k, k), across.reshape(p, k, k_other))
