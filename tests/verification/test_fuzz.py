"""Random whole problems of benchmarks/fuzz.py: a few in every run, and those that once went wrong."""

from __future__ import annotations

import re
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from enumeration import CAPPED_FORWARD, Problem, all_solutions
from hypothesis import HealthCheck, given, note, settings
from hypothesis import strategies as st

sys.path.append(str(Path(__file__).parents[2] / "benchmarks"))

from fuzz import Choice, StepChoice, judge

#: What no problem may come to. A solution that is not found (`missed`) is refused in words, and so rare
#: that hypothesis meets one in some thousand problems: which ones it tries depends on the modules that
#: are loaded. The problems with fixed seeds below may not have any.
DEFECTS = ("wrong", "crashed")


def kinds(seed):
    """What happened in the steps of a problem, by kind."""
    return [kind for kind, _ in judge(seed)]


@pytest.mark.parametrize(
    "seeds", [range(20), pytest.param(range(20, 60), marks=pytest.mark.slow)], ids=["few", "many"]
)
def test_no_random_problem_is_answered_wrongly(seeds):
    """Answers satisfy all conditions, refusals are errors of the library, and nothing crashes."""
    found = [(seed, kind) for seed in seeds for kind in kinds(seed)]
    assert [pair for pair in found if pair[1] in ("wrong", "crashed", "missed")] == []
    assert sum(kind == "right" for _, kind in found) > 1.6 * len(seeds)


STEPS = st.builds(
    StepChoice,
    load=st.integers(0, 1),
    force=st.sampled_from([1.0, 3.0, 0.0, -1.0]),
    displacement=st.sampled_from([1.0, 0.0, 2.0]),
    interference=st.none() | st.floats(-0.05, 0.05),
)
POWERS = st.integers(-4, 4).map(lambda k: 10.0**k)
PROBLEMS = st.builds(
    Choice,
    seed=st.integers(0, 2**31),
    mu=st.floats(0.0, 10.0),
    most=st.integers(2, 4),
    floating=st.just(False),
    scales=st.tuples(POWERS, POWERS),
    G=st.just(np.inf) | st.floats(-8, 8).map(lambda k: 10.0**k),
    caps=st.just({}) | st.fixed_dictionaries({"tau_max": st.floats(1e-6, 1.0)}),
    method=st.sampled_from(["node", "mortar"]),
    loop=st.sampled_from(["newton", "direct"]),
    linear=st.sampled_from(["auto", "sparse"]),
    cuts=st.just(0),
    steps=st.lists(STEPS, min_size=1, max_size=3).map(tuple),
)
REPEATABLE = settings(
    derandomize=True,  # the same problems in every run
    database=None,
    deadline=None,
    suppress_health_check=[HealthCheck.too_slow],
)


@settings(REPEATABLE, max_examples=30)
@given(PROBLEMS)
def test_whole_problems_that_hypothesis_thinks_of(choice):
    """Answers satisfy all conditions, whatever bodies, loads and friction."""
    for kind, words in judge(choice):
        note(words)
        assert kind not in DEFECTS


@settings(REPEATABLE, max_examples=15)
@given(PROBLEMS, st.integers(7, 20))
def test_larger_problems_by_their_certificate(choice, points):
    """Beyond six points answers are judged by dense matrices and by their certificate."""
    for kind, words in judge(replace(choice, fewest=points, most=points + 20)):
        note(words)
        assert kind not in DEFECTS


@pytest.mark.slow
@settings(REPEATABLE, max_examples=400)
@given(PROBLEMS, st.booleans())
def test_many_whole_problems(choice, floating):
    """Some hundred more, also of bodies that friction alone holds: none is answered wrongly."""
    steps = tuple(replace(s, force=abs(s.force) or 1.0) for s in choice.steps)
    choice = replace(choice, floating=floating, steps=steps if floating else choice.steps)
    for kind, words in judge(choice):
        note(words)
        assert kind not in DEFECTS


def test_what_taking_a_load_away_leaves_is_round_off():
    """Forces of 1e-20 after forces of 1e-3 are none, whatever their signs are to each other.

    Nor are gaps of 1e-21 after slips of 1e-4 gaps (323).
    """
    begin = StepChoice(load=0, force=1.0, displacement=1.0, interference=None)
    problem = Choice(
        seed=69746542, mu=5.0, most=4, floating=False, scales=(0.1, 1.0), G=1.0, caps={}, method="node",
        loop="direct", linear="sparse", cuts=0, steps=(begin, replace(begin, displacement=0.0)),
    )  # fmt: skip
    assert [kind.split(",")[0] for kind, _ in judge(problem)] == ["right", "right"]
    assert kinds(323) == ["right"] * 3


@pytest.mark.every_value
@pytest.mark.parametrize("seed", [4, 6, 11, 21, 41, 45, 55, 56])
def test_bodies_without_stress_are_certified(seed):
    """Problems with a step in which nothing touches: the certificate divided by round-off."""
    for kind, words in judge(seed):
        if kind == "right, few digits":
            # 4e-8 to 1.5e-7 on different machines: round-off of K u over loads of a millionth of its
            # terms (2e-10), times the ratio of the moduli, some hundreds; divided by round-off it was 1
            assert float(re.search(r"certificate (\S+),", words)[1]) < 1e-6
        else:
            assert kind in ("right", "right, not enumerated", "refused")


def test_smooth_point_that_closes_does_not_stick():
    """With mu = 0 a point that closed while no force acted stuck, pulled, opened, without end."""
    assert kinds(9694) == ["right"] * 3


@pytest.mark.parametrize("mu", [1e-300, 1e-62, 1e-16, 1e-15])
def test_friction_below_round_off_is_none(mu):
    """Points that a friction of 1e-16 of the pressure should have held stuck, slipped, and so on."""
    steps = StepChoice(1, -1.0, 1.0), StepChoice(0, 3.0, 1.0)
    choice = Choice(
        175717347, mu, 3, False, (100.0, 0.1), np.inf, {}, "mortar", "newton", "auto", 0, steps
    )
    assert [kind for kind, _ in judge(choice)] == ["right", "right"]


def test_body_held_by_capped_friction_alone():
    """An equilibrium in which some points slip at the cap and others stick should be found."""
    assert "missed" not in kinds(2247)


def test_a_body_that_carries_nothing_however_far_it_is_pulled():
    """A share of round-off of a way that doubles and doubles: it went on to 1e154 and an overflow."""
    assert kinds(500781) == ["refused"]


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


@pytest.mark.parametrize("seed", [262, 342, 389, 1123, 2982])
def test_sparse_route_ends_with_pivoting_too(seed):
    """Held bodies on the sparse route whose loops ran in circles: the step is condensed to pivot."""
    assert all(kind.startswith("right") for kind in kinds(seed))


@pytest.mark.parametrize("seed", [2228, 4746, 6255, 8001])
def test_direct_begins_at_the_exact_answer(seed):
    """With mu >= 2 lagged limits run away from an answer that pivoting knows to round-off only."""
    assert all(kind.startswith("right") for kind in kinds(seed))


@pytest.mark.parametrize("cuts", [0, 6])
def test_limits_that_lag_run_away_from_a_solution_that_newton_has(cuts):
    """With mu = 4 the loop `direct` enlarges round-off; what it began from is the answer."""
    steps = (StepChoice(load=1, force=-1.0, displacement=1.0),)
    choice = Choice(
        23817, 4.0, 3, False, (10.0, 0.01), 1000.0, {}, "mortar", "direct", "sparse", cuts, steps
    )
    assert [kind for kind, _ in judge(choice)] == ["right"]


@pytest.mark.parametrize(("mu", "floating"), [(0.0, True), (5e-324, False), (1e-160, False)])
def test_friction_whose_square_is_none_and_a_body_that_nothing_holds(mu, floating):
    """The smallest coefficient there is; and a stiffness of round-off alone, of either sign."""
    steps = (StepChoice(0, 1.0, 1.0),) * 2
    choice = Choice(0, mu, 2, floating, (1.0, 1.0), np.inf, {}, "node", "newton", "auto", 0, steps)
    assert not {kind for kind, _ in judge(choice)} & {"wrong", "crashed", "missed"}


def test_an_overlap_without_digits():
    """An interference of 2e-311, the smallest there is but for its digits, is nothing."""
    steps = StepChoice(0, 1.0, 1.0, 2.225073858507e-311), StepChoice(0, 1.0, 0.0)
    choice = Choice(1, 0.0, 2, False, (1.0, 1.0), np.inf, {}, "node", "newton", "auto", 0, steps)
    assert not {kind for kind, _ in judge(choice)} & {"wrong", "crashed", "missed"}


@pytest.mark.parametrize("power", [2, 5, 6.84375, 8])
def test_a_spring_of_friction_that_is_far_stiffer_than_the_bodies(power):
    """The digits of its force are those of equilibrium: its length has lost power + 3 + 2 of them."""
    steps = StepChoice(0, 3.0, 1.0), StepChoice(0, 0.0, 1.0)
    choice = Choice(
        0, 2.0, 3, False, (1000.0, 0.01), 10.0**power, {}, "node", "newton", "auto", 0, steps
    )
    for kind, words in judge(choice):
        assert kind == "right"
        assert float(re.search(r"residual (\S+),", words)[1]) < 1e-9  # forces of 1e-5 of the stiffness


def test_springs_that_are_round_off_beside_a_stiff_law():
    """G of 1e14 times the softer body: the proximal point is no way on, and is left."""
    steps = StepChoice(0, 3.0, 1.0, 0.015625), StepChoice(0, 1.0, 1.0)
    choice = Choice(26078, 4.0, 3, False, (100.0, 1e-4), 1e8, {}, "node", "newton", "auto", 0, steps)
    assert not {kind for kind, _ in judge(choice)} & {"wrong", "crashed"}
