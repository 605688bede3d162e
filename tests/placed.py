"""The same scene somewhere else: moved, turned, and in other units of length.

Nothing that a library says about a shape may depend on where it lies. A scene is described in a plain
view, of size one about the origin, and `Placement` carries its points to where the test puts them.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

#: The axis that solids turn about: none of the coordinate axes, so that no plane stays level.
AXIS = np.array([1.0, 2.0, -2.0]) / 3.0


@dataclass(frozen=True)
class Placement:
    """A scene turned by `turn`, moved by `move` of its own size, and counted in a `unit` of length."""

    name: str
    turn: float = 0.0
    move: float = 0.0
    unit: float = 1.0

    def matrix(self, dim: int) -> Any:
        """The rotation, (dim, dim)."""
        if dim == 3:
            return Rotation.from_rotvec(self.turn * AXIS).as_matrix()
        c, s = np.cos(self.turn), np.sin(self.turn)
        return np.array([[c, -s], [s, c]])

    def offset(self, dim: int) -> Any:
        """Where the origin goes, before units are counted, (dim,)."""
        return self.move * np.array([1.0, -0.7, 0.4])[:dim]

    def points(self, points: Any) -> Any:
        """Positions in their place, (n, dim)."""
        x = np.asarray(points, dtype=float)
        return self.unit * (x @ self.matrix(x.shape[1]).T + self.offset(x.shape[1]))

    def vectors(self, vectors: Any) -> Any:
        """Directions, or displacements over the unit of length, in their place, (..., dim)."""
        v = np.asarray(vectors, dtype=float)
        return v @ self.matrix(v.shape[-1]).T

    def back(self, points: Any) -> Any:
        """Positions in the plain view, (n, dim)."""
        x = np.asarray(points, dtype=float)
        dim = x.shape[1]
        return (x / self.unit - self.offset(dim)) @ self.matrix(dim)

    def mesh(self, mesh: Any) -> Any:
        """A mesh in its place, with the boundaries that it had."""
        placed = type(mesh)(np.ascontiguousarray(self.points(mesh.doflocs.T).T), mesh.t)
        return placed.with_boundaries(mesh.boundaries) if mesh.boundaries else placed


PLACEMENTS = [
    Placement("plain"),
    Placement("moved", move=1e3),
    Placement("turned", turn=0.7),
    Placement("tiny", unit=1e-12),
    Placement("huge", unit=1e6),
    Placement("moved and turned", turn=0.7, move=1e3),
    Placement("moved, turned and tiny", turn=0.7, move=1e3, unit=1e-12),
]

everywhere = pytest.mark.parametrize("placed", PLACEMENTS, ids=lambda p: p.name)
