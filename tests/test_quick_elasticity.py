"""The form that tests assemble is that of scikit-fem."""

from __future__ import annotations

import numpy as np
import pytest
import quick_elasticity
import skfem as fem
from skfem.models.elasticity import linear_elasticity
from solid_meshes import KINDS, cube

PLANE = {
    "P1": (fem.MeshTri, fem.ElementTriP1),
    "P2": (fem.MeshTri, fem.ElementTriP2),
    "Q1": (fem.MeshQuad, fem.ElementQuad1),
    "Q2": (fem.MeshQuad, fem.ElementQuad2),
}


def bent(x):
    """No cell stays a parallelogram, and the edges of quadratic ones are curved."""
    return x + 0.1 * np.sin(3 * x[::-1]) * x


@pytest.mark.parametrize("kind", [*PLANE, *KINDS])
def test_the_quick_form_is_that_of_scikit_fem(kind):
    """Every entry of the stiffness of a bent body, and the integrand at a field."""
    if kind in PLANE:
        mesh_type, element = PLANE[kind]
        mesh = mesh_type.init_tensor(*[np.linspace(0, 1, 3)] * 2)
        mesh = type(mesh)(bent(mesh.doflocs), mesh.t)
    else:
        mesh, element = cube(kind, 1, bent), KINDS[kind][2]
    basis = fem.Basis(mesh, fem.ElementVector(element()), intorder=3)
    forms = [of(1.3, 0.7) for of in (quick_elasticity.linear_elasticity, linear_elasticity)]
    K, known = (form.assemble(basis).toarray() for form in forms)
    # sums of some hundred products of numbers up to the largest entry
    np.testing.assert_allclose(K, known, rtol=0, atol=1e-13 * np.abs(known).max())
    u = basis.interpolate(np.random.default_rng(0).standard_normal(basis.N))
    one, other = (
        fem.Functional(lambda w, f=f: f.form(w["u"], w["u"], w)).assemble(basis, u=u) for f in forms
    )
    assert one == pytest.approx(other, rel=1e-12)
