"""Rigid obstacles as they are drawn: on their surface, the solid on its side, moved as they are."""

from __future__ import annotations

import sys
from typing import Any

import numpy as np
import pytest
import skfem as fem
from numpy.testing import assert_allclose
from quick_elasticity import linear_elasticity

import skfem_contact as sc
from skfem_contact.conditions import Motion
from skfem_contact.obstacles import read_motion
from skfem_contact.output import Tool, outline

LOW, HIGH = np.array([-1.0, -1.0, -1.0]), np.array([1.0, 1.0, 1.0])
WEDGE = [(0, 0), (1, 2), (-1, 2)]
CORNERS = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)]
FACES = [(0, 2, 1), (0, 1, 3), (1, 2, 3), (2, 0, 3)]


def plane(x: Any) -> Any:
    return x[0] * 0.6 + x[1] * 0.8 - 0.2


def ball(x: Any) -> Any:
    return np.linalg.norm(x - 0.3, axis=0) - 0.7


#: Obstacles with functions that are negative in them.
FLAT: list[tuple[Any, Any]] = [
    (sc.RigidPlane((0.12, 0.16), (3, 4)), plane),
    (sc.RigidSphere((0.3, 0.3), 0.7), ball),
    (sc.RigidCylinder((0.3, 0.3), 0.7, hollow=True), lambda x: -ball(x)),
    (sc.RigidSphere((0, -500), 499.5), lambda x: np.hypot(x[0], x[1] + 500) - 499.5),
    (sc.obstacles.LevelSet(plane), plane),
    (sc.RigidPolyline(WEDGE, closed=True), lambda x: np.maximum(2 * abs(x[0]) - x[1], x[1] - 2)),
]
SOLID: list[tuple[Any, Any]] = [
    (sc.RigidPlane((0.12, 0.16, 9), (3, 4, 0)), plane),
    (sc.RigidSphere((0.3, 0.3, 0.3), 0.7), ball),
    (sc.RigidSphere((0.3, 0.3, 0.3), 0.7, hollow=True), lambda x: -ball(x)),
    (
        sc.RigidSphere((0, 0, -500), 499.5),
        lambda x: np.linalg.norm(x - [[0], [0], [-500]], axis=0) - 499.5,
    ),
    (
        sc.RigidCylinder((0.3, 9, 0.3), 0.7, axis=(0, 2, 0)),
        lambda x: np.hypot(x[0] - 0.3, x[2] - 0.3) - 0.7,
    ),
    (sc.obstacles.LevelSet(ball), ball),
    (sc.RigidSurface(CORNERS, FACES), lambda x: np.maximum(-x.min(axis=0), x.sum(axis=0) - 1)),
]
STILL: dict[int, Any] = {2: (0.0, 0.0), 3: (0.0, 0.0, 0.0)}
MOVED: dict[int, Any] = {
    2: ((0.3, -0.2), 0.4, (0.5, 0.1)),
    3: ((0.3, -0.2, 0.1), (0.2, -0.3, 0.4), (0.5, 0.1, 0.0)),
}


def tool(obstacle: Any, motion: Any, d: int) -> Tool:
    return Tool("tool", obstacle, Motion(*read_motion(motion, d)), (0,))


@pytest.mark.parametrize("motions", [STILL, MOVED], ids=["still", "moved"])
@pytest.mark.parametrize(
    ("obstacle", "inside", "d"), [(*o, 2) for o in FLAT] + [(*o, 3) for o in SOLID]
)
def test_outlines_are_on_the_obstacle(obstacle: Any, inside: Any, d: int, motions: Any) -> None:
    """Points are on the surface; left of lines, and behind triangles, there is the solid."""
    x, cells = tool(obstacle, motions[d], d).outline(LOW[:d], HIGH[:d])
    assert len(cells)
    # the diagonals of a grid's cells, up to h = 0.11 long, are chords: 3 h²/(8 R); all others are exact
    curved = isinstance(obstacle, sc.obstacles.LevelSet) and d == 3
    assert_allclose(inside(x.T), 0.0, rtol=0, atol=7e-3 if curved else 1e-9)
    ends = x[cells]
    middle, side = ends.mean(axis=1), ends[:, 1] - ends[:, 0]
    if d == 2:
        out = np.column_stack([side[:, 1], -side[:, 0]])
    else:
        out = np.cross(side, ends[:, 2] - ends[:, 0])
    out /= np.linalg.norm(out, axis=1)[:, None]
    assert np.all(inside((middle - 0.02 * out).T) < 0)


@pytest.mark.parametrize("radius", [0.7, 3.0])
def test_round_obstacles_are_whole(radius: float) -> None:
    """Those that are not much larger than the bodies have all of their length, or area."""
    x, lines = tool(sc.RigidSphere((0, 0), radius), STILL[2], 2).outline(LOW[:2], HIGH[:2])
    length = np.linalg.norm(x[lines[:, 1]] - x[lines[:, 0]], axis=1).sum()
    assert length == pytest.approx(2 * np.pi * radius, rel=1e-4)  # 360 chords
    x, triangles = tool(sc.RigidSphere((0, 0, 0), radius), STILL[3], 3).outline(LOW, HIGH)
    a, b, c = np.moveaxis(x[triangles], 1, 0)
    area = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1).sum()
    assert area == pytest.approx(4 * np.pi * radius**2, rel=5e-3)  # 60 by 30 flat pieces


@pytest.mark.parametrize("obstacle", [FLAT[0][0], FLAT[3][0], FLAT[4][0]])
def test_endless_obstacles_reach_beyond_the_bodies(obstacle: Any) -> None:
    """What is drawn of a plane crosses the whole box around the bodies, wherever it has moved."""
    far = ((5.0, 40.0), 0.3, (1.0, 0.0))
    found = tool(obstacle, far, 2)
    where = found.motion.shift(np.zeros((1, 2)))[0]
    x, _ = found.outline(where + LOW[:2], where + HIGH[:2])
    x = x + found.motion.shift(x) - where
    assert np.ptp(x, axis=0).max() > 2.0 and np.abs(x).max() < 4.0


def test_rigid_bodies_are_where_their_degrees_of_freedom_say() -> None:
    """A roller that its load presses in is drawn at its centre then; one in two contacts once."""
    basis = fem.Basis(fem.MeshQuad().refined(3).with_defaults(), fem.ElementVector(fem.ElementQuad1()))
    block = sc.Body(basis, linear_elasticity(0.0, 50.0), D="bottom", name="block")
    roller = sc.RigidBody(
        sc.RigidCylinder((0.5, 2.0), 1.0), force=(0, -1), D=("x", "rotation"), name="roller"
    )
    wall = sc.RigidPlane((2.0, 0.0), (-1, 0), name="wall")
    contacts = [sc.Contact(block.surface("top"), roller), sc.Contact(block.surface("right"), wall)]
    result = sc.ContactSolver([block, roller], contacts).solve()
    pytest.importorskip("matplotlib").use("Agg")
    ax = sc.plot_deformed(result, scale=1.0)
    drawn = [np.array(c.get_segments()) for c in ax.collections if c.get_gid() == "obstacle"]
    first, second = (lines.reshape(-1, 2) for lines in drawn)
    centre = np.array([0.5, 2.0]) + result.motion("roller")[0]
    assert_allclose(np.linalg.norm(first - centre, axis=1), 1.0, rtol=1e-9)
    assert_allclose(second[:, 0], 2.0, rtol=1e-12)


def test_lines_of_functions_are_in_order(monkeypatch: pytest.MonkeyPatch) -> None:
    """By contourpy each begins where the last ends; without it they are the same in any order."""
    pytest.importorskip("contourpy")
    circle = sc.obstacles.LevelSet(lambda x: np.linalg.norm(x, axis=0) - 0.7)
    box = np.full(2, -1.0), np.ones(2)
    points, lines = outline(circle, *box)
    assert np.all(lines[1:, 0] == lines[:-1, 1])
    monkeypatch.setitem(sys.modules, "contourpy", None)
    same, others = outline(circle, *box)
    for x, pairs in ((points, lines), (same, others)):
        a, b = np.swapaxes(x[pairs], 0, 1)
        assert np.linalg.norm(b - a, axis=1).sum() == pytest.approx(1.4 * np.pi, rel=1e-4)
        assert np.all(a[:, 0] * b[:, 1] > a[:, 1] * b[:, 0])  # the solid on the left


def test_functions_without_values_somewhere_are_drawn_where_they_have_some() -> None:
    """A root that ends at x = 0: its curve is drawn from there on, without a warning."""
    root = sc.obstacles.LevelSet(lambda x: x[1] - np.sqrt(x[0]), name="root")
    x, lines = tool(root, STILL[2], 2).outline(LOW[:2], HIGH[:2])
    assert len(lines) and np.all(x[:, 0] >= 0)
    # a chord of the root over the first cell, h = 0.0116, is off by h / 4 in its square
    assert_allclose(x[:, 1] ** 2, x[:, 0], rtol=0, atol=3e-3)


def test_an_obstacle_of_unknown_shape_is_said_not_to_be_drawn() -> None:
    """Nothing is drawn of it, nothing is written, and the picture says so."""
    pytest.importorskip("matplotlib").use("Agg")
    from skfem_contact.obstacles import Obstacle

    class Own(Obstacle):
        name = "own"

        def moved(self, motion: Any) -> Any:
            return self

        def distance(self, surface: Any) -> Any:
            return sc.RigidPlane((0, 0), (0, 1)).distance(surface)

    basis = fem.Basis(fem.MeshQuad().refined(1).with_defaults(), fem.ElementVector(fem.ElementQuad1()))
    block = sc.Body(basis, linear_elasticity(), {"top": (0.0, -1e-3)}, D="left", name="block")
    result = sc.ContactSolver(block, sc.Contact(block.surface("bottom"), Own())).solve()
    assert "own is not drawn" in sc.plot_deformed(result).texts[0].get_text()
