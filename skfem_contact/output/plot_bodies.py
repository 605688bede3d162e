"""Pictures of deformed bodies, with matplotlib (the extra ``plot``).

In space they turn in a window of PyVista (the extra ``scene``), where what is behind is hidden.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from skfem_contact.answers.result import ContactResult
from skfem_contact.arguments import check_switch, known_keywords, members, numbers
from skfem_contact.arrays import Array
from skfem_contact.bodies.body import Body, body_nodes
from skfem_contact.bodies.member import Member
from skfem_contact.conditions.state import OPEN
from skfem_contact.errors import InputError
from skfem_contact.output.drawing import (
    FRICTION,
    LINES,
    PLAIN,
    Box,
    View,
    add_lines,
    arc_length,
    arrow_heads,
    colour_bar,
    draw_lines,
    gaps_overlap,
    is_solid,
    limits,
    new_axes,
    note,
    placed_tools,
    view,
    with_tools,
)
from skfem_contact.output.solids import (
    UP,
    VIEWER,
    body_part,
    colour_map,
    cut_cells,
    frame_of,
    picture,
    plotter_of,
    tool_parts,
)
from skfem_contact.output.stress import (
    USAGE,
    OneStress,
    asked,
    body_cells,
    checked_units,
    displaced,
    field_values,
    labelled,
    quantity,
)
from skfem_contact.output.stress import component as component_of
from skfem_contact.output.tools import BESIDE, tools


@known_keywords()
def plot_deformed(
    result: ContactResult,
    scale: float | Literal["auto"] = "auto",
    stress: OneStress | None = None,
    ax: Any = None,
    *,
    arrows: bool = True,
    label: str | None = None,
    cmap: str = "YlGnBu",
    component: str | None = None,
    units: Mapping[str, str] | None = None,
    window: Sequence[float] | None = None,
    obstacles: bool = True,
    u: ArrayLike | None = None,
    viewer: Sequence[float] = VIEWER,
    up: Sequence[float] = UP,
) -> Any:
    """Draw the deformed bodies, coloured, and rigid obstacles, with arrows of the traction.

    Solids are drawn by their outer faces, with PyVista where it is installed, and without arrows:
    what touches is inside, and `plot_contact` shows it. The arrows x, y, z below have the length that
    stands beside them.

    Parameters
    ----------
    result : ContactResult
    scale : float or "auto"
        Factor on the displacements. Initial gaps are not magnified with them: at a scale s, points
        that closed a gap g, as under a round tool, overlap by (s - 1) g in the picture, which says so
        where it is seen. "auto" keeps both small, and is never below one: what has moved far is drawn
        where it is. A translation that all bodies share is not magnified.
    stress : str, callable, or dict of one of them by name, optional
        The colours: the name of a field of `nodal_field`, such as "von_mises" or
        "equivalent_plastic_strain", where bodies without it stay grey; or ``stress(body, u)`` with a
        number, vector or tensor per node; by default the size of the displacement.
    ax : matplotlib Axes, optional
        Plain ones, for solids too.
    arrows : bool
        Draw the traction at closed points. The head is on the secondary surface.
    label : str, optional
        Of the colour bar. By default the name of the function `stress` and the unit of stress, or
        "stress" for a lambda; with ``stress={"hoop stress": function}`` the name given there.
    cmap : str
    component : str, optional
        Of a tensor, "xx", "xy", ...; of a vector "x", "y", "z".
    units : dict, optional
        Words for labels, ``{"length": "mm", "stress": "MPa"}``.
    window : (left, right, bottom, top), optional
        In the plane: what part is shown; arrows and the strokes of obstacles have its size.
    obstacles : bool
        Draw rigid obstacles: planes of symmetry may hide what matters.
    u : ndarray, shape (n,), optional
        Displacements of all bodies in the place of those of the result: a shape of vibration, times
        the size that it is to have [length].
    viewer, up : (x, y, z)
        For solids: the direction towards the viewer, and what is above.

    Returns
    -------
    matplotlib Axes

    Raises
    ------
    InputError
        If matplotlib is missing, the problem has no displacements, there is no such component, or the
        window is none.

    Examples
    --------
    >>> import skfem as fem
    >>> import skfem_contact as sc
    >>> from skfem.models.elasticity import linear_elasticity
    >>> mesh = fem.MeshQuad().refined(2).with_defaults()
    >>> basis = fem.Basis(mesh, fem.ElementVector(fem.ElementQuad1()), intorder=2)
    >>> block = sc.Body(basis, linear_elasticity(), D="top", x={"top": (0.002, -0.01)}, name="block")
    >>> floor = sc.RigidPlane((0, 0), (0, 1), name="floor")
    >>> foot = sc.Contact(block.surface("bottom"), floor, friction=sc.Coulomb(0.3), name="foot")
    >>> result = sc.ContactSolver(block, foot).solve()
    >>> ax = sc.plot_deformed(result, units={"length": "mm"})
    >>> ax.get_title()
    'deformation magnified 5 times'
    """
    result, arrows = displaced(result, u), arrows and u is None
    solid, words = is_solid(result), checked_units(units)
    check_switch(obstacles, "plot_deformed: obstacles")
    if solid and window is not None:
        raise InputError("window is for plane pictures: set the limits of these axes instead")
    seen, bodies = view(result, scale), list(result.system.solids.values())
    values = [colours(result, body, stress, component) for body in bodies]
    frame = frame_of(viewer, up) if solid else np.eye(2)
    box = seen.box(result) if window is None else _window(window)
    if window is None and obstacles:
        box = with_tools(result, seen, box)
    if solid:
        parts = [body_part(result, body, seen, v) for body, v in zip(bodies, values, strict=True)]
        parts += tool_parts(result, seen, box) if obstacles else []
        ax, image = picture(parts, ax, frame, cmap, limits(values), words)
    else:
        ax = new_axes(ax, _figure_size(box))
        image = _draw_cells(ax, result, seen, values, cmap)
        for points, lines in placed_tools(result, seen, box) if obstacles else ():
            draw_lines(ax, points, lines, float(np.max(box[1] - box[0])))
    remarks = [f"{v.name} is open" for v in result if not np.any(v.status != OPEN)]
    if obstacles:
        unknown = [tool.name for tool in tools(result) if not len(tool.outline(*box)[1])]
        remarks += [f"{name} is not drawn" for name in unknown]
    if gaps_overlap(result, seen):
        remarks.append("initial gaps are not magnified")
    if arrows and not solid:
        ends, peak = _arrows(ax, result, seen, box)
        if window is None and len(ends):
            box = np.minimum(box[0], ends.min(axis=0)), np.maximum(box[1], ends.max(axis=0))
        if peak > 0:
            remarks = [f"longest arrow: {quantity(peak, 'stress', words)}", *remarks]
    if not solid:
        room = 0.04 * float(np.max(box[1] - box[0])) if window is None else 0.0
        (left, low), (right, high) = box[0] - room, box[1] + room
        ax.set(aspect="equal", xlim=(left, right), ylim=(low, high))
        ax.set(xlabel=labelled("x", "length", words), ylabel=labelled("y", "length", words))
    if remarks:
        note(ax, remarks, np.concatenate(seen.nodes(result)) @ frame[:2].T)
    shrink = 0.7 if solid else 0.85
    colour_bar(ax, image, label or colour_name(stress, component, words), shrink=shrink, pad=0.02)
    ax.set_title(seen.words)
    return ax


def _window(window: Sequence[float]) -> Box:
    usage = "give (left, right, bottom, top)"
    edges = numbers(window, "window", usage)
    if edges.shape != (4,) or not (edges[0] < edges[1] and edges[2] < edges[3]):
        raise InputError(f"window is {window!r}; {usage}")
    return edges[[0, 2]], edges[[1, 3]]


def colour_name(stress: OneStress | None, component: str | None, units: Mapping[str, str]) -> str:
    """Return the title of the colour bar."""
    if stress is None:
        return labelled("displacement", "length", units)
    name = next(iter(asked(stress)))
    if not isinstance(stress, Mapping):  # names of functions; else the user's own words
        name = name.strip("_").replace("_", " ")
    name = "von Mises stress" if name in ("von mises", "mises") else name
    kind = "" if name.endswith("strain") else "stress"
    return labelled(f"{name} {component or ''}".strip(), kind, units)


def _draw_cells(ax: Any, result: ContactResult, seen: View, values: list[Array], cmap: str) -> Any:
    """The bodies with their colours and outlines."""
    from matplotlib.collections import PolyCollection  # optional, and slow to import

    low, high = limits(values)
    image = None
    bodies = result.system.solids.values()
    for body, places, colour in zip(bodies, seen.nodes(result), values, strict=True):
        x, triangles = places.T, cut_cells(body_cells(body)[1])
        if np.isnan(colour).any():  # a body without this field
            ax.add_collection(PolyCollection(x.T[triangles], color=PLAIN, rasterized=True))
        else:
            style = {"cmap": cmap, "vmin": low, "vmax": high, "rasterized": True}
            image = ax.tripcolor(*x, triangles, colour, shading="gouraud", **style)
        surface = body.surface(None)
        rim = surface.facets[:, surface.kind.simplices].reshape(-1, 2)
        add_lines(ax, seen.surface(result, surface)[rim], colors=LINES, linewidths=0.7)
    return image


def _arrows(ax: Any, result: ContactResult, seen: View, box: Box) -> tuple[Array, float]:
    """Tractions at closed points in a box, the longest 8 % of it; about 60 arrows at most.

    Returns their ends, (p, 2), and the largest traction.
    """
    heads, sizes, ends = [], [], []
    for contact, values in zip(result.contacts, result.values, strict=True):
        surface = contact.secondary
        heads.append(seen.surface(result, surface))
        inside = np.all((heads[-1] >= box[0]) & (heads[-1] <= box[1]), axis=1)
        sizes.append(np.where(inside, np.linalg.norm(values.traction, axis=1), 0.0))
    peak = max(float(size.max(initial=0.0)) for size in sizes)
    if peak == 0.0:
        return np.zeros((0, 2)), 0.0
    length = BESIDE * float(np.max(box[1] - box[0])) / peak
    for contact, values, place, size in zip(result.contacts, result.values, heads, sizes, strict=True):
        order = np.argsort(arc_length(contact.secondary, values.status != OPEN))
        head = place[order]
        tail = head - length * values.traction[order]
        ends.append(tail)
        torn = np.where(size[order, None] > 0, tail, np.nan)
        ax.plot(*torn.T, color=FRICTION, lw=0.8, zorder=3)
        few = arrow_heads(size[order], peak, 60)
        ax.quiver(
            *tail[few].T, *(head - tail)[few].T, angles="xy", scale_units="xy", scale=1.0,
            color=FRICTION, width=0.8, headwidth=4.5, headlength=5.5, headaxislength=5.0,
            units="dots", zorder=3,
        )  # fmt: skip
    return np.concatenate(ends), peak


def colours(
    result: ContactResult, body: Body, stress: OneStress | None, component: str | None
) -> Array:
    """A number per node."""
    u, nodes = result.displacement(body), body_nodes(body)
    if stress is None:
        if component is not None:
            raise InputError(f"component={component!r} is of a stress: give stress=... as well")
        return np.linalg.norm(u[nodes], axis=1)
    fields = asked(stress)
    if len(fields) != 1:
        raise InputError(f"stress has {len(fields)} fields; a picture shows one, {USAGE}")
    ((name, wish),) = fields.items()
    return component_of(field_values(result, body, wish), component, name)


def _figure_size(box: Box) -> tuple[float, float]:
    """Of the shape of what is shown, with room for the colour bar [inch]."""
    width, height = box[1] - box[0]
    ratio = float(np.clip(height / width, 0.3, 1.8)) if width > 0 else 1.0
    wide = 6.0 / max(1.0, ratio)
    return wide + 1.6, wide * ratio + 0.8


@known_keywords()
def scene(
    result: ContactResult,
    scale: float | Literal["auto"] = "auto",
    stress: OneStress | None = None,
    *,
    bodies: Sequence[Member | str] | None = None,
    component: str | None = None,
    arrows: bool = True,
    label: str | None = None,
    cmap: str = "YlGnBu",
    units: Mapping[str, str] | None = None,
    off_screen: bool | None = None,
) -> Any:
    """The deformed bodies and rigid obstacles in space, to be turned, or to be saved as a picture.

    Better than `plot_deformed` where bodies hide each other. It needs PyVista, which has a window of
    its own and a form for notebooks.

    Parameters
    ----------
    result : ContactResult
    scale, stress, component, label, cmap, units
        As in `plot_deformed`.
    bodies : sequence of Body or str, optional
        Those that are shown: what touches is seen with the body before it left out. By default all.
    arrows : bool
        Draw the traction on the secondary surfaces of solids, if their bodies are shown.
    off_screen : bool, optional
        Without a window, for ``screenshot``; by default as PyVista is set up.

    Returns
    -------
    pyvista.Plotter
        ``.show()`` opens it, ``.screenshot("picture.png")`` saves it, and all else of PyVista is there.

    Raises
    ------
    InputError
        If PyVista is missing, the problem has no displacements, or there is no such body.

    Examples
    --------
    Without PyVista the scene says what to install; with it the last two lines save a picture.

    >>> import skfem as fem
    >>> import skfem_contact as sc
    >>> from skfem.models.elasticity import linear_elasticity
    >>> mesh = fem.MeshHex().refined(1).with_boundaries({"low": lambda x: x[2] < 1e-9})
    >>> basis = fem.Basis(mesh, fem.ElementVector(fem.ElementHex1()), intorder=2)
    >>> cube = sc.Body(basis, linear_elasticity(), f={"low": (0, 0, -1e-3)}, name="cube")
    >>> floor = sc.RigidPlane((0, 0, 0), (0, 0, 1))
    >>> glue = sc.Contact(cube.surface("low"), floor, tied=True)
    >>> result = sc.ContactSolver(cube, glue).solve()
    >>> plotter = sc.output.scene(result, off_screen=True)  # doctest: +SKIP
    >>> plotter.screenshot("cube.png")  # doctest: +SKIP
    """
    solid, words = is_solid(result), checked_units(units)
    try:
        import pyvista  # optional, and slow to import
    except ImportError:
        raise InputError(
            "scene needs PyVista, which is not installed: pip install 'skfem-contact[scene]'; "
            "plot_deformed draws solids by matplotlib"
        ) from None
    seen, shown = view(result, scale), _chosen(result, bodies)
    label = label or colour_name(stress, component, words)
    shades = [colours(result, body, stress, component) for body in shown]
    parts = [body_part(result, body, seen, own) for body, own in zip(shown, shades, strict=True)]
    x = np.concatenate([part.points for part in parts])[:, : 3 if solid else 2]
    low, high = x.min(axis=0), x.max(axis=0)
    parts += tool_parts(result, seen, with_tools(result, seen, (low, high)))
    # wide labels of the last tick stay in the picture
    bar = {"title": f"{label}\n", "color": "black", "fmt": "%.3g", "width": 0.5, "position_x": 0.3}
    plotter = plotter_of(pyvista, parts, colour_map(cmap, limits(shades)), off_screen, **bar)
    remarks = [seen.words]
    drawn = [v for v in result if any(v.surface.body is body for body in shown)]
    peaks = [np.linalg.norm(v.traction, axis=1).max(initial=0.0) for v in drawn]
    if arrows and solid and any(peaks):  # the longest 8 % of the scene
        remarks.append(f"longest arrow: {quantity(max(peaks), 'stress', words)}")
        for values in drawn:
            way = BESIDE * float(np.max(high - low)) / max(peaks) * values.traction
            tails = pyvista.PolyData(seen.surface(result, values.surface) - way)
            tails.point_data["way"] = way
            glyphs = tails.glyph(orient="way", scale="way", factor=1.0)
            if glyphs.n_points:  # PyVista refuses empty meshes
                plotter.add_mesh(glyphs, color=FRICTION)
    plotter.add_text("\n".join(remarks), font_size=9, color="black")
    plotter.add_axes(color="black")
    plotter.camera_position = "iso" if solid else "xy"
    return plotter


def _chosen(result: ContactResult, bodies: Sequence[Member | str] | None) -> list[Any]:
    """The bodies that are shown."""
    solids = list(result.system.solids.values())
    if bodies is None:
        return solids
    usage = "give bodies of the result, or their names"
    # of either kind: a string is one name, not a sequence of letters
    given = members(bodies, (Member, str), "bodies", usage, "Body or name")
    wished = [result.system.bodies[result.system.index(body)] for body in given]
    found = [body for body in solids if any(body is own for own in wished)]
    if not found:
        raise InputError(f"bodies has none with a mesh; {usage}")
    return found
