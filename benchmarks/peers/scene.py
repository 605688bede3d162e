"""Meshes, material and motion that `compare.py` gives to this library and to its peers.

Only NumPy is needed, since peers bring interpreters of their own. Elements have the order of nodes of
VTK and Abaqus: the lower face around, then the upper one.

`press` (solid): a block of side 1 and height .5, held below; on it a block of side .8 with a slightly
round lower face, whose top comes down in one step, without friction.
`rub` (plane strain): two blocks of 80 by 20, the upper one round below. Its top comes down in ten
steps, then moves aside in ten: the outer part of the contact slips.
`rigid` (solid): the round block of `press` alone, its top lowered onto a rigid plane.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

E, NU = 1.0, 0.3
SIDES, HEIGHT, RADIUS, DEPTH = (1.0, 0.8), 0.5, 20.0, 5e-3  # press, as in solids.py
# rub, in half widths of contact: half the width, height, fine zone, where the face is flat again
HALF, HIGH, FINE, FLAT, R = 40.0, 20.0, 1.5, 3.0, 100.0
MU, STEPS = 0.3, 10  # steps down, and as many aside
DOWN = 2 * np.log(2 * HIGH) / (4 * R)  # the approach of two layers for a half width of one
ASIDE = 0.6 * MU * DOWN  # about half of what makes all of it slide


@dataclass(frozen=True)
class Body:
    """Nodes (n, dim), elements (m, 2^dim), and the nodes of the contact face and of the held one."""

    points: np.ndarray
    cells: np.ndarray
    face: np.ndarray  # facets of the contact face, as nodes in the order of their element
    held: np.ndarray
    grid: tuple[np.ndarray, ...]  # coordinates of the contact face, which is a grid


@dataclass(frozen=True)
class Scene:
    """Bodies, the upper one last, coefficient of friction, motion of the top at each step."""

    bodies: tuple[Body, ...]
    mu: float
    motion: np.ndarray  # (steps, dim)

    @property
    def dim(self) -> int:
        return self.motion.shape[1]

    def first(self, i: int) -> int:
        """Number of nodes before those of a body."""
        return sum(len(body.points) for body in self.bodies[:i])

    @property
    def size(self) -> int:
        """Number of nodes."""
        return self.first(len(self.bodies))


def grid_body(axes: list[np.ndarray], upper: bool, lift: Callable[[np.ndarray], np.ndarray]) -> Body:
    """A grid whose contact face is below, or above for the lower body, and lifted there."""
    shape = tuple(len(a) for a in axes)
    points = np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, len(axes))
    ids = np.arange(len(points)).reshape(shape)
    corners = [(0, 0), (1, 0), (1, 1), (0, 1)]
    if len(axes) == 3:
        corners = [(*c, k) for k in (0, 1) for c in corners]  # type: ignore[misc]
    cut = [[slice(c, n - 1 + c) for c, n in zip(corner, shape, strict=True)] for corner in corners]
    cells = np.stack([ids[tuple(s)] for s in cut], -1)
    layer = cells[..., 0, :] if upper else cells[..., -1, :]
    local = {True: [0, 1, 2, 3], False: [4, 5, 6, 7]}[upper]
    if len(axes) == 2:
        local = [0, 1] if upper else [3, 2]
    faces = layer[..., local].reshape(-1, len(local))
    high = axes[-1][-1] - axes[-1][0]
    if upper:
        points[:, -1] += lift(points) * (1 - points[:, -1] / high)
    held = ids[..., -1 if upper else 0].ravel()
    return Body(points, cells.reshape(-1, len(corners)), faces, held, tuple(axes[:-1]))


def press(block: int, punch: int, layers: int, *, alone: bool = False) -> Scene:
    """Elements along the sides of block and punch, and upwards."""

    def lift(p: np.ndarray) -> np.ndarray:
        return (p[:, :2] ** 2).sum(1) / (2 * RADIUS)

    across = [np.linspace(-s / 2, s / 2, n + 1) for s, n in zip(SIDES, (block, punch), strict=True)]
    up = np.linspace(0, HEIGHT, layers + 1)
    bodies = (
        grid_body([across[0]] * 2 + [up - HEIGHT], False, lift),
        grid_body([across[1]] * 2 + [up], True, lift),
    )
    return Scene(bodies[alone:], 0.0, np.array([[0.0, 0.0, -DEPTH]]))


def rub(fine: int, rest: int, upwards: int) -> Scene:
    """Elements along half the fine zone, beyond it, and upwards in it."""

    def lift(p: np.ndarray) -> np.ndarray:
        return np.minimum(np.abs(p[:, 0]), FLAT) ** 2 / (2 * R)

    x = np.concatenate([np.linspace(0, FINE, fine + 1), np.geomspace(FINE, HALF, rest + 1)[1:]])
    y = np.concatenate([np.linspace(0, FINE, upwards + 1), np.geomspace(FINE, HIGH, rest + 1)[1:]])
    x = np.concatenate([-x[:0:-1], x])
    ramp = np.linspace(0, 1, STEPS + 1)[1:]
    down = np.stack([0 * ramp, -DOWN * ramp], 1)
    aside = np.stack([ASIDE * ramp, 0 * ramp - DOWN], 1)
    bodies = grid_body([x, -y[::-1]], False, lift), grid_body([x, y], True, lift)
    return Scene(bodies, MU, np.concatenate([down, aside]))


CASES: dict[str, tuple[Callable[..., Scene], tuple[int, ...]]] = {
    "press 6k": (press, (12, 10, 6)),
    "press 24k": (press, (21, 15, 10)),
    "press 92k": (press, (32, 28, 15)),
    "rub 7k": (rub, (12, 18, 8)),
    "rub 26k": (rub, (24, 36, 16)),
    "rigid 66k": (lambda *n: press(*n, alone=True), (24, 28, 24)),
    "rigid 7k": (lambda *n: press(*n, alone=True), (12, 14, 9)),
}


def scene(name: str) -> Scene:
    """The scene of a case."""
    make, sizes = CASES[name]
    return make(*sizes)


def run(solve: Callable[[Scene], tuple[np.ndarray, dict[str, Any]]]) -> None:
    """`python PEER.py CASE FILE`: solve a case, write displacements (nodes, dim) and what is said."""
    _, name, path = sys.argv
    u, said = solve(scene(name))
    # of this process alone: `ru_maxrss` would count the process that it was forked from
    peak = next(line for line in Path("/proc/self/status").read_text().splitlines() if "VmHWM" in line)
    said.setdefault("memory", int(peak.split()[1]) / 1024)
    np.save(Path(path).with_suffix(".npy"), u)
    Path(path).with_suffix(".json").write_text(json.dumps(said), encoding="utf-8")
