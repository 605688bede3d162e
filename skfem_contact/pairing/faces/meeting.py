"""Where points of one surface of faces meet another: shape functions on both sides, gaps, areas."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from skfem_contact.bodies.facet_kinds import FacetKind
from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.pairing.faces.cells import Cells, local_coordinates
from skfem_contact.pairing.faces.clipping import cross
from skfem_contact.pairing.pieces import Meeting
from skfem_contact.pairing.thresholds import NEWTON_STEPS, SQUARED

Array = NDArray[np.float64]
Index = NDArray[np.intp]


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
