"""Few choices out of a full product, in which all pairs of values are left, or all single ones."""

from __future__ import annotations

from itertools import combinations
from numbers import Real
from typing import Any


def pairwise(choices: list[dict[str, Any]]) -> set[int]:
    """Numbers of a few choices in which any two values that meet in `choices` still meet.

    Of five numbers or more only the least, the largest, and the one in the middle are meant.
    """
    asked = _asked(choices)
    named = [sorted({(name, _same(value)) for name, value in c.items()} & asked) for c in choices]
    # single values as well, for products of one axis, and the empty set, for none
    pairs = [{p for size in range(3) for p in combinations(c, size)} for c in named]
    return _cover(pairs, set().union(*pairs))


def every_value(choices: list[dict[str, Any]]) -> set[int]:
    """Numbers of a few choices in which every value of `choices` is left, of numbers as above."""
    single = [{(), *((name, _same(value)) for name, value in c.items())} for c in choices]
    return _cover(single, {(), *_asked(choices)})


def _asked(choices: list[dict[str, Any]]) -> set[Any]:
    """The values of each axis: all, or the ends and the middle of many numbers."""
    asked: set[Any] = set()
    for name in set().union(*choices):
        values = {_same(c[name]): c[name] for c in choices if name in c}
        known = list(values)
        if len(known) >= 5 and all(_is_number(value) for value in values.values()):
            known.sort(key=lambda key: float(values[key]))
            known = [known[0], known[len(known) // 2], known[-1]]
        asked |= {(name, key) for key in known}
    return asked


def _is_number(value: Any) -> bool:
    return isinstance(value, Real) and not isinstance(value, bool)


def _same(value: Any) -> Any:
    """What tells values apart: arrays and laws cannot be compared or hashed, they are objects."""
    return str(float(value)) if _is_number(value) else str(id(value))


def _cover(choices: list[set[Any]], missing: set[Any]) -> set[int]:
    """Numbers of choices that have all of what is missing, always the one that has most of it next."""
    kept = set[int]()
    while missing:
        best = max(range(len(choices)), key=lambda number: len(choices[number] & missing))
        missing = missing - choices[best]
        kept.add(best)
    return kept
