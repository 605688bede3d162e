"""Pictures of one contact and of a history, with matplotlib (the extra ``plot``)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skfem_contact.answers.result import ContactResult
from skfem_contact.answers.values import ContactValues
from skfem_contact.arguments import known_keywords
from skfem_contact.conditions.checked_law import CheckedLaw
from skfem_contact.conditions.contact import Contact
from skfem_contact.conditions.state import OPEN, STATUS
from skfem_contact.errors import InputError
from skfem_contact.output.drawing import FRICTION, LINES, PRESSURE, arc_length, is_solid, new_axes
from skfem_contact.output.solids import draw_contact
from skfem_contact.output.thresholds import MARGIN

Array = NDArray[np.float64]

SHADES = ("none", "#bcd9c4", "#f6d6ad")  # open, stick, slip: pale, to lie behind lines
#: Legends stand above the axes, where no curve is.
ABOVE: dict[str, Any] = {
    "loc": "lower left", "bbox_to_anchor": (0.0, 1.0), "ncols": 5, "borderaxespad": 0.2,
    "handlelength": 1.4, "columnspacing": 1.2,
}  # fmt: skip


@known_keywords()
def plot_contact(
    result: ContactResult, contact: Contact | str | int | None = None, ax: Any = None
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
        Of solids with ``projection="3d"``.

    Returns
    -------
    matplotlib Axes

    Raises
    ------
    InputError
        If matplotlib is missing, the contact is not one of the result, or there are no displacements.
    """
    solid, i = is_solid(result), _which(result, contact)
    if solid:
        return draw_contact(result, result.values[i], ax)
    values, settings = result.values[i], result.contacts[i]
    surface = settings.secondary
    ax = new_axes(ax, (7.0, 4.0))
    arc = arc_length(surface, values.status != OPEN)
    order = np.argsort(arc)
    s, closed = arc[order], values.status[order] != 0
    _shade(ax, s, values.status[order])
    pressure = values.pressure[order]
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
    ax.set(xlabel=f"arc length along {surface.label}", ylabel="stress on the surface")
    ax.set_xlim(*_window(s, closed))
    ax.legend(frameon=False, fontsize="small", **ABOVE)
    ax.spines[["top", "right"]].set_visible(False)
    return ax


@known_keywords()
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
    ax = new_axes(ax, (7.0, 4.0))
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


def _window(s: Array, closed: NDArray[np.bool_]) -> tuple[float, float]:
    """What touches and a margin, within the surface."""
    if not closed.any():
        return float(s.min()), float(s.max())
    low, high = s[closed].min(), s[closed].max()
    margin = MARGIN * (high - low) + (s.max() - s.min()) / len(s)
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
