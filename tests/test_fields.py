"""Fields between the nodes of a contact surface: edges, areas, interpolation."""

from __future__ import annotations

import numpy as np
import pytest
import skfem as fem
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from quick_elasticity import linear_elasticity

import skfem_contact as sc
from skfem_contact.answers import contour, interpolate

ROUND_OFF = 1e-12


def surface(x, element=None, measure=None):
    """Top of a block with columns of nodes at `x`: its points run from right to left."""
    mesh = fem.MeshQuad.init_tensor(np.asarray(x, float), np.array([0.0, 1.0])).with_defaults()
    basis = fem.Basis(mesh, fem.ElementVector(element or fem.ElementQuad1()), intorder=4)
    return sc.Body(basis, linear_elasticity(), measure=measure).surface("top")


def opened(x, a):
    """Closed up to |x| = a, then open like ``(|x| - a)**1.5``."""
    gap = np.maximum(np.abs(x) - a, 0.0) ** 1.5
    return gap == 0, gap


TWENTY = [surface(np.linspace(-2, 2, 21), e) for e in (fem.ElementQuad1(), fem.ElementQuad2())]


@pytest.mark.parametrize("top", TWENTY, ids=["Q1", "Q2"])
@given(a=st.floats(0.3, 1.4))
@settings(deadline=None)
def test_edges_of_the_asymptotic_gap(top, a):
    """A gap that opens by the law of smooth contact shows its edges exactly, on both sides."""
    closed, gap = opened(top.points[:, 0], a)
    found = contour(top, closed, gap)
    assert_allclose(found.segments, [[[a, 1.0]], [[-a, 1.0]]], rtol=0, atol=1e-9)
    assert_allclose(found.area, 2 * a, rtol=0, atol=1e-9)


@pytest.mark.parametrize("a", [0.75, 0.85])
def test_heights_are_zero_on_the_edge(a):
    """Negative inside, and linear about the edge, also where that is before the last closed node."""
    top = TWENTY[0]
    x, order = top.points[:, 0], np.argsort(top.points[:, 0])
    found = contour(top, np.abs(x) < 0.81, opened(x, a)[1])
    assert_allclose(found.segments, [[[a, 1.0]], [[-a, 1.0]]], rtol=0, atol=1e-9)
    assert np.array_equal(found.heights < 0, np.abs(x) < a)
    assert_allclose(np.interp([-a, a], x[order], found.heights[order]), 0.0, atol=1e-9)


def test_graded_steps():
    """The distance between nodes may vary: lengths count, not numbers of nodes."""
    x = np.cumsum([0, 0.1, 0.3, 0.2, 0.5, 0.1, 0.4])
    top = surface(x)
    closed, gap = opened(top.points[:, 0], 0.25)
    assert_allclose(contour(top, closed, gap).segments, [[[0.25, 1.0]]], rtol=0, atol=ROUND_OFF)


@pytest.mark.parametrize(
    ("gap", "part"),
    [
        ((0, 0.1, 1.0, 4.0**1.5), 1.0),  # heights 1 and 4 at 2 and 3: zero at 1.7, too far
        ((0, 1.0, 5.0**1.5, 9.0**1.5), 0.75),  # heights 5 and 9 at 2 and 3
        ((0, 1.0, 8.0), 1 - 1 / 3),  # two open points: heights 1 and 4 at 1 and 2
        ((0, 1.0), 0.5),  # one open point: midway
        ((0, np.inf, np.inf), 0.0),  # the other surface ends
        ((0, 1.0, np.inf), 0.5),
        ((0, 8.0, 1.0), 0.5),  # a gap that closes again says nothing about this edge
        ((0, 0, 1.0, 1.5, 2.0), -0.5),  # and never deeper than half a facet inside
        ((0, 1.0, 1.5, 2.0), 0.5),  # where there is a closed node behind, else midway
    ],
)
def test_fewer_points_than_the_rule_needs(gap, part):
    """Where the gap does not tell, the edge is midway, or the last closed point."""
    gap = np.array(gap)
    last = np.count_nonzero(gap == 0) - 1
    top = surface(np.arange(len(gap)))
    gap = gap[top.points[:, 0].astype(int)]
    edges = contour(top, gap == 0, gap).segments
    assert_allclose(edges, [[[last + part, 1.0]]], rtol=0, atol=1e-11)  # heights of 1e-12 at the least


def test_closed_ends_are_no_edges():
    """A surface that is closed all over has no edge of contact, and its whole area."""
    top = surface([0, 0.3, 1.0])
    closed = np.ones(3, dtype=bool)
    found = contour(top, closed, np.zeros(3))
    assert found.segments.shape == (0, 1, 2)
    assert_allclose(found.area, 1.0)
    assert contour(top, ~closed, np.ones(3)).area == 0.0


def test_area_carries_the_measure():
    """A disc of radius a in axisymmetric contact has the area of a disc, but for its last facet."""
    top = surface(np.linspace(0, 2, 41), measure=lambda x: 2 * np.pi * x[0])
    for a in (1.0, 1.0125, 1.04):
        closed, gap = opened(top.points[:, 0], a)
        # the part of the last facet is taken with the measure at the facet's middle
        assert_allclose(contour(top, closed, gap).area, np.pi * a**2, rtol=0.05**2 / 2)


@pytest.mark.parametrize("element", [fem.ElementQuad1(), fem.ElementQuad2()])
def test_interpolation_by_shape_functions(element):
    """Between nodes a field is that of the element: linear, or quadratic."""
    top = surface([0, 0.3, 0.5, 1.2], element)
    x = np.linspace(0, 1.2, 17)
    points = np.column_stack([x, np.ones_like(x)])
    degree = top.facets.shape[1] - 1
    values = np.column_stack([top.points[:, 0] ** degree, top.points[:, 0]])
    assert_allclose(
        interpolate(top, values, points), np.column_stack([x**degree, x]), rtol=0, atol=1e-9
    )
    # off the surface: the closest point of it
    assert_allclose(interpolate(top, values[:, 1], points + [0.0, 0.2]), x, rtol=0, atol=1e-9)


def test_lengths_along_curved_facets():
    """A quadratic facet on a parabola is as long as its arc; its halves in proportion to the chords."""
    mesh = fem.MeshQuad2.from_mesh(fem.MeshQuad().with_defaults()).with_defaults()
    points = mesh.doflocs.copy()
    points[1] += points[1] * points[0] ** 2  # the top becomes 1 + x^2
    basis = fem.Basis(fem.MeshQuad2(points, mesh.t), fem.ElementVector(fem.ElementQuad2()), intorder=4)
    top = sc.Body(basis, linear_elasticity()).surface(lambda x: x[1] > 1.2)
    arc = 0.5 * np.sqrt(5) + 0.25 * np.arcsinh(2.0)
    chords = np.hypot(0.5, [0.75, 0.25])
    whole = np.ones(3, dtype=bool)
    # five Gauss points: 1e-6 of a facet that turns by 63 degrees
    assert_allclose(contour(top, whole, np.zeros(3)).area, arc, rtol=2e-6)
    half = int(np.argmin(top.points[:, 0]))
    gap = np.where(np.arange(3) == half, np.inf, 0.0)  # where the other side ends, at the middle node
    steep = arc * chords[0] / chords.sum()
    assert_allclose(contour(top, gap == 0, gap).area, steep, rtol=2e-6)
