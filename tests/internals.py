"""Numbers and functions inside a package of the library by their names, in whatever module they stand.

Some tests take the way of large meshes on a small one, and turn the number that decides; others count
how often something is done, and put a function of their own in its place. Neither is about a module: a
number or a function has one name in its package, and is replaced in every module that has it.
"""

from __future__ import annotations

import sys
from functools import reduce
from importlib import import_module
from pkgutil import walk_packages
from typing import Any

import pytest

LIBRARY = "skfem_contact."


def modules_with(package: str, name: str) -> list[Any]:
    """The modules that have what goes by a name in one of the packages, of which all are imported."""
    path = getattr(import_module(LIBRARY + package), "__path__", [])  # none of a module
    for found in walk_packages(path, f"{LIBRARY}{package}."):
        import_module(found.name)
    known = {at: m for at, m in sys.modules.items() if at.startswith(LIBRARY) and name in vars(m)}
    known = {at: m for at, m in known.items() if not hasattr(m, "__path__")}  # a package has modules
    own = [vars(m)[name] for at, m in known.items() if f"{at}.".startswith(f"{LIBRARY}{package}.")]
    assert own, f"no module of {package} has {name}"
    assert all(one is own[0] for one in own), f"{name} is several things in {package}"
    return [module for module in known.values() if vars(module)[name] is own[0]]


def original(where: str) -> Any:
    """What a name stands for, or its attribute: `answers.SAGITTA`, `history.Stepper.attempt`."""
    package, name, *attributes = where.split(".")
    return reduce(getattr, attributes, vars(modules_with(package, name)[0])[name])


def beside(known: Any, name: str) -> Any:
    """A private function that stands beside another one, in whatever module that is."""
    return vars(sys.modules[known.__module__])[name]


def replace(monkeypatch: pytest.MonkeyPatch, where: str, value: Any) -> None:
    """Another number, function or attribute of a class in its place, until the test ends."""
    package, name, *attributes = where.split(".")
    if attributes:
        monkeypatch.setattr(original(f"{package}.{name}"), *attributes, value)
        return
    for module in modules_with(package, name):
        monkeypatch.setattr(module, name, value)
