"""Loads and prescribed values by the names of boundaries: uniform tractions, constant displacements."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import skfem
from numpy.typing import NDArray

from skfem_contact.arguments import number, shown
from skfem_contact.arrays import Array
from skfem_contact.bodies.inputs import unknown_boundary
from skfem_contact.errors import InputError

Index = NDArray[np.int64]


def boundary_dofs(basis: Any, name: str, what: str) -> Index:
    """DOFs of all components on a boundary of the mesh, by its name; `what` begins the message."""
    if not isinstance(name, str):
        raise InputError(f"{what}: {shown(name)} is not the name of a boundary, which is a string")
    if name not in (basis.mesh.boundaries or {}):
        raise InputError(f"{what}: {unknown_boundary(name, basis.mesh)}")
    return np.asarray(np.unique(basis.get_dofs(name).flatten()), dtype=np.int64)


def tractions(
    given: Mapping[str, Any],
    basis: Any,
    measure: Callable[[Array], Array] | None,
    what: str,
) -> Array:
    """The load of uniform tractions on boundaries, shape (n,) [force].

    Parameters
    ----------
    given : dict
        By name of a boundary a traction of d numbers, in global axes [stress]; or one number, a
        pressure against the outward normal; of a scalar field the flux into the body. What several
        boundaries carry is added.
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
        stress = _components(value, basis, place, "a traction [stress]", False, pressure=True)
        check_not_lost(stress, basis, name, place)
        load += _form(stress, measure).assemble(basis.boundary(name))
    return load


def check_not_lost(values: list[Any], basis: Any, name: str, place: str) -> None:
    """Refuse values on a boundary without facets, unless they are none: scripts may name it for all."""
    if any(values) and not len(basis.mesh.boundaries[name]):
        raise InputError(
            f"{place}: this boundary has no facets in the mesh, so that the values would be lost. Look "
            "at how it was selected: a function of position has to hold at the midpoints of facets"
        )


def _form(stress: list[Any], measure: Callable[[Array], Array] | None) -> skfem.LinearForm:
    def power(v: Any, w: Any) -> Any:
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
