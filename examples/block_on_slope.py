r"""A block on a slope that nothing but friction holds.

             _
            / \_
           /    \_        block of rubber, 60 x 30 mm, under its own weight; plane strain
           \_     \_
             \_    /_--   slope: rigid, Coulomb friction 0.4,
               \__/_--    tilted degree by degree
              __--
          __--
      __--  ) tilt
    ----------------

No DOF of the block is prescribed. Points of its base slip from the start, but the block as a whole
holds, until no equilibrium is left: the library then raises `NoEquilibrium`, which names the body and
the motion that is free. The steepest slope on which the block holds is atan(0.4), to a millionth of
a degree.

Run ``python examples/block_on_slope.py [folder]``: report and a picture.
"""

import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import skfem as fem
from matplotlib.transforms import Affine2D
from matplotlib.tri import Triangulation
from skfem.models.elasticity import lame_parameters, linear_elasticity

import skfem_contact as sc

here = Path(__file__).parent
out = Path(sys.argv[1]) if len(sys.argv) > 1 else here / "out"

# %% Numbers (N, mm, MPa)
mu = 0.4
length, height = 60.0, 30.0
material = {"E": 2.0, "nu": 0.45}
weight = 1.1e-5  # of a volume
magnified = 3000  # displacements in the picture

# %% Body, in axes that are tilted with the slope
x, y = np.linspace(-length / 2, length / 2, 41), np.linspace(0, height, 21)
mesh = fem.MeshQuad.init_tensor(x, y).with_defaults()
basis = fem.Basis(mesh, fem.ElementVector(fem.ElementQuad1()), intorder=2)
block = sc.Body(basis, linear_elasticity(*lame_parameters(**material)), name="block")
along = fem.LinearForm(lambda v, w: -weight * v[0]).assemble(basis)
down = fem.LinearForm(lambda v, w: -weight * v[1]).assemble(basis)


def tilted(degrees):
    """The load step in which the slope has this angle."""
    angle = np.radians(degrees)
    return {"f": {"block": np.sin(angle) * along + np.cos(angle) * down}}


# %% Contact
slope = sc.RigidPlane((0, 0), (0, 1), name="slope")
contact = sc.Contact(block.surface("bottom"), slope, friction=sc.Coulomb(mu), name="base")
solver = sc.ContactSolver([block], [contact])
print(solver)

# %% Tilt it degree by degree until it slides
angles = []
results: list[sc.answers.ContactResult] = []
try:
    for degrees in np.arange(0.0, 30.0, 1.0):
        before = results[-1] if results else None
        results.append(solver.solve(**tilted(degrees), start=before))
        angles.append(degrees)
except sc.errors.NoEquilibrium as exception:
    print(f"\nAt {degrees:g} degrees: {exception}")

# %% Between the last angle that it holds and the first that it does not, halve the interval
tolerance = 1e-6
holds, slides = angles[-1], degrees
while slides - holds > tolerance / 10:
    middle = (holds + slides) / 2
    try:
        solver.solve(**tilted(middle), start=results[-1])
        holds = middle
    except sc.errors.NoEquilibrium:
        slides = middle
limit = np.degrees(np.arctan(mu))
error = abs(holds - limit)
print(f"\nit holds up to {holds:.7f} degrees; atan(mu) is {limit:.7f} degrees")

# %% Plot: the block at four angles, and how much of the friction is used up along its base
shown = [0, 7, 14, 21]
figure, axes = plt.subplot_mosaic(
    [[*shown], ["used"] * 4], figsize=(11, 6.2), height_ratios=[1, 1.1], layout="constrained"
)
cells, sides = mesh.to_meshtri().t.T, mesh.facets[:, mesh.boundary_facets()]
order = np.argsort(results[0].points[:, 0])
colours = plt.get_cmap("viridis")(np.linspace(0, 0.85, len(shown)))
for degrees, colour in zip(shown, colours, strict=True):
    ax, result = axes[degrees], results[degrees]
    turn = Affine2D().rotate_deg(degrees).transform
    u = result.displacement(block)
    stress = sc.von_mises(block, u, **material, plane="strain")
    p = turn((mesh.p + magnified * u[basis.nodal_dofs]).T).T
    image = ax.tripcolor(
        Triangulation(p[0], p[1], cells), stress, shading="gouraud", cmap="YlGnBu", vmin=0, vmax=5e-4
    )
    ax.plot(*p[:, sides], color="#3a3a3a", lw=0.7)
    ax.plot(*turn([(-45, 0), (45, 0)]).T, color="#3a3a3a", lw=1.5)
    every = order[::4]
    arrows = ax.quiver(
        *turn(result.points[every]).T, *turn(result.traction[every]).T,
        color="#b5441c", scale=2.2e-3, width=0.006, pivot="tip",
    )  # fmt: skip
    ax.set(aspect="equal", title=f"{degrees} degrees", xlim=(-52, 48), ylim=(-38, 48))
    ax.axis("off")
    used = result.tangential_force[order, 0] * result.tangent[order, 0, 0]
    used = used / np.where(result.status[order] == 0, np.inf, result.normal_force[order])
    axes["used"].plot(result.points[order, 0], used, color=colour, lw=1.6, label=f"{degrees} degrees")
figure.colorbar(image, ax=[axes[k] for k in shown], label="von Mises stress [MPa]", shrink=0.7)
axes[0].quiverkey(arrows, 0.3, 0.05, 4e-4, "4·10⁻⁴ MPa", labelpos="E", color="#b5441c")
axes["used"].axhspan(-mu, mu, color="#f0ece4", zorder=0)
axes["used"].set(xlabel="along the base [mm]", ylabel="friction on the base / pressure")
axes["used"].legend(frameon=False, loc="lower left", bbox_to_anchor=(0, 0.1))
axes["used"].spines[["top", "right"]].set_visible(False)
out.mkdir(parents=True, exist_ok=True)
figure.savefig(out / "block_on_slope.png", dpi=90)
