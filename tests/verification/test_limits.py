"""Limits of what contact carries: found, told, in the time of a step; and friction in tiny ones."""

from __future__ import annotations

import internals
import numpy as np
import pytest
import skfem as fem
from numpy.testing import assert_allclose
from quick_elasticity import linear_elasticity
from skfem.models.elasticity import lame_parameters

import skfem_contact as sc


def squeezed(n, mu=0.3, approach=0.01, **settings):
    """A cube between two plates at a fixed approach, and a body force that pulls it sideways.

    The force is the nominal friction: what the normal forces can bear that are there without it.
    """
    mesh = fem.MeshHex.init_tensor(*[np.linspace(0, 1, n + 1)] * 3).with_boundaries(
        {"low": lambda x: x[2] == 0, "high": lambda x: x[2] == 1}
    )
    basis = fem.Basis(mesh, fem.ElementVector(fem.ElementHex1()))
    body = sc.Body(basis, linear_elasticity(*lame_parameters(1.0, 0.25)), name="cube")
    plates = sc.RigidPlane((0, 0, 0), (0, 0, 1)), sc.RigidPlane((0, 0, 1 - approach), (0, 0, -1))
    contacts = [
        sc.Contact(body.surface(side), plate, friction=sc.Coulomb(mu), name=side)
        for side, plate in zip(("low", "high"), plates, strict=True)
    ]
    solver = sc.ContactSolver(body, contacts, **settings)
    pull = fem.LinearForm(lambda v, w: v[0]).assemble(basis)
    start = solver.solve(f=0 * pull)
    pressed = sum(start[side].normal_force.sum() for side in ("low", "high"))
    return solver, start, mu * pressed * pull


def told(error):
    """The share that a refusal says is carried."""
    return float(str(error).split("carries up to ")[1].split()[0])


@pytest.fixture
def starts(monkeypatch):
    """Where the attempts of all load steps began."""
    real, seen = internals.original("history.Stepper.attempt"), []

    def attempt(self, to, problem, start):
        seen.append(start)
        return real(self, to, problem, start)

    internals.replace(monkeypatch, "history.Stepper.attempt", attempt)
    return seen


def test_a_refused_load_is_told_its_share(starts):
    """A cube on 32 points slips before the load is reached: refused at once, with what it carries; just
    below that it is answered, just above refused."""
    solver, start, pull = squeezed(3)
    starts.clear()
    with pytest.raises(sc.errors.NotConverged, match="move on without carrying more") as refused:
        solver.solve(f=1.05 * pull, start=start)
    assert starts == ["warm", "pulled"]
    limit = told(refused.value) * 1.05
    assert limit == pytest.approx(0.9529, abs=2e-4)
    below = solver.solve(f=(limit - 2e-4) * pull, start=start)
    assert below.converged and below.certificate.worst < 1e-9
    assert all((below[side].status == 2).all() for side in ("low", "high"))
    with pytest.raises(sc.errors.NotConverged):
        solver.solve(f=(limit + 5e-4) * pull, start=start)


def test_what_is_carried_is_a_share_of_the_step():
    """Told from a state that carries half of the limit already, the share is that of the rest."""
    solver, start, pull = squeezed(3)
    start = solver.solve(f=0.5 * pull, start=start)
    with pytest.raises(sc.errors.NotConverged) as refused:
        solver.solve(f=1.5 * pull, start=start)
    assert 0.5 + told(refused.value) == pytest.approx(0.9529, abs=1e-3)


def pushed(share, **settings):
    """A block on a floor under a pressure, and a share of the friction that it can bear sideways."""
    mesh = fem.MeshHex.init_tensor(
        np.linspace(0, 1, 5), np.linspace(0, 1, 5), np.linspace(0, 0.5, 3)
    ).with_boundaries({"under": lambda x: x[2] == 0, "over": lambda x: x[2] == 0.5})
    basis = fem.Basis(mesh, fem.ElementVector(fem.ElementHex1()))
    body = sc.Body(basis, linear_elasticity(*lame_parameters(1.0, 0.3)), name="block")
    floor = sc.RigidPlane((0, 0, 0), (0, 0, 1))
    foot = sc.Contact(body.surface("under"), floor, friction=sc.Coulomb(0.3), name="foot")
    return sc.ContactSolver(body, foot, **settings), {"over": (share * 0.3 * 0.01, 0.0, -0.01)}


def plane_block(angle=0.0, size=0.5, n=4, material=(1.0, 0.25), **settings):
    """A block of width 1 in the plane, turned about the origin, and its basis."""
    side = np.linspace(0, 1, n + 1)
    mesh = fem.MeshQuad.init_tensor(side, size * side).with_boundaries(
        {"under": lambda x: x[1] == 0, "over": lambda x: x[1] == size}
    )
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    mesh = fem.MeshQuad(turn @ mesh.p, mesh.t, _boundaries=mesh.boundaries)
    basis = fem.Basis(mesh, fem.ElementVector(fem.ElementQuad1()))
    return sc.Body(basis, linear_elasticity(*lame_parameters(*material)), **settings)


def uniform(body, *force):
    """A body force, as a vector of its degrees of freedom, of this resultant."""
    whole = fem.LinearForm(lambda v, w: sum(f * c for f, c in zip(force, v, strict=True)))
    f = whole.assemble(body.basis)
    return f / np.hypot(*f[body.basis.nodal_dofs].sum(axis=1)) * np.hypot(*force)


@pytest.mark.parametrize("method", ["node", "mortar"])
@pytest.mark.parametrize("angle", [0.2, 0.31, 0.5])
def test_a_slope_carries_its_share_in_the_plane(angle, method):
    """Pressed on a slope and then left to its weight: it slides where tan(angle) is more than mu.

    Of that step it slides from the share s on at which s sin(angle) = mu (1 - s (1 - cos(angle))).
    """
    mu, weight = 0.3, 1e-3
    floor = plane_block(angle, -0.5, D="over", name="floor")
    block = plane_block(angle, name="block")
    foot = sc.Contact(
        block.surface("under"), floor.surface("under"), method=method, friction=sc.Coulomb(mu)
    )
    solver = sc.ContactSolver([block, floor], foot)
    pressed = uniform(block, weight * np.sin(angle), -weight * np.cos(angle))
    start = solver.solve(f={"block": pressed})
    heavy = {"f": {"block": uniform(block, 0.0, -weight)}, "start": start}
    if np.tan(angle) < mu:
        assert solver.solve(**heavy).converged
        return
    with pytest.raises(sc.errors.NoEquilibrium, match="move on without carrying more") as refused:
        solver.solve(**heavy)
    share = mu / (np.sin(angle) + mu * (1 - np.cos(angle)))
    assert told(refused.value) == pytest.approx(share, abs=2e-4)


@pytest.mark.parametrize("factor", [1.05, 2.0])
def test_plates_carry_their_share_in_the_plane(factor):
    """A block under a plate with a force N, on a floor, pulled sideways: held by 2 mu N."""
    mu, N = 0.3, 5e-3
    block = plane_block(name="block")
    floor = sc.RigidPlane((0, 0), (0, 1), name="floor")
    plate = sc.RigidBody(
        sc.RigidPlane((0.5, 0.5), (0, -1)), force=(0, -N), D=("x", "rotation"), name="plate"
    )
    contacts = [
        sc.Contact(block.surface(side), tool, friction=sc.Coulomb(mu), name=side)
        for side, tool in (("under", floor), ("over", plate))
    ]
    solver = sc.ContactSolver([block, plate], contacts)
    start = solver.solve()
    with pytest.raises(sc.errors.NoEquilibrium, match="move on without carrying more") as refused:
        solver.solve(f={"block": uniform(block, factor * 2 * mu * N, 0.0)}, start=start)
    assert factor * told(refused.value) == pytest.approx(1.0, abs=3e-4)
    assert solver.solve(f={"block": uniform(block, 0.999 * 2 * mu * N, 0.0)}, start=start).converged


@pytest.mark.parametrize("share", [1.0, 1.0 + 1e-9, 1.001])
def test_a_load_at_the_bound_is_decided_at_once(share, starts):
    """A load on the friction bound to round-off, and beyond it by more: 132 starts in halved steps."""
    solver, load = pushed(share)
    try:
        result = solver.solve(f={"block": load})
        assert result.certificate.worst < 1e-9
    except (sc.errors.NotConverged, sc.errors.NoEquilibrium) as error:
        assert "carries up to" not in str(error)  # of the pressure alone nothing is left over
    assert len(starts) <= 11


def test_no_part_is_carried():
    """Pressed and pushed at once, beyond the bound however small the load: no part of it is carried."""
    solver, load = pushed(1.1)
    with pytest.raises(
        (sc.errors.NotConverged, sc.errors.NoEquilibrium), match=r"carries no part|no force at the"
    ):
        solver.solve(f={"block": load})


def test_below_the_limit_nothing_changes(starts):
    """Steps that Newton takes are not pulled, and end where they did."""
    solver, start, pull = squeezed(3)
    once = solver.solve(f=0.94 * pull, start=start)
    assert "pulled" not in starts
    only, begun, _ = squeezed(3, options=sc.Options(max_cuts=0))
    again = only.solve(f=0.94 * pull, start=begun)
    assert_allclose(once.u, again.u, rtol=0, atol=1e-14)


def test_the_machine_finds_the_answer(monkeypatch):
    """Where all other starts fail, the state that carries the whole load is the answer of the step."""
    solver, start, pull = squeezed(3)
    known = solver.solve(f=0.94 * pull, start=start)
    alone, begun, _ = squeezed(3)
    internals.replace(monkeypatch, "history.Stepper.starts", ("pulled",))
    found = alone.solve(f=0.94 * pull, start=begun)
    assert found.converged and found.certificate.worst < 1e-9
    assert_allclose(found.u, known.u, rtol=0, atol=1e-9 * np.abs(known.u).max())


@pytest.mark.parametrize(("n", "share"), [(3, 0.9529), (6, 0.9627)])
def test_shares_of_finer_meshes(n, share):
    """The share that a cube between plates carries, on 32 and 98 points, told at twice the load too."""
    solver, start, pull = squeezed(n)
    for factor in (1.0, 2.0):
        with pytest.raises(sc.errors.NotConverged) as refused:
            solver.solve(f=factor * pull, start=start)
        assert factor * told(refused.value) == pytest.approx(share, abs=3e-4)


def test_friction_is_along_slips_however_small():
    """Loads that change by a thousandth let few points slip, by little: where Newton's method weighs
    their slips by what the points resist, friction is off its direction by 2e-7 of the largest one."""
    side = np.linspace(0, 1, 7)
    mesh = fem.MeshHex.init_tensor(side, side, np.linspace(0, 0.5, 4)).with_boundaries(
        {"under": lambda x: x[2] == 0, "over": lambda x: x[2] == 0.5}
    )
    basis = fem.Basis(mesh, fem.ElementVector(fem.ElementHex1()))
    body = sc.Body(basis, linear_elasticity(*lame_parameters(1.0, 0.3)), name="block")
    floor = sc.RigidPlane((0, 0, 0), (0, 0, 1))
    foot = sc.Contact(body.surface("under"), floor, friction=sc.Coulomb(0.3), name="foot")
    over = fem.FacetBasis(mesh, basis.elem, facets="over")
    turned = fem.LinearForm(lambda v, w: v[1] + 0.3 * v[0] * w.x[1]).assemble(basis) * 0.02
    press = fem.LinearForm(lambda v, w: -0.01 * v[2]).assemble(over)
    push = fem.LinearForm(lambda v, w: 0.01 * v[0]).assemble(over)
    rng = np.random.default_rng(1)
    loads = [press]
    for _ in range(12):
        along, across = rng.uniform(-0.8, 0.8, 2) * 10.0 ** -rng.integers(0, 5, 2)
        loads.append(press + 0.3 * (along * push + 0.5 * across * turned))
    solver = sc.ContactSolver(body, foot)
    worst = [r.certificate.friction for r in solver.history([{"f": {"block": f}} for f in loads])]
    assert max(worst) < 1e-9
