"""Selection of facets by names, functions of position, numbers, and lists of these."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import connected_components
from skfem.assembly import DofsView

from skfem_contact.arrays import Index, Mask
from skfem_contact.bodies.inputs import unknown_boundary
from skfem_contact.bodies.member import Member
from skfem_contact.errors import InputError, warn


def name_of(where: Any) -> str:
    if isinstance(where, str):
        return where
    if isinstance(where, list | tuple | set) and where and all(isinstance(w, str) for w in where):
        return "+".join(sorted(where) if isinstance(where, set) else where)
    name = getattr(where, "__name__", "<lambda>")
    return "surface" if name == "<lambda>" else name


def select_facets(mesh: Any, where: Any, nodes: bool, label: str) -> np.ndarray:
    """Boundary facets that `where` means."""
    chosen = np.unique(_normalize(mesh, where, nodes, label))
    on_boundary = chosen[mesh.f2t[1, chosen] < 0]
    if on_boundary.size:
        return on_boundary
    if chosen.size:
        raise InputError(
            f"surface {label!r}: all of the {chosen.size} facets selected are inside the mesh; "
            "contact needs two lips with nodes of their own (split the mesh along the interface)"
        )
    if isinstance(where, str):
        raise InputError(
            f"surface {label!r} has no facets: boundary {where!r} of the mesh is empty. Look at how it "
            "was selected: a function of position has to hold at the midpoints of facets"
        )
    lower, upper = mesh.doflocs.min(axis=1), mesh.doflocs.max(axis=1)
    raise InputError(
        f"surface {label!r} has no facets: no facet {'with all nodes' if nodes else 'midpoint'} "
        f"satisfies `where` in the mesh, which extends from {written(lower)} to {written(upper)}. "
        + (
            "Allow for round-off (np.isclose)"
            if nodes
            else "Allow for round-off (np.isclose), or for curved boundaries try nodes=True"
        )
    )


def _normalize(mesh: Any, where: Any, nodes: bool, label: str) -> np.ndarray:
    if isinstance(where, list | tuple | set | frozenset):
        parts = [_normalize(mesh, part, nodes, label) for part in where]
        return np.concatenate([np.zeros(0, dtype=np.int64), *parts])
    if isinstance(where, str):
        if where not in (mesh.boundaries or {}):
            raise InputError(unknown_boundary(where, mesh))
        return np.asarray(mesh.boundaries[where], dtype=np.int64)
    if callable(where):
        return _satisfying(mesh, where, nodes, label)
    if where is None:
        return mesh.boundary_facets()
    if isinstance(where, DofsView):
        return _facets_of_dofs(mesh, where, label)
    numbers = np.atleast_1d(np.asarray(where))
    if numbers.dtype == bool and numbers.shape == (mesh.nfacets,):
        return np.flatnonzero(numbers)
    if numbers.size == 0:
        return np.zeros(0, dtype=np.int64)
    if numbers.dtype.kind not in "iu" or numbers.ndim != 1:
        raise InputError(
            f"surface {label!r}: where is a {type(where).__name__} of {numbers.dtype}; it may be "
            "a boundary name, a function of position, facet numbers, or a list of these"
        )
    if numbers.min() < 0 or numbers.max() >= mesh.nfacets:
        raise InputError(
            f"surface {label!r}: facet numbers {numbers.min()} to {numbers.max()}, the mesh has "
            f"facets 0 to {mesh.nfacets - 1}; are these node numbers, or numbers of another mesh?"
        )
    inside = mesh.f2t[1, numbers] >= 0
    if inside.any() and not inside.all():
        warn(
            f"surface {label!r}: {np.count_nonzero(inside)} of the {len(numbers)} facet numbers given "
            "are inside the mesh and left out. Usually these are numbers of DOFs or nodes. A "
            "boundary name or a function of position selects facets of the boundary only."
        )
    return numbers.astype(np.int64)


def _facets_of_dofs(mesh: Any, dofs: DofsView, label: str) -> np.ndarray:
    """The facets that were asked for their DOFs; known where facets have some of their own."""
    facets = dofs.facet_ix
    if isinstance(facets, np.ndarray) and facets.size and dofs.obj.topo is mesh:
        return facets.astype(np.int64)
    raise InputError(
        f"surface {label!r}: where is what get_dofs returned, DOF numbers, and which facets they "
        f"belong to is not known{'' if dofs.obj.topo is mesh else ' (of another mesh, moreover)'}. "
        "Give what get_dofs was given: the boundary name, the function of position or facet numbers."
    )


def _satisfying(mesh: Any, test: Any, nodes: bool, label: str) -> np.ndarray:
    def ask(x: np.ndarray) -> np.ndarray:
        answer = np.asarray(test(x))
        if answer.shape != x.shape[1:] or answer.dtype != bool:
            raise InputError(
                f"surface {label!r}: the function returned {answer.dtype} of shape {answer.shape} "
                f"for positions of shape {x.shape}; it must return one bool for each position, as "
                "in lambda x: x[1] > 0.9"
            )
        return answer

    if not nodes:
        return np.flatnonzero(ask(mesh.p[:, mesh.facets].mean(axis=1)))
    on_facets = facet_nodes(mesh, mesh.dofs, np.arange(mesh.nfacets), mesh.facets.T)
    return np.flatnonzero(ask(mesh.doflocs)[on_facets].all(axis=1))


def mesh_edges(mesh: Any, start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """Numbers of the edges of a mesh between vertices, of the shape that `start` and `end` have."""
    count = np.int64(mesh.nvertices)
    known = np.min(mesh.edges, axis=0) * count + np.max(mesh.edges, axis=0)
    order = np.argsort(known)
    wanted = np.minimum(start, end) * count + np.maximum(start, end)
    return order[np.searchsorted(known, wanted, sorter=order)]


def written(point: np.ndarray) -> str:
    """Coordinates for a message."""
    return "(" + ", ".join(f"{value:.6g}" for value in point) + ")"


# -- nodes of facets -------------------------------------------------------------------------------


def facet_nodes(mesh: Any, dofs: Any, numbers: Index, vertices: Index) -> Index:
    """The nodes of facets, shape (nf, k): corners, then middles of edges of faces, then the middle.

    Of the mesh vertex v has the number v, edge e ``nvertices + e``, and facet f
    ``nvertices + nedges + f``; in the plane there are no edges.
    """
    columns, first = [vertices], mesh.nvertices
    if dofs.edge_dofs.size:
        columns.append(first + mesh_edges(mesh, vertices, np.roll(vertices, -1, axis=1)))
        first += mesh.edges.shape[1]
    if dofs.facet_dofs.size:
        columns.append(first + numbers[:, None])
    return np.concatenate(columns, axis=1)


def node_dofs(basis: Any, nodes: Index, components: int) -> NDArray[np.int32]:
    """The DOFs of nodes by their numbers of `facet_nodes`, (len(nodes), components)."""
    mesh = basis.mesh
    edges = mesh.edges.shape[1] if basis.edge_dofs.size else 0
    vertices = mesh.nvertices  # counted whenever one asks
    starts = 0, vertices, vertices + edges
    dofs = np.empty((len(nodes), components), dtype=np.int32)
    for start, table in zip(starts, (basis.nodal_dofs, basis.edge_dofs, basis.facet_dofs), strict=True):
        mine = (nodes >= start) & (nodes < start + table.shape[1])
        if table.size:
            dofs[mine] = table[:, nodes[mine] - start].T
    return dofs


def as_met(ids: Index) -> tuple[Index, Index]:
    """Nodes of facets (nf, k) in the order in which facets meet them, and facets by these places.

    >>> nodes, facets = as_met(np.array([[7, 3], [3, 5]]))
    >>> nodes.tolist(), facets.tolist()
    ([7, 3, 5], [[0, 1], [1, 2]])
    """
    flat = ids.ravel()
    place = np.zeros(flat.max(initial=-1) + 1, dtype=np.intp)
    place[flat[::-1]] = np.arange(len(flat))[::-1]  # of several places the last one, the first met
    nodes = flat[place[flat] == np.arange(len(flat))]
    place[nodes] = np.arange(len(nodes))
    return nodes, place[ids]


def held_components(body: Member, dofs: np.ndarray) -> Mask:
    """Prescribed components of nodes, (m, d); a scalar field has no directions to hold."""
    if dofs.shape[1] != body.dim or not len(body.D):
        return np.zeros((len(dofs), body.dim), dtype=bool)
    held = np.zeros(body.n, dtype=bool)
    held[body.D] = True
    return held[dofs]


# -- pieces of a mesh ------------------------------------------------------------------------------


def pieces(elements: Index, n: int) -> Index:
    """Number of the connected piece that each of n DOFs belongs to, shape (n,).

    Parameters
    ----------
    elements : ndarray of int, shape (k, ne)
        DOFs of each element.
    n : int

    Examples
    --------
    >>> pieces(np.array([[0, 1, 4], [1, 2, 3]]), 5).tolist()
    [0, 0, 0, 1, 1]
    """
    # DOFs are the first nodes of the graph, and elements the last: their rows are what is known
    size = n + elements.shape[1]
    start = np.zeros(size + 1, dtype=elements.dtype)
    start[n:] = np.arange(0, elements.size + 1, len(elements))
    graph = csr_matrix((np.ones(elements.size), elements.T.ravel(), start), shape=(size, size))
    return np.asarray(connected_components(graph, directed=False)[1][:n], dtype=np.intp)
