"""Two solid blocks pressed and sheared over one another so that the stress is uniform (P2 in space)."""

from __future__ import annotations

import sys
from functools import cache
from pathlib import Path

import numpy as np
import skfem as fem

sys.path.insert(0, str(Path(__file__).parent.parent))
from solid_meshes import KINDS, cube, elastic_form

import skfem_contact as sc


def near(axis, value, scale):
    """As `at`, within a part of a length."""
    return lambda x: np.abs(x[axis] - value) < 1e-6 * scale


@cache
def box(kind, n, size, low):
    """Basis of a block of a size above the height `low`, and what a shear of its sides does, (x, y)."""
    mesh = cube(kind, n, lambda x: np.array(size)[:, None] * (x + np.array([[0.0], [0.0], [low]])))
    # straight edges: products of two gradients, or a function
    order = 2 if kind in ("tri3", "quad4") else 4
    basis = fem.Basis(mesh, fem.ElementVector(KINDS[kind][2]()), intorder=order)
    across = []
    for axis in (0, 1):
        first, last = (
            fem.LinearForm(lambda v, w: v[2]).assemble(
                fem.FacetBasis(mesh, basis.elem, facets=mesh.facets_satisfying(end), intorder=order)
            )
            for end in (near(axis, 0.0, size[axis]), near(axis, size[axis], size[axis]))
        )
        across.append(last - first)
    return basis, across


def sheared_pair(kind, n, method, law, E=(0.7, 1.0), size=(1.0, 1.0, 1.0), partner=None, **options):
    """Two blocks, nu = 0, or one and a partner; and how they are loaded for a uniform shear."""
    cubes, sides, loads = [], [], []
    for k, modulus, name in zip(n, E, ("high", "low")[: len(n)], strict=True):
        low = 0.0 if name == "high" else -1.0
        basis, across = box(kind, k, tuple(size), low)
        D = basis.get_dofs(near(2, size[2] if low == 0 else -size[2], size[2])).all()
        cubes.append(sc.Body(basis, elastic_form(modulus, 0.0), D=D, name=name))
        sides.append(cubes[-1].surface(near(2, 0.0, size[2])))
        loads.append(across)
    sides += [] if partner is None else [partner]
    contact = sc.Contact(*sides, friction=law, method=method)
    solver = sc.ContactSolver(cubes, contact, options=sc.Options(**options))

    def load(U, d, tau):
        """The top moved along (x, y) and down; tau is the shear traction on it, (2,)."""
        x = np.zeros(cubes[0].n)
        D, component = cubes[0].D, cubes[0].dof_component[cubes[0].D]
        for i, value in enumerate((*U, -d)):
            x[D[component == i]] = value
        f = {
            body.name: sum(t * side for t, side in zip(tau, across, strict=True))
            for body, across in zip(cubes, loads, strict=True)
        }
        return {"x": {"high": x}, "f": f}

    return solver, load
