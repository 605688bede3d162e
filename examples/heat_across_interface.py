"""Heat across an interface of two meshes that do not match.

A copper foot, finely meshed, stands on a steel plate, coarsely meshed; they are soldered together.
The foot is hot at its top, the plate cold at its bottom, the sides are insulated::

         T = 100
        +---------+
        | copper  |      h / 1, finer
        +---------+  <-  sc.Contact(..., tied=True)
        |  steel  |      h / 0.7
        +---------+
          T = 20

Contact is not only for displacements: a tied contact of scalar fields glues temperatures, one row
per node, and `sc.elimination.condense` hands the reduced system to scikit-fem's own solver. The
temperature is linear in each part, so the answer is known,

    q = (100 - 20) / (1/k_copper + 1/k_steel),      T = 20 + q/k_steel  at the interface.

Run ``python examples/heat_across_interface.py [folder]``: a picture.

Expected: with ``method="mortar"`` temperatures and flux are exact to round-off (1e-12), although the
meshes do not match; node by node the flux is off by up to three tenths.
"""

# %% numbers
import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import skfem as fem
from mpl_toolkits.mplot3d.art3d import Poly3DCollection
from skfem.helpers import dot, grad

import skfem_contact as sc

out = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent / "out"
out.mkdir(parents=True, exist_ok=True)
k_copper, k_steel = 400.0, 50.0  # W/(m K)
hot, cold = 100.0, 20.0
tolerance = 1e-12

# %% bodies: plain scikit-fem, hexahedra
element = fem.ElementHex1()


def conductor(k, x, z):
    sides = {"bottom": lambda x: x[2] == z[0], "top": lambda x: x[2] == z[-1]}
    mesh = fem.MeshHex.init_tensor(x, x, z).with_boundaries(sides)
    basis = fem.Basis(mesh, element)
    return basis, fem.BilinearForm(lambda u, v, w: k * dot(grad(u), grad(v))).assemble(basis)


foot_basis, foot_K = conductor(k_copper, np.linspace(0, 1, 9), np.linspace(0, 1, 9))
plate_basis, plate_K = conductor(k_steel, np.linspace(0, 1, 6), np.linspace(-1, 0, 6))
foot = sc.Body(foot_basis, foot_K, D="top", x=np.full(foot_basis.N, hot), name="foot")
plate = sc.Body(plate_basis, plate_K, D="bottom", x=np.full(plate_basis.N, cold), name="plate")

# %% glue, and one linear solve by scikit-fem
system = sc.bodies.stack([plate, foot])


def solder(method):
    return sc.Contact(foot.surface("bottom"), plate.surface("top"), tied=True, method=method)


def temperature(method):
    rows = sc.elimination.contact_rows(system, solder(method))
    return fem.solve(*sc.elimination.condense(system.K, system.f, rows=rows, D=system.D, x=system.x))


T = temperature("mortar")

# %% against theory
q = (hot - cold) / (1 / k_copper + 1 / k_steel)
z = np.concatenate([b.doflocs[2] for b in (plate_basis, foot_basis)])
upper = np.arange(system.n) >= plate.n
exact = cold + q / k_steel + q * z / np.where(upper, k_copper, k_steel)
errors = {m: np.abs(temperature(m) - exact).max() / (hot - cold) for m in ("mortar", "node")}
for method, value in errors.items():
    print(f"{method:7s} largest error of the temperature {value:.1e} of the difference")

# %% the contact solver gives the same, and the flux through every point of the interface
results = {}
for method in list(errors):
    result = sc.ContactSolver([plate, foot], [solder(method)]).solve()
    flux = -result.pressure  # heat leaves the foot: what flows into the secondary is negative
    worst = np.abs(flux - q).max() / q
    print(f"{method:7s} largest error of the flux {worst:.1e}; heat flow {flux @ result.area:.6g} W")
    errors[method + " flux"] = worst
    results[method] = result.points, flux

# %% the field on the faces in front, and the flux over the interface
figure = plt.figure(figsize=(10, 4.4), layout="constrained")
grid = figure.add_gridspec(1, 3, width_ratios=[1.1, 1, 1])
solid = figure.add_subplot(grid[0], projection="3d")
colours = plt.Normalize(cold, hot)
for basis, values in ((plate_basis, T[: plate.n]), (foot_basis, T[plate.n :])):
    mesh = basis.mesh
    outer = mesh.facets.T[mesh.boundary_facets()]
    middle = mesh.p[:, outer].mean(axis=2)
    seen = outer[(middle[0] == 1) | (middle[1] == 0) | (middle[2] == 1)]
    faces = Poly3DCollection(mesh.p.T[seen], edgecolor="white", lw=0.3)
    faces.set_facecolor(
        plt.get_cmap("inferno")(colours(values[basis.nodal_dofs[0]][seen].mean(axis=1)))
    )
    solid.add_collection3d(faces)
solid.set(xlim=(0, 1), ylim=(0, 1), zlim=(-1, 1), title="copper on steel, soldered")
solid.set_box_aspect((1, 1, 2), zoom=1.15)
solid.view_init(20, -60)
solid.axis("off")
shades = plt.cm.ScalarMappable(colours, "inferno")
figure.colorbar(shades, ax=solid, label="temperature [°C]", shrink=0.8)
for column, (method, (points, flux)) in enumerate(results.items(), start=1):
    ax = figure.add_subplot(grid[column])
    dots = ax.scatter(
        points[:, 0], points[:, 1], c=1e-3 * flux, s=90, vmin=2.5, vmax=4.6, cmap="coolwarm"
    )
    ax.set(
        aspect="equal",
        xlabel="x [m]",
        ylabel="y [m]",
        title={"mortar": "mortar", "node": "node by node"}[method],
    )
figure.colorbar(dots, ax=figure.axes[-2:], label=f"heat flux [kW/m²]; exact {1e-3 * q:.2f}", shrink=0.7)
figure.savefig(out / "heat_across_interface.png", dpi=100)

# %% Check what the first lines say
assert 0.25 < errors["node flux"] < 0.32
error = max(errors["mortar"], errors["mortar flux"])
print(f"error {error:.1e}")
