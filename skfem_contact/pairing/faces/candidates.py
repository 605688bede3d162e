"""Which cells of the primary can lines along the normals of which cells of the secondary meet?"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.pairing.faces.cells import Cells
from skfem_contact.pairing.faces.search import FaceNodes, FaceTree
from skfem_contact.pairing.thresholds import FACING, MARGIN
from skfem_contact.pairing.vectors import ragged

Index = NDArray[np.intp]
Mask = NDArray[np.bool_]


def cells_along_normals(
    secondary: Cells, surface: ContactSurface, primary: Cells, reach: float
) -> tuple[Index, Index]:
    """Pairs of cells that may meet along the normals of the secondary.

    What a cell sees is a cone about its own normal, as wide as its normals are apart. The tree over the
    faces of the primary answers for all of them: no pair is left out, and the work is proportional to
    the cells and the pairs found, whatever the distance between the surfaces.

    Parameters
    ----------
    secondary, primary : Cells
    surface : ContactSurface
        The primary.
    reach : float
        Longest distance along the normal [length].

    Returns
    -------
    e, f : ndarray of int
        Cells of the secondary and of the primary, ordered by both.
    """
    height = np.abs(secondary.corners[..., 2]).max(axis=1)
    radius = np.linalg.norm(secondary.corners[..., :2], axis=2).max(axis=1)
    lean = np.linalg.norm(secondary.normals[..., :2], axis=2).max(axis=1)
    lean /= np.maximum(secondary.normals[..., 2].min(axis=1), FACING)

    def seen(e: Index, nodes: FaceNodes) -> Mask:
        local = secondary.local(e, nodes.centre)
        far = np.abs(local[:, 2]) + nodes.radius + height[e]
        across = np.linalg.norm(local[:, :2], axis=1) - nodes.radius
        near = np.abs(local[:, 2]) - nodes.radius - height[e]
        return (across <= (radius[e] + far * lean[e]) * (1 + MARGIN)) & (near <= reach)

    found = list(FaceTree.build(surface).descend(len(secondary.facet), seen))
    e, face = (np.concatenate(column) for column in zip(*found, strict=True))
    # all cells of a face
    order = np.argsort(primary.facet, kind="stable")
    first = np.searchsorted(primary.facet[order], np.arange(len(surface.facets) + 1))
    count = np.diff(first)[face]
    e, f = np.repeat(e, count), order[ragged(first[face], count)]
    order = np.lexsort((f, e))
    return e[order], f[order]
