"""How large a factorisation will be, from the pattern of the matrix alone."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from skfem_contact.linalg.multifrontal.assembly import checked_matrix
from skfem_contact.linalg.multifrontal.fronts import analyse
from skfem_contact.linalg.thresholds import LEAF


@dataclass(frozen=True)
class FactorSize:
    """Size of a factorisation, known before it is computed.

    Attributes
    ----------
    n, kept, fronts, largest : int
        DOFs in all and kept; number of fronts; order of the largest one.
    memory, peak : int
        What the factors and S take, and what is needed at most meanwhile [bytes].
    flops : float
        Multiplications and additions.
    """

    n: int
    kept: int
    fronts: int
    largest: int
    memory: int
    peak: int
    flops: float


def factor_size(
    K: Any, points: np.ndarray, keep: Any = (), *, free: np.ndarray | None = None, leaf: int = LEAF
) -> FactorSize:
    """Size of ``MultifrontalCholesky(K, points, keep, free=free)``, at a fraction of its cost.

    Examples
    --------
    >>> import numpy as np
    >>> import scipy.sparse as sp
    >>> K = sp.diags_array([-np.ones(6), np.full(7, 2.0), -np.ones(6)], offsets=[-1, 0, 1])
    >>> size = factor_size(K, np.arange(7.0)[:, None], keep=[0], leaf=1)
    >>> size.n, size.kept, size.fronts, size.largest
    (7, 1, 7, 3)
    """
    fronts = analyse(*checked_matrix(K, points, keep, free), leaf, free)
    sizes = np.diff(fronts.start) + np.diff(fronts.first)
    kept = int(fronts.start[-1] - fronts.start[-2])
    return FactorSize(
        n=fronts.order.size,
        kept=kept,
        fronts=sizes.size,
        largest=int(sizes.max()),
        memory=8 * int(fronts.panel[-1]) + fronts.nbytes,
        peak=fronts.peak,
        flops=fronts.flops,
    )
