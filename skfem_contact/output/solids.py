"""Pictures of solids, with matplotlib: deformed bodies from outside, contact faces by their pressure.

Faces are drawn as triangles of one colour each, cut fine enough to look smooth. All are in one
collection, which matplotlib draws from the back to the front; lines and points stand before them, so
only those of faces that look at the viewer are drawn.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skfem_contact.answers.result import ContactResult
from skfem_contact.answers.values import ContactValues
from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.conditions.state import SLIP, STICK
from skfem_contact.output.drawing import (
    FRICTION,
    LINES,
    LONGEST,
    PLAIN,
    arrow_heads,
    colour_bar,
    limits,
    note,
    open_words,
    solid_axes,
)
from skfem_contact.output.fields import labelled, quantity
from skfem_contact.output.view import Box, View, with_tools

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Mask = NDArray[np.bool_]

#: Where the viewer stands, seen from above.
ASIDE = np.array([np.cos(-1.0), np.sin(-1.0), 0.0])

# The box is drawn so much smaller than matplotlib does, which has no room for labels of long boxes.
ZOOM = 0.85

# Distances of the names and of the numbers of an axis from it, where matplotlib's own are 21 and 8 more
# than its pads [pt], times the part of the diagonal of the box that lies across the axis (`_beside`).
LABELS, TICKS = 21.0, 6.0

STUCK = "#2f7d4f"
#: Triangles into which a triangle is cut by the middles of its edges, as weights of its corners.
QUARTERS = np.array(
    [
        [[2, 0, 0], [1, 1, 0], [1, 0, 1]],
        [[1, 1, 0], [0, 2, 0], [0, 1, 1]],
        [[1, 0, 1], [0, 1, 1], [0, 0, 2]],
        [[1, 1, 0], [0, 1, 1], [1, 0, 1]],
    ]
) / 2.0  # fmt: skip


def draw_contact(values: ContactValues, ax: Any, units: Mapping[str, str]) -> Any:
    """The secondary surface around what touches, coloured by pressure, seen from the other side."""
    surface = values.surface
    closed = values.status != 0
    shown = _near(surface, closed)
    eye = _eye(surface, shown, closed)
    ax = solid_axes(ax, (7.0, 5.2))
    x, colour = _pieces(surface, shown, surface.points, values.pressure)
    image = _faces(ax, x, colour, "YlGnBu", (0.0, float(values.pressure.max(initial=0.0))))
    seen = shown & (surface.facet_normals @ eye > 0)
    _edges(ax, surface, seen, surface.points)
    if len(values.contact_edges):
        _lines(ax, values.contact_edges, color="black", lw=1.4, label="edge of contact")
    _states(ax, values, seen, surface, units)
    colour_bar(ax, image, labelled("pressure", "stress", units), shrink=0.7, pad=0.13)
    _look(ax, x.reshape(-1, 3), eye)
    ax.set_title(f"{values.name}: {surface.label}, seen from the other side", fontsize="medium")
    if not closed.any():
        note(ax, [open_words(values, units)])
    for axis in "xyz":
        if getattr(ax, f"get_{axis}label")():
            ax.set(**{f"{axis}label": labelled(axis, "length", units)})
    if ax.get_legend_handles_labels()[1]:  # below, where neither faces nor axes are
        below = {"loc": "upper center", "bbox_to_anchor": (0.5, 0.0), "borderaxespad": 0.2}
        ax.legend(**below, frameon=False, fontsize="small")
    return ax


def draw_bodies(
    result: ContactResult, seen: View, colours: list[Array], ax: Any, cmap: str, obstacles: bool
) -> tuple[Any, Any, Box]:
    """The outer faces of all bodies, displaced; `colours` per node of every boundary.

    Returns the axes, what the colour bar belongs to, and the box that is shown.
    """
    ax = solid_axes(ax, (7.0, 5.2))
    eye = _tilted(ASIDE, np.array([0.0, 0.0, 1.0]))
    parts, shades, outlines = [], [], []
    for body, colour in zip(result.system.solids.values(), colours, strict=True):
        surface = body.surface(None)
        places = seen.surface(result, surface)
        every = np.ones(len(surface.facets), dtype=bool)
        x, shade = _pieces(surface, every, places, colour)
        # what looks away is hidden by the body itself
        front = np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0]) @ eye > 0
        parts.append(x[front])
        shades.append(shade[front])
        outlines.append(_outline(surface, places, eye))
    low, high = limits(colours)
    x = np.concatenate(parts)
    lines = np.concatenate(outlines) + 0.02 * float(np.ptp(x.reshape(-1, 3), axis=0).max()) * eye
    image = _faces(ax, x, np.concatenate(shades), cmap, (low, high), lines)
    box = x.min(axis=(0, 1)), x.max(axis=(0, 1))
    if obstacles:
        box = with_tools(result, seen, box)
    _look(ax, np.stack(box), eye)
    return ax, image, box


def _pieces(surface: ContactSurface, shown: Mask, places: Array, values: Array) -> tuple[Array, Array]:
    """Triangles (t, 3, 3) of some faces, and the value at the middle of each, (t,)."""
    kind = surface.kind
    nodes = surface.facets[shown]
    x, v = places[nodes], values[nodes]
    if kind.centreless:
        N, _ = kind.shapes(kind.middle)
        x = np.concatenate([x, np.einsum("k,fkd->fd", N, x)[:, None]], axis=1)
        v = np.concatenate([v, v[:, -4:].mean(axis=1)[:, None]], axis=1)
    x, v = x[:, kind.simplices].reshape(-1, 3, 3), v[:, kind.simplices].reshape(-1, 3)
    while len(x) < 4000:  # as smooth as a picture can show
        x = np.einsum("qik,tkd->tqid", QUARTERS, x).reshape(-1, 3, 3)
        v = np.einsum("qik,tk->tqi", QUARTERS, v).reshape(-1, 3)
    return x, v.mean(axis=1)


def _outline(surface: ContactSurface, places: Array, eye: Array) -> Array:
    """Sharp edges of faces that look at the viewer, cut as finely as the faces, (s, 2, 3)."""
    edges = surface.kind.edges
    chain = surface.facets[:, edges[:, [0, 2, 1]] if edges.shape[1] == 3 else edges]
    x = places[surface.facets[:, : surface.kind.corners]]
    front = np.cross(x[:, 2] - x[:, 0], x[:, -1] - x[:, 1]) @ eye > 0
    x = places[chain[surface.sharp_edges & front[:, None]]]
    x = np.concatenate([x[:, :2], x[:, 1:]]) if x.shape[1] == 3 else x
    part = np.linspace(0.0, 1.0, 9)[:, None, None]
    points = (1 - part) * x[:, 0] + part * x[:, 1]
    return np.stack([points[:-1], points[1:]], axis=2).reshape(-1, 2, 3)


def _faces(
    ax: Any,
    x: Array,
    values: Array,
    cmap: str,
    limits: tuple[float, float],
    lines: Array | None = None,
) -> Any:
    """Triangles (t, 3, 3) with a colour each, and lines (s, 2, 3) among them."""
    from matplotlib.cm import ScalarMappable  # optional, and slow to import
    from matplotlib.colors import Normalize, to_rgba
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection

    image = ScalarMappable(Normalize(*limits), cmap)
    image.set_cmap(image.get_cmap().with_extremes(bad=PLAIN))
    colours = image.to_rgba(values)
    # an edge of the same colour closes the gaps between neighbours
    drawn, widths = x, np.full(len(x), 0.3)
    if lines is not None and len(lines):  # as triangles without area, to be hidden by what is before
        drawn = np.concatenate([x, lines[:, [0, 1, 1]]])
        dark = np.tile(to_rgba(LINES), (len(lines), 1))
        colours, widths = np.concatenate([colours, dark]), np.append(widths, np.full(len(lines), 0.8))
    faces = Poly3DCollection(
        list(drawn), facecolors=colours, edgecolors=colours, linewidths=widths, zorder=1
    )
    faces.set_rasterized(True)
    ax.add_collection3d(faces)
    image.set_array(values)
    return image


def _edges(ax: Any, surface: ContactSurface, shown: Mask, places: Array) -> None:
    """The edges of some faces, each once."""
    edges = surface.facets[shown][:, surface.kind.edges].reshape(-1, surface.kind.edges.shape[1])
    chain = edges[:, [0, 2, 1]] if edges.shape[1] == 3 else edges
    _, first = np.unique(np.sort(chain, axis=1), axis=0, return_index=True)
    if len(first):
        _lines(ax, places[chain[first]], color=LINES, lw=0.3, alpha=0.6)


def _lines(ax: Any, segments: Array, label: str | None = None, **style: Any) -> None:
    from mpl_toolkits.mplot3d.art3d import Line3DCollection  # as above

    lines = Line3DCollection(list(segments), zorder=3, colors=style.pop("color"), **style)
    lines.set_linewidth(style.get("lw", 1.0))
    lines.set_label(label or "_lines")
    ax.add_collection3d(lines)


def _states(
    ax: Any, values: ContactValues, seen: Mask, surface: ContactSurface, units: Mapping[str, str]
) -> None:
    """Draw points that stick as dots, points that slip as arrows of their friction."""
    if values.contact.friction is None:
        return
    there = np.zeros(len(values.points), dtype=bool)
    there[surface.facets[seen]] = True
    stuck = there & (values.status == STICK)
    if stuck.any():
        ax.scatter(
            *values.points[stuck].T, s=14, color=STUCK, zorder=4, label="sticks", depthshade=False
        )
    pressing = np.einsum("ik,ik->i", values.traction, values.normal)
    friction = values.traction - pressing[:, None] * values.normal
    size = np.linalg.norm(friction, axis=1)
    slipping = np.where(there & (values.status == SLIP), size, 0.0)
    slips = arrow_heads(slipping, float(size.max(initial=0.0)), 120)
    if len(slips):
        extent = float(np.ptp(surface.points[surface.facets[seen]].reshape(-1, 3), axis=0).max())
        arrow = LONGEST * extent / size.max() * friction[slips]
        longest = quantity(float(size.max()), "stress", units)
        ax.quiver(
            *(values.points[slips] - 0.5 * arrow).T, *arrow.T, color=FRICTION, lw=1.3, zorder=4,
            arrow_length_ratio=0.4, label=f"slips: friction on this side, up to {longest}",
        )  # fmt: skip


def _near(surface: ContactSurface, closed: Mask) -> Mask:
    """Faces around what touches: all, if nothing does."""
    if not closed.any():
        return np.ones(len(surface.facets), dtype=bool)
    x = surface.points
    low, high = x[closed].min(axis=0), x[closed].max(axis=0)
    margin = 0.25 * float(np.max(high - low)) + float(np.median(surface.lengths))
    middle = x[surface.facets].mean(axis=1)
    return np.asarray(np.all((middle >= low - margin) & (middle <= high + margin), axis=1))


def _eye(surface: ContactSurface, shown: Mask, closed: Mask) -> Array:
    """Towards the viewer: out of the faces, a little aside and above."""
    touching = shown & closed[surface.facets].any(axis=1)
    some = touching if touching.any() else shown
    normal = (surface.facet_areas[some, None] * surface.facet_normals[some]).sum(axis=0)
    size = float(np.linalg.norm(normal))
    normal = normal / size if size > 0 else np.array([0.0, 0.0, 1.0])
    aside = ASIDE - (ASIDE @ normal) * normal
    if np.linalg.norm(aside) < 0.3:  # seen from the side: a little above
        aside = np.array([0.0, 0.0, 1.0]) - normal[2] * normal
    return _tilted(normal, aside / np.linalg.norm(aside))


def _tilted(normal: Array, aside: Array) -> Array:
    """A direction half a radian off another: far enough to see that it is no plane picture."""
    return np.asarray(np.cos(0.5) * normal + np.sin(0.5) * aside)


def _look(ax: Any, points: Array, eye: Array) -> None:
    """Limits round the points, equal scales, seen from a direction."""
    from matplotlib.ticker import MaxNLocator  # as above

    low, high = points.min(axis=0), points.max(axis=0)
    least = 0.1 * float(np.max(high - low))  # a flat face has no height
    room = np.maximum(0.5 * (least - (high - low)), 0.0)
    low, high = low - room, high + room
    ax.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2]))
    ax.set_box_aspect(high - low, zoom=ZOOM)
    ax.view_init(
        elev=float(np.degrees(np.arcsin(eye[2]))), azim=float(np.degrees(np.arctan2(eye[1], eye[0])))
    )
    ax.set(xlabel="x", ylabel="y", zlabel="z")
    ax.tick_params(labelsize="small")
    size = (high - low) / float(np.max(high - low))
    for axis, length, room in zip(
        (ax.xaxis, ax.yaxis, ax.zaxis), size, _beside(size, eye), strict=True
    ):
        if length > 0.2:  # without the ends, where labels of two axes meet
            axis.set_major_locator(MaxNLocator(5 if length > 0.4 else 3, prune="both"))
            axis.labelpad = LABELS / room - 21.0
            axis.set_tick_params(pad=TICKS / room - 8.0)
        else:  # a flat face: nothing to read off
            axis.set_ticks([])
            axis.set_label_text("")


def _beside(size: Array, eye: Array) -> Array:
    """How far from an axis matplotlib sets its labels, over the diagonal of the box, per point of pad.

    It moves them along the other two sides, by parts of their lengths: of a slender box hardly at all.
    """
    seen = np.eye(3) - np.outer(eye, eye)  # the unit vectors of the axes as the viewer sees them
    found = np.empty(3)
    for k in range(3):
        along = seen[k] / max(float(np.linalg.norm(seen[k])), 1e-6)
        across = np.linalg.norm(np.cross(seen, along), axis=1) * size
        found[k] = np.sqrt(np.sum(np.delete(across, k) ** 2)) / np.linalg.norm(size)
    return np.maximum(found, 0.02)
