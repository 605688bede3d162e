"""Where solids slide far: does a surface run into a side of the other body that no contact has?

The nodes of a contact surface are looked for behind the sides of the other body that are not selected.
One is in there if the nearest of all faces of that body is such a side, and the node behind it: next to
the rim of a surface the nearest face is that which it is pressed on.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from skfem_contact.answers.validity.standing import Nearby, Standing
from skfem_contact.bodies.surface import ContactSurface, extract_surface
from skfem_contact.errors import InputError
from skfem_contact.pairing.faces.projection import project
from skfem_contact.pairing.thresholds import COINCIDENT
from skfem_contact.pairing.vectors import dot

Array = NDArray[np.float64]
Index = NDArray[np.intp]


class Flanks:
    """The sides of a body beside one of its contact surfaces.

    Parameters
    ----------
    whole, selected : ContactSurface
        All of the boundary, and the contact surface.
    own : ContactSurface
        Of the other body, whose nodes are looked for.
    """

    def __init__(self, whole: ContactSurface, selected: ContactSurface, own: ContactSurface) -> None:
        self.whole, self.own = whole, own
        self.beside = ~np.isin(whole.mesh_facets, selected.mesh_facets)
        self.near = Nearby(whole)

    def look(self, u: Array, u_own: Array, least: float) -> Standing | None:
        """The node that is deepest in, if it is deeper than a length.

        Parameters
        ----------
        u, u_own : ndarray
            Displacements of both bodies, right on the boundary and on the surface [length].
        least : float
            [length]
        """
        points = self.own.points + u_own[self.own.dofs]
        places = self.whole.points + u[self.whole.dofs]
        node, face = self.near.under(places, points, least)
        asked = np.unique(node[self.beside[face]])
        if not len(asked):
            return None
        whole = self.whole.moved(u)
        node, face = self.near.around(places, points)
        mine = np.isin(node, asked)
        node, face = node[mine], face[mine]
        feet = project(whole, face, points[node])
        away = points[node] - feet.foot
        depth = -dot(away, feet.own)
        # the nearest faces of each node; several where it is nearest to an edge between them, which
        # in a body is a hollow one: then the node is behind all of them
        distance = np.linalg.norm(away, axis=1)
        nearest, lowest = np.full(len(points), np.inf), np.full(len(points), np.inf)
        np.minimum.at(nearest, node, distance)
        same = distance <= nearest[node] + COINCIDENT * whole.lengths[face]
        np.minimum.at(lowest, node[same], depth[same])
        inside = same & (lowest[node] > 0)
        hidden = np.flatnonzero(inside & (depth > least) & self.beside[face])
        if not len(hidden):
            return None
        deepest = hidden[np.argmax(depth[hidden])]
        return Standing(
            len(np.unique(node[hidden])), float(depth[deepest]), points[node[deepest]], "flank"
        )


def boundary(surface: ContactSurface) -> ContactSurface | None:
    """All of the boundary of the body of a surface; None where some of it has no sides to speak of."""
    try:
        return extract_surface(surface.body, None)
    except InputError:  # faces that fold over, far from the contact
        return None
