"""Functions of the user's where bodies, solvers and results are pickled: process pools, joblib, files.

Pickle knows a function by its name. Lambdas and functions within functions, such as the forms that
scikit-fem makes, have none to be found by; they stay behind, and what needs them later says so.
"""

from __future__ import annotations

import pickle
from dataclasses import fields
from typing import Any, TypeVar

from skfem_contact.errors import InputError
from skfem_contact.records import dataclass

T = TypeVar("T")


class ByFields:
    """Of dataclasses: they travel by their fields; what they have found out is found out again.

    >>> @dataclass
    ... class Square(ByFields):
    ...     side: float
    >>> square = Square(2.0)
    >>> square.area = 4.0
    >>> square.__getstate__()
    {'side': 2.0}
    """

    def __getstate__(self) -> dict[str, Any]:
        known = vars(self)
        return {field.name: known[field.name] for field in fields(self)}  # type: ignore[arg-type]


def copied(value: T, **changed: Any) -> T:
    """A dataclass with its fields or others; what it has found out is left out, nothing is checked.

    For what every load step makes: `dataclasses.replace` takes ten times as long.

    >>> copied(LeftBehind("gap"), what="measure")
    LeftBehind(what='measure')
    """
    known, copy = vars(value), object.__new__(type(value))
    names = value.__dataclass_fields__  # type: ignore[attr-defined]
    vars(copy).update({name: known[name] for name in names} | changed)
    return copy


@dataclass(frozen=True)
class LeftBehind:
    """In place of a function that could not be carried along; an error where it is called."""

    what: str

    def __call__(self, *given: Any) -> Any:
        raise InputError(
            f"{self.what} is a function that was left behind when this was pickled or copied: pickle "
            "finds functions by their name in a module, and lambdas and functions within functions "
            "have none. Define it by def at the top of a module, or make the solver where it is used."
        )


def carried(function: Any, what: str) -> Any:
    """The function itself where pickle can take it along, and else what says that it is missing.

    Anything that is no function stays what it is.

    >>> carried(abs, "measure"), carried(lambda x: x, "measure"), carried(0.5, "gap")
    (<built-in function abs>, LeftBehind(what='measure'), 0.5)
    """
    return function if not callable(function) or can_be_carried(function) else LeftBehind(what)


def can_be_carried(thing: Any) -> bool:
    """Return whether pickle takes it."""
    try:
        pickle.dumps(thing)
    except (pickle.PicklingError, AttributeError, TypeError):
        return False
    return True
