"""Meshes of the judge's bodies: blocks with any lower and upper edge, rings, discs, polygons.

A shape is numbers only; `mesh_of` makes its mesh with so many facets, or with twice as many, and the
names of its edges. Nothing here knows of contact.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import skfem as fem

ELEMENTS = {
    "P1": (fem.MeshTri, fem.ElementTriP1),
    "Q1": (fem.MeshQuad, fem.ElementQuad1),
    "P2": (fem.MeshTri, fem.ElementTriP2),
    "Q2": (fem.MeshQuad, fem.ElementQuad2),
    "S2": (fem.MeshQuad, fem.ElementQuadS2),
}
QUADRATIC = {"P2", "Q2", "S2"}


@dataclass(frozen=True)
class Edge:
    """Lower or upper edge of a block: a straight line, or an arc about a point far above or below.

    ``y(x) = height + slope (x - middle) + bend (x - middle)^2 / (1 + sqrt(1 - 4 bend^2 (..)^2)) * 2``,
    the last term being the arc of radius ``1 / (2 |bend|)``.
    """

    height: float
    slope: float = 0.0
    bend: float = 0.0
    middle: float = 0.0

    def __call__(self, x: np.ndarray) -> np.ndarray:
        """Height of the edge."""
        s = x - self.middle
        root = np.sqrt(1.0 - (2 * self.bend * s) ** 2)
        return self.height + self.slope * s + 2 * self.bend * s**2 / (1.0 + root)


@dataclass(frozen=True)
class Block:
    """What lies between two edges: tags left, right, bottom, top."""

    x0: float
    x1: float
    lower: Edge
    upper: Edge
    counts: tuple[int, int]

    def place(self, p: np.ndarray) -> np.ndarray:
        """Positions of points of the unit square."""
        x = self.x0 + (self.x1 - self.x0) * p[0]
        return np.array([x, (1 - p[1]) * self.lower(x) + p[1] * self.upper(x)])

    tags = ("left", "right", "bottom", "top")

    @property
    def words(self) -> str:
        """The shape in words."""
        bent = "".join(
            f", {side} edge an arc of radius {0.5 / abs(e.bend):.3g}"
            for side, e in (("lower", self.lower), ("upper", self.upper))
            if e.bend
        )
        nx, ny = self.counts
        return f"block {self.x1 - self.x0:.3g} wide, {nx} x {ny} elements{bent}"


@dataclass(frozen=True)
class Ring:
    """Part of a ring, or all of it (`angles` 2 pi apart): tags inner, outer, start, end."""

    inner: float
    outer: float
    angles: tuple[float, float]
    counts: tuple[int, int]
    centre: tuple[float, float] = (0.0, 0.0)

    tags = ("inner", "outer", "start", "end")

    @property
    def closed(self) -> bool:
        """Whether it goes all round."""
        return bool(np.isclose(self.angles[1] - self.angles[0], 2 * np.pi))

    def place(self, p: np.ndarray) -> np.ndarray:
        """Positions of points of the unit square."""
        r = self.inner + (self.outer - self.inner) * p[0]
        t = self.angles[0] + (self.angles[1] - self.angles[0]) * p[1]
        return np.array([self.centre[0] + r * np.cos(t), self.centre[1] + r * np.sin(t)])

    @property
    def words(self) -> str:
        """The shape in words."""
        nr, nt = self.counts
        turn = np.degrees(self.angles[1] - self.angles[0])
        return f"ring {self.inner:.3g} to {self.outer:.3g}, {turn:.0f} degrees, {nr} x {nt} elements"


@dataclass(frozen=True)
class Disc:
    """A full disc of triangles; tags outer, lower, upper (the halves of its edge)."""

    radius: float
    counts: tuple[int, int]
    centre: tuple[float, float] = (0.0, 0.0)

    @property
    def words(self) -> str:
        """The shape in words."""
        return f"disc of radius {self.radius:.3g}, {self.counts[1]} facets round it"


@dataclass(frozen=True)
class Polygon:
    """A convex polygon of triangles; tags side0, side1, ... from corner to corner."""

    corners: tuple[tuple[float, float], ...]
    count: int

    @property
    def words(self) -> str:
        """The shape in words."""
        return f"polygon of {len(self.corners)} corners, {self.count} facets a side"


def refined(shape: Any, factor: int) -> Any:
    """The same shape with `factor` times as many facets."""
    if isinstance(shape, Polygon):
        return replace(shape, count=factor * shape.count)
    return replace(shape, counts=tuple(factor * c for c in shape.counts))


def mesh_of(shape: Any, element: str, curved: bool) -> tuple[Any, dict[str, np.ndarray]]:
    """Mesh and the facets of its tags; `curved`: quadratic elements follow arcs."""
    kind = ELEMENTS[element][0]
    if isinstance(shape, Polygon):
        return _polygon(shape)
    if isinstance(shape, Disc):
        return _disc(shape)
    if isinstance(shape, Ring) and shape.closed:
        return _closed_ring(shape, kind)
    nx, ny = shape.counts
    unit = kind.init_tensor(np.linspace(0, 1, nx + 1), np.linspace(0, 1, ny + 1))
    middle = unit.p[:, unit.facets].mean(axis=1)
    on = [middle[0] < 1e-9, middle[0] > 1 - 1e-9, middle[1] < 1e-9, middle[1] > 1 - 1e-9]
    tags = {name: np.flatnonzero(mask) for name, mask in zip(shape.tags, on, strict=True)}
    if curved and element in QUADRATIC:
        better = fem.MeshTri2 if kind is fem.MeshTri else fem.MeshQuad2
        unit = better.from_mesh(unit)
    return type(unit)(shape.place(unit.doflocs), unit.t), tags


def _disc(shape: Disc) -> tuple[Any, dict[str, np.ndarray]]:
    nr, nt = shape.counts
    r = shape.radius * np.arange(1, nr + 1) / nr
    t = 2 * np.pi * np.arange(nt) / nt
    x = np.concatenate([[0.0], np.outer(r, np.cos(t)).ravel()]) + shape.centre[0]
    y = np.concatenate([[0.0], np.outer(r, np.sin(t)).ravel()]) + shape.centre[1]
    j, k = np.arange(nt), (np.arange(nt) + 1) % nt
    cells = [np.array([0 * j, 1 + j, 1 + k])]
    for i in range(nr - 1):
        a, b = 1 + i * nt, 1 + (i + 1) * nt
        cells += [np.array([a + j, b + j, b + k]), np.array([a + j, b + k, a + k])]
    mesh = fem.MeshTri(np.array([x, y]), np.concatenate(cells, axis=1))
    edge = mesh.boundary_facets()
    height = mesh.p[1, mesh.facets[:, edge]].mean(axis=0) - shape.centre[1]
    return mesh, {"outer": edge, "lower": edge[height < 0], "upper": edge[height > 0]}


def _closed_ring(shape: Ring, kind: Any) -> tuple[Any, dict[str, np.ndarray]]:
    nr, nt = shape.counts
    xi, eta = np.meshgrid(np.arange(nr + 1) / nr, np.arange(nt) / nt, indexing="ij")
    p = shape.place(np.array([xi.ravel(), eta.ravel()]))
    i, j = (a.ravel() for a in np.meshgrid(np.arange(nr), np.arange(nt), indexing="ij"))
    k = (j + 1) % nt
    a, b, c, d = i * nt + j, (i + 1) * nt + j, (i + 1) * nt + k, i * nt + k
    if kind is fem.MeshQuad:
        mesh = fem.MeshQuad(p, np.array([a, b, c, d]))
    else:
        mesh = fem.MeshTri(p, np.concatenate([np.array([a, b, c]), np.array([a, c, d])], axis=1))
    edge = mesh.boundary_facets()
    arm = mesh.p[:, mesh.facets[:, edge]].mean(axis=1) - np.array(shape.centre)[:, None]
    far = np.hypot(*arm) > 0.5 * (shape.inner + shape.outer)
    return mesh, {"inner": edge[~far], "outer": edge[far]}


def _polygon(shape: Polygon) -> tuple[Any, dict[str, np.ndarray]]:
    corners, n = np.array(shape.corners), shape.count
    heart = corners.mean(axis=0)
    a, b = (v.ravel() for v in np.meshgrid(np.arange(n + 1), np.arange(n + 1), indexing="ij"))
    inside = a + b <= n
    a, b = a[inside], b[inside]
    number = {(i, j): k for k, (i, j) in enumerate(zip(a, b, strict=True))}
    up = [(number[i, j], number[i + 1, j], number[i, j + 1]) for i, j in number if i + j < n]
    down = [
        (number[i + 1, j], number[i + 1, j + 1], number[i, j + 1]) for i, j in number if i + j < n - 1
    ]
    local = np.array(up + down)
    points, cells = [], []
    for k in range(len(corners)):
        v, w = corners[k], corners[(k + 1) % len(corners)]
        cells.append(local + len(number) * k)
        points.append(heart + np.outer(a / n, v - heart) + np.outer(b / n, w - heart))
    p = np.concatenate(points)
    size = np.ptp(p, axis=0).max()
    _, first, inverse = np.unique(np.round(p / size, 9), axis=0, return_index=True, return_inverse=True)
    mesh = fem.MeshTri(p[first].T, inverse.ravel()[np.concatenate(cells)].T)
    edge = mesh.boundary_facets()
    middle = mesh.p[:, mesh.facets[:, edge]].mean(axis=1).T
    tags = {}
    for k in range(len(corners)):
        v, w = corners[k], corners[(k + 1) % len(corners)]
        along = (w - v) / np.linalg.norm(w - v)
        off = (middle - v) @ np.array([-along[1], along[0]])
        tags[f"side{k}"] = edge[np.abs(off) < 1e-9 * size]
    return mesh, tags
