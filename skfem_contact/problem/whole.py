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
from scipy.linalg import LinAlgError
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
from skfem_contact.problem.thresholds import DEPENDENT, LAYERS, RECOVERED_AT_ONCE


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

    @once
    def springs(self) -> Array:
        """Springs to the ground on the anchors, ``P`` with stiffness ``P P'``, shape (k, k).

        As stiff as K itself there: what anchors alone feel of a body that floats may be nothing.
        """
        return np.diag(np.sqrt(np.maximum(self.K.diagonal()[self.anchors], self._firm)))

    @property
    def P(self) -> Array:
        """Springs to the ground on the anchors over the contact DOFs, (n_c, k)."""
        P = np.zeros((len(self.columns), len(self.anchors)))
        P[np.searchsorted(self.columns, self.kept)] = self.springs
        return P

    def respond(self, force: Array) -> Array:
        """``F`` times forces on the contact DOFs, (n_c,) -> (n_c,)."""
        if not len(self.columns):
            return np.zeros(0)
        return self._response(force, self.flexibility)

    def displaced(self, force: Array) -> Array:
        """Displacements of all free DOFs under forces on them, (n_f, r) -> (n_f, r)."""
        x = self._factor.eliminate(force)
        kept = self.flexibility @ x[len(x) - len(self.kept) :]
        u = np.empty_like(x)
        u[self._factor.order] = self._factor.substitute(kept, x)
        return u


W = TypeVar("W", bound=WholeBody)


class Whole(Substructures[W]):
    """All bodies by their factors."""

    def flexibility(self, force: Array) -> Array:
        """``F`` times forces on the contact DOFs, (n_c,) -> (n_c,)."""
        pieces = zip(self.substructures, self.column_spans, strict=True)
        return np.concatenate([part.respond(force[span]) for part, span in pieces])

    def load(self, case: LoadCase) -> Array:
        """Displacements (n_c,) of the contact DOFs where contact carries nothing, on the springs."""
        pieces = []
        for part, span in zip(self.substructures, self.spans, strict=True):
            force = part.free_load(case.f[span], case.x[span])
            some = len(part.columns) and force.any()
            moved = part.displaced(force[:, None])[:, 0] if some else np.zeros(len(part.free))
            pieces.append(moved[np.searchsorted(part.free, part.columns)])
        return np.concatenate(pieces)

    def surface(self, source: Source, case: LoadCase) -> Array:
        """Displacements (n,) known without further work: here of all DOFs, which take as much."""
        if not source.forces:
            return source.values
        return self.recover(Source(source.values[:, None], True), (), [case])[0]

    def recover(
        self,
        sources: Source,
        components: Sequence[tuple[Components | None, ...] | None],
        cases: Sequence[LoadCase],
    ) -> list[Array]:
        """All displacements, r arrays (n,), from r sources: forces on the contact DOFs (n_c, r).

        Or from displacements of all DOFs (n, r).
        """
        if not sources.forces:
            return [np.array(u) for u in sources.values.T]
        u = [np.array(case.x) for case in cases]
        for part, span, own in zip(self.substructures, self.spans, self.column_spans, strict=True):
            place = np.searchsorted(part.free, part.columns)
            for first in range(0, len(u), RECOVERED_AT_ONCE):
                some = slice(first, first + RECOVERED_AT_ONCE)
                loads = [part.free_load(case.f[span], case.x[span]) for case in cases[some]]
                force = np.column_stack(loads)
                force[place] += sources.values[own, some]
                for column, out in zip(part.displaced(force).T, u[some], strict=True):
                    out[span.start + part.free] = column
        return u


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
        springs[np.searchsorted(columns, part.anchors)] = np.diag(part.springs) ** 2
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

    def compliance(self, G: csr_matrix) -> Array:
        """Of each row by the diagonal of K; of rows between rigid bodies that of the others, (r,)."""
        own = np.asarray(G.multiply(G) @ self.softness).ravel()
        return np.where(own > 0, own, own.max(initial=0.0) or 1.0)

    def independent(self, G: csr_matrix, points: Array) -> bool:
        """Whether rows (r, n_c) do not depend on each other; `points` (r, d) is where each acts."""
        Q = csr_matrix(G @ diags(self.softness) @ G.T)
        deforms = Q.diagonal() > 0
        if not _independent(csr_matrix(G[~deforms])):
            return False
        moving = np.flatnonzero(deforms)
        try:
            factor = MultifrontalCholesky(csr_matrix(Q[moving][:, moving]), points[moving])
        except LinAlgError:
            return False
        return factor.pivot_ratio >= DEPENDENT**2

    def stiffness(self, G: csr_matrix) -> Callable[[Array], Array]:
        """Forces on some rows (r, n_c) that hold them at gaps and slips, (r,) -> (r,)."""
        shared = csr_matrix(G @ diags(self.softness))
        Q = csr_matrix(shared @ G.T)
        alone = Q.diagonal() == 0.0
        # as LU of a symmetric matrix: half the time of the order that knows nothing of it
        order = {"permc_spec": "MMD_AT_PLUS_A", "options": {"SymmetricMode": True}}
        solve = splu((Q + diags(alone.astype(float))).tocsc(), diag_pivot_thresh=0.0, **order).solve

        def force(z: Array) -> Array:
            u = shared.T @ solve(z)
            held = np.zeros(len(u))
            for layer, span in self._layers:
                held[span] = layer.stiffness(u[span])
            return np.asarray(solve(shared @ held))

        return force


def _independent(G: csr_matrix) -> bool:
    """Return whether rows that only rigid bodies move do not depend on each other.

    Such are slips at nodes whose displacements are prescribed, on a symmetry plane for instance: a few
    of them fix all the motions that a rigid body has, and the others follow.
    """
    moved = np.unique(G.indices)
    if G.shape[0] > len(moved):
        return False
    A = G[:, moved].toarray()
    A /= np.abs(A).max(axis=0, initial=np.finfo(float).tiny)  # turns have another unit
    A /= np.linalg.norm(A, axis=1, keepdims=True)
    return bool(np.linalg.svd(A, compute_uv=False).min(initial=1.0) >= DEPENDENT)
