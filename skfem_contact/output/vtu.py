"""Files of VTK's own format for grids, ``.vtu``, with names, times and units in them.

Arrays are binary, compressed, and in the text of the file. What belongs to all of the grid is in its
field data, which are numbers: other readers take no words there, so words are the names of the arrays.
"""

from __future__ import annotations

import sys
import zlib
from base64 import b64encode
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from html import escape
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skfem_contact.bodies.facet_kinds import KINDS

#: Numbers of VTK's cells by their names in meshio; those of facets are in `KINDS`.
VTK_CELLS = {
    "tetra": 10, "tetra10": 24, "hexahedron": 12, "hexahedron20": 25, "hexahedron27": 29,
}  # fmt: skip
TYPES = {"f8": "Float64", "i4": "Int32", "i8": "Int64", "u1": "UInt8"}
#: Bytes that are compressed together.
BLOCK = 2**15
#: Components of a symmetric tensor, in the order of VTK.
SIX = ((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (0, 2))


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
            names = ["XYZ"[i] + "XYZ"[j] for i, j in SIX]
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
