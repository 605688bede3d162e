"""Only what the scene requires: each ingredient's scene with it and without it, side by side.

    python benchmarks/audit.py [--dofs N] [--only NAME ...] [--write]
    python benchmarks/audit.py --print [--write]        the table of what is stored

Stores `benchmarks/results/audit.json` and prints the tables. Every row is a process
of its own with one BLAS thread: both scenes in turn, several rounds, CPU seconds, of which the medians
count; once each for memory (`tracemalloc`, which NumPy reports to) and once for calls (`cProfile`).
"""

from __future__ import annotations

import argparse
import cProfile
import gc
import json
import os
import subprocess
import sys
import time
import tracemalloc
from pathlib import Path
from statistics import median
from typing import Any

from audit_scenes import ROWS, Blocks, Counts, Row
from run import HERE, RESULTS, THREADS, machine, write_into

DOFS, ROUNDS = 30e3, 5
ENOUGH = 15.0  # seconds of a row, after which two rounds will do
PACKAGE = "skfem_contact"
# What is imported, by what a user has typed so far.
IMPORTS = {
    "scikit-fem alone": "import skfem, skfem.models",
    "skfem_contact": "import skfem, skfem.models, skfem_contact",
}
# Packages that an import must not bring along: they are for files, pictures and other backends.
LATER = ("matplotlib", "meshio", "pyamg", "tqdm", "rich", "threadpoolctl", "xml")


# -- what a process measures ------------------------------------------------------------------


def calls(row: Row, blocks: Blocks, present: bool) -> tuple[Counts, Any]:
    """How often each function of the ingredient was called, and what the scene left behind."""
    profile = cProfile.Profile()
    done = profile.runcall(row.run, blocks, present)
    profile.create_stats()
    counts = dict.fromkeys(row.functions, 0)
    for (path, _, function), (_, number, *_) in profile.stats.items():  # type: ignore[attr-defined]
        for name in counts:
            module, _, wanted = name.partition(":")
            here = Path(path).parts[-2 - module.count("/") :] == (PACKAGE, *f"{module}.py".split("/"))
            if here and wanted in ("", function) and function[0] != "<":
                counts[name] += number
    return counts, done


def memory(row: Row, blocks: Blocks, present: bool) -> tuple[int, int]:
    """Bytes at the peak, and bytes that solver and results hold at the end."""
    gc.collect()
    tracemalloc.start()
    try:
        done = row.run(blocks, present)
        gc.collect()
        held, peak = tracemalloc.get_traced_memory()
        del done
    finally:
        tracemalloc.stop()
    return peak, held


def seconds(row: Row, blocks: Blocks, present: bool) -> float:
    """CPU time from the contacts to the results."""
    gc.collect()
    begin = time.process_time()
    row.run(blocks, present)
    return time.process_time() - begin


def measure(row: Row, dofs: float, rounds: int) -> dict[str, Any]:
    """Both scenes of a row."""
    blocks = Blocks(dofs)
    out: dict[str, Any] = {"ingredient": row.ingredient, "present": row.present, "absent": row.absent}
    sides: dict[str, dict[str, Any]] = {"with": {}, "without": {}}
    for name, side in sides.items():  # first, so that the rounds find everything imported
        side["calls"], done = calls(row, blocks, name == "with")
        side["holds"] = row.counts(done)
        side["dofs"], side["points"] = done.solver.system.n, done.solver.kin.m
        side["increments"] = len(done.results)
        side["iterations"] = sum(result.iterations for result in done.results)
        del done
    times: dict[str, list[float]] = {name: [] for name in sides}
    for number in range(rounds):
        if number > 1 and sum(map(sum, times.values())) > ENOUGH:
            break
        for name in sides:
            times[name].append(seconds(row, blocks, name == "with"))
    for name, side in sides.items():
        side["seconds"], side["rounds"] = median(times[name]), times[name]
        side["peak"], side["held"] = memory(row, blocks, name == "with")
    return out | sides


def imported() -> dict[str, Any]:
    """Seconds, memory and modules of an import, each in fresh processes, interleaved."""
    program = (
        "import time, sys; begin = time.process_time(); {0}; spent = time.process_time() - begin; "
        "loaded = list(sys.modules); import json, pathlib; "  # ru_maxrss begins at the parent's
        "status = pathlib.Path('/proc/self/status').read_text().partition('VmHWM:')[2]; "
        "print(json.dumps([spent, int(status.split()[0]) / 1024, len(loaded), "
        "sorted(set(name.split('.')[0] for name in loaded))]))"
    )
    runs: dict[str, list[Any]] = {name: [] for name in IMPORTS}
    for _ in range(ROUNDS + 2):
        for name, line in IMPORTS.items():
            done = subprocess.run(
                [sys.executable, "-c", program.format(line)],
                capture_output=True,
                text=True,
                check=True,
                env=os.environ | dict.fromkeys(THREADS, "1"),
            )
            runs[name].append(json.loads(done.stdout))
    return {
        name: {
            "seconds": median(run[0] for run in found),
            "memory": median(run[1] for run in found),
            "modules": found[-1][2],
            "brought along": [top for top in LATER if top in found[-1][3]],
        }
        for name, found in runs.items()
    }


# -- the table --------------------------------------------------------------------------------


def table(rows: list[dict[str, Any]]) -> str:
    """The table in Markdown."""
    head = ["ingredient", "scene with", "scene without", "time, s", "peak, MB", "held, MB"]
    head += ["only in the scene with", "of that in the scene without"]
    lines = ["| " + " | ".join(head) + " |", "|" + " --- |" * len(head)]
    for row in rows:
        a, b = row["with"], row["without"]
        pairs = [
            f"{a['seconds']:.2f} / {b['seconds']:.2f}",
            f"{a['peak'] / 1e6:.0f} / {b['peak'] / 1e6:.0f}",
            f"{a['held'] / 1e6:.1f} / {b['held'] / 1e6:.1f}",
        ]
        cells = [row["ingredient"], row["present"], row["absent"], *pairs, contents(a), contents(b)]
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines)


def contents(side: dict[str, Any]) -> str:
    """Counts of one side in words."""
    called = [f"{calls:,} calls of `{name.rstrip(':')}`" for name, calls in side["calls"].items()]
    return "; ".join([*called, *(f"{number:,} {what}" for what, number in side["holds"].items())])


def imports_table(found: dict[str, Any]) -> str:
    """The table of imports in Markdown."""
    lines = ["| import | CPU, s | peak of the process, MB | modules | of " + ", ".join(LATER) + " |"]
    lines.append("|" + " --- |" * 5)
    for name, side in found.items():
        brought = ", ".join(side["brought along"]) or "none"
        numbers = f"{side['seconds']:.2f} | {side['memory']:.0f} | {side['modules']}"
        lines.append(f"| {name} | {numbers} | {brought} |")
    return "\n".join(lines)


def run(name: str, dofs: float) -> dict[str, Any]:
    """A row in a process of its own; a failure is an answer too."""
    command = [sys.executable, __file__, "--worker", name, "--dofs", str(dofs)]
    pinned = os.environ | dict.fromkeys(THREADS, "1")
    done = subprocess.run(command, capture_output=True, text=True, env=pinned)
    if done.returncode:
        raise SystemExit(f"{name}: {done.stderr}")
    found: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--dofs", type=float, default=DOFS)
    parser.add_argument("--only", nargs="*", help="ingredients; other rows stay")
    parser.add_argument("--print", action="store_true", help="measure nothing")
    parser.add_argument("--write", action="store_true", help="put the tables into docs/checks/audit.md")
    parser.add_argument("--output", type=Path, default=RESULTS / "audit.json")
    parser.add_argument("--worker", help=argparse.SUPPRESS)
    args = parser.parse_args()
    names = [row.ingredient for row in ROWS]
    if args.worker:
        print(json.dumps(measure(ROWS[names.index(args.worker)], args.dofs, ROUNDS)))
        return
    path = args.output
    stored: dict[str, Any] = json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}
    if not args.print:
        rows = {row["ingredient"]: row for row in stored.get("rows", [])}
        for name in args.only or names:
            rows[name] = run(name, args.dofs)
            print(name, file=sys.stderr, flush=True)
        stored = {"machine": machine(), "dofs": args.dofs, "imports": imported()}
        stored["rows"] = [rows[name] for name in names if name in rows]
        path.write_text(json.dumps(stored, indent=1) + "\n", encoding="utf-8")
    text = table(stored["rows"]) + "\n\n" + imports_table(stored["imports"])
    print(text)
    if args.write:
        write_into(HERE.parent / "docs" / "checks" / "audit.md", text)


if __name__ == "__main__":
    main()
