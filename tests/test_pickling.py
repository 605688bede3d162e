"""Solvers and results in other processes: pickled, they give the same answers and reports."""

from __future__ import annotations

import pickle
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context

import numpy as np
import pytest
import skfem as fem
from numpy.testing import assert_allclose, assert_array_equal
from quick_elasticity import linear_elasticity
from rectangles import rectangle
from skfem.models.elasticity import lame_parameters

import skfem_contact as sc
from skfem_contact.answers import answer_of


def again(thing):
    """What arrives of something in another process."""
    return pickle.loads(pickle.dumps(thing))


def one(x):
    """A thickness that pickle finds by its name."""
    return 1.0 + 0.0 * x[0]


def half_bowl(x):
    """A level set that pickle finds by its name."""
    return x[1] - 0.1 * (x[0] - 0.5) ** 2 + 1e-4


def two_blocks(*, floats=False, measure=None, linear="auto", **contact):
    """A block on another one; held and moved at its top, or loaded there."""
    low = rectangle(np.linspace(-0.5, 1.5, 15), np.linspace(-1, 0, 6))
    top = rectangle(np.linspace(0, 1, 9), np.linspace(0, 0.5, 5))
    form = linear_elasticity(*lame_parameters(1e3, 0.3))
    x = np.zeros(top.N)
    x[top.nodal_dofs] = [[0.002], [-0.001]]
    load = fem.LinearForm(lambda v, w: 0.1 * v[0] - v[1]).assemble(top.boundary("top"))
    bodies = [
        sc.Body(low, form, D="bottom", name="low", measure=measure),
        sc.Body(
            top,
            form,
            f=load if floats else None,
            D=None if floats else "top",
            x=None if floats else x,
            name="top",
            measure=measure,
        ),
    ]
    contact.setdefault("friction", sc.Coulomb(0.3))
    touching = sc.Contact(
        bodies[1].surface("bottom"), bodies[0].surface("top"), name="joint", **contact
    )
    return sc.ContactSolver(bodies, touching, linear=linear)


def on_level_set():
    """A block on a rigid bowl that follows it."""
    basis = rectangle(np.linspace(0, 1, 9), np.linspace(0, 0.5, 5))
    x = np.zeros(basis.N)
    x[basis.nodal_dofs] = [[0.002], [-0.001]]
    body = sc.Body(basis, linear_elasticity(1.0, 1.0), D="top", x=x, name="top")
    bowl = sc.obstacles.LevelSet(half_bowl, name="bowl")
    contact = sc.Contact(
        body.surface("bottom"), bowl, friction=sc.Coulomb(0.2), sliding="finite", name="joint"
    )
    return sc.ContactSolver(body, contact)


SCENES = {
    "small": two_blocks,
    "floating": lambda: two_blocks(floats=True),
    "finite": lambda: two_blocks(sliding="finite"),
    "frictionless": lambda: two_blocks(friction=None),
    "tied": lambda: two_blocks(friction=None, tied=True),
    "node": lambda: two_blocks(method="node", friction=sc.Coulomb(0.3, tau_max=1.0)),
    "sparse": lambda: two_blocks(linear=sc.linalg.Direct()),
    "measure": lambda: two_blocks(measure=one),
    "functions": lambda: two_blocks(
        measure=lambda x: 1.0 + 0.0 * x[0],
        interference=lambda x: 1e-4 * x[0],
        gap=lambda x: 0.0 * x[0],
    ),
    "follows": lambda: two_blocks(
        interference=lambda x: 1e-4 * x[0], gap=lambda x: 1e-5 + 0.0 * x[0], sliding="finite"
    ),
    "level set": on_level_set,
}


def report(result):
    """The printed report without its last lines, the times."""
    return result.report().split("\n\n")[:-1]


@pytest.mark.parametrize("name", SCENES)
def test_results_and_solvers_arrive_whole(name):
    """The same report, displacements and fields; the copied solver goes on with the same answers."""
    solver = SCENES[name]()
    first, second = solver.history([0.5, 1.0])
    copied = again(first)
    assert report(copied) == report(first)
    assert_array_equal(copied.u, first.u)
    for field in ("pressure", "traction", "slip", "gap", "status", "points", "area"):
        assert_array_equal(getattr(copied, field), getattr(first, field))
    with pytest.raises(ValueError, match="read-only"):
        copied.u[0] = 1.0
    # recovered once more by the other side, from the contact forces
    assert_allclose(answer_of(copied).recover(), first.u, atol=1e-13)
    fresh = again(solver)
    for start in (first, copied):
        [other] = fresh.history([1.0], start=start)
        scale = np.abs(second.forces).max()
        assert_allclose(other.forces, second.forces, atol=1e-11 * scale)
        assert_allclose(other.u, second.u, atol=1e-13)


def test_bodies_travel_without_their_factors():
    """A pickled solver or result is as large as its bodies, not as their factors."""
    solver = two_blocks()
    before = len(pickle.dumps(solver))
    result = solver.solve()
    factors = sum(size.memory for size in solver.sizes().values())
    assert factors > 100_000
    assert len(pickle.dumps(solver)) < before + 0.1 * factors  # names and numbers of points
    # a result adds its vectors; what its estimate has found of surfaces and bodies, these keep
    travels = len(pickle.dumps(result))
    assert travels < len(pickle.dumps(solver)) + 0.1 * factors
    assert travels < before + factors
    assert "bodies" in vars(solver.linear_model)  # the one at home keeps them


def test_what_is_left_behind_says_so():
    """A measure that is a lambda is missed only where it is needed, and then in words."""
    solver = again(two_blocks(measure=lambda x: 1.0 + x[0]))
    assert solver.solve().converged  # areas are known
    with pytest.raises(
        sc.errors.InputError, match=r"measure of body 'top' is a function .* left behind"
    ):
        solver.system.bodies[1].surface("left")
    sliding = again(two_blocks(measure=lambda x: 1.0 + x[0], sliding="finite"))
    with pytest.raises(sc.errors.InputError, match="left behind"):
        sliding.solve()
    user = again(two_blocks(linear=lambda A, b: fem.solve(A, b)))
    with pytest.raises(sc.errors.InputError, match="linear is a function that was left behind"):
        user.solve()


def test_failures_arrive_with_their_results():
    """What a worker raises comes back with the message, the last state and the results before it."""
    solver = two_blocks(floats=True)
    with pytest.raises(sc.errors.NoEquilibrium) as failure:
        list(solver.history([0.5, {"f": {"top": -1.0}}]))
    copied = again(failure.value)
    assert str(copied) == str(failure.value) and copied.bodies == failure.value.bodies
    assert len(copied.results) == 1 and copied.results[0].converged
    assert_array_equal(copied.results[0].pressure, failure.value.results[0].pressure)


def solved(solver, mu):
    """A task of a pool."""
    return solver.with_friction(sc.Coulomb(mu)).solve()


@pytest.mark.slow
def test_process_pool():
    """Coefficients of friction in processes: as one after the other."""
    solver = two_blocks()
    coefficients = [0.1, 0.4]
    with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as pool:
        found = list(pool.map(solved, [solver] * 2, coefficients))
    for mu, result in zip(coefficients, found, strict=True):
        expected = solved(solver, mu)
        assert_allclose(result.forces, expected.forces, atol=1e-12)
        assert_allclose(result.displacement("top"), expected.displacement("top"), atol=1e-14)
