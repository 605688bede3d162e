r"""Segmentation of an interface between faces: the pieces on which one face meets one face.

A point of the secondary surface meets the point of the primary that lies on the line along the
secondary's normal field (`cells`), as in 2-D: the field is continuous, so nothing of the primary is
left out between two faces and nothing counted twice. At an edge of 45 degrees or more each face keeps
its own normal.

1. The corners of the primary's cells are moved along such lines into the plane of a secondary cell.
2. There the polygons are cut with the cell (`clipping`). As all faces of the primary share the images
   of their corners, the pieces cover the cell without gaps, whatever the surfaces are.
3. The pieces are cut into triangles with Gauss points, which meet the primary along their own normal.

On flat interfaces pieces are exact. On curved ones the images of edges are curves, and straight lines
stand in for them: some points then meet the continuation of a face in place of its neighbour, which
are one and the same at their common edge. Their distance is of the second order in the size of a
face times that of the surfaces; zero where surfaces touch and faces are straight.

Integrands are polynomials on plane triangles and parallelograms with one normal, and the quadrature
is exact for them (degree 5, more for quadratic faces). On other quadrilaterals shape functions have
roots of polynomials in them: there triangles are smaller and the degree is 12, which leaves an
error of 1e-10 in the worst of those whose corners were moved by a quarter of their size. On parts
of curved faces all is nearly polynomial, and degree 10 leaves 1e-10.

Where a line meets the primary more than once (two layers), the meeting closest to the secondary counts.

References
----------
M. A. Puso, T. A. Laursen, Comput. Methods Appl. Mech. Engrg 193 (2004) 601-629: segments in planes.
B. Yang, T. A. Laursen, X. Meng, Int. J. Numer. Meth. Engng 62 (2005) 1183-1225: continuous normals.
M. A. Puso, T. A. Laursen, J. Solberg, Comput. Methods Appl. Mech. Engrg 197 (2008) 555-566: quadratic
faces in parts.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray

from skfem_contact.bodies.facet_kinds import KINDS, FacetKind
from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.digits import COMPUTED
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
    cross,
    nearest_parts,
    several_sheets,
    signed_areas,
)
from skfem_contact.pairing.closest import search_range
from skfem_contact.pairing.pieces import Meeting, Pieces
from skfem_contact.pairing.thresholds import FACING, NEWTON_STEPS, POINTS_AT_ONCE, SQUARED
from skfem_contact.records import dataclass

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Mask = NDArray[np.bool_]

# Degrees of the quadrature: at least, in parts of curved faces, and by how much more than for
# polynomials on faces that are neither parallelograms nor triangles.
LEAST, CURVED, ROOTS = 5, 10, 7

# Degree of heights, squares of coordinates; they are integrated with linear or bilinear functions.
HEIGHTS = 2


@dataclass(frozen=True, eq=False)
class Segmentation(Pieces):
    """Polygons in the planes of the secondary's cells, each below one cell of the primary.

    Attributes
    ----------
    secondary, primary : ContactSurface
    cells : (Cells, Cells)
        Of both surfaces.
    e, f : ndarray of int, shape (p,)
        Cells of the secondary and of the primary.
    pieces : Polygons
        In the planes of the secondary's cells.
    """

    cells: tuple[Cells, Cells]
    e: Index
    f: Index
    pieces: Polygons

    @property
    def facets(self) -> tuple[Index, Index]:
        """Faces of the secondary and of the primary that each piece is part of, (p,) each."""
        return self.cells[0].facet[self.e], self.cells[1].facet[self.f]

    def points(
        self, some: Index | None = None, heights: bool = False
    ) -> Iterator[tuple[Index, Meeting, Array]]:
        """Yield quadrature points triangle by triangle, see `Pieces.points`.

        Those of heights are, between quadrilaterals, on triangles round the middles of pieces, which do
        not depend on the corner that a piece begins at.
        """
        shape = np.maximum(self.cells[0].shape[self.e], self.cells[1].shape[self.f])
        chosen = np.arange(len(shape)) if some is None else some
        if heights and not (self.secondary.kind.straight and self.primary.kind.straight):
            shape = np.full_like(shape, SKEW)
        for kind in np.unique(shape[chosen]):
            mine = chosen[shape[chosen] == kind]
            whose, triangles = self.pieces.some(mine).fans(round_middle=kind == SKEW)
            at, w = self._rule(kind, heights)
            step = max(1, POINTS_AT_ONCE // len(w))
            for first in range(0, len(whose), step):
                of, corners = mine[whose[first : first + step]], triangles[first : first + step]
                points = self._meet(of, at @ corners)
                weight = 2 * signed_areas(corners)[:, None] * w
                yield of, points, weight * stretch(self.secondary, self.cells[0], self.e[of], points)

    def corners(self, some: Index) -> Meeting:
        """Return what meets at the corners of some pieces."""
        return self._meet(some, self.pieces.corners[some])

    def distances(self, some: Index) -> Array:
        """Return how far nodes are from some pieces of their faces, in the planes of cells, (p, k)."""
        return self.pieces.some(some).distances(self._seen(some))

    def nodes(self, some: Index, local: Index) -> Meeting:
        """Return what normals at nodes meet, one of the face of each piece, if its partner went on."""
        return self._meet(some, self._seen(some)[np.arange(len(some)), local][:, None])

    def _seen(self, some: Index) -> Array:
        """Nodes of the faces of some pieces in the planes of their cells, (p, k, 2)."""
        x = self.secondary.points[self.secondary.facets[self.facets[0][some]]]
        return self.cells[0].local(self.e[some], x)[..., :2]

    def _meet(self, some: Index, X: Array) -> CellMeeting:
        return meet(self.secondary, self.primary, self.cells, self.e[some], self.f[some], X)

    def _rule(self, shape: int, heights: bool) -> tuple[Array, Array]:
        """Barycentric coordinates (n, 3) and weights (n,) of Gauss points of a triangle."""
        own, other = (surface.kind.order for surface in (self.secondary, self.primary))
        # products of two shape functions of the secondary, or of one and one of the primary, and a
        # `measure` linear in the position
        degree = max(LEAST, own + max(own, other) + 1)
        degree = {AFFINE: degree, PART: max(CURVED, degree), SKEW: degree + ROOTS}[shape]
        if heights:
            degree = HEIGHTS + min(max(own, other), KINDS["quad4"].order)
        xi, w = KINDS["tri3"].quadrature(degree)
        return KINDS["tri3"].shapes(xi)[0], w


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
    limits = search_range(secondary, primary, reach)
    cells = own, other = Cells.of(secondary), Cells.of(primary)
    e, f = cells_along_normals(own, primary, other, max(limits))
    # clockwise, as what faces the secondary is seen from there, turned round
    images = own.images(e, own.local(e, other.positions[f][:, ::-1]))
    windows = own.corners[e][:, :, :2]
    there = signed_areas(images) > 0  # False for nan
    for axis in (0, 1):
        there &= images[..., axis].max(axis=1) > windows[..., axis].min(axis=1)
        there &= images[..., axis].min(axis=1) < windows[..., axis].max(axis=1)
    e, f, images, windows = e[there], f[there], images[there], windows[there]
    pieces = clip(images, windows)
    some = np.flatnonzero(pieces.areas > COMPUTED * own.areas[e])
    e, f, pieces = e[some], f[some], pieces.some(some).plain(COMPUTED * own.areas[e[some]])
    gaps = partial(_gaps, secondary, primary, cells)
    gap = gaps(e, f, pieces.middles)
    looks = np.sum(own.axes[e, 2] * other.axes[f, 2], axis=1)
    near = np.flatnonzero((looks < -FACING) & (gap <= limits[0]) & (gap >= -limits[1]))
    e, f, pieces = e[near], f[near], pieces.some(near)
    rivals = several_sheets(e, primary.facets[other.facet[f], : primary.kind.corners])
    if rivals:
        of, pieces = nearest_parts(pieces, rivals, lambda i, X: gaps(e[i], f[i], X))
        e, f = e[of], f[of]
        some = np.flatnonzero(pieces.areas > COMPUTED * own.areas[e])
        e, f, pieces = e[some], f[some], pieces.some(some)
    return Segmentation(secondary, primary, cells, e, f, pieces)


def _gaps(
    secondary: ContactSurface,
    primary: ContactSurface,
    cells: tuple[Cells, Cells],
    e: Index,
    f: Index,
    X: Array,
) -> Array:
    """Gaps along the normals at places X (p, 2) in the planes of cells e, to cells f."""
    return meet(secondary, primary, cells, e, f, X[:, None]).gap[:, 0]


@dataclass(frozen=True, eq=False)
class CellMeeting(Meeting):
    """A `Meeting` of cells, in the coordinates of those of the secondary.

    Attributes
    ----------
    at : (ndarray, ndarray), shapes (p, n, c) and (p, n, c, 2)
        Shape functions of the corners of the secondary's cells, and their derivatives.
    """

    at: tuple[Array, Array]


def meet(
    secondary: ContactSurface,
    primary: ContactSurface,
    cells: Sequence[Cells],
    e: Index,
    f: Index,
    X: Array,
) -> CellMeeting:
    """Points of the secondary's cells on the primary, along the normal field.

    Parameters
    ----------
    secondary, primary : ContactSurface
    cells : (Cells, Cells)
        Of both.
    e, f : ndarray of int, shape (p,)
        Cells of each.
    X : ndarray, shape (p, n, 2)
        Places in the planes of the cells e.
    """
    own, other = cells
    # `take` gathers rows in a fraction of the time of an index
    faces = own.facet[e], other.facet[f]
    nodes, opposite = (
        own.local(e, surface.points.take(surface.facets.take(face, axis=0), axis=0))
        for surface, face in zip((secondary, primary), faces, strict=True)
    )
    at, slopes = own.kind.shapes(local_coordinates(own.corners.take(e, axis=0)[:, None, :, :2], X))
    N, x = at, X
    if secondary.kind.quadratic:
        N = secondary.kind.shapes(at @ own.reference[e])[0]
        x = N @ nodes
    # in the plane of the cell, as seen along the normal
    normal, slope = own.normals.take(e, axis=0), None
    if own.parallel[e].all():
        normal = normal[:, :1]
    else:
        normal = at @ normal
        slope = normal[..., :2] / normal[..., 2:]
        x = N @ nodes
        x = x[..., :2] - x[..., 2:] * slope
    seen = _seen(opposite, slope)
    corners = (
        _seen(own.local(e, other.positions.take(f, axis=0)), slope) if primary.kind.quadratic else seen
    )
    M = other.kind.shapes(local_coordinates(corners, x[..., :2]))[0]
    if primary.kind.quadratic:
        eta = _solve(primary.kind, seen, x[..., :2], M @ other.reference[f])
        M = primary.kind.shapes(eta)[0]
    return CellMeeting(*faces, N, M, normal, (nodes, opposite), own.axes.take(e, axis=0), (at, slopes))


def _seen(points: Array, slope: Array | None) -> Array:
    """Points (p, k, 3) moved into the plane along directions of slopes (p, n, 2); (p, n, k, 2)."""
    flat = points[:, None, :, :2]
    return flat if slope is None else flat - points[:, None, :, 2:] * slope[:, :, None]


def _solve(kind: FacetKind, seen: Array, target: Array, eta: Array) -> Array:
    """Reference coordinates where faces with nodes ``seen`` (p, n, k, 2) are at ``target``."""
    for _ in range(NEWTON_STEPS):
        M, dM = kind.shapes(eta)
        away = target - (M[..., None, :] @ seen)[..., 0, :]
        first, second = np.moveaxis(np.swapaxes(dM, -1, -2) @ seen, -2, 0)
        area = cross(first, second)
        step = np.stack([cross(away, second), cross(first, away)], axis=-1) / area[..., None]
        # curved faces end where they fold; half a face beyond the edge nothing is asked for
        new = np.clip(eta + step, -0.5, 1.5)
        change, eta = np.abs(new - eta).max(initial=0.0), new
        if change <= SQUARED:
            break
    return eta


def stretch(surface: ContactSurface, cells: Cells, cell: Index, points: CellMeeting) -> Array:
    """Area of faces, times the body's ``measure``, for the area in the planes of cells, (p, n).

    Parameters
    ----------
    surface : ContactSurface
    cells : Cells
        Of the surface.
    cell : ndarray of int, shape (p,)
    points : CellMeeting
        Of points on these cells.
    """
    out = np.ones(points.N.shape[:2])
    bent, measure = np.flatnonzero(~cells.plane[cell]), surface.body.measure
    if len(bent):
        of, (at, slopes) = cell[bent], (part[bent] for part in points.at)
        dN, nodes = slopes, surface.points[surface.facets[cells.facet[of]]]
        if surface.kind.quadratic:
            dN = surface.kind.shapes(at @ cells.reference[of])[1]
        reference, plane = (
            cross(*_along(slopes, corners[of])) for corners in (cells.reference, cells.corners[..., :2])
        )
        out[bent] = np.linalg.norm(np.cross(*_along(dN, nodes)), axis=-1) * reference / plane
    if measure is not None:
        nodes = surface.points[surface.facets[cells.facet[cell]]]
        out *= measure(np.moveaxis(points.N @ nodes, -1, 0))
    return out


def _along(dN: Array, nodes: Array) -> tuple[Array, Array]:
    """Derivatives of positions by both reference coordinates, (p, n, d) each, of nodes (p, k, d)."""
    first, second = (np.ascontiguousarray(dN[..., i]) @ nodes for i in range(2))
    return first, second
