r"""Wear: the depth that is worn off a surface, point by point.

Archard's law says that the volume worn off is ``k F s``, with the force F that presses and the way s
that it slides; at each point of a surface the depth grows by ``k p ds``. It opens the gap. In a load
step both are those of its end and its beginning (trapezoidal rule, as for the energy that friction
takes): where friction is Coulomb's the volume is ``k / mu`` times that energy, to round-off.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from skfem_contact.arguments import PrintedAsCall, numbers, take, with_known_keywords
from skfem_contact.errors import InputError
from skfem_contact.sealed import kept, sealed

Array = NDArray[np.float64]


@with_known_keywords(
    K="write k, the coefficient over the hardness, K / H",
    H="write k, the coefficient over the hardness, K / H",
    hardness="write k, the coefficient over the hardness, K / H",
)
@dataclass(frozen=True, eq=False, init=False)
class Archard(PrintedAsCall):
    """Archard's law of wear: the volume worn off is `k` times the force times the way that it slides.

    It is the secondary surface that wears. With small sliding nothing tells it from wear of the primary
    surface, or of both, whose `k` is the sum of theirs.

    Parameters
    ----------
    k : float or ndarray, shape (m,)
        Volume per force and way, Archard's coefficient over the hardness [area/force].

    Raises
    ------
    InputError
        If it is negative, infinite or NaN.

    Examples
    --------
    A force of 2 on a way of 10:

    >>> import numpy as np
    >>> import skfem_contact as sc
    >>> sc.Archard(1e-6).volume(np.array([2.0]), np.array([10.0]))
    array([2.e-05])
    """

    k: float | Array

    def __init__(self, k: ArrayLike) -> None:
        take(self, k=k)

    def __post_init__(self) -> None:
        usage = "give one number, or one per contact point: volume per force and way"
        k = numbers(self.k, "Archard: k", usage)
        if k.ndim > 1 or k.size == 0 or not (np.isfinite(k) & (k >= 0)).all():
            raise InputError(f"Archard: k = {self.k!r} has to be >= 0 and finite; {usage}.")
        own = sealed(k) if isinstance(self.k, list | tuple) else kept(self.k)
        object.__setattr__(self, "k", own)

    def volume(self, force: Array, way: Array) -> Array:
        """Volume worn off, shape (m,) [volume].

        Parameters
        ----------
        force : ndarray, shape (m,)
            That presses, not negative [force].
        way : ndarray, shape (m,)
            Length of the slip [length].
        """
        return np.asarray(self.k * force * way)
