r"""From contact DOFs to the gaps and slips of contact points: the small dense contact problem.

`Condensed` is what depends on the stiffness alone: every body condensed onto its contact DOFs
(`skfem_contact.problem.substructure`) and inverted. `PointProblem` adds where the points are: with
``z = B u`` the gaps and slips of the candidates, all else is eliminated (a Delassus operator, as in
Francavilla and Zienkiewicz, 1975). A new pairing costs a new `PointProblem` and nothing before it.

Bodies may float. A body that its supports do not hold is made definite by springs on a few anchor
DOFs away from contact, ``F = (S + P P')^-1``, whose extensions ``q = P'u`` are kept as extra rows
that carry no force; taking the springs away again is exact: with ``G = [B; P']``, ``A = (G F G')^-1``

    (A - [0, 0; 0, 1]) [z; q] = A G F f + [p; 0],

and q is eliminated. What is left is the stiffness against relative displacements of the points,
singular exactly where free motion is.

With many points, the dense matrix ``G F G'`` is most of the memory that a solver takes. It is formed by
blocks and inverted only on rows of points that may close (`zone`); its size is known before
(`dense_bytes`).
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import Any

import numpy as np
from scipy.linalg import LinAlgError
from scipy.sparse import csr_matrix

from skfem_contact.arrays import Array, block_diagonal
from skfem_contact.conditions.loads import LoadCase
from skfem_contact.conditions.rows import columns_of, stacked_rows, with_columns
from skfem_contact.errors import SingularMatrix
from skfem_contact.linalg.dense_factors import blocks, symmetrise
from skfem_contact.problem import thresholds
from skfem_contact.problem.points import PointSpace
from skfem_contact.problem.seam import (
    Conditions,
    ContactProblem,
    Load,
    OnContactDofs,
    PosedOn,
    Resistance,
    Response,
    Source,
)
from skfem_contact.problem.springs import (
    independent,
    point_resistance,
    resistance_by,
    spring_compliance,
)
from skfem_contact.problem.substructure import Components, Substructure, Substructures
from skfem_contact.problem.zone import Compliance, Zones


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


class PointProblem(OnContactDofs):
    """The contact problem on gaps and slips, see `Compliance`."""

    def __init__(self, bodies: Condensed, on: PosedOn) -> None:
        super().__init__(bodies, on)
        if bodies.P.nnz:
            self.G = stacked_rows([self.G, csr_matrix(bodies.P.T)])
        W, self.unknowns = bodies.compliance(self.G), self.q
        stable = all(part.definite for part in bodies.substructures)
        whole = Compliance(W, self.normal_rows, self.tangential_rows, self.q, stable)
        self.compliance = whole
        try:
            if whole.small or not (stable and independent(self.G, bodies.least_softness, W.diagonal())):
                self.zones.whole()
        except SingularMatrix:  # is told to whom it matters
            pass
        except LinAlgError:  # rows that depend on each other: corners, chains, tools that are held
            if on.independent():
                # it is a body that flows or buckles that makes them alike: they are taken as they are
                self._give_way(np.zeros(on.kin.m), np.zeros(self.tangential_rows.shape))
                try:
                    self.zones.whole()
                except LinAlgError as error:
                    raise SingularMatrix(str(error)) from None
                return
            self.springs = spring_compliance(self.rows, self.slips, bodies.softness)
            self._give_way(self.springs, self.springs[:, None])
            self.unknowns = 0

    @cached_property
    def zones(self) -> Zones:
        """Of this problem's memory."""
        return Zones(self.compliance)

    def _begin_anew(self) -> None:
        super()._begin_anew()
        vars(self).pop("zones", None)

    def _give_way(self, normal: Array, tangential: Array) -> None:
        """See all points through springs of these compliances, (m,) and (m, d-1), and no others."""
        give = self.on_rows(normal, tangential)
        self.compliance = self.compliance.with_springs(give - self.give)
        self.give = give
        self._begin_anew()

    @property
    def points(self) -> PointSpace | None:
        """The dense problem of all points; None where they are seen through springs."""
        return self.zones.whole().space if self.springs is None else None

    @cached_property
    def resistance(self) -> Resistance:
        """Return what each point resists by itself; anchors hold bodies that their supports do not.

        Where points are seen through springs, what its own DOFs resist: anchors depend on numbering.
        """
        if self.springs is None:
            return resistance_by(self.compliance.W, self.normal_rows, self.tangential_rows)
        return point_resistance(self.rows, self.slips, self.bodies.softness)

    def load(self, case: LoadCase) -> Load:
        """A load case on gaps and slips."""
        return self._load(case, *self.bodies.load(case.f, case.x))

    def other_load(self, case: LoadCase) -> Load:
        """A load case that is like no other, or one of its derivatives: nothing of it is remembered."""
        force = self.bodies.other_load(case.f, case.x)
        return self._load(case, (), force, self.bodies.flexibility(force))

    def _load(self, case: LoadCase, components: tuple[Any, ...], force: Array, u: Array) -> Load:
        return Load(np.zeros(0), *self.constant(case), force, components, self.G @ u)

    def solve(self, conditions: Conditions, load: Load) -> Response:
        """Gaps, slips and forces under these conditions."""
        return self.zones.solve(conditions, load)


def dense_bytes(kept: Sequence[int], rows: int) -> int:
    """Memory of the dense matrices of a contact problem at most, before any of them is there [bytes].

    That is the flexibility of each body, the stiffness of gaps and slips, and what an iteration makes
    of it: a factorisation, and what friction adds.

    Parameters
    ----------
    kept : sequence of int
        Contact DOFs of each body.
    rows : int
        Gaps and slips.

    Examples
    --------
    Two bodies of 1000 points, which all have three rows: four and a half matrices.

    >>> dense_bytes([3000, 3000], 3000) / (8 * 3000**2)
    4.5
    """
    return sum(8 * int(n) ** 2 for n in kept) + int(thresholds.PER_ROWS * 8 * rows**2)


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
