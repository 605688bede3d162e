"""The contact problem of surfaces with too many points for dense matrices: forces, iterated.

GMRES finds the forces of closed points, see `forces`. Each of its iterations takes a product with
``W = [B; P'] F [B; P']'``, which is a substitution through the factors of the bodies (`whole`); it is
preconditioned by the stiffness of a layer under the surfaces (`whole`).
"""

from __future__ import annotations

import logging
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from skfem_contact.conditions.loads import LoadCase
from skfem_contact.problem.forces import HeldForces, OnForces, could_not
from skfem_contact.problem.full import FullProblem, FullSystem
from skfem_contact.problem.response import Conditions, Load, Response, Source
from skfem_contact.problem.seam import ContactProblem, PosedOn
from skfem_contact.problem.sparse import DependentRows
from skfem_contact.problem.thresholds import ITERATED, MOST_PRODUCTS, STAGNANT
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
            full = FullSystem(self.system, self.stiffness, self.backend)
            return FullProblem(full, on, prefer, labels)


class IteratedProblem(OnForces[IteratedBodies]):
    """The contact problem on forces, by GMRES through the factors of the bodies."""

    def __init__(self, bodies: IteratedBodies, on: PosedOn) -> None:
        super().__init__(bodies, on)
        self._begin_anew()

    def _begin_anew(self) -> None:
        super()._begin_anew()
        self._last: tuple[Load, Array, Array] | None = None  # of the iteration before, under one load

    def moved(self, p: Array, q: Array) -> tuple[Array, Array]:
        """Gaps and slips, and extensions of the springs, by forces on all rows and on the springs."""
        u = self.bodies.flexibility(self.G.T @ p + self.bodies.P @ q)
        return self.G @ u + self.give * p, self.bodies.P.T @ u

    def load(self, case: LoadCase) -> Load:
        """A load case: what gaps, slips and anchors do where contact carries nothing."""
        u = self.bodies.load(case)
        moved = np.append(self.G @ u, self.bodies.P.T @ u)
        return Load(np.zeros(0), *self.constant(case), np.zeros(0), (), moved)

    def solve(self, conditions: Conditions, load: Load) -> Response:
        """Gaps, slips and forces under these conditions."""
        assert load.moved is not None
        z0, q0 = np.split(load.moved, [len(self.own)])
        begin = np.zeros(len(z0)), np.zeros(len(q0))
        if self._last is not None and self._last[0] is load:
            begin = self._last[1:]
        system = _Forces(self, conditions, load)
        p, q = system.found(z0, q0, *begin)
        self._last = load, p, q
        z = z0 + self.moved(p, q)[0]
        return self.response(conditions, load, z, p, np.append(p, q), system.rough)

    def source(self, load: Load, response: Response) -> Source:
        """Forces on the contact DOFs: contact, and the springs on the anchors."""
        q = response.solution[len(self.own) :]
        from_gaps, from_slips = self.onto_dofs
        force = from_gaps @ response.normal_force + self.bodies.P @ q
        if self.slips:
            force -= from_slips @ response.tangential_force.ravel()
        return Source(force, forces=True)


class _Forces(HeldForces):
    """The equations of held rows in one unit for all unknowns and residuals, the root of an energy."""

    def __init__(self, problem: IteratedProblem, conditions: Conditions, load: Load) -> None:
        super().__init__(problem, conditions, load)
        self.problem = problem

    def found(self, z0: Array, q0: Array, p: Array, q: Array) -> tuple[Array, Array]:
        """Forces on all rows and extensions of the springs, from p and q to begin with.

        Raises
        ------
        SingularMatrix
            The equations have no answer, or hardly.
        """
        rows, known = self.held.rows, self.held.known
        by_loads = self.held.equations(z0[rows], np.zeros(len(rows)))
        b = np.append(self.scale * (known - by_loads), -q0)
        size = float(np.linalg.norm(np.concatenate([self.scale * known, self.scale * by_loads, q0])))
        begin = np.append(p[rows] / self.scale, q)
        found = self.iterated(b, begin, ITERATED * size, MOST_PRODUCTS)
        logger.debug("contact forces: %d products, residual %.1e", found.iterations, found.residual)
        if not (self.rough or found.residual <= STAGNANT * size):
            raise could_not("the motion by loads", found.residual / size, found.iterations)
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
        p, q = self.solved(r[: len(self.scale)] / self.scale, r[len(self.scale) :])
        return np.append(p / self.scale, q)
