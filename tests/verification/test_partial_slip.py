"""Friction of smooth contacts: Cattaneo-Mindlin (H4), fretting loops (H5), shear cap (H8).

The bodies are identical, so that friction leaves the pressure alone, unless a test says otherwise.
Tractions are compared as averages over the hat functions, as `test_hertz` explains. The parabola
has a radius of 100 half widths; loads are such that the exact half width is 1.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from numpy.testing import assert_allclose
from smooth_contacts import Blocks, hat_averages, ordered

import skfem_contact as sc
from skfem_contact.reference import (
    capped_sliding,
    cattaneo_mindlin,
    fretting_dissipation_line,
    hertz_line,
)

R = 100.0
MU = 0.5


def parabola(x):
    return x[0] ** 2 / (2 * R)


class Scene:
    """Blocks pressed together to a half width of 1, N elements per half width."""

    def __init__(self, N, mu=MU, *, stiffness=None, d=None, law=None, **settings):
        law = law or sc.Coulomb(mu, stiffness=stiffness)
        self.h = 1 / N
        self.blocks = Blocks(self.h, parabola, law=law, fine=1.3, **settings)
        self.mu, self.P = mu, self.blocks.load_for(1.0, R)
        added = self.blocks.added_curvature(self.P)
        self.exact = hertz_line(self.P, R, self.blocks.E_star, added_curvature=added)
        if d is None:
            _, d = self.blocks.press(self.P, 1.0)
        self.d = d

    def step(self, x):
        """The load step with the tangential force ``x mu P``."""
        return {"x": self.blocks.lowered(self.d), "f": self.blocks.push(x * self.mu * self.P)}

    def history(self, amplitudes):
        return list(self.blocks.solver.history(self.step(x) for x in amplitudes))


def stick_half_width(result):
    return np.abs(result.points[result.status == 1, 0]).max(initial=0.0)


def traction_error(result, exact):
    """L2 error of the shear traction over its L2 norm."""
    x, length, _, q = ordered(result)
    error = q - hat_averages(x, exact.traction)
    return np.sqrt(length @ error**2 / (length @ exact.traction(x) ** 2))


def share_of_full_sliding(exact):
    """L2 norm of the traction over that of mu p."""
    x = np.linspace(-exact.contact.a, exact.contact.a, 2001)
    return np.linalg.norm(exact.traction(x)) / np.linalg.norm(exact.mu * exact.contact.pressure(x))


def relative(a, b):
    return np.abs(a - b).max() / np.abs(b).max()


def there_and_back(n, cycles=1):
    """Amplitudes 0 ... 1 in n steps, then cycles 1 ... -1 ... 1 with 2n steps each way."""
    cycle = [np.linspace(1, -1, 2 * n + 1)[1:], np.linspace(-1, 1, 2 * n + 1)[1:]]
    return np.concatenate([np.linspace(0, 1, n + 1), *cycle * cycles])


# -- H4: partial slip -------------------------------------------------------------------------------


@pytest.mark.parametrize("part", [*(pytest.param(p, marks=pytest.mark.slow) for p in (0.0, 0.75)), 0.4])
def test_H4_partial_slip(part):
    """Under Q < mu P the middle sticks and the rims slip, as Cattaneo and Mindlin found."""
    scene = Scene(30 + part)
    pressed, *pushed = [scene.history([0.0, x]) for x in (0.25, 0.5, 0.6, 0.75)]
    for x, (before, result) in zip((0.25, 0.5, 0.6, 0.75), [pressed, *pushed], strict=True):
        exact = cattaneo_mindlin(scene.exact, MU, x * MU * scene.P)
        # The edges of contact and of stick are each known to an element only. At x = .25 all slip
        # happens in four elements, the traction is small and the error of an edge is not: there it
        # is measured by the traction at full sliding instead (up to 3.6 % of the traction itself).
        error = traction_error(result, exact)
        if x < 0.5:
            error *= share_of_full_sliding(exact)
        assert error < 0.7 * scene.h
        assert abs(stick_half_width(result) - exact.c) <= scene.h
        # equilibrium: the condensed matrix has lost four digits
        _, length, _, q = ordered(result)
        assert_allclose(length @ q, exact.Q, rtol=1e-10)
        # mirrored blocks: the pressure knows nothing of friction
        assert_allclose(result.pressure, before.pressure, rtol=0, atol=1e-11 * scene.exact.p0)
        assert_allclose(before.tangential_force, 0.0, atol=1e-12 * MU * scene.P)
        assert result.iterations <= 7
        assert result.certificate.worst < 1e-9


def test_H4_on_triangles():
    """The traction of linear triangles is as close as that of quadrilaterals."""
    scene = Scene(24.5, kind="P1", fine_depth=0.5)
    _, result = scene.history([0.0, 0.6])
    exact = cattaneo_mindlin(scene.exact, MU, 0.6 * MU * scene.P)
    assert traction_error(result, exact) < 0.7 * scene.h
    assert abs(stick_half_width(result) - exact.c) <= scene.h


def test_H4_with_all_degrees_of_freedom():
    """The solver that keeps all degrees of freedom finds the same partial slip."""
    condensed = Scene(8.5, fine_depth=0.2)
    sparse = Scene(8.5, fine_depth=0.2, d=condensed.d, linear=sc.linalg.Direct())
    a, b = (scene.history([0.0, 0.6])[1] for scene in (sparse, condensed))
    # two ways through the same equations: the condition number of the bodies
    assert relative(a.tangential_force, b.tangential_force) < 1e-9
    assert relative(a.pressure, b.pressure) < 1e-9
    assert np.array_equal(a.status, b.status)


@pytest.fixture(scope="module")
def reference_scene():
    """Exact sticking, and K's own diagonal at the middle of the contact."""
    scene = Scene(30.5, fine_depth=0.2)
    upper = scene.blocks.bodies[0]
    surface = upper.surface("bottom")
    middle = np.argmin(np.abs(surface.points[:, 0]))
    return scene, scene.history([0.0, 0.5])[-1], upper.K.diagonal()[surface.dofs[middle, 0]]


def spring_scene(G, scene, loop):
    return Scene(30.5, stiffness=G, d=scene.d, loop=loop, fine_depth=0.2)


@pytest.mark.parametrize(
    "factor",
    [pytest.param(0.1, marks=pytest.mark.slow), 1.0, pytest.param(10.0, marks=pytest.mark.slow)],
)
def test_H4_three_loops_agree(factor, reference_scene):
    """Fictitious forces, direct iteration and Newton reach the same state at the same G."""
    scene, _, diagonal = reference_scene
    results = {
        loop: spring_scene(factor * diagonal, scene, loop).history([0.0, 0.5])[1]
        for loop in ("newton", "direct", "fictitious")
    }
    for loop in ("direct", "fictitious"):
        # the loops stop at 1e-10 of the law; `fictitious` is linear and amplifies that
        a, b = results[loop], results["newton"]
        assert relative(a.tangential_force, b.tangential_force) < 1e-6
        assert relative(a.pressure, b.pressure) < 1e-8
        assert relative(a.slip, b.slip) < 1e-6
    assert results["fictitious"].iterations > results["newton"].iterations


@pytest.mark.parametrize("loop", [pytest.param("direct", marks=pytest.mark.slow), "newton"])
def test_H4_any_tangential_stiffness(loop, reference_scene):
    """From soft to hard springs the count of iterations stays; the answer tends to sticking."""
    scene, exact, diagonal = reference_scene
    for factor in 10.0 ** np.arange(0, 9, 2):
        spring = spring_scene(factor * diagonal, scene, loop)
        pressed, result = spring.history([0.0, 0.5])
        assert pressed.iterations <= 12
        assert result.iterations <= (12 if loop == "direct" else 7)
        # a spring in series with the bodies: 1/G, down to the round-off of the forces
        error = relative(result.tangential_force, exact.tangential_force)
        assert error < 0.2 / factor + 1e-10
        assert error > 1e-3 / factor or factor > 1e6


# -- H5: fretting -----------------------------------------------------------------------------------


def fretting(N, x, n=24):
    """Energy per cycle over the closed form: as reported, and as last force times slip."""
    scene = Scene(N, fine_depth=1.3 if N < 50 else 0.3)
    results = scene.history(x * there_and_back(n // 2, cycles=2))
    start, half, full = n // 2, n // 2 + n, n // 2 + 2 * n
    exact = fretting_dissipation_line(scene.exact, MU, x * MU * scene.P)

    second = results[full:]
    reported = sum(r.dissipation for r in second[1:])
    implicit = sum(
        -np.sum(after.tangential_force * (after.slip - before.slip))
        for before, after in pairwise(second)
    )
    assert_allclose(
        reported, results[-1].dissipation_total - results[full].dissipation_total, rtol=1e-10
    )
    # the cycle has settled with the first reversal: the second repeats the first
    for early, late in ((results[full], results[-1]), (results[half], results[half + 2 * n])):
        assert relative(early.tangential_force, late.tangential_force) < 1e-10
        assert relative(early.slip, late.slip) < 1e-10
        assert np.array_equal(early.status, late.status)
    # a front of slip against the first one runs in from the edge
    for k in range(start + 1, half):
        Q = x * there_and_back(n // 2)[k] * MU * scene.P
        state = cattaneo_mindlin(scene.exact, MU, Q, after=(x * MU * scene.P,))
        assert abs(stick_half_width(results[k]) - state.c) <= scene.h
        if k == start + n // 2:
            # a small self-balanced rest, of two signs: measured by full sliding, as in H4
            error = traction_error(results[k], state) * share_of_full_sliding(state)
            assert error < 0.7 * scene.h
    assert np.mean([r.iterations for r in results]) < 3
    return reported / exact, implicit / exact


@pytest.mark.slow
def test_H5_fretting_loop_loses_the_energy_of_the_closed_form():
    """A cycle of the tangential force closes in itself and costs what theory says."""
    reported, implicit = fretting(24.5, 0.6)
    # 24 elements per half width, 24 steps per half cycle
    assert_allclose([reported, implicit], 1.0, rtol=0.02)
    # Energy is the mean of the friction bounds before and after a step times the slip. Pressures, and
    # so the bounds, are the same all along the cycle: the last force times the slip to round-off.
    assert_allclose(reported, implicit, rtol=1e-10)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("N", "x"),
    [
        *((24 + part, x) for part in (0.0, 0.25, 0.5, 0.75) for x in (0.4, 0.6, 0.8)),
        # At x = .2 all slip happens in a tenth of the half width: with 24 elements in it that is
        # two and a half, and the loop is up to 9.5 % off, by where the edge lies. Ten are needed.
        (96.25, 0.2),
    ],
)
def test_H5_energy_for_all_amplitudes(N, x):
    """The energy per cycle is that of the closed form wherever the slip zone has a few elements."""
    assert_allclose(fretting(N, x), 1.0, rtol=0.02)


@pytest.mark.slow
def test_H5_energy_does_not_depend_on_the_number_of_steps():
    """The reported energy is that of force times slip, which no step size changes."""
    reported, implicit = np.transpose([fretting(24.5, 0.6, n) for n in (24, 48, 96)])
    assert_allclose(implicit, implicit[0], rtol=1e-3)
    # bound times slip at constant pressure, point by point: round-off of the sums
    assert_allclose(reported, implicit, rtol=1e-9)


# -- H8: capped friction ----------------------------------------------------------------------------


@pytest.mark.parametrize(
    "s", [pytest.param(0.25, marks=pytest.mark.slow), 0.5, pytest.param(0.75, marks=pytest.mark.slow)]
)
def test_H8_shear_cap_under_full_sliding(s):
    """Dragged away, every point carries mu p or the cap, and their sum is the closed form."""
    plain = Scene(24.5, pushed=False)
    tau_max = s * MU * plain.exact.p0
    scene = Scene(24.5, law=sc.Coulomb(MU, tau_max=tau_max), pushed=False, d=plain.d)
    result = scene.blocks.solver.solve(x=scene.blocks.lowered(scene.d, shift=0.1))
    _, length, p, q = ordered(result)
    assert (result.status[result.normal_force > 0] == 2).all()
    # the law at every point, no discretisation in it
    assert_allclose(q @ length, np.minimum(MU * p, tau_max) @ length, rtol=1e-10)
    # the pressure is Hertz' to .05 % in the mean
    assert_allclose(q @ length, capped_sliding(scene.exact, MU, tau_max).Q, rtol=1e-3)


# -- iterations -------------------------------------------------------------------------------------

MESHES = [15.3, *(pytest.param(N, marks=pytest.mark.slow) for N in (30.3, 60.3, 120.3, 240.3))]


@pytest.mark.parametrize("N", MESHES)
def test_newton_from_a_cold_start_at_any_resolution(N):
    """Pressing and pushing in one go takes a handful of iterations, however fine the mesh."""
    graded = {"fine_depth": 0.0}
    free = Blocks(1 / N, parabola, fine=1.3, **graded)
    P = free.load_for(1.0, R)
    result, d = free.press(P, 1.0)
    assert result.iterations <= 12
    held = Blocks(1 / N, parabola, fine=1.3, law=sc.Coulomb(0.0), pushed=False, **graded)
    for shift in (0.0, 1e-3):
        without = held.solver.solve(x=held.lowered(d, shift=shift))
        assert without.iterations <= 12
        assert not without.tangential_force.any()  # mu = 0 is no friction, not round-off of it
        assert not (without.status == 1).any()
    for mu in (0.1, 0.5, 1.0):
        scene = Scene(N, mu, d=d, **graded)
        for x in (0.5, 0.95):
            step = scene.step(x)
            result = scene.blocks.solver.solve(**step)
            # every linear solve counts: points that touch are closed, and the zone grows from there; a
            # nested start took 12 on the full problem and up to 36 on fewer points before them
            assert len(result.trace) <= 16
            # against the same state reached step by step
            if N < 100:
                *_, stepwise = scene.history([0.0, 0.3 * x, 0.6 * x, x])
                force = stepwise.tangential_force
                assert relative(result.tangential_force, force) < 1e-9


@pytest.mark.slow
@pytest.mark.parametrize("mu", [0.1, 2.0])
def test_history_of_a_body_held_by_friction_alone(mu):
    """Press, push to .95 mu P, reverse twice: few iterations, no cut, and the loop closes."""
    scene = Scene(30.3, mu, fine_depth=0.2)
    results = scene.history(0.95 * there_and_back(8, cycles=2))
    counts = [r.iterations for r in results]
    assert max(counts) <= 12
    assert np.mean(counts) <= 6
    assert not any("cut" in r.message for r in results)
    assert max(r.certificate.worst for r in results[::8]) < 1e-9
    assert relative(results[-1].tangential_force, results[8 + 32].tangential_force) < 1e-10
    assert_allclose([r.force[1] for r in results], scene.P, rtol=1e-9)


@pytest.mark.parametrize("n", [1, *(pytest.param(n, marks=pytest.mark.slow) for n in (3, 8))])
@pytest.mark.parametrize(
    ("E", "mu"),
    [
        ((1e3, 1.0), 2.0),
        ((1.0, 1e3), 1.0),
        pytest.param((1e3, 1.0), 1.0, marks=pytest.mark.slow),
        pytest.param((1.0, 1e3), 2.0, marks=pytest.mark.slow),
    ],
)
def test_history_with_a_stiffness_contrast_of_1000(E, mu, n):
    """Where friction and pressure are coupled, small and large increments are all solved."""
    scene = Scene(30.3, mu, E=E, fine_depth=0.2)
    # friction lifts the pressed body: P falls by up to 6 %, and .95 mu P with it
    results = scene.history(0.88 * there_and_back(n, cycles=2))
    counts = [r.iterations for r in results]
    assert max(counts) <= 12
    assert np.mean(counts) <= (6 if n >= 3 else 9)
    for r, x in zip(results, 0.88 * there_and_back(n, cycles=2), strict=True):
        _, length, p, q = ordered(r)
        force = mu * scene.P
        # A soft body under 1000 times stiffer ones: the round-off of the stiff displacements, of
        # the size of the push, is 1e-9 of the contact forces.
        assert_allclose(q @ length, x * force, rtol=0, atol=1e-7 * force)
        assert (np.abs(q) <= mu * p + 1e-9 * mu * p.max()).all()
        assert (p >= 0).all()
    # the second cycle repeats the first
    assert relative(results[-1].tangential_force, results[-1 - 4 * n].tangential_force) < 1e-9


@pytest.mark.slow
def test_a_step_that_fails_is_cut_and_ends_in_the_same_state():
    """With too few iterations for the whole step the solver begins elsewhere or takes it in parts."""
    scene = Scene(30.3, mu=1.0, fine_depth=0.2)
    whole = scene.history([0.0, 0.95])[-1]
    assert whole.iterations > 4
    few = sc.Options(max_iterations=4, max_cuts=8)
    short = Scene(30.3, mu=1.0, d=scene.d, fine_depth=0.2, options=few)
    parts = short.history([0.0, 0.95])[-1]
    assert parts.converged
    # complementary pivoting finds it without a cut by now; cuts have their tests in test_stepping.py
    assert len(parts.trace) > 4
    # slip grows monotonically between equal bodies: no path but one
    assert relative(parts.tangential_force, whole.tangential_force) < 1e-9
    assert relative(parts.slip, whole.slip) < 1e-9
