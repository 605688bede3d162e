"""The names that tests and extensions take from inside a package, by the package alone.

``from skfem_contact.pairing import dual_mortar``: in which module of a package a step of the theory
stands is the package's own matter, and a module that moves is one line in its `__init__`. None of these
names is public, see docs/entrances.md. Modules of the library import from each other by full names.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from importlib import import_module
from typing import Any


def entrances(package: str, modules: Mapping[str, str]) -> Callable[[str], Any]:
    """The `__getattr__` of a package that hands out names of its modules, imported when asked for.

    >>> find = entrances("skfem_contact.bodies", {"normals": "angle_between tangents"})
    >>> find("tangents").__module__
    'skfem_contact.bodies.normals'
    """
    place = {name: module for module, names in modules.items() for name in names.split()}

    def find(name: str) -> Any:
        if name not in place:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        return getattr(import_module(f"{package}.{place[name]}"), name)

    return find
