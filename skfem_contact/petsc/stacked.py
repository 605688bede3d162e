r"""The stiffness of all bodies, by rows on ranks, and its ``V'KT``.

With the free DOFs c that neither trial nor test space eliminates, their projection P, and the others d,

    V'KT = P K P + P K_d' T_d + V_d' (K_d P + K_dd T_d).

The first is on the ranks: rows of K without what is prescribed or eliminated (`Stack`). The rest needs
the rows of d alone, DOFs of the contact: rank 0 (`StackedStiffness`) fetches them, makes it
(`ReducedStiffness`), and sends each rank its rows.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import block_diag, csr_matrix, diags, vstack

from skfem_contact.arrays import Array, Mask
from skfem_contact.bodies.member import Member
from skfem_contact.elimination.constraint import AffineConstraint
from skfem_contact.linalg.backend import Stacked
from skfem_contact.petsc.assembly import adopted
from skfem_contact.petsc.ranks import Ranks, csr_of
from skfem_contact.petsc.share import Settings
from skfem_contact.petsc.stiffness import (
    Alive,
    DistributedStiffness,
    Layout,
    RankedStiffness,
    Rows,
    orthonormal,
    together,
)
from skfem_contact.records import dataclass

Index = NDArray[Any]


class StackedStiffness(DistributedStiffness, Stacked):
    """Block diagonal stiffness of all bodies, and sparse terms on rank 0.

    Parameters
    ----------
    bodies : sequence of Member
    parts : sequence of RankedStiffness
        Of each body.
    uses_modes : bool
        Whether the solver looks at rigid motions.
    further : csr_matrix, shape (q, n), optional
        Unknowns that are no DOFs, on rank 0: what each is of the DOFs.
    """

    added: csr_matrix | None = None

    def __init__(
        self,
        bodies: Sequence[Member],
        parts: Sequence[RankedStiffness],
        uses_modes: bool,
        further: csr_matrix | None = None,
    ) -> None:
        self.bodies, self.uses_modes = bodies, uses_modes
        self.parts = [part._with(None) for part in parts]  # without what is added
        self.offsets = np.concatenate([[0], np.cumsum([len(part.diagonal()) for part in parts])])
        self.own: Ranks = parts[0].own
        q = 0 if further is None else further.shape[0]
        n = int(self.offsets[-1]) + q
        self.shape, self.nnz = (n, n), sum(part.nnz for part in parts)
        self.layout = self._layout(q)
        self.key = self.own.number()
        given = self.key, [part.key for part in self.parts], self.layout.size
        self.own.together(_stack, given, self._pieces(further))
        self._alive = Alive(self.own, self.key)
        if any(part.added is not None for part in parts):
            added = [csr_matrix(part.shape) if part.added is None else part.added for part in parts]
            self.added = block_diag([*added, csr_matrix((q, q))], format="csr")

    @classmethod
    def of(
        cls, bodies: Sequence[Member], stiffness: Sequence[Any], uses_modes: bool
    ) -> StackedStiffness:
        """Of bodies of which some have their whole stiffness on rank 0, as rigid ones do."""
        own = next(K.own for K in stiffness if isinstance(K, RankedStiffness))
        parts = [K if isinstance(K, RankedStiffness) else adopted(own, K) for K in stiffness]
        return cls(bodies, parts, uses_modes)

    def bordered(self, B: csr_matrix) -> StackedStiffness:
        """With further unknowns ``w = B u``, without stiffness but for what is added to all."""
        return StackedStiffness(self.bodies, self._with_terms(), self.uses_modes, B)

    def reduced(
        self, trial: AffineConstraint, f: Array, test: AffineConstraint
    ) -> tuple[ReducedStiffness, Array]:
        """``V'KT`` and ``V'(f - K c)``, rows in the order of the unknowns of the trial space."""
        place = _order(trial.independent, test.independent)
        f_r = np.empty(len(place))
        f_r[place] = test.T.T @ (f - self.times(trial.c))
        core = np.ones(self.shape[0], dtype=bool)
        gone = np.union1d(trial.dependent, test.dependent)
        core[trial.prescribed] = core[gone] = False
        T = _wide(trial.T, trial.independent)
        V = T if test is trial else _wide(test.T, trial.independent[place])
        rows = self.rows_on_ranks(gone)
        inside = _columns(rows, core)
        across = csr_matrix(rows[:, gone])
        change = inside.T @ T[gone] + V[gone].T @ (inside + across @ T[gone])
        if self.added is not None:
            change = change + V.T @ (self.added @ T)
        return ReducedStiffness(self, trial.independent, core, csr_matrix(change)), f_r

    def among(self, dofs: Index) -> ReducedStiffness:
        """Rows and columns of some DOFs, ascending, of each body by itself."""
        core = np.zeros(self.shape[0], dtype=bool)
        core[dofs] = True
        change = csr_matrix(self.shape)
        if self.added is not None:
            chosen = diags(core.astype(float))
            change = csr_matrix(chosen @ self.added @ chosen)
        return ReducedStiffness(self, dofs, core, change)

    def _with_terms(self) -> list[RankedStiffness]:
        if self.added is None:
            return self.parts
        spans = zip(self.offsets, self.offsets[1:], strict=False)
        terms = [self.added[a:b, a:b] for a, b in spans]
        return [part + own for part, own in zip(self.parts, terms, strict=True)]

    def _layout(self, q: int) -> Layout:
        """Rows of each rank: those of one body after the other, and further ones on rank 0."""
        slot = np.empty(self.shape[0], dtype=np.intp)
        starts = np.zeros(self.own.size + 1, dtype=np.intp)
        for rank in range(self.own.size):
            begin = starts[rank]
            for part, offset in zip(self.parts, self.offsets, strict=False):
                place = part.places[rank]
                slot[offset + place] = begin + np.arange(len(place))
                begin += len(place)
            if rank == 0 and q:
                slot[-q:] = begin + np.arange(q)
                begin += q
            starts[rank + 1] = begin
        return Layout(slot, starts, 1 if q else self._block())

    def _block(self) -> int:
        """Rows of a node, where all ranks have whole nodes one after the other."""
        d = self.bodies[0].components
        for body, part in zip(self.bodies, self.parts, strict=True):
            points, component = body.dof_points, body.dof_component
            for place in part.places:
                if len(place) % d or (component[place] != np.arange(len(place)) % d).any():
                    return 1
                nodes = points[place].reshape(-1, d, points.shape[1])
                if np.any(nodes != nodes[:, :1]):
                    return 1
        return d

    def _pieces(self, further: csr_matrix | None) -> Iterator[list[Array]]:
        """For each rank: its first row and their number, motions, and where its columns are."""
        motions = [np.zeros((body.n, 0)) for body in self.bodies]
        if self.uses_modes:
            motions = [together(body.rigid_modes) for body in self.bodies]
        most = max(own.shape[1] for own in motions)
        for rank in range(self.own.size):
            begin, end = self.layout.starts[rank : rank + 2]
            rows = np.zeros((end - begin, most))
            at = 0
            for own, part in zip(motions, self.parts, strict=True):
                place = part.places[rank]
                rows[at : at + len(place), : own.shape[1]] = own[place]
                at += len(place)
            if rank == 0 and further is not None:
                wide = [np.pad(own, ((0, 0), (0, most - own.shape[1]))) for own in motions]
                rows[at:] = further @ np.concatenate(wide)
            slots = [
                self.layout.slot[offset + part.columns[rank]]
                for part, offset in zip(self.parts, self.offsets, strict=False)
            ]
            yield [np.array([begin, end - begin]), rows, *slots]

    def diagonal(self) -> Array:
        """Shape (n,)."""
        out = self.diagonal_on_ranks()
        return out if self.added is None else out + self.added.diagonal()

    def diagonal_on_ranks(self) -> Array:
        """Without what is added, shape (n,)."""
        out = np.zeros(self.shape[0])
        out[: self.offsets[-1]] = np.concatenate([part.diagonal() for part in self.parts])
        return out

    def times(self, x: Array, absolute: bool = False) -> Array:
        """``K x``, or ``|K| x``."""
        spans = zip(self.parts, self.offsets, self.offsets[1:], strict=False)
        out = np.zeros(x.shape)
        for part, begin, end in spans:
            out[begin:end] = part.times(x[begin:end], absolute)
        if self.added is not None:
            out += (abs(self.added) if absolute else self.added) @ x
        return out

    def rows(self, dofs: Any) -> csr_matrix:
        """Some rows, (len(dofs), n)."""
        some = self.rows_on_ranks(np.arange(self.shape[0])[dofs].ravel())
        return some if self.added is None else csr_matrix(some + self.added[dofs])

    def rows_on_ranks(self, dofs: Index) -> csr_matrix:
        """Some rows without what is added, (len(dofs), n)."""
        blocks, order = [], []
        for part, begin, end in zip(self.parts, self.offsets, self.offsets[1:], strict=False):
            mine = np.flatnonzero((dofs >= begin) & (dofs < end))
            rows = part.rows(dofs[mine] - begin)
            entries = rows.data, rows.indices + begin, rows.indptr
            blocks.append(csr_matrix(entries, shape=(len(mine), self.shape[0])))
            order.append(mine)
        further = np.flatnonzero(dofs >= self.offsets[-1])
        blocks.append(csr_matrix((len(further), self.shape[0])))
        back = np.argsort(np.concatenate([*order, further]))
        return csr_matrix(vstack(blocks, format="csr")[back])

    def __add__(self, other: Any) -> StackedStiffness:
        twin = object.__new__(type(self))
        vars(twin).update(vars(self))
        twin.added = csr_matrix(other if self.added is None else self.added + other)
        return twin


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
    """Return the partner of each unknown of the test space in the trial space: itself if there.

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


def _stack(own: Ranks, given: tuple[Any, ...], parts: list[Any]) -> list[Any]:
    key, keys, size = given
    (begin, here), motions, *slots = parts
    rows = [own.held[part] for part in keys]
    own.held[key] = Stack(rows, slots, motions, int(begin), int(here), size)
    return []


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
