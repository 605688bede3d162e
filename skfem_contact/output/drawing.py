"""The common parts of all pictures: axes, the arc length along a surface, colours. With matplotlib.

Every function draws into `ax`, or into a new figure, and returns the axes: titles and limits are the
user's to change. Labels carry the units that the user gives, since nothing in the library has any.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skfem_contact.answers.result import ContactResult
from skfem_contact.answers.values import ContactValues
from skfem_contact.arguments import check_kind, shown
from skfem_contact.arrays import Array, Index
from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.conditions.contact import Contact
from skfem_contact.errors import InputError
from skfem_contact.output.fields import quantity

# The longest arrow over the extent.
LONGEST = 0.08

PRESSURE, FRICTION, LINES, TOOL = "#20618d", "#b5441c", "#3a3a3a", "#8a8a8a"
PLAIN = "#e4e4e4"  # bodies that have no value
SHADES = ("none", "#bcd9c4", "#f6d6ad")  # open, stick, slip: pale, to lie behind lines
#: Legends stand above the axes, where no curve is.
ABOVE: dict[str, Any] = {
    "loc": "lower left", "bbox_to_anchor": (0.0, 1.0), "ncols": 5, "borderaxespad": 0.2,
    "handlelength": 1.4, "columnspacing": 1.2,
}  # fmt: skip


def limits(values: Sequence[Array]) -> tuple[float, float]:
    """The smallest and the largest of all values; NaN is none.

    >>> limits([np.array([1.0, 2.0]), np.array([np.nan])])
    (1.0, 2.0)
    """
    every = np.concatenate(values)
    return float(np.nanmin(every)), float(np.nanmax(every))


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
    """Choose where to open a ring: the middle of the longest run of False."""
    if not closed.any():
        return 0
    first = int(np.argmax(closed))
    where = np.flatnonzero(np.roll(closed, -first))  # starts with 0
    stretch = np.diff(np.append(where, len(closed)))
    k = int(np.argmax(stretch))
    return int((first + where[k] + stretch[k] // 2) % len(closed))


def is_solid(result: ContactResult) -> bool:
    """Return whether a result is of solids; refuse results without displacements to draw."""
    usage = "draw what solve(...) returned, or one of a history"
    if isinstance(result, ContactValues):
        usage = f"write plot_contact(result, {result.name!r}), and plot_deformed(result) for the bodies"
    check_kind(result, ContactResult, "result", usage)
    body = next(iter(result.system.solids.values()))
    if body.components != body.dim:
        raise InputError(
            "pictures are of displacements, this is a scalar field: use write('result.vtu', ...)"
        )
    return bool(body.dim == 3)


def new_axes(ax: Any, size: tuple[float, float]) -> Any:
    """The axes given, or those of a new figure."""
    if ax is not None and not hasattr(ax, "tripcolor"):
        raise InputError(f"ax is {shown(ax)}, no axes of matplotlib; give ax=figure.gca(), or none")
    return ax if ax is not None else _pyplot().subplots(figsize=size, layout="compressed")[1]


def new_figure(size: tuple[float, float]) -> Any:
    """A new figure without axes."""
    return _pyplot().figure(figsize=size, layout="compressed")


def colour_bar(ax: Any, image: Any, label: str, **where: Any) -> None:
    """The bar of colours; where all values are equal it names this one, and no range around it."""
    low, high = image.get_clim()
    same = low == high
    ax.figure.colorbar(image, ax=ax, label=label, ticks=[low] if same else None, **where)


def short_numbers(ax: Any) -> None:
    """A few round numbers at both axes, with a common power of ten where they are small or large."""
    from matplotlib.ticker import MaxNLocator, ScalarFormatter  # optional, and slow to import

    for axis in (ax.xaxis, ax.yaxis):
        if isinstance(axis.get_major_formatter(), ScalarFormatter):  # not those of the user's axes
            axis.set_major_locator(MaxNLocator(6, steps=[1, 2, 2.5, 5, 10]))
            axis.get_major_formatter().set_powerlimits((-3, 5))
            axis.get_major_formatter().set_useMathText(True)


def which(result: ContactResult, contact: Contact | str | int | None) -> int:
    """The number of a contact, which may be left out where there is one."""
    if contact is not None:
        chosen = result[contact]
        return next(i for i, values in enumerate(result.values) if values is chosen)
    if len(result.names) > 1:
        raise InputError(
            f"there are {len(result.names)} contacts ({', '.join(result.names)}): say which to "
            f"plot, contact='{result.names[0]}'"
        )
    return 0


def open_words(values: ContactValues, units: Mapping[str, str]) -> str:
    """Say that nothing touches, and how far apart it is."""
    gap = values.gap[np.isfinite(values.gap)]
    if not len(gap):
        return f"{values.name} is open: no point has a partner"
    return f"{values.name} is open, the smallest gap is {quantity(gap.min(), 'length', units)}"


def note(ax: Any, lines: list[str], drawn: Array | None = None) -> None:
    """A few words on a pale ground, in the corner where least is drawn: at points (p, 2), if known.

    Other words are covered last.
    """
    corners = [(0.012, 0.985), (0.988, 0.985), (0.012, 0.015), (0.988, 0.015)]
    if drawn is not None and len(drawn):
        words = [
            t.get_position() for t in ax.texts if t.get_text() and t.get_transform() == ax.transData
        ]
        known = [ax.transLimits.transform(at) for at in (words, drawn) if len(at)]
        size = 0.018 * max(map(len, lines)), 0.055 * len(lines)
        covered = [[np.sum(np.all(np.abs(at - c) < size, axis=1)) for at in known] for c in corners]
        corners = [corners[covered.index(min(covered))]]
    x, y = corners[0]
    ax.text(
        x, y, "\n".join(lines), transform=ax.transAxes, va="top" if y > 0.5 else "bottom",
        ha="left" if x < 0.5 else "right", fontsize="small", zorder=6,
        bbox={"facecolor": "white", "alpha": 0.75, "edgecolor": "none", "pad": 1.5},
    )  # fmt: skip


def arrow_heads(size: Array, longest: float, most: int) -> Index:
    """Arrows that have a head, evenly spread: of 3 % of the longest, more would cover each other."""
    found = np.flatnonzero(size > 0.03 * longest)
    return found[:: 1 + len(found) // most]


def draw_lines(ax: Any, points: Array, lines: Index, size: float) -> None:
    """An obstacle in the plane, with strokes on the side of the solid; `size`: of the picture."""
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
    apart = 0.02 * size  # and as long
    places = np.arange(0.5 * apart, stop[-1], apart)
    k = np.minimum(np.searchsorted(stop, places), len(lines) - 1)
    unit = along[k] / length[k, None]
    start = ends[k, 0] + (places - stop[k] + length[k])[:, None] * unit
    left = np.column_stack([-unit[:, 1], unit[:, 0]])
    stroke = apart / np.sqrt(2) * (left - unit)
    ax.add_collection(
        LineCollection(
            list(np.stack([start, start + stroke], axis=1)),
            colors=TOOL,
            linewidths=0.7,
            zorder=2.4,
            gid="obstacle strokes",
        )
    )


def _pyplot() -> Any:
    try:
        from matplotlib import pyplot  # optional, and slow to import
    except ImportError:
        raise InputError(
            "pictures need matplotlib, which is not installed: pip install 'skfem-contact[plot]'"
        ) from None
    return pyplot
