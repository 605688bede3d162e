"""Node-to-face contact: every node of the secondary surface and its closest point on the primary."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.pairing.closest import search_range
from skfem_contact.pairing.faces.closest import closest_faces, overhang
from skfem_contact.pairing.faces.projection import interpolated_normals, project
from skfem_contact.pairing.node import Pairing, nodes_at_feet, without
from skfem_contact.pairing.thresholds import COINCIDENT
from skfem_contact.pairing.vectors import dot

Array = NDArray[np.float64]
Index = NDArray[np.intp]


def node_to_face(
    secondary: ContactSurface,
    primary: ContactSurface,
    *,
    reach: float | None = None,
    extended: bool = False,
) -> Pairing:
    """Pair every node of the secondary surface with its closest point on the primary surface.

    Parameters
    ----------
    secondary, primary : ContactSurface
        As a rule the secondary one is the finer.
    reach : float, optional
        Largest distance between a node and its partner [length], as in `node_to_segment`.
    extended : bool
        Whether the primary goes on a little beyond its rim, as in `node_to_segment`.

    Returns
    -------
    Pairing

    Notes
    -----
    The rules are those of `node_to_segment`. The closest point is taken among the faces that face
    the node (`closest.FACING`) and hold a stationary point of the distance to the *whole* primary
    surface. So a node beyond the rim of an open surface has no partner (tolerance:
    `closest.COINCIDENT` of the size of a face), and one outside a smooth convex edge or corner is
    paired with that edge or corner. Round edges of 45 degrees or more it is paired along the normal
    of the face most opposite to the node, as long as it lies at most 45 degrees off that normal;
    farther out it overhangs. Of equally near faces (a concave edge) the most opposite one is taken;
    ties do not depend on the numbering.

    The normal is interpolated between the averaged normals at the corners of the face
    (`bodies.normal_field`), ``gap = normal . (x_s - x_p)``.

    Examples
    --------
    A small cube above a large one; in scikit-fem "top" is the side of the largest y:

    >>> import skfem as fem
    >>> from skfem.models.elasticity import linear_elasticity
    >>> from skfem_contact.bodies.body import Body
    >>> def cube(side, x, y):
    ...     mesh = fem.MeshHex().scaled(side).translated((x, y, x)).with_defaults()
    ...     return Body(fem.Basis(mesh, fem.ElementVector(fem.ElementHex1())), linear_elasticity())
    >>> pairing = node_to_face(
    ...     cube(1.0, 1.0, 4.5).surface("bottom"), cube(4.0, 0.0, 0.0).surface("top")
    ... )
    >>> pairing.gap.tolist(), pairing.normal[0].tolist()
    ([0.5, 0.5, 0.5, 0.5], [0.0, 1.0, 0.0])
    >>> pairing.primary_weights.toarray()[0].round(12).tolist()
    [0.5625, 0.1875, 0.0625, 0.1875]
    """
    outside, inside = search_range(secondary, primary, reach)
    point, facet = closest_faces(secondary, primary, outside, inside, extended)
    feet = project(primary, facet, secondary.points[point])
    normal = interpolated_normals(primary, facet, feet.xi)
    gap = dot(normal, secondary.points[point] - feet.foot)
    N, nodes = feet.shape, primary.facets[facet]
    sides = _normals_of_sides(secondary, primary, point, normal, N, nodes)
    beyond = overhang(secondary, primary, without(point, secondary), outside, inside)
    return nodes_at_feet(secondary, primary, point, facet, N, gap, normal, sides, beyond)


def _normals_of_sides(
    secondary: ContactSurface,
    primary: ContactSurface,
    point: Index,
    feet: Array,
    weights: Array,
    nodes: Index,
) -> tuple[Array, Array]:
    """Normals of both sides where nodes stand above feet, as `facing.node_normals`.

    On a sharp edge or corner a side has no normal: there that of the other side stands for both.
    """
    own = -secondary.normals[point]
    corner = secondary.sharp_points[point, None]
    on_sharp = np.sum(np.where(primary.sharp_points[nodes], np.abs(weights), 0.0), axis=1)
    at_corner = (on_sharp >= 1 - COINCIDENT)[:, None]
    return np.where(corner & ~at_corner, feet, own), np.where(at_corner & ~corner, own, feet)
