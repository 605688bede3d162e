"""What supports leave of the multipliers of faces: the rules of `pairing.supports`, in space."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix

from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.pairing.faces.meeting import meet
from skfem_contact.pairing.faces.segmentation import Segmentation
from skfem_contact.pairing.node import Pairing
from skfem_contact.pairing.supports import FREE, HELD, MET, can_move, held_rows
from skfem_contact.pairing.thresholds import MOVING_SHARE, OVERHANG

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Mask = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Supports:
    """Faces of the secondary with nodes that have prescribed components.

    Attributes
    ----------
    rank : ndarray of int, shape (nf, k)
        What each node may do, see `pairing.supports`: `FREE`, `HELD` or `MET`.
    facet : ndarray of int, shape (h,)
        Faces with prescribed components that meet the primary.
    opposite : ndarray of int, shape (h, k, k')
        Nodes of the primary's face that each of their nodes meets.
    weight : ndarray, shape (h, k, k')
        Their shape functions there.
    """

    rank: Index
    facet: Index
    opposite: Index
    weight: Array


def find_supports(parts: Segmentation) -> Supports | None:
    """The held nodes of an interface; None where there are none."""
    secondary, primary = parts.secondary, parts.primary
    fixed: Mask = np.asarray(np.isin(secondary.dofs, secondary.body.D), dtype=bool)
    met = np.unique(parts.cells[0].facet[parts.e])
    some: Mask = np.asarray(fixed.any(axis=1))
    facet = met[some[secondary.facets[met]].any(axis=1)]
    if not len(facet):
        return None
    opposite, weight, above = _opposite(parts, facet)
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
    return Supports(rank, facet, opposite, weight)


def slip_rows(parts: Segmentation, supports: Supports) -> tuple[csr_matrix, csr_matrix]:
    """Rows of node-to-segment contact for the nodes with prescribed components, over both surfaces."""
    secondary, primary = parts.secondary, parts.primary
    fixed: Mask = np.asarray(np.isin(secondary.dofs, secondary.body.D).any(axis=1))
    nodes = secondary.facets[supports.facet]
    facet, local = np.nonzero(fixed[nodes])
    node, first = np.unique(nodes[facet, local], return_index=True)
    facet, local = facet[first], local[first]
    m, weight = len(secondary.points), supports.weight[facet, local]
    own = csr_matrix((np.ones(len(node)), (node, node)), shape=(m, m))
    at = np.repeat(node, weight.shape[1]), supports.opposite[facet, local].ravel()
    return own, csr_matrix((weight.ravel(), at), shape=(m, len(primary.points)))


def held_tangents(secondary: ContactSurface, primary: ContactSurface, pairing: Pairing) -> Pairing:
    """The pairing with its tangents that supports hold on both sides as `Pairing.still`.

    On a plane of symmetry, and at a wall that guides both bodies, the mortar row across it has some
    nodes of the primary that are not on it. The shear there is zero, the multiplier vanishes, and the
    neighbours keep theirs (rule 3 of `pairing.supports`).
    """
    if pairing.slip_weights is None:
        return pairing
    sides = list(zip(pairing.slip_weights, (secondary, primary), (1.0, -1.0), strict=True))
    some = np.diff(pairing.slip_weights[0].indptr) > 0
    still = [some & held_rows(sides, along) for along in np.moveaxis(pairing.tangent, 1, 0)]
    return replace(pairing, still=np.stack(still, axis=1))


def _opposite(parts: Segmentation, facet: Index) -> tuple[Index, Array, Mask]:
    """Nodes and shape functions of the primary where normals at nodes meet it, and if they do.

    The face of the primary is that of the nearest piece; beyond its edges it is continued, so that
    positions stay exact.
    """
    own = parts.cells[0]
    place = np.full(len(parts.secondary.facets), -1)
    place[facet] = np.arange(len(facet))
    pieces = np.flatnonzero(place[own.facet[parts.e]] >= 0)
    row, e = place[own.facet[parts.e[pieces]]], parts.e[pieces]
    at = own.local(e, parts.secondary.points[parts.secondary.facets[facet[row]]])[..., :2]
    away = parts.pieces.some(pieces).distances(at)  # (pieces, k)
    near = np.empty((len(facet), at.shape[1]), dtype=np.intp)
    for k in range(at.shape[1]):
        order = np.lexsort((away[:, k], row))
        near[:, k] = order[np.searchsorted(row[order], np.arange(len(facet)))]
    flat = near.ravel()
    nodes = np.tile(np.arange(at.shape[1]), len(facet))
    f = parts.f[pieces[flat]]
    points = meet(parts.secondary, parts.primary, parts.cells, e[flat], f, at[flat, nodes][:, None])
    weight = points.M[:, 0]
    xi = weight @ parts.primary.kind.locations
    over = np.maximum(-xi.min(axis=1), xi.max(axis=1) - 1.0)
    if parts.primary.kind.corners == 3:
        over = np.maximum(-xi.min(axis=1), xi.sum(axis=1) - 1.0)
    shape = (*near.shape, weight.shape[1])
    opposite = parts.primary.facets[points.f].reshape(shape)
    return opposite, weight.reshape(shape), (over <= OVERHANG).reshape(near.shape)
