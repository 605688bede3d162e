"""The stiffness of a body whose rows are on all ranks.

`RankedStiffness` is what rank 0 knows of it, `Rows` what each rank holds.

`Layout` says which rows that are. The nodes are parted by recursive coordinate bisection: ranks hold
compact regions, across bodies, so that few of the entries couple two of them. Where the rows are those
of nodes with d components, a node keeps d rows even if some of its DOFs are prescribed or eliminated:
multigrid then works on nodes, which halves its set-up. Rows of DOFs that are gone have nothing but a
diagonal entry.
"""

from __future__ import annotations

import weakref
from collections.abc import Iterator
from typing import Any, NoReturn

import numpy as np
from scipy.sparse import csr_matrix, vstack
from scipy.sparse.csgraph import connected_components

from skfem_contact.arrays import Array, Index
from skfem_contact.bodies.member import RemoteStiffness
from skfem_contact.digits import SOLVED
from skfem_contact.errors import InputError
from skfem_contact.petsc.ranks import Ranks, csr_of
from skfem_contact.records import dataclass, sealed

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
        taken = self.own.together(_taken, (self.key,), iter(wanted))
        found = vstack(
            [csr_of(part, (len(part[0]) - 1, self.shape[0])) for part in taken], format="csr"
        )
        back = np.empty(len(dofs), dtype=np.intp)
        back[np.concatenate(order)] = np.arange(len(dofs))
        some = csr_matrix(found[back])
        return some if self.added is None else csr_matrix(some + self.added[dofs])

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


def _times(own: Ranks, given: tuple[Any, ...], parts: list[Array]) -> list[Array]:
    key, absolute = given
    return [own.held[key].times(parts[0], absolute)]


def _taken(own: Ranks, given: tuple[Any, ...], parts: list[Array]) -> list[Array]:
    taken: list[Array] = own.held[given[0]].taken(parts[0])
    return taken


# -- rows of all ranks -----------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Layout:
    """The rows of all ranks, those of rank 0 first.

    Attributes
    ----------
    slot : ndarray of int, shape (n,)
        Row of each DOF.
    starts : ndarray of int, shape (ranks + 1,)
        First row of each rank, and the number of rows.
    block : int
        Rows of a node.
    """

    slot: Index
    starts: Index
    block: int

    @classmethod
    def of(cls, n: int, points: Array | None, modes: Array | None, ranks: int) -> Layout:
        """Rows of n DOFs at these points (n, d), which the rigid `modes` (n, k) tell apart.

        Examples
        --------
        Two nodes in the plane, of which the first is guided; each rank holds one of them:

        >>> points = np.array([[0.0, 1.0], [1.0, 0.0], [1.0, 0.0]])
        >>> modes = np.array([[0.0, 1.0, -0.5], [1.0, 0.0, 0.5], [0.0, 1.0, 0.5]])
        >>> layout = Layout.of(3, points, modes, 2)
        >>> layout.slot.tolist(), layout.starts.tolist(), layout.block
        ([1, 2, 3], [0, 2, 4], 2)
        """
        if points is None:
            return cls(np.arange(n), np.arange(ranks + 1) * n // ranks, 1)
        component, block = _components(n, points, modes)
        first = np.ones(n, dtype=bool)
        if n:
            first[1:] = np.any(points[1:] != points[:-1], axis=1)
            if block > 1 and modes is not None:
                body = bodies_of(modes)[1]
                first[1:] |= (body[1:] != body[:-1]) | (component[1:] <= component[:-1])
        if block == 1:
            first[:] = True  # a row is a node
        node = np.cumsum(first) - 1
        part = bisected(points[first], ranks)
        order = np.argsort(part, kind="stable")
        number = np.empty(len(order), dtype=np.intp)
        number[order] = np.arange(len(order))
        starts = block * np.searchsorted(part[order], np.arange(ranks + 1))
        return cls(block * number[node] + component, starts, block)

    @property
    def size(self) -> int:
        """Number of rows of all ranks together."""
        return int(self.starts[-1])

    def check_size(self, nnz: int, most: int) -> None:
        """Refuse so many entries where PETSc's integers count to `most`."""
        ranks = len(self.starts) - 1
        if max(self.size, nnz // ranks) > most:
            raise InputError(
                f"{nnz} entries in {self.size} rows on {ranks} ranks are more than the integers of "
                f"this PETSc can count, {most} on each: use more ranks, or a PETSc with 64-bit indices."
            )

    def vectors(self, x: Array) -> Iterator[Array]:
        """The rows (rows of the rank, ...) of one rank after the other of a vector, or of columns."""
        rows = np.zeros((self.size, *x.shape[1:]))
        rows[self.slot] = x
        return (rows[begin:end] for begin, end in zip(self.starts, self.starts[1:], strict=False))

    def matrices(self, A: csr_matrix) -> Iterator[csr_matrix]:
        """The rows of one rank after the other of a matrix; only one piece exists at a time."""
        dof = np.full(self.size, -1)
        dof[self.slot] = np.arange(len(self.slot))
        typical = float(np.abs(A.diagonal()).mean()) if A.shape[0] else 0.0
        for begin, end in zip(self.starts, self.starts[1:], strict=False):
            yield self._matrix(A, dof[begin:end], int(begin), typical or 1.0)

    def _matrix(self, A: csr_matrix, dofs: Index, begin: int, typical: float) -> csr_matrix:
        there = dofs >= 0
        own = A[dofs[there]]
        length = np.ones(len(dofs), dtype=np.intp)
        length[there] = np.diff(own.indptr)
        indptr = np.concatenate([[0], np.cumsum(length)])
        alone = indptr[:-1][~there]
        entries = np.ones(indptr[-1], dtype=bool)
        entries[alone] = False
        data, indices = np.empty(indptr[-1]), np.empty(indptr[-1], dtype=np.intp)
        data[entries], indices[entries] = own.data, self.slot[own.indices]
        data[alone], indices[alone] = typical, begin + np.flatnonzero(~there)
        piece = csr_matrix((data, indices, indptr), shape=(len(dofs), self.size))
        piece.sort_indices()
        return piece


def _components(n: int, points: Array, modes: Array | None) -> tuple[Index, int]:
    """Component of each DOF and rows of a node, by the translations among the rigid motions."""
    d = points.shape[1]
    if modes is not None and d > 1:
        translations = together(modes)[:, :d] != 0
        if translations.shape[1] == d and np.all(translations.sum(axis=1) == 1):
            return np.argmax(translations, axis=1), d
    return np.zeros(n, dtype=np.intp), 1


def bisected(points: Array, parts: int) -> Index:
    """Number of the part of each point, by halving along the longest side again and again.

    >>> bisected(np.array([[0.0, 0.0], [3.0, 0.0], [1.0, 1.0], [2.0, 1.0]]), 2).tolist()
    [0, 1, 0, 1]
    """
    part = np.zeros(len(points), dtype=np.intp)

    def split(index: Index, first: int, count: int) -> None:
        part[index] = first
        if count == 1 or not len(index):
            return
        half = count // 2
        axis = int(np.argmax(np.ptp(points[index], axis=0)))
        order = index[np.argsort(points[index, axis], kind="stable")]
        cut = len(order) * half // count
        split(order[:cut], first, half)
        split(order[cut:], first + half, count - half)

    split(np.arange(len(points)), 0, parts)
    return part


def bodies_of(modes: Array) -> tuple[Index, Index]:
    """Number of the body of each rigid motion (k,) and of each DOF (n,); a motion moves one body.

    >>> [part.tolist() for part in bodies_of(np.array([[1.0, 0.2, 0.0], [0.0, 0.0, 1.0]]))]
    [[0, 0, 1], [0, 1]]
    """
    moves = csr_matrix(modes != 0, dtype=np.int32)
    _, body = connected_components(moves.T @ moves, directed=False)
    column = np.argmax(modes != 0, axis=1) if modes.shape[1] else np.zeros(len(modes), dtype=np.intp)
    return body, body[column] if modes.shape[1] else column


def together(modes: Array) -> Array:
    """Rigid motions of all bodies at once, as few columns as the body with most of them has.

    Multigrid looks at motions of single aggregates of nodes, for which that is the same.
    """
    body, _ = bodies_of(modes)
    columns = [np.flatnonzero(body == i) for i in range(body.max(initial=-1) + 1)]
    out = np.zeros((len(modes), max(map(len, columns), default=0)))
    for own in columns:
        out[:, : len(own)] += modes[:, own]
    return out


def directions(modes: Array) -> Array:
    """Orthonormal columns that span the rigid motions of all bodies at once, (n, k)."""
    modes = together(modes)
    length = np.linalg.norm(modes, axis=0)
    modes = modes[:, length > 0] / length[length > 0]
    Q, R = np.linalg.qr(modes)
    # others follow from these on the DOFs that are left, and are no directions of their own
    return np.ascontiguousarray(Q[:, np.abs(R.diagonal()) > SOLVED])


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
        if length > SOLVED:
            kept.append(column / length)
    return np.ascontiguousarray(np.column_stack(kept)) if kept else np.zeros((len(columns), 0))
