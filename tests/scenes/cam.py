"""A cam (a disc out of centre) lifts a follower that a spring presses on it; half a turn."""

import numpy as np
import skfem as fem
from scipy.sparse import diags
from skfem.models.elasticity import lame_parameters, linear_elasticity

import skfem_contact as sc

radius, off, spring, first = 20.0, 4.0, 30.0, 400.0  # mm, N/mm, N
mesh = fem.MeshQuad.init_tensor(np.linspace(-9, 9, 37), np.linspace(0, 10, 11)).with_defaults()
basis = fem.Basis(mesh, fem.ElementVector(fem.ElementQuad1()), intorder=2)
guided = basis.get_dofs({"left", "right"}).all("u^1")
up = basis.get_dofs("top").all("u^2")
K = linear_elasticity(*lame_parameters(210e3, 0.3)).assemble(basis)
K = K + diags(np.where(np.isin(np.arange(basis.N), up), spring / len(up), 0.0))  # acts on the top
follower = sc.Body(basis, K, f={"top": (0.0, -first / 18)}, D=guided, name="follower")
# the axle is at the origin: at first the centre of the disc is straight below the highest point
cam = sc.RigidCylinder((0, -radius), radius, name="cam")
contact = sc.Contact(
    follower.surface("bottom"), cam, friction=sc.Coulomb(0.1), sliding="finite", name="cam on follower"
)
angles = np.linspace(0, np.pi, 25)
axle = (0.0, -radius - off)
steps = [{"motion": {"cam": ((0.0, 0.0), angle, axle)}} for angle in angles]
lifts, forces, ratio = [], [], []
for result in sc.ContactSolver(follower, contact, options=sc.Options(max_travel=np.inf)).history(steps):
    lifts.append(result.displacement("follower")[up].mean())
    forces.append(result.force[1])
    ratio.append(result.force[0] / result.force[1])
print(result)
exact = -off * (1 - np.cos(angles))
squeeze = 0.02  # what Hertz and the block give
assert np.abs(np.array(lifts) - exact).max() < squeeze
assert np.allclose(forces, first + spring * np.array(lifts), rtol=1e-6)  # statics of the follower
# it slips all the way; nodes off the middle bear along normals that lean by half a facet over radius
assert np.allclose(np.abs(ratio[1:]), 0.1, atol=0.0125)
