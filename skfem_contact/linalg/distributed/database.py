"""PETSc's options database: what the command line says, what solves add, what PETSc has read of it."""

from __future__ import annotations

import ctypes
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

PREFIX = "sc_"


def command_line() -> list[str]:
    """What the command line says to PETSc: ``-sc_...`` and its values."""
    given, ours = [sys.argv[0] if sys.argv else ""], False
    for word in sys.argv[1:]:
        if word.startswith("-") and not word[1:2].isdigit():
            ours = word.lstrip("-").startswith(PREFIX)
            word = "-" + word.lstrip("-") if ours else word
        if ours:
            given.append(word)
    return given


class Database:
    """The database of this process.

    Attributes
    ----------
    read : dict
        Of each option that solves have added, without hyphen, whether PETSc has read it so far.
    """

    def __init__(self, PETSc: Any) -> None:
        self.PETSc, self.options = PETSc, PETSc.Options()
        self.read: dict[str, bool] = {}
        # where the script has used petsc4py before, PETSc has not been told of the command line by us
        present = self.options.getAll()
        name = ""
        for word in command_line()[1:]:
            if word.startswith("-" + PREFIX):
                name = word[1:]
                if name not in present:
                    self.options[name] = ""
            elif name and name not in present:
                self.options[name], name = word, ""

    @contextmanager
    def added(self, defaults: Mapping[str, str], options: Mapping[str, str]) -> Iterator[None]:
        """With these, without prefix, as far as the command line does not say otherwise."""
        given = self.options.getAll()  # the command line, and the variable PETSC_OPTIONS
        own = {PREFIX + name: value for name, value in {**defaults, **options}.items()}
        own = {name: value for name, value in own.items() if name not in given}
        for name, value in own.items():
            self.options[name] = value
        try:
            yield
        finally:
            for name in own:
                if name.removeprefix(PREFIX) in options:
                    self.read[name] = self.read.get(name, False) or self._has_read(name)
                self.options.delValue(name)

    def unread(self) -> list[str]:
        """Options of ours that PETSc has never looked for."""
        given = [name for name in self.options.getAll() if name.startswith(PREFIX)]
        names = [name for name in given if not self._has_read(name)]
        return sorted({*names, *(name for name, read in self.read.items() if not read)})

    def _has_read(self, name: str) -> bool:
        """petsc4py does not say so, PETSc does; what can not be asked counts as read."""
        try:
            ask = ctypes.CDLL(self.PETSc.__file__).PetscOptionsUsed
        except (OSError, AttributeError):
            return True
        answer = (ctypes.c_int * 2)()
        ask.argtypes = ctypes.c_void_p, ctypes.c_char_p, ctypes.c_void_p
        return bool(ask(None, name.encode(), answer)) or any(answer)
