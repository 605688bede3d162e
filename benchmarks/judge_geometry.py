"""Where boundaries are: polylines of surfaces, signed distances and overlaps, by plain NumPy.

No pairing: a sample of one surface is measured against the whole boundary of the other body.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

PIECES = 6  # straight pieces that a quadratic facet is drawn with
CORNER = np.radians(45.0)  # a turn of the undeformed boundary that is a corner, not a chord's


@dataclass(frozen=True, eq=False)
class Line:
    """Facets of a boundary, the body on their left, with its DOFs.

    Attributes
    ----------
    X : ndarray, shape (m, 2)
        Undeformed positions of the nodes.
    dofs : ndarray, shape (m, 2)
        DOFs of each node.
    facets : ndarray, shape (nf, 2 or 3)
        Start, end and perhaps middle of each facet, as rows of `X`.
    """

    X: np.ndarray
    dofs: np.ndarray
    facets: np.ndarray

    @cached_property
    def xi(self) -> np.ndarray:
        """Samples along a facet, 0 to 1: the joints of the pieces it is drawn with."""
        return np.linspace(0.0, 1.0, (1 if self.facets.shape[1] == 2 else PIECES) + 1)

    def weights(self, xi: np.ndarray) -> np.ndarray:
        """Shape functions of a facet at samples, shape (samples, nodes of a facet)."""
        if self.facets.shape[1] == 2:
            return np.column_stack([1 - xi, xi])
        return np.column_stack([(1 - xi) * (1 - 2 * xi), xi * (2 * xi - 1), 4 * xi * (1 - xi)])

    def at(self, values: np.ndarray, xi: np.ndarray) -> np.ndarray:
        """Nodal values at samples of all facets, shape (nf, samples, ...)."""
        return np.einsum("sk,fk...->fs...", self.weights(xi), values[self.facets])

    def nodes(self, u: np.ndarray) -> np.ndarray:
        """Deformed positions of the nodes."""
        return self.X + u[self.dofs]

    def pieces(self, u: np.ndarray) -> np.ndarray:
        """Straight pieces of the deformed line, shape (nf * pieces, 2 ends, 2)."""
        p = self.at(self.nodes(u), self.xi)
        return np.stack([p[:, :-1], p[:, 1:]], axis=2).reshape(-1, 2, 2)

    @cached_property
    def before(self) -> np.ndarray:
        """The facet that ends where each facet starts, or -1."""
        ends = {int(b): k for k, b in enumerate(self.facets[:, 1])}
        return np.array([ends.get(int(a), -1) for a in self.facets[:, 0]])

    @cached_property
    def area(self) -> np.ndarray:
        """Length that belongs to each node, shape (m,)."""
        h = lengths(self.pieces(np.zeros(self.dofs.max() + 1))).reshape(len(self.facets), -1).sum(1)
        share = np.array([0.5, 0.5] if self.facets.shape[1] == 2 else [1 / 6, 1 / 6, 2 / 3])
        out = np.zeros(len(self.X))
        np.add.at(out, self.facets, h[:, None] * share)
        return out

    def roughness(self, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Length of each facet, and by how much the line turns in it and at its ends, (nf,)."""
        turned = self._turns(u)
        sharp = np.abs(self._turns(np.zeros_like(u))) > CORNER
        joint = np.where(sharp, np.abs(turned - self._turns(np.zeros_like(u))), np.abs(turned))
        p = self.pieces(u).reshape(len(self.facets), -1, 2, 2)
        d = p[:, :, 1] - p[:, :, 0]
        inner = np.abs(angle(d[:, :-1], d[:, 1:])).sum(axis=1)
        if d.shape[1] > 1:  # the curve also turns by half a piece at either end
            inner *= d.shape[1] / (d.shape[1] - 1)
        after = np.zeros(len(joint))
        has = self.before >= 0
        after[self.before[has]] = joint[has]
        return np.linalg.norm(d, axis=2).sum(axis=1), inner + joint + after

    def sagitta(self) -> float:
        """How far a curve through the nodes stands off its straight facets at most, corners apart."""
        turned = np.abs(self._turns(np.zeros(self.dofs.max() + 1)))
        turned = np.where(turned > CORNER, 0.0, turned)
        after = np.zeros(len(turned))
        has = self.before >= 0
        after[self.before[has]] = turned[has]
        chord = self.X[self.facets[:, 1]] - self.X[self.facets[:, 0]]
        return float((np.linalg.norm(chord, axis=1) * np.maximum(turned, after)).max()) / 8

    @property
    def bends(self) -> bool:
        """Whether the line is a curve, drawn with straight facets or with quadratic ones."""
        if self.facets.shape[1] == 2:
            return self.sagitta() > 0
        n = self.normals(np.zeros(self.dofs.max() + 1)).reshape(len(self.facets), -1, 2)
        return bool((n[:, 0] * n[:, -1]).sum(axis=1).min() < 1 - 1e-6)

    def _turns(self, u: np.ndarray) -> np.ndarray:
        """Turn at the start of each facet, signed; zero where the line ends."""
        p = self.pieces(u).reshape(len(self.facets), -1, 2, 2)
        first, last = p[:, 0, 1] - p[:, 0, 0], p[:, -1, 1] - p[:, -1, 0]
        return np.where(self.before >= 0, angle(last[self.before], first), 0.0)

    def normals(self, u: np.ndarray) -> np.ndarray:
        """Outward unit normals of the pieces, shape (nf * pieces, 2)."""
        p = self.pieces(u)
        d = p[:, 1] - p[:, 0]
        return np.column_stack([d[:, 1], -d[:, 0]]) / np.linalg.norm(d, axis=1)[:, None]


def angle(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Angle from one direction to another, in (-pi, pi]."""
    cross = a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
    return np.arctan2(cross, (a * b).sum(axis=-1))


def lengths(pieces: np.ndarray) -> np.ndarray:
    """Lengths of straight pieces."""
    return np.linalg.norm(pieces[:, 1] - pieces[:, 0], axis=1)


def line(basis: Any, facets: np.ndarray) -> Line:
    """The line of some boundary facets of a mesh."""
    mesh = basis.mesh
    ends = mesh.facets[:, facets].T
    heart = mesh.p[:, mesh.t[:, mesh.f2t[0, facets]]].mean(axis=1).T
    a, b = mesh.p[:, ends[:, 0]].T, mesh.p[:, ends[:, 1]].T
    right = angle(b - a, heart - a) < 0
    ends[right] = ends[right, ::-1]
    dofs = [basis.nodal_dofs[:, ends[:, 0]].T, basis.nodal_dofs[:, ends[:, 1]].T]
    if basis.facet_dofs.size:
        dofs.append(basis.facet_dofs[:2, facets].T)
    table = np.stack(dofs, axis=1)  # facet, node of the facet, component
    first, where = np.unique(table[:, :, 0], return_inverse=True)
    pairs = np.empty((len(first), 2), dtype=int)
    pairs[where.reshape(table.shape[:2])] = table
    return Line(basis.doflocs[:, pairs[:, 0]].T.copy(), pairs, where.reshape(table.shape[:2]))


def inside(points: np.ndarray, pieces: np.ndarray) -> np.ndarray:
    """Whether points lie within closed polygons, by the parity of crossings to the right."""
    a, b = pieces[None, :, 0], pieces[None, :, 1]
    p = points[:, None]
    straddles = (a[..., 1] > p[..., 1]) != (b[..., 1] > p[..., 1])
    rise = np.where(straddles, b[..., 1] - a[..., 1], 1.0)
    x = a[..., 0] + (p[..., 1] - a[..., 1]) / rise * (b[..., 0] - a[..., 0])
    return np.sum(straddles & (x > p[..., 0]), axis=1) % 2 == 1


def nearest(points: np.ndarray, pieces: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Distance to straight pieces, the nearest one, and the share of its length to the foot."""
    a, d = pieces[None, :, 0], pieces[None, :, 1] - pieces[None, :, 0]
    away = points[:, None] - a
    s = np.clip((away * d).sum(-1) / (d * d).sum(-1), 0.0, 1.0)
    far = np.linalg.norm(away - s[..., None] * d, axis=-1)
    best = far.argmin(axis=1)
    row = np.arange(len(points))
    return far[row, best], best, s[row, best]
