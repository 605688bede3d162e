"""One BLAS thread for the many small dense blocks of contact problems."""

from __future__ import annotations

from contextlib import AbstractContextManager, nullcontext
from functools import lru_cache
from typing import Any


def single_threaded() -> AbstractContextManager[Any]:
    """Limit BLAS to one thread.

    The dense blocks of contact problems are small: two threads spend their time waiting for each
    other and cost up to 30 times the CPU.
    """
    blas = _blas()
    # asking takes a microsecond, limiting twenty
    if all(library.num_threads == 1 for library in blas.lib_controllers):
        return nullcontext()
    limited: AbstractContextManager[Any] = blas.limit(limits=1)
    return limited


@lru_cache(maxsize=1)
def _blas() -> Any:
    from threadpoolctl import ThreadpoolController  # it looks for libraries when it is imported

    return ThreadpoolController().select(user_api="blas")
