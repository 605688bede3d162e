"""Values that never change: copies of what users give, and arrays that refuse writing; and pickles.

A result is as good as long as all that it was computed from is what it was. NumPy refuses to write
into a sealed array: ``result.u *= 2`` is an error where it is written, ``u = 2 * result.u`` is not.

Bodies, solvers and results are pickled by process pools, joblib and for files. Pickle knows a function
by its name. Lambdas and functions within functions, such as the forms that scikit-fem makes, have none
to be found by; they stay behind, and what needs them later says so.
"""

from __future__ import annotations

import pickle
from dataclasses import fields
from typing import Any, TypeVar

import numpy as np
from scipy.sparse import csr_matrix

from skfem_contact.errors import InputError
from skfem_contact.records import dataclass


def sealed(array: np.ndarray) -> np.ndarray:
    """The array itself, from now on read-only; for arrays that are nobody else's.

    >>> sealed(np.zeros(2)).flags.writeable
    False
    """
    array.setflags(write=False)
    return array


def sealed_matrix(matrix: csr_matrix) -> csr_matrix:
    """The matrix itself with all its arrays read-only."""
    matrix.has_canonical_format  # noqa: B018 (found out and remembered while it can be)
    for part in (matrix.data, matrix.indices, matrix.indptr):
        sealed(part)
    return matrix


def seal(*values: Any) -> None:
    """Make all arrays and matrices that objects have read-only; for every result, so it is quick."""
    for value in values:
        for part in vars(value).values():
            if isinstance(part, np.ndarray):
                part.setflags(False)  # type: ignore[call-arg]  # write; by keyword it takes thrice as long
            elif type(part) is csr_matrix and part.data.flags.writeable:
                sealed_matrix(part)


def kept(value: Any) -> Any:
    """A value of the user's as it is now: what the user does to it later stays outside.

    Numbers, functions and read-only arrays of their own stay themselves.

    >>> mine = np.ones(2)
    >>> ours = kept((mine, 0.5))
    >>> mine[0] = 3.0
    >>> ours
    (array([1., 1.]), 0.5)
    """
    if isinstance(value, np.ndarray):
        own = not value.flags.writeable and value.base is None
        # a mask is kept for those who refuse it
        return value if own else sealed(np.array(value, subok=np.ma.is_masked(value)))
    if isinstance(value, list | tuple):
        return type(value)([kept(part) for part in value]) if type(value) in (list, tuple) else value
    return value


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
