r"""`DistributedFactor`: a body condensed to its contact DOFs over all ranks, as rank 0 sees it.

The ranks hold K by rows and factorise its interior once, ``K_ii``. Of the kept DOFs c MUMPS leaves
``S = K_cc - K_ci K_ii^-1 K_ic`` on rank 0, in the same factorisation; other packages do not, and then
S is ``n_c`` solves, in blocks. All else is a solve with ``K_ii`` and a product with K,

    x_i = K_ii^-1 f_i,  f_c - K_ci x_i;      w_i = -K_ii^-1 K_ic u_c,  S u_c = K_ci w_i + K_cc u_c,

for loads and for displacements of the kept DOFs. Where few are kept, as the anchors of a body whose
contact is iterated, what follows from each of them is known once and for all, and costs no more solves.
"""

from __future__ import annotations

import time
import weakref
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from functools import cached_property
from itertools import repeat
from typing import Any, cast

import numpy as np
from scipy.linalg.blas import dsymv
from scipy.sparse import csr_matrix

from skfem_contact.arrays import Array, Index
from skfem_contact.bodies.member import Member
from skfem_contact.digits import GIVEN
from skfem_contact.errors import LinearSolveError, SingularMatrix
from skfem_contact.linalg.backend import BodyFactor
from skfem_contact.linalg.dense_factors import mirror, symmetrise
from skfem_contact.linalg.singular import singular, smallest_eigenvalue
from skfem_contact.linalg.thresholds import ACCEPTED, NEGLIGIBLE
from skfem_contact.petsc.body_share import COLUMNS_AT_ONCE, BodyShare
from skfem_contact.petsc.ranks import Ranks
from skfem_contact.petsc.share import LinearSolve, Settings, Solved, not_solved
from skfem_contact.petsc.stacked import StackedStiffness
from skfem_contact.petsc.stiffness import Layout, RankedStiffness


class DistributedFactor(BodyFactor):
    """A `BodyFactor` over MPI ranks.

    Parameters
    ----------
    own : Ranks
    body : Member
    K : csr_matrix or RankedStiffness, shape (n_all, n_all)
        Its stiffness, here or held rank by rank.
    free : ndarray of int, shape (n,)
        DOFs that are not prescribed, ascending.
    keep : ndarray of int, shape (n_c,)
        Which of these are kept, as positions in `free`; not all of them.
    settings : Settings
        How to factorise.
    tell : callable
        Takes a `LinearSolve` of every solve.

    Raises
    ------
    SingularMatrix
        The interior is not positive definite.
    LinearSolveError
        The package has failed, with its reason.
    """

    def __init__(
        self,
        own: Ranks,
        body: Member,
        K: Any,
        free: Index,
        keep: Index,
        settings: Settings,
        tell: Callable[[LinearSolve], None],
    ) -> None:
        begin = time.perf_counter()
        self.keep, self._own, self._settings, self._tell = keep, own, settings, tell
        self.interior = np.delete(np.arange(len(free)), keep)
        self.order = np.concatenate([self.interior, keep])
        self._key, self._layout = _held(own, body, K, free, keep, settings)
        weakref.finalize(self, own.drop, self._key)
        self._share = _share(own, self._key)
        self._kept_by = _owners(self._layout, self._layout.slot[keep])
        self._spent = time.perf_counter() - begin
        self.S = np.zeros((0, 0))
        self._check(K.diagonal()[free[self.interior]], body.dof_points[free[self.interior]])
        self.S = self._complement()

    @property
    def memory(self) -> int:
        """Factors and rows of all ranks, and what MUMPS keeps of the kept rows [bytes]."""
        left = 8 * len(self.keep) ** 2 if self._share.has_complement else 0
        return self._share.memory + left + self.S.nbytes

    def eliminate(self, f: Array) -> Array:
        """``K_ii^-1 f_i``, then ``f_c - K_ci K_ii^-1 f_i``, (n,) or (n, r) -> (n, r)."""
        f = np.asarray(f, dtype=float).reshape(len(f), -1)
        start = time.perf_counter()
        parts = self._own.together(
            _eliminated, (self._key,), ([rows] for rows in self._layout.vectors(f))
        )
        self._said(parts, f.shape[1], start)
        whole = np.concatenate([rows for rows, _ in parts])
        return whole[self._layout.slot[self.order]]

    def substitute(self, u_keep: Array, eliminated: Array) -> Array:
        """Displacements (n, r) of the DOFs `order`, in the place of `eliminated`."""
        inner = len(self.interior)
        if len(self.keep):
            if len(self.keep) <= COLUMNS_AT_ONCE:
                eliminated[:inner] += self._followers[self.interior] @ u_keep
            else:
                eliminated[:inner] += self._coupled(u_keep, True)[0][self.interior]
        eliminated[inner:] = u_keep
        return eliminated

    def response(self, dofs: Index) -> DistributedResponse:
        """Return the displacements that forces on some DOFs (m,) cause there."""
        return DistributedResponse(self, dofs)

    # -- what rank 0 asks of all --------------------------------------------------------------

    @cached_property
    def _followers(self) -> Array:
        """Return the displacements that follow each kept DOF where the others are held, (n, n_c)."""
        return self._coupled(np.eye(len(self.keep)), True)[0]

    def _coupled(self, u_keep: Array, wanted: bool) -> tuple[Array, Array]:
        """Return what follows kept DOFs (n_c, r): displacements (n, r) if wanted, and ``S u``."""
        start, r = time.perf_counter(), u_keep.shape[1]
        ranks = range(self._own.size)
        pieces = ([u_keep[self._kept_by == rank]] for rank in ranks)
        parts = self._own.together(_coupled, (self._key, wanted), pieces)
        self._said(parts, r, start)
        forces = np.empty((len(self.keep), r))
        for rank, (_, rows, _) in enumerate(parts):
            forces[self._kept_by == rank] = rows
        u = np.concatenate([rows for rows, _, _ in parts])
        return (u[self._layout.slot] if wanted else u), forces

    def _complement(self) -> Array:
        n = len(self.keep)
        if not self._share.has_complement:
            S = np.empty((n, n))
            for first in range(0, n, COLUMNS_AT_ONCE):
                some = slice(first, min(first + COLUMNS_AT_ONCE, n))
                unit = np.zeros((n, some.stop - first))
                np.fill_diagonal(unit[some], 1.0)
                S[:, some] = self._coupled(unit, False)[1]
            symmetrise(S)
            return S
        S = self._share.complement()
        # which of its triangles is good depends on the number of ranks: the one whose product is right
        u = np.random.default_rng(0).standard_normal(n)
        expected = self._coupled(u[:, None], False)[1][:, 0]
        for triangle in (S, S.T):  # the upper one, which LAPACK takes for the lower one
            found = dsymv(1.0, triangle.T, u, lower=1)
            if np.linalg.norm(found - expected) <= GIVEN * np.linalg.norm(expected):
                mirror(triangle.T)
                return S
        raise LinearSolveError("what MUMPS leaves of the kept rows is not their Schur complement")

    def _check(self, diagonal: Array, points: Array) -> None:
        """Refuse an interior that is not positive definite."""
        words, negative = self._share.trouble()
        if words and "pivot" not in words:
            raise LinearSolveError(f"PETSc, {self._share.name}: {words}.")
        dof, smallest = int(np.argmin(diagonal)), 0.0
        if diagonal[dof] > 0 and not words:
            with suppress(SingularMatrix):
                smallest, dof = smallest_eigenvalue(diagonal, self._interior_solve)
        if negative or not smallest >= NEGLIGIBLE:
            raise singular(self.interior[dof], 0.0 if negative else smallest, points[dof])

    def _interior_solve(self, b: Array) -> Array:
        f = np.zeros(len(self.order))
        f[self.interior] = b
        return self.eliminate(f)[: len(b), 0]

    def _said(self, parts: list[list[Any]], columns: int, start: float) -> None:
        """Record how a solve went, which the last array of rank 0 tells; and raise where it failed."""
        how: Solved = parts[0][-1]
        share, seconds, spent = self._share, time.perf_counter() - start, self._spent
        self._spent = 0.0
        told = share.told(how, len(self.order), self._own.size, spent, seconds, self.memory, columns)
        self._tell(told)
        if share.factorises and (how.reason < 0 or not how.residual <= ACCEPTED):
            raise singular(-1, 0.0)
        if not share.factorises and not how.residual <= self._settings.tol:
            raise not_solved(share.name, how, self._settings.tol)


class DistributedResponse:
    """Displacements of some DOFs under forces on them, by one solve over all ranks.

    Messages have the size of these DOFs, not that of the body.
    """

    def __init__(self, factor: DistributedFactor, dofs: Index) -> None:
        self._factor, self._kept = factor, np.isin(dofs, factor.keep)
        slots = factor._layout.slot[dofs]
        owner = _owners(factor._layout, slots)
        self._of_rank = [np.flatnonzero(owner == rank) for rank in range(factor._own.size)]
        starts = factor._layout.starts
        self._rows = [slots[own] - starts[rank] for rank, own in enumerate(self._of_rank)]
        self._followers = factor._followers[dofs] if len(factor.keep) else np.zeros((len(dofs), 0))

    def __call__(self, force: Array, flexibility: Array | None = None) -> Array:
        """See `Surface`."""
        factor, start = self._factor, time.perf_counter()
        pieces = zip(self._rows, (force[own] for own in self._of_rank), strict=True)
        parts = factor._own.together(_responded, (factor._key,), map(list, pieces))
        factor._said(parts, 1, start)
        u, left = np.empty(len(force)), np.empty(len(factor.keep))
        for rank, (moved, reduced, _) in enumerate(parts):
            u[self._of_rank[rank]] = moved
            left[factor._kept_by == rank] = reduced
        u[self._kept] = 0.0
        if flexibility is not None:
            u += self._followers @ (flexibility @ left)
        return u


def _held(
    own: Ranks, body: Member, K: Any, free: Index, keep: Index, settings: Settings
) -> tuple[int, Layout]:
    """Let the ranks hold K on its free DOFs and factorise its interior: number, and layout of rows."""
    if isinstance(K, RankedStiffness):
        A = StackedStiffness([body], [K], uses_modes=False).among(free)
        layout = A.layout
        layout.check_size(A.nnz, own.largest_integer)
        return A.factorize(replace(settings, block=layout.block, keep=layout.slot[keep])), layout
    A = csr_matrix(K[free][:, free])
    layout = Layout.of(len(free), body.dof_points[free], None, own.size)
    layout.check_size(A.nnz, own.largest_integer)
    settings = replace(settings, block=layout.block, keep=layout.slot[keep])
    return own.factorize(layout.matrices(A), repeat(None, own.size), settings), layout


def _owners(layout: Layout, slots: Index) -> Index:
    """The rank that has each of some rows."""
    return np.searchsorted(layout.starts, slots, side="right") - 1


# -- on every rank ----------------------------------------------------------------------------


def _share(own: Ranks, key: int) -> BodyShare:
    return cast(BodyShare, own.shares[key])


def _eliminated(own: Ranks, given: tuple[Any, ...], parts: list[Any]) -> list[Any]:
    return [*_share(own, given[0]).eliminated(parts[0])]


def _coupled(own: Ranks, given: tuple[Any, ...], parts: list[Any]) -> list[Any]:
    key, wanted = given
    X, forces, how = _share(own, key).coupled(parts[0])
    return [X if wanted else X[:0], forces, how]


def _responded(own: Ranks, given: tuple[Any, ...], parts: list[Any]) -> list[Any]:
    rows, force = parts
    share = _share(own, given[0])
    F = np.zeros((share.A.getLocalSize()[0], 1))
    F[rows, 0] = force
    X, how = share.eliminated(F)
    return [X[rows, 0], X[share.mine, 0], how]
