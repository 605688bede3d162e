"""What all pictures need: axes, the arc length along a surface, colours. 2-D, with matplotlib.

Every function draws into `ax`, or into a new figure, and returns the axes: titles, units and
limits are the user's to add. Labels carry no units, since nothing in the library has any.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from skfem_contact.answers.result import ContactResult
from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.errors import InputError

Array = NDArray[np.float64]

PRESSURE, FRICTION, LINES = "#20618d", "#b5441c", "#3a3a3a"


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
    """Where to open a ring: the middle of the longest run of False."""
    if not closed.any():
        return 0
    first = int(np.argmax(closed))
    where = np.flatnonzero(np.roll(closed, -first))  # starts with 0
    stretch = np.diff(np.append(where, len(closed)))
    k = int(np.argmax(stretch))
    return int((first + where[k] + stretch[k] // 2) % len(closed))


def require_plane(result: ContactResult) -> None:
    body = next(iter(result.system.solids.values()))
    if body.dim != 2 or body.components != 2:
        what = "a scalar field" if body.components == 1 else f"{body.dim}-D"
        raise InputError(
            f"pictures are of plane problems, this is {what}: use write('result.vtu', ...)"
        )


def new_axes(ax: Any, size: tuple[float, float]) -> Any:
    if ax is not None:
        return ax
    try:
        from matplotlib import pyplot  # optional, and slow to import
    except ImportError:
        raise InputError(
            "pictures need matplotlib, which is not installed: pip install 'skfem-contact[plot]'"
        ) from None
    return pyplot.subplots(figsize=size, layout="compressed")[1]
