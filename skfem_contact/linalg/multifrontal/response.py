"""What forces on some DOFs move there, without the displacements of all others."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.blas import dtrsv

from skfem_contact.linalg.threads import single_threaded

if TYPE_CHECKING:
    from skfem_contact.linalg.multifrontal.factor import MultifrontalCholesky

Array = NDArray[np.float64]
Index = NDArray[np.intp]


class Response:
    """Displacements of some DOFs under forces on them.

    Only the fronts that eliminate these DOFs take part, and those above them: of a solid and one of
    its faces somewhat more than half of the factors. It is made for one vector at a time, for which
    BLAS has faster ways than for several.

    Parameters
    ----------
    factor : MultifrontalCholesky
    dofs : ndarray of int, shape (m,)

    Examples
    --------
    Three unit springs in a row, one end held; a unit force at the other:

    >>> import scipy.sparse as sp
    >>> from skfem_contact.linalg.multifrontal.factor import MultifrontalCholesky
    >>> K = sp.csr_array([[2.0, -1, 0], [-1, 2, -1], [0, -1, 1]])
    >>> factor = MultifrontalCholesky(K, np.arange(3.0)[:, None])
    >>> Response(factor, np.array([2]))(np.array([1.0])).round(12)
    array([3.])
    """

    def __init__(self, factor: MultifrontalCholesky, dofs: Index) -> None:
        fronts = factor.fronts
        self._factor, self._place = factor, fronts.position[dofs]
        self._n, self._kept = fronts.order.size, int(fronts.start[-2])
        taking_part = np.zeros(fronts.parent.size, dtype=bool)
        taking_part[np.searchsorted(fronts.start, self._place, side="right") - 1] = True
        for front, parent in enumerate(fronts.parent[:-1].tolist()):  # children come before parents
            if taking_part[front]:
                taking_part[parent] = True
        start = fronts.start.tolist()
        # without what is kept, which is the last one, and boxes that own nothing
        self._along = [
            (slice(start[f], start[f + 1]), *factor.panels[f], factor.borders[f])
            for f in np.flatnonzero(taking_part[:-1]).tolist()
            if start[f] < start[f + 1]
        ]

    def __call__(self, force: Array, flexibility: Array | None = None) -> Array:
        """Displacements (m,) under forces (m,).

        Parameters
        ----------
        force : ndarray, shape (m,)
        flexibility : ndarray, shape (nk, nk), optional
            ``(S + ...)^-1`` of what the factorisation keeps, with what holds it besides.
        """
        x = np.zeros(self._n)
        x[self._place] = force
        with single_threaded():
            for pivots, L11, L21, border in self._along:
                y = dtrsv(L11.T, x[pivots], lower=1)
                x[pivots] = y
                x[border] -= y @ L21
            if flexibility is not None:
                x[self._kept :] = flexibility @ x[self._kept :]
            for pivots, L11, L21, border in reversed(self._along):
                x[pivots] = dtrsv(L11.T, x[pivots] - L21 @ x[border], lower=1, trans=1)
        return np.asarray(x[self._place])
