"""Facets by names, functions of position and numbers; what acts on boundaries, by their names.

Facets are seen from outside of their body, and have a length or an area.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

import numpy as np
import skfem
from numpy.typing import NDArray
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import connected_components
from skfem.assembly import DofsView

from skfem_contact.arguments import number, numbers, shown
from skfem_contact.arrays import Array, Index, Mask, check_finite, sizes
from skfem_contact.bodies.assembly import boundary_basis
from skfem_contact.bodies.facet_kinds import FacetKind, area_elements, area_vectors, node_positions
from skfem_contact.bodies.inputs import facets_named
from skfem_contact.bodies.member import Member
from skfem_contact.digits import COMPUTED, GIVEN
from skfem_contact.errors import InputError, warn
from skfem_contact.trees import pairs_within


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
        return np.asarray(facets_named(where, mesh), dtype=np.int64)
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


def seen_from_outside(mesh: Any, numbers: Index) -> tuple[Index, Index]:
    """Facets of the boundary and their vertices: of lines with the body on the left, of faces
    counter-clockwise seen from outside.

    Returns
    -------
    numbers : ndarray of int, shape (nf,)
        Lines as they are, faces in the order of their elements.
    vertices : ndarray of int, shape (nf, c)
    """
    element, d = mesh.f2t[0].take(numbers), len(mesh.p)
    if d == 3:
        order = np.argsort(element, kind="stable")
        numbers, element = numbers[order], element[order]
    vertices = mesh.facets.take(numbers, axis=1).T.astype(np.intp)
    x, c = node_positions(mesh.p.T, vertices), vertices.shape[1]
    outward = x.mean(axis=1) - mesh.p.take(mesh.t.take(element, axis=1), axis=1).mean(axis=1).T
    wrong = np.einsum("fd,fd->f", area_vectors(x), outward) < 0
    backward = (3 - d - np.arange(c)) % c  # the first corner of a face stays the first
    return numbers, np.where(wrong[:, None], vertices[:, backward], vertices)


def check_facets(
    points: Array, facets: Index, kind: FacetKind, numbers: Index, mesh: Any, label: str
) -> None:
    """Refuse facets without length or area, faces that fold over, and facets given twice.

    Raises
    ------
    InputError
    """
    facet, size, slit = ("facets", "length", "slit") if kind.dim == 1 else ("faces", "area", "crack")
    corners = node_positions(points, facets[:, : kind.corners])
    middle = corners.mean(axis=1)
    side = sizes(corners - corners[:, np.arange(kind.corners) - 1])
    # coordinates carry 16 digits of the mesh's extent; anything near that has no direction
    small = COMPUTED * np.ptp(mesh.doflocs, axis=1).max()
    none, folded = side.min(axis=1) <= small, np.zeros(0, dtype=bool)
    if kind.dim == 2:
        area = area_elements(points, facets, kind, kind.derivatives)
        none |= sizes(area[:, -1]) <= small * side.max(axis=1)
        folded = np.einsum("fqd,fd->fq", area, area[:, -1]).min(axis=1) <= 0
    bad = np.flatnonzero(none)
    if bad.size:
        raise InputError(
            f"surface {label!r}: {bad.size} {facet} have no {size}, the first is mesh facet "
            f"{numbers[bad[0]]} at {written(points[facets[bad[0], 0]])}; remove the degenerate "
            "elements from the mesh"
        )
    bad = np.flatnonzero(folded)
    if bad.size:
        raise InputError(
            f"surface {label!r}: {bad.size} faces fold over, the first is mesh facet "
            f"{numbers[bad[0]]} at {written(middle[bad[0]])}: at one of its nodes it "
            "looks into the body. Usually an element is turned inside out, or middle nodes are far off "
            "the middles of their edges; correct the mesh"
        )
    pairs = pairs_within(middle, max(small, GIVEN * side.min()))
    if len(pairs):
        i, j = pairs[0]
        raise InputError(
            f"surface {label!r}: {len(pairs)} {facet} lie twice at the same place, for example "
            f"mesh facets {numbers[i]} and {numbers[j]} at {written(middle[i])}. Both lips of a "
            f"{slit} can not be one surface: select each by its own boundary name or facet numbers"
        )


def boundary_dofs(basis: Any, name: str, what: str) -> Index:
    """DOFs of all components on a boundary of the mesh, by its name; `what` begins the message."""
    if not isinstance(name, str):
        raise InputError(f"{what}: {shown(name)} is not the name of a boundary, which is a string")
    facets_named(name, basis.mesh, f"{what}: ")
    return np.asarray(np.unique(basis.get_dofs(name).flatten()), dtype=np.int64)


def tractions(
    given: Mapping[str, Any], basis: Any, measure: Callable[[Array], Array] | None, what: str
) -> Array:
    """The load of tractions on boundaries, shape (n,) [force].

    Parameters
    ----------
    given : dict
        By name of a boundary a traction of d numbers, in global axes [stress]; or one number, a
        pressure against the outward normal; of a scalar field the flux into the body; or a function
        of the position that returns one of these. What several boundaries carry is added.
    basis : skfem.CellBasis
    measure : callable or None
        Weight of the area, as in `Body`.
    what : str
        Begins the messages.

    Examples
    --------
    A pressure of 3 on the top of a unit square is a load of 1.5 at each of its two nodes:

    >>> basis = skfem.Basis(skfem.MeshQuad().with_defaults(), skfem.ElementVector(skfem.ElementQuad1()))
    >>> load = tractions({"top": (0.0, -3.0)}, basis, None, "f")
    >>> load[basis.get_dofs("top").nodal["u^2"]].round(12).tolist(), round(float(load.sum()), 12)
    ([-1.5, -1.5], -3.0)
    >>> bool(np.all(load == tractions({"top": 3.0}, basis, None, "f")))
    True
    """
    load = np.zeros(basis.N)
    for name, value in given.items():
        boundary_dofs(basis, name, what)
        place = f"{what} on boundary {name!r}"
        stress: Any = partial(_at, value, place)
        if not callable(value):
            stress = _components(value, basis, place, "a traction [stress]", False, pressure=True)
        check_not_lost([stress] if callable(value) else stress, basis, name, place)
        if len(basis.mesh.boundaries[name]):
            load += _form(stress, measure).assemble(boundary_basis(basis, name))
    return load


def check_not_lost(values: list[Any], basis: Any, name: str, place: str) -> None:
    """Refuse values on a boundary without facets, unless they are none: scripts may name it for all."""
    if any(values) and not len(basis.mesh.boundaries[name]):
        raise InputError(
            f"{place}: this boundary has no facets in the mesh, so that the values would be lost. Look "
            "at how it was selected: a function of position has to hold at the midpoints of facets"
        )


def _at(function: Callable[[Array], Any], place: str, x: Array) -> list[Array]:
    """What a user's function says of the traction at positions x (d, nf, q): d components, or one."""
    usage = f"it must return {len(x)} numbers for each position, or one for a pressure"
    given, what = function(x), f"{place}: what the function returned"
    parts = given if isinstance(given, list | tuple) or np.ndim(given) == x.ndim else [given]
    found = [numbers(part, what, usage) for part in parts]
    if len(found) not in (1, len(x)) or any(part.shape not in ((), x.shape[1:]) for part in found):
        shapes = ", ".join(str(part.shape) for part in found)
        raise InputError(f"{what} has the shapes {shapes} for positions of shape {x.shape}; {usage}")
    for part in found:
        check_finite(np.ravel(part), what, "position")
    return found


def _form(given: Any, measure: Callable[[Array], Array] | None) -> skfem.LinearForm:
    def power(v: Any, w: Any) -> Any:
        stress = given(np.asarray(w.x)) if callable(given) else given
        if v.ndim > 2 and len(stress) == 1:  # a pressure
            density = -stress[0] * sum(w.n[k] * part for k, part in enumerate(v))
        else:
            density = stress[0] * v if v.ndim == 2 else sum(s * v[k] for k, s in enumerate(stress))
        return density if measure is None else density * measure(np.asarray(w.x))

    return skfem.LinearForm(power)


def displacements(
    given: Mapping[str, Any], before: Array, basis: Any, component: Index, D: Index, what: str
) -> Array:
    """Constant displacements on boundaries, the others as before, shape (n,) [length].

    Parameters
    ----------
    given : dict
        By name of a boundary d numbers, in global axes; of a scalar field one number. None for a
        component that is free there, such as the one along a symmetry plane.
    before : ndarray, shape (n,)
        Where nothing is named.
    basis : skfem.CellBasis
    component : ndarray of int, shape (n,)
        That every DOF stands for.
    D : ndarray of int
        Prescribed DOFs.
    what : str
        Begins the messages.

    Examples
    --------
    >>> basis = skfem.Basis(skfem.MeshQuad().with_defaults(), skfem.ElementVector(skfem.ElementQuad1()))
    >>> top = basis.get_dofs("top").nodal["u^2"]
    >>> x = displacements({"top": (None, -0.1)}, np.zeros(8), basis, np.arange(8) % 2, top, "x")
    >>> bool(np.all(x[top] == -0.1)), float(x.sum())
    (True, -0.2)
    """
    out, by = np.array(before), np.full(len(before), -1)
    names = list(given)
    for i, name in enumerate(names):
        dofs = boundary_dofs(basis, name, what)
        place = f"{what} on boundary {name!r}"
        values = _components(given[name], basis, place, "a displacement", True)
        check_not_lost(values, basis, name, place)
        for k, value in enumerate(values):
            mine = dofs[component[dofs] == k]
            held = np.isin(mine, D)
            if value is None and held.size and held.all():
                raise InputError(
                    f"{place}: component {'xyz'[k]} is None, which means free, but D prescribes it "
                    "there: give its value (0.0 holds it), or take it out of D."
                )
            if value is None:
                continue
            if not held.all():
                raise InputError(
                    f"{place}: component {'xyz'[k]} is {value:g}, but D of the body does not have "
                    f"{int((~held).sum())} of its {len(mine)} DOFs there. Only prescribed DOFs can be "
                    f"given values: name the boundary in D of Body(...), or write None where it is "
                    "free."
                )
            clash = mine[(by[mine] >= 0) & (out[mine] != value)]
            if len(clash):
                raise InputError(
                    f"{place}: component {'xyz'[k]} is {value:g}, but boundary "
                    f"{names[by[clash[0]]]!r}, which shares {len(clash)} DOFs with it, gives "
                    f"{out[clash[0]]:g}. Give both the same value, or one of them None."
                )
            out[mine], by[mine] = value, i
    return out


def _components(
    value: Any, basis: Any, what: str, kind: str, free: bool, pressure: bool = False
) -> list[float | None]:
    """One number for each component, or None where that is allowed; or the one of a pressure."""
    count = basis.mesh.dim() if isinstance(basis.elem, skfem.ElementVector) else 1
    usage = f"give {kind} of {count} numbers" if count > 1 else f"give {kind} of one number"
    usage += ", None for components that are free" if free else ""
    usage += ", or one number for a pressure" if pressure and count > 1 else ""
    listed = isinstance(value, list | tuple) or (isinstance(value, np.ndarray) and value.ndim == 1)
    given = list(value) if listed else [value]
    if len(given) != count and (listed or not pressure):
        raise InputError(f"{what} is {shown(value)}; {usage}")
    parts = [None if free and v is None else number(v, what, usage) for v in given]
    if not all(v is None or np.isfinite(v) for v in parts):
        raise InputError(f"{what} is {shown(value)}, which is not finite; {usage}")
    return parts
