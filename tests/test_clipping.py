"""Polygons cut with polygons, judged by a formula that does not cut; layers; fans of triangles."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

from skfem_contact.pairing import Polygons, clip, nearest_parts, several_sheets, signed_areas

ROUND_OFF = 1e-14  # areas of the order of one, from products of coordinates
SQUARE = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])


def convex(rng, count, corners, spread=0.4):
    """Random convex polygons: corners on circles about random points, counter-clockwise."""
    turn = np.arange(corners) * 2 * np.pi / corners + rng.uniform(-0.5, 0.5, (count, corners))
    radius, middle = rng.uniform(0.5, 1.5, (count, 1, 1)), rng.uniform(-spread, spread, (count, 1, 2))
    return middle + radius * np.stack([np.cos(turn), np.sin(turn)], axis=-1)


def inside(points, polygon):
    following = np.roll(polygon, -1, axis=0)
    along, away = following - polygon, points[:, None] - polygon
    return np.all(along[:, 0] * away[..., 1] - along[:, 1] * away[..., 0] >= 0, axis=1)


def common_area(one, other):
    """Area that two convex polygons share: hull of corners inside and of crossings, by angles."""
    found = [one[inside(one, other)], other[inside(other, one)]]
    for p, q in zip(one, np.roll(one, -1, axis=0), strict=True):
        for r, s in zip(other, np.roll(other, -1, axis=0), strict=True):
            matrix = np.column_stack([q - p, r - s])
            if abs(np.linalg.det(matrix)) < 1e-12:
                continue
            t = np.linalg.solve(matrix, r - p)
            if np.all((t >= 0) & (t <= 1)):
                found.append((p + t[0] * (q - p))[None])
    points = np.concatenate(found)
    if len(points) < 3:
        return 0.0
    away = points - points.mean(axis=0)
    ring = points[np.argsort(np.arctan2(away[:, 1], away[:, 0]))]
    x, y = ring.T
    return 0.5 * abs(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)))


@pytest.mark.parametrize("corners", [(3, 3), (4, 4), (3, 4), (6, 4)])
def test_areas_are_those_of_common_parts(corners):
    """Of random polygons that overlap, contain each other, or lie apart."""
    rng = np.random.default_rng(sum(corners))
    one, other = (convex(rng, 300, n, spread=0.8) for n in corners)
    parts = clip(one, other)
    expected = np.array([common_area(p, q) for p, q in zip(one, other, strict=True)])
    assert np.count_nonzero(expected == 0) and np.count_nonzero(expected > 0)
    assert_allclose(parts.areas, expected, rtol=0, atol=ROUND_OFF)
    assert_allclose(clip(other, one).areas, expected, rtol=0, atol=ROUND_OFF)


def test_parts_tile_what_they_were_cut_from():
    """The squares of a grid cut a polygon into parts that add up to it."""
    subject = convex(np.random.default_rng(0), 1, 5)
    grid = np.linspace(-3, 3, 13)
    corners = [(x, y) for x in grid[:-1] for y in grid[:-1]]
    windows = np.array([0.5 * SQUARE + corner for corner in corners])
    parts = clip(np.repeat(subject, len(windows), axis=0), windows)
    assert_allclose(parts.areas.sum(), signed_areas(subject)[0], rtol=0, atol=ROUND_OFF)


def test_polygons_that_only_touch_have_nothing_in_common():
    """Equal polygons are their own common part; at an edge, a corner, or apart there is none."""
    moved = SQUARE + np.array([[[0, 0]], [[1, 0]], [[1, 1]], [[3, 0]], [[0.25, 0.25]]])
    parts = clip(moved, np.tile(SQUARE, (5, 1, 1)))
    assert_allclose(parts.areas, [1, 0, 0, 0, 0.5625], rtol=0, atol=ROUND_OFF)


@pytest.mark.parametrize("round_middle", [False, True])
def test_fans_cover_their_polygons(round_middle):
    """Triangles of every polygon look the same way round and add up to its area and its moment."""
    rng = np.random.default_rng(4)
    polygons = clip(convex(rng, 200, 4), convex(rng, 200, 4))
    whose, triangles = polygons.simplices(round_middle)
    areas = signed_areas(triangles)
    assert areas.min() >= -ROUND_OFF
    assert_allclose(np.bincount(whose, areas, 200), polygons.areas, rtol=0, atol=ROUND_OFF)
    if not round_middle:
        assert np.bincount(whose, minlength=200).max() == polygons.count.max() - 2
    moment = areas[:, None] * triangles.mean(axis=1)
    other, expected = polygons.simplices(not round_middle)
    expected = signed_areas(expected)[:, None] * expected.mean(axis=1)
    for k in range(2):
        sums = [np.bincount(of, m[:, k], 200) for of, m in ((whose, moment), (other, expected))]
        assert_allclose(*sums, rtol=0, atol=ROUND_OFF)


def test_distances_from_polygons():
    """How far beyond edges: zero inside, whatever corners are repeated; beyond ends of intervals."""
    square = Polygons(np.concatenate([SQUARE, SQUARE[-1:]])[None], np.array([4]))
    points = np.array([[[0.5, 0.5], [0.5, -2.0], [4.0, 5.0], [1.0, 0.3]]])
    assert_allclose(square.beyond(points), [[0.0, 2.0, 4.0, 0.0]], rtol=0, atol=ROUND_OFF)
    interval = Polygons(np.array([[[1.0], [3.0]]]), np.array([2]))
    assert interval.beyond(np.array([[[0.0], [2.0], [4.5]]])).tolist() == [[1.0, 0.0, 1.5]]


def test_of_layers_the_nearest_counts():
    """Three sheets at known heights: everywhere the lowest is left, each part once."""
    rng = np.random.default_rng(7)
    sheets = [convex(rng, 1, 4)[0] for _ in range(3)]
    pieces = Polygons(np.array(sheets), np.full(3, 4))
    vertices = np.arange(12).reshape(3, 4)
    rivals = several_sheets(np.zeros(3, dtype=int), vertices)
    assert [i for i, _ in rivals] == [0, 1, 2]
    height = np.array([0.3, -0.1, 0.2])  # an overlap of 0.1 is nearer than a gap of 0.2
    of, parts = nearest_parts(pieces, rivals, lambda piece, X: height[piece])
    area = np.bincount(of, parts.areas, 3)
    # by inclusion and exclusion, from the areas of common parts
    both = {(i, j): common_area(sheets[i], sheets[j]) for i in range(3) for j in range(i)}
    every = clip(np.array([sheets[0]]), np.array([sheets[1]]))
    every = clip(every.corners, np.array([sheets[2]])).areas[0]
    own = signed_areas(np.array(sheets))
    expected = [own[0] - both[1, 0] - both[2, 0] + every, own[1], own[2] - both[2, 1]]
    assert every > 0.1
    assert_allclose(area, expected, rtol=0, atol=ROUND_OFF)


def test_pieces_of_one_sheet_are_no_rivals():
    """Faces with a common vertex over one cell, and sheets over different cells, stay as they are."""
    vertices = np.array([[0, 1, 2], [2, 3, 4], [7, 8, 9]])
    assert several_sheets(np.array([0, 0, 1]), vertices) == []


def test_corners_that_are_none_are_left_out():
    """On an edge, and twice at the same place: a square has four, and its middle is its own."""
    square = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    more = [[0, 0, 1, 2, 3], [0, 1, 1, 2, 2, 3], [0, 1, 2, 3, 3, 3, 0], [0, 1, 2, 3]]
    for corners in ([square[i] for i in some] for some in more):
        corners = [*corners[:1], np.array([0.4, 1e-17]), *corners[1:]] if len(corners) < 6 else corners
        for k in range(len(corners)):
            x = np.roll(corners, k, axis=0)
            found = Polygons(x[None], np.array([len(x)])).plain(np.array([1e-12]))
            assert found.count[0] == 4 and found.areas[0] == pytest.approx(1.0, abs=1e-15)
            np.testing.assert_allclose(found.middles[0], [0.5, 0.5], atol=1e-15)
    # what is thin as a whole is left as it is
    thin = Polygons(square[None] * [1.0, 1e-13], np.array([4]))
    assert thin.plain(np.array([1e-12])).count[0] == 4
