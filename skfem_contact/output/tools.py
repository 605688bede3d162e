"""Rigid obstacles as lines and triangles, where they are after a step: for pictures and files.

The solid is on the left of a line, and behind a triangle whose corners are seen counter-clockwise. What
has no end, or is much larger than the bodies, is shown around them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import singledispatch
from itertools import combinations, permutations
from typing import Any

import numpy as np

from skfem_contact.answers.answer import answer_of
from skfem_contact.answers.result import ContactResult
from skfem_contact.arrays import Array, Index, across, tangents
from skfem_contact.conditions.state import Motion
from skfem_contact.obstacles.obstacle import Faceted, Obstacle
from skfem_contact.obstacles.rigid_body import RigidBody
from skfem_contact.obstacles.shapes import LevelSet, RigidCylinder, RigidPlane, RigidSphere
from skfem_contact.records import dataclass

# What stands beside the bodies in a picture, over their extent: the longest arrow, and obstacles.
BESIDE = 0.08


@dataclass(frozen=True, eq=False)
class Tool:
    """A rigid obstacle of a result.

    Attributes
    ----------
    name : str
    obstacle : Obstacle
        Where it was made.
    motion : Motion
        Since then.
    contacts : tuple of int
        Numbers of the contacts that it is in.
    """

    name: str
    obstacle: Obstacle
    motion: Motion
    contacts: tuple[int, ...]

    def at(self, motion: Motion) -> Tool:
        """The same with another motion."""
        return replace(self, motion=motion)

    def outline(self, low: Array, high: Array) -> tuple[Array, Index]:
        """Points (p, d) where it was made, and lines (s, 2) or triangles (t, 3) between them.

        Parameters
        ----------
        low, high : ndarray, shape (d,)
            Corners of the box around all that is drawn, where the obstacle is now.
        """
        d = len(low)
        corners = np.stack(np.meshgrid(*np.column_stack([low, high])), axis=-1).reshape(-1, d)
        back = _inverse(self.motion).shift(corners) + corners
        return outline(self.obstacle, back.min(axis=0), back.max(axis=0))


def tools(result: ContactResult) -> list[Tool]:
    """The rigid obstacles of a result, each once."""
    answer = answer_of(result)
    found: dict[int, list[Any]] = {}
    for i, contact in enumerate(answer.contacts):
        primary = contact.primary
        if not isinstance(primary, Obstacle):
            continue
        if id(primary) in found:
            found[id(primary)][3].append(i)
            continue
        shape, motion = primary, answer.case.motion[i]
        if isinstance(primary, RigidBody):
            shape, motion = primary.obstacle, Motion(*result.motion(primary))
        found[id(primary)] = [primary.label, shape, motion, [i]]
    return [Tool(name, shape, motion, tuple(own)) for name, shape, motion, own in found.values()]


def fits(obstacle: Obstacle, size: float) -> bool:
    """Return whether an obstacle has an end, and is not longer than a size."""
    if isinstance(obstacle, Faceted):
        return bool(np.all(np.ptp(obstacle.points, axis=0) <= size))
    if isinstance(obstacle, RigidSphere) or (
        isinstance(obstacle, RigidCylinder) and obstacle.axis is None
    ):
        return 2 * obstacle.radius <= size
    return False


def _inverse(motion: Motion) -> Motion:
    """The way back: ``x -> R'(x - c - t) + c``, a turn about the place where the centre is now."""
    return Motion(-motion.translation, -motion.angle, motion.centre + motion.translation)


@singledispatch
def outline(obstacle: Obstacle, low: Array, high: Array) -> tuple[Array, Index]:
    """Points and lines or triangles of an obstacle; none of one whose shape is its own secret."""
    d = len(low)
    return np.zeros((0, d)), np.zeros((0, d), dtype=np.intp)


@outline.register
def _(obstacle: RigidPlane, low: Array, high: Array) -> tuple[Array, Index]:
    normal, middle = obstacle.normal, 0.5 * (low + high)
    foot = middle - ((middle - obstacle.point) @ normal) * normal
    reach = (0.5 + BESIDE) * float(np.linalg.norm(high - low))
    if len(normal) == 2:
        along = np.array([normal[1], -normal[0]])  # the solid is on its right, so go back
        return foot + reach * np.array([[1.0], [-1.0]]) * along, np.array([[0, 1]])
    corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * reach
    return foot + corners @ tangents(normal[None])[0], np.array([[0, 1, 2], [0, 2, 3]])


@outline.register
def _(obstacle: RigidSphere, low: Array, high: Array) -> tuple[Array, Index]:
    if len(low) == 2:
        return _arc(obstacle.centre, obstacle.radius, obstacle.hollow, low, high)
    return _cap(obstacle.centre, obstacle.radius, obstacle.hollow, low, high)


@outline.register
def _(obstacle: RigidCylinder, low: Array, high: Array) -> tuple[Array, Index]:
    if obstacle.axis is None:
        return _arc(obstacle.centre, obstacle.radius, obstacle.hollow, low, high)
    axis, ways = obstacle.axis, tangents(obstacle.axis[None])[0]
    corners = np.stack(np.meshgrid(*np.column_stack([low, high])), axis=-1).reshape(-1, 3)
    flat = (corners - obstacle.centre) @ ways.T
    ring, _ = _arc(np.zeros(2), obstacle.radius, False, flat.min(axis=0), flat.max(axis=0))
    height = (corners - obstacle.centre) @ axis
    n, room = len(ring), BESIDE * float(np.linalg.norm(high - low))
    points = obstacle.centre + np.tile(ring @ ways, (2, 1))
    points += np.repeat([height.min() - room, height.max() + room], n)[:, None] * axis
    i = np.arange(n - 1)
    triangles = np.concatenate([np.stack([i, i + 1, i + n], 1), np.stack([i + 1, i + n + 1, i + n], 1)])
    return points, triangles[:, ::-1] if obstacle.hollow else triangles


@outline.register
def _(obstacle: Faceted, low: Array, high: Array) -> tuple[Array, Index]:
    return np.array(obstacle.points), np.array(obstacle.facets)


@outline.register
def _(obstacle: LevelSet, low: Array, high: Array) -> tuple[Array, Index]:
    room = BESIDE * (high - low).max()
    count = 201 if len(low) == 2 else 33  # as smooth as a picture can show
    axes = [np.linspace(a - room, b + room, count) for a, b in zip(low, high, strict=True)]
    return (zero_lines if len(low) == 2 else zeros)(obstacle.function, axes)


def _reach(centre: Array, radius: float, low: Array, high: Array) -> tuple[Array, float]:
    """Direction from a centre to the middle of a box, and the angle to either side that is shown."""
    middle, size = 0.5 * (low + high), (0.5 + BESIDE) * float(np.linalg.norm(high - low))
    away = middle - centre
    distance = float(np.linalg.norm(away))
    if radius < 4.0 * size or distance <= size:  # as a whole
        return np.eye(len(low))[0], np.pi  # a direction of its own, which turns with it
    return away / distance, float(np.arcsin(size / distance))


def _arc(centre: Array, radius: float, hollow: bool, low: Array, high: Array) -> tuple[Array, Index]:
    """A circle, or what of it is near a box."""
    away, angle = _reach(centre, radius, low, high)
    turn = np.arctan2(away[1], away[0]) + np.linspace(-angle, angle, 361)
    points = centre + radius * np.column_stack([np.cos(turn), np.sin(turn)])
    if angle == np.pi:
        points[-1] = points[0]
    lines = np.stack([np.arange(360), np.arange(1, 361)], axis=1)
    return points, lines[:, ::-1] if hollow else lines


def _cap(centre: Array, radius: float, hollow: bool, low: Array, high: Array) -> tuple[Array, Index]:
    """A sphere, or what of it is near a box: rings about the direction towards it."""
    away, angle = _reach(centre, radius, low, high)
    n, rings = 60, 30
    turn, tilt = np.arange(n) * 2 * np.pi / n, np.linspace(0, angle, rings + 1)
    flat = np.column_stack([np.cos(turn), np.sin(turn)]) @ tangents(away[None])[0]
    points = centre + radius * (
        np.cos(tilt)[:, None, None] * away + np.sin(tilt)[:, None, None] * flat
    ).reshape(-1, 3)
    i, j = (part.ravel() for part in np.meshgrid(np.arange(n), np.arange(rings)))
    a, b = j * n + i, j * n + (i + 1) % n
    triangles = np.concatenate([np.stack([a, a + n, b], 1), np.stack([b, a + n, b + n], 1)])
    x = points[triangles]
    area = np.linalg.norm(np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0]), axis=1)
    triangles = triangles[area > 1e-9 * area.max()]  # those at the pole have none
    return points, triangles[:, ::-1] if hollow else triangles


def zero_lines(function: Callable[[Array], Array], axes: Sequence[Array]) -> tuple[Array, Index]:
    """Points and lines (s, 2) where a function is zero, one after the other; negative on their left.

    By contourpy, which matplotlib brings; without it the lines are the same in any order, as files take
    them.
    """
    try:
        from contourpy import contour_generator
    except ImportError:
        return zeros(function, axes)
    values = _on_grid(function, axes)[0]
    chains = contour_generator(*axes, np.ma.masked_invalid(-values.T)).lines(0.0)
    points = np.concatenate([np.zeros((0, 2)), *chains])
    last = np.cumsum([len(chain) for chain in chains]) - 1
    first = np.delete(np.arange(len(points)), last)
    lines = np.stack([first, first + 1], axis=1)
    return points, lines[np.any(points[first] != points[first + 1], axis=1)]


def zeros(function: Callable[[Array], Array], axes: Sequence[Array]) -> tuple[Array, Index]:
    """Points and lines (s, 2) or triangles (t, 3) where a function is zero, found on a grid.

    Rectangles are cut into triangles and bricks into tetrahedra, so that no case is ambiguous; the
    function is taken as linear in each of them. It is negative on the left of the lines, and behind the
    triangles as seen counter-clockwise.

    >>> points, lines = zeros(lambda x: x[1] - 0.5, [np.linspace(0, 1, 2)] * 2)
    >>> points[lines].round(6).tolist()
    [[[0.5, 0.5], [0.0, 0.5]], [[1.0, 0.5], [0.5, 0.5]]]
    >>> points, triangles = zeros(lambda x: x[2] - 0.5, [np.linspace(0, 1, 2)] * 3)
    >>> x = points[triangles]
    >>> normal = np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0])
    >>> bool(np.all(normal[:, 2] > 0)), float(normal[:, 2].sum() / 2)
    (True, 1.0)
    """
    d = len(axes)
    values, x = _on_simplices(function, axes)
    inside = values < 0
    count, found, ways = inside.sum(axis=1), [np.zeros((0, d, d))], [np.zeros((0, d))]

    def add(some: Any, edges: Sequence[tuple[int, int]]) -> None:
        v, corners = values[some], x[some]
        found.append(np.stack([_crossing(v, corners, *edge) for edge in edges], axis=1))
        row = np.arange(len(v))
        ways.append(corners[row, v.argmax(axis=1)] - corners[row, v.argmin(axis=1)])

    for k in range(d + 1):  # one corner alone on its side: as many crossings as there are others
        alone = ((count == 1) & inside[:, k]) | ((count == d) & ~inside[:, k])
        add(alone, [(k, j) for j in range(d + 1) if j != k])
    for i, j in combinations(range(4), 2) if d == 3 else ():  # two and two: a quadrilateral
        a, b = (k for k in range(4) if k not in (i, j))
        for third in ((i, b), (j, a)):
            add((count == 2) & inside[:, i] & inside[:, j], [(i, a), third, (j, b)])
    pieces, way = np.concatenate(found), np.concatenate(ways)
    normal = across(pieces[:, 1:] - pieces[:, :1])
    turned = np.einsum("td,td->t", normal, way) < 0
    pieces[turned] = pieces[turned][:, ::-1]
    pieces = pieces[np.any(normal != 0, axis=1)]
    return pieces.reshape(-1, d), np.arange(d * len(pieces)).reshape(-1, d)


def _on_grid(function: Callable[[Array], Array], axes: Sequence[Array]) -> tuple[Array, Array]:
    """Values at the points of a grid, and these points (d, ...)."""
    grid = np.stack(np.meshgrid(*axes, indexing="ij"))
    with np.errstate(all="ignore"):  # where it has no value there is nothing to draw
        values = np.asarray(function(grid.reshape(len(axes), -1)), dtype=float)
    return values.reshape(grid.shape[1:]), grid


def _on_simplices(function: Callable[[Array], Array], axes: Sequence[Array]) -> tuple[Array, Array]:
    """Values (t, d+1) and places (t, d+1, d) of the corners of triangles or tetrahedra on a grid."""
    d = len(axes)
    values, grid = _on_grid(function, axes)
    number = np.arange(values.size).reshape(values.shape)
    corners = []
    for order in permutations(range(d)):  # Kuhn's simplices: from one corner to the opposite one
        steps = np.eye(d, dtype=int)[list(order)]
        ways = np.concatenate([0 * steps[:1], np.cumsum(steps, axis=0)])
        shifted = [number[tuple(slice(s, s - 1 or None) for s in way)].ravel() for way in ways]
        corners.append(np.stack(shifted, axis=1))
    cells = np.concatenate(corners)
    signs, known = values.ravel()[cells] < 0, np.isfinite(values.ravel()[cells]).all(axis=1)
    cells = cells[signs.any(axis=1) & ~signs.all(axis=1) & known]
    return values.ravel()[cells], grid.reshape(d, -1).T[cells]


def _crossing(values: Array, x: Array, i: int, j: int) -> Array:
    """The place of the zero between the corners i and j of simplices."""
    way = values[:, i] / (values[:, i] - values[:, j])
    return x[:, i] + way[:, None] * (x[:, j] - x[:, i])
