"""What griffe is told of this library.

Types of docstrings in words, ``ndarray, shape (m, d)``, which it takes for Python code; the words of
properties that are made by `its`; and dataclasses that are made later.
"""

from __future__ import annotations

import re
from typing import Any

import griffe


def in_words(annotation: Any) -> str:
    """The type as it was written, from the tuple and the call that it was taken for."""
    text = str(annotation)
    if text.startswith("(") and text.endswith(")"):
        text = text[1:-1]
    text = re.sub(r"\bshape\(", "shape (", text)
    return re.sub(r"shape \((\w+)\)", r"shape (\1,)", text)


def words_of(attribute: Any) -> griffe.Docstring | None:
    """The words of a property that is made by ``gap: Array = its()``, as it has them."""
    made = attribute.value
    if not isinstance(made, griffe.ExprCall) or str(made.function) != "its":
        return None
    attribute.value = None
    words = f"The `{attribute.name}` of the only contact, see `ContactValues.{attribute.name}`."
    return griffe.Docstring(words, parent=attribute)


class NumpydocTypes(griffe.Extension):
    """Gives every parameter, attribute and return value its type in words."""

    def on_module_members(self, *, mod: griffe.Module, **kwargs: Any) -> None:
        """Called once the members of a module are known: where its `dataclass` comes from."""
        found = mod.members.get("dataclass")
        if isinstance(found, griffe.Alias) and found.target_path == "skfem_contact.records.dataclass":
            found.target_path = "dataclasses.dataclass"

    def on_package(self, *, pkg: griffe.Module, **kwargs: Any) -> None:
        """Called once the whole package is loaded."""
        todo: list[Any] = [pkg]
        while todo:
            item = todo.pop()
            if item.is_attribute:
                item.docstring = item.docstring or words_of(item)
            for section in item.docstring.parsed if item.docstring else ():
                for element in section.value if isinstance(section.value, list) else ():
                    annotation = getattr(element, "annotation", None)
                    if "shape(" in str(annotation):
                        element.annotation = in_words(annotation)
            todo += [member for member in item.members.values() if not member.is_alias]
