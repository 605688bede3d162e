"""Friction laws as pure functions: bounds, slopes, return map, tangential element."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from scipy.sparse import csr_matrix

from skfem_contact import Coulomb, FrictionLaw, InputError, Tresca
from skfem_contact.conditions.friction import return_map, tangential_matrix

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
    mapped, slips = return_map(trial, limit)
    length = np.linalg.norm(mapped, axis=1)
    # squares of numbers below 1e-150 are lost
    assert (length <= limit * (1 + 1e-12) + 1e-150).all()
    assert_array_equal(slips, np.linalg.norm(trial, axis=1) > limit)
    assert_array_equal(mapped[~slips], trial[~slips])
    assert_allclose(length[slips], limit[slips], rtol=1e-12, atol=1e-150)
    # parallel to the trial force
    cross = mapped[:, 0] * trial[:, 1] - mapped[:, 1] * trial[:, 0]
    assert_allclose(cross, 0.0, atol=1e-9)
    assert_allclose(return_map(mapped, limit)[0], mapped, rtol=1e-12, atol=1e-150)


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
