"""The case `rigid` of `compare.py` by FElupe: points against a rigid plane, by penalty.

    pip install felupe
    python felupe_plane.py "rigid 7k" FILE

It has no contact between two deformable bodies, so `press` and `rub` are not run. Its friction against
a plane and its large strains are not compared. Linear systems: SciPy's SuperLU, its default.
"""

from __future__ import annotations

from typing import Any

import felupe as fem
import numpy as np
from scene import NU, E, Scene, run

SCALE = (
    100.0  # of the penalty over the mean stiffness of the points; its default of 1 lets them sink in
)
TOLERANCE = 1e-8


def solve(scene: Scene) -> tuple[np.ndarray, dict[str, Any]]:
    """The displacements of the last step."""
    (body,) = scene.bodies
    mesh = fem.Mesh(np.vstack([body.points, np.zeros(3)]), body.cells, "hexahedron")
    mesh.points_without_cells = np.array([], dtype=int)  # the last one is the plane's
    displacement = fem.Field(fem.RegionHexahedron(mesh), dim=3)
    field = fem.FieldContainer([displacement])
    solid = fem.SolidBody(umat=fem.LinearElastic(E=E, nu=NU), field=field)
    given = {"normal": [0, 0, 1], "multiplier": SCALE, "items": [solid]}
    plane = fem.ContactRigidPlane(
        field, points=np.unique(body.face), centerpoint=len(body.points), **given
    )
    held = np.isin(np.arange(len(mesh.points)), body.held)
    sides = {"plane": fem.Boundary(displacement, mask=np.arange(len(mesh.points)) == len(body.points))}
    for i, value in enumerate(scene.motion[-1]):
        skip = [j != i for j in range(3)]
        sides[f"top {i}"] = fem.Boundary(displacement, mask=held, skip=skip, value=float(value))
    dof0, dof1 = fem.dof.partition(field, sides)
    ext0 = fem.dof.apply(field, sides, dof0)
    loads = {"dof0": dof0, "dof1": dof1, "ext0": ext0, "tol": TOLERANCE, "verbose": False}
    found = fem.newtonraphson(items=[solid, plane], **loads)
    said = {"version": fem.__version__, "iterations": found.iterations}
    return displacement.values[:-1], said


if __name__ == "__main__":
    run(solve)
