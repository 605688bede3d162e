"""`Rows`: the rows of a body's stiffness that one rank holds, and how they are put together."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Triples = tuple[Index, Index, Array]


@dataclass(frozen=True, eq=False)
class Rows:
    """Some rows of a symmetric matrix.

    Attributes
    ----------
    matrix : csr_matrix, shape (r, c)
    rows : ndarray of int, shape (r,)
        DOFs of the rows, ascending.
    columns : ndarray of int, shape (c,)
        DOFs of the columns, ascending, those of the rows among them.
    own : ndarray of int, shape (r,)
        Where the rows are among the columns.
    """

    matrix: csr_matrix
    rows: Index
    columns: Index
    own: Index

    @classmethod
    def gathered(cls, comm: Any, dofs: Index, matrix: csr_matrix, owner: Index) -> Rows:
        """The rows of this rank, from the contributions of all; every rank calls it.

        Parameters
        ----------
        comm : communicator of mpi4py
        dofs : ndarray of int, shape (k,)
            What this rank's contribution is about.
        matrix : csr_matrix, shape (k, k)
        owner : ndarray of int, shape (k,)
            The rank that each of the DOFs belongs to.
        """
        away: list[Triples | None] = [None] * comm.size
        for rank in np.setdiff1d(owner, comm.rank):
            some = np.flatnonzero(owner == rank)
            part = matrix[some].tocoo()
            away[rank] = dofs[some[part.row]], dofs[part.col], part.data
        come = [part for part in comm.alltoall(away) if part is not None]
        here = np.flatnonzero(owner == comm.rank)
        here = here[np.argsort(dofs[here], kind="stable")]
        mine = matrix[here]
        touched = np.zeros(len(dofs), dtype=bool)
        touched[mine.indices] = True
        touched[here] = True
        rows = dofs[here]
        columns = np.unique(np.concatenate([dofs[touched], *(part[1] for part in come)]))
        place = np.searchsorted(columns, dofs).astype(np.int32)
        shape = len(rows), len(columns)
        whole = csr_matrix((mine.data, place[mine.indices], mine.indptr), shape=shape)
        if come:
            i, j, value = (np.concatenate(part) for part in zip(*come, strict=True))
            at = np.searchsorted(rows, i), np.searchsorted(columns, j)
            whole = csr_matrix(whole + csr_matrix((value, at), shape=shape))
        whole.sum_duplicates()
        return cls(whole, rows, columns, np.searchsorted(columns, rows))

    def diagonal(self) -> Array:
        """Shape (r,)."""
        if not len(self.rows):  # of no entries SciPy makes a matrix
            return np.zeros(0)
        return np.asarray(self.matrix[np.arange(len(self.rows)), self.own]).ravel()

    def times(self, x: Array, absolute: bool) -> Array:
        """Rows of ``K x`` or ``|K| x`` from the entries of x at the columns."""
        return np.asarray((abs(self.matrix) if absolute else self.matrix) @ x)

    def taken(self, place: Index) -> list[Array]:
        """Parts of a csr_matrix with some of the rows, all columns in the numbering of the body."""
        some = self.matrix[place]
        return [some.indptr, self.columns[some.indices], some.data]

    def destroy(self) -> None:
        """Nothing but memory that Python gives back."""


def whole_rows(parts: list[list[Array]], n: int) -> csr_matrix:
    """The rows of one rank after those of the other, from what `Rows.taken` gave."""
    lengths = np.concatenate([np.diff(indptr) for indptr, _, _ in parts])
    indptr = np.concatenate([[0], np.cumsum(lengths)])
    indices = np.concatenate([columns for _, columns, _ in parts])
    data = np.concatenate([values for _, _, values in parts])
    return csr_matrix((data, indices, indptr), shape=(len(lengths), n))
