"""Results to files that ParaView opens: all bodies in one grid, the contact surfaces in a second.

A history becomes one pair of files per load step and a collection (`.pvd`) that lists them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import skfem
from numpy.typing import NDArray

from skfem_contact.answers.result import ContactResult
from skfem_contact.answers.values import ContactValues
from skfem_contact.arguments import known_keywords
from skfem_contact.bodies.body import Body
from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.errors import InputError
from skfem_contact.output.stress import field_name

if TYPE_CHECKING:
    import meshio

Array = NDArray[np.float64]
Stress = Callable[[Body, Array], Array]

#: What meshio calls the cells of each element, whose nodes are where its DOFs are.
CELLS = {
    skfem.ElementTriP1: "triangle",
    skfem.ElementTriP2: "triangle6",
    skfem.ElementQuad1: "quad",
    skfem.ElementQuadS2: "quad8",
    skfem.ElementQuad2: "quad9",
    skfem.ElementTetP1: "tetra",
    skfem.ElementTetP2: "tetra10",
    skfem.ElementHex1: "hexahedron",
    skfem.ElementHexS2: "hexahedron20",
    skfem.ElementHex2: "hexahedron27",
}
#: The same for facets, by dimension of space and number of nodes.
FACETS = {
    (2, 2): "line",
    (2, 3): "line3",
    (3, 3): "triangle",
    (3, 4): "quad",
    (3, 6): "triangle6",
    (3, 8): "quad8",
    (3, 9): "quad9",
}
EXTENSIONS = (".vtu", ".vtk")


@known_keywords()
def write(
    path: str | Path, result: ContactResult, *, stress: Stress | None = None
) -> tuple[Path, Path]:
    """Write a result: the bodies to `path`, the contact surfaces to ``<stem>_contact``.

    Bodies keep nodes of their own also where they touch. Both files hold the undeformed geometry
    and the field ``displacement``, to warp by.

    Parameters
    ----------
    path : str or Path
        Ends in ``.vtu`` or ``.vtk``; missing folders are made.
    result : ContactResult
    stress : callable, optional
        ``stress(body, u)`` returns a number for each node of the body, such as
        `skfem_contact.von_mises`; written by the name of the function, ``stress`` for a lambda.

    Returns
    -------
    bodies, contacts : Path
        The two files. The first has the point data ``displacement`` (3 components) or, for scalar
        problems, ``u``, and the cell data ``body`` (1 for the first). The second has the point
        data of `ContactValues`: ``pressure``, ``traction`` on the secondary, ``gap`` (NaN where
        there is no partner), ``slip``, ``status`` (0 open, 1 stick, 2 slip), ``tangential_force``,
        and the cell data ``contact`` (1 for the first). Slip and tangential force are one number
        along the tangent in 2-D and a vector in global axes in 3-D.

    Raises
    ------
    InputError
        If the extension is unknown, or `stress` returns something else than a number per node.
    """
    path = Path(path)
    if path.suffix.lower() not in EXTENSIONS:
        raise InputError(
            f"can not write {path.name!r}: the extension {path.suffix!r} is not one of "
            f"{', '.join(EXTENSIONS)}. Use write('{path.stem}.vtu', result), or write_series for "
            "a history; other formats by `meshio convert`."
        )
    path.parent.mkdir(parents=True, exist_ok=True)
    other = path.with_name(f"{path.stem}_contact{path.suffix}")
    bodies_grid(result, stress).write(path)
    contact_grid(result).write(other)
    return path, other


@known_keywords()
def write_series(
    path: str | Path,
    results: Iterable[ContactResult],
    *,
    times: Sequence[float] | None = None,
    stress: Stress | None = None,
) -> Path:
    """Write a history as a ParaView collection ``<stem>.pvd``.

    Step 7 is in ``<stem>_0007.vtu`` and ``<stem>_0007_contact.vtu``. The collection is renewed
    with every step, so what an interrupted history has reached can be opened.

    Parameters
    ----------
    path : str or Path
        Ends in ``.pvd``; missing folders are made.
    results : iterable of ContactResult
        A list, or ``solver.history(...)`` itself.
    times : sequence of float, optional
        Of each step. By default the load factors where they increase from step to step, else the
        numbers 0, 1, 2, ... of the steps.
    stress : callable, optional
        As in `write`.

    Returns
    -------
    Path
        The collection.

    Raises
    ------
    InputError
        If the extension is not ``.pvd``, or there are fewer times than results.
    """
    path = Path(path)
    if path.suffix.lower() != ".pvd":
        raise InputError(
            f"can not write a history to {path.name!r}: a series is a ParaView collection. Use "
            f"write_series('{path.stem}.pvd', results); a single result goes to write(...)."
        )
    path.parent.mkdir(parents=True, exist_ok=True)
    files: list[tuple[Path, Path]] = []
    factors: list[float | None] = []
    _collection(path, [], [])
    for i, result in enumerate(results):
        if times is not None and i >= len(times):
            raise InputError(f"times has {len(times)} entries, but there are more results than that.")
        step = path.with_name(f"{path.stem}_{i:04d}.vtu")
        files.append(write(step, result, stress=stress))
        factors.append(result.factor)
        _collection(path, files, _clock(factors) if times is None else times[: i + 1])
    return path


def _clock(factors: Sequence[float | None]) -> list[float]:
    """Load factors if they can serve as time, which has to increase; numbers of steps if not."""
    known = [float(factor) for factor in factors if factor is not None]
    if len(known) == len(factors) and all(np.diff(known) > 0):
        return known
    return [float(i) for i in range(len(factors))]


def _collection(path: Path, files: list[tuple[Path, Path]], times: Sequence[float]) -> None:
    from xml.etree import ElementTree  # only lists of files need it

    root = ElementTree.Element("VTKFile", type="Collection", version="0.1")
    listing = ElementTree.SubElement(root, "Collection")
    for pair, time in zip(files, times, strict=True):
        for part, file in enumerate(pair):
            entry = {"timestep": repr(float(time)), "part": str(part), "file": file.name}
            ElementTree.SubElement(listing, "DataSet", entry)
    ElementTree.indent(root)
    ElementTree.ElementTree(root).write(path, encoding="utf-8", xml_declaration=True)


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
    """The type of cell in the words of meshio, and the nodes of each cell, (elements, nodes)."""
    element = body.basis.elem
    inner = element.elem if isinstance(element, skfem.ElementVector) else element
    kind = next(name for cls, name in CELLS.items() if isinstance(inner, cls))
    node = np.zeros(body.n, dtype=np.int64)
    nodes = body_nodes(body)
    node[nodes] = np.arange(len(nodes))[:, None]
    cells = node[body.basis.dofs.element_dofs[:: body.components]]
    if kind.startswith("hexahedron"):  # scikit-fem counts the corners of a brick in another order
        from skfem.io.meshio import HEX_MAPPING  # which imports meshio

        cells = cells[HEX_MAPPING[: len(cells)]]
    return kind, cells.T


def bodies_grid(result: ContactResult, stress: Stress | None = None) -> meshio.Mesh:
    """All bodies as one grid; coincident nodes are never merged."""
    import meshio  # takes as long to import as all else together, and only files need it

    points, cells, number, values, scalars = [], [], [], [], []
    start, system = 0, result.system
    for i, body in enumerate(system.bodies):
        if not isinstance(body, Body):  # rigid bodies have no mesh
            continue
        nodes, (kind, table) = body_nodes(body), body_cells(body)
        u = result.displacement(body)
        points.append(three(body.dof_points[nodes[:, 0]]))
        values.append(u[nodes])
        cells.append((kind, table + start))
        number.append(np.full(len(table), i + 1, dtype=np.int32))
        if stress is not None:
            scalars.append(_nodal(stress(body, u), len(nodes), system.names[i]))
        start += len(nodes)
    field = np.concatenate(values)
    data = {"u": field[:, 0]} if field.shape[1] == 1 else {"displacement": three(field)}
    if stress is not None:
        data[_free_name(field_name(stress), data)] = np.concatenate(scalars)
    return meshio.Mesh(np.concatenate(points), cells, data, {"body": number})


def _free_name(name: str, taken: Iterable[str]) -> str:
    """The name of a field, or one beside it where another field has that name."""
    return f"{name}_given" if name in taken else name


def _nodal(values: Any, count: int, name: str) -> Array:
    array = np.asarray(values, dtype=float)
    if array.shape != (count,):
        raise InputError(
            f"stress(body, u) returned shape {array.shape} for body {name!r}, which has {count} "
            "nodes. It has to return a number for each node, as skfem_contact.von_mises does."
        )
    return array


def contact_grid(result: ContactResult) -> meshio.Mesh:
    """The secondary surfaces of all contacts as one grid of lines (facets in 3-D)."""
    import meshio  # as above

    points, cells, number, start = [], [], [], 0
    columns: dict[str, list[Array]] = {}
    for i, (contact, values) in enumerate(zip(result.contacts, result.values, strict=True)):
        surface = contact.secondary
        kind = FACETS[surface.dim, surface.facets.shape[1]]
        points.append(three(values.points))
        cells.append((kind, surface.facets + start))
        number.append(np.full(len(surface.facets), i + 1, dtype=np.int32))
        for name, column in _point_data(values, surface, result).items():
            columns.setdefault(name, []).append(column)
        start += len(values.points)
    data = {name: np.concatenate(parts) for name, parts in columns.items()}
    return meshio.Mesh(np.concatenate(points), cells, data, {"contact": number})


def _point_data(
    values: ContactValues, surface: ContactSurface, result: ContactResult
) -> dict[str, Array]:
    u = result.displacement(surface.body)[surface.dofs]
    data = {"u": u[:, 0]} if u.shape[1] == 1 else {"displacement": three(u)}
    return data | {
        "pressure": values.pressure,
        "traction": three(values.traction),
        "normal": three(values.normal),
        "gap": np.where(np.isfinite(values.gap), values.gap, np.nan),
        "slip": _along(values.slip, values.tangent),
        "status": values.status.astype(np.int32),
        "tangential_force": _along(values.tangential_force, values.tangent),
    }


def _along(components: Array, tangent: Array) -> Array:
    """One number in 2-D; a vector in global axes in 3-D; zero where there are no tangents."""
    if components.shape[1] > 1:
        return three(np.einsum("ik,ikd->id", components, tangent))
    return components.sum(axis=1)


def three(vectors: Array) -> Array:
    """Vectors with three components, as VTK wants them, shape (m, 3)."""
    return np.pad(vectors, ((0, 0), (0, 3 - vectors.shape[1])))
