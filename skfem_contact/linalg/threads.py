"""One BLAS thread for the many small dense blocks of contact problems."""

from __future__ import annotations

import os
import sys
from contextlib import AbstractContextManager, nullcontext
from ctypes import CDLL, Structure, byref, c_char_p, c_void_p
from functools import lru_cache
from importlib.machinery import EXTENSION_SUFFIXES
from typing import Any

# Ends of the names of extension modules, with the version of Python in them: no BLAS is called so.
MODULES = tuple(suffix for suffix in EXTENSION_SUFFIXES if suffix.count(".") > 1)
ALONE: AbstractContextManager[Any] = nullcontext()  # has no state, so that one will do
RTLD_DI_LINKMAP = 2  # asks `dlinfo` for the list of loaded files


class LinkMap(Structure):
    """A loaded file in the list of the dynamic loader, as <link.h> has it."""

    _fields_ = (("address", c_void_p), ("name", c_char_p), ("section", c_void_p), ("next", c_void_p))


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
        threadpoolctl that calls the methods by other names asks of all of them, with the same answer.
        """

        def _load_libraries(self) -> None:
            files = loaded_files()
            for file in files:
                self._make_controller_from_path(file)
            if not files:
                super()._load_libraries()

        def _make_controller_from_path(self, filepath: str) -> None:
            if not filepath.endswith(MODULES):
                super()._make_controller_from_path(filepath)

    return Libraries().select(user_api="blas")


def loaded_files() -> list[str]:
    """Files that the dynamic loader lists, where it can be asked; otherwise none.

    threadpoolctl has them from /proc/self/maps, for which the kernel needs a millisecond.
    """
    if not sys.platform.startswith("linux"):
        return []
    program, place = CDLL(None), c_void_p()
    if not hasattr(program, "dlinfo"):  # in a library of its own before glibc 2.34
        return []
    if program.dlinfo(c_void_p(program._handle), RTLD_DI_LINKMAP, byref(place)):
        return []
    files = []
    while place:
        entry = LinkMap.from_address(place.value or 0)
        files.append(os.fsdecode(entry.name or b""))
        place = c_void_p(entry.next)
    return [file for file in files if file]  # the program itself has no name
