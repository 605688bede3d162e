r"""Forging: a billet that yields is squeezed until it fills a die, which a ring holds together.

      axis  | | | | |  rigid punch, 0.7 mm down
        |   v v v v v
        |______________ ____ ______     billet: aluminium, radius 19.9 mm, height 20 mm
        |              |    |      |    die and ring: steel, radii 20, 40, 60 mm, height 28 mm
        |    billet    |die | ring |    interference of the ring 0.1 mm, without friction
        |______________|____|______|    billet: Coulomb friction 0.2, at most the yield stress in shear
         o    o    o    o    o    o     bottom: plane of symmetry

First the ring is shrunk on the die: the pressure is Lamé's of plane stress. Then the punch comes down.
The billet yields, spreads until it touches the wall, and from there on has nowhere to go, as metals
keep their volume: the pressure rises quickly, and what the billet still yields is what die and ring
give way, which are elastic. They are condensed once; each iterate costs no more than the billet.

Friction on the wall is 0.2 times the pressure, and from 577 MPa on what the metal bears in shear.
The work of the punch is found again in what the bodies store, in plastic flow and in friction, to one
per cent: the step of plastic flow is of first order.

Run ``python examples/forging.py [folder]``: a picture, and a series for ParaView.
"""

import sys
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import skfem as fem

import skfem_contact as sc
from skfem_contact.reference import lame_rings

out = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent / "out"
out.mkdir(parents=True, exist_ok=True)

# %% Numbers (N, mm, MPa)
radius, height, clear = 20.0, 20.0, 0.1
die_radius, ring_radius, die_height = 40.0, 60.0, 28.0
interference, mu = 0.1, 0.2
yield_stress, hardening = 200.0, 100.0
shear_strength = yield_stress / np.sqrt(3)
steel = sc.Elastic(210e3, 0.3)
aluminium = sc.J2(70e3, 0.33, [(yield_stress, 0.0), (yield_stress + hardening, 1.0)])


# %% Bodies: x[0] is the radius r, x[1] the height z; forces are those of the full circle
def circle(x):
    return 2 * np.pi * x[0]


def section(r, z):
    mesh = fem.MeshQuad.init_tensor(r, z).with_defaults()
    return fem.Basis(mesh, fem.ElementVector(fem.ElementQuad1()), intorder=2)


z = np.linspace(0, die_height, 29)
basis = section(np.linspace(0, radius - clear, 21), np.linspace(0, height, 21))
D = {"bottom": "y", "left": "x"}
billet = sc.NonlinearBody(basis, aluminium, D=D, measure=circle, name="billet")
basis = section(np.linspace(radius, die_radius, 15), z)
die = sc.Body(basis, steel, D={"bottom": "y"}, measure=circle, name="die")
basis = section(np.linspace(die_radius, ring_radius, 11), z)
ring = sc.Body(basis, steel, D={"bottom": "y"}, measure=circle, name="ring")
punch = sc.RigidPlane((0, height), (0, -1), name="punch")

# %% Contacts
rough = sc.Coulomb(mu, tau_max=shear_strength)
fit = sc.Contact(ring.surface("left"), die.surface("right"), name="fit")
wall = sc.Contact(billet.surface("right"), die.surface("left"), friction=rough, name="wall")
face = sc.Contact(billet.surface("top"), punch, friction=rough, name="face")
solver = sc.ContactSolver([billet, die, ring], [fit, wall, face])

# %% Shrink, then press
travel = np.concatenate([np.linspace(0, 0.1, 6)[1:], np.linspace(0.1, 0.7, 25)[1:]])
shrink = [{"interference": {"fit": share * interference}} for share in (0.5, 1.0)]
press = [{"motion": {"punch": (0.0, -down)}} for down in travel]
results = list(solver.history([*shrink, *press]))
fitted, last = results[1], results[-1]
print(last)
print(last.newton)

# %% Checks
steels = (steel.E, steel.nu)
radii = (radius, die_radius, ring_radius)
lame = lame_rings(*radii, steels, steels, interference=interference, plane="stress")
low = fitted["fit"].points[:, 1] < die_height / 2  # at the top the ring ends a little below the die
pressure = fitted["fit"].pressure[low]
off_lame = np.abs(pressure / lame.pressure - 1).max()
print(f"shrunk by {pressure.mean():.2f} MPa, Lamé {lame.pressure:.2f} MPa")

shear = max(np.abs(result["wall"].traction[:, 1]).max() for result in results)
print(f"friction on the wall up to {shear:.2f} MPa, the billet bears {shear_strength:.2f} MPa")


def spent(result):
    """Energy stored in the bodies, and lost in the billet and in friction."""
    elastic = [0.5 * u @ body.K @ u for body in (die, ring) for u in [result.displacement(body)]]
    stored, flow = billet.energy(result.displacement(billet), result.state["billet"])
    return np.array([sum(elastic) + stored, flow, result.dissipation_total])


pressed = results[1:]  # from the fit on
travel = np.append(0.0, travel)
force = np.array([-result["face"].force[1] for result in pressed])
work = np.trapezoid(force, travel)
parts = spent(last) - spent(fitted)
print(f"work {work:.0f} N mm = stored {parts[0]:.0f} + flow {parts[1]:.0f} + friction {parts[2]:.0f}")
print("linearisations of a step:", max(len(result.newton) for result in results))

# in units of what is promised above
error = max(off_lame / 2e-3, abs(shear / shear_strength - 1) / 1e-9, abs(work / parts.sum() - 1) / 0.01)
tolerance = 1.0
print(f"errors over what is promised: {error:.2f}")
assert error <= tolerance

# %% Write and plot
fields = ["von_mises", "equivalent_plastic_strain"]
sc.write_series(out / "forging.pvd", results[::4], stress=fields, times=range(len(results[::4])))

units = {"length": "mm", "stress": "MPa"}
figure, axes = plt.subplots(1, 3, figsize=(15, 4.2), width_ratios=[1.5, 0.9, 1], layout="constrained")
seen: dict[str, Any] = {"scale": 1.0, "units": units, "obstacles": False}
sc.plot_deformed(last, stress="von_mises", ax=axes[0], window=(-2, 62, -1, 30), **seen)
axes[0].set(title="pressed: billet, die and ring", xlabel="r [mm]", ylabel="z [mm]")
seen |= {"arrows": False, "cmap": "YlOrRd", "window": (-0.5, 24, -0.5, 22)}
sc.plot_deformed(last, stress="equivalent_plastic_strain", ax=axes[1], **seen)
axes[1].set(title="plastic strain of the billet", xlabel="r [mm]", ylabel="z [mm]")
area = np.pi * (radius - clear) ** 2
wall_pressure = [result["wall"].pressure.mean() for result in pressed]
axes[2].plot(travel, force / area, color="#20618d", lw=1.8, label="punch")
axes[2].plot(travel, wall_pressure, color="#b5441c", lw=1.8, label="wall, mean")
axes[2].plot(travel, [r["fit"].pressure.mean() for r in pressed], color="#4a9a6c", label="fit, mean")
axes[2].axhline(yield_stress, color="0.6", lw=0.8, ls=(0, (4, 2)), label="yield stress")
axes[2].set(xlabel="travel of the punch [mm]", ylabel="pressure [MPa]", xlim=(0, 0.7), ylim=(0, None))
axes[2].legend(frameon=False)
axes[2].spines[["top", "right"]].set_visible(False)
figure.savefig(out / "forging.png", dpi=90)
