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
meshes do not match; node by node the flux is off by a fifth in places.
"""

# %% numbers
import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import skfem as fem
from skfem.helpers import dot, grad

import skfem_contact as sc

out = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent / "out"
out.mkdir(parents=True, exist_ok=True)
k_copper, k_steel = 400.0, 50.0  # W/(m K)
hot, cold = 100.0, 20.0
tolerance = 1e-12

# %% bodies: plain scikit-fem, quadratic triangles
element = fem.ElementTriP2()


def conductor(k, x, y):
    mesh = fem.MeshTri.init_tensor(x, y).with_defaults()
    basis = fem.Basis(mesh, element)
    return basis, fem.BilinearForm(lambda u, v, w: k * dot(grad(u), grad(v))).assemble(basis)


foot_basis, foot_K = conductor(k_copper, np.linspace(0, 1, 11), np.linspace(0, 1, 11))
plate_basis, plate_K = conductor(k_steel, np.linspace(0, 1, 8), np.linspace(-1, 0, 8))
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
y = np.concatenate([b.doflocs[1] for b in (plate_basis, foot_basis)])
upper = np.arange(system.n) >= plate.n
exact = cold + q / k_steel + q * y / np.where(upper, k_copper, k_steel)
errors = {m: np.abs(temperature(m) - exact).max() / (hot - cold) for m in ("mortar", "node")}
for method, value in errors.items():
    print(f"{method:7s} largest error of the temperature {value:.1e} of the difference")

# %% the contact solver gives the same, and the flux through every point of the interface
results = {}
for method in list(errors):
    result = sc.ContactSolver([plate, foot], [solder(method)]).solve()
    flux = -result.pressure  # heat leaves the foot: what flows into the secondary is negative
    worst = np.abs(flux - q).max() / q
    print(f"{method:7s} largest error of the flux {worst:.1e}; heat flow {flux @ result.area:.6g} W/m")
    errors[method + " flux"] = worst
    results[method] = result.points[:, 0], flux

# %% the field, and the flux along the interface
figure, (field, along) = plt.subplots(1, 2, figsize=(10, 4.4), layout="constrained")
start = 0
for basis in (plate_basis, foot_basis):
    values = T[start : start + basis.N]
    start += basis.N
    corners = values[basis.nodal_dofs[0]]
    image = field.tripcolor(
        *basis.mesh.p, basis.mesh.t.T, corners, shading="gouraud", cmap="inferno", vmin=cold, vmax=hot
    )
    field.triplot(*basis.mesh.p, basis.mesh.t.T, color="white", lw=0.3, alpha=0.5)
figure.colorbar(image, ax=field, label="temperature [°C]")
field.text(0.5, 0.5, "copper", ha="center", color="black")
field.text(0.5, -0.5, "steel", ha="center", color="white")
field.set(aspect="equal", xlabel="x [m]", ylabel="y [m]", title="two meshes that do not match")
for method, (x, flux) in results.items():
    i = np.argsort(x)
    along.plot(
        x[i], 1e-3 * flux[i], "o-", ms=3, label={"mortar": "mortar", "node": "node by node"}[method]
    )
along.axhline(1e-3 * q, color="k", lw=0.8, ls=":", label="exact")
along.set(xlabel="place along the interface [m]", ylabel="heat flux [kW/m²]", ylim=(0, None))
along.legend(frameon=False, loc="lower right")
along.spines[["top", "right"]].set_visible(False)
figure.savefig(out / "heat_across_interface.png", dpi=100)

# %% Check what the first lines say
assert 0.15 < errors["node flux"] < 0.25
error = max(errors["mortar"], errors["mortar flux"])
print(f"error {error:.1e}")
