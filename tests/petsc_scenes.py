"""Blocks pressed, slid and slid back, as a script, with `mpirun` or without.

    mpirun -n 2 python tests/petsc_scenes.py answers OUT.npz [direct] [SCENE ...] [-sc_... options]
    mpirun -n 2 python tests/petsc_scenes.py history FOLDER [killed | broken | mistaken | unsolved]

`answers` stores every step of the scenes, all of them if none is named. `history` goes on from
FOLDER/last.npz, where there is one, and stores the last step. What may happen in its fourth step: the
last rank is killed, or fails by itself, or the script has a mistake, or a linear problem is not solved.
"""

from __future__ import annotations

import itertools
import os
import signal
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import skfem as fem
from skfem.models.elasticity import lame_parameters, linear_elasticity

import skfem_contact as sc
from skfem_contact.linalg.distributed.ranks import ranks
from skfem_contact.linalg.distributed.share import Share

STEPS = ("press", "slide", "reverse")
SCENES = {
    f"{dim}-D_{method}_{sliding}": (dim, method, sliding)
    for dim, method, sliding in itertools.product((2, 3), ("mortar", "node"), ("small", "finite"))
}
SIZES = {2: 10, 3: 5}  # elements along the lower block

# Rounds of finite sliding end at this, so that they end at the same answer.
PLACED = sc.Options(placement_tolerance=1e-11)


def grid(sides: list[np.ndarray]) -> Any:
    """Quadrilaterals or hexahedra, with the fields of two or three displacements."""
    kind, element = (
        (fem.MeshQuad, fem.ElementQuad1()) if len(sides) == 2 else (fem.MeshHex, fem.ElementHex1())
    )
    mesh = kind.init_tensor(*sides).with_defaults()
    return fem.Basis(mesh, fem.ElementVector(element), intorder=2)


def blocks(dim: int, method: str, sliding: str, n: int) -> tuple[list[sc.Body], sc.Contact]:
    """A block of n - 2 elements along its sides on a wider one of n."""
    form = linear_elasticity(*lame_parameters(1.0, 0.3))
    wide, narrow = np.linspace(0.0, 1.0, n + 1), np.linspace(0.23, 0.81, n - 1)
    low = grid([wide] * (dim - 1) + [np.linspace(-0.5, 0.0, n // 2 + 1)])
    up = grid([narrow] * (dim - 1) + [np.linspace(0.0, 0.4, n // 2 + 1)])
    at = [basis.doflocs[-1] for basis in (low, up)]
    shift = np.zeros((2, up.N))
    component = np.arange(up.N) % dim
    shift[0, (component == 0) & (at[1] > 0.39)] = 1.0
    shift[1, (component == dim - 1) & (at[1] > 0.39)] = -1.0
    lower = sc.Body(low, form, D=np.flatnonzero(at[0] < -0.49), name="lower")
    upper = sc.Body(up, form, D=np.flatnonzero(at[1] > 0.39), x=shift[1], name="upper")
    sides = (
        upper.surface(lambda x: x[-1] < 1e-9),
        lower.surface(lambda x: x[-1] > -1e-9),
    )
    rough = sc.Contact(*sides, friction=sc.Coulomb(0.3), method=method, sliding=sliding)
    return [lower, upper], rough


def moves(upper: sc.Body, steps: int = 1) -> list[dict[str, Any]]:
    """Pressed, slid and slid back, each in as many steps."""
    component = np.arange(upper.n) % upper.dim
    held = np.isin(np.arange(upper.n), upper.D)
    out = []
    ways = np.array([[0.0, 0.0], [0.0, 0.012], [0.03, 0.012], [-0.01, 0.012]])
    for begin, end in itertools.pairwise(ways):
        for share in np.arange(1, steps + 1) / steps:
            right, down = begin + share * (end - begin)
            x = np.where(held & (component == 0), right, 0.0)
            out.append({"x": {"upper": np.where(held & (component == upper.dim - 1), -down, x)}})
    return out


def answers(linear: Any, scenes: Sequence[str]) -> dict[str, np.ndarray]:
    """Displacements and forces of every step of some scenes."""
    out = {}
    for name in scenes:
        dim, method, sliding = SCENES[name]
        bodies, contact = blocks(dim, method, sliding, SIZES[dim])
        solver = sc.ContactSolver(bodies, contact, linear=linear, options=PLACED)
        history = solver.history(moves(bodies[1]))
        for step, result in zip(STEPS, history, strict=True):
            for what in ("u", "normal_force", "traction"):  # the last in axes of space
                out[f"{name}, {step}: {what}"] = getattr(result, what)
    return out


def history(linear: Any, folder: Path, fault: str) -> None:
    """A history of twelve steps with checkpoints."""
    bodies, contact = blocks(2, "mortar", "small", 10)
    solver = sc.ContactSolver(bodies, contact, linear=linear)
    steps, last, done = moves(bodies[1], 4), folder / "last.npz", folder / "done"
    begin = int(done.read_text()) if done.exists() else 0
    state = solver.load_state(last) if begin else None
    for i in range(begin, len(steps)):
        if i == 3 and fault == "killed":
            victim = max(folder.glob("pid_*"), key=lambda path: int(path.name.removeprefix("pid_")))
            os.kill(int(victim.read_text()), signal.SIGKILL)
        if i == 3 and fault == "mistaken":
            raise KeyError("a mistake of the script")
        if i == 3 and fault == "unsolved":
            object.__setattr__(linear, "max_iterations", 2)
        (result,) = solver.history([steps[i]], start=state)
        state = solver.load_state(solver.save_state(last, result))
        done.write_text(str(i + 1))
    np.savez(folder / "answer.npz", u=result.u, slip=result.slip)
    print(f"history of {len(steps)} steps, begun at {begin}")


def fails_by_itself(count: int) -> None:
    """Of this rank, the solve after so many."""
    solve, left = Share.solve, [count]

    def solve_or_fail(self: Share, b: np.ndarray) -> Any:
        left[0] -= 1
        if left[0] < 0:
            raise MemoryError("no room for the rows of this rank")
        return solve(self, b)

    Share.solve = solve_or_fail  # type: ignore[method-assign]


def main() -> None:
    """Only rank 0 comes past `PETSc()`."""
    what, where, *words = (word for word in sys.argv[1:] if not word.startswith("-"))
    rank, fault = os.environ.get("OMPI_COMM_WORLD_RANK", "0"), "".join(words[:1])
    if what == "history":
        Path(where, f"pid_{rank}").write_text(str(os.getpid()))
        if fault == "broken" and rank != "0":
            fails_by_itself(10)
    linear = sc.PETSc("direct" if fault == "direct" else "iterative", tol=1e-12)
    if what == "answers":
        found = answers(linear, [word for word in words if word in SCENES] or list(SCENES))
        most = max(solve.iterations for solve in linear.solves)
        np.savez(where, **found, most=most, held=len(ranks().shares))
        print(f"{len(linear.solves)} solves on {linear.ranks} ranks, at most {most} iterations")
    else:
        history(linear, Path(where), fault)


if __name__ == "__main__":
    main()
