"""Selection of facets by names, functions of position, numbers, and lists of these."""

from __future__ import annotations

from typing import Any

import numpy as np
from skfem.assembly import DofsView

from skfem_contact.bodies.inputs import unknown_boundary
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
    chosen = ask(mesh.p)[mesh.facets].all(axis=0)
    # the middle nodes of a quadratic mesh: of edges and faces in 3-D, of facets in 2-D
    if mesh.dofs.edge_dofs.size:
        middle = ask(mesh.doflocs[:, mesh.dofs.edge_dofs[0]])
        chosen &= middle[mesh_edges(mesh, mesh.facets, np.roll(mesh.facets, -1, axis=0))].all(axis=0)
    if mesh.dofs.facet_dofs.size:
        chosen &= ask(mesh.doflocs[:, mesh.dofs.facet_dofs[0]])
    return np.flatnonzero(chosen)


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
