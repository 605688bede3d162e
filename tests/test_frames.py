"""Frames of small sliding: normals of both sides weighted with the stiffness that K itself shows."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import scipy.sparse as sp
import skfem as fem
from numpy.testing import assert_allclose
from quick_elasticity import linear_elasticity
from skfem.models.elasticity import lame_parameters

import skfem_contact as sc
from skfem_contact.conditions import pair, plane_moduli
from skfem_contact.pairing import dual_mortar, node_to_segment

ELEMENTS = {
    "P1": (fem.MeshTri, fem.ElementTriP1),
    "Q1": (fem.MeshQuad, fem.ElementQuad1),
    "P2": (fem.MeshTri, fem.ElementTriP2),
    "Q2": (fem.MeshQuad, fem.ElementQuad2),
    "S2": (fem.MeshQuad, fem.ElementQuadS2),
}


def block(side, *, kind="Q1", E=1.0, nu=0.3, n=6, bulge=0.0, D=None, K=None, shift=0.0):
    """A unit square below (side -1) or above the axis, its face y = bulge x²/2, centred."""
    mesh_type, element = ELEMENTS[kind]
    x, y = np.linspace(-0.5, 0.5, n + 1), np.linspace(0, 1, n + 1)
    mesh = mesh_type.init_tensor(x, y if side > 0 else y - 1.0).with_defaults()
    p = mesh.p.copy()
    p[1] += 0.5 * bulge * p[0] ** 2 * (1 - np.abs(p[1])) + shift
    mesh = replace(mesh, doflocs=p)
    basis = fem.Basis(mesh, fem.ElementVector(element()), intorder=4)
    K = linear_elasticity(*lame_parameters(E, nu)) if K is None else K(basis)
    return sc.Body(basis, K, D=basis.get_dofs().all() if D == "all" else None, name=f"b{side}")


def face(body):
    return body.surface("bottom" if body.name == "b1" else "top")


@pytest.mark.every_value
@pytest.mark.parametrize("kind", ELEMENTS)
@pytest.mark.parametrize("nu", [0.0, 0.3, 0.499])
def test_plane_modulus_of_any_element(kind, nu):
    """The nodal forces of a linear field show E / (1 - nu²), on straight and on bent boundaries."""
    for n, bulge in ((3, 0.0), (6, 0.0), (5, 0.7)):
        body = block(1, kind=kind, E=7.0, nu=nu, n=n, bulge=bulge)
        assert_allclose(plane_moduli(face(body)), 7.0 / (1 - nu**2), rtol=1e-9)


def test_plane_modulus_where_the_body_is_not_homogeneous():
    """Each node shows the modulus around it, and its neighbour's at the end of the surface."""

    def K(basis):
        lam, mu = lame_parameters(1.0, 0.25)

        @fem.BilinearForm
        def form(u, v, w):
            return np.where(w.x[0] > 0, 100.0, 1.0) * linear_elasticity(lam, mu).form(u, v, w)

        return form

    body = block(1, n=6, K=K)
    x, modulus = face(body).points[:, 0], plane_moduli(face(body))
    exact = np.where(x > 0, 100.0, 1.0) / (1 - 0.25**2)
    away = np.abs(x) > 1e-9
    assert_allclose(modulus[away], exact[away], rtol=1e-9)
    assert 1.0 < modulus[~away].item() < 110.0


def test_springs_do_not_matter_and_no_body_has_a_diagonal():
    """Springs to the ground change nothing; a K that is no elastic body's shows its diagonal."""
    plain = block(1)
    dofs = face(plain).dofs
    springs = np.zeros(plain.n)
    springs[dofs] = 1e6
    on_springs = sc.Body(plain.basis, plain.K + sp.diags(springs), name="b1")
    assert_allclose(plane_moduli(face(on_springs)), plane_moduli(face(plain)), rtol=1e-6)
    alone = sc.Body(plain.basis, sp.diags(np.full(plain.n, 3.0)).tocsr(), name="b1")
    assert_allclose(plane_moduli(face(alone)), 3.0)


def contact(E=(1.0, 1.0), bulges=(0.4, 0.0), **settings):
    upper = block(1, E=E[0], bulge=bulges[0], n=8)
    lower = block(-1, E=E[1], bulge=bulges[1], n=6, shift=-1e-3)
    sides = [face(upper), face(lower)]
    if settings.pop("swap", False):
        sides.reverse()
    return sc.Contact(*sides, **settings)


def slopes(pairing):
    """Slope of the interface at each point, whichever side is secondary."""
    inner = np.abs(pairing.points[:, 0]) < 0.3
    return pairing.points[inner, 0], -(pairing.normal[:, 0] / pairing.normal[:, 1])[inner]


@pytest.mark.pairwise
@pytest.mark.parametrize("swap", [False, True])
@pytest.mark.parametrize("method", ["node", "mortar"])
@pytest.mark.parametrize("E", [(1.0, 1.0), (4.0, 1.0), (1.0, 1000.0), (1e6, 1.0)])
def test_the_stiffer_side_keeps_its_shape(E, method, swap):
    """The slope of the frames is the mean of both slopes, weighted with the moduli."""
    x, slope = slopes(pair(contact(E, (0.4, -0.2), method=method, swap=swap)))
    exact = (E[0] * 0.4 * x - E[1] * 0.2 * x) / (E[0] + E[1])
    # normals of chords of 1/8, and the angles' cubes
    assert_allclose(slope, exact, atol=3e-3)
    assert np.abs(slope).max() > 0.01


@pytest.mark.parametrize("method", ["node", "mortar"])
def test_a_body_that_is_prescribed_is_rigid(method):
    """A boundary whose nodes are all prescribed has its own normal, however soft its K."""
    sides = face(block(1, bulge=0.4, n=8)), face(block(-1, E=1e-6, n=6, D="all", shift=-1e-3))
    _, slope = slopes(pair(sc.Contact(*sides, method=method)))
    assert_allclose(slope, 0.0, atol=1e-12)


@pytest.mark.parametrize("method", ["node", "mortar"])
def test_flat_and_matching_interfaces_stay_as_they_are(method):
    """Where both sides have one normal nothing is weighted, and nothing is measured anew."""
    plain = {"mortar": dual_mortar, "node": node_to_segment}[method]
    settled = contact(bulges=(0.0, 0.0), method=method)
    flat, before = pair(settled), plain(settled.secondary, settled.primary)
    assert np.array_equal(flat.normal, before.normal)
    assert np.array_equal(flat.gap, before.gap)
    assert not flat.tilt.any()


@pytest.mark.parametrize("method", ["node", "mortar"])
def test_finite_sliding_and_glue_keep_their_frames(method):
    """Finite sliding has the frames of the deformed surfaces; glue needs none."""
    for settings in ({"sliding": "finite"}, {"tied": True}):
        one_side = pair(contact(method=method, **settings))
        own = one_side.secondary_normal if method == "mortar" else one_side.primary_normal
        assert_allclose(one_side.normal, own, atol=1e-15)
        assert one_side.tilt.max() > 0.1


def disc(centre, radius=0.5):
    mesh = fem.MeshTri.init_circle(3)
    mesh = replace(mesh, doflocs=radius * mesh.p + np.array(centre)[:, None])
    return sc.Body(
        fem.Basis(mesh, fem.ElementVector(fem.ElementTriP1())), linear_elasticity(1, 1), name="disc"
    )


@pytest.mark.parametrize("swap", [False, True])
def test_at_a_corner_the_other_side_has_the_normal(swap):
    """A disc above the corner of a block: the vertex has no normal, the disc has."""
    turn = np.pi / 4
    corner = fem.MeshQuad.init_tensor(np.linspace(-1, 0, 5), np.linspace(-1, 0, 5))
    block = sc.Body(
        fem.Basis(corner, fem.ElementVector(fem.ElementQuad1())), linear_elasticity(1, 1), name="block"
    )
    up = np.array([np.cos(turn), np.sin(turn)])
    round_body = disc(0.501 * up)
    near = round_body.surface(lambda x: (x[0] + x[1]) < 0.2, name="rim")
    sides = block.surface(lambda x: (x[0] > -0.01) | (x[1] > -0.01), name="corner"), near
    contact = sc.Contact(*(sides[::-1] if swap else sides), method="node")
    pairing = pair(contact)
    if swap:
        i = np.argmin(np.linalg.norm(pairing.points - 0.001 * up, axis=1))
        exact = up
    else:
        i = np.argmin(np.linalg.norm(pairing.points, axis=1))
        exact = -up
    assert pairing.paired[i]
    assert_allclose(pairing.normal[i], exact, atol=1e-2)
