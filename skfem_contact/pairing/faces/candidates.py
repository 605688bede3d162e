"""Which cells of the primary can lines along the normals of which cells of the secondary meet?"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from skfem_contact.pairing.faces.cells import Cells
from skfem_contact.pairing.search import FacetTree, Nodes
from skfem_contact.pairing.thresholds import FACING, MARGIN

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Mask = NDArray[np.bool_]


def cells_along_normals(secondary: Cells, primary: Cells, reach: float) -> tuple[Index, Index]:
    """Pairs of cells that may meet along the normals of the secondary.

    What a cell sees is a cone about its own normal, as wide as its normals are apart. One tree over the
    cells of the primary answers for all of them: no pair is left out, and the work is
    proportional to the cells and the pairs found, whatever the distance between the surfaces.

    Returns
    -------
    e, f : ndarray of int
        Cells of the secondary and of the primary, ordered by both.
    """
    height = np.abs(secondary.corners[..., 2]).max(axis=1)
    radius = np.linalg.norm(secondary.corners[..., :2], axis=2).max(axis=1)
    lean = np.linalg.norm(secondary.normals[..., :2], axis=2).max(axis=1)
    lean /= np.maximum(secondary.normals[..., 2].min(axis=1), FACING)

    def seen(e: Index, nodes: Nodes) -> Mask:
        local = secondary.local(e, nodes.centre)
        far = np.abs(local[:, 2]) + nodes.radius + height[e]
        across = np.linalg.norm(local[:, :2], axis=1) - nodes.radius
        near = np.abs(local[:, 2]) - nodes.radius - height[e]
        return (across <= (radius[e] + far * lean[e]) * (1 + MARGIN)) & (near <= reach)

    tree, order = _tree(primary)
    found = list(tree.descend(len(secondary.facet), seen))
    e, f = (np.concatenate(column) for column in zip(*found, strict=True))
    f = order[f]
    order = np.lexsort((f, e))
    return e[order], f[order]


def _tree(cells: Cells) -> tuple[FacetTree, Index]:
    """A tree over cells, and the order in which it has them."""
    order = _bisected(cells.origin)
    lower, upper = cells.positions[order].min(axis=1), cells.positions[order].max(axis=1)
    levels = []
    while True:
        radius = 0.5 * np.linalg.norm(upper - lower, axis=1) * (1 + MARGIN)
        nothing = np.zeros(len(lower))
        levels.append(Nodes(0.5 * (lower + upper), radius, nothing, nothing))
        if len(lower) == 1:
            return FacetTree(tuple(levels)), order
        left = np.arange(0, len(lower), 2)
        right = np.minimum(left + 1, len(lower) - 1)
        lower = np.minimum(lower[left], lower[right])
        upper = np.maximum(upper[left], upper[right])


def _bisected(points: Array) -> Index:
    """Order of points in which halves, quarters, ... are compact: cut in two along the longest side."""
    order = np.arange(len(points))
    pieces = [order]
    while len(pieces[0]) > 1 or len(pieces[-1]) > 1:
        halves: list[Index] = []
        for piece in pieces:
            axis = np.argmax(np.ptp(points[piece], axis=0))
            piece = piece[np.argsort(points[piece, axis], kind="stable")]
            # as many as fit a binary tree from the left
            half = 1 << max(0, (len(piece) - 1).bit_length() - 1)
            halves += [piece[:half], piece[half:]] if len(piece) > 1 else [piece]
        pieces = halves
    return np.concatenate(pieces)
