r"""The dense contact problem on gaps and slips, and on those of them that matter at the moment.

Eliminating a closed point from ``S z = h + p`` is deleting its row and column. Points that are open,
and far from closing, carry no force whatever they do: they are eliminated for good (`Reduction`),
until one of them is asked to close. This is exact and costs about one factorisation; the many
factorisations of a load history are then of the size of the contact zone, not of the surface.

A spring in series with every point, which forces are taken from (`PointsInSeries`):
gaps and slips z of the points are seen through springs with the stiffness C, which have no strain at
forces ``p_0 = (lambda, -tau)``,

    seen = z + C^-1 (p - p_0).

Where ``p = p_0`` comes out they are as good as not there: it is the answer of the problem itself. On
displacements this is an augmented Lagrangian.
"""

from __future__ import annotations

from dataclasses import field, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import LinAlgError

from skfem_contact.linalg.dense_factors import (
    DenseFactors,
    cholesky,
    factorised,
    lu,
    subtract_product,
    symmetrise,
)
from skfem_contact.problem import thresholds
from skfem_contact.problem.response import Conditions, Load, Resistance, Response, friction_force
from skfem_contact.problem.thresholds import FEWEST, LOOSE, SHARE, SPARE, SURPLUS
from skfem_contact.records import dataclass

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Index = NDArray[np.intp]


# What rows of -1 find at the end of a vector: those that can not change.
NO_ROW = np.zeros(1)


class HeldRows:
    """Which rows conditions hold, and which carry friction: the same for all with one `matrix_key`.

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
    gives : bool
        Whether any point has a spring.
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
        self.gives = conditions.gives


class Unknowns(NamedTuple):
    """Gaps and slips z, the forces p on them, and slips since the anchors of springs, all (q,)."""

    z: Array
    p: Array
    since: Array


class Duals(NamedTuple):
    """Derivatives of a number by what an answer follows from, see `PointSpace.adjoint`.

    Attributes
    ----------
    force : ndarray, shape (q,)
        By the load on gaps and slips.
    gap0 : ndarray, shape (m,)
    slip0, anchor, offset : ndarray, shape (m, d-1)
    """

    force: Array
    gap0: Array
    slip0: Array
    anchor: Array
    offset: Array


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
    # rows and factor for the conditions of this key: most iterations ask for the set of the last one
    _key: object = field(default=None, repr=False)
    _rows: HeldRows | None = field(default=None, repr=False)
    _factor: DenseFactors | None = field(default=None, repr=False)
    _reduction: Reduction | None = field(default=None, repr=False)
    # what was last chosen to solve with, and for which rows
    _chosen: tuple[HeldRows, Reduction | None] | None = field(default=None, repr=False)
    _last: Array | None = field(default=None, repr=False)

    def solve(self, conditions: Conditions, load: Load) -> Response:
        """Solve for the gaps and slips that the conditions leave free."""
        rows = self._held(conditions, conditions.matrix_key())
        if self._chosen is None or self._chosen[0] is not rows:
            self._chosen = None  # before the next one takes memory
            self._chosen = rows, self._reduce(rows.closed, load)
        reduction = self._chosen[1]
        if reduction is None:
            found = self.unknowns(conditions, load, self._key)
        else:
            found = reduction.unknowns(conditions, load, rows)
        response = self._response(conditions, load, rows, found)
        self._last = response.gap
        return response

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
        if rows.gives:
            beyond = load.slip0 - conditions.anchor
            z[rows.sliding] = -beyond[rows.slides]
            given = np.where(rows.slides, 0.0, beyond)  # along tangents that supports prescribe
            known = known + np.einsum("ikl,il->ik", conditions.spring, given)
        rhs = load.force - self.S.dot(z)  # of so few rows in half the time of @
        rhs[rows.sliding] -= known[rows.slides]
        rhs[rows.rubbing] += rows.share * rhs[rows.pressing]
        if self._factor is None:
            self._factor = self._factorize(conditions, rows)
        since = np.zeros_like(z)
        since[rows.free] = self._factor.solve(rhs[rows.free])
        z[rows.free] += since[rows.free]
        return Unknowns(z, self.S.dot(z) - load.force, since)

    def adjoint(self, conditions: Conditions, of: Response) -> Duals:
        """`solve` transposed: what a number depends on, from how it depends on the answer.

        Parameters
        ----------
        conditions : Conditions
        of : Response
            Derivatives of the number by gaps, slips and forces; by the solution z too.
        """
        closed, key = conditions.closed & (self.normal_rows >= 0), conditions.matrix_key()
        still = np.zeros(of.slip.shape)
        reduction = self._reduce(closed, Load(of.solution, of.gap, still, still))
        if reduction is None:
            return self._transposed(conditions, key, of)
        return reduction.adjoint(conditions, of, key)

    def reduce_to(self, needed: Mask) -> None:
        """Leave out what none of many solves needs: all points (m,) that are open in all of them."""
        keep = needed | (self.normal_rows < 0)
        self._reduction = None if keep.all() else Reduction(self, keep)

    def _transposed(self, conditions: Conditions, key: object, of: Response) -> Duals:
        """`_response` and `unknowns` backwards, line by line."""
        rows = self._held(conditions, key)
        has_row, q = self.tangential_rows >= 0, len(self.S)
        slip, normal_force, tangential = of.slip, of.normal_force, of.tangential_force
        by_law, way = np.where(rows.rubs[:, None] & ~has_row, tangential, 0.0), 0.0
        if np.count_nonzero(by_law):  # along tangents without a row there is only the law
            way = np.einsum("ikl,ik->il", conditions.spring, by_law)
            normal_force = normal_force + np.sum(conditions.coupling * by_law, axis=1)
        slip, anchor, offset = slip + way, -way, by_law
        gap0 = np.where(rows.closed, 0.0, of.gap)
        slip0 = slip.copy()
        # each point has rows of its own; those of -1, which there are not, go to the end
        z, p = np.append(of.solution, 0.0), np.zeros(q)
        z[self.normal_rows] += gap0
        z[self.tangential_rows] += slip
        p[rows.gaps] = normal_force[rows.closed]
        p[rows.slips] = -tangential[rows.stick]
        p[rows.sliding] = -tangential[rows.slides]
        z = z[:-1] + self.S.dot(p)
        if self._factor is None:
            self._factor = self._factorize(conditions, rows)
        r = np.zeros(q)
        r[rows.free] = self._factor.solve(z[rows.free], transposed=True)
        np.add.at(r, rows.pressing, rows.share * r[rows.rubbing])
        base = z - self.S.dot(r)
        gap0[rows.closed] = -base[rows.gaps]
        held = np.zeros(slip.shape)  # of what moves with anchors: slips of sticking points, and springs
        held[rows.stick] = base[rows.slips]
        known = np.zeros(slip.shape)
        known[rows.slides] = -r[rows.sliding]
        if rows.gives:
            held[rows.slides] = base[rows.sliding]
            given = np.einsum("ikl,ik->il", conditions.spring, known)
            held -= np.where(rows.slides, 0.0, given)
        return Duals(r - p, gap0, slip0 - held, anchor + held, offset + known)

    def _held(self, conditions: Conditions, key: object) -> HeldRows:
        """The rows that conditions hold; of the last ones, if their matrix is the same."""
        if self._rows is None or key != self._key:
            self._key, self._rows, self._factor = key, HeldRows(self, conditions), None
        return self._rows

    def _reduce(self, needed: Mask, load: Load) -> Reduction | None:
        """The reduction in use, or a new one where it is too small or much too large."""
        count = np.count_nonzero(needed)
        spare = max(FEWEST, int(SPARE * count), int(SHARE * len(needed)))
        old = self._reduction
        if old is not None and old.keeps(needed, SURPLUS * (count + spare)):
            return old if old.good else None
        gap = np.where(needed, -np.inf, load.gap0 if self._last is None else self._last)
        keep = needed.copy()
        keep[np.argsort(gap, kind="stable")[: count + spare]] = True
        keep |= self.normal_rows < 0
        if 4 * keep.sum() > 3 * len(keep):
            if self.S.nbytes > thresholds.KEPT_BESIDE:
                self._reduction = None
            return None
        old = self._reduction = self._factor = None  # before the next one takes memory
        self._reduction = Reduction(self, keep)
        return self._reduction if self._reduction.good else None

    def _factorize(self, conditions: Conditions, rows: HeldRows) -> DenseFactors:
        free = rows.free
        where = np.full(len(self.S), -1)
        where[free] = np.arange(len(free))
        At = self.S[np.ix_(free, free)]  # transposed, as LAPACK has it
        t = self.tangential_rows.shape[1]
        for k, j in np.ndindex(t, t) if rows.gives else ():
            on = rows.slides[:, k] & rows.slides[:, j]
            row, column = where[self.tangential_rows[on, k]], where[self.tangential_rows[on, j]]
            At[column, row] += conditions.spring[on, k, j]
        At[:, where[rows.rubbing]] += rows.share * self.S[np.ix_(free, rows.pressing)]
        return factorised(At.T, symmetric=not len(rows.rubbing) and conditions.even_springs)

    def _response(
        self, conditions: Conditions, load: Load, rows: HeldRows, found: Unknowns
    ) -> Response:
        z, p, since = found
        moved = np.concatenate((z, NO_ROW))
        gap = load.gap0 + moved[self.normal_rows]
        gap[rows.closed] = 0.0
        slip = load.slip0 + moved[self.tangential_rows]
        normal_force, tangential = np.zeros(gap.shape), np.zeros(slip.shape)
        normal_force[rows.closed] = p[rows.gaps]
        tangential[rows.stick] = -p[rows.slips]
        # with its part along a tangent whose slip supports prescribe, for which there is no row
        way = slip
        if rows.gives:  # springs are stiff: whole slips have lost the digits of what they give
            way = slip - conditions.anchor
            way[rows.slides] = since[rows.sliding]
        friction = friction_force(conditions, way, normal_force, rows.gives)
        tangential[rows.rubs] = friction[rows.rubs]
        own = z if load.strained is None else z + load.strained
        return Response(gap, slip, normal_force, tangential, own)


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
        self.keep, self._dropped, self._count = keep, ~keep, np.count_nonzero(keep)
        self._outer = space.normal_rows, space.tangential_rows
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
        return bool(self._count <= most and not np.count_nonzero(needed & self._dropped))

    def load(self, load: Load) -> Load:
        """A load on the rows that are kept; the same load is reduced once."""
        if self._load is not load:
            self._load, rest = load, load.force[self.rest]
            self._at_rest = self._factor.solve(rest)
            force = load.force[self.rows] - self._follow.T.dot(rest)
            self._reduced = Load(force, load.gap0, load.slip0, load.prescribed)
        return self._reduced

    def expand(self, z: Array, load: Load) -> Array:
        """Gaps and slips of all rows (q,) from those of the rows that are kept."""
        self.load(load)
        full = np.empty(len(self.rows) + len(self.rest))
        full[self.rows] = z
        full[self.rest] = self._at_rest - self._follow.dot(z)
        return full

    def adjoint(self, conditions: Conditions, of: Response, key: object) -> Duals:
        """That of all rows, see `PointSpace.adjoint`."""
        z, dropped = np.append(of.solution, 0.0), self._dropped
        z[self._outer[0][dropped]] += of.gap[dropped]
        np.add.at(z, self._outer[1][dropped], of.slip[dropped])
        kept, left = z[self.rows], z[self.rest]
        asked = np.count_nonzero(left)
        if asked:
            kept = kept - self._follow.T.dot(left)
        own = Response(of.gap, of.slip, of.normal_force, of.tangential_force, kept)
        found = self.space._transposed(conditions, key, own)
        force = np.empty(len(z) - 1)
        force[self.rows] = found.force
        force[self.rest] = -self._follow.dot(found.force)
        if asked:
            force[self.rest] += self._factor.solve(left)
        return found._replace(force=force)

    def unknowns(self, conditions: Conditions, load: Load, key: object) -> Unknowns:
        """Those of all rows."""
        z, *others = self.space.unknowns(conditions, self.load(load), key)
        forces, since = np.zeros((2, len(self.rows) + len(self.rest)))
        forces[self.rows], since[self.rows] = others
        return Unknowns(self.expand(z, load), forces, since)


class PointsInSeries:
    """On gaps and slips, ``S z = h + p``, where ``S = (W + E)^-1`` has springs E already, or none.

    With those of the stiffness C in their place, ``D = C^-1 - E``,

        (1 + S D)^-1 S seen = (1 + S D)^-1 (h - S C^-1 p_0) + p.

    Parameters
    ----------
    space : PointSpace
    C : Resistance
        Stiffness of the springs of each point.
    own : ndarray, shape (m,), optional
        Compliance E of the springs that are in S.
    """

    springs = None  # that are to lose their strain

    def __init__(self, space: PointSpace, C: Resistance, own: Array | None = None) -> None:
        self._space = space
        shape = space.tangential_rows.shape
        soft = 1.0 / C.normal, np.broadcast_to(1.0 / C.tangential[:, None], shape)
        self._give = self._on_rows(*soft)
        replaced = np.zeros(len(space.S))
        if own is not None:
            replaced = self._on_rows(own, np.broadcast_to(own[:, None], shape))
        self._factor = lu(np.eye(len(space.S)) + space.S * (self._give - replaced))
        S = self._factor.solve(space.S)
        symmetrise(S)
        self.points = PointSpace(S, space.normal_rows, space.tangential_rows)

    def at_forces(self, load: Load, normal_force: Array, tangential_force: Array) -> Load:
        """The load with the forces at which the springs have no strain."""
        p = self._on_rows(normal_force, -tangential_force)
        return replace(load, force=self._factor.solve(load.force) - self.points.S @ (self._give * p))

    def solve(self, conditions: Conditions, load: Load) -> Response:
        """Gaps and slips as they are seen, and forces, under these conditions."""
        return self.points.solve(conditions, load)

    def _on_rows(self, normal: Array, tangential: Array) -> Array:
        space = self._space
        return on_rows((normal, tangential), space.normal_rows, space.tangential_rows, len(space.S))


def on_rows(
    values: tuple[Array, Array],
    normal_rows: Index,
    tangential_rows: Index,
    q: int,
) -> Array:
    """Values of points (m,) and of their tangents (m, d-1), on the q rows that there are."""
    out = np.zeros(q + 1)  # the last for rows of -1, which there are not
    out[normal_rows], out[tangential_rows] = values
    return out[:q]
