"""Rectangles of quadrilaterals, with their sides named left, right, bottom and top."""

from __future__ import annotations

from typing import Any

import numpy as np
import skfem as fem
from quick_elasticity import linear_elasticity
from skfem.models.elasticity import lame_parameters

import skfem_contact as sc


def rectangle(x: Any, y: Any, *, element: Any = None, order: int | None = None) -> fem.CellBasis:
    """A basis over the lines of a grid; `order` is that of the quadrature, or what scikit-fem takes."""
    mesh = fem.MeshQuad.init_tensor(np.asarray(x, float), np.asarray(y, float)).with_defaults()
    return fem.Basis(mesh, fem.ElementVector(element or fem.ElementQuad1()), intorder=order)


def block(
    name: str = "block",
    x: tuple[float, float] = (0.0, 1.0),
    y: tuple[float, float] = (0.0, 1.0),
    n: int | tuple[int, int] = 4,
    *,
    E: float = 1.0,
    nu: float = 0.3,
    move: Any = None,
    force: Any = None,
    element: Any = None,
    order: int | None = None,
    **data: Any,
) -> sc.Body:
    """An elastic one between ends, of n elements each way, or of so many along either.

    A `move` is the displacement of all that is prescribed, a `force` is spread over the nodes.
    """
    across, up = (n, n) if isinstance(n, int) else n
    basis = rectangle(
        np.linspace(*x, across + 1), np.linspace(*y, up + 1), element=element, order=order
    )
    for key, vector, share in (("x", move, 1), ("f", force, basis.mesh.p.shape[1])):
        if vector is not None:
            data[key] = np.zeros(basis.N)
            data[key][basis.nodal_dofs] = np.reshape(vector, (2, 1)) / share
    return sc.Body(basis, linear_elasticity(*lame_parameters(E, nu)), name=name, **data)
