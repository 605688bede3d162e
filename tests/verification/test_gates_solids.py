"""Closed forms in three dimensions: patch and shear of two blocks, spheres turned and pushed."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
import skfem as fem
from numpy.testing import assert_allclose

sys.path.insert(0, str(Path(__file__).parent.parent))
from solids import KINDS, at, cube, elastic, elastic_form

import skfem_contact as sc
from skfem_contact.answers.answer import answer_of
from skfem_contact.reference import (
    cattaneo_mindlin,
    hertz_point,
    mindlin_compliance,
    mindlin_dissipation,
)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(("n", "method"), [((1, 1), "node"), ((1, 1), "mortar"), ((2, 3), "mortar")])
def test_P1_two_cubes_of_SSNV167(n, method, kind):
    """Two cubes of 2 mm, E = 200 000 MPa, nu = 0, pressed by 0.2 mm: -0.1 mm and 10 000 MPa between."""
    cubes = []
    for k, low, name in ((n[0], 0.0, "high"), (n[1], -2.0, "low")):
        mesh = cube(kind, k, lambda x, low=low: 2 * x + np.array([[-1.0], [-1.0], [low]]))
        far = at(2, 2.0 if name == "high" else -2.0)
        push = (far, (0.0, 0.0, -0.2)) if name == "high" else None
        cubes.append(elastic(mesh, kind, name, E=2e5, nu=0.0, held=((far, (0, 1, 2)),), push=push))
    sides = [body.surface(at(2, 0.0)) for body in cubes]
    result = sc.ContactSolver(cubes, sc.Contact(*sides, method=method)).solve()
    assert_allclose(result.pressure, 1e4, rtol=1e-10)
    for body, side in zip(cubes, sides, strict=True):
        assert_allclose(result.displacement(body)[side.dofs[:, 2]], -0.1, rtol=1e-10)
    if n == (1, 1) and kind in ("quad4", "quad8", "quad9"):
        # forces of a uniform pressure on one face: of 8 nodes -1/12 at corners, 1/3 at middles
        forces = answer_of(result).kin.B_n.T @ result.normal_force
        found = forces[sides[0].dofs[:, 2]][sides[0].facets[0]] / 4e4
        corner, middle, centre = {
            "quad4": (1 / 4, None, None),
            "quad8": (-1 / 12, 1 / 3, None),
            "quad9": (1 / 36, 1 / 9, 4 / 9),
        }[kind]
        assert_allclose(found[:4], corner, rtol=1e-9)
        if middle:
            assert_allclose(found[4:8], middle, rtol=1e-9)
        if centre:
            assert_allclose(found[8:], centre, rtol=1e-9)


P2 = {  # U, tau_max, tau, slip of the whole joint
    "stick": (3e-4, np.inf, 6.1764705882e-5, 0.0),
    "slip": (3e-3, np.inf, 2.0588235294e-4, 2.0e-3),
    "cap": (3e-3, 1e-4, 1e-4, 2.51428571429e-3),
}


def near(axis, value, scale):
    """As `at`, within a part of a length."""
    return lambda x: np.abs(x[axis] - value) < 1e-6 * scale


def sheared_pair(kind, n, method, law, E=(0.7, 1.0), size=(1.0, 1.0, 1.0)):
    """Two blocks of a size, nu = 0; and how their sides are loaded for a uniform shear."""
    cubes, sides, loads, size = [], [], [], np.array(size)
    for k, modulus, name in zip(n, E, ("high", "low"), strict=True):
        low = 0.0 if name == "high" else -1.0
        mesh = cube(kind, k, lambda x, low=low: size[:, None] * (x + np.array([[0.0], [0.0], [low]])))
        basis = fem.Basis(mesh, fem.ElementVector(KINDS[kind][2]()), intorder=4)
        D = basis.get_dofs(near(2, size[2] if low == 0 else -size[2], size[2])).all()
        cubes.append(sc.Body(basis, elastic_form(modulus, 0.0), D=D, name=name))
        sides.append(cubes[-1].surface(near(2, 0.0, size[2])))
        across = []
        for axis in (0, 1):
            first, last = (
                fem.LinearForm(lambda v, w: v[2]).assemble(
                    fem.FacetBasis(mesh, basis.elem, facets=mesh.facets_satisfying(end), intorder=4)
                )
                for end in (near(axis, 0.0, size[axis]), near(axis, size[axis], size[axis]))
            )
            across.append(last - first)
        loads.append(across)
    contact = sc.Contact(*sides, friction=law, method=method)
    solver = sc.ContactSolver(cubes, contact)

    def load(U, d, tau):
        """The top moved along (x, y) and down; tau is the shear traction on it, (2,)."""
        x = np.zeros(cubes[0].n)
        D, component = cubes[0].D, cubes[0].dof_component[cubes[0].D]
        for i, value in enumerate((*U, -d)):
            x[D[component == i]] = value
        f = {
            body.name: sum(t * side for t, side in zip(tau, across, strict=True))
            for body, across in zip(cubes, loads, strict=True)
        }
        return {"x": {"high": x}, "f": f}

    return solver, load


@pytest.mark.parametrize("case", P2)
@pytest.mark.parametrize("angle", [0.0, 37.0])
@pytest.mark.parametrize(
    ("kind", "n", "method"),
    [("quad4", (2, 2), "node"), ("quad4", (3, 2), "mortar"), ("tri3", (2, 3), "mortar")]
    + [pytest.param("quad9", (2, 3), "mortar", marks=pytest.mark.slow)],
)
def test_P2_numbers(kind, n, method, angle, case):
    """Uniform shear between two blocks that do not match: stick, slip and cap, in any direction."""
    U, cap, tau, slip = P2[case]
    solver, load = sheared_pair(kind, n, method, sc.Coulomb(0.5, tau_max=cap))
    way = np.array([np.cos(np.radians(angle)), np.sin(np.radians(angle))])
    result = solver.solve(**load(U * way, 1e-3, tau * way))
    assert_allclose(result.pressure, 4.1176470588e-4, rtol=1e-9)  # the digits of the numbers
    expected = np.tile(-tau * way, (len(result.points), 1))
    assert_allclose(result.traction[:, :2], expected, rtol=0, atol=1e-9 * tau)
    found = np.linalg.norm(result.slip_vector, axis=1)
    assert_allclose(found, slip, rtol=1e-9, atol=1e-12)


def graded(end, h, fine, ratio):
    """Coordinates from 0 to `end`: steps h up to `fine`, growing beyond."""
    even = h * np.arange(round(fine / h) + 1)
    count = max(int(np.log1p((end - fine) * (ratio - 1) / (h * ratio)) / np.log(ratio)), 1)
    growing = np.cumsum(ratio ** np.arange(1, count + 1))
    return np.concatenate([even, even[-1] + (end - even[-1]) * growing / growing[-1]])


def block_under_ball(across, law, nu=0.3):
    """A block, E = 1, under a rigid ball of radius 50 with a circle of contact of about 1."""
    h = 1 / across
    x = graded(6.0, h, 1.2, 1.7)
    x = np.append(-x[:0:-1], x)
    mesh = fem.MeshHex.init_tensor(x, x, -graded(6.0, h, 0.6, 1.7)[::-1])
    held = ((at(2, -6.0), (0, 1, 2)),)
    block = elastic(mesh, "quad4", "block", nu=nu, held=held)
    ball = sc.RigidSphere((0, 0, 50.0), 50.0, name="ball")
    contact = sc.Contact(block.surface(at(2, 0.0)), ball, friction=law, name="joint")
    return sc.ContactSolver([block], contact)


DOWN = 0.018


def test_torque_of_a_ball_that_spins():
    """Slipping everywhere under Hertz's pressure, a ball is turned by 3 pi / 16 mu P a."""
    mu = 0.3
    solver = block_under_ball(5, sc.Coulomb(mu))
    steps = [
        {"motion": {"joint": ((0, 0, -DOWN), (0, 0, angle), (0, 0, 50.0))}}
        for angle in (0.0, 0.02, 0.04)
    ]
    pressed, *turned = solver.history(steps)
    assert pressed.force[2] < 0
    P = -turned[-1].force[2]  # friction in pressing had made it a little larger
    a = hertz_point(P, 50.0, 1 / (1 - 0.3**2)).a
    values = turned[-1]["joint"]
    closed = values.normal_force > 0
    assert np.all(values.status[closed & (np.hypot(*values.points[:, :2].T) > 1e-9)] == 2)
    torque = abs(values.moment((0, 0, 0))[2])
    # every point at its bound, square to its arm but for what is left of the friction of pressing
    arm = np.hypot(*values.points[:, :2].T)
    assert torque == pytest.approx(mu * float(values.normal_force @ arm), rel=1e-3)
    assert torque == pytest.approx(3 * np.pi / 16 * mu * P * a, rel=0.01)


@pytest.mark.parametrize(
    "share", [0.5, *(pytest.param(s, marks=pytest.mark.slow) for s in (0.25, 0.75))]
)
def test_H8_a_cap_under_full_sliding(share):
    """Friction min(mu p, tau_max): Q / (mu P) = 1.5 s - 0.5 s^3 with s = tau_max / (mu p0)."""
    mu = 0.3
    p0 = hertz_point(2.9e-2, 50.0, 1 / (1 - 0.3**2)).p0
    for _ in range(2):  # the cap for the pressure that there is
        cap = share * mu * p0
        solver = block_under_ball(5, sc.Coulomb(mu, tau_max=cap))
        steps = [{"motion": {"joint": (way, 0, -DOWN)}} for way in (0.0, 0.01, 0.02)]
        *_, result = solver.history(steps)
        P = -result.force[2]
        p0 = hertz_point(P, 50.0, 1 / (1 - 0.3**2)).p0
    values = result["joint"]
    pressure = values.normal_force / values.area
    exact = float(np.minimum(mu * pressure, cap) @ values.area)
    bound = np.linalg.norm(values.tangential_force_vector, axis=1)
    assert_allclose(bound.sum(), exact, rtol=1e-10)
    assert exact == pytest.approx(
        (1.5 * share - 0.5 * share**3) * mu * P, rel=0.03
    )  # five elements on a


def half_blocks(across, mu, R):
    """Halves of two blocks alike, E = 1, cut along y = 0, with the gap of a ball between them."""
    h = 1 / across
    y, z = graded(6.0, h, 1.3, 1.6), graded(6.0, h, 0.6, 1.6)
    bodies = []
    for name, z_lines, far in (("high", z, 6.0), ("low", -z[::-1], -6.0)):
        mesh = fem.MeshHex.init_tensor(np.append(-y[:0:-1], y), y, z_lines)
        held = ((at(2, far), (0, 1, 2)), (at(1, 0.0), (1,)))
        bodies.append(elastic(mesh, "quad4", name, held=held))
    contact = sc.Contact(
        *(body.surface(at(2, 0.0)) for body in bodies),
        friction=sc.Coulomb(mu),
        gap=lambda x: (x[0] ** 2 + x[1] ** 2) / (2 * R),
    )
    return bodies, sc.ContactSolver(bodies, contact)


@pytest.mark.slow
def test_H6_mindlin():
    """A ball pushed to and fro: the circle of stick, the traction, and the work lost in a loop."""
    mu, R, across = 0.4, 100.0, 6
    (high, _), solver = half_blocks(across, mu, R)
    top = np.flatnonzero(np.isclose(high.dof_points[:, 2], 6.0))

    def step(push):
        x = np.zeros(high.n)
        x[top[high.dof_component[top] == 0]] = push
        x[top[high.dof_component[top] == 2]] = -0.0095
        return {"x": {"high": x}}

    side, there = 0.0042, np.linspace(-1, 1, 13)[1:]
    way = [0.0, *(side * np.linspace(0, 1, 7)[1:]), *(-side * there), *(side * there)]
    results = list(solver.history([step(push) for push in way]))
    P = 2 * results[0].force[2]
    exact = hertz_point(P, R, 1 / (2 * (1 - 0.3**2)))
    assert exact.a == pytest.approx(1.0, abs=0.1)
    r = np.hypot(*results[0].points[:, :2].T)
    turn = results[6]
    share = abs(turn.force[0] / (mu * turn.force[2]))
    assert 0.5 < share < 0.95
    c = exact.a * (1 - share) ** (1 / 3)
    area = turn["contact 1"].area
    radius = np.sqrt(2 * area[turn.status == 1].sum() / np.pi)
    assert abs(radius - c) < 1 / across
    # the traction along the push, against that of full sliding; across it next to nothing
    theory = cattaneo_mindlin(exact, mu, mu * P * share).traction(r)
    found = np.abs(turn.traction[:, 0])
    full = np.sqrt(area @ (mu * exact.pressure(r)) ** 2)
    assert np.sqrt(area @ (found - theory) ** 2) / full < 0.6 / across
    assert np.sqrt(area @ turn.traction[:, 1] ** 2) / full < 0.03
    # the loop from the first turn, of both halves; and it closes
    lost = 2 * (results[-1].dissipation_total - turn.dissipation_total)
    compliance = mindlin_compliance(1 / 2.6, 0.3, 1 / 2.6, 0.3)
    theory = mindlin_dissipation(exact, mu, mu * P * share, compliance)
    assert lost == pytest.approx(theory, rel=0.08)
    last = results[-1].traction - turn.traction
    assert np.abs(last[:, 0]).max() < 2e-3 * mu * exact.p0
    # across the push directions go on turning for a few loops, by less and less
    assert np.abs(last[:, 1]).max() < 2e-2 * mu * exact.p0


@pytest.mark.slow
def test_H3_two_balls():
    """R = 50 both, E = 20 000, nu = 0.3, approach 0.25: radius and peak for the force there is."""
    R, h = 50.0, 0.4
    y = graded(30.0, h, 3.2, 1.5)
    bodies, sides = [], []
    for sign, name in ((1.0, "high"), (-1.0, "low")):
        z = graded(30.0, h, 1.2, 1.5)
        mesh = fem.MeshHex.init_tensor(y, y, z if sign > 0 else -z[::-1])
        p = mesh.p.copy()
        p[2] += sign * (1 - np.abs(p[2]) / 30) * (p[0] ** 2 + p[1] ** 2) / (2 * R)
        far = at(2, 30.0 * sign)
        faces = mesh.facets_satisfying(at(2, 0.0))
        mesh = fem.MeshHex(p, mesh.t)
        held = ((at(0, 0.0), (0,)), (at(1, 0.0), (1,)), (far, (2,)))
        push = (far, (0.0, 0.0, -0.125 * sign))
        bodies.append(elastic(mesh, "quad4", name, E=2e4, held=held, push=push))
        sides.append(bodies[-1].surface(faces, name="side"))
    result = sc.ContactSolver(bodies, sc.Contact(*sides)).solve()
    F = 4 * result.force[2]
    exact = hertz_point(F, R / 2, 2e4 / (2 * (1 - 0.3**2)))
    # SSNV104 with its small approach: 9157.5, a = 2.5; blocks of 12 a are stiffer than half spaces
    assert pytest.approx(9157.5, rel=0.12) == F and exact.a == pytest.approx(2.5, rel=0.04)
    r = np.hypot(*result.points[:, :2].T)
    width = np.sqrt(2.5 * (result.normal_force @ r**2) / result.normal_force.sum())
    assert width == pytest.approx(exact.a, rel=0.02)
    assert result.pressure[np.argmin(r)] == pytest.approx(exact.p0, rel=0.02)
