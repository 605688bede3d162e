"""A block on another one, 200 000 degrees of freedom, pressed and dragged in 10 steps with progress."""

import time

import numpy as np
import skfem as fem
from skfem.models.elasticity import lame_parameters, linear_elasticity

import skfem_contact as sc


def block(nx, y0, y1, ny, name, E):
    mesh = fem.MeshQuad.init_tensor(np.linspace(0, 2, nx + 1), np.linspace(y0, y1, ny + 1))
    basis = fem.Basis(mesh.with_defaults(), fem.ElementVector(fem.ElementQuad1()), intorder=2)
    side = "top" if y0 == 0 else "bottom"
    return sc.Body(basis, linear_elasticity(*lame_parameters(E, 0.3)), D=side, name=name)


lower, upper = block(340, -1, 0, 160, "lower", 1.0), block(300, 0, 1, 150, "upper", 2.0)
print(lower.n + upper.n, "degrees of freedom")
foot = sc.Contact(upper.surface("bottom"), lower.surface("top"), friction=sc.Coulomb(0.3), name="foot")
solver = sc.ContactSolver([lower, upper], foot)
print(solver)
begin = time.process_time()
solver.prepare()
prepared = time.process_time() - begin
steps = [{"x": {"upper": {"top": (s, -0.01)}}} for s in np.linspace(0, 0.02, 11)]
results = list(solver.history(steps, progress=True))
took = time.process_time() - begin - prepared
last = results[-1]
print(last)
print(f"condensation {prepared:.1f} s, 11 steps {took:.1f} s")
assert lower.n + upper.n > 200_000 - 2
assert abs(-last.force[0] / last.force[1] - 0.3) < 1e-9 and (last.status > 0).sum() > 200
assert last.certificate.worst < 1e-9 and took < prepared
