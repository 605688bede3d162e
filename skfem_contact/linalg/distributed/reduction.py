r"""``V'KT`` of a stiffness that is held rank by rank.

With the free DOFs c that neither trial nor test space eliminates, their projection P, and the others d,

    V'KT = P K P + P K_d' T_d + V_d' (K_d P + K_dd T_d).

The first is on the ranks. The rest needs the rows of d alone, DOFs of the contact: rank 0 fetches them,
makes it, and sends each rank its rows.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix

from skfem_contact.elimination.constraint import AffineConstraint
from skfem_contact.linalg.distributed.layout import Layout
from skfem_contact.linalg.distributed.ranks import Ranks
from skfem_contact.linalg.distributed.share import Settings
from skfem_contact.linalg.distributed.stack import Stack, csr_of

if TYPE_CHECKING:
    from skfem_contact.linalg.distributed.stacked import StackedStiffness

Array = NDArray[np.float64]
Index = NDArray[Any]
Mask = NDArray[np.bool_]


def reduced(
    K: StackedStiffness, trial: AffineConstraint, f: Array, test: AffineConstraint
) -> tuple[ReducedStiffness, Array]:
    """``V'KT`` and ``V'(f - K c)``, rows in the order of the unknowns of the trial space."""
    place = _order(trial.independent, test.independent)
    f_r = np.empty(len(place))
    f_r[place] = test.T.T @ (f - K.times(trial.c))
    core = np.ones(K.shape[0], dtype=bool)
    gone = np.union1d(trial.dependent, test.dependent)
    core[trial.prescribed] = core[gone] = False
    T = _wide(trial.T, trial.independent)
    V = T if test is trial else _wide(test.T, trial.independent[place])
    rows = K.rows_on_ranks(gone)
    inside = _columns(rows, core)
    across = csr_matrix(rows[:, gone])
    change = inside.T @ T[gone] + V[gone].T @ (inside + across @ T[gone])
    if K.added is not None:
        change = change + V.T @ (K.added @ T)
    return ReducedStiffness(K, trial.independent, core, csr_matrix(change)), f_r


@dataclass(frozen=True, eq=False)
class ReducedStiffness:
    """``V'KT`` as it is before the ranks make their rows: what there is of K, and the change.

    Attributes
    ----------
    stack : StackedStiffness
    independent : ndarray of int, shape (n_r,)
        DOFs of its unknowns.
    core : ndarray of bool, shape (n,)
        DOFs whose rows and columns are those of K.
    change : csr_matrix, shape (n, n)
        To be added to these.
    """

    stack: StackedStiffness
    independent: Index
    core: Mask
    change: csr_matrix
    ndim = 2

    @property
    def shape(self) -> tuple[int, int]:
        """Of the reduced system."""
        return len(self.independent), len(self.independent)

    @property
    def nnz(self) -> int:
        """About as many entries as it has on all ranks."""
        return int(self.stack.nnz + self.change.nnz)

    def diagonal(self) -> Array:
        """Shape (n_r,)."""
        bare = self.stack.diagonal_on_ranks()
        return np.asarray(np.where(self.core, bare, 0.0) + self.change.diagonal())[self.independent]

    @property
    def layout(self) -> Layout:
        """Rows of all ranks; those of DOFs that are gone have nothing but a diagonal entry."""
        whole = self.stack.layout
        return Layout(whole.slot[self.independent], whole.starts, whole.block)

    def factorize(self, settings: Settings) -> int:
        """Let each rank make its rows, ready to solve with; returns the number of the matrix."""
        own = self.stack.own
        key = own.number()
        typical = float(np.abs(self.diagonal()).mean()) if len(self.independent) else 0.0
        given = self.stack.key, key, settings, typical or 1.0
        own.together(_make, given, self._pieces())
        return key

    def _pieces(self) -> Iterator[list[Array]]:
        layout, size = self.stack.layout, self.stack.layout.size
        there = np.zeros(size, dtype=bool)
        there[layout.slot[self.independent]] = True
        change = self.change.tocoo()
        at = layout.slot[change.row], layout.slot[change.col]
        change = csr_matrix((change.data, at), shape=(size, size))
        for rank in range(self.stack.own.size):
            begin, end = layout.starts[rank : rank + 2]
            own = change[begin:end]
            touched = [
                self.core[offset + part.columns[rank]]
                for part, offset in zip(self.stack.parts, self.stack.offsets, strict=False)
            ]
            yield [np.concatenate(touched), there[begin:end], own.indptr, own.indices, own.data]


def _order(trial: Index, test: Index) -> Index:
    """Which unknown of the trial space each of the test space goes with: itself, where it is there.

    >>> _order(np.array([1, 2, 4]), np.array([1, 4, 7])).tolist()
    [0, 2, 1]
    """
    place = np.searchsorted(trial, test)
    same = trial[np.minimum(place, len(trial) - 1)] == test if len(trial) else place == 0
    left = np.ones(len(trial), dtype=bool)
    left[place[same]] = False
    place[~same] = np.flatnonzero(left)
    return place


def _wide(T: csr_matrix, dofs: Index) -> csr_matrix:
    """The same matrix, each column under the number of a DOF, (n, n)."""
    return csr_matrix((T.data, dofs[T.indices], T.indptr), shape=(T.shape[0], T.shape[0]))


def _columns(rows: csr_matrix, core: Mask) -> csr_matrix:
    """The entries in some of the columns."""
    inside = core[rows.indices]
    start = np.concatenate([[0], np.cumsum(inside)])[rows.indptr]
    return csr_matrix((rows.data[inside], rows.indices[inside], start), shape=rows.shape)


# -- on every rank ----------------------------------------------------------------------------


def _make(own: Ranks, given: tuple[Any, ...], parts: list[Any]) -> list[Any]:
    stack_key, key, settings, typical = given
    stack: Stack = own.held[stack_key]
    core, there, *change = parts
    parts.clear()
    shape = stack.here, stack.size
    rows = stack.reduced(core, there, typical, csr_of(change, shape))
    mine = [np.array(rows.shape), rows.indptr, rows.indices, rows.data]
    if stack.motions.shape[1]:
        mine.append(stack.directions(own.comm, there))
    del rows
    own.make(key, settings, mine)
    return []
