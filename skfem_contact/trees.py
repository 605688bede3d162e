"""Points that are near each other; by SciPy's trees, imported when the first is made."""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy  # its parts are imported when they are used: this one takes long
from numpy.typing import NDArray

#: A direction that no mesh has rows along, so that points of a grid have different places on it.
ODD = np.array([0.5410, 0.6180, 0.5704])


def kd_tree(points: Any) -> Any:
    """A tree of points (m, d).

    >>> distance, nearest = kd_tree([(0.0, 0.0), (1.0, 0.0)]).query((0.9, 0.0))
    >>> int(nearest)
    1
    """
    return scipy.spatial.cKDTree(points)


def pairs_within(points: NDArray[np.float64], distance: float) -> NDArray[np.intp]:
    """Pairs of points (m, d) that are not farther apart than a distance, shape (p, 2).

    Usually there are none, and places along one line show it without a tree.

    >>> pairs_within(np.array([(0.0, 0.0), (1.0, 0.0), (1.0, 1e-9)]), 1e-6).tolist()
    [[1, 2]]
    """
    places = np.sort(points @ ODD[: points.shape[1]])
    if np.all(np.diff(places) > distance):  # no line is longer along a direction of unit length
        return np.zeros((0, 2), dtype=np.intp)
    return np.asarray(kd_tree(points).query_pairs(distance, output_type="ndarray"))
