"""Rows of a pairing that corners take in place of those of nodes: see `corners`."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix

from skfem_contact.bodies.facets import facet_shapes
from skfem_contact.bodies.normals import tangents
from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.pairing.node import Pairing
from skfem_contact.pairing.thresholds import COINCIDENT
from skfem_contact.pairing.vertices import Corners, Met

Array = NDArray[np.float64]
Index = NDArray[np.intp]
# (0 of the secondary, 1 of the primary; number of the point)
Names = frozenset[tuple[int, int]]


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
        N = facet_shapes(met.xi[k], len(nodes))[0]
        self._write(node, (np.array([node]), np.ones(1)), (nodes, N), met.normal[k], met, k)
        self.values["facet"][node] = met.facet[k]

    def of_other_vertex(self, corners: Corners, met: Met, k: int) -> None:
        """A vertex of the primary on a facet of the secondary: the row of the end farther off."""
        nodes = self.secondary.facets[met.facet[k]]
        N = facet_shapes(met.xi[k], len(nodes))[0]
        vertex = corners.node[met.corner[k]]
        ends = nodes[:2]
        own = self.values["gap"][ends]
        there = int(np.argmax(N[:2]))
        deepest = met.gap[k] + COINCIDENT * self.secondary.lengths[met.facet[k]]
        if N[there] > 1 - COINCIDENT and own[there] <= deepest:
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
