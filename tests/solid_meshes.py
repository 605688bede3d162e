"""Meshes of solids that several tests take: cubes, balls and cylinders of every element."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

import numpy as np
import scipy.sparse as sp
import skfem as fem
from quick_elasticity import linear_elasticity
from skfem.models.elasticity import lame_parameters

from skfem_contact import Body

#: Kind of the faces, linear mesh, mesh with middle nodes, element.
KINDS: dict[str, tuple[Any, Any, Any]] = {
    "tri3": (fem.MeshTet, fem.MeshTet, fem.ElementTetP1),
    "tri6": (fem.MeshTet, fem.MeshTet2, fem.ElementTetP2),
    "quad4": (fem.MeshHex, fem.MeshHex, fem.ElementHex1),
    "quad8": (fem.MeshHex, fem.MeshHex2, fem.ElementHexS2),
    "quad9": (fem.MeshHex, fem.MeshHex2, fem.ElementHex2),
}


def cube(kind: str, n: int = 2, place: Any = None, layers: int | None = None) -> Any:
    """The unit cube of n^3 hexahedra, or the tetrahedra they are cut into; `place` maps it, (3, N).

    With fewer `layers` upwards it is quicker made, for what only needs its upper side.
    """
    linear, curved, _ = KINDS[kind]
    t, z = np.linspace(0, 1, n + 1), np.linspace(0, 1, (layers or n) + 1)
    mesh = linear.init_tensor(t, t, z)
    mesh = mesh if curved is linear else curved.from_mesh(mesh)
    if place is None:
        return mesh
    p = np.ascontiguousarray(place(mesh.doflocs))
    return type(mesh)(as_eight_nodes(mesh, p) if kind == "quad8" else p, mesh.t)


def as_eight_nodes(mesh: Any, p: np.ndarray) -> np.ndarray:
    """Middles of faces where the 8 nodes round them have them, so that the mesh is the body."""
    known = {tuple(edge): number for number, edge in enumerate(np.sort(mesh.edges, axis=0).T.tolist())}
    ends = np.sort([mesh.facets, np.roll(mesh.facets, -1, axis=0)], axis=0)
    edges = np.array([[known[tuple(edge)] for edge in row] for row in ends.transpose(1, 2, 0).tolist()])
    middles = p[:, mesh.dofs.edge_dofs[0, edges]].sum(axis=1)
    p[:, mesh.dofs.facet_dofs[0]] = 0.5 * middles - 0.25 * p[:, mesh.facets].sum(axis=1)
    return p


def onto_ball(x: np.ndarray) -> np.ndarray:
    """The unit cube onto the unit ball about the origin, its boundary onto the sphere."""
    y = 2 * x - 1
    largest, length = np.abs(y).max(axis=0), np.linalg.norm(y, axis=0)
    return y * largest / np.where(length > 0, length, 1.0)


def onto_octant(x: np.ndarray) -> np.ndarray:
    """The unit cube onto the part of the unit ball with positive coordinates."""
    largest, length = np.abs(x).max(axis=0), np.linalg.norm(x, axis=0)
    return x * largest / np.where(length > 0, length, 1.0)


def in_tetrahedra(mesh: Any) -> Any:
    """Hexahedra cut into 24 tetrahedra each about the middles of cells and faces: alike on all sides.

    scikit-fem's own cut goes by the numbers of vertices: neighbours may cut their face in two ways.
    """
    faces, cells = mesh.p[:, mesh.facets].mean(axis=1), mesh.p[:, mesh.t].mean(axis=1)
    first, last = mesh.nvertices, mesh.nvertices + mesh.nfacets
    t = [
        np.stack([mesh.t[a], mesh.t[b], first + mesh.t2f[i], last + np.arange(mesh.nelements)])
        for i, corners in enumerate(mesh.elem.refdom.facets)
        for a, b in zip(corners, np.roll(corners, -1), strict=True)
    ]
    return fem.MeshTet(np.hstack([mesh.p, faces, cells]), np.hstack(t))


def octant_shell(kind: str, n: int, layers: int, inner: float, outer: float) -> Any:
    """An eighth of a hollow ball about the origin: 3 n^2 faces on each sphere, or 12 n^2 triangles."""
    linear, curved, _ = KINDS[kind]
    number: dict[tuple[float, ...], int] = {}
    points, cells = [], []
    radii, slope = (
        np.linspace(inner, outer, layers + 1),
        np.tan(0.25 * np.pi * np.linspace(0, 1, n + 1)),
    )
    corners = [(0, 0, 0), (0, 0, 1), (0, 1, 0), (1, 0, 0), (0, 1, 1), (1, 0, 1), (1, 1, 0), (1, 1, 1)]
    for side, i, j, k in np.ndindex(3, n, n, layers):
        cell = []
        for di, dj, dk in corners:
            way = np.roll([1.0, slope[i + di], slope[j + dj]], side)
            x = way / np.linalg.norm(way) * radii[k + dk]
            key = tuple(np.round(x, 9))
            if key not in number:
                number[key] = len(points)
                points.append(x)
            cell.append(number[key])
        cells.append(cell)
    mesh = fem.MeshHex(np.array(points).T, np.array(cells).T)
    if linear is fem.MeshTet:
        size = np.linalg.norm(mesh.p, axis=0)
        radius = np.concatenate([size, size[mesh.facets].mean(axis=0), size[mesh.t].mean(axis=0)])
        mesh = in_tetrahedra(mesh)
        mesh = fem.MeshTet(mesh.p / np.linalg.norm(mesh.p, axis=0) * radius, mesh.t)
    if curved is linear:
        return mesh
    size = np.linalg.norm(mesh.p, axis=0)
    mesh = curved.from_mesh(mesh)
    parts = [size, size[mesh.edges].mean(axis=0)]
    if mesh.dofs.facet_dofs.size:
        parts += [size[mesh.facets].mean(axis=0), size[mesh.t].mean(axis=0)]
    p = mesh.doflocs / np.linalg.norm(mesh.doflocs, axis=0) * np.concatenate(parts)
    return type(mesh)(as_eight_nodes(mesh, p) if kind == "quad8" else p, mesh.t)


def shuffled(mesh: Any, seed: int = 0) -> Any:
    """The same mesh with vertices and elements in a random order, and elements begun elsewhere."""
    rng = np.random.default_rng(seed)
    new = rng.permutation(mesh.nvertices)
    p = np.empty((3, mesh.nvertices))
    p[:, new] = mesh.p[:, : mesh.nvertices]
    t = new[mesh.t][:, rng.permutation(mesh.nelements)]
    if t.shape[0] == 8:  # turn each hexahedron about its diagonal: a numbering as good as the first
        turn = np.array([0, 2, 3, 1, 6, 4, 5, 7])
        times = rng.integers(0, 3, t.shape[1])
        for _ in range(2):
            t = np.where(times > 0, t[turn], t)
            times -= 1
    else:
        t = t[rng.permuted(np.tile(np.arange(4), (t.shape[1], 1)), axis=1).T, np.arange(t.shape[1])]
    plain = (fem.MeshTet if t.shape[0] == 4 else fem.MeshHex)(p, t)
    return plain if type(mesh) in (fem.MeshTet, fem.MeshHex) else type(mesh).from_mesh(plain)


@dataclass(frozen=True)
class _Alike:
    """Meshes are alike if they have the same nodes in the same cells."""

    mesh: Any = field(compare=False)
    content: tuple[bytes, bytes]


def basis_on(mesh: Any, kind: str, order: int) -> Any:
    """A basis; of a mesh alike one that was there before: instances of a test make the same body."""
    if mesh.boundaries or mesh.subdomains:
        return fem.Basis(mesh, fem.ElementVector(KINDS[kind][2]()), intorder=order)
    return _basis(_Alike(mesh, (mesh.doflocs.tobytes(), mesh.t.tobytes())), kind, order)


@lru_cache(maxsize=32)
def _basis(alike: _Alike, kind: str, order: int) -> Any:
    return fem.Basis(alike.mesh, fem.ElementVector(KINDS[kind][2]()), intorder=order)


def body(mesh: Any, kind: str, **options: Any) -> Body:
    """A body whose stiffness is the identity, for what only needs its surfaces."""
    basis = basis_on(mesh, kind, 2)
    return Body(basis, sp.eye(basis.N), **options)


def elastic(
    mesh: Any,
    kind: str,
    name: str,
    *,
    E: float = 1.0,
    nu: float = 0.3,
    held: tuple[tuple[Any, tuple[int, ...]], ...] = (),
    push: tuple[Any, tuple[float, ...]] | None = None,
    press: tuple[Any, tuple[float, ...]] | None = None,
) -> Body:
    """An elastic body.

    `held` pairs a function of position with components that are prescribed where it holds; `push` one
    with the displacement of all of them there, `press` one with a traction.
    """
    order = 2 if kind in ("tri3", "quad4") else 4
    basis = basis_on(mesh, kind, order)
    parts = basis.split_indices()
    D = [
        dofs[where(basis.doflocs[:, dofs])] for where, axes in held for dofs in (parts[i] for i in axes)
    ]
    x, f = np.zeros(basis.N), None
    if push is not None:
        for i, value in enumerate(push[1]):
            x[parts[i][push[0](basis.doflocs[:, parts[i]])]] = value
    if press is not None:
        side = fem.FacetBasis(mesh, basis.elem, facets=mesh.facets_satisfying(press[0]), intorder=6)
        f = fem.LinearForm(lambda v, w: sum(t * v[i] for i, t in enumerate(press[1]))).assemble(side)
    stiffness = linear_elasticity(*lame_parameters(E, nu))
    return Body(
        basis,
        stiffness,
        f,
        D=np.unique(np.concatenate(D)) if D else None,
        x=x if D else None,
        name=name,
    )


def elastic_form(E: float, nu: float) -> Any:
    """The stiffness form of an isotropic solid, or of plane strain."""
    return linear_elasticity(*lame_parameters(E, nu))


def at(axis: int, value: float) -> Any:
    """A function of position: on the plane where a coordinate has a value."""
    return lambda x: np.isclose(x[axis], value, rtol=0, atol=1e-9)


def extruded(mesh, kind, height, E, nu, name, held, push=None):
    """A plane body, and the same extruded by one element in plane strain."""
    plane = {"quad4": fem.ElementQuad1, "quad9": fem.ElementQuad2}[kind]()
    n = mesh.nvertices
    p = np.vstack([np.hstack([mesh.p] * 2), np.repeat([0.0, height], n)])
    low, high = mesh.t, mesh.t + n
    t = np.stack([low[0], high[0], low[3], low[1], high[3], high[1], low[2], high[2]])
    solid = fem.MeshHex(p, t)
    solid = solid if kind == "quad4" else fem.MeshHex2.from_mesh(solid)
    bodies = []
    for m, element in ((mesh, plane), (solid, KINDS[kind][2]())):
        basis = fem.Basis(m, fem.ElementVector(element), intorder=4)
        parts = basis.split_indices()
        fixed = [parts[i][held(basis.doflocs[:, parts[i]])] for i in range(2)]
        x = np.zeros(basis.N)
        for i, value in enumerate(push or ()):
            x[fixed[i]] = value
        D = np.concatenate(fixed + ([parts[2]] if m is solid else []))
        stiffness = linear_elasticity(*lame_parameters(E, nu))
        bodies.append(Body(basis, stiffness, D=np.unique(D), x=x, name=name))
    return bodies
