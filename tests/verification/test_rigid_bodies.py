"""Rigid bodies under force and moment control: against statics, prescribed motions, stiff bodies."""

from __future__ import annotations

import itertools
import warnings

import numpy as np
import pytest
import skfem as fem
from numpy.testing import assert_allclose
from scenes import UPRIGHT, Pose, block_basis, elastic
from solid_meshes import KINDS
from test_obstacles import axisymmetric, per_turn
from unlike_meshes import rectangle

import skfem_contact as sc
from skfem_contact.obstacles import rotation_matrix

LOOPS = ["newton", "direct", "fictitious"]
# multigrid nearly to the last digit: what is left of the load moves points that stick, and the
# certificate of friction measures their slip against slips of the size of round-off
ROUTES = {"condensed": "condensed", "sparse": sc.linalg.Direct(), "AMG": sc.linalg.AMG(tol=5e-15)}
EXACT = sc.Options(placement_tolerance=1e-12)


def slab(
    x0=-1.0, x1=1.0, y0=-1.0, y1=0.0, *, n=20, E=1.0, pose=UPRIGHT, D="bottom", name="block", **given
):
    """A block of n facets to the length, as a rule with its top at y = 0."""
    x = np.linspace(x0, x1, round(n * (x1 - x0) / 2) + 1)
    y = np.linspace(y0, y1, round(n * (y1 - y0) / 2) + 1)
    basis = block_basis(x, y, pose=pose)
    return sc.Body(basis, elastic(E, 0.3), D=D, name=name, **given)


def disc(radius=2.0, x=0.1, gap=0.0, pose=UPRIGHT):
    return sc.RigidCylinder(pose.turn((x, radius + gap)), radius, name="die")


def floor(y=0.0, pose=UPRIGHT):
    """A plane that lies on what is below it."""
    return sc.RigidPlane(pose.turn((0.0, y)), pose.turn((0.0, -1.0)), name="die")


def solver_of(bodies, contacts, **settings):
    return sc.ContactSolver(bodies, contacts, **settings)


def elastic_energy(result):
    u = {body.name: result.displacement(body) for body in result.system.bodies}
    return 0.5 * sum(u[body.name] @ (body.K @ u[body.name]) for body in result.system.bodies)


# -- force control is displacement control with the reaction found --------------------------------

PATH = [(0.0, -0.01), (0.002, -0.014), (0.004, -0.015), (0.001, -0.012), (-0.002, -0.016)]


@pytest.mark.parametrize("sliding", ["small", "finite"])
@pytest.mark.parametrize("route", ROUTES)
@pytest.mark.parametrize("loop", LOOPS)
@pytest.mark.pairwise
def test_a_die_under_the_force_that_its_motion_took_moves_by_that_motion(loop, route, sliding):
    """Pressed, dragged and brought back by forces, a disc goes where it was led to find them."""
    block, shape = slab(), disc()
    law = sc.Coulomb(0.4)
    settings = {"loop": loop, "linear": ROUTES[route]}
    options = sc.Options(tolerance=1e-13, placement_tolerance=1e-12, max_iterations=20000)
    contact = sc.Contact(block.surface("top"), shape, friction=law, sliding=sliding)
    led = solver_of([block], [contact], options=options, **settings)
    known = list(led.history([{"motion": {"die": v}} for v in PATH]))
    die = sc.RigidBody(shape, D="rotation")
    contact = sc.Contact(block.surface("top"), die, friction=law, sliding=sliding)
    pushed = solver_of([block, die], [contact], options=options, **settings)
    assert all(np.any(r.status == 1) for r in known)  # where all slip, forces do not tell the place
    forces = [{"f": {"die": {"x": -r.force_on_primary[0], "y": -r.force_on_primary[1]}}} for r in known]
    size = np.abs(known[-1].forces).max()
    for v, there, here in zip(PATH, known, pushed.history(forces), strict=True):
        translation, angle, about = here.motion("die")
        # a softness of 100 to 1 between a point and the block, times the digits of a loop's limits
        assert_allclose(translation, v, rtol=0, atol=1e-10 if loop != "fictitious" else 1e-8)
        assert angle == 0.0 and np.array_equal(about, shape.centre)
        assert_allclose(here.forces, there.forces, rtol=0, atol=1e-8 * size)
        assert_allclose(here.reaction("die")[:2], 0.0, rtol=0, atol=1e-10 * size)
        assert here.certificate.worst < 1e-8


@pytest.mark.filterwarnings("ignore:Rigid bodies carry their loads along")
@pytest.mark.every_value
@pytest.mark.parametrize("sliding", ["small", "finite"])
@pytest.mark.parametrize("shape", [disc(), floor()], ids=["disc", "plane"])
def test_a_moment_turns_a_die_as_far_as_its_turn_took(shape, sliding):
    """The same with a rotation about a point beside the middle: prescribed, then by its moment."""
    block, about = slab(), (0.3, 0.2)
    path = [(0.0, -0.01, 0.0), (0.003, -0.012, 0.003), (0.006, -0.014, -0.004), (0.0, -0.01, 0.002)]
    led = sc.RigidBody(shape, about=about, D=(0, 1, 2))
    free = sc.RigidBody(shape, about=about)
    answers = []
    for die, key in ((led, "x"), (free, "f")):
        contact = sc.Contact(block.surface("top"), die, friction=sc.Coulomb(0.4), sliding=sliding)
        solver = solver_of([block, die], [contact], options=EXACT)
        given = path if key == "x" else [r.reaction("die") for r in answers[0]]
        answers.append(list(solver.history([{key: {"die": q}} for q in given])))
    for q, there, here in zip(path, *answers, strict=True):
        assert_allclose(here.displacement("die"), q, rtol=0, atol=1e-10)
        assert_allclose(here.forces, there.forces, rtol=0, atol=1e-10 * np.abs(there.forces).max())
        assert_allclose(there.reaction("die")[:2], -there.force_on_primary, rtol=0, atol=1e-15)
        assert max(here.certificate.worst, there.certificate.worst) < 1e-10


@pytest.mark.parametrize("sliding", ["small", "finite"])
def test_prescribed_motions_are_those_of_an_obstacle(sliding):
    """A rigid body all of whose motions are prescribed is an obstacle that moves."""
    block, shape = slab(), disc(1.0)
    turn = 0.0 if sliding == "small" else 1.0  # small sliding is linear in the turn of rigid bodies
    path = [(0.0, -0.02, 0.0), (0.02, -0.02, -0.05), (0.03, -0.02, -0.2), (0.0, -0.015, 0.1)]
    path = [(x, y, turn * angle) for x, y, angle in path]
    die = sc.RigidBody(shape, D=("x", "y", "rotation"))
    contacts = [
        sc.Contact(block.surface("top"), primary, friction=sc.Coulomb(0.4), sliding=sliding)
        for primary in (shape, die)
    ]
    told = solver_of([block], [contacts[0]], options=EXACT)
    told = told.history([{"motion": {"die": ((x, y), a, shape.centre)}} for x, y, a in path])
    held = solver_of([block, die], [contacts[1]], options=EXACT)
    for there, here in zip(told, held.history([{"x": {"die": q}} for q in path]), strict=True):
        size = np.abs(there.forces).max()
        assert_allclose(here.forces, there.forces, rtol=0, atol=1e-11 * size)
        assert_allclose(here.reaction("die")[:2], -there.force_on_primary, rtol=0, atol=1e-11 * size)


# -- by hand -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("route", ["condensed", "sparse"])
@pytest.mark.parametrize("mu", [0.0, 0.3])
def test_equations_and_conditions_written_down_by_hand(mu, route):
    """Equilibrium, gaps, slips and friction of a tilting disc, from positions and numbers alone."""
    block, shape = slab(), disc(2.0, gap=0.02)
    load, about = np.array([0.001, -0.02, 0.002 * (mu > 0)]), np.array([0.4, 0.5])
    springs = np.array([0.5, 0.0, 0.5])
    die = sc.RigidBody(shape, force=load[:2], moment=load[2], about=about, K=springs)
    contact = sc.Contact(block.surface("top"), die, friction=sc.Coulomb(mu))
    result = solver_of([block, die], [contact], linear=ROUTES[route]).solve()
    x, dofs = contact.secondary.points, contact.secondary.dofs
    arm = x - shape.centre
    distance = np.linalg.norm(arm, axis=1)
    n = arm / distance[:, None]
    t = np.column_stack([-n[:, 1], n[:, 0]])
    foot = shape.centre + shape.radius * n - about
    u, q = result.displacement("block"), result.displacement("die")
    apart = u[dofs] - q[:2] - q[2] * np.column_stack([-foot[:, 1], foot[:, 0]])
    gap = distance - shape.radius + np.sum(n * apart, axis=1)
    slip = np.sum(t * apart, axis=1)
    pressing = np.sum(n * result.forces, axis=1)
    friction = np.sum(t * result.forces, axis=1)
    closed = result.status > 0
    assert closed.sum() > 3 and (~closed).sum() > 3
    assert_allclose(gap[closed], 0.0, atol=1e-14)
    assert gap[~closed].min() > 0 and pressing[closed].min() > 0
    assert_allclose(result.forces[~closed], 0.0, atol=0)
    residual = block.K @ u
    residual[dofs] -= result.forces
    residual[block.D] = 0.0
    assert_allclose(residual, 0.0, atol=1e-14)
    moment = np.sum(foot[:, 0] * result.forces[:, 1] - foot[:, 1] * result.forces[:, 0])
    total = load - springs * q - np.array([*result.force, moment])
    assert_allclose(total, 0.0, atol=1e-14)
    slips = closed & (result.status == 2)
    if mu:
        assert slips.any()
        assert_allclose(friction[slips], -mu * pressing[slips] * np.sign(slip[slips]), atol=1e-15)
        assert np.all(np.abs(friction[closed & ~slips]) <= mu * pressing[closed & ~slips] + 1e-16)
        assert_allclose(slip[closed & ~slips], 0.0, atol=1e-15)
    assert result.certificate.worst < 1e-12


def test_a_lever_on_two_blocks_shares_its_load_by_statics():
    """A beam without weight on two blocks of unlike stiffness: the load goes by the lever arms."""
    left = slab(-3, -1, E=1.0, name="left")
    right = slab(2, 3, E=7.0, name="right")
    beam = sc.RigidBody(floor(), force=(0, -0.02), about=(0.5, 0.7), D="x", name="beam")
    contacts = [sc.Contact(b.surface("top"), beam, name=b.name) for b in (left, right)]
    result = solver_of([left, right, beam], contacts).solve()
    centres = [result[b.name].moment() / result[b.name].force[1] for b in (left, right)]
    share = (0.5 - centres[0]) / (centres[1] - centres[0])
    assert_allclose(result["right"].force[1], -0.02 * share, rtol=1e-12)
    assert_allclose(result["left"].force[1], -0.02 * (1 - share), rtol=1e-12)
    assert -3 < centres[0] < -1 and 2 < centres[1] < 3
    assert result.certificate.worst < 1e-13


def test_a_lever_on_a_pivot_balances_moments():
    """A moment about a pivot presses with as much over its arm, and the pivot bears the force."""
    block = slab(1, 3)
    lever = sc.RigidBody(floor(), moment=-0.01, about=(0, 0), D=("x", "y"), name="lever")
    contact = sc.Contact(block.surface("top"), lever, friction=sc.Coulomb(0.2))
    result = solver_of([block, lever], [contact]).solve()
    assert_allclose(result.moment((0, 0)), -0.01, rtol=1e-12)
    assert_allclose(result.reaction("lever"), [*-result.force_on_primary, 0.0], atol=1e-16)
    assert result.motion("lever")[1] < 0 and result.certificate.worst < 1e-13


def test_springs_of_a_tool_bear_what_contact_does_not():
    """A die on springs over a gap: force, springs and contact balance along each of its motions."""
    block, stiffness = slab(), np.array([[0.02, 0.001, 0], [0.001, 0.03, 0.004], [0, 0.004, 0.1]])
    die = sc.RigidBody(disc(gap=0.01), force=(0.0005, -0.01), moment=1e-4, K=stiffness)
    free = sc.RigidBody(disc(gap=10.0), force=(0.0005, -0.01), moment=1e-4, K=stiffness)
    contact = sc.Contact(block.surface("top"), die, friction=sc.Coulomb(0.5))
    result = solver_of([block, die], [contact]).solve()
    q = result.displacement("die")
    assert_allclose((stiffness @ q)[:2], die.f[:2] + result.force_on_primary, atol=1e-15)
    away = solver_of([block, free], [sc.Contact(block.surface("top"), free)]).solve()
    assert_allclose(away.displacement("die"), np.linalg.solve(stiffness, die.f), rtol=1e-12)
    assert max(result.certificate.worst, away.certificate.worst) < 1e-12


@pytest.mark.parametrize("route", ["condensed", "sparse"])
def test_a_tool_on_points_that_supports_hold(route):
    """A die on a face all of whose nodes are prescribed: nothing gives way, and statics is all."""
    block = slab(D=["top", "bottom"])
    die = sc.RigidBody(floor(), force=(0.01, -0.1), about=(0.2, 0.3), name="die")
    contact = sc.Contact(block.surface("top"), die, friction=sc.Coulomb(0.3))
    result = solver_of([block, die], [contact], linear=ROUTES[route]).solve()
    assert_allclose(result.displacement("die"), 0.0, atol=1e-14)
    # some ten rounded terms of forces and arms below 1, 2e-16 each (other kernels: 1.1e-15)
    assert_allclose(result.force, (0.01, -0.1), atol=1e-14)
    assert_allclose(result.moment((0.2, 0.3)), 0.0, atol=1e-14)
    assert result.certificate.worst < 1e-12


def test_loads_and_motions_by_name_whatever_the_size_of_the_bodies():
    """Moments and angles by name of DOF and as vectors, on bodies that are not of unit size."""
    block = slab(-7, 5, -6, 0, n=4)
    die = sc.RigidBody(floor(), about=(0.5, 0.7), D="x")
    solver = solver_of([block, die], [sc.Contact(block.surface("top"), die)])
    named = {"f": {"die": {"y": -0.05, "rotation": 0.02}}}
    vector = {"f": {"die": (0.0, -0.05, 0.02)}}
    stacked = {"f": np.array([*np.zeros(block.n), 0.0, -0.05, 0.02])}
    own = solver.with_load("die", {"y": -0.05, "rotation": 0.02}).solve()
    for step in (named, vector, stacked):
        result = next(solver.history([step]))
        assert_allclose(result.moment((0.5, 0.7)), 0.02, rtol=1e-12)
        assert_allclose(result.displacement("die"), own.displacement("die"), atol=1e-14)
    turned = sc.RigidBody(floor(), force=(0, -0.05), D=("x", "rotation"), name="die")
    solver = solver_of([block, turned], [sc.Contact(block.surface("top"), turned)])
    for step in ({"rotation": 0.003}, (0.0, 0.0, 0.003)):
        result = next(solver.history([{"x": {"die": step}}]))
        assert_allclose(result.motion("die")[1], 0.003, rtol=1e-14)
        assert_allclose(result.reaction("die")[2], result.moment((0.0, 0.0)), rtol=1e-10)


# -- the limit of stiff bodies -----------------------------------------------------------------------


# what a slab gives way falls with its modulus; at 1e8 round-off of its stiffness is as much
@pytest.mark.every_value
@pytest.mark.parametrize(("ratio", "near"), [(1e5, 1e-4), (1e7, 1e-6), (1e8, 1e-5)])
@pytest.mark.parametrize("mu", [0.0, 0.3])
def test_a_very_stiff_body_is_the_limit(mu, ratio, near):
    """A slab ever stiffer, under the same force and moment, moves as a rigid die."""
    block, law = slab(), sc.Coulomb(mu)
    P, M = 0.01, 0.001
    basis = slab(y0=0.0, y1=0.5).basis
    side = 0.1 * P * (mu > 0)  # nothing takes a force along a smooth contact
    load = fem.LinearForm(lambda v, w: -(P / 2 - 1.5 * M * w.x[0]) * v[1] + side / 2 * v[0])
    corner = np.argmin(np.abs(basis.doflocs - [[-1.0], [0.5]]).sum(axis=0))  # its first DOF, along x
    stiff = sc.Body(basis, elastic(ratio, 0.3), load.assemble(basis.boundary("top")),
                    D=None if mu else [corner], name="die")  # fmt: skip
    rigid = sc.RigidBody(floor(), about=(0, 0.5), force=(side, -P), moment=M,
                         D=None if mu else "x", name="die")  # fmt: skip
    answers = []
    for die, primary in ((stiff, stiff.surface("bottom")), (rigid, rigid)):
        contact = sc.Contact(block.surface("top"), primary, friction=law if mu else None)
        answers.append(solver_of([block, die], [contact]).solve())
    there, here = answers
    size = np.abs(there.forces).max()
    assert_allclose(here.forces, there.forces, rtol=0, atol=near * size)
    top = stiff.basis.get_dofs("top")
    x = stiff.basis.doflocs[0, top.nodal["u^2"]]
    v = there.displacement("die")[top.nodal["u^2"]]
    tilt, mean = np.polyfit(x, v, 1)
    translation, angle, _ = here.motion("die")
    assert_allclose([tilt, mean], [angle, translation[1]], rtol=0, atol=near * abs(mean))


# -- rollers ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("route", ["condensed", "sparse"])
def test_a_free_roller_between_plates_goes_half_the_way_and_turns(route):
    """Between a plate that stands and one that moves, a roller moves by half and rolls on both."""
    R, U = 1.0, 0.6
    low = slab(-1, 2, n=40, name="low")
    high = slab(-1, 2, 2 * R, 2 * R + 1, n=40, D="top", name="high")
    roller = sc.RigidBody(sc.RigidCylinder((0.2, R), R), name="roller")
    contacts = [
        sc.Contact(side, roller, friction=sc.Coulomb(0.5), sliding="finite", name=side.body.name)
        for side in (low.surface("top"), high.surface("bottom"))
    ]
    solver = solver_of([low, high, roller], contacts, linear=ROUTES[route])
    steps = [{"x": {"high": {"top": (x, -0.02)}}} for x in np.linspace(0.0, U, 9)]
    for step, result in zip(steps, solver.history(steps), strict=True):
        way = step["x"]["high"]["top"][0]
        translation, angle, _ = result.motion("roller")
        # a roll goes forward by the arc of the strained plate: strains are 1 %
        assert_allclose(translation[0], way / 2, rtol=0, atol=0.01 * U)
        assert_allclose(-angle * R, way / 2, rtol=0, atol=0.01 * U)
        force = result["low"].force + result["high"].force
        assert_allclose(force, 0.0, atol=1e-10 * abs(result["low"].force[1]))
        # nothing resists a roller but the small shift of its pressures
        assert abs(result["low"].force[0]) < 1e-2 * abs(result["low"].force[1])
        assert result.certificate.worst < 1e-9
    assert -angle > 0.29
    assert result["low"].dissipation_total < 1e-3 * abs(result["low"].force[1]) * U


@pytest.mark.filterwarnings("ignore:.*over the length of one facet")
def test_a_driven_roller_turns_on_the_spot_where_friction_gives_way():
    """A moment beyond mu N R has no equilibrium; one just below it is borne by friction."""
    block, shape, N = slab(), disc(0.5, x=0.0), 0.005
    held = {"force": (0.0, -N), "D": "x"}
    result = None
    for share, borne in ((0.9, True), (1.1, False)):
        die = sc.RigidBody(shape, moment=share * 0.3 * N * 0.5, **held)
        contact = sc.Contact(block.surface("top"), die, friction=sc.Coulomb(0.3), sliding="finite")
        solver = solver_of([block, die], [contact])
        if borne:
            result = solver.solve()
            assert_allclose(result.force_on_primary[1], N, rtol=1e-10)
            assert result.certificate.worst < 1e-10
        else:
            with pytest.raises((sc.errors.NoEquilibrium, sc.errors.NotConverged)):
                solver.solve()
    assert result is not None and 0 < result.motion("die")[1] < 0.1


# -- what must not matter -----------------------------------------------------------------------------


def tilted(pose=UPRIGHT, order=(0, 1, 2), scale=1.0, route="condensed", loop="newton", sliding="small"):
    """A disc on two blocks, pushed and turned: its place, and both forces, in the local frame."""
    one = slab(-1, 0, pose=pose, name="one")
    two = slab(0.1, 1.1, E=3.0, y1=-0.1, y0=-1.1, pose=pose, name="two")
    bodies = []
    for body in (one, two):
        mesh = body.basis.mesh.scaled(scale)
        basis = fem.Basis(mesh, body.basis.elem, intorder=2)
        bodies.append(
            sc.Body(basis, elastic(3.0 if body is two else 1.0, 0.3), D="bottom", name=body.name)
        )
    shape = sc.RigidCylinder(scale * pose.turn((0.05, 1.0)), 1.0 * scale, name="die")
    die = sc.RigidBody(
        shape,
        about=scale * pose.turn((0.3, 0.4)),
        force=scale * pose.turn((0.002, -0.02)),
        moment=0.0012 * scale**2,
    )
    contacts = [
        sc.Contact(b.surface("top"), die, friction=sc.Coulomb(0.4), sliding=sliding, name=b.name)
        for b in bodies
    ]
    bodies = [[*bodies, die][i] for i in order]
    contacts = [c for body in bodies for c in contacts if c.name == body.name]
    solver = solver_of(bodies, contacts, linear=ROUTES[route], loop=loop, options=EXACT)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", sc.ContactWarning)
        result = solver.solve()
    assert result.certificate.worst < 1e-9
    q = result.displacement("die")
    forces = [pose.back(result[name].force) / scale for name in ("one", "two")]
    return np.concatenate([pose.back(q[:2]) / scale, q[2:], *forces])


@pytest.mark.parametrize("order", list(itertools.permutations(range(3))))
@pytest.mark.parametrize("sliding", ["small", "finite"])
@pytest.mark.every_value
def test_the_order_of_bodies_and_contacts_is_no_matter(order, sliding):
    """Given in any order, bodies and contacts have one answer."""
    known = tilted(sliding=sliding)
    assert_allclose(tilted(order=order, sliding=sliding), known, rtol=0, atol=1e-12)


@pytest.mark.parametrize("pose", [Pose(33.0), Pose(90.0), Pose(0.0, 7), Pose(200.0, 3)], ids=str)
@pytest.mark.parametrize("sliding", ["small", "finite"])
@pytest.mark.every_value
def test_pose_and_numbering_are_no_matter(pose, sliding):
    """Turned in space, and numbered otherwise, the scene has the same answer."""
    known = tilted(sliding=sliding)
    assert_allclose(tilted(pose, sliding=sliding), known, rtol=0, atol=1e-11)


@pytest.mark.every_value
@pytest.mark.parametrize("scale", [1e-6, 1e3, 1e9])
@pytest.mark.parametrize("route", ["condensed", "sparse"])
def test_units_of_length_are_no_matter(scale, route):
    """In micrometres or kilometres angles, and lengths over the unit, are the same."""
    known = tilted(route=route)
    assert_allclose(tilted(scale=scale, route=route), known, rtol=0, atol=1e-11)


@pytest.mark.parametrize("route", ROUTES)
@pytest.mark.parametrize("loop", LOOPS)
@pytest.mark.parametrize("sliding", ["small", "finite"])
@pytest.mark.pairwise
def test_loops_and_routes_agree(loop, route, sliding):
    """All loops on all routes find the place of the tool and the forces of both contacts."""
    known = tilted(sliding=sliding)
    # G of the loop `fictitious` is soft: sticking points creep by tau / G
    near = {"newton": 1e-9, "direct": 2e-4, "fictitious": 2e-2}[loop]
    found = tilted(loop=loop, route=route, sliding=sliding)
    assert_allclose(found, known, rtol=0, atol=near)


@pytest.mark.parametrize("loop", ["newton", "direct"])
def test_a_pairing_is_asked_no_more_digits_than_its_forces_have(loop):
    """Placed to zero, which round-off never meets, a step ends where the loop's tolerance does."""
    block, die = slab(), sc.RigidBody(disc(), force=(0.001, -0.02), D="rotation")
    contact = sc.Contact(block.surface("top"), die, friction=sc.Coulomb(0.4), sliding="finite")
    found = [
        solver_of(
            [block, die], [contact], loop=loop, options=sc.Options(placement_tolerance=to)
        ).solve()
        for to in (1e-9, 0.0)
    ]
    assert found[1].certificate.placement <= sc.Options().tolerance
    size = np.abs(found[0].forces).max()
    # the looser of both asks for 1e-9 of the largest force
    assert_allclose(found[1].forces, found[0].forces, rtol=0, atol=1e-8 * size)


# -- energy, histories, states ------------------------------------------------------------------------


@pytest.mark.filterwarnings("ignore:Rigid bodies carry their loads along")
@pytest.mark.parametrize("sliding", ["small", "finite"])
def test_the_work_of_the_tool_is_stored_or_lost(sliding):
    """Work of force and moment: elastic energy, friction, and what the balance is known to miss."""
    block, shape = slab(), floor() if sliding == "small" else disc()
    die = sc.RigidBody(shape, about=(0.1, 0.2), K=(0.0, 0.0, 0.05))
    contact = sc.Contact(block.surface("top"), die, friction=sc.Coulomb(0.3), sliding=sliding)
    loads = [(0, -0.01, 0), (0.0025, -0.012, 1e-4), (-0.001, -0.012, -1e-4), (0.002, -0.01, 0)]
    q0, f0, U0 = np.zeros(3), np.zeros(3), 0.0
    lost = missed = work = 0.0
    for f, result in zip(
        np.array(loads),
        solver_of([block, die], [contact], options=EXACT).history([{"f": {"die": f}} for f in loads]),
        strict=True,
    ):
        q, U = result.displacement("die"), elastic_energy(result)
        done = 0.5 * (f + f0) @ (q - q0)
        if sliding == "small":  # turning frames add terms of second order
            balance = done - (U - U0) - result.dissipation - result.energy_residual
            assert abs(balance) < 1e-13 * max(abs(done), U)
        work, lost, missed = work + done, lost + result.dissipation, missed + result.energy_residual
        q0, f0, U0 = q, f, U
    assert lost > 1e-6
    # steps this coarse miss a part of what is lost by rows that turn as the disc goes along
    assert abs(work - U0 - lost - missed) < (1e-13 if sliding == "small" else 0.05 * lost)


@pytest.mark.parametrize(("k", "off"), [(0.01, 1.27), (0.1, 0.127), (0.5, 0.025)])
def test_a_roller_carries_its_load_along(k, off):
    """On flat ground its weight resists no rolling: a spring alone holds it. Small sliding is told."""
    basis = block_basis(np.linspace(-2, 2, 41), np.linspace(-1, 0, 9))
    block = sc.Body(basis, elastic(1.0, 0.3), D="bottom", name="block")
    way, weight = 0.02, 0.02

    def rolled(**settings):
        roller = sc.RigidBody(disc(1.0), name="roller", **settings)
        return solver_of(
            [block, roller], [sc.Contact(block.surface("top"), roller, friction=sc.Coulomb(0.3))]
        ).solve()

    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        result = rolled(force=(k * way, -weight), K=(k, 0, 0))
    found = way / result.displacement("roller")[0] - 1.0
    assert_allclose(found, off, rtol=0.02)  # what small sliding misses of the way, as measured
    share = result.validity.second_order["roller"]
    assert 0.5 * off < share < 3 * off
    assert result.validity.holds == (share < 0.1) == (not told)
    if told:
        assert "change the motion of 'roller' by" in str(told[0].message)
        assert ("second order", "roller") in result.validity.problems
        assert "moments of second order" in result.report()
    # nothing to be told of: only pressed, or held against rolling
    assert rolled(force=(0, -weight)).validity.holds
    assert rolled(force=(0.002, -weight), D="rotation").validity.second_order == {}


def test_a_tower_that_topples_is_warned_of():
    """A weight on top of ever higher towers: from some height on it topples, small sliding holds it."""
    basis = block_basis(np.linspace(-2, 2, 41), np.linspace(-1, 0, 9))
    block = sc.Body(basis, elastic(1.0, 0.3), D="bottom", name="block")
    shares = []
    for height in (0.3, 1.0, 20.0):
        outline = [(-0.5, 0), (0.5, 0), (0.5, height), (-0.5, height)]
        tower = sc.RigidBody(
            sc.RigidPolyline(outline, closed=True), about=(0, height), force=(1e-5, -0.02), name="tower"
        )
        contact = sc.Contact(block.surface("top"), tower, friction=sc.Coulomb(0.3))
        with warnings.catch_warnings(record=True) as told:
            warnings.simplefilter("always")
            result = solver_of([block, tower], [contact]).solve()
        shares.append(result.validity.second_order["tower"])
        assert bool(told) == (shares[-1] > 0.1)
    # the moment of the weight on a lean by the push, over that of the push
    lean = 0.02 * abs(result.displacement("tower")[2]) / 1e-5
    assert_allclose(shares[2], lean, rtol=0.02)
    assert shares[0] < shares[1] < 0.1 and shares[2] > 1.0


def test_a_plate_beside_its_middle_is_pressed_unevenly_by_as_much():
    """It goes aside by 1 % of its length, and leans by a part of that: nothing to be warned of."""
    block = slab(-1, 1, n=10)
    plate = sc.RigidBody(floor(), force=(0.001, -0.02), K=(0.1, 0, 0), name="plate")
    result = solver_of([block, plate], [sc.Contact(block.surface("top"), plate)]).solve()
    assert_allclose(result.displacement("plate")[0], 0.01, rtol=1e-9)
    assert 0.01 < result.validity.second_order["plate"] < 0.05


def test_a_history_goes_on_from_a_file_to_the_last_bit(tmp_path):
    """Where the tool is, how far it has turned and what friction remembers is in the saved state."""
    block = slab(-1, 2, n=30)
    steps = [{"f": {"die": (x, -0.01, m)}} for x, m in ((0, 0), (5e-4, 0), (1e-3, 4e-4), (0, -2e-4))]

    def solver():
        die = sc.RigidBody(disc(1.0), K=(0.002, 0, 0.002))
        contact = sc.Contact(block.surface("top"), die, friction=sc.Coulomb(0.3), sliding="finite")
        return solver_of([block, die], [contact])

    whole = list(solver().history(steps))
    first = solver()
    file = first.save_state(tmp_path / "state", list(first.history(steps[:2]))[-1])
    second = solver()
    rest = list(second.history(steps[2:], start=second.load_state(file)))
    for there, here in zip(whole[2:], rest, strict=True):
        assert np.array_equal(there.u, here.u) and np.array_equal(there.slip, here.slip)
    other = sc.RigidBody(disc(1.0), K=(0.002, 0, 0.002), about=(0.0, 0.0))
    contact = sc.Contact(block.surface("top"), other, friction=sc.Coulomb(0.3), sliding="finite")
    with pytest.raises(sc.errors.InputError, match="nodes are elsewhere: body 'die'"):
        solver_of([block, other], [contact]).load_state(file)


@pytest.mark.every_value
@pytest.mark.parametrize("seed", range(12))
def test_random_tools_have_one_answer_on_both_routes(seed):
    """Random discs and planes, loads, supports and springs: two routes, one answer, certified."""
    rng = np.random.default_rng(seed)
    block = slab(E=10.0 ** rng.uniform(-2, 2))
    E = 1 / abs(np.linalg.norm(block.K.diagonal(), np.inf)) ** -1
    shape = disc(rng.uniform(0.5, 5), rng.uniform(-0.5, 0.5), rng.uniform(-0.01, 0.01))
    if seed % 3 == 0:
        shape = floor(rng.uniform(-0.005, 0.005))
    held = [None, "x", "rotation", ("x", "rotation")][seed % 4]
    mu = [None, sc.Coulomb(0.3), sc.Coulomb(1.0)][seed % 3 if held is None else seed % 2]
    K = E * np.array([1e-4, 0, 1e-4]) if held != ("x", "rotation") else None
    about = None if seed % 2 else rng.uniform(-0.3, 0.3, 2)
    die = sc.RigidBody(shape, D=held, K=K, about=about)
    loads = [(rng.uniform(-2e-4, 2e-4) * E, -rng.uniform(5e-4, 5e-3) * E, rng.uniform(-1e-4, 1e-4) * E)
             for _ in range(3)]  # fmt: skip
    answers = []
    for route in ("condensed", "sparse"):
        contact = sc.Contact(block.surface("top"), die, friction=mu)
        solver = solver_of([block, die], [contact], linear=ROUTES[route])
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", sc.ContactWarning)
            answers.append(list(solver.history([{"f": {"die": f}} for f in loads])))
    for one, other in zip(*answers, strict=True):
        size = np.abs(one.forces).max()
        assert_allclose(one.forces, other.forces, rtol=0, atol=1e-9 * size)
        assert_allclose(one.displacement("die"), other.displacement("die"), rtol=0, atol=1e-9)
        assert max(one.certificate.worst, other.certificate.worst) < 1e-10


def test_a_ball_on_an_axisymmetric_block_under_its_weight():
    """Per full turn: under the force that an approach took, a ball approaches by that."""
    basis = rectangle("Q1", np.linspace(0, 2, 41), np.linspace(-2, 0, 41))
    held = np.append(basis.get_dofs("bottom").all(), basis.get_dofs("left").all("u^1"))
    block = sc.Body(basis, axisymmetric(0.3), D=held, measure=per_turn, name="block")
    ball = sc.RigidSphere((0, 3.0), 3.0, name="ball")
    led = solver_of([block], [sc.Contact(block.surface("top"), ball)])
    there = next(led.history([{"motion": {"ball": (0, -0.05)}}]))
    tool = sc.RigidBody(ball, force=-there.force_on_primary * (0, 1), D=("x", "rotation"))
    here = solver_of([block, tool], [sc.Contact(block.surface("top"), tool)]).solve()
    assert_allclose(here.motion("ball")[0], (0, -0.05), rtol=0, atol=1e-12)
    with pytest.raises(sc.errors.InputError, match="moves along their axis alone"):
        free = sc.RigidBody(ball, force=(0, -1.0))
        solver_of([block, free], [sc.Contact(block.surface("top"), free)])


# -- what nothing holds, and what small sliding does not follow -------------------------------------


def test_a_tool_that_nothing_holds_is_diagnosed_like_a_floating_body():
    """Pulled off, beside its base, or in no contact: the message names the tool and its motion."""
    block = slab()

    def press(force, about=(0.0, 0.5), held="x", **given):
        die = sc.RigidBody(floor(), force=force, about=about, D=held, name="die")
        return solver_of([block, die], [sc.Contact(block.surface("top"), die, **given)]).solve()

    with pytest.raises(
        sc.errors.NoEquilibrium, match="Body 'die' is free to move: translation along y"
    ):
        press((0, 0.01))
    with pytest.raises(sc.errors.NoEquilibrium, match=r"Body 'die' is free to move: .*rotation"):
        press((0, -0.01), about=(1.2, 0.5))
    with pytest.raises(sc.errors.NoEquilibrium, match="'die' is free to move: translation along x"):
        press((0.004, -0.01), held=None, friction=sc.Coulomb(0.3))
    with pytest.warns(
        sc.ContactWarning, match=r"place of body 'die' is indifferent \(translation along x"
    ):
        result = press((0, -0.01), held=None)
    assert_allclose(result.motion("die")[0][0], 0.0, atol=1e-15)
    loose = sc.RigidBody(disc(), name="die", force=(0, -1e-3))
    with pytest.raises(
        sc.errors.NoEquilibrium, match="Body 'die' is free to move: translation along y"
    ):
        solver_of([block, loose], [sc.Contact(block.surface("top"), floor())]).solve()


def test_a_smooth_disc_that_may_turn_in_itself_is_no_matter_of_a_warning():
    """Without friction nothing feels the turn of a disc about its centre."""
    block = slab()
    die = sc.RigidBody(disc(), force=(0, -0.01))
    result = solver_of([block, die], [sc.Contact(block.surface("top"), die)]).solve()
    assert result.indifferent == () and result.motion("die")[1] == 0.0


def test_turns_are_small_with_small_sliding_and_any_with_finite():
    """A moment that turns a roller far is warned of with small sliding, and followed with finite."""
    block = slab(-1, 2, n=30)
    shape = disc(0.5, x=0.0)
    step = {"x": {"die": {"x": 0.2, "rotation": -0.4}}}
    answers = {}
    for sliding in ("small", "finite"):
        die = sc.RigidBody(shape, force=(0, -0.005), D=("x", "rotation"))
        contact = sc.Contact(block.surface("top"), die, friction=sc.Coulomb(0.3), sliding=sliding)
        solver = solver_of([block, die], [contact])
        with warnings.catch_warnings(record=True) as said:
            warnings.simplefilter("always")
            answers[sliding] = list(solver.history([{"x": {"die": {"x": 0.0}}}, step]))[-1]
        words = [str(w.message) for w in said if "small sliding" in str(w.message)]
        assert bool(words) == (sliding == "small"), words
    rolled = answers["finite"]
    assert_allclose(rolled.motion("die")[1], -0.4)
    # the foot of the disc has gone along with its centre
    pressed = rolled.points[rolled.status > 0, 0]
    assert abs(pressed.mean() - 0.2) < 0.05


# -- solids -----------------------------------------------------------------------------------------


def elastic_solid(mesh, kind):
    basis = fem.Basis(mesh, fem.ElementVector(KINDS[kind][2]()), intorder=4)
    return sc.Body(basis, elastic(1.0, 0.3), D="ground", name="block")


def solid(kind="quad4", n=4):
    """A block on the ground, of any element."""
    linear, curved, _ = KINDS[kind]
    t = np.linspace(-1, 1, n + 1)
    mesh = linear.init_tensor(t, t, np.linspace(-1, 0, n // 2 + 1))
    mesh = mesh if curved is linear else curved.from_mesh(mesh)
    sides = {"top": lambda x: x[2] > -1e-9, "ground": lambda x: x[2] < -1 + 1e-9}
    return elastic_solid(mesh.with_boundaries(sides), kind)


@pytest.mark.parametrize("route", ROUTES)
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.every_value
def test_a_ball_on_a_solid_under_the_force_that_its_motion_took(kind, route):
    """In space: pressed by the force found at a motion, a ball goes there, on faces of every kind."""
    block = solid(kind)
    ball = sc.RigidSphere((0.1, 0.05, 10.0), 10.0, name="ball")
    led = solver_of([block], [sc.Contact(block.surface("top"), ball, method="node")])
    there = next(led.history([{"motion": {"ball": (0.001, -0.002, -0.05)}}]))
    tool = sc.RigidBody(ball, force=-there.force_on_primary,
                        D=("rotation x", "rotation y", "rotation z"))  # fmt: skip
    contact = sc.Contact(block.surface("top"), tool, method="node")
    here = solver_of([block, tool], [contact], linear=ROUTES[route]).solve()
    translation, turn, _ = here.motion("ball")
    assert_allclose(translation, (0.001, -0.002, -0.05), rtol=0, atol=1e-9)
    assert_allclose(here.forces, there.forces, rtol=0, atol=1e-9 * np.abs(there.forces).max())
    assert np.array_equal(turn, np.zeros(3)) and here.certificate.worst < 1e-9


@pytest.mark.parametrize("kind", ["quad4", "tri6"])
def test_a_lid_on_a_solid_balances_moments_about_both_axes(kind):
    """A plane under a force beside its middle tilts about two axes, until statics holds."""
    block = solid(kind)
    plane = sc.RigidPlane((0, 0, 0), (0, 0, -1), name="lid")
    about, load = np.array([0.1, 0.2, 0.3]), np.array([0.0, 0.0, -0.05])
    lid = sc.RigidBody(plane, force=load, moment=(0.004, -0.002, 0), about=about,
                       D=("x", "y", "rotation z"))  # fmt: skip
    contact = sc.Contact(block.surface("top"), lid, method="node")
    result = solver_of([block, lid], [contact]).solve()
    assert_allclose(result.force, load, atol=1e-14)
    assert_allclose(result.moment(about)[:2], [0.004, -0.002], atol=1e-14)
    translation, turn, _ = result.motion("lid")
    # towards the side that the force and the moment press down
    assert turn[0] < 0 < turn[1] and result.certificate.worst < 1e-12
    if kind == "quad4":  # closed nodes are on the lid, linear in its turn
        closed, x = result.status > 0, result.points
        lid_at = translation[2] + turn[0] * (x[:, 1] - 0.2) - turn[1] * (x[:, 0] - 0.1)
        u = result.displacement("block")[contact.secondary.dofs]
        assert_allclose(u[closed, 2], lid_at[closed], atol=1e-15)
        assert (x[:, 2] + u[:, 2] <= lid_at + 1e-15).all()


@pytest.mark.filterwarnings("ignore:Rigid bodies carry their loads along")
@pytest.mark.filterwarnings("ignore:.*over the length of one facet")
def test_directions_in_space_are_alike():
    """The scene turned by whole axes: forces, places and turns are those of the other axes."""
    found = []
    for shift in range(3):
        axes = np.roll(np.arange(3), shift)
        t = np.linspace(-1, 1, 5)
        mesh = fem.MeshHex.init_tensor(t, t, np.linspace(-1, 0, 3))
        mesh = fem.MeshHex(mesh.p[axes], mesh.t)
        up = int(np.flatnonzero(axes == 2)[0])
        sides = {"top": lambda x, k=up: x[k] > -1e-9, "ground": lambda x, k=up: x[k] < -1 + 1e-9}
        block = elastic_solid(mesh.with_boundaries(sides), "quad4")
        ball = sc.RigidSphere(np.array([0.1, 0.05, 2.0])[axes], 2.0, name="ball")
        given = {
            "force": (0.001, 0.002, -0.03),
            "moment": (3e-4, -2e-4, 1e-4),
            "about": (0.2, 0.1, 0.5),
        }
        given = {key: np.array(value)[axes] for key, value in given.items()}
        tool = sc.RigidBody(ball, K=[*np.array([0.1, 0.2, 0.0])[axes], 0.3, 0.3, 0.3], **given)
        contact = sc.Contact(block.surface("top"), tool, method="node")
        result = solver_of([block, tool], [contact]).solve()
        q = result.displacement("ball")
        back = np.argsort(axes)
        found.append([q[:3][back], q[3:][back], result.force[back]])
    for other in found[1:]:
        for a, b in zip(found[0], other, strict=True):
            assert_allclose(a, b, atol=1e-13)


def test_a_ball_that_is_led_in_space_is_an_obstacle_that_moves():
    """Rolled and spun about axes that change, with finite sliding: forces, and slips by the spin."""
    block = solid(n=8)
    ball = sc.RigidSphere((0.1, 0.05, 2.0), 2.0, name="ball")
    tool = sc.RigidBody(ball, D=range(6))
    way = [
        ((0.01 * k, 0.005 * k, -0.05), (0.03 * k, 0.05 * k, 0.005 * k**2) if k else (0.0, 0.0, 0.0))
        for k in range(5)
    ]
    settings = {"method": "node", "sliding": "finite"}
    top = block.surface("top")
    told = solver_of([block], [sc.Contact(top, ball, **settings)], options=EXACT)
    told = list(told.history([{"motion": {"ball": (v, turn, ball.centre)}} for v, turn in way]))
    led = solver_of([block, tool], [sc.Contact(top, tool, **settings)], options=EXACT)
    led = list(led.history([{"x": {"ball": [*v, *turn]}} for v, turn in way]))
    on = np.all([result.status > 0 for result in told], axis=0)  # where slip counts from the start
    assert on.sum() > 5
    for there, here in zip(told, led, strict=True):
        assert_allclose(here.forces, there.forces, rtol=0, atol=1e-11 * np.abs(there.forces).max())
        # as far as the pairings are settled
        assert_allclose(here.slip_vector[on], there.slip_vector[on], rtol=0, atol=1e-11)
        assert here.certificate.worst < 1e-10


@pytest.mark.parametrize("turn", [2.5, 11.0])
def test_a_ball_that_has_turned_rolls_about_another_axis(turn):
    """Turned about z by a lot, then rolled along y: its rotation is one about x after the other.

    The change of its rotation vector is far from the angular velocity then.
    """
    R, way = 2.0, 0.25
    lines = np.linspace(-1.2, 1.2, 13), np.linspace(-1.2, 1.4, 14), np.linspace(-1.0, 0.0, 3)
    plate = sc.Body.from_mesh(
        fem.MeshHex.init_tensor(*lines).with_defaults(),
        fem.ElementVector(fem.ElementHex1()),
        sc.Elastic(60.0, 0.3),
        D="front",
    )

    def solver(**settings):
        ball = sc.RigidBody(sc.RigidSphere((0, 0, R), R), name="ball", **settings)
        friction = sc.Coulomb(0.5)
        contact = sc.Contact(plate.surface("back"), ball, friction=friction, sliding="finite")
        return solver_of([plate, ball], [contact])

    steps = [{"x": {"ball": x}} for x in ({"z": 0.1, "rotation z": turn}, {"z": -0.05})]
    *_, pressed = solver(D=range(6)).history(steps)
    rolling = solver(D=("x", "y"), force=(0, 0, -6.0))
    before, after = rolling.history([{"x": {"ball": {"y": y}}} for y in (0.0, way)], start=pressed)
    first, second = (rotation_matrix(result.motion("ball")[1]) for result in (before, after))
    assert_allclose(second @ first.T, rotation_matrix(np.array([-way / R, 0, 0])), rtol=0, atol=0.005)


def test_a_lock_holds_from_where_it_finds_the_body():
    """A wheel that has rolled is locked by a second solver and drawn on: in parts of a step, too.

    A new support begins at the place that the state has, not at zero: the wheel would turn back.
    """
    basis = block_basis(np.linspace(-1, 2, 49), np.linspace(-1, 0, 5))
    strip = sc.Body(basis, elastic(1.0, 0.3), D="bottom", name="strip")

    def with_wheel(*held):
        wheel = sc.RigidBody(sc.RigidCylinder((0, 2.0), 2.0), D=("x", *held), name="wheel")
        contact = sc.Contact(strip.surface("top"), wheel, friction=sc.Coulomb(0.3), sliding="finite")
        return sc.ContactSolver([strip, wheel], contact)

    steps = [{"f": {"wheel": {"y": -0.05}}}, *({"x": {"wheel": {"x": x}}} for x in (0.25, 0.5, 0.75))]
    *_, rolled = with_wheel().history(steps)
    turn = rolled.motion("wheel")[1]
    assert abs(turn) > 0.3
    step = {"x": {"wheel": {"x": 1.0, "rotation": turn}}}
    (drawn,) = with_wheel("rotation").history([step], start=rolled)
    assert "step cut" in drawn.message and drawn.motion("wheel")[1] == pytest.approx(turn)
    closed = drawn.status > 0
    assert np.all(drawn.status[closed] == 2)
    # it slid by 0.25 less what the strip gives, against 0.3 of the weight
    assert 0.8 < drawn.dissipation / (0.3 * 0.05 * 0.25) < 1.05
