"""Draws the stored results: time by stage, and growth over the number of DOFs.

    python benchmarks/plot.py [results/history.json]

The picture goes to ``docs/images/benchmark.png``.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

import matplotlib.pyplot as plt

HERE = Path(__file__).parent
PYTHON_COUNTS = 10_000  # DOFs, as in run.py
STAGES = {
    "setup": "pairing",
    "condensation": "condensation",
    "contact problem": "contact problem",
    "loop": "50 increments",
    "recovery": "interiors",
}
COLOURS = ("#9ecae1", "#20618d", "#7fbf9b", "#e08a3c", "#c9c9c9")


def main() -> None:
    path = Path(sys.argv[1]) if len(sys.argv) > 1 else HERE / "results" / "history.json"
    rows = json.loads(path.read_text(encoding="utf-8"))["rows"]
    good = [row for row in rows if all("failed" not in row[k] for k in ("history", "own", "plain"))]
    figure, (left, right) = plt.subplots(1, 2, figsize=(10, 3.8), layout="constrained")

    line = [row for row in good if row["kind"] == "Q1" and row["method"] == "node"]
    # where Python's time counts the bars would hide all others; the curves show it
    good = [row for row in good if row["history"]["dofs"] > PYTHON_COUNTS]
    names = [row["case"] for row in good]
    base = [0.0] * len(good)
    for (stage, label), colour in zip(STAGES.items(), COLOURS, strict=True):
        share = [row["history"][stage] / row["plain"]["solve"] for row in good]
        left.barh(names, share, left=base, color=colour, label=label)
        base = [a + b for a, b in zip(base, share, strict=True)]
    own = [row["own"]["solve"] / row["plain"]["solve"] for row in good]
    left.plot(own, names, "k|", ms=16, label="own linear solve")
    left.axvline(1.0, color="0.3", lw=1, ls=":")
    left.invert_yaxis()
    left.set(xlabel="CPU time over one skfem.solve of the tied meshes")
    left.legend(frameon=False, fontsize=8)

    n = [row["history"]["dofs"] for row in line]
    for what, key, style in (
        ("history", "total", "o-"),
        ("own", "solve", "s--"),
        ("plain", "solve", "^:"),
    ):
        label = {"history": "50 increments", "own": "own solve", "plain": "skfem.solve"}[what]
        right.loglog(n, [row[what][key] for row in line], style, label=label)
    right.set(xlabel="DOFs", ylabel="CPU time [s]")
    right.legend(frameon=False)
    for axes in (left, right):
        axes.spines[["top", "right"]].set_visible(False)
    images = HERE.parent / "docs" / "images"
    images.mkdir(parents=True, exist_ok=True)
    figure.savefig(images / "benchmark.png", dpi=90)


if __name__ == "__main__":
    main()
