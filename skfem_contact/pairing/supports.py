r"""Supports and the multipliers of mortar contact: nodes that are held need none.

The row of a secondary node is given up for the node's own DOF. Where that is prescribed, the row
would be closed by moving the few free nodes of the primary that have some weight in it: with a
weight of ``1e-6``, a million times as far as the gap is deep. Hence four rules.

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
4. The tangential rows of glue along what supports hold on both sides are closed by the supports, of
   whatever method. What else moves in them would close them with a million times the force: a node with
   a weight below the digits of coordinates, of a foot that round-off puts beside a wall, or the
   neighbours that the height of a smooth boundary follows.

References
----------
B. I. Wohlmuth, SIAM J. Numer. Anal. 38 (2000) 989-1012: no multipliers at prescribed nodes.
M. A. Puso, T. A. Laursen, Comput. Methods Appl. Mech. Engrg 193 (2004) 601-629: the same where
several interfaces meet.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.sparse import csr_matrix, diags

from skfem_contact.arrays import Array, Index, Mask, unit
from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.digits import GIVEN
from skfem_contact.pairing.node import Pairing
from skfem_contact.pairing.segmentation import Segmentation
from skfem_contact.pairing.thresholds import FACING, MOVING_SHARE, OVERHANG
from skfem_contact.pairing.vectors import entries
from skfem_contact.records import dataclass

# What a node may do on a facet; the largest of these on the facet have no multiplier.
FREE, HELD, MET = range(3)


@dataclass(frozen=True, eq=False)
class Supports:
    """Facets of the secondary with nodes that have prescribed components.

    Attributes
    ----------
    rank : ndarray of int, shape (nf, k)
        `FREE`; `HELD`: has no displacement of its own; `MET`: nor has the primary opposite to it.
    facet : ndarray of int, shape (h,)
        Facets with prescribed components that meet the primary.
    opposite : ndarray of int, shape (h, k, k')
        Nodes of the primary's facet that each of their nodes meets.
    weight : ndarray, shape (h, k, k')
        Their shape functions there.
    above : ndarray of bool, shape (h, k)
        Whether the primary lies opposite to a node, or ends a little beside it.
    """

    rank: Index
    facet: Index
    opposite: Index
    weight: Array
    above: Mask


def find_supports(pieces: Segmentation) -> Supports | None:
    """The held nodes of an interface; None where there are none."""
    secondary, primary = pieces.secondary, pieces.primary
    if not secondary.held_nodes.any():
        return None
    fixed: Mask = np.asarray(np.isin(secondary.dofs, secondary.body.D), dtype=bool)
    some: Mask = np.asarray(fixed.any(axis=1))
    met = np.unique(pieces.facets[0])
    facet = met[some[secondary.facets[met]].any(axis=1)]
    if not len(facet):
        return None
    opposite, weight, above = _opposite(pieces, facet)
    there = np.asarray(np.isin(primary.dofs, primary.body.D), dtype=bool)[opposite]  # (h, k, k', c)
    here, size = fixed[secondary.facets[facet]], np.abs(weight)
    normal = secondary.facet_node_normals[facet]
    if fixed.shape[1] == 1:  # of a scalar field its value, no directions
        normal = np.ones((*here.shape[:2], 1))
    own = ~can_move(here, normal)
    free = np.sum(size * can_move(there, normal[:, :, None]), axis=2)
    other = above & (free < MOVING_SHARE * size.sum(axis=2))
    rank = np.full(secondary.facets.shape, FREE)
    rank[facet] = np.where(own & other, MET, np.where(here.all(axis=2), HELD, FREE))
    return Supports(rank, facet, opposite, weight, above)


def slip_rows(
    pieces: Segmentation, supports: Supports, weights: tuple[csr_matrix, csr_matrix]
) -> tuple[csr_matrix, csr_matrix]:
    """Weights of both sides with rows of node-to-segment contact where components are prescribed."""
    secondary = pieces.secondary
    nodes = secondary.facets[supports.facet]
    fixed: Mask = np.asarray(np.isin(secondary.dofs, secondary.body.D).any(axis=1))
    facet, local = np.nonzero(fixed[nodes] & supports.above)
    node, first = np.unique(nodes[facet, local], return_index=True)
    facet, local = facet[first], local[first]
    m, weight = len(secondary.points), supports.weight[facet, local]
    own = csr_matrix((np.ones(len(node)), (node, node)), shape=(m, m))
    at = np.repeat(node, weight.shape[1]), supports.opposite[facet, local].ravel()
    there = csr_matrix((weight.ravel(), at), shape=weights[1].shape)
    others = diags(1.0 - own.diagonal())
    return csr_matrix(others @ weights[0] + own), csr_matrix(others @ weights[1] + there)


def guided_tangents(secondary: ContactSurface, primary: ContactSurface, pairing: Pairing) -> Pairing:
    """The pairing of glue in space, its tangents along what supports hold `Pairing.still` (rule 4)."""
    guided = np.array(np.broadcast_to(pairing.paired[:, None], pairing.normal.shape))
    sides = (pairing.secondary_weights, secondary), (pairing.primary_weights, primary)
    for weights, surface in sides:
        size = abs(weights)
        free = size @ (~surface.held).astype(float)
        guided &= free <= GIVEN * np.asarray(size.sum(axis=1))
    still = ~can_move(guided[:, None], pairing.tangent)
    # one direction is left, and the normal has it
    alone: Mask = (np.sum(guided, axis=1) == 2) & can_move(guided, pairing.normal)
    still |= alone[:, None]
    still &= np.any(guided, axis=1, keepdims=True)
    if not still.any():
        return pairing
    return replace(pairing, still=still if pairing.still is None else still | pairing.still)


def held_tangents(secondary: ContactSurface, primary: ContactSurface, pairing: Pairing) -> Pairing:
    """The pairing with what supports hold on both sides along the interface as `Pairing.still`.

    On a line or plane of symmetry, and at a wall that guides both bodies, the mortar row across it has
    some nodes of the primary that are not on it. The shear there is zero, the multiplier vanishes, and
    the neighbours keep theirs (rule 3 above).
    """
    if pairing.slip_weights is None:
        return pairing
    sides = list(zip(pairing.slip_weights, (secondary, primary), (1.0, -1.0), strict=True))
    some, along = secondary.held.any(axis=1), pairing.tangent
    if secondary.dim == 2:  # along the one axis that is held: across it one row is left
        some = (secondary.held.sum(axis=1) == 1) & can_move(secondary.held, pairing.normal)
        along = secondary.held[:, None].astype(float)
    still = [some & held_rows(sides, way) for way in np.moveaxis(along, 1, 0)]
    if not np.any(still):
        return replace(pairing, slip_weights=None)
    return replace(pairing, still=np.stack(still, axis=1))


def can_move(fixed: Mask, direction: Array) -> Mask:
    """Return whether nodes with prescribed components (..., c) move along directions (..., c).

    >>> can_move(np.array([True, False]), np.array([[1.0, 0.0], [0.8, 0.6]])).tolist()
    [False, True]
    """
    size = np.abs(direction)
    return np.asarray(np.sum(size * ~fixed, axis=-1) >= FACING * size.sum(axis=-1))


def held_rows(sides: Sequence[tuple[csr_matrix, ContactSurface, float]], direction: Array) -> Mask:
    """Rows that no route may close: neither side moves along `direction` (m, d), shape (m,).

    On the secondary a tenth of the weights is enough to move, it is what the row is given up for.
    """
    held = np.ones(len(direction), dtype=bool)
    for (weights, surface, _), least in zip(sides, (FACING, MOVING_SHARE), strict=False):
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


def _opposite(pieces: Segmentation, facet: Index) -> tuple[Index, Array, Mask]:
    """Nodes and shape functions of the primary where normals at nodes meet it, and if they do.

    The facet of the primary is that of the nearest piece; beyond its ends or edges it is continued, so
    that positions stay exact.
    """
    e, _ = pieces.facets
    place = np.full(len(pieces.secondary.facets), -1)
    place[facet] = np.arange(len(facet))
    mine = np.flatnonzero(place[e] >= 0)
    row, away = place[e[mine]], pieces.beyond(mine)
    near = np.empty((len(facet), away.shape[1]), dtype=np.intp)
    for k in range(away.shape[1]):
        order = np.lexsort((away[:, k], row))
        near[:, k] = mine[order[np.searchsorted(row[order], np.arange(len(facet)))]]
    points = pieces.nodes(near.ravel(), np.tile(np.arange(near.shape[1]), len(facet)))
    weight, kind = points.M[:, 0], pieces.primary.kind
    xi = weight @ kind.locations
    most = xi.sum(axis=1) if kind.triangle else xi.max(axis=1)
    over = np.maximum(-xi.min(axis=1), most - 1.0)
    shape = (*near.shape, weight.shape[1])
    opposite = pieces.primary.facets[points.f].reshape(shape)
    return opposite, weight.reshape(shape), (over <= OVERHANG).reshape(near.shape)


def along_supports(tangent: Array, normal: Array, held: Mask) -> Array:
    """Tangents (m, 2, 3) turned about the normal so that what supports hold is one of them.

    A roller or a plane of symmetry through the contact takes one direction from the slip. It has to be
    along a tangent: else both rows would be half held, and stand for the one direction that is left
    together.

    Parameters
    ----------
    tangent : ndarray, shape (m, 2, 3)
    normal : ndarray, shape (m, 3)
    held : ndarray of bool, shape (m, 3)
        Prescribed components of the nodes.

    Examples
    --------
    >>> frame = np.array([[[0.6, 0.8, 0.0], [-0.8, 0.6, 0.0]]])
    >>> turned = along_supports(frame, np.array([[0.0, 0.0, 1.0]]), np.array([[True, False, False]]))
    >>> turned.tolist()
    [[[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]]
    """
    count = held.sum(axis=1)
    # the only one that is held, or the only one that is free
    axis = np.where(count == 1, np.argmax(held, axis=1), np.argmin(held, axis=1))
    across = np.eye(3)[axis] - normal[np.arange(len(normal)), axis][:, None] * normal
    some = ((count == 1) | (count == 2)) & (np.linalg.norm(across, axis=1) > FACING)
    first = unit(np.where(some[:, None], across, tangent[:, 0]))
    frame = np.stack([first, np.cross(normal, first)], axis=1)
    return np.where(some[:, None, None], frame, tangent)
