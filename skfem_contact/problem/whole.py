r"""Bodies by their factors alone: what forces on contact DOFs move there, without a dense matrix.

Where a surface has too many points for dense matrices, the contact DOFs are eliminated like all
others. Displacements at the contact under forces there, ``F f``, then cost a substitution through the
fronts above the contact DOFs, somewhat more than half of them in a solid.

What is dense are the springs on the anchors of bodies that their supports do not hold, as in
`condensed`: ``F = R (K + P P')^-1 R'``, R selecting contact DOFs and anchors.

A stiffness of the points that is cheap preconditions the iterated contact problem (`Layers`).
Forces on points move them by ``G F G'``; the inverse of that is a stiffness ``S`` of the bodies'
surfaces. It is well approximated by that of a layer of few elements under each surface, the rest of
the body held (`S_b`), and by sharing what two surfaces move against each other out to both, the
softer moving more (D: diagonal of K),

    S = Q^-1 (sum over bodies of G D^-1 S_b D^-1 G') Q^-1,     Q = G D^-1 G',

the preconditioner of dual domain decomposition [1]_ for a layer in place of a body: with four elements
it takes 20 iterations where the whole body takes 13 and the surface's own entries of K take 45 (1089
points that all touch).

References
----------
.. [1] A. Klawonn and O. B. Widlund, FETI and Neumann-Neumann iterative substructuring methods,
   Communications on Pure and Applied Mathematics 54 (2001) 57-90.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, TypeVar

import numpy as np
from scipy.sparse import csr_matrix, diags
from scipy.sparse.linalg import splu

from skfem_contact.arrays import Array, Index
from skfem_contact.bodies.body import Body
from skfem_contact.conditions.loads import LoadCase
from skfem_contact.linalg.backend import Surface
from skfem_contact.linalg.multifrontal.factor import MultifrontalCholesky, SurfaceResponse
from skfem_contact.once import once
from skfem_contact.problem.response import Source
from skfem_contact.problem.substructure import Components, Substructure, Substructures
from skfem_contact.problem.thresholds import LAYERS


class WholeBody(Substructure):
    """One body with all its factors, of which only the anchors are left.

    Attributes
    ----------
    columns : ndarray of int
        Contact DOFs and anchors, sorted.
    kept : ndarray of int
        The anchors.
    """

    keeps_contact = False

    @once
    def _place(self) -> Index:
        return np.searchsorted(self.free, self.columns)

    @once
    def _response(self) -> Surface:
        return self._factor.response(self._place)

    def respond(self, force: Array) -> Array:
        """``F`` times forces on the contact DOFs, (n_c,) -> (n_c,)."""
        if not len(self.columns):
            return np.zeros(0)
        return self._response(force, self.flexibility)

    def recover(
        self,
        force: Array,
        components: Sequence[Components | None],
        loads: Sequence[tuple[Array, Array]],
    ) -> Array:
        """Displacements of the DOFs `order` (n_f, r) under forces on the contact DOFs and loads."""
        f = np.column_stack([self.free_load(*load) for load in loads])
        f[self._place] += force
        x = self._factor.eliminate(f)
        return self._factor.substitute(self.flexibility @ x[len(x) - len(self.kept) :], x)


W = TypeVar("W", bound=WholeBody)


class Whole(Substructures[W]):
    """All bodies by their factors."""

    def flexibility(self, force: Array) -> Array:
        """``F`` times forces on the contact DOFs, (n_c,) -> (n_c,)."""
        pieces = zip(self.substructures, self.column_spans, strict=True)
        return np.concatenate([part.respond(force[span]) for part, span in pieces])

    def load(self, case: LoadCase) -> Array:
        """Displacements (n_c,) of the contact DOFs where contact carries nothing, on the springs."""
        return self.surface(Source(np.zeros(len(self.columns)), True), case)[self.columns]

    def surface(self, source: Source, case: LoadCase) -> Array:
        """Displacements (n,) known without further work: here of all DOFs, which take as much."""
        return self.recover(Source(source.values[:, None], source.forces), [None], [case])[0]


class Layer:
    """The layer of a body under its contact DOFs.

    Parameters
    ----------
    part : WholeBody

    Attributes
    ----------
    diagonal : ndarray, shape (n_c,)
        Of K at the contact DOFs [force/length].
    """

    def __init__(self, part: WholeBody) -> None:
        K, columns = part.K, part.columns
        self.diagonal = K.diagonal()[columns]
        inside = np.zeros(K.shape[0])
        inside[columns] = 1.0
        for _ in range(LAYERS):
            inside = (abs(K) @ inside > 0).astype(float)
        inside[part.body.D] = inside[columns] = 0.0
        layer = np.flatnonzero(inside)
        # springs on anchors count where these touch: without them the layer would follow a rigid motion
        springs = np.zeros(len(columns))
        springs[np.searchsorted(columns, part.anchors)] = part.springs
        self._K_cc = csr_matrix(K[columns][:, columns] + diags(springs))
        self._K_cl = csr_matrix(K[columns][:, layer])
        K_ll = csr_matrix(K[layer][:, layer])
        factor = MultifrontalCholesky(K_ll, part.body.dof_points[layer])
        near = np.unique(self._K_cl.indices)
        self._K_cl = self._K_cl[:, near]
        self._inverse = SurfaceResponse(factor, near, single=True)

    def stiffness(self, u: Array) -> Array:
        """Forces on the contact DOFs that hold them at displacements, (n_c,) -> (n_c,)."""
        return np.asarray(self._K_cc @ u - self._K_cl @ self._inverse(self._K_cl.T @ u))


class Layers:
    """The layers of all bodies, and the rows of the points over them.

    Parameters
    ----------
    bodies : Whole
    """

    def __init__(self, bodies: Whole[Any]) -> None:
        parts = zip(bodies.substructures, bodies.column_spans, strict=True)
        # rigid bodies have no layer: what moves are the others
        self._layers = [
            (Layer(part), span)
            for part, span in parts
            if isinstance(part.body, Body) and len(part.columns)
        ]
        self.softness = np.zeros(len(bodies.columns))
        for layer, span in self._layers:
            self.softness[span] = 1.0 / layer.diagonal

    def stiffness(self, G: csr_matrix) -> Callable[[Array], Array]:
        """Forces on some rows (r, n_c) that hold them at gaps and slips, (r,) -> (r,)."""
        shared = csr_matrix(G @ diags(self.softness))
        Q = csr_matrix(shared @ G.T)
        # as LU of a symmetric matrix: half the time of the order that knows nothing of it
        order = {"permc_spec": "MMD_AT_PLUS_A", "options": {"SymmetricMode": True}}
        solve = splu(Q.tocsc(), diag_pivot_thresh=0.0, **order).solve

        def force(z: Array) -> Array:
            u = shared.T @ solve(z)
            held = np.zeros(len(u))
            for layer, span in self._layers:
                held[span] = layer.stiffness(u[span])
            return np.asarray(solve(shared @ held))

        return force
