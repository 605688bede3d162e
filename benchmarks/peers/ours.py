"""The cases of `compare.py` by this library: `python ours.py CASE FILE`."""

from __future__ import annotations

from typing import Any

import numpy as np
import skfem as fem
from scene import NU, Body, E, Scene, run
from skfem.models.elasticity import lame_parameters, linear_elasticity

import skfem_contact as sc

KINDS = {  # of mesh and element, and where the nodes of an element of the scene are in scikit-fem's
    2: (fem.MeshQuad, fem.ElementQuad1, [0, 1, 2, 3]),
    3: (fem.MeshHex, fem.ElementHex1, [6, 2, 5, 7, 1, 3, 4, 0]),
}


def body(given: Body, dim: int, name: str) -> Any:
    """A body on a mesh of scikit-fem, whose nodes have the numbers of the scene."""
    mesh_type, element, order = KINDS[dim]
    mesh = mesh_type(given.points.T.copy(), given.cells[:, order].T.copy())
    sides = {"face": np.unique(given.face), "held": given.held}
    facets = {key: np.flatnonzero(np.isin(mesh.facets, on).all(axis=0)) for key, on in sides.items()}
    form = linear_elasticity(*lame_parameters(E, NU))
    vector = fem.ElementVector(element())
    return sc.Body.from_mesh(mesh.with_boundaries(facets), vector, form, D="held", name=name)


def solve(scene: Scene) -> tuple[np.ndarray, dict[str, Any]]:
    """The displacements of the last step."""
    bodies = [body(b, scene.dim, f"body {i}") for i, b in enumerate(scene.bodies)]
    upper = bodies[-1]
    other = sc.RigidPlane((0, 0, 0), (0, 0, 1)) if len(bodies) == 1 else bodies[0].surface("face")
    friction = sc.Coulomb(scene.mu) if scene.mu else None
    contact = sc.Contact(upper.surface("face"), other, friction=friction)
    steps = []
    for motion in scene.motion:
        u = np.zeros(upper.n)
        u[upper.D] = np.tile(motion, upper.n // scene.dim)[upper.D]
        steps.append({"x": {upper.name: u}})
    results = list(sc.ContactSolver(bodies, [contact]).history(steps))
    said = {"version": sc.__version__, "iterations": sum(r.iterations for r in results)}
    return results[-1].u.reshape(-1, scene.dim), said


if __name__ == "__main__":
    run(solve)
