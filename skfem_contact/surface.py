"""`ContactSurface`: nodes, DOFs, facets, normals and tributary areas of one boundary."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from skfem_contact.arguments import check_name, numbers
from skfem_contact.errors import InputError
from skfem_contact.selection import name_of, place, select_facets

if TYPE_CHECKING:
    from skfem_contact.body import Body

#: Two facets that meet at a larger angle than 45 degrees form a corner: no normal is averaged over
#: it.
CORNER = np.cos(np.pi / 4)

#: Gauss points per facet for the areas: exact up to order 9, so also for a curved quadratic facet
#: (whose length element is no polynomial) far below the error of its geometry.
GAUSS = np.polynomial.legendre.leggauss(5)


@dataclass(frozen=True, eq=False)
class ContactSurface:
    """One boundary of a body as contact sees it.

    Facets are listed along the surface with the body on their left, and the nodes in the order in
    which the facets meet them; so a plot over the nodes of one piece is a line.

    Attributes
    ----------
    body : Body
    name : str
    points : ndarray, shape (m, d)
        Positions of the surface nodes [length].
    dofs : ndarray of int, shape (m, c)
        DOF (of the body) of each component at each node; ``c = d``, or 1 for a scalar field.
    facets : ndarray of int, shape (nf, k)
        Numbers of points: (start, end) of linear facets, (start, end, middle) of quadratic ones.
    facet_normals : ndarray, shape (nf, d)
        Outward unit normals, at the middle of a curved facet.
    normals : ndarray, shape (m, d)
        Outward unit normals at the nodes: average over the adjacent facets, the shorter counting
        more (weights 1/length). At a
        corner this is the direction between the two sides, good to tell which way the node looks;
        the normals to constrain along are `facet_node_normals`.
    facet_node_normals : ndarray, shape (nf, 2, d)
        Outward unit normals at start and end of each facet: averaged with the neighbour, but the
        facet's own where the surface turns by more than 45 degrees, or ends. A curved surface that
        ends on a line of symmetry (one component of its last node is prescribed) is averaged with
        its mirror image.
    area : ndarray, shape (m,)
        Tributary areas: integrals of the shape functions times the `measure` of the body. They add
        up to the area of the surface. (The end of a quadratic facet on the axis of symmetry has
        area zero.)
    lengths : ndarray, shape (nf,)
        Lengths of the facets [length].
    mesh_facets : ndarray of int, shape (nf,)
        Facet numbers in the mesh.

    Examples
    --------
    The top of a unit square; the body is on the left, so the facet runs from right to left:

    >>> import skfem as fem
    >>> from skfem.models.elasticity import linear_elasticity
    >>> from skfem_contact.body import Body
    >>> basis = fem.Basis(fem.MeshQuad().with_defaults(), fem.ElementVector(fem.ElementQuad1()))
    >>> top = Body(basis, linear_elasticity(), name="block").surface("top")
    >>> top.label, top.points.tolist(), top.area.round(12).tolist()
    ('block/top', [[1.0, 1.0], [0.0, 1.0]], [0.5, 0.5])
    >>> top.facet_normals.tolist()
    [[0.0, 1.0]]
    """

    body: Body
    name: str
    points: np.ndarray
    dofs: np.ndarray
    facets: np.ndarray
    facet_normals: np.ndarray
    normals: np.ndarray
    facet_node_normals: np.ndarray
    area: np.ndarray
    lengths: np.ndarray
    mesh_facets: np.ndarray

    def __repr__(self) -> str:
        kind = "quadratic" if self.quadratic else "linear"
        sizes = f"{len(self.points)} points, {len(self.facets)} {kind} facets"
        return f"<ContactSurface {self.label}: {sizes}>"

    @property
    def label(self) -> str:
        """ "body/name" for messages."""
        return f"{self.body.name}/{self.name}" if self.body.name else self.name

    @property
    def dim(self) -> int:
        """Dimension of space."""
        return self.points.shape[1]

    @property
    def quadratic(self) -> bool:
        """Whether facets have a middle node."""
        return self.facets.shape[1] == 3

    @cached_property
    def neighbours(self) -> np.ndarray:
        """Facets before and after each facet, shape (nf, 2); -1 where the surface ends."""
        return facet_neighbours(self.facets)

    @cached_property
    def held(self) -> np.ndarray:
        """Which components of each node are prescribed, shape (m, d)."""
        return _held(self.body, self.dofs)

    @cached_property
    def end_normals(self) -> np.ndarray:
        """The facets' own outward unit normals at start and end, (nf, 2, d), not averaged."""
        return _normals_at(self.points, self.facets, np.array([0.0, 1.0]))[0]

    def moved(self, u: np.ndarray) -> ContactSurface:
        """Return the surface displaced: same nodes, facets and areas, new positions and normals.

        Parameters
        ----------
        u : ndarray, shape (n,)
            Displacement of the body [length].
        """
        u = numbers(u, f"the displacement of surface {self.label!r}", "give the body's vector")
        if self.dofs.shape[1] != self.dim:
            raise InputError(f"surface {self.label!r} belongs to a scalar field, it can not move")
        if u.shape != (self.body.n,):
            raise InputError(
                f"displacement of shape {u.shape} for surface {self.label!r}, whose body has "
                f"{self.body.n} DOFs"
            )
        points = self.points + u[self.dofs]
        return replace(
            self, points=points, **_geometry(points, self.facets, self.held, self.neighbours)
        )


def extract_surface(
    body: Body, where: Any, nodes: bool = False, name: str | None = None
) -> ContactSurface:
    """Take a surface out of the mesh of a body; the function behind `Body.surface`."""
    basis, mesh = body.basis, body.basis.mesh
    if body.dim != 2:
        raise InputError(f"surfaces of {body.dim}-D bodies are not implemented yet; only 2-D")
    check_name(name, "name of a surface")
    name = name or name_of(where)
    label = f"{body.name}/{name}" if body.name else name
    numbers = select_facets(mesh, where, nodes, label)
    numbers, facets_v = _oriented(mesh, numbers)
    order = _along(facets_v)
    numbers, facets_v = numbers[order], facets_v[order]

    # a node is known by its vertex number, or behind those by the number of its facet
    quadratic = basis.facet_dofs.size > 0
    start, end = facets_v.T
    columns = [start, mesh.nvertices + numbers, end] if quadratic else [start, end]
    ids = np.column_stack(columns)
    unique, first, inverse = np.unique(ids, return_index=True, return_inverse=True)
    met = np.argsort(first)
    rank = np.empty_like(met)
    rank[met] = np.arange(len(met))
    facets = rank[inverse.reshape(ids.shape)]
    if quadratic:
        facets = facets[:, [0, 2, 1]]
    unique = unique[met]
    vertex = unique < mesh.nvertices
    dofs = np.empty((len(unique), body.components), dtype=np.int32)
    dofs[vertex] = basis.nodal_dofs[:, unique[vertex]].T
    if quadratic:
        dofs[~vertex] = basis.facet_dofs[:, unique[~vertex] - mesh.nvertices].T

    points = np.ascontiguousarray(basis.doflocs[:, dofs[:, 0]].T)
    _check_facets(points, facets, numbers, mesh, label)
    return ContactSurface(
        body=body,
        name=name,
        points=points,
        dofs=dofs,
        facets=facets,
        area=_areas(points, facets, body.measure, label),
        mesh_facets=numbers,
        **_geometry(points, facets, _held(body, dofs), facet_neighbours(facets)),
    )


def facet_shapes(xi: np.ndarray, k: int) -> tuple[np.ndarray, np.ndarray]:
    """Shape functions of a facet and their derivatives at local coordinates.

    Parameters
    ----------
    xi : ndarray, shape (...)
        Local coordinate, 0 at the start and 1 at the end of the facet.
    k : int
        2 (start, end) or 3 (start, end, middle).

    Returns
    -------
    N, dN : ndarray, shape (..., k)

    Examples
    --------
    >>> facet_shapes(np.array([0.0, 0.5]), 3)[0].tolist()
    [[1.0, -0.0, 0.0], [0.0, 0.0, 1.0]]
    """
    xi = np.asarray(xi, dtype=float)
    if k == 2:
        return np.stack([1 - xi, xi], -1), np.stack([-np.ones_like(xi), np.ones_like(xi)], -1)
    N = np.stack([(1 - xi) * (1 - 2 * xi), xi * (2 * xi - 1), 4 * xi * (1 - xi)], -1)
    return N, np.stack([4 * xi - 3, 4 * xi - 1, 4 - 8 * xi], -1)


def facet_neighbours(facets: np.ndarray) -> np.ndarray:
    """Facets before and after each facet, shape (nf, 2); -1 where the surface ends.

    Where more than two facets share a point (two corners touch), the k-th that ends there is
    followed by the k-th that starts there.

    >>> facet_neighbours(np.array([[0, 1], [1, 2], [5, 6]])).tolist()
    [[-1, 1], [0, -1], [-1, -1]]
    """
    start, end = facets[:, 0], facets[:, 1]
    count = len(facets) + 1
    _, ends, starts = np.intersect1d(
        end * count + _occurrence(end), start * count + _occurrence(start), return_indices=True
    )
    neighbours = np.full((len(facets), 2), -1)
    neighbours[starts, 0] = ends
    neighbours[ends, 1] = starts
    return neighbours


def _occurrence(values: np.ndarray) -> np.ndarray:
    """How often each value has appeared before: [7, 3, 7] gives [0, 0, 1]."""
    order = np.argsort(values, kind="stable")
    ordered = values[order]
    position = np.arange(len(values))
    is_first = np.r_[True, ordered[1:] != ordered[:-1]]
    occurrence = np.empty(len(values), dtype=np.int64)
    occurrence[order] = position - np.maximum.accumulate(np.where(is_first, position, 0))
    return occurrence


def _along(facets: np.ndarray) -> np.ndarray:
    """Order of facets along the surface, piece by piece (list ranking by pointer doubling)."""
    count = len(facets)
    before = facet_neighbours(facets)[:, 0].copy()
    linked = np.flatnonzero(before >= 0)
    graph = coo_matrix((np.ones(len(linked)), (linked, before[linked])), shape=(count, count))
    _, piece = connected_components(graph, directed=False)
    # a closed curve has no first facet: cut it before the one that the mesh numbers first
    open_pieces = np.unique(piece[before < 0])
    _, first = np.unique(piece, return_index=True)
    before[np.setdiff1d(first, first[open_pieces])] = -1
    distance = (before >= 0).astype(np.int64)
    while np.any(before >= 0):
        on = before >= 0
        distance[on] += distance[before[on]]
        before[on] = before[before[on]]
    return np.lexsort((distance, piece))


def _oriented(mesh: Any, numbers: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Vertices (start, end) of facets, turned so that their element is on the left."""
    ends = mesh.facets[:, numbers].T.astype(np.int64)
    element = mesh.f2t[0, numbers]
    centre = mesh.p[:, mesh.t[:, element]].mean(axis=1).T
    along, inward = (
        (mesh.p[:, ends[:, 1]] - mesh.p[:, ends[:, 0]]).T,
        centre - mesh.p[:, ends[:, 0]].T,
    )
    left = along[:, 0] * inward[:, 1] - along[:, 1] * inward[:, 0] > 0
    return numbers, np.where(left[:, None], ends, ends[:, ::-1])


def _check_facets(
    points: np.ndarray, facets: np.ndarray, numbers: np.ndarray, mesh: Any, label: str
) -> None:
    chord = np.linalg.norm(points[facets[:, 1]] - points[facets[:, 0]], axis=1)
    # coordinates carry 16 digits of the mesh's extent; anything near that has no direction
    small = 1e-12 * np.abs(mesh.doflocs - mesh.doflocs.mean(axis=1, keepdims=True)).max()
    bad = np.flatnonzero(chord <= small)
    if bad.size:
        raise InputError(
            f"surface {label!r}: {bad.size} facets have no length, the first is mesh facet "
            f"{numbers[bad[0]]} at {place(points[facets[bad[0], 0]])}; remove the degenerate "
            "elements from the mesh"
        )
    middle = points[facets].mean(axis=1)
    pairs = cKDTree(middle).query_pairs(max(small, 1e-9 * chord.min()), output_type="ndarray")
    if len(pairs):
        i, j = pairs[0]
        raise InputError(
            f"surface {label!r}: {len(pairs)} facets lie twice at the same place, for example "
            f"mesh facets {numbers[i]} and {numbers[j]} at {place(middle[i])}. Both lips of a "
            "slit can not be one surface: select each by its own boundary name or facet numbers"
        )


def _normals_at(
    points: np.ndarray, facets: np.ndarray, xi: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Outward unit normals (nf, q, d) and length elements dx/dxi (nf, q) at coordinates (q,)."""
    _, dN = facet_shapes(xi, facets.shape[1])
    tangent = np.einsum("qk,fkd->fqd", dN, points[facets])
    speed = np.linalg.norm(tangent, axis=2)
    # the body is on the left, so outward is to the right of the direction of travel
    normal = np.stack([tangent[..., 1], -tangent[..., 0]], axis=2) / speed[..., None]
    return normal + 0.0, speed  # + 0.0 turns -0.0 into 0.0


def _held(body: Body, dofs: np.ndarray) -> np.ndarray:
    """Prescribed components, (m, d); a scalar field has no directions to hold."""
    held = np.isin(dofs, body.D)
    return held if dofs.shape[1] == body.dim else np.zeros((len(dofs), body.dim), dtype=bool)


def _on_symmetry(
    middle: np.ndarray,
    lengths: np.ndarray,
    facets: np.ndarray,
    held: np.ndarray,
    before: np.ndarray,
    side: int,
) -> np.ndarray:
    """Facets (nf,) of a curved surface that ends here on a line of symmetry.

    There one component of the last node is prescribed, and the normal, continued from the middles
    of the last two facets to the end, has none of it left. A straight inclined surface that ends
    at a roller is not meant: its normal stays as it is.
    """
    inner = before[:, 1 - side]
    here = held[facets[:, side]]
    last = (before[:, side] < 0) & (inner >= 0) & (here.sum(axis=1) == 1)
    last &= np.einsum("fd,fd->f", middle, middle[inner]) >= CORNER
    share = (lengths / (lengths + lengths[inner]))[:, None]
    ahead = middle + share * (middle - middle[inner])
    left = np.abs(np.sum(ahead * here, axis=1)), np.abs(np.sum(middle * here, axis=1))
    return np.asarray(last & (left[0] <= 0.5 * left[1]))


def _geometry(
    points: np.ndarray, facets: np.ndarray, held: np.ndarray, neighbours: np.ndarray
) -> dict[str, Any]:
    """Lengths and normals: what changes when the surface moves."""
    gauss, weight = 0.5 * (GAUSS[0] + 1), 0.5 * GAUSS[1]
    lengths = _normals_at(points, facets, gauss)[1] @ weight
    own = _normals_at(points, facets, np.array([0.0, 0.5, 1.0]))[0]
    ends = own[:, [0, 2]]

    averaged = ends.copy()
    for side in (0, 1):
        other = neighbours[:, side]
        there = ends[other, 1 - side]
        smooth = (other >= 0) & (np.einsum("fd,fd->f", ends[:, side], there) >= CORNER)
        # a facet's normal is exact at its middle, so the nearer, shorter facet counts more: this is
        # exact on a circle, and of second order on any smooth curve
        mean = lengths[other, None] * ends[:, side] + lengths[:, None] * there
        averaged[smooth, side] = _unit(mean[smooth])

    for side in (0, 1):
        mirrored = _on_symmetry(own[:, 1], lengths, facets, held, neighbours, side)
        # the average with the mirror image, without which the end node would be constrained along
        # the normal of a chord
        image = np.where(held[facets[mirrored, side]], 0.0, ends[mirrored, side])
        ends[mirrored, side] = averaged[mirrored, side] = _unit(image)

    total = np.zeros_like(points)
    np.add.at(total, facets[:, :2], lengths.min() / lengths[:, None, None] * ends)
    if facets.shape[1] == 3:
        total[facets[:, 2]] = own[:, 1]
    # two sides back to back (a crack tip) cancel: then the side met last decides
    lost = np.linalg.norm(total, axis=1) <= 1e-9 * lengths.min() / lengths.max()
    fallback = np.zeros_like(points)
    fallback[facets[:, :2]] = ends
    total[lost] = fallback[lost]
    return {
        "facet_normals": own[:, 1],
        "normals": _unit(total),
        "facet_node_normals": averaged,
        "lengths": lengths,
    }


def _areas(points: np.ndarray, facets: np.ndarray, measure: Any, label: str) -> np.ndarray:
    """Integrals of the shape functions, times the measure, over the surface."""
    gauss, weight = 0.5 * (GAUSS[0] + 1), 0.5 * GAUSS[1]
    N, _ = facet_shapes(gauss, facets.shape[1])
    density = _normals_at(points, facets, gauss)[1] * weight
    if measure is not None:
        x = np.einsum("qk,fkd->dfq", N, points[facets])
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
                "weight of the area is positive and finite (an axisymmetric mesh lies at x[0] >= "
                "0)"
            )
        density = density * factor
    area = np.zeros(len(points))
    np.add.at(area, facets, density @ N)
    return area


def _unit(vectors: np.ndarray) -> np.ndarray:
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)
