"""Nodes and cells of bodies, as files and pictures have them."""

from __future__ import annotations

import numpy as np
import skfem
from numpy.typing import NDArray

from skfem_contact.bodies.body import Body
from skfem_contact.bodies.inputs import SUPPORTED

Array = NDArray[np.float64]

#: Nodes of a tetrahedron whose first two corners change places.
MIRRORED = (1, 0, 2, 3, 4, 6, 5, 8, 7, 9)


def body_nodes(body: Body) -> NDArray[np.int64]:
    """DOFs of each node of a body, shape (nodes, components).

    Vertices first, then edges, facets and interiors: the numbering of the DOFs of the scalar
    element, so nodal values of `skfem.Basis.project` go with it.
    """
    dofs, c = body.basis.dofs, body.components
    parts = (dofs.nodal_dofs, dofs.edge_dofs, dofs.facet_dofs, dofs.interior_dofs)
    # one node per entity: all supported elements have at most that
    table = [np.asarray(part).T for part in parts if np.asarray(part).shape[0] == c]
    return np.concatenate(table).astype(np.int64)


def body_cells(body: Body) -> tuple[str, NDArray[np.int64]]:
    """The type of cell in the words of meshio, and the nodes of each cell, (elements, nodes).

    Without nodes of the element that the cell does not have.
    """
    element = body.basis.elem
    inner = element.elem if isinstance(element, skfem.ElementVector) else element
    kind = next(name for cls, name in SUPPORTED.items() if isinstance(inner, cls))
    node = np.zeros(body.n, dtype=np.int64)
    nodes = body_nodes(body)
    node[nodes] = np.arange(len(nodes))[:, None]
    cells = node[body.basis.dofs.element_dofs[:: body.components]]
    cells = cells[: int("".join(filter(str.isdigit, kind)) or len(cells))]
    if kind.startswith("hexahedron"):  # scikit-fem counts the corners of a brick in another order
        from skfem.io.meshio import HEX_MAPPING  # which imports meshio

        cells = cells[HEX_MAPPING[: len(cells)]]
    if kind.startswith("tetra"):  # scikit-fem has them of either orientation, readers of files of one
        a, b, c, d = body.dof_points[nodes[cells[:4], 0]]
        inside_out = np.einsum("ij,ij->i", np.cross(b - a, c - a), d - a) < 0
        cells[:, inside_out] = cells[np.array(MIRRORED[: len(cells)])][:, inside_out]
    return kind, cells.T


def three(vectors: Array) -> Array:
    """Vectors with three components, as VTK wants them, shape (m, 3)."""
    return np.pad(vectors, ((0, 0), (0, 3 - vectors.shape[1])))
