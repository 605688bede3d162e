"""Every example runs, and the number it ends with is as small as it promises."""

from __future__ import annotations

import ast
import runpy
import sys
from pathlib import Path

import pytest

EXAMPLES = sorted((Path(__file__).parents[1] / "examples").glob("*.py"))


@pytest.mark.slow
@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_example_keeps_its_promise(path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The `error` that an example ends with is below the `tolerance` it states."""
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("Agg")
    monkeypatch.setattr(sys, "argv", [str(path), str(tmp_path)])
    monkeypatch.chdir(tmp_path)
    values = runpy.run_path(str(path), run_name="__main__")
    assert values["error"] <= values["tolerance"], f"error {values['error']:.3g}"
    from matplotlib import pyplot

    pyplot.close("all")


def test_there_are_examples() -> None:
    """The examples are found, so that the test above can not pass on an empty list."""
    assert any(path.stem == "pin_in_lug" for path in EXAMPLES)


def test_the_flange_takes_at_most_fifteen_lines() -> None:
    """Pairs, bolts, a sequence of tightening, and rising pressure, without what is printed."""
    text = next(path for path in EXAMPLES if path.stem == "leaking_flange").read_text(encoding="utf-8")
    part = text.split("# %% Contacts, bolts")[1].split("# %% Tight: ")[0]
    steps = [one for one in ast.parse(part).body if not isinstance(one, ast.Expr | ast.For)]
    lines = [one.end_lineno - one.lineno + 1 for one in steps]  # type: ignore[operator]
    assert "solver.history" in part and sum(lines) <= 15
