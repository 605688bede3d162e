"""Friction laws of users are checked value by value, and laws that are steep or stiff are solved."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest
import skfem as fem
from hex_blocks import checked_law
from numpy.testing import assert_allclose
from quick_elasticity import linear_elasticity

import skfem_contact as sc

LOOPS = ["newton", "direct", "fictitious"]


@dataclass(frozen=True, eq=False)
class Own(sc.conditions.FrictionLaw):
    """A law of the user's own, by functions."""

    bound: Callable[..., Any] = field(kw_only=True)
    derivative: Callable[..., Any] | None = field(default=None, kw_only=True)

    def limit(self, normal_force, area, slip):
        return self.bound(normal_force, area, slip)

    def slope(self, normal_force, area, slip):
        if self.derivative is not None:
            return self.derivative(normal_force, area, slip)
        return super().slope(normal_force, area, slip)


def own(bound, derivative=None):
    return Own(bound=bound, derivative=derivative)


def size(slip):
    return np.linalg.norm(slip, axis=1)


def pushed(law, loop="newton", move=(0.02, -0.01), n=6, crown=0.0):
    """A block of modulus 1 on a rigid plane, its top moved; with a crown only its middle touches."""
    mesh = fem.MeshQuad.init_tensor(np.linspace(-1, 1, 2 * n + 1), np.linspace(0, 1, n + 1))
    mesh = mesh.with_defaults()
    mesh.doflocs[1] += crown * mesh.p[0] ** 2 * (1 - mesh.p[1])
    basis = fem.Basis(mesh, fem.ElementVector(fem.ElementQuad1()))
    x = basis.project(lambda x: np.stack([move[0] + 0 * x[0], move[1] + 0 * x[0]]))
    block = sc.Body(basis, linear_elasticity(0.0, 0.5), D="top", x=x, name="block")
    floor = sc.RigidPlane((0, 0), (0, 1), name="floor")
    pair = sc.Contact(block.surface("bottom"), floor, friction=law, name="joint")
    return sc.ContactSolver(block, pair, loop=loop)


WRONG = {
    "NaN": (lambda N, A, s: np.full_like(N, np.nan), r"returned nan at point 0 at \("),
    "one NaN": (
        lambda N, A, s: np.where(np.arange(13) == 3, np.nan, 0.3 * N),
        "returned nan at point 3 ",
    ),
    "negative": (lambda N, A, s: -0.3 * N, r"returned -[\d.e-]+ at point .*has to be >= 0"),
    "infinite": (lambda N, A, s: np.where(N > 0, np.inf, 0.0), r"returned inf at point .*tied=True"),
    "a number": (lambda N, A, s: 0.3, r"array of shape \(\) for 13 points"),
    "a column": (lambda N, A, s: 0.3 * N[:, None], r"array of shape \(13, 1\) for 13 points"),
    "a matrix": (lambda N, A, s: 0.3 * N * np.exp(s), r"shape \(13, 13\).*np.linalg.norm"),
    "nothing": (lambda N, A, s: None, "None, which is not made of real numbers"),
    "a power": (lambda N, A, s: (N / A) ** (-1 / 3) * N, r"normal force is 0 .*c \* p\*\*\(2/3\)"),
}


@pytest.mark.parametrize(("share", "refused"), [(0.7e-12, False), (1.5e-12, True)])
def test_bounds_are_computed_to_twelve_digits(share, refused):
    """A bound that is negative by the round-off of the largest is zero (COMPUTED)."""
    law = own(lambda N, A, s: np.where(np.arange(len(N)) == 3, -share * N.max(), 0.3 * N))
    if not refused:
        friction = np.abs(pushed(law).solve().friction_stress)
        assert friction[3] < 1e-15 * friction.max()
        return
    with pytest.raises(sc.errors.InputError, match="has to be >= 0"):
        pushed(law).solve()


@pytest.mark.every_value
@pytest.mark.parametrize("loop", LOOPS)
@pytest.mark.parametrize("what", WRONG)
def test_wrong_bounds_are_named(what, loop):
    """Contact, law, point and value of a bound that is none are said, by every loop alike."""
    bound, words = WRONG[what]
    with pytest.raises(sc.errors.InputError, match=r"contact 'joint': Own\.limit") as caught:
        pushed(own(bound), loop).solve()
    with pytest.raises(sc.errors.InputError, match=words):
        raise caught.value


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_wrong_slopes_are_named(value):
    """A derivative that is not finite is refused where the point presses."""
    law = own(lambda N, A, s: 0.1 * N, lambda N, A, s: np.full_like(N, value))
    with pytest.raises(
        sc.errors.InputError, match=r"contact 'joint': Own\.slope returned .* slope out"
    ):
        pushed(law).solve()


def test_laws_may_work_in_place():
    """What a law does to its arguments stays with the law."""

    def bound(normal_force, area, slip):
        area *= np.nan
        slip *= np.nan
        normal_force *= 0.1
        return normal_force

    assert_allclose(pushed(own(bound)).solve().forces, pushed(sc.Coulomb(0.1)).solve().forces)


def test_bounds_may_be_lists():
    """What is one number per point is taken, by the package's own derivative too."""
    law = own(lambda N, A, s: [0.1 * n for n in N])
    assert_allclose(pushed(law).solve().forces, pushed(sc.Coulomb(0.1)).solve().forces)


@pytest.mark.parametrize(
    "law", [sc.Tresca(2.0), sc.Coulomb(0.3, cohesion=2.0), sc.Coulomb(0.3, tau_max=2.0)]
)
def test_points_of_negative_area_have_no_bound(law):
    """Vertices of quadratic faces by mortar: they carry nothing, and no division by zero warns."""
    force, area, none = np.array([1.0, 0.0]), np.array([1.0, -0.5]), np.zeros((2, 2))
    checked = checked_law(law, np.zeros((2, 3)))
    limit = checked.limit(force, area, none)
    assert limit[0] > 0 and limit[1] == 0
    with np.errstate(all="raise"):
        mapped, slips = checked.force(none, force, area, none)
    assert not mapped.any() and not slips.any()


def test_numbers_that_are_not_finite_are_not_blamed_on_the_law():
    """Forces that are NaN already, from a linear solve gone wrong, pass through."""
    for given in (sc.Coulomb(0.5), own(lambda N, A, s: 0.5 * N)):
        law = checked_law(given, np.zeros((2, 2)))
        found = law.limit(np.array([np.nan, 2.0]), np.ones(2), np.zeros((2, 1)))
        assert np.isnan(found[0])
        assert found[1] == 1.0


def test_round_off_below_zero_is_zero():
    """The difference of two equal numbers is no negative bound; one part in a million is."""
    for drop, good in ((1e-16, True), (1e-6, False)):
        law = checked_law(own(lambda N, A, s, drop=drop: -drop * N), np.zeros((1, 2)))
        arguments = np.ones(1), np.ones(1), np.zeros((1, 1))
        if good:
            assert law.limit(*arguments) == 0.0
        else:
            with pytest.raises(sc.errors.InputError, match=">= 0"):
                law.limit(*arguments)


def test_the_certificate_shows_nan():
    """NaN in any number of a certificate is the worst of them; only moments may be missing."""
    good = sc.answers.Certificate(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, np.nan, np.nan, np.nan)
    assert good.worst == 0.0
    assert "moment" not in str(good)
    spoiled = sc.answers.Certificate(0.0, 0.0, 0.0, 0.0, np.nan, 0.0, 0.0, np.nan, np.nan, np.nan)
    assert np.isnan(spoiled.worst)
    assert re.search(r"friction +nan", str(spoiled))


POWERS = {"1/2": 0.5, "2/3": 2 / 3, "1/10": 0.1}


@pytest.mark.every_value
@pytest.mark.parametrize("loop", ["newton", "direct"])
@pytest.mark.parametrize("power", POWERS)
def test_powers_of_the_pressure(power, loop):
    """A bound c p**k A, whose slope at p = 0 is infinite: all slipping points carry it, also at the
    edge of contact, on the way up, back and down to nothing."""
    k, c = POWERS[power], 0.01
    law = own(lambda N, A, s: c * (N / A) ** k * A)
    solver = pushed(law, loop, n=8, crown=0.02)
    for result in solver.history([0.5, 1.0, 0.6]):
        slips = result.status == 2
        assert slips.any()
        assert (result.status == 0).any()
        tau = np.abs(result.friction_stress[:, 0])
        # Options.tolerance: 1e-10 of the largest force
        assert_allclose(tau[slips], c * result.pressure[slips] ** k, rtol=1e-7, atol=1e-12)
        assert (tau <= c * result.pressure**k + 1e-9).all()
        # without the chord at points that just close Newton wanders, or meets a singular matrix
        assert loop != "newton" or result.iterations <= 10
    down = solver.solve(x={"block": np.zeros(solver.system.n)}, start=result)
    assert np.abs(down.forces).max() < 1e-12


def test_infinite_slopes_at_no_force():
    """The exact derivative of a power law is infinite at points that just close: it is not refused."""
    c = 0.01
    exact = own(lambda N, A, s: c * (N / A) ** 0.5 * A, lambda N, A, s: 0.5 * c * (N / A) ** -0.5)
    quotient = own(exact.bound)
    found, same = (pushed(law, n=8, crown=0.02).solve() for law in (exact, quotient))
    assert_allclose(found.forces, same.forces, atol=1e-12)


HARDENING = {
    "line": lambda s: 0.1 + 30 * s,
    "exponential": lambda s: 0.3 - 0.2 * np.exp(-s / 1e-3),
    "tanh": lambda s: 0.3 * np.tanh(s / 1e-3),
    "steep tanh": lambda s: 0.3 * np.tanh(s / 1e-4),
}


@pytest.mark.every_value
@pytest.mark.parametrize("loop", LOOPS)
@pytest.mark.parametrize("name", HARDENING)
def test_hardening_laws(name, loop):
    """Bounds that grow with the slip: friction is what the law says of the slip, and in equilibrium.

    Without the derivative with respect to the slip, Newton's method came within 1e-9 of the largest
    force in 80 iterations and was refused.
    """
    mu = HARDENING[name]
    solver = pushed(own(lambda N, A, s: mu(size(s)) * N), loop, move=(0.004, -0.01))
    result = solver.solve()
    slips, N = result.status == 2, result.normal_force
    # the spring of `fictitious` gives way before a steep law slips
    assert slips.any() or loop == "fictitious"
    bound = mu(size(result.slip)) * N
    tau = np.abs(result.tangential_force[:, 0])
    # Options.tolerance: 1e-10 of the largest force
    assert_allclose(tau[slips], bound[slips], atol=1e-10 * N.max())
    assert (tau <= bound + 1e-10 * N.max()).all()
    body, surface = solver.system.bodies[0], result.contacts[0].secondary
    f = np.zeros(body.n)
    f[surface.dofs] = result.forces
    free = np.setdiff1d(np.arange(body.n), body.D)
    assert_allclose((body.K @ result.u)[free], f[free], atol=1e-10 * N.max())
    assert loop != "newton" or result.iterations <= 25


@dataclass(frozen=True, eq=False)
class Mapped(sc.conditions.FrictionLaw):
    """A bound that grows with slip, with a return map in closed form, spoiled by `change`."""

    change: Callable[..., Any] | None = field(default=None, kw_only=True)

    def limit(self, normal_force, area, slip):
        return 0.2 * normal_force * (1 + 5 * size(slip))

    def return_map(self, trial, normal_force, area, slip):
        most, wanted = self.limit(normal_force, area, slip), size(trial)
        slips = wanted > most
        way = trial / np.where(slips, wanted, 1.0)[:, None]
        force = np.where(slips[:, None], most[:, None] * way, trial)
        turn = np.eye(trial.shape[1]) - way[:, :, None] * way[:, None, :]
        by_trial = (most / np.where(slips, wanted, 1.0))[:, None, None] * turn
        by_normal = (0.2 * (1 + 5 * size(slip)))[:, None] * way
        slid = slip / np.where(size(slip) > 0, size(slip), 1.0)[:, None]
        by_slip = normal_force[:, None, None] * way[:, :, None] * slid[:, None, :]
        found = force, slips, (by_trial, by_normal, by_slip)
        return found if self.change is None else self.change(*found)


@pytest.mark.parametrize("loop", LOOPS)
def test_a_return_map_of_ones_own_is_that_of_its_limit(loop):
    """Closed derivatives change neither the answer nor, much, the way to it; all loops ask for them."""
    asked, partly = [], {"move": (0.008, -0.02), "crown": 0.02}

    def seen(*found):
        asked.append(loop)
        return found

    mine = pushed(Mapped(change=seen), loop, **partly).solve()
    other = pushed(own(lambda N, A, s: 0.2 * N * (1 + 5 * size(s))), loop, **partly).solve()
    assert asked and {1, 2} <= set(mine.status)
    assert_allclose(mine.forces, other.forces, rtol=0, atol=1e-8 * np.abs(other.forces).max())
    assert abs(mine.iterations - other.iterations) <= 1
    assert mine.certificate.friction < 1e-9


NO_MAP = {
    "two things": (lambda f, s, by: (f, s), r"\(force, slips, \(by_trial"),
    "two derivatives": (lambda f, s, by: (f, s, by[:2]), r"\(force, slips, \(by_trial"),
    "numbers": (lambda f, s, by: (f[:, 0], s, by), r"force of what .* has shape \(13,\) .*\(13, 1\)"),
    "one slope": (lambda f, s, by: (f, s, (by[0], 0.2, by[2])), r"by_normal_force of what .*\(13, 1\)"),
    "slips as numbers": (lambda f, s, by: (f, 1.0 * s, by), "True or False for each point"),
    "NaN": (lambda f, s, by: (np.nan * f, s, by), r"returned the force \(nan"),
    "NaN as slope": (lambda f, s, by: (f, s, (by[0], np.nan * by[1], by[2])), "all numbers finite"),
    "more than its limit": (lambda f, s, by: (1.01 * f, s, by), "own limit"),
    "less than its limit": (lambda f, s, by: (np.where(s[:, None], 0.99 * f, f), s, by), "own limit"),
    "nothing slips": (lambda f, s, by: (f, s & False, by), "sticking, at point"),
    "everything slips": (lambda f, s, by: (f, s | True, by), "slipping, at point"),
}


@pytest.mark.parametrize("what", NO_MAP)
def test_return_maps_that_are_none_are_named(what):
    """Contact, law, point and numbers are said, or what it has to return."""
    change, words = NO_MAP[what]
    with pytest.raises(sc.errors.InputError, match=r"contact 'joint': Mapped\.return_map") as caught:
        pushed(Mapped(change=change)).solve()
    with pytest.raises(sc.errors.InputError, match=words):
        raise caught.value
