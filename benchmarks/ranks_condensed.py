"""Bodies condensed over 1, 2 and 4 ranks: time, memory and answers of a history, against other ways.

    python benchmarks/ranks_condensed.py [--sizes 22] [--ranks 1 2 4] [--by-cg 10] [--by-factors 1]
        [--add] [--write]

The two blocks of `ranks.py`, assembled rank by rank, in ten increments: pressed, slid, slid back. In
one run, one after the other:

* `condensed`: PETSc("direct");
* `by CG`: PETSc(), contact eliminated from all DOFs in every iteration, the first --by-cg increments;
* `by factors`: the same with MUMPS in every iteration, of the first --by-factors increments, or none;
* `one process`: the default, on rank 0, with the answers that the others are compared with.

Ratios of times are of one run. Stores benchmarks/results/ranks_condensed.json; with --write the table
goes into docs/checks/petsc.md.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # before NumPy starts its threads

import numpy as np

HERE = Path(__file__).parent
sys.path.append(str(HERE.parent / "tests"))
STORED = HERE / "results" / "ranks_condensed.json"
PAGE = HERE.parent / "docs" / "checks" / "petsc.md"
INCREMENTS = 10  # of a history
CORES = 2  # of the machine
PLANNED, PER_RANK = (1e6, 1e7, 1e8), 250e3  # DOFs
MIB, GB = 2**20, 1e9
MUMPS = {"pc_type": "lu", "pc_factor_mat_solver_type": "mumps"}


# -- one run, on all ranks --------------------------------------------------------------------


def one(n: int, by_cg: int, by_factors: int) -> dict[str, Any]:
    """Measure one model on the ranks that there are."""
    import petsc_scenes

    import skfem_contact as sc

    linear = sc.petsc.PETSc("direct")
    empty = linear.memory()
    bodies, contact = petsc_scenes.blocks(3, "mortar", "small", n, linear, collected=False)
    model = linear.memory()
    found, u = {}, {}
    found["condensed"], u["condensed"] = history(sc, bodies, contact, linear, INCREMENTS)
    parts = found["condensed"].pop("solver").model.substructures
    out = {
        "elements": n,
        "ranks": linear.ranks,
        "dofs": sum(body.n for body in bodies),
        "contact dofs": [len(part.kept) for part in parts],
        "factors": sum(part.memory for part in parts),
        "empty": empty,
        "model": model,
        "peak": linear.memory(),
    }
    first = linear.solves[0]
    out["column"] = first.seconds / first.columns
    del parts
    for name, way, count in (
        ("by CG", sc.petsc.PETSc(), by_cg),
        ("by factors", sc.petsc.PETSc(options=MUMPS), by_factors),
    ):
        if not count:
            continue
        found[name], u[name] = history(sc, bodies, contact, way, count)
        found[name].pop("solver")
        found[name]["solve"] = float(np.mean([solve.seconds for solve in way.solves]))
        found[name]["setup"] = float(np.mean([s.setup for s in way.solves if s.setup]))
    whole, contact = petsc_scenes.blocks(3, "mortar", "small", n)
    found["one process"], u["one process"] = history(sc, whole, contact, "auto", INCREMENTS)
    found["one process"].pop("solver")
    expected = u["one process"]
    for name, way in found.items():
        at = way["increments"] - 1
        way["away"] = petsc_scenes.away(u[name][at], expected[at])
    return out | {"ways": found}


def history(sc: Any, bodies: Any, contact: Any, linear: Any, count: int) -> tuple[dict[str, Any], Any]:
    """Seconds of the condensation and of so many increments with their displacements, which are u."""
    import petsc_scenes

    steps = petsc_scenes.moves(bodies[1], 4)[:count]
    solver = sc.ContactSolver(bodies, contact, linear=linear)
    start = time.perf_counter()
    solver.prepare()
    prepared = time.perf_counter() - start
    start = time.perf_counter()
    results = list(solver.history(steps))
    increments = time.perf_counter() - start
    start = time.perf_counter()
    u = solver.recover(results)
    recovery = time.perf_counter() - start
    print(f"{linear!r}: {prepared:.1f} s, {increments:.1f} s", file=sys.stderr, flush=True)
    told = {
        "condensation": prepared,
        "loops": increments,
        "recovery": recovery,
        "increments": count,
        "iterations": sum(result.iterations for result in results),
    }
    return told | {"solver": solver}, u


# -- all runs ---------------------------------------------------------------------------------


def measured(given: argparse.Namespace, runs: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """All runs, in turn, stored one by one beside those that there are."""
    for size in given.sizes:
        for count in given.ranks:
            command = ["mpirun", "--oversubscribe", "--mca", "mpi_yield_when_idle", "1"]
            command += ["-n", str(count), sys.executable, __file__, "--one", str(size)]
            command += ["--by-cg", str(given.by_cg), "--by-factors", str(given.by_factors)]
            load = os.getloadavg()[0]
            done = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=False)
            if done.returncode:
                sys.exit(f"{' '.join(command)}:\n{done.stdout}")
            runs.append({"load": load, **json.loads(done.stdout.splitlines()[-1])})
            print(row(runs[-1]), flush=True)
            STORED.write_text(json.dumps(runs, indent=1) + "\n", encoding="utf-8")
    return runs


# -- table ------------------------------------------------------------------------------------


def table(runs: list[dict[str, Any]]) -> str:
    """One row for each size and number of ranks."""
    head = (
        "| DOFs | ranks | contact DOFs | condensation | an increment, with its displacements "
        "| of `T'KT` by CG, over this | by factors, over this | increments until CG takes longer "
        "| rank 0 | largest other rank | farthest from one process | load before |"
    )
    lines = [head, "| --- " * 12 + "|"]
    return "\n".join([*lines, *(row(run) for run in sorted(runs, key=order))])


def order(run: dict[str, Any]) -> tuple[int, int]:
    """By size, then ranks."""
    return run["elements"], run["ranks"]


def increment(way: dict[str, Any]) -> float:
    """Seconds of one increment, its displacements included."""
    return float((way["loops"] + way["recovery"]) / way["increments"])


def row(run: dict[str, Any]) -> str:
    """One run."""
    ways = run["ways"]
    condensed, iterated, factors = (ways.get(name) for name in ("condensed", "by CG", "by factors"))
    own = [(peak - empty) / MIB for peak, empty in zip(run["peak"], run["empty"], strict=True)]
    each = increment(condensed)
    pays = condensed["condensation"] / (increment(iterated) - each)
    away = max(way["away"] for name, way in ways.items() if name != "condensed")
    return (
        f"| {run['dofs']} | {run['ranks']} | {sum(run['contact dofs'])} "
        f"| {condensed['condensation']:.1f} s | {each:.2f} s "
        f"| {increment(iterated) / each:.0f} "
        f"| {f'{increment(factors) / each:.0f}' if factors else ''} | {pays:.1f} "
        f"| {own[0]:.0f} MiB | {f'{max(own[1:]):.0f} MiB' if own[1:] else ''} "
        f"| {condensed['away']:.0e} (others {away:.0e}) | {run['load']:.1f} |"
    )


def plan(runs: list[dict[str, Any]]) -> str:
    """What condensation takes of larger solids, from the largest one on as many ranks as cores.

    Contact DOFs grow as DOFs to the power of 2/3, factors as n^(4/3), operations as n^2.
    """
    largest = max((run for run in runs if run["ranks"] == CORES), key=order)
    n, contact, factors = largest["dofs"], largest["contact dofs"], largest["factors"]
    seconds = largest["ways"]["condensed"]["condensation"]
    lines = [
        "| DOFs | ranks | contact DOFs | `S` of the bodies, twice | factors, all ranks | and each "
        f"| condensation on {CORES} cores |",
        "| --- " * 7 + "|",
    ]
    for size in PLANNED:
        ratio, ranks = size / n, size / PER_RANK
        kept = [own * ratio ** (2 / 3) for own in contact]
        dense, needed = 2 * sum(8 * own**2 for own in kept) / GB, factors * ratio ** (4 / 3) / GB
        lines.append(
            f"| {size:.0e} | {ranks:.0f} | {sum(kept):.0f} | {dense:.3g} GB | {needed:.3g} GB "
            f"| {needed / ranks:.2g} GB | {seconds * ratio**2 / 3600:.2g} h |"
        )
    told = f"DOFs {n}, contact DOFs {sum(contact)}, factors {factors / GB:.3g} GB"
    return "\n".join(lines) + f"\n\nInputs: {told}, condensation {seconds:.1f} s."


def tables(runs: list[dict[str, Any]]) -> dict[str, str]:
    """By their names on the page."""
    return {"condensed": table(runs), "condensed plan": plan(runs)}


def write(found: dict[str, str]) -> None:
    """Put the tables between their marks in the page."""
    page = PAGE.read_text(encoding="utf-8")
    for name, text in found.items():
        begin, end = f"<!-- {name} table: begin -->", f"<!-- {name} table: end -->"
        before, rest = page.split(begin)
        page = f"{before}{begin}\n{text}\n{end}{rest.split(end)[1]}"
    PAGE.write_text(page, encoding="utf-8")


def main() -> None:
    """Measure, store and write."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--sizes", type=int, nargs="+", default=[22])
    parser.add_argument("--ranks", type=int, nargs="+", default=[1, 2, 4])
    parser.add_argument("--by-cg", type=int, default=INCREMENTS)
    parser.add_argument("--by-factors", type=int, default=1)
    parser.add_argument("--one", type=int, help="a single run, started by mpirun")
    parser.add_argument("--stored", action="store_true", help="the table of what is stored")
    parser.add_argument("--add", action="store_true", help="to what is stored")
    parser.add_argument("--write", action="store_true")
    given = parser.parse_args()
    if given.one:
        print(json.dumps(one(given.one, given.by_cg, given.by_factors)))
        return
    old = given.stored or given.add
    runs = json.loads(STORED.read_text(encoding="utf-8")) if old else []
    if not given.stored:
        measured(given, runs)
    print("\n\n".join(tables(runs).values()))
    if given.write:
        write(tables(runs))


if __name__ == "__main__":
    main()
