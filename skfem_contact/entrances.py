"""The names that tests and extensions take from inside a package, by the package alone.

``from skfem_contact.pairing import dual_mortar``: in which module of a package a step of the theory
stands is the package's own matter, and a module that moves is one line in its `__init__`. Of these
names those in the package's `__all__` are public; the others are for tests, see docs/entrances.md.
Modules of the library import from each other by full names.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from importlib import import_module
from typing import Any


def entrances(
    package: str, public: Sequence[str], modules: Mapping[str, str]
) -> tuple[Callable[[str], Any], Callable[[], list[str]]]:
    """Return `__getattr__` and `__dir__` of a package that hands out names of its modules.

    They are imported when they are asked for; ``dir`` shows the public ones only. A module of another
    package has one more dot, ``".answers.result"``.

    >>> find, names = entrances("skfem_contact.bodies", [], {"facets": "twin_edges"})
    >>> find("twin_edges").__module__
    'skfem_contact.bodies.facets'
    """
    place = {name: module for module, names in modules.items() for name in names.split()}

    def find(name: str) -> Any:
        if name not in place:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        return getattr(import_module(f".{place[name]}", package), name)

    return find, lambda: [*public]
