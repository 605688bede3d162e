r"""Multipliers of facets: the dual basis of each kind, on the part that the primary covers.

On each facet the multipliers are biorthogonal to functions ``P = B N`` made of its shape functions,

    phi = S diag(int P) (int P P')^-1 P,       int phi_i N_j = (S diag(int P) B^-T)_ij,

with all integrals, also those of the mass matrix, over the covered part, so that this holds, and
``sum_i phi_i = 1``, at the edge of the contact as well (Cichosz and Bischoff 2011). The functions are

* the shape functions themselves (B = 1) for linear facets, for quadratic lines, whose integrals 1/6,
  1/6, 4/6 are positive, and for faces with nine nodes, 1/36, 4/36, 16/36. (The multipliers of a
  quadratic line contain the linear functions, as Simpson's rule integrates cubics; those of linear
  facets do not.);
* for triangles with six nodes and quadrilaterals with eight, whose corners have the integrals 0 and
  -1/12, so that a pressure there would have no sign,

      P_corner = N_corner + 1/5 (sum of N over both edges),      P_edge = 3/5 N_edge :

  positive integrals (2/15 and 3/15, 1/20 and 4/20 of the area) and the sum 1. The displacement
  ``sum_i P_i v_i`` has ``v = u`` at corners and ``v = (5 u - u_start - u_end) / 3`` at the middles of
  edges: the row of a corner holds one node, that of a middle three, and they are eliminated one
  after the other. Multipliers are as many as nodes, and contain the constants.

**Merging.** Where the primary covers little of a facet, or the wrong part, the multiplier of a node has
to extrapolate from there to the node, and ``int N_i`` of a quadratic one can be negative, so that a
pressure would have no sign. A node whose share ``int P_i`` is less than a quarter of what it has on the
whole facet hands its multiplier on this facet to the nearest nodes that keep theirs, in proportion to
their shares: nothing depends on the order of the nodes. So does the node of a quadratic line on the
axis of symmetry, where ``int N_i 2 pi r dr`` is zero, or next to zero on a curve. Where no node has as
much, the best covered keep theirs. What the rows then weigh in all is bounded by

    int |phi| <= (area int phi^2)^(1/2),

and where this is more than `WEIGHTS_KEPT` times that of the whole facet, only the nodes of one edge
of a face keep theirs, and in the end one node does. Nodes that supports hold are merged too
(see below). All columns of S have the sum one: the basis keeps the constants, hence the patch test.

**Supports.** The row of a secondary node is given up for the node's own DOF. Where that is prescribed,
the row would be closed by moving the few free nodes of the primary that have some weight in it: with a
weight of ``1e-6``, a million times as far as the gap is deep. Hence four rules.

1. A node all of whose components are prescribed has no multiplier: on every facet its share goes to
   a neighbour that is free (merging, as above). Facets all of whose nodes are held keep theirs, as
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
B. I. Wohlmuth, SIAM J. Numer. Anal. 38 (2000) 989-1012: dual multipliers. A. Popp, B. I. Wohlmuth,
M. W. Gee, W. A. Wall, SIAM J. Sci. Comput. 34 (2012) B421-B446: quadratic faces. T. Cichosz, M.
Bischoff, Comput. Methods Appl. Mech. Engrg 200 (2011) 1317-1332: boundaries.
M. A. Puso, T. A. Laursen, Comput. Methods Appl. Mech. Engrg 193 (2004) 601-629: no multipliers where
several interfaces meet, nor (Wohlmuth) at prescribed nodes.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from scipy.sparse import csr_matrix, diags

from skfem_contact.arrays import Array, Index, Mask, entries
from skfem_contact.bodies.facet_kinds import FacetKind, positive_functions
from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.digits import GIVEN, SINGLE
from skfem_contact.pairing.node import SHARE_KEPT
from skfem_contact.pairing.search import FACING
from skfem_contact.pairing.segmentation import Segmentation
from skfem_contact.records import dataclass

# The weights of a row are bounded by this times those of whole facets: the number at which two
# multipliers become one on a line whose middle third is covered. On lines the sum of |weights| is then
# below 5 (linear) and 7 (quadratic) however they are cut; uncut it is 1.7 and 2.2.
WEIGHTS_KEPT = float(np.sqrt(7))

# A surface moves at a point if nodes that move have this part of the weights there. To close a gap by
# less is to tear the body: a node next to a clamped one, with a fifth of the weight, by five times
# the gap, and the force is 30 times too large.
MOVING_SHARE = 0.5

# The primary lies opposite to a node if it ends no farther from it than this part of a facet; and by
# this part of its length two edges that touch may do so beyond the end of one.
OVERHANG = 0.25

# What a node may do on a facet; the largest of these on the facet have no multiplier.
FREE, HELD, MET = range(3)


@dataclass(frozen=True, eq=False)
class DualBasis:
    """Multipliers on all facets of a surface.

    Attributes
    ----------
    A : ndarray, shape (nf, k, k)
        ``phi_i = sum_j A_ij N_j``, dimensionless; zero where a node has no multiplier.
    S : ndarray, shape (nf, k, k)
        Whose multiplier includes how much of whose; the columns of covered facets have the sum one.
    share : ndarray, shape (nf, k)
        ``int P_i`` over the covered part [area].
    """

    A: Array
    S: Array
    share: Array


def dual_basis(
    kind: FacetKind,
    mass: Array,
    whole: Array,
    total: Array,
    without: Mask | None = None,
    constant: Mask | None = None,
) -> DualBasis:
    """Multipliers of facets, with what is left of small parts merged.

    Parameters
    ----------
    kind : FacetKind
    mass : ndarray, shape (nf, k, k)
        ``int N_i N_j`` over the covered part of each facet [area].
    whole : ndarray, shape (nf, k)
        ``int P_i`` over each whole facet, positive [area].
    total : ndarray, shape (nf, k)
        Share of each node on all its facets: of two equal ones on a facet the larger inherits [area].
    without : ndarray of bool, shape (nf, k), optional
        Nodes that have no multiplier whatever their share, never all of a facet.
    constant : ndarray of bool, shape (nf,), optional
        Facets that have one multiplier whatever is covered.

    Examples
    --------
    A triangle of area 12, covered:

    >>> from skfem_contact.bodies.facet_kinds import KINDS
    >>> mass = np.array([[[2.0, 1, 1], [1, 2, 1], [1, 1, 2]]])
    >>> basis = dual_basis(KINDS["tri3"], mass, np.full((1, 3), 4.0), np.full((1, 3), 4.0))
    >>> print(basis.A[0].round(12), basis.share[0])
    [[ 3. -1. -1.]
     [-1.  3. -1.]
     [-1. -1.  3.]] [4. 4. 4.]
    """
    share = mass.sum(axis=2) @ positive_functions(kind).T  # int P_i, as the N_j sum to 1
    without = np.zeros(share.shape, dtype=bool) if without is None else without
    relative = np.where(without, -np.inf, share / whole)
    kept = ~without & (relative >= SHARE_KEPT * (1 - GIVEN))
    best = relative >= 0.5 * relative.max(axis=1, keepdims=True)
    kept = np.where(kept.any(axis=1, keepdims=True), kept, best)
    edges = [np.isin(np.arange(kind.nodes), edge) & best for edge in kind.edges if kind.dim == 2]
    single = kept.sum(axis=1) == 1
    A, S = _constants(share, total, np.where(single[:, None], kept, ~without))
    several = ~single if constant is None else ~(single | constant)
    # the mass matrix of a sliver has no inverse to speak of: half of the digits of the rows would be
    # lost, on a part of the area that is small
    least, most = np.linalg.eigvalsh(mass)[:, [0, -1]].T
    left = np.flatnonzero(several & (least > SINGLE * most))
    for choices in ([kept], edges):
        if not len(left):
            break
        size = share[left] + GIVEN * total[left]
        A_left, S_left, good = _least(kind, mass[left], share[left], size, [c[left] for c in choices])
        A[left[good]], S[left[good]] = A_left[good], S_left[good]
        left = left[~good]
    return DualBasis(A, S, share)


def _constants(share: Array, total: Array, possible: Mask) -> tuple[Array, Array]:
    """A and S with one multiplier: the constant 1, known without an inverse."""
    most = np.where(possible, share, -np.inf)
    ties = most >= most.max(axis=1, keepdims=True) * (1 - GIVEN)
    S = np.zeros((*share.shape, share.shape[1]))
    S[np.arange(len(S)), np.where(ties, total, -np.inf).argmax(axis=1)] = 1.0
    return S.copy(), S


def _least(
    kind: FacetKind, mass: Array, share: Array, size: Array, choices: Sequence[Mask]
) -> tuple[Array, Array, Mask]:
    """A and S of the choice of nodes with the least weights, and where there is one within the limit.

    Of equal ones it is that of the largest `size` (nf, k).
    """
    A, S = np.zeros_like(mass), np.zeros_like(mass)
    least, most = np.full(len(A), WEIGHTS_KEPT * _whole_weights(kind)), np.zeros(len(A))
    for kept in choices:
        A_kept, S_kept, weights = _with_weights(kind, mass, share, kept)
        mine = np.where(kept, size, 0.0).sum(axis=1)
        equal = (weights <= least * (1 + GIVEN)) & (mine > most)
        better = (kept.sum(axis=1) > 1) & ((weights < least * (1 - GIVEN)) | equal)
        A[better], S[better] = A_kept[better], S_kept[better]
        least[better], most[better] = weights[better], mine[better]
    return A, S, most > 0


def _with_weights(kind: FacetKind, mass: Array, share: Array, kept: Mask) -> tuple[Array, Array, Array]:
    """A and S of facets where some nodes keep their multipliers, and the bound of weights, (nf,)."""
    B, several = positive_functions(kind), kept.sum(axis=1) > 1
    S = np.where(several[:, None, None], _handed(kind, share, kept), 0.0)
    inverse = np.linalg.inv(np.where(several[:, None, None], B @ mass @ B.T, np.eye(kind.nodes)))
    A = S @ (share[:, :, None] * inverse) @ B
    square = mass.sum(axis=(1, 2))[:, None] * np.einsum("fij,fij->fi", A @ mass, A)
    integral = np.where(kept, np.einsum("fij,fj->fi", S, share), 1.0)
    weights = np.sqrt(np.maximum(square, 0.0)) / np.where(integral > 0, integral, np.nan)
    return A, S, np.where(kept, np.nan_to_num(weights, nan=np.inf), 0.0).max(axis=1)


@lru_cache
def _whole_weights(kind: FacetKind) -> float:
    """The bound of the weights on a whole straight facet."""
    at, w = kind.quadrature(10)
    N = kind.shapes(at)[0]
    mass = (N * w[:, None]).T @ N
    share = positive_functions(kind) @ mass.sum(axis=1)
    every = np.ones((1, kind.nodes), dtype=bool)
    return float(_with_weights(kind, mass[None], share[None], every)[2][0])


def _handed(kind: FacetKind, share: Array, kept: Mask) -> Array:
    """S (nf, k, k): multipliers that are kept, and the others in parts those of the nearest kept."""
    distance = np.where(kept[:, :, None], _distances(kind), np.inf)
    nearest = distance <= distance.min(axis=1, keepdims=True) * (1 + GIVEN)
    part = np.where(nearest & kept[:, :, None], share[:, :, None], 0.0)
    own = kept[:, None, :] & np.eye(kind.nodes, dtype=bool)
    part = np.where(kept[:, None, :], own, part)
    size = part.sum(axis=1, keepdims=True)
    return np.divide(part, size, out=np.zeros_like(part), where=size > 0)


@lru_cache
def node_rows(kind: FacetKind) -> Array:
    """Return the share of nodal values that each multiplier sees, ``B^-T``, shape (k, k)."""
    return np.asarray(np.linalg.inv(positive_functions(kind)).T)


@lru_cache
def _distances(kind: FacetKind) -> Array:
    """Distances between the nodes of a line, an equilateral triangle or a square, shape (k, k)."""
    at = kind.locations
    if kind.triangle:
        at = at @ np.array([[1.0, 0.0], [0.5, np.sqrt(0.75)]])
    return np.asarray(np.linalg.norm(at[:, None] - at, axis=2))


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
