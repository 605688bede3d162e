"""One BLAS thread for the many small dense blocks of contact problems.

Memory: how much a factorisation may take, before anything is known of it, and in words.
"""

from __future__ import annotations

from functools import lru_cache
from threading import Lock, local
from typing import Any

import numpy as np

from skfem_contact.records import dataclass

# Twice the bytes of the factors of squares over n log2 n, and of cubes over n^1.37: 3.2 GB are taken by
# a million DOFs in the plane; 0.21, 0.98 and 2.8 GB for 30 000, 95 000 and 202 000 in space.
FACTORS_2D, FACTORS_3D = 240.0, 300.0


class SingleThreaded:
    """The time in which BLAS has one thread: from the first who asks for it to the last who leaves.

    The dense blocks of contact problems are small: two threads spend their time waiting for each
    other and cost up to 30 times the CPU.

    The setting is one of the process as a rule. If everyone who came set it and took it back, one of
    two Python threads would take back what the other still needs, and the other leave one thread for
    good. Of a BLAS that has a setting for each Python thread every one takes back its own.
    """

    def __init__(self) -> None:
        self._lock, self._inside, self.taken = Lock(), 0, list[tuple[Any, int]]()
        self._own = _Own()

    def __enter__(self) -> None:
        own = self._own
        if not own.depth:
            with self._lock:
                for library in _blas().lib_controllers:
                    # asking takes a microsecond, setting twenty
                    if (count := library.num_threads) != 1:
                        (own if _of_each_thread(library) else self).taken.append((library, count))
                        _set(library, 1)
                self._inside += 1
        own.depth += 1

    def __exit__(self, *failed: object) -> None:
        own = self._own
        own.depth -= 1
        if not own.depth:
            _give_back(own.taken)
            with self._lock:
                self._inside -= 1
                if not self._inside:
                    _give_back(self.taken)


class _Own(local):
    """The number of times that a thread is inside, and what it has set for itself."""

    def __init__(self) -> None:
        self.depth, self.taken = 0, list[tuple[Any, int]]()


def _of_each_thread(library: Any) -> bool:
    """Return whether each Python thread has a setting of its own."""
    return library.internal_api == "mkl" or getattr(library, "threading_layer", "") == "openmp"


def _set(library: Any, count: int) -> None:
    library.set_num_threads(count)
    # threadpoolctl lets nobody but the thread that was first set it, until that gives it free
    free = getattr(library, "clear_controlling_thread", None)
    if free is not None:
        free()


def _give_back(taken: list[tuple[Any, int]]) -> None:
    while taken:
        _set(*taken.pop())


#: One for the process: BLAS has one thread as long as anybody is ``with`` it.
single_threaded = SingleThreaded()


@lru_cache(maxsize=1)
def _blas() -> Any:
    from threadpoolctl import ThreadpoolController  # it looks for libraries when it is imported

    return ThreadpoolController().select(user_api="blas")


@dataclass(frozen=True)
class Limits:
    """The memory that a solver may take [bytes]."""

    dense: float
    factors: float


def factor_bound(n: int, dim: int) -> float:
    """About twice what the factors of a body of n DOFs take in general [bytes].

    Where this is allowed, nobody needs to look closer.

    >>> f"{factor_bound(100_000, 3):.2g}", f"{factor_bound(100_000, 2):.2g}"
    ('2.1e+09', '4e+08')
    """
    if n < 2:
        return 0.0
    if dim < 3:
        return float(FACTORS_2D * n * np.log2(n))
    return float(FACTORS_3D * n**1.37)


def written_bytes(count: float) -> str:
    """A number of bytes with three digits.

    >>> written_bytes(80), written_bytes(1234567), written_bytes(3e9)
    ('80 B', '1.23 MB', '3 GB')
    """
    for unit, size in (("GB", 1e9), ("MB", 1e6), ("kB", 1e3)):
        if count >= size:
            return f"{count / size:.3g} {unit}"
    return f"{count:.0f} B"
