"""A friction law of one's own: the coefficient falls from 0.5 to 0.3 over a slip of 0.02 mm."""

from dataclasses import dataclass

import numpy as np
import skfem as fem
from skfem.models.elasticity import linear_elasticity

import skfem_contact as sc


@dataclass(frozen=True, eq=False)
class Falling(sc.conditions.FrictionLaw):
    start: float = 0.5
    end: float = 0.3
    length: float = 0.02

    def limit(self, normal_force, area, slip):
        part = np.exp(-np.linalg.norm(slip, axis=1) / self.length)
        return (self.end + (self.start - self.end) * part) * normal_force


mesh = fem.MeshQuad.init_tensor(np.linspace(0, 1, 9), np.linspace(0, 1, 9)).with_defaults()
basis = fem.Basis(mesh, fem.ElementVector(fem.ElementQuad1()), intorder=2)
block = sc.Body(basis, linear_elasticity(0.0, 500.0), D="top", name="block")  # E = 1000, nu = 0
foot = sc.Contact(block.surface("bottom"), sc.RigidPlane((0, 0), (0, 1)), friction=Falling())
ways = np.linspace(0, 0.1, 21)
steps = [{"x": {"block": {"top": (way, -0.001)}}} for way in ways]
ratios = []
for result in sc.ContactSolver(block, foot).history(steps):
    ratios.append(-result.force[0] / result.force[1])
    if (result.status == 2).all():  # then each point is on the law
        bound = Falling().limit(result.normal_force, result.area, result.slip)
        assert abs(bound.sum() + result.force[0]) < 1e-9
print(result)
assert 0.4 < max(ratios) < 0.5 and abs(ratios[-1] - 0.3) < 0.01
