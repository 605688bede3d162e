"""Rigid obstacles in pictures: lines with strokes on the side of the solid, in space pale faces."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from skfem_contact.answers.result import ContactResult
from skfem_contact.output.drawing import LINES
from skfem_contact.output.thresholds import AROUND, STROKES, WHOLE
from skfem_contact.output.tools import fits, tools
from skfem_contact.output.view import View

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Box = tuple[Array, Array]

TOOL = "#8a8a8a"


def placed_tools(result: ContactResult, view: View, box: Box) -> list[tuple[Array, Index]]:
    """Points and lines or triangles of all obstacles in a picture of what is in a box."""
    found = []
    for tool in tools(result):
        motion = view.motion(tool.motion) if view.factor != 1 else tool.motion
        points, cells = tool.at(motion).outline(*box)
        found.append((points + motion.shift(points), cells))
    return found


def with_tools(result: ContactResult, view: View, box: Box) -> Box:
    """A box around bodies that has the places next to them on obstacles, and small ones as a whole."""
    low, high = box
    size = float(np.max(high - low))
    for values in result:
        if not values.contact.rigid:
            continue
        # the obstacle is behind the point by the gap, initial gaps are not magnified
        body = values.contact.secondary
        u = result.displacement(body.body)[body.dofs]
        near = np.isfinite(values.gap)
        if near.any():
            i = int(np.argmin(np.where(near, values.gap, np.inf)))
            foot = view.place(body.points, u)[i] - values.gap[i] * values.normal[i]
            low, high = np.minimum(low, foot), np.maximum(high, foot)
    drawn = placed_tools(result, view, (low, high))
    for tool, (points, _) in zip(tools(result), drawn, strict=True):
        if fits(tool.obstacle, WHOLE * size):
            low, high = np.minimum(low, points.min(axis=0)), np.maximum(high, points.max(axis=0))
    return low, high


def draw_lines(ax: Any, points: Array, lines: Index, size: float) -> None:
    """An obstacle in the plane; `size`: extent of the picture."""
    from matplotlib.collections import LineCollection  # optional, and slow to import

    if not len(lines):
        return
    ends = points[lines]
    ax.add_collection(
        LineCollection(list(ends), colors=LINES, linewidths=1.2, zorder=2.5, gid="obstacle")
    )
    along = ends[:, 1] - ends[:, 0]
    length = np.linalg.norm(along, axis=1)
    stop = np.cumsum(length)
    places = np.arange(0.5 * STROKES * size, stop[-1], STROKES * size)
    k = np.minimum(np.searchsorted(stop, places), len(lines) - 1)
    unit = along[k] / length[k, None]
    start = ends[k, 0] + (places - stop[k] + length[k])[:, None] * unit
    left = np.column_stack([-unit[:, 1], unit[:, 0]])
    stroke = STROKES * size / np.sqrt(2) * (left - unit)
    ax.add_collection(
        LineCollection(
            list(np.stack([start, start + stroke], axis=1)),
            colors=TOOL,
            linewidths=0.7,
            zorder=2.4,
            gid="obstacle strokes",
        )
    )


def draw_faces(ax: Any, points: Array, triangles: Index, box: Box) -> None:
    """An obstacle in space, as far as it is in a box: the bodies are seen through it."""
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection  # as above

    low, high = box
    size = float(np.max(high - low))
    shown = _inside(points[triangles], low - AROUND * size, high + AROUND * size)
    if shown:
        ax.add_collection3d(
            Poly3DCollection(
                shown,
                facecolors=TOOL,
                edgecolors=TOOL,
                linewidths=0.15,
                alpha=0.22,
                zorder=2,
                gid="obstacle",
            )
        )


def _inside(x: Array, low: Array, high: Array) -> list[Array]:
    """What of triangles (t, 3, 3) is in a box: polygons (k, 3), cut off at its sides."""
    apart = np.any((x.max(axis=1) < low) | (x.min(axis=1) > high), axis=1)
    whole = np.all((x >= low) & (x <= high), axis=(1, 2))
    shown = list(x[whole])
    for polygon in x[~whole & ~apart]:
        for k in range(3):
            for sign, bound in ((1.0, low[k]), (-1.0, high[k])):
                polygon = _beyond(polygon, sign * (polygon[:, k] - bound))
        if len(polygon) > 2:
            shown.append(polygon)
    return shown


def _beyond(polygon: Array, height: Array) -> Array:
    """The part of a convex polygon (k, 3) where heights (k,) are not negative."""
    after, there = np.roll(height, -1), np.roll(polygon, -1, axis=0)
    points = []
    for i in range(len(polygon)):
        if height[i] >= 0:
            points.append(polygon[i])
        if height[i] * after[i] < 0:
            part = height[i] / (height[i] - after[i])
            points.append(polygon[i] + part * (there[i] - polygon[i]))
    return np.array(points).reshape(-1, 3)
