"""The contact problem of surfaces with too many points for dense matrices: forces, iterated.

GMRES finds the forces of closed points, see `forces`. Each of its iterations takes a product with
``W = [B; P'] F [B; P']'``, which is a substitution through the factors of the bodies; it is
preconditioned by the stiffness of a layer under the surfaces.

For bodies too large to be factorised, displacements and forces are found together (`MultigridProblem`).
With K held by the springs on the anchors (`condensed`), the equations are those of bodies and `forces`,

    K u - B'p - P q = f,      what is held of B u and p,      P'u - q = 0.

GMRES solves them for u, p and q at once. It is preconditioned by a V-cycle of multigrid for K, then by
the stiffness of a layer under the surfaces for the forces. What multigrid is prepared for is
K, which contact never changes: points that close, stick or slip cost no new preparation, and slipping
points, whose equations are unsymmetric, no more iterations. (With contact eliminated, ``T'KT`` is
another matrix in every iteration; it took up to 160 iterations where friction follows the normal
force and these take 30.)

The contact DOFs are eliminated from bodies like all others. Displacements at the contact under forces
there, ``F f``, then cost a substitution through the fronts above the contact DOFs, somewhat more than
half of them in a solid. What is dense are the springs on the anchors of bodies that their supports do
not hold, as in `condensed`: ``F = R (K + P P')^-1 R'``, R selecting contact DOFs and anchors.
"""

from __future__ import annotations

import logging
from collections.abc import Sequence

import numpy as np
from scipy.sparse import bsr_matrix, csr_matrix, diags

from skfem_contact.arrays import Array, Index
from skfem_contact.bodies.body import Body
from skfem_contact.bodies.system import slices
from skfem_contact.conditions.state import LoadCase
from skfem_contact.digits import COMPUTED, SOLVED
from skfem_contact.errors import SingularMatrix
from skfem_contact.linalg.amg import (
    AMG,
    Hierarchy,
    conjugate_gradients,
    hierarchy,
    longest_row,
    not_within,
)
from skfem_contact.linalg.backend import Surface
from skfem_contact.linalg.krylov import sizes_of_parts
from skfem_contact.problem.condensed import Substructures
from skfem_contact.problem.forces import HeldForces, Layer, OnForces
from skfem_contact.problem.full import DependentRows, FullProblem, FullSystem
from skfem_contact.problem.points import Conditions, Load, Response
from skfem_contact.problem.seam import ContactProblem, PosedOn, Source
from skfem_contact.problem.substructure import Components, Substructure
from skfem_contact.records import once

logger = logging.getLogger("skfem_contact")


# Products with the bodies until forces leave no more than `COMPUTED` of the motion by loads: 15 to 30,
# up to 60 where most points slip. Above `SOLVED` there is no answer.
MOST_PRODUCTS = 400


# Of one operation, relative: half a unit in the last place.
ROUNDING = 2.0**-53


class _Forces(HeldForces):
    """The equations of forces, bodies eliminated."""

    def found(self, begin: tuple[Array, Array, Array] | None) -> tuple[Array, Array, Array]:
        """Displacements of the contact DOFs, forces on all rows and extensions of the springs.

        Raises
        ------
        SingularMatrix
            The equations have no answer, or hardly.
        """
        assert self.load.moved is not None
        z0, q0 = np.split(self.load.moved, [self.problem.q])
        by_loads = self.held.equations(z0[self.held.rows], np.zeros(len(self.scale)))
        b = np.append(self.scale * (self.held.known - by_loads), -q0)
        terms = np.append(self.scale * np.hypot(self.held.known, by_loads), q0)
        sizes = sizes_of_parts(self.part, terms)
        found = self.iterated(b, sizes, begin, COMPUTED, MOST_PRODUCTS)
        logger.debug("contact forces: %d products, residual %.1e", found.iterations, found.residual)
        if not (self.rough or found.residual <= SOLVED):
            raise SingularMatrix(
                f"the contact forces could not be found: {found.residual:.1e} of the motion "
                f"by loads is left after {found.iterations} iterations. Usually the points that are "
                "closed hardly hold the bodies"
            )
        _, p, q = self.parts(sizes * found.x)
        return self._moved(p, q), self.on_all(p), q

    def _moved(self, p: Array, q: Array) -> Array:
        return self.bodies.flexibility(self.G.T @ p + self.P @ q)

    def _product(self, x: Array) -> Array:
        _, p, q = self.parts(x)
        u = self._moved(p, q)
        held = self.held.equations(self.G @ u + self.give * p, p)
        return np.append(self.scale * held, self.P.T @ u - q)

    def _precondition(self, r: Array) -> Array:
        p, q = self.solved(r[: len(self.scale)] / self.scale, r[len(self.scale) :])
        return np.append(p / self.scale, q)


class IteratedProblem(OnForces):
    """The contact problem on forces, by GMRES through the factors of the bodies."""

    equations = _Forces

    def load(self, case: LoadCase) -> Load:
        """A load case: what gaps, slips and anchors do where contact carries nothing."""
        u = self.bodies.load(case)
        moved = np.append(self.G @ u, self.bodies.P.T @ u)
        return Load(np.zeros(0), *self.constant(case), np.zeros(len(u)), (), moved)

    def solution(self, u: Array, p: Array, q: Array) -> Array:
        """Forces on all rows, and extensions of the springs."""
        return np.append(p, q)


class _Fields(HeldForces):
    """The equations of bodies and forces."""

    def __init__(self, problem: OnForces, conditions: Conditions, load: Load) -> None:
        super().__init__(problem, conditions, load)
        self.size = np.sqrt(self.bodies.diagonal)
        counts = [len(part.free) for part in self.bodies.substructures]
        self.part = np.concatenate([np.repeat(self.label, counts), self.part])

    def found(self, begin: tuple[Array, Array, Array] | None) -> tuple[Array, Array, Array]:
        """Displacements of the free DOFs, forces on all rows and extensions of the springs.

        Raises
        ------
        LinearSolveError
            They are not found within the tolerance.
        """
        assert self.load.moved is not None
        settings, still = self.bodies.backend, np.zeros(len(self.scale))
        known = self.held.known - self.held.equations(self.load.moved[self.held.rows], still)
        b = np.concatenate([self.load.force / self.size, self.scale * known, np.zeros(self.P.shape[1])])
        sizes = sizes_of_parts(self.part, b)
        found = self.iterated(b, sizes, begin, settings.tol, settings.max_iterations)
        logger.debug("multigrid: %d iterations, residual %.1e", found.iterations, found.residual)
        if not (found.enough or found.residual <= self._round_off(*self.parts(found.x))):
            raise not_within(found.residual, settings.tol, found.iterations)
        u, p, q = self.parts(sizes * found.x)
        return u, self.on_all(p), q

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
        held = self.scale * (G @ np.abs(u_c) + self.give * np.abs(p))
        springs = abs(self.P).T @ np.abs(u_c) + np.abs(q)
        terms = np.concatenate([bodies / self.size, held, springs])
        return float(per_row * ROUNDING * np.linalg.norm(terms))

    def _product(self, x: Array) -> Array:
        u, p, q = self.parts(x)
        u_c, f = u[self.bodies.place], self.bodies.times_K(u)
        f[self.bodies.place] -= self.G.T @ p + self.P @ q
        held = self.scale * self.held.equations(self.G @ u_c + self.give * p, p)
        return np.concatenate([f / self.size, held, self.P.T @ u_c - q])

    def _precondition(self, r: Array) -> Array:
        f, known, rest = np.split(r, np.cumsum([len(self.size), len(self.scale)]))
        u = self.bodies.cycle(f * self.size)
        u_c = u[self.bodies.place]
        by_u = self.held.equations(self.G @ u_c, np.zeros(len(known)))
        return self.joined(u, *self.solved(known / self.scale - by_u, rest - self.P.T @ u_c))


class MultigridProblem(OnForces):
    """The contact problem on displacements and forces, by GMRES with multigrid."""

    equations = _Fields

    def load(self, case: LoadCase) -> Load:
        """A load case on the free DOFs; `prescribed` are the displacements of the others."""
        u = np.zeros(self.bodies.system.n)
        u[self.bodies.system.D] = case.x[self.bodies.system.D]
        still = np.zeros(self.q)  # springs in series move them; loads are part of the equations
        return Load(self.bodies.free_load(case), *self.constant(case), u, (), still)

    def solution(self, u: Array, p: Array, q: Array) -> Array:
        """Displacements of the free DOFs."""
        return u

    def sources(self, found: Sequence[tuple[Load, Response]]) -> list[Source]:
        """Displacements of all DOFs."""
        displacements = [load.prescribed.copy() for load, _ in found]
        for u, (_, response) in zip(displacements, found, strict=True):
            u[self.bodies.free] = response.solution
        return [Source(u, forces=False) for u in displacements]


class WholeBody(Substructure):
    """One body with all its factors, of which only the anchors are left.

    Attributes
    ----------
    columns : ndarray of int
        Contact DOFs and anchors, sorted.
    kept : ndarray of int
        The anchors.
    """

    keeps_contact = False

    @once
    def _place(self) -> Index:
        return np.searchsorted(self.free, self.columns)

    @once
    def _response(self) -> Surface:
        return self._factor.response(self._place)

    @once
    def layer(self) -> Layer:
        """The layer under its contact DOFs, the same on all pairings."""
        return Layer(self)

    @once
    def springs(self) -> Array:
        """As stiff as K itself: what anchors alone feel of a body that floats may be nothing."""
        return np.maximum(self.K.diagonal()[self.anchors], self._firm)

    @once
    def by_springs(self) -> Array:
        """What each spring does to the contact DOFs by a unit of its root of an energy, (n_c, k)."""
        pulls = np.zeros((len(self.anchors), len(self.columns)))
        at = np.searchsorted(self.columns, self.anchors)
        pulls[np.arange(len(at)), at] = np.sqrt(self.springs)
        return np.array([self.respond(pull) for pull in pulls]).reshape(pulls.shape).T

    def respond(self, force: Array) -> Array:
        """``F`` times forces on the contact DOFs, (n_c,) -> (n_c,)."""
        if not len(self.columns):
            return np.zeros(0)
        return self._response(force, self.flexibility)

    def recover(
        self,
        force: Array,
        components: Sequence[Components | None],
        loads: Sequence[tuple[Array, Array]],
    ) -> Array:
        """Displacements of the DOFs `order` (n_f, r) under forces on the contact DOFs and loads."""
        f = np.column_stack([self.free_load(*load) for load in loads])
        f[self._place] += force
        x = self._factor.eliminate(f)
        return self._factor.substitute(self.flexibility @ x[len(x) - len(self.kept) :], x)


class IteratedBodies(Substructures):
    """Bodies by their factors, and the contact problem put upon them."""

    kind: type[WholeBody] = WholeBody
    problem: type[OnForces] = IteratedProblem
    place: slice | Index = slice(None)  # of contact DOFs among the unknown displacements

    def attach(self, on: PosedOn) -> ContactProblem:
        """The contact problem on one pairing."""
        try:
            return self.problem(self, on)
        except DependentRows:  # a corner, a chain
            logger.info("contact rows depend on each other: they are eliminated in every iteration")
            return FullProblem(FullSystem(self.system, self.stiffness, self.backend), on)

    def flexibility(self, force: Array) -> Array:
        """``F`` times forces on the contact DOFs, (n_c,) -> (n_c,)."""
        pieces = zip(self.substructures, self.column_spans, strict=True)
        return np.concatenate([part.respond(force[span]) for part, span in pieces])

    def load(self, case: LoadCase) -> Array:
        """Displacements (n_c,) of the contact DOFs where contact carries nothing, on the springs."""
        return self.surface(Source(np.zeros(len(self.columns)), True), case)[self.columns]

    def surface(self, source: Source, case: LoadCase) -> Array:
        """Displacements (n,) known without further work: here of all DOFs, which take as much."""
        return self.recover(Source(source.values[:, None], source.forces), [None], [case])[0]


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
        fewer = 2 * blocks.data.nbytes < 3 * K.data.nbytes  # of 8 bytes, and 4 of indices
        return blocks if fewer else K

    @once
    def grids(self) -> Hierarchy:
        """Grids of the body; of a rigid one its few equations themselves."""
        if isinstance(self.body, Body):
            return hierarchy(self.K_free, self.modes[self.free])
        inverse = np.linalg.inv(self.K_free.toarray())
        return Hierarchy((), inverse.dot)

    def respond(self, force: Array) -> Array:
        """``F`` times forces on the contact DOFs, (n_c,) -> (n_c,)."""
        if not force.any():
            return force
        f = np.zeros(len(self.free))
        f[self._place] = force
        most = self._backend.max_iterations
        given = self.K_free, f, self.grids.cycle, COMPUTED, most
        return conjugate_gradients(*given, to_round_off=True)[self._place]

    @property
    def memory(self) -> int:
        """Bytes of all grids."""
        return self.grids.memory


class MultigridBodies(IteratedBodies):
    """Bodies by their matrices and multigrid, and the contact problem put upon them.

    The backend is an `AMG`: its tolerance, and its most iterations.
    """

    kind, problem, usual = GridBody, MultigridProblem, AMG

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

    def free_load(self, case: LoadCase) -> Array:
        """Loads on the free DOFs, those of prescribed displacements included, (n_f,)."""
        parts = zip(self.substructures, self.spans, strict=True)
        return np.concatenate([part.free_load(case.f[s], case.x[s]) for part, s in parts])
