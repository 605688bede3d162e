"""What a result keeps, and what is recovered only when somebody asks for it."""

from __future__ import annotations

import gc
import types

import numpy as np
import pytest
import rectangles
import skfem as fem
from numpy.testing import assert_allclose

import skfem_contact as sc
from skfem_contact.answers import answer_of
from skfem_contact.history import recover_all


def block(nx, **given):
    """A block with nx elements along its lower edge."""
    return rectangles.block(y=(0.0, 0.5), n=(nx, 4), E=1e3, **({"D": "top"} | given))


def solver_of(nx, **contact):
    """The block on a plane, moved down and along."""
    body = block(nx)
    floor = sc.RigidPlane((0, 0), (0, 1), name="floor")
    return sc.ContactSolver(body, sc.Contact(body.surface("bottom"), floor, **contact))


def step(solver, along, down):
    """A step that moves the upper edge."""
    body = solver.system.bodies[0]
    x = np.zeros(body.n)
    x[body.D] = np.where(body.dof_component[body.D] == 0, along, -down)
    return {"x": {"block": x}}


def arrays(root, stop=()):
    """All arrays that an object keeps alive, by id, but for those beyond `stop`."""
    seen, found, waiting = set(stop), {}, [root]
    while waiting:
        thing = waiting.pop()
        if id(thing) in seen or isinstance(thing, type | types.ModuleType | types.FunctionType):
            continue
        seen.add(id(thing))
        if isinstance(thing, np.ndarray):
            found[id(thing)] = thing
        waiting.extend(gc.get_referents(thing))
    return found, seen


@pytest.mark.parametrize("friction", [None, sc.Coulomb(0.3)])
def test_many_results_at_once_are_what_each_is_alone(friction):
    """The forces that displacements follow from are the same to the last bit, however many."""
    steps = [step(solver_of(8), 1e-3 * k, 1e-2) for k in range(1, 4)]
    one, other = (list(solver_of(8, friction=friction).history(steps)) for _ in range(2))
    recover_all([answer_of(result) for result in one])
    for a, b in zip(one, other, strict=True):
        alone, together = answer_of(b).recover, answer_of(a).recover
        assert "source" in vars(together)
        np.testing.assert_array_equal(together.source.values, alone.source.values)
        # one factor and other blocks of right-hand sides: round-off
        assert_allclose(a.u, b.u, rtol=0, atol=1e-14 * np.abs(b.u).max())


def test_a_result_of_finite_sliding_keeps_no_dense_matrix():
    """What results hold beside what their solver holds grows with the points, not their square."""
    sizes = []
    for nx in (32, 128):
        solver = solver_of(nx, friction=sc.Coulomb(0.3), sliding="finite")
        steps = [step(solver, a, 1e-3) for a in (0.0, 0.005, 0.01)]
        result = list(solver.history(steps))[1]
        _, shared = arrays(solver)
        own, _ = arrays(result, stop=shared)
        sizes.append(sum(array.nbytes for array in own.values() if array.base is None))
        assert result.uniqueness is not None  # it is made anew where it is asked for
    # four times the points, and as many DOFs: some vectors of each
    assert sizes[1] < 5 * sizes[0]
    assert sizes[1] < 200 * 8 * 129


@pytest.mark.parametrize("sliding", ["small", "finite"])
def test_pressure_recovers_no_interior(sliding):
    """Without friction too, only slip and displacements are worth the interior."""
    solver = solver_of(16, sliding=sliding)
    result = next(solver.history([step(solver, 0.01, 1e-3)]))
    assert_allclose(result.force[0], 0.0, atol=1e-12)
    assert result.pressure.min() > 0 and result.contact_area == pytest.approx(1.0)
    assert np.all(result.status == 2) and np.all(result.gap == 0.0)
    assert "u" not in vars(answer_of(result))
    # the lower edge follows the upper one, which moves along by 0.01, as far as it does not bulge
    slip = np.einsum("ik,ikd->id", result.slip, result.tangent)
    assert_allclose(np.mean(slip[:, 0]), 0.01, rtol=1e-3)
    assert "u" in vars(answer_of(result))


@pytest.mark.parametrize("held", [True, False], ids=["held", "floating"])
@pytest.mark.parametrize("sliding", ["small", "finite"])
def test_displacements_from_the_contact_forces(held, sliding):
    """Recovered from loads and contact forces alone they satisfy K u = f + forces, and the gaps."""
    if held:
        solver = solver_of(12, friction=sc.Coulomb(0.3), sliding=sliding)
        result = next(solver.history([step(solver, 0.01, 1e-3)]))
    else:
        body = block(12, D=None)
        edge = body.basis.boundary("top")
        load = fem.LinearForm(lambda v, w: 0.1 * v[0] - (1 + w.x[0]) * v[1]).assemble(edge)
        floor = sc.RigidPlane((0, 0), (0, 1), name="floor")
        contact = sc.Contact(body.surface("bottom"), floor, friction=sc.Coulomb(0.3), sliding=sliding)
        solver = sc.ContactSolver(body, contact)
        result = solver.solve({"block": load})
    kin, state, K = answer_of(result).kin, answer_of(result).local, solver.system.K
    residual = K @ result.u - answer_of(result).case.f
    residual -= kin.B_n.T @ state.normal_force - kin.B_t.T @ state.tangential_force.ravel()
    residual[solver.system.D] = 0.0
    scale = np.abs(abs(K) @ np.abs(result.u)).max()
    assert np.abs(residual).max() < 1e-13 * scale
    moved = answer_of(result).seen.gap0 + kin.B_n @ result.u
    assert np.abs(moved[result.status != 0]).max() < 1e-14
