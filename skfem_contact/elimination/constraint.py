r"""Affine constraints ``u = T u_r + c``: from rows, to reduce, to expand, to recover forces.

Rows ``C u = b`` and prescribed DOFs ``u[D] = x[D]`` are merged (`eliminate`) into one map from the
remaining, *independent* DOFs to all DOFs; it condenses a linear system to

    K_r = T' K T,     f_r = T' (f - K c)

([M] eqs. 8-10). With the columns split into pivots p (one per row) and the rest f,

    u_p = C_p^-1 (b - C_f u_f) .

(There only the columns are combined, here the rows too: otherwise symmetry and the load on the
eliminated DOFs are lost.) No penalty and no multiplier enters the system; the forces of the
constraints are recovered from the rows that were eliminated.

For `skfem.solve` a system is condensed by rows, as scikit-fem takes it (`condense`); the rows of
contacts, for scripts that solve for themselves, are made by `contact_rows`.

References
----------
[M] V. L. Marchenko, *Solving contact problems by the finite element method at considerable slip
and friction forces* (in Ukrainian), Khmelnytskyi National University, 2014.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import csr_matrix, vstack

from skfem_contact.arguments import NAMED, check_kind, known_keywords, members, numbers, shown
from skfem_contact.arrays import (
    Array,
    Mask,
    check_finite,
    check_size,
    check_type,
    dof_numbers,
    rectangular,
)
from skfem_contact.bodies.inputs import csr32
from skfem_contact.bodies.system import System
from skfem_contact.conditions.contact import Contact
from skfem_contact.conditions.discretisation import pair
from skfem_contact.conditions.geometry import secondary_dofs
from skfem_contact.conditions.interface import point_labels
from skfem_contact.conditions.kinematics import join, kinematics
from skfem_contact.digits import SOLVED
from skfem_contact.elimination.pivoting import AGREEMENT, FloatArray, IntArray, find_pivots, row_maximum
from skfem_contact.errors import ConstraintError, InputError
from skfem_contact.records import dataclass

Labels = Sequence[str] | Callable[[int], str] | None

# Attributes of rows that `condense` passes to `eliminate`.
OPTIONS = ("prefer", "labels", "scale")


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
    independent: IntArray, dependent: IntArray, coefficients: sp.csr_matrix, number: IntArray, n: int
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
        by = ", ".join(name(int(j)) for j in others[:NAMED])
        by += f" and {len(others) - NAMED} more" if len(others) > NAMED else ""
        because = f"with {by} it is" if by else "its DOFs are all prescribed and make it"
        lines.append(f"{name(int(row))} asks for {asked[i]:.6g}, but {because} {made[i]:.6g}")
    more = f"; and {len(lines) - NAMED} more" if len(lines) > NAMED else ""
    return ConstraintError(
        f"Constraints contradict each other: {'; '.join(lines[:NAMED])}{more}. Usually a node is"
        " constrained twice (two contacts, or a contact and D) with different gaps or values."
        " Drop one of them, or correct b or x; if the difference is round-off of coordinates, pass"
        " their size as scale.",
        dict.fromkeys(int(row) for row in involved),
    )


@dataclass(frozen=True, eq=False, repr=False)
class AffineConstraint:
    """All vectors that satisfy a set of constraints, as ``u = T u_r + c``.

    Made by `eliminate`. It holds for linear equality constraints only: which contact points are
    closed has been decided before.

    Attributes
    ----------
    T : csr_matrix, shape (n, n_r)
        The identity on `independent`, zero on `prescribed`.
    c : ndarray, shape (n,)
        One vector that satisfies the constraints: zero on `independent`, ``x`` on `prescribed`.
    independent : ndarray, shape (n_r,)
        DOFs kept, ascending.
    dependent : ndarray, shape (r,)
        DOFs given up, one for each of `rows_kept`.
    prescribed : ndarray, shape (n_D,)
        Prescribed DOFs, ascending.
    rows_kept, redundant : ndarray
        Row numbers, ascending: the independent rows, and those that follow from them.
    C : csr_matrix, shape (k, n)
        The rows as given.
    pivot_inverse : csr_matrix, shape (r, r)
        Inverse of ``C[rows_kept][:, dependent]``.

    Examples
    --------
    >>> import skfem as fem
    >>> import skfem_contact as sc
    >>> from skfem.models.elasticity import linear_elasticity
    >>> def square(y, **settings):
    ...     mesh = fem.MeshQuad().refined(1).translated((0, y)).with_defaults()
    ...     basis = fem.Basis(mesh, fem.ElementVector(fem.ElementQuad1()), intorder=2)
    ...     return sc.Body(basis, linear_elasticity(), **settings)
    >>> low = square(0, D="bottom", name="low")
    >>> high = square(1, D="top", x={"top": (0, 0.01)}, name="high")
    >>> system = sc.bodies.stack([low, high])
    >>> glued = sc.Contact(high.surface("bottom"), low.surface("top"), tied=True)
    >>> rows = sc.elimination.contact_rows(system, glued)
    >>> constraint = sc.elimination.eliminate(rows.C, rows.b, D=system.D, x=system.x)
    >>> K, f = constraint.reduce(system.K, system.f)
    >>> u = constraint.expand(fem.solve(K, f))
    >>> K.shape, u.shape  # all 36 DOFs, less 12 that are prescribed and 6 that are glued
    ((18, 18), (36,))
    """

    T: sp.csr_matrix
    c: FloatArray
    independent: IntArray
    dependent: IntArray
    prescribed: IntArray
    rows_kept: IntArray
    redundant: IntArray
    C: sp.csr_matrix
    pivot_inverse: sp.csr_matrix

    def __repr__(self) -> str:
        return (
            f"AffineConstraint({len(self.c)} DOFs = {len(self.independent)} independent"
            f" + {len(self.dependent)} dependent + {len(self.prescribed)} prescribed,"
            f" {len(self.redundant)} of {self.C.shape[0]} rows redundant)"
        )

    def reduce(
        self, K: Any, f: ArrayLike | None = None, test: AffineConstraint | None = None
    ) -> tuple[sp.csr_matrix, NDArray[Any]]:
        r"""Condense a linear system: ``K_r = V' K T``, ``f_r = V' (f - K c)``.

        Parameters
        ----------
        K : sparse matrix, shape (n, n)
            Stiffness of all bodies [force/length].
        f : ndarray, shape (n,), optional
            Load [force]; default zero.
        test : AffineConstraint, optional
            The constraint whose ``T`` is V; default this one. Where the forces of the constraints
            do not act along the rows themselves (friction proportional to the normal force), V
            spans the null space of the rows along which they act. Its independent DOFs need not
            be those of T, only as many.

        Returns
        -------
        K_r : csr_matrix, shape (n_r, n_r)
            Symmetric to round-off where `K` is and V = T.
        f_r : ndarray, shape (n_r,)

        Raises
        ------
        InputError
            If the shapes do not fit, or `f` has NaN or inf.

        Examples
        --------
        Three springs in a row, the middle DOF tied to the mean of its neighbours:

        >>> from skfem_contact.elimination.constraint import eliminate
        >>> K = sp.csr_matrix([[2.0, -1.0, 0.0], [-1.0, 2.0, -1.0], [0.0, -1.0, 1.0]])
        >>> tie = eliminate([[-0.5, 1.0, -0.5]], [0.0])
        >>> K_r, f_r = tie.reduce(K, [0.0, 0.0, 1.0])
        >>> K_r.toarray()
        array([[ 1.5, -0.5], [-0.5,  0.5]])
        >>> u = tie.expand(np.linalg.solve(K_r.toarray(), f_r))
        >>> u
        array([1., 2., 3.])

        Every spring is stretched by 1 and carries the load of 1, and the tie carries nothing:

        >>> tie.multipliers(K @ u - [0.0, 0.0, 1.0])
        array([0.])
        """
        V = self if test is None else test
        n = len(self.c)
        K = sp.csr_matrix(K)
        if K.shape != (n, n):
            raise InputError(f"K has shape {K.shape}, but the constraint is for n = {n} DOFs.")
        if V.T.shape != self.T.shape:
            raise InputError(
                f"The test constraint maps {V.T.shape[1]} independent to {len(V.c)} DOFs, the"
                f" trial one {self.T.shape[1]} to {n}: the system would not be square. Usually a"
                " row is redundant in one and not in the other; pass both the same rows and D."
            )
        f = np.zeros(n) if f is None else finite_vector("f", f, n)
        Vt = V.T.T.tocsr()
        return csr32(Vt @ (K @ self.T)), Vt @ (f - K @ self.c)

    def expand(self, u_r: ArrayLike) -> NDArray[Any]:
        """All DOFs from the independent ones: ``u = T u_r + c``, shape (n,)."""
        u: NDArray[Any] = self.T @ finite_vector("u_r", u_r, self.T.shape[1]) + self.c
        return u

    def multipliers(self, r: ArrayLike) -> NDArray[Any]:
        r"""Forces of the rows from the residual: the p with ``C' p = r`` off the prescribed DOFs.

        Parameters
        ----------
        r : ndarray, shape (n,)
            ``K u - f`` [force], for a u in equilibrium (``T' r = 0``): then ``K u = f + C' p``.

        Returns
        -------
        p : ndarray, shape (k,)
            Force of each row as given [force, for rows without unit]; 0 for redundant rows, whose
            share the rows they follow from carry.

        Notes
        -----
        Only the residual at the pivots is used, with all rows coupled there solved together:
        ``C_p' p = r_p``.
        """
        r = finite_vector("r", r, len(self.c))
        p = np.zeros(self.C.shape[0], dtype=np.result_type(r, np.float64))
        p[self.rows_kept] = self.pivot_inverse.T @ r[self.dependent]
        return p

    def reactions(self, r: ArrayLike, p: ArrayLike) -> NDArray[Any]:
        """Forces that hold the prescribed DOFs, ``r - C' p`` there; shape (n_D,), as `prescribed`.

        What the rows themselves put on a prescribed DOF is not part of its reaction.
        """
        force = finite_vector("r", r, len(self.c)) - self.C.T @ finite_vector("p", p, self.C.shape[0])
        held: NDArray[Any] = force[self.prescribed]
        return held


NO_ARRAY = "which is no array: its parts differ."


def checked_rows(C: Any, b: ArrayLike) -> tuple[sp.csr_matrix, FloatArray]:
    """Constraint rows in memory of their own, without duplicate entries and explicit zeros."""
    C = sparse_matrix("C", C)
    if np.iscomplexobj(C.data):
        raise InputError("C is complex; constraint rows have to be real.")
    C = csr32(C.astype(np.float64))  # copies
    C.sum_duplicates()
    C.eliminate_zeros()
    check_finite(C.data, "C", "row", np.repeat(np.arange(C.shape[0]), np.diff(C.indptr)))
    b = finite_vector("b", b, C.shape[0])
    if np.iscomplexobj(b):
        raise InputError("b is complex; constraint rows have to be real.")
    return C, b.astype(np.float64)


def sparse_matrix(name: str, value: Any) -> sp.csr_matrix:
    try:
        matrix = sp.csr_matrix(value)
        if matrix.dtype.kind in "fiubc":
            return matrix
    except (TypeError, ValueError, IndexError, AttributeError):
        pass
    raise InputError(f"{name} is {shown(value)}; give a sparse matrix or an array of numbers")


def finite_vector(name: str, v: ArrayLike, n: int, at: IntArray | None = None) -> NDArray[Any]:
    """The vector `v` of shape (n,), or its entries `at`; finite, not copied."""
    array = rectangular(v, name, NO_ARRAY)
    check_size(array, n, name, f"but ({n},) is needed.")
    check_type(array, name, "but numbers are needed.", "fiubc")
    array = array if at is None else array[at]
    check_finite(array, name, number=at)
    return array


def dof_mask(prefer: ArrayLike, n: int) -> Mask:
    mask = rectangular(prefer, "prefer", NO_ARRAY)
    if mask.shape != (n,) or mask.dtype != bool:
        raise InputError(
            f"prefer has shape {mask.shape} and type {mask.dtype}; give a mask, one bool for each"
            f" of the {n} DOFs."
        )
    return mask


def prescribed(D: Any, n: int, name: str = "D") -> IntArray:
    """Sorted DOF numbers of what scikit-fem calls D (or I): array, DofsView or dict of them."""
    if D is None:
        return np.arange(0)
    dofs = np.arange(0)
    for part in D.values() if isinstance(D, dict) else (D,):
        numbers = rectangular(part.flatten() if hasattr(part, "flatten") else part, name, NO_ARRAY)
        dofs = np.union1d(dofs, dof_numbers(numbers.ravel(), n, name))
    return dofs


@known_keywords(K="write A", f="write b")
def condense(
    A: Any,
    b: Any = None,
    x: ArrayLike | None = None,
    I: Any = None,
    D: Any = None,
    expand: bool = True,
    *,
    rows: Any = None,
) -> tuple[Any, ...]:
    r"""Condense a system by constraint rows into what ``skfem.solve`` takes.

    `skfem.condense` with one argument more, `rows`.

    Parameters
    ----------
    A : sparse matrix, shape (n, n)
        Stiffness [force/length].
    b : ndarray, shape (n,), or sparse matrix, shape (n, n), optional
        Load [force], default zero; or the mass matrix of an eigenproblem.
    x : ndarray, shape (n,), optional
        Values of the prescribed DOFs, default zero.
    I : ndarray of int, DofsView or dict of DofsView, optional
        The DOFs that are not prescribed, in place of `D`.
    D : ndarray of int, DofsView or dict of DofsView, optional
        Prescribed DOFs.
    expand : bool
        Whether to return what the solution is expanded by, too.
    rows : object with attributes `C` and `b`, or tuple (C, b), optional
        Constraint rows; its attributes `labels`, `prefer` and `scale` are passed to `eliminate`
        where it has them.

    Returns
    -------
    tuple
        ``(T'AT, T'(b - Ac), zeros(n), (arange(n), lambda z: T @ z + c))``, for a mass matrix M
        ``(T'AT, T'MT, zeros(n), (arange(n), lambda z: T @ z))``; without `expand` the first two.

    Notes
    -----
    ``solver_iter_pcg()`` at its default tolerance leaves an error of 1e-6 or so; pass `rtol`.

    Examples
    --------
    >>> from skfem import solve
    >>> K = sp.csr_matrix([[2.0, -1.0, 0.0], [-1.0, 2.0, -1.0], [0.0, -1.0, 1.0]])
    >>> solve(*condense(K, np.array([0.0, 0.0, 1.0]), rows=([[-0.5, 1.0, -0.5]], [0.0])))
    array([1., 2., 3.])
    """
    A = sparse_matrix("A", A)
    n = A.shape[0]
    if not np.isfinite(A.data).all():
        raise InputError("A has NaN or inf entries. Check the form it is assembled from.")
    if hasattr(x, "C") and hasattr(x, "b"):
        raise InputError("x is rows of constraints; x are prescribed values: write rows=...")
    if I is not None:
        if D is not None:
            raise InputError("I and D are both given; give the DOFs to keep, or those prescribed")
        D = np.setdiff1d(np.arange(n), prescribed(I, n, "I"))
    C, c, options = _rows(rows, n)
    constraint = eliminate(C, c, D, x, **options)
    is_mass: bool = sp.issparse(b)
    if is_mass:
        M = sp.csr_matrix(b)
        if not np.isfinite(M.data).all():
            raise InputError("The mass matrix has NaN or inf entries.")
        A_r, b_r = constraint.reduce(A)[0], constraint.reduce(M)[0]
    else:
        A_r, b_r = constraint.reduce(A, b)
    zeros = np.zeros(n, dtype=np.result_type(A_r, b_r, float))
    expansion = _Modes(constraint.T, zeros.dtype) if is_mass else constraint.expand
    return (A_r, b_r, zeros, (np.arange(n), expansion)) if expand else (A_r, b_r)


def _rows(rows: Any, n: int) -> tuple[Any, Any, dict[str, Any]]:
    """The matrix, the right-hand side and what else is known of the constraint rows."""
    rows = (sp.csr_matrix((0, n)), np.zeros(0)) if rows is None else rows
    if not (isinstance(rows, tuple) and len(rows) == 2) and not (
        hasattr(rows, "C") and hasattr(rows, "b")
    ):
        raise InputError(f"rows is {shown(rows)}; give contact_rows(...), or a pair (C, b)")
    C, b = rows if isinstance(rows, tuple) else (rows.C, rows.b)
    return C, b, {name: getattr(rows, name) for name in OPTIONS if hasattr(rows, name)}


@dataclass(frozen=True, eq=False)
class _Modes:
    """``T @ z``, real for a real problem: ARPACK's `eigs` gives real modes as complex numbers."""

    T: sp.csr_matrix
    dtype: Any

    def __call__(self, z: NDArray[Any]) -> NDArray[Any]:
        mode: NDArray[Any] = self.T @ z
        if np.iscomplexobj(mode) and not np.issubdtype(self.dtype, np.complexfloating):
            if np.abs(mode.imag).max() > SOLVED * np.abs(mode).max():
                raise InputError(
                    "An eigenmode of a real system came out complex. If K and M are symmetric (a"
                    " multiple eigenvalue, split by round-off), pass"
                    " solver=solver_eigen_scipy_sym(); otherwise pass K as a complex matrix."
                )
            return mode.real
        return mode


@dataclass(frozen=True, eq=False)
class ConstraintRows:
    """Rows ``C u = b`` with the names of their points; what `condense` takes.

    Attributes
    ----------
    C : csr_matrix, shape (k, n)
    b : ndarray, shape (k,)
    prefer : ndarray of bool, shape (n,)
        DOFs of the secondary surfaces: the first choice as pivots.
    labels : tuple of str
    scale : float
        Size of the bodies: gaps below its round-off are zero [length].

    Examples
    --------
    >>> import skfem as fem
    >>> import skfem_contact as sc
    >>> from skfem.models.elasticity import linear_elasticity
    >>> def square(y, **settings):
    ...     mesh = fem.MeshQuad().refined(1).translated((0, y)).with_defaults()
    ...     basis = fem.Basis(mesh, fem.ElementVector(fem.ElementQuad1()), intorder=2)
    ...     return sc.Body(basis, linear_elasticity(), **settings)
    >>> low = square(0, D="bottom", name="low")
    >>> high = square(1, D="top", x={"top": (0, 0.01)}, name="high")
    >>> glued = sc.Contact(high.surface("bottom"), low.surface("top"), tied=True)
    >>> rows = sc.elimination.contact_rows(sc.bodies.stack([low, high]), glued)
    >>> rows.C.shape  # gap and slip of three points, and all 36 DOFs
    (6, 36)
    """

    C: csr_matrix
    b: Array
    prefer: Mask
    labels: tuple[str, ...]
    scale: float = 0.0


@known_keywords()
def contact_rows(
    system: System, contacts: Sequence[Contact] | Contact, closed: ArrayLike | None = None
) -> ConstraintRows:
    """The rows that hold the closed points together, for use without a contact solver.

    Parameters
    ----------
    system : System
        From `stack`.
    contacts : sequence of Contact
        A tied contact gives a row per component, any other its normal rows.
    closed : ndarray of bool, shape (m,), optional
        Points to hold, over all contacts; by default all that have a partner.

    Returns
    -------
    ConstraintRows
        For `condense`: ``skfem.solve(*condense(system.K, system.f, rows=rows, D=system.D))``.

    Examples
    --------
    Two unit squares, one upon the other and glued, pulled at the top:

    >>> import numpy as np
    >>> import skfem as fem
    >>> import skfem_contact as sc
    >>> from skfem.models.elasticity import linear_elasticity
    >>> e = fem.ElementVector(fem.ElementQuad1())
    >>> low = fem.MeshQuad().refined(1).with_defaults()
    >>> top = fem.MeshQuad().refined(2).translated((0, 1)).with_defaults()
    >>> a = sc.Body(fem.Basis(low, e), linear_elasticity(0, 0.5), D="bottom")
    >>> basis = fem.Basis(top, e)
    >>> up = basis.project(lambda x: np.stack([0 * x[0], 0.1 + 0 * x[0]]))
    >>> b = sc.Body(basis, linear_elasticity(0, 0.5), D="top", x=up)
    >>> system = sc.bodies.stack([a, b])
    >>> tie = sc.Contact(b.surface("bottom"), a.surface("top"), tied=True)
    >>> rows = sc.elimination.contact_rows(system, tie)
    >>> u = fem.solve(*sc.elimination.condense(system.K, system.f, rows=rows, D=system.D, x=system.x))
    >>> bool(abs(u[a.surface("top").dofs[:, 1]] - 0.05).max() < 1e-12)
    True
    """
    check_kind(system, System, "system", "make it by stack(bodies)")
    contacts = members(contacts, Contact, "contacts", "make each by Contact(surface, other, ...)")
    parts = [kinematics(system, contact, pair(contact)) for contact in contacts]
    kin = join(parts)
    held = kin.paired
    if closed is not None:
        usage = f"give one bool for each of the {kin.m} points"
        mask = closed
        if not (isinstance(mask, np.ndarray) and mask.dtype == bool):
            mask = numbers(mask, "closed", usage)
        if mask.shape != (kin.m,):
            raise InputError(f"closed has shape {mask.shape}; {usage}.")
        held = held & (mask != 0)
    glued = held & kin.tied
    tangential = np.repeat(glued, kin.tangents)
    rows = [kin.B_n[held], *([kin.B_t[tangential]] if glued.any() else [])]
    names = np.concatenate([point_labels(c, p.m) for c, p in zip(contacts, parts, strict=True)])
    return ConstraintRows(
        C=csr_matrix(vstack(rows)),
        b=np.concatenate([-kin.gap0[held], np.zeros(tangential.sum())]),
        prefer=secondary_dofs(system, contacts),
        labels=(*names[held], *np.repeat(names, kin.tangents)[tangential]),
        scale=system.extent,
    )
