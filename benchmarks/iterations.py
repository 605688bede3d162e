"""Newton iterations from a cold start, and per increment of a load history, over mesh and friction.

    python benchmarks/iterations.py             stores results/iterations.json, writes the table
    python benchmarks/iterations.py --quick     up to 60 points per half width; prints only

Cold: the whole pressing in one step, nothing known before. With friction, pressing and pushing to
0.5 mu P in one step as well. Then the history of `cases.py`: 10 increments of pressing, 20 of
pushing, 20 back.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

from cases import Case, Scene
from run import write_into

import skfem_contact as sc

MARKS = "<!-- iterations table: begin -->", "<!-- iterations table: end -->"
STORED = Path(__file__).parent / "results" / "iterations.json"
POINTS = (15, 30, 60, 120, 240)
FRICTION = (0.0, 0.1, 0.5, 1.0)


def count(points: int, mu: float) -> dict[str, Any]:
    """Iterations on one mesh with one coefficient."""
    scene = Scene(Case("iterations", 0, mu=mu, thin=True), 1 / points)
    solver = sc.ContactSolver(scene.bodies, [scene.contact()])
    cold = solver.solve(x=scene.lowered(1))
    row = {"points": points, "mu": mu, "dofs": solver.system.n, "cold": cold.iterations}
    if mu:
        push = scene.pushed(0.5 * mu * float(cold.normal_force.sum()))
        row["cold, pushed"] = solver.solve(f=push, x=scene.lowered(1)).iterations
    iterations = [result.iterations for result in scene.run(solver)]
    row["average"] = sum(iterations) / len(iterations)
    row["most"] = max(iterations)
    return row


def table(rows: list[dict[str, Any]]) -> str:
    """The table in Markdown."""
    lines = ["| points per half width | mu | DOFs | cold | cold, pushed | average | most |"]
    lines.append("|" + " --- |" * 7)
    for row in rows:
        cells = [row["points"], row["mu"], f"{row['dofs']:,}", row["cold"]]
        cells += [row.get("cold, pushed", "-"), f"{row['average']:.1f}", row["most"]]
        lines.append("| " + " | ".join(map(str, cells)) + " |")
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        "--quick", action="store_true", help="up to 60 points per half width; stores nothing"
    )
    quick = parser.parse_args().quick
    rows = [count(points, mu) for points in (POINTS[:3] if quick else POINTS) for mu in FRICTION]
    print(table(rows))
    if not quick:
        STORED.parent.mkdir(exist_ok=True)
        STORED.write_text(json.dumps(rows, indent=1) + "\n", encoding="utf-8")
        write_into(Path(__file__).parents[1] / "docs" / "checks" / "performance.md", table(rows), MARKS)


if __name__ == "__main__":
    main()
