"""The whole boundary of a body, from the displacements of its contact surfaces and supports alone.

After a load step the displacements of the contact surfaces and of the prescribed DOFs are known;
those of the interior, and of the rest of the boundary, would have to be recovered. To see whether
something may have run into a side that no contact has, it is enough to know that side roughly: as the
rigid motion that suits the known displacements best, and next to known nodes what is left of theirs,
which dies off along the boundary within a facet or two. So a dent at the end of a surface does not take
the side with it, and an overlap is rather seen too deep. Rigid motions are exact.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_matrix, csr_matrix, diags
from scipy.sparse.linalg import splu

from skfem_contact.answers.thresholds import LEAK
from skfem_contact.answers.validity.overlap import Outline, drawn
from skfem_contact.bodies.body import Body

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Mask = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Skin:
    """The boundary of a plane body, and what its displacement follows from.

    Attributes
    ----------
    points : ndarray, shape (b, 2)
        Nodes on the boundary, undeformed [length].
    dofs : ndarray of int, shape (b, 2)
        Of the body.
    facets : ndarray of int, shape (f, 2) or (f, 3)
        Numbers of points: start, end and middle.
    rigid, fit : ndarray, shape (2b, 3), (3, 2b)
        Rigid motions of the points, and the least squares fit to the known components.
    spread : csr_matrix, shape (2b, 2b)
        From the known components to all, along the boundary.
    """

    points: Array
    dofs: Index
    facets: Index
    rigid: Array
    fit: Array
    spread: csr_matrix

    @classmethod
    def of(cls, body: Body, known: Mask) -> Skin:
        """Prepare the boundary.

        Parameters
        ----------
        body : Body
        known : ndarray of bool, shape (n_body,)
            DOFs whose displacement will be known.
        """
        basis, mesh = body.basis, body.basis.mesh
        numbers = mesh.boundary_facets()
        vertices, ends = np.unique(mesh.facets[:, numbers].T, return_inverse=True)
        facets, dofs = ends.reshape(-1, 2), basis.nodal_dofs[:, vertices].T
        if basis.facet_dofs.size:
            facets = np.column_stack([facets, len(dofs) + np.arange(len(facets))])
            dofs = np.concatenate([dofs, basis.facet_dofs[:, numbers].T])
        points = basis.doflocs[:, dofs[:, 0]].T
        x, y = (points - points.mean(axis=0)).T / np.maximum(np.ptp(points), np.finfo(float).tiny)
        one, zero = np.ones(len(points)), np.zeros(len(points))
        columns = [np.stack(c, axis=1).ravel() for c in ((one, zero), (zero, one), (-y, x))]
        rigid, there = np.stack(columns, axis=1), known[dofs].ravel()
        fit = np.zeros(rigid.T.shape)
        fit[:, there] = np.linalg.pinv(rigid[there])
        return cls(points, dofs, facets, rigid, fit, _spread(points, facets, there))

    def moved(self, u: Array) -> Array:
        """Positions of the points, shape (b, 2); `u` has the known displacements of the body."""
        there = u[self.dofs].ravel()
        rigid = self.rigid @ (self.fit @ there)
        moved: Array = self.points + (rigid + self.spread @ (there - rigid)).reshape(-1, 2)
        return moved

    def placed(self, u: Array) -> Array:
        """The same where all displacements of the body are known."""
        placed: Array = self.points + u[self.dofs]
        return placed

    def outline(self, points: Array) -> Outline:
        """The boundary with its points at these places."""
        return drawn(*(points[column] for column in self.facets.T))


def _spread(points: Array, facets: Index, there: Mask) -> csr_matrix:
    """Interpolation along the boundary: currents in a net of wires that are as long as the facets."""
    n = len(points)
    pairs = facets if facets.shape[1] == 2 else facets[:, [0, 2, 2, 1]].reshape(-1, 2)
    a, b = pairs.T
    conductance = 1.0 / np.linalg.norm(points[a] - points[b], axis=1)
    wires = csr_matrix((np.tile(conductance, 2), (np.r_[a, b], np.r_[b, a])), shape=(n, n))
    leak = LEAK * conductance.max()
    net = csc_matrix(diags(np.asarray(wires.sum(axis=1)).ravel() + leak) - wires)
    rows, columns, values = [], [], []
    for i in range(2):
        known, missing = np.flatnonzero(there[i::2]), np.flatnonzero(~there[i::2])
        rows.append(2 * known + i)
        columns.append(2 * known + i)
        values.append(np.ones(len(known)))
        coupling = net[missing][:, known]
        beside = np.flatnonzero(
            coupling.getnnz(axis=0)
        )  # few: where a known piece of the boundary ends
        if not len(beside):
            continue
        inside = splu(csc_matrix(net[missing][:, missing]))
        found = csr_matrix(inside.solve(-coupling[:, beside].toarray())).tocoo()
        rows.append(2 * missing[found.row] + i)
        columns.append(2 * known[beside[found.col]] + i)
        values.append(found.data)
    entries = np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))
    return csr_matrix(entries, shape=(2 * n, 2 * n))
