"""What all tests share."""

from __future__ import annotations

import gc
import sys
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

import pytest
from pairs import pairwise

HERE = Path(__file__).parent
collect_ignore_glob = ["scenes/*"]  # scripts, which `test_scenes` runs


# Instances that took more than some 0.6 CPU s, by `pytest --durations=0`.
SLOW = (HERE / "slow.txt").read_text(encoding="utf-8").splitlines()


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """What the default run leaves to the slow one, besides what is marked in the files themselves."""
    _leave_pairs(items)
    found = {item.nodeid: item for item in items}
    for name in SLOW:
        if name in found:
            found[name].add_marker(pytest.mark.slow)
        elif not config.option.file_or_dir:  # all tests are here
            raise pytest.UsageError(f"tests/slow.txt names {name}, which does not exist")


def _leave_pairs(items: list[pytest.Item]) -> None:
    """Of the full products marked `pairwise` only pairs stay in the default run; the rest is slow."""
    products = defaultdict(list)
    for item in items:
        if item.get_closest_marker("pairwise") and not item.get_closest_marker("slow"):
            products[item.nodeid.partition("[")[0]].append(item)
    for product in products.values():
        # values are told apart as objects: arrays and laws cannot be compared or hashed
        values = [{name: id(v) for name, v in item.callspec.params.items()} for item in product]
        kept = pairwise(values)
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


def pytest_collection_finish() -> None:
    """What is imported by now stays: the collection of garbage need not look at it again."""
    gc.collect()
    gc.freeze()
