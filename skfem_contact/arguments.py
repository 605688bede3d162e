"""What users pass as numbers, words, switches and lists: checked, with the name of the argument."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from skfem_contact.errors import InputError

Array = NDArray[np.float64]
WORDS = (bool, np.bool_, str, bytes)


def shown(value: Any) -> str:
    """A value for a message: what it is, and not more of it than fits a line.

    >>> shown("left"), shown([1])
    ("'left'", '[1] (list)')
    """
    text = " ".join(repr(value).split())
    text = text if len(text) <= 60 else text[:57] + "..."
    plain = value is None or isinstance(value, str | int | float | complex)
    return text if plain else f"{text} ({type(value).__name__})"


def numbers(value: Any, what: str, usage: str) -> Array:
    """An array of real numbers; NaN and infinity are left to the caller.

    >>> numbers([1, 2], "f", "give a vector").tolist()
    [1.0, 2.0]
    """
    try:
        array = np.asarray(value)
        # NumPy makes numbers of True, and of words such as "1.0" among objects
        if array.dtype.kind not in "fiuO" or (
            array.dtype.kind == "O"
            and any(entry is None or isinstance(entry, WORDS) for entry in array.flat)
        ):
            raise TypeError
        return np.array(array, dtype=float)
    except (TypeError, ValueError, IndexError, OverflowError, AttributeError):
        raise InputError(
            f"{what} is {shown(value)}, which is not made of real numbers; {usage}"
        ) from None


def number(value: Any, what: str, usage: str) -> float:
    """One real number.

    >>> number(3, "radius", "give a length")
    3.0
    """
    array = numbers(value, what, usage)
    if array.shape:
        raise InputError(f"{what} has shape {array.shape} and has to be one number; {usage}")
    return float(array)


def check_name(value: Any, what: str) -> None:
    """A name is a string, or not given."""
    if value is not None and not isinstance(value, str):
        raise InputError(
            f"{what} is {shown(value)}, which is not a string; leave it out where there is none"
        )


def check_switch(value: Any, what: str) -> None:
    """True or False; what only counts as one of these in Python is a mistake."""
    if not isinstance(value, bool | np.bool_):
        raise InputError(f"{what} is {shown(value)}; it is a switch, True or False")


def members(value: Any, kind: type, what: str, usage: str) -> list[Any]:
    """One object of a kind, or several of them."""
    try:
        found = [value] if isinstance(value, kind) else list(value)
    except (TypeError, AttributeError):
        raise InputError(
            f"{what} is {shown(value)}, neither a {kind.__name__} nor a list of them; {usage}"
        ) from None
    for i, member in enumerate(found):
        check_kind(member, kind, f"{what}[{i}]", usage)
    return found


def check_kind(value: Any, kind: Any, what: str, usage: str) -> None:
    """An object of a class of this package, or of one of several."""
    if not isinstance(value, kind):
        kinds = kind if isinstance(kind, tuple) else (kind,)
        names = " or ".join(k.__name__ for k in kinds)
        raise InputError(f"{what} is {shown(value)}, not a {names}; {usage}")
