"""The judge of bodies that are not linear: scenes, its stored table, and that it sees what is wrong."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

sys.path.insert(0, str(Path(__file__).parents[2] / "benchmarks"))

import judge_nonlinear as bench


@pytest.mark.parametrize("seed", [25, 73])
def test_scenes(seed):
    """Steel under an elastic tool, moved; and up to the limit load and back, with friction."""
    verdict = bench.judge(seed)
    assert verdict.kind == "right", verdict.words


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(0, 200, 4))
def test_random_scenes(seed):
    """Energy of steps and ways, cut steps, other orders, turns and units."""
    verdict = bench.judge(seed)
    assert verdict.kind in ("right", "warned"), verdict.words


def test_the_stored_table():
    """All of 200 scenes are right, or somebody is told; and the page has their table."""
    stored = json.loads(bench.STORED.read_text())
    assert [verdict["seed"] for verdict in stored] == list(range(200))
    assert {verdict["kind"] for verdict in stored} <= {"right", "warned"}
    assert bench.table(stored) in bench.PAGE.read_text()


class Spoiled:
    """An answer with something changed."""

    def __init__(self, result, **changes):
        self._result, self._changes = result, changes

    def __getattr__(self, name):
        return self._changes[name] if name in self._changes else getattr(self._result, name)

    def __getitem__(self, name):
        told = self._result[name]
        force = self._changes.get("rubs", 1.0) * told.tangential_force
        return SimpleNamespace(
            slip=told.slip, gap=told.gap, normal_force=told.normal_force, tangential_force=force
        )


@pytest.fixture(scope="module")
def rubbed():
    s = bench.scene(25)
    built = bench.Built(s)
    return built, built.history(s.way)


def test_friction_that_is_wrong_is_seen_in_a_step(rubbed):
    """A hundred-thousandth more of it."""
    built, results = rubbed
    assert bench.steps_missing(built, results) < bench.SAME
    spoiled = [Spoiled(result, rubs=1 + 1e-5) for result in results]
    assert bench.steps_missing(built, spoiled) > bench.SAME


@pytest.mark.parametrize("by", [0.0, 2.0])
def test_energy_that_is_lost_or_won_is_seen_on_the_way(rubbed, by):
    """Dissipation that is left out, or counted twice: what is missing does not fall with the step."""
    s = bench.scene(27)  # of rubber, which misses less by itself
    missing = []
    for parts in (1, 3):
        built, way = bench.Built(s), bench.between(s.way, parts)
        results = [
            Spoiled(result, dissipation_total=by * result.dissipation_total)
            for result in built.history(way)
        ]
        missing.append(bench.ways_missing(built, results, way)[0])
    assert missing[1] > bench.FALLS * missing[0]
