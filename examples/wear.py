r"""Wear: a bronze cylinder on a steel plate that goes to and fro becomes flat.

             P
             |                the plate moves by 250 mm to and fro, the cylinder is held
           __v__
          /     \             Archard's law: the depth grows by k times the pressure
         |       |            times the way, at every point
          \_   _/
       ____ \_/ _______
       <-- plate -->

At first the cylinder touches along a strip of Hertz' width, under a high pressure. What presses most
wears fastest: the shape becomes flat, the strip wide and the pressure small and even. When the depth
worn is far beyond what bodies give way elastically, the volume worn off is the segment that is missing
of the cylinder, ``2 a^3 / 3R = k P s`` after a way s, so that

    a = (3/2 R k P s)^(1/3),    depth = a^2 / 2R,    pressure = P / 2a.

The volume is k over mu times the energy that friction takes, to round-off, and at the end the depth is
that of the closed form to 1 %.

Run ``python examples/wear.py [folder]``: a picture.
"""

import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import skfem as fem
from skfem.models.elasticity import lame_parameters, linear_elasticity

import skfem_contact as sc

out = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent / "out"
out.mkdir(parents=True, exist_ok=True)

# %% Numbers: N, mm, MPa, per mm of length
E, nu, mu, R, P = 110e3, 0.34, 0.15, 500.0, 60.0
k = 2e-7  # mm^2/N: a coefficient of 2.4e-4 over a hardness of 1200 MPa
ways = np.array([0.0, 10.0, 100.0, 1000.0, 4000.0, 10000.0])  # mm, in all

# %% The lowest part of the cylinder, as a block whose gap is the cylinder's
x, y = np.linspace(-6, 6, 49), np.linspace(0, 6, 17)
mesh = fem.MeshQuad.init_tensor(x, y).with_defaults()
basis = fem.Basis(mesh, fem.ElementVector(fem.ElementQuad1()), intorder=2)
bronze = linear_elasticity(*lame_parameters(E, nu))
guided = basis.get_dofs(lambda x: np.isclose(x[0], 0.0)).all("u^1")  # neither moves along nor tilts
cylinder = sc.Body(basis, bronze, {"top": (0.0, -P / 12)}, D=guided, name="cylinder")

# %% Contact with wear
plate = sc.RigidPlane((0, 0), (0, 1), name="plate")
contact = sc.Contact(
    cylinder.surface("bottom"),
    plate,
    gap=lambda x: x[0] ** 2 / (2 * R),
    friction=sc.Coulomb(mu),
    wear=sc.conditions.Archard(k),
)
solver = sc.ContactSolver(cylinder, contact)
print(solver)

# %% To and fro: strokes of 250 mm, and results where they are wanted
steps: list[dict] = [{}]
kept, place, done = [0], 0.0, 0.0
sign = 1.0
for way in ways[1:]:
    while done < way:
        stroke = min(250.0, way - done)
        place, done, sign = place + sign * stroke, done + stroke, -sign
        steps.append({"motion": {"plate": (place, 0.0)}})
    kept.append(len(steps) - 1)
results = list(solver.history(steps))
some = [results[i] for i in kept]
print(some[-1])

# %% Closed forms
half = np.cbrt(1.5 * R * k * P * ways)
depth = half**2 / (2 * R)
for way, result, there in zip(ways[1:], some[1:], depth[1:], strict=True):
    volume, found = result.worn_volume / (k * P * way), result.wear_depth.max()
    print(f"{way:7.0f} mm: depth {found:.6f} mm, {there:.6f}; volume {volume:.6f} k P s")

# %% Pictures
figure, (shape, pressure, growth) = plt.subplots(1, 3, figsize=(12, 3.9), layout="constrained")
order = np.argsort(some[0].points[:, 0])
s = some[0].points[order, 0]
for i, (way, result) in enumerate(zip(ways, some, strict=True)):
    colour = plt.cm.viridis(i / (len(ways) - 0.5))
    left = s**2 / (2 * R) + result.wear_depth[order]
    shape.plot(s, 1e3 * left, color=colour, label=f"{way:g} mm")
    pressure.semilogy(
        s, np.where(result.pressure[order] > 0, result.pressure[order], np.nan), color=colour
    )
shape.set(xlabel="x [mm]", ylabel="height of the cylinder's surface [µm]", ylim=(-1, 52))
shape.set(title="the cylinder wears flat", xlim=(-6, 6))
shape.legend(frameon=False, title="sliding distance", loc="upper center")
pressure.set(xlabel="x [mm]", ylabel="pressure [MPa]", title="its pressure becomes even", xlim=(-6, 6))
ticks = [5, 10, 20, 50]
pressure.set_yticks(ticks, labels=map(str, ticks))
pressure.yaxis.set_minor_formatter("")
growth.loglog(ways[1:], 1e3 * depth[1:], "k", lw=0.8, label="segment of the cylinder, $a^2 / 2R$")
growth.loglog(ways[1:], [1e3 * r.wear_depth.max() for r in some[1:]], "o", label="finite elements")
growth.set(xlabel="sliding distance [mm]", ylabel="depth worn off [µm]", title="depth in the middle")
growth.legend(frameon=False)
figure.savefig(out / "wear.png", dpi=120)

# %% Check what the first lines say
last = some[-1]
assert abs(last.worn_volume * mu / (k * last.dissipation_total) - 1) < 1e-12
error, tolerance = abs(last.wear_depth.max() / depth[-1] - 1), 0.01
assert error < tolerance
