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
from copy import copy
from functools import cached_property
from typing import Any

import numpy as np
from scipy.linalg import LinAlgError
from scipy.sparse import csr_matrix

from skfem_contact.arrays import Array, Mask, block_diagonal
from skfem_contact.conditions.loads import LoadCase
from skfem_contact.conditions.rows import columns_of, stacked_rows, with_columns
from skfem_contact.errors import SingularMatrix
from skfem_contact.linalg.dense_factors import blocks, symmetrise
from skfem_contact.problem import thresholds
from skfem_contact.problem.points import PointSpace
from skfem_contact.problem.response import Conditions, Load, Resistance, Response, Source
from skfem_contact.problem.seam import ContactProblem, OnContactDofs, PosedOn
from skfem_contact.problem.springs import point_resistance, resistance_by, spring_compliance
from skfem_contact.problem.substructure import Components, Substructure, Substructures
from skfem_contact.problem.thresholds import RECOVERED_AT_ONCE
from skfem_contact.problem.zone import Compliance, Zones


class Condensed(Substructures[Substructure]):
    """All bodies condensed onto their contact DOFs."""

    kind = Substructure

    def __init__(self, *parts: Any) -> None:
        super().__init__(*parts)
        self._split: dict[str, tuple[Array, list[Array]]] = {}
        self._along: tuple[list[int], Array, Array] | None = None

    @cached_property
    def anchor_rows(self) -> csr_matrix:
        """The extensions of the springs as rows over the contact DOFs: P', one entry in each."""
        count = self.P.shape[1]
        entries = self.P.max(axis=0), self.P.argmax(axis=0), np.arange(count + 1)
        return csr_matrix(entries, shape=(count, len(self.P)))

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

    def components(self, f: Array, x: Array) -> tuple[Components | None, ...]:
        """Return what `recover` wants to know of loads: of each body, see `Substructure.components`."""
        parts = zip(self.substructures, self._parts("f", f), self._parts("x", x), strict=True)
        return tuple([part.components(*loads) for part, *loads in parts])

    def _parts(self, what: str, vector: Array) -> list[Array]:
        """What of a vector is each body's: of one that has not changed the same arrays as before."""
        known = self._split.get(what)
        if known is None or known[0] is not vector:
            known = self._split[what] = vector, [vector[span] for span in self.spans]
        return known[1]

    def load(self, f: Array, x: Array) -> Array:
        """Loads condensed onto the contact DOFs, (n_c,)."""
        parts = zip(self.substructures, self.spans, strict=True)
        return np.concatenate([part.load(f[span], x[span]) for part, span in parts])

    def other_load(self, f: Array, x: Array) -> Array:
        """The same of loads that are not to be remembered, (n_c,)."""
        parts = zip(self.substructures, self.spans, strict=True)
        return np.concatenate([part.other_load(f[span], x[span]) for part, span in parts])

    def along(self, components: Sequence[Components]) -> tuple[Array, Array]:
        """Loads on the contact DOFs that have one component, of all that there are, (n_c, k).

        And the displacements of the contact DOFs under them: the same on every pairing.
        """
        counts, known = [len(c) for pair in components for c in pair], self._along
        if known is None or known[0] != counts:
            parts = zip(self.substructures, components, strict=True)
            force = block_diagonal([part.along(own) for part, own in parts])
            known = self._along = counts, force, self.flexibility(force)
        return known[1:]

    def contact_dofs(self, source: Source) -> Array:
        """Displacements of the contact DOFs, (n_c,) or (n_c, r)."""
        return self.flexibility(source.values) if source.forces else source.values

    def surface(self, source: Source, case: LoadCase) -> Array:
        """Displacements (n,) known without the interior: contact DOFs and prescribed ones."""
        u = np.zeros(self.system.n)
        u[self.system.D] = case.x[self.system.D]
        u[self.columns] = self.contact_dofs(source)
        return u

    def recover(
        self,
        sources: Source,
        components: Sequence[tuple[Components | None, ...] | None],
        cases: Sequence[LoadCase],
    ) -> list[Array]:
        """All displacements, r arrays (n,), from r sources (n_c, r)."""
        u_c = self.contact_dofs(sources)
        u = [np.array(case.x) for case in cases]
        for k, (span, kept) in enumerate(zip(self.spans, self.column_spans, strict=True)):
            part = self.substructures[k]
            place = span.start + part.order
            for first in range(0, len(u), RECOVERED_AT_ONCE):
                some = slice(first, first + RECOVERED_AT_ONCE)
                x = part.recover(
                    u_c[kept, some],
                    [known[k] if known else None for known in components[some]],
                    [(case.f[span], case.x[span]) for case in cases[some]],
                )
                for few in range(0, x.shape[1], 8):  # a copy of all would take as much memory again
                    columns = np.ascontiguousarray(x[:, few : few + 8].T)
                    for column, out in zip(columns, u[first + few :], strict=False):
                        out[place] = column
                del x  # or it waits while the next one is computed
        return u

    @cached_property
    def softness(self) -> Array:
        """How far a unit force moves each contact DOF, all others held, (n_c,) [length/force]."""
        return np.concatenate([part.softness for part in self.substructures])

    @cached_property
    def least_softness(self) -> Array | None:
        """Return how far a unit force moves each contact DOF at least, (n_c,) [length/force].

        By Gershgorin's circles ``S + P P' <= diag(sum_j |K_ij|) + P P'``. None where K is elsewhere.
        """
        if not all(isinstance(part.K, csr_matrix) for part in self.substructures):
            return None
        rows = [np.asarray(abs(p.K[p.kept]).sum(axis=1)).ravel() for p in self.substructures]
        return np.asarray(1.0 / (np.concatenate(rows) + np.sum(self.P**2, axis=1)))

    def attach(self, on: PosedOn, prefer: Mask, labels: Sequence[str]) -> ContactProblem:
        """The contact problem on one pairing."""
        return PointProblem(self, on)


class PointProblem(OnContactDofs):
    """The contact problem on gaps and slips, see `Compliance`."""

    def __init__(self, bodies: Condensed, on: PosedOn) -> None:
        super().__init__(bodies, on)
        if bodies.P.size:
            self.G = stacked_rows([self.G, bodies.anchor_rows])
        W = bodies.compliance(self.G)
        stable = all(part.definite for part in bodies.substructures)
        self.compliance = Compliance(W, self.normal_rows, self.tangential_rows, self.q, stable)
        self.zones, self.unknowns = Zones(self.compliance), self.q
        try:
            if not self.compliance.independent(self.G, bodies.least_softness):
                self.zones.whole()
        except SingularMatrix:  # is told to whom it matters
            pass
        except LinAlgError:  # rows that depend on each other: corners, chains, tools that are held
            if on.independent is not None and on.independent():
                self._take_all()
            else:
                self.springs = spring_compliance(self.rows, self.slips, bodies.softness)
                self._give_way(self.springs, self.springs[:, None])
                self.unknowns = 0
        # what follows from loads that have one component, of so many as there were of each kind
        self._follows = np.zeros((len(bodies.columns) + len(W), 0))
        self._counts: list[int] = []

    def _begin_anew(self) -> None:
        super()._begin_anew()
        if hasattr(self, "compliance"):
            self.zones = Zones(self.compliance)

    def _take_all(self) -> None:
        """Take the rows as they are: it is a body that flows or buckles that makes them alike."""
        self.compliance = self.compliance.with_springs(np.zeros(self.q))
        self._begin_anew()
        try:
            self.zones.whole()
        except LinAlgError as error:
            raise SingularMatrix(str(error)) from None

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
        components = self.bodies.components(case.f, case.x)
        whole = [pair for pair in components if pair is not None]
        if len(whole) == len(components):
            known = [c for pair in whole for c in pair]
            counts = [len(c) for c in known]
            if counts != self._counts:
                self._counts, self._follows = counts, self._following(*self.bodies.along(whole))
            found = self._follows.dot(np.concatenate(known))
        else:
            force = self.bodies.load(case.f, case.x)
            found = self._following(force, self.bodies.flexibility(force))
        return self._load(case, found, components)

    def other_load(self, case: LoadCase) -> Load:
        """A load case that is like no other, or one of its derivatives: nothing of it is remembered."""
        force = self.bodies.other_load(case.f, case.x)
        return self._load(case, self._following(force, self.bodies.flexibility(force)), ())

    def _load(self, case: LoadCase, found: Array, components: tuple[Any, ...]) -> Load:
        rows = len(self.compliance.W)
        return Load(np.zeros(0), *self.constant(case), found[rows:], components, found[:rows])

    def _following(self, f_c: Array, u_c: Array) -> Array:
        """Changes of gaps, slips and anchors; then the loads themselves.

        From loads on the contact DOFs, (n_c,) or (n_c, r), and the displacements that follow from them.
        """
        return np.concatenate([self.G @ u_c, f_c])

    def solve(self, conditions: Conditions, load: Load) -> Response:
        """Gaps, slips and forces under these conditions."""
        return self.zones.solve(conditions, load)

    def in_series(self, C: Resistance) -> PointProblem:
        """The same problem with springs of the stiffness C in series with its points."""
        new = copy(self)
        new.springs = None  # that are to lose their strain
        new._give_way(1.0 / C.normal, 1.0 / C.tangential[:, None])
        return new


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
