r"""The contact problem on gaps and slips, of those points that may carry a force: the zone.

`PointProblem` puts the bodies of `condensed` on a pairing: with ``z = B u`` the gaps and slips of the
points all else is eliminated (a Delassus operator, as in Francavilla and Zienkiewicz, 1975). A new
pairing costs a new `PointProblem` and nothing before it.

Of the compliance W of gaps, slips and anchors the rows of points that are open, and far from closing,
are left out: what carries no force gives way freely. The stiffness of the others is ``A = W_kk^-1``, k
the rows of the zone and of the anchors, less the springs on these,

    (A - [0, 0; 0, 1]) [z; q] = A [z0; q0] + [p; 0],

z0 and q0 being what gaps, slips and anchors do where contact carries nothing. With q eliminated that is
``S z = h + p`` of `PointSpace`. What is left out follows: ``z = z0 + W_zk [p; q]``.

This is exact, and costs the inverse of a matrix as large as the zone. The many factorisations of a load
history are as large as what is free within it. The inverse of all of W, with many points most of the
time that a solver takes, is formed only where nearly all points are in the zone, or somebody asks.
"""

from __future__ import annotations

from copy import copy
from functools import cached_property
from typing import Any

import numpy as np
from scipy.linalg import LinAlgError
from scipy.sparse import csr_matrix

from skfem_contact.arrays import Array, Index, Mask
from skfem_contact.conditions.rows import stacked_rows
from skfem_contact.conditions.state import LoadCase
from skfem_contact.errors import SingularMatrix
from skfem_contact.linalg.dense_factors import (
    ROWS_AT_ONCE,
    definite_inverse,
    indefinite_inverse,
    lu,
    symmetrise,
)
from skfem_contact.problem.points import (
    NO_ROW,
    Conditions,
    Load,
    LoadForces,
    PointSpace,
    Resistance,
    Response,
)
from skfem_contact.problem.seam import (
    DEPENDENT,
    OnContactDofs,
    PosedOn,
    independent,
    point_resistance,
    resistance_by,
    spring_compliance,
)
from skfem_contact.records import once

# Size of the compliance of all points up to which its inverse stays beside it [bytes]. Of a larger one,
# of 2 800 rows, it takes half a second and more, and is formed where somebody asks. Dense matrices of
# this size altogether are made however few load steps there are.
KEPT_BESIDE = 64_000_000


# Pivot of the bodies without the springs on their anchors, over the largest stiffness with them, below
# which the points of a zone hardly hold them: taking away the springs costs forces as many digits.
LOOSE = 1e-5


# Points kept besides those that are closed, as a share of these, and at least so many.
SPARE, FEWEST = 0.1, 8


class PointProblem(OnContactDofs):
    """The contact problem on gaps and slips, see `Compliance`."""

    def __init__(self, bodies: Any, on: PosedOn) -> None:
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
        force = self.bodies.other_load(case.f, case.x)
        return self._load(case, (), force, self.bodies.flexibility(force))

    def _load(self, case: LoadCase, components: tuple[Any, ...], force: Array, u: Array) -> Load:
        return Load(np.zeros(0), *self.constant(case), force, components, self.G @ u)

    def solve(self, conditions: Conditions, load: Load) -> Response:
        """Gaps, slips and forces under these conditions."""
        return self.zones.solve(conditions, load)


class Zones:
    """The zone of one solve at a time, drawn anew where it is too small or has become too large.

    Open points beyond those that a new zone would have cost time in every factorisation, and to draw it
    costs an inverse. It is drawn once they have cost as much: at most twice the least.
    """

    def __init__(self, compliance: Compliance) -> None:
        self.compliance = compliance
        self._has_gap, self._rows = compliance.normal_rows >= 0, 1 + compliance.tangential_rows.shape[1]
        # points with slips alone are always in it, those without any row never: they count as none
        self._slips_alone = ~self._has_gap & np.any(compliance.tangential_rows >= 0, axis=1)
        self._most = np.count_nonzero(self._has_gap | self._slips_alone)
        self._key: object = None
        self._chosen: Zone | None = None  # for the conditions of this key
        self._part: Zone | None = None
        self._all: Zone | None = None
        self._last: Array | None = None
        self._spent = 0.0  # on open points that a new one would not have [operations]

    def solve(self, conditions: Conditions, load: Load) -> Response:
        """Gaps, slips and forces under these conditions."""
        gap = load.gap0 if self._last is None else self._last
        zone, key = self.fitting(conditions, gap)
        response = zone.solve(conditions, load, key)
        self._last = response.gap
        return response

    def fitting(self, conditions: Conditions, gap: Array) -> tuple[Zone, object]:
        """The zone for these conditions, where points that are open have these gaps; and its key."""
        key = conditions.matrix_key()
        if self._chosen is None or key != self._key:
            self._chosen = None  # before the next one takes memory
            self._key, self._chosen = key, self._drawn(conditions, gap)
        return self._chosen, key

    def whole(self) -> Zone:
        """All points."""
        if self._all is None:
            whole = self.compliance
            self._all = whole.whole.anew() if whole.small else Zone(whole, refuses=whole.refuses)
        return self._all

    def _drawn(self, conditions: Conditions, gap: Array) -> Zone:
        whole, now = self.compliance, self._part
        if not whole.stable:
            return self.whole()
        has_gap, rows = self._has_gap, self._rows
        needed = conditions.closed & has_gap
        count = np.count_nonzero(needed)
        asked = count + max(FEWEST, int(SPARE * count))
        if now is not None and now.keeps(needed):
            free = np.array([now.count, asked]) - count + 0.0
            free = free * rows + (rows - 1) * np.count_nonzero(needed & ~conditions.stick)
            self._spent += max(free[0] ** 3 - free[1] ** 3, 0.0)
            if self._spent <= (asked * rows) ** 3:
                return now if now.good else self.whole()
        keep = needed.copy()
        gap = np.where(needed, -np.inf, np.where(has_gap, gap, np.inf))
        keep[np.argsort(gap, kind="stable")[:asked]] = True
        keep = keep & has_gap | self._slips_alone
        now = self._part = None  # before the next one takes memory
        self._spent = 0.0
        # the inverse of all points is there where they are few, and serves others if it is kept
        kept = np.count_nonzero(keep)
        if 4 * kept > 3 * self._most if whole.small else kept == self._most:
            self._part = self.whole()
        else:
            if not whole.small:
                self._all = None
            self._part = Zone(whole, keep)
        return self._part if self._part.good else self.whole()


class Compliance:
    """The compliance of gaps, slips and anchors; all solves share it.

    Parameters
    ----------
    W : ndarray, shape (q + k, q + k)
        Of the points, then of k anchors; symmetric [length/force].
    normal_rows, tangential_rows : ndarray of int
        As of `PointSpace`.
    q : int
    stable : bool
        Whether it is positive definite: bodies that are not stable may buckle where nothing holds them,
        and no point is left out.
    refuses : bool
        Whether rows that depend on each other are refused.
    """

    def __init__(
        self,
        W: Array,
        normal_rows: Index,
        tangential_rows: Index,
        q: int,
        stable: bool = True,
        refuses: bool = True,
    ) -> None:
        self.W, self.q, self.stable, self.refuses = W, q, stable, refuses
        self.normal_rows, self.tangential_rows = normal_rows, tangential_rows
        self.small = W.nbytes <= KEPT_BESIDE  # the stiffness of all points is kept beside it

    @once
    def whole(self) -> Zone:
        """All points, of which several solves may have a copy."""
        return Zone(self, refuses=self.refuses)

    def with_springs(self, give: Array) -> Compliance:
        """The same with springs of these compliances in series with its rows, (q,)."""
        W = self.W.copy()
        W[np.diag_indices(self.q)] += give
        given = W, self.normal_rows, self.tangential_rows, self.q
        return Compliance(*given, stable=self.stable, refuses=False)

    def inverse(self, on: Index | None, refuses: bool) -> Array:
        """Inverse of W on some rows; on all without them."""
        W = self.W.copy() if on is None else self.W[np.ix_(on, on)]
        least = DEPENDENT if refuses else 0.0
        return definite_inverse(W, least) if self.stable else indefinite_inverse(W, least)


class Zone:
    """The stiffness of the gaps and slips of some points, the others free; of one solve at a time.

    Parameters
    ----------
    whole : Compliance
    keep : ndarray of bool, shape (m,), optional
        Points that may carry a force; by default all.
    refuses : bool
        Whether rows that depend on each other are refused.

    Attributes
    ----------
    good : bool
        False where the points that are kept do not hold the bodies; then there is no `space`.
    space : PointSpace
        Over the rows of the points that are kept.
    """

    def __init__(self, whole: Compliance, keep: Mask | None = None, refuses: bool = False) -> None:
        normal, tangential, q = whole.normal_rows, whole.tangential_rows, whole.q
        self.left = keep is not None
        self.good = True
        self.keep = np.ones(len(normal), dtype=bool) if keep is None else keep
        self._dropped, self.count = ~self.keep, np.count_nonzero(self.keep & (normal >= 0))
        on, self.rows = None, np.arange(q)
        if keep is not None:
            place = np.full(q + 1, -1)
            rows = np.concatenate([normal[keep], tangential[keep].ravel()])
            self.rows = rows = np.sort(rows[rows >= 0])
            place[rows] = np.arange(len(rows))
            normal = np.where(keep, place[normal], -1)
            tangential = np.where(keep[:, None], place[tangential], -1)
            on = np.append(rows, np.arange(q, len(whole.W)))
            self.rest = np.setdiff1d(np.arange(q), rows)
            q = len(rows)
            self._across = whole.W[np.ix_(self.rest, on)]
            self._left = np.flatnonzero(self._dropped)
            self._left_rows = whole.normal_rows[self._left], whole.tangential_rows[self._left]
        A = whole.inverse(on, refuses)
        A_zq, self._A_qq = A[:q, q:].copy(), A[q:, q:].copy()
        try:
            self._rigid = lu(self._A_qq - np.eye(len(A) - q))
        except LinAlgError:
            if keep is None:
                raise SingularMatrix("the contact points do not hold the bodies") from None
            self.good = False
            return
        held = np.min(self._rigid.diagonal, initial=np.inf)
        self.good = bool(keep is None or held >= LOOSE * np.max(self._A_qq, initial=0.0))
        self._carried = self._rigid.solve(A_zq.T)
        S = without_anchors(A, A_zq, self._carried)
        self._on, self._forces = on, LoadForces(S, self._carried, self._rigid, on)
        self.space = PointSpace(S, normal, tangential, self._forces)

    def anew(self) -> Zone:
        """The same with a memory of its own."""
        new, space = copy(self), self.space
        new._forces = copy(self._forces)
        new.space = PointSpace(space.S, space.normal_rows, space.tangential_rows, new._forces)
        return new

    def keeps(self, needed: Mask) -> bool:
        """Return whether all these points are kept."""
        return not np.count_nonzero(needed & self._dropped)

    def solve(self, conditions: Conditions, load: Load, key: object) -> Response:
        """Gaps, slips and forces of all points under conditions that close no other ones."""
        response, p = self.space.pushed(conditions, load, key)
        z, q = response.solution, np.zeros(0)  # no anchors, as a rule
        assert load.moved is not None
        if len(self._A_qq):
            moved = load.moved if self._on is None else load.moved[self._on]
            z0, q0 = moved[: len(z)], moved[len(z) :]
            # R (A_qq q0 - A_qz (z - z0)), with R = (A_qq - 1)^-1 and the pull R q0
            q = q0 + self._forces.pull - self._carried @ (z - z0)
        if self.left:
            full = np.zeros(len(self.rows) + len(self.rest) + 1)  # the last for rows of -1
            full[self.rows] = z
            full[self.rest] = load.moved[self.rest] + self._across.dot(np.append(p, q))
            z, (normal, tangential) = full[:-1], self._left_rows
            response.gap[self._left] += full[normal]
            response.slip[self._left] += full[tangential]
        response.solution = np.append(z, q) if len(q) else z
        return response

    def transposed(
        self, conditions: Conditions, start: Array, forces: Array, moved: Array, key: object
    ) -> tuple[Array, Array]:
        """Solve the transposed problem of all points, see `PointSpace.transposed`.

        Parameters
        ----------
        conditions, key
            As of `solve`.
        start, forces : ndarray, shape (q,)
            What gaps and slips are held at, and forces on them.
        moved : ndarray, shape (q + k,)
            As of `Load`; it is changed.

        Returns
        -------
        total : ndarray, shape (q + k + 1,)
            Forces on gaps and slips, those of contact too, and of the springs on anchors; then zero.
        since : ndarray, shape (q + 1,)
            Slips beyond where springs begin; then zero, as for rows of -1.
        """
        q, rows = len(start), self.rows
        if self.left:  # forces on what is left out move the others
            moved[self._on] += forces[self.rest] @ self._across
        h, total, since = forces[rows], np.concatenate((forces, moved[q:], NO_ROW)), np.zeros(q + 1)
        if len(moved) > q:
            h = h - moved[q:] @ self._carried
        found = self.space.transposed(conditions, (start - moved[:q])[rows], h, key)
        total[rows] += found.p
        since[rows] = found.since
        if len(moved) > q:
            total[q:-1] += self._rigid.solve(moved[q:]) - self._carried @ found.z
        return total, since


def without_anchors(A: Array, A_zq: Array, carried: Array) -> Array:
    """``A_zz - A_zq R A_qz``, in the place of A; `carried` is ``R A_qz``."""
    q = len(A_zq)
    if len(A) == q:
        return A
    # the rows close up, from the first one on: NumPy copies what is not in one piece for every product
    S = A.reshape(-1)[: q * q].reshape(q, q)
    for begin in range(0, q, ROWS_AT_ONCE):
        rows = slice(begin, min(begin + ROWS_AT_ONCE, q))
        S[rows] = A[rows, :q] - A_zq[rows] @ carried
    symmetrise(S)
    return S
