"""Bodies, contact surfaces and rigid obstacles of a result as grids with fields, and their files.

Files are VTK's own for grids, ``.vtu``, with names, times and units in them. Arrays are binary,
compressed, and in the text of the file. What belongs to all of the grid is in its field data, which are
numbers: other readers take no words there, so words are the names of the arrays.
"""

from __future__ import annotations

import sys
import zlib
from base64 import b64encode
from collections.abc import Mapping, Sequence
from dataclasses import field
from html import escape
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skfem_contact.answers.result import ContactResult
from skfem_contact.answers.values import ContactValues
from skfem_contact.arrays import Array
from skfem_contact.bodies.body import Body
from skfem_contact.bodies.facet_kinds import KINDS
from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.errors import InputError
from skfem_contact.output.fields import (
    SIX,
    Stress,
    as_columns,
    asked,
    body_cells,
    body_nodes,
    three,
)
from skfem_contact.output.stress import field_values
from skfem_contact.output.tools import tools
from skfem_contact.output.view import TRUE
from skfem_contact.records import dataclass

Fields = Stress | Sequence[Stress] | Mapping[str, Stress]

#: Numbers of VTK's cells by their names in meshio; those of facets are in `KINDS`.
VTK_CELLS = {
    "tetra": 10, "tetra10": 24, "hexahedron": 12, "hexahedron20": 25, "hexahedron27": 29,
}  # fmt: skip
TYPES = {"f8": "Float64", "i4": "Int32", "i8": "Int64", "u1": "UInt8"}
#: Bytes that are compressed together.
BLOCK = 2**15

#: What kind of quantity the fields are, for their units; those that users give are stresses.
QUANTITIES = {
    "displacement": "length", "gap": "length", "slip": "length", "wear_depth": "length",
    "pressure": "stress", "traction": "stress", "tangential_force": "force",
}  # fmt: skip


def with_time(grid: Grid, result: ContactResult, time: float | None) -> Grid:
    """A grid with the time and the load factor of a result."""
    known = dict(grid.field_data)
    if result.factor is not None:
        known["load factor"] = result.factor
    if time is None:
        time = result.factor
    if time is not None:
        known["TimeValue"] = float(time)
    return Grid(grid.points, grid.cells, grid.point_data, grid.cell_data, known, grid.units)


def bodies_grid(result: ContactResult, stress: Fields | None, units: Mapping[str, str]) -> Grid:
    """All bodies as one grid; coincident nodes are never merged."""
    points, cells, numbers, values = [], [], [], []
    fields: dict[str, list[Array]] = {}
    names: dict[str, float] = {}
    start, system, wanted = 0, result.system, asked(stress)
    for i, (body, name) in enumerate(zip(system.bodies, system.names, strict=True)):
        if not isinstance(body, Body):  # rigid bodies have no mesh
            continue
        nodes, (kind, table) = body_nodes(body), body_cells(body)
        u = result.displacement(body)
        points.append(three(body.dof_points[nodes[:, 0]]))
        values.append(u[nodes])
        cells.append((kind, table + start))
        numbers.append(np.full(len(table), i + 1, dtype=np.int32))
        names[f"body {i + 1}: {name}"] = i + 1
        for key, wish in wanted.items():
            fields.setdefault(key, []).append(as_columns(field_values(result, body, wish)))
        start += len(nodes)
    moved = np.concatenate(values)
    data = {"u": moved[:, 0]} if moved.shape[1] == 1 else {"displacement": three(moved)}
    for key, parts in fields.items():
        if len({part.shape[1:] for part in parts}) > 1:
            raise InputError(f"stress {key!r} is a number for some bodies and a tensor for others")
        data[f"{key}_given" if key in data else key] = np.concatenate(parts)
    of_fields = {key: "" if key.endswith("strain") else "stress" for key in data} | QUANTITIES
    return _grid(points, cells, data, {"body": numbers}, names, of_fields, units)


def contact_grid(result: ContactResult, units: Mapping[str, str]) -> Grid:
    """The secondary surfaces of all contacts as one grid of lines (facets in 3-D)."""
    points, cells, numbers, start = [], [], [], 0
    columns: dict[str, list[Array]] = {}
    for i, (contact, values) in enumerate(zip(result.contacts, result.values, strict=True)):
        surface = contact.secondary
        points.append(three(values.points))
        cells.append((surface.kind.cell, surface.facets + start))
        numbers.append(np.full(len(surface.facets), i + 1, dtype=np.int32))
        for name, column in _point_data(values, surface, result).items():
            columns.setdefault(name, []).append(column)
        start += len(values.points)
    data = {name: np.concatenate(parts) for name, parts in columns.items()}
    names = {f"contact {i + 1}: {name}": i + 1.0 for i, name in enumerate(result.names)}
    return _grid(points, cells, data, {"contact": numbers}, names, QUANTITIES, units)


def obstacles_grid(result: ContactResult, units: Mapping[str, str]) -> Grid | None:
    """The rigid obstacles where they were made, as lines or triangles; None where there are none."""
    points, cells, numbers, moved, start = [], [], [], [], 0
    names: dict[str, float] = {}
    known = tools(result)
    box = TRUE.box(result)
    for i, tool in enumerate(known):
        x, table = tool.outline(*box)
        if not len(table):
            continue
        points.append(three(x))
        moved.append(three(tool.motion.shift(x)))
        cells.append(("line" if x.shape[1] == 2 else "triangle", table + start))
        numbers.append(np.full(len(table), i + 1, dtype=np.int32))
        names[f"obstacle {i + 1}: {tool.name}"] = i + 1
        start += len(x)
    if not points:
        return None
    data = {"displacement": np.concatenate(moved)}
    return _grid(points, cells, data, {"obstacle": numbers}, names, QUANTITIES, units)


def _grid(
    points: list[Array],
    cells: list[tuple[str, NDArray[np.int64]]],
    data: dict[str, Array],
    of_cells: dict[str, list[NDArray[Any]]],
    names: Mapping[str, float],
    kinds: Mapping[str, str],
    units: Mapping[str, str],
) -> Grid:
    joined = {name: np.concatenate(parts) for name, parts in of_cells.items()}
    known = {name: units[kind] for name, kind in kinds.items() if kind in units}
    return Grid(np.concatenate(points), cells, data, joined, names, known)


def _point_data(
    values: ContactValues, surface: ContactSurface, result: ContactResult
) -> dict[str, Array]:
    u = result.displacement(surface.body)[surface.dofs]
    data = {"u": u[:, 0]} if u.shape[1] == 1 else {"displacement": three(u)}
    if any(v.contact.wear is not None or v.wear_depth.any() for v in result.values):
        data["wear_depth"] = values.wear_depth
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


def vtk_numbers() -> dict[str, int]:
    """Numbers of VTK's cells by their names in meshio."""
    return VTK_CELLS | {kind.cell: kind.vtk for kind in KINDS.values()}


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
        numbers = vtk_numbers()
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
    known = "" if unit is None else _unit(unit)
    return f'<DataArray {about} format="binary">{_encoded(data.tobytes())}{known}</DataArray>'


def _unit(unit: str) -> str:
    return f'<InformationKey name="UNITS_LABEL" location="vtkDataArray">{escape(unit)}</InformationKey>'


def _encoded(data: bytes) -> str:
    """Compressed blocks with their sizes before them, in base 64."""
    blocks = [zlib.compress(data[i : i + BLOCK], 1) for i in range(0, len(data), BLOCK)]
    last = len(data) - BLOCK * (len(blocks) - 1) if blocks else 0
    sizes = np.array([len(blocks), BLOCK, last, *map(len, blocks)], dtype=np.uint32)
    return b64encode(sizes.tobytes()).decode() + b64encode(b"".join(blocks)).decode()


def _field(name: str, value: float) -> str:
    return (
        f'<DataArray type="Float64" Name="{escape(name)}" NumberOfTuples="1" format="ascii">'
        f"{float(value)!r}</DataArray>"
    )
