r"""A disc brake whose disc is a rigid tool from an STL file: the torque of friction beside mu F r.

            | F   turned
         ___v_______________________
        |_______disc_(STL)__________|     rigid: pressed by F, turned step by step
               |   pad   |
               |_________|                softer; its back is held
               ///////////
                    r ---> from the axis

The script writes the disc to an STL file, as a program for drawing would, and reads it. First the disc
shears the pad, which sticks. Then all of the pad slips. The torque is then mu F r with the mean
radius r = (2/3) (Ro³ - Ri³) / (Ro² - Ri²) of uniform pressure. It is found to 0.5 %, although the
pressure near the rims of the pad is not uniform.

Run ``python examples/stl_brake.py [folder]``: a table, files for ParaView, and a picture.
"""

import sys
from pathlib import Path

import matplotlib.pyplot as plt
import meshio
import numpy as np
import skfem as fem
from skfem.models.elasticity import lame_parameters, linear_elasticity

import skfem_contact as sc

out = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent / "out"
out.mkdir(parents=True, exist_ok=True)

# %% Numbers: N, mm and MPa
E, nu, mu = 500.0, 0.25, 0.4
Ri, Ro, sector, thickness = 90.0, 140.0, np.radians(60), 10.0
F = 5000.0
angle = np.radians([0.002, 0.004, 0.006, 0.008, 0.012, 0.02, 0.03])

# %% The disc as triangles: a ring with its rims, written as STL
around = np.linspace(0, 2 * np.pi, 96, endpoint=False)
profile = np.array([(75, 0), (155, 0), (155, 12), (75, 12)])  # (radius, height), once around
corners = [(r * np.cos(t), r * np.sin(t), z) for t in around for r, z in profile]
triangles = []
for i in range(len(around)):
    for k in range(4):
        here, beside = 4 * i + k, 4 * i + (k + 1) % 4
        there, beyond = ((n + 4) % len(corners) for n in (here, beside))
        triangles += [(here, there, beside), (beside, there, beyond)]
meshio.write_points_cells(out / "disc.stl", np.array(corners), [("triangle", np.array(triangles))])

# %% The pad: a sector of a ring, glued to its back plate
radii = np.linspace(Ri, Ro, 11)
grid = fem.MeshHex.init_tensor(
    radii, np.linspace(-sector / 2, sector / 2, 21), [-10, -7, -4, -2, -1, 0]
)
r, turned, z = grid.p
mesh = fem.MeshHex(np.array([r * np.cos(turned), r * np.sin(turned), z]), grid.t).with_boundaries(
    {"face": lambda x: x[2] == 0, "back": lambda x: x[2] == -thickness}
)
element = fem.ElementVector(fem.ElementHex1())
lining = linear_elasticity(*lame_parameters(E, nu))
pad = sc.Body.from_mesh(mesh, element, lining, D="back", name="pad")

# %% The disc, read and guided
shape = sc.RigidSurface.from_file(out / "disc.stl")
guided = ("x", "y", "rotation x", "rotation y", "rotation z")
disc = sc.RigidBody(shape, force=(0, 0, -F), about=(0, 0, 0), D=guided, name="disc")
contact = sc.Contact(pad.surface("face"), disc, friction=sc.Coulomb(mu), name="face")
solver = sc.ContactSolver([pad, disc], [contact])
print(solver)

# %% Press, then turn
steps = [{"x": {"disc": {"rotation z": 0.0}}}]
steps += [{"x": {"disc": {"rotation z": a}}} for a in angle]
results = list(solver.history(steps))
torque = np.array([result.reaction("disc")[5] for result in results])
mean = 2 / 3 * (Ro**3 - Ri**3) / (Ro**2 - Ri**2)
print("angle [rad]   torque [N m]   slipping share")
for a, M, result in zip([0, *angle], torque, results, strict=True):
    print(f"{a:11.2e} {M / 1e3:14.2f} {np.mean(result['face'].status == 2):16.2f}")
print(f"mu F r        {mu * F * mean / 1e3:12.2f}")
values = results[-1]["face"]
print(f"pressure {values.pressure.min():.2f} to {values.pressure.max():.2f} MPa")

# %% Files and pictures: with PyVista where it is installed
sc.write_series(out / "stl_brake.pvd", results)
figure = plt.figure(figsize=(11, 4.4), layout="constrained")
left, right = figure.subfigures(1, 2, squeeze=False, width_ratios=[1.2, 1]).flat
units = {"length": "mm", "stress": "MPa"}
sc.plot_deformed(results[-1], ax=left.subplots(), units=units, viewer=(230, -260, 240))
curve = right.subplots()
curve.axhline(mu * F * mean / 1e3, color="k", lw=0.8, label="μ F r, all slips")
curve.plot(1e6 * np.append(0, angle), torque / 1e3, "o-", ms=4, label="found")
curve.set(xlabel="angle of the disc [µrad]", ylabel="torque of friction [N m]", ylim=(0, None))
curve.legend(frameon=False, loc="lower right")
curve.spines[["top", "right"]].set_visible(False)
figure.savefig(out / "stl_brake.png", dpi=90)

# %% Check what the first lines say
assert np.all(values.status == 2) and not np.any(results[1]["face"].status == 2)
assert abs(values.force[2] + F) < 1e-8 * F
error, tolerance = float(abs(torque[-1] / (mu * F * mean) - 1)), 0.005
assert error < tolerance
