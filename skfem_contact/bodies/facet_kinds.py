"""`FacetKind`: what is the same for all facets of a kind: nodes, edges, shape functions, names.

Areas and normals of facets, by the shape functions of their kind, stand at the end.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property, lru_cache
from itertools import pairwise
from typing import Any, Literal

import numpy as np
import skfem
from skfem.quadrature import get_quadrature

from skfem_contact.arguments import numbers
from skfem_contact.arrays import Array, Index, across, sizes
from skfem_contact.digits import COMPUTED, SOLVED
from skfem_contact.errors import InputError
from skfem_contact.records import dataclass, sealed

# What corners of a face take of the middles of their edges where their own integrals are not positive.
TAKEN = 0.2


@dataclass(frozen=True, eq=False)
class FacetKind:
    """A kind of facets, the same for all facets of a surface; the elements are those of scikit-fem.

    The nodes of a facet are its corners, counter-clockwise seen from outside, then the middles of its
    edges, edge i from corner i to corner i + 1, then its centre.

    Attributes
    ----------
    name : str
        "line2" or "line3" in 2-D; "tri3", "quad4", "tri6", "quad8" or "quad9" in 3-D.
    element : skfem.Element
        With the shape functions. Its reference coordinates are in [0, 1]; those of triangles have a
        sum of one at most.
    corners : int
    degree : int
        What products of shape functions and the area element ask of a quadrature: exact for plane
        faces with straight edges, else with an error far below that of the facet itself.
    cell : str
        Its name in meshio.
    vtk : int
        Its number in VTK.
    parts : sequence of sequences of int
        The linear facets between its nodes, by their corners; the facet itself where it has no
        others.

    Examples
    --------
    >>> KINDS["tri6"].edges.tolist(), KINDS["tri6"].nodes
    ([[0, 1, 3], [1, 2, 4], [2, 0, 5]], 6)
    """

    name: str
    element: Any
    corners: int
    degree: int
    cell: str
    vtk: int
    parts: Sequence[Sequence[int]] = ()

    def __post_init__(self) -> None:
        if not self.parts:
            object.__setattr__(self, "parts", [range(self.corners)])

    def __reduce__(self) -> tuple[Any, ...]:
        return kind_of, (self.dim + 1, self.nodes)  # the one in `KINDS`, whatever is pickled

    @cached_property
    def nodes(self) -> int:
        """Number of nodes k."""
        return len(self.element.doflocs)

    @cached_property
    def dim(self) -> int:
        """Dimension of a facet: 1 for lines, 2 for faces."""
        return int(self.element.doflocs.shape[1])

    @property
    def triangle(self) -> bool:
        """Reference coordinates are those of a triangle."""
        return self.dim == 2 and self.corners == 3

    @property
    def quadratic(self) -> bool:
        """Facets have middle nodes."""
        return self.nodes > self.corners

    @property
    def straight(self) -> bool:
        """Facets are straight or plane whatever their nodes are: lines and triangles."""
        return self.nodes == self.dim + 1

    @property
    def linear(self) -> FacetKind:
        """The kind that has the corners only."""
        return kind_of(self.dim + 1, self.corners)

    @property
    def order(self) -> int:
        """Degree of the shape functions where the facet is straight, or a parallelogram."""
        return int(self.element.maxdeg)

    @cached_property
    def taken(self) -> float:
        """The share of edges' middles that corners take, to have positive integrals."""
        positive = self.shares[: self.corners].min() > COMPUTED
        return 0.0 if self.dim == 1 or positive else TAKEN

    @cached_property
    def cut(self) -> Index:
        """Triangles (t, 3) between the nodes of a face."""
        return np.array([(part[0], *pair) for part in self.parts for pair in pairwise(part[1:])])

    @cached_property
    def linear_parts(self) -> Index:
        """The linear facets that a facet is cut into (p, c), all triangles or all quadrilaterals."""
        unlike = len({len(part) for part in self.parts}) > 1
        return self.cut if unlike else np.array(self.parts)

    @cached_property
    def simplices(self) -> Index:
        """Straight pieces (p, 2) of a line; of a face triangles (t, 3) that prefer no diagonal.

        Those of `cut`, if all `parts` are triangles; else round the centre: k is one more node there,
        if there is none.
        """
        if self.dim == 1:
            return np.array(self.parts)
        if all(len(part) == 3 for part in self.parts):
            return self.cut
        rim = self.edges[:, [0, 2, 1]] if self.quadratic else self.edges
        steps = np.stack([rim[:, :-1], rim[:, 1:]], axis=2).reshape(-1, 2)
        return np.column_stack([steps, np.full(len(steps), steps.max() + 1)])

    @property
    def centreless(self) -> bool:
        """The `simplices` meet where there is no node."""
        return bool(self.simplices.max() == self.nodes)

    @cached_property
    def edges(self) -> Index:
        """Nodes of each edge of a face: start, end, and the middle if there is one, (c, 2 or 3).

        The edges of a line are its ends, (2, 1).
        """
        start = np.arange(self.corners)
        if self.dim == 1:
            return start[:, None]
        columns = [start, (start + 1) % self.corners]
        return np.column_stack(columns + ([start + self.corners] if self.quadratic else []))

    @cached_property
    def locations(self) -> Array:
        """Reference coordinates of the nodes, shape (k, d-1)."""
        return np.array(self.element.doflocs, dtype=float)

    @cached_property
    def middle(self) -> Array:
        """Reference coordinates of the middle of a facet, shape (d-1,)."""
        return self.locations[: self.corners].mean(axis=0)

    def shapes(self, xi: Array) -> tuple[Array, Array]:
        """Shape functions and their derivatives.

        Parameters
        ----------
        xi : ndarray, shape (..., d-1)
            Reference coordinates.

        Returns
        -------
        N : ndarray, shape (..., k)
        dN : ndarray, shape (..., k, d-1)
            In Fortran order where `xi` is, see `node_positions`.

        Examples
        --------
        >>> KINDS["quad4"].shapes(np.array([0.5, 0.0]))[0].tolist()
        [0.5, 0.5, 0.0, 0.0]
        """
        if self.dim == 1:
            return _on_line(np.asarray(xi, dtype=float)[..., 0], self.nodes)
        x = np.moveaxis(np.asarray(xi, dtype=float), -1, 0)
        order: Literal["C", "F"] = "F" if x.flags.c_contiguous else "C"
        N = np.empty((*x.shape[1:], self.nodes), order=order)
        dN = np.empty((*N.shape, self.dim), order=order)
        for i in range(self.nodes):
            value, slope = self.element.lbasis(x, i)
            N[..., i] = value
            for j in range(self.dim):
                dN[..., i, j] = slope[j]
        return N, dN

    def second(self, xi: Array) -> Array:
        """Second derivatives of the shape functions, shape (..., k, d-1, d-1).

        Central differences of the first ones, exact for polynomials of their degree.
        """
        xi = np.asarray(xi, dtype=float)
        columns = [
            self.shapes(xi + half)[1] - self.shapes(xi - half)[1] for half in 0.5 * np.eye(self.dim)
        ]
        return np.stack(columns, axis=-1)

    @cached_property
    def curvatures(self) -> Array | None:
        """The second derivatives (k, d-1, d-1) where they are the same everywhere, else None."""
        at = self.locations
        second = self.second(at)
        return second[0] if np.allclose(second, second[0], rtol=0, atol=COMPUTED) else None

    @cached_property
    def between(self) -> Array:
        """Shape functions (p, k) halfway between any two nodes, and in the middle, where no node is."""
        at = self.locations
        halfway = 0.5 * (at[:, None] + at).reshape(-1, self.dim)
        places = np.unique(np.vstack([halfway, self.middle]), axis=0)
        to_nodes = np.abs(places[:, None] - at).max(axis=2).min(axis=1)
        return self.shapes(places[to_nodes > COMPUTED])[0]

    @cached_property
    def derivatives(self) -> Array:
        """Of the shape functions at the nodes, and in the middle, shape (k + 1, k, d-1)."""
        return self.shapes(np.vstack([self.locations, self.middle]))[1]

    @cached_property
    def gauss(self) -> tuple[Array, Array, Array]:
        """Shape functions (q, k), their derivatives (q, k, d-1) and weights (q,) of `quadrature`."""
        at, weight = self.quadrature()
        return *self.shapes(at), weight

    @cached_property
    def shares(self) -> Array:
        """Integrals of the shape functions over a straight facet of area one, shape (k,).

        >>> KINDS["quad8"].shares.round(12).tolist()[3:5]
        [-0.083333333333, 0.333333333333]
        """
        N, _, weight = self.gauss
        return np.asarray(weight @ N / weight.sum())

    def quadrature(self, degree: int | None = None) -> tuple[Array, Array]:
        """Gauss points (q, d-1) and weights (q,), for polynomials up to `degree` at least."""
        return _quadrature(self, self.degree if degree is None else degree)


@lru_cache
def _quadrature(kind: FacetKind, degree: int) -> tuple[Array, Array]:
    """Points and weights: once for all surfaces, as the eigenvalues that they come from take long."""
    points, weights = get_quadrature(kind.element, degree)
    return sealed(np.ascontiguousarray(points.T)), sealed(weights)


def _on_line(t: Array, k: int) -> tuple[Array, Array]:
    """Shape functions of lines and their derivatives, written out: a quarter of the element's time."""
    if k == 2:
        N, slopes = np.empty((*t.shape, 2)), np.empty((*t.shape, 2, 1))
        np.subtract(1, t, out=N[..., 0])
        N[..., 1] = t
        slopes[..., 0, 0], slopes[..., 1, 0] = -1.0, 1.0
        return N, slopes
    N, slopes, t4 = np.empty((*t.shape, 3)), np.empty((*t.shape, 3, 1)), 4 * t
    middle, rest = N[..., 2], 1 - t
    np.multiply(t4, rest, out=middle)
    half = 0.5 * middle
    np.subtract(rest, half, out=N[..., 0])
    np.subtract(t, half, out=N[..., 1])
    np.subtract(t4, 3, out=slopes[..., 0, 0])
    np.subtract(t4, 1, out=slopes[..., 1, 0])
    np.subtract(4, 2 * t4, out=slopes[..., 2, 0])
    return N, slopes


#: All kinds by name. Quadratic lines and quadrilaterals have area elements that are no polynomials.
#: The elements of bodies that have such facets are `inputs.SUPPORTED`, and for files `vtk.VTK_CELLS`.
KINDS = {
    kind.name: kind
    for kind in (
        FacetKind("line2", skfem.ElementLineP1(), 2, 9, "line", 3),
        FacetKind("line3", skfem.ElementLineP2(), 2, 9, "line3", 21, [(0, 2), (2, 1)]),
        FacetKind("tri3", skfem.ElementTriP1(), 3, 4, "triangle", 5),
        FacetKind(
            "tri6", skfem.ElementTriP2(), 3, 8, "triangle6", 22,
            [(0, 3, 5), (3, 1, 4), (5, 4, 2), (3, 4, 5)],
        ),
        FacetKind("quad4", skfem.ElementQuad1(), 4, 5, "quad", 9),
        FacetKind(
            "quad8", skfem.ElementQuadS2(), 4, 7, "quad8", 23,
            [(0, 4, 7), (4, 1, 5), (5, 2, 6), (6, 3, 7), (4, 5, 6, 7)],
        ),
        FacetKind(
            "quad9", skfem.ElementQuad2(), 4, 7, "quad9", 28,
            [(0, 4, 8, 7), (1, 5, 8, 4), (2, 6, 8, 5), (3, 7, 8, 6)],
        ),
    )
}  # fmt: skip


def node_positions(points: Array, facets: Index) -> Array:
    """Positions of the nodes of facets, ``points[facets]``, (nf, k, d), in Fortran order.

    Facets are contiguous in memory then, and sums over nodes run along all facets at once (with
    ``np.einsum(..., order="F")``): ten times as fast as facet by facet.
    """
    return np.asarray(np.take(points.T, facets.T, axis=1).T)


def kind_of(dim: int, nodes: int) -> FacetKind:
    """The kind of the facets of a surface in `dim`-D space, by their number of nodes.

    >>> kind_of(3, 8).name, kind_of(2, 3).name
    ('quad8', 'line3')
    """
    for kind in KINDS.values():
        if (kind.dim + 1, kind.nodes) == (dim, nodes):
            return kind
    raise InputError(f"no kind of facets in {dim}-D with {nodes} nodes is known; add it to KINDS")


@lru_cache
def positive_functions(kind: FacetKind) -> Array:
    """B of ``P = B N``, the functions that the multipliers of a kind are dual to, shape (k, k)."""
    B = np.eye(kind.nodes)
    for start, end, middle in kind.edges if kind.taken else ():
        B[[start, end], middle] = kind.taken
        B[middle, middle] = 1 - 2 * kind.taken
    return B


def area_elements(points: Array, facets: Index, kind: FacetKind, dN: Array) -> Array:
    """Outward normals with the length of the line or area element, (nf, q, d).

    Of shape functions with derivatives (q, k, d-1); of straight facets only one, (nf, 1, d).
    """
    if kind.straight:  # the same all over, so it is computed once
        x = points.T.take(facets.T, axis=1)
        return across((x[:, 1:] - x[:, :1]).T)[:, None]
    return across(np.einsum("qki,fkd->fqid", dN, node_positions(points, facets), order="F"))


def facet_sizes(points: Array, facets: Index, kind: FacetKind) -> Array:
    """Lengths of lines, areas of faces, shape (nf,)."""
    _, dN, weight = kind.gauss
    density = sizes(area_elements(points, facets, kind, dN))
    return density[:, 0] * weight.sum() if kind.straight else density @ weight


def own_normals(points: Array, facets: Index, kind: FacetKind) -> tuple[Array, Array]:
    """The facets' own outward unit normals at their nodes, (nf, k, d), and in the middle, (nf, d).

    At a node where the facet has no tangents, as at a quarter point, that of the middle.
    """
    element = area_elements(points, facets, kind, kind.derivatives)
    size = sizes(element)[..., None]
    middle = element[:, -1] / size[:, -1]
    if kind.straight:
        return np.repeat(middle[:, None], kind.nodes, axis=1), middle
    size, least = size[:, :-1], SOLVED * size[:, -1:]
    if size.min() > least.max():
        return element[:, :-1] / size, middle
    there = size > least
    return np.where(there, element[:, :-1] / np.where(there, size, 1.0), middle[:, None]), middle


def node_shares(
    points: Array, facets: Index, kind: FacetKind, measure: Any, label: str, places: Array | None = None
) -> Array:
    """Integrals of the shape functions, times the measure, over each facet, shape (nf, k).

    The measure is that of the nodes' `places` (m, d), where it is not that of the points.
    """
    N, dN, weight = kind.gauss
    density = sizes(area_elements(points, facets, kind, dN)) * weight
    if measure is not None:
        at = (points if places is None else places)[facets]
        density = density * weights_of(measure, np.einsum("qk,fkd->dfq", N, at), label)
    return np.asarray(density @ N)


def tributary_areas(points: Array, facets: Index, *given: Any) -> Array:
    """`node_shares` of all facets together, shape (m,)."""
    shares = node_shares(points, facets, *given)
    return np.asarray(np.bincount(facets.ravel(), shares.ravel(), len(points)), dtype=float)


def area_integrals(points: Array, facets: Index, kind: FacetKind, measure: Any) -> tuple[Array, Array]:
    """``int N n dA`` with the measure of the body, (m, d), and ``int |N| dA`` without, (m,)."""
    N, dN, weight = kind.gauss
    element = area_elements(points, facets, kind, dN) * weight[:, None]
    size = sizes(element)
    if measure is not None:
        x = np.einsum("qk,fkd->dfq", N, points[facets])
        element = element * np.asarray(measure(x))[..., None]
    area, total = np.zeros_like(points), np.zeros(len(points))
    np.add.at(area, facets, np.einsum("qk,fqd->fkd", N, element))
    np.add.at(total, facets, size @ np.abs(N))
    return area, total


def weights_of(measure: Any, x: Array, label: str) -> Array:
    """The measure of a body at positions (d, nf, q) of a surface, checked."""
    usage = "return one positive number for each position, as in lambda x: 2 * np.pi * x[0]"
    factor = numbers(measure(x), f"measure on surface {label!r}", usage)
    if factor.shape not in ((), x.shape[1:]):
        raise InputError(
            f"measure on surface {label!r} has shape {factor.shape} for positions of shape "
            f"{x.shape}; {usage}"
        )
    factor = np.broadcast_to(factor, x.shape[1:])
    if not np.all(np.isfinite(factor)) or factor.min() < 0 or factor.max() <= 0:
        raise InputError(
            f"measure is {factor.min():.3g} to {factor.max():.3g} on surface {label!r}; a "
            "weight of the area is positive and finite (an axisymmetric mesh lies at x[0] >= 0)"
        )
    return factor


def area_vectors(corners: Array) -> Array:
    """Mean normals of facets (..., c, d), warped ones too, as long as they or twice their area."""
    if corners.shape[-1] == 2:
        return across(corners[..., 1:, :] - corners[..., :1, :])
    return across(corners[..., [2, -1], :] - corners[..., [0, 1], :])
