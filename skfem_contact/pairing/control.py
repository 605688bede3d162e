r"""Rows at control points, for quadratic triangles and 8-node faces: their forces are as pressures are.

A uniform pressure has no force at the corners of a quadratic triangle, and a negative one at those of
an 8-node face: the integrals of their shape functions are zero and -1/12 of the area. A condition on
the sign of nodal forces is none on the pressure there. With the control points of the quadratic edges,

    g_m' = 2 g_m - (g_a + g_b) / 2    at the middle m between a and b,      g_a' = g_a    at corners,

in place of the gaps at the nodes the same displacements have the forces of Bernstein's polynomials, all
of whose integrals are positive: 1/6 of a triangle each; of an 8-node face 1/12 at corners, 1/6 else.
Where all points of a face are closed the conditions are those at the nodes, combined, and the forces on
the bodies are what they were. At the rim of a contact the control polygon touches a little earlier than
the parabola under it, by the square of the size of a face. Gaps that users give (an interference) are
lengths along the normals of the nodes: `gap_weights` combines them as the rows combine displacements.
Faces with 9 nodes need none of this: the integrals are 1/36, 1/9 and 4/9.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix, diags

from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.pairing.node import Pairing
from skfem_contact.pairing.vectors import dot

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]


def at_control_points(surface: ContactSurface, pairing: Pairing, away: Array) -> Pairing:
    """The pairing of nodes with its rows at control points, where faces ask for it.

    Parameters
    ----------
    surface : ContactSurface
        The secondary.
    pairing : Pairing
        Node by node: its rows have one node of the secondary each.
    away : ndarray, shape (m, 3)
        From the foot of every node to the node; anything where not paired [length].

    Returns
    -------
    Pairing
        The same if no face is of these kinds, as on curves. Middle nodes next to a corner without a
        partner keep their own row.
    """
    if not surface.kind.taken:
        return pairing
    W = control_weights(surface, pairing.paired)
    # the gap of a node is that to the smooth boundary
    rest = np.where(pairing.paired, pairing.gap, 0.0) - dot(pairing.normal, away)
    away = np.where(pairing.paired[:, None], away + rest[:, None] * pairing.normal, 0.0)
    gap = dot(pairing.normal, W @ away)
    # unit pressure has the nodal forces W' area = int N
    share = abs(diags(W.diagonal()) - W)
    own = surface.area / W.diagonal()
    area = np.where(
        W.diagonal() > 1, own, surface.area + share.T @ np.where(W.diagonal() > 1, own, 0.0)
    )
    return replace(
        pairing,
        gap=np.where(pairing.paired, gap, np.inf),
        area=area,
        secondary_weights=W,
        primary_weights=csr_matrix(W @ pairing.primary_weights),
        control=True,
    )


def gap_weights(pairing: Pairing) -> csr_matrix | None:
    """Gaps that are given at the nodes in those of the rows, (m, m); None where rows are at nodes.

    They are lengths along the nodes' own normals: with the angles between these a body that swells
    evenly closes an even gap in all rows at once, on curved surfaces too.
    """
    if not pairing.control:
        return None
    W = pairing.secondary_weights.tocoo()
    turned = dot(pairing.normal[W.row], pairing.normal[W.col])
    return csr_matrix((W.data * turned, (W.row, W.col)), shape=W.shape)


def control_weights(surface: ContactSurface, paired: Mask) -> csr_matrix:
    """Weights of the nodes at control points, (m, m): rows of the identity but for middles of edges."""
    m = len(surface.points)
    edges = np.unique(surface.facets[:, surface.kind.edges].reshape(-1, 3)[:, [2, 0, 1]], axis=0)
    # an edge is met from both of its faces, once in each direction
    _, first = np.unique(edges[:, 0], return_index=True)
    middle, start, end = edges[first][paired[edges[first]].all(axis=1)].T
    own = np.ones(m)
    own[middle] = 2.0
    row = np.concatenate([np.arange(m), middle, middle])
    column = np.concatenate([np.arange(m), start, end])
    data = np.concatenate([own, np.full(2 * len(middle), -0.5)])
    return csr_matrix((data, (row, column)), shape=(m, m))
