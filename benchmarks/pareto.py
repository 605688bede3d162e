"""Error over time on Hertz contact with meshes that do not match: a picture and its numbers.

    python benchmarks/pareto.py            measures, stores benchmarks/results/pareto.json, draws
    python benchmarks/pareto.py --draw     draws what is stored

Every setting is measured in turn, three rounds of all of them; the median counts. A time is the CPU
time of the whole script a user would write: meshes, assembly, pairing, condensation, loop.
"""

from __future__ import annotations

import json
import os
import platform
import sys
import time
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # before NumPy starts its threads

import matplotlib.pyplot as plt
import numpy as np

here = Path(__file__).parent
sys.path.insert(0, str(here.parent / "tests" / "verification"))

from test_mortar_hertz import hertz, pressure_error  # noqa: E402

STORED = here / "results" / "pareto.json"
PICTURE = here.parent / "docs" / "images" / "pareto.png"
ROUNDS, RATIO = 3, 4 / 3
MESHES = {
    "P1": (8.5, 16.5, 32.5, 48.5),
    "Q1": (8.5, 16.5, 32.5, 48.5),
    "P2": (4.25, 8.25, 16.25, 24.25),
    "Q2": (4.25, 8.25, 16.25, 24.25),
}
SETTINGS = [(kind, method, n) for kind in MESHES for method in ("node", "mortar") for n in MESHES[kind]]


def measure() -> dict:
    """Errors and times of all settings."""
    rows = {setting: {"seconds": []} for setting in SETTINGS}
    for number in range(ROUNDS):
        for kind, method, n in SETTINGS:
            hertz.cache_clear()  # the tests keep results
            start = time.process_time()
            result, exact = hertz(n, method, kind, RATIO)
            row = rows[kind, method, n]
            row["seconds"].append(time.process_time() - start)
            if number == 0:
                row["error"] = pressure_error(result, exact)
                row["dofs"] = result.system.n
                row["iterations"] = result.iterations
    return {
        "problem": "Hertz, lower elements 4/3 of the upper ones; L2 error of the pressure",
        "machine": f"{platform.machine()}, Python {platform.python_version()}, one BLAS thread",
        "rows": [
            {
                "kind": kind,
                "method": method,
                "nodes": n,
                **row,
                "median": float(np.median(row["seconds"])),
            }
            for (kind, method, n), row in rows.items()
        ],
    }


def draw(stored: dict) -> None:
    """Error over time, a line for each element and method."""
    figure, ax = plt.subplots(figsize=(6.5, 4.5))
    colours = dict(zip(MESHES, ("C0", "C1", "C2", "C3"), strict=True))
    for kind in MESHES:
        for method, style in (("node", "o--"), ("mortar", "s-")):
            rows = [r for r in stored["rows"] if r["kind"] == kind and r["method"] == method]
            ax.loglog(
                [r["median"] for r in rows],
                [100 * r["error"] for r in rows],
                style,
                color=colours[kind],
                markersize=4,
                label=f"{kind}, {method}",
            )
    ax.set(xlabel="CPU seconds, assembly included", ylabel="L2 error of the pressure [%]")
    ax.set_xticks([0.1, 0.2, 0.5, 1.0], ["0.1", "0.2", "0.5", "1"])
    ax.set_xticks([], minor=True)
    ax.set_yticks([0.1, 0.2, 0.5, 1, 2, 5], ["0.1", "0.2", "0.5", "1", "2", "5"])
    ax.legend(ncols=2, frameon=False, fontsize="small")
    ax.grid(which="both", alpha=0.2)
    figure.tight_layout()
    figure.savefig(PICTURE, dpi=110)


if __name__ == "__main__":
    if "--draw" not in sys.argv:
        STORED.parent.mkdir(exist_ok=True)
        STORED.write_text(json.dumps(measure(), indent=1))
    data = json.loads(STORED.read_text())
    for row in data["rows"]:
        print(
            f"{row['kind']}  {row['method']:<7s} {row['dofs']:7d} DOFs  "
            f"{100 * row['error']:6.2f} %  {row['median']:6.2f} s"
        )
    draw(data)
