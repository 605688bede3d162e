"""One BLAS thread for the many small dense blocks of contact problems."""

from __future__ import annotations

from contextlib import AbstractContextManager, nullcontext
from functools import lru_cache
from typing import Any


def single_threaded() -> AbstractContextManager[Any]:
    """Limit BLAS to one thread, where ``threadpoolctl`` is installed.

    The dense blocks of contact problems are small: two threads spend their time waiting for each
    other and cost up to 30 times the CPU.
    """
    blas = _blas()
    # asking takes a microsecond, limiting twenty
    if blas is None or all(library.num_threads == 1 for library in blas.lib_controllers):
        return nullcontext()
    limited: AbstractContextManager[Any] = blas.limit(limits=1)
    return limited


@lru_cache(maxsize=1)
def _blas() -> Any:
    try:
        from threadpoolctl import ThreadpoolController  # optional: without it BLAS does as it likes
    except ImportError:
        return None
    return ThreadpoolController().select(user_api="blas")
