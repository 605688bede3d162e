"""Bodies, as the user gives them, with stiffness and loads, and the surfaces that may touch.

* `inputs`, `selection`: matrices, vectors, sets of DOFs and facets as users pass them, checked;
  nodes of facets, and pieces of a mesh; tractions and displacements by the names of boundaries;
* `assembly`: points of integration, gradients, and from a form stiffness and moduli;
* `member`: what is asked of a body, and its rigid modes; `body`, `system`: one, and several under one
  numbering; `nonlinear`: bodies that yield or stretch, `equations`: their equations; a
  stiffness that is held elsewhere, by a backend;
* `surface`: a boundary as contact sees it, of a body or of none;
* `facet_kinds`: kinds of facets, their shape functions, areas and normals;
* `normal_field`: what lies across edges, averaged normals, and where a surface turns;
* `quadrics`: the smooth boundaries that nodes lie on.
"""

from typing import TYPE_CHECKING

from skfem_contact.records import entrances

if TYPE_CHECKING:
    from skfem_contact.bodies.surface import ContactSurface as ContactSurface
    from skfem_contact.bodies.system import System as System
    from skfem_contact.bodies.system import stack as stack

__all__ = ["ContactSurface", "System", "stack"]

__getattr__, __dir__ = entrances(
    __name__,
    __all__,
    {
        "assembly": "assembled",
        "facet_kinds": "FacetKind KINDS kind_of positive_functions",
        "inputs": "SUPPORTED",
        "normal_field": "angle_between kink_angles twin_edges",
        "quadrics": "tangents",
        "selection": "pieces",
        "surface": "bare_surface ContactSurface",
        "system": "stack System",
    },
)
