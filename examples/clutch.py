r"""A clutch that is closed and turned until it slips: two rings of solids, pressed and twisted.

        ________          ________
       |  plate |        |        |    pressed down and turned about the axis
       |________|   axis |________|
       | lining |    :   |        |    softer; its back is held
       |________|    :   |________|
            Ri ----> Ro

The faces do not match; the default, dual mortar, carries pressure and friction across. The moment grows
with the angle until points slip, from the outer rim inward, and ends at

    M = (2/3) mu P (Ro³ - Ri³) / (Ro² - Ri²)

where all of them do and the pressure is uniform. Turned back, the lining first springs back, then slips
the other way.

Run ``python examples/clutch.py [folder]``: report, files for ParaView, and a picture.
"""

import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import skfem as fem
from matplotlib.collections import PolyCollection
from skfem.models.elasticity import lame_parameters, linear_elasticity

import skfem_contact as sc
from skfem_contact.reference import annulus_torsion_capacity

here = Path(__file__).parent
out = Path(sys.argv[1]) if len(sys.argv) > 1 else here / "out"

# %% Numbers: N and mm
Ri, Ro, mu = 60.0, 100.0, 0.35
press = 0.4  # MPa
steel, lining_modulus = 210e3, 300.0


# %% Bodies
def ring(name, around, across, heights, E, nu):
    """A ring of hexahedra between two heights, with its sides named."""
    angle, radius = np.linspace(0, 2 * np.pi, around + 1), np.linspace(Ri, Ro, across + 1)
    strip = fem.MeshHex.init_tensor(angle, radius, np.array(heights))
    keep = ~np.isclose(strip.p[0], 2 * np.pi)  # the last angle is the first one
    number = np.cumsum(keep) - 1
    first = {
        tuple(p): n
        for p, n in zip(
            np.round(strip.p[1:, strip.p[0] == 0].T, 9), number[strip.p[0] == 0], strict=True
        )
    }
    number[~keep] = [first[tuple(p)] for p in np.round(strip.p[1:, ~keep].T, 9)]
    turn, r, z = strip.p[:, keep]
    mesh = fem.MeshHex(np.array([r * np.cos(turn), r * np.sin(turn), z]), number[strip.t])
    low, high = heights[0], heights[-1]
    mesh = mesh.with_boundaries(
        {"low": lambda x: np.isclose(x[2], low), "high": lambda x: np.isclose(x[2], high)}
    )
    basis = fem.Basis(mesh, fem.ElementVector(fem.ElementHex1()), intorder=2)
    return basis, linear_elasticity(*lame_parameters(E, nu))


basis, stiffness = ring("lining", 60, 6, [0, 1.5, 3.0], lining_modulus, 0.25)
lining = sc.Body(basis, stiffness, D=basis.get_dofs("low").all(), name="lining")
basis, stiffness = ring("plate", 48, 5, [3.0, 5.5, 8.0], steel, 0.3)
facets = fem.FacetBasis(basis.mesh, basis.elem, facets="high")
pressing = fem.LinearForm(lambda v, w: -press * v[2]).assemble(facets)
turned = basis.get_dofs("high").all(["u^1", "u^2"])
plate = sc.Body(basis, stiffness, pressing, D=turned, name="plate")

# %% Contact
contact = sc.Contact(lining.surface("high"), plate.surface("low"), friction=sc.Coulomb(mu))
solver = sc.ContactSolver([lining, plate], contact)
print(solver)


# %% Close, turn, and turn back
def turned_by(angle):
    """The upper side of the plate turned about the axis."""
    u = np.zeros(plate.basis.N)
    x, y, _ = plate.dof_points.T
    u[turned] = angle * np.where(plate.dof_component == 0, -y, x)[turned]
    return {"x": {"plate": u}}


largest = 8e-5  # radians
angle = largest * np.concatenate([np.linspace(0, 1, 11), np.linspace(1, -1, 17)[1:]])
results = list(solver.history([turned_by(a) for a in angle]))
moment = np.array([result.moment()[2] for result in results])
last = results[10]
print("At the largest angle:", last, sep="\n")

# %% Check: all slips at the largest angle
P = press * np.pi * (Ro**2 - Ri**2)
exact = annulus_torsion_capacity(P, mu, Ri, Ro)
error, tolerance = abs(moment[10] / exact - 1), 0.01
print(f"moment {abs(moment[10]) / 1e3:.1f} Nm, all slipping {exact / 1e3:.1f} Nm: {error:.2%} apart")

# %% Write and plot
sc.write_series(out / "clutch.pvd", results[::2])
some = results[5]["contact 1"]
figure, (plan, curve) = plt.subplots(1, 2, figsize=(11, 4.8), layout="constrained")
faces = some.surface.points[some.surface.facets][:, :, :2]
size = np.linalg.norm(some.friction_stress, axis=1)
nodal = size[some.surface.facets].mean(axis=1)
filled = plan.add_collection(
    PolyCollection(faces, array=nodal, cmap="YlOrRd", edgecolors="white", lw=0.2)
)
figure.colorbar(filled, ax=plan, label="friction stress on the lining [MPa]", shrink=0.8)
slips = some.status == 2
x, y = some.points[slips, :2].T
plan.plot(x, y, "o", ms=3, color="#20618d", label="slips")
every = np.abs(np.linalg.norm(some.points, axis=1) - 0.5 * (Ri + Ro)) < 4
x, y, u, v = *some.points[every, :2].T, *some.traction[every, :2].T
plan.quiver(x, y, u, v, color="#444444", width=0.003, scale=2)
plan.set(xlim=(-110, 110), ylim=(-110, 110), aspect="equal", xlabel="x [mm]", ylabel="y [mm]")
plan.set_title(
    f"turned by {1e6 * angle[5]:.0f} µrad: the rim slips, the inside sticks", fontsize="medium"
)
plan.legend(frameon=False, loc="center")
curve.axhspan(-exact / 1e3, exact / 1e3, color="#f0ece4")
curve.plot(1e6 * angle, moment / 1e3, "-o", ms=3.5, color="#20618d")
curve.plot(1e6 * angle[5], moment[5] / 1e3, "s", color="#c1440e", label="shown on the left")
curve.set(xlabel="angle [µrad]", ylabel="moment on the lining [Nm]")
curve.set_title("shaded: up to the closed form, where all slips", fontsize="medium")
curve.legend(frameon=False, loc="lower right")
curve.spines[["top", "right"]].set_visible(False)
figure.savefig(out / "clutch.png", dpi=90)
