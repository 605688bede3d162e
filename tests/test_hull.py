"""Points in displaced solids: sorted across the ray, judged as all pairs with triangles say."""

from __future__ import annotations

import internals
import numpy as np
import pytest

from skfem_contact.answers import Boundary

RAY, ACROSS = internals.original("answers.RAY"), internals.original("answers.ACROSS")


def inside_by_all_pairs(hull: Boundary, points: np.ndarray) -> np.ndarray:
    """The rule itself: a ray from a point meets an odd number of triangles."""
    odd = np.zeros(len(points), dtype=bool)
    for x in hull.corners:
        seen, p = x @ ACROSS[3].T, points @ ACROSS[3].T
        rise = np.roll(seen, -1, axis=0) - seen
        away = p[:, None] - seen
        side = rise[:, 0] * away[..., 1] - rise[:, 1] * away[..., 0]
        through = np.all(side > 0, axis=1) | np.all(side < 0, axis=1)
        normal = np.cross(x[1] - x[0], x[2] - x[0])
        odd ^= through & ((x[0] - points) @ normal * (normal @ RAY) > 0)
    return odd


def ball(rng: np.random.Generator, count: int) -> np.ndarray:
    """A closed surface: an octahedron whose faces are refined, its corners at random distances."""
    x = np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1]]) * np.array(np.meshgrid(*3 * [[-1, 1]])).T.reshape(
        -1, 1, 3
    ).astype(float)
    for _ in range(count):
        a, b, c = np.moveaxis(x, 1, 0)
        ab, bc, ca = (a + b) / 2, (b + c) / 2, (c + a) / 2
        parts = ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))
        x = np.concatenate([np.stack(part, axis=1) for part in parts])
    wave = rng.normal(size=(3, 3))
    return x * (1 + 0.3 * np.sin(x @ wave).sum(axis=2, keepdims=True)) + rng.normal(size=3)


@pytest.mark.parametrize("block", [None, 1000])
def test_ten_thousand_points_are_judged_as_by_all_pairs(
    block: int | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    """100 random solids, closed and round or triangles anywhere, 100 points each; in parts, too."""
    if block:
        internals.replace(monkeypatch, "arrays.AT_ONCE", 100 * block)
    rng, inner, outer = np.random.default_rng(22), 0, 0
    for i in range(100):
        if i % 2:
            corners = ball(rng, i % 4)
        else:
            corners = rng.normal(size=(30, 1, 3)) + 0.5 * rng.normal(size=(30, 3, 3))
        at = corners.reshape(-1, 3)
        hull, points = (
            Boundary(corners, corners[:, 0]),
            rng.uniform(at.min(axis=0), at.max(axis=0), (100, 3)),
        )
        found = hull.inside(points)
        np.testing.assert_array_equal(found, inside_by_all_pairs(hull, points))
        inner, outer = inner + found.sum(), outer + (~found).sum()
    assert inner > 1000 and outer > 1000


def test_points_beside_the_box_are_outside() -> None:
    """Without any point near there is nothing to sort."""
    corners = ball(np.random.default_rng(0), 1)
    hull = Boundary(corners, corners[:, 0])
    assert not hull.inside(np.array([[50.0, 0, 0], [0, 0, -50.0]])).any()
    assert hull.inside(np.zeros((0, 3))).shape == (0,)
    assert not len(hull.samples((np.full(3, 50.0), np.full(3, 60.0))))


def test_samples_of_a_box_are_those_of_all_that_lie_in_it() -> None:
    """Each corner, middle of an edge and middle of a triangle once."""
    x = np.vstack([np.zeros(3), np.eye(3)])
    hull = Boundary(x[[[0, 1, 2], [0, 1, 3], [0, 2, 3], [1, 2, 3]]], x)
    everywhere = hull.samples(hull.box)
    assert len(everywhere) == 4 + 6 + 4
    box = np.zeros(3), np.full(3, 0.5)
    some = everywhere[np.all(everywhere <= 0.5, axis=1)]
    np.testing.assert_array_equal(hull.samples(box), some)
    assert 0 < len(some) < len(everywhere)


@pytest.mark.parametrize("share", [0.0, 0.1, 1.0])
def test_inner_points_are_all_that_lie_deeper_than_said(share: float) -> None:
    """What one simplex shows to be next to the boundary is left out, and nothing that is deeper."""
    rng = np.random.default_rng(3)
    corners = ball(rng, 1)
    hull, at = Boundary(corners, corners[:, 0]), corners.reshape(-1, 3)
    points = rng.uniform(at.min(axis=0), at.max(axis=0), (200, 3))
    depth = hull.depth(points)
    length = share * depth.max()
    inner, deep = hull.inner(points, length)
    np.testing.assert_allclose(deep, hull.depth(inner), rtol=1e-12)
    assert (len(inner) > 0) == (share < 1) and np.all(deep > 0)
    assert np.isin(points[depth > length, 0], inner[:, 0]).all()
    assert share == 0 or len(inner) < np.count_nonzero(depth)
    for none in (np.zeros((0, 3)), 50 + points):
        assert [len(found) for found in hull.inner(none, length)] == [0, 0]
