"""`Stack`: what one rank holds of all bodies, and its rows of ``T'KT``.

T is the identity but at the DOFs that contact eliminates. So the rows of ``T'KT`` are those of K
without what is prescribed or eliminated, and a change near the contact, which rank 0 makes.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix, vstack

from skfem_contact.linalg.distributed.rows import Rows
from skfem_contact.linalg.distributed.thresholds import SAME_MOTION

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Mask = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Stack:
    """Rows of several bodies on one rank, one body after the other.

    Attributes
    ----------
    parts : list of Rows
    slots : list of ndarray of int
        Of each body, where its columns are among the rows of all ranks.
    motions : ndarray, shape (here, k)
        Rigid motions of all bodies at once.
    begin, here, size : int
        First row of this rank; number of rows on it, and on all.
    """

    parts: list[Rows]
    slots: list[Index]
    motions: Array
    begin: int
    here: int
    size: int

    def reduced(self, core: Mask, there: Mask, typical: float, change: csr_matrix) -> csr_matrix:
        """This rank's rows of ``T'KT``, shape (here, size).

        Parameters
        ----------
        core : ndarray of bool
            Columns of all parts whose DOFs are free and not eliminated; the others are left out.
        there : ndarray of bool, shape (here,)
            Rows that the reduced system has. The others have nothing but a diagonal entry.
        typical : float
            That entry.
        change : csr_matrix, shape (here, size)
            To be added.
        """
        blocks, begin = [], 0
        for part, slots in zip(self.parts, self.slots, strict=True):
            inside = core[begin : begin + len(slots)]
            begin += len(slots)
            blocks.append(_left(part, inside, slots, self.size))
        rows = sum(len(part.rows) for part in self.parts)
        if rows < self.here or not blocks:  # further unknowns have no rows in K
            blocks.append(csr_matrix((self.here - rows, self.size)))
        whole = blocks[0] if len(blocks) == 1 else vstack(blocks, format="csr")
        blocks.clear()
        if change.nnz:
            whole = whole + change
        if not there.all():
            place = self.begin + np.flatnonzero(~there)
            alone = np.flatnonzero(~there), place
            whole = whole + csr_matrix((np.full(len(place), typical), alone), shape=whole.shape)
        whole.sort_indices()
        return whole

    def directions(self, comm: Any, there: Mask) -> Array:
        """Rigid motions on the rows that are there, orthonormal; every rank calls it."""
        return orthonormal(comm, self.motions * there[:, None])

    def destroy(self) -> None:
        """Nothing but memory that Python gives back."""


def _left(part: Rows, inside: Mask, slots: Index, size: int) -> csr_matrix:
    """The entries whose row and column are inside, in the numbering of all ranks."""
    K = part.matrix
    entries = np.repeat(inside[part.own], np.diff(K.indptr)) & inside[K.indices]
    start = np.concatenate([[0], np.cumsum(entries)])[K.indptr]
    kind = np.int32 if size <= np.iinfo(np.int32).max else np.int64
    indices = slots.astype(kind)[K.indices[entries]]
    return csr_matrix((K.data[entries], indices, start.astype(kind)), shape=(len(part.rows), size))


def orthonormal(comm: Any, columns: Array) -> Array:
    """Orthonormal columns with the same span, of vectors whose rows are on all ranks.

    By Gram and Schmidt, each column twice.
    """
    kept: list[Array] = []
    for column in columns.T:
        length = np.sqrt(comm.allreduce(float(column @ column)))
        if length == 0.0:
            continue
        column = column / length
        for _ in range(2 if kept else 0):
            shares = comm.allreduce(np.array([other @ column for other in kept]))
            column = column - np.column_stack(kept) @ shares
        length = np.sqrt(comm.allreduce(float(column @ column)))
        if length > SAME_MOTION:
            kept.append(column / length)
    return np.ascontiguousarray(np.column_stack(kept)) if kept else np.zeros((len(columns), 0))


def csr_of(parts: list[Array], shape: tuple[int, int]) -> csr_matrix:
    """A matrix from its arrays ``indptr``, ``indices`` and ``data``, as they are sent."""
    indptr, indices, data = parts
    return csr_matrix((data, indices, indptr), shape=shape)
