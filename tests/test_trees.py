"""Points that are near: few are compared with all, and what is found is what SciPy's trees find."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial import cKDTree

from skfem_contact.trees import Tree, pairs_within

ROOT = Path(__file__).parents[1]


def asked(tree: Tree) -> bool:
    """Whether SciPy's tree has been made."""
    return "_large" in vars(tree)


def grid(d: int, count: int) -> np.ndarray:
    """Points of a grid: many are equally far from others."""
    return np.stack(np.meshgrid(*[np.arange(count) / 8] * d), axis=-1).reshape(-1, d)


def clouds(d: int) -> list[tuple[np.ndarray, np.ndarray]]:
    """Points and others: anywhere, and on grids with a node in the middle between others."""
    rng, count = np.random.default_rng(d), {2: 6, 3: 4}[d]
    anywhere = [
        (rng.normal(size=(m, d)), rng.normal(size=(p, d))) for m, p in ((1, 5), (40, 9), (99, 300))
    ]
    return [*anywhere, (grid(d, count), grid(d, count) + 1 / 16), (grid(d, count), grid(d, count + 2))]


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("k", [1, 4, np.arange(1, 3)])
def test_the_nearest_are_those_of_the_tree(d: int, k: int | np.ndarray) -> None:
    """To the last bit, numbers of equally far points included."""
    for points, others in clouds(d):
        most = k if isinstance(k, int) else len(k)
        if most > len(points):
            continue
        distance, index = Tree(points).query(others, k=k)
        right, which = cKDTree(points).query(others, k=k)
        np.testing.assert_array_equal(distance, right)
        np.testing.assert_array_equal(index, which)
        np.testing.assert_array_equal(Tree(points).distances(others), cKDTree(points).query(others)[0])


@pytest.mark.parametrize("d", [2, 3])
def test_what_lies_around_is_what_the_tree_finds(d: int) -> None:
    """Numbers in balls of different sizes, in their order, and pairs within a distance."""
    for points, others in clouds(d):
        radius = np.linspace(0.1, 1.0, len(others))
        found = Tree(points).query_ball_point(others, radius)
        right = cKDTree(points).query_ball_point(others, radius)
        assert [some.tolist() for some in found] == [sorted(some) for some in right]
        pairs = Tree(points).pairs(others, 0.3)
        table = cKDTree(points).sparse_distance_matrix(cKDTree(others), 0.3, output_type="ndarray")
        assert list(zip(*pairs, strict=True)) == sorted(zip(table["i"], table["j"], strict=True))


def test_no_points_are_near_none() -> None:
    """Nothing is asked, and nothing is imported for it."""
    tree, none = Tree(np.zeros((3, 2))), np.zeros((0, 2))
    assert tree.query(none)[1].shape == (0,) and tree.query(none, k=2)[0].shape == (0, 2)
    assert tree.distances(none).shape == (0,) and tree.query_ball_point(none, np.zeros(0)) == []
    assert tree.pairs(none, 1.0)[0].shape == (0,) and not asked(tree)
    assert pairs_within(none, 1.0).shape == (0, 2)


def test_trees_are_for_many_points_or_for_ties() -> None:
    """150 points among 150 are compared; 170 among 170 take a tree, and so do equally far ones."""
    rng = np.random.default_rng(0)
    for count, large in ((150, False), (170, True)):
        tree = Tree(rng.random((count, 2)))
        tree.query(rng.random((count, 2)))
        assert asked(tree) == large
        for ask in (
            lambda tree, at: tree.query(at, k=3),
            lambda tree, at: tree.distances(at),
            lambda tree, at: tree.query_ball_point(at, np.full(len(at), 0.1)),
            lambda tree, at: tree.pairs(at, 0.1),
        ):
            tree = Tree(rng.random((count, 2)))
            ask(tree, rng.random((count, 2)))
            assert asked(tree) == large
    two = Tree([(0.0, 0.0), (1.0, 0.0), (5.0, 0.0)])
    two.query([(0.5, 0.0)], k=2, ordered=False)
    assert not asked(two)  # both are told, whichever is the first
    two.query([(0.5, 0.0)])
    assert asked(two)


def test_a_tree_is_imported_when_it_pays(monkeypatch: pytest.MonkeyPatch) -> None:
    """Ten searches among a million pairs take as long as the import; the eleventh takes a tree."""
    monkeypatch.delitem(sys.modules, "scipy.spatial")
    monkeypatch.setattr(Tree, "compared", 0)
    points = np.random.default_rng(0).random((1000, 2))
    for search in range(11):
        tree = Tree(points)
        np.testing.assert_array_equal(tree.nearest(points), np.arange(1000))
        assert asked(tree) == (search == 10)


def test_positions_that_are_no_numbers_are_refused() -> None:
    """As SciPy's trees do it, before a number goes on into a pairing."""
    with pytest.raises(ValueError, match="finite"):
        Tree(np.eye(2)).query([(np.nan, 0.0)])


def test_the_first_scene_needs_no_tree() -> None:
    """README's example in a fresh process, with its report: the import took as long as the solve."""
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    example = re.search(r"```python\n(.*?)```", text, re.S)
    assert example is not None and "report()" in example[1]
    late = "\nimport sys\nprint([name for name in sys.modules if name.startswith('scipy.spatial')])"
    run = [sys.executable, "-c", example[1] + late]
    done = subprocess.run(run, capture_output=True, text=True, check=True, cwd=ROOT)
    assert done.stdout.splitlines()[-1] == "[]"
