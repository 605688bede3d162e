"""The contact problem on all DOFs, for any linear solver: ``T'KT`` is built and solved anew.

`SparseSpace` eliminates contact from displacements; the same with springs in series with the points is
`DisplacementsInSeries`. `FullProblem` takes the second where rows depend on each other.
"""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import field, replace
from functools import cached_property
from typing import Any

import numpy as np
from scipy.linalg import block_diag as dense_block_diag
from scipy.sparse import block_diag, bmat, csr_matrix, diags, hstack, identity, vstack

from skfem_contact.arrays import Array, Index, Mask
from skfem_contact.bodies.member import RemoteStiffness
from skfem_contact.bodies.system import System
from skfem_contact.conditions.kinematics import Kinematics, prescribed_rows, without_columns
from skfem_contact.conditions.rows import combined_rows, tangential_matrix
from skfem_contact.conditions.state import LoadCase
from skfem_contact.elimination.constraint import AffineConstraint, eliminate
from skfem_contact.errors import ConstraintError
from skfem_contact.linalg.backend import Stacked
from skfem_contact.linalg.direct import as_linear_solver
from skfem_contact.problem.points import Conditions, Load, Resistance, Response, friction_force
from skfem_contact.problem.seam import (
    ContactProblem,
    PosedOn,
    Source,
    point_resistance,
    spring_compliance,
)
from skfem_contact.records import dataclass

logger = logging.getLogger("skfem_contact")


class FullSystem:
    """All DOFs as unknowns, for any linear backend; the reference for the condensed route."""

    def __init__(self, system: System, stiffness: Sequence[csr_matrix], backend: Any) -> None:
        self.system = system
        self.backend = as_linear_solver(backend)
        self.points: Array | None = None
        self.modes: Array | None = None
        if any(isinstance(K, RemoteStiffness) for K in stiffness):
            self.K = self.backend.stacked(system.bodies, stiffness)
            return  # who holds the rows has their places and motions
        self.K = csr_matrix(block_diag(stiffness))
        self.points = np.concatenate([body.dof_points for body in system.bodies])
        if self.backend.uses_modes:
            self.modes = dense_block_diag(*map(system.modes, range(len(system.bodies))))

    def surface(self, source: Source, case: LoadCase) -> Array:
        """Displacements of all DOFs (n,)."""
        return source.values

    def recover(
        self, sources: Source, components: Sequence[Any], cases: Sequence[LoadCase]
    ) -> list[Array]:
        """All displacements, r arrays (n,), which are the sources themselves (n, r)."""
        return [np.array(u) for u in sources.values.T]

    @cached_property
    def softness(self) -> Array:
        """Return how far a unit force moves each DOF, all others held, (n,) [length/force]."""
        diagonal = self.K.diagonal()
        diagonal[self.system.D] = 0.0
        return np.divide(1.0, diagonal, out=np.zeros(len(diagonal)), where=diagonal > 0)

    def attach(self, on: PosedOn) -> ContactProblem:
        """The contact problem on one pairing."""
        return FullProblem(self, on)


class FullProblem(ContactProblem):
    """The contact problem on all DOFs."""

    def __init__(self, bodies: FullSystem, on: PosedOn) -> None:
        self.space = SparseSpace(
            K=bodies.K,
            kin=on.kin,
            D=bodies.system.D,
            prefer=on.prefer,
            backend=bodies.backend,
            scale=bodies.system.extent,
            frictional=on.slipping,
            points=bodies.points,
            modes=bodies.modes,
        )
        super().__init__(bodies, on)

    def _begin_anew(self) -> None:
        super()._begin_anew()
        self.space = replace(self.space, _key=None, _factor=None)
        vars(self).pop("_seen", None)

    @cached_property
    def resistance(self) -> Resistance:
        """Return what each point resists by itself, by K's diagonal."""
        return point_resistance(self.kin, self.slips, self.bodies.softness)

    def solve(self, conditions: Conditions, load: Load) -> Response:
        """Gaps, slips and forces under these conditions; through springs once rows are dependent."""
        if self.springs is None:
            try:
                return self.space.solve(conditions, load)
            except DependentRows:
                logger.info("contact rows depend on each other: points are seen through springs")
                self.springs = self._compliance()
        n = self.kin.B_n.shape[1]
        if len(load.force) == n:
            still = np.zeros(load.gap0.shape), np.zeros(load.slip0.shape)
            load = self.at_forces(load, *still)
        found = self._seen.solve(conditions, load)
        return replace(found, solution=found.solution[:n])

    @cached_property
    def _seen(self) -> DisplacementsInSeries:
        assert self.springs is not None
        return self.in_series(Resistance(1.0 / self.springs, 1.0 / self.springs))

    def at_forces(self, load: Load, normal_force: Array, tangential_force: Array) -> Load:
        """The load with the forces at which the springs of the problem have no strain."""
        return self._seen.at_forces(load, normal_force, tangential_force)

    def in_series(self, C: Resistance) -> DisplacementsInSeries:
        """The same problem with springs of the stiffness C in series with its points."""
        return DisplacementsInSeries(self.space, C)

    def _compliance(self) -> Array:
        """Of the springs of each point, by K's diagonal, (m,) [length/force]."""
        softness = self.bodies.softness
        free = np.setdiff1d(np.arange(len(softness)), self.space.D)
        return spring_compliance(without_columns(self.kin, free), self.slips, softness[free])

    def load(self, case: LoadCase) -> Load:
        """The load case as it stands."""
        return Load(case.f, case.gap0, case.slip0, case.x)

    def sources(self, found: Sequence[tuple[Load, Response]]) -> list[Source]:
        """Displacements of all DOFs."""
        return [Source(response.solution, forces=False) for _, response in found]


class DependentRows(Exception):
    """Contact rows depend on each other: their forces are not unique, or there are none."""


@dataclass(eq=False)
class SparseSpace:
    r"""Displacements as unknowns, ``u = T u_r + c``, ``T'KT u_r = T'(f - K c)``.

    On slipping points of the loop ``newton`` the friction force follows the normal force; the test
    functions then come from ``B_n - coupling B_t`` instead of ``B_n``: a Petrov-Galerkin elimination
    with the same pivots, unsymmetric but as small.

    Parameters
    ----------
    K : csr_matrix, shape (n, n)
    kin : Kinematics
    D : ndarray of int
        Prescribed DOFs.
    prefer : ndarray of bool, shape (n,)
        DOFs of the secondary surfaces.
    backend : object
        ``factorize(A, ...)`` of `skfem_contact.linalg.direct`.
    scale : float
        Size of the bodies: gaps below its round-off are zero [length].
    frictional : ndarray of bool, shape (m,)
    points : ndarray, shape (n, d), optional
        Positions of the DOFs, for the ordering of the backend.
    modes : ndarray, shape (n, k), optional
        Rigid-body modes, for multigrid.
    """

    K: csr_matrix
    kin: Kinematics
    D: Index
    prefer: Mask | None
    backend: Any
    scale: float
    frictional: Mask
    points: Array | None = None
    modes: Array | None = None
    _key: bytes | None = field(default=None, repr=False)
    _factor: Any = field(default=None, repr=False)

    def solve(self, conditions: Conditions, load: Load) -> Response:
        """Eliminate, reduce, solve, expand, and read the forces off the eliminated rows."""
        kin, t = self.kin, self.kin.tangents
        # a gap or a slip that is prescribed on both sides is what it is: contact has no say in it
        closed = np.flatnonzero(conditions.closed & self.can_close)
        tangential, rows = np.zeros(0, dtype=np.intp), [kin.B_n[closed]]
        if conditions.stick.any():
            tangential = np.flatnonzero(np.repeat(conditions.stick, t) & self.can_slip)
            rows.append(kin.B_t[tangential])
        C = vstack(rows).tocsr()
        anchor = (conditions.anchor - load.slip0).ravel()
        b = np.concatenate([-load.gap0[closed], anchor[tangential]])
        try:
            trial = eliminate(C, b, self.D, load.prescribed, prefer=self.prefer, scale=self.scale)
        except ConstraintError:
            raise DependentRows from None
        test = self._test_space(conditions, C, closed, trial)
        if len(trial.redundant) or len(test.redundant):
            raise DependentRows

        slides = (conditions.closed & ~conditions.stick)[:, None]
        spring = np.where(slides[:, None], conditions.spring, 0.0)
        known = np.einsum("ikl,il->ik", spring, load.slip0 - conditions.anchor)
        offset = np.where(slides, conditions.offset, 0.0) + known
        f = load.force - kin.B_t.T @ offset.ravel() if offset.any() else load.force
        K = self.K + tangential_matrix(kin.B_t, spring) if spring.any() else self.K
        if isinstance(K, Stacked):
            K_r, f_r = K.reduced(trial, f, test)
        else:
            K_r, f_r = trial.reduce(K, f, test=test)
        key = conditions.matrix_key()
        if key != self._key:
            self._key = self._factor = None  # not two of them at once
            symmetric = test is trial and conditions.even_springs
            self._factor = self._factorize(K_r, trial, spd=symmetric)
            self._key = key
        u = trial.expand(self._factor.solve(f_r))
        p = test.multipliers(K @ u - f)
        return self._response(conditions, load, u, p, closed, tangential)

    @cached_property
    def can_close(self) -> Mask:
        """Rows of B_n that touch DOFs that are not prescribed, shape (m,)."""
        return ~prescribed_rows(self.kin.B_n, self.D)

    @cached_property
    def can_slip(self) -> Mask:
        """Rows of B_t that touch DOFs that are not prescribed, shape (m (d-1),)."""
        return ~prescribed_rows(self.kin.B_t, self.D)

    def _test_space(
        self, conditions: Conditions, C: csr_matrix, closed: Index, trial: AffineConstraint
    ) -> AffineConstraint:
        if not conditions.coupling.any():
            return trial
        coupling = np.where((conditions.closed & ~conditions.stick)[:, None], conditions.coupling, 0.0)
        rows = csr_matrix(self.kin.B_n - combined_rows(coupling[:, None], self.kin.B_t))
        test = vstack([rows[closed], C[len(closed) :]]).tocsr()
        return eliminate(test, np.zeros(test.shape[0]), self.D, None, prefer=self.prefer)

    def _factorize(self, K_r: csr_matrix, trial: Any, spd: bool) -> Any:
        points = None if self.points is None else self.points[trial.independent]
        modes = None if self.modes is None else self.modes[trial.independent]
        return self.backend.factorize(K_r, points=points, modes=modes, spd=spd)

    def _response(
        self, conditions: Conditions, load: Load, u: Array, p: Array, closed: Index, sticking: Index
    ) -> Response:
        kin, (m, t) = self.kin, conditions.anchor.shape
        gap = load.gap0 + kin.B_n @ u
        gap[closed] = 0.0
        slip = load.slip0
        if self.frictional.any():
            slip = slip + (kin.B_t @ u).reshape(m, t)
        normal_force = np.zeros(m)
        normal_force[closed] = p[: len(closed)]
        tangential = np.zeros((m, t))
        tangential.ravel()[sticking] = -p[len(closed) :]
        slides = conditions.closed & ~conditions.stick & self.frictional
        moved = slip - conditions.anchor
        tangential[slides] = friction_force(conditions, moved, normal_force)[slides]
        return Response(gap, slip, normal_force, tangential, u)


class DisplacementsInSeries:
    """On displacements u and gaps and slips w that are seen:

        [K + B'C B,  -B'C] [u]   [f + B'p_0]   [0]
        [  -C B,       C ] [w] = [   -p_0  ] + [p].

    Parameters
    ----------
    space : SparseSpace
    C : Resistance
        Stiffness of the springs of each point.
    """

    points = None
    springs = None

    def __init__(self, space: SparseSpace, C: Resistance) -> None:
        kin, n = space.kin, space.K.shape[0]
        slips = bool(space.frictional.any())
        self._B = B = csr_matrix(vstack([kin.B_n, kin.B_t]) if slips else kin.B_n)
        stiff = np.concatenate([C.normal, np.repeat(C.tangential, kin.tangents)])[: B.shape[0]]
        pull = diags(stiff) @ B
        q, m = B.shape[0], kin.m
        wide = (
            space.K.bordered(B)
            if isinstance(space.K, Stacked)
            else block_diag([space.K, np.zeros((q, q))])
        )
        K = wide + bmat([[B.T @ pull, -pull.T], [-pull, diags(stiff)]], format="csr")
        own = csr_matrix(hstack([csr_matrix((q, n)), identity(q)]))
        t_rows = own[m:] if slips else csr_matrix((m * kin.tangents, n + q))
        places = None
        if space.points is not None:
            where = np.concatenate([kin.points, np.repeat(kin.points, kin.tangents, axis=0)])
            places = np.concatenate([space.points, where[:q]])
        modes = None if space.modes is None else np.concatenate([space.modes, B @ space.modes])
        self._extra = np.zeros(q)
        self.space = replace(
            space,
            K=K,
            kin=replace(kin, B_n=csr_matrix(own[:m]), tangential=lambda: csr_matrix(t_rows)),
            prefer=np.concatenate([np.zeros(n, dtype=bool), np.ones(q, dtype=bool)]),
            points=places,
            modes=modes,
            _key=b"",
            _factor=None,
        )

    def at_forces(self, load: Load, normal_force: Array, tangential_force: Array) -> Load:
        """The load with the forces at which the springs have no strain."""
        p = np.concatenate([normal_force, -tangential_force.ravel()])[: self._B.shape[0]]
        force = np.concatenate([load.force + self._B.T @ p, -p])
        return replace(load, force=force, prescribed=np.concatenate([load.prescribed, self._extra]))

    def solve(self, conditions: Conditions, load: Load) -> Response:
        """Gaps and slips as they are seen, and forces, under these conditions."""
        return self.space.solve(conditions, load)
