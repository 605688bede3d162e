r"""Contact problems on the forces of points: what those iterated through factors and multigrid share.

With the gaps and slips ``z0`` and the extensions ``q0`` of the springs on the anchors (`condensed`)
that the loads alone cause, and the compliance W of all these rows,

    z = z0 + W_zz p + W_zq q,      q = q0 + W_qz p + W_qq q;

p is zero on the rows of open points, and what contact asks of the others is below. With springs in
series with the points (`points`) it is ``W_zz + C^-1``, and the layers that precondition are as much
softer as the springs make each row.

Of the gaps and slips z a closed point knows its gap, a sticking one its slip, and of a slipping one it
is known that ``-p_t = offset + K (slip0 + z_t - anchor) + coupling p_n``. That times ``(K + r)^-1``, r
being the point's own stiffness, is

    ``P z_t + (1 - P) (p_t + coupling p_n) / r = known``     with     ``P = K (K + r)^-1``:

all between free slip, ``P = 0``, and sticking, ``P = 1``, in one scale.

A stiffness of the points that is cheap preconditions the iterated contact problem (`Layers`).
Forces on points move them by ``G F G'``; the inverse of that is a stiffness ``S`` of the bodies'
surfaces. It is well approximated by that of a layer of few elements under each surface, the rest of
the body held (`S_b`), and by sharing what two surfaces move against each other out to both, the
softer moving more (D: diagonal of K),

    S = Q^-1 (sum over bodies of G D^-1 S_b D^-1 G') Q^-1,     Q = G D^-1 G',

the preconditioner of dual domain decomposition [1]_ for a layer in place of a body: with four elements
it takes 20 iterations where the whole body takes 13 and the surface's own entries of K take 45 (1089
points that all touch).

References
----------
.. [1] A. Klawonn and O. B. Widlund, FETI and Neumann-Neumann iterative substructuring methods,
   Communications on Pure and Applied Mathematics 54 (2001) 57-90.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from functools import cached_property
from typing import Any

import numpy as np
from scipy.linalg import block_diag
from scipy.sparse import csr_matrix, diags
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import splu

from skfem_contact.arrays import Array, Index
from skfem_contact.bodies.body import Body
from skfem_contact.digits import SOLVED
from skfem_contact.errors import SingularMatrix
from skfem_contact.linalg.dense_factors import lu
from skfem_contact.linalg.krylov import Iterated, divided, gmres
from skfem_contact.linalg.multifrontal import MultifrontalCholesky, SurfaceResponse
from skfem_contact.problem.full import DependentRows
from skfem_contact.problem.points import Conditions, Load, Resistance, Response, friction_force
from skfem_contact.problem.seam import OnContactDofs, PosedOn, independent, point_resistance
from skfem_contact.records import dataclass

# Couplings of K from the surface to the bottom of its layer: elements, in effect.
LAYERS = 4


# What an answer on the way may leave of the residual: points change by more than a hundredth from one
# of Newton's iterations to the next, and what is left is taken up there. An increment takes half as
# long as with all digits in all iterations; with a third of it, or three times, as long as with this.
ROUGHLY = 1e-2


class Layer:
    """The layer of a body under its contact DOFs.

    Parameters
    ----------
    part : WholeBody
    """

    def __init__(self, part: Any) -> None:
        K, columns = part.K, part.columns
        inside = np.zeros(K.shape[0])
        inside[columns] = 1.0
        for _ in range(LAYERS):
            inside = (abs(K) @ inside > 0).astype(float)
        inside[part.body.D] = inside[columns] = 0.0
        layer = np.flatnonzero(inside)
        # springs on anchors count where these touch: without them the layer would follow a rigid motion
        springs = np.zeros(len(columns))
        springs[np.searchsorted(columns, part.anchors)] = part.springs
        self._K_cc = csr_matrix(K[columns][:, columns] + diags(springs))
        self._K_cl = csr_matrix(K[columns][:, layer])
        K_ll = csr_matrix(K[layer][:, layer])
        factor = MultifrontalCholesky(K_ll, part.body.dof_points[layer])
        near = np.unique(self._K_cl.indices)
        self._K_cl = self._K_cl[:, near]
        self._inverse = SurfaceResponse(factor, near, single=True)

    def stiffness(self, u: Array) -> Array:
        """Forces on the contact DOFs that hold them at displacements, (n_c,) -> (n_c,)."""
        return np.asarray(self._K_cc @ u - self._K_cl @ self._inverse(self._K_cl.T @ u))


class Layers:
    """The layers of all bodies, and the rows of the points over them.

    Parameters
    ----------
    bodies : IteratedBodies
    """

    def __init__(self, bodies: Any) -> None:
        parts = zip(bodies.substructures, bodies.column_spans, strict=True)
        # rigid bodies have no layer: what moves are the others
        self._layers = [
            (part.layer, span)
            for part, span in parts
            if isinstance(part.body, Body) and len(part.columns)
        ]
        self._softness = bodies.softness

    def stiffness(self, G: csr_matrix) -> Callable[[Array], Array]:
        """Forces on some rows (r, n_c) that hold them at gaps and slips, (r,) -> (r,)."""
        shared = csr_matrix(G @ diags(self._softness))
        Q = csr_matrix(shared @ G.T)
        # as LU of a symmetric matrix: half the time of the order that knows nothing of it
        order = {"permc_spec": "MMD_AT_PLUS_A", "options": {"SymmetricMode": True}}
        solve = splu(Q.tocsc(), diag_pivot_thresh=0.0, **order).solve

        def force(z: Array) -> Array:
            u = shared.T @ solve(z)
            held = np.zeros(len(u))
            for layer, span in self._layers:
                held[span] = layer.stiffness(u[span])
            return np.asarray(solve(shared @ held))

        return force


@dataclass(frozen=True, eq=False)
class Held:
    """The rows on which contact acts under some conditions; s points of them have slips.

    Attributes
    ----------
    rows : ndarray of int, shape (h,)
        Normal rows of closed points, then tangential ones.
    known : ndarray, shape (h,)
        What the equations are to give [length].
    sticks : ndarray, shape (s, t, t)
        P of each point.
    stiffness : ndarray, shape (s, 1)
        Its own stiffness r [force/length].
    coupling : ndarray, shape (s, t)
    place : ndarray of int, shape (s, t)
        Its tangential rows among the h, or h where a row does not exist.
    normal : ndarray of int, shape (s,)
        Its normal row among the h, or h.
    """

    rows: Index
    known: Array
    sticks: Array
    stiffness: Array
    coupling: Array
    place: Index
    normal: Index

    @classmethod
    def under(
        cls, conditions: Conditions, load: Load, normal_rows: Index, tangential_rows: Index, own: Array
    ) -> Held:
        """The rows held by some conditions.

        Parameters
        ----------
        conditions : Conditions
        load : Load
        normal_rows, tangential_rows : ndarray of int, shapes (m,) and (m, t)
            Rows of the points among all q; -1 where there is none.
        own : ndarray, shape (q,)
            Stiffness of each row [force/length].
        """
        closed = np.flatnonzero(conditions.closed)
        touching = closed[normal_rows[closed] >= 0]
        exists = tangential_rows[closed] >= 0
        closed, exists = closed[exists.any(axis=1)], exists[exists.any(axis=1)]
        on, stick = tangential_rows[closed], conditions.stick[closed][:, None]
        rows = np.concatenate([normal_rows[touching], on[exists]])
        where = np.full(len(own) + 1, len(rows))
        where[rows] = np.arange(len(rows))

        beyond, spring = (load.slip0 - conditions.anchor)[closed], conditions.spring[closed]
        r = np.max(np.append(own, 0.0)[on], axis=1, initial=0.0)[:, None]
        K = np.where(exists[:, :, None] & exists[:, None, :] & ~stick[:, None], spring, 0.0)
        soft = np.linalg.inv(K + r[:, None] * np.eye(on.shape[1]))
        asked = np.where(
            exists, conditions.offset[closed] + np.einsum("ikl,il->ik", spring, beyond), 0.0
        )
        slides = -np.einsum("ikl,il->ik", soft, asked)
        known = np.where(stick, -beyond, slides)
        return cls(
            rows=rows,
            known=np.concatenate([-load.gap0[touching], known[exists]]),
            sticks=np.where(stick[:, None], np.eye(on.shape[1]) * exists[:, None], K @ soft),
            stiffness=r,
            coupling=np.where(exists & ~stick, conditions.coupling[closed], 0.0),
            place=np.where(exists, where[on], len(rows)),
            normal=where[normal_rows[closed]],
        )

    def equations(self, z: Array, p: Array) -> Array:
        """The left-hand sides: gaps, and of slips their mixture with forces, (h,) [length]."""
        out, z, p = np.append(z, 0.0), np.append(z, 0.0), np.append(p, 0.0)
        free = (p[self.place] + self.coupling * p[self.normal][:, None]) / self.stiffness
        out[self.place] = _times(self.sticks, z[self.place] - free) + free
        return out[:-1]

    def solved(self, known: Array, stiffness: Callable[[Array], Array]) -> Array:
        """Forces (h,) that about fulfil the equations, from a stiffness of all rows."""
        known = np.append(known, 0.0)
        slips = known[self.place]
        given = known.copy()
        given[self.place] = _times(self.sticks, slips)
        p = np.append(stiffness(given[:-1]), 0.0)
        free = self.stiffness * slips - self.coupling * p[self.normal][:, None]
        p[self.place] = _times(self.sticks, p[self.place] - free) + free
        return p[:-1]


def _times(A: Array, x: Array) -> Array:
    return np.asarray(np.einsum("ikl,il->ik", A, x))


class OnForces(OnContactDofs):
    """A contact problem on forces, its equations solved by GMRES.

    Attributes
    ----------
    own : ndarray, shape (q,)
        Stiffness of each row by itself, by the diagonal of K [force/length].
    bare : ndarray, shape (q,)
        The same without springs in series.
    FP : ndarray, shape (n_c, k)
        What the springs on the anchors do to the contact DOFs.
    iterations : list of int
        That every solve has taken so far.

    Raises
    ------
    DependentRows
    """

    equations: type[HeldForces]

    def __init__(self, bodies: Any, on: PosedOn) -> None:
        super().__init__(bodies, on)
        self.layers = Layers(bodies)
        if not independent(self.G, bodies.softness):  # as slips are that only rigid bodies make
            raise DependentRows  # they are solved with all DOFs
        self.own = self.bare = 1.0 / (self.G.multiply(self.G) @ bodies.softness)
        self._share = np.ones(self.q)
        self.FP = block_diag(*(part.by_springs for part in bodies.substructures))
        self.iterations: list[int] = []

    @cached_property
    def resistance(self) -> Resistance:
        """Return what each point resists by itself, by the diagonal of K."""
        return point_resistance(self.rows, self.slips, self.bodies.softness)

    def _give_way(self, normal: Array, tangential: Array) -> None:
        self.give = self.on_rows(normal, tangential)
        self._share = 1.0 / (1.0 + self.bare * self.give)
        self.own = self.bare * self._share
        self._begin_anew()

    def _begin_anew(self) -> None:
        super()._begin_anew()
        self._stiffness: tuple[Index, Callable[[Array], Array]] | None = None
        self._last: tuple[Any, Any] = None, None  # load and answer of the iteration before

    def stiffness(self, rows: Index) -> Callable[[Array], Array]:
        """Forces on some of the rows that hold them at gaps and slips, nearly.

        That of the rows of the last time is kept: what sticks or slips are the same rows.
        """
        if self._stiffness is None or not np.array_equal(self._stiffness[0], rows):
            bare, share = self.layers.stiffness(csr_matrix(self.G[rows])), np.sqrt(self._share[rows])
            self._stiffness = rows, lambda z: share * bare(share * z)
        return self._stiffness[1]

    def solve(self, conditions: Conditions, load: Load) -> Response:
        """Gaps, slips and forces under these conditions, from those of the iteration before."""
        assert load.moved is not None
        begin = self._last[1] if self._last[0] is load else None
        system = self.equations(self, conditions, load)
        u, p, q = system.found(begin)
        self._last = load, (u, p, q)
        z = load.moved[: self.q] + self.G @ u[self.bodies.place] + self.give * p
        return self.response(conditions, load, z, p, self.solution(u, p, q), system.rough)

    def solution(self, u: Array, p: Array, q: Array) -> Array:
        """Return what the displacements of the bodies follow from."""
        raise NotImplementedError

    def response(
        self, conditions: Conditions, load: Load, z: Array, p: Array, solution: Array, rough: bool
    ) -> Response:
        """Gaps, slips and forces of all points from those of the rows, (r,).

        Equations are fulfilled to their tolerance, which a spring that is stiffer than its point would
        magnify in the force, and a softer one in the slip. Both take a part of what is missing of the
        law, as in `Held`, so that it is fulfilled to the last digit.
        """
        # a row of -1, one that can not change, finds the zero at the end
        z, p, own = np.append(z, 0.0), np.append(p, 0.0), np.append(self.own, 0.0)
        exists = self.tangential_rows >= 0
        closed, sticks = conditions.closed & (self.normal_rows >= 0), conditions.stick[:, None] & exists
        gap, slip = load.gap0 + z[self.normal_rows], load.slip0 + z[self.tangential_rows]
        gap[closed], slip[sticks] = 0.0, conditions.anchor[sticks]
        normal_force = np.where(closed, p[self.normal_rows], 0.0)
        tangential = np.where(conditions.closed[:, None] & exists, -p[self.tangential_rows], 0.0)
        rubs = (conditions.closed & ~conditions.stick)[:, None]
        lawful = friction_force(conditions, slip - conditions.anchor, normal_force)
        missing = np.where(rubs & exists, tangential - lawful, 0.0)
        at = np.flatnonzero(missing.any(axis=1))
        r, gives = np.max(own[self.tangential_rows[at]], axis=1, initial=0.0)[:, None], exists[at]
        K = np.where(gives[:, :, None] & gives[:, None, :], conditions.spring[at], 0.0)
        moved = np.linalg.solve(K + r[:, None] * np.eye(gives.shape[1]), missing[at, :, None])[:, :, 0]
        slip[at] += moved
        tangential[at] -= r * moved
        if not exists.all():
            # along a tangent whose slip supports prescribe there is only the law to ask
            lawful = friction_force(conditions, slip - conditions.anchor, normal_force)
            tangential = np.where(rubs & ~exists, lawful, tangential)
        return Response(gap, slip, normal_force, tangential, solution, rough)


class HeldForces(ABC):
    """The equations of held rows, and forces that about fulfil them, the springs on anchors included.

    Unknowns and residuals have one unit, the root of an energy.

    Parameters
    ----------
    problem : OnForces
    conditions : Conditions
    load : Load

    Attributes
    ----------
    held : Held
    rough : bool
        Whether the equations need not be fulfilled, and then, whether they are not.
    scale : ndarray, shape (h,)
        Roots of the rows' own stiffness: forces divided by it and gaps times it have one unit.
    size : ndarray
        The same of the displacements that are unknowns.
    label : ndarray of int
        A number for each body, the same of those that the rows couple.
    part : ndarray of int
        That of the body of each unknown.

    Raises
    ------
    SingularMatrix
        The rows do not hold the bodies.
    """

    size = np.zeros(0)

    def __init__(self, problem: OnForces, conditions: Conditions, load: Load) -> None:
        rows = problem.normal_rows, problem.tangential_rows
        self.held = held = Held.under(conditions, load, *rows, problem.own)
        self.problem, self.bodies, self.load = problem, problem.bodies, load
        self.P, self.rough = problem.bodies.P, conditions.rough
        self.scale, self.give = np.sqrt(problem.own[held.rows]), problem.give[held.rows]
        self.G = csr_matrix(problem.G[held.rows])
        self._stiffness = problem.stiffness(held.rows)
        # with forces nearly eliminated, the springs on the anchors are left, a small dense problem
        self._back = problem.FP.T @ self.G.T
        ahead = [held.equations(column, np.zeros(len(held.rows))) for column in self._back]
        self._forces = np.array([held.solved(column, self._stiffness) for column in ahead])
        k = len(self._back)
        left = self.P.T @ problem.FP - np.eye(k)
        self._rigid = lu(left - self._back @ self._forces.T if k else left)
        if not self._rigid.even(SOLVED):
            raise SingularMatrix("the points that are closed do not hold the bodies")
        spans = self.bodies.column_spans
        owner = np.repeat(np.arange(len(spans)), [span.stop - span.start for span in spans])
        shape = self.G.shape[0], len(spans)
        touch = csr_matrix((np.ones(self.G.nnz), owner[self.G.indices], self.G.indptr), shape)
        self.label = connected_components(touch.T @ touch, directed=False)[1]
        of_rows, of_springs = touch.indices[touch.indptr[:-1]], owner[self.P.tocsc().indices]
        self.part = self.label[np.concatenate([of_rows, of_springs])]

    @abstractmethod
    def found(self, begin: tuple[Array, Array, Array] | None) -> tuple[Array, Array, Array]:
        """Displacements, forces on all rows and extensions, from such to begin with."""

    @abstractmethod
    def _product(self, x: Array) -> Array:
        """The left-hand sides for some unknowns."""

    @abstractmethod
    def _precondition(self, r: Array) -> Array:
        """Unknowns for some left-hand sides, about."""

    def parts(self, x: Array) -> tuple[Array, Array, Array]:
        """Displacements, forces on held rows and extensions, from all in one unit."""
        u, p, q = np.split(x, np.cumsum([len(self.size), len(self.scale)]))
        return u / self.size, p * self.scale, q

    def joined(self, u: Array, p: Array, q: Array) -> Array:
        """`parts` backwards."""
        return np.concatenate([u * self.size, p / self.scale, q])

    def iterated(
        self,
        b: Array,
        sizes: Array,
        begin: tuple[Array, Array, Array] | None,
        tolerance: float,
        most: int,
    ) -> Iterated:
        """Unknowns over sizes of their parts by GMRES, from some to begin with; counted."""
        x = np.zeros(len(b))
        if begin is not None:
            x = self.joined(begin[0][: len(self.size)], begin[1][self.held.rows], begin[2])
        b, x = divided(b, sizes), divided(x, sizes)
        given = self._product, b, self._precondition, x, tolerance, most
        found = gmres(*given, roughly=ROUGHLY if self.rough else 0.0)
        self.problem.iterations.append(found.iterations)
        self.rough = self.rough and found.enough and found.residual > tolerance
        return found

    def on_all(self, p: Array) -> Array:
        """Forces on held rows as such on all rows."""
        out = np.zeros(self.problem.q)
        out[self.held.rows] = p
        return out

    def solved(self, known: Array, extensions: Array) -> tuple[Array, Array]:
        """Forces (h,) and extensions (k,) for right-hand sides of both."""
        p, q = self.held.solved(known, self._stiffness), extensions
        if len(q):
            q = self._rigid.solve(extensions - self._back @ p)
            p = p - self._forces.T @ q
        return p, q
