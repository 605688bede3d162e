r"""What supports leave of the multipliers of mortar contact: nodes that are held need none.

The row of a secondary node is given up for the node's own DOF. Where that is prescribed, the row
would be closed by moving the few free nodes of the primary that have some weight in it: with a
weight of ``1e-6``, a million times as far as the gap is deep. Hence three rules.

1. A node all of whose components are prescribed has no multiplier: on every facet its share goes to
   a neighbour that is free (merging, see `dual`). Facets all of whose nodes are held keep theirs, as
   nothing else would hold the other body off: a punch whose whole face is prescribed.
2. Where the primary is held at the same place too (two bodies clamped on one floor), the gap at the
   node is what the supports make it. The node keeps a row, that of node-to-segment contact,
   ``u_i - sum_j N_j(x_i) u_j``: contact never closes it, all checks of prescribed values see it. The
   neighbour takes what is left of its mortar row. The sum of both rows is what it was, so uniform
   pressure passes as before; and an interference that supports do not allow stays at the node,
   where rule 1 would make the neighbour gape by half as much.
3. On a line of symmetry, and at a wall that guides both bodies, one component is held on both sides.
   If it is the normal one, this is rule 2. Else the tangential row is that of node-to-segment contact
   along what is held, which nothing closes: there is no shear on a line of symmetry across it, the
   neighbours keep their rows, and half a model is half of the whole. Along what is free it is the
   multiple of the normal row: on a surface that meets the line at another angle than a right one,
   forces have one direction, and normal force and friction share it as at any node that two rows hold.

References
----------
B. I. Wohlmuth, SIAM J. Numer. Anal. 38 (2000) 989-1012: no multipliers at prescribed nodes.
M. A. Puso, T. A. Laursen, Comput. Methods Appl. Mech. Engrg 193 (2004) 601-629: the same where
several interfaces meet.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix

from skfem_contact.bodies.facets import facet_shapes
from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.pairing.segmentation import Quadrature
from skfem_contact.pairing.thresholds import MOVING_SHARE, OVERHANG, SHARE_FREE
from skfem_contact.pairing.vectors import dot, entries, turned

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Mask = NDArray[np.bool_]

# What a node may do on a facet; the largest of these on the facet have no multiplier.
FREE, HELD, MET = 0, 1, 2


@dataclass(frozen=True, eq=False)
class Supports:
    """Nodes of facets of the secondary surface that are held.

    Attributes
    ----------
    rank : ndarray of int, shape (nf, k)
        `FREE`; `HELD`: has no displacement of its own; `MET`: nor has the primary opposite to it.
    node, facet, local : ndarray of int, shape (h,)
        The nodes with prescribed components, once for each of their facets.
    opposite : ndarray of int, shape (h, k')
        Nodes of the primary facet that each of them meets.
    weight : ndarray, shape (h, k')
        Their shape functions there.
    still : ndarray of bool, shape (h,)
        Whether one component is prescribed, here and opposite, and it is not the normal one.
    """

    rank: Index
    node: Index
    facet: Index
    local: Index
    opposite: Index
    weight: Array
    still: Mask


def find_supports(
    secondary: ContactSurface, primary: ContactSurface, quadrature: Quadrature
) -> Supports | None:
    """The held nodes of an interface; None where there are none."""
    fixed: Mask = np.asarray(np.isin(secondary.dofs, secondary.body.D), dtype=bool)
    if not fixed.any():
        return None
    met = np.zeros(len(secondary.facets), dtype=bool)
    met[quadrature.secondary_facet] = True
    facet, local = np.nonzero(np.asarray(fixed.any(axis=1))[secondary.facets] & met[:, None])
    if len(facet) == 0:
        return None
    node = secondary.facets[facet, local]
    normal = secondary.facet_node_normals[facet, local]
    opposite, weight, above = _opposite(secondary, primary, quadrature, facet, local, normal)

    there = np.asarray(np.isin(primary.dofs, primary.body.D), dtype=bool)[opposite]  # (h, k', c)
    size = np.abs(weight)

    def held(direction: Array) -> tuple[Mask, Mask]:
        """Whether the node, and the primary opposite to it, can not move along a direction."""
        free = np.sum(size * can_move(there, direction[:, None]), axis=1)
        return ~can_move(fixed[node], direction), above & (free < MOVING_SHARE * size.sum(axis=1))

    scalar = fixed.shape[1] == 1  # its value, no directions
    own, other = held(np.ones((len(node), 1)) if scalar else normal)
    rank = np.zeros(secondary.facets.shape, dtype=np.intp)
    rank[facet, local] = np.where(own & other, MET, np.where(fixed[node].all(axis=1), HELD, FREE))
    still = np.zeros(len(node), dtype=bool)
    if not scalar:  # what is held is an axis: across it one row is left, and it is the normal one
        still = ~own & held(fixed[node].astype(float))[1]
    return Supports(rank, node, facet, local, opposite, weight, still)


def can_move(fixed: Mask, direction: Array) -> Mask:
    """Whether nodes with prescribed components (..., c) move along directions (..., c).

    >>> can_move(np.array([True, False]), np.array([[1.0, 0.0], [0.8, 0.6]])).tolist()
    [False, True]
    """
    size = np.abs(direction)
    return np.asarray(np.sum(size * ~fixed, axis=-1) >= SHARE_FREE * size.sum(axis=-1))


def held_rows(sides: Sequence[tuple[csr_matrix, ContactSurface, float]], direction: Array) -> Mask:
    """Rows that no route may close: neither side moves along `direction` (m, d), shape (m,).

    On the secondary a tenth of the weights is enough to move, it is what the row is given up for.
    """
    held = np.ones(len(direction), dtype=bool)
    for (weights, surface, _), least in zip(sides, (SHARE_FREE, MOVING_SHARE), strict=False):
        if not surface.held.any():
            return np.zeros(len(direction), dtype=bool)
        row, node, weight = entries(weights)
        moving = can_move(surface.held[node], direction[row])
        size, m = np.abs(weight), len(direction)
        free = np.bincount(row, size * moving, m)
        held &= free < least * np.bincount(row, size, m)
    return held


def without_multiplier(rank: Index) -> Mask:
    """Nodes (nf, k) that hand their multiplier over: those held more than others of their facet.

    >>> without_multiplier(np.array([[FREE, HELD], [HELD, HELD], [MET, HELD]])).tolist()
    [[False, True], [False, False], [True, False]]
    """
    return np.asarray(rank > rank.min(axis=1, keepdims=True))


def _opposite(
    secondary: ContactSurface,
    primary: ContactSurface,
    quadrature: Quadrature,
    facet: Index,
    local: Index,
    normal: Array,
) -> tuple[Index, Array, Mask]:
    """Nodes and shape functions of the primary where normals at nodes meet it, and if they do.

    The primary facet is that of the nearest quadrature point; beyond its end it is continued, so
    that positions stay exact.
    """
    near = _nearest_point(quadrature, facet, local)
    nodes = primary.facets[quadrature.primary_facet[near]]
    x = secondary.points[secondary.facets[facet, local]]
    side = dot(primary.points[nodes] - x[:, None], turned(normal)[:, None])
    eta = np.full(len(facet), 0.5)
    for _ in range(6):  # linear facets need one step; curved ones are nearly so
        N, dN = facet_shapes(eta, nodes.shape[1])
        eta = np.clip(eta - dot(N, side) / dot(dN, side), -1.0, 2.0)
    above = (eta >= -OVERHANG) & (eta <= 1.0 + OVERHANG)
    return nodes, facet_shapes(eta, nodes.shape[1])[0], above


def _nearest_point(quadrature: Quadrature, facet: Index, local: Index) -> Index:
    """The quadrature point of each facet where the shape function of its node is largest."""
    order = np.argsort(quadrature.secondary_facet, kind="stable")
    first, last = (
        np.searchsorted(quadrature.secondary_facet, facet, side, order) for side in ("left", "right")
    )
    N = quadrature.secondary_shape
    return np.array(
        [
            points[N[points, k].argmax()]
            for points, k in ((order[a:b], k) for a, b, k in zip(first, last, local, strict=True))
        ]
    )
