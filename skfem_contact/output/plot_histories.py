"""Pictures of a history: over load steps, time or displacement, with matplotlib (extra ``plot``)."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from typing import Any

import numpy as np

from skfem_contact.answers.answer import answer_of, contact_forces
from skfem_contact.answers.result import ContactResult
from skfem_contact.answers.tangent.modes import Damping
from skfem_contact.arguments import check_kind, known_keywords, members, numbers, shown, suggest
from skfem_contact.arrays import Array
from skfem_contact.bodies.body import Body
from skfem_contact.bodies.member import Member
from skfem_contact.bodies.selection import boundary_dofs
from skfem_contact.conditions.contact import Contact
from skfem_contact.conditions.state import STATUS
from skfem_contact.errors import InputError
from skfem_contact.obstacles.obstacle import Obstacle
from skfem_contact.output.drawing import (
    ABOVE,
    FRICTION,
    LINES,
    PRESSURE,
    SHADES,
    new_axes,
    new_figure,
    which,
)
from skfem_contact.output.stress import checked_units, labelled
from skfem_contact.output.tools import tools

Over = Sequence[float] | Callable[[ContactResult], float]


@known_keywords()
def plot_history(
    results: Sequence[ContactResult],
    contact: Contact | str | int | None = None,
    ax: Any = None,
    *,
    quantity: str | Callable[[ContactResult], Any] | None = None,
    over: Over | None = None,
    xlabel: str | None = None,
    ylabel: str | None = None,
    units: Mapping[str, str] | None = None,
) -> Any:
    """Plot a history: how much of a contact sticks and slips and the energy lost, or any quantity.

    Parameters
    ----------
    results : sequence of ContactResult
    contact : Contact, str or int, optional
        Needed where there are several, but for a `quantity` of the whole result.
    ax : matplotlib Axes, optional
    quantity : str or callable, optional
        What to plot instead: the name of a number of `ContactValues`, such as ``"contact_area"`` or
        ``"force"``, or a function of the result. Vectors are one line per component.
    over : sequence of float, or callable, optional
        Times, or whatever else, of every result, or a function of the result; by default the number of
        the load step.
    xlabel, ylabel : str, optional
        With units, where the quantities are the user's own.
    units : dict, optional
        Words for labels, ``{"area": "mm²", "energy": "mJ", "time": "s"}``; with "time" `over` is
        called so.

    Returns
    -------
    matplotlib Axes
        Of areas the energy is on a twin axis at the right.

    Raises
    ------
    InputError
        No results, another number of places than of results, an unknown quantity.

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
    >>> steps = [{"x": {"block": {"top": (s, -0.01)}}} for s in (0, 0.001, 0.002)]
    >>> results = list(sc.ContactSolver(block, foot).history(steps))
    >>> ax = sc.plot_history(results)
    """
    results, words = _several(results), checked_units(units)
    x = _places(results, over)
    if xlabel is None:
        xlabel = "load step" if over is None else labelled("time", "time", words) * ("time" in words)
    ax = new_axes(ax, (7.0, 4.0))
    if quantity is None:
        _areas(ax, x, [result.values[which(result, contact)] for result in results], words)
    else:
        usage = "give a function of the result that returns a number, or a vector"
        y = numbers([_value(result, quantity, contact) for result in results], "the quantity", usage)
        name = quantity.replace("_", " ") if isinstance(quantity, str) else ""
        _curves(ax, x, y)
        ax.set(ylabel=name)
    ax.set(xlabel=xlabel)
    if ylabel is not None:
        ax.set(ylabel=ylabel)
    ax.spines["top"].set_visible(False)
    return ax


@known_keywords()
def plot_force(
    results: Sequence[ContactResult],
    body: Member | Obstacle | str,
    boundary: str | None = None,
    ax: Any = None,
    *,
    component: str | None = None,
    label: str | None = None,
    units: Mapping[str, str] | None = None,
) -> Any:
    """Plot the force on a boundary of a body, or on a rigid obstacle, over how far that has moved.

    The force is what acts from outside: loads and supports of the boundary, or what moves the obstacle.
    Both are counted along the axis, and to the side, to which it moves most.

    Parameters
    ----------
    results : sequence of ContactResult
    body : Body, RigidBody, obstacle or str
    boundary : str, optional
        Of a body with a mesh: its name; the displacement is the mean of its nodes.
    ax : matplotlib Axes, optional
    component : str, optional
        "x", "y" or "z": another axis.
    label : str, optional
        For a legend.
    units : dict, optional
        Words for labels, ``{"length": "mm", "force": "N"}``.

    Returns
    -------
    matplotlib Axes

    Raises
    ------
    InputError
        Unknown names, a body with a mesh and no boundary.

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
    >>> steps = [{"x": {"block": {"top": (0, -s)}}} for s in (0.005, 0.01)]
    >>> results = list(sc.ContactSolver(block, foot).history(steps))
    >>> ax = sc.output.plot_force(results, "block", "top")
    >>> len(ax.get_lines()[0].get_xdata())
    2
    """
    results, words = _several(results), checked_units(units)
    usage = "give one of the result, or its name"
    check_kind(body, (Member, Obstacle, str), "body", usage, "Body, RigidBody or obstacle")
    pairs = [_force_and_way(result, body, boundary) for result in results]
    force, way = (np.array(part) for part in zip(*pairs, strict=True))
    axes = "xyz"[: way.shape[1]]
    if component is not None and component not in tuple(axes):
        raise InputError(f"component={component!r} is not one of {', '.join(map(repr, axes))}")
    k = axes.index(component) if component else int(np.argmax(np.abs(way).max(axis=0)))
    side = -1.0 if way[np.argmax(np.abs(way[:, k])), k] < 0 else 1.0
    ax = new_axes(ax, (6.0, 4.0))
    ax.plot(side * way[:, k], side * force[:, k], "o-", ms=3, color=PRESSURE, label=label)
    name = getattr(body, "name", body) or "the obstacle"
    name = f"{name}/{boundary}" if boundary else name
    towards = f"-{axes[k]}" if side < 0 else axes[k]
    ax.set(
        xlabel=labelled(f"displacement of {name} along {towards}", "length", words),
        ylabel=labelled(f"force along {towards}", "force", words),
    )
    with suppress(AttributeError):  # matplotlib refuses other numbers, those of the user's axes
        ax.ticklabel_format(scilimits=(-3, 5), useMathText=True)
        ax.locator_params(nbins=6, steps=[1, 2, 2.5, 5, 10])
    ax.spines[["top", "right"]].set_visible(False)
    return ax


@known_keywords()
def plot_damping(damping: Damping, *, units: Mapping[str, str] | None = None) -> Any:
    """Plot frequency and damping of a mode over its amplitude, and what its loops have beside a line.

    Loops of small damping are lines to the eye: of each displacement that of the secant is taken off,
    and both are relative to their peaks. Dashed is the loop of the largest amplitude by Masing's rule.

    Parameters
    ----------
    damping : Damping
    units : dict, optional
        Words for labels, ``{"length": "mm", "time": "s"}``.

    Returns
    -------
    matplotlib Figure

    Examples
    --------
    >>> import skfem as fem
    >>> import skfem_contact as sc
    >>> mesh = fem.MeshQuad().refined(2).with_defaults()
    >>> basis = fem.Basis(mesh, fem.ElementVector(fem.ElementQuad1()))
    >>> block = sc.Body(basis, sc.Elastic(1.0, 0.3, density=1.0), f={"top": 0.01}, name="block")
    >>> floor = sc.RigidPlane((0, 0), (0, 1), name="floor")
    >>> foot = sc.Contact(block.surface("bottom"), floor, friction=sc.Coulomb(0.3), name="foot")
    >>> solver = sc.ContactSolver(block, foot)
    >>> result = solver.solve()
    >>> found = solver.damping(result, solver.modes(result, 1), [1e-3, 2e-3])
    >>> figure = sc.output.plot_damping(found, units={"length": "m", "time": "s"})
    """
    check_kind(damping, Damping, "damping", "give what solver.damping(...) returned")
    words = checked_units(units)
    turns = f"frequency [1/{words['time']}]" if "time" in words else "frequency"
    figure, order = new_figure((10.5, 3.4)), np.argsort(damping.amplitude)
    by_frequency, by_damping, beside = figure.subplots(1, 3)
    over, amplitude = labelled("amplitude", "length", words), damping.amplitude[order]
    ticks = np.unique(amplitude[np.linspace(0, len(order) - 1, 5).astype(int)])
    for ax, y in ((by_frequency, damping.frequency), (by_damping, damping.damping)):
        ax.semilogx(amplitude, y[order], "o-", ms=4, color=PRESSURE)
        ax.set_xticks(ticks, [f"{w:.2g}" for w in ticks])
        ax.minorticks_off()
        ax.set_xlabel(over)
    by_damping.set_ylabel("damping, of critical")
    by_frequency.set_ylabel(turns)
    by_frequency.axhline(damping.linear, color=LINES, lw=0.8, ls=":", label="the mode itself")
    by_frequency.ticklabel_format(axis="y", useOffset=False)
    by_frequency.legend(frameon=False, fontsize="small", **ABOVE)
    shades = zip(order, np.linspace(0.3, 1.0, len(order)), strict=True)
    drawn = [(damping.loops[i], "-", shade, f"{damping.amplitude[i]:.3g}") for i, shade in shades]
    drawn.append((damping.masing_loop(int(order[-1])), "--", 0.8, "by Masing"))
    for loop, style, shade, label in drawn:
        w, force = loop.T
        middle, peak = 0.5 * (w.max() + w.min()), np.abs(force).max()
        off = (w - middle) / (0.5 * np.ptp(w)) - force / peak
        beside.plot(force / peak, off, style, color=FRICTION, alpha=shade, label=label)
    beside.set(xlabel="inertia force / peak", ylabel="displacement beside the secant / peak")
    place = {"loc": "upper left", "bbox_to_anchor": (1.0, 1.0)}
    beside.legend(frameon=False, fontsize="small", title=over, **place)
    for ax in figure.axes:
        ax.spines[["top", "right"]].set_visible(False)
    return figure


def _several(results: Sequence[ContactResult]) -> list[ContactResult]:
    known = members(results, ContactResult, "results", "pass list(solver.history(steps))")
    if not known:
        raise InputError("there are no results to plot: pass list(solver.history(steps))")
    return known


def _places(results: list[ContactResult], over: Over | None) -> Array:
    """Return the place of every result on the axis, (k,)."""
    if over is None:
        return np.arange(len(results), dtype=float)
    given = [over(result) for result in results] if callable(over) else over
    x = numbers(given, "over", "give a number for each result, or a function of the result")
    if x.shape != (len(results),):
        raise InputError(f"over has shape {x.shape}, but there are {len(results)} results")
    return x


def _value(
    result: ContactResult,
    quantity: str | Callable[[ContactResult], Any],
    contact: Contact | str | int | None,
) -> Any:
    if callable(quantity):
        return quantity(result)
    values = result.values[which(result, contact)]
    names = [name for name in dir(values) if not name.startswith("_")]
    if not isinstance(quantity, str) or quantity not in names:
        raise InputError(
            f"there is no quantity {shown(quantity)}{suggest(quantity, names, 'quantities')}"
        )
    found = getattr(values, quantity)
    if callable(found) or np.ndim(found) > 1 or np.size(found) > 3:
        raise InputError(
            f"quantity={quantity!r} is {shown(found)}; a history shows one number per step, or a "
            "vector: give a function of the result, lambda result: result.pressure.max()"
        )
    return found


def _curves(ax: Any, x: Array, y: Array) -> None:
    """A line, or one for each component."""
    if y.ndim == 1:
        ax.plot(x, y, "o-", ms=3, color=PRESSURE)
        return
    for name, column in zip("xyz", y.T, strict=False):
        ax.plot(x, column, "o-", ms=3, label=name)
    ax.legend(frameon=False, fontsize="small", **ABOVE)


def _areas(ax: Any, x: Array, values: list[Any], units: Mapping[str, str]) -> None:
    """Draw the areas that stick and slip, and the energy lost on a twin axis."""
    share = np.array([[v.area[v.status == k].sum() for v in values] for k in (1, 2)])
    ax.stackplot(x, share, colors=SHADES[1:], labels=STATUS[1:])
    ax.set(ylabel=labelled("area in contact", "area", units))
    ax.set_xlim(x.min(), x.max() if x.max() > x.min() else x.min() + 1)
    right = ax.twinx()
    right.plot(x, [v.dissipation_total for v in values], color=FRICTION, lw=1.8)
    right.set_ylabel(labelled("energy lost by friction", "energy", units), color=FRICTION)
    right.set_ylim(bottom=0.0)
    ax.legend(frameon=False, fontsize="small", **ABOVE)
    right.spines["top"].set_visible(False)


def _force_and_way(
    result: ContactResult, body: Member | Obstacle | str, boundary: str | None
) -> tuple[Array, Array]:
    """Force from outside (d,) on a boundary or an obstacle, and its displacement (d,)."""
    for tool in tools(result):
        if tool.name == body or any(result.contacts[i].primary is body for i in tool.contacts):
            force = sum(result.values[i].force for i in tool.contacts)
            return np.asarray(force), np.asarray(tool.motion.translation)
    answer = answer_of(result)
    known = answer.system.names
    if isinstance(body, str) and body not in known:
        names = [*known, *(tool.name for tool in tools(result))]
        raise InputError(f"there is no body {body!r}{suggest(body, names, 'bodies and obstacles')}")
    i = answer.system.index(body)  # type: ignore[arg-type]
    own = answer.system.bodies[i]
    if not isinstance(own, Body) or boundary is None:
        raise InputError(f"body {known[i]!r} has boundaries: say of which one, boundary='top'")
    dofs = boundary_dofs(own.basis, boundary, f"force on body {known[i]!r}")
    span, u = answer.system.slice(own), answer.displacement(own)
    apart = {} if own.finite_strain else answer.case.apart
    thermal = apart[i][: own.n] if i in apart else 0.0  # strains, and no force
    outside = (answer.internal[span] - contact_forces(answer)[span] - thermal)[dofs]
    axis = own.dof_component[dofs]
    force = np.array([outside[axis == k].sum() for k in range(own.components)])
    return force, np.array([u[dofs][axis == k].mean() for k in range(own.components)])
