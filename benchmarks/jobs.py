"""Whole jobs of `whole_jobs.py`: what a script does from its import of the library to its print.

This module is the process that is measured, so it imports no more than such a script does. The library
is that of `PYTHONPATH`, in an old version too: `Body.from_mesh` is used where it has it. What is
compared with a closed form is computed after the clock has stopped.
"""

from __future__ import annotations

import json
import resource
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import skfem as fem
from skfem.models.elasticity import lame_parameters, linear_elasticity

NU = 0.3
# Press, as in solids.py: sides of block and punch, height of both, radius of the face, approach.
SIDES, HEIGHT, RADIUS, DEPTH = (1.0, 0.8), 0.5, 20.0, 5e-3
ASIDE = 1.2e-3  # of the push
# Hertz: two blocks, wide and high in half widths of contact, of which the fine zone has 1.5.
HALF, HIGH, FINE, R = 40.0, 20.0, 1.5, 100.0
MU, STEPS = 0.3, 20  # of the history


@dataclass(frozen=True)
class Job:
    """A job by its name: which kind, and how fine: elements of block and punch, and upwards."""

    name: str
    kind: str
    sizes: tuple[int, int, int] = (0, 0, 0)
    rounds: int = 5
    large: bool = False
    steps: int = 7  # of the push
    linear: str = "auto"


JOBS = [
    Job("import", "import", rounds=30),
    Job("README", "readme", rounds=9),
    Job("Hertz, plane", "hertz", (12, 18, 8), rounds=9),
    Job("history, plane", "history", (40, 20, 20), rounds=9),
    Job("press 14k", "press", (16, 14, 8)),
    Job("press 24.5k", "press", (21, 15, 10)),
    Job("press 92k", "press", (32, 28, 15), rounds=3),
    Job("press 92k, condensed", "press", (32, 28, 15), rounds=1, linear="condensed"),
    Job("press 360k", "press", (52, 44, 24), rounds=1, large=True),
    Job("push, 2209 points", "push", (50, 46, 6), rounds=1, large=True),
    Job("push 300k", "push", (50, 44, 21), rounds=1, large=True, steps=6),
]
QUICK = [
    Job("import", "import", rounds=1),
    Job("README", "readme", rounds=1),
    Job("quick Hertz", "hertz", (8, 10, 5), rounds=1),
    Job("quick history", "history", (20, 10, 10), rounds=1),
    Job("quick press", "press", (6, 5, 3), rounds=1),
]


class Parts:
    """CPU seconds of the parts of a job, each from the end of the one before."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}
        self.last = time.process_time()  # of the process so far: Python, NumPy, SciPy, scikit-fem
        self.before = self.last

    def __call__(self, part: str) -> None:
        now = time.process_time()
        self.seconds[part], self.last = now - self.last, now


def body(sc: Any, mesh: Any, element: Any, E: float, **given: Any) -> Any:
    """A body from its mesh; by a basis in versions that need one."""
    vector, form = fem.ElementVector(element), linear_elasticity(*lame_parameters(E, NU))
    if hasattr(sc.Body, "from_mesh"):
        return sc.Body.from_mesh(mesh, vector, form, **given)
    return sc.Body(fem.Basis(mesh, vector, intorder=2), form, **given)


def readme(sc: Any, job: Job, parts: Parts) -> tuple[Any, list[Any]]:
    """The example of the README, whose report is printed."""

    def rectangle(x0: float, x1: float, y0: float, y1: float, nx: int, ny: int) -> Any:
        x, y = np.linspace(x0, x1, nx + 1), np.linspace(y0, y1, ny + 1)
        mesh = fem.MeshQuad.init_tensor(x, y).with_defaults()
        return fem.Basis(mesh, fem.ElementVector(fem.ElementQuad1()), intorder=2)

    steel = linear_elasticity(*lame_parameters(210e3, 0.3))
    block = sc.Body(rectangle(-20, 20, -20, 0, 40, 20), steel, D="bottom", name="block")
    load = {"top": (20.0, -100.0)}
    punch = sc.Body(rectangle(-5, 5, 0, 10, 14, 14), steel, f=load, name="punch")
    parts("bodies")
    contact = sc.Contact(punch.surface("bottom"), block.surface("top"), friction=sc.Coulomb(0.3))
    solver = sc.ContactSolver([block, punch], [contact])
    parts("set-up")
    result = solver.solve()
    parts("solve")
    str(result.report())
    parts("print")
    return solver, [result]


def plane(x: np.ndarray, y: np.ndarray) -> Any:
    """A mesh of quadrilaterals, symmetric about x = 0."""
    return fem.MeshQuad.init_tensor(np.concatenate([-x[:0:-1], x]), y).with_defaults()


def hertz(sc: Any, job: Job, parts: Parts) -> tuple[Any, list[Any]]:
    """Two blocks with a parabola between them; the upper base comes down."""
    fine, rest, upwards = job.sizes
    x = np.concatenate([np.linspace(0, FINE, fine + 1), np.geomspace(FINE, HALF, rest + 1)[1:]])
    y = np.concatenate([np.linspace(0, FINE, upwards + 1), np.geomspace(FINE, HIGH, rest + 1)[1:]])
    # the approach of two layers for a half width of one, see cases.py
    down = 2 * np.log(2 * HIGH) / (4 * R)
    base = {"D": "top", "x": {"top": (0.0, -down)}}
    upper = body(sc, plane(x, y), fem.ElementQuad1(), 1.0, name="upper", **base)
    lower = body(sc, plane(x, -y[::-1]), fem.ElementQuad1(), 1.0, D="bottom", name="lower")
    parts("bodies")
    between = {"gap": lambda x: x[0] ** 2 / (2 * R)}
    contact = sc.Contact(upper.surface("bottom"), lower.surface("top"), **between)
    return solved(sc, [upper, lower], contact, parts)


def history(sc: Any, job: Job, parts: Parts) -> tuple[Any, list[Any]]:
    """A punch on a block: pressed down, then pushed aside until all of it slides."""
    nx, ny, punch_x = job.sizes
    block = body(
        sc,
        plane(np.linspace(0, 20, nx // 2 + 1), np.linspace(-20, 0, ny + 1)),
        fem.ElementQuad1(),
        1.0,
        D="bottom",
        name="block",
    )
    mesh = plane(np.linspace(0, 5, punch_x // 2 + 1), np.linspace(0, 10, punch_x + 1))
    punch = body(sc, mesh, fem.ElementQuad1(), 1.0, D="top", name="punch")
    parts("bodies")
    contact = sc.Contact(punch.surface("bottom"), block.surface("top"), friction=sc.Coulomb(MU))
    path = [(0.0, -0.05 * s) for s in np.linspace(0, 1, STEPS // 2 + 1)[1:]]
    path += [(0.15 * s, -0.05) for s in np.linspace(0, 1, STEPS // 2 + 1)[1:]]
    steps = [{"x": {"punch": held(punch, motion)}} for motion in path]
    return solved(sc, [punch, block], contact, parts, steps)


def held(punch: Any, motion: tuple[float, ...]) -> np.ndarray:
    """The same displacement of all DOFs that are prescribed."""
    u = np.zeros(punch.n)
    u[punch.D] = np.tile(motion, punch.n // len(motion))[punch.D]
    return u


def press(sc: Any, job: Job, parts: Parts) -> tuple[Any, list[Any]]:
    """The scene of solids.py without friction, pressed in one step."""
    bodies = block_and_punch(sc, job)
    parts("bodies")
    contact = sc.Contact(bodies[1].surface("bottom"), bodies[0].surface("top"))
    return solved(sc, bodies, contact, parts, linear=job.linear)


def push(sc: Any, job: Job, parts: Parts) -> tuple[Any, list[Any]]:
    """The same with friction: down in two steps, then aside.

    Earlier versions, which do not ask how many steps there are, are told which route takes less time.
    """
    bodies = block_and_punch(sc, job)
    parts("bodies")
    contact = sc.Contact(bodies[1].surface("bottom"), bodies[0].surface("top"), friction=sc.Coulomb(MU))
    path = [(0.0, 0.75), *((aside, 1.0) for aside in np.linspace(0, 1, job.steps - 1))]
    steps = [
        {"x": {"punch": held(bodies[1], (aside * ASIDE, 0.0, -down * DEPTH))}} for aside, down in path
    ]
    route = {} if hasattr(sc.Body, "from_mesh") else {"linear": "iterated"}
    return solved(sc, bodies, contact, parts, steps, **route)


def block_and_punch(sc: Any, job: Job) -> list[Any]:
    """The bodies of solids.py, the upper one pressed down."""
    bodies = []
    for i, name in enumerate(("block", "punch")):
        across = np.linspace(-SIDES[i] / 2, SIDES[i] / 2, job.sizes[i] + 1)
        low, high = (-HEIGHT, 0.0) if name == "block" else (0.0, HEIGHT)
        mesh = fem.MeshHex.init_tensor(across, across, np.linspace(low, high, job.sizes[2] + 1))
        ends = {"bottom": lambda x, z=low: np.isclose(x[2], z)}
        mesh = mesh.with_boundaries(ends | {"top": lambda x, z=high: np.isclose(x[2], z)})
        given: dict[str, Any] = {"D": "bottom", "name": name}
        if name == "punch":
            x, y, z = mesh.doflocs
            lifted = z + (x**2 + y**2) / (2 * RADIUS) * (1 - z / HEIGHT)
            mesh = replace(mesh, doflocs=np.array([x, y, lifted]))
            given = {"D": "top", "x": {"top": (0.0, 0.0, -DEPTH)}, "name": name}
        bodies.append(body(sc, mesh, fem.ElementHex1(), 1.0, **given))
    return bodies


def solved(
    sc: Any, bodies: list[Any], contact: Any, parts: Parts, steps: Any = None, **how: Any
) -> tuple[Any, list[Any]]:
    """Set up, solve with the displacements, print."""
    solver = sc.ContactSolver(bodies, [contact], **how)
    parts("set-up")
    results = [solver.solve()] if steps is None else list(solver.history(steps))
    assert results[-1].u is not None  # the displacements, which are found when they are asked for
    parts("solve")
    str(results[-1])
    parts("print")
    return solver, results


# -- how right the answer is ------------------------------------------------------------------


def load_error(results: list[Any]) -> float:
    """README: the force on the punch against its load."""
    wanted = np.array([-200.0, 1000.0])
    return float(np.linalg.norm(results[-1].force - wanted) / np.linalg.norm(wanted))


def hertz_error(results: list[Any]) -> float:
    """Relative L2 error of the pressure for the force that was found."""
    from skfem_contact.reference import block_curvature, effective_modulus, hertz_line

    result, E_star = results[-1], effective_modulus(1.0, NU, 1.0, NU)
    P = float(result.normal_force.sum())
    added = 2 * block_curvature(P, HIGH, 1.0, NU, base="fixed", width=HALF / HIGH)
    exact = hertz_line(P, R, E_star, added_curvature=added).pressure(result.points[:, 0])
    area = np.asarray(result.area)
    return float(np.sqrt(area @ (result.pressure - exact) ** 2 / (area @ exact**2)))


def coulomb_error(results: list[Any]) -> float:
    """History: in the end all of it slides, and friction is mu times the normal force."""
    aside, down = np.abs(results[-1].force)
    return float(abs(aside / (MU * down) - 1))


KINDS: dict[str, tuple[Callable[..., Any], Callable[[list[Any]], float] | None]] = {
    "readme": (readme, load_error),
    "hertz": (hertz, hertz_error),
    "history": (history, coulomb_error),
    "press": (press, None),  # no closed form: the punch is as wide as what it touches
    "push": (push, None),
}


def measured(job: Job) -> dict[str, Any]:
    """Do a job and say what each part took, its peak of memory and its answer."""
    parts = Parts()
    import skfem_contact as sc

    parts("import")
    do, error = KINDS.get(job.kind, (None, None))
    solver, results = (None, []) if do is None else do(sc, job, parts)
    found = {
        **parts.seconds,
        "job": parts.last - parts.before,
        "process": parts.last,
        "memory": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
    }
    if solver is None:
        return found
    pressure = np.asarray(results[-1].pressure)
    return found | {
        "dofs": int(solver.system.n),
        "force": np.asarray(results[-1].force).tolist(),
        "pressure": pressure.tolist(),
        "error": None if error is None else error(results),
    }


if __name__ == "__main__":
    print(json.dumps(measured({job.name: job for job in [*QUICK, *JOBS]}[sys.argv[-1]])))
