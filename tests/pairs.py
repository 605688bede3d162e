"""Few choices out of a full product, in which all pairs of values are left."""

from __future__ import annotations

from itertools import combinations


def pairwise(choices: list[dict[str, int]]) -> set[int]:
    """Numbers of a few choices in which any two values that meet in `choices` still meet."""
    # single values as well, for products of one axis, and the empty set, for none
    pairs = [{p for size in range(3) for p in combinations(sorted(c.items()), size)} for c in choices]
    missing, kept = set().union(*pairs), set[int]()
    while missing:
        best = max(range(len(pairs)), key=lambda number: len(pairs[number] & missing))
        missing -= pairs[best]
        kept.add(best)
    return kept
