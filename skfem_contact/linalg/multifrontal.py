"""Multifrontal Cholesky factorisation that leaves a Schur complement on chosen DOFs.

A body enters a contact problem through its contact DOFs alone. Eliminating the other DOFs from
the stiffness leaves ``S = K_kk - K_ki K_ii^-1 K_ik`` on the DOFs kept, and the elimination that
produces S is the one that a solution of the whole system needs anyhow.

The elimination follows the tree of a nested dissection. Every box of the tree gathers its
equations and what its children left over in a dense matrix, its front,

    [F11  F21']     F11: the DOFs eliminated here, the pivots,
    [F21  F22 ]     F22: DOFs further up the tree that they are coupled with, the border,

takes the factors ``L11 L11' = F11`` and ``L21 = F21 L11^-T`` and leaves ``F22 - L21 L21'`` to its
parent. So all arithmetic is dense and done by LAPACK [1]_.

The fronts are stored by columns, as LAPACK has them, and so appear transposed: ``F21`` below is
an array of shape (pivots, border).

References
----------
.. [1] J. W. H. Liu, The multifrontal method for sparse matrix solution: theory and practice,
   SIAM Review 34 (1992) 82-109.

`SurfaceResponse` tells what forces on some DOFs move there, without the displacements of all others.
"""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.blas import dgemm, dsyrk, dtrsm, dtrsv, strsv
from scipy.linalg.lapack import dpotrf

from skfem_contact.arrays import Array, Index
from skfem_contact.digits import SINGLE
from skfem_contact.errors import InputError
from skfem_contact.linalg.backend import (
    NEGLIGIBLE,
    BodyFactor,
    singular,
    smallest_eigenvalue,
)
from skfem_contact.linalg.dense_factors import ROWS_AT_ONCE, mirror, single_threaded
from skfem_contact.linalg.fronts import LEAF, Fronts, Pattern, checked_matrix


class MultifrontalCholesky(BodyFactor):
    r"""Factorise a stiffness up to the DOFs that are kept: :math:`K_{ii} = L L'`, and S.

    Parameters
    ----------
    K : sparse matrix, shape (n, n)
        Symmetric; positive definite on the DOFs that are not kept [force/length]. A floating body
        will do if the DOFs kept stop its rigid motions.
    points : ndarray, shape (n, d)
        Position of each DOF [length]. They guide the order of elimination; any will do.
    keep : array of int, shape (nk,)
        DOFs that are not eliminated, without repetition.
    free : ndarray of int, shape (n,), optional
        The rows and columns of `K` that are DOFs, ascending, if not all: as if the others were not
        there, but without a copy of `K`. DOFs are counted among these; `points` are theirs alone.
    leaf : int
        Size of the smallest boxes [DOFs].
    pattern : Pattern, optional
        That of `K`, where it is known from another matrix.

    Attributes
    ----------
    S : ndarray, shape (nk, nk)
        ``K_kk - K_ki K_ii^-1 K_ik`` in the order of `keep`, symmetric [force/length].
    keep : ndarray of int, shape (nk,)
        DOFs that are not eliminated.
    order : ndarray of int, shape (n,)
        The DOFs in the order of elimination, the kept ones last.
    pivot_ratio : float
        Smallest pivot divided by its diagonal entry of `K`; 1 where nothing is eliminated.
    memory : int
        What the factors take [bytes].
    fronts : Fronts
    panels : list of pairs of ndarray
        ``L11`` and ``L21`` of each front, transposed.
    borders : list of ndarray of int
        Positions of the border of each front.

    Raises
    ------
    SingularMatrix
        It knows where `K` is singular, or not positive definite.

    Notes
    -----
    Most fronts are too small to be shared: whoever makes it, or solves with it, does so
    ``with single_threaded``. Two BLAS threads have been seen to take 30 times as long.

    Examples
    --------
    Three unit springs in a row, both ends kept: one spring of 1/3 remains.

    >>> import numpy as np
    >>> import scipy.sparse as sp
    >>> K = sp.csr_array([[1.0, -1, 0, 0], [-1, 2, -1, 0], [0, -1, 2, -1], [0, 0, -1, 1]])
    >>> factor = MultifrontalCholesky(K, np.arange(4.0)[:, None], keep=[0, 3])
    >>> factor.S.round(12)
    array([[ 0.33333333, -0.33333333],
           [-0.33333333,  0.33333333]])
    >>> factor.recover(np.array([0.0, 3.0])).round(12)
    array([0., 1., 2., 3.])
    """

    def __init__(
        self,
        K: Any,
        points: np.ndarray,
        keep: Any = (),
        *,
        free: np.ndarray | None = None,
        leaf: int = LEAF,
        pattern: Pattern | None = None,
    ) -> None:
        K, points, self.keep = checked_matrix(K, points, keep, free)
        pattern = pattern or Pattern.of(K, points, self.keep, leaf, free)
        self.fronts = fronts = pattern.fronts
        self.order = fronts.order
        kept = self.keep if free is None else free[self.keep]
        self.S = K[kept][:, kept].toarray()
        self._data = pattern.gather(K)
        del pattern  # which is as large as K
        self.panels = panels(self._data, fronts)
        self.borders = [fronts.border[a:b] for a, b in pairwise(fronts.first.tolist())]
        diagonal = K.diagonal() if free is None else K.diagonal()[free]
        self._factorise(diagonal[fronts.order], points)
        if not self.pivot_ratio >= SINGLE:  # a NaN is found as well
            self._check_eigenvalue(diagonal, points)
        mirror(self.S.T)  # LAPACK has filled what is above the diagonal

    @property
    def memory(self) -> int:
        return self._data.nbytes + self.S.nbytes + self.fronts.nbytes

    def response(self, dofs: np.ndarray) -> SurfaceResponse:
        """Return what forces on some DOFs (m,) move there."""
        return SurfaceResponse(self, dofs)

    def solve(self, b: np.ndarray) -> np.ndarray:
        """``K^-1 b`` where nothing is kept; b of shape (n,) or (n, r) [force]."""
        if self.keep.size:
            raise InputError(
                f"solve needs a factorisation of all of K, but {self.keep.size} DOFs are kept: "
                "use reduce_load, S and recover."
            )
        return self.recover(np.zeros((0, *np.shape(b)[1:])), b)

    def eliminate(self, f: np.ndarray) -> np.ndarray:
        """The first half of `recover`, which is linear in the load: to be kept for many of them.

        Parameters
        ----------
        f : ndarray, shape (n,) or (n, r)
            Load [force].

        Returns
        -------
        ndarray, shape (n, r)
            In the order of elimination; its last rows are the reduced load.
        """
        f = np.asarray(f, dtype=float)
        x = f.reshape(len(f), math.prod(f.shape[1:]))[self.fronts.order]
        self._forward(x)
        return x

    def substitute(self, u_keep: np.ndarray, eliminated: np.ndarray) -> np.ndarray:
        """The second half of `recover`; overwrites `eliminated` with the displacements.

        Parameters
        ----------
        u_keep : ndarray, shape (nk, r)
            Displacement of the DOFs kept [length].
        eliminated : ndarray, shape (n, r)
            From `eliminate`, or a combination of such.

        Returns
        -------
        ndarray, shape (n, r)
            Displacements of the DOFs `order`.
        """
        eliminated[self.fronts.start[-2] :] = u_keep
        self._backward(eliminated)
        return eliminated

    def recover(self, u_keep: np.ndarray, f: np.ndarray | None = None) -> np.ndarray:
        """All displacements that belong to those of the DOFs kept: ``K_ii u_i = f_i - K_ik u_k``.

        Parameters
        ----------
        u_keep : ndarray, shape (nk,) or (nk, r)
            Displacement of the DOFs kept [length].
        f : ndarray, shape (n,) or (n, r), optional
            Load [force]; its entries on the DOFs kept do not matter. None: no load.

        Returns
        -------
        ndarray, shape (n,) or (n, r)
        """
        u_keep = np.asarray(u_keep, dtype=float)
        shape = (self.fronts.order.size, *u_keep.shape[1:])
        flat = u_keep.reshape(len(u_keep), math.prod(shape[1:]))
        with single_threaded:  # for those who solve with it by themselves
            x = np.zeros((shape[0], flat.shape[1])) if f is None else self.eliminate(f)
            u = np.empty_like(x)
            u[self.fronts.order] = self.substitute(flat, x)
        return u.reshape(shape)

    @np.errstate(all="ignore")  # the triangles that do not count hold whatever was in memory
    def _factorise(self, diagonal: np.ndarray, points: np.ndarray) -> None:
        fronts, panels = self.fronts, self.panels
        order, start, first = fronts.order, fronts.start.tolist(), fronts.first.tolist()
        parent, runs, leftovers = fronts.parent.tolist(), find_runs(fronts), Leftovers(fronts, self.S)
        for f in fronts.schedule[:-1]:  # what is kept is not eliminated
            F11, F21 = panels[f]
            p, b = F21.shape
            F22 = leftovers.of(f)
            if p:
                _, failed = dpotrf(F11.T, lower=1, clean=0, overwrite_a=1)
                if failed:
                    dof = order[start[f] + failed - 1]
                    raise singular(dof, 0.0, points[dof])
            if p and b:
                dtrsm(1.0, F11.T, F21.T, side=1, lower=1, trans_a=1, overwrite_b=1)
                dsyrk(-1.0, F21.T, beta=1.0, c=F22.T, lower=1, overwrite_c=1)
            if f < len(panels) - 1:  # what the last one leaves is added to S as it stands
                rows = fronts.target[first[f] : first[f + 1]]
                _extend_add((*panels[parent[f]], leftovers.of(parent[f])), F22, rows, runs[f])
                leftovers.give_back(f)
        pivots = np.concatenate([L11.diagonal() for L11, _ in self.panels])
        ratios = pivots**2 / diagonal[: pivots.size]
        self.pivot_ratio = float(np.min(ratios, initial=1.0))

    def _check_eigenvalue(self, diagonal: np.ndarray, points: np.ndarray) -> None:
        inside = self.order[: self.fronts.start[-2]]

        def solve(b: np.ndarray) -> np.ndarray:
            f = np.zeros(len(self.order))
            f[inside] = b
            return self.recover(np.zeros(self.keep.size), f)[inside]

        smallest, dof = smallest_eigenvalue(diagonal[inside], solve)
        if not smallest >= NEGLIGIBLE:
            raise singular(inside[dof], smallest, points[inside[dof]])

    def _forward(self, x: np.ndarray) -> None:
        """Eliminate: pivots become ``L11^-1 x``, borders lose ``L21`` times that. In place."""
        start = self.fronts.start.tolist()
        for f, (L11, L21) in enumerate(self.panels):
            y = x[start[f] : start[f + 1]]
            if np.count_nonzero(y):  # loads act on few of the fronts as a rule, and on those above them
                y[:] = dtrsm(1.0, L11.T, y.T, side=1, lower=1, trans_a=1, overwrite_b=1).T
                x[self.borders[f]] -= L21.T @ y

    def _backward(self, x: np.ndarray) -> None:
        """Substitute back: pivots become ``L11^-T (x - L21' x_border)``. In place."""
        start = self.fronts.start.tolist()
        for f in range(len(self.panels) - 1, -1, -1):
            L11, L21 = self.panels[f]
            y = x[start[f] : start[f + 1]]
            if y.size:
                border = x.take(self.borders[f], axis=0)
                less = dgemm(-1.0, border.T, L21.T, beta=1.0, c=y.T, overwrite_c=1)
                y[:] = dtrsm(1.0, L11.T, less, side=1, lower=1, overwrite_b=1).T


def panels(data: np.ndarray, fronts: Fronts) -> list[tuple[np.ndarray, np.ndarray]]:
    """Views of ``F11`` and ``F21``, transposed, in the storage of all factors."""
    begin = fronts.panel.tolist()
    sizes = zip(np.diff(fronts.start).tolist(), np.diff(fronts.first).tolist(), strict=True)
    return [
        (data[o : o + p * p].reshape(p, p), data[o + p * p : o + p * (p + b)].reshape(p, b))
        for o, (p, b) in zip(begin[:-2], sizes, strict=False)  # without what is kept
    ]


def find_runs(fronts: Fronts) -> list[list[tuple[int, int, int]]]:
    """For each front, where its border is consecutive in the parent: runs of the border and their rows.

    A run ``(a, b, i)`` is the border from a to b, which are the rows from i on in the parent: all of
    them pivots there, or none.
    """
    size, pivots = np.diff(fronts.first), np.diff(fronts.start)
    begins = np.ones(fronts.target.size, dtype=bool)
    begins[1:] = np.diff(fronts.target) != 1
    begins[fronts.first[:-1][size > 0]] = True
    begins |= fronts.target == np.repeat(np.append(pivots, 0)[fronts.parent], size)
    cuts = np.append(np.flatnonzero(begins), fronts.target.size)
    bounds = np.searchsorted(cuts, fronts.first)
    begin, end, row = cuts[:-1], cuts[1:], fronts.target[cuts[:-1]]
    offset = np.repeat(fronts.first[:-1], np.diff(bounds))
    local = (begin - offset).tolist(), (end - offset).tolist(), row.tolist()
    runs = list(zip(*local, strict=True))
    return [runs[a:b] for a, b in pairwise(bounds.tolist())]


class Leftovers:
    """Memory of what fronts leave to their parents: one array for all, filled from both ends.

    A front has its square from the time when the first of its children is done, and each child adds to
    it at once: so those that are there at a time, and their parents, are on one way to the top. Those
    of even depth take from the beginning of the array, those of odd depth from its end, and the last
    one taken at either end is given back first. Memory is touched for the first time once, not in every
    front: that took as long as the additions. What the top of the tree leaves is S.
    """

    def __init__(self, fronts: Fronts, S: np.ndarray) -> None:
        self._sizes = np.diff(fronts.first).tolist()
        # whether the way from each front to the last one has an odd number of steps
        self._odd = [False] * fronts.parent.size
        for front in range(fronts.parent.size - 2, -1, -1):
            self._odd[front] = not self._odd[fronts.parent[front]]
        self._memory = np.empty(fronts.waiting)
        self._used = [0, 0]  # entries at either end
        self._taken = {fronts.parent.size - 2: S}

    def of(self, front: int) -> np.ndarray:
        """The square for the border of a front, of zeros at first."""
        known = self._taken.get(front)
        if known is not None:
            return known
        b, odd = self._sizes[front], self._odd[front]
        begin = self._used[odd] if not odd else self._memory.size - self._used[odd] - b * b
        self._used[odd] += b * b
        new = self._taken[front] = self._memory[begin : begin + b * b].reshape(b, b)
        for row in range(0, b, ROWS_AT_ONCE):  # half of it: to touch memory at first takes long
            new[row : row + ROWS_AT_ONCE, row:] = 0.0
        return new

    def give_back(self, front: int) -> None:
        """Return what a front took is free again."""
        del self._taken[front]
        self._used[self._odd[front]] -= self._sizes[front] ** 2


def _extend_add(
    parent: tuple[np.ndarray, np.ndarray, np.ndarray],
    C: np.ndarray,
    rows: np.ndarray,
    runs: list[tuple[int, int, int]],
) -> None:
    """Add what a child left over; only the lower triangles count (here: upper, transposed)."""
    F11, F21, F22 = parent
    p = len(F11)
    if 6 * (len(runs) + 1) > len(rows):  # scattered: one by one
        k = int(rows.searchsorted(p))
        near, far = rows[:k], rows[k:] - p
        F11[near[:, None], near] += C[:k, :k]
        F21[near[:, None], far] += C[:k, k:]
        F22[far[:, None], far] += C[k:, k:]
        return
    pivots = [run for run in runs if run[2] < p]
    border = [(a, b, i - p) for a, b, i in runs[len(pivots) :]]
    for number, (a, b, i) in enumerate(pivots):
        for c, d, j in pivots[number:]:
            F11[i : i + b - a, j : j + d - c] += C[a:b, c:d]
        for c, d, j in border:
            F21[i : i + b - a, j : j + d - c] += C[a:b, c:d]
    for number, (a, b, i) in enumerate(border):
        for c, d, j in border[number:]:
            F22[i : i + b - a, j : j + d - c] += C[a:b, c:d]


class SurfaceResponse:
    """Displacements of some DOFs under forces on them.

    Only the fronts that eliminate these DOFs take part, and those above them: of a solid and one of
    its faces somewhat more than half of the factors. It is made for one vector at a time, for which
    BLAS has faster ways than for several; it takes as long as they take to be read.

    Parameters
    ----------
    factor : MultifrontalCholesky
    dofs : ndarray of int, shape (m,)
    single : bool
        Whether it has its own factors in single precision, which preconditioners are content with.

    Examples
    --------
    Three unit springs in a row, one end held; a unit force at the other:

    >>> import scipy.sparse as sp
    >>> from skfem_contact.linalg.multifrontal import MultifrontalCholesky
    >>> K = sp.csr_array([[2.0, -1, 0], [-1, 2, -1], [0, -1, 1]])
    >>> factor = MultifrontalCholesky(K, np.arange(3.0)[:, None])
    >>> SurfaceResponse(factor, np.array([2]))(np.array([1.0])).round(12)
    array([3.])
    """

    def __init__(self, factor: MultifrontalCholesky, dofs: Index, single: bool = False) -> None:
        fronts = factor.fronts
        self._place = fronts.position[dofs]
        self._kind, self._substituted = (np.float32, strsv) if single else (np.float64, dtrsv)
        self._n, self._kept = fronts.order.size, int(fronts.start[-2])
        taking_part = np.zeros(fronts.parent.size, dtype=bool)
        taking_part[np.searchsorted(fronts.start, self._place, side="right") - 1] = True
        for front, parent in enumerate(fronts.parent[:-1].tolist()):  # children come before parents
            if taking_part[front]:
                taking_part[parent] = True
        start = fronts.start.tolist()
        # without what is kept, which is the last one, and boxes that own nothing
        self._along = [
            (slice(start[f], start[f + 1]), *map(self._read, factor.panels[f]), factor.borders[f])
            for f in np.flatnonzero(taking_part[:-1]).tolist()
            if start[f] < start[f + 1]
        ]

    @np.errstate(over="ignore", invalid="ignore")  # the triangles that do not count hold anything
    def _read(self, panel: Array) -> NDArray[Any]:
        return panel.astype(self._kind, copy=False)

    def __call__(self, force: Array, flexibility: Array | None = None) -> Array:
        """Displacements (m,) under forces (m,).

        Parameters
        ----------
        force : ndarray, shape (m,)
        flexibility : ndarray, shape (nk, nk), optional
            ``(S + ...)^-1`` of what the factorisation keeps, with what holds it besides.
        """
        x = np.zeros(self._n, self._kind)
        x[self._place] = force
        substituted = self._substituted
        with single_threaded:
            for pivots, L11, L21, border in self._along:
                y = substituted(L11.T, x[pivots], lower=1)
                x[pivots] = y
                x[border] -= y @ L21
            if flexibility is not None:
                x[self._kept :] = flexibility @ x[self._kept :]
            for pivots, L11, L21, border in reversed(self._along):
                x[pivots] = substituted(L11.T, x[pivots] - L21 @ x[border], lower=1, trans=1)
        return np.asarray(x[self._place], dtype=float)
