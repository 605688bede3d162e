r"""What an iteration asks of the contact points, and the dense problem that answers it.

One iteration asks one linear question: with these points closed, those sticking and a given linear
friction law on the rest (`Conditions`), what are the gaps, slips and contact forces (`Response`) under
this load (`Load`)? On gaps and slips it is ``S z = h + p`` with ``p = (lambda, -tau)``. Eliminating a
closed point from that is deleting its row and column.
"""

from __future__ import annotations

from dataclasses import field
from functools import cached_property
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from skfem_contact.arrays import Array, Index, Mask
from skfem_contact.digits import SOLVED
from skfem_contact.linalg.dense_factors import ROWS_AT_ONCE, DenseFactors, factorised
from skfem_contact.records import dataclass


@dataclass(eq=False)
class Conditions:
    r"""The conditions at every point during one linear solve.

    A closed point has no gap. If it sticks, its slip is `anchor`; otherwise its friction force is
    ``tau = offset + spring (s - anchor) + coupling lambda``: springs may be far stiffer than points,
    and what they give is then a small part of the slip. An open point carries nothing.

    Attributes
    ----------
    closed, stick : ndarray of bool, shape (m,)
    anchor, offset, coupling : ndarray, shape (m, d-1)
        [length], [force], [1]
    spring : ndarray, shape (m, d-1, d-1)
        [force/length]
    rough : bool
        Whether an answer on the way will do: where linear problems are iterated, one that leaves a
        hundredth of what is wrong with the iterate before.
    """

    closed: Mask
    stick: Mask
    anchor: Array
    spring: Array
    offset: Array
    coupling: Array
    rough: bool = False

    @cached_property
    def gives(self) -> bool:
        """Return whether any point has a spring."""
        return bool(np.count_nonzero(self.spring))

    @property
    def even_springs(self) -> bool:
        """Return whether all springs are symmetric.

        They are not where a bound grows with the slip: the force along the direction of friction then
        changes with slip along another, that of all slip so far.
        """
        spring = self.spring
        if spring.shape[1] == 1 or not self.gives:
            return True
        return not np.count_nonzero(_skewed(spring))

    def matrix_key(self) -> bytes:
        """Equal for conditions with the same matrix, so that a factorisation can be kept."""
        masks = self.closed.tobytes() + self.stick.tobytes()
        return masks + self.spring.tobytes() + self.coupling.tobytes()


def odd_round_off(spring: Array) -> Array:
    """Return what takes springs (m, t, t) that count as symmetric from being so; zero for the others.

    >>> odd_round_off(np.array([[[2.0, 1e-12], [0.0, 2.0]], [[2.0, 1.0], [0.0, 2.0]]])).tolist()
    [[[0.0, 5e-13], [-5e-13, 0.0]], [[0.0, 0.0], [0.0, 0.0]]]
    """
    odd = 0.5 * (spring - spring.swapaxes(1, 2))
    odd[_skewed(spring)] = 0.0
    return odd


def _skewed(spring: Array) -> Mask:
    """Springs (m, t, t) that differ from their transposes by more than round-off."""
    size = np.max(np.abs(spring), axis=(1, 2))
    skew = np.max(np.abs(spring - spring.swapaxes(1, 2)), axis=(1, 2))
    return np.asarray(skew > SOLVED * size)


@dataclass(eq=False)
class Response:
    """Gaps, slips and forces of all points, and the solution in the space's own unknowns.

    `rough`: bodies are not yet in equilibrium as well as they will be, see `Conditions`.
    """

    gap: Array
    slip: Array
    normal_force: Array
    tangential_force: Array
    solution: Array
    rough: bool = False


class Resistance(NamedTuple):
    """The resistance of each point by itself, the others free to move, (m,) [force/length].

    Attributes
    ----------
    normal : ndarray, shape (m,)
        Against a change of its gap.
    tangential : ndarray, shape (m,)
        Against slip, in the direction in which it resists least.
    """

    normal: Array
    tangential: Array


@dataclass(eq=False)
class Load:
    """One load step in the unknowns of a space: forces and initial gaps and slips.

    Attributes
    ----------
    force : ndarray
        Empty where it follows from `moved`.
    components : tuple
        What the bodies remember of the load, for the interior.
    moved : ndarray
        Changes of gaps, slips and anchors where contact carries nothing; on gaps and slips.
    """

    force: Array
    gap0: Array
    slip0: Array
    prescribed: Array
    components: tuple[Any, ...] = ()
    moved: Array | None = None


def friction_force(conditions: Conditions, moved: Array, normal_force: Array) -> Array:
    """The linear friction law of the points that do not stick exactly, moved from their anchors."""
    force = conditions.offset
    if conditions.gives:
        force = force + np.einsum("ikl,il->ik", conditions.spring, moved)
    return force + conditions.coupling * normal_force[:, None]


class LinearProblem(Protocol):
    """A problem that gives gaps, slips and forces under conditions that are linear.

    Attributes
    ----------
    points : PointSpace or None
        The dense problem on gaps and slips, where it is that: pivoting and uniqueness need it.
    springs : ndarray, shape (m,), or None
        Compliance of the springs through which points are seen [length/force]; see `seam`. None
        where rows do not depend on each other, and there are none. They are a device of the iteration:
        it moves their rest forces until none has a strain.
    """

    @property
    def points(self) -> Any: ...

    @property
    def springs(self) -> Array | None: ...

    def solve(self, conditions: Conditions, load: Load) -> Response:
        """Gaps, slips and forces of all points under these conditions.

        Raises
        ------
        SingularMatrix
            If the conditions do not hold the bodies.
        """
        ...

    def at_forces(self, load: Load, normal_force: Array, tangential_force: Array) -> Load:
        """A load of `ContactProblem.load` with the forces at which the springs have no strain."""
        ...


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


class Unknowns(NamedTuple):
    """Gaps and slips z, the forces p on them, and slips since the anchors of springs, all (q,)."""

    z: Array
    p: Array
    since: Array


class LoadForces:
    """Forces h on gaps and slips of loads that say what these do where contact carries nothing.

    Of the load that was asked for last they are known, and so is `pull`: what the bodies without the
    springs on their anchors make of the extensions (k,) of these.

    Parameters
    ----------
    S : ndarray, shape (q, q)
        As of `PointSpace`.
    carried : ndarray, shape (k, q)
        ``R A_qz``: by what gaps and slips pull k anchors along, without the springs on these.
    rigid : DenseFactors
        Of ``A_qq - 1``, the inverse of which is R.
    on : ndarray of int, shape (q + k,), or None
        The rows and anchors among those of the load.
    """

    def __init__(self, S: Array, carried: Array, rigid: DenseFactors, on: Index | None) -> None:
        self._S, self._carried, self._rigid, self._on = S, carried, rigid, on
        self._last: tuple[Load, Array] | None = None
        self.pull = np.zeros(0)

    def __call__(self, load: Load) -> Array:
        last = self._last
        if last is None or last[0] is not load:
            assert load.moved is not None
            moved, q = load.moved if self._on is None else load.moved[self._on], len(self._S)
            # A_zz - A_zq R A_qz = S and A_zq (1 - R A_qq) = -A_zq R, with R = (A_qq - 1)^-1
            h = self._S.dot(moved[:q])
            if len(moved) > q:
                self.pull = self._rigid.solve(moved[q:])
                h -= moved[q:] @ self._carried
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
        rows, factor = self._held(conditions, conditions.matrix_key() if key is None else key)
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
        since = np.zeros_like(z)
        since[rows.free] = factor.solve(rhs[rows.free])
        z[rows.free] += since[rows.free]
        return Unknowns(z, self.S.dot(z) - force, since)

    def transposed(self, conditions: Conditions, start: Array, h: Array, key: object) -> Unknowns:
        """Solve the transposed problem, which derivatives go back by.

        Gaps follow slips in it, where in the problem itself friction follows normal forces.

        Parameters
        ----------
        conditions : Conditions
        start : ndarray, shape (q,)
            What is held of gaps and slips, and where springs begin; of others any values.
        h : ndarray, shape (q,)
        key : object
            As of `unknowns`.
        """
        rows, factor = self._held(conditions, key)
        since = np.zeros(len(h))
        since[rows.free] = factor.solve((h - self.S.dot(start))[rows.free], transposed=True)
        z = start + since
        np.add.at(z, rows.pressing, rows.share * since[rows.rubbing])
        return Unknowns(z, self.S.dot(z) - h, since)

    def _held(self, conditions: Conditions, key: object) -> tuple[HeldRows, DenseFactors]:
        """The rows that conditions hold, and the factor; the last ones, if their matrix is the same."""
        if self._rows is None or self._factor is None or key != self._key:
            self._key, self._rows, self._factor = key, HeldRows(self, conditions), None
            self._factor = self._factorize(conditions, self._rows)
        return self._rows, self._factor

    def _factorize(self, conditions: Conditions, rows: HeldRows) -> DenseFactors:
        free = rows.free
        where = np.full(len(self.S), -1)
        where[free] = np.arange(len(free))
        At = self.S[free[:, None], free]  # transposed, as LAPACK has it
        t = self.tangential_rows.shape[1]
        for k, j in np.ndindex(t, t) if conditions.gives else ():
            on = rows.slides[:, k] & rows.slides[:, j]
            row, column = where[self.tangential_rows[on, k]], where[self.tangential_rows[on, j]]
            At[column, row] += conditions.spring[on, k, j]
        for begin in range(0, len(rows.rubbing), ROWS_AT_ONCE):
            some = slice(begin, begin + ROWS_AT_ONCE)
            pressing = self.S[free[:, None], rows.pressing[some]]
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
