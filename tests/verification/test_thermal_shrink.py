"""A shrink fit by heating: the load of a temperature is the same fit as an interference."""

from __future__ import annotations

import numpy as np
import pytest
import skfem as fem
from scenes import plane_stress, ring_basis

import skfem_contact as sc
from skfem_contact.reference import lame_rings

E, NU, ALPHA, HEAT = 210e3, 0.3, 12e-6, 150.0
R, INNER, OUTER = 40.0, 20.0, 60.0


def quarter(radii, name, f=None, n=24):
    """A quarter of a ring with symmetry at both cuts."""
    basis = ring_basis(radii, np.linspace(0, np.pi / 2, n + 1), element=fem.ElementQuad1())
    D = np.concatenate([basis.get_dofs("start").all("u^2"), basis.get_dofs("end").all("u^1")])
    load = None if f is None else f.assemble(basis)
    return sc.Body(basis, plane_stress(E, NU), load, D=D, name=name)


def cooling(change):
    """What a change of temperature asks of a free body in plane stress: ``int sigma_T div v``."""
    stress = E / (1 - NU) * ALPHA * change
    return fem.LinearForm(lambda v, w: stress * (v.grad[0, 0] + v.grad[1, 1]))


@pytest.mark.parametrize("method", ["mortar", "node"])
def test_a_hub_that_cools_is_an_interference(method):
    """Cooled by dT a free hub is smaller by alpha dT, a strain that linear elements have exactly."""
    shaft = quarter(np.linspace(INNER, R, 9), "shaft")
    cooled = quarter(np.linspace(R, OUTER, 9), "hub", cooling(-HEAT))
    cold = quarter(np.linspace(R, OUTER, 9), "hub")
    found = []
    for hub, overlap in ((cooled, 0.0), (cold, ALPHA * HEAT * R)):
        sides = hub.surface("inner"), shaft.surface("outer")
        fit = sc.Contact(*sides, method=method, interference=overlap)
        found.append(sc.ContactSolver([shaft, hub], fit).solve())
    by_heat, by_overlap = found
    # in the middle of a facet the chord is nearer to the axis, by 0.05 %: so the hub shrinks less there
    rtol = 1e-9 if method == "node" else 1e-3
    np.testing.assert_allclose(by_heat.pressure, by_overlap.pressure, rtol=rtol)
    steel = (E, NU)
    fit = lame_rings(INNER, R, OUTER, steel, steel, interference=ALPHA * HEAT * R, plane="stress")
    # facets of 3.75 degrees, eight elements through each ring
    assert np.max(np.abs(by_heat.pressure / fit.pressure - 1)) < 0.01
