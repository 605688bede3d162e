r"""Contact at convex corners: a vertex of one surface meets a facet of the other.

Nodes of the secondary that look for facets of the primary, and means over what facets share, both
lose a corner: between two nodes of a coarse secondary the vertex of the primary presses unseen, and
the mean over a facet that leans away from the vertex is open while the vertex is in the body. There

    g = n . (sum_k N_k(xi) x_k - x_vertex)

is the row: the facet of the secondary at the vertex' foot ``xi``, the vertex of the primary with weight
one (a quadrature point of the multiplier at the vertex alone), along the normal of the facet; or the
same with the two sides exchanged, for a vertex of the secondary. The row is that of one secondary
node, in place of its own: of the two ends of the facet the one that is farther from contact.

A vertex meets what leans by more than `LEAN` towards the other facet of the corner, and no farther
than that facet's normal. What the surface ends at is known from the mesh, so that the end of "top" is
a corner even if the side of the body was not selected. On flat interfaces nothing changes.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix

from skfem_contact.bodies.normals import tangents
from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.digits import GIVEN, SOLVED
from skfem_contact.pairing.closest import search_range
from skfem_contact.pairing.node import Pairing
from skfem_contact.pairing.thresholds import CROSS, LEAN, SLACK
from skfem_contact.pairing.vertices import Corners, Met, closest, lean_of, meet
from skfem_contact.records import dataclass

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Mask = NDArray[np.bool_]
# (0 of the secondary, 1 of the primary; number of the point)
Names = frozenset[tuple[int, int]]


@dataclass(frozen=True, eq=False)
class CornerContacts:
    """The contacts of the corners of two surfaces.

    Attributes
    ----------
    tilt : float
        `LEAN`.
    own, other : tuple of Corners and the facets they meet
        The corners of the secondary on facets of the primary, and the other way round.
    """

    secondary: ContactSurface
    primary: ContactSurface
    tilt: float
    own: tuple[Corners, Met]
    other: tuple[Corners, Met]

    @property
    def names(self) -> Names:
        """The corners that met something."""
        sides = enumerate((self.own, self.other))
        return frozenset((i, int(n)) for i, (c, met) in sides for n in c.node[met.corner])

    @property
    def pressed(self) -> Index:
        """Facets of the secondary that a vertex of the primary meets, and those next to them.

        Of the next ones only those that lean, too: a vertex passes to them without a jump.
        """
        corners, met = self.other
        if not len(met.corner):
            return met.facet
        beside = self.secondary.neighbours[met.facet]
        found = [met.facet]
        for next_facet in beside.T:
            lean = lean_of(corners, met.corner, self.secondary, next_facet)
            leans = (lean > self.tilt) & (lean < corners.turn[met.corner] - self.tilt)
            found.append(next_facet[leans & (next_facet >= 0)])
        return np.unique(np.concatenate(found))

    def rows(self, pairing: Pairing, every: bool) -> Pairing:
        """The pairing with the rows of the vertices.

        Parameters
        ----------
        pairing : Pairing
        every : bool
            Whether rows of vertices of the secondary are replaced that have a partner already.
        """
        if not (len(self.own[1].corner) or len(self.other[1].corner)):
            return pairing
        rows = CornerRows(pairing, self.secondary, self.primary)
        corners, met = self.own
        node = corners.node[met.corner]
        # a partner that faces the node may be farther off than the one that faces the corner
        farther = np.abs(pairing.gap[node]) > np.abs(met.gap) + SOLVED * self.primary.lengths[met.facet]
        for k in np.flatnonzero(every | farther):
            rows.of_own_vertex(int(node[k]), met, int(k))
        corners, met = self.other
        for k in np.argsort(met.gap, kind="stable")[::-1]:  # the deepest is written last
            rows.of_other_vertex(corners, met, int(k))
        return rows.pairing(self.names)


def corner_contacts(
    secondary: ContactSurface,
    primary: ContactSurface,
    *,
    reach: float | None = None,
    only_overlaps: bool = False,
    known: Names = frozenset(),
) -> CornerContacts:
    """Find the vertices of either surface that meet a facet of the other.

    Parameters
    ----------
    secondary, primary : ContactSurface
    reach : float, optional
        As in `node_to_segment`.
    only_overlaps : bool
        Leave out vertices that do not overlap now: for small sliding.
    known : set
        `CornerContacts.names` of a round before: these vertices carry however little they lean, so
        that no round undoes what the last one found.
    """
    limits = search_range(secondary, primary, reach)
    found = []
    for side, (own, other) in enumerate(((secondary, primary), (primary, secondary))):
        corners = Corners.of(own)
        held = np.array([(side, int(node)) in known for node in corners.node], dtype=bool)
        tilt = np.where(held, -SLACK, LEAN)
        found.append((corners, meet(corners, own, other, tilt, limits, only_overlaps)))
    return CornerContacts(secondary, primary, LEAN, *found)


def unselected_sides(own: ContactSurface, other: ContactSurface) -> list[tuple[int, float]]:
    """Ends of a surface that the other one overlaps from a side that is not part of the surface.

    Returns
    -------
    list of (int, float)
        Number of the point, and by how much it lies in the other body [length].
    """
    corners = Corners.of(own)
    met = closest(corners, own, other, search_range(own, other, None))
    lean, turn = lean_of(corners, met.corner, other, met.facet), corners.turn[met.corner]
    ahead, behind = ~corners.covered[met.corner].T
    outside = behind & (lean >= turn - SLACK) & (lean < turn + CROSS)
    outside |= ahead & (lean <= SLACK) & (lean > -CROSS)
    deep = met.gap < -LEAN * other.lengths[met.facet]
    return [
        (int(corners.node[met.corner[k]]), -float(met.gap[k])) for k in np.flatnonzero(outside & deep)
    ]


class CornerRows:
    """A pairing some of whose rows are replaced."""

    def __init__(self, pairing: Pairing, secondary: ContactSurface, primary: ContactSurface) -> None:
        self.old, self.secondary, self.primary = pairing, secondary, primary
        self.values = {
            name: np.array(getattr(pairing, name))
            for name in ("normal", "gap", "area", "paired", "miss", "facet")
        }
        self.values["vertex"] = np.full(len(pairing.gap), -1)
        self.weights: dict[int, tuple[tuple[Index, Array], tuple[Index, Array]]] = {}

    def of_own_vertex(self, node: int, met: Met, k: int) -> None:
        """A vertex of the secondary on a facet of the primary."""
        nodes = self.primary.facets[met.facet[k]]
        N = met.shape[k]
        self._write(node, (np.array([node]), np.ones(1)), (nodes, N), met.normal[k], met, k)
        self.values["facet"][node] = met.facet[k]

    def of_other_vertex(self, corners: Corners, met: Met, k: int) -> None:
        """A vertex of the primary on a facet of the secondary: the row of the end farther off."""
        nodes = self.secondary.facets[met.facet[k]]
        N = met.shape[k]
        vertex = corners.node[met.corner[k]]
        ends = nodes[:2]
        own = self.values["gap"][ends]
        there = int(np.argmax(N[:2]))
        deepest = met.gap[k] + GIVEN * self.secondary.lengths[met.facet[k]]
        if N[there] > 1 - GIVEN and own[there] <= deepest:
            self.values["vertex"][ends[there]] = vertex
            return  # the vertex lies at a node, whose own row says the same
        host = there if own[0] == own[1] else int(np.argmax(own))
        if met.gap[k] >= own[host]:
            return
        node = int(ends[host])
        self._write(node, (nodes, N), (np.array([vertex]), np.ones(1)), -met.normal[k], met, k)
        self.values["facet"][node] = corners.facet[met.corner[k]]
        self.values["vertex"][node] = vertex

    def _write(
        self,
        node: int,
        own: tuple[Index, Array],
        other: tuple[Index, Array],
        normal: Array,
        met: Met,
        k: int,
    ) -> None:
        self.weights[int(node)] = own, other
        new = {"normal": normal, "gap": met.gap[k], "paired": True, "miss": 0.0}
        for name, value in new.items():
            self.values[name][node] = value

    def pairing(self, names: Names) -> Pairing:
        """The pairing with the rows that were written."""
        old, written = self.old, np.array(list(self.weights), dtype=int)
        m = len(old.gap)
        new: dict[str, Any] = dict(self.values)
        normal = new["normal"]
        for name in ("secondary_normal", "primary_normal"):
            if getattr(old, name) is not None:
                new[name] = getattr(old, name).copy()
                new[name][written] = normal[written]
        if old.slip_weights is not None:
            new["slip_weights"] = tuple(self._replaced(i, w) for i, w in enumerate(old.slip_weights))
        if old.primary_bulge is not None:
            new["primary_bulge"] = bulge = old.primary_bulge.copy()
            bulge.data[np.isin(np.repeat(np.arange(m), np.diff(bulge.indptr)), written)] = 0.0
        if old.smooth is not None:
            new["smooth"] = old.smooth.copy()
            new["smooth"][written] = 0.0
        if old.still is not None:
            new["still"] = old.still.copy()
            new["still"][written] = False
        return replace(
            old,
            **new,
            corners=names,
            tangent=tangents(normal),
            secondary_weights=self._replaced(0, old.secondary_weights),
            primary_weights=self._replaced(1, old.primary_weights),
        )

    def _replaced(self, side: int, matrix: csr_matrix) -> csr_matrix:
        return _replaced(matrix, {node: rows[side] for node, rows in self.weights.items()})


def _replaced(matrix: csr_matrix, rows: dict[int, tuple[Index, Array]]) -> csr_matrix:
    """A sparse matrix with some rows replaced by (columns, values)."""
    coo = matrix.tocoo()
    keep = ~np.isin(coo.row, list(rows))
    parts = [(coo.row[keep], coo.col[keep], coo.data[keep])]
    parts += [(np.full(len(c), node), c, v) for node, (c, v) in rows.items()]
    row, col, data = (np.concatenate(part) for part in zip(*parts, strict=True))
    out = csr_matrix((data, (row, col)), shape=matrix.shape)
    out.eliminate_zeros()
    return out
