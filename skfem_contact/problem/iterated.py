"""The contact problem of surfaces with too many points for dense matrices: forces, iterated.

GMRES finds the forces of closed points, see `forces`. Each of its iterations takes a product with
``W = [B; P'] F [B; P']'``, which is a substitution through the factors of the bodies (`whole`); it is
preconditioned by the stiffness of a layer under the surfaces (`whole`).

For bodies too large to be factorised, displacements and forces are found together (`MultigridProblem`).
With K held by the springs on the anchors (`condensed`), the equations are those of bodies and `forces`,

    K u - B'p - P q = f,      what is held of B u and p,      P'u - q = 0.

GMRES solves them for u, p and q at once. It is preconditioned by a V-cycle of multigrid for K, then by
the stiffness of a layer under the surfaces (`whole`) for the forces. What multigrid is prepared for is
K, which contact never changes: points that close, stick or slip cost no new preparation, and slipping
points, whose equations are unsymmetric, no more iterations. (With contact eliminated, ``T'KT`` is
another matrix in every iteration; it took up to 160 iterations where friction follows the normal
force and these take 30.)
"""

from __future__ import annotations

import logging
from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy.sparse import bsr_matrix, csr_matrix, diags

from skfem_contact.arrays import Array, Index
from skfem_contact.bodies.body import Body
from skfem_contact.bodies.system import slices
from skfem_contact.conditions.loads import LoadCase
from skfem_contact.digits import SOLVED
from skfem_contact.linalg.amg import (
    AMG,
    Hierarchy,
    conjugate_gradients,
    hierarchy,
    longest_row,
    not_within,
)
from skfem_contact.once import once
from skfem_contact.problem.forces import HeldForces, OnForces, could_not
from skfem_contact.problem.full import DependentRows, FullProblem, FullSystem
from skfem_contact.problem.response import Conditions, Load, Response, Source
from skfem_contact.problem.seam import ContactProblem, PosedOn
from skfem_contact.problem.thresholds import CLOSER, ITERATED, MOST_PRODUCTS, ROUNDING
from skfem_contact.problem.whole import Whole, WholeBody

logger = logging.getLogger("skfem_contact")


class IteratedBodies(Whole[WholeBody]):
    """Bodies by their factors, and the contact problem put upon them."""

    kind = WholeBody

    def attach(self, on: PosedOn) -> ContactProblem:
        """The contact problem on one pairing."""
        return _attached(self, on, IteratedProblem)


class IteratedProblem(OnForces):
    """The contact problem on forces, by GMRES through the factors of the bodies."""

    def moved(self, p: Array, q: Array) -> tuple[Array, Array]:
        """Gaps and slips, and extensions of the springs, by forces on all rows and on the springs."""
        u = self.bodies.flexibility(self.G.T @ p + self.bodies.P @ q)
        return self.G @ u + self.give * p, self.bodies.P.T @ u

    def load(self, case: LoadCase) -> Load:
        """A load case: what gaps, slips and anchors do where contact carries nothing."""
        u = self.bodies.load(case)
        moved = np.append(self.G @ u, self.bodies.P.T @ u)
        return Load(np.zeros(0), *self.constant(case), np.zeros(len(u)), (), moved)

    def solve(self, conditions: Conditions, load: Load) -> Response:
        """Gaps, slips and forces under these conditions."""
        assert load.moved is not None
        z0, q0 = np.split(load.moved, [self.q])
        begin = self._last[1:] if self._last[0] is load else (np.zeros(len(z0)), np.zeros(len(q0)))
        system = _Forces(self, conditions, load)
        p, q = system.found(z0, q0, *begin)
        self._last = load, p, q
        z = z0 + self.moved(p, q)[0]
        return self.response(conditions, load, z, p, np.append(p, q), system.rough)


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
        if not (self.rough or found.residual <= SOLVED * size):
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


class GridBody(WholeBody):
    """One body by its matrix, with multigrid in place of factors."""

    @once
    def K_free(self) -> csr_matrix | bsr_matrix:
        """K on the free DOFs, with springs on the anchors; in blocks where these take fewer bytes."""
        springs = np.zeros(self.body.n)
        springs[self.anchors] = self.springs
        K = csr_matrix(self.K[self.free][:, self.free] + diags(springs[self.free]))
        size = self.body.dof_points.shape[1]
        if len(self.free) % size:
            return K
        blocks = K.tobsr((size, size))
        return (
            blocks if 2 * blocks.data.nbytes < 3 * K.data.nbytes else K
        )  # of 8 bytes, and 4 of indices

    @once
    def grids(self) -> Hierarchy:
        """Grids of the body; of a rigid one its few equations themselves."""
        if isinstance(self.body, Body):
            return hierarchy(self.K_free, self.modes[self.free])
        inverse = np.linalg.inv(self.K_free.toarray())
        return Hierarchy((), inverse.dot)

    @property
    def memory(self) -> int:
        """Bytes of all grids."""
        return self.grids.memory


class MultigridBodies(Whole[GridBody]):
    """Bodies by their matrices and multigrid, and the contact problem put upon them.

    The backend is an `AMG`: its tolerance, and its most iterations.
    """

    kind = GridBody

    usual = AMG

    @once
    def free_spans(self) -> list[slice]:
        """The free DOFs of each body among those of all."""
        return slices(np.cumsum([0, *(len(part.free) for part in self.substructures)]))

    @once
    def free(self) -> Index:
        """The free DOFs among all."""
        parts = zip(self.substructures, self.spans, strict=True)
        return np.concatenate([span.start + part.free for part, span in parts])

    @once
    def place(self) -> Index:
        """The contact DOFs among the free ones."""
        return np.searchsorted(self.free, self.columns)

    @once
    def diagonal(self) -> Array:
        """Of K on the free DOFs, (n_f,)."""
        return np.concatenate([part.K_free.diagonal() for part in self.substructures])

    def times_K(self, u: Array, absolute: bool = False) -> Array:
        """``K u`` on the free DOFs, the springs included, (n_f,); or ``|K| u``."""
        parts = zip(self.substructures, self.free_spans, strict=True)
        pairs = [(abs(part.K_free) if absolute else part.K_free, u[span]) for part, span in parts]
        return np.concatenate([K @ own for K, own in pairs])

    def cycle(self, f: Array) -> Array:
        """About ``K^-1 f``, (n_f,)."""
        parts = zip(self.substructures, self.free_spans, strict=True)
        return np.concatenate([part.grids.cycle(f[span]) for part, span in parts])

    def flexibility(self, force: Array) -> Array:
        """``F`` times forces on the contact DOFs, (n_c,) -> (n_c,)."""
        f = np.zeros(len(self.free))
        f[self.place] = force
        u, most = np.zeros(len(f)), self.backend.max_iterations
        for part, span in zip(self.substructures, self.free_spans, strict=True):
            if f[span].any():
                own = part.K_free, f[span], part.grids.cycle
                u[span] = conjugate_gradients(*own, ITERATED, most, to_round_off=True)
        return u[self.place]

    def free_load(self, case: LoadCase) -> Array:
        """Loads on the free DOFs, those of prescribed displacements included, (n_f,)."""
        parts = zip(self.substructures, self.spans, strict=True)
        return np.concatenate([part.free_load(case.f[s], case.x[s]) for part, s in parts])

    def attach(self, on: PosedOn) -> ContactProblem:
        """The contact problem on one pairing."""
        return _attached(self, on, MultigridProblem)


def _attached(bodies: Whole[Any], on: PosedOn, kind: type[OnForces]) -> ContactProblem:
    try:
        return kind(bodies, on)
    except DependentRows:  # a corner, a chain
        logger.info("contact rows depend on each other: they are eliminated in every iteration")
        return FullProblem(FullSystem(bodies.system, bodies.stiffness, bodies.backend), on)


class MultigridProblem(OnForces):
    """The contact problem on displacements and forces, by GMRES with multigrid."""

    def load(self, case: LoadCase) -> Load:
        """A load case on the free DOFs; `prescribed` are the displacements of the others."""
        u = np.zeros(self.bodies.system.n)
        u[self.bodies.system.D] = case.x[self.bodies.system.D]
        still = np.zeros(self.q)  # springs in series move them; loads are part of the equations
        return Load(self.bodies.free_load(case), *self.constant(case), u, (), still)

    def solve(self, conditions: Conditions, load: Load) -> Response:
        """Gaps, slips and forces under these conditions."""
        assert load.moved is not None
        sizes = len(load.force), self.q, self.bodies.P.shape[1]
        begin = self._last[1:] if self._last[0] is load else map(np.zeros, sizes)
        system = _Fields(self, conditions, load)
        u, p, q = system.found(load, *begin)
        self._last = load, u, p, q
        z = load.moved + self.G @ u[self.bodies.place] + self.give * p
        return self.response(conditions, load, z, p, u, system.rough)

    def sources(self, found: Sequence[tuple[Load, Response]]) -> list[Source]:
        """Displacements of all DOFs."""
        displacements = [load.prescribed.copy() for load, _ in found]
        for u, (_, response) in zip(displacements, found, strict=True):
            u[self.bodies.free] = response.solution
        return [Source(u, forces=False) for u in displacements]


class _Fields(HeldForces):
    """All equations in one unit for all unknowns and residuals, the root of an energy.

    Loops end by forces. A tolerance that is one of the load may be met before these are as exact as a
    loop asks: every solve comes closer than the one before.
    """

    closer = CLOSER

    def __init__(self, problem: MultigridProblem, conditions: Conditions, load: Load) -> None:
        super().__init__(problem, conditions, load)
        self.problem, self.bodies = problem, problem.bodies
        self.diagonal = np.sqrt(self.bodies.diagonal)
        self._ends = np.cumsum([len(self.diagonal), len(self.scale)])

    def found(self, load: Load, u: Array, p: Array, q: Array) -> tuple[Array, Array, Array]:
        """Displacements, forces on all rows and extensions, from u, p and q to begin with.

        Raises
        ------
        LinearSolveError
            They are not found within the tolerance.
        """
        assert load.moved is not None
        rows, settings = self.held.rows, self.bodies.backend
        known = self.held.known - self.held.equations(load.moved[rows], np.zeros(len(rows)))
        b = np.concatenate([load.force / self.diagonal, self.scale * known, np.zeros(len(q))])
        begin = np.concatenate([u * self.diagonal, p[rows] / self.scale, q])
        size = float(np.linalg.norm(b))
        found = self.iterated(b, begin, settings.tol * size, settings.max_iterations)
        logger.debug("multigrid: %d iterations, residual %.1e", found.iterations, found.residual)
        u, own, q = self._parts(found.x)
        good = self.rough or found.residual <= settings.tol * size
        if not (good or found.residual <= self._round_off(u, own, q)):
            raise not_within(found.residual / size, settings.tol, found.iterations)
        p = np.zeros(len(p))
        p[rows] = own
        return u, p, q

    def _round_off(self, u: Array, p: Array, q: Array) -> float:
        """Return what the left-hand sides are uncertain by: large terms cancel.

        So they do in stiff bodies that move as they are, and where a body that only contact holds is
        held by springs, whose extensions q contact takes back. A sum of n terms is known to n roundings
        of their sizes (Higham 2002, section 3.1).
        """
        per_row = max(longest_row(part.K_free) for part in self.bodies.substructures)
        u_c, G = u[self.bodies.place], abs(self.G)
        bodies = self.bodies.times_K(np.abs(u), absolute=True)
        bodies[self.bodies.place] += G.T @ np.abs(p) + abs(self.P) @ np.abs(q)
        held = self.scale * (G @ np.abs(u_c) + self.problem.give[self.held.rows] * np.abs(p))
        springs = abs(self.P).T @ np.abs(u_c) + np.abs(q)
        terms = np.concatenate([bodies / self.diagonal, held, springs])
        return float(per_row * ROUNDING * np.linalg.norm(terms))

    def _parts(self, x: Array) -> tuple[Array, Array, Array]:
        u, p, q = np.split(x, self._ends)
        return u / self.diagonal, p * self.scale, q

    def _product(self, x: Array) -> Array:
        u, p, q = self._parts(x)
        u_c, f = u[self.bodies.place], self.bodies.times_K(u)
        f[self.bodies.place] -= self.G.T @ p + self.P @ q
        z = self.G @ u_c + self.problem.give[self.held.rows] * p
        held = self.scale * self.held.equations(z, p)
        return np.concatenate([f / self.diagonal, held, self.P.T @ u_c - q])

    def _precondition(self, r: Array) -> Array:
        f, known, rest = np.split(r, self._ends)
        u = self.bodies.cycle(f * self.diagonal)
        u_c = u[self.bodies.place]
        by_u = self.held.equations(self.G @ u_c, np.zeros(len(known)))
        p, q = self.solved(known / self.scale - by_u, rest - self.P.T @ u_c)
        return np.concatenate([u * self.diagonal, p / self.scale, q])
