"""The edge of contact on faces, and the area within it."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation
from solid_meshes import KINDS, at, body, cube, shuffled

from skfem_contact.answers import contour

every_kind = pytest.mark.parametrize("kind", KINDS)


def square(kind, n, turn=None, seed=None, **options):
    """The square from -1 to 1, of faces whose inner nodes are moved; its coordinates in the plane."""

    def place(x):
        inner = np.prod(np.sin(np.pi * x[:2]), axis=0)
        move = 0.15 / n * inner * np.array([np.sin(9 * n * x[1]), np.cos(7 * n * x[0])])
        return np.vstack([2 * (x[:2] + move) - 1, x[2:]])

    mesh = cube(kind, n, place, layers=1)
    mesh = mesh if seed is None else shuffled(mesh, seed)
    facets = mesh.facets_satisfying(at(2, 1.0))
    turn = np.eye(3) if turn is None else turn
    mesh = type(mesh)(turn @ mesh.doflocs, mesh.t)
    surface = body(mesh, kind, **options).surface(facets)
    return surface, surface.points @ turn[:, :2]


def hertz_gap(r, a):
    """Of a sphere of radius one on a half-space (Johnson, Contact Mechanics, eq. 3.42a and d)."""
    q = np.maximum(r / a, 1.0)
    return a**2 / np.pi * (np.sqrt(q**2 - 1) + (q**2 - 2) * np.arccos(1 / q))


@every_kind
@pytest.mark.parametrize("direction", [(1.0, 0.0), (0.6, 0.8)])
def test_a_straight_edge_is_found_exactly(kind, direction):
    """Where the gap opens by the law of smooth contact along a line, at any angle to the faces."""
    surface, x = square(kind, 8)
    along = x @ np.array(direction)
    gap = np.maximum(along - 0.1, 0.0) ** 1.5
    found = contour(surface, gap == 0, gap)
    inner = np.abs(found.segments[..., :2]).max(axis=(1, 2)) < 0.5
    # in corners of the square there may be too few open nodes
    assert_allclose(found.segments[inner][..., :2] @ np.array(direction), 0.1, rtol=0, atol=1e-9)
    assert inner.sum() > 4
    if direction == (1.0, 0.0):
        # edges of quadratic faces are bent here, the triangles between their nodes are straight
        assert_allclose(found.area, 2.2, rtol=0, atol=1e-9 if kind in ("tri3", "quad4") else 1e-3)
        length = np.linalg.norm(found.segments[:, 1] - found.segments[:, 0], axis=1)
        assert_allclose(length.sum(), 2.0, rtol=0, atol=1e-9)


@every_kind
@pytest.mark.every_value
@pytest.mark.parametrize("n, tolerance", [(12, 0.03), (24, 0.015)])
def test_the_circle_of_a_sphere(kind, n, tolerance):
    """3 and 6 faces to the radius: the area to 3 % and 1.5 %, wherever the circle is between nodes."""
    if n == 24 and kind not in ("tri3", "quad4"):
        n = 16
    surface, x = square(kind, n)
    for a, middle in ((0.45, (0, 0)), (0.53, (0.03, 0.05)), (0.58, (0.06, -0.02))):
        r = np.linalg.norm(x - np.array(middle), axis=1)
        found = contour(surface, r <= a, hertz_gap(r, a))
        assert_allclose(found.area, np.pi * a**2, rtol=tolerance)
        edge = np.linalg.norm(found.segments[..., :2] - np.array(middle), axis=2)
        assert_allclose(edge, a, rtol=0, atol=1.0 / n)  # half a face, at the worst of its points


@every_kind
def test_position_and_numbering_do_not_matter(kind):
    """Turned in space, renumbered, in millimetres: the same area and the same length of the edge."""
    turn = Rotation.random(random_state=1).as_matrix()
    found = []
    for settings in ({}, {"turn": turn}, {"seed": 3}, {"turn": 1e3 * turn}):
        surface, x = square(kind, 8, **settings)
        unit = np.linalg.norm(settings["turn"][0]) if "turn" in settings else 1.0
        r = np.linalg.norm(x / unit**2 - np.array([0.03, 0.05]), axis=1)
        cut = contour(surface, r <= 0.62, unit * hertz_gap(r, 0.62))
        length = np.linalg.norm(cut.segments[:, 1] - cut.segments[:, 0], axis=1).sum()
        found.append((cut.area / unit**2, length / unit))
    # renumbered meshes have new middle nodes, and tetrahedra other diagonals
    same = [0, 1, 2, 3] if kind == "quad4" else [0, 1, 3]
    assert_allclose(np.array(found)[same], np.tile(found[0], (len(same), 1)), rtol=1e-9)


@every_kind
def test_all_closed_and_all_open(kind):
    """Closed surfaces have their whole area and no edge; open ones none of both."""
    surface, x = square(kind, 3)
    whole = contour(surface, np.ones(len(x), dtype=bool), np.zeros(len(x)))
    assert_allclose(whole.area, 4.0, rtol=1e-12)
    assert whole.segments.shape == (0, 2, 3)
    none = contour(surface, np.zeros(len(x), dtype=bool), 1.0 + x[:, 0] ** 2)
    assert none.area == 0.0 and none.segments.shape == (0, 2, 3)


@every_kind
def test_where_the_other_surface_ends_the_last_closed_node_is_the_edge(kind):
    """Nodes without a partner: the edge is the line of the last closed nodes, and nothing beyond."""
    surface, x = square(kind, 4)
    edge = 0.0 if kind in ("tri3", "quad4") else 0.25
    closed = x[:, 0] <= edge + 0.1
    found = contour(surface, closed, np.where(closed, 0.0, np.inf))
    inside = x[closed, 0].max()
    assert np.all(found.segments[..., 0] <= inside + 1e-12)
    length = np.linalg.norm(found.segments[:, 1] - found.segments[:, 0], axis=1)
    assert length.sum() == pytest.approx(2.0, rel=0.1)  # nodes on the line are moved off it a little
    assert found.area == pytest.approx(2 * (1 + edge), rel=0.1)


def test_a_single_closed_point_has_an_edge_round_it():
    """Too few points for the law of smooth contact: midway to the open ones."""
    surface, x = square("quad4", 4)
    gap = np.linalg.norm(x, axis=1)
    closed = gap == gap.min()
    found = contour(surface, closed, np.where(closed, 0.0, gap))
    assert 0.0 < found.area < 1.0 and len(found.segments) >= 4


def test_the_area_carries_the_measure():
    """A surface counted twice has twice the area."""
    surface, x = square("quad4", 4, measure=lambda x: 2.0 + 0 * x[0])
    gap = np.maximum(x[:, 0], 0.0)
    plain, _ = square("quad4", 4)
    closed = gap == 0
    twice, once = (contour(s, closed, gap).area for s in (surface, plain))
    assert_allclose(twice, 2 * once, rtol=1e-12)


def placed_again(surface, turn):
    """The same surface in another direction, its nodes where round-off puts them."""
    mesh = surface.body.basis.mesh
    noise = 1e-15 * np.random.default_rng(3).uniform(-1, 1, mesh.doflocs.shape)
    mesh = type(mesh)(turn @ mesh.doflocs + noise, mesh.t)
    return body(mesh, surface.kind.name).surface(surface.mesh_facets)


@pytest.mark.parametrize("noise", [0.0, 1e-17])
def test_the_area_follows_neither_round_off_nor_direction(noise):
    """Open points on one line do not span a plane, and gaps of touching faces are round-off."""
    surface, x = square("quad4", 2)
    last = x[:, 0] > 0.9
    touching = ~last & (x[:, 1] < -0.9) if noise else np.zeros(len(x), dtype=bool)
    gap = np.where(last, 0.01 * (2.0 + x[:, 1]), 0.0)
    areas = []
    for k, turn in enumerate((np.eye(3), Rotation.random(random_state=5).as_matrix())):
        round_off = noise * np.random.default_rng(k).uniform(-1, 1, len(gap))
        side = placed_again(surface, turn)
        areas.append(contour(side, ~last & ~touching, np.where(touching, round_off, gap)).area)
        # all others touch without a force
        areas.append(contour(side, np.abs(x[:, 1]) < 0.5, round_off).area)
    assert_allclose(areas[:2], areas[2:], rtol=1e-9)
