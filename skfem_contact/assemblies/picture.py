"""A picture of pairs that were found: the bodies pale, both sides of each pair in one colour."""

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

#: How dark bodies are, their outlines in the plane, and pairs, which are seen through bodies.
PALE, LINE, STRONG = 0.06, 0.4, 0.8


def draw_pairs(contacts: Sequence[Contact], names: Sequence[str], ax: Any) -> Any:
    """Draw the surfaces of contacts, and the boundaries of their bodies; return the axes."""
    sides = [(c.secondary, c.primary) for c in contacts if isinstance(c.primary, ContactSurface)]
    if not sides:
        raise InputError("there are no pairs to draw; print(pairs) says what was near")
    bodies = {id(side.body): side.body for both in sides for side in both}
    whole = [body.surface(None) for body in bodies.values() if isinstance(body, Body)]
    plane = whole[0].dim == 2
    ax = (new_axes if plane else solid_axes)(ax, (7.0, 5.2))
    for surface in whole:
        _add(ax, surface, LINES, LINE if plane else PALE)
    for i, ((one, other), name) in enumerate(zip(sides, names, strict=True)):
        _add(ax, one, f"C{i % 10}", STRONG, name)
        _add(ax, other, f"C{i % 10}", STRONG)
    points = np.concatenate([surface.points for surface in whole])
    low, high = points.min(axis=0), points.max(axis=0)
    for axis, a, b in zip("xyz", low, high, strict=False):
        room = 0.05 * (high - low).max()
        ax.set(**{f"{axis}lim": (a - room, b + room), f"{axis}label": axis})
    ax.set_aspect("equal")
    ax.legend(**ABOVE | {"ncols": 3, "fontsize": "small", "frameon": False})
    return ax


def _add(ax: Any, surface: ContactSurface, colour: str, alpha: float, label: str = "") -> None:
    """One surface as lines or faces."""
    kind = surface.kind
    from matplotlib.collections import LineCollection  # optional, and slow to import
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection

    plane = surface.dim == 2
    pieces = np.array(kind.parts) if plane else kind.linear_parts
    x = list(surface.points[surface.facets][:, pieces].reshape(-1, pieces.shape[1], surface.dim))
    if plane:
        drawn = LineCollection(x, colors=colour, linewidths=3.0 if alpha == STRONG else 0.8)
    else:
        drawn = Poly3DCollection(x, facecolors=colour, edgecolors="none")
    drawn.set(alpha=alpha, label=label or "_side")
    ax.add_collection(drawn)
