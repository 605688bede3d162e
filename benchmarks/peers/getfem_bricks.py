"""The cases of `compare.py` by GetFEM: multipliers, generalised Newton of Alart and Curnier.

    apt install python3-getfem      (for the interpreter of the system, `GETFEM_PYTHON`)
    python3 getfem_bricks.py CASE FILE

Without friction its nodal brick, with friction the one in integral form, multipliers on the upper face:
the nodal one has no history of friction, the integral one misses points that are far apart at first
(`press` with 24,420 DOFs: the force is 8 % too small). The augmentation parameter is the user's.
Linear systems: MUMPS. Nitsche's method, large sliding, dynamics and self-contact are not compared.
"""

from __future__ import annotations

from typing import Any

import getfem as gf
import numpy as np
from scene import NU, Body, E, Scene, run

AUGMENT = 10 * E  # near the modulus, says its manual
FACE, HELD = 1, 2
VARIANT = 1  # of the augmented Lagrangian: unsymmetric, of Alart and Curnier
RESIDUAL, ITERATIONS = 1e-10, 100


def mesh_of(body: Body, dim: int) -> Any:
    """A mesh of GetFEM, whose elements have the order of nodes of a tensor product."""
    order = [0, 1, 3, 2] if dim == 2 else [0, 1, 3, 2, 4, 5, 7, 6]
    mesh = gf.Mesh("empty", dim)
    mesh.add_point(body.points.T)
    kind = gf.GeoTrans(f"GT_QK({dim},1)")
    mesh.add_convex(kind, body.points[body.cells[:, order]].transpose(2, 1, 0))
    for region, ids in ((FACE, np.unique(body.face)), (HELD, body.held)):
        mesh.set_region(region, mesh.faces_from_pid(ids))
    return mesh


def touch(model: Any, scene: Scene, fields: list[Any], rules: list[Any]) -> None:
    """Nodal contact without friction; with friction the integral brick, which knows the step before."""
    model.add_initialized_data("r", AUGMENT)
    if not scene.mu:
        model.add_nodal_contact_between_nonmatching_meshes_brick(
            rules[1], rules[0], "u1", "u0", "force", "r", FACE, FACE
        )
        return
    pressures = gf.MeshFem(fields[1].linked_mesh(), scene.dim)
    pressures.set_fem(gf.Fem(f"FEM_QK({scene.dim},1)"))
    model.add_filtered_fem_variable("force", pressures, FACE)
    model.add_initialized_data("friction", scene.mu)
    model.add_initialized_data("rate", 1.0)
    for i, field in enumerate(fields):
        model.add_initialized_fem_data(f"before{i}", field, np.zeros(field.nbdof()))
    named = ("u1", "u0", "force", "r", "friction", FACE, FACE, VARIANT, "rate", "before1", "before0")
    model.add_integral_contact_between_nonmatching_meshes_brick(rules[1], *named)


def solve(scene: Scene) -> tuple[np.ndarray, dict[str, Any]]:
    """The displacements of the last step."""
    model = gf.Model("real")
    lame = E * NU / (1 + NU) / (1 - 2 * NU), E / 2 / (1 + NU)
    model.add_initialized_data("lambda", lame[0])
    model.add_initialized_data("mu", lame[1])
    fields, rules = [], []
    for i, body in enumerate(scene.bodies):
        mesh = mesh_of(body, scene.dim)
        field = gf.MeshFem(mesh, scene.dim)
        field.set_fem(gf.Fem(f"FEM_QK({scene.dim},1)"))
        rule = gf.MeshIm(mesh, gf.Integ(f"IM_GAUSS_PARALLELEPIPED({scene.dim},3)"))
        model.add_fem_variable(f"u{i}", field)
        model.add_isotropic_linearized_elasticity_brick(rule, f"u{i}", "lambda", "mu")
        model.add_initialized_data(f"top{i}", [0.0] * scene.dim)
        model.add_Dirichlet_condition_with_simplification(f"u{i}", HELD, f"top{i}")
        fields.append(field)
        rules.append(rule)
    touch(model, scene, fields, rules)
    count = 0
    for at in scene.motion:
        model.set_variable("top1", at)
        count += model.solve("max_iter", ITERATIONS, "max_res", RESIDUAL, "lsolver", "mumps")[0]
        for i in range(2 if scene.mu else 0):
            model.set_variable(f"before{i}", model.variable(f"u{i}"))
    u = np.empty((scene.size, scene.dim))
    for i, field in enumerate(fields):
        # nodes of the field are those of the mesh, in another order
        where = field.basic_dof_nodes()[:, :: scene.dim].T
        order, wanted = np.lexsort(where.T.round(12)), np.lexsort(scene.bodies[i].points.T.round(12))
        part = model.variable(f"u{i}").reshape(-1, scene.dim)
        u[scene.first(i) + wanted] = part[order]
    return u, {
        "version": gf.getfem_env("version") if hasattr(gf, "getfem_env") else "5.4",
        "iterations": count,
    }


if __name__ == "__main__":
    run(solve)
