"""The stiffness of a body whose rows are on all ranks.

`RankedStiffness` is what rank 0 knows of it, `Rows` what each rank holds.
"""

from __future__ import annotations

import weakref
from typing import Any, NoReturn

import numpy as np
from scipy.sparse import csr_matrix

from skfem_contact.arrays import Array, Index
from skfem_contact.bodies.remote import RemoteStiffness
from skfem_contact.errors import InputError
from skfem_contact.petsc.ranks import Ranks
from skfem_contact.records import dataclass
from skfem_contact.sealed import sealed

Triples = tuple[Index, Index, Array]


class DistributedStiffness(RemoteStiffness):
    """A symmetric matrix (n, n) of which each rank holds some rows."""

    def refused(self, why: str) -> InputError:
        """The error for what needs all of the matrix in one place."""
        return InputError(
            f"this stiffness was assembled rank by rank, and no process has all of it; {why}. It has "
            "K @ x, K.diagonal(), K[dofs], and goes with ContactSolver(..., linear=PETSc()) alone."
        )

    def __mul__(self, factor: Any) -> NoReturn:
        raise self.refused(
            "numbers do not multiply it: let the function that assembles have the factor"
        )

    __rmul__ = __mul__

    def __repr__(self) -> str:
        return f"<stiffness of {self.shape[0]} DOFs, {self.nnz} entries, held rank by rank>"

    def __getattr__(self, name: str) -> NoReturn:
        # what NumPy, SciPy, pickle and copy look for by themselves is simply not there
        if name.startswith("_"):
            raise AttributeError(name)
        raise AttributeError(str(self.refused(f"there is no {name!r} of it")))

    def __reduce_ex__(self, protocol: Any) -> NoReturn:
        raise self.refused("it can not be pickled or copied: use save_state for states of a history")


class RankedStiffness(DistributedStiffness):
    """A stiffness by rows on ranks, and sparse terms on rank 0 that were added.

    Attributes
    ----------
    places : list of ndarray of int
        DOFs whose rows each rank has, ascending.
    columns : list of ndarray of int
        DOFs that these rows touch, ascending.
    added : csr_matrix, shape (n, n), or None
        What is not on the ranks.
    """

    added: csr_matrix | None = None

    def __init__(self, own: Ranks, key: int, told: list[list[Any]]) -> None:
        self.own, self.key = own, key
        self.places = [part[0].astype(np.int32, copy=False) for part in told]
        self.columns = [part[1].astype(np.int32, copy=False) for part in told]
        n = sum(map(len, self.places))
        self.shape = n, n
        self.nnz = int(sum(part[3] for part in told))
        diagonal = np.empty(n)
        for place, part in zip(self.places, told, strict=True):
            diagonal[place] = part[2]
        self._diagonal = sealed(diagonal)
        # shared by all that is made of it by adding terms: when the last is gone, ranks forget theirs
        self._alive = Alive(own, key)

    def diagonal(self) -> Array:
        """Shape (n,)."""
        if self.added is None:
            return self._diagonal
        return np.asarray(self._diagonal + self.added.diagonal())

    def times(self, x: Array, absolute: bool = False) -> Array:
        """``K x`` or ``|K| x``: each rank is sent what its rows touch, and multiplies."""
        if x.ndim not in (1, 2) or len(x) != self.shape[0]:
            raise self.refused(
                f"it is multiplied with arrays ({self.shape[0]},), this one is {x.shape}"
            )
        parts = self.own.together(_times, (self.key, absolute), ([x[c]] for c in self.columns))
        out = np.empty(x.shape)
        for place, (rows,) in zip(self.places, parts, strict=True):
            out[place] = rows
        if self.added is not None:
            out += (abs(self.added) if absolute else self.added) @ x
        return out

    def rows(self, dofs: Any) -> csr_matrix:
        """Some rows, (len(dofs), n)."""
        dofs = np.arange(self.shape[0])[dofs].ravel()
        order, wanted = [], []
        for place in self.places:
            at = np.minimum(np.searchsorted(place, dofs), max(len(place) - 1, 0))
            mine = np.flatnonzero(place[at] == dofs) if len(place) else np.zeros(0, dtype=np.intp)
            order.append(mine)
            wanted.append([at[mine]])
        found = whole_rows(self.own.together(_taken, (self.key,), iter(wanted)), self.shape[0])
        back = np.empty(len(dofs), dtype=np.intp)
        back[np.concatenate(order)] = np.arange(len(dofs))
        some = csr_matrix(found[back])
        return some if self.added is None else csr_matrix(some + self.added[dofs])

    def on_ranks(self) -> RankedStiffness:
        """Without what is added."""
        return self._with(None)

    def __add__(self, other: Any) -> RankedStiffness:
        return self._with(csr_matrix(other if self.added is None else self.added + other))

    def _with(self, added: csr_matrix | None) -> RankedStiffness:
        twin = object.__new__(type(self))
        vars(twin).update(vars(self), added=added)
        return twin


class Alive:
    """Rows on all ranks as long as somebody has this."""

    def __init__(self, own: Ranks, key: int) -> None:
        weakref.finalize(self, own.drop, key)


# -- on every rank ----------------------------------------------------------------------------


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


def _times(own: Ranks, given: tuple[Any, ...], parts: list[Array]) -> list[Array]:
    key, absolute = given
    return [own.held[key].times(parts[0], absolute)]


def _taken(own: Ranks, given: tuple[Any, ...], parts: list[Array]) -> list[Array]:
    taken: list[Array] = own.held[given[0]].taken(parts[0])
    return taken
