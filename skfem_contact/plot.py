"""Pictures with matplotlib (the extra ``plot``): bodies, one contact, a history. 2-D only.

Every function draws into `ax`, or into a new figure, and returns the axes: titles, units and
limits are the user's to add. Labels carry no units, since nothing in the library has any.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from skfem_contact.contact import Contact
from skfem_contact.errors import InputError
from skfem_contact.io import Stress, body_cells, body_nodes
from skfem_contact.result import ContactResult, ContactValues
from skfem_contact.surface import ContactSurface

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
STATUS = ("open", "stick", "slip")
SHADES = ("none", "#bcd9c4", "#f6d6ad")  # open, stick, slip: pale, to lie behind lines
#: Legends stand above the axes, where no curve is.
ABOVE: dict[str, Any] = {
    "loc": "lower left", "bbox_to_anchor": (0.0, 1.0), "ncols": 5, "borderaxespad": 0.2,
    "handlelength": 1.4, "columnspacing": 1.2,
}  # fmt: skip
PRESSURE, FRICTION, LINES = "#20618d", "#b5441c", "#3a3a3a"


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
    arrows : bool
        Draw the traction at closed points. The head is on the secondary surface.
    label : str, optional
        Of the colour bar, to add a unit.
    cmap : str

    Returns
    -------
    matplotlib Axes

    Raises
    ------
    InputError
        If matplotlib is missing, or the problem is not a plane one with displacements.
    """
    _require_plane(result)
    ax = _axes(ax, _figure_size(result))
    factor = auto_scale(result) if scale == "auto" else float(scale)
    values = [_colours(result, i, stress) for i in range(len(result.system.bodies))]
    low, high = min(v.min() for v in values), max(v.max() for v in values)
    image = None
    for body, colour in zip(result.system.bodies, values, strict=True):
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
    label = label or ("displacement" if stress is None else "von Mises stress")
    ax.figure.colorbar(image, ax=ax, label=label, shrink=0.85, pad=0.02)
    ax.set(aspect="equal", xlabel="x", ylabel="y")
    ax.set_title(f"deformation magnified {factor:g} times" if factor != 1 else "true deformation")
    ax.autoscale_view()
    return ax


def plot_contact(
    result: ContactResult, contact: Contact | str | int | None = None, ax: Any = None
) -> Any:
    """Plot pressure and friction along the secondary surface, over its arc length.

    Sticking and slipping parts are shaded; the thin lines are the bounds of friction. A closed
    surface (a hole) is cut open in the middle of its longest part without contact.

    Parameters
    ----------
    result : ContactResult
    contact : Contact, str or int, optional
        Needed where there are several.
    ax : matplotlib Axes, optional

    Returns
    -------
    matplotlib Axes

    Raises
    ------
    InputError
        If matplotlib is missing, the contact is not one of the result, or it is not plane.
    """
    _require_plane(result)
    i = _which(result, contact)
    values, settings = result.values[i], result.contacts[i]
    surface = settings.secondary
    ax = _axes(ax, (7.0, 4.0))
    arc = arc_length(surface, values.status != 0)
    order = np.argsort(arc)
    s, closed = arc[order], values.status[order] != 0
    _shade(ax, s, values.status[order])
    pressure = values.pressure[order]
    ax.fill_between(s, pressure, color=PRESSURE, alpha=0.12, linewidth=0)
    ax.plot(s, pressure, color=PRESSURE, lw=1.8, label="pressure")
    if settings.friction is not None or settings.tied:
        friction = np.divide(
            values.tangential_force[:, 0],
            values.area,
            out=np.zeros_like(arc),
            where=values.area > 0,
        )
        ax.plot(s, friction[order], color=FRICTION, lw=1.8, label="friction")
    if settings.friction is not None:
        force = np.maximum(values.normal_force, 0.0)
        limit = settings.friction.limit(force, values.area, values.slip)
        bound = np.divide(limit, values.area, out=np.zeros_like(arc), where=values.area > 0)
        bound = np.where(closed, bound[order], 0.0)
        ax.plot(s, bound, color=FRICTION, lw=0.7, ls=(0, (4, 2)), label="bounds of friction")
        ax.plot(s, -bound, color=FRICTION, lw=0.7, ls=(0, (4, 2)))
    ax.axhline(0.0, color=LINES, lw=0.6)
    ax.set(xlabel=f"arc length along {surface.label}", ylabel="stress on the surface")
    ax.set_xlim(*_window(s, closed))
    ax.legend(frameon=False, fontsize="small", **ABOVE)
    ax.spines[["top", "right"]].set_visible(False)
    return ax


def plot_history(
    results: Sequence[ContactResult], contact: Contact | str | int | None = None, ax: Any = None
) -> Any:
    """Plot how much of a contact sticks and slips in each step, and the energy lost so far.

    Parameters
    ----------
    results : sequence of ContactResult
    contact : Contact, str or int, optional
        Needed where there are several.
    ax : matplotlib Axes, optional

    Returns
    -------
    matplotlib Axes
        That of the areas; the energy is on a twin axis at the right.
    """
    results = list(results)
    if not results:
        raise InputError("there are no results to plot: pass list(solver.history(steps))")
    ax = _axes(ax, (7.0, 4.0))
    values = [result.values[_which(result, contact)] for result in results]
    steps = np.arange(len(values))
    share = np.array([[v.area[v.status == k].sum() for v in values] for k in (1, 2)])
    ax.stackplot(steps, share, colors=SHADES[1:], labels=STATUS[1:])
    ax.set(xlabel="load step", ylabel="area in contact", xlim=(0, max(len(steps) - 1, 1)))
    right = ax.twinx()
    lost = [v.dissipation_total for v in values]
    right.plot(steps, lost, color=FRICTION, lw=1.8, label="energy lost by friction")
    right.set_ylabel("energy lost by friction", color=FRICTION)
    right.set_ylim(bottom=0.0)
    ax.legend(frameon=False, fontsize="small", **ABOVE)
    ax.spines["top"].set_visible(False)
    right.spines["top"].set_visible(False)
    return ax


def auto_scale(result: ContactResult) -> float:
    """A round factor: displacements up to 6 % of the extent, closed gaps overlapping by 1 %."""
    extent, largest = result.system.extent, float(np.abs(result.u).max(initial=0.0))
    if largest == 0.0:
        return 1.0
    closed = (result.state.status != 0) & result.kin.paired
    gap = float(np.abs(result.case.gap0[closed]).max(initial=0.0))
    factor = 0.06 * extent / largest
    if gap > 0.0:
        factor = min(factor, 1.0 + 0.01 * extent / gap)
    power = 10.0 ** np.floor(np.log10(factor))
    rounded = power * max(k for k in (1.0, 2.0, 5.0) if k * power <= factor * (1 + 1e-12))
    # a model in true size needs no factor just below or above one
    return 1.0 if 0.5 <= rounded <= 1.0 else float(rounded)


def arc_length(surface: ContactSurface, closed: NDArray[np.bool_]) -> Array:
    """Arc length of every point along its surface [length]; pieces follow one another.

    A surface that ends where it starts is cut open in the middle of its longest part without
    contact (`closed` all False), so that what touches is not torn apart.
    """
    start, end, length = surface.facets[:, 0], surface.facets[:, 1], surface.lengths
    jump = np.concatenate([[True], start[1:] != end[:-1]])
    piece = np.cumsum(jump) - 1
    arc, begin = np.full(len(surface.points), np.nan), 0.0
    for k in range(piece[-1] + 1):
        facets = np.flatnonzero(piece == k)
        if start[facets[0]] == end[facets[-1]]:
            facets = np.roll(facets, -_cut(closed[start[facets]]))
        stop = begin + np.cumsum(length[facets])
        arc[end[facets]] = stop
        arc[start[facets]] = stop - length[facets]
        if surface.quadratic:
            arc[surface.facets[facets, 2]] = stop - 0.5 * length[facets]
        begin = stop[-1]
    return arc


def _cut(closed: NDArray[np.bool_]) -> int:
    """Where to open a ring: the middle of the longest run of False."""
    if not closed.any():
        return 0
    first = int(np.argmax(closed))
    where = np.flatnonzero(np.roll(closed, -first))  # starts with 0
    stretch = np.diff(np.append(where, len(closed)))
    k = int(np.argmax(stretch))
    return int((first + where[k] + stretch[k] // 2) % len(closed))


def _window(s: Array, closed: NDArray[np.bool_]) -> tuple[float, float]:
    """What touches and a margin, within the surface."""
    if not closed.any():
        return float(s.min()), float(s.max())
    low, high = s[closed].min(), s[closed].max()
    margin = 0.15 * (high - low) + (s.max() - s.min()) / len(s)
    return float(max(low - margin, s.min())), float(min(high + margin, s.max()))


def _shade(ax: Any, s: Array, status: NDArray[np.intp]) -> None:
    """Shade runs of equal status; a point owns half of the way to its neighbours."""
    middle = np.concatenate([s[:1], 0.5 * (s[1:] + s[:-1]), s[-1:]])
    change = np.flatnonzero(np.diff(status)) + 1
    named = set()
    for a, b in zip([0, *change], [*change, len(s)], strict=True):
        k = int(status[a])
        if k:
            label = None if k in named else STATUS[k]
            ax.axvspan(middle[a], middle[b], color=SHADES[k], lw=0, zorder=0, label=label)
            named.add(k)


def _outline(ax: Any, x: Array, cells: NDArray[np.int64], kind: str) -> None:
    """Draw the edges that belong to one cell only: the boundary of the body."""
    from matplotlib.collections import LineCollection

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
    length = 0.08 * result.system.extent / peak
    for contact, values, size in zip(result.contacts, result.values, sizes, strict=True):
        surface = contact.secondary
        u = result.displacement(surface.body)[surface.dofs]
        order = np.argsort(arc_length(surface, values.status != 0))
        head = (values.points + factor * u)[order]
        tail = head - length * values.traction[order]
        ax.plot(*_only(tail, size[order] > 0).T, color=FRICTION, lw=0.8, zorder=3)
        shown = np.flatnonzero(size[order] > 0.03 * peak)
        shown = shown[:: 1 + len(shown) // 60]
        ax.quiver(
            *tail[shown].T, *(head - tail)[shown].T, angles="xy", scale_units="xy", scale=1.0,
            color=FRICTION, width=0.8, headwidth=4.5, headlength=5.5, headaxislength=5.0,
            units="dots", zorder=3,
        )  # fmt: skip


def _only(points: Array, keep: NDArray[np.bool_]) -> Array:
    """Points to draw a line through, torn where they are not kept."""
    return np.where(keep[:, None], points, np.nan)


def _colours(result: ContactResult, i: int, stress: Stress | None) -> Array:
    body = result.system.bodies[i]
    u = result.displacement(body)
    if stress is None:
        return np.linalg.norm(u[body_nodes(body)], axis=1)
    return np.asarray(stress(body, u), dtype=float)


def _which(result: ContactResult, contact: Contact | str | int | None) -> int:
    if contact is not None:
        return _index(result, result[contact])
    if len(result.names) > 1:
        raise InputError(
            f"there are {len(result.names)} contacts ({', '.join(result.names)}): say which to "
            f"plot, contact='{result.names[0]}'"
        )
    return 0


def _index(result: ContactResult, values: ContactValues) -> int:
    return next(i for i, mine in enumerate(result.values) if mine is values)


def _figure_size(result: ContactResult) -> tuple[float, float]:
    """Of the shape of the bodies, with room for the colour bar [inch]."""
    x = np.concatenate([body.dof_points for body in result.system.bodies])
    width, height = np.ptp(x, axis=0)
    ratio = float(np.clip(height / width, 0.3, 1.8)) if width > 0 else 1.0
    wide = 6.0 / max(1.0, ratio)
    return wide + 1.6, wide * ratio + 0.8


def _require_plane(result: ContactResult) -> None:
    body = result.system.bodies[0]
    if body.dim != 2 or body.components != 2:
        what = "a scalar field" if body.components == 1 else f"{body.dim}-D"
        raise InputError(
            f"pictures are of plane problems, this is {what}: use write('result.vtu', ...)"
        )


def _axes(ax: Any, size: tuple[float, float]) -> Any:
    if ax is not None:
        return ax
    try:
        from matplotlib import pyplot
    except ImportError:
        raise InputError(
            "pictures need matplotlib, which is not installed: pip install 'skfem-contact[plot]'"
        ) from None
    return pyplot.subplots(figsize=size, layout="compressed")[1]
