"""A bolt through two plates, axisymmetric: tightened to 10 kN, then the plates are pulled apart."""

import numpy as np
import skfem as fem
from skfem.helpers import grad
from skfem.models.elasticity import lame_parameters

import skfem_contact as sc

preload, pulls = 10e3, (0.0, 4e3, 8e3, 12e3, 16e3)  # N
lam, G = lame_parameters(210e3, 0.3)


@fem.BilinearForm
def steel(u, v, w):
    du, dv, r = grad(u), grad(v), w.x[0]
    e = np.array([du[0, 0], du[1, 1], u[0] / r, (du[0, 1] + du[1, 0]) / np.sqrt(2)])
    d = np.array([dv[0, 0], dv[1, 1], v[0] / r, (dv[0, 1] + dv[1, 0]) / np.sqrt(2)])
    return 2 * np.pi * r * (2 * G * (e * d).sum(0) + lam * e[:3].sum(0) * d[:3].sum(0))


def body(mesh, name):
    basis = fem.Basis(mesh, fem.ElementVector(fem.ElementQuad1()), intorder=4)
    D = None
    if name == "bolt":  # nothing else says where along the axis it all stands
        middle = mesh.nodes_satisfying(lambda x: (x[0] == 0) & (x[1] == 0))
        D = np.append(basis.get_dofs("axis").all("u^1"), basis.nodal_dofs[1, middle])
    return sc.Body(basis, steel, D=D, measure=lambda x: 2 * np.pi * x[0], name=name)


# a shank of radius 4 and height 20 between a head and a nut of radius 8 and height 5
mesh = fem.MeshQuad.init_tensor(np.linspace(0, 8, 17), np.linspace(-15, 15, 61))
mesh = mesh.restrict(mesh.elements_satisfying(lambda x: (x[0] < 4) | (abs(x[1]) > 10)))
parts = {
    "axis": lambda x: x[0] == 0,
    "head": lambda x: (x[1] == 10) & (x[0] > 4),
    "nut": lambda x: (x[1] == -10) & (x[0] > 4),
}
bolt = body(mesh.with_boundaries(parts), "bolt")
sheet = fem.MeshQuad.init_tensor(np.linspace(4.5, 20, 32), np.linspace(0, 10, 21)).with_defaults()
upper = body(sheet, "upper")
lower = body(sheet.translated((0, -10)).with_defaults(), "lower")
contacts = [
    sc.Contact(bolt.surface("head"), upper.surface("top"), name="head"),
    sc.Contact(bolt.surface("nut"), lower.surface("bottom"), name="nut"),
    sc.Contact(upper.surface("bottom"), lower.surface("top"), name="joint"),
]
solver = sc.ContactSolver([bolt, upper, lower], contacts)
print(solver)

# the force is nearly proportional to how much the bolt is too short
short = 0.01
for _ in range(3):
    tight = list(solver.history([{"interference": {"nut": short}}]))[-1]
    short *= preload / tight["head"].force[1]
assert abs(tight["head"].force[1] / preload - 1) < 1e-9
apart = [p / (2 * np.pi * 20 * 10) for p in pulls]  # over the outer sides
steps = [{"f": {"upper": {"right": (0, p)}, "lower": {"right": (0, -p)}}} for p in apart]
for pull, result in zip(pulls, solver.history(steps, start=tight), strict=True):
    head, joint = result["head"].force[1], result["joint"].force[1]
    print(f"pull {pull:6.0f}  bolt {head:6.0f}  joint {joint:6.0f}")
    # statics; and a joint that is closed takes nearly all of the pull, an open one nothing
    assert abs(head - joint - pull) < 1e-9 * preload
    assert abs(head / max(preload, pull) - 1) < (0.04 if pull < preload else 1e-9)
