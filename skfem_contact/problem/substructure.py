"""Static condensation of one linear body onto the DOFs that contact needs, and the way back.

``S = K_cc - K_ci K_ii^-1 K_ic`` comes from one factorisation with the contact DOFs ordered last: the
trailing block of the factors is S, and the same factors recover the interior.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Callable, Sequence
from copy import copy
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from scipy.linalg import LinAlgError
from scipy.sparse import csr_matrix

from skfem_contact.arrays import Array, Index, same, sizes
from skfem_contact.bodies.body import Body
from skfem_contact.bodies.member import Member, largest
from skfem_contact.digits import ROUND_OFF
from skfem_contact.errors import InputError, SingularMatrix
from skfem_contact.linalg.backend import Backend, BodyFactor
from skfem_contact.linalg.dense_factors import definite_inverse, lu
from skfem_contact.linalg.direct import Direct, IndefiniteFactor
from skfem_contact.linalg.fronts import FactorSize, factor_size, nodes_of
from skfem_contact.records import Lock, once

logger = logging.getLogger("skfem_contact")

Components = tuple[Array, Array]


# Ratio of singular values of the rigid modes on some DOFs above which these hold the body firmly.
HELD_FIRMLY = 1e-2


# Load directions that are remembered; a history of more is condensed step by step.
MOST_DIRECTIONS = 12


class Directions(NamedTuple):
    """Directions of loads on a body as far as they are known: others come behind them, in another one.

    Attributes
    ----------
    loads : ndarray, shape (n, k)
        The directions, orthonormal.
    places : ndarray of int, shape (a,)
        DOFs that they act on, which are few as a rule.
    values : ndarray, shape (a, k)
        The directions there.
    eliminated : ndarray, shape (n_f, k)
        Loads that have one component, which is one, the interior eliminated.
    """

    loads: Array
    places: Index
    values: Array
    eliminated: Array


class LoadSpan:
    """The few directions that the loads of a history span, and what follows from each of them.

    Load steps are as a rule multiples and sums of few vectors. The interior is eliminated once from
    each direction; a load step then costs a few scalar products. Forces and prescribed displacements
    have each their own: in a sum, the larger would hide the digits of the other.

    All threads share the directions, to which one adds while others that would wait. Components of a
    load stay what they are, along the first of all directions.

    Parameters
    ----------
    dofs : ndarray of int
        Of the n DOFs of the body, that these loads are on.
    n, free, kept : int
        Of these the ones that factors are about, and the ones that are not eliminated.
    """

    def __init__(self, dofs: Index, n: int, free: int, kept: int) -> None:
        self._dofs, self._inside = dofs, free - kept
        places, none = np.zeros(0, dtype=np.intp), np.zeros((0, 0))
        self._known = Directions(np.zeros((n, 0)), places, none, np.zeros((free, 0)))
        self._last = np.zeros(0), np.zeros(0)
        self._lock = Lock()

    def components(self, load: Array, eliminate: Callable[[Array], Array]) -> Array | None:
        """Components of a load (n,) along the directions; adds one where they do not span it.

        None where there are too many directions already. `eliminate` takes values on `dofs` to what
        they are once the interior is eliminated, (n_f, 1). (It is not kept: a body's own would be a
        cycle with its factors, and their memory wait for the garbage collector.)
        """
        known, last = self._known, self._last
        places, Q, b = known.places, known.values, load[known.places]
        if np.count_nonzero(b) != np.count_nonzero(load):  # it acts elsewhere, too
            places, Q, b = self._dofs, known.loads[self._dofs], load[self._dofs]
        if len(b) == len(last[0]) and not np.count_nonzero(b != last[0]):
            return last[1]  # most steps change one of many loads
        c = Q.T.dot(b)  # in half the time of @
        rest = b - _combined(Q, c)
        again = Q.T.dot(rest)  # once more: the first pass leaves round-off of |b|
        c, rest = c + again, rest - _combined(Q, again)
        size = math.sqrt(rest.dot(rest))
        if size <= ROUND_OFF * math.sqrt(b.dot(b)):
            self._last = b, c
            return c
        if Q.shape[1] >= MOST_DIRECTIONS:
            return None
        with self._lock:
            if self._known is known:
                self._add(places, rest / size, eliminate)
        return self.components(load, eliminate)

    def _add(self, places: Index, direction: Array, eliminate: Callable[[Array], Array]) -> None:
        known = self._known
        load = np.zeros((len(known.loads), 1))
        load[places, 0] = direction
        reduced = eliminate(load[self._dofs, 0])
        loads = np.concatenate([known.loads, load], axis=1)
        places = np.flatnonzero(loads.any(axis=1))
        eliminated = np.concatenate([known.eliminated, reduced], axis=1)
        self._last = np.zeros(0), np.zeros(0)
        self._known = Directions(loads, places, loads[places], eliminated)

    def along(self, count: int) -> Array:
        """Loads on the kept DOFs with one component, of the first directions, (n_c, count)."""
        return self._known.eliminated[self._inside :, :count]

    @property
    def eliminated(self) -> Array:
        """Loads that have one component, which is one, the interior eliminated, (n_f, k)."""
        return self._known.eliminated


def _combined(Q: Array, c: Array) -> Array:
    """``Q @ c``; of a single direction, the usual case, BLAS takes ten times as long as a product."""
    return Q[:, 0] * c if len(c) == 1 else np.asarray(Q @ c)


class Substructure:
    """One body condensed onto the DOFs that contact needs; of a rigid body all that it has.

    Parameters
    ----------
    body : Body or RigidBody
    K : csr_matrix, shape (n, n)
        Its stiffness.
    wanted : ndarray of int
        DOFs that occur in contact rows, without prescribed ones.
    firm : float
        Stiffness of the springs on the anchors of a rigid body, which has none of its own; that of the
        bodies it touches, or their digits are lost [force/length].
    backend : Backend, optional
        What factorises it; the multifrontal method of this process if there is none.
    modes : ndarray, shape (n, k), optional
        Motions that K may leave free; the rigid ones if not given.

    Attributes
    ----------
    columns, kept : ndarray of int
        Contact DOFs and anchors, sorted.
    anchors : ndarray of int
        DOFs that stop the rigid motions of a body which its supports do not hold.
    S : ndarray, shape (n_c, n_c)
    """

    keeps_contact = True  # or contact DOFs are eliminated like all others
    definite = True  # but the tangent of a body that is not linear may be none of a stable state
    shaky = False  # and neither is what is condensed of it
    _last: tuple[Array, Array, Array] | None = None  # a load like no other, and what it is when reduced

    def __init__(
        self,
        body: Member,
        K: csr_matrix,
        wanted: Index,
        firm: float = 0.0,
        backend: Backend | None = None,
        modes: Array | None = None,
    ) -> None:
        self.body, self.K, self._firm = body, K, firm
        self._backend: Any = backend or Direct()
        self.modes = body.rigid_modes if modes is None else modes
        self.free = np.delete(np.arange(body.n), body.D)
        self.anchors = wanted
        if len(wanted):
            self.anchors = anchors(body, wanted, self.modes) if isinstance(body, Body) else self.free
        self.columns = np.union1d(wanted, self.anchors)
        self.kept = self.columns if self.keeps_contact else self.anchors
        self._spanned = isinstance(body, Body) and len(self.kept) > 0  # loads are remembered
        self._spans = self._new_spans()

    @once
    def _K_D(self) -> csr_matrix:
        # K is symmetric: a few rows are found at once, a few columns only by going over all of K
        return csr_matrix(self.K[self.body.D])

    def _by_supports(self, x: Array) -> Array:
        """The load (n_f,) that prescribed displacements of the supports are."""
        return -(self._K_D.T @ x)[self.free]

    @once
    def _factor(self) -> BodyFactor:
        return self._factorised()

    def _new_spans(self) -> tuple[LoadSpan, LoadSpan]:
        """What is remembered of forces, and of prescribed displacements."""
        sizes = self.body.n, len(self.free), len(self.kept)
        return LoadSpan(self.free, *sizes), LoadSpan(self.body.D, *sizes)

    def _factorised(self) -> BodyFactor:
        place = np.searchsorted(self.free, self.kept)
        try:
            return self._backend.condensed(self.body, self.K, self.free, place)
        except SingularMatrix as error:
            if self.body.nonlinear:  # on the way of Newton's method, or of a body that buckles
                self.shaky = True
                K = csr_matrix(self.K[self.free][:, self.free])
                return IndefiniteFactor(K, self.body.dof_points[self.free], place)
            raise InputError(
                f"The stiffness of body '{self.body.name or 'unnamed'}' is not positive definite "
                f"({error}). Usually a material parameter is negative or zero, nodes belong to no "
                "element, or K is not that of an elastic body."
            ) from None

    def factor_size(self, kept: Index) -> FactorSize:
        """Size of the factorisation that keeps some of the contact DOFs, before it is computed."""
        place = np.searchsorted(self.free, kept)
        return factor_size(self.K, self.body.dof_points[self.free], place, free=self.free)

    @property
    def S(self) -> Array:
        """The condensed stiffness, in the order of `kept`; computed again once it was inverted."""
        S = self._factor.S if len(self.kept) else np.zeros((0, 0))
        return S if S.size == len(self.kept) ** 2 else self._factorised().S

    @cached_property
    def springs(self) -> Array:
        """Stiffness of springs to the ground on the anchors, (k,) [force/length]."""
        if not len(self.anchors):
            return np.zeros(0)
        return np.maximum(np.diag(self.S)[np.searchsorted(self.kept, self.anchors)], self._firm)

    @once
    def flexibility(self) -> Array:
        """Inverse of S with springs, shape (n_c, n_c) [length/force]; takes the place of a large S."""
        if len(self.kept) == 0:
            return np.zeros((0, 0))
        S, self._factor.S = self._factor.S, np.zeros((0, 0))  # which the factors do not need
        if not S.size:  # asked for before, in vain
            S = self.S.copy()
        at = np.searchsorted(self.kept, self.anchors)
        S[at, at] += self.springs
        try:
            return definite_inverse(S)
        except LinAlgError:
            self.definite, self.shaky = False, True
        S = self.S.copy()  # what Cholesky began with is lost
        S[at, at] += self.springs
        factors = lu(S)
        if not factors.even(ROUND_OFF):
            raise SingularMatrix("a body that is not stable moves without resistance")
        return factors.solve(np.eye(len(S)))

    @property
    def memory(self) -> int:
        """Bytes of the factors."""
        return int(self._factor.memory)

    def unloaded(self) -> Substructure:
        """The same body, condensed once, without what is remembered of its loads."""
        twin = copy(self)
        twin._spans = self._new_spans()
        return twin

    @property
    def order(self) -> Index:
        """The DOFs in the order in which `recover` returns them: all but the prescribed ones."""
        return np.asarray(self.free[self._factor.order])

    def components(self, f: Array, x: Array) -> Components | None:
        """Components of forces and of prescribed displacements along the directions known so far.

        Of a body without part in the contact problem, for which nothing is factorised yet, there are
        none; of a rigid one its load itself, as nothing of it is eliminated. None where there are too
        many directions.
        """
        if not self._spanned:
            return self.free_load(f, x) if len(self.kept) else np.zeros(0), np.zeros(0)
        forces, moves = self._spans
        force = forces.components(f, lambda acting: self._factor.eliminate(acting))
        move = moves.components(x, lambda x_D: self._factor.eliminate(self._by_supports(x_D)))
        return None if force is None or move is None else (force, move)

    def along(self, components: Components | None) -> Array:
        """Loads on the kept DOFs with one component, (n_c, k): those of forces, then those of moves.

        Of the directions that `components` are along.
        """
        if components is None:
            return np.zeros((len(self.kept), 0))
        if not self._spanned:
            return np.eye(len(self.kept))
        spans = zip(self._spans, components, strict=True)
        return np.concatenate([span.along(len(c)) for span, c in spans], axis=1)

    def other_load(self, f: Array, x: Array) -> Array:
        """Load on the kept DOFs, those of the interior and of prescribed DOFs included, (n_c,).

        Nothing of it is remembered.
        """
        if not (len(self.kept) and (f.any() or x.any())):
            return np.zeros(len(self.kept))
        return np.asarray(self._factor.reduce_load(self.free_load(f, x)))

    def changed_load(self, f: Array, x: Array) -> Array:
        """The same; the last load is remembered, as it may stay while those of other bodies change."""
        last = self._last
        if last is None or not (same(f, last[0]) and same(x, last[1])):
            last = self._last = f.copy(), x.copy(), self.other_load(f, x)
        return last[2]

    def recover(
        self,
        force: Array,
        components: Sequence[Components | None],
        loads: Sequence[tuple[Array, Array]],
    ) -> Array:
        """Displacements of the DOFs `order` (n_f, r) under forces on the contact DOFs and loads.

        Parameters
        ----------
        force : ndarray, shape (n_c, r)
            Those of loads included.
        components : sequence of pairs or None
            From `components`.
        loads : sequence of (f, x)
        """
        # forces and moves at once: BLAS is slow with a single direction, as most histories have of each
        forces, others = (span.eliminated for span in self._spans)
        along, moves = np.concatenate([forces, others], axis=1), forces.shape[1]
        C, known = np.zeros((along.shape[1], len(components))), components if self._spanned else ()
        for column, c in zip(C.T, known, strict=False):
            if c:  # steps may know fewer directions than later ones
                column[: len(c[0])] = c[0]
                column[moves : moves + len(c[1])] = c[1]
        x = along @ C
        for k, load in enumerate(loads):
            if not (known and known[k]):
                x[:, k] = self._factor.eliminate(self.free_load(*load))[:, 0]
        return self._factor.substitute(self.flexibility @ force, x)

    def free_load(self, f: Array, x: Array) -> Array:
        """Load on the free DOFs, that of prescribed displacements included, (n_f,)."""
        return f[self.free] + self._by_supports(x[self.body.D])


def anchors(body: Body, wanted: Index, modes: Array) -> Index:
    """Free DOFs of a few nodes away from contact that stop the motions which supports leave free.

    A few nodes for each part of the mesh that prescribed DOFs do not hold: springs on them make
    the condensed stiffness definite, and as further kept DOFs they do the same for the interior.
    """
    R, chosen = modes / largest(modes), np.zeros(0, dtype=int)
    points, node, touched = np.zeros((0, body.dim)), chosen, np.zeros(0, dtype=bool)
    for part in np.unique(body.parts[wanted]):
        mine = body.parts == part
        modes = R[:, [np.any(mode[mine]) for mode in R.T]]
        if _held_by(body.D[mine[body.D]], modes):
            continue
        if not len(node):
            points = body.dof_points
            node, _ = nodes_of(points)
            # of a node that contact touches too: rows of two anchors would make that of a gap
            touched = np.isin(node, node[wanted])
            touched[body.D] = True
        seeds = points[wanted[body.parts[wanted] == part]][:1]
        for count in range(2 * body.dim):
            held = np.union1d(body.D[mine[body.D]], chosen[mine[chosen]])
            if _held_by(held, modes):
                break
            if count < body.dim:
                distance = np.min(sizes(points - seeds[:, None]), axis=0)
                distance = distance / distance.max() + (mine & ~touched)
            else:  # those lie nearly on a line: what moves most in the motion that is held least
                _, motions = np.linalg.eigh(modes[held].T @ modes[held])
                distance = np.abs(modes @ motions[:, 0])
                distance[body.D] = -1.0
            distance[~mine] = -1.0
            distance[chosen] = -1.0
            found = np.argmax(distance)
            here = np.setdiff1d(np.flatnonzero(mine & (node == node[found])), body.D)
            chosen = np.union1d(chosen, here)
            seeds = np.concatenate([seeds, points[[found]]])
    return chosen


def _held_by(dofs: Index, modes: Array) -> bool:
    """Return whether no combination of modes (n, k) leaves these DOFs where they are, or nearly."""
    values = np.linalg.svd(modes[dofs], compute_uv=False)
    return len(values) == modes.shape[1] and values[-1] > HELD_FIRMLY * values[0]
