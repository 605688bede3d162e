"""`StackedStiffness`: the stiffness of all bodies, by rows on ranks."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import block_diag, csr_matrix, diags, vstack

from skfem_contact.bodies.member import Member
from skfem_contact.elimination.constraint import AffineConstraint
from skfem_contact.linalg.backend import Stacked
from skfem_contact.linalg.distributed.assembly import adopted
from skfem_contact.linalg.distributed.layout import Layout, together
from skfem_contact.linalg.distributed.ranks import Ranks
from skfem_contact.linalg.distributed.reduction import ReducedStiffness, reduced
from skfem_contact.linalg.distributed.stack import Stack
from skfem_contact.linalg.distributed.stiffness import Alive, RankedStiffness

Array = NDArray[np.float64]
Index = NDArray[Any]


class StackedStiffness(Stacked):
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
        self.parts = [part.on_ranks() for part in parts]
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
        """See `reduction`."""
        return reduced(self, trial, f, test)

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


# -- on every rank ----------------------------------------------------------------------------


def _stack(own: Ranks, given: tuple[Any, ...], parts: list[Any]) -> list[Any]:
    key, keys, size = given
    (begin, here), motions, *slots = parts
    rows = [own.held[part] for part in keys]
    own.held[key] = Stack(rows, slots, motions, int(begin), int(here), size)
    return []
