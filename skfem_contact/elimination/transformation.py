r"""Elimination: from rows ``C u = b`` and prescribed DOFs to ``u = T u_r + c``.

With the columns split into pivots p (one per row) and the rest f,

    u_p = C_p^-1 (b - C_f u_f)

([M] eqs. 8-10, see `constraint`; there only the columns are combined, here the rows too: otherwise
symmetry and the load on the eliminated DOFs are lost).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import ArrayLike

from skfem_contact.arguments import known_keywords, shown
from skfem_contact.arrays import Mask
from skfem_contact.bodies.inputs import csr32
from skfem_contact.elimination.constraint import (
    AffineConstraint,
    checked_rows,
    dof_mask,
    finite_vector,
    prescribed,
)
from skfem_contact.elimination.pivoting import FloatArray, IntArray, find_pivots, row_maximum
from skfem_contact.elimination.thresholds import AGREEMENT, SHOWN
from skfem_contact.errors import ConstraintError, InputError

Labels = Sequence[str] | Callable[[int], str] | None


@known_keywords()
def eliminate(
    C: Any,
    b: ArrayLike,
    D: Any = None,
    x: ArrayLike | None = None,
    *,
    prefer: ArrayLike | None = None,
    labels: Labels = None,
    scale: float = 0.0,
) -> AffineConstraint:
    r"""Solve the rows ``C u = b`` together with ``u[D] = x[D]`` for as many DOFs as their rank.

    Parameters
    ----------
    C : sparse matrix or array, shape (k, n)
        Constraint rows.
    b : ndarray, shape (k,)
        Their right-hand sides.
    D : ndarray of int, mask (n,), DofsView or dict of DofsView, optional
        Prescribed DOFs.
    x : ndarray, shape (n,), optional
        Values of the prescribed DOFs, read only there; default zero.
    prefer : ndarray of bool, shape (n,), optional
        DOFs to be given up if possible, as a rule those of the secondary surface: where one has
        at least a tenth of the largest coefficient of its row. By default those that the fewest
        rows contain.
    labels : sequence of str, or callable from row number to str, optional
        Names of the rows for messages; default "row i".
    scale : float, optional
        A length from which `b` was computed, for instance the size of the model. Rows agree if
        they do to 1e-10 of the largest ``|b| + |C||x|``; where all of these are round-off of
        coordinates, it is `scale` that says so.

    Returns
    -------
    AffineConstraint

    Raises
    ------
    ConstraintError
        If rows contradict each other or the prescribed values; `rows` are their numbers.
    InputError
        If shapes do not fit, DOFs do not exist, or numbers are NaN or inf.

    Examples
    --------
    Node 0 rests on node 1, which rests on node 2; the last row says nothing new:

    >>> chain = eliminate([[1, -1, 0], [0, 1, -1], [1, 0, -1]], [0.1, 0.2, 0.3])
    >>> chain
    AffineConstraint(3 DOFs = 1 independent + 2 dependent + 0 prescribed, 1 of 3 rows redundant)
    >>> u = chain.expand([5.0])
    >>> np.round([u[0] - u[1], u[1] - u[2]], 12)
    array([0.1, 0.2])
    """
    C, b = checked_rows(C, b)
    k, n = C.shape
    D = prescribed(D, n)
    prefer = None if prefer is None else dof_mask(prefer, n)
    _check_labels_and_scale(labels, k, scale)
    u_D = np.zeros(n)
    if x is not None:
        u_D[D] = finite_vector("x", x, n, D)
    free = np.ones(n, dtype=bool)
    free[D] = False

    # rows scaled to a largest coefficient of one, without the prescribed columns
    size = row_maximum(C, np.abs(C.data))
    size[size == 0.0] = 1.0
    columns, A = _columns(C, free)
    A.data = A.data / np.repeat(size, np.diff(A.indptr))
    rhs = (b - C @ u_D) / size
    magnitude = (np.abs(b) + abs(C) @ np.abs(u_D)) / size

    pivots = find_pivots(A, None if prefer is None else prefer[columns])
    rows, inverse = pivots.rows, pivots.inverse
    redundant = np.setdiff1d(np.arange(k), rows)
    if len(redundant):
        combination = sp.csr_matrix(A[redundant][:, pivots.columns] @ inverse)
        excess = rhs[redundant] - combination @ rhs[rows]
        weight = 1.0 + np.asarray(abs(combination).sum(axis=1)).ravel()
        wrong = np.abs(excess) > AGREEMENT * weight * max(float(magnitude.max()), scale)
        if wrong.any():
            asked, row = b[redundant][wrong], redundant[wrong]
            made = asked - (excess * size[redundant])[wrong]
            raise _contradiction(row, asked, made, rows, combination[wrong], labels)

    dependent = columns[pivots.columns]
    u_D[dependent] = inverse @ rhs[rows]
    free[dependent] = False
    independent = np.flatnonzero(free)
    used, A_f = _columns(A[rows], free[columns])
    coefficients = -(inverse @ A_f)
    number = np.searchsorted(independent, columns[used])
    return AffineConstraint(
        T=_identity_and_rows(independent, dependent, coefficients, number, n),
        c=u_D,
        independent=independent,
        dependent=dependent,
        prescribed=D,
        rows_kept=rows,
        redundant=redundant,
        C=C,
        pivot_inverse=csr32(inverse @ sp.diags(1.0 / size[rows])),
    )


def _check_labels_and_scale(labels: Labels, k: int, scale: float) -> None:
    """Refuse what does not name each of k rows, and a scale that is no length."""
    if not 0.0 <= scale < np.inf:
        raise InputError(f"scale = {scale}, but it is a length: zero or positive.")
    listed = isinstance(labels, list | tuple) or (isinstance(labels, np.ndarray) and labels.ndim == 1)
    if callable(labels) or labels is None or (listed and len(labels) == k):
        return
    has = f"has {len(labels)} names" if listed else f"is {shown(labels)}"
    raise InputError(f"labels {has} for {k} rows: give one name for each of them.")


def _columns(A: sp.csr_matrix, mask: Mask) -> tuple[IntArray, sp.csr_matrix]:
    """Numbers of the nonempty columns under the mask, and the matrix with only these.

    So pivoting costs nothing for the DOFs that no row knows.
    """
    inside = mask[A.indices]
    touched = np.zeros(A.shape[1], dtype=bool)
    touched[A.indices[inside]] = True
    columns = np.flatnonzero(touched)
    number = np.empty(A.shape[1], dtype=np.int32)
    number[columns] = np.arange(len(columns))
    start = np.append(0, np.cumsum(inside))[A.indptr]
    entries = (A.data[inside], number[A.indices[inside]], start)
    return columns, sp.csr_matrix(entries, shape=(A.shape[0], len(columns)))


def _identity_and_rows(
    independent: IntArray,
    dependent: IntArray,
    coefficients: sp.csr_matrix,
    number: IntArray,
    n: int,
) -> sp.csr_matrix:
    """T from its parts: one on `independent`, `coefficients` on `dependent`, zero elsewhere.

    `number` says which independent DOF each column of `coefficients` is; ascending.
    """
    coefficients.eliminate_zeros()
    coefficients.sort_indices()
    count = np.diff(coefficients.indptr)
    length = np.zeros(n, dtype=np.int64)
    length[independent] = 1
    length[dependent] = count
    indptr = np.append(0, np.cumsum(length))
    indices = np.empty(indptr[-1], dtype=np.int32)
    data = np.ones(indptr[-1])
    indices[indptr[independent]] = np.arange(len(independent))
    at = np.repeat(indptr[dependent] - coefficients.indptr[:-1], count) + np.arange(count.sum())
    indices[at], data[at] = number[coefficients.indices], coefficients.data
    return csr32(sp.csr_matrix((data, indices, indptr), shape=(n, len(independent))))


def _contradiction(
    rows: IntArray,
    asked: FloatArray,
    made: FloatArray,
    kept: IntArray,
    combination: sp.csr_matrix,
    labels: Labels,
) -> ConstraintError:
    """The error for `rows` that ask for one value where their combination of others makes another.

    `combination` (rows, kept) holds how the rows follow from those kept.
    """

    def name(row: int) -> str:
        if labels is None:
            return f"row {row}"
        return labels(row) if callable(labels) else str(labels[row])

    involved, lines = [], []
    for i, row in enumerate(rows):
        part = combination[i]
        weight = np.abs(part.data)
        # what elimination left as round-off is no contribution
        others = np.sort(kept[part.indices[weight > AGREEMENT * weight.max(initial=0.0)]])
        involved += [row, *others]
        by = ", ".join(name(int(j)) for j in others[:SHOWN])
        by += f" and {len(others) - SHOWN} more" if len(others) > SHOWN else ""
        because = f"with {by} it is" if by else "its DOFs are all prescribed and make it"
        lines.append(f"{name(int(row))} asks for {asked[i]:.6g}, but {because} {made[i]:.6g}")
    more = f"; and {len(lines) - SHOWN} more" if len(lines) > SHOWN else ""
    return ConstraintError(
        f"Constraints contradict each other: {'; '.join(lines[:SHOWN])}{more}. Usually a node is"
        " constrained twice (two contacts, or a contact and D) with different gaps or values."
        " Drop one of them, or correct b or x; if the difference is round-off of coordinates, pass"
        " their size as scale.",
        dict.fromkeys(int(row) for row in involved),
    )
