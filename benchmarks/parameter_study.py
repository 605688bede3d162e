"""What a parameter study costs in one process and in a pool of two: docs/checks/guide.md.

    OPENBLAS_NUM_THREADS=1 python benchmarks/parameter_study.py [plane] [solid]

Eight coefficients of friction of a block that is pressed onto a floor and pushed to and fro. CPU
seconds of the busiest process, which is what the clock shows where each process has a core of its own:
those of the parent and of the worker that has worked most, from its start on.
"""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from functools import partial

import numpy as np
import skfem as fem
from skfem.models.elasticity import linear_elasticity

import skfem_contact as sc

COEFFICIENTS = np.linspace(0.1, 0.45, 8)
#: Load steps of a short and of a long path.
STEPS = {"plane": (2, 40), "solid": (2, 20)}

Job = tuple[float, int, float]


def build(kind: str) -> sc.ContactSolver:
    """The block, its condensation done."""
    if kind == "plane":
        mesh = fem.MeshQuad.init_tensor(np.linspace(0, 4, 201), np.linspace(0, 1, 51))
        element = fem.ElementVector(fem.ElementQuad1())
    else:
        side = np.linspace(0, 3, 25)
        mesh = fem.MeshHex.init_tensor(side, side, np.linspace(0, 1, 9))
        element = fem.ElementVector(fem.ElementHex1())
    mesh = mesh.with_boundaries({"low": lambda x: x[-1] < 1e-9, "high": lambda x: x[-1] > 1 - 1e-9})
    basis = fem.Basis(mesh, element, intorder=2)
    block = sc.Body(basis, linear_elasticity(1.0, 1.0), D="high", name="block")
    up = np.eye(mesh.dim())[-1]
    floor = sc.RigidPlane(0 * up, up, name="floor")
    foot = sc.Contact(block.surface("low"), floor, friction=sc.Coulomb(0.1), name="foot")
    return sc.ContactSolver(block, foot).prepare()


def case(solver: sc.ContactSolver, steps: int, mu: float) -> Job:
    """Energy lost by friction; which process it was, and the CPU time that it has had so far."""
    aside = 0.005 * np.sin(2 * np.pi * np.arange(steps) / 20)
    still = [0.0] * (solver.system.bodies[0].dim - 2)
    path = [{"x": {"block": {"high": (a, *still, -0.01)}}} for a in aside]
    *_, last = solver.with_friction(sc.Coulomb(mu)).history(path)
    return last.dissipation_total, os.getpid(), time.process_time()


def start(kind: str) -> None:
    """Called once in every worker."""
    global own
    own = build(kind)


def own_case(steps: int, mu: float) -> Job:
    """The case by the worker's own solver."""
    return case(own, steps, mu)


def in_turn(kind: str, steps: int) -> list[Job]:
    """One solver, one case after the other."""
    solver = build(kind)
    return [case(solver, steps, mu) for mu in COEFFICIENTS]


def anew(kind: str, steps: int) -> list[Job]:
    """A new solver for each case."""
    return [case(build(kind), steps, mu) for mu in COEFFICIENTS]


def one_per_worker(kind: str, steps: int) -> list[Job]:
    """A pool whose workers build a solver each."""
    with ProcessPoolExecutor(2, initializer=start, initargs=(kind,)) as pool:
        return list(pool.map(partial(own_case, steps), COEFFICIENTS))


def passed_along(kind: str, steps: int) -> list[Job]:
    """A pool that gets the solver with every case."""
    solver = build(kind)
    with ProcessPoolExecutor(2) as pool:
        return list(pool.map(partial(case, solver, steps), COEFFICIENTS))


WAYS: tuple[Callable[[str, int], list[Job]], ...] = (in_turn, one_per_worker, anew, passed_along)


def busiest(way: Callable[[str, int], list[Job]], kind: str, steps: int) -> tuple[float, float]:
    """CPU seconds of the busiest process, and the sum of the energies, which is the same for all."""
    before = time.process_time()
    jobs = way(kind, steps)
    parent = time.process_time() - before
    workers = [spent for _, process, spent in jobs if process != os.getpid()]
    return parent + max(workers, default=0.0), sum(energy for energy, *_ in jobs)


if __name__ == "__main__":
    for kind in sys.argv[1:] or STEPS:
        busiest(in_turn, kind, 2)  # imports, and what is made once
        for steps in STEPS[kind]:
            found = [busiest(way, kind, steps) for way in WAYS]
            np.testing.assert_allclose([energy for _, energy in found], found[0][1], rtol=1e-9)
            times = ", ".join(
                f"{way.__name__} {spent:.2f}" for way, (spent, _) in zip(WAYS, found, strict=True)
            )
            print(f"{kind}, {steps} steps: {times}", flush=True)
