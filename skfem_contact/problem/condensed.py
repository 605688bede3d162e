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

With many points, the dense matrix ``(G F G')^-1`` of the rows of gaps, slips and anchors is most of the
memory that a solver takes. So it is formed by blocks of rows, changed in place from then on, and its
size is known before (`dense_bytes`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import LinAlgError
from scipy.sparse import csr_matrix, diags

from skfem_contact.arrays import block_diagonal
from skfem_contact.bodies.system import System, slices
from skfem_contact.conditions.loads import LoadCase
from skfem_contact.conditions.rows import columns_of, stacked_rows, with_columns
from skfem_contact.linalg.backend import Backend
from skfem_contact.linalg.dense_factors import (
    DenseFactors,
    blocks,
    cholesky,
    divide,
    lu,
    subtract_product,
    symmetrise,
)
from skfem_contact.problem import thresholds
from skfem_contact.problem.points import PointsInSeries, PointSpace, on_rows
from skfem_contact.problem.response import Conditions, Load, Resistance, Response, Source
from skfem_contact.problem.seam import ContactProblem, OnContactDofs, PosedOn
from skfem_contact.problem.springs import point_resistance, spring_compliance
from skfem_contact.problem.substructure import Components, Substructure, substructures_of
from skfem_contact.problem.thresholds import RECOVERED_AT_ONCE, STIFFER

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Mask = NDArray[np.bool_]


class Condensed:
    """All bodies condensed onto their contact DOFs.

    Parameters
    ----------
    system : System
    stiffness : sequence of csr_matrix
        Of each body.
    wanted : ndarray of int
        DOFs (stacked) that contact rows may touch.
    reuse : sequence of Substructure or None
        Parts that are still good.
    backend : Backend, optional
        What factorises the bodies, see `Substructure`.
    """

    def __init__(
        self,
        system: System,
        stiffness: Sequence[csr_matrix],
        wanted: Index,
        reuse: Sequence[Substructure | None] = (),
        backend: Backend | None = None,
    ) -> None:
        self.system = system
        self.spans = slices(system.offsets)  # DOFs of each body
        self.substructures = substructures_of(Substructure, system, stiffness, wanted, reuse, backend)
        kept = [
            part.kept + span.start for part, span in zip(self.substructures, self.spans, strict=True)
        ]
        self.columns = np.concatenate(kept)
        # contact DOFs of each body among all contact DOFs
        self.kept_spans = slices(np.cumsum([0, *map(len, kept)]))
        self.P = block_diagonal([part.springs for part in self.substructures])
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
            for part, span in zip(self.substructures, self.kept_spans, strict=True)
        ]
        return np.concatenate(pieces)

    def row_flexibility(self, rows: csr_matrix) -> Array:
        """Sparse rows over the contact DOFs times ``F``, (r, n_c) -> (r, n_c)."""
        pieces = [
            columns_of(rows, span) @ part.flexibility
            for part, span in zip(self.substructures, self.kept_spans, strict=True)
        ]
        return np.concatenate(pieces, axis=1)

    def compliance(self, G: csr_matrix) -> Array:
        """``G F G'`` for sparse rows over the contact DOFs, (r, n_c) -> (r, r)."""
        W = np.zeros((G.shape[0], G.shape[0]))
        for part, span in zip(self.substructures, self.kept_spans, strict=True):
            delassus_compliance(W, columns_of(G, span), part.flexibility)
        return W

    def components(self, f: Array, x: Array) -> tuple[Components | None, ...]:
        """What `recover` wants to know of loads: of each body, see `Substructure.components`."""
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
        for k, (span, kept) in enumerate(zip(self.spans, self.kept_spans, strict=True)):
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

    def attach(self, on: PosedOn, prefer: Mask, labels: Sequence[str]) -> ContactProblem:
        """The contact problem on one pairing."""
        return PointProblem(self, on)


class PointProblem(OnContactDofs[Condensed]):
    """The contact problem on gaps and slips, see `PointSpace`."""

    def __init__(self, bodies: Condensed, on: PosedOn) -> None:
        super().__init__(bodies, on)
        B, normal_rows, tangential_rows = self.changing_rows(on)
        self._places = normal_rows, tangential_rows, B.shape[0]
        # of the dense matrices S alone is kept, in the place of A; G F follows from G
        self.G = G = stacked_rows([B, bodies.anchor_rows] if bodies.P.size else [B])
        self.q = q = B.shape[0]
        self.springs: Array | None = None
        try:
            W = bodies.compliance(G)
            stable = all(part.definite for part in bodies.substructures)
            A = definite_inverse(W) if stable else indefinite_inverse(W)
        except LinAlgError:  # rows that depend on each other: corners, chains, tools that are held
            A = self._inverse_with_springs()
        self.A_zq, self.A_qq = A[:q, q:].copy(), A[q:, q:].copy()
        self.rigid = lu(self.A_qq - np.eye(len(A) - q))
        S = without_anchors(A, self.A_zq, self.rigid)
        self.space = PointSpace(S, normal_rows, tangential_rows)
        self.points: PointSpace | None = self.space if self.springs is None else None
        # what follows from loads that have one component, of so many as there were of each kind
        self._follows = np.zeros((len(bodies.columns) + 2 * q + len(self.A_qq), 0))
        self._counts: list[int] = []

    def _begin_anew(self) -> None:
        super()._begin_anew()
        space = self.space
        self.space = PointSpace(space.S, space.normal_rows, space.tangential_rows)
        self.points = self.space if self.springs is None else None

    def _inverse_with_springs(self) -> Array:
        """``(G F G' + E)^-1``, E of the springs in series with the points."""
        rows, slips, bodies = self.rows, self.slips, self.bodies
        self.springs = spring_compliance(rows, slips, lambda B: B.multiply(B) @ bodies.softness)
        self._give = self._on_rows(self.springs, self.springs[:, None])
        W = bodies.compliance(self.G)
        W[np.diag_indices(self.q)] += self._give
        return definite_inverse(W, refuses=False)

    def _on_rows(self, normal: Array, tangential: Array) -> Array:
        return on_rows((normal, tangential), *self._places)

    @cached_property
    def resistance(self) -> Resistance:
        """What each point resists by itself; anchors hold bodies that their supports do not.

        Where points are seen through springs, what its own DOFs resist: anchors depend on numbering.
        """
        if self.springs is None:
            return point_resistance(self.rows, self.slips, self.bodies.row_flexibility)
        given = diags(STIFFER * self.bodies.softness)
        return point_resistance(self.rows, self.slips, lambda rows: rows @ given)

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
        force, rest = found[: self.q], len(found) - len(self.bodies.columns)
        gap0, slip0 = self.constant(case)
        return Load(force, gap0, slip0, found[rest:], components, found[self.q : rest])

    def _following(self, f_c: Array, u_c: Array) -> Array:
        """Forces on gaps and slips, and changes of gaps, slips and anchors; then the loads themselves.

        From loads on the contact DOFs, (n_c,) or (n_c, r), and the displacements that follow from them.
        """
        moved = self.G @ u_c
        # A_zz - A_zq R A_qz = S and A_zq (1 - R A_qq) = -A_zq R, with R = (A_qq - 1)^-1
        force = self.space.S @ moved[: self.q] - self.A_zq @ self.rigid.solve(moved[self.q :])
        return np.concatenate([force, moved, f_c])

    def solve(self, conditions: Conditions, load: Load) -> Response:
        """Gaps, slips and forces under these conditions."""
        return self.space.solve(conditions, load)

    def at_forces(self, load: Load, normal_force: Array, tangential_force: Array) -> Load:
        """The load with the forces at which the springs of the problem have no strain."""
        strained = self._give * self._on_rows(normal_force, -tangential_force)
        return replace(load, force=load.force - self.space.S.dot(strained), strained=strained)

    def in_series(self, C: Resistance) -> PointsInSeries:
        """The same problem with springs of the stiffness C in series with its points."""
        return PointsInSeries(self.space, C, self.springs)

    def source(self, load: Load, response: Response) -> Source:
        """Forces on the contact DOFs: loads, contact, and the springs on the anchors."""
        return self.sources([(load, response)])[0]

    def sources(self, found: Sequence[tuple[Load, Response]]) -> list[Source]:
        """Those of many answers: sparse matrices are quick where they meet many vectors at once."""
        from_gaps, from_slips = self.onto_dofs
        loads, responses = [load for load, _ in found], [response for _, response in found]
        force = np.column_stack([load.prescribed for load in loads])
        force += from_gaps @ np.column_stack([r.normal_force for r in responses])
        # A [z; q] - A G F f is the force on all rows, of which the last is q itself
        z = np.column_stack([r.solution for r in responses])
        known = np.column_stack([load.moved for load in loads if load.moved is not None])
        along = self.A_zq.T @ (known[: self.q] - z) + self.A_qq @ known[self.q :]
        force += self.bodies.P @ self.rigid.solve(along)
        if self.slips:
            force -= from_slips @ np.column_stack([r.tangential_force.ravel() for r in responses])
        return [Source(column.copy(), forces=True) for column in force.T]


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
    """Add ``G F G'`` of one body to W, by blocks of rows.

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
        part = G[rows] if rows.stop - rows.start < len(W) else G
        W[:, rows] += G @ (part @ F).T


def indefinite_inverse(W: Array) -> Array:
    """Inverse of a symmetric matrix that is not positive definite, as of bodies that are not stable.

    Raises
    ------
    LinAlgError
        Rows depend on each other.
    """
    symmetrise(W)
    size = np.sqrt(np.max(np.abs(W), axis=1))
    divide(W, size)
    factors = lu(W)
    if not factors.even(thresholds.DEPENDENT**2):
        raise LinAlgError("dependent contact rows")
    inverse = factors.solve(np.eye(len(W)))
    symmetrise(inverse)
    divide(inverse, size)
    return inverse


def definite_inverse(W: Array, refuses: bool = True) -> Array:
    """Inverse of a symmetric positive definite matrix, in its place; dependent rows may be refused.

    No diagonal entry is zero: rows without free coefficients are left out before, and the flexibility
    of the bodies is positive definite.

    Raises
    ------
    LinAlgError
        Rows depend on each other; `W` is lost.
    """
    scale = np.sqrt(np.diag(W))
    symmetrise(W)
    divide(W, scale)
    factors = cholesky(W.T, overwrite=True)
    if refuses and np.min(factors.diagonal, initial=1.0) < thresholds.DEPENDENT:
        raise LinAlgError("dependent contact rows")
    inverse = factors.inverse()
    divide(inverse, scale)
    return inverse


def without_anchors(A: Array, A_zq: Array, rigid: DenseFactors) -> Array:
    """``A_zz - A_zq R A_qz``, a part of A itself; R is the inverse of what `rigid` factorises."""
    q = len(A_zq)
    if len(A) == q:
        return A
    S = A[:q, :q]
    subtract_product(S, A_zq, rigid.solve(A_zq.T))
    symmetrise(S)
    return S
