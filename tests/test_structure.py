"""The modules stand in the order of the theory: each imports only from those above it."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

import skfem_contact

ROOT = Path(skfem_contact.__file__).parent
LISTED = re.findall(
    r"`(\w+)`", skfem_contact.__doc__.split("each imports only from those above it:")[1]
)
ORDER = [name for name in LISTED if name != "reference"]


def imports(path):
    """Modules of this package that a file imports when it is imported itself."""
    found = set()
    for node in ast.parse(path.read_text()).body:
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("skfem_contact"):
            _, *inside = node.module.split(".")
            found |= {inside[0]} if inside else {alias.name for alias in node.names}
    return found


def test_every_module_is_listed_once():
    """The list of modules in the package's docstring is complete and has none that do not exist."""
    assert sorted(ORDER) == sorted(path.stem for path in ROOT.glob("*.py") if path.stem != "__init__")


@pytest.mark.parametrize("name", ORDER)
def test_modules_import_only_from_those_above(name):
    """No module depends on one that comes later; what functions import when called does not count."""
    above = set(ORDER[: ORDER.index(name)])
    assert imports(ROOT / f"{name}.py") <= above


def test_closed_forms_depend_on_nothing():
    """The closed forms are independent of what they are compared with."""
    for path in (ROOT / "reference").glob("*.py"):
        assert imports(path) <= {"reference", "errors"}
