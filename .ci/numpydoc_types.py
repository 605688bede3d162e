"""Types of docstrings in words, ``ndarray, shape (m, d)``, which griffe takes for Python code."""

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


class NumpydocTypes(griffe.Extension):
    """Gives every parameter, attribute and return value its type in words."""

    def on_package(self, *, pkg: griffe.Module, **kwargs: Any) -> None:
        """Called once the whole package is loaded."""
        todo: list[Any] = [pkg]
        while todo:
            item = todo.pop()
            for section in item.docstring.parsed if item.docstring else ():
                for element in section.value if isinstance(section.value, list) else ():
                    annotation = getattr(element, "annotation", None)
                    if "shape(" in str(annotation):
                        element.annotation = in_words(annotation)
            todo += [member for member in item.members.values() if not member.is_alias]
