"""What all tests share."""

from __future__ import annotations

import gc
import os
import sys
from collections import defaultdict
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
import verdicts
from pairs import every_value, pairwise

HERE = Path(__file__).parent
collect_ignore_glob = ["scenes/*"]  # scripts, which `test_scenes` runs


# Instances that took more than some 0.6 CPU s, by `pytest --durations=0`.
SLOW = (HERE / "slow.txt").read_text(encoding="utf-8").splitlines()


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """What the default run leaves to the slow one, besides what is marked in the files themselves."""
    _leave(items, "pairwise", pairwise)
    found = {item.nodeid: item for item in items}
    # files of which all tests are here: no test was named, and the file is not ignored
    whole = set() if config.option.file_or_dir else {_file(name) for name in found}
    for name in SLOW:
        if name in found:
            found[name].add_marker(pytest.mark.slow)
        elif _file(name) in whole or not (HERE.parent / _file(name)).exists():
            raise pytest.UsageError(f"tests/slow.txt names {name}, which does not exist")
    _leave(items, "every_value", every_value)


def _file(name: str) -> str:
    return name.partition("::")[0]


def _leave(
    items: list[pytest.Item], mark: str, few: Callable[[list[dict[str, Any]]], set[int]]
) -> None:
    """Of the products with a mark the default run keeps a few of those that are not slow already."""
    products = defaultdict(list)
    for item in items:
        if item.get_closest_marker(mark) and not item.get_closest_marker("slow"):
            products[item.nodeid.partition("[")[0]].append(item)
    for product in products.values():
        kept = few([item.callspec.params for item in product])
        for number, item in enumerate(product):
            if number not in kept:
                item.add_marker(pytest.mark.slow)


@pytest.fixture(scope="module", autouse=True)
def forgotten_answers() -> Iterator[None]:
    """Answers that a module keeps for its tests are forgotten when it ends: all are 8 GB together."""
    yield
    for module in list(sys.modules.values()):
        if (getattr(module, "__file__", None) or "").startswith(str(HERE)):
            for kept in list(vars(module).values()):
                if hasattr(kept, "cache_clear"):
                    kept.cache_clear()
    gc.collect()


@pytest.fixture(autouse=True)
def as_recorded(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """The validity of all answers of some tests is what was recorded; see `verdicts`."""
    if request.path.stem not in verdicts.FILES:
        yield
        return
    name = request.node.nodeid.removeprefix("tests/")
    with verdicts.answers(monkeypatch) as made:
        yield
        found = [verdicts.verdict(result) for result in made[-verdicts.MOST :]]
    if os.environ.get("SKFEM_CONTACT_RECORD"):
        if found:
            verdicts.store(name, found)
        return
    known = verdicts.stored().get(name)
    assert known is None or known == found


def pytest_collection_finish() -> None:
    """What is imported by now stays: the collection of garbage need not look at it again."""
    gc.collect()
    gc.freeze()
