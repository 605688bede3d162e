"""Pictures of contacts, with matplotlib (the extra ``plot``): one, all joints, pairs of surfaces."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skfem_contact.answers.result import ContactResult
from skfem_contact.answers.values import ContactValues
from skfem_contact.arguments import known_keywords
from skfem_contact.arrays import Array, Mask
from skfem_contact.bodies.body import Body
from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.conditions.contact import Contact
from skfem_contact.conditions.friction import CheckedLaw
from skfem_contact.conditions.interface import contact_names
from skfem_contact.conditions.state import OPEN, SLIP, STATUS, STICK
from skfem_contact.errors import InputError
from skfem_contact.output.drawing import (
    ABOVE,
    FRICTION,
    LINES,
    PRESSURE,
    SHADES,
    add_lines,
    arc_length,
    arrow_heads,
    colour_bar,
    is_solid,
    new_axes,
    new_figure,
    note,
    open_words,
    which,
)
from skfem_contact.output.solids import (
    STUCK,
    UP,
    VIEWER,
    Part,
    edge_lines,
    faces_part,
    frame_of,
    picture,
)
from skfem_contact.output.stress import checked_units, labelled, quantity
from skfem_contact.output.tools import BESIDE


@known_keywords()
def plot_contact(
    result: ContactResult,
    contact: Contact | str | int | None = None,
    ax: Any = None,
    *,
    units: Mapping[str, str] | None = None,
) -> Any:
    """Plot pressure and friction along the secondary surface, over its arc length; of solids on it.

    Sticking and slipping parts are shaded; the thin lines are the bounds of friction. A closed
    surface (a hole) is cut open in the middle of its longest part without contact.

    Of solids the faces around what touches are drawn, coloured by pressure, as the other side sees
    them: with the edge of contact, points where it sticks, and arrows of friction where it slips.

    Parameters
    ----------
    result : ContactResult
    contact : Contact, str or int, optional
        Needed where there are several.
    ax : matplotlib Axes, optional
        Plain ones, for solids too.
    units : dict, optional
        Words for labels, ``{"length": "mm", "stress": "MPa"}``.

    Returns
    -------
    matplotlib Axes

    Raises
    ------
    InputError
        If matplotlib is missing, the contact is not one of the result, or there are no displacements.

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
    >>> ax = sc.plot_contact(result, units={"length": "mm", "stress": "MPa"})
    >>> ax.get_xlabel()
    'arc length along block/bottom [mm]'
    """
    solid, i, words = is_solid(result), which(result, contact), checked_units(units)
    if solid:
        return draw_contact(result.values[i], ax, words)
    values, settings = result.values[i], result.contacts[i]
    surface = settings.secondary
    ax = new_axes(ax, (7.0, 4.0))
    arc = arc_length(surface, values.status != OPEN)
    order = np.argsort(arc)
    s, closed = arc[order], values.status[order] != 0
    _shade(ax, s, values.status[order])
    pressure = values.pressure[order]
    if settings.friction is None:  # else what sticks and slips is shaded
        ax.fill_between(s, pressure, color=PRESSURE, alpha=0.12, linewidth=0)
    ax.plot(s, pressure, color=PRESSURE, lw=1.8, label="pressure")
    if settings.friction is not None or settings.tied:
        # at a point merged into another it is that of its heir, as the pressure is
        ax.plot(s, values.friction_stress[order, 0], color=FRICTION, lw=1.8, label="friction")
    if settings.friction is not None:
        force = np.maximum(values.normal_force, 0.0)
        law = CheckedLaw(settings.friction, values.name, values.points)
        limit = law.limit(force, values.area, values.slip)
        bound = np.divide(limit, values.area, out=np.zeros_like(arc), where=values.area > 0)
        bound = np.where(closed, bound[values.heir][order], 0.0)
        ax.plot(s, bound, color=FRICTION, lw=0.7, ls=(0, (4, 2)), label="bounds of friction")
        ax.plot(s, -bound, color=FRICTION, lw=0.7, ls=(0, (4, 2)))
    ax.axhline(0.0, color=LINES, lw=0.6)
    along = labelled(f"arc length along {surface.label}", "length", words)
    ax.set(xlabel=along, ylabel=labelled("stress on the surface", "stress", words))
    if not closed.any():
        note(ax, [open_words(values, words)])
    ax.set_xlim(*_window(s, closed))
    ax.legend(frameon=False, fontsize="small", **ABOVE)
    ax.spines[["top", "right"]].set_visible(False)
    return ax


@known_keywords()
def plot_joints(result: ContactResult, *, units: Mapping[str, str] | None = None) -> Any:
    """Plot the pressure of all contacts of a result in one figure, each as `plot_contact` draws it.

    Parameters
    ----------
    result : ContactResult
    units : dict, optional
        Words for labels, ``{"length": "mm", "stress": "MPa"}``.

    Returns
    -------
    matplotlib Figure

    Raises
    ------
    InputError
        As `plot_contact` does.

    Examples
    --------
    >>> import skfem as fem
    >>> import skfem_contact as sc
    >>> from skfem.models.elasticity import linear_elasticity
    >>> mesh = fem.MeshQuad().refined(2).with_defaults()
    >>> basis = fem.Basis(mesh, fem.ElementVector(fem.ElementQuad1()), intorder=2)
    >>> block = sc.Body(basis, linear_elasticity(), D="top", x={"top": (0.002, -0.01)}, name="block")
    >>> feet = [sc.Contact(block.surface("bottom"), sc.RigidPlane((0, 0), (0, 1)), name="foot")]
    >>> feet += [sc.Contact(block.surface("left"), sc.RigidPlane((0, 0), (1, 0)), name="side")]
    >>> figure = sc.output.plot_joints(sc.ContactSolver(block, feet).solve())
    >>> [ax.get_title("right") for ax in figure.axes]
    ['foot', 'side']
    """
    solid, columns = is_solid(result), int(np.ceil(np.sqrt(len(result))))
    rows = -(-len(result) // columns)
    figure = new_figure((5.0 * columns, (4.5 if solid else 3.2) * rows))
    for i, name in enumerate(result.names):
        ax = figure.add_subplot(rows, columns, i + 1)
        plot_contact(result, i, ax, units=units)
        # in space a long title and the legend would stand in each other's way
        ax.set_title(name, fontsize="medium", loc="center" if solid else "right")
        if solid and ax.get_legend() is not None:
            ax.get_legend().remove()
    return figure


def _window(s: Array, closed: NDArray[np.bool_]) -> tuple[float, float]:
    """Find what touches and a margin, within the surface."""
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


def draw_contact(values: ContactValues, ax: Any, units: Mapping[str, str]) -> Any:
    """The secondary surface around what touches, coloured by pressure, seen from the other side."""
    surface, closed = values.surface, values.status != OPEN
    shown = _near(surface, closed)
    frame = _facing(surface, shown, closed)
    facing = shown & (surface.facet_normals @ frame[2] > 0)
    edges = edge_lines(
        surface, surface.points, np.repeat(facing[:, None], surface.kind.corners, axis=1)
    )
    part = faces_part(surface, shown, surface.points, values.pressure, np.zeros((0, 2, 3)))
    largest = float(values.pressure.max(initial=0.0))
    part = replace(part, shaded=False)  # colours are those of the bar
    ax, image = picture([part], ax, frame, "YlGnBu", (0.0, largest), units)
    add_lines(ax, edges @ frame[:2].T, colors=LINES, linewidths=0.3, alpha=0.6, zorder=3)
    if len(values.contact_edges):
        rim = values.contact_edges @ frame[:2].T
        add_lines(ax, rim, colors="black", linewidths=1.4, zorder=3, label="edge of contact")
    _states(ax, values, facing, frame, units)
    colour_bar(ax, image, labelled("pressure", "stress", units), shrink=0.7, pad=0.02)
    ax.set_title(f"{values.name}: {surface.label}, seen from the other side", fontsize="medium")
    if not closed.any():
        note(ax, [open_words(values, units)], part.points @ frame[:2].T)
    if ax.get_legend_handles_labels()[1]:  # below, where nothing is drawn
        below = {"loc": "upper center", "bbox_to_anchor": (0.5, 0.0), "borderaxespad": 0.2}
        ax.legend(**below, frameon=False, fontsize="small")
    return ax


def _states(
    ax: Any, values: ContactValues, facing: Mask, frame: Array, units: Mapping[str, str]
) -> None:
    """Draw points that stick as dots, points that slip as arrows of their friction."""
    if values.contact.friction is None:
        return
    there, at = np.zeros(len(values.points), dtype=bool), values.points @ frame[:2].T
    there[values.surface.facets[facing]] = True
    stuck = there & (values.status == STICK)
    if stuck.any():
        ax.scatter(*at[stuck].T, s=14, color=STUCK, zorder=4, label="sticks")
    pressing = np.einsum("ik,ik->i", values.traction, values.normal)
    friction = values.traction - pressing[:, None] * values.normal
    size = np.linalg.norm(friction, axis=1)
    slipping = np.where(there & (values.status == SLIP), size, 0.0)
    slips = arrow_heads(slipping, float(size.max(initial=0.0)), 120)
    if len(slips):
        arrow = (
            BESIDE * float(np.ptp(at[there], axis=0).max()) / size.max() * friction[slips] @ frame[:2].T
        )
        longest = quantity(float(size.max()), "stress", units)
        ax.quiver(
            *(at[slips] - 0.5 * arrow).T, *arrow.T, angles="xy", scale_units="xy", scale=1.0,
            color=FRICTION, width=1.0, units="dots", headwidth=4.5, zorder=4,
        )  # fmt: skip
        ax.plot([], [], color=FRICTION, label=f"slips: friction on this side, up to {longest}")


def _near(surface: ContactSurface, closed: Mask) -> Mask:
    """Faces around what touches: all, if nothing does."""
    if not closed.any():
        return np.ones(len(surface.facets), dtype=bool)
    x = surface.points
    low, high = x[closed].min(axis=0), x[closed].max(axis=0)
    margin = 0.25 * float(np.max(high - low)) + float(np.median(surface.lengths))
    middle = x[surface.facets].mean(axis=1)
    return np.asarray(np.all((middle >= low - margin) & (middle <= high + margin), axis=1))


def _facing(surface: ContactSurface, shown: Mask, closed: Mask) -> Array:
    """Half a radian off from what looks out of the faces: enough to see that it is no plane picture."""
    touching = shown & closed[surface.facets].any(axis=1)
    some = touching if touching.any() else shown
    normal = (surface.facet_areas[some, None] * surface.facet_normals[some]).sum(axis=0)
    size = float(np.linalg.norm(normal))
    normal = normal / size if size > 0 else np.array(UP)
    viewer = np.array(VIEWER) * (1.0, 1.0, 0.0) / np.hypot(*VIEWER[:2])
    aside = viewer - (viewer @ normal) * normal
    if np.linalg.norm(aside) < 0.3:  # seen from the side: a little above
        aside = np.array(UP) - normal[2] * normal
    eye = np.cos(0.5) * normal + np.sin(0.5) * aside / np.linalg.norm(aside)
    return frame_of(eye, UP)


def plot_pairs(contacts: Sequence[Contact], ax: Any = None) -> Any:
    """Draw the two surfaces of each contact in one colour, and the bodies pale; with matplotlib.

    Parameters
    ----------
    contacts : FoundContacts or sequence of Contact
        Contacts with rigid obstacles are left out.
    ax : matplotlib axes, optional
        Plain ones, for solids too. A new figure if not given.

    Returns
    -------
    matplotlib axes

    Raises
    ------
    InputError
        There is no pair of surfaces.

    Examples
    --------
    >>> import skfem as fem
    >>> import skfem_contact as sc
    >>> from skfem.models.elasticity import linear_elasticity
    >>> element = fem.ElementVector(fem.ElementQuad1())
    >>> low = fem.MeshQuad().refined(2).with_defaults()
    >>> meshes = {"block": low, "lid": low.translated((0.0, 1.01))}
    >>> bodies = [
    ...     sc.Body(fem.Basis(mesh, element), linear_elasticity(), name=name)
    ...     for name, mesh in meshes.items()
    ... ]
    >>> ax = plot_pairs(sc.find_contacts(bodies, within=0.02))
    >>> len(ax.get_legend().get_texts())
    1
    """
    drawn = [
        (name, (contact.secondary, contact.primary))
        for name, contact in zip(contact_names(contacts), contacts, strict=True)
        if isinstance(contact.primary, ContactSurface)
    ]
    if not drawn:
        raise InputError("there are no pairs to draw; print(pairs) says what was near")
    bodies = {id(side.body): side.body for _, both in drawn for side in both}
    whole = [body.surface(None) for body in bodies.values() if isinstance(body, Body)]
    shades = [(f"C{i % 10}", both, name) for i, (name, both) in enumerate(drawn)]
    if whole[0].dim == 3:  # pairs are seen through bodies
        parts = [_part(surface, "#dddddd", 0.25) for surface in whole]
        parts += [_part(side, colour, 1.0) for colour, both, _ in shades for side in both]
        ax, _ = picture(parts, ax, frame_of(VIEWER, UP), "YlGnBu", (0.0, 1.0), {})
    else:
        ax = new_axes(ax, (7.0, 5.2))
        drawn_as = [(side, LINES, 0.8, 0.4) for side in whole]
        drawn_as += [(side, colour, 3.0, 0.8) for colour, both, _ in shades for side in both]
        for side, colour, width, alpha in drawn_as:
            lines = side.points[side.facets[:, side.kind.simplices].reshape(-1, 2)]
            add_lines(ax, lines, colors=colour, linewidths=width, alpha=alpha)
        ax.set(aspect="equal", xlabel="x", ylabel="y")
        ax.margins(0.05)
    for colour, _, name in shades:
        ax.plot([], [], "s", color=colour, label=name)
    ax.legend(**ABOVE | {"ncols": 3, "fontsize": "small", "frameon": False})
    return ax


def _part(surface: ContactSurface, colour: str, opacity: float) -> Part:
    """All of a surface in one colour."""
    every = np.ones(len(surface.facets), dtype=bool)
    part = faces_part(surface, every, surface.points, colour, np.zeros((0, 2, 3)))
    return replace(part, opacity=opacity)
