r"""Shallow ironing of rubber: a stiff die is pressed into a slab and dragged along it.

                 ___
                |   |   down by 0.15 H, then 1.2 H to the right
                 \_/                        ---->
         ___________________________
        |                           |       slab: neo-Hookean, E = 1, nu = 0.3, height H = 1
        |           slab            |       die: elastic, E = 100, radius 0.5 H
        |___________________________|       Coulomb friction 0.3, plane strain
        /////////////////////////////

The rubber is strained by a third under the die, and the contact slides over ten facets and more.
Equilibrium is that of the deformed bodies and surfaces: tangents of the rubber, pairing and
directions are renewed in every iterate, and the die is condensed once for all.

The ratio of horizontal to vertical force is the friction coefficient to 3 %. It hardly changes on the
way, and on two meshes it is the same within 0.005.

Run ``python examples/rubber_ironing.py [folder]``.
"""

import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import skfem as fem

import skfem_contact as sc

out = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent / "out"
out.mkdir(parents=True, exist_ok=True)

# %% Numbers
mu, radius, depth, distance = 0.3, 0.5, 0.15, 1.2
element = fem.ElementVector(fem.ElementQuad1())
press = [{"x": {"die": {"inner": (0.0, -depth * share)}}} for share in (1 / 3, 2 / 3, 1.0)]
travel = np.linspace(0, distance, 13)[1:]
drag = [{"x": {"die": {"inner": (float(way), -depth)}}} for way in travel]


# %% The slab with n elements over its height; the lower half of a ring as die; contact that follows
def ironing(n):
    grid = fem.MeshQuad.init_tensor(np.linspace(0, 3, 3 * n + 1), np.linspace(-1, 0, n + 1))
    slab_basis = fem.Basis(grid.with_defaults(), element, intorder=2)
    slab = sc.NonlinearBody(slab_basis, sc.materials.NeoHooke.of(1.0, 0.3), D="bottom", name="slab")

    angles = np.linspace(-np.pi, 0, 2 * n + 1)
    polar = fem.MeshQuad.init_tensor(np.linspace(0.5, 1, n // 2 + 1), angles).with_defaults()
    r, angle = polar.p
    p = np.array([0.8 + radius * r * np.cos(angle), radius + radius * r * np.sin(angle)])
    rims = {"inner": polar.boundaries["left"], "outer": polar.boundaries["right"]}
    die_basis = fem.Basis(fem.MeshQuad(p, polar.t).with_boundaries(rims), element, intorder=4)
    die = sc.Body(die_basis, sc.Elastic(100.0, 0.3), D="inner", name="die")

    faces = slab.surface("top"), die.surface("outer")
    contact = sc.Contact(*faces, friction=sc.Coulomb(mu), sliding="finite")
    return list(sc.ContactSolver([slab, die], [contact]).history(press + drag))


# %% Two meshes
ratios, forces = {}, {}
for n in (8, 12):
    results = ironing(n)
    forces[n] = np.array([result.force for result in results[len(press) :]])  # on the slab
    ratios[n] = forces[n][:, 0] / -forces[n][:, 1]
    work = sum(len(result.newton) for result in results)
    print(f"n = {n:2d}: T/N {ratios[n][3:9].mean():.4f}, {work} linearisations in {len(results)} steps")
print(results[-1].newton)

# %% Checks
middle = np.array([ratio[3:9].mean() for ratio in ratios.values()])
error, tolerance = np.ptp(middle), 0.005
print(f"T/N over two meshes within {error:.4f}")
assert error <= tolerance
assert max(result.certificate.worst for result in results) < 1e-8

# %% Picture
units = {"length": "H", "stress": "E"}
figure, (deformed, drawn) = plt.subplots(
    2, 1, figsize=(8, 6.6), height_ratios=[3, 2], layout="constrained"
)
shown = results[len(press) + 7]
sc.plot_deformed(shown, scale=1.0, stress="von_mises", ax=deformed, units=units, window=(0, 3, -1, 0.6))
deformed.set_title(f"the die has travelled {travel[7]:.1f} H; true positions")
for n, colour in zip(ratios, ("#4a9a6c", "#20618d"), strict=True):
    drawn.plot(travel, ratios[n], color=colour, label=f"{n} elements over the height")
drawn.axhline(mu, color="k", ls=":", label="friction coefficient")
drawn.set(xlabel="travel of the die [H]", ylabel="horizontal over vertical force", ylim=(0.28, 0.32))
drawn.legend(loc="lower left", frameon=False)
drawn.spines[["top", "right"]].set_visible(False)
figure.savefig(out / "rubber_ironing.png", dpi=90)
