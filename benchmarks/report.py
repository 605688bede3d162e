"""Times a report beside the whole solve that it is about, in the plane and in space.

    python benchmarks/report.py [--quick] [--only NAME ...]

One process with one BLAS thread, after a first solve and report, as in a session: what is imported late
is there. *Whole solve* is everything from the matrices on: bodies, surfaces, set-up, the solve, and the
displacements. *Report* is the text of `result.report()`, with the error estimate, the validity of the
model and the uniqueness of the answer. Friction, mu = 0.3; mortar; meshes that do not match; a block
is pressed down and pushed aside in one step. CPU seconds, medians of rounds that take turns.
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # before NumPy is imported

import argparse
from collections.abc import Callable
from dataclasses import dataclass
from statistics import median
from typing import Any

import cases
import numpy as np
import solids
from run import Clock, listed
from skfem.models.elasticity import lame_parameters, linear_elasticity

import skfem_contact as sc

SHIFT = 0.1  # of the base in the plane, over how far it comes down


@dataclass(frozen=True)
class Case:
    """One row: about so many DOFs in the plane; or elements along both sides and upwards."""

    name: str
    dofs: float = 0.0
    elements: tuple[int, int, int] = (0, 0, 0)
    rounds: int = 7


CASES = [
    Case("plane 5k", dofs=5e3),
    Case("plane 50k", dofs=50e3, rounds=5),
    Case("plane 200k", dofs=200e3, rounds=3),
    Case("solid 6k", elements=(12, 10, 6)),
    Case("solid 37k", elements=(23, 20, 11), rounds=3),
]
QUICK = [Case("plane quick", dofs=2e3, rounds=2), Case("solid quick", elements=(5, 4, 3), rounds=2)]


def plane(case: Case) -> Callable[[], Any]:
    """The whole solve of two blocks with a Hertz profile between them; matrices are made before."""
    scene = cases.Scene(cases.Case(case.name, case.dofs, method="mortar", mismatch=0.83))
    stiffness = linear_elasticity(*lame_parameters(cases.E, cases.NU))
    upper, lower = scene.bases["upper"], scene.bases["lower"]
    matrices = stiffness.assemble(upper), stiffness.assemble(lower)
    top, bottom = upper.get_dofs("top"), lower.get_dofs("bottom")
    held = np.append(bottom.all("u^2"), cases.middle(lower, "bottom"))
    moved = scene_motion(scene, top.all("u^1"))

    def solve() -> Any:
        above = sc.Body(upper, matrices[0], D=top.all(), name="upper")
        below = sc.Body(lower, matrices[1], D=held, name="lower")
        scene.bodies = [above, below]
        return sc.ContactSolver(scene.bodies, [scene.contact()]).solve(x=moved)

    return solve


def scene_motion(scene: cases.Scene, aside: np.ndarray) -> dict[str, np.ndarray]:
    """Prescribed displacements of the upper base: down, and aside at these DOFs."""
    x = np.zeros(scene.bases["upper"].N)
    x[scene.base], x[aside] = -scene.depth, SHIFT * scene.depth
    return {"upper": x}


def solid(case: Case) -> Callable[[], Any]:
    """The whole solve of a round punch on a block; matrices are made before."""
    scene = solids.Scene(solids.Case(case.name, *case.elements))
    parts = [(body.basis, body.K) for body in scene.bodies]

    def solve() -> Any:
        block = sc.Body(*parts[0], D="bottom", name="block")
        punch = sc.Body(*parts[1], D="top", name="punch")
        scene.bodies = [block, punch]
        return scene.solver().solve(**scene.moved(1.0, 1.0))

    return solve


def measured(case: Case) -> dict[str, Any]:
    """Times of the rounds of a case, and how large it is."""
    solve = solid(case) if case.elements[0] else plane(case)
    first = whole(solve)
    first.report()
    wholes, reports = [], []
    for _ in range(case.rounds):
        clock = Clock()
        result = clock("whole", lambda: whole(solve))
        clock("report", result.report)
        wholes.append(clock.stages["whole"])
        reports.append(clock.stages["report"])
    return {
        "case": case.name,
        "dofs": first.u.size,
        "points": sum(len(values.points) for values in first),
        "whole": median(wholes),
        "report": median(reports),
        "ratio": median(r / w for r, w in zip(reports, wholes, strict=True)),
        "unique": first.uniqueness is not None,
    }


def whole(solve: Callable[[], Any]) -> Any:
    """A result with its displacements."""
    result = solve()
    _ = result.u
    return result


COLUMNS: dict[str, Callable[[dict[str, Any]], str]] = {
    "case": lambda r: r["case"],
    "DOFs": lambda r: f"{r['dofs']:,}",
    "contact points": lambda r: f"{r['points']}",
    "whole solve, s": lambda r: f"{r['whole']:.3f}",
    "report, s": lambda r: f"{r['report']:.3f}",
    "report / whole solve": lambda r: f"{r['ratio']:.2f}",
}


def table(rows: list[dict[str, Any]]) -> str:
    """The table in Markdown."""
    return listed(rows, COLUMNS)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="small cases")
    parser.add_argument("--only", nargs="+", choices=[case.name for case in CASES])
    args = parser.parse_args()
    chosen = [case for case in CASES if args.only is None or case.name in args.only]
    print(table([measured(case) for case in (QUICK if args.quick else chosen)]))


if __name__ == "__main__":
    main()
