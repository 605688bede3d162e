"""Fields over the nodes of bodies that users ask for: one or several, numbers, vectors or tensors."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skfem_contact.arguments import numbers, shown
from skfem_contact.bodies.body import Body
from skfem_contact.errors import InputError
from skfem_contact.output.nodes import three
from skfem_contact.output.stress import field_name

Array = NDArray[np.float64]
Stress = Callable[[Body, Array], Array]

USAGE = "give a function (body, u) -> values at the nodes, such as von_mises, or a dict of them by name"
#: Components of a symmetric tensor, in the order of VTK.
SIX = {"xx": (0, 0), "yy": (1, 1), "zz": (2, 2), "xy": (0, 1), "yz": (1, 2), "xz": (0, 2)}


def asked(stress: Any) -> dict[str, Stress]:
    """Functions by the names of their fields.

    >>> asked({"sigma": lambda body, u: u}).keys(), asked(None)
    (dict_keys(['sigma']), {})
    """
    if stress is None:
        return {}
    if isinstance(stress, Mapping):
        named = [(name, function) for name, function in stress.items()]
    elif callable(stress) or not isinstance(stress, Iterable):
        named = [(field_name(stress), stress)]
    else:
        named = [(field_name(function), function) for function in stress]
    for name, function in named:
        if not callable(function) or not isinstance(name, str):
            raise InputError(f"stress has {shown(function)} for {shown(name)}; {USAGE}")
    if len(dict(named)) < len(named):
        raise InputError("two fields have the same name: give stress={'name': function, ...}")
    return dict(named)


def checked(values: Any, count: int, body: str) -> Array:
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
    """As files have them: one number, three of a vector, or six of a symmetric tensor."""
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
