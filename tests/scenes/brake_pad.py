"""A brake pad pressed on a rail that is drawn away under it by four lengths of the pad."""

import numpy as np
import skfem as fem
from skfem.models.elasticity import lame_parameters, linear_elasticity

import skfem_contact as sc

mu, press = 0.4, 2.0  # MPa
pad_mesh = fem.MeshQuad.init_tensor(np.linspace(0, 40, 21), np.linspace(0, 10, 6)).with_defaults()
pad_basis = fem.Basis(pad_mesh, fem.ElementVector(fem.ElementQuad1()), intorder=2)
pad = sc.Body(
    pad_basis,
    linear_elasticity(*lame_parameters(500.0, 0.3)),
    f={"top": (0.0, -press)},
    D=pad_basis.get_dofs("top").all("u^1"),
    name="pad",
)
rail_mesh = fem.MeshQuad.init_tensor(np.linspace(-10, 220, 60), np.linspace(-20, 0, 6)).with_defaults()
rail_basis = fem.Basis(rail_mesh, fem.ElementVector(fem.ElementQuad1()), intorder=2)
rail = sc.Body(rail_basis, linear_elasticity(*lame_parameters(210e3, 0.3)), D="bottom", name="rail")
lining = sc.Contact(
    pad.surface("bottom"), rail.surface("top"), friction=sc.Coulomb(mu), sliding="finite"
)
solver = sc.ContactSolver([pad, rail], [lining])
results = list(solver.history({"x": {"rail": {"bottom": (-s, 0.0)}}} for s in (0, 5, 50, 160)))

last = results[-1]
print(last)
# statics: the force is mu times the load, whatever the pressure is
assert abs(last.force[1] / (press * 40) - 1) < 1e-6
assert abs(last.force[0] / (-mu * press * 40) - 1) < 1e-3
# and it takes its work: mu N over the way, less what the pad springs
assert abs(last.dissipation_total / (mu * press * 40 * 160) - 1) < 0.01
