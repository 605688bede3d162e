"""A chain of three blocks on the floor, drawn at the first by a spring: one after the other slips."""

from itertools import pairwise

import numpy as np
import skfem as fem
from skfem.models.elasticity import linear_elasticity

import skfem_contact as sc

weight, mu = 1.0, 0.4


def block(x, name):
    mesh = fem.MeshQuad.init_tensor(np.linspace(x, x + 1, 7), np.linspace(0, 1, 7)).with_defaults()
    basis = fem.Basis(mesh, fem.ElementVector(fem.ElementQuad1()), intorder=2)
    down = fem.LinearForm(lambda v, w: -weight * v[1]).assemble(basis)
    return sc.Body(basis, linear_elasticity(0.0, 500.0), down, name=name)


blocks = [block(2.0 * i, f"block {i}") for i in range(3)]
floor = sc.RigidPlane((0, 0), (0, 1))
feet = [
    sc.Contact(b.surface("bottom"), floor, friction=sc.Coulomb(mu), name=f"foot {i}")
    for i, b in enumerate(blocks)
]
# links: the right side of a block is glued to the left one of the next, as meshed, across the gap
links = [sc.Contact(a.surface("right"), b.surface("left"), tied=True) for a, b in pairwise(blocks)]
solver = sc.ContactSolver(blocks, feet + links)


def pulled(force):
    return {"block 2": blocks[2].f + blocks[2].load({"right": (force, 0.0)}, "pull")}


result = solver.solve(f=pulled(0.9 * 3 * mu * weight))
print(result)
assert abs(sum(result[f"foot {i}"].force[0] for i in range(3)) + 0.9 * 3 * mu * weight) < 1e-9
assert abs(sum(result[f"foot {i}"].force[1] for i in range(3)) - 3 * weight) < 1e-9
try:
    solver.solve(f=pulled(1.01 * 3 * mu * weight))
    raise AssertionError("more than all friction was carried")
except sc.errors.NoEquilibrium as error:
    print(error)
