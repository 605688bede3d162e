"""Uniform states of solids (P1, P2, P6): blocks led along paths with friction, and a hollow ball.

The blocks are springs in series, shear and pressure alike at every point. What friction makes of
a path is one formula of vectors: the friction before plus the shear stiffness times the motion, drawn
back onto the circle of radius ``min(mu p, tau_max)``. Nothing is left once the blocks have parted.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
import skfem as fem
from numpy.testing import assert_allclose
from scipy.sparse import csr_matrix
from sheared_solids import sheared_pair
from skfem.helpers import dot

sys.path.insert(0, str(Path(__file__).parent.parent))
from solid_meshes import at, cube, elastic, octant_shell

import skfem_contact as sc

E_HIGH, E_LOW = 0.7, 1.0  # heights 1, nu = 0, so that G = E / 2
SOFT = 1 / E_HIGH + 1 / E_LOW  # of pressing; twice as soft in shear
WAY = np.array([np.cos(np.radians(37.0)), np.sin(np.radians(37.0))])
MESHES = [
    ("quad4", (3, 2), "mortar"),
    *(
        pytest.param(mesh, marks=pytest.mark.slow)
        for mesh in (
            ("quad4", (2, 2), "node"),
            ("tri3", (2, 3), "mortar"),
            ("quad9", (2, 3), "mortar"),
            ("tri6", (2, 2), "mortar"),
        )
    ),
]


def states(path, mu, tau_max=np.inf, k_t=np.inf):
    """Pressure, friction traction that resists, and whether it slips, along a path of (U, d)."""
    tau, last, found = np.zeros(2), np.zeros(2), []
    for U, d in path:
        p = max(d, 0.0) / SOFT
        bound = min(mu * p, tau_max) if d > 0 else 0.0
        trial = tau + (np.asarray(U) - last) / (2 * SOFT + 1 / k_t)
        size = np.linalg.norm(trial)
        slips = size > bound
        tau, last = trial * (bound / size if slips else 1.0), np.asarray(U)
        found.append((p, tau, slips))
    return found


def walk(mesh, path, mu=0.3, tau_max=np.inf, k_t=np.inf, rtol=1e-10):
    """Follow a path, and hold every point of every step to the formula; the results and the states."""
    kind, n, method = mesh
    stiffness = np.inf if np.isinf(k_t) else k_t / 4  # of four corners on one face
    law = sc.Coulomb(mu, tau_max=tau_max, stiffness=stiffness)
    # directions of friction are iterated: to more digits than by default
    solver, load = sheared_pair(kind, n, method, law, tolerance=2e-11)
    expected = states(path, mu, tau_max, k_t)
    steps = [load(U, d, tau) for (U, d), (_, tau, _) in zip(path, expected, strict=True)]
    results = list(solver.history(steps))
    size = max(mu * p for p, *_ in expected)
    for result, (p, tau, slips) in zip(results, expected, strict=True):
        share = result.area / result.area.max()  # loops end by the size of forces
        off = result.traction[:, :2] + tau
        assert np.abs(share[:, None] * off).max() <= rtol * size
        assert np.abs(share * (result.pressure - p)).max() <= rtol * size
        if p == 0:
            assert np.all(result.status == 0)
        elif np.isinf(k_t):
            assert np.all(result.status == (2 if slips else 1))
    return results, expected


D = 1e-3  # pressed down by; p = D / SOFT


def turn_of(mu, d=D):
    """Motion that shears the joint, at rest before, just to its bound."""
    return mu * d / SOFT * 2 * SOFT


@pytest.mark.parametrize("mesh", MESHES)
def test_P2a_reverse_stick_then_reverse_slip(mesh):
    """Back from slip: stick until the motion is twice the elastic one, then slip the other way."""
    u = turn_of(0.3)
    factors = (3.0, 2.0, 1.0 + 1e-4, 1.0 - 1e-4, 0.4, 0.0)
    results, expected = walk(mesh, [(f * u * WAY, D) for f in factors])
    assert [slips for *_, slips in expected] == [True, False, False, True, True, True]
    assert_allclose(results[-1].traction[:, :2] @ WAY, 0.3 * D / SOFT, rtol=1e-9)


@pytest.mark.parametrize("mesh", MESHES)
def test_P2b_slip_by_falling_pressure(mesh):
    """Nothing moves sideways: slip begins where the pressure has fallen to tau / mu."""
    u = 0.5 * turn_of(0.3)
    path = [(u * WAY, d * D) for d in (1.0, 0.5 * (1 + 1e-4), 0.5 * (1 - 1e-4), 0.2, 0.005)]
    _, expected = walk(mesh, path)
    assert [slips for *_, slips in expected] == [False, False, True, True, True]


@pytest.mark.parametrize("mesh", MESHES)
def test_P2c_the_bound_is_that_of_the_end_of_the_step(mesh):
    """Pressed and pushed in one step, more and less: mu times the pressure that there is."""
    u = turn_of(0.3)
    _, expected = walk(mesh, [(2 * u * WAY, 0.1 * D), (4 * u * WAY, D), (5 * u * WAY, 0.2 * D)])
    assert all(slips for *_, slips in expected)


@pytest.mark.parametrize("mesh", MESHES)
def test_P2d_lifting_off_forgets_friction(mesh):
    """Parted, moved by 20 times as much another way, pressed again: no shear; then it starts anew."""
    u, far = turn_of(0.3), np.array([-0.02, 0.05])
    path = [(3 * u * WAY, D), (3 * u * WAY, -D), (far, -D), (far, D)]
    path += [(far + 0.3 * u * WAY, D), (far + 3 * u * WAY, D)]
    results, expected = walk(mesh, path)
    assert_allclose(results[3].traction[:, :2], 0.0, atol=1e-10 * 0.3 * D / SOFT)
    assert [slips for *_, slips in expected[3:]] == [False, False, True]


@pytest.mark.parametrize("mesh", MESHES[:3])
@pytest.mark.parametrize("size", [0.7, 2.5])
def test_P2e_steps_do_not_matter_on_a_proportional_path(mesh, size):
    """Pressed and pushed in proportion: one step or five, sticking or slipping from the start."""
    u = size * turn_of(0.3) * WAY
    one, _ = walk(mesh, [(u, D)])
    many, _ = walk(mesh, [(u * k / 5, D * k / 5) for k in range(1, 6)])
    assert_allclose(many[-1].forces, one[-1].forces, rtol=0, atol=1e-10 * 0.3 * D / SOFT)


@pytest.mark.parametrize("mesh", MESHES)
@pytest.mark.parametrize("tau_max", [np.inf, 0.6 * 0.3 * D / SOFT])
def test_P6_a_path_that_turns(mesh, tau_max):
    """Round a square, back across it, with the pressure rising and falling; capped or not."""
    u = turn_of(0.3)
    way = [(0, 0), (2, 0), (2, 1.5), (0.5, 1.5), (0.5, -1), (1.5, 0.3), (1.4, 0.35), (0, 0)]
    down = (1.0, 1.0, 1.5, 0.5, 0.5, 2.0, 2.0, 0.7)
    path = [(u * np.array(w), d * D) for w, d in zip(way, down, strict=True)]
    _, expected = walk(mesh, path, tau_max=tau_max)
    assert {slips for *_, slips in expected} == {True, False}


@pytest.mark.parametrize(
    ("steps", "degrees"), [(5, 41.80918), pytest.param(100, 40.47505, marks=pytest.mark.slow)]
)
def test_P6_turning_between_two_blocks(steps, degrees):
    """The numbers of the turning path, saturated along x and moved along y, on meshes unlike."""
    mu = 0.3
    u = turn_of(mu)
    path = [((3 * u, 0.0), D)] + [((3 * u, u * (k + 1) / steps), D) for k in range(steps)]
    results, _ = walk(("quad4", (3, 2), "mortar"), path, mu)
    force = np.abs(results[-1].traction[:, :2].mean(axis=0))
    assert abs(np.degrees(np.arctan2(*force)) - degrees) < 5e-6  # the digits of the number


def test_P6_all_directions():
    """Every 15 degrees friction is as large, and straight against the slip."""
    mu, d = 0.3, D
    solver, load = sheared_pair("quad4", (2, 2), "node", sc.Coulomb(mu))
    pressed = solver.solve(**load((0, 0), d, np.zeros(2)))
    tau = mu * d / SOFT
    for angle in np.radians(np.arange(0, 360, 15)):
        way = np.array([np.cos(angle), np.sin(angle)])
        result = solver.solve(**load(4 * turn_of(mu) * way, d, tau * way), start=pressed)
        expected = np.tile(-tau * way, (len(result.points), 1))
        assert_allclose(result.traction[:, :2], expected, rtol=0, atol=1e-10 * tau)
        slip = result.slip_vector[:, :2]
        assert_allclose(slip, 3 * turn_of(mu) * np.tile(way, (len(slip), 1)), rtol=0, atol=1e-10 * D)


@pytest.mark.parametrize(
    ("kappa", "tau"),
    [(1e-8, 7.999999e-11), (1e-4, 7.987220e-7), (1.0, 4.705882e-4), (1e4, 4.999969e-4)],
)
def test_P2_tangential_stiffness_in_series(kappa, tau):
    """k_t = 8 kappa in series with one block, E = 1, on a rigid floor: U = 1e-3, never at the bound."""
    exact = 1e-3 / (2 + 1 / (8 * kappa))
    assert exact == pytest.approx(tau, rel=1e-6)  # the digits of the number
    law = sc.Coulomb(0.3, stiffness=8 * kappa / 4)  # of four corners
    floor = sc.RigidPlane((0, 0, 0), (0, 0, 1), name="floor")
    solver, load = sheared_pair("quad4", (1,), "node", law, E=(1.0,), partner=floor)
    result = solver.solve(**load(1e-3 * WAY, 1e-2, exact * WAY))
    expected = np.tile(-exact * WAY, (4, 1))
    assert_allclose(result.traction[:, :2], expected, rtol=0, atol=1e-10 * exact)


@pytest.mark.parametrize("kappa", [1e-4, 1.0, 1e4])
def test_P2_tangential_stiffness_between_two_blocks(kappa):
    """To and fro by a third of the bound's motion and beyond it: a spring in the series more."""
    k_t = 8 * kappa
    u = (2 * SOFT + 1 / k_t) * 0.3 * D / SOFT
    path = [(f * u * WAY, D) for f in (0.3, 0.9, 1.5, 0.5, -0.2)]
    walk(("quad4", (1, 1), "node"), path, k_t=k_t)


# -- P1: a ball in a shell ------------------------------------------------------------------------


def squeezed_ball(kind, n, law):
    """A hollow core in a shell; its inner and outer spheres are moved inwards by 3e-3 of the radius."""
    hold = tuple((at(i, 0.0), (i,)) for i in range(3))
    bodies, sides = [], []
    for inner, outer, name in ((0.5, 1.0, "core"), (1.0, 2.0, "shell")):
        mesh = octant_shell(kind, n, 2, inner, outer)
        body = elastic(mesh, kind, name, E=1e6, nu=0.25, held=hold)
        far = inner if name == "core" else outer
        rim = np.flatnonzero(np.abs(np.linalg.norm(body.dof_points, axis=1) - far) < 1e-9)
        x = np.zeros(body.n)
        x[rim] = -3e-3 * body.dof_points[rim, body.dof_component[rim]]
        D = np.union1d(body.D, rim)
        bodies.append(sc.Body(body.basis, body.form, D=D, x=x, name=name))
        on = lambda x: np.abs(np.linalg.norm(x, axis=0) - 1.0) < 1e-6  # noqa: E731
        sides.append(bodies[-1].surface(on, nodes=True))
    contact = sc.Contact(sides[1], sides[0], friction=law, method="node", name="joint")
    return bodies, sides, sc.ContactSolver(bodies, contact).solve()


@pytest.mark.parametrize("kind", ["quad4", "tri3"])
def test_P1_a_ball_in_a_shell(kind):
    """E = 1e6, nu = .25, u = -3e-3 r: pressure 6000 all over, whatever its faces look like.

    Friction holds what the forces of straight faces are out of the direction of the nodes' normals by:
    then the displacement is linear, and forces are those of a uniform pressure on the faces.
    """
    bodies, sides, result = squeezed_ball(kind, 3, sc.Coulomb(0.5))
    for body in bodies:
        exact = -3e-3 * body.dof_points[np.arange(body.n), body.dof_component]
        assert_allclose(result.displacement(body), exact, rtol=0, atol=1e-12)
    core, side = bodies[0], sides[0]
    faces = fem.FacetBasis(core.basis.mesh, core.basis.elem, facets=side.mesh_facets, intorder=6)
    exact = fem.LinearForm(lambda v, w: 6000.0 * dot(v, w.n)).assemble(faces)[side.dofs]
    # nodes on planes of symmetry press on the supports, too
    order = np.argsort(np.round(side.points, 6) @ [1e4, 1e2, 1.0])
    other = np.argsort(np.round(sides[1].points, 6) @ [1e4, 1e2, 1.0])
    inner = ~side.held.any(axis=1)[order]
    found = result.forces[other][inner]
    assert_allclose(found, exact[order][inner], rtol=0, atol=1e-9 * np.abs(exact).max())


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["quad4", "tri3"])
def test_P1_a_smooth_ball_in_a_shell(kind):
    """Without friction straight faces are a polyhedron: 6000 in the mean, by order 2."""
    errors = []
    for n in (3, 6):
        _, _, result = squeezed_ball(kind, n, None)
        errors.append(abs(np.average(result.pressure, weights=result.area) / 6000 - 1))
    assert errors[0] < 0.03 and np.log2(errors[0] / errors[1]) > 1.8


# -- P3: a pad that slides against weak springs ------------------------------------------------------


@pytest.mark.parametrize("loop", ["newton", "direct"])
@pytest.mark.parametrize(
    "angle", [30.0, *(pytest.param(a, marks=pytest.mark.slow) for a in (0.0, 200.0))]
)
@pytest.mark.parametrize("share", [0.99, 1.01])
def test_P3_a_pad_held_by_weak_springs_and_friction(share, angle, loop):
    """Pushed by .99 mu N it sticks, by 1.01 mu N it slides as far as the springs along the push allow.

    Across the push, and against turning, nothing but the friction of points that slip holds it.
    """
    mu, N = 0.3, 1e-3
    way = np.array([np.cos(np.radians(angle)), np.sin(np.radians(angle)), 0.0])
    mesh = cube("quad4", 3, lambda x: x * np.array([[1.0], [1.0], [0.2]]))
    plain = elastic(mesh, "quad4", "pad", E=1e4)
    nodes = plain.basis.nodal_dofs[:, np.isclose(mesh.p[2], 0.2)]
    stiff = 1e-2 / nodes.shape[1]  # a millionth of E times the length, in all
    springs = np.zeros((plain.n, 1))
    blocks = [
        csr_matrix((way[:2], (dofs[:2], np.zeros(2, dtype=int))), shape=springs.shape)
        for dofs in nodes.T
    ]
    K = plain.K + sum(stiff * (v @ v.T) for v in blocks)
    pad = sc.Body(plain.basis, K, name="pad")
    f = np.zeros(pad.n)
    low = plain.basis.nodal_dofs[:, np.isclose(mesh.p[2], 0.0)]
    f[nodes[2]] = -N / nodes.shape[1]
    f[low] += share * mu * N / low.shape[1] * way[:, None]
    floor = sc.RigidPlane((0, 0, 0), (0, 0, 1), name="floor")
    foot = pad.surface(at(2, 0.0))
    contact = sc.Contact(foot, floor, friction=sc.Coulomb(mu, stiffness=np.inf))
    result = sc.ContactSolver(pad, contact, loop=loop).solve({"pad": f})
    assert_allclose(result.force[2], N, rtol=1e-10)
    u = result.displacement("pad")[nodes].T @ way
    if share < 1:
        assert np.abs(u).max() < 1e-6  # some may slip under their own pressure; the pad does not
        return
    assert np.all(result.status == 2)
    # strains are a thousandth of the slip, by which directions differ from point to point
    assert_allclose(result.force, np.append(-mu * N * way[:2], N), rtol=0, atol=1e-6 * N)
    assert u.mean() == pytest.approx((share - 1) * mu * N / 1e-2, rel=1e-4)
