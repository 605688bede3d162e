r"""Error of tractions along a surface: at edges, between nodes, and what scatters from node to node.

The value at a node less what its neighbours tell (`misfit`) is how it differs from a mesh of twice the
size. By Richardson's argument the error of the mesh itself is that over ``2**p - 1``: over 1 where
contact or stick ends and the order p is one, over 3 on linear facets and 7 on quadratic ones. At the
edges of contact the misfit is the one from a square root, which does not depend on where between two
nodes the edge lies.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from skfem_contact.answers.error.misfit import Line, edge_misfit, misfit
from skfem_contact.answers.thresholds import SHARPER
from skfem_contact.answers.values import ContactValues
from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.conditions.state import OPEN, STICK
from skfem_contact.digits import SOLVED

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Three = tuple[float, float, float]


def surface_error(values: ContactValues, line: Line, traction: Array) -> tuple[Three, Array]:
    """Errors by edges, facets and scatter over the norm of the traction; the share of each point."""
    surface = values.surface
    area, quadratic = surface.area[:, None], surface.quadratic
    size = float(np.sum(area * traction**2))
    first = misfit(line, traction, quadratic)
    sharp = _sharp(line, values.status, first, surface)
    order = np.where(sharp, 1.0, 1 / 7 if quadratic else 1 / 3)[:, None]
    # a hat function has a third of the square of its height, over its area
    squares = area / 3.0 * (order * first) ** 2
    edges = line.edges(values.status != OPEN, values.gap)
    squares[edges.inside] = squares[edges.outside] = 0.0
    squares[edges.inside] += edge_misfit(line, edges, traction)
    sharp[edges.inside] = True
    scatter = area / 3.0 * _scatter(line, first, sharp, quadratic)
    total = (squares + scatter).sum(axis=1)
    share = total / total.sum() if total.sum() > SOLVED**2 * size else np.zeros(len(total))

    def norm(part: Array) -> float:
        return float(np.sqrt(part.sum() / size)) if size > 0 else 0.0

    return (norm(squares[sharp]), norm(squares[~sharp]), norm(scatter)), share


def _sharp(line: Line, status: Index, first: Array, surface: ContactSurface) -> NDArray[np.bool_]:
    """Points where tractions are no smooth functions: at ends of contact, of stick, of the surface."""
    border = np.zeros(len(status), dtype=bool)
    for link in (line.before, line.after):
        border |= (link >= 0) & (status[link] != status)
    # where slip begins tractions may well be smooth, and then are misfits not larger than beside it
    size, beside = np.linalg.norm(first, axis=1), np.zeros(len(status))
    for link in (line.before, line.after):
        inner = (link >= 0) & ~border[link]
        beside = np.where(inner, np.maximum(beside, size[link]), beside)
    sharp = border & (size > SHARPER * beside)
    # at the end of a surface stress may be singular, but not on a line of symmetry or at a support
    bound = np.asarray(surface.held.any(axis=1))
    supported = np.asarray(surface.held.all(axis=1))[surface.facets].any(axis=1)
    bound[surface.facets[supported]] = True
    return sharp | (line.ends & ~bound)


def _scatter(line: Line, first: Array, sharp: NDArray[np.bool_], quadratic: bool) -> Array:
    """Squared heights of what jumps from node to node, (m, k), times three over those of its hats.

    Taking the misfit again and again leaves of a traction what scatters. It enlarges waves by
    ``1 - cos`` of their phase per node: 2 for a zigzag, 1 for waves of four nodes. Longer ones are as
    good as smooth.
    """
    # only nodes whose neighbours' misfits know no sharp points, and stand between others
    left_out = sharp | line.ends
    for _ in range(3 if quadratic else 2):
        left_out = line.beside(left_out)
    second = np.where(left_out[:, None], 0.0, misfit(line, first, quadratic))
    third = np.where(left_out[:, None], 0.0, misfit(line, second, quadratic))
    scale = float(np.sum(second**2))
    growth = min(float(np.sqrt(np.sum(third**2) / scale)), 2.0) if scale > 0 else 1.0
    # a field of hats with heights a cos(phase i) has the mean square a² (2 + cos phase) / 6
    return (3.0 - growth) * (second / max(growth, 1.0) ** 2) ** 2


def points_across(line: Line, status: Index) -> int:
    """Points of the shortest run of contact, or of sticking, that touches an edge."""
    fewest = 0
    for zone in (status != OPEN, status == STICK):
        start = zone & ((line.before < 0) | ~zone[line.before])
        for first in np.flatnonzero(start):
            run = [first]
            while line.after[run[-1]] >= 0 and zone[line.after[run[-1]]]:
                run.append(line.after[run[-1]])
                if run[-1] == first:
                    break
            beyond = line.before[run[0]], line.after[run[-1]]
            if any(node >= 0 and not zone[node] for node in beyond):
                fewest = min(fewest, len(run)) if fewest else len(run)
    return fewest
