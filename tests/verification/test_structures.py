"""Structures with friction: S1 layered cantilever, S2 bar between planes, S5 stack, R1 Raous block."""

from __future__ import annotations

from functools import cache, partial

import numpy as np
import pytest
import rectangles
import skfem as fem
from scenes import elastic, plane_stress, pressure_load

import skfem_contact as sc
from skfem_contact.reference import (
    RAOUS,
    bar_between_planes,
    layered_cantilever,
    stacked_blocks_normal_forces,
)

rectangle = partial(rectangles.rectangle, order=4)  # for quadratic elements too


def side_load(basis: fem.CellBasis, side: str, traction: tuple[float, float]) -> np.ndarray:
    """Load of a uniform traction on one side."""
    facets = fem.FacetBasis(basis.mesh, basis.elem, facets=side, intorder=4)
    return fem.LinearForm(lambda v, w: traction[0] * v[0] + traction[1] * v[1]).assemble(facets)


# -- S1: two beams, slip damping ----------------------------------------------------------------


@cache
def cantilever() -> tuple:
    """Two cycles of the tip force to twice the slip force, in steps that hit every kink."""
    exact = layered_cantilever(L=20.0, h=1.0, E=1e5, mu=0.3, p=1.0)
    x, y = np.linspace(0, 20, 41), np.linspace(0, 1, 3)
    upper = rectangle(x, y, element=fem.ElementQuad2())
    lower = rectangle(x, y - 1, element=fem.ElementQuad2())
    form = plane_stress(1e5, 0.0)
    bodies = [sc.Body(b, form, D="left", name=n) for b, n in ((upper, "up"), (lower, "low"))]
    clamp = {"up": side_load(upper, "top", (0.0, -1.0)), "low": side_load(lower, "bottom", (0.0, 1.0))}
    shear = {"up": side_load(upper, "right", (0.0, 0.5)), "low": side_load(lower, "right", (0.0, 0.5))}
    contact = sc.Contact(
        bodies[0].surface("bottom"), bodies[1].surface("top"), friction=sc.Coulomb(0.3)
    )
    solver = sc.ContactSolver(bodies, contact)
    most = 2 * exact.slip_force
    way = [0.0, 0.25, 1.0]  # half the slip force, twice the slip force
    way += 2 * [0.5, 0.0, -0.5, -1.0, -0.5, 0.0, 0.5, 1.0]
    forces = most * np.array(way)
    steps = [{"f": {n: clamp[n] + F * shear[n] for n in clamp}} for F in forces]
    results = list(solver.history(steps))
    end = shear["up"], shear["low"]
    tips = np.array([end[0] @ r.displacement("up") + end[1] @ r.displacement("low") for r in results])
    return exact, forces, results, tips


def test_s1_stick_stiffness_is_that_of_one_thick_beam() -> None:
    """Below the slip force both beams bend as one, with Timoshenko's shear deflection."""
    exact, forces, _, tips = cantilever()
    stiffness = (forces[1] - forces[0]) / (tips[1] - tips[0])
    # the corner at the clamp is stiffer than a beam's: 5e-5 of the deflection
    assert stiffness == pytest.approx(exact.shear_stiffness(0.0), rel=1e-3)
    assert abs(tips[0]) < 1e-3 * abs(tips[1])  # the clamping pressure bends nothing


def test_s1_tip_deflection_in_slip() -> None:
    """At twice the slip force the beams slide on each other and bend separately."""
    exact, forces, results, tips = cantilever()
    # Bernoulli's beams: the shear deflection is 0.6 % in stick, a quarter of that in slip
    assert tips[2] == pytest.approx(exact.tip(forces[2]), rel=5e-3)
    inside = results[2].points[:, 0] > 1.0
    assert (results[2].status[inside] == 2).all()


def test_s1_energy_lost_per_cycle() -> None:
    """The loop of force and deflection encloses what friction dissipates, as Goodman and Klumpp
    found."""
    exact, forces, results, tips = cantilever()
    lost = sum(r.dissipation for r in results[3:11])
    assert lost == pytest.approx(exact.dissipation(forces[2]), rel=1e-3)
    work = np.sum(0.5 * (forces[3:11] + forces[2:10]) * np.diff(tips[2:11]))
    # the clamping pressure does no net work in a closed cycle, nor do the elastic bodies; what the
    # trapezoidal work misses of the turns, where points slip a little before the others, is known
    missed = sum(r.energy_residual for r in results[3:11])
    assert lost + missed == pytest.approx(work, rel=1e-9)
    assert abs(missed) < 1e-3 * lost


def test_s1_the_second_cycle_repeats_the_first() -> None:
    """Under cyclic load the state at every force is that of one cycle before."""
    _, _, results, tips = cantilever()
    assert np.abs(tips[3:11] - tips[11:19]).max() < 1e-9 * np.abs(tips).max()
    for first, second in zip(results[3:11], results[11:19], strict=True):
        scale = first.normal_force.max()
        assert np.abs(first.tangential_force - second.tangential_force).max() < 1e-9 * scale
        assert first.dissipation == pytest.approx(second.dissipation, rel=1e-9, abs=1e-12)


# -- S2: bar between rough planes ---------------------------------------------------------------


CHORDS = 4


def bar(ratio: float) -> tuple:
    """Half of a bar with half height 1 on a rigid plane, pulled so that it slips over 1/ratio.

    First the grip, by interference with the plane; then the pull, and a cycle of the force in
    `CHORDS` steps each way.
    """
    E, mu, p = 1e4, 0.5, 1.0
    exact = bar_between_planes(half_height=1.0, E=E, mu=mu, p=p)
    length = 1 / ratio
    x = np.linspace(0, 1.3 * length, round(1.3 * length * 4) + 1)
    basis = rectangle(x, np.linspace(0, 1, 5))
    middle = basis.get_dofs("top").all("u^2")
    pull = side_load(basis, "right", (1.0, 0.0))
    body = sc.Body(basis, plane_stress(E, 0.0), D=middle, name="bar")
    plane = sc.RigidPlane((0, 0), (0, 1), name="plane")
    contact = sc.Contact(
        body.surface("bottom"), plane, friction=sc.Coulomb(mu), interference=p / E, name="grip"
    )
    force = mu * p * length
    way = np.concatenate(
        [[0.0, 1.0], np.linspace(1, -1, CHORDS + 1)[1:], np.linspace(-1, 1, CHORDS + 1)[1:]]
    )
    results = list(sc.ContactSolver(body, contact).history([{"f": F * pull} for F in force * way]))
    ends = np.array([pull @ r.u for r in results])
    return exact, force, results, ends


def test_s2_bar_slips_from_its_end() -> None:
    """A gripped bar yields as the square of the force, keeps half of it, and loses a cube."""
    errors = []
    for ratio in (0.083, 0.042, 0.021):
        exact, force, results, ends = bar(ratio)
        pulled, left = ends[1], ends[1 + CHORDS // 2]
        errors.append(1 - pulled / exact.pull(force))
        lost = sum(r.dissipation for r in results[2:])
        slipping = results[1].points[results[1].status == 2, 0]
        zone = 1.3 / ratio - slipping.min()
        # the shear lag over the height of the bar reaches about one height
        assert abs(zone - exact.slip_length(force)) < 1.5
    # the closed form neglects the height of the bar: an error of its ratio to the slip length
    # the same from another program, on meshes of its own
    assert 1 - np.array(errors) == pytest.approx([0.9765, 0.9873, 0.9937], abs=1.5e-3)
    assert pulled == pytest.approx(exact.pull(force), rel=0.015)
    assert left == pytest.approx(exact.pull(0.0, turned_at=force), rel=0.015)
    # what slips under constant pressure loses bound times slip, whatever the steps
    assert lost == pytest.approx(exact.dissipation(force), rel=0.015)
    # the area between chords of the two parabolas, 1 - 1/CHORDS^2 of that between themselves
    chords = lost + sum(r.energy_residual for r in results[2:])
    assert chords == pytest.approx(exact.dissipation(force) * (1 - CHORDS**-2), rel=0.015)


# -- S5: stack of blocks ------------------------------------------------------------------------


def stack(count: int, mu: float, *, held: bool, pulled: int) -> tuple:
    """Blocks one upon the other, numbered from the top; all but one held sideways, or none."""
    bodies, weights, pulls = [], [], []
    for k in range(count):  # from the top
        y = count - 1 - k
        n = 4 + k % 3  # meshes that do not match
        basis = rectangle(np.linspace(0, 3, n + 1), np.linspace(y, y + 1, 3))
        D = basis.get_dofs("left").all("u^1") if held and k != pulled else None
        bodies.append(sc.Body(basis, elastic(1e3, 0.2), D=D, name=f"block {k + 1}"))
        weights.append(fem.LinearForm(lambda v, w: -v[1] / 3.0).assemble(basis))  # weight 1
        pulls.append(side_load(basis, "right", (1.0, 0.0)))
    floor = sc.RigidPlane((0, 0), (0, 1), name="floor")
    below = [body.surface("top") for body in bodies[1:]] + [floor]
    contacts = [
        sc.Contact(body.surface("bottom"), primary, friction=sc.Coulomb(mu), name=f"joint {k + 1}")
        for k, (body, primary) in enumerate(zip(bodies, below, strict=True))
    ]
    f = {body.name: weight for body, weight in zip(bodies, weights, strict=True)}
    return sc.ContactSolver(bodies, contacts), f, pulls


def test_s5_every_joint_carries_the_weight_above() -> None:
    """The normal force in each joint of a stack is the weight of the blocks above it."""
    solver, f, _ = stack(4, 0.3, held=False, pulled=-1)
    result = solver.solve(f)
    exact = stacked_blocks_normal_forces([1.0] * 4)
    found = [result[f"joint {k + 1}"].normal_force.sum() for k in range(4)]
    # statics: round-off, enlarged by the condition of four blocks that nothing but contact holds
    assert np.abs(np.array(found) - exact).max() < 1e-10 * exact[-1]


@pytest.mark.parametrize("pulled", [0, 1, 2, 3])
def test_s5_pulled_block_between_held_ones(pulled: int) -> None:
    """A block pulled out from between others that are held sideways comes at the sum of both
    friction limits, and not before."""
    mu = 0.3
    solver, f, pulls = stack(4, mu, held=True, pulled=pulled)
    limit = mu * (2 * pulled + 1)  # pulled blocks above it, and pulled + 1 weights below
    name = f"block {pulled + 1}"
    rest = solver.solve(f)
    sticks = solver.solve({**f, name: f[name] + 0.99 * limit * pulls[pulled]}, start=rest)
    joints = [sticks[f"joint {k}"] for k in range(1, 5)]
    assert [j.normal_force.sum() for j in joints] == pytest.approx([1, 2, 3, 4], rel=1e-9)
    taken = joints[pulled].force[0] - (joints[pulled - 1].force[0] if pulled else 0.0)
    assert taken == pytest.approx(-0.99 * limit, rel=1e-9)
    with pytest.raises(sc.errors.NoEquilibrium, match=f"'{name}'") as error:
        solver.solve({**f, name: f[name] + 1.01 * limit * pulls[pulled]}, start=rest)
    assert error.value.bodies == (name,)


def test_s5_free_stack_slips_below_the_pulled_block() -> None:
    """In a stack that nothing holds, the blocks above ride along: the joint below the pulled block
    slips first, at mu times the weight above it."""
    mu, pulled = 0.3, 1
    solver, f, pulls = stack(4, mu, held=False, pulled=pulled)
    rest = solver.solve(f)
    limit = mu * (pulled + 1)
    sticks = solver.solve({**f, "block 2": f["block 2"] + 0.99 * limit * pulls[1]}, start=rest)
    force = [sticks[f"joint {k}"].force[0] for k in range(1, 5)]
    # statics of each block: nothing above the pulled one, the whole pull in every joint below
    assert force == pytest.approx([0.0] + 3 * [-0.99 * limit], abs=1e-9)
    with pytest.raises(sc.errors.NoEquilibrium) as error:
        solver.solve({**f, "block 2": f["block 2"] + 1.01 * limit * pulls[1]}, start=rest)
    assert set(error.value.bodies) == {"block 1", "block 2"}


# -- R1: the block of Raous ---------------------------------------------------------------------


@cache
def raous(n: int = 32, factor: float = 1.0, steps: int = 1) -> tuple:
    """The block of the benchmark with n x n elements, loaded proportionally."""
    side = RAOUS.side
    basis = rectangle(np.linspace(0, side, n + 1), np.linspace(0, side, n + 1))
    f = factor * (
        pressure_load(basis, "right", RAOUS.lateral_pressure)
        + pressure_load(basis, "top", RAOUS.top_pressure)
    )
    D = basis.get_dofs("left").all("u^1")
    body = sc.Body(basis, elastic(RAOUS.E, RAOUS.nu), f, D=D, name="block")
    plane = sc.RigidPlane((0, 0), (0, 1), name="plane")
    contact = sc.Contact(body.surface("bottom"), plane, friction=sc.Coulomb(RAOUS.mu))
    solver = sc.ContactSolver(body, contact)
    *_, result = solver.history([k / steps for k in range(1, steps + 1)])
    order = np.argsort(result.points[:, 0])
    u = result.u[body.surface("bottom").dofs][order]
    return result, result.points[order, 0], u, order


def test_r1_displacements_at_the_points_of_the_benchmark() -> None:
    """The slip of points A to E is that of the benchmark."""
    _, x, u, _ = raous()
    at = np.interp(RAOUS.points, x, np.abs(u[:, 0]))  # the points are nodes
    assert at == pytest.approx(RAOUS.converged, rel=1.5e-3)  # discretisation of 32 elements
    assert at == pytest.approx(RAOUS.code_aster, rel=1e-2)  # another mesh
    assert at == pytest.approx(RAOUS.published, rel=5e-2)  # the tolerance of the benchmark


def test_r1_resultants() -> None:
    """The normal force balances the pressure on top exactly; the friction force is the benchmark's."""
    result, *_ = raous()
    assert result.normal_force.sum() == pytest.approx(RAOUS.normal_force, rel=1e-12)
    off_axis = result.points[:, 0] > 0
    friction = abs(result.tangential_force[off_axis].sum())
    assert friction == pytest.approx(RAOUS.friction_force, rel=5e-4)


def test_r1_stick_slip_and_separation() -> None:
    """From the symmetry plane outwards the block sticks, slips and lifts off, each zone connected."""
    result, x, _, order = raous()
    status = result.status[order]
    h = RAOUS.side / 32
    stick, closed = x[status == 1].max(), x[status != 0].max()
    assert abs(stick - RAOUS.stick_end) <= h  # one element
    assert abs(closed - RAOUS.contact_end) <= h
    inner = status[1:]  # the node on the symmetry plane can not slip
    expected = np.where(x <= stick, 1, np.where(x <= closed, 2, 0))[1:]
    assert (inner == expected).all()
    slips = result.status == 2
    ratio = np.abs(result.tangential_force[slips, 0]) / result.normal_force[slips]
    assert ratio == pytest.approx(RAOUS.mu, rel=1e-12)


def test_r1_proportional_load_in_one_step_or_five() -> None:
    """Under proportional load all zones stand still, so the number of steps does not matter."""
    one, five = raous()[0], raous(steps=5)[0]
    assert (one.status == five.status).all()
    assert np.abs(one.u - five.u).max() < 1e-10 * np.abs(one.u).max()


def test_r1_twice_the_load() -> None:
    """Without gaps everything is proportional to the load, and the zones do not change."""
    one, two = raous()[0], raous(factor=2.0)[0]
    assert (one.status == two.status).all()
    assert np.abs(2 * one.u - two.u).max() < 1e-12 * np.abs(two.u).max()
