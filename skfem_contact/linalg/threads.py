"""One BLAS thread for the many small dense blocks of contact problems."""

from __future__ import annotations

from contextlib import AbstractContextManager, nullcontext
from functools import lru_cache
from importlib.machinery import EXTENSION_SUFFIXES
from typing import Any

# Ends of the names of extension modules, with the version of Python in them: no BLAS is called so.
MODULES = tuple(suffix for suffix in EXTENSION_SUFFIXES if suffix.count(".") > 1)
ALONE: AbstractContextManager[Any] = nullcontext()  # has no state, so that one will do


def single_threaded() -> AbstractContextManager[Any]:
    """Limit BLAS to one thread.

    The dense blocks of contact problems are small: two threads spend their time waiting for each
    other and cost up to 30 times the CPU.
    """
    blas = _blas()
    # asking takes a microsecond, limiting twenty
    for library in blas.lib_controllers:
        if library.num_threads != 1:
            limited: AbstractContextManager[Any] = blas.limit(limits=1)
            return limited
    return ALONE


@lru_cache(maxsize=1)
def _blas() -> Any:
    from threadpoolctl import ThreadpoolController  # it looks for libraries when it is imported

    class Libraries(ThreadpoolController):
        """Asks of all loaded files but extension modules, nine in ten, whether they are a BLAS.

        A process that uses SciPy has loaded a hundred files, and to ask takes 50 microseconds each. A
        threadpoolctl that calls the method by another name asks of all of them, with the same answer.
        """

        def _make_controller_from_path(self, filepath: str) -> None:
            if not filepath.endswith(MODULES):
                super()._make_controller_from_path(filepath)

    return Libraries().select(user_api="blas")
