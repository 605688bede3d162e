"""The default run keeps all pairs of the products that it thins out."""

from __future__ import annotations

from itertools import combinations, product

import pytest
from pairs import pairwise


# least possible: the product of the two longest axes
@pytest.mark.parametrize(
    ("sizes", "most"),
    [((3, 2, 2, 2), 8), ((17, 2, 2), 34), ((3, 3, 3, 2), 12), ((4, 5), 20), ((6,), 6)],
)
def test_every_pair_of_values_still_meets(sizes: tuple[int, ...], most: int) -> None:
    """Any two values of two axes meet in what is kept, and little more is kept than that takes."""
    full = [dict(enumerate(choice)) for choice in product(*map(range, sizes))]
    kept = [full[number] for number in pairwise(full)]
    assert len(kept) <= most
    for axes in combinations(range(len(sizes)), min(2, len(sizes))):
        wanted = set(product(*(range(sizes[axis]) for axis in axes)))
        assert {tuple(choice[axis] for axis in axes) for choice in kept} == wanted


def test_a_single_choice_is_kept() -> None:
    """A test that is run on its own by its name is never slow, and one without axes is kept."""
    assert pairwise([{"a": 3, "b": 1, "c": 2}]) == {0}
    assert pairwise([{}]) == {0}
