"""What derivatives and modes cost, against one linear solve and against SciPy on the same matrices.

* The gradient of a number that follows from 50 load steps by the interference of every point in each of
  them, 7 300 numbers, at 12 000 DOFs: over one `skfem.solve` of the tied meshes, as in run.py (whose
  spsolve orders, factorises and solves), and over one of the bodies apart, which costs half.
* Ten modes of bodies in contact at 30 000 DOFs: against `eigsh` by shift-invert on T'KT and T'MT.

Run ``python benchmarks/derivatives.py``: medians of processor time, taken in turns.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np
import skfem as fem
from scipy.sparse import block_diag, csc_matrix
from scipy.sparse.linalg import eigsh

import skfem_contact as sc
from skfem_contact.answers.answer import answer_of
from skfem_contact.answers.tangent.derivatives import gradient
from skfem_contact.answers.tangent.tangent import left_free


def rectangle(x: Any, y: Any) -> fem.CellBasis:
    mesh = fem.MeshQuad.init_tensor(x, y).with_defaults()
    return fem.Basis(mesh, fem.ElementVector(fem.ElementQuad1()), intorder=2)


def scene(cells: tuple[int, int, int, int]) -> sc.ContactSolver:
    """Two blocks, the upper one rounded by a gap; cells along and across each."""
    bases = (
        rectangle(np.linspace(-1, 1, cells[0] + 1), np.linspace(-1, 0, cells[1] + 1)),
        rectangle(np.linspace(-1, 1, cells[2] + 1), np.linspace(0, 1, cells[3] + 1)),
    )
    steel = sc.Elastic(1.0, 0.3, density=1.0)
    low, up = (
        sc.Body(basis, steel, D=D, name=name)
        for basis, D, name in zip(bases, ("bottom", "top"), ("low", "up"), strict=True)
    )
    joint = sc.Contact(
        up.surface("bottom"),
        low.surface("top"),
        friction=sc.Coulomb(0.4),
        gap=lambda x: 0.02 * x[0] ** 2,
        name="joint",
    )
    return sc.ContactSolver([low, up], joint)


def held(solver: sc.ContactSolver, closed: np.ndarray) -> Any:
    """What is left free where these points are stuck, ``u = T u_r``."""
    return left_free(solver, closed, closed).T


def spent(run: Callable[[], object]) -> float:
    """Processor time of a call [s]."""
    begin = time.process_time()
    run()
    return time.process_time() - begin


def gradients(rounds: int = 15) -> list[float]:
    """Seconds of a history, a gradient without it, solves of the bodies tied and apart, and reading.

    In the gradient is what the user's function takes, to read pressures and slips of 50 results: the
    last time is that alone, of as many other results.
    """
    solver = scene((120, 22, 145, 21))
    turns = 0.004 * np.sin(np.linspace(0, 2 * np.pi, 51)[1:])
    steps = [{"x": {"up": {"top": (turn, -0.012)}}} for turn in turns]
    by = sc.answers.Parameter("interference", field=True, each_step=True)

    def objective(results: list[sc.answers.ContactResult]) -> Any:
        return 0.0, [{"pressure": 2 * r.pressure, "slip": r.slip} for r in results]

    system, kin = solver.system, solver.kin
    T = held(solver, np.ones(kin.m, dtype=bool))
    tied = csc_matrix(T.T @ system.K @ T)
    apart, f, *_ = fem.condense(csc_matrix(system.K), np.ones(system.n), D=system.D)

    times: list[list[float]] = [[], [], [], [], []]
    for _ in range(rounds):
        results: list[sc.answers.ContactResult] = []
        others = list(solver.history(steps))
        times[0].append(spent(lambda: results.extend(solver.history(steps))))  # noqa: B023
        times[1].append(spent(lambda: gradient(lambda: results, objective, by, solver.recover)))  # noqa: B023
        times[2].append(spent(lambda: fem.solve(tied, np.ones(tied.shape[0]))))
        times[3].append(spent(lambda: fem.solve(apart, f)))
        times[4].append(spent(lambda: objective(others)))  # noqa: B023
    return [float(np.median(own[1:])) for own in times]


def modes(rounds: int = 5) -> tuple[float, float, int]:
    """Deviation from `eigsh` on reduced matrices, time over its, and DOFs."""
    solver = scene((160, 40, 200, 41))
    result = solver.solve(x={"up": {"top": (0.002, -0.012)}})
    answer = answer_of(result)
    system = solver.system
    K = block_diag(answer.stiffness, format="csr")
    M = block_diag([body.mass for body in system.bodies], format="csr")
    T = held(solver, answer.local.status != 0)  # closed points stick, as modes have it
    found: list[Any] = [None, None]

    def ours() -> None:
        found[0] = solver.modes(result, 10).frequency

    def scipy() -> None:
        squares = eigsh(csc_matrix(T.T @ K @ T), 10, csc_matrix(T.T @ M @ T), sigma=0.0)[0]
        found[1] = np.sqrt(np.sort(squares)) / (2 * np.pi)

    times = np.array([[spent(ours), spent(scipy)] for _ in range(rounds)])
    off = float(np.max(np.abs(found[0] / found[1] - 1)))
    return off, float(np.median(times[:, 0]) / np.median(times[:, 1])), system.n


if __name__ == "__main__":
    history, backwards, tied, apart, reading = gradients()
    print(
        f"gradient by 7 300 numbers, {1e3 * backwards:.1f} ms: {backwards / tied:.3f} of one "
        f"skfem.solve ({backwards / apart:.2f} of one of the bodies apart), "
        f"{backwards / history:.2f} of its history; {1e3 * reading:.1f} ms of it read the results, "
        f"{(backwards - reading) / tied:.3f} without"
    )
    off, ratio, n = modes()
    print(f"ten modes of {n} DOFs: off by {off:.1e}, {ratio:.2f} of the time of eigsh on T'KT, T'MT")
