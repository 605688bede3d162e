"""`RankedStiffness`: what rank 0 knows of a stiffness whose rows are on all ranks."""

from __future__ import annotations

import weakref
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix

from skfem_contact.bodies.distributed import DistributedStiffness, refused
from skfem_contact.linalg.distributed.ranks import Ranks
from skfem_contact.linalg.distributed.rows import whole_rows
from skfem_contact.sealed import sealed

Array = NDArray[np.float64]
Index = NDArray[np.intp]


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

    def __init__(self, own: Ranks, key: int, told: list[list[Array]]) -> None:
        self.own, self.key = own, key
        self.places = [part[0].astype(np.int32, copy=False) for part in told]
        self.columns = [part[1].astype(np.int32, copy=False) for part in told]
        n = sum(map(len, self.places))
        self.shape = n, n
        self.nnz = int(sum(part[3][0] for part in told))
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
            raise refused(f"it is multiplied with arrays ({self.shape[0]},), this one is {x.shape}")
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


def _times(own: Ranks, given: tuple[Any, ...], parts: list[Array]) -> list[Array]:
    key, absolute = given
    return [own.held[key].times(parts[0], absolute)]


def _taken(own: Ranks, given: tuple[Any, ...], parts: list[Array]) -> list[Array]:
    taken: list[Array] = own.held[given[0]].taken(parts[0])
    return taken
