"""Energy lost by friction: closed forms, steps of any size, and the balance of energies."""

from __future__ import annotations

import contextlib

import numpy as np
import pytest
import skfem as fem
from numpy.testing import assert_allclose
from scenes import block_basis, elastic, field
from scipy.sparse import coo_matrix
from sliding_scenes import rectangle

import skfem_contact as sc
from skfem_contact.answers import answer_of

# coefficient, stiffness of a spring, overlap, way
MU, k, P, S = 0.3, 2.0, 0.02, 0.4


def spring_sliders(law, sliding="small", loop="newton"):
    """Nodes on a plane, each pulled by springs of its own, upright and along: rigid blocks.

    The upper edge of a row of squares moves; every node below hangs on the one above it alone.
    """
    basis = rectangle(np.linspace(0, 1, 5), np.linspace(0, 0.25, 2))
    low, up = basis.get_dofs("bottom").flatten(), basis.get_dofs("top").flatten()
    order = [np.lexsort(basis.doflocs[:1, d]) for d in (low, up)]
    low, up = low[order[0]], up[order[1]]
    one = np.full(len(low), k)
    rows, columns = np.concatenate([low, up, low, up]), np.concatenate([low, up, up, low])
    K = coo_matrix((np.concatenate([one, one, -one, -one]), (rows, columns))).tocsr()
    block = sc.Body(basis, K, D="top", name="block")
    floor = sc.RigidPlane((0, 0), (0, 1), name="floor")
    contact = sc.Contact(block.surface("bottom"), floor, friction=law, sliding=sliding)
    # no limit to the slip of a step: what is asked is what a single step gives
    solver = sc.ContactSolver(block, contact, loop=loop, options=sc.Options(max_travel=np.inf))

    def step(along, down):
        x = field(basis, lambda x: np.stack([along + 0 * x[0], -down + 0 * x[0]]))
        return {"x": {"block": np.where(np.isin(np.arange(basis.N), up), x, 0.0)}}

    return solver, step


LAWS = {
    "Coulomb": (sc.Coulomb(MU), lambda area: MU * k * P),
    "cohesion": (sc.Coulomb(MU, cohesion=0.01), lambda area: MU * k * P + 0.01 * area),
    "capped": (sc.Coulomb(MU, tau_max=0.008), lambda area: np.minimum(MU * k * P, 0.008 * area)),
    "Tresca": (sc.Tresca(0.01), lambda area: 0.01 * area),
}


@pytest.mark.pairwise
@pytest.mark.parametrize("N", [1, 2, 4])
@pytest.mark.parametrize("sliding", ["small", "finite"])
@pytest.mark.parametrize("name", LAWS)
def test_rigid_blocks_under_constant_pressure(name, sliding, N):
    """Bound times slip, from rest and for a reversal, in any number of steps; each step is exact.

    A block slips by the way of its spring's end less the spring's extension ``L / k``; at the turn
    the spring first springs back from one extension to the other.
    """
    law, bound = LAWS[name]
    solver, step = spring_sliders(law, sliding)
    there, back = np.linspace(0, S, N + 1)[1:], np.linspace(S, -S, N + 1)[1:]
    results = list(solver.history([step(0.0, P), *(step(a, P) for a in [*there, *back])]))
    L = np.broadcast_to(bound(results[0].area), (5,))
    assert_allclose(np.abs(results[-1].tangential_force[:, 0]), L, rtol=1e-12)
    assert results[0].dissipation == 0.0
    first, second = results[N].dissipation_total, sum(r.dissipation for r in results[N + 1 :])
    # each node to round-off of some sums
    assert_allclose(first, np.sum(L * (S - L / k)), rtol=1e-10)
    assert_allclose(second, np.sum(L * (2 * S - 2 * L / k)), rtol=1e-10)
    assert_allclose(results[-1].dissipation_total, first + second, rtol=1e-12)


@pytest.mark.parametrize("loop", ["newton", "direct"])
def test_rigid_blocks_with_springs_in_the_contact(loop):
    """With a finite tangential stiffness only the plastic slip counts: the springs give theirs back."""
    G = 50.0
    solver, step = spring_sliders(sc.Coulomb(MU, stiffness=G), loop=loop)
    _, one, back = solver.history([step(0.0, P), step(S, P), step(-S, P)])
    L, series = MU * k * P, k * G / (k + G)
    # 1e-8: the limits of `direct` lag by its tolerance
    assert_allclose(one.dissipation, 5 * L * (S - L / series), rtol=1e-8)
    assert_allclose(back.dissipation, 5 * L * (2 * S - 2 * L / series), rtol=1e-8)


@pytest.mark.parametrize("N", [1, 2, 5])
def test_proportional_load_of_rigid_blocks(N):
    """Pressure and way grow together: half of the last bound times slip, in any number of steps."""
    solver, step = spring_sliders(sc.Coulomb(MU))
    results = list(solver.history([step(S * i / N, P * i / N) for i in range(1, N + 1)]))
    L = MU * k * P
    assert_allclose(results[-1].dissipation_total, 5 * 0.5 * L * (S - L / k), rtol=1e-10)
    # force and slip on a straight path: the balance of energies has nothing to miss
    assert_allclose([r.energy_residual for r in results], 0.0, atol=1e-12 * L * S)


def test_what_the_balance_misses_is_said():
    """A reversal in one step: the mean of the forces is zero, the residual is all that was lost."""
    solver, step = spring_sliders(sc.Coulomb(MU))
    _, one, back = solver.history([step(0.0, P), step(S, P), step(-S, P)])
    assert_allclose(back.energy_residual, -back.dissipation, rtol=1e-12)
    assert_allclose(one.energy_residual, -0.5 * one.dissipation, rtol=1e-12)
    assert "energy balance misses    -0.0473 in this step" in str(back)


def energies(result, last, K):
    """Work of all loads by the trapezoidal rule and elastic energy, of a step, from K and u alone.

    What K u asks for beside the contact forces is load or support.
    """
    zero = np.zeros(len(result.u))
    u, outside = [zero], [zero]
    for r in (last, result):
        if r is None:
            continue
        contact = (
            answer_of(r).kin.B_n.T @ answer_of(r).local.normal_force
            - answer_of(r).kin.B_t.T @ answer_of(r).local.tangential_force.ravel()
        )
        u.append(r.u)
        outside.append(K @ r.u - contact)
    work = 0.5 * (outside[-1] + outside[-2]) @ (u[-1] - u[-2])
    return work, 0.5 * (u[-1] @ (K @ u[-1]) - u[-2] @ (K @ u[-2]))


@pytest.mark.every_value
@pytest.mark.parametrize("method", ["mortar", "node"])
@pytest.mark.parametrize("seed", range(6))
def test_balance_of_random_steps(method, seed):
    """Whatever opens, closes, sticks, slips or turns: no step gains energy, and the balance closes.

    Two blocks whose meshes do not match, a wedge of a gap between them, random ways and turns of the
    upper one in steps so large that the zone of contact changes by half.
    """
    rng = np.random.default_rng(seed)
    low = block_basis(np.linspace(-0.5, 3.5, 17), np.linspace(-1, 0, 5))
    top = block_basis(np.linspace(0, 3, 10), np.linspace(0, 1, 5))
    bodies = [
        sc.Body(low, elastic(1.0, 0.3), D="bottom", name="low"),
        sc.Body(top, elastic(5.0, 0.2), D="top", name="top"),
    ]
    contact = sc.Contact(
        bodies[1].surface("bottom"),
        bodies[0].surface("top"),
        friction=sc.Coulomb(0.4, cohesion=1e-4 * (seed % 2)),
        gap=lambda x: 2e-3 * x[0],
        method=method,
    )
    solver = sc.ContactSolver(bodies, [contact])
    steps = []
    for a, b, turn in rng.uniform(-1, 1, (8, 3)):
        move = field(
            top, lambda x, a=a, b=b, c=turn: [5e-3 * a + 0 * x[0], 5e-3 * (b - 1 + c * (x[0] - 1.5))]
        )
        steps.append({"x": {"top": move}})
    last, events = None, 0
    for result in solver.history(steps):
        assert "cut" not in result.message  # the balance is that of the ends of a step
        work, strain = energies(result, last, solver.system.K)
        scale = abs(work) + abs(strain) + result.dissipation
        assert result.dissipation >= 0.0
        # linear elasticity and the trapezoidal rule leave nothing: round-off
        missing = work - strain - result.dissipation - result.energy_residual
        assert abs(missing) <= 1e-11 * scale
        before = np.zeros(len(result.status)) if last is None else last.status
        events += np.sum((before == 0) != (result.status == 0))
        last = result
    assert events > 10 and last.dissipation_total > 0


@pytest.mark.slow
def test_random_stacks_never_gain_energy():
    """Random stacks of two and three bodies, loaded, reversed and released: no step below zero."""
    lost, missed = [], []
    for seed in range(5):
        with contextlib.suppress(sc.errors.NoEquilibrium, sc.errors.NotConverged):
            for result in random_stack(seed):
                lost.append(result.dissipation)
                missed.append(result.energy_residual)
    assert min(lost) >= 0.0 and len(lost) > 10
    # the work of the mean force, which was shown before, is below zero in some of them
    assert min(np.add(lost, missed)) < 0.0


def random_stack(seed):
    """Slabs upon each other under random pressures and shears, friction with caps and cohesion."""
    rng = np.random.default_rng(seed)
    bodies, contacts, height = [], [], 0.0
    for i in range(rng.integers(2, 4)):
        nx, x0, x1 = rng.integers(4, 10), -0.5 * rng.random() - 0.1 * (3 - i), 2 + 0.1 * (3 - i)
        basis = rectangle(np.linspace(x0, x1, nx + 1), np.linspace(height, height + 0.5, 3))
        E = 10.0 ** rng.uniform(0, 3)
        load = np.zeros(basis.N)
        if i:
            edge = basis.boundary("top")
            load = fem.LinearForm(lambda v, w: -v[1] + 0.2 * v[0] * np.sin(3 * w.x[0])).assemble(edge)
        name = f"slab {i}"
        bodies.append(
            sc.Body(basis, elastic(E, 0.3), f=load, D="bottom" if i == 0 else None, name=name)
        )
        if i:
            law = sc.Coulomb(rng.uniform(0.2, 0.8), tau_max=rng.choice([np.inf, 0.5]), cohesion=0.05)
            contacts.append(
                sc.Contact(bodies[i].surface("bottom"), bodies[i - 1].surface("top"), friction=law)
            )
        height += 0.5
    solver = sc.ContactSolver(bodies, contacts)
    factors = [1.0, rng.uniform(0.1, 0.5), rng.uniform(0.8, 2.0), 0.1]
    side = {b.name: rng.uniform(-0.3, 0.3) * np.abs(b.f).sum() / b.n for b in bodies}
    steps = [
        {"f": {b.name: a * b.f + (-1) ** j * side[b.name] * (b.dof_component == 0) for b in bodies[1:]}}
        for j, a in enumerate(factors)
    ]
    return solver.history(steps)


def pressed_punch():
    """The scene of the README with mu = 0.1, the punch pressed and not pushed."""

    def basis(x0, x1, y0, y1, nx, ny):
        return rectangle(np.linspace(x0, x1, nx + 1), np.linspace(y0, y1, ny + 1))

    low, top = basis(-20, 20, -20, 0, 40, 20), basis(-5, 5, 0, 10, 14, 14)
    press = fem.LinearForm(lambda v, w: -100 * v[1]).assemble(top.boundary("top"))
    block = sc.Body(low, elastic(210e3, 0.3), D="bottom", name="block")
    punch = sc.Body(top, elastic(210e3, 0.3), f=press, name="punch")
    contact = sc.Contact(punch.surface("bottom"), block.surface("top"), friction=sc.Coulomb(0.1))
    return sc.ContactSolver([block, punch], [contact])


def test_press_and_release():
    """No step gives energy back, and the total tends to that of small steps, not to nothing."""
    lost, missed = {}, {}
    for n in (1, 5, 20, 100):
        # not quite released: what is left on nothing but friction is another question
        way = [*np.linspace(0, 1, n + 1)[1:], *np.linspace(1, 1e-3, n + 1)[1:]]
        results = list(pressed_punch().history(way))
        assert min(r.dissipation for r in results) > 0.0
        lost[n] = results[-1].dissipation_total
        missed[n] = abs(sum(r.energy_residual for r in results))
    assert_allclose(lost[100], 0.0444, rtol=0, atol=5e-5)  # the digits that are known
    errors = [abs(lost[n] / lost[100] - 1) for n in (1, 5, 20)]
    assert errors[0] < 0.5 and errors[1] < 0.02 and errors[2] < 2e-3  # second order in the step
    # and the residual knows: it is larger than the error, and falls with it
    assert all(missed[n] > abs(lost[n] - lost[100]) for n in (1, 5, 20))
    assert missed[1] > 10 * missed[5] > 50 * missed[20]
