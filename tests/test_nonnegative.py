"""Least squares with unknowns that are not negative, by the conditions that mark the least one."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

from skfem_contact.linalg import nonnegative_least_squares


def check(A: np.ndarray, b: np.ndarray) -> np.ndarray:
    """No entry below zero; the gradient pulls none down, and is zero where x is not."""
    x = nonnegative_least_squares(A, b)
    pull = A.T @ (b - A @ x)
    size = max(np.linalg.norm(b) * np.linalg.norm(A, axis=0).max(initial=0.0), 1e-300)
    assert np.min(x, initial=0.0) >= 0.0
    assert np.max(pull, initial=0.0) <= 1e-13 * size
    assert_allclose(pull[x > 0], 0.0, atol=1e-13 * size)
    return x


@pytest.mark.parametrize("columns", [1, 2, 5, 60, 300])
@pytest.mark.parametrize("rows", [1, 2, 3, 7])
def test_conditions_of_the_least_one(rows: int, columns: int) -> None:
    """Matrices by chance, and some with columns that are the same, opposite, or zero."""
    rng = np.random.default_rng(100 * rows + columns)
    for _ in range(20):
        A, b = rng.standard_normal((rows, columns)), rng.standard_normal(rows)
        check(A, b)
        check(np.hstack([A, A[:, ::2], -A[:, ::3], 0.0 * A[:, :1]]), b)
        check(1e-9 * A, 1e6 * b)


def test_a_reachable_vector_is_reached() -> None:
    """A vector in the cone of the columns leaves no distance, whatever the columns' sizes are."""
    rng = np.random.default_rng(1)
    for _ in range(50):
        A = rng.standard_normal((4, 9)) * 10.0 ** rng.integers(-3, 4, 9)
        b = A @ np.maximum(rng.standard_normal(9), 0)
        x = nonnegative_least_squares(A, b)
        assert np.all(x >= 0)
        assert_allclose(A @ x, b, atol=1e-12 * np.abs(b).max())


def test_by_hand() -> None:
    """Least squares alone would be (-1, 3)."""
    A, b = np.array([[1.0, 1.0], [1.0, 2.0]]), np.array([2.0, 5.0])
    assert_allclose(np.linalg.solve(A, b), [-1.0, 3.0])
    assert_allclose(check(A, b), [0.0, 2.4])


def test_nothing_to_choose() -> None:
    """No unknowns, no equations, nothing to reach."""
    assert nonnegative_least_squares(np.zeros((3, 0)), np.ones(3)).shape == (0,)
    assert nonnegative_least_squares(np.zeros((0, 2)), np.zeros(0)).tolist() == [0.0, 0.0]
    assert nonnegative_least_squares(np.eye(2), np.zeros(2)).tolist() == [0.0, 0.0]


def test_columns_that_depend_on_each_other_stay_bounded():
    """Walls that face each other, and a place to be found for a block: opposite columns.

    With columns of both walls above zero the slopes of all others are round-off, and following one of
    them ends at numbers of 1e13 and in no place at all.
    """
    opposite = [
        -0.23570226039551587,
        -0.23570226039551587,
        -0.23570226039551587,
        -0.23570226039551587,
        -0.23570226039551587,
        -0.23570226039551587,
        0.23570226039551587,
        0.23570226039551587,
        0.23570226039551587,
        0.23570226039551587,
        0.23570226039551587,
    ]
    along = [
        0.20193423622038303,
        0.12116054173222983,
        0.04038684724407664,
        -0.04038684724407663,
        -0.12116054173222982,
        -0.201934236220383,
        -0.09316791297380489,
        -0.04658395648690244,
        -4.0707145837380836e-18,
        0.046583956486902445,
        0.09316791297380486,
    ]
    reached = [
        -0.9999999999999861,
        -0.9999999999999858,
        -0.9999999999999858,
        -0.9999999999999856,
        -0.9999999999999852,
        -0.9999999999999898,
        0.9999999999999831,
        0.9999999999999877,
        0.999999999999992,
        0.9999999999999959,
        1.0,
    ]
    A = np.array([[-0.0] * 11, opposite, along, reached])
    x = nonnegative_least_squares(A, np.array([0.0, 0.0, 0.0, 1.0]))
    # those that balance along the wall: 1 / (1 + 1 / 18) in all
    expected = np.zeros(11)
    expected[[6, 10]] = 9 / 19
    # gaps over their largest are one to 1e-14, and angles between columns a tenth
    assert_allclose(x, expected, rtol=0, atol=1e-12)
