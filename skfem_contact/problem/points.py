r"""The dense contact problem on gaps and slips, and on those of them that matter at the moment.

Eliminating a closed point from ``S z = h + p`` is deleting its row and column. Points that are open,
and far from closing, carry no force whatever they do: they are eliminated for good (`Reduction`),
until one of them is asked to close. This is exact and costs about one factorisation; the many
factorisations of a load history are then of the size of the contact zone, not of the surface.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import LinAlgError

from skfem_contact.linalg.dense_factors import DenseFactors, cholesky, factorised
from skfem_contact.linalg.in_place import subtract_product, symmetrise
from skfem_contact.problem import thresholds
from skfem_contact.problem.response import Conditions, Load, Response, friction_force
from skfem_contact.problem.thresholds import FEWEST, LOOSE, SHARE, SPARE, SURPLUS

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]


@dataclass(eq=False)
class PointSpace:
    r"""Gaps and slips as unknowns: ``S z = h + p`` with ``p = (lambda, -tau)``.

    Parameters
    ----------
    S : ndarray, shape (q, q)
        Stiffness against relative displacements of the points [force/length].
    normal_rows : ndarray of int, shape (m,)
        Row of z that is the gap of a point; -1 where the gap can not change.
    tangential_rows : ndarray of int, shape (m, d-1)
        The same for the slips; -1 where a slip is not modelled (no friction) or can not change.
    """

    S: Array
    normal_rows: NDArray[np.intp]
    tangential_rows: NDArray[np.intp]
    _key: bytes = field(default=b"", repr=False)
    _factor: DenseFactors | None = field(default=None, repr=False)
    _reduction: Reduction | None = field(default=None, repr=False)
    _last: Array | None = field(default=None, repr=False)

    def solve(self, conditions: Conditions, load: Load) -> Response:
        """Solve for the gaps and slips that the conditions leave free."""
        reduction = self._reduce(conditions, load)
        if reduction is None:
            z, p = self.unknowns(conditions, load)
        else:
            z, p = reduction.unknowns(conditions, load)
        response = self._response(conditions, load, z, p)
        self._last = response.gap
        return response

    def unknowns(self, conditions: Conditions, load: Load) -> tuple[Array, Array]:
        """Gaps and slips z, and the forces p on them, both (q,)."""
        z = np.zeros(len(self.S))
        held = np.zeros(len(self.S), dtype=bool)
        closed = conditions.closed & (self.normal_rows >= 0)
        held[self.normal_rows[closed]] = True
        z[self.normal_rows[closed]] = -load.gap0[closed]
        stick = conditions.stick[:, None] & (self.tangential_rows >= 0)
        held[self.tangential_rows[stick]] = True
        z[self.tangential_rows[stick]] = (conditions.anchor - load.slip0)[stick]
        free = np.flatnonzero(~held)
        slides = conditions.closed & ~conditions.stick
        coupled = slides & np.any(conditions.coupling != 0, axis=1) & (self.normal_rows >= 0)

        rhs = load.force - self.S @ z
        self._friction_rhs(conditions, load, slides, coupled, rhs)
        key = conditions.matrix_key()
        if key != self._key or self._factor is None:
            self._factor = self._factorize(conditions, slides, coupled, free)
            self._key = key
        z[free] = self._factor.solve(rhs[free])
        return z, self.S @ z - load.force

    def _reduce(self, conditions: Conditions, load: Load) -> Reduction | None:
        """The reduction in use, or a new one where it is too small or much too large."""
        needed = conditions.closed & (self.normal_rows >= 0)
        spare = max(FEWEST, int(SPARE * needed.sum()), int(SHARE * len(needed)))
        old = self._reduction
        if old is not None and old.keeps(needed, SURPLUS * (needed.sum() + spare)):
            return old if old.good else None
        gap = np.where(needed, -np.inf, load.gap0 if self._last is None else self._last)
        keep = needed.copy()
        keep[np.argsort(gap, kind="stable")[: needed.sum() + spare]] = True
        keep |= self.normal_rows < 0
        if 4 * keep.sum() > 3 * len(keep):
            if self.S.nbytes > thresholds.KEPT_BESIDE:
                self._reduction = None
            return None
        old = self._reduction = self._factor = None  # before the next one takes memory
        self._reduction = Reduction(self, keep)
        return self._reduction if self._reduction.good else None

    def _friction_rhs(
        self, conditions: Conditions, load: Load, slides: Mask, coupled: Mask, rhs: Array
    ) -> None:
        """Add the constant part of ``-tau`` on the rows of points that slide."""
        normal_force = -np.append(rhs, 0.0)[self.normal_rows]  # as far as it follows from what is held
        known = conditions.offset
        if conditions.gives:
            known = known + np.einsum("ikl,il->ik", conditions.spring, load.slip0)
        for k in range(self.tangential_rows.shape[1]):
            on = slides & (self.tangential_rows[:, k] >= 0)
            rhs[self.tangential_rows[on, k]] -= known[on, k]
            on &= coupled
            rhs[self.tangential_rows[on, k]] -= conditions.coupling[on, k] * normal_force[on]

    def _factorize(
        self, conditions: Conditions, slides: Mask, coupled: Mask, free: NDArray[np.intp]
    ) -> DenseFactors:
        where = np.full(len(self.S), -1)
        where[free] = np.arange(len(free))
        At = self.S[np.ix_(free, free)]  # transposed, as LAPACK has it
        t = self.tangential_rows.shape[1]
        for k in range(t):
            for j in range(t):
                on = slides & (self.tangential_rows[:, k] >= 0) & (self.tangential_rows[:, j] >= 0)
                row = where[self.tangential_rows[on, k]]
                column = where[self.tangential_rows[on, j]]
                At[column, row] += conditions.spring[on, k, j]
            on = coupled & (self.tangential_rows[:, k] >= 0)
            row, normal = where[self.tangential_rows[on, k]], self.normal_rows[on]
            At[:, row] += conditions.coupling[on, k] * self.S[np.ix_(free, normal)]
        return factorised(At.T, symmetric=not coupled.any())

    def _response(self, conditions: Conditions, load: Load, z: Array, p: Array) -> Response:
        # a row of -1, one that can not change, finds the zero at the end
        p, moved = np.append(p, 0.0), np.append(z, 0.0)
        closed = conditions.closed & (self.normal_rows >= 0)
        slides = conditions.closed & ~conditions.stick
        gap = load.gap0 + moved[self.normal_rows]
        gap[closed] = 0.0
        exists = self.tangential_rows >= 0
        slip = load.slip0 + moved[self.tangential_rows]
        normal_force = np.where(closed, p[self.normal_rows], 0.0)
        sticking = np.where(conditions.stick[:, None] & exists, -p[self.tangential_rows], 0.0)
        sliding = friction_force(conditions, slip, normal_force)
        tangential = np.where((slides[:, None]) & exists, sliding, sticking)
        return Response(gap, slip, normal_force, tangential, z)


class Reduction:
    """A point space without points that carry no force.

    Parameters
    ----------
    space : PointSpace
    keep : ndarray of bool, shape (m,)
        Points that may carry one.

    Attributes
    ----------
    good : bool
        False where the points that are kept do not hold the bodies; then there is no `space`.
    space : PointSpace
        Over the rows of the points that are kept.
    """

    def __init__(self, space: PointSpace, keep: Mask) -> None:
        self.keep = keep
        rows = np.concatenate([space.normal_rows[keep], space.tangential_rows[keep].ravel()])
        self.rows = rows = np.sort(rows[rows >= 0])
        self.rest = rest = np.setdiff1d(np.arange(len(space.S)), rows)
        try:
            # transposed: S is symmetric, and LAPACK works in place on columns
            self._factor = cholesky(space.S[np.ix_(rest, rest)].T, overwrite=True)
        except LinAlgError:
            self.good = False
            return
        self.good = self._factor.even(LOOSE)
        coupling = space.S[np.ix_(rest, rows)]
        self._follow = self._factor.solve(coupling)
        S = space.S[np.ix_(rows, rows)]
        subtract_product(S, coupling.T, self._follow)
        symmetrise(S)
        place = np.full(len(space.S) + 1, -1)
        place[rows] = np.arange(len(rows))
        self.space = PointSpace(
            S,
            np.where(keep, place[space.normal_rows], -1),
            np.where(keep[:, None], place[space.tangential_rows], -1),
        )
        self._load: Load | None = None

    def keeps(self, needed: Mask, most: float) -> bool:
        """Whether all these points are kept, and not many more."""
        return not np.any(needed & ~self.keep) and self.keep.sum() <= most

    def load(self, load: Load) -> Load:
        """A load on the rows that are kept; the same load is reduced once."""
        if self._load is not load:
            self._load = load
            self._at_rest = self._factor.solve(load.force[self.rest])
            force = load.force[self.rows] - self._follow.T @ load.force[self.rest]
            self._reduced = Load(force, load.gap0, load.slip0, load.prescribed)
        return self._reduced

    def expand(self, z: Array, load: Load) -> Array:
        """Gaps and slips of all rows (q,) from those of the rows that are kept."""
        self.load(load)
        full = np.empty(len(self.rows) + len(self.rest))
        full[self.rows] = z
        full[self.rest] = self._at_rest - self._follow @ z
        return full

    def unknowns(self, conditions: Conditions, load: Load) -> tuple[Array, Array]:
        """Gaps and slips of all rows, and the forces on them, both (q,)."""
        z, p = self.space.unknowns(conditions, self.load(load))
        forces = np.zeros(len(self.rows) + len(self.rest))
        forces[self.rows] = p
        return self.expand(z, load), forces
