"""Fields of bodies for pictures and files: nodes and cells, values over these, and words for units.

Fields are those that users ask for, one or several: numbers, vectors or tensors. Units are the user's
own words, since the library has none.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from copy import copy
from typing import Any

import numpy as np
import skfem
from numpy.typing import NDArray

from skfem_contact.answers.answer import answer_of
from skfem_contact.answers.result import ContactResult
from skfem_contact.arguments import numbers, shown, suggest
from skfem_contact.arrays import Array
from skfem_contact.bodies.body import Body
from skfem_contact.bodies.inputs import SUPPORTED
from skfem_contact.errors import InputError
from skfem_contact.records import sealed

Stress = Callable[[Body, Array], Array] | str
#: What a picture shows: one field, or one under a name of the user's.
OneStress = Stress | Mapping[str, Stress]

KINDS = ("length", "force", "stress", "area", "energy", "time")
UNITS = "give a dict such as {'length': 'mm', 'force': 'N', 'stress': 'MPa'}"
USAGE = (
    "give the name of a field that materials know, such as 'von_mises', or a function (body, u) -> "
    "values at the nodes, or a dict of them by name"
)
#: Components of a symmetric tensor, in the order of VTK.
SIX = {"xx": (0, 0), "yy": (1, 1), "zz": (2, 2), "xy": (0, 1), "yz": (1, 2), "xz": (0, 2)}
#: Nodes of a tetrahedron whose first two corners change places.
MIRRORED = (1, 0, 2, 3, 4, 6, 5, 8, 7, 9)


def displaced(result: ContactResult, u: Any) -> ContactResult:
    """The result with other displacements (n,), such as a shape of vibration, to be shown."""
    if u is None:
        return result
    values = numbers(u, "u", "give displacements (n,) of all bodies")
    if values.shape != (result.system.n,):
        raise InputError(
            f"u has shape {values.shape}, not ({result.system.n},): displacements of all bodies"
        )
    answer = copy(answer_of(result))
    vars(answer)["u"] = sealed(values)
    return ContactResult(answer)


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
    """The type of cell in the words of meshio, and the nodes of each cell, (elements, nodes).

    Without nodes of the element that the cell does not have.
    """
    element = body.basis.elem
    inner = element.elem if isinstance(element, skfem.ElementVector) else element
    kind = next(name for cls, name in SUPPORTED.items() if isinstance(inner, cls))
    node = np.zeros(body.n, dtype=np.int64)
    nodes = body_nodes(body)
    node[nodes] = np.arange(len(nodes))[:, None]
    cells = node[body.basis.dofs.element_dofs[:: body.components]]
    cells = cells[: int("".join(filter(str.isdigit, kind)) or len(cells))]
    if kind.startswith("hexahedron"):  # scikit-fem counts the corners of a brick in another order
        from skfem.io.meshio import HEX_MAPPING  # which imports meshio

        cells = cells[HEX_MAPPING[: len(cells)]]
    if kind.startswith("tetra"):  # scikit-fem has them of either orientation, readers of files of one
        a, b, c, d = body.dof_points[nodes[cells[:4], 0]]
        inside_out = np.einsum("ij,ij->i", np.cross(b - a, c - a), d - a) < 0
        cells[:, inside_out] = cells[np.array(MIRRORED[: len(cells)])][:, inside_out]
    return kind, cells.T


def three(vectors: Array) -> Array:
    """Vectors with three components, as VTK wants them, shape (m, 3)."""
    return np.pad(vectors, ((0, 0), (0, 3 - vectors.shape[1])))


def field_name(field: Any) -> str:
    """Return the name of a field in files and pictures: its own, or that of its function.

    >>> from functools import partial
    >>> from skfem_contact import von_mises
    >>> field_name(von_mises), field_name(partial(von_mises, E=1.0, nu=0.3)), field_name(lambda b, u: u)
    ('von_mises', 'von_mises', 'stress')
    """
    if isinstance(field, str):
        return field
    name = getattr(getattr(field, "func", field), "__name__", "<lambda>")
    return "stress" if name == "<lambda>" else str(name)


def asked(stress: Any) -> dict[str, Stress]:
    """Functions, or names that materials know, by the names of their fields.

    >>> asked({"sigma": lambda body, u: u}).keys(), asked(["stress"]), asked(None)
    (dict_keys(['sigma']), {'stress': 'stress'}, {})
    """
    if stress is None:
        return {}
    if isinstance(stress, Mapping):
        named = [(name, function) for name, function in stress.items()]
    elif callable(stress) or isinstance(stress, str) or not isinstance(stress, Iterable):
        named = [(field_name(stress), stress)]
    else:
        named = [(field_name(function), function) for function in stress]
    for name, function in named:
        if not (callable(function) or isinstance(function, str)) or not isinstance(name, str):
            raise InputError(f"stress has {shown(function)} for {shown(name)}; {USAGE}")
    if len(dict(named)) < len(named):
        raise InputError("two fields have the same name: give stress={'name': function, ...}")
    return dict(named)


def checked_field(values: Any, count: int, body: str) -> Array:
    """Values of a body's nodes: numbers (nodes,), vectors (nodes, 2 or 3), tensors (nodes, 3, 3)."""
    array = numbers(values, f"what stress(body, u) returned for body {body!r}", "see von_mises")
    if array.shape[:1] != (count,) or array.shape[1:] not in ((), (2,), (3,), (3, 3)):
        raise InputError(
            f"stress(body, u) returned shape {array.shape} for body {body!r}, which has {count} "
            "nodes. It has to return a number for each node, as skfem_contact.von_mises does, a vector "
            "(nodes, 2 or 3), or a tensor (nodes, 3, 3), as nodal_stress does."
        )
    return array


def as_columns(values: Array) -> Array:
    """Arrange values as files have them: one number, three of a vector, or six of a tensor."""
    if values.ndim == 3:
        return np.stack([values[:, i, j] for i, j in SIX.values()], axis=1)
    return three(values) if values.ndim == 2 else values


def component(values: Array, which: str | None, name: str) -> Array:
    """One number per node for a picture, of a tensor or a vector the component `which`.

    >>> component(np.eye(3)[None] * 2.0, "yy", "sigma")
    array([2.])
    """
    if values.ndim == 1:
        if which is not None:
            raise InputError(f"component={which!r}: {name!r} is one number per node, and has none")
        return values
    names = {**SIX, **{k[::-1]: v for k, v in SIX.items()}}
    known: dict[str, Any] = names if values.ndim == 3 else dict(zip("xyz", range(3), strict=True))
    if which not in known or (values.ndim == 2 and known[which] >= values.shape[1]):
        listed = ", ".join(map(repr, SIX if values.ndim == 3 else "xyz"[: values.shape[1]]))
        raise InputError(f"component={which!r} of {name!r}: a picture shows one of {listed}")
    index = (slice(None), *np.atleast_1d(known[which]))
    return values[index]


def checked_units(units: Mapping[str, str] | None) -> dict[str, str]:
    """Units by kind of quantity, as users give them.

    >>> checked_units({"lenght": "mm"})
    Traceback (most recent call last):
        ...
    skfem_contact.errors.InputError: units has no kind 'lenght'; did you mean 'length'? Known kinds: ...
    """
    if units is None:
        return {}
    if not isinstance(units, Mapping):
        raise InputError(f"units is {shown(units)}; {UNITS}")
    for kind, unit in units.items():
        if kind not in KINDS:
            raise InputError(f"units has no kind {kind!r}{suggest(kind, KINDS, 'kinds')}")
        if not isinstance(unit, str):
            raise InputError(f"units[{kind!r}] is {shown(unit)}, which is no word; {UNITS}")
    return dict(units)


def labelled(words: str, kind: str, units: Mapping[str, str]) -> str:
    """A label with its unit, where there is one.

    >>> labelled("pressure", "stress", {"stress": "MPa"}), labelled("x", "length", {})
    ('pressure [MPa]', 'x')
    """
    return f"{words} [{units[kind]}]" if units.get(kind) else words


def quantity(value: float, kind: str, units: Mapping[str, str]) -> str:
    """A number in words with its unit.

    >>> quantity(104.73, "stress", {"stress": "MPa"}), quantity(1363.2, "stress", {})
    ('105 MPa', '1360')
    """
    return f"{float(f'{value:.3g}'):g} {units.get(kind, '')}".strip()
