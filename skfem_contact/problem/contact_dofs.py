"""`OnContactDofs`: what the contact problems of bodies reduced to their contact DOFs have in common."""

from __future__ import annotations

from functools import cached_property
from typing import Generic, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_matrix, csr_matrix

from skfem_contact.bodies.system import System
from skfem_contact.conditions.kinematics import without_columns
from skfem_contact.conditions.loads import LoadCase
from skfem_contact.conditions.rows import row_sizes, stacked
from skfem_contact.digits import GIVEN
from skfem_contact.problem.response import Source
from skfem_contact.problem.seam import Posed, PosedOn

Array = NDArray[np.float64]
Index = NDArray[np.intp]


class Reduced(Protocol):
    """Bodies reduced to the contact DOFs `columns` (n_c,) of their system."""

    system: System
    columns: Index

    def surface(self, source: Source, case: LoadCase) -> Array:
        """Displacements (n,) known without the interior."""
        ...


B = TypeVar("B", bound=Reduced)


class OnContactDofs(Posed, Generic[B]):
    """What contact problems on contact DOFs share: the rows on these, and on prescribed ones."""

    def __init__(self, bodies: B, on: PosedOn) -> None:
        super().__init__(on)
        self.bodies: B = bodies
        self.slips = bool(on.slipping.any())
        self.rows = without_columns(on.kin, bodies.columns)
        self.prescribed = without_columns(on.kin, bodies.system.D)

    @cached_property
    def onto_dofs(self) -> tuple[csc_matrix, csc_matrix]:
        """From forces on gaps and on slips to those on the contact DOFs: the rows transposed."""
        kin = self.rows
        return kin.B_n.T, kin.B_t.T if self.slips else csc_matrix((len(self.bodies.columns), 0))

    def changing_rows(self, on: PosedOn) -> tuple[csr_matrix, Index, Index]:
        """Rows (q, n_c) of gaps and slips that can change, and where in them each point has its own.

        Those of gaps first; -1 where a point has none, (m,) and (m, d-1).
        """
        kin, t = self.rows, on.kin.tangents
        normal = np.flatnonzero(kin.paired & (row_sizes(kin.B_n) > GIVEN))
        tangential, rows = np.zeros(0, dtype=np.intp), [_chosen(kin.B_n, normal)]
        if self.slips:
            may_slip = np.repeat(kin.paired & on.slipping, t)
            tangential = np.flatnonzero(may_slip & (row_sizes(kin.B_t) > GIVEN))
            rows.append(_chosen(kin.B_t, tangential))
        normal_rows, tangential_rows = np.full(kin.m, -1), np.full(kin.m * t, -1)
        normal_rows[normal] = np.arange(len(normal))
        tangential_rows[tangential] = len(normal) + np.arange(len(tangential))
        return stacked(rows), normal_rows, tangential_rows.reshape(kin.m, t)

    def constant(self, case: LoadCase) -> tuple[Array, Array]:
        """Initial gaps and slips with what prescribed displacements add."""
        gap0, slip0 = case.gap0, case.slip0
        if self.prescribed.B_n.nnz:  # only where supports reach into the contact
            gap0 = gap0 + self.prescribed.B_n @ case.x[self.bodies.system.D]
        if self.slips and self.prescribed.B_t.nnz:
            moved = self.prescribed.B_t @ case.x[self.bodies.system.D]
            slip0 = slip0 + moved.reshape(slip0.shape)
        return gap0, slip0

    def surface(self, source: Source, case: LoadCase) -> Array:
        """Displacements (n,) known without the interior."""
        return self.bodies.surface(source, case)


def _chosen(B: csr_matrix, rows: Index) -> csr_matrix:
    """Some rows, in their order; usually all."""
    return B if len(rows) == B.shape[0] else csr_matrix(B[rows])
