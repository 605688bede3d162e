"""The extremes as a table: cases, right answers, clear refusals, and the precision attained.

    OPENBLAS_NUM_THREADS=1 python benchmarks/extremes.py [--slow] [--write]

Runs test_extremes.py, test_extreme_cases.py and test_extremes_solids.py in tests/verification. A case
is a test with one set of parameters; its row is the number in the name of the test. It counts as
refused if it passed and the assertion of an error's type and words was what it passed by (the fixture
`refused`), as wrong if it failed, as right otherwise. The deviation is the largest that
`assert_allclose` met in any case of the row, over the largest value compared, if that was more than the
absolute tolerance.
"""

from __future__ import annotations

import argparse
import json
import re
import sys
import time
from collections import defaultdict
from pathlib import Path
from typing import Any

import numpy as np
import numpy.testing
import pytest

HERE = Path(__file__).parent
TESTS = [
    str(HERE.parent / "tests" / "verification" / name)
    for name in ("test_extremes.py", "test_extreme_cases.py", "test_extremes_solids.py")
]

STORED = HERE / "results" / "extremes.json"
PAGE = HERE.parent / "docs" / "checks" / "extremes.md"
BEGIN, END = "<!-- extremes table: begin -->", "<!-- extremes table: end -->"

#: What is varied, and what is right.
ROWS = {
    "X1": (
        "moduli of the two bodies 1e-8 to 1e8",
        "springs in series; a rigid foundation in the limit",
    ),
    "X2": (
        "tangential stiffness 1e-8 to 1e12 of K's diagonal, and infinite",
        "in series, at most mu p",
    ),
    "X3": ("mu = 0", "no friction, to the last digit"),
    "X4": ("mu = 1e-12", "slip with mu p"),
    "X5": ("mu up to 1e6", "stick; the law holds where the block lifts"),
    "X6": ("nanometres to gigametres, micropascals to gigapascals", "the same numbers times the units"),
    "X7": ("loads times 1e-30 to 1e30", "proportional"),
    "X8": ("gaps and overlaps from 1e-15 to ten times the body", "exactly nothing; E g / H"),
    "X9": ("bodies 1e4 times as wide as high, to 100 times as high", "uniform stress"),
    "X10": ("facets 100 times longer on either side", "uniform stress (mortar); resultants of statics"),
    "X11": ("normals at every angle, and a hair off the axes", "the turned answer"),
    "X12": ("nu up to 0.49999", "1667.11 E times the strain at 0.4999"),
    "X13": ("one point in contact", "the only admissible state; of several the one that continues"),
    "X14": ("all points slip", "mu N; no equilibrium if nothing else holds"),
    "X15": ("no point touches", "the answer without contact"),
    "X16": ("no load at all", "nothing moves, at once"),
    "X17": ("a body held by friction alone", "rests below mu N, is free to move above"),
    "X18": ("contact nodes that are prescribed", "what is prescribed wins, and says if it overlaps"),
    "X19": ("a node in several contacts", "uniform stress"),
    "X20": ("nodes on joints of the other surface", "one partner, and continuous"),
    "X21": ("overhang", "carries nothing beyond the end"),
    "X22": ("corners, concave and convex", "one partner, and continuous"),
    "X23": ("facets twice, in any order, without length", "the same surface; named"),
    "X24": ("NaN, infinity, parameters out of range", "refused before solving"),
    "X25": ("reversals; a thousand cycles", "the loop closes, no drift"),
    "X26": ("caps: 0, below, at and above mu p, infinite", "frictionless, capped, Coulomb"),
    "X27": ("pressure that falls while sliding", "the bound of the end of the step"),
    "X28": ("numbering, order of bodies, a joint in two parts", "the same answer"),
    "X29": ("pushed with mu P (1 +- 1e-12)", "the same forces, stick or slip, or free to move"),
    "X30": ("nothing to touch; 1e5 points (slow)", "named; uniform pressure"),
    "X31": ("single precision, integers, strided, read-only", "bit by bit the same"),
    "X32": ("restart half-way", "the path itself"),
    "X33": ("moved and turned as a whole", "the same forces"),
    "redundant": ("constraints that are nearly redundant, or contradict", "statics; named if they do"),
    "far": ("contact pairs 1e9 sizes apart, or that far from the origin", "the answer of one alone"),
    "crossed": ("moduli, mu, units, direction at their extremes together", "uniform stress"),
    "S1": ("solids: moduli 1e-9 to 1e9", "springs in series"),
    "S2": ("solids: nanometres to megametres, units of stress", "the same numbers times the units"),
    "S3": ("solids: plates 1000 times as wide as high, walls, bars", "uniform stress"),
    "S4": ("solids: mu from 0 to 1000", "slip with mu p; stick"),
    "S5": ("solids: the corner of a box in a face, pressed by 1e-12 to 1e-2", "one condition, by hand"),
    "S6": ("solids: one coarse face on 64 fine ones, either way", "uniform stress"),
    "S7": ("solids: gaps and overlaps from 1e-12 to ten bodies", "exactly nothing; E g / 2 H"),
    "S8": ("solids: equal squares turned by 1e-15 to 1e-3", "uniform stress, less what sticks out"),
    "S9": ("solids: a thousand cycles of full slip", "every loop is the first"),
    "S10": ("solids: nothing to touch, elements inside out", "named"),
}


class Collector:
    """A pytest plugin that counts outcomes by row, and how far compared numbers were apart."""

    def __init__(self) -> None:
        self.cases: dict[str, list[tuple[str, str, float]]] = defaultdict(list)
        self.deviation = 0.0

    def compare(self, actual: Any, desired: Any, *args: Any, **settings: Any) -> None:
        """`assert_allclose`, remembering the deviation."""
        numpy_allclose(actual, desired, *args, **settings)
        a, d = np.broadcast_arrays(np.asarray(actual, dtype=float), np.asarray(desired, dtype=float))
        scale = np.abs(d).max(initial=0.0)
        if scale > np.max(settings.get("atol", 0.0)):  # else it was compared with nothing
            self.deviation = max(self.deviation, float(np.abs(a - d).max() / scale))

    def pytest_runtest_setup(self) -> None:
        self.deviation = 0.0

    def pytest_runtest_logreport(self, report: Any) -> None:
        if report.when != "call" and not report.failed:
            return
        name = report.nodeid.split("::")[-1]
        row = re.match(r"test_([a-zA-Z]+\d*)", name)
        outcome = dict(report.user_properties).get("outcome", "right")
        if report.failed:
            outcome = "wrong"
        self.cases[row[1] if row else "?"].append((name, outcome, self.deviation))


numpy_allclose = np.testing.assert_allclose


def table(rows: dict[str, Any]) -> str:
    """The rows as they stand in the documentation."""
    lines = [
        "| | what is extreme | right answer | cases | right | refused clearly | wrong | deviation |",
        "| --- | --- | --- | --- | --- | --- | --- | --- |",
    ]
    total = [0, 0, 0, 0]
    for name, (what, answer) in ROWS.items():
        row = rows[name]
        counts = [row["cases"], row["right"], row["refused clearly"], row["wrong"]]
        total = [a + b for a, b in zip(total, counts, strict=True)]
        deviation = f"{row['deviation']:.0e}" if row["deviation"] > 0 else "0"
        cells = [name, what, answer, *map(str, counts), deviation]
        lines.append("| " + " | ".join(cells) + " |")
    lines.append("| **all** | | | " + " | ".join(f"**{n}**" for n in total) + " | |")
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--slow", action="store_true", help="the cases marked as slow as well")
    parser.add_argument("--write", action="store_true", help="put the table into the docs")
    parser.add_argument("--out", type=Path, default=STORED)
    options = parser.parse_args()
    collector, start = Collector(), time.process_time()
    np.testing.assert_allclose = collector.compare  # before the tests import it
    marks = ["-m", ""] if options.slow else []
    code = pytest.main(["-q", "-p", "no:cacheprovider", *marks, *TESTS], plugins=[collector])
    rows = {}
    for name, cases in collector.cases.items():
        count = [outcome for _, outcome, _ in cases]
        worst = max(cases, key=lambda case: case[2])
        rows[name] = {
            "cases": len(count),
            **{kind: count.count(kind) for kind in ("right", "refused clearly", "wrong")},
            "deviation": worst[2],
            "at": worst[0],
        }
    unknown = set(rows) ^ set(ROWS)
    if unknown:
        sys.exit(f"rows without a description, or without a case: {sorted(unknown)}")
    seconds = round(time.process_time() - start)
    found = {"rows": rows, "slow": options.slow, "cpu_seconds": seconds}
    options.out.parent.mkdir(exist_ok=True)
    options.out.write_text(json.dumps(found, indent=1) + "\n")
    print(table(rows))
    if options.write:
        before, _, rest = PAGE.read_text(encoding="utf-8").partition(BEGIN)
        after = rest.partition(END)[2]
        PAGE.write_text(f"{before}{BEGIN}\n{table(rows)}\n{END}{after}", encoding="utf-8")
    sys.exit(int(code))


if __name__ == "__main__":
    main()
