"""Times whole jobs in processes of their own, from the import of the library to the print.

    python benchmarks/whole_jobs.py [--beside CHECKOUT] [--quick] [--large] [--only NAME ...] [--write]

Benchmarks that repeat a solve in one process do not see imports, first set-ups and what is made once;
a user with a script waits for them. Files are compiled by a run before. With `--beside` the library of
another checkout does the same jobs in turn with this one, and ratios and differences of answers are
in the table. The jobs are in `jobs.py`. As in `run.py` the times are CPU seconds with one BLAS thread.
"""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from jobs import JOBS, QUICK, Job
from run import (
    HERE,
    RESULTS,
    command_line,
    listed,
    machine,
    measure,
    middle,
    stored,
    write_into,
)

MARKS = "<!-- jobs table: begin -->", "<!-- jobs table: end -->"
PARTS = ("import", "bodies", "set-up", "solve", "print")
SCRIPT = str(HERE / "jobs.py")


def run(job: Job, beside: str | None = None) -> dict[str, Any]:
    """All rounds of a job, interleaved with those of the library of another checkout."""
    libraries = {"history": str(HERE.parent)} | ({"beside": beside} if beside else {})
    runs: dict[str, list[dict[str, Any]]] = {what: [] for what in libraries}
    for _ in range(job.rounds):
        for what, done in runs.items():
            done.append(measure(what, job, libraries[what], script=SCRIPT))
            note = done[-1].get("failed") or f"{done[-1]['job']:.2f} s"
            print(f"  {job.name:16s} {what:8s} {note}", file=sys.stderr, flush=True)
    row: dict[str, Any] = {"case": job.name, "rounds": job.rounds}
    for what, done in runs.items():
        good = [r for r in done if "failed" not in r]
        row[what] = summed_up(good) if good else done[-1]
    row["apart"] = apart(row["history"], row.get("beside", {}))
    for what in libraries:
        row[what].pop("pressure", None)  # many numbers, which have been compared
    return row


def summed_up(runs: list[dict[str, Any]]) -> dict[str, Any]:
    """Medians, and the smallest time of the whole job."""
    return middle(runs) | {"least": min(run["job"] for run in runs)}


def apart(here: dict[str, Any], there: dict[str, Any]) -> float | None:
    """Largest difference of pressures over the largest pressure, between the two libraries."""
    if "pressure" not in here or "pressure" not in there:
        return None
    ours, theirs = np.array(here["pressure"]), np.array(there["pressure"])
    return float(np.abs(ours - theirs).max() / np.abs(theirs).max())


def compared(row: dict[str, Any], key: str) -> str:
    """A number of this library over that of the other one."""
    other = row.get("beside", {})
    if key not in other:
        return other.get("failed", "not run")
    return f"{row['history'][key] / other[key]:.2f}"


def written(value: float | None, form: str) -> str:
    return "-" if value is None else format(value, form)


def shown(key: str, form: str) -> Callable[[dict[str, Any]], str]:
    """The column of a number of this library; an import alone has few."""
    return lambda row: written(row["history"].get(key), form)


COLUMNS: dict[str, Callable[[dict[str, Any]], str]] = {
    "job": lambda r: r["case"],
    "DOFs": shown("dofs", ","),
    "import, s": shown("import", ".3f"),
    "bodies": shown("bodies", ".3f"),
    "set-up": shown("set-up", ".3f"),
    "solve": shown("solve", ".3f"),
    "print": shown("print", ".3f"),
    "job, s": shown("job", ".2f"),
    "least, s": shown("least", ".3f"),
    "of the other version": lambda r: compared(r, "job"),
    "smallest times": lambda r: compared(r, "least"),
    "peak memory, MB": shown("memory", ".0f"),
    "of its memory": lambda r: compared(r, "memory"),
    "error": shown("error", ".0e"),
    "pressures apart": lambda r: written(r["apart"], ".0e"),
}


def table(rows: list[dict[str, Any]]) -> str:
    """The table in Markdown."""
    return listed(rows, COLUMNS)


def compile_files(libraries: list[str | None]) -> None:
    """Let every library be imported once, as it is after it has been installed."""
    os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
    for library in libraries:
        if library is not None:
            measure("compiled", QUICK[0], library, script=SCRIPT)


def main() -> None:
    parser = command_line(__doc__)
    parser.add_argument("--beside", metavar="CHECKOUT", help="measure its library in turn with this")
    parser.add_argument("--large", action="store_true", help="the largest job, of minutes, as well")
    args = parser.parse_args()
    beside = None if args.beside is None else str(Path(args.beside).resolve())
    chosen = QUICK if args.quick else [job for job in JOBS if args.large or not job.large]
    if args.only is not None:
        known = {job.name: job for job in [*QUICK, *JOBS]}
        chosen = [known[name] for name in args.only]
    compile_files([str(HERE.parent), beside])
    path = RESULTS / ("whole_jobs_quick.json" if args.quick else "whole_jobs.json")
    rows = stored(path)
    for job in chosen:
        rows[job.name] = run(job, beside) | {"machine": machine()}
        record = [rows[one.name] for one in (QUICK if args.quick else JOBS) if one.name in rows]
        path.write_text(json.dumps({"rows": record}, indent=1) + "\n", encoding="utf-8")
    print(table(record))
    if args.write:
        write_into(HERE.parent / "docs" / "checks" / "performance.md", table(record), MARKS)


if __name__ == "__main__":
    main()
