r"""A press fit: a hub shrunk on a shaft, and the force that pushes it off again.

      axis
        |____
        |    |__________    shaft: radius 20 mm
        |    |          |   hub: 160 mm long, outer radius 30 mm
        |    |          |   interference 0.02 mm of the radii, Coulomb friction 0.2
        |    |   hub    |
        |    |__________|
        |    |   ^  ^  ^    puller: a rigid ring, moved up from below
        |____|
       ///////              half a section; steel, axisymmetric

Away from its ends the hub does not slip on the shaft, so that neither can stretch along the axis on
its own: although nothing holds the ends, the pressure in the middle is Lamé's of plane strain, to
0.2 %. (In plane stress, without friction, it would be 9 % less.) Then the puller pushes the hub; slip
grows from both ends, and when all has slipped the force is the friction coefficient times the
normal force, to nine digits. It is a quarter less than the fit promised: the push makes the
shaft thinner and the hub wider.

Run ``python examples/press_fit.py [folder]``: report, files for ParaView, and a picture.
"""

import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import skfem as fem
from skfem.helpers import grad
from skfem.models.elasticity import lame_parameters

import skfem_contact as sc
from skfem_contact.reference import lame_rings

here = Path(__file__).parent
out = Path(sys.argv[1]) if len(sys.argv) > 1 else here / "out"

# %% Numbers (N, mm, MPa)
Rc, Ro = 20.0, 30.0  # radii of the joint and of the hub
bottom, top, shaft_top = 40.0, 200.0, 220.0  # the ends of the hub, and that of the shaft
clear = 0.1  # between hub and puller, at first
interference, mu = 0.02, 0.2
material = {"E": 210e3, "nu": 0.3}
lam, G = lame_parameters(**material)


# %% Bodies: x[0] is the radius r, x[1] the height z; forces are those of the full circle
@fem.BilinearForm
def axisymmetric(u, v, w):
    r = w.x[0]
    (du, dv) = grad(u), grad(v)
    direct = [(du[0, 0], dv[0, 0]), (du[1, 1], dv[1, 1]), (u[0] / r, v[0] / r)]
    volume = sum(a for a, _ in direct) * sum(b for _, b in direct)
    shear = (du[0, 1] + du[1, 0]) * (dv[0, 1] + dv[1, 0])
    return 2 * np.pi * r * (lam * volume + 2 * G * sum(a * b for a, b in direct) + G * shear)


def section(r, z):
    mesh = fem.MeshQuad.init_tensor(r, z).with_defaults()
    return fem.Basis(mesh, fem.ElementVector(fem.ElementQuad1()), intorder=4)


def circle(x):
    return 2 * np.pi * x[0]


z = np.linspace(0, shaft_top, 111)
shaft_basis = section(np.linspace(0, Rc, 11), z)
hub_basis = section(np.linspace(Rc, Ro, 7), z[(z >= bottom) & (z <= top)])
D = {"bottom": "y", "left": "x"}
shaft = sc.Body(shaft_basis, axisymmetric, D=D, measure=circle, name="shaft")
hub = sc.Body(hub_basis, axisymmetric, measure=circle, name="hub")

# %% Contacts: the hub is held by nothing but the joint
joint = sc.Contact(hub.surface("left"), shaft.surface("right"), friction=sc.Coulomb(mu), name="joint")
ring = np.array([(Rc, -5), (Ro + 4, -5), (Ro + 4, 0), (Rc, 0)])
plate = sc.RigidPolyline(ring + [0, bottom - clear], closed=True, name="puller")
pushed = sc.Contact(hub.surface("bottom"), plate, name="face")
solver = sc.ContactSolver([shaft, hub], [joint, pushed])

# %% Fit in four steps, then push until the whole hub slides
fit = [{"interference": {"joint": share * interference}} for share in (0.25, 0.5, 0.75, 1.0)]
travel = np.linspace(0, 0.22, 45)
push = [{"motion": {"puller": (0.0, clear + t)}} for t in travel]
results = list(solver.history([*fit, *push]))
fitted, last = results[len(fit) - 1], results[-1]
print("The fit:", fitted, "", "At the end of the push:", last, sep="\n")

# %% Check: Lamé in the middle; friction at full slip
steel = tuple(material.values())
lame = lame_rings(0.0, Rc, Ro, steel, steel, interference=interference)
height = fitted["joint"].points[:, 1]
middle = np.argmin(np.abs(height - (bottom + top) / 2))
pressure = fitted["joint"].pressure[middle]
off_lame = abs(pressure / lame.pressure - 1)

force = np.array([result["face"].force[1] for result in results[len(fit) :]])
normal = np.array([result["joint"].normal_force.sum() for result in results[len(fit) :]])
off_coulomb = abs(force[-1] / (mu * normal[-1]) - 1)
print(f"\npressure in the middle {pressure:.3f} MPa, Lamé {lame.pressure:.3f} MPa: {off_lame:.1e}")
print(f"pushed off by {force[-1]:.1f} N, mu times normal force to {off_coulomb:.1e}")
print(f"before the push mu times normal force was {mu * normal[0]:.1f} N")
error = max(off_lame / 2e-3, off_coulomb / 1e-9)  # in units of what is promised above
tolerance = 1.0


# %% Write and plot
def mises(body, u):
    return sc.von_mises(body, u, **material, plane="axisymmetric")


sc.write_series(out / "press_fit.pvd", results, stress=mises)

units = {"length": "mm", "stress": "MPa"}
figure, axes = plt.subplots(
    1, 4, figsize=(13, 4.6), width_ratios=[1.15, 1, 0.8, 1.4], layout="constrained"
)
sc.plot_deformed(last, scale=1.0, stress=mises, ax=axes[0], units=units, window=(0, 36, 30, 84))
axes[0].set(title="pushed off: the lower end", xlabel="r [mm]", ylabel="z [mm]")

half = len(fit) + len(travel) // 3
order = np.argsort(height)
moments = {
    "fit": (fitted, "#20618d"),
    f"at {1e3 * travel[half - len(fit)]:.0f} µm": (results[half], "#4a9a6c"),
    "all slips": (last, "#b5441c"),
}
for label, (result, colour) in moments.items():
    values = result["joint"]
    axes[1].plot(values.pressure[order], height[order], color=colour, lw=1.5, label=label)
    axes[2].plot(values.traction[order, 1], height[order], color=colour, lw=1.5)
axes[1].axvline(lame.pressure, color="#777777", lw=0.8, ls=(0, (4, 2)), label="Lamé")
axes[1].set(xlabel="pressure [MPa]", ylabel="z [mm]", xlim=(0, 150), ylim=(bottom, top))
axes[1].legend(frameon=False, loc="center right", handlelength=1.3)
axes[2].axvline(0, color="#3a3a3a", lw=0.6)
axes[2].set(xlabel="friction on the hub [MPa]", ylim=(bottom, top))
axes[3].plot(1e3 * travel, 1e-3 * mu * normal, "--", color="#b5441c", label="μ times normal force")
axes[3].plot(1e3 * travel, 1e-3 * force, color="#20618d", lw=1.8, label="force of the puller")
axes[3].set(xlabel="travel of the puller [µm]", ylabel="force on the full circle [kN]", ylim=(0, None))
axes[3].legend(frameon=False, loc="lower right")
for ax in axes[1:]:
    ax.spines[["top", "right"]].set_visible(False)
figure.savefig(out / "press_fit.png", dpi=90)
