"""Places of solids that friction at its bound holds, because its direction turns with the slip."""

from __future__ import annotations

import numpy as np
import pytest
import skfem as fem
from numpy.testing import assert_allclose
from quick_elasticity import linear_elasticity
from skfem.models.elasticity import lame_parameters

import skfem_contact as sc

CENTRE = (0.5, 0.5, 0.5)


def pressed(n, nu=0.3, **settings):
    """A plate that is pressed on a block: the solver, and the plate."""
    t = np.linspace(0, 1, n + 1)
    mesh = fem.MeshHex.init_tensor(t, t, np.linspace(0, 0.5, 3)).with_defaults()
    basis = fem.Basis(mesh, fem.ElementVector(fem.ElementHex1()), intorder=2)
    K = linear_elasticity(*lame_parameters(100.0, nu)).assemble(basis)
    low, high = (mesh.facets_satisfying(lambda x, z=z: np.isclose(x[2], z)) for z in (0.0, 0.5))
    block = sc.Body(basis, K, D=basis.get_dofs(low), name="block")
    shape = sc.RigidPlane(CENTRE, (0, 0, -1))
    plate = sc.RigidBody(shape, about=CENTRE, force=(0, 0, -1.0), name="plate", **settings)
    contact = sc.Contact(block.surface(high), plate, friction=sc.Coulomb(0.4))
    return sc.ContactSolver([block, plate], [contact])


def test_a_moment_that_friction_at_its_bound_carries_decides_the_turn():
    """Nearly all points slip, in directions that turn on: no warning, and the turn is that moment's."""
    result = pressed(4).solve(f={"plate": (0, 0, -1.0, 0, 0, 0.14)})
    assert np.count_nonzero(result.status == 2) == 24
    assert result.indifferent == ()
    turn = result.motion("plate")[1][2]
    turned = pressed(4, D=("rotation z",)).solve(x={"plate": {"rotation z": turn}})
    assert_allclose(turned.moment(CENTRE)[2], 0.14, rtol=1e-9)


def test_a_block_that_slides_straight_is_indifferent():
    """All friction is against the load, at its bound: how far the plate has slid nothing says."""
    with pytest.warns(sc.ContactWarning, match="The place of body 'plate' is indifferent"):
        result = pressed(2, nu=0.0).solve(f={"plate": (0.4, 0, -1.0, 0, 0, 0)})
    assert_allclose(result.force[0], 0.4, rtol=1e-9)
