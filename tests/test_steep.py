"""Friction that jumps where points open: which points have no state, in three dimensions."""

from __future__ import annotations

import re

import internals
import numpy as np
import pytest
import skfem as fem
from numpy.testing import assert_allclose
from skfem.models.elasticity import lame_parameters, linear_elasticity

import skfem_contact as sc

SHEAR = 0.005


def pushed(law: sc.conditions.FrictionLaw, press: float, **options) -> sc.answers.ContactResult:
    """A cube whose top is pressed down and moved sideways, so that friction lifts its rear end."""
    mesh = fem.MeshHex.init_tensor(*3 * [np.linspace(0, 1, 3)]).with_defaults()
    basis = fem.Basis(mesh, fem.ElementVector(fem.ElementHex1()), intorder=3)
    K = linear_elasticity(*lame_parameters(1.0, 0.3)).assemble(basis)
    block = sc.Body(basis, K, D="back", x={"back": (0.02, 0.006, -press)}, name="block")
    seat = sc.Contact(
        block.surface("front"), sc.RigidPlane((0, 0, 0), (0, 0, 1)), friction=law, name="seat"
    )
    return sc.ContactSolver(block, seat, options=sc.Options(**options)).solve()


@pytest.mark.parametrize("press", [0.0007, 0.0025])
def test_a_point_without_state_is_named(press):
    """With friction that rises more and more steeply, its pressure tends to zero, and it slips at
    a share of its bound that tends to the one that the refusal tells."""
    with pytest.raises(sc.errors.NotConverged, match="lost all at once") as refused:
        pushed(sc.Tresca(SHEAR), press, max_cuts=0)
    found = re.search(r"point (\d+) of contact 'seat'.* pressure at ([\d.]+) %", str(refused.value))
    assert found is not None
    point, share = int(found[1]), float(found[2]) / 100
    pressures, shares = [], []
    for mu in (1e3, 1e4):
        seat = pushed(sc.Coulomb(mu, tau_max=SHEAR), press)["seat"]
        pressures.append(seat.normal_force[point])
        shares.append(np.linalg.norm(seat.tangential_force[point]) / (SHEAR * seat.area[point]))
    assert 0.05 < share < 0.95
    # what it rises over is a part of the friction in the order of 1 / mu; three digits are told
    limit = (10 * shares[1] - shares[0]) / 9
    assert_allclose(limit, share, rtol=0, atol=0.001)
    assert_allclose(pressures[1], pressures[0] / 10, rtol=0.02)


@pytest.mark.parametrize("law", [sc.Tresca(SHEAR), sc.Coulomb(0.3, cohesion=SHEAR)])
def test_answers_are_found_from_there_where_there_are_any(law, monkeypatch):
    """The steep law is where the iterations begin; the answer is that of the law itself."""
    usual = pushed(law, 0.002)["seat"]
    internals.replace(monkeypatch, "history.Stepper.starts", ("regularised",))
    found = pushed(law, 0.002)["seat"]
    assert (usual.status == 0).any() and (usual.status == 2).any()
    # the tolerance of the loop
    assert_allclose(found.forces, usual.forces, rtol=0, atol=1e-10 * np.abs(usual.forces).max())


def test_friction_that_begins_at_zero_is_not_made_steeper(monkeypatch):
    """Coulomb's law fails as it did: with its own words."""
    internals.replace(monkeypatch, "history.Stepper.starts", ("cold",))
    with pytest.raises(sc.errors.NotConverged) as refused:
        pushed(sc.Coulomb(0.3), 0.002, max_cuts=0, max_iterations=1)
    assert "has none" not in str(refused.value)
