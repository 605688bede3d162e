"""The verdicts on all answers of a test, as `verdicts.json` has them: kinds and places, no words.

``SKFEM_CONTACT_RECORD=1 python -m pytest -m "slow or not slow" FILES`` writes them anew.
"""

from __future__ import annotations

import json
import re
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

import skfem_contact as sc

STORED = Path(__file__).with_suffix(".json")
PLACE = re.compile(r"\bat \(([^()]*)\)")

#: Tests that make all of their answers themselves: what is kept between tests is made in the first.
FILES = (
    "test_corners",
    "test_rigid_bodies",
    "test_standing",
    "test_triangles",
    "test_validity",
    "test_validity_solids",
)

#: Of long histories the last answers are looked at.
MOST = 8


def verdict(result: sc.answers.ContactResult) -> str:
    """What does not hold, and where; a star per late warning; after a bar what was warned of."""
    with warnings.catch_warnings(record=True) as late:
        warnings.simplefilter("always")
        validity = result.validity
    parts = []
    for (kind, name), text in sorted(validity.problems.items()):
        places = [f"({_rounded(place)})" for place in PLACE.findall(text)]
        parts.append(" ".join([f"{kind} {name}", *places]))
    before = [f"{kind} {name}" for kind, name in validity.before]
    words = "; ".join(parts) + "*" * len(late)
    return f"{words} | {'; '.join(before)}" if before else words


def _rounded(place: str) -> str:
    """Coordinates to two digits; what is next to zero is zero, and so is round-off of lengths of one.

    The smallest scenes are some 1e-12 long.
    """
    values = [float(value) for value in place.split(",")]
    largest = max(*map(abs, values), 1e-12)
    return ", ".join(f"{0.0 if abs(v) < 1e-3 * largest else v:.2g}" for v in values)


@contextmanager
def answers(monkeypatch: pytest.MonkeyPatch) -> Iterator[list[Any]]:
    """All answers that are made meanwhile, in their order."""
    made: list[Any] = []
    plain = sc.answers.ContactResult.__init__

    def noted(self: Any, answer: Any) -> None:
        plain(self, answer)
        if answer.converged and not any(answer is other._answer for other in made):
            made.append(self)

    monkeypatch.setattr(sc.answers.ContactResult, "__init__", noted)
    yield made


def stored() -> dict[str, list[str]]:
    """The recorded verdicts by the name of the test."""
    known: dict[str, list[str]] = json.loads(STORED.read_text(encoding="utf-8"))
    return known


def store(name: str, found: list[str]) -> None:
    """Write the verdicts of one test."""
    known = (stored() if STORED.exists() else {}) | {name: found}
    lines = [f"{json.dumps(k)}: {json.dumps(known[k])}" for k in sorted(known)]
    STORED.write_text("{\n" + ",\n".join(lines) + "\n}\n", encoding="utf-8")
