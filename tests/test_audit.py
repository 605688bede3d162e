"""A scene contains only what it needs: counted, not timed, on the scenes of `benchmarks/audit.py`."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import internals
import numpy as np
import pytest
import skfem as fem
from quick_elasticity import linear_elasticity
from scipy.sparse import csr_matrix

import skfem_contact as sc
from skfem_contact.problem import FullSystem

BENCHMARKS = Path(__file__).parents[1] / "benchmarks"
sys.path.insert(0, str(BENCHMARKS))
import audit as benchmark  # noqa: E402
import audit_scenes as scenes  # noqa: E402

sys.path.remove(str(BENCHMARKS))


@pytest.fixture(scope="module", autouse=True)
def _forget() -> Iterator[None]:
    """The benchmarks are no package: other tests import modules of the same names."""
    yield
    for name in ("audit", "audit_scenes", "run", "cases"):
        sys.modules.pop(name, None)


@pytest.fixture(scope="module")
def blocks() -> Any:
    return scenes.Blocks(500, count=4)


@pytest.mark.parametrize("row", scenes.ROWS, ids=lambda row: row.ingredient)
def test_absent_means_none(blocks: Any, row: Any) -> None:
    """What only an ingredient needs is called and held in the scene with it, and not without it."""
    with_calls, with_scene = benchmark.calls(row, blocks, True)
    calls, scene = benchmark.calls(row, blocks, False)
    assert all(with_calls.values()), with_calls
    held, without = row.counts(with_scene), row.counts(scene)
    assert all(held.values()), held
    assert with_calls or held
    assert not any(calls.values()), calls
    if row.fewer:
        assert all(without[what] < held[what] for what in held), (held, without)
    else:
        assert not any(without.values()), without


def run(blocks: Any, **settings: Any) -> Any:
    return blocks.solve(blocks.contact(**settings))


def test_import_brings_no_optional_package() -> None:
    """Files, pictures, multigrid and progress bars are imported by those who ask for them."""
    program = "import sys, skfem_contact; print(*sorted({name.split('.')[0] for name in sys.modules}))"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert not set(benchmark.LATER) & set(done.stdout.split())


def test_tangential_operator_is_made_by_asking(blocks: Any) -> None:
    """Without friction no tangential row exists; the slip of a result makes them, and is right."""
    done = run(blocks)
    kin, result = done.solver.kin, done.results[-1]
    assert "B_t" not in kin.__dict__
    moved = result.u[blocks.upper.n :], result.u[: blocks.upper.n]
    lower, upper = blocks.lower.surface("top"), blocks.upper.surface("bottom")
    # meshes that match, node on node: the slip is the difference of two nodal displacements
    above, below = moved[1][upper.dofs[:, 0]], moved[0][lower.dofs[:, 0]]
    order = np.argsort(upper.points[:, 0]), np.argsort(lower.points[:, 0])
    tangent = kin.tangent[order[0], 0, 0]
    closed = result.status[order[0]] != 0
    expected = np.where(closed, tangent * (above[order[0]] - below[order[1]]), 0.0)
    assert closed.any()
    # round-off of displacements of order one
    np.testing.assert_allclose(result.slip[order[0], 0], expected, rtol=0, atol=1e-12)
    assert "B_t" in kin.__dict__


def test_dense_problem_keeps_one_matrix(blocks: Any) -> None:
    """Beside the body's flexibility one dense matrix of the size of the rows is kept, not three."""
    problem = run(blocks, friction=sc.Coulomb(0.3)).solver.linear_model.problem_on(None, None)
    own = [value for value in vars(problem).values() if isinstance(value, np.ndarray)]
    q = len(problem.points.S)
    # the rest is in `points`; what follows from the directions of loads is kept, a column for each
    most = internals.original("problem.MOST_DIRECTIONS")
    assert sum(array.size for array in own) < q * q / 10 + q * most


def test_supported_bodies_are_not_asked_for_springs(blocks: Any, monkeypatch: Any) -> None:
    """Whether K holds a body is of interest only where its supports do not."""
    asked = []
    real = internals.original("conditions._resistance")
    internals.replace(monkeypatch, "conditions._resistance", lambda K, R: asked.append(K) or real(K, R))
    run(blocks)
    assert not asked


def test_direct_backend_gets_no_rigid_modes(blocks: Any) -> None:
    """Only multigrid asks for the rigid motions of all DOFs."""
    solver = sc.ContactSolver(
        [blocks.upper, blocks.lower], [blocks.contact()], linear=sc.linalg.Direct()
    )
    assert solver.model.modes is None
    assert FullSystem(solver.system, solver._stiffness, sc.linalg.AMG()).modes is not None


def test_matrices_of_the_user_are_not_copied(blocks: Any) -> None:
    """The solver works on the stiffness that the body has."""
    solver = run(blocks).solver
    for body, K in zip((blocks.upper, blocks.lower), solver.linear_model.stiffness, strict=True):
        assert K is body.K


def test_report_counts_dofs_that_are_kept(blocks: Any) -> None:
    """Without friction on a straight side only the normal DOFs of both sides are contact DOFs."""
    solver = run(blocks).solver
    m = solver.kin.m
    assert f"-> {2 * m} contact DOFs -> {m} gaps and slips" in str(solver)
    rough = run(blocks, friction=sc.Coulomb(0.3)).solver
    assert f"-> {4 * m} contact DOFs -> {2 * m} gaps and slips" in str(rough)


def test_a_module_is_a_module() -> None:
    """Rows name functions that exist, or their count of zero would say nothing."""
    import importlib

    for row in scenes.ROWS:
        for name in row.functions:
            path = name.partition(":")[0].replace("/", ".")
            module = importlib.import_module(f"skfem_contact.{path}")
            assert isinstance(module, ModuleType)


@pytest.mark.every_value
@pytest.mark.parametrize("sliding", ["small", "finite"])
@pytest.mark.parametrize("mu", [None, 0.3])
def test_increments_do_not_touch_the_interior(mu: Any, sliding: str, monkeypatch: Any) -> None:
    """A further step neither reads nor multiplies with K of a body, which has the whole interior."""
    element = fem.ElementVector(fem.ElementQuad1())
    mesh = fem.MeshQuad().refined(3).with_defaults()
    basis = fem.Basis(mesh, element)
    above = fem.Basis(mesh.translated((0.0, 1.0)).with_defaults(), element)
    load = fem.LinearForm(lambda v, w: -0.01 * v[1]).assemble(above.boundary("top"))
    form = linear_elasticity(0.0, 0.5)
    # held by contact and, without friction, by its side
    D = above.get_dofs("left").all("u^1") if mu is None else None
    low, up = sc.Body(basis, form, D="bottom"), sc.Body(above, form, load, D=D)
    friction = None if mu is None else sc.Coulomb(mu)
    pair = sc.Contact(up.surface("bottom"), low.surface("top"), friction=friction, sliding=sliding)
    history = sc.ContactSolver([low, up], pair).history([0.5, 0.6, 0.7, 0.8])
    next(history)
    next(history)  # what is asked for once has been
    read: list[str] = []

    def count(name: str) -> None:
        known = getattr(csr_matrix, name)

        def counted(self: Any, *given: Any) -> Any:
            if self.shape == (basis.N, basis.N):
                read.append(name)
            return known(self, *given)

        monkeypatch.setattr(csr_matrix, name, counted)

    for name in ("diagonal", "__matmul__"):
        count(name)
    results = list(history)
    assert len(results) == 2 and not read
    assert results[-1].certificate.worst < 1e-10 and read  # asked for, it multiplies with K


def test_increments_compute_nothing_that_only_questions_need(blocks: Any, monkeypatch: Any) -> None:
    """Forces that displacements follow from, singular values and ends of surfaces: where asked for."""
    upper = blocks.floating  # contact alone holds it sideways
    pair = blocks.contact(upper, friction=sc.Coulomb(0.3))
    steps = (blocks.moved(upper, down, 0.0) for down in (0.9, 1.0, 1.1))
    history = sc.ContactSolver([upper, blocks.lower], pair).history(steps)
    next(history)  # what is asked for once has been
    calls: list[str] = []

    def count(owner: Any, name: str) -> None:
        known = getattr(owner, name)

        def counted(*given: Any, **settings: Any) -> Any:
            calls.append(name)
            return known(*given, **settings)

        monkeypatch.setattr(owner, name, counted)

    count(internals.original("problem.PointProblem"), "source")
    count(internals.original("answers.Track"), "_past_end")
    count(np.linalg, "svd")
    results = list(history)
    assert len(results) == 2 and not calls
    assert results[-1].certificate.worst < 1e-10 and "source" in calls


def test_pictures_files_and_petsc_are_imported_when_asked_for() -> None:
    """Their modules come with the first use of a name, which is then there as any other."""
    program = """
import sys, skfem_contact as sc
late = "skfem_contact.output.", "skfem_contact.petsc."
print([name for name in sys.modules if name.startswith(late)])
sc.von_mises, sc.petsc.PETSc
print(late[0] + "stress" in sys.modules, late[1] + "backend" in sys.modules)
print("von_mises" in vars(sc), hasattr(sc, "plot"))
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.split("\n")[:3] == ["[]", "True True", "True False"]


def test_the_table_names_functions_that_are_there() -> None:
    """What the page counts are the functions that are counted now, and none that are gone."""
    stored = json.loads((BENCHMARKS / "results" / "audit.json").read_text(encoding="utf-8"))
    counted = {row["ingredient"]: set(row["with"]["calls"]) for row in stored["rows"]}
    assert counted == {row.ingredient: set(row.functions) for row in scenes.ROWS}
