"""Hertz (H1) and Cattaneo-Mindlin (H4) between blocks whose meshes do not match; edges of contact.

The lower elements have 2/3 or 4/3 of the size of the upper ones, which carry the contact points.
`points` counts elements of the upper block per half width, chosen so that the edge of contact lies at
the same place between the nodes of either mesh (halfway on the upper one): the error on the facet at
the edge (see `test_hertz`) then is the same on all meshes and orders are clean.

L2 errors of the nodal pressure in percent; quadratic elements have twice the size, as many nodes:

    =======  =====================  =====================  =====================
    points   Q1 node, 2/3 and 4/3   Q1 mortar              Q2 mortar
    =======  =====================  =====================  =====================
    8.5      15.2   6.0             .90   1.39             .55   .51
    16.5     15.0   5.3             .47   .71              .28   .25
    32.5     14.9   5.0             .25   .37              .14   .13
    48.5     14.9   4.9             .18   .25              .10   .08
    =======  =====================  =====================  =====================
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import pytest
from numpy.testing import assert_allclose
from smooth_contacts import ordered
from unlike_meshes import QUADRATIC, UnlikeBlocks

import skfem_contact as sc
from skfem_contact.reference import cattaneo_mindlin, hertz_line

R = 100.0  # radius of the profile over the half width of contact, which is 1


def scene(points, law=None, **settings):
    """Blocks, the load at which the exact half width is 1, and Hertz' answer to it."""
    blocks = UnlikeBlocks(1 / points, lambda x: x[0] ** 2 / (2 * R), law=law, **settings)
    P = hertz_load = np.pi / 4 * blocks.E_star / R
    for _ in range(30):
        P = hertz_load + np.pi / 4 * blocks.E_star * blocks.added_curvature(P)
    exact = hertz_line(P, R, blocks.E_star, added_curvature=blocks.added_curvature(P))
    assert_allclose(exact.a, 1.0, rtol=1e-12)
    return blocks, P, exact


@lru_cache(maxsize=2)  # a result holds the factors of its bodies
def hertz(points, method, kind="Q1", ratio=2 / 3, H=20.0, growth=1.15):
    blocks, P, exact = scene(points, method=method, kind=kind, ratio=ratio, H=H, growth=growth)
    return blocks.press(P, 1.0)[0], exact


def pressure_error(result, exact):
    """Relative L2 error of the nodal pressures, weighted with the tributary areas."""
    x, area, p, _ = ordered(result)
    nodal = exact.pressure(x)
    return np.sqrt(area @ (p - nodal) ** 2 / (area @ nodal**2))


def orders(points, errors):
    return np.log(np.array(errors[:-1]) / errors[1:]) / np.log(np.array(points[1:]) / points[:-1])


POINTS = (8.5, 16.5, 32.5, 48.5)


@pytest.mark.slow
@pytest.mark.parametrize("ratio", [2 / 3, 4 / 3])
def test_H1_mortar_converges_and_node_to_segment_does_not(ratio):
    """L2 error of the Hertz pressure: mortar of order 1 and below 1 %, node-to-segment stays."""
    # a mesh refines only where it does so everywhere: with elements that grow by 15 % beyond the
    # contact on every mesh, the error of that part stays and the orders fall to 0.8
    growth = [1.15 ** (POINTS[0] / n) for n in POINTS]
    mortar = [
        pressure_error(*hertz(n, "mortar", ratio=ratio, growth=g))
        for n, g in zip(POINTS, growth, strict=True)
    ]
    node = [pressure_error(*hertz(n, "node", ratio=ratio)) for n in POINTS]
    # measured .22 and .33 % with 32 points: what matching meshes have, .29 % with 30
    assert mortar[2] < 5e-3
    # order 1 is what the square root at the edge allows on uniform meshes; measured 1.03 to 1.07
    assert (orders(POINTS, mortar) > 1.0).all()
    assert min(node) > 0.04
    assert node[3] > 0.8 * node[0]


@pytest.mark.parametrize("method", ["node", "mortar"])
def test_H1_resultant_by_either_method(method):
    """Whatever its distribution, the pressure adds up to the load."""
    result, exact = hertz(16.5, method)
    assert_allclose(result.normal_force.sum(), exact.P, rtol=1e-10)
    assert_allclose(result.integrate(result.traction), result.force, rtol=0, atol=1e-12 * exact.P)
    assert result.certificate.worst < 1e-10


@pytest.mark.parametrize(
    ("kind", "ratio"),
    [("P1", 4 / 3), pytest.param("P2", 2 / 3, marks=pytest.mark.slow), ("Q2", 4 / 3), ("S2", 2 / 3)],
)
def test_H1_other_elements(kind, ratio):
    """Triangles and quadratic elements carry the pressure without oscillation, of order 1."""
    points = (8.5, 16.5, 32.5) if kind not in QUADRATIC else (4.25, 8.25)
    found = [hertz(n, "mortar", kind, ratio) for n in points]
    errors = [pressure_error(*f) for f in found]
    # quadratic elements of twice the size: as many nodes as the linear ones. The square-root edge
    # decides, which quadratics do not resolve any better
    assert errors[-1] < (0.01 if kind == "P1" else 0.003)
    assert (orders(points, errors) > 0.9).all()
    x, _, p, _ = ordered(found[-1][0])
    inside = np.abs(x) < 0.8
    # no node off the smooth curve by more than a hundredth, ends and middles alike
    assert np.abs(p - found[-1][1].pressure(x))[inside].max() < 5e-3 * found[-1][1].p0


@pytest.mark.every_value
@pytest.mark.parametrize("part", [0.03, 0.28, 0.78])
@pytest.mark.parametrize("method", ["node", "mortar"])
@pytest.mark.parametrize("kind", ["Q1", "P1", "Q2", "P2"])
def test_H1_edge_of_contact_within_a_facet(kind, method, part):
    """The edges of contact are known to a small part of the distance between nodes."""
    ratio = 1.0 if method == "node" else 0.77
    points = 6 + part / 2 if kind in QUADRATIC else 12 + part
    spacing = 1 / points / (2 if kind in QUADRATIC else 1)
    result, exact = hertz(points, method, kind, ratio, 10.0)
    edges = np.sort(result.contact_edges[:, 0])
    # measured: .09 at most; the last closed node is off by up to .9
    assert_allclose(edges, [-exact.a, exact.a], rtol=0, atol=0.12 * spacing)
    assert_allclose(result.contact_area, 2 * exact.a, rtol=0, atol=0.24 * spacing)


def test_H1_pressure_between_nodes():
    """Between nodes the pressure is as good as at them."""
    result, exact = hertz(32.5, "mortar")
    x = np.linspace(-0.9, 0.9, 400)
    p = result.interpolate(result.pressure, np.column_stack([x, 0 * x]))
    assert_allclose(p, exact.pressure(x), rtol=0, atol=0.005 * exact.p0)


@pytest.mark.every_value
@pytest.mark.parametrize(
    ("points", "ratio"),
    [
        (8.5, 2 / 3),
        (8.5, 4 / 3),
        (16.5, 2 / 3),
        (16.5, 4 / 3),
        (32.5, 4 / 3),
        pytest.param(32.5, 2 / 3, marks=pytest.mark.slow),
    ],
)
def test_H4_cattaneo_mindlin(points, ratio):
    """Friction under a tangential load below the limit: within .7 h/a in L2, stick to one facet."""
    mu, share = 0.5, 0.6
    blocks, P, exact = scene(points, sc.Coulomb(mu), ratio=ratio)
    normal, depth = blocks.press(P, 1.0)
    # meshes that do not match are no mirror images: some friction comes with the normal load
    assert np.abs(normal.tangential_force).max() < 1e-3 * P
    Q = share * mu * P
    result = blocks.solver.solve(x=blocks.lowered(depth), f=blocks.push(Q), start=normal)
    x, area, _, q = ordered(result)
    known = cattaneo_mindlin(exact, mu, Q)
    true = np.sign(q.sum()) * known.traction(x)
    # the gate for linear elements on matching meshes; measured a tenth to nine tenths of it
    assert np.sqrt(area @ (q - true) ** 2 / (area @ true**2)) <= 0.7 / points
    assert_allclose(abs(area @ q), Q, rtol=1e-9)
    stick = np.abs(result.points[result.status == 1, 0]).max()
    assert abs(stick - known.c) <= 1 / points
