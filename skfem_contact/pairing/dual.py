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
axis of symmetry, where ``int N_i 2 pi r dr`` is zero. Where no node has as much, the best covered keep
theirs. What the rows then weigh in all is bounded by

    int |phi| <= (area int phi^2)^(1/2),

and where this is more than `WEIGHTS_KEPT` times that of the whole facet, only the nodes of one edge
of a face keep theirs, and in the end one node does. Nodes that supports hold are merged too
(`supports`). All columns of S have the sum one: the basis keeps the constants, hence the patch test.

References
----------
B. I. Wohlmuth, SIAM J. Numer. Anal. 38 (2000) 989-1012: dual multipliers. A. Popp, B. I. Wohlmuth,
M. W. Gee, W. A. Wall, SIAM J. Sci. Comput. 34 (2012) B421-B446: quadratic faces. T. Cichosz, M.
Bischoff, Comput. Methods Appl. Mech. Engrg 200 (2011) 1317-1332: boundaries.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from skfem_contact.arrays import Array, Mask
from skfem_contact.bodies.facet_kinds import FacetKind
from skfem_contact.digits import GIVEN
from skfem_contact.pairing.thresholds import SHARE_KEPT, WEIGHTS_KEPT, WORST_CONDITION
from skfem_contact.records import dataclass


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
    # the mass matrix of a sliver has no inverse to speak of
    least, most = np.linalg.eigvalsh(mass)[:, [0, -1]].T
    left = np.flatnonzero(several & (least > most / WORST_CONDITION))
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
def positive_functions(kind: FacetKind) -> Array:
    """B of ``P = B N``, the functions that the multipliers of a kind are dual to, shape (k, k)."""
    B = np.eye(kind.nodes)
    for start, end, middle in kind.edges if kind.taken else ():
        B[[start, end], middle] = kind.taken
        B[middle, middle] = 1 - 2 * kind.taken
    return B


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
