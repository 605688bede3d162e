r"""Refine where the answer says: Hertz' contact to one percent from a coarse mesh, by its own estimate.

A steel cylinder (radius 100 mm) is pressed on a steel block, both 40 mm wide and 10 mm high, as in
`hertz.py`, but nobody tells the mesh where the contact will be or how wide. Eight elements along the
surface to begin with; then, round by round, `result.error_estimate` says which points of the contact
and which elements around it make most of the error, and these are cut in halves.

The true error, by Hertz' closed form, stands beside the estimate, and beside both what it takes
without: meshes that are refined everywhere.

Run ``python examples/adaptive_hertz.py [folder]``: a table, and a picture.
"""

import sys
import warnings
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import skfem as fem
from scipy.spatial import cKDTree
from skfem.models.elasticity import lame_parameters, linear_elasticity

import skfem_contact as sc
from skfem_contact.reference import block_curvature, effective_modulus, hertz_line

here = Path(__file__).parent
out = Path(sys.argv[1]) if len(sys.argv) > 1 else here / "out"

# %% Numbers (N, mm, MPa; forces per mm of thickness)
R, H, W = 100.0, 10.0, 20.0  # radius of the cylinder, height and half width of both bodies
material = {"E": 210e3, "nu": 0.3}
down, goal = 0.02, 0.01
element = fem.ElementVector(fem.ElementTriP1())
stiffness = linear_elasticity(*lame_parameters(**material))


# The first meshes are too coarse for so light a contact, as the library warns. They are refined below
# until the estimated error is small, and the last ones are not.
warnings.filterwarnings("ignore", ".*contact ends within the facets", sc.ContactWarning)


# %% The problem on two given meshes of rectangles, of which the upper one becomes a segment
def solve(meshes):
    upper, lower = (mesh.with_defaults() for mesh in meshes)
    arc = upper.morphed(
        lambda p: p[0], lambda p: p[1] + (R - np.sqrt(R**2 - p[0] ** 2)) * (1 - p[1] / H)
    )
    basis = fem.Basis(arc, element)
    lowered = np.zeros(basis.N)
    lowered[basis.get_dofs("top").all("u^2")] = -down
    cylinder = sc.Body(basis, stiffness, D="top", x=lowered, name="cylinder")
    block = sc.Body(fem.Basis(lower, element), stiffness, D="bottom", name="block")
    contact = sc.Contact(cylinder.surface("bottom"), block.surface("top"))
    return sc.ContactSolver([cylinder, block], [contact]).solve()


def true_error(result):
    """L2 error of the pressure against Hertz, for the force that the finite elements carry."""
    P, E_star = result.force[1], effective_modulus(*material.values(), *material.values())
    added = 2 * block_curvature(P, H, *material.values(), width=W / H)
    exact = hertz_line(P, R, E_star, added_curvature=added)
    x = np.linspace(-2 * exact.a, 2 * exact.a, 4001)
    p = result.interpolate(result.pressure, np.column_stack([x, 0 * x]))
    return np.linalg.norm(p - exact.pressure(x)) / np.linalg.norm(exact.pressure(x))


# %% What to refine: the fewest points, or elements, that make 80 % of the squared error
def most(shares):
    order = np.argsort(shares)[::-1]
    return order[: np.searchsorted(np.cumsum(shares[order]), 0.8) + 1]


def refined(meshes, result):
    estimate = result.error_estimate
    if estimate.traction.largest == "bodies":
        near = {name: ix[most(share)] for name, (ix, share) in estimate.elements.items()}
        return [mesh.refined(near[n]) for mesh, n in zip(meshes, ("cylinder", "block"), strict=True)]
    x = result.points[most(estimate.indicator), 0]
    size = result.area[most(estimate.indicator)].max()  # of the facets beside these points
    new = []
    for mesh in meshes:
        middle = mesh.p[:, mesh.t].mean(axis=1).T
        distance, _ = cKDTree(np.column_stack([x, 0 * x])).query(middle)
        new.append(mesh.refined(np.flatnonzero(distance < size)))
    return new


def coarse():
    x = np.linspace(-W, W, 9)
    return [fem.MeshTri.init_tensor(x, y) for y in (np.linspace(0, H, 3), np.linspace(-H, 0, 3))]


# %% Round by round
def follow(improve, rounds):
    meshes, rows = coarse(), []
    for number in range(rounds):
        result = solve(meshes)
        rows.append((result.system.n, result.error_estimate.traction.total, true_error(result)))
        print(f"{number:5d} {rows[-1][0]:8d} {100 * rows[-1][1]:10.2f} % {100 * rows[-1][2]:10.2f} %")
        if rows[-1][1] < goal:
            break
        meshes = improve(meshes, result)
    return np.array(rows), result


print("round     DOFs   estimated         true")
adaptive, result = follow(refined, 25)
print(result.report())
print("\nrefined everywhere")
uniform, _ = follow(lambda meshes, result: [mesh.refined() for mesh in meshes], 6)
last_dofs, _, last_error = uniform[-1]
same = np.interp(np.log(last_error), np.log(adaptive[::-1, 2]), np.log(adaptive[::-1, 0]))
print(f"\nfor {last_error:.1%} refining everywhere takes {last_dofs / np.exp(same):.0f} times the DOFs")
error, tolerance = adaptive[-1, 2], goal

# %% Picture: the mesh around the contact, and the errors over the number of unknowns
figure, axes = plt.subplots(1, 2, figsize=(11, 4.4))
edge = np.abs(result.contact_edges[:, 0]).max()
for body in result.system.bodies:
    mesh = body.basis.mesh
    axes[0].triplot(*mesh.p, mesh.t.T, color="0.4", linewidth=0.3)
scale = 0.6 * edge / result.pressure.max()
order = np.argsort(result.points[:, 0])
axes[0].plot(result.points[order, 0], scale * result.pressure[order], "C3", lw=2)
axes[0].set(
    xlim=(-2 * edge, 2 * edge), ylim=(-1.2 * edge, 1.2 * edge), xlabel="x [mm]", ylabel="y [mm]",
    aspect="equal", title="the last mesh, and its pressure",
)  # fmt: skip
right = axes[0].secondary_yaxis("right", functions=(lambda y: y / scale, lambda p: p * scale))
right.set_ylabel("pressure [MPa]", color="C3", loc="top")
right.set_yticks([0, 200, 400, 600])
for rows, colour, label in (
    (uniform, "C0", "refined everywhere"),
    (adaptive, "C1", "refined where it says"),
):
    axes[1].loglog(rows[:, 0], 100 * rows[:, 2], f"{colour}o-", ms=4, label=f"{label}: true")
    axes[1].loglog(rows[:, 0], 100 * rows[:, 1], f"{colour}x:", ms=4, label=f"{label}: estimated")
axes[1].set(xlabel="degrees of freedom", ylabel="L2 error of the pressure [%]")
axes[1].legend(frameon=False, fontsize="small")
axes[1].grid(which="both", alpha=0.2)
figure.tight_layout()
out.mkdir(exist_ok=True, parents=True)
figure.savefig(out / "adaptive_hertz.png", dpi=110)
