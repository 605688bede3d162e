"""Friction with a material direction, through the public interface: closed forms, and a judge.

The judge is written down from the ellipse and the associated rule, in global axes; it knows nothing of
scaled slips.
"""

from __future__ import annotations

import sys
from itertools import pairwise, product
from pathlib import Path

import numpy as np
import pytest
import skfem as fem
from quick_elasticity import linear_elasticity
from scipy.integrate import quad
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation
from skfem.models.elasticity import lame_parameters

sys.path.insert(0, str(Path(__file__).parent.parent))
sys.path.insert(0, str(Path(__file__).parent))
from solid_meshes import at, cube, elastic, onto_octant
from test_solid_friction import FLOOR, Sheared, ring

import skfem_contact as sc
from skfem_contact.answers import answer_of
from skfem_contact.conditions import escape

LOOPS = ("newton", "direct", "fictitious")
SLOW = pytest.mark.slow
MU = (0.1, 0.3)


def along(degrees):
    """A horizontal unit vector."""
    return np.array([np.cos(np.radians(degrees)), np.sin(np.radians(degrees)), 0.0])


def squares(mu, grain, normal=(0.0, 0.0, 1.0)):
    """The tensor ``sum mu_i^2 d_i d_i'`` in global axes, (3, 3)."""
    across = np.cross(normal, grain)
    return mu[0] ** 2 * np.outer(grain, grain) + mu[1] ** 2 * np.outer(across, across)


def resisting(mu, grain, slip):
    """Friction over normal force that resists a slip, by the associated rule."""
    M = squares(mu, grain)
    return M @ slip / np.sqrt(slip @ M @ slip)


class Grooved(Sheared):
    """A cube with nu = 0 on a plane with a grain, under uniform pressure and shear."""

    def __init__(self, mu, grain, kind="quad4"):
        super().__init__(kind, 0.0)
        self.law = sc.conditions.OrthotropicCoulomb(mu, grain)

    def solver(self, **settings):
        contact = sc.Contact(self.foot, FLOOR, friction=self.law, name="joint")
        return sc.ContactSolver(self.block, contact, **settings)


@pytest.mark.parametrize(
    "angle, grain, kind",
    [
        (90, 0, "quad4"),
        (30, 50, "quad4"),
        *(pytest.param(*case, "quad4", marks=SLOW) for case in ((0, 0), (45, 0), (-110, 20))),
        *(pytest.param(*case, "quad9", marks=SLOW) for case in ((160, 75), (30, 50))),
        *(pytest.param(*case, "tri3", marks=SLOW) for case in ((160, 75), (30, 50))),
    ],
)
def test_a_block_dragged_any_way(angle, grain, kind):
    """Friction is on the ellipse where its normal is along the slip, and so turned from it."""
    block, slip, d = Grooved(MU, along(grain), kind), 0.05 * along(angle), along(grain)
    friction = 0.01 * resisting(MU, d, slip)
    solver = block.solver()
    pressed = solver.solve(**block.load((0, 0), (0, 0)))
    moved = slip + friction / block.G  # of height 1
    values = solver.solve(**block.load(moved[:2], -friction[:2]), start=pressed)["joint"]
    count = (len(values.points), 1)
    np.testing.assert_allclose(
        values.traction, np.tile([*-friction[:2], 0.01], count), rtol=0, atol=1e-11
    )
    np.testing.assert_allclose(values.slip_vector, np.tile(slip, count), rtol=0, atol=1e-11)
    # along the grain and across it
    across = np.array([-d[1], d[0], 0.0])
    np.testing.assert_allclose(values.slip, np.tile([slip @ d, slip @ across], count), atol=1e-11)
    # the pressure is the same all the way: what is lost is force times way, exactly
    assert values.dissipation == pytest.approx(friction @ slip, rel=1e-9)


def nearest_on_ellipse(tau, axes):
    """The point of an ellipse about the origin that is nearest to one outside of it."""
    squared = np.asarray(axes) ** 2

    def outside(stretch):
        return np.sum((tau / (1 + stretch / squared)) ** 2 / squared) - 1

    if outside(0.0) <= 0:
        return tau
    return tau / (1 + brentq(outside, 0.0, 1e3, xtol=1e-16, rtol=1e-15) / squared)


@pytest.mark.parametrize("loop", ["newton", pytest.param("direct", marks=SLOW)])
def test_a_turning_path(loop):
    """Slipping along x, then moved along y: every step is the nearest point of the ellipse."""
    block = Grooved((0.3, 0.15), (1, 0, 0))
    axes = np.array([0.3, 0.15]) * block.p
    solver = block.solver(loop=loop)
    way = [block.load((0, 0), (0, 0)), block.load((0.05, 0), (-axes[0], 0))]
    tau, taus = np.array([axes[0], 0.0]), []
    for k in range(5):
        tau = nearest_on_ellipse(tau + [0.0, axes[0] / 5], axes)
        taus.append(tau)
        way.append(block.load((0.05, (k + 1) / 5 * axes[0] / block.G), -tau))
    results = list(solver.history(way))
    tolerance = 1e-9 if loop == "newton" else 1e-2  # its springs are 1000 times as stiff, or a quarter
    for tau, result in zip(taus, results[2:], strict=True):
        found = result["joint"].traction[:, :2]
        np.testing.assert_allclose(
            found, np.tile(-tau, (len(found), 1)), rtol=0, atol=tolerance * axes[0]
        )


@SLOW
@pytest.mark.parametrize("loop", LOOPS)
def test_torque_of_a_turning_ring(loop):
    """Turned by far more than it strains, a ring resists by the ellipse's mean round the circle.

    That is ``mean of sqrt(mu_1^2 sin^2 + mu_2^2 cos^2)`` times the mean radius times the force, but for
    pressures that friction moves as the ring has a height; and exactly by the forces that press.
    """
    p, mu, mesh = 1e-7, (0.2, 0.4), ring(3)
    basis = fem.Basis(mesh, fem.ElementVector(fem.ElementHex1()), intorder=4)
    top = basis.get_dofs(lambda x: np.isclose(x[2], 0.5))
    sides = fem.FacetBasis(mesh, basis.elem, facets=mesh.facets_satisfying(at(2, 0.5)), intorder=4)
    load = fem.LinearForm(lambda v, w: -p * v[2]).assemble(sides)
    D = [top.all(["u^1"]), top.all(["u^2"])]
    form = linear_elasticity(*lame_parameters(1.0, 0.0))
    body = sc.Body(basis, form, load, D=np.concatenate(D), name="foot")
    law = sc.conditions.OrthotropicCoulomb(mu, along(25))
    contact = sc.Contact(body.surface(at(2, 0.0)), FLOOR, friction=law, name="joint")
    x = np.zeros(basis.N)
    x[D[0]], x[D[1]] = -1e-2 * basis.doflocs[1, D[0]], 1e-2 * basis.doflocs[0, D[1]]
    solver = sc.ContactSolver(body, contact, loop=loop)
    values = list(solver.history([{"x": {"foot": 0 * x}}, {"x": {"foot": x}}]))[-1]["joint"]
    force, moment = values.force, values.moment()
    mean = quad(lambda a: np.hypot(mu[0] * np.sin(a), mu[1] * np.cos(a)), 0, 2 * np.pi)[0] / (2 * np.pi)
    # 14/9: mean of r^2 over that of r between the radii 1 and 2
    assert abs(-moment[2] / (14 / 9 * mean * force[2]) - 1) < 1e-3
    ways = np.cross([0.0, 0.0, 1.0], values.points)
    friction = -np.array([resisting(mu, along(25), way) for way in ways])
    friction *= values.normal_force[:, None]
    # strains are a millionth of the turn
    np.testing.assert_allclose(values.tangential_force_vector, friction, rtol=0, atol=1e-5 * p)
    assert moment[2] == pytest.approx(np.cross(values.points, friction)[:, 2].sum(), rel=1e-6)


def pushed_block(law, loop="newton"):
    """A block that stands on friction alone, and a load on its top as a function of its direction."""
    mesh = cube("quad4", 3, lambda x: x * [[1.0], [1.0], [0.5]])
    block = elastic(mesh, "quad4", "block", press=(at(2, 0.5), (0.0, 0.0, -1e-3)))
    contact = sc.Contact(block.surface(at(2, 0.0)), FLOOR, friction=law, name="joint")
    sides = fem.FacetBasis(
        mesh, block.basis.elem, facets=mesh.facets_satisfying(at(2, 0.5)), intorder=4
    )

    def load(fx, fy):
        form = fem.LinearForm(lambda v, w: 1e-3 * (fx * v[0] + fy * v[1] - v[2]))
        return {"block": form.assemble(sides)}

    return sc.ContactSolver(block, contact, loop=loop), load


@pytest.mark.parametrize("angle", [35.0, *(pytest.param(a, marks=SLOW) for a in (0.0, 90.0, 130.0))])
def test_a_released_block_slides_at_the_ellipse(angle):
    """Pushed in any direction it holds up to the ellipse in that direction, and no further."""
    law, way = sc.conditions.OrthotropicCoulomb((0.4, 0.2), along(20)), along(angle)
    most = 1 / np.sqrt(way @ np.linalg.pinv(squares((0.4, 0.2), along(20))) @ way)
    solver, load = pushed_block(law)
    pressed = solver.solve(f=load(0.0, 0.0))
    held = solver.solve(f=load(*0.98 * most * way[:2]), start=pressed)
    np.testing.assert_allclose(held.force[:2], -0.98e-3 * most * way[:2], rtol=0, atol=1e-12)
    assert held.certificate.worst < 1e-9
    with pytest.raises(sc.errors.NoEquilibrium, match="no force at the contact points can stop"):
        solver.solve(f=load(*1.02 * most * way[:2]), start=pressed)


def turns(old, new):
    """Smallest rotations between unit vectors, as rotation vectors."""
    axis = np.cross(old, new)
    sine = np.linalg.norm(axis, axis=1)[:, None]
    return axis * np.arcsin(sine) / np.where(sine > 0, sine, 1.0)


def violation(law, grain, result, before, name="joint"):
    """Largest distance of friction from the ellipse and its normal, over the largest force.

    `before` is the result of the step before; slips of points that were open begin where they closed.
    """
    new, old = result[name], before[name]
    largest = new.normal_force.max()
    # where contact slides far the slip so far has turned with the normal
    turn = [Rotation.from_rotvec(a) for a in turns(old.normal, new.normal)]
    so_far = np.array([t.apply(s) for t, s in zip(turn, old.slip_vector, strict=True)])
    moved = new.slip_vector - np.where((old.status != 0)[:, None], so_far, 0.0)
    worst, far = 0.0, np.abs(moved).max()
    for i in np.flatnonzero(new.status != 0):
        force, tau = new.normal_force[i], -new.tangential_force_vector[i]
        d = grain - (grain @ new.normal[i]) * new.normal[i]
        M = squares(law, d / np.linalg.norm(d), new.normal[i])
        reached = np.sqrt(tau @ np.linalg.pinv(M) @ tau)  # of the normal force
        worst = max(worst, min(law) * (reached - force) / largest)
        if new.status[i] == 2:
            s = moved[i]
            if np.linalg.norm(s) > 1e-6 * far:
                lawful = force * M @ s / np.sqrt(s @ M @ s)
                # the fewer digits a slip has, the fewer has its direction
                worst = max(worst, np.linalg.norm(tau - lawful) / largest * np.linalg.norm(s) / far)
        else:
            worst = max(worst, np.linalg.norm(moved[i]) / far * largest / largest)
    return worst


def two_blocks(law, method="mortar", sliding="small", apart=0.0, **settings):
    """A block pressed onto a larger one whose mesh does not match, and led to and fro.

    `apart` is a distance between their meshes that does not count.
    """
    low = cube("quad4", 3, lambda x: x * [[1.6], [1.6], [0.5]] + [[-0.3], [-0.3], [-0.5]])
    base = elastic(low, "quad4", "base", held=((at(2, -0.5), (0, 1, 2)),), push=(at(2, -0.5), (0,) * 3))
    high = cube("quad4", 3, lambda x: x * [[1.0], [1.0], [0.5]] + [[0.0], [0.0], [apart]])
    block = elastic(high, "quad4", "block", held=((at(2, 0.5 + apart), (0, 1, 2)),))
    joint = sc.Contact(
        block.surface(at(2, apart)),
        base.surface(at(2, 0.0)),
        friction=law,
        method=method,
        sliding=sliding,
        gap=0.0 if apart else None,
        name="joint",
    )
    return sc.ContactSolver([base, block], joint, **settings)


WAY = ((0, 0, -0.01), (0.003, 0.001, -0.01), (0.003, 0.005, -0.012), (0.001, 0.002, -0.008))


def led(solver, way=WAY):
    """The results on a way of the top of the block."""
    return list(solver.history([{"x": {"block": lifted(solver, at)}} for at in way]))


def lifted(solver, shift):
    block = solver.system.bodies[1]
    x = np.zeros(block.n)
    x[block.D] = np.asarray(shift)[block.dof_component[block.D]]
    return x


GRAIN = np.array([0.8, 0.5, 0.3])  # what is along the normals does not count
WAYS = {
    "mortar": {},
    "node": {"method": "node"},
    "iterated": {"linear": "iterated"},
    "sparse": {"linear": sc.linalg.Direct()},
    "multigrid": {"linear": sc.linalg.AMG(tol=1e-12)},
    "finite": {"sliding": "finite"},
    "finite by node": {"sliding": "finite", "method": "node"},
}


@pytest.mark.parametrize(
    "name", ["mortar", *(pytest.param(name, marks=SLOW) for name in WAYS if name != "mortar")]
)
def test_the_judge_agrees(name):
    """Every point of every answer is where the ellipse lets it be, by every route and pairing."""
    law = (0.1, 0.4)
    results = led(two_blocks(sc.conditions.OrthotropicCoulomb(law, GRAIN), **WAYS[name]))
    for before, result in pairwise(results):
        assert violation(law, GRAIN, result, before) < 1e-8
        assert result.certificate.worst < 1e-7
        assert 0 < (result.status == 2).sum() < len(result.status)
        assert result["joint"].dissipation > 0
    if name in ("iterated", "sparse", "multigrid"):
        other = led(two_blocks(sc.conditions.OrthotropicCoulomb(law, GRAIN)))
        for one, two in zip(results, other, strict=True):
            np.testing.assert_allclose(one.u, two.u, rtol=0, atol=1e-9 * np.abs(two.u).max())


@SLOW
def test_all_loops_find_the_same():
    """With a stiffness of sticking, which the loop fictitious needs: 1e-9 of the displacements."""
    law = sc.conditions.OrthotropicCoulomb((0.1, 0.4), GRAIN, stiffness=2.0)
    newton, *others = (led(two_blocks(law, loop=loop)) for loop in LOOPS)
    assert (newton[1].status == 1).any() and (newton[1].status == 2).any()
    for results in others:
        for one, two in zip(newton, results, strict=True):
            np.testing.assert_allclose(one.u, two.u, rtol=0, atol=1e-9 * np.abs(one.u).max())


@pytest.mark.parametrize("sliding", ["small", pytest.param("finite", marks=SLOW)])
def test_equal_coefficients_are_coulombs(sliding):
    """Whatever the direction: to the last bit, or but for the round-off of what is carried over."""
    one = led(two_blocks(sc.Coulomb(0.3), sliding=sliding))
    two = led(two_blocks(sc.conditions.OrthotropicCoulomb((0.3, 0.3), GRAIN), sliding=sliding))
    for a, b in zip(one, two, strict=True):
        if sliding == "small":
            np.testing.assert_array_equal(a.u, b.u)
        np.testing.assert_allclose(a.u, b.u, rtol=0, atol=1e-12 * np.abs(a.u).max())
        np.testing.assert_allclose(a.slip_vector, b.slip_vector, rtol=0, atol=1e-14)
        assert a["joint"].dissipation == pytest.approx(b["joint"].dissipation, rel=1e-9)


@SLOW
def test_axes_exchanged_and_turned_round():
    """Coefficients exchanged and the direction turned by 90 degrees, or its sign: the same law."""
    law = sc.conditions.OrthotropicCoulomb((0.1, 0.4), GRAIN)
    across = np.cross([0, 0, 1.0], GRAIN)
    ours = led(two_blocks(law))
    for other in (
        sc.conditions.OrthotropicCoulomb((0.4, 0.1), across),
        sc.conditions.OrthotropicCoulomb((0.1, 0.4), -7.0 * GRAIN),
        sc.conditions.OrthotropicCoulomb(
            np.full((16, 2), (0.1, 0.4)), lambda x: GRAIN[:, None] + 0 * x
        ),
    ):
        for a, b in zip(ours, led(two_blocks(other)), strict=True):
            np.testing.assert_allclose(a.u, b.u, rtol=0, atol=1e-12 * np.abs(a.u).max())


@SLOW
def test_the_whole_scene_rotated():
    """Block, floor, motion and grain turned together: so are slips and forces."""
    found = []
    for turn in (np.eye(3), Rotation.from_rotvec([0.4, -0.7, 1.1]).as_matrix()):
        mesh = cube("quad4", 3)
        basis = fem.Basis(
            fem.MeshHex(turn @ mesh.p, mesh.t), fem.ElementVector(fem.ElementHex1()), intorder=2
        )
        D = np.flatnonzero(np.isclose((turn.T @ basis.doflocs)[2], 1.0))
        block = sc.Body(basis, linear_elasticity(*lame_parameters(1.0, 0.3)), D=D, name="block")
        foot = block.surface(lambda x, turn=turn: np.isclose((turn.T @ x)[2], 0.0))
        law = sc.conditions.OrthotropicCoulomb((0.4, 0.15), turn @ GRAIN)
        plane = sc.RigidPlane((0, 0, 0), turn[:, 2])
        solver = sc.ContactSolver(block, sc.Contact(foot, plane, friction=law, name="joint"))
        x = np.zeros(basis.N)
        steps = []
        for shift in WAY:
            x[D] = (turn @ shift)[block.dof_component[D]]
            steps.append({"x": {"block": x.copy()}})
        found.append([(turn.T @ r.slip_vector.T, turn.T @ r.traction.T) for r in solver.history(steps)])
    for one, two in zip(*found, strict=True):
        np.testing.assert_allclose(one, two, rtol=0, atol=1e-10)
    assert np.abs(found[0][1][0]).max() > 1e-3


@pytest.mark.filterwarnings("ignore:.*over the length of one facet")  # few faces are enough here
@pytest.mark.parametrize("kind", ["tri3", pytest.param("quad9", marks=SLOW)])
@pytest.mark.parametrize("sliding", [pytest.param("small", marks=SLOW), "finite"])
def test_a_ball_turned_in_its_socket(sliding, kind):
    """On a curved surface the direction is projected onto every tangent plane."""
    law, grain = (0.1, 0.3), np.array([1.0, -1.0, 0.2])
    mesh = cube(kind, 3 if kind == "tri3" else 2, onto_octant)
    core = ((lambda x: np.linalg.norm(x, axis=0) < 0.51, (0, 1, 2)),)
    ball = elastic(mesh, kind, "ball", held=core)
    surface = ball.surface(lambda x: np.isclose(np.linalg.norm(x, axis=0), 1.0), nodes=True)
    socket = sc.RigidSphere((0, 0, 0), 1.0, hollow=True, name="socket")
    contact = sc.Contact(
        surface,
        socket,
        friction=sc.conditions.OrthotropicCoulomb(law, grain),
        sliding=sliding,
        name="joint",
    )
    steps = []
    for push, angle in ((0.01, 0.0), (0.01, 0.01), (0.012, 0.004)):
        x = np.zeros(ball.n)
        way = push * np.ones(3) + angle * np.cross([0.3, -0.2, 1.0], ball.dof_points)
        x[ball.D] = way[ball.D, ball.dof_component[ball.D]]
        steps.append({"x": {"ball": x}})
    results = list(sc.ContactSolver(ball, contact).history(steps))
    for before, result in pairwise(results):
        assert violation(law, grain, result, before) < 1e-8
        assert result.certificate.worst < 1e-7
        assert (result.status == 2).sum() > 3


@pytest.mark.parametrize(
    "axis, grain, linear",
    [
        (0, 30, "condensed"),
        (1, 110, "sparse"),
        *(
            pytest.param(*case, marks=SLOW)
            for case in product((0, 1), (0, 30, 110), ("condensed", "sparse", "iterated"))
        ),
    ],
)
def test_guides_take_the_side_force(axis, grain, linear):
    """Between guides a block slips along one axis; its friction is not along it, and guides it."""
    block, way = Grooved(MU, along(grain)), np.eye(3)[axis]
    body = block.block
    D = np.union1d(body.D, np.flatnonzero(body.dof_component == 1 - axis))
    block.block = sc.Body(body.basis, body.K, D=D, name="block")
    block.foot = block.block.surface(at(2, 0.0), name="foot")
    friction = 0.01 * resisting(MU, along(grain), way)
    solver = block.solver(linear=sc.linalg.Direct() if linear == "sparse" else linear)
    pressed = solver.solve(**block.load((0, 0), (0, 0)))
    own = friction * way  # what strains the block; the rest goes from the foot into the guides
    moved = 0.05 * way + own / block.G
    result = solver.solve(**block.load(moved[:2], -own[:2]), start=pressed)
    count = (len(result.points), 1)
    np.testing.assert_allclose(
        result.traction, np.tile([*-friction[:2], 0.01], count), rtol=0, atol=1e-12
    )
    np.testing.assert_allclose(result.slip_vector, np.tile(0.05 * way, count), rtol=0, atol=1e-12)
    np.testing.assert_allclose(result.reaction("block")[:2], friction[:2], rtol=0, atol=1e-12)


@pytest.mark.parametrize("mu", [(0.1, 0.3), pytest.param((0.3, 0.1), marks=SLOW)])
def test_half_a_block_is_half_of_the_whole(mu):
    """A plane of symmetry through the contact, along the grain or across it."""
    forces = []
    for low in (-1.0, 0.0):
        y = np.linspace(low, 1.0, 3 if low == 0.0 else 5)
        mesh = fem.MeshHex.init_tensor(np.linspace(0, 1, 4), y, np.linspace(0, 1, 4))
        held = ((at(2, 1.0), (0, 1, 2)), *(((at(1, 0.0), (1,)),) if low == 0.0 else ()))
        block = elastic(mesh, "quad4", "block", held=held)
        law = sc.conditions.OrthotropicCoulomb(mu, (1, 0, 0))
        contact = sc.Contact(block.surface(at(2, 0.0)), FLOOR, friction=law, name="joint")
        top = block.D[np.isclose(block.dof_points[block.D, 2], 1.0)]
        steps = []
        for s in (0.0, 0.02, 0.018):
            x = np.zeros(block.n)
            x[top] = np.array([s, 0.0, -0.01])[block.dof_component[top]]
            steps.append({"x": {"block": x}})
        results = list(sc.ContactSolver(block, contact).history(steps))
        assert (results[1].status == 2).any() and (results[2].status == 1).any()
        forces.append([r.force[[0, 2]] for r in results])
    np.testing.assert_allclose(forces[0], 2 * np.array(forces[1]), rtol=1e-9, atol=1e-14)


def test_a_floor_that_moves():
    """The floor pulled one way is the block pulled the other way, also where it slides far."""
    block, shift = Grooved((0.1, 0.3), GRAIN), np.array([0.05, 0.03, 0.0])
    for sliding in ("small", "finite"):
        contact = sc.Contact(block.foot, FLOOR, friction=block.law, sliding=sliding, name="joint")
        solver = sc.ContactSolver(block.block, contact)
        pressed = solver.solve(**block.load((0, 0), (0, 0)))
        dragged = solver.solve(**block.load(shift[:2], (0, 0)), start=pressed)
        (pulled,) = solver.history([{"motion": {"floor": tuple(-shift)}}], start=pressed)
        np.testing.assert_allclose(pulled.traction, dragged.traction, rtol=0, atol=1e-11)
        np.testing.assert_allclose(pulled.slip_vector, dragged.slip_vector, rtol=0, atol=1e-11)


@pytest.mark.parametrize(
    "law, scale",
    [({"cohesion": (0.001, 0.003)}, 2.0), ({"tau_max": (0.0005, 0.0015)}, 0.5)],
    ids=["cohesion", "cap"],
)
def test_caps_and_cohesion_keep_the_shape(law, scale):
    """Twice the ellipse by cohesion, half of it by a cap: the same direction of friction."""
    block, slip = Grooved(MU, (1, 0, 0)), 0.05 * along(40)
    block.law = sc.conditions.OrthotropicCoulomb(MU, (1, 0, 0), **law)
    friction = scale * 0.01 * resisting(MU, along(0), slip)
    solver = block.solver()
    pressed = solver.solve(**block.load((0, 0), (0, 0)))
    moved = slip + friction / block.G
    values = solver.solve(**block.load(moved[:2], -friction[:2]), start=pressed)["joint"]
    expected = np.tile([*-friction[:2], 0.01], (len(values.points), 1))
    np.testing.assert_allclose(values.traction, expected, rtol=0, atol=1e-11)


def test_wear_counts_the_way_itself():
    """Depth is k p times the length of the slip, whatever the coefficients along it."""
    block, slip = Grooved(MU, (1, 0, 0)), 0.05 * along(20)
    friction = 0.01 * resisting(MU, along(0), slip)
    contact = sc.Contact(
        block.foot, FLOOR, friction=block.law, wear=sc.conditions.Archard(1e-6), name="joint"
    )
    solver = sc.ContactSolver(block.block, contact)
    pressed = solver.solve(**block.load((0, 0), (0, 0)))
    moved = slip + friction / block.G
    values = solver.solve(**block.load(moved[:2], -friction[:2]), start=pressed)["joint"]
    np.testing.assert_allclose(values.wear_depth, 1e-6 * 0.01 * 0.05, rtol=1e-5)


@pytest.mark.parametrize("mu", [(0.003, 0.3), pytest.param((0.3, 0.003), marks=SLOW)])
def test_how_far_a_step_slides_is_a_length(mu):
    """Twice the length of a facet in one step is too far, along the smooth axis as along the other."""
    block = Grooved(mu, (1, 0, 0))
    corners = [(-9, -9, 0), (9, -9, 0), (9, 9, 0), (-9, 9, 0)]
    floor = sc.RigidSurface(corners, [(0, 1, 2), (0, 2, 3)], name="floor")
    contact = sc.Contact(block.foot, floor, friction=block.law, sliding="finite", name="joint")
    solver = sc.ContactSolver(block.block, contact, options=sc.Options(max_travel=1.0, max_cuts=0))
    pressed = solver.solve(**block.load((0, 0), (0, 0)))
    with pytest.raises(sc.errors.NotConverged, match=r"slid (1\.9|2)\d* times as far as max_travel"):
        solver.solve(**block.load((1.0, 0.0), (0, 0)), start=pressed)


def test_the_certificate_judges_direction_and_size():
    """Friction turned by a thousandth, too large, or against the slip on the ellipse, is told."""
    law = sc.conditions.OrthotropicCoulomb((0.4, 0.2), (1, 0, 0))
    solver, load = pushed_block(law)
    pressed = solver.solve(f=load(0.0, 0.0))
    result = answer_of(solver.solve(f=load(0.12, 0.12), start=pressed))
    slips = result.state.status == 2
    assert slips.any() and sc.answers.ContactResult(result).certificate.friction < 1e-9
    right, slip = result.state.tangential_force, result.state.slip
    turned = right + 1e-3 * np.cross([0.0, 0.0, 1.0], right)
    back = np.where(slips[:, None], slip, 0.0)
    along_slip = result.state.normal_force[:, None] * back
    along_slip /= np.sqrt((back[:, [0]] / 0.4) ** 2 + (back[:, [1]] / 0.2) ** 2 + 1e-300)
    along_slip = np.where(slips[:, None], along_slip, right)
    for wrong in (turned, 1.001 * right, along_slip):
        object.__setattr__(result.state, "tangential_force", wrong)
        for name in ("local", "certificate"):  # what is derived of the state
            vars(result).pop(name, None)
        scale = result.state.normal_force.max()
        at_fault = np.linalg.norm(wrong - right, axis=1)[slips].max() / scale
        # between the two axes forces are scaled by up to 2
        assert 0.15 * at_fault < sc.answers.ContactResult(result).certificate.friction < 6 * at_fault


def test_moments_of_friction_across_a_gap():
    """They are those of the forces themselves: with them the moments of all bodies balance."""
    solver = two_blocks(sc.conditions.OrthotropicCoulomb((0.1, 0.4), GRAIN), apart=0.05)
    certificate = led(solver, WAY[:2])[-1].certificate
    assert certificate.moment_gap > 1e-4
    assert certificate.moment_balance < 1e-10


def test_statics_know_the_ellipse():
    """What a load on a loose block needs is proven to be too much beyond it only."""
    mu, grain = (0.4, 0.1), along(20)
    solver, load = pushed_block(sc.conditions.OrthotropicCoulomb(mu, grain))
    model = solver.linear_model
    for angle in (20.0, 50.0, 110.0, 200.0):
        way = along(angle)
        most = 1 / np.sqrt(way @ np.linalg.pinv(squares(mu, grain)) @ way)
        for share in (0.99, 1.01):
            f = load(*share * most * way[:2])["block"]
            found = escape(model.motions, model.interface, model.kin.paired, f)
            assert (found is None) == (share < 1)


@SLOW
def test_other_answers_are_those_of_the_circle():
    """Of the larger coefficient whose ratio stays, whichever axis is called the first."""
    law, across = sc.conditions.OrthotropicCoulomb((0.1, 0.4), GRAIN), np.cross([0, 0, 1.0], GRAIN)
    ours, other = (
        led(two_blocks(one))[1].uniqueness
        for one in (law, sc.conditions.OrthotropicCoulomb((0.4, 0.1), across))
    )
    np.testing.assert_allclose(ours.critical_friction, other.critical_friction, rtol=1e-9)
    np.testing.assert_allclose(ours.friction, 0.4)
    assert ours.unique_up_to == pytest.approx(other.unique_up_to, rel=1e-6) and ours.index == 1
    assert ours.unique_up_to > 0
