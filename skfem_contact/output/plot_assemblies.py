"""`plot_pairs`: the pairs of surfaces that may touch, each in a colour of its own."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skfem_contact.bodies.body import Body
from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.conditions.contact import Contact
from skfem_contact.errors import InputError
from skfem_contact.output.drawing import ABOVE, LINES, new_axes, solid_axes

Array = NDArray[np.float64]


def plot_pairs(contacts: Sequence[Contact], ax: Any = None) -> Any:
    """Draw the two surfaces of each contact in one colour, and the bodies pale; with matplotlib.

    Parameters
    ----------
    contacts : FoundContacts or sequence of Contact
        Contacts with rigid obstacles are left out.
    ax : matplotlib axes, optional
        Of solids with ``projection="3d"``. A new figure if not given.

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
    names = [contact.name or "" for contact in contacts]
    sides = [(c.secondary, c.primary) for c in contacts if isinstance(c.primary, ContactSurface)]
    if not sides:
        raise InputError("there are no pairs to draw; print(pairs) says what was near")
    bodies = {id(side.body): side.body for both in sides for side in both}
    whole = [body.surface(None) for body in bodies.values() if isinstance(body, Body)]
    plane = whole[0].dim == 2
    ax = (new_axes if plane else solid_axes)(ax, (7.0, 5.2))
    for surface in whole:
        _add(ax, surface, LINES, alpha=0.4 if plane else 0.06)  # pairs are seen through bodies
    for i, ((one, other), name) in enumerate(zip(sides, names, strict=True)):
        _add(ax, one, f"C{i % 10}", width=3.0, label=name)
        _add(ax, other, f"C{i % 10}", width=3.0)
    points = np.concatenate([surface.points for surface in whole])
    low, high = points.min(axis=0), points.max(axis=0)
    for axis, a, b in zip("xyz", low, high, strict=False):
        room = 0.05 * (high - low).max()
        ax.set(**{f"{axis}lim": (a - room, b + room), f"{axis}label": axis})
    ax.set_aspect("equal")
    ax.legend(**ABOVE | {"ncols": 3, "fontsize": "small", "frameon": False})
    return ax


def _add(
    ax: Any,
    surface: ContactSurface,
    colour: str,
    alpha: float = 0.8,
    width: float = 0.8,
    label: str = "",
) -> None:
    """One surface as lines or faces."""
    from matplotlib.collections import LineCollection  # optional, and slow to import
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection

    kind, plane = surface.kind, surface.dim == 2
    pieces = np.array(kind.parts) if plane else kind.linear_parts
    x = list(surface.points[surface.facets][:, pieces].reshape(-1, pieces.shape[1], surface.dim))
    if plane:
        drawn = LineCollection(x, colors=colour, linewidths=width)
    else:
        drawn = Poly3DCollection(x, facecolors=colour, edgecolors="none")
    drawn.set(alpha=alpha, label=label or "_side")
    ax.add_collection(drawn)
