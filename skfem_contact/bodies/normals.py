"""Lengths, outward normals and tributary areas of a curve; tangents in both dimensions."""

from __future__ import annotations

from typing import Any

import numpy as np

from skfem_contact.arguments import numbers
from skfem_contact.bodies.facets import facet_shapes
from skfem_contact.bodies.thresholds import ALIKE, CORNER, STEEPEST, STRAIGHT
from skfem_contact.digits import SOLVED
from skfem_contact.errors import InputError

#: Gauss points per facet for the areas: exact up to order 9, so also for a curved quadratic facet
#: (whose length element is no polynomial) far below the error of its geometry.
GAUSS = np.polynomial.legendre.leggauss(5)


def normals_at(points: np.ndarray, facets: np.ndarray, xi: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Outward unit normals (nf, q, d) and length elements dx/dxi (nf, q) at coordinates (q,)."""
    if facets.shape[1] == 2:  # the same all along, so it is computed once
        tangent = (points.take(facets[:, 1], axis=0) - points.take(facets[:, 0], axis=0))[:, None]
    else:
        tangent = np.einsum("qk,fkd->fqd", facet_shapes(xi, facets.shape[1])[1], points[facets])
    x, y = tangent[..., 0], tangent[..., 1]
    speed = sizes(tangent)
    # the body is on the left, so outward is to the right of the direction of travel
    normal = np.empty((len(facets), len(xi), 2))
    np.divide(y, speed, out=normal[..., 0])
    np.divide(-x, speed, out=normal[..., 1])
    normal += 0.0  # turns -0.0 into 0.0
    return normal, np.repeat(speed, len(xi), axis=1) if facets.shape[1] == 2 else speed


def tangents(normal: np.ndarray) -> np.ndarray:
    """Unit tangents (m, d-1, d) to normals (m, d).

    In 2-D the normal rotated by +90 degrees. In 3-D the projection of the axis that the normal has
    least of, and what makes a right-handed frame with both: a choice on which no answer depends.

    >>> tangents(np.array([[0.0, 1.0]])).tolist()
    [[[-1.0, 0.0]]]
    >>> tangents(np.array([[0.0, 0.0, 1.0]])).tolist()
    [[[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]]
    """
    if normal.shape[1] == 3:
        axis = np.eye(3)[np.argmin(np.abs(normal), axis=1)]
        first = unit(axis - np.einsum("md,md->m", axis, normal)[:, None] * normal)
        return np.stack([first, np.cross(normal, first)], axis=1) + 0.0
    return np.stack([-normal[:, 1], normal[:, 0]], axis=1)[:, None, :]


def lengths_and_normals(
    points: np.ndarray, facets: np.ndarray, held: np.ndarray, neighbours: np.ndarray
) -> dict[str, Any]:
    """Lengths and normals: what changes when the surface moves."""
    gauss, weight = 0.5 * (GAUSS[0] + 1), 0.5 * GAUSS[1]
    lengths = normals_at(points, facets, gauss)[1] @ weight
    own = normals_at(points, facets, np.array([0.0, 0.5, 1.0]))[0]
    ends = own[:, [0, 2]]

    averaged = ends.copy()
    there = ends[neighbours, [1, 0]]
    smooth = (neighbours >= 0) & (np.einsum("fsd,fsd->fs", ends, there) >= CORNER)
    # a facet's normal is exact at its middle, so the nearer, shorter facet counts more: this is
    # exact on a circle, and of second order on any smooth curve
    mean = lengths.take(neighbours)[..., None] * ends + lengths[:, None, None] * there
    averaged[smooth] = unit(mean[smooth])

    last = (neighbours < 0) & (neighbours[:, ::-1] >= 0)
    last &= np.count_nonzero(held.take(facets[:, :2], axis=0), axis=2) == 1
    for side in np.flatnonzero(last.any(axis=0)).tolist():
        mirrored = last[:, side] & _on_symmetry(own[:, 1], lengths, facets, held, neighbours, side)
        # the average with the mirror image, without which the end node would be constrained along
        # the normal of a chord
        image = np.where(held[facets[mirrored, side]], 0.0, ends[mirrored, side])
        ends[mirrored, side] = averaged[mirrored, side] = unit(image)

    total = np.zeros_like(points)
    np.add.at(total, facets[:, :2], lengths.min() / lengths[:, None, None] * ends)
    if facets.shape[1] == 3:
        total[facets[:, 2]] = own[:, 1]
    # two sides back to back (a crack tip) cancel: then the side met last decides
    lost = sizes(total) <= SOLVED * lengths.min() / lengths.max()
    fallback = np.zeros_like(points)
    fallback[facets[:, :2]] = ends
    total[lost] = fallback[lost]
    return {
        "facet_normals": own[:, 1],
        "normals": unit(total),
        "facet_node_normals": averaged,
        "lengths": lengths,
    }


def _on_symmetry(
    middle: np.ndarray,
    lengths: np.ndarray,
    facets: np.ndarray,
    held: np.ndarray,
    before: np.ndarray,
    side: int,
) -> np.ndarray:
    """Facets (nf,) of a curved surface that, if it ends here, does so on a line of symmetry.

    There one component of the last node is prescribed, and the normal, continued from the middles
    of the last two facets to the end, has none of it left. A straight inclined surface that ends
    at a roller is not meant: its normal stays as it is.
    """
    inner = before[:, 1 - side]
    here = held[facets[:, side]]
    smooth = np.einsum("fd,fd->f", middle, middle[inner]) >= CORNER
    share = (lengths / (lengths + lengths[inner]))[:, None]
    ahead = middle + share * (middle - middle[inner])
    left = np.abs(np.sum(ahead * here, axis=1)), np.abs(np.sum(middle * here, axis=1))
    return np.asarray(smooth & (left[0] <= 0.5 * left[1]))


def end_slopes(points: np.ndarray, facets: np.ndarray, averaged: np.ndarray) -> np.ndarray:
    """Slopes of the smooth boundary through the nodes against the chords, shape (nf, 2).

    Parameters
    ----------
    points, facets : ndarray
    averaged : ndarray, shape (nf, 2, 2)
        Normals at start and end of each facet, averaged with the neighbours.

    Returns
    -------
    ndarray, shape (nf, 2)
        At start and end; positive and negative where the boundary bulges outward. Zero on straight
        and on quadratic facets, and on those that are no piece of a curve (`STEEPEST`, `ALIKE`).
    """
    slopes = np.zeros((len(facets), 2))
    if facets.shape[1] != 2 or points.shape[1] != 2:
        return slopes
    chord = normals_at(points, facets, np.array([0.5]))[0]
    forward = np.stack([-averaged[..., 1], averaged[..., 0]], axis=2)
    across = np.einsum("fsd,fsd->fs", forward, np.broadcast_to(chord, forward.shape))
    along = chord[..., 0] * forward[..., 1] - chord[..., 1] * forward[..., 0]
    slopes = across / along
    start, end = slopes[:, 0], -slopes[:, 1]
    least, most = np.minimum(np.abs(start), np.abs(end)), np.maximum(np.abs(start), np.abs(end))
    curve = (start * end > 0) & (most <= STEEPEST) & (least >= ALIKE * most)
    return np.where(curve[:, None], slopes, 0.0)


def kink_angles(points: np.ndarray, facets: np.ndarray, neighbours: np.ndarray) -> np.ndarray:
    """Angle by which a surface turns at nodes where it is straight on one side, shape (m,) [rad].

    Straight is a facet at whose other end the surface turns by less than a quarter of it: on a curve
    turns are alike, and where it ends at a tangent the last is half of the others. Beyond the end of
    a surface nothing is known, and no facet there is straight.

    >>> points = np.array([[3, 0], [2, 0], [1, 0], [0, 1.0], [-1, 2]])
    >>> facets = np.array([[0, 1], [1, 2], [2, 3], [3, 4]])
    >>> neighbours = np.array([[-1, 1], [0, 2], [1, 3], [2, -1]])
    >>> np.degrees(kink_angles(points, facets, neighbours)).round(9).tolist()
    [0.0, 0.0, 45.0, 0.0, 0.0]
    """
    ends = normals_at(points, facets, np.array([0.0, 1.0]))[0]
    there = ends[neighbours, np.array([1, 0])]
    turn = angle_between(ends, there)
    known = neighbours >= 0
    turn[~known] = 0.0
    straight = known & known[:, ::-1] & (turn[:, ::-1] < STRAIGHT * turn)
    kinks = np.zeros(len(points))
    np.maximum.at(kinks, facets[:, :2][straight], turn[straight])
    return kinks


def tributary_areas(points: np.ndarray, facets: np.ndarray, measure: Any, label: str) -> np.ndarray:
    """Integrals of the shape functions, times the measure, over the surface."""
    gauss, weight = 0.5 * (GAUSS[0] + 1), 0.5 * GAUSS[1]
    N, _ = facet_shapes(gauss, facets.shape[1])
    density = normals_at(points, facets, gauss)[1] * weight
    if measure is not None:
        density = density * weights_of(measure, np.einsum("qk,fkd->dfq", N, points[facets]), label)
    area = np.zeros(len(points))
    np.add.at(area, facets, density @ N)
    return area


def weights_of(measure: Any, x: np.ndarray, label: str) -> np.ndarray:
    """The measure of a body at positions (d, nf, q) of a surface, checked."""
    usage = "return one positive number for each position, as in lambda x: 2 * np.pi * x[0]"
    factor = numbers(measure(x), f"measure on surface {label!r}", usage)
    if factor.shape not in ((), x.shape[1:]):
        raise InputError(
            f"measure on surface {label!r} has shape {factor.shape} for positions of shape "
            f"{x.shape}; {usage}"
        )
    factor = np.broadcast_to(factor, x.shape[1:])
    if not np.all(np.isfinite(factor)) or factor.min() < 0 or factor.max() <= 0:
        raise InputError(
            f"measure is {factor.min():.3g} to {factor.max():.3g} on surface {label!r}; a "
            "weight of the area is positive and finite (an axisymmetric mesh lies at x[0] >= 0)"
        )
    return factor


def angle_between(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Angles between unit vectors (..., d), shape (...) [rad]; exact also where they are small."""
    along = np.einsum("...d,...d->...", one, other)
    if one.shape[-1] == 3:
        return np.asarray(np.arctan2(np.linalg.norm(np.cross(one, other), axis=-1), along))
    across = one[..., 0] * other[..., 1] - one[..., 1] * other[..., 0]
    return np.asarray(np.abs(np.arctan2(across, along)))


def cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Vector products in space of vectors (..., 3), laid out in memory as these are.

    What `numpy.cross` returns, at a third of the time where one component follows the other.

    >>> cross(np.array([[2.0, 0.0, 0.0]]), np.array([[0.0, 3.0, 0.0]])).tolist()
    [[0.0, 0.0, 6.0]]
    """
    out = np.empty_like(a)
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        np.multiply(a[..., j], b[..., k], out=out[..., i])
        out[..., i] -= a[..., k] * b[..., j]
    return out


def sizes(vectors: np.ndarray) -> np.ndarray:
    """Lengths of vectors (..., d), shape (...).

    Those of NumPy to the last digit; in the plane, where nearly all the time would go into passes over
    two components, in a quarter of its time.

    >>> sizes(np.array([[3.0, 4.0]])).tolist()
    [5.0]
    """
    if vectors.shape[-1] != 2:
        return np.asarray(np.linalg.norm(vectors, axis=-1))
    x, y = vectors[..., 0], vectors[..., 1]
    return np.asarray(np.sqrt(x * x + y * y))


def unit(vectors: np.ndarray) -> np.ndarray:
    return vectors / sizes(vectors)[..., None]
