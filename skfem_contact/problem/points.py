r"""The dense contact problem on gaps and slips: ``S z = h + p`` with ``p = (lambda, -tau)``.

Eliminating a closed point from it is deleting its row and column.
"""

from __future__ import annotations

from dataclasses import field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from skfem_contact.arrays import Array, Index
from skfem_contact.linalg.dense_factors import DenseFactors, blocks, factorised
from skfem_contact.problem.seam import Conditions, Load, Response, friction_force
from skfem_contact.records import dataclass

# What rows of -1 find at the end of a vector: those that can not change.
NO_ROW = np.zeros(1)


class HeldRows:
    """The rows that conditions hold, and that carry friction: the same for all with one `matrix_key`.

    Parameters
    ----------
    space : PointSpace
    conditions : Conditions

    Attributes
    ----------
    closed, rubs : ndarray of bool, shape (m,)
        Closed points whose gap can change; all closed points that do not stick.
    stick, slides : ndarray of bool, shape (m, d-1)
    gaps, slips, sliding : ndarray of int
        The rows of these.
    free : ndarray of int
        All rows but `gaps` and `slips`.
    rubbing, pressing : ndarray of int, share : ndarray
        Rows whose friction follows the normal force, on which row that is, and how much of it.
    bare : ndarray of bool, shape (m, d-1), or None
        Tangents along which there is only the law, as they have no row; None without any.
    """

    def __init__(self, space: PointSpace, conditions: Conditions) -> None:
        has_gap, has_slip = space.normal_rows >= 0, space.tangential_rows >= 0
        self.rubs = conditions.closed & ~conditions.stick
        self.closed = conditions.closed & has_gap
        self.stick = conditions.stick[:, None] & has_slip
        self.slides = self.rubs[:, None] & has_slip
        self.gaps = space.normal_rows[self.closed]
        self.slips = space.tangential_rows[self.stick]
        self.sliding = space.tangential_rows[self.slides]
        free = np.ones(len(space.S), dtype=bool)
        free[self.gaps] = free[self.slips] = False
        self.free = np.flatnonzero(free)
        coupled = self.closed & np.any(conditions.coupling != 0, axis=1)
        follows = self.slides & coupled[:, None]
        self.rubbing = space.tangential_rows[follows]
        self.pressing = space.normal_rows[np.nonzero(follows)[0]]
        self.share = conditions.coupling[follows]
        bare = self.rubs[:, None] & ~has_slip
        self.bare = bare if np.count_nonzero(bare) else None


class Unknowns(NamedTuple):
    """Gaps and slips z, the forces p on them, and slips since the anchors of springs, all (q,)."""

    z: Array
    p: Array
    since: Array


#: Derivatives of a number by what an answer follows from.
Duals = dict[str, Array]


class LoadForces:
    """Forces h on gaps and slips of loads that say what these do where contact carries nothing.

    Of the load that was asked for last they are known.

    Parameters
    ----------
    S : ndarray, shape (q, q)
        As of `PointSpace`.
    A_zq : ndarray, shape (q, k)
        What couples them with the springs on k anchors.
    rigid : DenseFactors
        Of ``A_qq - 1``.
    on : ndarray of int, shape (q + k,), or None
        The rows and anchors among those of the load.
    """

    def __init__(self, S: Array, A_zq: Array, rigid: DenseFactors, on: Index | None) -> None:
        self._S, self._A_zq, self._rigid, self._on = S, A_zq, rigid, on
        self._last: tuple[Load, Array] | None = None

    def __call__(self, load: Load) -> Array:
        last = self._last
        if last is None or last[0] is not load:
            assert load.moved is not None
            moved, q = load.moved if self._on is None else load.moved[self._on], len(self._S)
            # A_zz - A_zq R A_qz = S and A_zq (1 - R A_qq) = -A_zq R, with R = (A_qq - 1)^-1
            h = self._S.dot(moved[:q])
            if len(moved) > q:
                h -= self._A_zq @ self._rigid.solve(moved[q:])
            last = self._last = load, h
        return last[1]


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
    follows : LoadForces, optional
        Forces h (q,) of loads that have none of their own.
    """

    S: Array
    normal_rows: NDArray[np.intp]
    tangential_rows: NDArray[np.intp]
    follows: LoadForces | None = None
    # rows and factor for the conditions of this key: most iterations ask for the set of the last one
    _key: object = field(default=None, repr=False)
    _rows: HeldRows | None = field(default=None, repr=False)
    _factor: DenseFactors | None = field(default=None, repr=False)

    def force(self, load: Load) -> Array:
        """The forces h of a load, (q,)."""
        return load.force if self.follows is None or load.force.size else self.follows(load)

    def solve(self, conditions: Conditions, load: Load) -> Response:
        """Solve for the gaps and slips that the conditions leave free."""
        return self.pushed(conditions, load)[0]

    def pushed(self, conditions: Conditions, load: Load, key: object = None) -> tuple[Response, Array]:
        """The same, and the forces on gaps and slips, (q,); `key` as of `unknowns`."""
        found = self.unknowns(conditions, load, key)
        return self._response(conditions, load, found), found.p

    def unknowns(self, conditions: Conditions, load: Load, key: object = None) -> Unknowns:
        """Gaps and slips, and the forces on them.

        `key`: the same, or equal, for conditions with the same matrix; by default their own.
        """
        rows = self._held(conditions, conditions.matrix_key() if key is None else key)
        z = np.zeros(len(self.S))
        z[rows.gaps] = -load.gap0[rows.closed]
        z[rows.slips] = (conditions.anchor - load.slip0)[rows.stick]
        # friction of what slides, as far as it follows from what is held; springs begin at anchors
        known = conditions.offset
        if conditions.gives:
            beyond = load.slip0 - conditions.anchor
            z[rows.sliding] = -beyond[rows.slides]
            given = np.where(rows.slides, 0.0, beyond)  # along tangents that supports prescribe
            known = known + np.einsum("ikl,il->ik", conditions.spring, given)
        force = self.force(load)
        rhs = force - self.S.dot(z)  # of so few rows in half the time of @
        rhs[rows.sliding] -= known[rows.slides]
        rhs[rows.rubbing] += rows.share * rhs[rows.pressing]
        if self._factor is None:
            self._factor = self._factorize(conditions, rows)
        since = np.zeros_like(z)
        since[rows.free] = self._factor.solve(rhs[rows.free])
        z[rows.free] += since[rows.free]
        return Unknowns(z, self.S.dot(z) - force, since)

    def adjoint(self, conditions: Conditions, of: Response, key: object) -> Duals:
        """`unknowns` and `response` backwards, line by line.

        Parameters
        ----------
        conditions : Conditions
        of : Response
            Derivatives of a number by gaps, slips and forces; by the solution z too.
        key : object
            As of `unknowns`.

        Returns
        -------
        dict of ndarray
            Derivatives by the forces h on gaps and slips, `load` (q,), and S times that, `moved`; by
            gap0 (m, 1), and by slip0, anchor and offset, (m, d-1).
        """
        rows = self._held(conditions, key)
        q, slip, normal_force, tangential = len(self.S), of.slip, of.normal_force, of.tangential_force
        by_law: Array | float = 0.0
        way: Array | float = 0.0
        if rows.bare is not None:
            by_law = np.where(rows.bare, tangential, 0.0)
            way = np.einsum("ikl,ik->il", conditions.spring, by_law)
            normal_force = normal_force + np.sum(conditions.coupling * by_law, axis=1)
        slip = slip + way
        gap0 = np.where(rows.closed, 0.0, of.gap)
        # each point has rows of its own; those of -1, which there are not, go to the end
        z, p = np.concatenate((of.solution, NO_ROW)), np.zeros(q)
        z[self.normal_rows] += gap0
        z[self.tangential_rows] += slip
        p[rows.gaps] = normal_force[rows.closed]
        p[rows.slips] = -tangential[rows.stick]
        p[rows.sliding] = -tangential[rows.slides]
        own = z[:-1]
        z = own + self.S.dot(p)
        if self._factor is None:
            self._factor = self._factorize(conditions, rows)
        r = np.zeros(q)
        r[rows.free] = self._factor.solve(z[rows.free], transposed=True)
        if len(rows.rubbing):
            np.add.at(r, rows.pressing, rows.share * r[rows.rubbing])
        base = z - self.S.dot(r)
        gap0[rows.closed] = -base[rows.gaps]
        held = np.zeros(slip.shape)  # of what moves with anchors: slips of sticking points, and springs
        held[rows.stick] = base[rows.slips]
        known = np.zeros(slip.shape)
        known[rows.slides] = -r[rows.sliding]
        if conditions.gives:
            held[rows.slides] = base[rows.sliding]
            given = np.einsum("ikl,ik->il", conditions.spring, known)
            held -= np.where(rows.slides, 0.0, given)
        found = {"load": r - p, "moved": own - base, "gap0": gap0[:, None], "slip0": slip - held}
        return found | {"anchor": held - way, "offset": by_law + known}

    def _held(self, conditions: Conditions, key: object) -> HeldRows:
        """The rows that conditions hold; of the last ones, if their matrix is the same."""
        if self._rows is None or key != self._key:
            self._key, self._rows, self._factor = key, HeldRows(self, conditions), None
        return self._rows

    def _factorize(self, conditions: Conditions, rows: HeldRows) -> DenseFactors:
        free = rows.free
        where = np.full(len(self.S), -1)
        where[free] = np.arange(len(free))
        At = self.S[np.ix_(free, free)]  # transposed, as LAPACK has it
        t = self.tangential_rows.shape[1]
        for k, j in np.ndindex(t, t) if conditions.gives else ():
            on = rows.slides[:, k] & rows.slides[:, j]
            row, column = where[self.tangential_rows[on, k]], where[self.tangential_rows[on, j]]
            At[column, row] += conditions.spring[on, k, j]
        for some in blocks(len(rows.rubbing)):
            pressing = self.S[np.ix_(free, rows.pressing[some])]
            At[:, where[rows.rubbing[some]]] += rows.share[some] * pressing
        return factorised(At.T, symmetric=not len(rows.rubbing) and conditions.even_springs)

    def _response(self, conditions: Conditions, load: Load, found: Unknowns) -> Response:
        """Gaps, slips and forces of all points from the unknowns that were found last."""
        assert self._rows is not None
        rows, (z, p, since) = self._rows, found
        moved = np.concatenate((z, NO_ROW))
        gap = load.gap0 + moved[self.normal_rows]
        gap[rows.closed] = 0.0
        slip = load.slip0 + moved[self.tangential_rows]
        normal_force, tangential = np.zeros(gap.shape), np.zeros(slip.shape)
        normal_force[rows.closed] = p[rows.gaps]
        tangential[rows.stick] = -p[rows.slips]
        # with its part along a tangent whose slip supports prescribe, for which there is no row
        way = slip
        if conditions.gives:  # springs are stiff: whole slips have lost the digits of what they give
            way = slip - conditions.anchor
            way[rows.slides] = since[rows.sliding]
        friction = friction_force(conditions, way, normal_force)
        tangential[rows.rubs] = friction[rows.rubs]
        return Response(gap, slip, normal_force, tangential, z)
