r"""The dual basis of a facet, on the part of it that the primary covers.

The multipliers are made facet by facet,

    phi_i = sum_k A_ik N_k,      A = diag(int N) Mass^-1,

so that ``int phi_i N_j = delta_ij int N_j``. All integrals, those of ``Mass`` too, are over the
part of the facet that the primary covers, so that this holds, and ``sum_i phi_i = 1``, also at
the edge of the contact (Cichosz and Bischoff 2011).

Quadratic facets carry the quadratic dual basis (three multipliers): in 2-D its weights
``1/6, 1/6, 4/6`` are positive, it does not oscillate as the trace of the secondary is its own
multiplier space, and it even contains the linear functions (Simpson's rule integrates cubics),
which the dual basis of linear facets does not.

**Merging.** A node whose share ``int N_i`` of a facet is less than a quarter of what it has on a
whole facet of equal area hands its multiplier on this facet to the node with the largest share:
``phi_heir + phi_i`` instead of ``phi_heir`` and ``phi_i``. So do all others of a facet covered by
less than a third. This happens

* where the primary covers little of the facet: the node's row would extrapolate from the covered
  part to the node, with weights that grow without bound;
* on quadratic facets covered in part, where ``int N_i`` can be negative and the sign of a
  pressure would lose its meaning;
* at the node of a quadratic facet on the axis of symmetry, where ``int N_i 2 pi r dr`` is zero.

Nodes that supports hold are merged too, into those that they leave free, see `supports`.

The basis keeps the constants, hence the patch test.

References
----------
B. I. Wohlmuth, SIAM J. Numer. Anal. 38 (2000) 989-1012: dual multipliers. T. Cichosz,
M. Bischoff, Comput. Methods Appl. Mech. Engrg 200 (2011) 1317-1332: boundaries.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from skfem_contact.digits import GIVEN
from skfem_contact.pairing.thresholds import COVER_KEPT, SHARE_KEPT

Array = NDArray[np.float64]
Index = NDArray[np.intp]

# Integrals of the shape functions over a whole facet of unit length: end, end (, middle)
WHOLE = {2: np.array([0.5, 0.5]), 3: np.array([1.0, 1.0, 4.0]) / 6.0}


def dual_basis(
    mass: Array, area: Array, without: NDArray[np.bool_] | None = None
) -> tuple[Array, Array, Index]:
    """Coefficients of the dual basis of facets, with what is left of small parts merged.

    Parameters
    ----------
    mass : ndarray, shape (nf, k, k)
        ``int N_i N_j`` over the covered part of each facet [area].
    area : ndarray, shape (nf,)
        Area of each whole facet [area].
    without : ndarray of bool, shape (nf, k), optional
        Nodes that have no multiplier whatever their share, never all of a facet.

    Returns
    -------
    A : ndarray, shape (nf, k, k)
        ``phi_i = sum_k A_ik N_k``, dimensionless.
    share : ndarray, shape (nf, k)
        ``int N_i`` over the covered part [area].
    heir : ndarray of int, shape (nf, k)
        Local number of the node whose multiplier includes that of node i; i itself in general.
        ``int phi_i N_j = share_j`` if i is the heir of j, and zero else.

    Examples
    --------
    A linear facet of length 6, fully covered:

    >>> A, share, heir = dual_basis(np.array([[[2.0, 1.0], [1.0, 2.0]]]), np.array([6.0]))
    >>> print(A[0], share[0], heir[0])
    [[ 2. -1.]
     [-1.  2.]] [3. 3.] [0 1]

    Its first node is prescribed:

    >>> held = np.array([[True, False]])
    >>> A, _, heir = dual_basis(np.array([[[2.0, 1.0], [1.0, 2.0]]]), np.array([6.0]), held)
    >>> print(A[0], heir[0])
    [[0. 0.]
     [1. 1.]] [1 1]
    """
    nf, k = mass.shape[:2]
    share = mass.sum(axis=2)  # int N_i, as the N_j sum to 1
    every, own = np.arange(nf), np.arange(k)
    without = np.zeros((nf, k), dtype=bool) if without is None else without
    largest = np.where(without, -np.inf, share).argmax(axis=1)
    least = (1 - GIVEN) * area[:, None]
    merged = without | (share < SHARE_KEPT * WHOLE[k] * least)
    merged |= share.sum(axis=1, keepdims=True) < COVER_KEPT * least
    merged[every, largest] = False
    heir = np.where(merged, largest[:, None], own)
    S = np.zeros_like(mass)
    S[every[:, None], heir, own] = 1.0
    # one multiplier left: it is the constant 1, known without the inverse of what may be a sliver
    single = merged.sum(axis=1) == k - 1
    inverse = np.linalg.inv(np.where(single[:, None, None], np.eye(k), mass))
    A = S @ (share[:, :, None] * inverse)
    A[single] = S[single]  # row of the largest: all ones
    return A, share, heir
