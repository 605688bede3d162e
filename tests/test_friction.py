"""Friction laws as pure functions: bounds, slopes, return map, tangential element."""

from __future__ import annotations

from dataclasses import dataclass

import internals
import numpy as np
import pytest
import skfem as fem
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from quick_elasticity import linear_elasticity
from scipy.sparse import csr_matrix

import skfem_contact as sc
from skfem_contact import Coulomb, Tresca
from skfem_contact.conditions import (
    Derivatives,
    FrictionLaw,
    radial_return,
    tangential_matrix,
    unlawful,
)
from skfem_contact.errors import InputError

size = st.floats(0.0, 1e3)


@given(force=size, area=size, mu=size, cohesion=size, cap=size)
def test_coulomb_is_the_smaller_of_two_bounds(force, area, mu, cohesion, cap):
    """The bound grows with pressure and cohesion until the shear cap."""
    found = Coulomb(mu, tau_max=cap, cohesion=cohesion).limit(np.array([force]), np.array([area]), None)
    assert_allclose(found, min(mu * force + cohesion * area, cap * area), rtol=1e-15)


@pytest.mark.parametrize("law", [Coulomb(0.3), Coulomb(0.3, tau_max=2.0, cohesion=0.5), Tresca(3.0)])
def test_slopes_are_derivatives(law):
    """The slope is the derivative of the limit by the normal force, away from the cap's corner."""
    force, area, slip = np.array([0.0, 1.0, 4.0, 50.0]), np.full(4, 1.5), np.zeros((4, 1))
    h = 1e-6
    difference = (law.limit(force + h, area, slip) - law.limit(force, area, slip)) / h
    assert_allclose(law.slope(force, area, slip), difference, rtol=0, atol=1e-8)
    # the base class takes a difference quotient that users need not write
    assert_allclose(FrictionLaw.slope(law, force, area, slip), difference, rtol=0, atol=1e-6)


def test_one_value_per_point():
    """Coefficients may differ from point to point; a point without area has no cap of inf times 0."""
    law = Coulomb(np.array([0.1, 0.2, 0.3]))
    assert_allclose(law.limit(np.ones(3), np.array([1.0, 1.0, 0.0]), None), [0.1, 0.2, 0.3])


def test_laws_of_users_need_a_limit():
    """The base class has no bound of its own."""
    with pytest.raises(NotImplementedError, match=r"FrictionLaw does not define limit"):
        FrictionLaw().limit(np.ones(1), np.ones(1), np.zeros((1, 1)))


@pytest.mark.parametrize("value", [-1.0, np.nan, np.inf])
def test_parameters_that_are_no_bounds(value):
    """Negative, infinite and NaN parameters are refused by the name of the law and the parameter."""
    for make, name in (
        (lambda: Coulomb(value), "Coulomb: mu"),
        (lambda: Coulomb(0.1, cohesion=value), "Coulomb: cohesion"),
        (lambda: Tresca(value), "Tresca: tau_max"),
    ):
        with pytest.raises(InputError, match=name):
            make()


@given(st.lists(st.tuples(st.floats(-1e3, 1e3), st.floats(-1e3, 1e3), size), min_size=1, max_size=5))
def test_return_map_is_a_projection(points):
    """A trial force is brought to the nearest one within the bound; doing so twice changes nothing."""
    values = np.array(points)
    trial, limit = values[:, :2], values[:, 2]
    mapped, slips = radial_return(trial, limit)
    length = np.linalg.norm(mapped, axis=1)
    # squares of numbers below 1e-150 are lost
    assert (length <= limit * (1 + 1e-12) + 1e-150).all()
    assert_array_equal(slips, np.linalg.norm(trial, axis=1) > limit)
    assert_array_equal(mapped[~slips], trial[~slips])
    assert_allclose(length[slips], limit[slips], rtol=1e-12, atol=1e-150)
    # parallel to the trial force
    cross = mapped[:, 0] * trial[:, 1] - mapped[:, 1] * trial[:, 0]
    assert_allclose(cross, 0.0, atol=1e-9)
    assert_allclose(radial_return(mapped, limit)[0], mapped, rtol=1e-12, atol=1e-150)


@pytest.mark.parametrize("t", [1, 2])
def test_tangential_matrix_is_the_energy_of_its_springs(t):
    """u' K_t u is the sum of s' G s over the points, for one tangent and for two."""
    rng = np.random.default_rng(t)
    B_t = rng.standard_normal((3 * t, 7))
    spring = rng.standard_normal((3, t, t))
    spring = spring @ spring.transpose(0, 2, 1)
    u = rng.standard_normal(7)
    s = (B_t @ u).reshape(3, t)
    energy = np.einsum("ik,ikl,il->", s, spring, s)
    assert_allclose(u @ tangential_matrix(csr_matrix(B_t), spring) @ u, energy, rtol=1e-12)


@dataclass(frozen=True, eq=False)
class Worn(FrictionLaw):
    """A bound that grows with the pressure and with the size of the slip, and less along one axis."""

    def limit(self, normal_force, area, slip):
        grown = 1.0 + 0.2 * np.sqrt(0.1 + np.sum(slip**2, axis=1)) + 0.05 * slip[:, 0]
        return 0.4 * normal_force**0.9 * grown + 0.1 * area


@pytest.mark.parametrize("t", [1, 2])
@pytest.mark.parametrize("law", [Coulomb(0.3, tau_max=2.0, cohesion=0.1), Tresca(1.0), Worn()])
def test_derivatives_of_the_return_map(law, t):
    """By central differences of the forces: of trial force, normal force and slip, each by itself."""
    rng = np.random.default_rng(t)
    m, h = 40, 1e-5
    trial, slip = rng.standard_normal((2, m, t))
    force, area = rng.uniform(0.5, 5.0, m), rng.uniform(0.5, 1.5, m)
    found, slips, by = law.return_map(trial, force, area, slip)
    assert 5 < slips.sum() < 35
    far = np.abs(np.linalg.norm(trial, axis=1) - law.limit(force, area, slip)) > 1e-3  # of the corner
    far &= np.abs(0.3 * force + 0.1 * area - 2.0 * area) > 1e-3  # and of the cap's

    def change(*where):
        a, b, c = where
        ends = [law.return_map(trial + s * a, force + s * b, area, slip + s * c)[0] for s in (1, -1)]
        return (ends[0] - ends[1])[far] / (2 * h)

    for k in range(t):
        axis = h * np.eye(t)[k]
        assert_allclose(by.trial[far, :, k], change(axis, 0.0, 0.0), rtol=0, atol=1e-8)
        # quotients of the law have seven digits
        assert_allclose(by.slip[far, :, k], change(0.0, 0.0, axis), rtol=0, atol=1e-6)
    assert_allclose(by.normal_force[far], change(0.0, h, 0.0), rtol=0, atol=1e-6)
    assert_allclose(found, radial_return(trial, law.limit(force, area, slip))[0], rtol=1e-15)


def test_where_slip_begins_the_bound_grows_ahead():
    """At no slip a bound of its size has a kink: the derivative is that along the friction."""

    @dataclass(frozen=True, eq=False)
    class Hardening(FrictionLaw):
        def limit(self, normal_force, area, slip):
            return 0.1 * normal_force + 2.0 * np.linalg.norm(slip, axis=1)

    one = np.ones(2)
    slip = np.array([[0.0, 0.0], [0.3, 0.4]])  # the second point has slipped; it gives the step
    by = Hardening().return_map(np.array([[-6.0, 8.0], [6.0, 8.0]]), one, one, slip)[2]
    direction = np.array([[-0.6, 0.8], [0.6, 0.8]])
    expected = 2.0 * direction[:, :, None] * direction[:, None, :]
    assert_allclose(by.slip, expected, rtol=0, atol=1e-6)


def test_a_trial_force_beyond_any_bound_gives_the_bound():
    """Where a point slips in a known direction, the force is the bound to the last digit."""
    limit, beyond = np.array([0.0, 1e-30, 0.3, 7.0, 1e30]), internals.original("conditions.BEYOND")
    for way in (1.0, -1.0):
        force, slips = radial_return(np.full((5, 1), way * beyond), limit)
        assert_array_equal(force[:, 0], way * limit)
        assert slips.all()


def test_return_maps_that_are_none():
    """Sticking beyond the bound, slipping below it, and forces off the bound, each by itself."""
    by = Derivatives(np.zeros((5, 1, 1)), np.zeros((5, 1)), np.zeros((5, 1, 1)))
    trial, limit = np.array([[0.5], [2.0], [2.0], [0.5], [2.0]]), np.ones(5)
    force, slips = np.array([[0.5], [1.0], [2.0], [1.0], [0.9]]), np.array([0, 1, 0, 1, 1]) > 0
    assert_array_equal(unlawful(trial, limit, force, slips, by), [False, False, True, True, True])


@dataclass(frozen=True, eq=False)
class Along(sc.conditions.FrictionLaw):
    """A coefficient that goes from `mu` to `end` over a slip of `length`."""

    mu: float
    end: float
    length: float = 0.05

    def limit(self, normal_force, area, slip):
        share = np.exp(-np.linalg.norm(slip, axis=1) / self.length)
        return (self.end + (self.mu - self.end) * share) * normal_force


@pytest.mark.parametrize(
    ("law", "push", "said"),
    [
        (Along(0.4, 0.2), 0.1, True),
        (Along(0.4, 0.2), 0.0, False),  # nothing slips
        (Along(0.2, 0.4), 0.1, False),
        (sc.Coulomb(0.3), 0.1, False),
    ],
)
def test_a_report_says_of_friction_that_falls(law, push, said):
    """Two loops held a block between two jaws in two places, both in equilibrium, without a word."""
    mesh = fem.MeshQuad().refined(2).with_defaults()
    basis = fem.Basis(mesh, fem.ElementVector(fem.ElementQuad1()), intorder=2)
    down = {"top": (push, -0.02)}
    block = sc.Body(basis, linear_elasticity(), D="top", x=down, name="block")
    contact = sc.Contact(block.surface("bottom"), sc.RigidPlane((0, 0), (0, 1)), friction=law)
    report = sc.ContactSolver(block, contact).solve().report()
    assert ("falls with the slip" in report) == said


@dataclass(frozen=True, eq=False)
class Breaks(sc.conditions.FrictionLaw):
    """A coefficient that drops once a point has slipped by a ten thousandth of the block."""

    def limit(self, normal_force, area, slip):
        return np.where(np.linalg.norm(slip, axis=1) < 1e-4, 0.5, 0.1) * normal_force


def test_a_loop_that_fails_at_friction_that_falls_names_the_law_and_another_loop():
    """The loop that the message names passes, and all of the block slides in the end."""
    x = np.linspace(0, 1, 25)
    mesh = fem.MeshQuad.init_tensor(x, x).with_defaults()
    basis = fem.Basis(mesh, fem.ElementVector(fem.ElementQuad1()), intorder=2)
    block = sc.Body(basis, sc.Elastic(1e3, 0.3), D="top", name="block")
    floor = sc.RigidPlane((0, 0), (0, 1))
    foot = sc.Contact(block.surface("bottom"), floor, friction=Breaks(), name="foot")
    steps = [{"x": {"block": {"top": (push, -0.01)}}} for push in np.linspace(0, 0.04, 9)]
    with pytest.raises(
        sc.errors.NotConverged, match=r"of contact 'foot' falls with the slip.*loop='newton'"
    ):
        list(sc.ContactSolver(block, foot, loop="fictitious").history(steps))
    last = list(sc.ContactSolver(block, foot, loop="newton").history(steps))[-1]
    assert_allclose(last.force[0], -0.1 * last.force[1])


@pytest.mark.parametrize(("length", "most"), [(1e-4, 15), (1e-3, 30)])
def test_a_bound_that_falls_with_the_slip_lags_in_whole_steps(length, most):
    """No line search follows a bound that falls: halved steps took 79 and 97 iterations, or failed."""
    x = np.linspace(0, 1, 5)
    mesh = fem.MeshQuad.init_tensor(2 * np.linspace(0, 1, 9), x).with_defaults()
    basis = fem.Basis(mesh, fem.ElementVector(fem.ElementQuad1()), intorder=2)
    block = sc.Body(basis, sc.Elastic(1.0, 0.3), D="top", x={"top": (0.02, -0.01)}, name="block")
    floor, law = sc.RigidPlane((0, 0), (0, 1)), Along(0.6, 0.05, length)
    solver = sc.ContactSolver(block, sc.Contact(block.surface("bottom"), floor, friction=law))
    results = list(solver.history([0.3, 0.6, 1.0]))
    assert sum(result.iterations for result in results) <= most


def test_a_coefficient_that_is_round_off_is_none():
    """A free cube on a floor stands anywhere, and is not looked for where round-off would hold it."""
    mesh = fem.MeshHex().with_boundaries({"low": lambda x: x[2] == 0, "high": lambda x: x[2] == 1})
    basis = fem.Basis(mesh, fem.ElementVector(fem.ElementHex1()), intorder=2)
    cube = sc.Body(basis, sc.Elastic(1.0, 0.3), f={"high": (0.0, 0.0, -0.01)}, name="cube")
    floor = sc.RigidPlane((0, 0, 0), (0, 0, 1))
    contact = sc.Contact(cube.surface("low"), floor, friction=sc.Coulomb(1e-17))
    with pytest.warns(sc.errors.ContactWarning, match="place of body 'cube' is indifferent"):
        result = sc.ContactSolver(cube, contact).solve()
    assert result.iterations <= 2
