"""Iterations, memory and time of linear problems on 1, 2 and 4 ranks, and a plan beyond them.

    python benchmarks/ranks.py [--sizes 22 32] [--ranks 1 2 4] [--rounds 2] [--add] [--write]

Two blocks of hexahedra, pressed and slid (3-D, mortar, friction); N is the number of elements along the
lower one. Each round runs all numbers of ranks in turn with `mpirun`; ratios of times are of the same
round. The first linear problem is symmetric (all points stick), those after it are not.

Bodies are assembled rank by rank; with --whole rank 0 assembles them and holds their stiffness, which
is what the others are compared with. Stores benchmarks/results/ranks.json; with --write the tables go
into docs/checks/petsc.md.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # before NumPy starts its threads

import numpy as np

HERE = Path(__file__).parent
sys.path.append(str(HERE.parent / "tests"))
STORED = HERE / "results" / "ranks.json"
PAGE = HERE.parent / "docs" / "checks" / "petsc.md"
PLANNED = (1e6, 1e7, 1e8, 1e9)  # DOFs
ITERATES = 3  # nonlinear iterations that are measured: one symmetric, the others not
PARTED = (2, 4, 16, 64)  # ranks whose exchanges are counted, without running them
MIB, GB = 2**20, 1e9


# -- one run, on all ranks --------------------------------------------------------------------


def one(n: int, whole: bool) -> dict[str, Any]:
    """Measure one model on the ranks that there are."""
    import petsc_scenes

    import skfem_contact as sc
    from skfem_contact.problem.full import SparseSpace

    linear = sc.petsc.PETSc()
    empty = linear.memory()
    spent: dict[str, float] = {}
    cpu = {"set-up": 0.0, "solves": 0.0}
    matrices: list[Any] = []
    factorize = SparseSpace._factorize

    def timed(self: Any, K_r: Any, trial: Any, spd: bool) -> Any:
        # exchanges follow from the matrix: counted once
        if whole and linear.ranks == 1 and not matrices:
            matrices.append((K_r, self.points[trial.independent], self.modes[trial.independent]))
        start = time.process_time()
        factor = factorize(self, K_r, trial, spd)
        cpu["set-up"] += time.process_time() - start

        def solve(b: np.ndarray) -> np.ndarray:
            start = time.process_time()
            x = factor.function(b)
            cpu["solves"] += time.process_time() - start
            return x

        return replace(factor, function=solve)

    SparseSpace._factorize = timed  # type: ignore[method-assign]
    start = time.process_time()
    given = None if whole else linear
    bodies, contact = petsc_scenes.blocks(3, "mortar", "small", n, given, collected=False)
    cpu["assembly"] = time.process_time() - start
    start = time.process_time()
    solver = sc.ContactSolver(bodies, contact, linear=linear)
    cpu["pairing"] = time.process_time() - start
    before = linear.memory()

    def stop(record: Any) -> None:
        if record.iteration >= ITERATES:
            raise StopIteration

    begin, start = time.perf_counter(), time.process_time()
    x = petsc_scenes.moves(bodies[1])[1]["x"]
    result = solver.solve(x=x, callback=stop, throw=False)
    spent["loop"] = time.perf_counter() - begin
    solves = [vars(solve) for solve in linear.solves]
    spent["linear"] = sum(solve["setup"] + solve["seconds"] for solve in solves)
    cpu["reduce"] = time.process_time() - start - cpu["set-up"] - cpu["solves"]
    peak = linear.memory()
    start = time.process_time()
    result.certificate  # noqa: B018 (measured when first asked for)
    cpu["certificate"] = time.process_time() - start
    return {
        "elements": n,
        "whole": whole,
        "ranks": linear.ranks,
        "dofs": solver.system.n,
        "points": int(solver.kin.m),
        "entries": int(sum(body.K.nnz for body in bodies)),
        "solves": solves,
        "seconds": spent,
        "cpu": cpu,
        "empty": empty,
        "model": before,
        "peak": peak,
        "with certificate": linear.memory(),
        "exchanged": exchanged(*matrices[0]) if matrices else {},
    }


def exchanged(A: Any, points: np.ndarray, modes: np.ndarray) -> dict[str, int]:
    """Entries of a vector that the busiest rank takes from others for a product, by number of ranks."""
    from skfem_contact.petsc.stiffness import Layout

    out = {}
    for ranks in PARTED:
        layout = Layout.of(A.shape[0], points, modes, ranks)
        ghosts = []
        ends = zip(layout.matrices(A), layout.starts, layout.starts[1:], strict=False)
        for rows, begin, end in ends:
            columns = np.unique(rows.indices)
            ghosts.append(int(np.sum((columns < begin) | (columns >= end))))
        out[str(ranks)] = max(ghosts)
    return out


# -- all runs ---------------------------------------------------------------------------------


def measured(
    sizes: list[int], ranks: list[int], rounds: int, whole: bool, runs: list[dict[str, Any]]
) -> list[dict[str, Any]]:
    """All runs, in turn, stored one by one beside those that there are."""
    for size in sizes:
        for number in range(rounds):
            for count in ranks:
                # ranks that wait for each other leave the core to others, which a shared machine needs
                command = ["mpirun", "--oversubscribe", "--mca", "mpi_yield_when_idle", "1"]
                command += ["-n", str(count), sys.executable, __file__]
                command += ["--whole"] if whole else []
                done = subprocess.run(
                    [*command, "--one", str(size)], capture_output=True, text=True, check=False
                )
                if done.returncode:
                    sys.exit(f"{' '.join(command)}:\n{done.stdout}{done.stderr}")
                run = json.loads(done.stdout.splitlines()[-1])
                runs.append({"round": number, "load": os.getloadavg()[0], **run})
                print(summary(runs[-1]), flush=True)
                STORED.write_text(json.dumps(runs, indent=1) + "\n")
    return runs


def summary(run: dict[str, Any]) -> str:
    """One run in a line."""
    solves = ", ".join(f"{s['method']} {s['iterations']}" for s in run["solves"])
    peak = ", ".join(f"{bytes_ / MIB:.0f}" for bytes_ in run["peak"])
    return (
        f"{run['dofs']} DOFs, {run['ranks']} ranks: {solves}; linear {run['seconds']['linear']:.1f} s, "
        f"the rest of the loop {run['cpu']['reduce']:.1f} s of CPU; peak {peak} MiB; "
        f"load {run['load']:.1f}"
    )


# -- tables -----------------------------------------------------------------------------------


def own(run: dict[str, Any], rank: int) -> float:
    """Memory of a rank over that of Python, PETSc and the libraries [bytes]."""
    return float(run["peak"][rank] - run["empty"][rank])


def tables(runs: list[dict[str, Any]]) -> dict[str, str]:
    """Measurements and plan, in Markdown; the plan needs a run with all of K on rank 0 as well."""
    found = {"measured": measured_table(runs)}
    if any(run["exchanged"] for run in runs):
        found["plan"] = plan_table(inputs(runs))
    return found


def measured_table(runs: list[dict[str, Any]]) -> str:
    """One row for each size and number of ranks; ratios are those of all rounds."""
    rows = [
        "| DOFs | ranks | CG | GMRES | rank 0 with all of K | rank 0 | largest other rank "
        "| rank 0 over another, per DOF | matrices per rank "
        "| linear problems: time on 1 rank over this | and CPU of rank 0 |",
        "| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |",
    ]
    apart = [run for run in runs if not run["whole"]]
    for size, count in sorted({(run["elements"], run["ranks"]) for run in apart}):
        first = next(run for run in apart if (run["elements"], run["ranks"]) == (size, count))
        before = [run for run in runs if run["whole"] and run["elements"] == size]
        before = [own(run, 0) / MIB for run in before if run["ranks"] == count]
        gmres = max((s["iterations"] for s in first["solves"] if "gmres" in s["method"]), default=0)
        others = max((own(first, rank) for rank in range(1, count)), default=0.0)
        more = f"{(own(first, 0) - others) / first['dofs']:.0f} B" if count > 1 else ""
        rows.append(
            f"| {first['dofs']} | {count} | {first['solves'][0]['iterations']} | {gmres} "
            f"| {f'{before[0]:.0f} MiB' if before else ''} | {own(first, 0) / MIB:.0f} MiB "
            f"| {f'{others / MIB:.0f} MiB' if count > 1 else ''} | {more} "
            f"| {first['solves'][0]['memory'] / count / MIB:.0f} MiB "
            f"| {speedup(apart, size, count, wall)} | {speedup(apart, size, count, cpu)} |"
        )
    return "\n".join(rows)


def wall(run: dict[str, Any]) -> float:
    """Time of the linear problems [s]."""
    return float(run["seconds"]["linear"])


def cpu(run: dict[str, Any]) -> float:
    """CPU of rank 0 for them, that of waiting busily for other ranks included [s]."""
    return float(run["cpu"]["set-up"] + run["cpu"]["solves"])


def speedup(
    runs: list[dict[str, Any]], size: int, count: int, seconds: Callable[[dict[str, Any]], float]
) -> str:
    """Seconds on one rank over those on some, round by round."""
    ratios = []
    for run in runs:
        if (run["elements"], run["ranks"]) == (size, count):
            alone = [
                seconds(other)
                for other in runs
                if (other["elements"], other["ranks"], other["round"]) == (size, 1, run["round"])
            ]
            ratios += [spent / seconds(run) for spent in alone]
    return ", ".join(f"{ratio:.2f}" for ratio in ratios)


def inputs(runs: list[dict[str, Any]]) -> dict[str, float]:
    """What the plan is made of: of the largest model, on most ranks."""
    apart = [run for run in runs if not run["whole"]]
    n = max(run["dofs"] for run in apart)
    largest = [run for run in apart if run["dofs"] == n]
    alone = [run for run in largest if run["ranks"] == 1][-1]
    most = max(largest, key=lambda run: run["ranks"])
    count, part = most["ranks"], max(PARTED)
    counted = max((run for run in runs if run["exchanged"]), key=lambda run: run["dofs"])
    other = max(own(most, rank) for rank in range(1, count))
    return {
        "dofs": n,
        "ranks": count,
        "iterations": max(solve["iterations"] for solve in most["solves"]),
        "rank 0": (own(most, 0) - other) / n,
        "distributed": other * count / n,
        "matrices": most["solves"][0]["memory"] / n,
        "ghosts": counted["exchanged"][str(part)] / (counted["dofs"] / part) ** (2 / 3),
        "points": alone["points"] / n ** (2 / 3),
        "assembly": alone["cpu"]["assembly"] / n,
        "pairing": alone["cpu"]["pairing"] / n,
        "reduce": alone["cpu"]["reduce"] / ITERATES / n,
        "set-up": alone["cpu"]["set-up"] / ITERATES / n,
    }


def plan_table(a: dict[str, float]) -> str:
    """Memory, exchange and serial time of larger models, on ranks of 250 000 DOFs."""
    each = 250e3
    rows = [
        "| DOFs | ranks | rank 0 | each other rank | contact points | read per iteration and rank "
        "| exchanged per product and rank | assembly on a rank, CPU | set-up of multigrid, CPU "
        "| rank 0 alone, CPU |",
        "| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |",
    ]
    for n in PLANNED:
        # a cycle reads the matrices of all levels four times (two sweeps down, two up), CG once more
        read = 5 * a["matrices"] * each
        exchange = 8 * a["ghosts"] * each ** (2 / 3)
        rows.append(
            f"| {n:.0e} | {n / each:.0f} | {(a['rank 0'] * n + a['distributed'] * each) / GB:.0f} GB "
            f"| {a['distributed'] * each / GB:.1f} GB | {a['points'] * n ** (2 / 3):.0f} "
            f"| {read / GB:.1f} GB | {exchange / 1e6:.1f} MB | {a['assembly'] * each:.0f} s "
            f"| {a['set-up'] * each:.0f} s "
            f"| {a['pairing'] * n / 3600:.2f} h, and {a['reduce'] * n:.0f} s in each iteration |"
        )
    told = ", ".join(f"{name} {value:.4g}" for name, value in a.items())
    return "\n".join(rows) + f"\n\nInputs, bytes and seconds per DOF: {told}."


def write(found: dict[str, str]) -> None:
    """Put the tables between their marks in the page."""
    text = PAGE.read_text()
    for name, table in found.items():
        begin, end = f"<!-- {name} table: begin -->", f"<!-- {name} table: end -->"
        before, rest = text.split(begin)
        text = f"{before}{begin}\n{table}\n{end}{rest.split(end)[1]}"
    PAGE.write_text(text)


def main() -> None:
    """Measure, store and write."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--sizes", type=int, nargs="+", default=[22, 32])
    parser.add_argument("--ranks", type=int, nargs="+", default=[1, 2, 4])
    parser.add_argument("--rounds", type=int, default=2)
    parser.add_argument("--one", type=int, help="a single run, started by mpirun")
    parser.add_argument("--whole", action="store_true", help="rank 0 holds the stiffness")
    parser.add_argument("--stored", action="store_true", help="tables of what is stored")
    parser.add_argument("--add", action="store_true", help="to what is stored")
    parser.add_argument("--write", action="store_true")
    given = parser.parse_args()
    if given.one:
        print(json.dumps(one(given.one, given.whole)))
        return
    runs = json.loads(STORED.read_text()) if given.stored or given.add else []
    if not given.stored:
        measured(given.sizes, given.ranks, given.rounds, given.whole, runs)
    found = tables(runs)
    print("\n\n".join(found.values()))
    if given.write:
        write(found)


if __name__ == "__main__":
    main()
