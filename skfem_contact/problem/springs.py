r"""Stiff springs in series with contact points whose rows depend on each other.

Where rows depend on each other, at corners, along edges that contacts share, on tools that supports
hold and that are finer than what they press, forces of contact are not unique. Each point is then seen
through a spring with the compliance E, ``W + E`` in place of ``W = B S^-1 B'``, whose rest forces are
moved until no spring has a strain (`skfem_contact.loops.multipliers`). What is left of the springs is a
choice: forces p with the least ``p'E p``. With

    ``E_i = eps mean(c_j a_j) / a_i``,

a the areas and c the compliances of the points, that is the least square of the pressure over the
surface, whatever the order of contacts and the numbering of nodes. The mean is over points whose rows
are connected: rows of others do not depend on each other.

Where points stick by friction, `least_friction` goes on from there: of all forces that do the same to
the bodies, first those with the least friction, in the same mean square, then the least of these.

What each contact point resists by itself are the diagonal blocks of the compliance of all points.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import connected_components

from skfem_contact.arrays import Array, Index, Mask, runs
from skfem_contact.conditions.kinematics import Kinematics
from skfem_contact.digits import COMPUTED
from skfem_contact.problem.response import Resistance
from skfem_contact.problem.thresholds import GIVE


def spring_compliance(kin: Kinematics, slips: bool, compliance: Callable[[csr_matrix], Array]) -> Array:
    """Compliance of the spring of each point, along its normal and its tangents, (m,) [length/force].

    Parameters
    ----------
    kin : Kinematics
        With the columns of DOFs that can move.
    slips : bool
        Whether tangential rows are modelled.
    compliance : callable
        ``B -> (r,)``, of rows (r, n) how far a unit force on each moves it, by the DOFs' own stiffness.
    """
    own, area = np.asarray(compliance(kin.B_n), dtype=float), np.asarray(kin.area, dtype=float)
    pattern = abs(kin.B_n)
    for k in range(kin.tangents if slips else 0):
        along = abs(csr_matrix(kin.B_t[k :: kin.tangents]))
        pattern = pattern + along
        own = np.where(own > 0, own, compliance(along))
    large = area > 0
    area = np.where(large, area, np.mean(area[large]) if large.any() else 1.0)
    count, group = connected_components(pattern @ pattern.T, directed=False)
    moves = own > 0
    weight = np.bincount(group[moves], (own * area)[moves], minlength=count)
    mean = weight / np.maximum(np.bincount(group[moves], minlength=count), 1)
    mean = np.where(mean > 0, mean, mean.max(initial=0.0) or 1.0)  # of rows that nothing moves
    return np.asarray(GIVE * mean[group] / area)


def least_friction(
    rows: csr_matrix, friction: Mask, give: Array, force: Array
) -> Iterator[tuple[Index, Array]]:
    """Forces on rows that depend on each other, with the least friction, then the least of the others.

    Parameters
    ----------
    rows : csr_matrix, shape (r, n)
        What each force acts along, none of them empty.
    friction : ndarray of bool, shape (r,)
    give : ndarray, shape (r,)
        Compliance of the springs: weights of the squares [length/force].
    force : ndarray, shape (r,)
        Forces with the right ``rows.T @ force``.

    Yields
    ------
    of : ndarray of int
        A smallest set of rows that depend on no others, some of them of friction.
    forces : ndarray
        On these rows.

    Examples
    --------
    One normal force and one of friction along the same DOF:

    >>> rows = csr_matrix([[1.0, 0.0], [2.0, 0.0], [0.0, 1.0]])
    >>> friction = np.array([False, True, False])
    >>> [(of, forces)] = least_friction(rows, friction, np.ones(3), np.array([1.0, 1.0, 5.0]))
    >>> of.tolist(), np.round(forces, 12).tolist()
    ([0, 1], [3.0, 0.0])
    """
    from skfem_contact.elimination.constraint import eliminate

    found = eliminate(rows, np.zeros(len(force)))
    more, kept = found.redundant, found.rows_kept
    follow = (rows[more][:, found.dependent] @ found.pivot_inverse).tocoo()
    part = np.abs(follow.data) > COMPUTED
    pairs = more[follow.row[part]], kept[follow.col[part]]
    shape = (len(force), len(force))
    _, group = connected_components(csr_matrix((np.ones(len(pairs[0])), pairs), shape), directed=False)
    for g in np.unique(group[more]):
        of = np.flatnonzero(group == g)
        if friction[of].any():
            root, own = np.sqrt(give[of]), rows[of]
            A = own[:, np.unique(own.indices)].toarray().T / root
            yield of, _least_of_some(A, friction[of], root * force[of]) / root


def _least_of_some(A: Array, some: Mask, y: Array) -> Array:
    """Of all vectors with the same ``A y`` those with the least `some` entries, of these the least."""
    size, asked, out = float(np.linalg.norm(A)), A @ y, np.empty_like(y)
    U, s, V = _decomposed(A[:, ~some], size)
    across = A[:, some] - U @ (U.T @ A[:, some])  # what the other entries can not do instead
    P, t, Q = _decomposed(across, size)
    out[some] = Q.T @ (P.T @ asked / t)
    out[~some] = V.T @ (U.T @ (asked - A[:, some] @ out[some]) / s)
    return out


def _decomposed(A: Array, size: float) -> tuple[Array, Array, Array]:
    """Singular values and vectors of A, without those that are round-off of a matrix of this size."""
    U, s, V = np.linalg.svd(A, full_matrices=False)
    some = s > COMPUTED * size
    return U[:, some], s[some], V[some]


def point_resistance(
    kin: Kinematics, slips: bool, flexibility: Callable[[csr_matrix], csr_matrix | Array]
) -> Resistance:
    """Resistance of each point from rows times the flexibility of the bodies.

    Parameters
    ----------
    kin : Kinematics
    slips : bool
        Whether tangential rows are modelled.
    flexibility : callable
        ``B -> B F``, of rows (r, n) the displacements that unit forces along them cause, (r, n).
    """
    t = kin.tangents if slips else 0
    normal = _blocks(kin.B_n, 1, flexibility)
    return _resistance(normal, _blocks(kin.B_t, t, flexibility) if t else normal)


def resistance_by(W: Array, normal_rows: Index, tangential_rows: Index) -> Resistance:
    """Resistance of each point from the compliance of all rows; -1 where a point has none."""
    rows = (
        normal_rows[:, None],
        tangential_rows if (tangential_rows >= 0).any() else normal_rows[:, None],
    )
    W = W if W.size else np.zeros((1, 1))  # whose last row is looked at for points that have none
    normal, tangential = (
        np.where((on[:, :, None] >= 0) & (on[:, None, :] >= 0), W[on[:, :, None], on[:, None, :]], 0.0)
        for on in rows
    )
    return _resistance(normal, tangential)


def _resistance(normal: Array, tangential: Array) -> Resistance:
    # of a body that is about to buckle it may be negative: how stiff it is is a size all the same
    softest = np.max(np.abs(np.linalg.eigvalsh(tangential)), axis=1)
    return Resistance(_inverse(np.abs(normal[:, 0, 0])), _inverse(softest))


def _blocks(B: csr_matrix, size: int, flexibility: Callable[[csr_matrix], csr_matrix | Array]) -> Array:
    """Diagonal blocks (m, size, size) of ``B F B'``, of a few rows at a time."""
    out = np.zeros((B.shape[0] // size, size, size))
    for points in runs(len(out), 8 * size * B.shape[1]):
        rows = csr_matrix(B[points.start * size : points.stop * size])
        W = _dense(flexibility(rows) @ rows.T)
        count = points.stop - points.start
        where = np.arange(count)[:, None] * size + np.arange(size)
        out[points] = W[where[:, :, None], where[:, None, :]]
    return out


def _dense(A: csr_matrix | Array) -> Array:
    return np.asarray(A.toarray() if hasattr(A, "toarray") else A)


def _inverse(compliance: Array) -> Array:
    """One over it; what can not move at all resists like the stiffest of the others."""
    moves = compliance > 0
    if not moves.any():
        return np.ones_like(compliance)
    return 1.0 / np.where(moves, compliance, np.min(compliance[moves]))
