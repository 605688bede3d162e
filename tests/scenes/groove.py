"""A soft disc (an O-ring's section) pressed into a rectangular groove by a flat lid."""

import numpy as np
import skfem as fem
from skfem.models.elasticity import lame_parameters, linear_elasticity

import skfem_contact as sc

mesh = fem.MeshQuad.init_tensor(np.linspace(-1, 1, 33), np.linspace(-1, 1, 33))
x, y = mesh.p  # the square onto the disc of diameter 5 mm
mesh = fem.MeshQuad(2.5 * np.array([x * np.sqrt(1 - y**2 / 2), y * np.sqrt(1 - x**2 / 2)]), mesh.t)
basis = fem.Basis(mesh, fem.ElementVector(fem.ElementQuad1()), intorder=2)
ring = sc.Body(basis, linear_elasticity(*lame_parameters(6.0, 0.48)), name="ring")
skin = ring.surface(None)
groove = sc.RigidPolyline([(2.55, 4), (2.55, -2.5), (-2.55, -2.5), (-2.55, 4)], name="groove")
lid = sc.RigidPlane((0, 2.5), (0, -1), name="lid")
contacts = [
    sc.Contact(ring.surface(lambda x: x[1] < 1.5), groove, friction=sc.Coulomb(0.2), sliding="finite"),
    sc.Contact(ring.surface(lambda x: x[1] > 1.5), lid, friction=sc.Coulomb(0.2), sliding="finite"),
]
solver = sc.ContactSolver(ring, contacts)
results = list(solver.history({"motion": {"lid": (0, -d)}} for d in np.linspace(0, 0.5, 6)))
last = results[-1]
print(last)
walls, top = last["contact 1"], last["contact 2"]
assert np.abs(walls.force + top.force).max() < 1e-9 * abs(top.force[1])  # statics
left = walls.forces[walls.points[:, 0] < -1.5].sum(axis=0)
right = walls.forces[walls.points[:, 0] > 1.5].sum(axis=0)
assert left[0] > 0 and abs(left[0] + right[0]) < 1e-6 * abs(top.force[1])  # it bears on both sides
