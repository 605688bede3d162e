"""Random whole problems of benchmarks/fuzz.py: a few in every run, and those that once went wrong."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
from enumeration import CAPPED_FORWARD, Problem, all_solutions

sys.path.append(str(Path(__file__).parents[2] / "benchmarks"))

from fuzz import judge


def kinds(seed):
    """What happened in the steps of a problem, by kind."""
    return [kind for kind, _ in judge(seed)]


def test_no_random_problem_is_answered_wrongly():
    """Answers satisfy all conditions, refusals are errors of the library, and nothing crashes."""
    found = [(seed, kind) for seed in range(60) for kind in kinds(seed)]
    assert [pair for pair in found if pair[1] in ("wrong", "crashed", "missed")] == []
    assert sum(kind == "right" for _, kind in found) > 100


@pytest.mark.parametrize("seed", [4, 6, 11, 21, 41, 45, 55, 56])
def test_bodies_without_stress_are_certified(seed):
    """Problems with a step in which nothing touches: the certificate divided by round-off."""
    assert set(kinds(seed)) <= {"right", "right, not enumerated", "refused"}


def test_smooth_point_that_closes_does_not_stick():
    """With mu = 0 a point that closed while no force acted stuck, pulled, opened, without end."""
    assert kinds(9694) == ["right"] * 3


def test_body_held_by_capped_friction_alone():
    """An equilibrium in which some points slip at the cap and others stick should be found."""
    assert "missed" not in kinds(2247)


def test_enumeration_knows_the_cap():
    """A point pressed by 1 and dragged along a plane bears no more than the cap."""
    one, zero = np.ones(1), np.zeros(1)
    row = np.array([[0.0, 1.0]]), np.array([[1.0, 0.0]])
    for mu, cap, tau in ((0.5, 0.2, 0.2), (0.1, 0.2, 0.1)):
        f = np.array([2.0, -1.0])
        D, x = np.zeros(0, dtype=int), np.zeros(2)
        p = Problem(np.eye(2), f, D, x, *row, zero, mu, np.inf, zero, zero, cap=cap * one)
        (found,) = all_solutions(p)
        np.testing.assert_allclose([found.lam[0], found.tau[0]], [1.0, tau], rtol=1e-12)
        assert (found.pattern[0] == CAPPED_FORWARD) == (tau == cap)
