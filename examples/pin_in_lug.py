r"""A pin in the hole of a lug, pulled up and swung from side to side.

               ^   pull, 1500 N/mm, then 20 degrees to either side
            .--|--.
          /   _|_   \          aluminium lug, steel pin with a radial clearance of 0.03 mm,
         |   ( | )   |         Coulomb friction 0.2; plane stress, per mm of thickness
         |    ---    |
         |    lug    |         meshes from one Gmsh file, with nodes of their own at the hole
         |___________|
         /////////////

The pin is held by nothing but contact and friction. It sticks on one part of the hole and slips on
another, which depends on where the pull comes from; so it turns to and fro on different paths.
Pressure and friction on the hole add up to the pull in every step, to nine digits.

Run ``python examples/pin_in_lug.py [folder]``: report, files for ParaView, and a picture.
"""

import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import skfem as fem
from skfem.models.elasticity import lame_parameters, linear_elasticity

import skfem_contact as sc

here = Path(__file__).parent
out = Path(sys.argv[1]) if len(sys.argv) > 1 else here / "out"

# %% Numbers (N, mm, MPa)
clearance = 0.03
material = {"lug": {"E": 72e3, "nu": 0.33}, "pin": {"E": 210e3, "nu": 0.3}}
force = 1500.0


def plane_stress(E, nu):
    lam, mu = lame_parameters(E, nu)
    return linear_elasticity(2 * lam * mu / (lam + 2 * mu), mu)


# %% Two bodies: the subdomains of one Gmsh file, whose physical curves are the boundaries
mesh = fem.MeshTri.load(here / "meshes" / "pin_in_lug.msh")
element = fem.ElementVector(fem.ElementTriP1())
lug_basis = fem.Basis(mesh.restrict("lug"), element)
pin_basis = fem.Basis(mesh.restrict("pin"), element)

lug = sc.Body(lug_basis, plane_stress(**material["lug"]), D="base", name="lug")
pin = sc.Body(pin_basis, plane_stress(**material["pin"]), name="pin")

# the pull is spread over the pin; a unit of it along each axis
section = pin_basis.dx.sum()
unit = [fem.LinearForm(lambda v, w, k=k: v[k] / section).assemble(pin_basis) for k in range(2)]


def pull(size, degrees):
    """The load step in which the pin is pulled by `size`, `degrees` off the vertical."""
    angle = np.radians(degrees)
    return {"f": {"pin": size * (np.sin(angle) * unit[0] + np.cos(angle) * unit[1])}}


# %% Contact
def gap(x):
    """Between two circles that touch at the top.

    The meshes would give it with an error of h^2 / 8R: the chords of one are over the nodes of the
    other. That is a twentieth of the clearance, enough for ripples in the pressure.
    """
    radius = np.hypot(*x)
    return clearance * (1.0 - x[1] / radius)


contact = sc.Contact(
    lug.surface("hole"),
    pin.surface("rim"),
    friction=sc.Coulomb(0.2),
    method="mortar",
    gap=gap,
    name="pin in hole",
)
solver = sc.ContactSolver([lug, pin], [contact])
print(solver)

# %% Pull up, then swing: right, left, and right again
swing = np.arange(-20, 20, 4)
angles = np.concatenate([np.zeros(3), np.arange(4, 20, 4), -swing, swing, [20]])
sizes = np.minimum(force, force / 3 * np.arange(1, len(angles) + 1))
results = list(solver.history(pull(F, angle) for F, angle in zip(sizes, angles, strict=True)))
print("\nAt the end of the history:", results[-1], sep="\n")

# %% Check: the hole carries the pull
directions = np.column_stack([np.sin(np.radians(angles)), np.cos(np.radians(angles))])
on_hole = np.array([result.force for result in results])
error = np.abs(on_hole - sizes[:, None] * directions).max() / force
tolerance = 1e-9
print(f"\npressure and friction on the hole differ from the pull by {error:.1e} of it")


# %% Write and plot
def mises(body, u):
    return sc.von_mises(body, u, **material[body.name], plane="stress")


sc.write_series(out / "pin_in_lug.pvd", results, stress=mises)

figure, axes = plt.subplot_mosaic(
    "AB;AC", figsize=(11, 6.4), width_ratios=[1, 1.15], layout="constrained"
)
last = results[-1]
units = {"length": "mm", "stress": "MPa"}
sc.plot_deformed(last, stress=mises, ax=axes["A"], units=units)
sc.plot_contact(last, ax=axes["B"], units=units)
axes["B"].set(xlabel="arc length along the hole [mm]")
turn = fem.LinearForm(lambda v, w: (v.grad[1, 0] - v.grad[0, 1]) / (2 * section))
rotation = [turn.assemble(pin_basis) @ result.displacement(pin) for result in results]
axes["C"].plot(angles, 1e3 * np.array(rotation), "o-", ms=3, color="#20618d")
axes["C"].set(xlabel="direction of the pull [degrees]", ylabel="rotation of the pin [mrad]")
axes["C"].spines[["top", "right"]].set_visible(False)
figure.savefig(out / "pin_in_lug.png", dpi=90)
