r"""A block on a slope that nothing but friction holds.

             _
            / \_
           /    \_        soft block, 60 x 30 x 30 mm, under its own weight
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
from skfem.models.elasticity import lame_parameters, linear_elasticity

import skfem_contact as sc

here = Path(__file__).parent
out = Path(sys.argv[1]) if len(sys.argv) > 1 else here / "out"

# %% Numbers (N, mm, MPa)
mu = 0.4
length, width, height = 60.0, 30.0, 30.0
material = {"E": 2.0, "nu": 0.3}
weight = 1.1e-5  # of a volume
magnified = 3000  # displacements in the picture

# %% Body, in axes that are tilted with the slope
x, y, z = np.linspace(-length / 2, length / 2, 13), np.linspace(0, width, 6), np.linspace(0, height, 6)
mesh = fem.MeshHex.init_tensor(x, y, z).with_boundaries({"base": lambda x: x[2] == 0})
basis = fem.Basis(mesh, fem.ElementVector(fem.ElementHex1()), intorder=2)
block = sc.Body(basis, linear_elasticity(*lame_parameters(**material)), name="block")
along = fem.LinearForm(lambda v, w: -weight * v[0]).assemble(basis)
down = fem.LinearForm(lambda v, w: -weight * v[2]).assemble(basis)


def tilted(degrees):
    """The load step in which the slope has this angle."""
    angle = np.radians(degrees)
    return {"f": {"block": np.sin(angle) * along + np.cos(angle) * down}}


# %% Contact
slope = sc.RigidPlane((0, 0, 0), (0, 0, 1), name="slope")
contact = sc.Contact(block.surface("base"), slope, friction=sc.Coulomb(mu), name="base")
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
    except (sc.errors.NoEquilibrium, sc.errors.NotConverged):  # close by, it may only find no answer
        slides = middle
limit = np.degrees(np.arctan(mu))
error = abs(holds - limit)
print(f"\nit holds up to {holds:.7f} degrees; atan(mu) is {limit:.7f} degrees")

# %% Plot: the block at three angles, and how much of the friction is used up on its base
shown = [0, 10, 20]
figure = plt.figure(figsize=(11, 5.8), layout="constrained")
grid = figure.add_gridspec(2, len(shown), height_ratios=[1.4, 1])


def mises(body, u):
    return sc.von_mises(body, u, E=material["E"], nu=material["nu"])


bases = []
for column, degrees in enumerate(shown):
    result = results[degrees]
    ax = figure.add_subplot(grid[0, column])
    tilt = np.radians(degrees)
    up = (np.sin(tilt), 0, np.cos(tilt))  # it slides to the left
    units = {"length": "mm", "stress": "MPa"}
    sc.plot_deformed(
        result, magnified, stress=mises, ax=ax, units=units, viewer=(0.25, -1, 0.15), up=up
    )
    ax.set_title(f"{degrees} degrees")
    used = np.linalg.norm(result.tangential_force, axis=1)
    used = used / np.where(result.status == 0, np.inf, result.normal_force)
    ax = figure.add_subplot(grid[1, column])
    bases.append(ax)
    dots = ax.scatter(
        result.points[:, 0], result.points[:, 1], c=used, s=90, vmin=0, vmax=mu, cmap="YlOrRd"
    )
    ax.set(aspect="equal", xlabel="x on the base [mm]", ylim=(-4, width + 4))
figure.colorbar(dots, ax=bases, location="bottom", shrink=0.4, label="friction / pressure")
out.mkdir(parents=True, exist_ok=True)
figure.savefig(out / "block_on_slope.png", dpi=90)
