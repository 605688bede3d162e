"""The common parts of all pictures: axes, the arc length along a surface, colours. With matplotlib.

Every function draws into `ax`, or into a new figure, and returns the axes: titles and limits are the
user's to change. Labels carry the units that the user gives, since nothing in the library has any.

**Places.** A point at X with the displacement u is drawn at ``X + c + s (u - c)``: s is the factor and
c a translation that all bodies share. An obstacle that has moved by t is drawn as moved by
``c + s (t - c)``, so points that touch it do so in the picture, but for initial gaps, which are not
magnified.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from skfem_contact.answers.answer import answer_of
from skfem_contact.answers.result import ContactResult
from skfem_contact.answers.values import ContactValues
from skfem_contact.arguments import check_kind, number, shown
from skfem_contact.arrays import Array, Index
from skfem_contact.bodies.body import body_nodes
from skfem_contact.bodies.member import Member
from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.conditions.contact import Contact
from skfem_contact.conditions.state import OPEN, Motion
from skfem_contact.digits import COMPUTED
from skfem_contact.errors import InputError
from skfem_contact.obstacles.shapes import RigidCylinder, RigidPlane, RigidSphere
from skfem_contact.output.stress import quantity
from skfem_contact.output.tools import Tool, fits, tools
from skfem_contact.records import dataclass

Box = tuple[Array, Array]

# A factor is rounded down to one of these times a power of ten.
ROUND = (1.0, 2.0, 5.0)

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
    if not len(lines):
        return
    ends = points[lines]
    add_lines(ax, ends, colors=LINES, linewidths=1.2, zorder=2.5, gid="obstacle")
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
    strokes = np.stack([start, start + stroke], axis=1)
    add_lines(ax, strokes, colors=TOOL, linewidths=0.7, zorder=2.4, gid="obstacle strokes")


def add_lines(ax: Any, lines: Array, **style: Any) -> None:
    """Lines (s, 2, 2) of one style."""
    from matplotlib.collections import LineCollection  # optional, and slow to import

    ax.add_collection(LineCollection(list(lines), **style))


def _pyplot() -> Any:
    try:
        from matplotlib import pyplot  # optional, and slow to import
    except ImportError:
        raise InputError(
            "pictures need matplotlib, which is not installed: pip install 'skfem-contact[plot]'"
        ) from None
    return pyplot


@dataclass(frozen=True, eq=False)
class View:
    """A choice of how displacements are shown.

    Attributes
    ----------
    factor : float
    shared : ndarray, shape (d,)
        The translation that is not magnified [length].
    """

    factor: float
    shared: Array

    def place(self, points: Array, displacements: Array) -> Array:
        """Places (p, d) of points in the picture."""
        return points + self.shared + self.factor * (displacements - self.shared)

    def nodes(self, result: ContactResult) -> list[Array]:
        """Places of the nodes of all bodies with a mesh, in the order of `body_nodes`."""
        of = [(body, body_nodes(body)) for body in result.system.solids.values()]
        u = result.displacement
        return [self.place(body.dof_points[own[:, 0]], u(body)[own]) for body, own in of]

    def surface(self, result: ContactResult, surface: ContactSurface) -> Array:
        """Places of the points of a surface."""
        return self.place(surface.points, result.displacement(surface.body)[surface.dofs])

    def box(self, result: ContactResult) -> Box:
        """Corners of the box around all bodies."""
        x = np.concatenate(self.nodes(result))
        return x.min(axis=0), x.max(axis=0)

    def motion(self, motion: Motion) -> Motion:
        """Return the motion of an obstacle in the picture."""
        translation = self.shared + self.factor * (motion.translation - self.shared)
        return Motion(translation, self.factor * motion.angle, motion.centre)

    @property
    def words(self) -> str:
        """For the title."""
        return f"deformation magnified {self.factor:g} times" if self.factor != 1 else "true positions"


def view(result: ContactResult, scale: float | Literal["auto"] = "auto") -> View:
    """The view with a factor, or with one that shows the deformation.

    "auto": a round factor, with displacements up to 6 % of the extent and closed gaps overlapping by
    1 %, and never below one. What moves far is where it is, unless all bodies move so together.
    """
    d = next(iter(result.system.solids.values())).dim
    if not isinstance(scale, str) or scale != "auto":
        factor = number(scale, "scale", "give a factor, or 'auto'")
        if not np.isfinite(factor):
            raise InputError(f"scale is {factor}; give a finite factor, or 'auto'")
        return View(factor, np.zeros(d))
    u = np.concatenate([nodal(body, result) for body in result.system.solids.values()])
    known = tools(result)
    together = 0.5 * (u.max(axis=0) + u.min(axis=0))
    views = [View(_factor(result, u, known, shared), shared) for shared in (np.zeros(d), together)]
    return views[1] if views[1].factor > 4.0 * views[0].factor else views[0]


def nodal(body: Member, result: ContactResult) -> Array:
    """Displacements of a body by node, in any order, shape (nodes, d)."""
    u = result.displacement(body)
    return np.column_stack([u[body.dof_component == k] for k in range(body.dim)])


def _factor(result: ContactResult, u: Array, known: list[Tool], shared: Array) -> float:
    answer = answer_of(result)
    extent = answer.system.extent
    largest = float(np.abs(u - shared).max(initial=0.0))
    largest = max([largest, *(_moved(tool, result, shared) for tool in known)])
    if largest == 0.0:
        return 1.0
    factor = 0.06 * extent / largest  # bodies keep their shapes
    gap = _closed_gap(result)
    if gap > 0.0:
        factor = min(factor, 1.0 + 0.01 * extent / gap)  # further, bodies would be seen in each other
    power = 10.0 ** np.floor(np.log10(factor))
    rounded = power * max(k for k in ROUND if k * power <= factor * (1 + COMPUTED))
    return max(1.0, float(rounded))


def gaps_overlap(result: ContactResult, seen: View) -> bool:
    """Return whether closed gaps, which are not magnified, are seen to overlap in the picture."""
    extent = answer_of(result).system.extent
    return abs(seen.factor - 1.0) * _closed_gap(result) > 0.002 * extent  # the width of a line


def _closed_gap(result: ContactResult) -> float:
    """The largest initial gap of the points that are closed now [length]."""
    answer = answer_of(result)
    gap, closed = np.array(answer.case.gap0), (answer.state.status != OPEN) & answer.kin.paired
    # without the motions of obstacles, which these have in them
    for contact, motion, part in zip(answer.contacts, answer.case.motion, answer.slices(), strict=True):
        shift = motion.shift(contact.secondary.points)  # none of bodies
        gap[part] += np.einsum("md,md->m", answer.kin.normal[part], shift)
    return float(np.abs(gap[closed]).max(initial=0.0))


def _moved(tool: Tool, result: ContactResult, shared: Array) -> float:
    """Return how far an obstacle has moved from where the bodies are, as far as its shape shows it."""
    shape = tool.obstacle
    if isinstance(shape, RigidCylinder | RigidSphere):
        return float(np.abs(tool.motion.shift(shape.centre[None])[0] - shared).max())
    points = np.concatenate([result.contacts[i].secondary.points for i in tool.contacts])
    moved = tool.motion.shift(points) - shared
    if isinstance(shape, RigidPlane):
        moved = moved @ shape.normal
    return float(np.abs(moved).max(initial=0.0))


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
        near = np.isfinite(values.gap)
        if near.any():
            i = int(np.argmin(np.where(near, values.gap, np.inf)))
            place = view.surface(result, values.contact.secondary)[i]
            foot = place - values.gap[i] * values.normal[i]
            low, high = np.minimum(low, foot), np.maximum(high, foot)
    drawn = placed_tools(result, view, (low, high))
    for tool, (points, _) in zip(tools(result), drawn, strict=True):
        if fits(tool.obstacle, 1.5 * size):
            low, high = np.minimum(low, points.min(axis=0)), np.maximum(high, points.max(axis=0))
    return low, high
