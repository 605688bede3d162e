r"""A rubber block squeezed on a rough floor: the user's own Newton loop around the contact solver.

      lowered by 15 % of the height
       |||||||||||||||||
    o |                 |
    o |     rubber      |     left: plane of symmetry; top: guided
    o |                 |     compressible neo-Hookean, plane strain
    o |_________________|
      =================== mu = 0.2

`skfem_contact.NonlinearBody` does all of this by itself. Here the loop is the user's own, as for
equations of another kind: in every Newton iteration ``solver.update`` takes the tangent stiffness
K(u) and the load f - f_int(u) + K(u) u, condenses it again, and solves for contact and friction. On a
floor the kinematics stay exact for any deformation.

Without friction the answer is homogeneous: the pressure on the floor, force over initial area, is that
of the closed form; with friction the middle sticks, the rest slips outwards, the block bulges. In both
cases the residual of the equations of the rubber is at round-off.

Run ``python examples/nonlinear_body.py [folder]``.
"""

import sys
import warnings
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import skfem as fem
from scipy.optimize import brentq
from skfem.helpers import ddot, det, grad, identity, inv, mul, transpose

import skfem_contact as sc

out = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent / "out"
out.mkdir(parents=True, exist_ok=True)

# %% Numbers (mm, MPa)
length, height, squeeze = 20.0, 10.0, 1.5
shear, lam = 1.0, 4.0

# %% The rubber: P = G (F - F^-T) + lam ln(J) F^-T and its derivative


def deformation(w):
    F = grad(w["u"]) + identity(w["u"])
    return F, transpose(inv(F)), np.log(det(F))


@fem.LinearForm
def internal(v, w):
    F, G, log_J = deformation(w)
    return ddot(shear * (F - G) + lam * log_J * G, grad(v))


@fem.BilinearForm
def tangent(u, v, w):
    _, G, log_J = deformation(w)
    turned = mul(mul(G, transpose(grad(u))), G)
    change = shear * grad(u) + (shear - lam * log_J) * turned + lam * ddot(G, grad(u)) * G
    return ddot(change, grad(v))


mesh = fem.MeshQuad.init_tensor(np.linspace(0, length, 41), np.linspace(0, height, 21))
basis = fem.Basis(mesh.with_defaults(), fem.ElementVector(fem.ElementQuad1()))
held = np.union1d(basis.get_dofs("left").all("u^1"), basis.get_dofs("top").all("u^2"))
top = basis.get_dofs("top").all("u^2")


def stiffness(u):
    return tangent.assemble(basis, u=basis.interpolate(u))


def force(u):
    return internal.assemble(basis, u=basis.interpolate(u))


# The solver sees a linear body that is strained by 15 %, and warns that linear elasticity is wrong by
# as much. Here it is not: what the tangent leaves out comes back as a load in every iteration below.
warnings.filterwarnings("ignore", ".*is strained by", sc.ContactWarning)


# %% The loop: load steps outside, Newton's iterations inside


def squeezed(friction, steps=5):
    """The state after the last step, the residual of the rubber over the largest force, iterations."""
    rubber = sc.Body(basis, stiffness(basis.zeros()), D=held, name="rubber")
    floor = sc.RigidPlane((0, 0), (0, 1), name="floor")
    solver = sc.ContactSolver(
        [rubber], [sc.Contact(rubber.surface("bottom"), floor, friction=friction)]
    )
    u, last, counts = basis.zeros(), None, []
    for share in np.linspace(0, 1, steps + 1)[1:]:
        x = basis.zeros()
        x[top] = -share * squeeze
        result, change = last, np.inf
        counts.append(0)
        while change > 1e-11 * height and counts[-1] < 20:
            K = stiffness(u)
            solver.update("rubber", K=K, f=K @ u - force(u))
            # friction remembers the last step; the last iterate is a guess and no more
            result = solver.solve(x={"rubber": x}, start=last, guess=result)
            change, u = np.abs(result.u - u).max(), result.u
            counts[-1] += 1
        last = result
    assert last is not None
    surface = rubber.surface("bottom")
    out_of_balance = force(u)
    np.subtract.at(out_of_balance, surface.dofs, last.forces)
    out_of_balance[held] = 0.0
    return last, np.abs(out_of_balance).max() / last.normal_force.max(), counts


smooth, residual, counts = squeezed(None)
print(f"without friction: residual {residual:.1e}, Newton iterations {counts}")
rough, residual_rough, counts = squeezed(sc.Coulomb(0.2))
print(f"with friction:    residual {residual_rough:.1e}, Newton iterations {counts}")

# %% Check: homogeneous without friction, and in equilibrium with it
stretch = 1 - squeeze / height


def side(a):  # the stress on the free side, a the stretch across
    return shear * (a - 1 / a) + lam * np.log(a * stretch) / a


across = brentq(side, 1.0, 2.0, xtol=1e-14)
pressure = -shear * (stretch - 1 / stretch) - lam * np.log(across * stretch) / stretch
error = max(residual, residual_rough, np.abs(smooth.pressure / pressure - 1).max())
tolerance = 1e-9
print(f"pressure {pressure:.6f} MPa, error and residuals at most {error:.1e}")
assert error <= tolerance

# %% Picture
units = {"length": "mm", "stress": "MPa"}
figure, axes = plt.subplots(2, 1, figsize=(7.5, 8), height_ratios=[1, 1.1], layout="constrained")
sc.plot_deformed(rough, ax=axes[0], units=units)
axes[0].set_title("squeezed by 15 %; true positions")
sc.plot_contact(rough, ax=axes[1], units=units)
axes[1].axhline(pressure, color="0.4", lw=1, ls=":")
axes[1].text(7, pressure - 0.03, "pressure without friction", va="top", color="0.3")
axes[1].set(xlabel="place along the floor [mm]", ylabel="force over initial area [MPa]")
figure.savefig(out / "nonlinear_body.png", dpi=90)
