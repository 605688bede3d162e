"""The default run keeps all pairs of the products that it thins out."""

from __future__ import annotations

from itertools import combinations, product

import numpy as np
import pytest
from pairs import every_value, pairwise


# least possible: the product of the two longest axes
@pytest.mark.parametrize(
    ("sizes", "most"),
    [((3, 2, 2, 2), 8), ((17, 2, 2), 34), ((3, 3, 3, 2), 12), ((4, 5), 20), ((6,), 6)],
)
def test_every_pair_of_values_still_meets(sizes: tuple[int, ...], most: int) -> None:
    """Any two values of two axes meet in what is kept, and little more is kept than that takes."""
    names = [[f"{axis}:{value}" for value in range(size)] for axis, size in enumerate(sizes)]
    full = [dict(enumerate(choice)) for choice in product(*names)]
    kept = [full[number] for number in pairwise(full)]
    assert len(kept) <= most
    for axes in combinations(range(len(sizes)), min(2, len(sizes))):
        wanted = set(product(*(names[axis] for axis in axes)))
        assert {tuple(choice[axis] for axis in axes) for choice in kept} == wanted


def test_of_many_numbers_the_ends_and_the_middle_meet_the_others() -> None:
    """Seventeen powers of ten with two kinds: six pairs are left of 34."""
    full = [{"size": 10.0**k, "kind": kind} for k in range(-8, 9) for kind in ("P1", "Q1")]
    kept = {(c["size"], c["kind"]) for c in (full[number] for number in pairwise(full))}
    assert kept == set(product((1e-8, 1.0, 1e8), ("P1", "Q1")))


def test_a_single_choice_is_kept() -> None:
    """A test that is run on its own by its name is never slow, and one without axes is kept."""
    assert pairwise([{"a": 3, "b": 1, "c": 2}]) == {0}
    assert pairwise([{}]) == {0}


def test_every_value_is_still_met() -> None:
    """Each kind, law and array is kept; of a row of numbers its ends and its middle."""
    law, other = np.zeros(2), np.zeros(2)
    full = [
        {"kind": kind, "law": one, "size": size}
        for kind in ("P1", "Q1", "Q2")
        for one in (law, other)
        for size in (1e-9, 1e-3, 1.0, 1e3, 1e9)
    ]
    kept = [full[number] for number in every_value(full)]
    assert len(kept) == 3
    assert {c["kind"] for c in kept} == {"P1", "Q1", "Q2"}
    assert {id(c["law"]) for c in kept} == {id(law), id(other)}
    assert {c["size"] for c in kept} == {1e-9, 1.0, 1e9}
    assert len(every_value([{"size": size} for size in (0.0, 1.0, 2.0, 3.0)])) == 4
    assert every_value([{}]) == {0}
