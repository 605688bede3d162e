r"""Wear: a bronze ball on a steel plate that goes to and fro becomes flat.

             P
             |                the plate moves by 1 m to and fro, the ball is held
           __v__
          /     \             Archard's law: the depth grows by k times the pressure
         |       |            times the way, at every point
          \_   _/
       ____ \_/ _______
       <-- plate -->

At first the ball touches in a circle of Hertz' size, under a high pressure. What presses most wears
fastest: the shape becomes flat, the circle wide and the pressure small and even. When the depth worn is
far beyond what bodies give way elastically, the volume worn off is the cap that is missing of the ball,
``pi a^4 / 4R = k P s`` after a way s, so that

    a = (4 R k P s / pi)^(1/4),    depth = a^2 / 2R,    pressure = P / pi a^2.

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

# %% Numbers: N, mm, MPa
E, nu, mu, R, P = 110e3, 0.34, 0.15, 500.0, 200.0
k = 2e-7  # mm^2/N: a coefficient of 2.4e-4 over a hardness of 1200 MPa
ways = np.array([0.0, 100.0, 1000.0, 4000.0, 10000.0])  # mm, in all

# %% The lowest part of the ball, as a block whose gap is the ball's: half of it, cut at y = 0
x, z = np.linspace(-6, 6, 13), np.array([0.0, 0.5, 1.2, 2.4, 4.0, 6.0])
sides = {"bottom": lambda x: x[2] == 0, "top": lambda x: x[2] == 6, "cut": lambda x: x[1] == 0}
mesh = fem.MeshHex.init_tensor(x, x[x >= 0], z).with_boundaries(sides)
basis = fem.Basis(mesh, fem.ElementVector(fem.ElementHex1()), intorder=2)
bronze = linear_elasticity(*lame_parameters(E, nu))
guided = basis.nodal_dofs[0, np.hypot(*mesh.p[:2]) < 1e-9]  # the axis neither moves along nor tilts
ball = sc.Body(basis, bronze, {"top": (0.0, 0.0, -P / 144)}, D=[guided, {"cut": "y"}], name="ball")

# %% Contact with wear
plate = sc.RigidPlane((0, 0, 0), (0, 0, 1), name="plate")
contact = sc.Contact(
    ball.surface("bottom"),
    plate,
    gap=lambda x: (x[0] ** 2 + x[1] ** 2) / (2 * R),
    friction=sc.Coulomb(mu),
    wear=sc.conditions.Archard(k),
)
solver = sc.ContactSolver(ball, contact)
print(solver)

# %% To and fro: strokes of 1000 mm, and results where they are wanted
steps: list[dict] = [{}]
kept, place, done = [0], 0.0, 0.0
sign = 1.0
for way in ways[1:]:
    while done < way:
        stroke = min(1000.0, way - done)
        place, done, sign = place + sign * stroke, done + stroke, -sign
        steps.append({"motion": {"plate": (place, 0.0, 0.0)}})
    kept.append(len(steps) - 1)
results = list(solver.history(steps))
some = [results[i] for i in kept]
print(some[-1])

# %% Closed forms
a = (4 * R * k * P * ways / np.pi) ** 0.25
depth = a**2 / (2 * R)
for way, result, there in zip(ways[1:], some[1:], depth[1:], strict=True):
    volume, found = 2 * result.worn_volume / (k * P * way), result.wear_depth.max()
    print(f"{way:7.0f} mm: depth {found:.6f} mm, {there:.6f}; volume {volume:.6f} k P s")

# %% Pictures
figure = plt.figure(figsize=(12, 3.9), layout="constrained")
shape = figure.add_subplot(131, projection="3d")
pressure, growth = figure.add_subplot(132), figure.add_subplot(133)
points = some[0].points
height = 1e3 * (np.sum(points[:, :2] ** 2, axis=1) / (2 * R) + some[-1].wear_depth)
shape.plot_trisurf(*points[:, :2].T, height, cmap="viridis", edgecolor="white", lw=0.3)
shape.set(xlabel="x [mm]", ylabel="y [mm]", title="surface of half of the ball [µm], worn flat")
shape.set_box_aspect((2, 1, 1))
shape.view_init(35, -60)
cut = np.flatnonzero(points[:, 1] == 0)
cut = cut[np.argsort(points[cut, 0])]
for i, (way, result) in enumerate(zip(ways, some, strict=True)):
    values = np.where(result.pressure > 0, result.pressure, np.nan)[cut]
    colour = plt.cm.viridis(i / (len(ways) - 0.5))
    pressure.semilogy(points[cut, 0], values, "o-", ms=3, color=colour, label=f"{way:g} mm")
pressure.legend(frameon=False, title="sliding distance")
pressure.set(xlabel="x [mm]", ylabel="pressure [MPa]", title="its pressure becomes even", xlim=(-6, 6))
ticks = [5, 10, 20, 50, 100]
pressure.set_yticks(ticks, labels=map(str, ticks))
pressure.yaxis.set_minor_formatter("")
growth.loglog(ways[1:], 1e3 * depth[1:], "k", lw=0.8, label="cap of the ball, $a^2 / 2R$")
growth.loglog(ways[1:], [1e3 * r.wear_depth.max() for r in some[1:]], "o", label="finite elements")
growth.set(xlabel="sliding distance [mm]", ylabel="depth worn off [µm]", title="depth in the middle")
growth.legend(frameon=False)
figure.savefig(out / "wear.png", dpi=120)

# %% Check what the first lines say
last = some[-1]
assert abs(last.worn_volume * mu / (k * last.dissipation_total) - 1) < 1e-12
error, tolerance = abs(last.wear_depth.max() / depth[-1] - 1), 0.01
assert error < tolerance
