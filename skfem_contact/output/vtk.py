"""Results to files that ParaView opens: bodies in one grid, contact surfaces and obstacles in others.

A history becomes such files per load step and a collection (`.pvd`) that lists them.

Files are VTK's own for grids, ``.vtu``, with names, times and units in them. Arrays are binary,
compressed, and in the text of the file. What belongs to all of the grid is in its field data, which are
numbers: other readers take no words there, so words are the names of the arrays.
"""

from __future__ import annotations

import sys
import zlib
from base64 import b64encode
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import field, replace
from html import escape
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from skfem_contact.answers.result import ContactResult
from skfem_contact.arguments import check_kind, file_path, known_keywords, number, numbers, shown
from skfem_contact.arrays import Array
from skfem_contact.bodies.body import Body, body_nodes
from skfem_contact.bodies.facet_kinds import KINDS
from skfem_contact.errors import InputError
from skfem_contact.output.drawing import View
from skfem_contact.output.stress import (
    SIX,
    Stress,
    as_columns,
    asked,
    body_cells,
    checked_units,
    displaced,
    field_values,
    three,
)
from skfem_contact.output.tools import tools
from skfem_contact.records import dataclass

EXTENSIONS = (".vtu", ".vtk")
#: Number, name, points (p, d), kind and nodes of cells, and data of points.
Part = tuple[int, str, Array, tuple[str, NDArray[Any]], dict[str, Array]]
Fields = Stress | Sequence[Stress] | Mapping[str, Stress]

#: Numbers of VTK's cells by their names in meshio; those of facets are in `KINDS`.
VTK_CELLS = {
    "tetra": 10, "tetra10": 24, "hexahedron": 12, "hexahedron20": 25, "hexahedron27": 29,
}  # fmt: skip
TYPES = {"f8": "Float64", "i4": "Int32", "i8": "Int64", "u1": "UInt8"}

#: What kind of quantity the fields are, for their units; those that users give are stresses.
QUANTITIES = {
    "displacement": "length", "gap": "length", "slip": "length", "wear_depth": "length",
    "pressure": "stress", "traction": "stress", "tangential_force": "force",
}  # fmt: skip


@known_keywords()
def write(
    path: str | Path,
    result: ContactResult,
    *,
    stress: Fields | None = None,
    time: float | None = None,
    units: Mapping[str, str] | None = None,
    u: ArrayLike | None = None,
) -> tuple[Path, Path]:
    """Write a result: bodies to `path`, contacts to ``<stem>_contact``, tools to ``<stem>_obstacles``.

    Bodies keep nodes of their own also where they touch. All files hold the undeformed geometry
    and the field ``displacement``, to warp by.

    Parameters
    ----------
    path : str or Path
        Ends in ``.vtu`` or ``.vtk``; missing folders are made.
    result : ContactResult
    stress : str or callable, list or dict of them, optional
        Names of fields of `nodal_field`, such as "stress" or "equivalent_plastic_strain", NaN on bodies
        without them. Or ``stress(body, u)`` returns a number for each node of the body, such as
        `skfem_contact.von_mises`, a vector, or a tensor (nodes, 3, 3), such as `nodal_stress`. It is
        written by the name of the function (``stress`` for a lambda), or by its name in the dict.
    time : float, optional
        Written as ``TimeValue``, which ParaView shows; by default the load factor.
    units : dict, optional
        Words that are written with the fields: ``{"length": "mm", "stress": "MPa", "force": "N"}``.
    u : ndarray, shape (n,), optional
        Displacements of all bodies in the place of those of the result: a shape of vibration.

    Returns
    -------
    bodies, contacts : Path
        The first two files. The first has the point data ``displacement`` (3 components) or, for scalar
        problems, ``u``, and the cell data ``body`` (1 for the first). The second has the point
        data of `ContactValues`: ``pressure``, ``traction`` on the secondary, ``gap`` (NaN where
        there is no partner), ``slip``, ``status`` (0 open, 1 stick, 2 slip), ``tangential_force``,
        ``wear_depth`` where surfaces wear, and the cell data ``contact`` (1 for the first). Slip and
        tangential force are one number along `tangent` in 2-D (the normal from primary to secondary,
        turned counter-clockwise) and a vector in global axes in 3-D.
        The third is written where there are rigid obstacles, and has the cell data ``obstacle``.

    Raises
    ------
    InputError
        If the extension is unknown, or `stress` returns something else than values per node.

    Notes
    -----
    Names are in the field data of ``.vtu`` files: an array ``body 1: block`` with the value 1 says that
    body 1 is "block"; contacts and obstacles have theirs, too. Tensors have six components, in the
    order XX, YY, ZZ, XY, YZ, XZ. Planes and other obstacles without end are written as far as the
    bodies reach. An obstacle of a user's own class is not written: its shape is not known.

    Examples
    --------
    >>> import skfem as fem
    >>> import skfem_contact as sc
    >>> from skfem.models.elasticity import linear_elasticity
    >>> mesh = fem.MeshQuad().refined(2).with_defaults()
    >>> basis = fem.Basis(mesh, fem.ElementVector(fem.ElementQuad1()), intorder=2)
    >>> block = sc.Body(basis, linear_elasticity(), D="top", x={"top": (0.002, -0.01)}, name="block")
    >>> floor = sc.RigidPlane((0, 0), (0, 1), name="floor")
    >>> foot = sc.Contact(block.surface("bottom"), floor, friction=sc.Coulomb(0.3), name="foot")
    >>> result = sc.ContactSolver(block, foot).solve()
    >>> import tempfile, pathlib
    >>> folder = pathlib.Path(tempfile.mkdtemp())
    >>> path = sc.write(folder / "block.vtu", result)
    >>> sorted(file.name for file in folder.iterdir())
    ['block.vtu', 'block_contact.vtu', 'block_obstacles.vtu']
    """
    path = file_path(path)
    check_kind(result, ContactResult, "result", "a history goes to write_series('name.pvd', results)")
    if path.suffix.lower() not in EXTENSIONS:
        raise InputError(
            f"can not write {path.name!r}: the extension {path.suffix!r} is not one of "
            f"{', '.join(EXTENSIONS)}. Use write('{path.stem}.vtu', result), or write_series for "
            "a history; other formats by `meshio convert`."
        )
    words = checked_units(units)
    if time is not None:
        time = number(time, "time", "give one number")
    result = displaced(result, u)
    path.parent.mkdir(parents=True, exist_ok=True)
    files = _files(path)
    grids = (
        bodies_grid(result, stress, words),
        contact_grid(result, words),
        obstacles_grid(result, words),
    )
    for file, grid in zip(files, grids, strict=True):
        if grid is not None:
            _write(file, with_time(grid, result, time))
    return files[0], files[1]


def _files(path: Path) -> list[Path]:
    """Of bodies, contacts and obstacles."""
    ends = ("", "_contact", "_obstacles")
    return [path.with_name(f"{path.stem}{end}{path.suffix}") for end in ends]


def _write(path: Path, grid: Grid) -> None:
    if path.suffix.lower() == ".vtu":
        grid.write(path)
        return
    import meshio  # takes as long to import as all else together, and only these files need it

    cuts = np.cumsum([len(c) for _, c in grid.cells])[:-1]
    data = {name: np.split(values, cuts) for name, values in grid.cell_data.items()}
    meshio.Mesh(grid.points, list(grid.cells), dict(grid.point_data), data).write(path)


@known_keywords()
def write_series(
    path: str | Path,
    results: Iterable[ContactResult],
    *,
    times: Sequence[float] | None = None,
    stress: Fields | None = None,
    units: Mapping[str, str] | None = None,
) -> Path:
    """Write a history as a ParaView collection ``<stem>.pvd``.

    Step 7 is in ``<stem>_0007.vtu``, ``<stem>_0007_contact.vtu`` and, where there are obstacles,
    ``<stem>_0007_obstacles.vtu``. The collection is renewed with every step, so what an interrupted
    history has reached can be opened.

    Parameters
    ----------
    path : str or Path
        Ends in ``.pvd``; missing folders are made.
    results : iterable of ContactResult
        A list, or ``solver.history(...)`` itself.
    times : sequence of float, optional
        Of each step. By default the load factors where they increase from step to step, else the
        numbers 0, 1, 2, ... of the steps.
    stress, units : optional
        As in `write`.

    Returns
    -------
    Path
        The collection.

    Raises
    ------
    InputError
        If the extension is not ``.pvd``, or there are fewer times than results.

    Examples
    --------
    >>> import skfem as fem
    >>> import skfem_contact as sc
    >>> from skfem.models.elasticity import linear_elasticity
    >>> mesh = fem.MeshQuad().refined(2).with_defaults()
    >>> basis = fem.Basis(mesh, fem.ElementVector(fem.ElementQuad1()), intorder=2)
    >>> block = sc.Body(basis, linear_elasticity(), D="top", x={"top": (0.002, -0.01)}, name="block")
    >>> floor = sc.RigidPlane((0, 0), (0, 1), name="floor")
    >>> foot = sc.Contact(block.surface("bottom"), floor, friction=sc.Coulomb(0.3), name="foot")
    >>> import tempfile, pathlib
    >>> folder = pathlib.Path(tempfile.mkdtemp())
    >>> results = list(sc.ContactSolver(block, foot).history([0.5, 1.0]))
    >>> path = sc.write_series(folder / "press.pvd", results, times=[0.0, 1.0])
    >>> len(list(folder.glob("*.vtu")))  # bodies, contacts and obstacles of two steps
    6
    """
    path = file_path(path)
    if path.suffix.lower() != ".pvd":
        raise InputError(
            f"can not write a history to {path.name!r}: a series is a ParaView collection. Use "
            f"write_series('{path.stem}.pvd', results); a single result goes to write(...)."
        )
    if isinstance(results, ContactResult) or not isinstance(results, Iterable):
        raise InputError(
            f"results is {shown(results)}, not a list of results, or a history; a single result goes "
            "to write('name.vtu', result)"
        )
    if times is not None:
        usage = "give one number for each result"
        times = np.atleast_1d(numbers(times, "times", usage)).tolist()
    path.parent.mkdir(parents=True, exist_ok=True)
    files: list[list[Path]] = []
    factors: list[float | None] = []
    _collection(path, [], [])
    for i, result in enumerate(results):
        if times is not None and i >= len(times):
            raise InputError(f"times has {len(times)} entries, but there are more results than that.")
        step = path.with_name(f"{path.stem}_{i:04d}.vtu")
        time = None if times is None else times[i]
        written = list(write(step, result, stress=stress, time=time, units=units))
        if tools(result):
            written.append(_files(step)[2])
        files.append(written)
        factors.append(result.factor)
        _collection(path, files, _clock(factors) if times is None else times[: i + 1])
    return path


def _clock(factors: Sequence[float | None]) -> list[float]:
    """Load factors if they can serve as time, which has to increase; numbers of steps if not."""
    known = [float(factor) for factor in factors if factor is not None]
    if len(known) == len(factors) and all(np.diff(known) > 0):
        return known
    return [float(i) for i in range(len(factors))]


def _collection(path: Path, files: list[list[Path]], times: Sequence[float]) -> None:
    from xml.etree import ElementTree  # only lists of files need it

    root = ElementTree.Element("VTKFile", type="Collection", version="0.1")
    listing = ElementTree.SubElement(root, "Collection")
    for step, time in zip(files, times, strict=True):
        for part, file in enumerate(step):
            name = ("bodies", "contacts", "obstacles")[part]
            entry = {"timestep": repr(float(time)), "part": str(part), "name": name, "file": file.name}
            ElementTree.SubElement(listing, "DataSet", entry)
    ElementTree.indent(root)
    ElementTree.ElementTree(root).write(path, encoding="utf-8", xml_declaration=True)


def with_time(grid: Grid, result: ContactResult, time: float | None) -> Grid:
    """A grid with the time and the load factor of a result."""
    known = dict(grid.field_data)
    if result.factor is not None:
        known["load factor"] = result.factor
    if time is None:
        time = result.factor
    if time is not None:
        known["TimeValue"] = float(time)
    return replace(grid, field_data=known)


def bodies_grid(result: ContactResult, stress: Fields | None, units: Mapping[str, str]) -> Grid:
    """All bodies as one grid; coincident nodes are never merged."""
    parts, wanted = list[Part](), asked(stress)
    for i, (body, name) in enumerate(zip(result.system.bodies, result.system.names, strict=True)):
        if not isinstance(body, Body):  # rigid bodies have no mesh
            continue
        nodes = body_nodes(body)
        data = _moved(result.displacement(body)[nodes])
        fields = {key: as_columns(field_values(result, body, wish)) for key, wish in wanted.items()}
        data |= {f"{key}_given" if key in data else key: own for key, own in fields.items()}
        parts.append((i + 1, name, body.dof_points[nodes[:, 0]], body_cells(body), data))
    kinds = {key: "" if key.endswith("strain") else "stress" for key in parts[0][-1]} | QUANTITIES
    return _grid("body", parts, kinds, units)


def contact_grid(result: ContactResult, units: Mapping[str, str]) -> Grid:
    """The secondary surfaces of all contacts as one grid of lines (facets in 3-D)."""
    parts = list[Part]()
    wears = any(v.contact.wear is not None or v.wear_depth.any() for v in result)
    for i, (contact, values) in enumerate(zip(result.contacts, result, strict=True)):
        surface = contact.secondary
        data = _moved(result.displacement(surface.body)[surface.dofs])
        data |= {"wear_depth": values.wear_depth} if wears else {}
        data |= {
            "pressure": values.pressure,
            "traction": three(values.traction),
            "normal": three(values.normal),
            "gap": np.where(np.isfinite(values.gap), values.gap, np.nan),
            "slip": _along(values.slip, values.tangent),
            "status": values.status.astype(np.int32),
            "tangential_force": _along(values.tangential_force, values.tangent),
        }
        parts.append((i + 1, values.name, values.points, (surface.kind.cell, surface.facets), data))
    return _grid("contact", parts, QUANTITIES, units)


def obstacles_grid(result: ContactResult, units: Mapping[str, str]) -> Grid | None:
    """The rigid obstacles where they were made, as lines or triangles; None where there are none."""
    parts = list[Part]()
    box = View(1.0, np.zeros(1)).box(result)  # everything where it is
    for i, tool in enumerate(tools(result)):
        x, table = tool.outline(*box)
        if len(table):
            cells = "line" if x.shape[1] == 2 else "triangle", table
            parts.append((i + 1, tool.name, x, cells, _moved(tool.motion.shift(x))))
    return _grid("obstacle", parts, QUANTITIES, units) if parts else None


def _moved(u: Array) -> dict[str, Array]:
    return {"u": u[:, 0]} if u.shape[1] == 1 else {"displacement": three(u)}


def _grid(what: str, parts: Sequence[Part], kinds: Mapping[str, str], units: Mapping[str, str]) -> Grid:
    """Parts as one grid: their numbers are in the data of cells, their names in those of the grid."""
    numbers, names, every, tables, data = zip(*parts, strict=True)
    starts = np.cumsum([0, *map(len, every)])
    cells = [(kind, table + start) for (kind, table), start in zip(tables, starts, strict=False)]
    of_points = dict[str, Array]()
    for key in data[0]:
        own = [known[key] for known in data]
        if len({values.shape[1:] for values in own}) > 1:
            raise InputError(f"stress {key!r} is a number for some bodies and a tensor for others")
        of_points[key] = np.concatenate(own)
    of_cells = np.repeat(np.array(numbers, dtype=np.int32), [len(table) for _, table in tables])
    known = {name: units[kind] for name, kind in kinds.items() if kind in units}
    words = {f"{what} {number}: {name}": number for number, name in zip(numbers, names, strict=True)}
    return Grid(np.concatenate([*map(three, every)]), cells, of_points, {what: of_cells}, words, known)


def _along(components: Array, tangent: Array) -> Array:
    """One number in 2-D; a vector in global axes in 3-D; zero where there are no tangents."""
    if components.shape[1] > 1:
        return three(np.einsum("ik,ikd->id", components, tangent))
    return components.sum(axis=1)


@dataclass(frozen=True, eq=False)
class Grid:
    """Points, cells and what is known of them.

    Attributes
    ----------
    points : ndarray, shape (p, 3)
    cells : sequence of (str, ndarray)
        The name of their kind in meshio and the nodes of each cell, (c, nodes).
    point_data, cell_data : dict
        Arrays of numbers by name: one, three, or six components of a symmetric tensor (`SIX`).
    field_data : dict
        Numbers by name.
    units : dict
        Units of the fields by their names.
    """

    points: NDArray[np.float64]
    cells: Sequence[tuple[str, NDArray[np.int64]]]
    point_data: Mapping[str, NDArray[Any]] = field(default_factory=dict)
    cell_data: Mapping[str, NDArray[Any]] = field(default_factory=dict)
    field_data: Mapping[str, float] = field(default_factory=dict)
    units: Mapping[str, str] = field(default_factory=dict)

    def write(self, path: Path) -> None:
        """Write it to a file."""
        count = sum(len(nodes) for _, nodes in self.cells)
        order = "LittleEndian" if sys.byteorder == "little" else "BigEndian"
        lines = [
            '<?xml version="1.0"?>',
            f'<VTKFile type="UnstructuredGrid" version="0.1" byte_order="{order}" header_type="UInt32" '
            'compressor="vtkZLibDataCompressor">',
            "<UnstructuredGrid>",
            "<FieldData>",
            *(_field(name, value) for name, value in self.field_data.items()),
            "</FieldData>",
            f'<Piece NumberOfPoints="{len(self.points)}" NumberOfCells="{count}">',
            *_part("Points", {"Points": self.points}, {}),
            *_part("Cells", self._topology(), {}),
            *_part("PointData", self.point_data, self.units),
            *_part("CellData", self.cell_data, self.units),
            "</Piece>",
            "</UnstructuredGrid>",
            "</VTKFile>",
        ]
        path.write_text("\n".join(lines) + "\n", encoding="utf-8")

    def _topology(self) -> dict[str, NDArray[Any]]:
        corners = np.concatenate([np.full(len(c), c.shape[1]) for _, c in self.cells])
        numbers = VTK_CELLS | {kind.cell: kind.vtk for kind in KINDS.values()}
        kinds = [np.full(len(c), numbers[kind], dtype=np.uint8) for kind, c in self.cells]
        return {
            "connectivity": np.concatenate([c.ravel() for _, c in self.cells]),
            "offsets": np.cumsum(corners),
            "types": np.concatenate(kinds),
        }


def _part(tag: str, arrays: Mapping[str, NDArray[Any]], units: Mapping[str, str]) -> list[str]:
    return [f"<{tag}>", *(_array(k, a, units.get(k)) for k, a in arrays.items()), f"</{tag}>"]


def _array(name: str, values: NDArray[Any], unit: str | None = None) -> str:
    """An array as an element of the file, with its unit where VTK looks for it."""
    kind = TYPES.get(np.asarray(values).dtype.str[1:], "Float64")
    data = np.ascontiguousarray(values, dtype=next(k for k, v in TYPES.items() if v == kind))
    about = f'type="{kind}" Name="{escape(name)}"'
    if data.ndim == 2:
        about += f' NumberOfComponents="{data.shape[1]}"'
        if data.shape[1] == len(SIX):
            names = ["XYZ"[i] + "XYZ"[j] for i, j in SIX.values()]
            about += "".join(f' ComponentName{k}="{word}"' for k, word in enumerate(names))
    found = _encoded(data.tobytes())
    if unit is not None:
        label = 'name="UNITS_LABEL" location="vtkDataArray"'
        found += f"<InformationKey {label}>{escape(unit)}</InformationKey>"
    return f'<DataArray {about} format="binary">{found}</DataArray>'


def _encoded(data: bytes) -> str:
    """Compressed, as one block with its sizes before it, in base 64."""
    blocks = [zlib.compress(data, 1)] if data else []
    sizes = np.array([len(blocks), len(data), 0, *map(len, blocks)], dtype=np.uint32)
    return b64encode(sizes.tobytes()).decode() + b64encode(b"".join(blocks)).decode()


def _field(name: str, value: float) -> str:
    return (
        f'<DataArray type="Float64" Name="{escape(name)}" NumberOfTuples="1" format="ascii">'
        f"{float(value)!r}</DataArray>"
    )
