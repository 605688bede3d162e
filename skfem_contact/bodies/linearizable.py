"""`Linearizable`: what a load step asks of a body, whether it is linear or not."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix


class Linearizable(Protocol):
    r"""A body as the contact problem sees it: linear equations near a state.

    With the internal forces ``f_int(u)``, their derivative ``K(u)`` and the load ``f_ext``,

        ``K(u) v = f``,       ``f = f_ext - f_int(u) + K(u) u``.

    A linear body answers the same whatever u is, so it is asked once. A body that is not linear is
    asked at every iterate, by a loop around the load step.
    """

    def linearize(self, u: NDArray[np.float64] | None = None) -> tuple[csr_matrix, NDArray[np.float64]]:
        """Stiffness and load near a state.

        Parameters
        ----------
        u : ndarray, shape (n,), optional
            Displacements; the undeformed state if not given [length].

        Returns
        -------
        K : csr_matrix, shape (n, n)
            Symmetric [force/length].
        f : ndarray, shape (n,)
            [force]
        """
        ...
