"""Pictures of one contact, with matplotlib (the extra ``plot``)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skfem_contact.answers.result import ContactResult
from skfem_contact.arguments import known_keywords
from skfem_contact.arrays import Array
from skfem_contact.conditions.contact import Contact
from skfem_contact.conditions.friction import CheckedLaw
from skfem_contact.conditions.state import OPEN, STATUS
from skfem_contact.output.drawing import (
    ABOVE,
    FRICTION,
    LINES,
    PRESSURE,
    SHADES,
    arc_length,
    is_solid,
    new_axes,
    new_figure,
    note,
    open_words,
    which,
)
from skfem_contact.output.fields import checked_units, labelled
from skfem_contact.output.solids import draw_contact


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
