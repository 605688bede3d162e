"""Motions that no row holds: the quick answer is that of the singular values."""

from __future__ import annotations

from dataclasses import replace

import internals
import numpy as np
import pytest
from numpy.testing import assert_allclose

from skfem_contact.conditions import LoadCase, RigidMotions, null_space

_held = internals.original("conditions._held")
SOLVED = 1e-9  # of `digits`


@pytest.mark.parametrize("least", [SOLVED, 1e-7, 1e-2])
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
            if _held(rows.T @ rows, least):
                assert not free


def test_quick_answer_is_given_where_contact_holds() -> None:
    """Points around a corner hold a body by numbers of order one: no singular values are asked for."""
    points = np.array([[-1.0, 0.0], [0.5, 0.0], [1.0, 0.3]])
    normals = np.array([[0.0, 1.0], [0.0, 1.0], [1.0, 0.0]])
    turn = normals[:, 1] * points[:, 0] - normals[:, 0] * points[:, 1]
    rows = np.column_stack([normals, turn])
    assert _held(rows.T @ rows, 1e-2)
    assert not _held(rows[:2].T @ rows[:2], SOLVED)  # nothing holds it sideways


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("seed", range(6))
def test_held_by_products_is_held_by_rows(seed: int, d: int) -> None:
    """What products of single points say is held, singular values of all rows find no motion of."""
    rng = np.random.default_rng(seed)
    m, k = 8, 3 * (d - 1)
    motions = RigidMotions(np.zeros((1, k)), None, None)
    normal, tangential = rng.standard_normal((m, k)), rng.standard_normal((m, d - 1, k))
    if seed % 2:  # in the last motion nothing moves along the normals
        normal[:, -1] = 0.0
    vars(motions).update(normal=normal, tangential=tangential)
    answers = set()
    for count in range(m + 1):
        closed, stick = np.arange(m) < count, np.arange(m) < count // 3
        weights = np.where(closed, rng.uniform(0.1, 1.0, m), 0.0)
        for weighted, least in ((closed.astype(float), 1e-2), (weights**2, 1e-7)):
            rows = np.concatenate([normal, tangential[stick].reshape(-1, k)])
            rows[:m] *= np.sqrt(weighted)[:, None]
            held = motions.held(weighted, stick, least)
            answers.add(held)
            # no singular value of these rows is near the bounds, where the two may differ
            assert held == (null_space(rows, 2 * least).shape[1] == 0)
    assert answers == {True, False}


def test_held_is_asked_again_where_points_or_bounds_change() -> None:
    """The answer of the last question serves an equal one, and no other."""
    motions = RigidMotions(np.zeros((1, 2)), None, None)
    vars(motions).update(normal=np.array([[1.0, 0.0], [0.0, 1e-3]]), tangential=np.eye(2)[:, None])
    both, one, none = np.array([True, True]), np.array([True, False]), np.zeros(2, dtype=bool)
    questions = [
        (both, none, 1e-7, True),
        (one, none, 1e-7, False),
        (one, ~one, 1e-7, True),
        (both, none, 1e-2, False),
        (both, none, 1e-7, True),
    ]
    for closed, stick, least, held in [*questions, *questions]:
        assert motions.held(closed, stick, least) is held
    closed = both.copy()
    assert motions.held(closed, none, 1e-7)
    closed[1] = False  # the same array with other points
    assert not motions.held(closed, none, 1e-7)


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
