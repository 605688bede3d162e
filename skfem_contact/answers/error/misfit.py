r"""What neighbours tell: nodal values along a surface against the ones recovered from around them.

Every nodal value is compared with the polynomial through the nodes around it, without the node itself;
at the end of contact with the square root that tractions are there.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from skfem_contact.answers.fields import Edges, Segments, find_edges
from skfem_contact.bodies.surface import ContactSurface

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
