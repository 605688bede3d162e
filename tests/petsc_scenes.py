"""Blocks pressed, slid and slid back, as a script, with `mpirun` or without.

    mpirun -n 2 python tests/petsc_scenes.py answers OUT.npz [direct] [assembled] [iterated] [SCENE ...]
    mpirun -n 2 python tests/petsc_scenes.py history FOLDER [killed | broken | mistaken | unsolved ...]

`answers` stores every step of the scenes, all of them if none is named; `direct` condenses the bodies,
`assembled` has the stiffness assembled rank by rank, `iterated` allows no dense matrices. `history`
goes on from FOLDER/last.npz, where there is one, and stores the last step. What may happen in its
fourth step: the last rank is killed, or fails by itself, or the script has a mistake, or a linear
problem is not solved.
With `own` the script uses petsc4py before the library, with another default communicator; where it is
`ended`, it ends MPI itself.
"""

from __future__ import annotations

import gc
import itertools
import os
import signal
import sys
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import skfem as fem
from skfem.models.elasticity import lame_parameters, linear_elasticity

import skfem_contact as sc
from skfem_contact.petsc import Share
from skfem_contact.petsc.ranks import ranks

STEPS = ("press", "slide", "reverse")
SCENES = {
    f"{dim}-D_{method}_{sliding}": (dim, method, sliding)
    for dim, method, sliding in itertools.product((2, 3), ("mortar", "node"), ("small", "finite"))
}
SIZES = {2: 10, 3: 5}  # elements along the lower block

# Rounds of finite sliding end at this, so that they end at the same answer.
PLACED = sc.Options(placement_tolerance=1e-11)


ELEMENTS = {2: fem.ElementQuad1(), 3: fem.ElementHex1()}


def mesh_of(dim: int, n: int, upper: bool) -> Any:
    """Quadrilaterals or hexahedra of one of the blocks."""
    kind = fem.MeshQuad if dim == 2 else fem.MeshHex
    side = np.linspace(0.23, 0.81, n - 1) if upper else np.linspace(0.0, 1.0, n + 1)
    height = np.linspace(0.0, 0.4, n // 2 + 1) if upper else np.linspace(-0.5, 0.0, n // 2 + 1)
    return kind.init_tensor(*[side] * (dim - 1), height).with_defaults()


def basis_of(mesh: Any, elements: Any = None) -> Any:
    """The fields of two or three displacements."""
    element = fem.ElementVector(ELEMENTS[mesh.dim()])
    return fem.Basis(mesh, element, intorder=2, elements=elements)


def elastic(mesh: Any) -> Any:
    """Stiffness of a piece of a body; each rank has its own."""
    return linear_elasticity(*lame_parameters(1.0, 0.3)).assemble(basis_of(mesh))


def some_elements(dim: int, n: int, rank: int, count: int) -> tuple[np.ndarray, Any]:
    """Of the upper block, what a rank has of it by another partition."""
    mesh = mesh_of(dim, n, True)
    basis = basis_of(mesh, np.array_split(np.arange(mesh.nelements), count)[rank])
    K = linear_elasticity(*lame_parameters(1.0, 0.3)).assemble(basis)
    dofs = np.unique(basis.element_dofs)[::-1]  # in any order
    return dofs, K[dofs][:, dofs]


def blocks(
    dim: int, method: str, sliding: str, n: int, linear: Any = None, collected: bool = True
) -> tuple[list[sc.Body], sc.Contact]:
    """A block of n - 2 elements along its sides on a wider one of n.

    With a `PETSc` their stiffness is assembled rank by rank: of the lower one on pieces that the
    library cuts, of the upper one, where it is `collected`, by another partition.
    """
    low, up = (mesh_of(dim, n, upper) for upper in (False, True))
    form: Any = linear_elasticity(*lame_parameters(1.0, 0.3))
    if linear is None:
        low, up = basis_of(low), basis_of(up)
        stiffness = form, form
    else:
        element = fem.ElementVector(ELEMENTS[dim])
        low, up = (linear.numbering(mesh, element) for mesh in (low, up))
        stiffness = (
            linear.assemble(elastic, low),
            (
                linear.collect(partial(some_elements, dim, n))
                if collected
                else linear.assemble(elastic, up)
            ),
        )
    at = [basis.doflocs[-1] for basis in (low, up)]
    shift = np.zeros((2, up.N))
    component = np.arange(up.N) % dim
    shift[0, (component == 0) & (at[1] > 0.39)] = 1.0
    shift[1, (component == dim - 1) & (at[1] > 0.39)] = -1.0
    lower = sc.Body(low, stiffness[0], D=np.flatnonzero(at[0] < -0.49), name="lower")
    upper = sc.Body(up, stiffness[1], D=np.flatnonzero(at[1] > 0.39), x=shift[1], name="upper")
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


def answers(
    linear: Any, scenes: Sequence[str], assembled: bool = False, options: sc.Options = PLACED
) -> dict[str, np.ndarray]:
    """Displacements and forces of every step of some scenes, reactions and the certificate.

    With `assembled` the stiffness is assembled rank by rank.
    """
    out = {}
    for name in scenes:
        dim, method, sliding = SCENES[name]
        given = linear if assembled else None
        bodies, contact = blocks(dim, method, sliding, SIZES[dim], given)
        solver = sc.ContactSolver(bodies, contact, linear=linear, options=options)
        history = solver.history(moves(bodies[1]))
        for step, result in zip(STEPS, history, strict=True):
            for what in ("u", "normal_force", "traction"):  # the last in axes of space
                out[f"{name}, {step}: {what}"] = getattr(result, what)
            reactions = [result.reaction(body) for body in ("lower", "upper")]
            out[f"{name}, {step}: reactions"] = np.concatenate(reactions)
            out[f"{name}, {step}: worst"] = np.array(result.certificate.worst)
    return out


def away(found: np.ndarray, expected: np.ndarray) -> float:
    """Largest difference over the largest number."""
    return float(np.abs(found - expected).max() / np.abs(expected).max())


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
        if fault == "own":
            from petsc4py import PETSc

            PETSc.Sys.setDefaultComm(PETSc.COMM_SELF)
    linear = sc.petsc.PETSc("direct" if "direct" in words else "iterative", tol=1e-12)
    if what == "answers":
        scenes = [word for word in words if word in SCENES] or list(SCENES)
        options = replace(PLACED, max_dense_bytes=0) if "iterated" in words else PLACED
        found = answers(linear, scenes, "assembled" in words, options)
        most = max(solve.iterations for solve in linear.solves)
        held = len(ranks().shares)
        gc.collect()  # bodies and their surfaces know of each other
        linear.memory()  # a command, by which ranks forget what is gone
        left = len(ranks().shares)
        np.savez(where, **found, most=most, held=held, left=left, rows=len(ranks().held))
        print(f"{len(linear.solves)} solves on {linear.ranks} ranks, at most {most} iterations")
    else:
        history(linear, Path(where), fault)
        if fault == "ended":
            from mpi4py import MPI

            MPI.Finalize()


if __name__ == "__main__":
    main()
