"""What bodies condensed over MPI ranks do, as a script for `mpirun`.

    mpirun -n 2 python tests/petsc_condensed.py factors OUT.npz
    mpirun -n 2 python tests/petsc_condensed.py others OUT.npz [all]
    mpirun -n 2 python tests/petsc_condensed.py history OUT.npz
    mpirun -n 2 python tests/petsc_condensed.py said OUT.txt
    mpirun -n 2 python tests/petsc_condensed.py broken OUT.npz

`factors` compares factors over the ranks with those of this process, and `others` answers with those of
the default: relative differences, which are stored. `history` counts solves of an increment, and
`said` writes reports and what is refused; in `broken` the last rank has no memory for a solve.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import internals
import numpy as np
import petsc_assembled
import pytest
import skfem as fem
from petsc_scenes import away, basis_of, blocks, elastic, moves
from scipy.sparse import csr_matrix, diags
from skfem.models.elasticity import linear_elasticity

import skfem_contact as sc
from skfem_contact.petsc.ranks import Ranks, ranks

SPARSE = sc.Options(max_dense_bytes=0)  # contact is iterated


# -- factors ----------------------------------------------------------------------------------


def without_complement(own: Ranks, given: tuple[bool], parts: list[Any]) -> list[Any]:
    """On every rank: as if PETSc had no functions for the complement, or with them again."""
    usual.undo()
    if given[0]:
        internals.replace(usual, "petsc.schur_available", lambda PETSc: False)
    return []


usual = pytest.MonkeyPatch()


def compared(linear: Any, body: sc.Body, K: Any, A: csr_matrix, keep: np.ndarray) -> dict[str, float]:
    """Everything that condensation asks of factors."""
    rng, free = np.random.default_rng(1), np.delete(np.arange(body.n), body.D)
    place = np.searchsorted(free, keep)
    found = linear.condensed(body, K, free, place)
    expected = sc.linalg.Direct().condensed(body, A, free, place)
    f, u_c = rng.standard_normal((len(free), 3)), rng.standard_normal((len(place), 3))
    dofs = rng.permutation(len(free))[:40]
    held = np.eye(len(place)) + expected.S
    force = rng.standard_normal(40)
    u = [np.empty_like(f) for _ in range(2)]
    for out, factor in zip(u, (found, expected), strict=True):
        out[factor.order] = factor.substitute(u_c.copy(), factor.eliminate(f))
    flexibility = np.linalg.inv(held)
    moved = [factor.response(dofs)(force, flexibility) for factor in (found, expected)]
    out = {
        "S": away(found.S, expected.S) if len(place) else 0.0,
        "S is symmetric": float((found.S != found.S.T).any()),
        "reduced": away(found.reduce_load(f), expected.reduce_load(f)) if len(place) else 0.0,
        "reduced vector": float(found.reduce_load(f[:, 0]).shape != (len(place),)),
        "u": away(*u),
        "moved": away(*moved),
        "order": float((np.sort(found.order) != np.arange(len(free))).any()),
        "memory": float(found.memory <= 8 * len(place) ** 2),
    }
    return out


def factors(linear: Any) -> dict[str, float]:
    """Few and many kept DOFs, K here and on all ranks, springs; by the complement and by solves."""
    out, few = {}, internals.original("petsc.COLUMNS_AT_ONCE")
    for dim, n in ((2, 10), (3, 6)):
        here, there = blocks(dim, "mortar", "small", n)[0][1], None
        there = blocks(dim, "mortar", "small", n, linear)[0][1]
        free = np.delete(np.arange(here.n), here.D)
        surface = free[here.dof_points[free, -1] < 0.2]
        spring = diags(np.random.default_rng(0).random(here.n))
        ways = {"here": (here.K, here.K), "ranks": (there.K, here.K)}
        ways["springs"] = there.K + csr_matrix(spring), csr_matrix(here.K + spring)
        for keep in (free[:0], surface[:5], surface[::-1][::2], surface):
            for missing in (False, True) if len(keep) > few else (False,):
                ranks().together(without_complement, (missing,))
                for way, (K, A) in ways.items():
                    found = compared(linear, here, K, A, np.sort(keep))
                    name = f"{dim}-D, {len(keep)} kept, {way}, {missing}"
                    out |= {f"{name}: {what}": value for what, value in found.items()}
            ranks().together(without_complement, (False,))
    return out


# -- answers ----------------------------------------------------------------------------------


def seat(linear: Any, options: sc.Options | None = None) -> sc.answers.ContactResult:
    """A rigid tool on nodes of two symmetry planes: contact rows that depend on each other."""
    mesh = fem.MeshHex.init_tensor(*3 * [np.linspace(0, 1, 3)]).with_defaults()
    basis = linear.numbering(mesh, fem.ElementVector(fem.ElementHex1())) if linear else basis_of(mesh)
    K = linear.assemble(elastic, basis) if linear else elastic(mesh)
    D = np.union1d(basis.get_dofs("left").all(["u^1"]), basis.get_dofs("bottom").all(["u^2"]))
    block = sc.Body(basis, K, D=D, name="block")
    tool = sc.RigidBody(
        sc.RigidPlane((0, 0, 0), (0, 0, 1)),
        about=(0.5, 0.5, 0),
        K=np.repeat([1.0, 0.2], 3),
        name="tool",
    )
    contact = sc.Contact(block.surface("front"), tool, friction=sc.Coulomb(0.3), name="seat")
    solver = sc.ContactSolver([block, tool], [contact], linear=linear or "auto", options=options)
    return solver.solve(f={"block": {"back": (0.004, -0.002, -0.02)}})


def loop(linear: Any, name: str) -> sc.answers.ContactResult:
    """One of the loops."""
    bodies, rough = blocks(2, "mortar", "small", 10, linear)
    solver = sc.ContactSolver(bodies, rough, linear=linear or "auto", loop=name)
    return solver.solve(x=moves(bodies[1])[1]["x"])


def sprung(linear: Any) -> sc.answers.ContactResult:
    """The upper block is as stiff again near its top, by terms that one process has."""
    bodies, rough = blocks(2, "mortar", "small", 10, linear)
    upper = bodies[1]
    more = csr_matrix(diags(np.where(upper.dof_points[:, -1] > 0.1, 0.3, 0.0)))
    solver = sc.ContactSolver(bodies, rough, linear=linear or "auto")
    return solver.with_stiffness(upper, upper.K + more).solve(x=moves(upper)[1]["x"])


def beside(linear: Any) -> sc.answers.ContactResult:
    """A third body that touches nothing, with a load."""
    bodies, rough = blocks(2, "mortar", "small", 10, linear)
    mesh = fem.MeshQuad().refined(2).translated((3.0, 0.0)).with_defaults()
    basis = fem.Basis(mesh, fem.ElementVector(fem.ElementQuad1()))
    alone = sc.Body(basis, linear_elasticity(), D="left", f={"right": (0.0, 0.01)}, name="alone")
    solver = sc.ContactSolver([*bodies, alone], rough, linear=linear or "auto")
    return solver.solve(x=moves(bodies[1])[0]["x"])


def others(linear: Any, every: bool) -> dict[str, float]:
    """Differences of displacements and tractions from the default's, and certificates."""
    scenes: dict[str, Callable[[Any], sc.answers.ContactResult]] = {
        "floating": lambda way: petsc_assembled.floating(2, way),
        "tool": lambda way: petsc_assembled.tool(2, way),
        "sprung": sprung,
        "beside": beside,
        "dependent": seat,
        "dependent, iterated": lambda way: seat(way, SPARSE if way else None),
    }
    if every:
        scenes |= {
            "floating solid": lambda way: petsc_assembled.floating(3, way),
            "tool, solid": lambda way: petsc_assembled.tool(3, way),
            "in series": lambda way: petsc_assembled.in_series(3, way),
            "the loop direct": lambda way: loop(way, "direct"),
            "the paper's loop": lambda way: loop(way, "fictitious"),
        }
    out = {}
    for name, scene in scenes.items():
        found, expected = scene(linear), scene(None)
        for what in ("u", "traction"):
            out[f"{name}: {what}"] = away(getattr(found, what), getattr(expected, what))
        out[f"{name}: certificate"] = found.certificate.worst
    return out


def history(linear: Any) -> dict[str, Any]:
    """A history of 51 increments, and how many solves, of how many columns, that took."""
    found = []
    for way in (linear, "auto"):
        bodies, rough = blocks(3, "mortar", "small", 5, linear if way is linear else None)
        solver = sc.ContactSolver(bodies, rough, linear=way).prepare()
        before = len(linear.solves)
        results = list(solver.history(moves(bodies[1], 17)))
        known = len(linear.solves)
        u = solver.recover(results)
        found.append((u, known - before, len(linear.solves) - known))
    (u, steps, recovery), (expected, *_) = found
    columns = [solve.columns for solve in linear.solves[-recovery:]]
    out = {"away": away(np.array(u), np.array(expected)), "increments": len(u), "solves": steps}
    return out | {"recovery": recovery, "columns": sum(columns)}


# -- words ------------------------------------------------------------------------------------


def said(linear: Any) -> list[str]:
    """Reports of the routes, and what is refused."""
    bodies, contact = blocks(2, "mortar", "small", 10, linear)
    dense = sc.ContactSolver(bodies, contact, linear=linear)
    sparse = sc.ContactSolver(bodies, contact, linear=linear, options=SPARSE)
    lines = [str(solver).splitlines()[0] for solver in (dense, sparse)]
    lines.append(sparse.solve(x=moves(bodies[1])[0]["x"]).report().replace("\n", " "))
    upper = blocks(3, "mortar", "small", 5)[0][1]
    # its diagonal is positive, but it is not
    soft = sc.Body(upper.basis, upper.K - 0.9 * diags(upper.K.diagonal()), D=upper.D, name="soft")
    loose = sc.Body(upper.basis, upper.K * 0.0, D=upper.D, name="loose")
    small = replace(linear, options={"mat_mumps_icntl_23": 1})  # MB
    larger = blocks(3, "mortar", "small", 12)[0][1]
    tries: list[Callable[[], Any]] = [
        dense.sizes,
        lambda: linear.condensed(soft, soft.K, np.arange(upper.n), np.arange(100)),
        lambda: linear.condensed(loose, loose.K, np.arange(upper.n), np.arange(100)),
        lambda: sc.linalg.AMG().condensed(upper, upper.K, np.arange(upper.n), np.arange(100)),
        lambda: small.condensed(larger, larger.K, np.arange(larger.n), larger.D),
    ]
    for attempt in tries:
        try:
            lines.append(f"not refused: {attempt()!r}")
        except (sc.ContactError, np.linalg.LinAlgError) as error:
            lines.append(f"{type(error).__name__}: {error}")
    return lines


def no_room(self: Any, U: np.ndarray) -> Any:
    """On the ranks that serve."""
    raise MemoryError("no room for what follows contact")


def main() -> None:
    """Only rank 0 comes past `PETSc()`."""
    what, where, *words = (word for word in sys.argv[1:] if not word.startswith("-"))
    if what == "broken" and os.environ.get("OMPI_COMM_WORLD_RANK", "0") != "0":
        internals.replace(usual, "petsc.BodyShare.coupled", no_room)
    linear = sc.petsc.PETSc("direct", tol=1e-12)
    if what == "factors":
        np.savez(where, **factors(linear))
    elif what == "others":
        np.savez(where, **others(linear, "all" in words))
    elif what in ("history", "broken"):
        np.savez(where, **history(linear))
    else:
        Path(where).write_text("\n".join(said(linear)))


if __name__ == "__main__":
    main()
