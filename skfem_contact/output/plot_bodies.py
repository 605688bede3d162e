"""Pictures of deformed bodies, with matplotlib (the extra ``plot``)."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from skfem_contact.answers.answer import answer_of
from skfem_contact.answers.result import ContactResult
from skfem_contact.arguments import known_keywords
from skfem_contact.bodies.body import Body
from skfem_contact.conditions.state import OPEN
from skfem_contact.output.drawing import FRICTION, LINES, arc_length, is_solid, new_axes
from skfem_contact.output.solids import draw_bodies
from skfem_contact.output.stress import field_name
from skfem_contact.output.thresholds import (
    ARROWS,
    DISPLACED,
    LONGEST,
    NEARLY_TRUE,
    OVERLAPPING,
    ROUND,
    SAME_FACTOR,
    SHORTEST,
)
from skfem_contact.output.vtk import Stress, body_cells, body_nodes

Array = NDArray[np.float64]

#: How the cells of each type are cut into triangles, by local node numbers.
TRIANGLES = {
    "triangle": [(0, 1, 2)],
    "triangle6": [(0, 3, 5), (3, 1, 4), (5, 4, 2), (3, 4, 5)],
    "quad": [(0, 1, 2), (0, 2, 3)],
    "quad8": [(0, 4, 7), (4, 1, 5), (5, 2, 6), (6, 3, 7), (4, 5, 6), (4, 6, 7)],
    "quad9": [
        *[(0, 4, 8), (4, 1, 8), (1, 5, 8), (5, 2, 8)],
        *[(2, 6, 8), (6, 3, 8), (3, 7, 8), (7, 0, 8)],
    ],
}


@known_keywords()
def plot_deformed(
    result: ContactResult,
    scale: float | Literal["auto"] = "auto",
    stress: Stress | None = None,
    ax: Any = None,
    *,
    arrows: bool = True,
    label: str | None = None,
    cmap: str = "YlGnBu",
) -> Any:
    """Draw the deformed bodies, coloured, with arrows for what the contact does to the secondary.

    Of solids the outer faces, as seen from the first octant, without arrows: what touches is inside,
    and `plot_contact` shows it.

    Parameters
    ----------
    result : ContactResult
    scale : float or "auto"
        Factor on the displacements. Initial gaps are not magnified with them: at a scale s, points
        that closed a gap g overlap by (s - 1) g in the picture. "auto" keeps both small.
    stress : callable, optional
        ``stress(body, u)`` gives the colours, a number per node, such as `von_mises`; by default
        the size of the displacement.
    ax : matplotlib Axes, optional
        Of solids with ``projection="3d"``.
    arrows : bool
        Draw the traction at closed points. The head is on the secondary surface.
    label : str, optional
        Of the colour bar, to add a unit; by default the name of the function `stress`.
    cmap : str

    Returns
    -------
    matplotlib Axes

    Raises
    ------
    InputError
        If matplotlib is missing, or the problem has no displacements.
    """
    solid = is_solid(result)
    factor = auto_scale(result) if scale == "auto" else float(scale)
    values = [_colours(result, body, stress) for body in result.system.solids.values()]
    if solid:
        bodies = result.system.solids.values()
        outside = [_on_boundary(body, v) for body, v in zip(bodies, values, strict=True)]
        ax, image = draw_bodies(result, factor, outside, ax, cmap)
        _label(ax, image, factor, label, stress)
        return ax
    ax = new_axes(ax, _figure_size(result))
    low, high = min(v.min() for v in values), max(v.max() for v in values)
    image = None
    for body, colour in zip(result.system.solids.values(), values, strict=True):
        u = result.displacement(body)
        nodes, (kind, cells) = body_nodes(body), body_cells(body)
        x = (body.dof_points[nodes[:, 0]] + factor * u[nodes]).T
        triangles = np.concatenate([cells[:, list(local)] for local in TRIANGLES[kind]])
        image = ax.tripcolor(
            *x,
            triangles,
            colour,
            shading="gouraud",
            cmap=cmap,
            vmin=low,
            vmax=high,
            rasterized=True,
        )
        _outline(ax, x, cells, kind)
    if arrows:
        _arrows(ax, result, factor)
    _label(ax, image, factor, label, stress)
    ax.set(aspect="equal", xlabel="x", ylabel="y")
    ax.autoscale_view()
    return ax


def _label(ax: Any, image: Any, factor: float, label: str | None, stress: Stress | None) -> None:
    """The colour bar, and the factor in the title."""
    if label is None:
        label = "displacement" if stress is None else field_name(stress).replace("_", " ")
    plane = not hasattr(ax, "zaxis")
    ax.figure.colorbar(
        image, ax=ax, label=label, shrink=0.85 if plane else 0.7, pad=0.02 if plane else 0.08
    )
    ax.set_title(f"deformation magnified {factor:g} times" if factor != 1 else "true deformation")


def _on_boundary(body: Body, values: Array) -> Array:
    """Values at the nodes of a body, (nodes,), at those of its boundary surface."""
    of_dof = np.empty(body.n)
    of_dof[body_nodes(body)] = values[:, None]
    return np.asarray(of_dof[body.surface(None).dofs[:, 0]])


def auto_scale(result: ContactResult) -> float:
    """A round factor: displacements up to 6 % of the extent, closed gaps overlapping by 1 %."""
    answer = answer_of(result)
    extent, largest = answer.system.extent, _largest(result)
    if largest == 0.0:
        return 1.0
    closed = (answer.state.status != OPEN) & answer.kin.paired
    gap = float(np.abs(answer.case.gap0[closed]).max(initial=0.0))
    factor = DISPLACED * extent / largest
    if gap > 0.0:
        factor = min(factor, 1.0 + OVERLAPPING * extent / gap)
    power = 10.0 ** np.floor(np.log10(factor))
    rounded = power * max(k for k in ROUND if k * power <= factor * (1 + SAME_FACTOR))
    # a model in true size needs no factor just below or above one
    return 1.0 if NEARLY_TRUE <= rounded <= 1.0 else float(rounded)


def _largest(result: ContactResult) -> float:
    """The largest displacement of a body that is drawn."""
    found = [np.abs(result.displacement(body)) for body in result.system.solids.values()]
    return max(float(u.max(initial=0.0)) for u in found)


def _outline(ax: Any, x: Array, cells: NDArray[np.int64], kind: str) -> None:
    """Draw the edges that belong to one cell only: the boundary of the body."""
    from matplotlib.collections import LineCollection  # optional, and slow to import

    corners = 3 if kind.startswith("triangle") else 4
    ends = [(i, (i + 1) % corners) for i in range(corners)]
    quadratic = cells.shape[1] > 4
    edges = np.concatenate(
        [
            np.column_stack([cells[:, i], cells[:, corners + i if quadratic else i], cells[:, j]])
            for i, j in ends
        ]
    )
    _, index, count = np.unique(
        np.sort(edges[:, [0, 2]], axis=1), axis=0, return_index=True, return_counts=True
    )
    lines = x.T[edges[index[count == 1]]]
    ax.add_collection(LineCollection(list(lines), colors=LINES, linewidths=0.7))


def _arrows(ax: Any, result: ContactResult, factor: float) -> None:
    """Tractions at closed points, the longest 8 % of the extent; about 60 arrows at most."""
    sizes = [np.linalg.norm(v.traction, axis=1) for v in result.values]
    peak = max(float(size.max(initial=0.0)) for size in sizes)
    if peak == 0.0:
        return
    length = LONGEST * result.system.extent / peak
    for contact, values, size in zip(result.contacts, result.values, sizes, strict=True):
        surface = contact.secondary
        u = result.displacement(surface.body)[surface.dofs]
        order = np.argsort(arc_length(surface, values.status != OPEN))
        head = (values.points + factor * u)[order]
        tail = head - length * values.traction[order]
        ax.plot(*_only(tail, size[order] > 0).T, color=FRICTION, lw=0.8, zorder=3)
        shown = np.flatnonzero(size[order] > SHORTEST * peak)
        shown = shown[:: 1 + len(shown) // ARROWS]
        ax.quiver(
            *tail[shown].T, *(head - tail)[shown].T, angles="xy", scale_units="xy", scale=1.0,
            color=FRICTION, width=0.8, headwidth=4.5, headlength=5.5, headaxislength=5.0,
            units="dots", zorder=3,
        )  # fmt: skip


def _only(points: Array, keep: NDArray[np.bool_]) -> Array:
    """Points to draw a line through, torn where they are not kept."""
    return np.where(keep[:, None], points, np.nan)


def _colours(result: ContactResult, body: Body, stress: Stress | None) -> Array:
    u = result.displacement(body)
    if stress is None:
        return np.linalg.norm(u[body_nodes(body)], axis=1)
    return np.asarray(stress(body, u), dtype=float)


def _figure_size(result: ContactResult) -> tuple[float, float]:
    """Of the shape of the bodies, with room for the colour bar [inch]."""
    x = np.concatenate([body.dof_points for body in result.system.solids.values()])
    width, height = np.ptp(x, axis=0)
    ratio = float(np.clip(height / width, 0.3, 1.8)) if width > 0 else 1.0
    wide = 6.0 / max(1.0, ratio)
    return wide + 1.6, wide * ratio + 0.8
