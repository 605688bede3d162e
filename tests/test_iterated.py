"""The iterated contact problem: the answers of the dense one, without its matrices."""

from __future__ import annotations

import tracemalloc
from dataclasses import replace

import internals
import numpy as np
import pytest
import rectangles
import skfem as fem
from numpy.testing import assert_allclose
from skfem.models.elasticity import lame_parameters, linear_elasticity
from solid_blocks import Blocks, two_blocks

import skfem_contact as sc
from skfem_contact.errors import SingularMatrix
from skfem_contact.linalg import AMG, MultifrontalCholesky, gmres
from skfem_contact.linalg import SurfaceResponse as Substitution
from skfem_contact.problem import (
    Condensed,
    Conditions,
    IteratedBodies,
    IteratedProblem,
    MultigridBodies,
    MultigridProblem,
    PointProblem,
    Resistance,
)


def conditions(blocks: Blocks, seed: int = 0, *, mu: float = 0.4) -> Conditions:
    """A disc of closed points: the middle sticks, the others slip, most of them on springs."""
    rng = np.random.default_rng(seed)
    m, rho = blocks.kin.m, np.linalg.norm(blocks.kin.points[:, :2] - 0.5, axis=1)
    closed, stick = rho < 0.45, rho < 0.2
    slides = closed & ~stick
    angle = rng.uniform(0, 2 * np.pi, m)
    along = np.column_stack([np.cos(angle), np.sin(angle)])
    across = np.eye(2) - along[:, :, None] * along[:, None, :]
    size = np.where(slides & (rho < 0.4), 10.0 ** rng.uniform(-3, 3, m), 0.0)
    return Conditions(
        closed,
        stick,
        1e-3 * rng.standard_normal((m, 2)),
        size[:, None, None] * across,
        np.where(slides[:, None], 1e-3 * rng.standard_normal((m, 2)), 0.0),
        np.where(slides[:, None], mu * along, 0.0),
    )


def posed(blocks: Blocks) -> tuple[PointProblem, IteratedProblem, MultigridProblem]:
    """The dense problem, and those without dense matrices and without factors."""
    parts, on = (blocks.system, blocks.stiffness, blocks.wanted), blocks.on()
    grids = MultigridBodies(*parts, backend=AMG(tol=1e-13))
    dense, whole = Condensed(*parts), IteratedBodies(*parts)
    return PointProblem(dense, on), IteratedProblem(whole, on), MultigridProblem(grids, on)


@pytest.mark.every_value
@pytest.mark.parametrize("E", [1.0, 1e4])
@pytest.mark.parametrize("floating", [False, True], ids=["held", "floating"])
def test_forces_are_those_of_the_dense_problem(floating, E):
    """Sticking, slipping and open points of solids: the same forces, gaps, slips and displacements."""
    blocks = two_blocks(6, 3, floating=floating, E=E)
    rng = np.random.default_rng(1)
    x, f = np.zeros(blocks.system.n), 1e-4 * rng.standard_normal(blocks.system.n)
    upper = blocks.system.bodies[1]
    if len(upper.D):
        x[blocks.system.offsets[1] + upper.D] = 1e-2 * rng.standard_normal(len(upper.D))
    case = blocks.case(f, x)
    answers = []
    for problem in posed(blocks):
        load, of = problem.load(case), []
        for seed in range(2):
            found = problem.solve(conditions(blocks, seed), load)
            source = problem.source(load, found)
            of.append((found, problem.bodies.recover(_column(source), (load.components,), [case])[0]))
            surface = problem.surface(source, case)[blocks.wanted]
            assert_allclose(surface, of[-1][1][blocks.wanted], rtol=0, atol=1e-11)
        answers.append(of)
    for of in answers[1:]:
        for (found, u), (dense, exact) in zip(of, answers[0], strict=True):
            force = np.abs(dense.normal_force).max()
            # GMRES to 1e-13, times the condition of the points, some hundreds
            assert_allclose(found.normal_force, dense.normal_force, rtol=0, atol=1e-10 * force)
            assert_allclose(found.tangential_force, dense.tangential_force, rtol=0, atol=1e-10 * force)
            for name in ("gap", "slip"):
                a, b = getattr(found, name), getattr(dense, name)
                assert_allclose(a, b, rtol=0, atol=1e-10 * np.abs(b).max())
            assert_allclose(u, exact, rtol=0, atol=1e-10 * np.abs(exact).max())


def _column(source):
    return type(source)(source.values[:, None], source.forces)


def test_springs_in_series_with_the_points():
    """As on gaps and slips: forces, and gaps and slips as they are seen through the springs."""
    blocks = two_blocks(6, 3)
    m, rng = blocks.kin.m, np.random.default_rng(2)
    case = blocks.case(1e-4 * rng.standard_normal(blocks.system.n), np.zeros(blocks.system.n))
    springs = Resistance(10.0 ** rng.uniform(-2, 1, m), 10.0 ** rng.uniform(-2, 1, m))
    forces = 1e-3 * rng.random(m), 1e-3 * rng.standard_normal((m, 2))
    answers = []
    for problem in posed(blocks):
        together = problem.in_series(springs)
        load = together.at_forces(problem.load(case), *forces)
        answers.append(together.solve(conditions(blocks), load))
    dense = answers[0]
    for found in answers[1:]:
        for name in ("gap", "slip", "normal_force", "tangential_force"):
            a, b = getattr(found, name), getattr(dense, name)
            # as above
            assert_allclose(a, b, rtol=0, atol=1e-10 * np.abs(b).max(), err_msg=name)


def test_answers_on_the_way_are_rough_and_say_so():
    """They take fewer iterations and are about right; the exact one after them is as without them."""
    blocks = two_blocks(6, 3)
    case = blocks.case(np.ones(blocks.system.n), np.zeros(blocks.system.n))
    asked = conditions(blocks)
    _, *problems = posed(blocks)
    for problem in problems:
        exact = problem.solve(asked, problem.load(case))
        load = problem.load(case)
        rough = problem.solve(replace(asked, rough=True), load)
        assert rough.rough and not exact.rough
        assert problem.iterations[1] < problem.iterations[0] / 2
        force = np.abs(exact.normal_force).max()
        assert 1e-8 * force < np.abs(rough.normal_force - exact.normal_force).max() < 0.05 * force
        after = problem.solve(asked, load)
        assert_allclose(after.normal_force, exact.normal_force, rtol=0, atol=1e-10 * force)
        assert not problem.solve(replace(asked, rough=True), load).rough  # nothing is left to do


def test_number_of_iterations_hardly_grows_with_the_number_of_points():
    """The layer takes the growth away that forces alone have, from 30 to 45 and more."""
    counts = []
    for n in (5, 9, 13):
        blocks = two_blocks(n, n // 2)
        x = np.zeros(blocks.system.n)
        x[blocks.system.offsets[1] + blocks.system.bodies[1].D] = -0.01
        case = blocks.case(np.zeros_like(x), x)
        parts, on = (blocks.system, blocks.stiffness, blocks.wanted), blocks.on()
        problems = (
            IteratedProblem(IteratedBodies(*parts), on),
            MultigridProblem(MultigridBodies(*parts), on),
        )
        for problem in problems:
            problem.solve(conditions(blocks), problem.load(case))
        counts.append([problem.iterations[0] for problem in problems])
    assert np.max(counts) <= 35
    assert counts[2][0] <= counts[1][0] + 4


def test_points_that_do_not_hold_a_body():
    """A body that the closed points leave free to move is a singular problem, said so."""
    blocks = two_blocks(4, 2, floating=True)
    few = conditions(blocks)
    only = np.zeros(blocks.kin.m, dtype=bool)
    only[:2] = True
    free = Conditions(only, only & False, few.anchor, 0 * few.spring, 0 * few.offset, 0 * few.coupling)
    for problem in posed(blocks)[1:]:
        load = problem.load(blocks.case(np.ones(blocks.system.n), np.zeros(blocks.system.n)))
        with pytest.raises(SingularMatrix, match="do not hold the bodies"):
            problem.solve(free, load)


@pytest.mark.parametrize("linear", ["iterated", AMG(tol=1e-13)], ids=["iterated", "multigrid"])
def test_slips_that_a_tool_alone_decides_depend_on_each_other(linear):
    """At nodes of symmetry planes they are its motions: six rows here, of which three are enough."""
    mesh = fem.MeshHex.init_tensor(*3 * [np.linspace(0, 1, 3)]).with_defaults()
    basis = fem.Basis(mesh, fem.ElementVector(fem.ElementHex1()), intorder=3)
    K = linear_elasticity(*lame_parameters(1.0, 0.3)).assemble(basis)
    D = np.union1d(basis.get_dofs("left").all(["u^1"]), basis.get_dofs("bottom").all(["u^2"]))
    block = sc.Body(basis, K, D=D, name="block")
    plane = sc.RigidPlane((0, 0, 0), (0, 0, 1))
    tool = sc.RigidBody(plane, about=(0.5, 0.5, 0), K=np.repeat([1.0, 0.2], 3), name="tool")
    contact = sc.Contact(block.surface("front"), tool, friction=sc.Coulomb(0.3), name="seat")
    push = {"f": {"block": {"back": (0.004, -0.002, -0.02)}}}
    forces = []
    for way in ("auto", linear):
        solver = sc.ContactSolver([block, tool], [contact], linear=way)
        forces.append(solver.solve(**push)["seat"].forces.sum(axis=0))
    assert_allclose(forces[1], forces[0], rtol=0, atol=1e-9 * abs(forces[0]).max())


@pytest.mark.parametrize("linear", ["iterated", AMG(tol=1e-13)], ids=["iterated", "multigrid"])
def test_sticking_that_gives_a_little_amplifies_no_tolerance(linear):
    """A force is the stiffness times the slip: a stiff one leaves few digits."""
    mesh = fem.MeshHex.init_tensor(*3 * [np.linspace(0, 1, 4)]).with_defaults()
    basis = fem.Basis(mesh, fem.ElementVector(fem.ElementHex1()), intorder=3)
    K = linear_elasticity(*lame_parameters(1.0, 0.3)).assemble(basis)
    block = sc.Body(basis, K, D="back", x={"back": (0.01, 0.004, -0.02)}, name="block")
    plane = sc.RigidPlane((0, 0, 0), (0, 0, 1))
    answers = []
    for way in ("auto", linear):
        law = sc.Coulomb(0.15, stiffness=1e6)
        contact = sc.Contact(block.surface("front"), plane, friction=law, name="seat")
        answers.append(sc.ContactSolver(block, contact, linear=way).solve()["seat"])
    dense, found = answers
    assert 0 < np.count_nonzero(dense.status == 2) < len(dense.status)  # both stick and slip
    # the tolerance of the loop
    assert_allclose(found.forces, dense.forces, rtol=0, atol=1e-10 * abs(dense.forces).max())


def test_one_load_solved_again_is_the_same_to_the_last_bit():
    """What an iteration begins with comes from its own load alone."""
    blocks = two_blocks(5, 3)
    case = blocks.case(np.ones(blocks.system.n), np.zeros(blocks.system.n))
    first, other = conditions(blocks), conditions(blocks, 5)
    for problem in posed(blocks)[1:]:
        answers = []
        for _ in range(2):
            load = problem.load(case)
            problem.solve(first, load)
            answers.append(problem.solve(other, load).normal_force)
        assert np.array_equal(*answers)


def test_response_of_some_dofs():
    """Displacements at forces, from the fronts above alone, are those of the whole solve."""
    blocks = two_blocks(6, 3)
    body, K = blocks.system.bodies[0], blocks.stiffness[0]
    free = np.setdiff1d(np.arange(body.n), body.D)
    factor = MultifrontalCholesky(K[free][:, free], body.dof_points[free], leaf=20)
    dofs = np.flatnonzero(np.isclose(body.dof_points[free, 2], 0.0))
    force = np.random.default_rng(0).standard_normal(len(dofs))
    load = np.zeros(len(free))
    load[dofs] = force
    exact = factor.solve(load)[dofs]
    assert_allclose(Substitution(factor, dofs)(force), exact, rtol=0, atol=1e-13 * np.abs(exact).max())


def test_gmres():
    """Unsymmetric equations, from any start; what has no answer ends with its residual."""
    rng = np.random.default_rng(0)
    A, b = rng.standard_normal((40, 40)) + 8 * np.eye(40), rng.standard_normal(40)
    exact = np.linalg.solve(A, b)
    for restart in (5, 100):
        for start in (np.zeros(40), exact + 1e-3, exact):
            found = gmres(lambda x: A @ x, b, lambda r: r / 8, start, 1e-13, 200, restart)
            assert_allclose(found.x, exact, rtol=0, atol=1e-12)
            assert found.residual <= 1e-13
    singular = np.diag(np.append(np.ones(9), 0.0))
    found = gmres(lambda x: singular @ x, np.ones(10), lambda r: r, np.zeros(10), 1e-13, 50)
    assert found.residual >= 1.0
    assert gmres(lambda x: x, np.zeros(3), lambda r: r, np.zeros(3), 0.0, 10).iterations == 0


def test_gmres_begins_at_zero_where_that_is_nearer():
    """A start that leaves more than the whole load is none: its share that is enough would be all."""
    rng = np.random.default_rng(1)
    A, b = rng.standard_normal((40, 40)) + 8 * np.eye(40), rng.standard_normal(40)
    far = 1e6 * rng.standard_normal(40)
    found = gmres(lambda x: A @ x, b, lambda r: r / 8, far, 1e-13, 200, roughly=1e-2)
    assert np.linalg.norm(b - A @ found.x) <= 1e-2 * np.linalg.norm(b)
    found = gmres(lambda x: A @ x, 0.0 * b, lambda r: r / 8, far, 0.0, 200)
    assert found.enough and not found.iterations and not found.x.any()


ITERATIVE = [sc.linalg.AMG(), "iterated"]


def on_block(place=0.0, n=9, **given):
    """A block on another one, which supports hold; the lower one is larger."""
    low = rectangles.block(f"low {place}", (place - 2, place + 2), (-1, 0), (2 * n - 2, 4), D="bottom")
    up = rectangles.block(f"up {place}", (place - 1, place + 1), (0, 1), (n, 4), **given)
    rough = {"friction": sc.Coulomb(0.3), "name": f"foot {place}"}
    return [low, up], sc.Contact(up.surface("bottom"), low.surface("top"), **rough)


@pytest.mark.parametrize("linear", ITERATIVE, ids=["AMG", "iterated"])
def test_a_light_load_beside_a_heavy_one(linear):
    """Bodies that do not touch have the digits that they have alone, whatever acts on the others."""
    heavy, light = (
        on_block(place, 17, f={"top": (1e-3 * part, -1e-2 * part)})
        for place, part in ((0.0, 1.0), (9.0, 1e-8))
    )
    alone = sc.ContactSolver(light[0], light[1], linear="condensed").solve()
    both = sc.ContactSolver([*heavy[0], *light[0]], [heavy[1], light[1]], linear=linear).solve()
    size = np.abs(alone.forces).max()
    assert_allclose(both["foot 9.0"].forces, alone.forces, rtol=0, atol=1e-9 * size)


@pytest.mark.parametrize("linear", ITERATIVE, ids=["AMG", "iterated"])
def test_a_load_that_is_taken_back(linear):
    """A body that contact alone holds is let go: nothing acts, and nothing is divided by it."""
    bodies, contact = on_block()
    solver = sc.ContactSolver(bodies, contact, linear=linear)
    loads = (0.0, -0.01), (1e-3, -0.01), (0.0, 0.0)
    steps = [{"f": {"up 0.0": {"top": load}}} for load in loads]
    with pytest.warns(sc.ContactWarning, match="indifferent"):
        *_, pressed, last = solver.history(steps)
    assert pressed.force[1] > 1e-3 and last.converged and not last.forces.any()


@pytest.mark.parametrize("linear", ITERATIVE, ids=["AMG", "iterated"])
def test_layers_are_those_of_bodies(monkeypatch, linear):
    """What lies under the surfaces is the same on all pairings, and so is what springs do there."""
    made = []
    layer = internals.original("problem.Layer")
    internals.replace(monkeypatch, "problem.Layer", lambda part: made.append(part) or layer(part))
    bodies, given = on_block(f={"top": (0.0, -0.01)})
    contact = replace(given, sliding="finite")
    solver = sc.ContactSolver(bodies, contact, linear=linear)
    for result in solver.history([{"f": {"up 0.0": {"top": (4e-4 * k, -0.01)}}} for k in range(3)]):
        assert result.converged
    assert len(made) == 2


def test_memory_without_dense_matrices():
    """Beyond the factors no matrix of the size of all gaps and slips is there at any time."""
    blocks = two_blocks(12, 2)
    whole = IteratedBodies(blocks.system, blocks.stiffness, blocks.wanted)
    for part in whole.substructures:
        part.memory  # noqa: B018 (factorises)
    x = np.zeros(blocks.system.n)
    x[blocks.system.offsets[1] + blocks.system.bodies[1].D] = -0.01
    tracemalloc.start()
    problem = IteratedProblem(whole, blocks.on())
    problem.solve(conditions(blocks), problem.load(blocks.case(np.zeros_like(x), x)))
    _, most = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert blocks.kin.m == 169
    # layers of such thin bodies are factors as large as their own
    layers = sum(part.memory for part in whole.substructures)
    assert most - 2 * layers < 8 * (3 * blocks.kin.m) ** 2
