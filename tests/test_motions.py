"""Motions that no row holds: the quick answer is that of the singular values."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from skfem_contact.conditions.loads import LoadCase
from skfem_contact.conditions.motions import _holds_all, null_space
from skfem_contact.conditions.thresholds import RESISTS


@pytest.mark.parametrize("least", [RESISTS, 1e-7, 1e-2])
@pytest.mark.parametrize("k", [1, 2, 3, 6])
def test_quick_answer_is_that_of_the_singular_values(k: int, least: float) -> None:
    """Whatever the smallest singular value is, held motions are found to be so, and no others."""
    rng = np.random.default_rng(k)
    near = least * np.array([1e-6, 0.5, 0.99, 1.01, 2.5, 10.0])
    for smallest in [*near, 1e-5, 1e-3, 1.0]:
        for size in (1e-3, 1.0, 30.0):
            left = np.linalg.qr(rng.standard_normal((20, k)))[0]
            right = np.linalg.qr(rng.standard_normal((k, k)))[0]
            values = size * np.linspace(1.0, 2.0, k)
            values[0] = smallest
            rows = (left * values) @ right.T
            found = null_space(rows, least)
            held = np.linalg.svd(rows, compute_uv=False)
            free = int(np.sum(held < least * max(1.0, held.max())))
            assert found.shape == (k, free)
            # what a direction is off by: round-off of the rows over the distance to the other values
            assert_allclose(rows @ found, 0.0, atol=1.01 * least * max(1.0, held.max()))
            if _holds_all(rows, least):
                assert not free


def test_quick_answer_is_given_where_contact_holds() -> None:
    """Points around a corner hold a body by numbers of order one: no singular values are asked for."""
    points = np.array([[-1.0, 0.0], [0.5, 0.0], [1.0, 0.3]])
    normals = np.array([[0.0, 1.0], [0.0, 1.0], [1.0, 0.0]])
    turn = normals[:, 1] * points[:, 0] - normals[:, 0] * points[:, 1]
    rows = np.column_stack([normals, turn])
    assert _holds_all(rows, 1e-2)
    assert not _holds_all(rows[:2], RESISTS)  # nothing holds it sideways


def test_no_rows_and_no_motions() -> None:
    """Without rows everything is free; of no motions none is."""
    assert_allclose(null_space(np.zeros((0, 2))), np.eye(2))
    assert null_space(np.zeros((3, 0))).shape == (0, 0)


@pytest.mark.parametrize("share", [0.0, 0.25, 1.0])
def test_part_of_the_way_between_two_loads(share: float) -> None:
    """All that a step prescribes goes straight from one load to the next, slips of obstacles too."""
    rng = np.random.default_rng(4)
    sizes = {"f": 6, "x": 6, "gap0": 3, "slip0": (3, 1), "interference": 3}
    one, other = (LoadCase(**{k: rng.random(n) for k, n in sizes.items()}, motion=()) for _ in "ab")
    # a point that has no partner at the end has none on the way
    other = replace(other, gap0=np.append(other.gap0[:2], np.inf))
    found = one.towards(other, share)
    for key in sizes:
        here, there = getattr(one, key), getattr(other, key)
        with np.errstate(invalid="ignore"):  # of zero times infinity
            wanted = np.where(np.isinf(there), np.inf, (1 - share) * here + share * there)
        assert_allclose(getattr(found, key), wanted, rtol=1e-14)
