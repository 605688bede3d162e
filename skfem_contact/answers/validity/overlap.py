"""Do deformed bodies overlap? Judged from outside: polygons in polygons, and no word of contact.

The boundary of every body, moved by its displacement, is a set of straight pieces (a curved facet gives
several). A point is inside where a ray from it meets an odd number of them. This knows of no surface,
partner or normal of the contact modules, and shares no code with them: what they overlook is seen here.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from skfem_contact.answers.thresholds import PAIRS_AT_ONCE, PIECES
from skfem_contact.bodies.body import Body

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Outline:
    """The boundary of a body as straight pieces.

    Attributes
    ----------
    start, end : ndarray, shape (s, 2)
        Ends of the pieces, in any order [length].

    Examples
    --------
    A triangle, and two points:

    >>> corners = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    >>> triangle = Outline(corners, np.roll(corners, -1, axis=0))
    >>> triangle.depth(np.array([[0.25, 0.25], [0.75, 0.75]])).tolist()
    [0.25, 0.0]
    """

    start: Array
    end: Array

    @cached_property
    def box(self) -> tuple[Array, Array]:
        """Least and largest coordinates, (2,) each [length]."""
        ends = np.concatenate([self.start, self.end])
        return ends.min(axis=0), ends.max(axis=0)

    def samples(self, box: tuple[Array, Array]) -> Array:
        """Ends and middles of all pieces that lie in a box, each once, (p, 2)."""
        points = np.concatenate([self.start, 0.5 * (self.start + self.end)])
        return np.unique(points[within(points, box)], axis=0)

    def inside(self, points: Array) -> Mask:
        """Which points lie inside, shape (p,)."""
        out = np.zeros(len(points), dtype=bool)
        rise = self.end - self.start
        for some in _blocks(np.flatnonzero(within(points, self.box)), len(self.start)):
            x, y = points[some, 0][:, None], points[some, 1][:, None]
            crossed = (self.start[:, 1] > y) != (self.end[:, 1] > y)
            row, piece = np.nonzero(crossed)
            part = (y[row, 0] - self.start[piece, 1]) / rise[piece, 1]
            right = self.start[piece, 0] + part * rise[piece, 0] > x[row, 0]
            out[some] = np.bincount(row[right], minlength=len(some)) % 2 == 1
        return out

    def distance(self, points: Array) -> Array:
        """Distances of points from the boundary, shape (p,) [length]."""
        out = np.zeros(len(points))
        rise = self.end - self.start
        square = np.maximum(np.sum(rise**2, axis=1), np.finfo(float).tiny)
        for some in _blocks(np.arange(len(points)), len(self.start)):
            apart = points[some][:, None] - self.start
            part = np.clip(np.einsum("psd,sd->ps", apart, rise) / square, 0.0, 1.0)
            apart -= part[..., None] * rise
            out[some] = np.sqrt(np.min(np.einsum("psd,psd->ps", apart, apart), axis=1))
        return out

    def depth(self, points: Array) -> Array:
        """How deep points lie inside, zero outside, shape (p,) [length]."""
        out, inside = np.zeros(len(points)), self.inside(points)
        out[inside] = self.distance(points[inside])
        return out

    def signed(self, points: Array) -> Array:
        """Distances of points, negative inside, shape (p,) [length]."""
        return np.where(self.inside(points), -1.0, 1.0) * self.distance(points)


def within(points: Array, box: tuple[Array, Array]) -> Mask:
    """Which points (p, d) lie in a box of least and largest coordinates, its sides included."""
    low, high = box
    return np.asarray(np.all((points >= low) & (points <= high), axis=1))


def outline(body: Body, u: Array) -> Outline:
    """The whole boundary of a plane body, displaced.

    Parameters
    ----------
    body : Body
    u : ndarray, shape (n_body,)
        Displacement of the body [length].
    """
    basis, mesh = body.basis, body.basis.mesh
    facets = mesh.boundary_facets()
    ends = basis.nodal_dofs[:, mesh.facets[:, facets]]
    dofs = [ends[:, 0], ends[:, 1]]
    if basis.facet_dofs.size:
        dofs.append(basis.facet_dofs[:, facets])
    return drawn(*(_places(basis, u, at) for at in dofs))


def drawn(a: Array, b: Array, middle: Array | None = None) -> Outline:
    """Facets from their ends (f, 2), and the middle nodes of quadratic ones, as straight pieces."""
    if middle is None:
        return Outline(a, b)
    s = np.linspace(0.0, 1.0, PIECES + 1)[:, None, None]
    curve = (1 - s) * (1 - 2 * s) * a + s * (2 * s - 1) * b + 4 * s * (1 - s) * middle
    return Outline(curve[:-1].reshape(-1, 2), curve[1:].reshape(-1, 2))


def _places(basis: object, u: Array, dofs: NDArray[np.intp]) -> Array:
    """Positions (k, 2) of nodes with these DOFs (2, k), displaced."""
    at: Array = basis.doflocs[:, dofs[0]].T + u[dofs].T  # type: ignore[attr-defined]
    return at


def _blocks(numbers: NDArray[np.intp], pieces: int) -> list[NDArray[np.intp]]:
    count = -(-len(numbers) * pieces // PAIRS_AT_ONCE)
    return np.array_split(numbers, count) if count else []
