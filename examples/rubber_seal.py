r"""A rubber seal in a groove: squeezed by a lid, then pressed by a fluid on its free side.

          lid, 0.6 mm down
      ___________________________
             . - - - .           |       cord of radius 3 mm, plane strain; upper half
     ---> /             \        |wall   Mooney-Rivlin, E about 6 MPa, Poisson's ratio 0.48
     ---> |   rubber    |        |       Coulomb friction 0.2 on lid and wall
     p -->|_____________|________|       fluid from the left, up to 1.2 MPa
      o      o       o    o              plane of symmetry

The fluid presses at right angles to the surface as it stands, on the surface as large as it is: a
number in `f` of a body of large strains does so. It comes as far as the seal was open a step before.

A seal is tight while it presses on the lid by more than the fluid does. It does so by itself: the
fluid pushes it against the wall, it spreads, and the pressure on the lid rises with that of the fluid.

In equilibrium, wall and lid bear along x what the fluid pushes: its pressure times the height, as it
is in the end, of the surface that it wets.

Run ``python examples/rubber_seal.py [folder]``.
"""

import sys
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import skfem as fem

import skfem_contact as sc

out = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent / "out"
out.mkdir(parents=True, exist_ok=True)

# %% Numbers (N, mm, MPa)
radius, squeeze, mu = 3.0, 0.6, 0.2
rubber = sc.materials.MooneyRivlin(0.8, 0.2, bulk=30.0)


# %% Half a disc: a core of 2 n by n elements, and layers around it
def half_disc(n=6, layers=5):
    core = fem.MeshQuad.init_tensor(np.linspace(-1, 1, 2 * n + 1), np.linspace(0, 1, n + 1))
    x, y = core.p
    p = 0.55 * radius * np.array([x * (1 - 0.12 * y**2), y * (1 - 0.12 * x**2)])
    rim = np.flatnonzero((np.abs(x) == 1) | (y == 1))
    rim = rim[np.argsort(np.arctan2(p[1, rim], p[0, rim]))]
    angle = np.linspace(0, np.pi, len(rim))
    end, points, cells, ids = radius * np.array([np.cos(angle), np.sin(angle)]), [p], [core.t], rim
    for k in range(1, layers + 1):
        points.append(p[:, rim] + k / layers * (end - p[:, rim]))
        new = np.arange(len(rim)) + p.shape[1] + (k - 1) * len(rim)
        cells.append(np.array([ids[:-1], new[:-1], new[1:], ids[1:]]))
        ids = new
    mesh = fem.MeshQuad(np.hstack(points), np.hstack(cells))
    symmetric = mesh.facets_satisfying(lambda x: np.abs(x[1]) < 1e-9, boundaries_only=True)
    outside = np.setdiff1d(mesh.boundary_facets(), symmetric)
    return mesh.with_boundaries({"symmetry": symmetric, "rim": outside})


mesh = half_disc()
basis = fem.Basis(mesh, fem.ElementVector(fem.ElementQuad1()), intorder=2)
seal = sc.NonlinearBody(basis, rubber, D={"symmetry": "y"}, name="seal")

# %% Contacts: one surface, two tools
laws: dict[str, Any] = {"friction": sc.Coulomb(mu), "sliding": "finite"}
lid = sc.RigidPlane((0, radius), (0, -1), name="lid")
wall = sc.RigidPlane((radius, 0), (-1, 0), name="wall")
above = sc.Contact(seal.surface("rim"), lid, name="above", **laws)
behind = sc.Contact(seal.surface("rim"), wall, name="behind", **laws)
solver = sc.ContactSolver(seal, [above, behind])

# %% Squeeze
steps = [{"motion": {"lid": (0.0, -squeeze * share)}} for share in np.linspace(0, 1, 7)[1:]]
*_, squeezed = solver.history(steps)

# %% Press by the fluid
rim = mesh.boundaries["rim"]
middle = mesh.p[:, mesh.facets[:, rim]].mean(axis=1)


def end(result):
    """The x from which on the seal touches the lid, in the undeformed state."""
    return result["above"].points[result["above"].status > 0, 0].min()


results, pressures = [squeezed], np.linspace(0, 1.2, 7)
for pressure in pressures[1:]:
    reach = end(results[-1])
    wet = {"rim": lambda x, p=pressure, reach=reach: p * (x[0] < reach)}
    results.append(solver.solve(f={"seal": wet}, start=results[-1]))
    peak = results[-1]["above"].pressure.max()
    print(f"fluid {pressure:.1f} MPa: lid up to {peak:.2f} MPa")
last = results[-1]
print(last)
print(last.newton)

# %% Checks: what pushes along x, and tightness
side = mesh.facets[:, rim[middle[0] < reach]]
heights = last.displacement(seal)[basis.nodal_dofs[1]] + mesh.p[1]
pushed = pressures[-1] * np.ptp(heights[side])
borne = -last["above"].force[0] - last["behind"].force[0]
print(f"the fluid pushes by {pushed:.6f} N/mm, lid and wall bear {borne:.6f} N/mm")
peaks = np.array([result["above"].pressure.max() for result in results])
spare = (peaks - pressures).min()
print(f"the lid is pressed by {spare:.2f} MPa more than the fluid has, at least")
assert end(last) == reach  # the fluid has not come further
assert abs(borne / pushed - 1) <= 1e-9
assert spare > 0

# %% Picture
units = {"length": "mm", "stress": "MPa"}
figure, axes = plt.subplots(1, 3, figsize=(14.5, 4), width_ratios=[1, 1, 0.9], layout="constrained")
for ax, result, words in ((axes[0], squeezed, "squeezed"), (axes[1], last, "and pressed by 1.2 MPa")):
    style: dict[str, Any] = {
        "scale": 1.0,
        "stress": "von_mises",
        "units": units,
        "window": (-4.4, 3.9, -0.3, 3.4),
    }
    sc.plot_deformed(result, ax=ax, **style)
    ax.set_title(words)
u = last.displacement(seal)[basis.nodal_dofs]
ends = (mesh.p + u)[:, side]
middle, along = ends.mean(axis=1), ends[:, 1] - ends[:, 0]
inwards = np.array([-along[1], along[0]]) / np.hypot(*along)
inwards *= np.sign(np.sum(inwards * (np.array([[0.0], [1.0]]) - middle), axis=0))
arrows: dict[str, Any] = {
    "angles": "xy",
    "scale_units": "xy",
    "scale": 1.0,
    "width": 0.004,
    "color": "#20618d",
}
axes[1].quiver(*(middle - 0.7 * inwards), *(0.65 * inwards), **arrows)
axes[2].plot(pressures, peaks, "o-", color="#b5441c", ms=4, label="largest pressure on the lid")
axes[2].plot(pressures, pressures, color="#20618d", label="pressure of the fluid")
axes[2].set(xlabel="pressure of the fluid [MPa]", ylabel="[MPa]", ylim=(0, None), xlim=(0, 1.2))
axes[2].legend(frameon=False)
axes[2].spines[["top", "right"]].set_visible(False)
figure.savefig(out / "rubber_seal.png", dpi=90)

error, tolerance = abs(borne / pushed - 1), 1e-6  # to which the bodies are in equilibrium
assert error <= tolerance
