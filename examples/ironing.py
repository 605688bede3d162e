r"""Ironing: an elastic die is pressed into a block and dragged along it.

                 ___
                |   |   down by 0.05, then 2.4 to the right
                 \_/                        ---->
         ___________________________
        |                           |       Coulomb friction 0.3, E = 1 (block) and 10 (die),
        |           block           |       plane strain
        |___________________________|
        /////////////////////////////

Contact travels over 60 facets of the block, so the pairing follows it (``sliding="finite"``). Far
from the ends of the block the ratio of horizontal to vertical force ripples by less than half a per
cent as nodes meet and leave the die. The ratio itself is 0.295, below mu: friction shifts the contact
to the trailing side of the die, where the pressure leans forward and helps to push.

Run ``python examples/ironing.py [folder]``: a picture, an animation, and a series for ParaView.
"""

import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import skfem as fem
from matplotlib.animation import PillowWriter
from skfem.models.elasticity import lame_parameters, linear_elasticity

import skfem_contact as sc

out = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent / "out"
out.mkdir(parents=True, exist_ok=True)

# %% Numbers
mu, radius, depth, distance = 0.3, 0.5, 0.05, 2.4
element = fem.ElementVector(fem.ElementQuad1())


def elastic(E):
    return linear_elasticity(*lame_parameters(E, 0.3))


# %% The block, and the lower half of a ring as die
grid = fem.MeshQuad.init_tensor(np.linspace(0, 4, 101), np.linspace(-1, 0, 21)).with_defaults()
block_basis = fem.Basis(grid, element, intorder=2)
block = sc.Body(block_basis, elastic(1.0), D="bottom", name="block")

fine = np.linspace(-0.6, 0.6, 25)
angles = np.concatenate(
    [np.linspace(-np.pi / 2, -0.6, 7)[:-1], fine, np.linspace(0.6, np.pi / 2, 7)[1:]]
)
polar = fem.MeshQuad.init_tensor(np.linspace(0.5, 1, 9), angles - np.pi / 2)
inner = polar.facets_satisfying(lambda x: x[0] < 0.51)
outer = polar.facets_satisfying(lambda x: x[0] > 0.99)
r, angle = polar.p
ring = fem.MeshQuad(
    np.array([0.8 + radius * r * np.cos(angle), radius + radius * r * np.sin(angle)]), polar.t
).with_boundaries({"inner": inner, "outer": outer})
die_basis = fem.Basis(ring, element, intorder=4)
held = die_basis.get_dofs("inner")
right, down = np.zeros((2, die_basis.N))
right[held.nodal["u^1"]], down[held.nodal["u^2"]] = 1.0, -1.0
die = sc.Body(die_basis, elastic(10.0), D=held, name="die")

# %% Contact that follows
contact = sc.Contact(
    secondary=block.surface("top"),  # the softer side
    primary=die.surface("outer"),
    friction=sc.Coulomb(mu),
    sliding="finite",
    method="mortar",
)
solver = sc.ContactSolver([block, die], [contact])
print(solver)

# Where most of its energy is the block is strained by 0.055: linear bodies are wrong by about as much,
# and from 0.1 on the solver would warn. This example is about sliding.
press = [{"x": {"die": depth * k / 4 * down}} for k in range(1, 5)]
travel = np.linspace(0, distance, 81)[1:]
drag = [{"x": {"die": depth * down + s * right}} for s in travel]
results = list(solver.history(press + drag))
print(results[-1].report())
sc.write_series(out / "ironing.pvd", results[:: len(results) // 16])

# %% Forces over travel, away from the ends
force = np.array([result.force for result in results[len(press) :]])  # on the block
ratio = force[:, 0] / -force[:, 1]
middle = (travel > 0.5) & (travel < 2.0)
ripple = np.ptp(ratio[middle]) / ratio[middle].mean()
pressures = [np.sum(r.normal_force[:, None] * r.normal, axis=0) for r in results[len(press) :]]
lean = np.mean([p[0] / p[1] for p in np.array(pressures)[middle]])
print(f"horizontal over vertical force {ratio[middle].mean():.4f}, ripple {100 * ripple:.2f} %")
rest = mu - (1 + mu**2) * lean
print(f"the pressure leans forward by {lean:.4f}: mu - (1 + mu^2) times that is {rest:.4f}")


# %% Pictures
def mises(body, u):
    return sc.von_mises(body, u, E={"block": 1.0, "die": 10.0}[body.name], nu=0.3)


# lengths in heights of the block, stresses in its modulus
units = {"length": "H", "stress": "E"}
figure, (deformed, forces) = plt.subplots(
    2, 1, figsize=(8, 6.4), height_ratios=[3, 2], layout="constrained"
)
shown = results[len(press) + 49]
sc.plot_deformed(shown, stress=mises, ax=deformed, units=units)
deformed.set_title(f"the die has travelled {travel[49]:.1f} H; true positions")
forces.plot(travel, -force[:, 1], color="#20618d", label="vertical force on the block")
forces.plot(travel, force[:, 0], color="#b5441c", label="horizontal force")
forces.plot(travel, -mu * force[:, 1], "k:", label="μ times the vertical force")
forces.set(xlabel="travel of the die [H]", ylabel="force per thickness [E H]", ylim=(0, None))
forces.legend(loc="center right", frameon=False)
forces.spines[["top", "right"]].set_visible(False)
figure.savefig(out / "ironing.png", dpi=120)

# %% The same as an animation, with one scale of colours for all frames
figure = plt.figure(figsize=(6.4, 3.1), layout="constrained")
writer = PillowWriter(fps=8)
with writer.saving(figure, str(out / "ironing.gif"), dpi=70):
    for result in [*results[: len(press)], *results[len(press) :: 2]]:
        figure.clf()
        axes = sc.plot_deformed(result, scale=1.0, stress=mises, ax=figure.add_subplot(), units=units)
        axes.set(xlim=(-0.1, 4.1), ylim=(-1.1, 0.7), title="")
        for image in axes.collections[:1] + axes.collections[2:3]:  # the colours of the two bodies
            image.set_clim(0.0, 0.13)
        writer.grab_frame()

# %% Check what the first lines say
error, tolerance = ripple, 0.005
assert error < tolerance
