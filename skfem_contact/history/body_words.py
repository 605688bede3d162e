"""What of a body may be other than meant: lines of the dry run that no solver would notice.

Each of them may be meant, so none is a warning: a slit, a body of several pieces, the stiffness of a
body under load.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from skfem_contact.bodies.body import Body
from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.conditions.contact import Contact
from skfem_contact.digits import SOLVED
from skfem_contact.history.thresholds import RESISTED, UNRESISTED
from skfem_contact.trees import pairs_within

Array = NDArray[np.float64]
Index = NDArray[np.intp]


def body_words(body: Body, own: bool, contacts: Sequence[Contact]) -> list[str]:
    """Lines about the mesh, the supports and the stiffness of one body; none as a rule.

    Parameters
    ----------
    body : Body
    own : bool
        Whether the stiffness is the body's own, and not another one that the solver was given.
    contacts : sequence of Contact
        What stands on both sides of them is known to be apart.
    """
    surfaces = [s for c in contacts for s in (c.secondary, c.primary) if isinstance(s, ContactSurface)]
    dofs = [s.dofs[:, 0] for s in surfaces if s.body is body]
    told = [f"  K was assembled by scikit-fem: {body.by_skfem}"] if own and body.by_skfem else []
    return [
        *told,
        *_apart(body, np.unique(np.concatenate([np.zeros(0, dtype=np.intp), *dofs]))),
        *_half_held(body),
        *_own_turn(body),
    ]


def _apart(body: Body, in_contact: Index) -> list[str]:
    """Nodes at one place that no element joins, and that no contact keeps from overlapping."""
    mesh = body.basis.mesh
    nodes = np.unique(mesh.facets[:, mesh.boundary_facets()])
    x = mesh.p[:, nodes].T
    pairs = pairs_within(x, SOLVED * float(np.ptp(mesh.p, axis=1).max()))
    known = np.isin(body.basis.nodal_dofs[0, nodes], in_contact)
    count = int(np.sum(~known[pairs].all(axis=1)))
    if not count:
        return []
    return [
        f"  {count} of its nodes lie where another one is, and nothing joins the two or keeps them "
        "from overlapping: as meant, if it is a slit that opens; else the parts of the mesh were not "
        "merged (mesh.remove_duplicate_nodes())"
    ]


def _half_held(body: Body) -> list[str]:
    """Facets whose corners are prescribed and whose other nodes are free, two and more side by side."""
    basis = body.basis
    mesh, facets = basis.mesh, basis.mesh.boundary_facets()
    between = basis.facet_dofs if mesh.dim() == 2 else basis.edge_dofs
    if len(between) != len(basis.nodal_dofs):
        return []  # linear elements
    middle = between[:, facets[None] if mesh.dim() == 2 else mesh.f2e[:, facets]]
    held = np.zeros(body.n, dtype=bool)
    held[body.D] = True
    corners = mesh.facets[:, facets]
    half = held[basis.nodal_dofs[:, corners]].all(axis=1) & ~held[middle].any(axis=1)
    found = np.zeros(half.shape[1], dtype=bool)
    for some in half:
        # one alone may be the end of a strip one element wide, whose two sides are held
        met = np.bincount(corners[:, some].ravel(), minlength=mesh.p.shape[1]) > 1
        found |= some & met[corners].any(axis=0)
    if not found.any():
        return []
    return [
        f"  D holds the corners of {int(found.sum())} facets and not the nodes between them: as from "
        "get_dofs(...).nodal; get_dofs(...).all() has all nodes of quadratic elements"
    ]


def _own_turn(body: Body) -> list[str]:
    """A stiffness that resists rotations of the body and no translations."""
    if body.components == 1 or body.axisymmetric:
        return []
    R = body.rigid_modes
    turns = np.array(["rotation" in name for name in body.rigid_mode_names])
    forces = np.linalg.norm(body.K @ R, axis=0)
    scale = np.linalg.norm(body.K.diagonal()[:, None] * R, axis=0)
    resisted = forces / np.where(scale > 0, scale, 1.0)
    if resisted[~turns].max() > UNRESISTED or resisted[turns].max() < RESISTED:
        return []
    return [
        "  K resists rotations of the whole body and no translations: as meant, if it is that of a "
        "body under load; else it was assembled on another mesh (scaled, turned or moved nodes since)"
    ]
