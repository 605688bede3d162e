"""Error of tractions along a surface: at edges, between nodes and across them, of straight facets.

Every nodal value is compared with the polynomial through the nodes around it, without the node itself;
at the end of contact with the square root that tractions are there. The value at a node less what its
neighbours tell (`misfit`) is how it differs from a mesh of twice the size. By Richardson's argument the
error of the mesh itself is that over ``2**p - 1``: over 1 where contact or stick ends and the order p
is one, over 3 on linear facets and 7 on quadratic ones. At the edges of contact the misfit is the one
from a square root, which does not depend on where between two nodes the edge lies.

Nodal forces act along the curve, straight facets do not. The pressure p of a chord that spans the angle
a acts along the normal of the chord. Along the normal of the curve, at the node between two, it has the
force ``p L cos(a / 2)``: the nodal force over the length L shows a pressure that is ``1 - cos(a / 2)``
too low, on matching meshes as well. Between two bodies it is the mean of both sides (more or less, by
their stiffness). Faces have at each of their corners the angle between their own normal and that of the
boundary in the place of ``a / 2``.
"""

from __future__ import annotations

import itertools

import numpy as np
from numpy.typing import NDArray

from skfem_contact.answers.answer import Answer
from skfem_contact.answers.error.sources import Three, relative
from skfem_contact.answers.fields import Edges, Segments, find_edges
from skfem_contact.answers.thresholds import SHARPER
from skfem_contact.answers.values import ContactValues
from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.conditions.state import OPEN, STICK
from skfem_contact.records import dataclass

Array = NDArray[np.float64]
Index = NDArray[np.intp]


#: Of a square root up to its zero: four digits, which no estimate needs.
GAUSS = np.polynomial.legendre.leggauss(8)

#: Nodes, by their rank before (0, 1, 2) and after (3, 4, 5), for parabolas: one from either side; at
#: an end of the line the first of the others that exists. The nearest node is on both sides, so that
#: these are the vertices and middles that a quadratic facet of twice the length would have.
PARABOLAS = (((0, 1, 3), (0, 3, 4)), ((0, 1, 2),), ((3, 4, 5),))
#: The same for straight lines, with two nodes on either side.
LINES = (((0, 2),), ((0, 1),), ((2, 3),))


@dataclass(frozen=True, eq=False)
class Line:
    """The nodes of a surface in 2-D and their neighbours along it; -1 where there is none.

    Attributes
    ----------
    before, after : ndarray of int, shape (m,)
    to_before, to_after : ndarray, shape (m,)
        Distances along the surface [length].
    segments : Segments
        The facets, or halves of quadratic ones.
    """

    before: Index
    after: Index
    to_before: Array
    to_after: Array
    segments: Segments

    @classmethod
    def of(cls, surface: ContactSurface, known: NDArray[np.bool_]) -> Line:
        """Along the nodes with a known value; the others interrupt the line."""
        segments, m = Segments.of(surface), len(surface.points)
        kept = known[segments.start] & known[segments.end]
        start, end, length = segments.start[kept], segments.end[kept], segments.length[kept]
        before, after = np.full(m, -1), np.full(m, -1)
        to_before, to_after = np.zeros(m), np.zeros(m)
        after[start], to_after[start] = end, length
        before[end], to_before[end] = start, length
        return cls(before, after, to_before, to_after, segments)

    @property
    def ends(self) -> NDArray[np.bool_]:
        """Nodes without a neighbour on one side, shape (m,)."""
        return (self.before < 0) | (self.after < 0)

    def beside(self, marked: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """The marked nodes and their neighbours."""
        out = marked.copy()
        for link in (self.before, self.after):
            out |= (link >= 0) & marked[link]
        return out

    def edges(self, closed: NDArray[np.bool_], gap: Array) -> Edges:
        """Where contact ends (`find_edges`) on the line, with two closed nodes before it."""
        edges = find_edges(self.segments, closed, gap)
        ahead = self.after[edges.inside] == edges.outside
        inner = np.where(ahead, self.before[edges.inside], self.after[edges.inside])
        kept = (ahead | (self.before[edges.inside] == edges.outside)) & (inner >= 0)
        kept &= closed[inner]
        return Edges(edges.inside[kept], edges.outside[kept], edges.segment[kept], edges.part[kept])

    def around(self, reach: int) -> tuple[Index, Array]:
        """The next nodes before and after, and their distances, negative before, (m, 2 reach)."""
        nodes, places = [], []
        for link, length, sign in ((self.before, self.to_before, -1), (self.after, self.to_after, 1)):
            node, place = np.arange(len(link)), np.zeros(len(link))
            for _ in range(reach):
                there = node >= 0
                place = np.where(there, place + sign * length[node], place)
                node = np.where(there, link[node], -1)
                nodes.append(node)
                places.append(place)
        return np.stack(nodes, axis=1), np.stack(places, axis=1)


def misfit(line: Line, values: Array, quadratic: bool) -> Array:
    """Values less what their neighbours tell, shape of `values`; zero where there are too few.

    Parameters
    ----------
    line : Line
    values : ndarray, shape (m, k)
    quadratic : bool
        Whether the neighbours tell a parabola, or a straight line.

    Examples
    --------
    Of a parabola over equal segments a straight line misses half the second difference:

    >>> i = np.arange(5)
    >>> segments = Segments(i[:-1], i[1:], np.ones(4), np.ones(4))
    >>> line = Line(i - 1, np.where(i < 4, i + 1, -1), np.ones(5), np.ones(5), segments)
    >>> misfit(line, i[:, None] ** 2.0, quadratic=False)[1:4].ravel().tolist()
    [-1.0, -1.0, -1.0]
    >>> bool(abs(misfit(line, i[:, None] ** 2.0, quadratic=True)).max() < 1e-12)
    True
    """
    nodes, places = line.around(3 if quadratic else 2)
    recovered, found = np.zeros_like(values), np.zeros(len(values))
    for choice in PARABOLAS if quadratic else LINES:
        open_ = found == 0
        for columns in choice:
            there = open_ & (nodes[:, columns] >= 0).all(axis=1)
            at = places[np.ix_(there, columns)]
            recovered[there] += np.einsum("mc,mck->mk", _at_zero(at), values[nodes[there][:, columns]])
            found += there
    known = found > 0
    recovered[known] = recovered[known] / found[known, None]
    return np.where(known[:, None], values - recovered, 0.0)


def _at_zero(places: Array) -> Array:
    """Lagrange's weights of the values at `places` (m, c) for that at zero."""
    weight = np.ones_like(places)
    for i, j in np.ndindex(places.shape[1], places.shape[1]):
        if i != j:
            weight[:, i] *= places[:, j] / (places[:, j] - places[:, i])
    return weight


def edge_misfit(line: Line, edges: Edges, values: Array) -> Array:
    """Square integral, around each edge of contact, of the nodal field less a square root, (k, c).

    The root begins at the edge and goes through the value of the second node inside. Straight lines
    join zero at the open node, the value of the last closed node, and that of the second.

    Parameters
    ----------
    line : Line
    edges : Edges
        Of `Line.edges`.
    values : ndarray, shape (m, c)
    """
    segment, last = edges.segment, values[edges.inside]
    ahead = line.after[edges.inside] == edges.outside
    second = values[np.where(ahead, line.before[edges.inside], line.after[edges.inside])]
    inner = np.where(ahead, line.to_before[edges.inside], line.to_after[edges.inside])
    outer = line.segments.length[segment]
    place = edges.part * outer  # of the edge beyond the last closed node
    slope = second / np.sqrt(inner + place)[:, None]
    # s runs from the edge inwards: open node, edge and last closed node in either order, second node
    knots = np.sort([place - outer, np.minimum(place, 0), np.maximum(place, 0), place + inner], axis=0)
    t, weight = GAUSS
    total = np.zeros_like(last)
    for a, b in itertools.pairwise(knots):
        s = 0.5 * (a + b)[:, None] + 0.5 * (b - a)[:, None] * t
        way = s - place[:, None]
        rising = (1 + way / outer[:, None])[..., None] * last[:, None]
        joining = (way / inner[:, None])[..., None] * (second - last)[:, None] + last[:, None]
        nodal = np.where((way < 0)[..., None], rising, joining)
        root = np.sqrt(np.maximum(s, 0))[..., None] * slope[:, None]
        total += 0.5 * (b - a)[:, None] * np.einsum("q,kqc->kc", weight, (nodal - root) ** 2)
    return total * (line.segments.area[segment] / outer)[:, None]


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
    of_nodes = squares.sum(axis=1)
    parts = np.where(sharp, of_nodes, 0.0), np.where(sharp, 0.0, of_nodes), scatter.sum(axis=1)
    return relative(*parts, size)


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


def chords_error(result: Answer, values: ContactValues) -> float:
    """By which part pressures are too low; zero on straight and on quadratic facets."""
    i = result.names.index(values.name)
    contact, part = result.contacts[i], result.slices()[i]
    forces = result.kin.B_n[part].T @ values.normal_force
    sides = [contact.secondary]
    if isinstance(contact.primary, ContactSurface):
        sides.append(contact.primary)
    return float(np.mean([_lost(side, forces[result.system.slice(side.body)]) for side in sides]))


def _lost(surface: ContactSurface, forces: Array) -> float:
    """Root of the mean square of ``1 - cos(a / 2)`` over a surface, weighted as the pressure is."""
    if surface.quadratic or surface.dofs.shape[1] != surface.dim:
        return 0.0  # what flows from chord to chord has no direction
    if surface.dim == 3:
        along = np.einsum("fkd,fkd->fk", surface.own_normals, surface.facet_node_normals)
        low, extent = np.maximum(1 - along.mean(axis=1), 0.0), surface.facet_areas
    else:
        half = np.arctan(0.5 * (surface.slopes[:, 0] - surface.slopes[:, 1]))
        low, extent = 1 - np.cos(half), surface.lengths
    size = np.linalg.norm(forces[surface.dofs], axis=1)
    pressure = np.divide(size, surface.area, out=np.zeros_like(size), where=surface.area > 0)
    weight = extent * np.sum(pressure[surface.facets] ** 2, axis=1)
    total = float(weight.sum())
    return float(np.sqrt(weight @ low**2 / total)) if total > 0 else 0.0


def net(result: Answer, bodies: float, chords: float) -> tuple[float, float]:
    """What is left of both where they are known to have opposite signs.

    Meshes are too stiff, so what interference presses is too high, and chords show too little of it.
    Loads and supports leave the sign of the first open: then the squares of both count.
    """
    driven = np.any(result.case.f) or np.any(result.case.x)
    if driven or np.isnan(bodies):
        return bodies, chords
    return max(bodies - chords, 0.0), max(chords - bodies, 0.0)
