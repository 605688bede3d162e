"""Scenes as a user writes them, from the documentation alone: each ends with statics or a closed form.

A bond is a page of the documentation (`docs/recipes`), which `test_pages` runs.
"""

from __future__ import annotations

import runpy
import warnings
from pathlib import Path

import pytest

SCENES = sorted((Path(__file__).parent / "scenes").glob("*.py"))
SLOW = {"brake_pad", "groove", "large"}
MOST_LINES = 55


@pytest.mark.parametrize(
    "path",
    [pytest.param(p, marks=pytest.mark.slow if p.stem in SLOW else ()) for p in SCENES],
    ids=lambda path: path.stem,
)
def test_a_scene_is_right_short_and_quiet(path: Path) -> None:
    """It runs through its assertions, without a warning, in a page of code."""
    text = path.read_text()
    if "import gmsh" in text:
        pytest.importorskip("gmsh")
    assert sum(bool(line.strip()) for line in text.splitlines()) <= MOST_LINES
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        runpy.run_path(str(path), run_name="__main__")


def test_there_are_scenes() -> None:
    """The scenes are found, so that the test above can not pass on an empty list."""
    assert {path.stem for path in SCENES} > SLOW and len(SCENES) == 9
