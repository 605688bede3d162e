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
    x = _fine(points[triangles], size / 12)
    middle, room = x.mean(axis=1), AROUND * size
    x = x[np.all((middle >= low - room) & (middle <= high + room), axis=1)]
    if len(x):
        ax.add_collection3d(
            Poly3DCollection(
                list(x),
                facecolors=TOOL,
                edgecolors=TOOL,
                linewidths=0.15,
                alpha=0.22,
                zorder=2,
                gid="obstacle",
            )
        )


def _fine(x: Array, longest: float) -> Array:
    """Triangles (t, 3, 3) cut in halves until their sides are short enough."""
    for _ in range(12):
        sides = np.linalg.norm(np.roll(x, -1, axis=1) - x, axis=2)
        k = np.argmax(sides, axis=1)
        long = sides.max(axis=1, initial=0.0) > longest
        if not long.any() or len(x) > 20_000:
            break
        cut, k = x[long], k[long]
        i = np.arange(len(cut))
        a, b, c = cut[i, k], cut[i, (k + 1) % 3], cut[i, (k + 2) % 3]
        m = 0.5 * (a + b)
        x = np.concatenate([x[~long], np.stack([a, m, c], 1), np.stack([m, b, c], 1)])
    return x
