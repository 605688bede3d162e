"""Frequency and damping of a mode against amplitude: a rod, spheres, and plates that are bolted."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
import skfem as fem
from bolted import clamped, parts
from numpy.testing import assert_allclose
from quick_elasticity import linear_elasticity
from rectangles import rectangle
from scipy.optimize import brentq
from scipy.sparse import diags

import skfem_contact as sc
from skfem_contact.reference import hertz_point, mindlin_compliance, mindlin_dissipation

PULL, LENGTH, BOUND, STIFFNESS = 30.0, 100.0, 1.0, 1000.0


@cache
def rod(cells=100, height=0.5, spring=0.0):
    """On a rough floor, with its mass at the end that is free, and its mode without friction."""
    basis = rectangle(np.linspace(0, LENGTH, cells + 1), [0, height])
    D = np.union1d(basis.get_dofs("left").all(), basis.get_dofs(elements=True).all("u^2"))
    form = fem.BilinearForm(lambda u, v, _: u[0] * v[0] + u[1] * v[1])
    # next to nothing elsewhere: eigenvalues of more than one mode are finite
    end = form.assemble(basis.boundary("right"))
    mass, bedded = end + 1e-12 * form.assemble(basis), spring / height * end
    K = linear_elasticity(0.0, 0.5 * STIFFNESS / height).assemble(basis) + bedded
    body = sc.Body(basis, K, D=D, mass=mass, name="rod")
    floor = sc.RigidPlane((0, 0), (0, 1), name="floor")
    foot = sc.Contact(
        body.surface("bottom"), floor, friction=sc.Tresca(BOUND), separation=False, method="node"
    )
    solver = sc.ContactSolver(body, foot)
    smooth = solver.with_friction(None)
    return solver, solver.solve(), smooth.modes(smooth.solve(), 1)


def pulled(force):
    """The amplitude that a force at the end of the rod has without friction."""
    return force * LENGTH / STIFFNESS


@pytest.mark.parametrize("force", [PULL, 2 * PULL])
def test_a_rod_on_a_rough_floor(force):
    """``u = F^2 / 2 q EA``, loss ``2 F^3 / 3 q EA``, damping ``2 / 3 pi`` whatever F."""
    solver, result, modes = rod()
    found = solver.damping(result, modes, [pulled(force)])
    # the ends of its slip zone are found to a cell, of 30 and 60
    rtol = 2e-3
    assert_allclose(found.amplitude, force**2 / (2 * BOUND * STIFFNESS), rtol=rtol)
    assert_allclose(found.energy, 2 * force**3 / (3 * BOUND * STIFFNESS), rtol=rtol)
    assert_allclose(found.damping, 2 / (3 * np.pi), rtol=rtol)
    m = 0.5  # a unit of mass by length across the height of the end
    assert_allclose(found.frequency, np.sqrt(force / (m * found.amplitude)) / (2 * np.pi), rtol=1e-9)
    # bounds are given: Masing's rule holds, loops close at once, and all that is lost damps
    assert_allclose(found.masing, found.energy, rtol=1e-9)
    assert_allclose(found.dissipation, found.energy, rtol=1e-3)
    assert found.cycles == [1] and found.closed.all()
    assert_allclose(found.masing_loop(0)[:, 0], found.loops[0][:, 0], atol=1e-9 * found.amplitude[0])


def test_a_rod_that_is_loaded_vibrates_about_where_it_is():
    """The first peak is on the curve of first loading, and loops are what they are without a load."""
    solver, _, modes = rod()
    mean = 20.0
    load = solver.system.bodies[0].load({"right": (mean / 0.5, 0.0)}, "a pull")
    found = solver.damping(solver.solve(f={"rod": load}), modes, [pulled(PULL)])
    peak = ((PULL + mean) ** 2 - mean**2) / (2 * BOUND * STIFFNESS)
    assert_allclose(found.loops[0][0, 0], peak, rtol=2e-3)
    assert_allclose(found.energy, 2 * PULL**3 / (3 * BOUND * STIFFNESS), rtol=2e-3)
    assert_allclose(found.damping, 2 / (3 * np.pi), rtol=2e-3)


def test_more_load_steps_change_the_area_by_their_fourth_power():
    """Against many steps, of the same mesh: 4, 8 and 32 of them for half a cycle."""
    solver, result, modes = rod()
    few, some, many = (
        solver.damping(result, modes, [pulled(2 * PULL)], steps=steps).energy[0] for steps in (4, 8, 32)
    )
    assert abs(few / many - 1) < 8e-3
    assert abs(some - many) < abs(few - many) / 8  # 16, less what slips node by node


def decay(m, spring, w, cycles, dt):
    """Extremes of ``m w'' + spring w + F(w) = 0``, let go at w, by generalised alpha.

    F is that of a rod on a rough floor without end, whose branches are Masing's.
    """
    alpha_m, alpha_f, beta, gamma = 0.5, 0.5, 0.25, 0.5  # nothing is damped by the method
    turn, before, way = w, np.sqrt(2 * STIFFNESS * BOUND * w), -1.0

    def force(x):
        return spring * x + before + way * 2 * np.sqrt(STIFFNESS * BOUND * max(way * (x - turn), 0.0))

    v, a, found = 0.0, -force(w) / m, [w]
    while len(found) <= 2 * cycles:
        here = force(w)

        def speeding(x):
            return (x - w - dt * v - dt**2 * (0.5 - beta) * a) / (beta * dt**2)  # noqa: B023

        def left(x):
            mean = (1 - alpha_m) * speeding(x) + alpha_m * a  # noqa: B023
            return m * mean + (1 - alpha_f) * force(x) + alpha_f * here  # noqa: B023

        far = w + 3 * way * (abs(dt * v) + dt**2 * abs(a))
        if left(w) * left(far) > 0:  # it goes no further
            found.append(w)
            turn, before, way = w, here - spring * w, -way
            continue
        new = brentq(left, w, far, xtol=1e-15)
        w, v, a = new, v + dt * ((1 - gamma) * a + gamma * speeding(new)), speeding(new)
    return np.abs(found)


@pytest.mark.slow
@pytest.mark.parametrize("stiff", [20, 80])
def test_free_vibrations_decay_as_damping_says(stiff):
    """In time, on a spring beside the rod; both differ by half the share of friction in the force."""
    peak = PULL**2 / (2 * BOUND * STIFFNESS)
    spring, m = stiff * PULL / peak, 0.5
    solver, result, modes = rod(spring=spring)
    found = solver.damping(result, modes, peak * np.linspace(0.7, 1.1, 9))
    extremes = decay(m, spring, peak, 2, 1 / (800 * found.frequency[-1]))
    ratio = np.log(extremes[:-2] / extremes[2:]) / (2 * np.pi)
    between = np.sqrt(extremes[:-2] * extremes[2:])
    assert found.amplitude[0] < between.min() and between.max() < found.amplitude[-1]
    assert_allclose(ratio, np.interp(between, found.amplitude, found.damping), rtol=0.6 / stiff)


def spheres(across, share):
    """Two equal spheres, R 10, pressed by 100, one of which is pushed by its mass on top.

    Blocks with the gap of the spheres, cut along y = 0, `across` faces on the radius of the contact.
    """
    E, nu, mu, R, P = 210e3, 0.3, 0.3, 10.0, 100.0
    exact = hertz_point(P, R / 2, E / (2 * (1 - nu**2)))
    h = exact.a / across

    def graded(even):
        count = round(even * across)
        growing = h * np.cumsum(1.6 ** np.arange(1, 14))
        end = 6 * exact.a - count * h
        growing = growing[: np.searchsorted(growing, end) + 1]
        return h * np.append(np.arange(count + 1), count + growing / growing[-1] * end / h)

    y, z, bodies = graded(1.3), graded(0.6), []
    for name, up in (("high", z), ("low", -z[::-1])):
        mesh = fem.MeshHex.init_tensor(np.append(-y[:0:-1], y), y, up)
        basis = fem.Basis(mesh, fem.ElementVector(fem.ElementHex1()), intorder=2)
        axis, (_, beside, level) = np.arange(basis.N) % 3, basis.doflocs
        top = np.isclose(np.abs(level), 6 * exact.a)
        free = top & (axis == 0) & (name == "high")
        D = np.flatnonzero((np.isclose(beside, 0) & (axis == 1)) | (top & ~free))
        mass = diags(np.where(free, 1.0, 1e-9)).tocsr()
        bodies.append(sc.Body(basis, sc.Elastic(E, nu), D=D, mass=mass, name=name))
    surfaces = (body.surface(lambda x: np.isclose(x[2], 0)) for body in bodies)
    gap = lambda x: (x[0] ** 2 + x[1] ** 2) / R  # noqa: E731
    contact = sc.Contact(*surfaces, friction=sc.Coulomb(mu), gap=gap, method="node")
    solver = sc.ContactSolver(bodies, contact)
    high = bodies[0]
    top = np.intersect1d(np.flatnonzero(np.isclose(high.basis.doflocs[2], z[-1])), high.D)
    top = top[top % 3 == 2]

    def pressed(down):
        x = np.zeros(high.n)
        x[top] = -down
        return solver.solve(x={"high": x})

    down, slope = 4e-3, 3 * P / (2 * 4e-3)  # of the force by the approach, after Hertz
    while abs(2 * (result := pressed(down)).force[2] / P - 1) > 1e-6:
        down += (P - 2 * result.force[2]) / slope
    modes = solver.modes(result, 1)
    shape = modes.displacement(0, high) / np.abs(modes.shapes).max()
    m, push = shape @ high.mass @ shape, (high.mass @ shape).sum()
    force = 0.5 * share * mu * P * m / push  # that does its work where most moves
    found = solver.damping(result, modes, force / (m * (2 * np.pi * modes.frequency) ** 2))
    G = E / (2 * (1 + nu))
    compliance = mindlin_compliance(G, nu, G, nu)
    return found, mindlin_dissipation(exact, mu, share * mu * P, compliance)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("share", "across", "off"),
    # the ring that slips is .07, .2, .4 and .6 of the radius wide: less than a face, and up to four
    [(0.2, 10, 0.1), (0.5, 7, 0.04), (0.5, 10, 0.01), (0.8, 7, 0.01), (0.95, 7, 0.01)],
)
def test_mindlins_spheres(share, across, off):
    """The energy of a cycle of ``Q = share mu P``, and Masing's rule, as pressures do not change."""
    found, exact = spheres(across, share)
    written = {0.2: 6.5663e-5, 0.5: 1.35112e-3, 0.8: 8.50272e-3, 0.95: 2.16614e-2}  # N mm
    assert exact == pytest.approx(written[share], rel=1e-5)
    assert 2 * found.energy[0] == pytest.approx(exact, rel=off)
    assert_allclose(found.masing, found.energy, rtol=3e-3)


@cache
def bolted(unit=1.0):
    """Plates with a bolt, tightened, and its modes; in millimetres and tonnes, or as SI has it."""
    steel = sc.Elastic(210e3 / unit**2, 0.3, density=7.85e-9 / unit**4)
    solver = clamped(parts(fem.MeshHex), unit=unit, form=steel)
    [tight] = solver.history([{"bolt": {"M": {"force": 8e3}}}])
    return solver, tight, solver.modes(tight, 1)


def test_loops_are_closed_where_their_ends_meet():
    """To 1 % of their width, found here from loops of one cycle that is not asked to close."""
    solver, tight, modes = bolted()
    amplitudes = [5.93e-3, 6e-3]
    with pytest.warns(sc.ContactWarning, match=r"amplitudes 0.00593 did not close in 1 cycles"):
        once = solver.damping(tight, modes, amplitudes, steps=4, cycles=1)
    width = once.energy / [2 * loop[0, 1] for loop in once.loops]
    apart = np.array([abs(loop[-1, 0] - loop[0, 0]) for loop in once.loops]) / width
    assert 0.01 < apart[0] < 0.02 and 0.005 < apart[1] < 0.01
    assert once.closed.tolist() == [False, True] and "1 (open)" in str(once)
    found = solver.damping(tight, modes, amplitudes, steps=4)
    assert found.cycles.tolist() == [2, 1] and found.closed.all()
    # what friction loses beyond the area is preload that settles, which the bolt shows
    assert np.all(found.bolts["M"] < 0) and "force of M" in str(found)
    assert abs(found.masing[1] / found.energy[1] - 1) > 0.01  # pressures change in a cycle


@pytest.mark.slow
def test_small_amplitudes_are_those_of_the_mode():
    """A joint that sticks is linear: the frequency of the mode, and no damping; whatever the unit."""
    found = []
    for unit, (solver, tight, modes) in zip((1.0, 1e-3), (bolted(), bolted(1e-3)), strict=True):
        now = solver.damping(tight, modes, [1e-6 * unit, 1e-3 * unit], steps=4)
        assert_allclose(now.frequency[0], modes.frequency[0], rtol=1e-9)
        assert abs(now.damping[0]) < 1e-9 < now.damping[1]
        assert now.dissipation[0] == 0 and now.cycles[0] > 1  # what slipped before settles, and sticks
        found.append((now.frequency, now.damping[1:], now.energy[1:] / unit, now.bolts["M"]))
    for here, there in zip(*found, strict=True):
        assert_allclose(here, there, rtol=1e-6)


def test_what_is_glued_has_no_damping():
    """Whose loops are lines, and closed in spite of round-off."""
    basis = rectangle(np.linspace(0, 1, 9), np.linspace(0, 1, 9))
    block = sc.Body(basis, sc.Elastic(1.0, 0.3, density=1.0), f={"top": 0.01}, name="block")
    foot = sc.Contact(block.surface("bottom"), sc.RigidPlane((0, 0), (0, 1)), tied=True)
    solver = sc.ContactSolver(block, foot)
    result = solver.solve()
    modes = solver.modes(result, 3)
    for mode in range(3):
        found = solver.damping(result, modes, [1e-3, 2e-3], mode=mode, steps=3)
        assert not found.damping.any() and found.cycles.tolist() == [1, 1]
        assert_allclose(found.frequency, modes.frequency[mode], rtol=1e-9)
        assert_allclose(found.amplitude, [1e-3, 2e-3], rtol=1e-9)


def test_pictures():
    """Frequency, damping and loops, one more by Masing's rule."""
    pytest.importorskip("matplotlib")
    solver, result, modes = rod(20)
    found = solver.damping(result, modes, [pulled(PULL), pulled(2 * PULL)], steps=3)
    figure = sc.output.plot_damping(found, units={"length": "mm", "time": "s"})
    assert [ax.get_ylabel() for ax in figure.axes[:2]] == ["frequency [1/s]", "damping, of critical"]
    assert figure.axes[0].get_xlabel() == "amplitude [mm]"
    assert len(figure.axes[2].lines) == 3
    with pytest.raises(sc.errors.InputError, match="damping is"):
        sc.output.plot_damping(result)


def test_wrong_questions_are_refused():
    """Modes, amplitudes and numbers that make no sense."""
    solver, result, modes = rod()
    still = sc.answers.Modes(np.zeros(1), np.zeros(1), modes.shapes, "stuck", modes.system)
    other = sc.answers.Modes(np.ones(1), np.zeros(1), np.ones((1, 3)), "stuck", modes.system)
    cases = {
        "amplitudes = 0": lambda: solver.damping(result, modes, 0),
        "give a list of lengths above zero": lambda: solver.damping(result, modes, [np.nan]),
        "mode is 1; give a whole number from 0 to 0": lambda: solver.damping(result, modes, [1.0], mode=1),
        "steps is 1; give a whole number from 2 on": lambda: solver.damping(result, modes, [1.0], steps=1),
        "cycles is 0": lambda: solver.damping(result, modes, [1.0], cycles=0),
        "mode 0 is a rigid motion": lambda: solver.damping(result, still, [1.0]),
        "those of other bodies": lambda: solver.damping(result, other, [1.0]),
        "modes is": lambda: solver.damping(result, result, [1.0]),
        "result is": lambda: solver.damping(modes, modes, [1.0]),
    }
    for words, ask in cases.items():
        with pytest.raises(sc.errors.InputError, match=words):
            ask()
