"""What a stiffness that is assembled rank by rank does, as a script for `mpirun`.

    mpirun -n 3 python tests/petsc_assembled.py operators OUT.npz
    mpirun -n 2 python tests/petsc_assembled.py others OUT.npz
    mpirun -n 2 python tests/petsc_assembled.py refused OUT.txt
    mpirun -n 2 python tests/petsc_assembled.py broken OUT.txt

`operators` compares it with SciPy's matrices and stores relative differences, `others` does so with
answers of a body that contact alone holds and of a rigid tool, and from springs in series. `refused`
writes what is said to what can not be done, and in `broken` assembly fails on the last rank.
"""

from __future__ import annotations

import pickle
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import internals
import numpy as np
import pytest
import skfem as fem
from petsc_scenes import away, blocks, elastic, moves, some_elements
from scipy.sparse import block_diag, csr_matrix, diags, identity, vstack
from skfem.models.elasticity import linear_elasticity

import skfem_contact as sc
from skfem_contact.petsc import StackedStiffness, csr_of
from skfem_contact.petsc.ranks import ranks

_order = internals.beside(StackedStiffness, "_order")


def own_rows(own: Any, given: tuple[int], parts: list[Any]) -> list[Any]:
    """Rows of a matrix as PETSc has them on a rank, and its rigid motions."""
    A = own.shares[given[0]].A
    motions = [vector.array.copy() for vector in A.getNearNullSpace().getVecs()]
    return [*A.getValuesCSR(), np.column_stack(motions)]


def single(K: Any, A: csr_matrix) -> dict[str, float]:
    """The stiffness of one body."""
    rng = np.random.default_rng(3)
    x, some = rng.standard_normal((K.shape[0], 2)), rng.permutation(K.shape[0])[:40]
    return {
        "K x": away(K @ x, A @ x),
        "K' x": away(K.T @ x[:, 0], A.T @ x[:, 0]),
        "|K| x": away(abs(K) @ x, abs(A) @ x),
        "diagonal": away(K.diagonal(), A.diagonal()),
        "rows": away(K[some].toarray(), A[some].toarray()),
    }


def eliminated(linear: Any, K: StackedStiffness, A: csr_matrix, unlike: bool) -> dict[str, float]:
    """Rows eliminated from all bodies, with a test space of its own or without."""
    rng, n = np.random.default_rng(4), A.shape[0]
    x, f, D = rng.standard_normal(n), rng.standard_normal(n), np.flatnonzero(rng.random(n) < 0.1)
    C = csr_matrix(rng.standard_normal((5, n)) * (rng.random(n) < 0.05))
    trial = test = sc.elimination.eliminate(C, rng.standard_normal(5), D, x)
    if unlike:
        test = sc.elimination.eliminate(C[:, rng.permutation(n)], np.zeros(5), D)
    K_r, f_r = K.reduced(trial, f, test)
    expected, load = trial.reduce(A, f, test=test)
    key = K_r.factorize(linear._settings(not unlike, K_r.layout.block))
    parts, layout = ranks().together(own_rows, (key,)), K_r.layout
    rows = [csr_of(part[:3], (len(part[0]) - 1, layout.size)) for part in parts]
    whole, motions = vstack(rows, format="csr"), np.concatenate([part[3] for part in parts])
    place = _order(trial.independent, test.independent)
    gone = np.setdiff1d(np.arange(layout.size), layout.slot)
    ranks().drop(key)
    return {
        "K u": away(K @ x, A @ x),
        "V'KT": away(whole[layout.slot][:, layout.slot].toarray()[place], expected.toarray()),
        "f_r": away(f_r[place], load),
        "gone": float((whole[gone].indices != gone).any() or whole[gone].data.min() <= 0),
        "motions": away(motions.T @ motions, np.eye(motions.shape[1])),
        "other DOFs": float(unlike == np.array_equal(trial.independent, test.independent)),
    }


def operators(linear: Any) -> dict[str, float]:
    """Relative differences from matrices of SciPy."""
    rng = np.random.default_rng(5)
    here, _ = blocks(3, "mortar", "small", 5)
    there, _ = blocks(3, "mortar", "small", 5, linear)
    spring = diags(rng.random(here[0].n))
    one, two = (body.K for body in here)
    first, second = (body.K for body in there)
    first_held, one_held = first + csr_matrix(spring), csr_matrix(one + spring)
    out = {}
    singles = {"lower": (first, one), "upper": (second, two), "springs": (first_held, one_held)}
    for name, (K, A) in singles.items():
        out |= {f"{name}: {what}": value for what, value in single(K, A).items()}

    A = csr_matrix(block_diag([two, one_held]))
    K = StackedStiffness.of((here[1], here[0]), [second, first_held], True)
    B = csr_matrix(rng.standard_normal((3, A.shape[0])) * (rng.random(A.shape[0]) < 0.1))
    systems = {
        "bodies": (K, A),
        "one on rank 0": (StackedStiffness.of((here[1], here[0]), [two, first_held], True), A),
        "with terms": (K + csr_matrix(B.T @ B), csr_matrix(A + B.T @ B)),
        "bordered": (
            K.bordered(B) + identity(A.shape[0] + 3, format="csr"),
            csr_matrix(block_diag([A, csr_matrix((3, 3))]) + identity(A.shape[0] + 3)),
        ),
    }
    for name, (K, A) in systems.items():
        for unlike in (False, True):
            found = eliminated(linear, K, A, unlike)
            out |= {f"{name}, {unlike}: {what}": value for what, value in found.items()}
    return out


def floating(dim: int, linear: Any) -> sc.answers.ContactResult:
    """The upper block has loads and no supports."""
    (lower, up), _ = blocks(dim, "mortar", "small", 10 if dim == 2 else 5, linear)
    component, top = np.arange(up.n) % dim, up.dof_points[:, -1] > 0.39
    f = np.where(component == dim - 1, -1e-3, np.where(component == 0, 1e-4, 0.0)) * top
    upper = sc.Body(up.basis, up.K, f=f, name="upper")
    sides = upper.surface(lambda x: x[-1] < 1e-9), lower.surface(lambda x: x[-1] > -1e-9)
    rough = sc.Contact(*sides, friction=sc.Coulomb(0.3))
    return sc.ContactSolver([lower, upper], rough, linear=linear or "auto").solve()


def tool(dim: int, linear: Any) -> sc.answers.ContactResult:
    """A rigid ball under a force is pressed into the lower block."""
    (lower, _), _ = blocks(dim, "mortar", "small", 10 if dim == 2 else 5, linear)
    ball = sc.RigidCylinder((0.5, 0.3), 0.3) if dim == 2 else sc.RigidSphere((0.5, 0.5, 0.3), 0.3)
    turns = ("rotation",) if dim == 2 else ("rotation x", "rotation y", "rotation z")
    held = ("x", "y")[: dim - 1] + turns
    body = sc.RigidBody(ball, D=held, force=(0.0,) * (dim - 1) + (-1e-3,), name="tool")
    rough = sc.Contact(lower.surface(lambda x: x[-1] > -1e-9), body, friction=sc.Coulomb(0.3))
    return sc.ContactSolver([lower, body], rough, linear=linear or "auto").solve()


def in_series(dim: int, linear: Any) -> sc.answers.ContactResult:
    """Newton's iterations begin from springs in series with the points."""
    bodies, rough = blocks(3, "mortar", "small", 5, linear)
    solver = sc.ContactSolver(bodies, rough, linear=linear or "auto")
    with pytest.MonkeyPatch.context() as monkeypatch:
        internals.replace(monkeypatch, "loops.possible_starts", lambda *given: ["proximal"])
        return solver.solve(x=moves(bodies[1])[1]["x"])


def others(linear: Any) -> dict[str, float]:
    """Relative differences of answers from the default route's, and their certificates."""
    out = {}
    for scene, dim in ((floating, 2), (floating, 3), (tool, 2), (tool, 3), (in_series, 3)):
        found, expected = scene(dim, linear), scene(dim, None)
        for what in ("u", "traction"):
            values = getattr(found, what), getattr(expected, what)
            out[f"{scene.__name__}, {dim}-D: {what}"] = away(*values)
        out[f"{scene.__name__}, {dim}-D: certificate"] = found.certificate.worst
    return out


def soft(linear: Any) -> float:
    """A lower block a million times as soft as the upper one, pressed and slid: what is off.

    Beside the loads of the upper one the forces of the lower one are in the last digits.
    """
    (lower, upper), _ = blocks(2, "mortar", "small", 10)
    lower = sc.Body(lower.basis, 1e-6 * lower.K, D=lower.D, name="lower")
    sides = upper.surface(lambda x: x[-1] < 1e-9), lower.surface(lambda x: x[-1] > -1e-9)
    rough = sc.Contact(*sides, friction=sc.Coulomb(0.3))
    found, expected = (
        sc.ContactSolver([lower, upper], rough, linear=backend).solve(x=moves(upper)[1]["x"])
        for backend in (linear, "auto")
    )
    return max(away(found.u, expected.u), away(found.traction, expected.traction))


def without_stiffness(linear: Any) -> sc.answers.ContactResult:
    """A DOF that has none."""
    (lower, upper), _ = blocks(2, "mortar", "small", 10)
    K = lower.K.tolil()
    free = np.setdiff1d(np.arange(lower.n), lower.D)[0]
    K[free] = K[:, free] = 0.0
    lower = sc.Body(lower.basis, K.tocsr(), D=lower.D, name="lower")
    sides = upper.surface(lambda x: x[-1] < 1e-9), lower.surface(lambda x: x[-1] > -1e-9)
    return sc.ContactSolver([lower, upper], sc.Contact(*sides), linear=linear).solve()


def all_held(linear: Any) -> float:
    """Nothing is left to solve for; the largest displacement."""
    (lower, upper), _ = blocks(2, "mortar", "small", 10)
    first, second = (sc.Body(b.basis, b.K, D=np.arange(b.n)) for b in (lower, upper))
    rough = sc.Contact(second.surface(lambda x: x[-1] < 1e-9), first.surface(lambda x: x[-1] > -1e-9))
    return float(abs(sc.ContactSolver([first, second], rough, linear=linear).solve().u).max())


def holes(rank: int, count: int) -> tuple[np.ndarray, Any]:
    """DOFs 0 and 2, of which 1 is in nobody's matrix."""
    return np.array([0, 2]), identity(2)


def slanted(rank: int, count: int) -> tuple[np.ndarray, Any]:
    """A matrix that is not symmetric on the last rank."""
    return np.arange(2), csr_matrix([[1.0, float(rank == count - 1)], [0.0, 1.0]])


def twice(rank: int, count: int) -> tuple[np.ndarray, Any]:
    """A DOF that has two rows."""
    return np.array([1, 1]), identity(2)


def nothing(rank: int, count: int) -> None:
    """No matrix."""


def dense(mesh: Any) -> np.ndarray:
    """An array."""
    return elastic(mesh).toarray()


def other_numbering(mesh: Any) -> Any:
    """A matrix that belongs to another element."""
    return linear_elasticity().assemble(fem.Basis(mesh, fem.ElementVector(fem.ElementQuad2())))


def fails(rank: int, count: int, dim: int) -> tuple[np.ndarray, Any]:
    """On the last rank there is a file missing."""
    if rank == count - 1:
        raise FileNotFoundError("part_1.msh is not on this machine")
    return some_elements(dim, 10, rank, count)


def refused(linear: Any) -> list[str]:
    """What is said to what can not be done."""
    bodies, contact = blocks(2, "mortar", "small", 10, linear)
    lower, K = bodies[0].basis, bodies[0].K
    solver = sc.ContactSolver(bodies, contact, linear=linear)
    form = fem.LinearForm(lambda v, w: v[0])
    tries: list[Callable[[], Any]] = [
        lambda: K.toarray(),
        lambda: K[:, 1],
        lambda: 2.0 * K,
        lambda: K @ np.ones(3),
        lambda: pickle.dumps(bodies[0]),
        lambda: solver.system.K,
        lambda: solver.sizes(),
        lambda: sc.ContactSolver(bodies, contact),
        lambda: sc.ContactSolver(bodies, contact, linear=sc.linalg.AMG()),
        lambda: sc.ContactSolver(bodies, contact, linear="iterated"),
        lambda: sc.Body(lower, bodies[1].K),
        lambda: sc.Body(lower, linear_elasticity()),
        lambda: sc.Body(lower, K, f=form),
        lambda: linear.assemble(lambda mesh: elastic(mesh), lower),
        lambda: linear.assemble(elastic, lower.mesh),
        lambda: linear.assemble(dense, lower),
        lambda: linear.assemble(other_numbering, lower),
        lambda: linear.collect(holes),
        lambda: linear.collect(slanted),
        lambda: linear.collect(twice),
        lambda: linear.collect(nothing),
        lambda: without_stiffness(linear),
    ]
    said = []
    for attempt in tries:
        try:
            said.append(f"not refused: {attempt()!r}")
        except (sc.errors.InputError, AttributeError, sc.errors.SingularMatrix) as error:
            said.append(f"{type(error).__name__}: {error}")
    # all of that has left the ranks as they were
    result = solver.solve(x=moves(bodies[1])[0]["x"])
    said.append(f"answers: {result.converged}")
    # residuals of 1e-12 of all loads are none of those on the soft body
    said += [f"soft: {soft(linear) < 1e-8}", f"all held: {all_held(linear)}"]
    return said


def main() -> None:
    """Only rank 0 comes past `PETSc()`."""
    what, where = sys.argv[1:3]
    linear = sc.petsc.PETSc(tol=1e-12)
    if what == "operators":
        np.savez(where, **operators(linear))
    elif what == "others":
        np.savez(where, **others(linear))
    elif what == "refused":
        Path(where).write_text("\n".join(refused(linear)))
    else:
        linear.collect(partial(fails, dim=2))


if __name__ == "__main__":
    main()
