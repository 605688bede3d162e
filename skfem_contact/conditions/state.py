"""`State`: what friction remembers from one load step to the next, and the status of contact points."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

OPEN, STICK, SLIP = 0, 1, 2
STATUS = ("open", "stick", "slip")


@dataclass(frozen=True, eq=False)
class State:
    """What friction remembers of the last load step; the path dependence lives here.

    Attributes
    ----------
    status : ndarray of int, shape (m,)
    slip : ndarray, shape (m, d-1)
        Relative tangential displacement since the undeformed state [length].
    tangential_force : ndarray, shape (m, d-1)
        Force that resists the slip; zero at open points [force].
    normal_force : ndarray, shape (m,)
    reference : ndarray, shape (m, d-1)
        Slip at which the point closed [length].
    gap, area : ndarray, shape (m,)
        Gap; tributary area, which follows the pairing [length], [area].
    surface, trend : ndarray
        Displacements of the surfaces that slide far, and their change in the last load step: where
        the pairing of the next one begins. Empty for small sliding [length].
    vertex : ndarray of int, shape (m,)
        The vertex of the primary whose row a point carries, or -1, see `Kinematics.vertex`.
    """

    status: NDArray[np.intp]
    slip: Array
    tangential_force: Array
    normal_force: Array
    reference: Array
    gap: Array
    area: Array
    surface: Array
    trend: Array
    vertex: NDArray[np.intp]

    def handed_on(self, vertex: NDArray[np.intp], parts: Sequence[slice]) -> State:
        """The state with the history of every vertex at the point that carries its row now.

        A vertex of the primary that slides along the secondary goes from point to point, and its slip
        and friction go with it; the point that it leaves takes the history of the one it comes to.

        Parameters
        ----------
        vertex : ndarray of int, shape (m,)
            That of the pairing to come.
        parts : sequence of slice
            The points of each contact.
        """
        if np.array_equal(self.vertex, vertex):
            return self
        source = np.arange(len(vertex))
        for part in parts:
            old, new = self.vertex[part], vertex[part]
            _, before, after = np.intersect1d(
                np.where(old >= 0, old, -1), np.where(new >= 0, new, -2), return_indices=True
            )
            moved = before != after
            before, after = before[moved], after[moved]
            source[part.start + after] = part.start + before
            left = np.setdiff1d(before, after)
            source[part.start + left] = part.start + np.setdiff1d(after, before)
        names = ("status", "slip", "tangential_force", "normal_force", "reference", "gap", "area")
        return replace(self, **{name: getattr(self, name)[source] for name in names}, vertex=vertex)
