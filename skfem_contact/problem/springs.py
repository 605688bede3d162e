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

What each contact point resists by itself are the diagonal blocks of the compliance of all points, or of
what K's diagonal makes of it.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy.sparse import csr_matrix, diags
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import splu

from skfem_contact.arrays import Array, Index, Mask
from skfem_contact.conditions.kinematics import Kinematics
from skfem_contact.digits import COMPUTED
from skfem_contact.problem.seam import Resistance
from skfem_contact.problem.thresholds import DEPENDENT, GIVE, STIFFER


def spring_compliance(kin: Kinematics, slips: bool, softness: Array) -> Array:
    """Compliance of the spring of each point, along its normal and its tangents, (m,) [length/force].

    Parameters
    ----------
    kin : Kinematics
        With the columns of DOFs that can move.
    slips : bool
        Whether tangential rows are modelled.
    softness : ndarray, shape (n,)
        How far a unit force on each DOF moves it, by its own stiffness [length/force].
    """
    own, area = kin.B_n.multiply(kin.B_n) @ softness, np.asarray(kin.area, dtype=float)
    pattern = abs(kin.B_n)
    for B in _tangential(kin) if slips else ():
        pattern = pattern + abs(B)
        own = np.where(own > 0, own, B.multiply(B) @ softness)
    large = area > 0
    area = np.where(large, area, np.mean(area[large]) if large.any() else 1.0)
    count, group = connected_components(pattern @ pattern.T, directed=False)
    moves = own > 0
    weight = np.bincount(group[moves], (own * area)[moves], minlength=count)
    mean = weight / np.maximum(np.bincount(group[moves], minlength=count), 1)
    mean = np.where(mean > 0, mean, mean.max(initial=0.0) or 1.0)  # of rows that nothing moves
    return np.asarray(GIVE * mean[group] / area)


def _tangential(kin: Kinematics) -> list[csr_matrix]:
    """Rows of the slips along each tangent."""
    return [csr_matrix(kin.B_t[k :: kin.tangents]) for k in range(kin.tangents)]


def independent(rows: csr_matrix, softness: Array, size: Array | None = None) -> bool:
    """Return whether no row depends on others as far as DOFs show that move each by itself.

    Parameters
    ----------
    rows : csr_matrix, shape (r, n)
    softness : ndarray, shape (n,)
        Of the DOFs. Not above the true flexibility F, it proves it of ``B F B'``: no pivot of that is
        below that of ``B diag(softness) B'``.
    size : ndarray, shape (r,), optional
        What pivots are relative to; by default the diagonal of the latter [length/force].
    """
    Q = csr_matrix(rows @ diags(softness) @ rows.T)
    size = Q.diagonal() if size is None else size
    if not np.all(size > 0.0):
        return False
    scale = diags(1.0 / np.sqrt(size))
    order = {"permc_spec": "MMD_AT_PLUS_A", "options": {"SymmetricMode": True}}
    try:
        pivots = splu((scale @ Q @ scale).tocsc(), diag_pivot_thresh=0.0, **order).U.diagonal()
    except RuntimeError:  # exactly singular
        return False
    return bool(np.min(pivots, initial=1.0) >= DEPENDENT**2)


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


def point_resistance(kin: Kinematics, slips: bool, softness: Array) -> Resistance:
    """Resistance of each point by the stiffness of its DOFs, as if they were bodies of their own.

    K's diagonal knows nothing of what gives way around a node: a third of it is taken (`STIFFER`).

    Parameters
    ----------
    kin : Kinematics
    slips : bool
        Whether tangential rows are modelled.
    softness : ndarray, shape (n,)
        As of `spring_compliance`.
    """
    of_normals, of_tangents = (
        STIFFER * np.array([[A.multiply(B) @ softness for B in rows] for A in rows]).transpose(2, 0, 1)
        for rows in ([kin.B_n], (_tangential(kin) if slips else []) or [kin.B_n])
    )
    return _resistance(of_normals, of_tangents)


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


def _inverse(compliance: Array) -> Array:
    """One over it; what can not move at all resists like the stiffest of the others."""
    moves = compliance > 0
    if not moves.any():
        return np.ones_like(compliance)
    return 1.0 / np.where(moves, compliance, np.min(compliance[moves]))
