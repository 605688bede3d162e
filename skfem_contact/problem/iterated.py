r"""The contact problem of surfaces with too many points for dense matrices: forces, iterated.

The unknowns are the forces p on the rows of closed points, and the extensions q of the springs on the
anchors (`condensed`). With the gaps and slips ``z0`` and the extensions ``q0`` that the loads alone
cause, and the compliance W of all these rows,

    z = z0 + W_zz p + W_zq q,      q = q0 + W_qz p + W_qq q;

what contact asks of z is in `held`. GMRES finds the forces. Each of its iterations takes a product with
``W = [B; P'] F [B; P']'``, which is a substitution through the factors of the bodies (`whole`); it is
preconditioned by the stiffness of a layer under the surfaces (`layer`).
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix

from skfem_contact.conditions.loads import LoadCase
from skfem_contact.linalg.dense_factors import lu
from skfem_contact.linalg.direct import Direct
from skfem_contact.linalg.krylov import gmres
from skfem_contact.linalg.singular import SingularMatrix
from skfem_contact.problem.condensed import CondensedProblem
from skfem_contact.problem.full import FullProblem, FullSystem
from skfem_contact.problem.held import Held
from skfem_contact.problem.layer import Layers
from skfem_contact.problem.resistance import point_resistance
from skfem_contact.problem.response import (
    Conditions,
    Load,
    Resistance,
    Response,
    Source,
    friction_force,
)
from skfem_contact.problem.seam import ContactProblem, PosedOn
from skfem_contact.problem.thresholds import ITERATED, MOST_PRODUCTS, STAGNANT, STIFFER, UNHELD
from skfem_contact.problem.whole import Whole

Array = NDArray[np.float64]
logger = logging.getLogger("skfem_contact")


class IteratedBodies(Whole):
    """Bodies by their factors, and the contact problem put upon them."""

    def attach(self, on: PosedOn, prefer: NDArray[np.bool_], labels: Sequence[str]) -> ContactProblem:
        """The contact problem on one pairing."""
        try:
            return IteratedProblem(self, on)
        except DependentRows:  # a corner, a chain
            logger.info("contact rows depend on each other: solved with all DOFs")
            full = FullSystem(self.system, self.stiffness, Direct())
            return FullProblem(full, on, prefer, labels)


class DependentRows(Exception):
    """Contact rows depend on each other: their forces are not unique."""


class IteratedProblem(CondensedProblem[IteratedBodies]):
    """The contact problem on forces, by GMRES.

    Attributes
    ----------
    products : list of int
        Products with W that every solve has taken so far.

    Raises
    ------
    DependentRows
    """

    points = None

    def __init__(self, bodies: IteratedBodies, on: PosedOn) -> None:
        super().__init__(bodies, on)
        self.G, self.normal_rows, self.tangential_rows = self.changing_rows(on)
        self.layers = Layers(bodies)
        if not self.layers.independent(self.G, self._positions()):
            raise DependentRows
        self.own = 1.0 / self.layers.compliance(self.G)
        # of what the springs on the anchors do, a few columns
        columns = [bodies.flexibility(column) for column in bodies.P.T]
        self.FP = np.column_stack(columns) if columns else bodies.P
        self.products: list[int] = []
        self._last: tuple[Load, Array, Array] | None = None  # of the iteration before, under one load

    @cached_property
    def resistance(self) -> Resistance:
        """What each point resists by itself, by the diagonal of K."""
        return point_resistance(
            self.rows, self.slips, lambda rows: STIFFER * self.layers.flexibility(rows)
        )

    def in_series(self, C: Resistance) -> ForcesInSeries:
        """The same problem with springs of the stiffness C in series with its points."""
        return ForcesInSeries(self, C)

    def stiffness(self, rows: NDArray[np.intp]) -> Callable[[Array], Array]:
        """Forces on some of the rows that hold them at gaps and slips, nearly."""
        return self.layers.stiffness(csr_matrix(self.G[rows]))

    def _positions(self) -> Array:
        """Where the point of each row is, (q, d)."""
        points = np.zeros((self.G.shape[0], self.kin.points.shape[1]))
        for rows in (self.normal_rows[:, None], self.tangential_rows):
            point, column = np.nonzero(rows >= 0)
            points[rows[point, column]] = self.kin.points[point]
        return points

    def moved(self, p: Array, q: Array) -> tuple[Array, Array]:
        """Gaps and slips, and extensions of the springs, by forces on all rows and on the springs."""
        force = self.G.T @ p + self.bodies.P @ q
        u = self.bodies.flexibility(force)
        return self.G @ u, self.bodies.P.T @ u

    def load(self, case: LoadCase) -> Load:
        """A load case: what gaps, slips and anchors do where contact carries nothing."""
        u = self.bodies.load(case)
        moved = np.append(self.G @ u, self.bodies.P.T @ u)
        return Load(np.zeros(0), *self.constant(case), np.zeros(0), (), moved)

    def solve(self, conditions: Conditions, load: Load) -> Response:
        """Gaps, slips and forces under these conditions."""
        assert load.moved is not None
        z0, q0 = np.split(load.moved, [len(self.own)])
        held = Held.under(conditions, load, self.normal_rows, self.tangential_rows, self.own)
        begin = np.zeros(len(z0)), np.zeros(len(q0))
        if self._last is not None and self._last[0] is load:
            begin = self._last[1:]
        p, q = HeldSystem(self, held).solve(z0, q0, *begin)
        self._last = load, p, q
        z = z0 + self.moved(p, q)[0]
        # a row of -1, one that can not change, finds the zero at the end
        z, p = np.append(z, 0.0), np.append(p, 0.0)
        closed, slides = (
            conditions.closed & (self.normal_rows >= 0),
            conditions.closed & ~conditions.stick,
        )
        exists = self.tangential_rows >= 0
        gap, slip = load.gap0 + z[self.normal_rows], load.slip0 + z[self.tangential_rows]
        sticks = conditions.stick[:, None] & exists
        gap[closed], slip[sticks] = 0.0, conditions.anchor[sticks]
        normal_force = np.where(closed, p[self.normal_rows], 0.0)
        found = np.where(conditions.closed[:, None] & exists, -p[self.tangential_rows], 0.0)
        # by the law itself to the last digit; but a stiff spring would magnify the round-off of slips
        lawful = friction_force(conditions, slip, normal_force)
        rigid = slides & ~conditions.spring.any(axis=(1, 2))
        tangential = np.where(rigid[:, None] & exists, lawful, found)
        return Response(gap, slip, normal_force, tangential, np.append(p[:-1], q))

    def source(self, load: Load, response: Response) -> Source:
        """Forces on the contact DOFs: contact, and the springs on the anchors."""
        q = response.solution[len(self.own) :]
        force = self.rows.B_n.T @ response.normal_force + self.bodies.P @ q
        if self.slips:
            force -= self.rows.B_t.T @ response.tangential_force.ravel()
        return Source(force, forces=True)


class ForcesInSeries(IteratedProblem):
    """The contact problem on forces with springs in series with its points, see `series`.

    ``W + C^-1`` in place of W; the layers are as much softer as the springs make each row.
    """

    def __init__(self, problem: IteratedProblem, C: Resistance) -> None:
        vars(self).update(vars(problem))
        self._last = None
        self._give = np.zeros(len(problem.own))
        for rows, stiff in ((self.normal_rows, C.normal), (self.tangential_rows.T, C.tangential)):
            exists = rows >= 0
            self._give[rows[exists]] = 1.0 / np.broadcast_to(stiff, rows.shape)[exists]
        self._share = 1.0 / (1.0 + problem.own * self._give)
        self.own = problem.own * self._share

    def moved(self, p: Array, q: Array) -> tuple[Array, Array]:
        """Gaps and slips as they are seen, and extensions of the springs on the anchors."""
        z, stretched = super().moved(p, q)
        return z + self._give * p, stretched

    def stiffness(self, rows: NDArray[np.intp]) -> Callable[[Array], Array]:
        """Forces on some of the rows that hold them at gaps and slips, nearly."""
        bare, share = super().stiffness(rows), np.sqrt(self._share[rows])
        return lambda z: share * bare(share * z)

    def at_forces(self, load: Load, normal_force: Array, tangential_force: Array) -> Load:
        """The load with the forces at which the springs have no strain."""
        assert load.moved is not None
        p = np.zeros(len(self.own) + 1)
        p[self.normal_rows], p[self.tangential_rows] = normal_force, -tangential_force
        moved = load.moved.copy()
        moved[: len(self.own)] -= self._give * p[:-1]
        return replace(load, moved=moved)


class HeldSystem:
    """The equations of held rows in one unit for all unknowns and residuals, the root of an energy.

    Parameters
    ----------
    problem : IteratedProblem
    held : Held

    Raises
    ------
    SingularMatrix
        The rows do not hold the bodies.
    """

    def __init__(self, problem: IteratedProblem, held: Held) -> None:
        self.problem, self.held = problem, held
        self.scale = np.sqrt(problem.own[held.rows])
        G = csr_matrix(problem.G[held.rows])
        self._stiffness = problem.stiffness(held.rows)
        # with forces nearly eliminated, the springs on the anchors are left, a small dense problem
        self._back = problem.FP.T @ G.T
        ahead = [held.equations(column, np.zeros(len(held.rows))) for column in self._back]
        self._forces = np.array([held.solved(column, self._stiffness) for column in ahead])
        k = len(self._back)
        left = problem.bodies.P.T @ problem.FP - np.eye(k)
        self._rigid = lu(left - self._back @ self._forces.T if k else left)
        if not self._rigid.even(UNHELD):
            raise SingularMatrix("the points that are closed do not hold the bodies")

    def solve(self, z0: Array, q0: Array, p: Array, q: Array) -> tuple[Array, Array]:
        """Forces on all rows and extensions of the springs.

        Parameters
        ----------
        z0, q0 : ndarray
            Gaps, slips and extensions where contact carries nothing [length].
        p, q : ndarray
            To begin with.

        Raises
        ------
        SingularMatrix
            The equations have no answer, or hardly.
        """
        rows, known = self.held.rows, self.held.known
        by_loads = self.held.equations(z0[rows], np.zeros(len(rows)))
        b = np.append(self.scale * (known - by_loads), -q0)
        parts = np.concatenate([self.scale * known, self.scale * by_loads, q0])
        size = float(np.linalg.norm(parts))
        begin = np.append(p[rows] / self.scale, q)
        found = gmres(self._product, b, self._precondition, begin, ITERATED * size, MOST_PRODUCTS)
        self.problem.products.append(found.iterations)
        logger.debug("contact forces: %d products, residual %.1e", found.iterations, found.residual)
        if not found.residual <= STAGNANT * size:
            raise SingularMatrix(
                f"the contact forces could not be found: {found.residual / size:.1e} of the motion by "
                f"loads is left after {found.iterations} products. Usually the points that are closed "
                "hardly hold the bodies"
            )
        return self._forces_of(found.x)

    def _forces_of(self, x: Array) -> tuple[Array, Array]:
        p = np.zeros(len(self.problem.own))
        p[self.held.rows] = self.scale * x[: len(self.scale)]
        return p, x[len(self.scale) :]

    def _product(self, x: Array) -> Array:
        p, q = self._forces_of(x)
        z, stretched = self.problem.moved(p, q)
        rows = self.held.rows
        return np.append(self.scale * self.held.equations(z[rows], p[rows]), stretched - q)

    def _precondition(self, r: Array) -> Array:
        known, rest = r[: len(self.scale)] / self.scale, r[len(self.scale) :]
        p, q = self.held.solved(known, self._stiffness), rest
        if len(q):
            q = self._rigid.solve(rest - self._back @ p)
            p = p - self._forces.T @ q
        return np.append(p / self.scale, q)
