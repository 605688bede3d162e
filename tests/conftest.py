"""What all tests share."""

from __future__ import annotations

import gc
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

HERE = Path(__file__).parent


@pytest.fixture(scope="module", autouse=True)
def forgotten_answers() -> Iterator[None]:
    """Answers that a module keeps for its tests are forgotten when it ends: all are 8 GB together."""
    yield
    for module in list(sys.modules.values()):
        if HERE in Path(getattr(module, "__file__", None) or "/").parents:
            for kept in list(vars(module).values()):
                if hasattr(kept, "cache_clear"):
                    kept.cache_clear()
    gc.collect()
