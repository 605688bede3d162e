r"""Second-order faces: what their tractions leave between the nodes, and the linear faces within them.

Multipliers of second-order faces scatter between corners and middles of edges, by some percent where
both sides are curved. What a face makes of it depends on its shape functions: serendipity ones have the
fourfold opposite of the corners' in the middle, corners of quadratic triangles count next to nothing.
So the difference of the nodal values to parabolas through those around, by least squares with the areas
of the nodes, is interpolated on each face as the traction is, and integrated.

Where contact ends shape functions matter less: there the faces are cut into linear ones along their
nodes, for `faces`.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from skfem_contact.bodies.areas import tributary_areas
from skfem_contact.bodies.facet_kinds import kind_of
from skfem_contact.bodies.facets import twin_edges
from skfem_contact.bodies.normal_field import sizes_and_normals
from skfem_contact.bodies.surface import ContactSurface

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]


def cut(surface: ContactSurface) -> ContactSurface:
    """The linear faces between the nodes of a second-order surface; a linear one as it is."""
    if not surface.kind.quadratic:
        return surface
    parts = surface.kind.linear_parts
    facets = np.concatenate([surface.facets[:, part] for part in parts])
    kind = kind_of(3, facets.shape[1])
    points, twins = surface.points, twin_edges(facets)
    return replace(
        surface,
        facets=facets,
        twins=twins,
        mesh_facets=np.tile(surface.mesh_facets, len(parts)),
        area=tributary_areas(points, facets, kind, surface.body.measure, surface.label),
        **sizes_and_normals(points, facets, kind, surface.held, twins),
    )


def ripple(surface: ContactSurface, faces: Mask, off: Array) -> Array:
    """Square integrals over faces of what nodal values (m, k) are off, by nodes, (m,)."""
    out = np.zeros(len(surface.points))
    at, weight = surface.kind.quadrature(4)
    nodes = surface.facets[faces]
    between = np.einsum("qa,fak->fqk", surface.kind.shapes(at)[0], off[nodes])
    square = np.einsum("q,fqk->f", weight / weight.sum(), between**2) * surface.facet_areas[faces]
    np.add.at(out, nodes, square[:, None] / nodes.shape[1])
    return out
