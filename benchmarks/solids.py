"""Times load histories of solids with friction, compares the routes, and prints the table of the docs.

    python benchmarks/solids.py [--quick] [--only NAME ...] [--write]

        top pressed down, then pushed aside and turned
              ______________
             |              |
             |    punch     |     its lower face is slightly round;
             |_____    _____|     the meshes do not match
     ______________----______________
    |                                |
    |             block              |
    |________________________________|   held

As in `run.py`, every measurement is a process of its own with one BLAS thread, the processes of one
case are interleaved, and the times are CPU seconds. The linear solves that the history is compared with
are those of the same meshes, glued together and lowered.
"""

from __future__ import annotations

import json
import resource
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import skfem as fem
from run import (
    HERE,
    RESULTS,
    Clock,
    answer,
    command_line,
    listed,
    machine,
    measure,
    middle,
    ratio,
    stored,
    write_into,
)
from scipy.linalg import block_diag
from skfem.models.elasticity import lame_parameters, linear_elasticity

import skfem_contact as sc

E, NU, MU = 1.0, 0.3, 0.3
SIDE, HEIGHT, RADIUS = 0.8, 0.5, 20.0  # of the punch; the block is as high, and 1 wide
DEPTH, SHIFT, TURN = 5e-3, 1.2e-3, 2e-3  # what the top of the punch does
PRESS, PUSH, FURTHER = 4, 6, 5  # increments
MARKS = "<!-- solids table: begin -->", "<!-- solids table: end -->"


@dataclass(frozen=True)
class Case:
    """One row of the table: elements along the side of the block and of the punch, and upwards."""

    name: str
    block: int
    punch: int
    layers: int
    linear: str = "auto"  # or "AMG"
    rounds: int = 1
    plain: int = 0  # seconds that `skfem.solve` may take; 0: it is not run
    routes: bool = False  # compare with the other routes
    factorised: bool = False  # solve the tied meshes by factors as well, where the route has none


CASES = [
    Case("30k", 22, 19, 10, rounds=3, plain=600, routes=True),
    Case("100k", 33, 27, 16, plain=2400, routes=True),
    Case("200k", 42, 35, 20),
    Case("100k AMG", 33, 27, 16, linear="AMG", factorised=True),
    Case("200k AMG", 42, 35, 20, linear="AMG", factorised=True),
    Case("400k AMG", 53, 44, 26, linear="AMG"),
]
QUICK = Case("quick", 8, 6, 4, plain=60, routes=True)


@dataclass(eq=False)
class Scene:
    """Bodies, contact and loads of a case."""

    case: Case

    @cached_property
    def bodies(self) -> list[sc.Body]:
        """Block and punch, assembled when first asked for."""
        case = self.case
        block = _mesh(1.0, case.block, np.linspace(-HEIGHT, 0, case.layers + 1))
        punch = _mesh(SIDE, case.punch, np.linspace(0, HEIGHT, case.layers + 1), round_below)
        given = fem.ElementVector(fem.ElementHex1()), linear_elasticity(*lame_parameters(E, NU))
        return [
            sc.Body.from_mesh(block, *given, D="bottom", name="block"),
            sc.Body.from_mesh(punch, *given, D="top", name="punch"),
        ]

    def contact(self, tied: bool = False) -> sc.Contact:
        """The contact, or the same surfaces glued."""
        block, punch = self.bodies
        pair = punch.surface("bottom"), block.surface("top")
        return sc.Contact(*pair, tied=True) if tied else sc.Contact(*pair, friction=sc.Coulomb(MU))

    def solver(self, linear: Any = None) -> sc.ContactSolver:
        """The solver of the case, or one with another route."""
        linear = linear or (sc.linalg.AMG() if self.case.linear == "AMG" else "auto")
        return sc.ContactSolver(self.bodies, [self.contact()], linear=linear)

    def moved(self, down: float, aside: float) -> dict[str, Any]:
        """Prescribed displacements of the top of the punch; pushed and turned in one."""
        punch = self.bodies[1]
        motion = np.zeros((punch.n // 3, 3))
        x, y, _ = punch.dof_points[::3].T
        motion[:, 0] = aside * (SHIFT - TURN * y)
        motion[:, 1] = aside * TURN * x
        motion[:, 2] = -down * DEPTH
        u = np.zeros(punch.n)
        u[punch.D] = motion.ravel()[punch.D]
        return {"x": {"punch": u}}

    @property
    def path(self) -> list[dict[str, Any]]:
        """Load steps: down, then aside and turned."""
        down = [self.moved(s, 0.0) for s in np.linspace(0, 1, PRESS + 1)[1:]]
        return down + [self.moved(1.0, s) for s in np.linspace(0, 1, PUSH + 1)[1:]]

    @property
    def way_back(self) -> list[dict[str, Any]]:
        """Further load steps."""
        return [self.moved(1.0, s) for s in np.linspace(1, 0, FURTHER + 1)[1:]]


def round_below(p: np.ndarray) -> np.ndarray:
    """Nodes of the punch (3, n), its lower face lifted towards the edges."""
    x, y, z = p
    return np.array([x, y, z + (x**2 + y**2) / (2 * RADIUS) * (1 - z / HEIGHT)])


def _mesh(side: float, count: int, heights: np.ndarray, shape: Callable[..., Any] | None = None) -> Any:
    across = np.linspace(-side / 2, side / 2, count + 1)
    mesh = fem.MeshHex.init_tensor(across, across, heights)
    low, high = heights[0], heights[-1]
    mesh = mesh.with_boundaries(
        {"bottom": lambda x: np.isclose(x[2], low), "top": lambda x: np.isclose(x[2], high)}
    )
    if shape is not None:
        mesh = replace(mesh, doflocs=shape(mesh.doflocs))
    return mesh


# -- what a process measures ------------------------------------------------------------------


def history(scene: Scene) -> dict[str, Any]:
    """All load steps with the displacements of each, and what a further one takes."""
    clock = Clock()
    solver = clock("setup", scene.solver)
    clock("condensation", lambda: [made(part) for part in solver.model.substructures])
    clock("contact problem", solver.prepare)
    results = clock("loop", lambda: list(solver.history(scene.path)))
    clock("recovery", lambda: solver.recover(results))
    spent = list(inner_iterations(solver))
    peak = memory()
    clock("further", lambda: list(solver.history(scene.way_back, start=results[-1])))
    last = results[-1]
    counts = np.bincount(last.status, minlength=3)
    return {
        **clock.stages,
        "total": sum(clock.stages.values()) - clock.stages["further"],
        "further": clock.stages["further"] / FURTHER,
        "peak": peak,
        "route": solver.linear_model.route,
        "dofs": solver.system.n,
        "points": solver.kin.m,
        "open, stick, slip": counts.tolist(),
        "iterations": [result.iterations for result in results],
        "inner": spent,
        "force": np.abs(np.asarray(last.force)).tolist(),
        "certificate": float(last.certificate.worst),
    }


def made(part: Any) -> Any:
    """What the elimination of a body's interior consists in."""
    return part.grids if hasattr(part, "grids") else part.S


def inner_iterations(solver: sc.ContactSolver) -> Iterator[int]:
    """Iterations of every linear solve, where it iterates."""
    yield from getattr(solver.linear_model.problem_on(None, None), "iterations", ())


def tied_system(scene: Scene) -> tuple[Any, Any, Any, Any]:
    """Matrix, load, positions and rigid motions of the same meshes glued together and lowered."""
    system = sc.bodies.stack(scene.bodies)
    x = np.zeros(system.n)
    x[system.slice("punch")] = scene.moved(1.0, 1.0)["x"]["punch"]
    rows = sc.elimination.contact_rows(system, scene.contact(tied=True))
    constraint = sc.elimination.eliminate(rows.C, rows.b, system.D, x, prefer=rows.prefer)
    K, f = constraint.reduce(system.K, system.f)
    free = constraint.independent
    points = np.concatenate([body.dof_points for body in scene.bodies])[free]
    modes = block_diag(*(body.rigid_modes for body in scene.bodies))[free]
    return K, f, points, modes


def own(scene: Scene) -> dict[str, Any]:
    """One linear solve of the tied meshes by the backend of this library that suits the case."""
    return tied(scene, sc.linalg.AMG() if scene.case.linear == "AMG" else sc.linalg.Direct())


def factorised(scene: Scene) -> dict[str, Any]:
    """One factorisation and solve of the tied meshes, by this library."""
    return tied(scene, sc.linalg.Direct())


def tied(scene: Scene, backend: Any) -> dict[str, Any]:
    """One linear solve of the tied meshes by a backend."""
    K, f, points, modes = tied_system(scene)
    clock = Clock()
    u = clock("solve", lambda: backend.factorize(K, points=points, modes=modes).solve(f))
    return clock.stages | {"residual": residual(K, u, f)}


def plain(scene: Scene) -> dict[str, Any]:
    """One linear solve of the tied meshes by ``skfem.solve`` as it is."""
    K, f, _, _ = tied_system(scene)
    clock = Clock()
    u = clock("solve", lambda: fem.solve(K, f))
    return clock.stages | {"residual": residual(K, u, f)}


def residual(K: Any, u: np.ndarray, f: np.ndarray) -> float:
    return float(np.linalg.norm(K @ u - f) / np.linalg.norm(f))


def routes(scene: Scene) -> dict[str, Any]:
    """Largest difference of forces between the routes over a short history."""
    path = scene.path[PRESS - 1 : PRESS + 2]
    answers = []
    for linear in ("condensed", "iterated", sc.linalg.AMG()):
        solver = scene.solver(linear)
        answers.append(list(solver.history(path)))
    first, *others = answers
    apart = [
        max(
            float(np.abs(b.traction - a.traction).max() / np.abs(a.traction).max())
            for a, b in zip(first, other, strict=True)
        )
        for other in others
    ]
    return {"iterated apart": apart[0], "multigrid apart": apart[1]}


WORK = {"history": history, "own": own, "factorised": factorised, "plain": plain, "routes": routes}


def memory() -> float:
    """Peak of this process so far [MB]."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def worker(what: str, case: Case) -> dict[str, Any]:
    """Assemble the bodies, measure, and add the peak of memory."""
    scene, clock = Scene(case), Clock()
    clock("assembly", lambda: scene.bodies)
    assembled = memory()
    out = WORK[what](scene)
    return clock.stages | {"assembled": assembled} | out | {"memory": memory()}


# -- the runner -------------------------------------------------------------------------------


def run(case: Case) -> dict[str, Any]:
    """All measurements of a case, interleaved."""
    kinds = ["history", "own"] + ["factorised"] * case.factorised + ["plain"] * (case.plain > 0)
    runs: dict[str, list[dict[str, Any]]] = {what: [] for what in kinds}
    for _ in range(case.rounds):
        for what, done in runs.items():
            limit = {"limit": case.plain} if what == "plain" else {}
            done.append(measure(what, case, script=__file__, **limit))
            note = done[-1].get("failed") or f"{done[-1]['memory']:.0f} MB"
            print(f"  {case.name:12s} {what:8s} {note}", flush=True)
    row: dict[str, Any] = {"case": case.name, "linear": case.linear, "rounds": case.rounds}
    for what, done in runs.items():
        good = [r for r in done if "failed" not in r]
        row[what] = middle(good) if good else done[-1]
    row["routes"] = measure("routes", case, script=__file__) if case.routes else {}
    return row


def written(row: dict[str, Any], what: str, key: str, form: str) -> str:
    """A number of a measurement, or that there is none."""
    found = row.get(what, {})
    if key in found:
        return format(found[key], form)
    return "not run" if not found else "failed"


COLUMNS: dict[str, Callable[[dict[str, Any]], str]] = {
    "DOFs": lambda r: f"{r['history']['dofs']:,}",
    "contact points": lambda r: f"{r['history']['points']}",
    "route": lambda r: r["history"]["route"],
    "set-up": lambda r: f"{r['history']['setup']:.2f}",
    "condensation": lambda r: f"{r['history']['condensation']:.2f}",
    "contact problem": lambda r: f"{r['history']['contact problem']:.2f}",
    "10 increments": lambda r: f"{r['history']['loop']:.2f}",
    "10 interiors": lambda r: f"{r['history']['recovery']:.2f}",
    "total, s": lambda r: f"{r['history']['total']:.1f}",
    "Newton iterations (most)": lambda r: (
        f"{sum(r['history']['iterations'])} ({max(r['history']['iterations'])})"
    ),
    "inner iterations, mean (most)": lambda r: inner(r["history"]["inner"]),
    "condensed - multigrid": lambda r: written(r, "routes", "multigrid apart", ".0e"),
    "total / own solve": lambda r: ratio(r["history"]["total"], r["own"]),
    "total / `skfem.solve`": lambda r: of_plain(r, "total"),
    "next increment / own solve": lambda r: ratio(r["history"]["further"], r["own"], percent=True),
    "of a factorisation and solve": lambda r: of_factors(r),
    "peak memory, MB": lambda r: f"{r['history']['memory']:.0f}",
    "of `skfem.solve`": lambda r: written(r, "plain", "memory", ".0f"),
}


def inner(counts: list[int]) -> str:
    """Iterations per linear solve."""
    return f"{np.mean(counts):.0f} ({max(counts)})" if counts else "none"


def of_factors(row: dict[str, Any]) -> str:
    """A next increment over one factorisation and solve of this library."""
    own = row["own"] if row["linear"] == "auto" else row.get("factorised", {})
    return ratio(row["history"]["further"], own, percent=True) if "solve" in own else "not run"


def of_plain(row: dict[str, Any], key: str) -> str:
    """Times over one `skfem.solve`, or why there is no ratio."""
    found = row.get("plain", {})
    if "solve" in found:
        return ratio(row["history"][key], found)
    return found.get("failed", "not run")


def table(rows: list[dict[str, Any]]) -> str:
    """The table in Markdown."""
    return listed(rows, COLUMNS)


def main() -> None:
    args = command_line(__doc__).parse_args()
    known = {case.name: case for case in [*CASES, QUICK]}
    if args.worker:
        what, name = args.worker
        answer(lambda: worker(what, known[name]))
        return
    chosen = [known[name] for name in args.only] if args.only is not None else CASES
    path = RESULTS / ("solids_quick.json" if args.quick else "solids.json")
    rows = stored(path)
    for case in [QUICK] if args.quick else chosen:
        rows[case.name] = run(case) | {"machine": machine()}
        record = [rows[name] for name in known if name in rows]
        path.write_text(json.dumps({"rows": record}, indent=1) + "\n", encoding="utf-8")
    record = [rows[name] for name in known if name in rows]
    print(table(record))
    if args.write:
        write_into(HERE.parent / "docs" / "checks" / "performance.md", table(record), MARKS)


if __name__ == "__main__":
    main()
