r"""What facets that are long for a light contact make of it: the height of curves over one facet.

Between two nodes a curve stands off its chord, and off the other side of the interface more than at
the nodes: over a facet of length h by the sagitta

    e = k h^2 / 8,        k = k_s + k_p,

with the curvatures of both sides (convex ones positive, so that curves that fit have none) and the
longer of the facets that meet; faces have the same in `face_chords`. Contact that is pressed in by less
ends within one facet. Then polygons touch where curves do not, or do not touch where curves do; gaps at
the nodes of a flat side do not see an arc that comes down between them; and a weighted gap, which knows
a parabola as a mean only, has an overlap of 2/3 of e where the curve just touches. Forces that follow
from a prescribed approach d are wrong by ``d / e`` or its inverse. So e is compared with what the
bodies take up elastically: forces are wrong by as large a part of them at most, and by less than half
of that in general (`answers.thresholds.SAGITTA`).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from skfem_contact.answers.thresholds import CURVED
from skfem_contact.answers.validity.face_chords import face_sagittas
from skfem_contact.bodies.kinks import end_slopes
from skfem_contact.bodies.surface import ContactSurface

Array = NDArray[np.float64]
Index = NDArray[np.intp]


def sagittas(
    secondary: ContactSurface, primary: ContactSurface, facet: Index, by_node: bool = False
) -> Array:
    """Height of the gap's parabola over the longer of the facets that meet, shape (m,) [length].

    Parameters
    ----------
    secondary, primary : ContactSurface
    facet : ndarray of int, shape (m,)
        Primary facets that the points meet.
    by_node : bool
        Whether only the nodes of the secondary see the primary; matters for faces.

    Returns
    -------
    ndarray, shape (m,)
        Zero where no side is a curve: on straight sides, kinks and polygons of less than 16 sides.
    """
    if secondary.dim == 3:
        return face_sagittas(secondary, primary, facet, by_node)
    of_primary, longest = bends(primary)
    bend, length = bends(secondary)
    m, ends = len(secondary.points), secondary.facets
    every = np.broadcast_to(bend[:, None], ends.shape)
    mean = np.bincount(ends.ravel(), every.ravel(), m) / np.bincount(ends.ravel(), minlength=m)
    step = np.zeros(m)
    np.maximum.at(step, ends, length[:, None])
    return np.asarray(np.abs(mean + of_primary[facet]) * np.maximum(step, longest[facet]) ** 2 / 8)


def bends(surface: ContactSurface) -> tuple[Array, Array]:
    """Curvature of every facet [1/length], positive where it is convex, and the length of its pieces.

    A quadratic facet has two pieces, unless it is straight and stands for an arc nevertheless.
    """
    slopes = surface.slopes
    if not surface.quadratic:
        return (slopes[:, 0] - slopes[:, 1]) / surface.lengths, surface.lengths
    chain = surface.facets[:, :2]
    slopes = end_slopes(surface.points, chain, surface.facet_node_normals)
    start, end, middle = (surface.points[surface.facets[:, k]] for k in range(3))
    chord = end - start
    away = middle - 0.5 * (start + end)
    height = np.abs(chord[:, 0] * away[:, 1] - chord[:, 1] * away[:, 0]) / surface.lengths
    rise = np.abs(slopes[:, 0] - slopes[:, 1]) / 8 * surface.lengths
    pieces = np.where(height >= CURVED * rise, 0.5, 1.0)
    return (slopes[:, 0] - slopes[:, 1]) / surface.lengths, pieces * surface.lengths
