r"""All bodies, each condensed onto its contact DOFs (`substructure`), and whether that pays.

What is condensed depends on the stiffness alone; where the points are is added by `zone`.

Bodies may float. A body that its supports do not hold is made definite by springs on a few anchor
DOFs away from contact, ``F = (S + P P')^-1``, whose extensions ``q = P'u`` are kept as extra rows
that carry no force; taking the springs away again is exact: with ``G = [B; P']``, ``A = (G F G')^-1``

    (A - [0, 0; 0, 1]) [z; q] = A G F f + [p; 0],

and q is eliminated. What is left is the stiffness against relative displacements of the points,
singular exactly where free motion is.

With many points, the dense matrix ``G F G'`` is most of the memory that a solver takes. It is formed by
blocks and inverted only on rows of points that may close (`zone`).

**The choice** of the way of the bodies into the contact problem is the user's, or by memory and time.
Dense matrices of the contact DOFs take the cube of their number to make, and hardly anything in each
load step. Iterated forces take products with the factors of the bodies in each load step, and nothing
before. Multigrid needs no factors either, which in solids take the cube of what a cut through them
meets; each of its load steps reads K some hundred times. So the number of load steps decides: factors,
and then dense matrices, are made where going without them would take longer.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from copy import copy
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag
from scipy.sparse import csr_matrix

from skfem_contact.arrays import Array, Index
from skfem_contact.bodies.body import Body
from skfem_contact.bodies.member import Member, check_whole
from skfem_contact.bodies.system import System, slices
from skfem_contact.conditions.kinematics import columns_of, with_columns
from skfem_contact.conditions.state import LoadCase
from skfem_contact.digits import COMPUTED
from skfem_contact.errors import InputError
from skfem_contact.linalg.backend import Backend
from skfem_contact.linalg.dense_factors import (
    ROWS_AT_ONCE,
    Limits,
    factor_bound,
    symmetrise,
    written_bytes,
)
from skfem_contact.linalg.direct import Direct, as_linear_solver
from skfem_contact.linalg.fronts import FactorSize
from skfem_contact.problem.seam import ContactProblem, PosedOn, Source
from skfem_contact.problem.substructure import Components, Substructure
from skfem_contact.problem.zone import KEPT_BESIDE, PointProblem
from skfem_contact.records import once

# Results whose interior is recovered at a time: enough for matrix products, few enough for memory.
RECOVERED_AT_ONCE = 32

# Matrices of the size of all gaps and slips that are there at once: the stiffness, its factorisation,
# and half of one for the columns of points that slip, or for what is eliminated of open ones.
PER_ROWS = 2.5


# Cubes of contact DOFs per byte of the bound of the factors and load step from which on iterated forces
# take less time. Condensing takes three operations for each, at the peak of a processor; a load step
# some 60 products with the factors, each of which reads all bytes twice, a third of the bound: with
# 2 200 points on solids of 100 000 DOFs the two meet at 2.6 load steps, and by this number at 2.7.
PER_BYTE = 100.0


# Cubes of DOFs between halves of bodies, per entry of K and load step, up to which multigrid takes less
# time than factors. One step on two blocks takes as long by both at 300 (24 500 DOFs), half as long by
# multigrid at 970 (92 600), a quarter at 4 000 (362 600): twice what is even, as elements of second
# order, thin ones and a Poisson's ratio of .49 take twice as many cycles.
CUBES_PER_ENTRY = 600.0


# Cycles of multigrid in one linear problem after which factors are made, where both are at hand. Well
# posed problems take 10 to 60.
CYCLES = 60


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
        self.spans, self.substructures = system.spans, list[Any]()
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
        for begin in range(0, len(W), ROWS_AT_ONCE):  # all else is written twice
            rows = slice(begin, begin + ROWS_AT_ONCE)
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
            along = block_diag(*(part.along(own) for part, own in each))
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
    for begin in range(0, len(W), ROWS_AT_ONCE):
        end = begin + ROWS_AT_ONCE
        part, below = (G, G) if len(W) <= ROWS_AT_ONCE else (G[begin:end], G[begin:])
        found = below @ (part @ F).T
        W[begin:, begin:end] += found
        W[begin:end, end:] += found[ROWS_AT_ONCE:].T


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


def checked_linear(linear: Any) -> Any:
    """The argument `linear` of a solver, refused at once where it is nothing that solves."""
    if isinstance(linear, str) and linear not in ("auto", "condensed", "iterated"):
        raise InputError(
            f"linear = {linear!r} is neither 'auto' nor 'condensed' nor 'iterated'; a backend is "
            "given as an object, Direct(), AMG() or PETSc(), or as a callable solver(A, b)."
        )
    if not isinstance(linear, str):
        as_linear_solver(linear)
    return linear


def check_distributed(linear: Any, stiffness: Sequence[Any]) -> None:
    """Refuse what can not solve with a stiffness that is held elsewhere."""
    if not getattr(linear, "distributed", False):
        given = repr(linear) if isinstance(linear, str) else type(linear).__name__
        check_whole(stiffness, f"linear = {given} needs it whole: give the PETSc() that assembled it")


class Choice:
    """One of the routes, and why it was taken.

    Parameters
    ----------
    linear : "auto", "condensed", "iterated", a backend or a solver callable
        As for `ContactSolver`.
    limits : Limits
        Memory up to which "auto" forms dense matrices, and factorises.
    system : System
    stiffness : sequence of csr_matrix
        Of each body.
    rows : int
        Gaps and slips of the points that have a partner.
    wanted : callable
        Gives the DOFs (stacked) that contact rows may touch; called where something depends on them.
    steps : float
        Load steps that are known to come, infinite where many may; zero where nothing is known.
    plain : bool
        Whether supports hold the bodies, and a load step has one pairing and one stiffness: what
        multigrid takes is known of these, and is several times as much of others.
    """

    def __init__(
        self,
        linear: Any,
        limits: Limits,
        system: System,
        stiffness: Sequence[csr_matrix],
        rows: int,
        wanted: Callable[[], Index],
        steps: float = 0.0,
        plain: bool = True,
    ) -> None:
        self.linear, self.limits, self.plain = linear, limits, plain
        self.system, self.stiffness = system, stiffness
        self.rows, self._wanted, self.steps = rows, wanted, steps

    @cached_property
    def route(self) -> str:
        """Return how the bodies enter the contact problem.

        "condensed" to their contact DOFs, "iterated" by products with their factors, by "multigrid"
        without factors, or "full", with contact eliminated from all of their DOFs.
        """
        if not self.by_memory:
            if isinstance(self.linear, str):
                return self.linear
            from skfem_contact.linalg.amg import AMG  # few choose it

            return "multigrid" if isinstance(self.linear, AMG) else "full"
        if self.chooses and (self.few_steps or self.factor_bytes > self.limits.factors):
            return "multigrid"
        if self.dense_bytes > self.limits.dense:
            return "iterated"
        return "iterated" if 0 < self.steps < self.pays_from else "condensed"

    @cached_property
    def chooses(self) -> bool:
        """Whether the backend is left to this choice, as by "auto"."""
        return isinstance(self.linear, str) and self.by_memory

    @cached_property
    def few_steps(self) -> bool:
        """Whether multigrid takes less time than factors for the load steps that are known to come."""
        return 0 < self.steps < self.factors_pay_from

    @property
    def condenses(self) -> bool:
        """Whether there is a problem on gaps and slips as well: where memory allows to condense bodies.

        Not in place of an iterative solver, which is chosen where a factorisation is too much.
        """
        if self.route == "full":
            return isinstance(self.backend, Direct)
        fits = self.chooses and self._factor_bound <= self.limits.factors
        return self.route == "condensed" or (fits and self.dense_bytes <= self.limits.dense)

    def expecting(self, steps: float) -> Choice:
        """The same with more load steps to come."""
        new = copy(self)
        new.steps += steps
        for name in ("route", "few_steps"):  # which follow from them
            vars(new).pop(name, None)
        return new

    @cached_property
    def pays_from(self) -> float:
        """Number of load steps from which on dense matrices take less time than iterated forces.

        Both backends of the bodies are the multifrontal method; of others nothing is known. Small
        matrices are there in half a second, whatever the bodies are.
        """
        if not isinstance(self.linear, str) or self.dense_bytes <= KEPT_BESIDE:
            return 0.0
        return float(np.sum(self._kept.astype(float) ** 3)) / (PER_BYTE * max(self._factor_bound, 1.0))

    @cached_property
    def factors_pay_from(self) -> float:
        """Number of load steps from which on factors take less time than multigrid, zero if always."""
        if not (self.chooses and self.plain):  # nobody asks, and ranks have no matrix to count
            return 0.0
        bodies = zip(self.system.bodies, self.stiffness, strict=True)
        cubes = sum(float(_cut(K, body.dof_points)) ** 3 for body, K in bodies)
        entries = sum(K.nnz for K in self.stiffness)
        # a body without stiffness is refused in words, later
        return cubes / (CUBES_PER_ENTRY * entries) if entries else 0.0

    @cached_property
    def by_memory(self) -> bool:
        """Whether the route follows from memory and time: by default, or by backends that condense."""
        if isinstance(self.linear, str):
            return self.linear == "auto"
        return bool(getattr(self.linear, "condenses", False))

    @property
    def reason(self) -> str:
        """Why this route, in words."""
        if not self.by_memory:
            return "as chosen"
        told = f"{self.steps:.0f} load step{'s' * (self.steps > 1)}"
        pays = "{} pay from {} load steps on".format
        dense = pays("they", math.ceil(self.pays_from))
        if self.route == "multigrid" and self.few_steps:
            factors = pays("they", math.ceil(self.factors_pay_from))
            return f"as factors are not worth their time for {told}: {factors}"
        if self.route == "multigrid":
            most = f"max_factor_bytes allows {written_bytes(self.limits.factors)}"
            return f"because factors would take {written_bytes(self.factor_bytes)}: {most}"
        most = f"max_dense_bytes allows {written_bytes(self.limits.dense)}"
        if self.route == "condensed":
            factors = pays("factors", math.ceil(self.factors_pay_from))
            more = (factors, self.factors_pay_from), (dense, self.pays_from)
            return "; ".join([most, *(words for words, steps in more if steps > 1)])
        if self.dense_bytes <= self.limits.dense:
            return f"as dense matrices are not worth their time for {told}: {dense}"
        return f"because dense matrices would take {written_bytes(self.dense_bytes)}: {most}"

    @property
    def said(self) -> str:
        """Return what a report says of the route: nothing of the usual one."""
        words = {
            "iterated": "forces by GMRES through the factors of the bodies",
            "multigrid": "displacements and forces by GMRES with multigrid",
        }
        return f"{words[self.route]}, {self.reason}" if self.route in words else ""

    @cached_property
    def factor_bytes(self) -> float:
        """Memory that the factorisation of all bodies takes at most, or would [bytes].

        A bound where this is far from the limit, as it costs nothing; else what it will be.
        """
        if self._factor_bound <= self.limits.factors:
            return self._factor_bound
        sizes = self._sizes().values()
        waiting = max((size.peak - size.memory for size in sizes), default=0)
        return float(sum(size.memory for size in sizes) + waiting)

    @cached_property
    def dense_bytes(self) -> int:
        """Memory that the dense matrices of the contact problem take at most, or would [bytes]."""
        copies = getattr(self.linear, "complements", 0)
        return dense_bytes(self._kept.tolist(), self.rows) + copies * int(8 * np.sum(self._kept**2))

    @cached_property
    def _kept(self) -> Index:
        """Contact DOFs of each body."""
        enters = np.zeros(self.system.n, dtype=bool)
        enters[self._wanted()] = True
        enters[self.system.D] = False
        return np.diff(np.searchsorted(np.flatnonzero(enters), self.system.offsets))

    @cached_property
    def _factor_bound(self) -> float:
        bodies = self.system.bodies
        return float(sum(factor_bound(body.n - len(body.D), body.dim) for body in bodies))

    @property
    def backend(self) -> Any:
        """Return what factorises the bodies, or solves where nothing is factorised beforehand."""
        if isinstance(self.linear, str):
            if self.route != "multigrid":
                return Direct()
            from skfem_contact.linalg.amg import AMG

            return AMG(tol=COMPUTED, max_iterations=CYCLES) if self.few_steps else AMG()
        return self.linear

    def sizes(self) -> dict[str, FactorSize]:
        """What the factorisation of each body in contact will take, before anything is computed."""
        if self.by_memory and not isinstance(self.linear, str):
            raise InputError(
                f"{self.linear!r} factorises the bodies, and how large that will be it does not say in "
                "advance; linear='auto' does."
            )
        return self._sizes(keeping=self.route != "iterated")

    def _sizes(self, keeping: bool = True) -> dict[str, FactorSize]:
        """With contact DOFs kept, or eliminated like all others."""
        check_whole(self.stiffness, "a factorisation, and its size, needs all of it")
        out, wanted = {}, self._wanted()
        for i, (name, K) in enumerate(zip(self.system.names, self.stiffness, strict=True)):
            body = self.system.bodies[i]
            mine = wanted_of(body, self.system.slice(body), wanted)
            if len(mine):
                part = Substructure(body, K, mine, modes=self.system.modes(i))
                out[name] = part.factor_size(part.columns if keeping else part.anchors)
        return out


def _cut(K: csr_matrix, points: NDArray[np.float64]) -> int:
    """Fewest DOFs that separate two halves of a body, along an axis, from each other.

    Its cube is in proportion to what a factorisation takes (A. George, SIAM J. Numer. Anal. 10 (1973)
    345-363): a thirteenth to a sixteenth of the operations for blocks of 14 000 to 93 000 DOFs.
    """
    beyond = points > np.median(points, axis=0)
    pattern = csr_matrix((np.ones(K.nnz, dtype=np.float32), K.indices, K.indptr), shape=K.shape)
    above = pattern @ beyond
    below = np.diff(K.indptr)[:, None] - above
    touching = np.stack([(above > 0) & ~beyond, (below > 0) & beyond])
    return int(np.count_nonzero(touching, axis=1).min())


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
    return sum(8 * int(n) ** 2 for n in kept) + int(PER_ROWS * 8 * rows**2)
