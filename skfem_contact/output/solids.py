"""Pictures of solids: parts in space, seen from a direction, by PyVista or by matplotlib.

What is drawn is a list of `Part`: triangles with lines on them. PyVista, where it is installed, turns
them into the pixels of a picture without distortion by distance, which stands in plane axes of
matplotlib. Otherwise matplotlib paints the triangles from the back to the front. Marks, arrows, words
and the bar of colours are matplotlib's in both.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Mapping, Sequence
from ctypes.util import find_library
from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skfem_contact.answers.result import ContactResult
from skfem_contact.arguments import numbers
from skfem_contact.arrays import Array, Index, Mask, check_finite
from skfem_contact.bodies.body import Body, body_nodes
from skfem_contact.bodies.facet_kinds import FacetKind, kind_of
from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.digits import COMPUTED
from skfem_contact.errors import InputError
from skfem_contact.output.drawing import LINES, PLAIN, ROUND, TOOL, Box, View, new_axes, placed_tools
from skfem_contact.output.stress import body_cells, quantity, three
from skfem_contact.output.tools import BESIDE
from skfem_contact.records import dataclass

#: From where solids are seen, and what is above there.
VIEWER, UP = (1.0, -1.5, 1.0), (0.0, 0.0, 1.0)
STUCK = "#2f7d4f"
#: Larger side of a picture by PyVista [pixels]: more than a figure has, which smooths it.
PIXELS = 1600


@dataclass(frozen=True, eq=False)
class Part:
    """Triangles of a picture in space, and lines on them.

    Attributes
    ----------
    points : ndarray, shape (p, 3)
    triangles : ndarray, shape (t, 3)
    colour : str or ndarray, shape (p,)
        A colour, or a value of each point.
    lines : ndarray, shape (s, 2, 3)
    opacity : float
    shaded : bool
        Darker where it looks away from the light, where PyVista draws it.
    """

    points: Array
    triangles: Index
    colour: str | Array
    lines: Array
    opacity: float = 1.0
    shaded: bool = True


def body_part(result: ContactResult, body: Body, seen: View, values: Array) -> Part:
    """A displaced body with values at its nodes: outer faces of a solid, cells of a plane body."""
    surface = body.surface(None)
    places = seen.surface(result, surface)
    if body.dim == 3:
        of_dof = np.empty(body.n)
        of_dof[body_nodes(body)] = values[:, None]
        every = np.ones(len(surface.facets), dtype=bool)
        lines = edge_lines(surface, places, surface.sharp_edges)
        return faces_part(surface, every, places, of_dof[surface.dofs[:, 0]], lines)
    nodes, cells = body_nodes(body), body_cells(body)[1]
    x = seen.place(body.dof_points[nodes[:, 0]], result.displacement(body)[nodes])
    lines = three(places[surface.facets][:, surface.kind.simplices].reshape(-1, 2)).reshape(-1, 2, 3)
    return Part(three(x), cut_cells(cells), values, lines)


def cut_cells(cells: Index) -> Index:
    """Triangles between the nodes of plane cells."""
    return np.concatenate([cells[:, local] for local in kind_of(3, cells.shape[1]).cut])


def faces_part(
    surface: ContactSurface, shown: Mask, places: Array, values: Array | str, lines: Array
) -> Part:
    """Some faces of a surface, curved as their shape functions are."""
    nodes = surface.facets[shown]
    cuts = max(2, int(np.ceil(np.sqrt(2000 / max(1, len(nodes))))))  # as smooth as a picture can show
    at, triangles = _lattice(surface.kind, cuts)
    N, _ = surface.kind.shapes(at)
    x = np.einsum("qk,fkd->fqd", N, places[nodes]).reshape(-1, 3)
    colour = values if isinstance(values, str) else np.einsum("qk,fk->fq", N, values[nodes]).ravel()
    starts = len(at) * np.arange(len(nodes))[:, None, None]
    return Part(x, (starts + triangles).reshape(-1, 3), colour, lines)


def _lattice(kind: FacetKind, cuts: int) -> tuple[Array, Index]:
    """Reference coordinates (q, 2) all over a face, and triangles (t, 3) between them."""
    t = np.linspace(0.0, 1.0, cuts + 1)
    at = np.stack(np.meshgrid(t, t, indexing="ij"), axis=-1).reshape(-1, 2)
    i = np.arange(len(at)).reshape(cuts + 1, -1)
    a, b, c, d = (part.ravel() for part in (i[:-1, :-1], i[1:, :-1], i[1:, 1:], i[:-1, 1:]))
    triangles = np.concatenate([np.stack([a, b, d], axis=1), np.stack([b, c, d], axis=1)])
    if kind.triangle:
        triangles = triangles[at[triangles].sum(axis=2).max(axis=1) < 1.0 + COMPUTED]
    used, triangles = np.unique(triangles, return_inverse=True)
    return at[used], triangles.reshape(-1, 3)


def edge_lines(surface: ContactSurface, places: Array, chosen: Mask) -> Array:
    """Edges (f, corners) of faces as short straight lines (s, 2, 3)."""
    kind = surface.kind
    start = kind.locations[: kind.corners]
    t = np.linspace(0.0, 1.0, 9 if kind.quadratic else 2)[:, None]
    N, _ = kind.shapes((1 - t) * start[:, None] + t * np.roll(start, -1, axis=0)[:, None])
    x = np.einsum("eqk,fkd->feqd", N, places[surface.facets])[chosen]
    return np.stack([x[:, :-1], x[:, 1:]], axis=2).reshape(-1, 2, 3)


def tool_parts(result: ContactResult, seen: View, box: Box) -> list[Part]:
    """Rigid obstacles as far as they are in a box and near it; bodies are seen through them."""
    room = BESIDE * float(np.max(box[1] - box[0]))
    parts = []
    for points, cells in placed_tools(result, seen, box):
        lines, x, triangles = np.zeros((0, 2, 3)), np.zeros((0, 3)), np.zeros((0, 3), dtype=int)
        if points.shape[1] == 2:
            lines = three(points)[cells]
        else:
            shown = _inside(points[cells], box[0] - room, box[1] + room)
            fans = [p[[0, i, i + 1]] for p in shown for i in range(1, len(p) - 1)]
            x = np.array(fans).reshape(-1, 3)
            triangles = np.arange(len(x)).reshape(-1, 3)
        if len(lines) or len(x):
            parts.append(Part(x, triangles, TOOL, lines, 0.4))
    return parts


def _inside(x: Array, low: Array, high: Array) -> list[Array]:
    """Cut off what is outside of a box from triangles (t, 3, 3): polygons (k, 3) are left."""
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
    cut = height * after < 0
    part = np.divide(height, height - after, out=np.zeros_like(height), where=cut)
    points = np.stack([polygon, polygon + part[:, None] * (there - polygon)], axis=1)
    return points[np.stack([height >= 0, cut], axis=1)]


def frame_of(viewer: Sequence[float] | Array, up: Sequence[float] | Array) -> Array:
    """Unit vectors to the right, up and towards the viewer, as rows of (3, 3)."""
    usage = "give a direction (x, y, z); viewer and up must not be parallel"
    back, above = numbers(viewer, "viewer", usage), numbers(up, "up", usage)
    if back.shape != (3,) or above.shape != (3,):
        raise InputError(f"viewer has shape {back.shape} and up {above.shape}; {usage}")
    check_finite(back, "viewer", "component")
    check_finite(above, "up", "component")
    right = np.cross(above, back)
    if np.linalg.norm(right) <= COMPUTED * np.linalg.norm(back) * np.linalg.norm(above):
        raise InputError(f"viewer is {back.tolist()} and up {above.tolist()}; {usage}")
    rows = np.stack([right, np.cross(back, right), back])
    return np.asarray(rows / np.linalg.norm(rows, axis=1)[:, None])


def picture(
    parts: list[Part],
    ax: Any,
    frame: Array,
    cmap: str,
    clim: tuple[float, float],
    units: Mapping[str, str],
) -> tuple[Any, Any]:
    """Draw parts into plane axes: the axes, and what their bar of colours belongs to.

    A point x stands at ``frame[:2] @ x`` of the axes.
    """
    ax = new_axes(ax, (7.0, 5.2))
    if hasattr(ax, "zaxis"):
        raise InputError(
            "these axes are in space: give plain ones, figure.add_subplot(), and viewer=(x, y, z)"
        )
    image = colour_map(cmap, clim)
    seen = np.concatenate([part.points for part in parts]) @ frame.T
    low, high = seen[:, :2].min(axis=0), seen[:, :2].max(axis=0)
    room = 0.03 * float(np.max(high - low))
    low, high = low - room, high + room
    pyvista = _pyvista()
    if pyvista is None:
        _paint(ax, parts, frame, image)
    else:
        pixels = _pixels(pyvista, parts, frame, image, (low, high), seen[:, 2])
        ax.imshow(pixels, extent=(low[0], high[0], low[1], high[1]), zorder=1)
    low[1] -= _triad(ax, frame, (low, high), units)
    ax.set(aspect="equal", xlim=(low[0], high[0]), ylim=(low[1], high[1]))
    ax.axis("off")
    return ax, image


def colour_map(cmap: str, clim: tuple[float, float]) -> Any:
    """The colours of values, grey where there is none."""
    from matplotlib.cm import ScalarMappable  # optional, and slow to import
    from matplotlib.colors import Normalize

    image = ScalarMappable(Normalize(*clim), cmap)
    image.set_cmap(image.get_cmap().with_extremes(bad=PLAIN))
    image.set_array(np.array(clim))
    return image


def _pyvista() -> Any:
    """PyVista where it is installed and can draw."""
    try:
        import pyvista  # optional, and slow to import
    except ImportError:
        return None
    return pyvista if _can_draw(pyvista) else None


@lru_cache
def _can_draw(pyvista: Any) -> bool:
    """Return whether VTK finds OpenGL; where it does not, it ends the process when it draws.

    Without a display VTK takes EGL, from 9.4 on, and as its last resort OSMesa, there or not.
    """
    if sys.platform.startswith("linux") and not os.environ.get("DISPLAY"):
        if pyvista.vtk_version_info < (9, 4):
            return False
        with pyvista.vtk_verbosity("off"):
            plotter = pyvista.Plotter(off_screen=True)
            window = plotter.render_window.GetClassName()
            plotter.close()
        return not window.startswith("vtkOS") or find_library("OSMesa") is not None
    return True


def plotter_of(pyvista: Any, parts: list[Part], image: Any, off_screen: bool | None, **bar: Any) -> Any:
    """A plotter with all parts; `bar`: of the bar of colours, none if there is nothing."""
    from matplotlib.colors import to_hex  # which PyVista brings

    plotter = pyvista.Plotter(off_screen=off_screen)
    plotter.set_background("white")
    low, high = image.get_clim()
    for part in parts:
        style: dict[str, Any] = {"opacity": part.opacity, "lighting": part.shaded}
        if part.shaded:
            style |= {"ambient": 0.6, "diffuse": 0.4}
        mesh = pyvista.PolyData(part.points, np.insert(part.triangles, 0, 3, axis=1))
        if isinstance(part.colour, str):
            style["color"] = to_hex(part.colour)
        else:
            name = bar.get("title", "values")
            mesh.point_data[name] = part.colour
            style |= {"scalars": name, "clim": (low, high), "cmap": image.get_cmap().name}
            style |= {"nan_color": PLAIN, "show_scalar_bar": bool(bar), "scalar_bar_args": bar or None}
        if len(part.triangles):
            plotter.add_mesh(mesh, **style)
        if len(part.lines):
            ends = np.arange(2 * len(part.lines)).reshape(-1, 2)
            lines = pyvista.PolyData(part.lines.reshape(-1, 3), lines=np.insert(ends, 0, 2, axis=1))
            plotter.add_mesh(lines, color=LINES, line_width=3.0)
    return plotter


def _pixels(
    pyvista: Any, parts: list[Part], frame: Array, image: Any, shown: Box, depth: Array
) -> NDArray[np.uint8]:
    """The picture of a part of the plane of view, (height, width, 4)."""
    size = shown[1] - shown[0]
    middle = np.append(0.5 * (shown[0] + shown[1]), depth.mean())
    centre, reach = middle @ frame, float(np.ptp(depth) + size.max())
    behind = 0.002 * reach * frame[2]  # obstacles, so that faces that touch them are drawn
    parts = [replace(p, points=p.points - behind) if p.opacity < 1 else p for p in parts]
    with pyvista.vtk_verbosity("error"):  # VTK warns where it looks for a display in vain
        plotter = plotter_of(pyvista, parts, image, True)
        plotter.window_size = [max(1, int(s)) for s in PIXELS * size / size.max()]
        camera = plotter.camera
        camera.focal_point, camera.position, camera.up = centre, centre + 2 * reach * frame[2], frame[1]
        camera.parallel_projection, camera.parallel_scale = True, 0.5 * float(size[1])
        camera.clipping_range = reach, 3 * reach
        pixels = plotter.screenshot(return_img=True, transparent_background=True)
        plotter.close()
    return np.asarray(pixels)


def _paint(ax: Any, parts: list[Part], frame: Array, image: Any) -> None:
    """Triangles of one colour each, and lines as triangles without area, those behind first.

    What bodies are seen through stands before them.
    """
    from matplotlib.collections import PolyCollection
    from matplotlib.colors import to_rgba

    x, colours, widths, before = [], [], [], []
    for part in parts:
        corners, shade = part.points[part.triangles] @ frame.T, part.colour
        if part.opacity == 1:  # what looks away is hidden
            sides = corners[:, 1:, :2] - corners[:, :1, :2]
            front = sides[:, 0, 0] * sides[:, 1, 1] > sides[:, 0, 1] * sides[:, 1, 0]
        else:
            front = np.ones(len(corners), dtype=bool)
        values = shade if isinstance(shade, str) else shade[part.triangles[front]].mean(axis=1)
        fill = to_rgba(values) if isinstance(values, str) else image.to_rgba(values)
        x += [corners[front], part.lines[:, [0, 1, 1]] @ frame.T]
        fill = np.broadcast_to(fill, (len(x[-2]), 4)) * np.array([1, 1, 1, part.opacity])
        colours += [fill, np.tile(to_rgba(LINES), (len(part.lines), 1))]
        widths += [np.full(len(fill), 0.3 * (part.opacity == 1)), np.full(len(part.lines), 0.8)]
        before += [np.full(len(fill) + len(part.lines), part.opacity < 1)]
    seen, every, width = (np.concatenate(some) for some in (x, colours, widths))
    depth = seen[..., 2].mean(axis=1)
    depth += 0.02 * np.ptp(depth) * (width > 0.5)  # lines are on the faces
    order = np.lexsort([depth, np.concatenate(before)])
    style: dict[str, Any] = {"facecolors": every[order], "edgecolors": every[order]}
    drawn = PolyCollection(list(seen[order, :, :2]), linewidths=width[order], zorder=1, **style)
    drawn.set_rasterized(True)
    ax.add_collection(drawn)


def _triad(ax: Any, frame: Array, shown: Box, units: Mapping[str, str]) -> float:
    """Draw the three axes below the picture, with their length; the height that they take."""
    low, high = shown
    wish = 0.12 * float(np.max(high - low))
    power = 10.0 ** np.floor(np.log10(wish))
    length = power * max(k for k in ROUND if k * power <= wish * (1 + COMPUTED))
    ends = length * frame[:2].T  # of x, y and z in the plane of view
    start = low - np.minimum(ends.min(axis=0), 0.0)
    height = float(np.ptp(np.append(ends[:, 1], 0.0))) + 0.3 * wish
    start[1] -= height - 0.15 * wish
    placed: list[Array] = []
    for name, end in zip("xyz", ends, strict=True):
        if np.linalg.norm(end) > 0.1 * length:
            tip = {"arrowstyle": "-|>", "color": LINES, "lw": 0.8, "shrinkA": 0, "shrinkB": 0}
            ax.annotate("", start + end, start, arrowprops=tip, annotation_clip=False)
            step = 0.2 * wish * end / np.linalg.norm(end)
            at = start + end + step
            while any(np.linalg.norm(at - other) < 0.3 * wish for other in placed):
                at = at + step  # axes that look alike from here have their letters in a row
            placed.append(at)
            ax.text(*at, name, color=LINES, ha="center", va="center", fontsize="small")
    place = low[0] + float(np.ptp(np.append(ends[:, 0], 0.0))) + 0.5 * wish, low[1] - 0.5 * height
    ax.text(*place, quantity(length, "length", units), va="center", fontsize="small", color=LINES)
    return height + 0.15 * wish
