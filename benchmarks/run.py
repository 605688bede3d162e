"""Times every case, checks its answer, and prints the table that stands in the README.

    python benchmarks/run.py [--quick] [--all] [--only NAME ...] [--beside CHECKOUT] [--write]

Every measurement is a process of its own with one BLAS thread, so that its peak memory is its own.
The processes of one case are interleaved, and the medians over several rounds are compared: the times
are CPU seconds, which other users of the machine disturb less than the wall clock. With `--beside` the
library of another checkout does the same history in turn with this one, and the ratios are printed.
"""

from __future__ import annotations

import argparse
import datetime
import json
import os
import platform
import resource
import subprocess
import sys
import time
import traceback
from collections.abc import Callable, Iterable
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np
import scipy
import scipy.spatial  # the library does so with its first pairing: the time is that of imports
import skfem as fem
import threadpoolctl  # noqa: F401 (likewise, with its first factorisation)
from cases import CASES, Case, Scene

import skfem_contact as sc

HERE = Path(__file__).parent
RESULTS = HERE / "results"
THREADS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")  # one for each worker
BEGIN, END = "<!-- benchmark table: begin -->", "<!-- benchmark table: end -->"
TIME_LIMIT = 3600  # seconds per process
PYTHON_COUNTS = 10_000  # DOFs below which times are Python's, and do not grow


class Clock:
    """CPU seconds by stage."""

    def __init__(self) -> None:
        self.stages: dict[str, float] = {}

    def __call__(self, stage: str, work: Callable[[], Any]) -> Any:
        begin = time.process_time()
        result = work()
        self.stages[stage] = time.process_time() - begin
        return result


# -- what a process measures ------------------------------------------------------------------


def history(scene: Scene) -> dict[str, Any]:
    """The whole load history, condensed, with the interior of every increment."""
    clock = Clock()
    contact = clock("surfaces", scene.contact)
    solver = clock("setup", lambda: sc.ContactSolver(scene.bodies, [contact]))
    # `--beside`: earlier versions have other names, and condense all bodies at once
    clock("condensation", lambda: [part.S for part in getattr(solver.model, "substructures", ())])
    clock("contact problem", solver.prepare)
    results = clock("loop", lambda: list(scene.run(solver)))
    clock("recovery", lambda: solver.recover(results))
    further = clock("further", lambda: further_increments(scene, solver, results[-1]))
    iterations = [result.iterations for result in results]
    return {
        **clock.stages,
        "total": sum(clock.stages.values()) - clock.stages["further"],
        "further": clock.stages["further"] / further,
        "dofs": solver.system.n,
        "points": solver.kin.m,
        "increments": len(results),
        "iterations": iterations,
        "errors": scene.errors(results),
        "certificate": float(results[-1].certificate.worst),
    }


def further_increments(scene: Scene, solver: sc.ContactSolver, last: Any) -> int:
    """Twenty more load steps, back to the middle of the loop; returns how many."""
    count = 20
    if scene.case.mu == 0:
        steps = [{"x": scene.lowered(s)} for s in np.linspace(1, 0.9, count)]
    else:
        Q = 0.95 * scene.case.mu * float(last.normal_force.sum())
        steps = [{"f": scene.pushed(q), "x": scene.lowered(1)} for q in np.linspace(-Q, 0, count)]
    for _ in solver.history(steps, start=last):
        pass
    return count


def tied_system(scene: Scene) -> tuple[Any, Any, Any]:
    """Matrix, load and positions of the same meshes glued together, under the same loads."""
    system = sc.bodies.stack(scene.bodies)
    x, f = np.zeros(system.n), np.zeros(system.n)
    x[system.slice("upper")] = scene.lowered(1)["upper"]
    for name, load in scene.pushed(1e-3 * scene.E_star).items():
        f[system.slice(name)] = load
    rows = sc.elimination.contact_rows(system, scene.contact(tied=True))
    constraint = sc.elimination.eliminate(rows.C, rows.b, system.D, x, prefer=rows.prefer)
    K, f = constraint.reduce(system.K, f)
    points = np.concatenate([body.dof_points for body in scene.bodies])
    return K, f, points[constraint.independent]


def own(scene: Scene) -> dict[str, Any]:
    """One linear solve of the tied meshes by this library's direct solver."""
    K, f, points = tied_system(scene)
    clock = Clock()
    u = clock("solve", lambda: sc.linalg.Direct().factorize(K, points=points).solve(f))
    return clock.stages | {"residual": float(np.linalg.norm(K @ u - f) / np.linalg.norm(f))}


def plain(scene: Scene) -> dict[str, Any]:
    """One linear solve of the tied meshes by ``skfem.solve`` as it is."""
    K, f, _ = tied_system(scene)
    clock = Clock()
    u = clock("solve", lambda: fem.solve(K, f))
    return clock.stages | {"residual": float(np.linalg.norm(K @ u - f) / np.linalg.norm(f))}


def sparse(scene: Scene) -> dict[str, Any]:
    """Largest difference between the condensed and the sparse route over a short history."""
    answers = []
    for linear in ("condensed", sc.linalg.Direct()):
        solver = sc.ContactSolver(scene.bodies, [scene.contact()], linear=linear)
        answers.append(list(scene.run(solver, press=2, push=2)))
    worst = 0.0
    for a, b in zip(*answers, strict=True):
        for name in ("u", "normal_force", "tangential_force"):
            x, y = getattr(a, name), getattr(b, name)
            scale = np.abs(b.normal_force if name != "u" else y).max()
            worst = max(worst, float(np.abs(x - y).max() / scale))
    return {"difference": worst}


WORK = {"history": history, "own": own, "plain": plain, "sparse": sparse}


def worker(what: str, case: Case) -> dict[str, Any]:
    """Assemble the bodies and their loads, measure, and add the peak of memory."""
    scene = Scene(case)
    clock = Clock()
    clock("assembly", lambda: (scene.bodies, scene.shear))
    out = WORK[what](scene)
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    return clock.stages | out | {"memory": peak}


# -- the runner -------------------------------------------------------------------------------


def measure(
    what: str,
    case: Any,
    library: str | None = None,
    *,
    script: str = __file__,
    limit: int = TIME_LIMIT,
) -> dict[str, Any]:
    """Run a worker in a process of its own; a failure is an answer too.

    `library`: a checkout whose library is measured in place of this one; `limit`: seconds.
    """
    command = [sys.executable, script, "--worker", what, case.name]
    try:
        pinned = os.environ | dict.fromkeys(THREADS, "1")
        if library is not None:
            pinned |= {"PYTHONPATH": library}
        done = subprocess.run(command, capture_output=True, text=True, timeout=limit, env=pinned)
    except subprocess.TimeoutExpired:
        return {"failed": f"more than {limit} s"}
    if done.returncode:
        lines = done.stderr.strip().splitlines()
        return {"failed": lines[-1] if lines else f"process ended with {done.returncode}"}
    return json.loads(done.stdout.splitlines()[-1])


def run(case: Case, beside: str | None = None) -> dict[str, Any]:
    """All measurements of a case, interleaved; with the history of the library of another checkout."""
    runs: dict[str, list[dict[str, Any]]] = {"history": [], "own": [], "plain": []}
    if beside is not None:
        runs["beside"] = []
    for _ in range(case.rounds):
        for what, done in runs.items():
            other = what == "beside"
            done.append(measure("history" if other else what, case, beside if other else None))
            note = done[-1].get("failed") or f"{done[-1]['memory']:.0f} MB"
            print(f"  {case.name:12s} {what:8s} {note}", file=sys.stderr, flush=True)
    row: dict[str, Any] = {"case": case.name, "kind": case.kind, "method": case.method}
    row["rounds"] = case.rounds
    for what, done in runs.items():
        good = [r for r in done if "failed" not in r]
        row[what] = middle(good) if good else done[-1]
    row["sparse"] = measure("sparse", case) if case.sparse else {}
    return row


def middle(runs: list[dict[str, Any]]) -> dict[str, Any]:
    """Medians of the numbers that vary, the last of everything else."""
    out = dict(runs[-1])
    for key, value in runs[-1].items():
        if isinstance(value, float):
            out[key] = median(run[key] for run in runs)
            out[key + " spread"] = [min(r[key] for r in runs), max(r[key] for r in runs)]
    return {k: v for k, v in out.items() if not (k.endswith("spread") and v[0] == v[1])}


COLUMNS: dict[str, Callable[[dict[str, Any]], str]] = {
    "case": lambda r: f"{r['kind']}, {r['method']}",
    "DOFs": lambda r: f"{r['history']['dofs']:,}",
    "contact points": lambda r: f"{r['history']['points']}",
    "assembly": lambda r: f"{r['history']['assembly']:.2f}",
    "pairing, set-up": lambda r: f"{r['history']['surfaces'] + r['history']['setup']:.2f}",
    "condensation": lambda r: f"{r['history']['condensation']:.2f}",
    "contact problem": lambda r: f"{r['history']['contact problem']:.2f}",
    "50 increments": lambda r: f"{r['history']['loop']:.2f}",
    "50 interiors": lambda r: f"{r['history']['recovery']:.2f}",
    "total, s": lambda r: f"{r['history']['total']:.2f}",
    "iterations (most)": lambda r: (
        f"{sum(r['history']['iterations'])} ({max(r['history']['iterations'])})"
    ),
    "error": lambda r: f"{100 * max(r['history']['errors'].values()):.2f} %",
    "condensed - sparse": lambda r: (
        f"{r['sparse']['difference']:.0e}" if "difference" in r["sparse"] else "not run"
    ),
    "total / own solve": lambda r: ratio(r["history"]["total"], r["own"]),
    "total / `skfem.solve`": lambda r: ratio(r["history"]["total"], r["plain"]),
    "next increment": lambda r: ratio(r["history"]["further"], r["plain"], percent=True),
    "peak memory, MB": lambda r: f"{r['history']['memory']:.0f}",
    "of `skfem.solve`": lambda r: f"{r['plain'].get('memory', np.nan):.0f}",
}
SHORT = ("case", "DOFs", "contact points", "total, s", "error", "total / own solve")
SHORT += ("total / `skfem.solve`", "next increment", "peak memory, MB", "of `skfem.solve`")
SHORTEST = ("case", "DOFs", "total, s", "error", "total / own solve", "next increment")


def ratio(seconds: float, other: dict[str, Any], *, percent: bool = False) -> str:
    """Time over that of a linear solve, or that this one failed."""
    if "solve" not in other:
        return "solve failed"
    value = seconds / other["solve"]
    return f"{100 * value:.2f} %" if percent else f"{value:.2f}"


def compared(row: dict[str, Any]) -> str:
    """Times of the history over those of the other checkout, medians and smallest."""
    here, there = row["history"], row.get("beside", {})
    if "loop" not in here or "loop" not in there:
        return f"{row['case']}: not compared"
    shares = []
    for stage in ("loop", "total"):
        median_share = here[stage] / there[stage]
        least = [r.get(stage + " spread", [r[stage]])[0] for r in (here, there)]
        shares.append(f"{stage} {median_share:.2f} (smallest {least[0] / least[1]:.2f})")
    return f"{row['case']}: {', '.join(shares)} of the other checkout's"


def listed(rows: list[dict[str, Any]], columns: dict[str, Callable[[dict[str, Any]], str]]) -> str:
    """A table in Markdown, a row for each measurement; the reason where one failed."""
    lines = ["| " + " | ".join(columns) + " |", "|" + " --- |" * len(columns)]
    for row in rows:
        measured = row.get("history", row)
        if "failed" in measured:
            cells = [row["case"], f"failed: {measured['failed']}"] + [""] * (len(columns) - 2)
        else:
            cells = [cell(row) for cell in columns.values()]
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines)


def table(rows: list[dict[str, Any]], columns: Iterable[str] = tuple(COLUMNS)) -> str:
    """The table in Markdown."""
    return listed(rows, {name: COLUMNS[name] for name in columns})


def growth(rows: list[dict[str, Any]]) -> dict[str, float]:
    """Exponents of the growth of the times over the DOFs, for the Q1 cases."""
    plain_rows = [r for r in rows if r["kind"] == "Q1" and r["method"] == "node"]
    good = [r for r in plain_rows if all("failed" not in r[k] for k in ("history", "own", "plain"))]
    good = [r for r in good if r["history"]["dofs"] > PYTHON_COUNTS]
    if len(good) < 2:
        return {}
    n = np.log([r["history"]["dofs"] for r in good])
    times = {
        "history": [r["history"]["total"] for r in good],
        "own solve": [r["own"]["solve"] for r in good],
        "skfem.solve": [r["plain"]["solve"] for r in good],
    }
    return {name: float(np.polyfit(n, np.log(t), 1)[0]) for name, t in times.items()}


def write_into(path: Path, text: str, marks: tuple[str, str] = (BEGIN, END)) -> None:
    """Replace the marked section of a document."""
    begin, end = marks
    old = path.read_text(encoding="utf-8")
    if begin not in old:
        print(f"{path.name} has no marked section for the table", file=sys.stderr)
        return
    before, _, rest = old.partition(begin)
    _, _, after = rest.partition(end)
    path.write_text(f"{before}{begin}\n{text}\n{end}{after}", encoding="utf-8")


def stored(path: Path) -> dict[str, dict[str, Any]]:
    """Rows of earlier runs by case; every row is measured within one run."""
    if not path.exists():
        return {}
    return {row["case"]: row for row in json.loads(path.read_text(encoding="utf-8"))["rows"]}


def machine() -> dict[str, Any]:
    """What the figures depend on."""
    return {
        "date": datetime.date.today().isoformat(),
        "processor": processor(),
        "cores": os.cpu_count(),
        "threads": 1,
        "python": platform.python_version(),
        "numpy": np.__version__,
        "scipy": scipy.__version__,
        "scikit-fem": fem.__version__,
        "skfem_contact": sc.__version__,
    }


def processor() -> str:
    """Model name of the processor, where the system tells."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor()
    return next((line.split(":")[1].strip() for line in lines if "model name" in line), "")


def command_line(doc: str) -> argparse.ArgumentParser:
    """What all benchmarks of this kind take."""
    parser = argparse.ArgumentParser(description=doc.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="the smallest case, once")
    parser.add_argument("--only", nargs="*", help="names of cases; the rows of others stay")
    parser.add_argument("--write", action="store_true", help="put the table into the documents")
    parser.add_argument("--worker", nargs=2, help=argparse.SUPPRESS)
    return parser


def answer(work: Callable[[], dict[str, Any]]) -> None:
    """Print what a worker has measured for `measure`, or why it failed."""
    try:
        print(json.dumps(work()))
    except Exception:
        traceback.print_exc()
        raise SystemExit(1) from None


def main() -> None:
    parser = command_line(__doc__)
    parser.add_argument("--all", action="store_true", help="the case of a million DOFs as well")
    parser.add_argument("--beside", metavar="CHECKOUT", help="measure its library in turn with this")
    args = parser.parse_args()
    if args.worker:
        what, name = args.worker
        answer(lambda: worker(what, next(c for c in CASES if c.name == name)))
        return
    chosen = [c for c in CASES if (args.all or not c.optional or c.name in (args.only or ()))]
    if args.only is not None:
        chosen = [c for c in chosen if c.name in args.only]
    if args.quick:
        chosen = [Case(**{**CASES[0].__dict__, "rounds": 1})]
    path = RESULTS / ("quick.json" if args.quick else "history.json")
    RESULTS.mkdir(exist_ok=True)
    record = list(stored(path).values())
    for case in chosen:
        rows = stored(path) if args.only is not None or case is not chosen[0] else {}
        rows[case.name] = run(case, args.beside) | {"machine": machine()}
        order = [c.name for c in CASES if c.name in rows]
        record = [rows[name] for name in order]
        path.write_text(
            json.dumps({"growth": growth(record), "rows": record}, indent=1) + "\n", encoding="utf-8"
        )
    text = table(record)
    print(text)
    for what, exponent in growth(record).items():
        print(f"time of {what} grows as DOFs^{exponent:.2f}")
    for row in record if args.beside else ():
        print(compared(row))
    if args.write:
        write_into(HERE.parent / "docs" / "checks" / "performance.md", text)
        write_into(HERE.parent / "README.md", table(record, SHORT))
        write_into(HERE.parent / "paper.md", table(record, SHORTEST))


if __name__ == "__main__":
    main()
