"""Bodies that yield and stretch, without contact, against closed forms of whole bodies."""

from __future__ import annotations

import numpy as np
import pytest
import skfem as fem
from numpy.testing import assert_allclose
from plain_newton import newton

import skfem_contact as sc
from skfem_contact.materials import Elastic, FromFunction

INNER, OUTER, E, TRESCA = 50.0, 100.0, 210e3, 300.0
RADIUS = {"measure": lambda x: 2 * np.pi * x[0]}


def hill(c, nu):
    """Pressure and displacement inside a thick ring that has yielded up to the radius c.

    Tresca without hardening, plane strain (Hill, The Mathematical Theory of Plasticity, chapter V.2).
    """
    pressure = TRESCA / 2 * (1 - c**2 / OUTER**2 + 2 * np.log(c / INNER))
    outward = (1 - nu**2) * TRESCA * c**2 / (E * INNER)
    return pressure, outward - (1 + nu) * (1 - 2 * nu) * pressure * INNER / E


def ring_errors(material, element, elements, nu, steps):
    """Errors of the pressure along the path of the plastic radius, one strip of elements along r."""
    mesh = fem.MeshQuad.init_tensor(np.linspace(INNER, OUTER, elements + 1), np.array([0.0, 1.0]))
    basis = fem.Basis(mesh.with_defaults(), fem.ElementVector(element()))
    inner = basis.get_dofs("left").all("u^1")
    component = np.zeros(basis.N, dtype=int)
    for rows in (basis.nodal_dofs, basis.facet_dofs, basis.interior_dofs):
        component[rows[1::2]] = 1
    body = sc.NonlinearBody(basis, material, D=[inner, np.flatnonzero(component)], **RADIUS)
    u, state, before, errors, counts = np.zeros(body.n), None, 0.0, [], []
    for c in np.linspace(INNER, OUTER, 6):
        pressure, now = hill(c, nu)
        for at in np.linspace(before, now, steps + 1)[1:]:
            x = np.zeros(body.n)
            x[inner] = at
            u, state, residuals = newton(body, x, state, u, tolerance=1e-9)
            counts.append(len(residuals) - 1)
        before = now
        found = body.linearize(u, state).internal[inner].sum() / (2 * np.pi * INNER)
        errors.append(found / pressure - 1)
    return np.abs(errors), counts


def test_ring_that_yields_by_tresca():
    """Hill's pressure to 1e-4 with 20 quadratic elements; the material is a function of the user's."""
    nu, mu = 0.3, E / 2.6
    across = np.diag([-1.0, 0.0, 1.0])[:, :, None, None]  # hoop less radial
    elastic = Elastic(E, nu)

    def tresca(H, state):
        stress, tangent, _ = elastic(H - state["plastic"] * across, {})
        tangent = np.array(np.broadcast_to(tangent, (3, 3, 3, 3, *H.shape[2:])))
        excess = stress[2, 2] - stress[0, 0] - TRESCA
        flow = np.maximum(excess, 0.0) / (4 * mu)
        tangent -= (flow > 0) * mu * np.einsum("ij...,kl...->ijkl...", across, across)
        return stress - 2 * mu * flow * across, tangent, {"plastic": state["plastic"] + flow}

    law = FromFunction(tresca, {"plastic": 0.0})
    errors, counts = ring_errors(law, fem.ElementQuad2, 20, nu, 1)
    assert errors.max() < 1e-4
    assert max(counts) <= 5


def test_ring_that_yields_by_von_mises():
    """J2 that keeps its volume is Tresca with 2 Y / sqrt(3) in plane strain; of second order in h."""
    nu = 0.49
    law = sc.J2(E, nu, TRESCA * np.sqrt(3) / 2)
    coarse, fine = (ring_errors(law, fem.ElementQuad1, n, nu, 2)[0] for n in (10, 20))
    assert fine.max() < 3e-4
    assert_allclose(coarse[1:] / fine[1:], 4.0, atol=0.6)
    errors, counts = ring_errors(law, fem.ElementQuad2, 20, nu, 1)
    assert errors.max() < 1e-4
    assert max(counts) <= 5


@pytest.mark.parametrize("shape", [1, 4])
@pytest.mark.parametrize("kind", ["disc", "strip"])
def test_bonded_rubber_pads_do_not_lock(kind, shape):
    """Gent and Lindley: E (1 + 2 S^2) of discs, 4/3 E (1 + S^2) of strips, 3 %."""
    radius = (2.0 if kind == "disc" else 1.0) * shape
    given = RADIUS if kind == "disc" else {}
    rubber = sc.materials.MooneyRivlin(0.3, 0.2, bulk=1e5)
    young = 3 * rubber.shear
    expected = young * (1 + 2 * shape**2) if kind == "disc" else 4 / 3 * young * (1 + shape**2)
    area = np.pi * radius**2 if kind == "disc" else radius

    def modulus(mesh, element, mean=None):
        basis = fem.Basis(mesh.with_defaults(), fem.ElementVector(element()))
        held = [basis.get_dofs("left").all("u^1"), basis.get_dofs("bottom").all("u^2"), "top"]
        body = sc.NonlinearBody(basis, rubber, D=held, mean_dilatation=mean, **given)
        x, top = np.zeros(body.n), basis.get_dofs("top").all("u^2")
        x[top] = -1e-3 * 0.5
        u = newton(body, x, tolerance=1e-8)[0]  # of the bulk modulus, 1e5 times the shear modulus
        return -body.linearize(u).internal[top].sum() / area / 1e-3

    grid = np.linspace(0, radius, 33), np.linspace(0, 0.5, 9)
    quads = fem.MeshQuad.init_tensor(*grid)
    assert_allclose(modulus(quads, fem.ElementQuad1), expected, rtol=0.03)
    triangles = fem.MeshTri.init_tensor(grid[0][::2], grid[1][::2])
    assert_allclose(modulus(triangles, fem.ElementTriP2), expected, rtol=0.03)
    # what it is against: the same elements without the mean lock altogether
    assert modulus(quads, fem.ElementQuad1, mean=False) > 4 * expected


def test_bonded_rubber_block_of_hexahedra():
    """A strip as a solid in plane strain: the answer of quadrilaterals, to round-off."""
    rubber = sc.materials.MooneyRivlin(0.3, 0.2, bulk=1e3)
    grid = np.linspace(0, 2.0, 9), np.linspace(0, 0.5, 5)

    def force(mesh, element, across):
        basis = fem.Basis(mesh.with_defaults(), fem.ElementVector(element()), intorder=4)
        top = basis.get_dofs(lambda p: np.isclose(p[1], 0.5))
        held = [
            basis.get_dofs(lambda p: np.isclose(p[0], 0.0)).all("u^1"),
            basis.get_dofs(lambda p: np.isclose(p[1], 0.0)).all("u^2"),
            top,
            *across(basis),
        ]
        body = sc.NonlinearBody(basis, rubber, D=held)
        x = np.zeros(body.n)
        x[top.all("u^2")] = -0.01
        u = newton(body, x)[0]
        return body.linearize(u).internal[top.all("u^2")].sum()

    plane = force(fem.MeshQuad.init_tensor(*grid), fem.ElementQuad1, lambda b: [])
    solid = force(
        fem.MeshHex.init_tensor(*grid, np.array([0.0, 0.4])),
        fem.ElementHex1,
        lambda b: [b.nodal_dofs[2]],
    )
    assert_allclose(solid, 0.4 * plane, rtol=1e-10)
