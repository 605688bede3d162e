"""Bodies, contact surfaces and rigid obstacles of a result as grids with fields, for files."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skfem_contact.answers.result import ContactResult
from skfem_contact.answers.values import ContactValues
from skfem_contact.bodies.body import Body
from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.errors import InputError
from skfem_contact.output import wanted
from skfem_contact.output.nodes import body_cells, body_nodes, three
from skfem_contact.output.tools import tools
from skfem_contact.output.vtu import Grid
from skfem_contact.output.wanted import Stress

Array = NDArray[np.float64]
Fields = Stress | Sequence[Stress] | Mapping[str, Stress]

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
    start, system, asked = 0, result.system, wanted.asked(stress)
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
        for key, function in asked.items():
            columns = wanted.as_columns(wanted.checked(function(body, u), len(nodes), name))
            fields.setdefault(key, []).append(columns)
        start += len(nodes)
    field = np.concatenate(values)
    data = {"u": field[:, 0]} if field.shape[1] == 1 else {"displacement": three(field)}
    for key, parts in fields.items():
        if len({part.shape[1:] for part in parts}) > 1:
            raise InputError(f"stress {key!r} is a number for some bodies and a tensor for others")
        data[f"{key}_given" if key in data else key] = np.concatenate(parts)
    of_fields = dict.fromkeys(data, "stress") | QUANTITIES
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
    box = _reached(result) if known else (np.zeros(2), np.zeros(2))
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


def _reached(result: ContactResult) -> tuple[Array, Array]:
    """The corners of the box around all bodies where they are now."""
    places = []
    for body in result.system.solids.values():
        nodes = body_nodes(body)
        places.append(body.dof_points[nodes[:, 0]] + result.displacement(body)[nodes])
    x = np.concatenate(places)
    return x.min(axis=0), x.max(axis=0)


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
