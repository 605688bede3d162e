"""Fixtures of the verification problems."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import Any

import pytest

import skfem_contact as sc

REFUSED = "refused clearly"

# Closed forms and discrete conditions of linear bodies hold at any strain: here moduli are one, and
# loads what is handy. Other warnings are errors here as well; those of strains and rotations are in
# test_validity.py.
STRAINED = [
    f"ignore:.*{what}:skfem_contact.ContactWarning"
    for what in ("is strained by", "has turned by", "arge displacements")
]


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Verification is about the linear theory, whatever the load."""
    here = str(Path(__file__).parent)
    for item in items:
        if str(item.path).startswith(here):
            for words in STRAINED:
                item.add_marker(pytest.mark.filterwarnings(words))


@pytest.fixture
def refused(record_property: Any) -> Callable[..., AbstractContextManager[Any]]:
    """``with refused(error, match):`` asserts an error of this library whose message says why.

    Where it holds the test's outcome is noted as a refusal (`benchmarks/extremes.py` counts them);
    with ``either=True`` an answer will do as well, and `.excinfo` is None then.
    """

    @contextmanager
    def check(error: Any = sc.ContactError, *, match: str, either: bool = False) -> Iterator[Any]:
        seen = Refusal()
        if either:
            try:
                yield seen
            except error:
                with pytest.raises(error, match=match) as seen.excinfo:
                    raise
                seen.happened = True
        else:
            with pytest.raises(error, match=match) as seen.excinfo:
                yield seen
            seen.happened = True
        if seen.happened:
            record_property("outcome", REFUSED)

    return check


class Refusal:
    """Whether the error came, and pytest's record of it."""

    happened = False
    excinfo: Any = None

    @property
    def error(self) -> Any:
        """The exception."""
        return self.excinfo.value
