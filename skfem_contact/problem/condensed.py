r"""All bodies, each condensed onto its contact DOFs (`substructure`) and inverted.

It depends on the stiffness alone; where the points are is added by `zone`.

Bodies may float. A body that its supports do not hold is made definite by springs on a few anchor
DOFs away from contact, ``F = (S + P P')^-1``, whose extensions ``q = P'u`` are kept as extra rows
that carry no force; taking the springs away again is exact: with ``G = [B; P']``, ``A = (G F G')^-1``

    (A - [0, 0; 0, 1]) [z; q] = A G F f + [p; 0],

and q is eliminated. What is left is the stiffness against relative displacements of the points,
singular exactly where free motion is.

With many points, the dense matrix ``G F G'`` is most of the memory that a solver takes. It is formed by
blocks and inverted only on rows of points that may close (`zone`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property
from typing import Any

import numpy as np
from scipy.sparse import csr_matrix

from skfem_contact.arrays import Array, Index, block_diagonal
from skfem_contact.bodies.body import Body
from skfem_contact.bodies.member import Member
from skfem_contact.bodies.system import System, slices
from skfem_contact.conditions.rows import columns_of, with_columns
from skfem_contact.conditions.state import LoadCase
from skfem_contact.linalg.backend import Backend
from skfem_contact.linalg.dense_factors import blocks, symmetrise
from skfem_contact.linalg.direct import Direct
from skfem_contact.problem.seam import (
    ContactProblem,
    PosedOn,
    Source,
)
from skfem_contact.problem.substructure import Components, Substructure
from skfem_contact.problem.zone import PointProblem
from skfem_contact.records import once

# Results whose interior is recovered at a time: enough for matrix products, few enough for memory.
RECOVERED_AT_ONCE = 32


class Substructures:
    """All bodies, each reduced to its contact DOFs.

    Parameters
    ----------
    system : System
    stiffness : sequence of csr_matrix
        Of each body.
    wanted : ndarray of int
        DOFs (stacked) that contact rows may touch.
    reuse : sequence of Substructure or None
        Parts that are still good, if they are of this kind.
    backend : Backend, optional
        What factorises the bodies, see `Substructure`.

    Attributes
    ----------
    spans, column_spans : list of slice
        All DOFs of each body, and its contact DOFs among those of all.
    columns : ndarray of int, shape (n_c,)
        Contact DOFs and anchors.
    P : csr_matrix, shape (n_c, k)
        Springs to the ground on the anchors, of the stiffness ``P P'``: one entry in each column.
    """

    kind: type[Substructure]
    usual: Callable[[], Any] = Direct

    def __init__(
        self,
        system: System,
        stiffness: Sequence[csr_matrix],
        wanted: Index,
        reuse: Sequence[Substructure | None] = (),
        backend: Backend | None = None,
    ) -> None:
        self.backend: Any
        self.system, self.stiffness, self.backend = system, stiffness, backend or self.usual()
        self.spans, self.substructures = slices(system.offsets), list[Any]()
        for i, body in enumerate(system.bodies):
            part = reuse[i] if len(reuse) else None
            if type(part) is not self.kind:
                firm = firmness(system, stiffness, wanted) if len(body.rotations) else 0.0
                mine = wanted_of(body, self.spans[i], wanted)
                part = self.kind(body, stiffness[i], mine, firm, self.backend, system.modes(i))
            self.substructures.append(part)
        parts = list(zip(self.substructures, self.spans, strict=True))
        columns = [part.columns + span.start for part, span in parts]
        self.columns = np.concatenate(columns)
        self.column_spans = slices(np.cumsum([0, *map(len, columns)]))
        anchors = np.concatenate([part.anchors + span.start for part, span in parts])
        place = np.searchsorted(self.columns, anchors), np.arange(len(anchors))
        springs = np.concatenate([part.springs for part, _ in parts])
        self.P = csr_matrix((np.sqrt(springs), place), (len(self.columns), len(anchors)))

    @once
    def softness(self) -> Array:
        """Return how far a unit force moves each contact DOF, all others held, (n_c,) [length/force].

        By the diagonal of K, which knows of no anchors; zero of a rigid body.
        """
        stiff = [
            part.K.diagonal()[part.columns]
            if isinstance(part.body, Body)
            else np.full(len(part.columns), np.inf)
            for part in self.substructures
        ]
        return 1.0 / np.concatenate(stiff)

    def recover(
        self, sources: Source, components: Sequence[Any], cases: Sequence[LoadCase]
    ) -> list[Array]:
        """All displacements, r arrays (n,), from r sources: forces on the contact DOFs (n_c, r).

        Or from displacements of all DOFs (n, r), which are the sources themselves. `components` are
        those of the loads of all bodies, where they have any, see `Substructure.components`.
        """
        if not sources.forces:
            return [np.array(u) for u in sources.values.T]
        u = [np.array(case.x) for case in cases]
        for k, (span, own) in enumerate(zip(self.spans, self.column_spans, strict=True)):
            part = self.substructures[k]
            place = span.start + part.order
            for first in range(0, len(u), RECOVERED_AT_ONCE):
                some = slice(first, first + RECOVERED_AT_ONCE)
                x = part.recover(
                    sources.values[own, some],
                    [known[k] if known else None for known in components[some]],
                    [(case.f[span], case.x[span]) for case in cases[some]],
                )
                for few in range(0, x.shape[1], 8):  # a copy of all would take as much memory again
                    columns = np.ascontiguousarray(x[:, few : few + 8].T)
                    for column, out in zip(columns, u[first + few :], strict=False):
                        out[place] = column
                del x  # or it waits while the next one is computed
        return u


class Condensed(Substructures):
    """All bodies condensed onto their contact DOFs."""

    kind = Substructure

    _along: tuple[list[tuple[int, ...]], Array, Array] | None = None

    def flexibility(self, force: Array) -> Array:
        """``F`` times forces on the contact DOFs, (n_c, r) -> (n_c, r)."""
        pieces = [
            part.flexibility @ force[span]
            for part, span in zip(self.substructures, self.column_spans, strict=True)
        ]
        return np.concatenate(pieces)

    def compliance(self, G: csr_matrix) -> Array:
        """``G F G'`` for sparse rows over the contact DOFs, (r, n_c) -> (r, r)."""
        W = np.zeros((G.shape[0], G.shape[0]))
        for part, span in zip(self.substructures, self.column_spans, strict=True):
            delassus_compliance(W, columns_of(G, span), part.flexibility)
        for rows in blocks(len(W)):  # all else is written twice
            symmetrise(W[rows, rows])
        return W

    def load(self, f: Array, x: Array) -> tuple[tuple[Components | None, ...], Array, Array]:
        """What `recover` wants to know of loads; forces and displacements of the contact DOFs, (n_c,).

        Of loads that follow from those before only sums of what is known: see `LoadSpan`. The load of a
        body that has had too many is its own, beside those of the others.
        """
        parts = list(zip(self.substructures, self.spans, strict=True))
        found = [part.components(f[span], x[span]) for part, span in parts]
        counts = [tuple(map(len, pair)) if pair else () for pair in found]
        known = self._along  # which another thread may put another one in the place of
        if known is None or known[0] != counts:
            each = zip(self.substructures, found, strict=True)
            along = block_diagonal([part.along(own) for part, own in each])
            known = self._along = counts, along, self.flexibility(along)
        c = np.concatenate([own for pair in found if pair for own in pair] or [np.zeros(0)])
        force, moved = known[1].dot(c), known[2].dot(c)
        for (part, span), pair, own in zip(parts, found, self.column_spans, strict=True):
            if pair is None:
                force[own] = part.changed_load(f[span], x[span])
                moved[own] = part.flexibility @ force[own]
        return tuple(found), force, moved

    def other_load(self, f: Array, x: Array) -> Array:
        """Loads condensed onto the contact DOFs, (n_c,); nothing of them is remembered."""
        parts = zip(self.substructures, self.spans, strict=True)
        return np.concatenate([part.other_load(f[span], x[span]) for part, span in parts])

    def surface(self, source: Source, case: LoadCase) -> Array:
        """Displacements (n,) known without the interior: contact DOFs and prescribed ones."""
        u = np.zeros(self.system.n)
        u[self.system.D] = case.x[self.system.D]
        u[self.columns] = self.flexibility(source.values)
        return u

    @cached_property
    def least_softness(self) -> Array:
        """Return how far a unit force moves each contact DOF at least, (n_c,) [length/force].

        By Gershgorin's circles ``S + P P' <= diag(sum_j |K_ij|) + P P'``.
        """
        rows = [np.asarray(abs(p.K[p.kept]).sum(axis=1)).ravel() for p in self.substructures]
        return np.asarray(1.0 / (np.concatenate(rows) + self.P.power(2) @ np.ones(self.P.shape[1])))

    def attach(self, on: PosedOn) -> ContactProblem:
        """The contact problem on one pairing."""
        return PointProblem(self, on)


def delassus_compliance(W: Array, G: csr_matrix, F: Array) -> None:
    """Add ``G F G'`` of one body to W, by blocks of rows, of which half are the others transposed.

    What slides over a long surface touches few of its DOFs: the rest of F is left out where that is
    most of it.

    Parameters
    ----------
    W : ndarray, shape (r, r)
    G : csr_matrix, shape (r, n)
    F : ndarray, shape (n, n)
    """
    touched = np.zeros(len(F), dtype=bool)
    touched[G.indices] = True
    some = np.flatnonzero(touched)
    if 2 * len(some) < len(F):
        place = np.cumsum(touched) - 1
        G, F = with_columns(G, place, len(some)), F[np.ix_(some, some)]
    for rows in blocks(len(W)):
        begin, end = rows.start, rows.stop
        whole = end - begin == len(W)
        part, below = (G, G) if whole else (G[rows], G[begin:])
        found = below @ (part @ F).T
        W[begin:, rows] += found
        W[rows, end:] += found[end - begin :].T


def wanted_of(body: Member, span: slice, wanted: Index) -> Index:
    """Of stacked DOFs those of one body that are not prescribed, in its own numbering."""
    chosen = np.zeros(body.n, dtype=bool)
    chosen[wanted[(wanted >= span.start) & (wanted < span.stop)] - span.start] = True
    chosen[body.D] = False
    return np.flatnonzero(chosen)


def firmness(system: System, stiffness: Sequence[csr_matrix], wanted: Index) -> float:
    """Stiffness that rigid bodies meet: the median over contact DOFs of the other bodies."""
    solid = np.concatenate([np.full(body.n, isinstance(body, Body)) for body in system.bodies])
    diagonal = np.concatenate([K.diagonal() for K in stiffness])
    return float(np.median(diagonal[wanted[solid[wanted]]]))
