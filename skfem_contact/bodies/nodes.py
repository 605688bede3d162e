"""The nodes of a surface by their numbers in the mesh, their DOFs, and their order."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from skfem_contact.arrays import Index, Mask
from skfem_contact.bodies.member import Member
from skfem_contact.bodies.selection import mesh_edges


def facet_nodes(basis: Any, numbers: Index, vertices: Index) -> Index:
    """The nodes of facets, shape (nf, k): corners, then middles of edges of faces, then the middle.

    Of the mesh vertex v has the number v, edge e ``nvertices + e``, and facet f
    ``nvertices + nedges + f``; in the plane there are no edges.
    """
    mesh, columns, first = basis.mesh, [vertices], basis.mesh.nvertices
    if basis.edge_dofs.size:
        columns.append(first + mesh_edges(mesh, vertices, np.roll(vertices, -1, axis=1)))
        first += mesh.edges.shape[1]
    if basis.facet_dofs.size:
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
