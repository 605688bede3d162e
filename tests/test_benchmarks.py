"""The benchmark's problem has the answer it is measured against, on both routes."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import pytest


@pytest.fixture
def run(monkeypatch: pytest.MonkeyPatch) -> Any:
    """The modules of the benchmark, which is no package."""
    monkeypatch.syspath_prepend(str(Path(__file__).parents[1] / "benchmarks"))
    import run

    yield run
    for name in ("run", "cases"):
        sys.modules.pop(name)


@pytest.mark.parametrize("kind", ["Q1", "P2"])
def test_history_and_routes(run: Any, kind: str) -> None:
    """50 increments end at Hertz, Cattaneo and Mindlin; without condensation the answer is the same."""
    scene = run.Scene(run.Case("small", 8000, kind=kind))
    measured = run.history(scene)
    assert measured["increments"] == 50
    # 5 (Q1) or 2 (P2) elements per half width: their edge of contact is off by half an element
    assert max(measured["errors"].values()) < 0.1
    assert run.sparse(scene)["difference"] < 1e-9


def test_table_names_what_failed(run: Any) -> None:
    """A case that failed is a row with its reason."""
    failed = {"failed": "MemoryError"}
    text = run.table([{"case": "large", "history": failed, "own": failed, "plain": failed}])
    assert "| large | failed: MemoryError |" in text
