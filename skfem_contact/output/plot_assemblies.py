"""`plot_pairs`: the pairs of surfaces that may touch, each in a colour of its own."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from skfem_contact.bodies.body import Body
from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.conditions.contact import Contact
from skfem_contact.conditions.interface import contact_names
from skfem_contact.errors import InputError
from skfem_contact.output.drawing import ABOVE, LINES, new_axes
from skfem_contact.output.solids import UP, VIEWER, Part, faces_part, frame_of, picture


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
        _add(ax, whole, LINES, 0.8, 0.4)
        for colour, both, _ in shades:
            _add(ax, both, colour, 3.0, 0.8)
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


def _add(ax: Any, surfaces: Sequence[ContactSurface], colour: str, width: float, alpha: float) -> None:
    """Surfaces of plane bodies as lines."""
    from matplotlib.collections import LineCollection  # optional, and slow to import

    for surface in surfaces:
        lines = surface.points[surface.facets[:, surface.kind.simplices].reshape(-1, 2)]
        ax.add_collection(LineCollection(list(lines), colors=colour, linewidths=width, alpha=alpha))
