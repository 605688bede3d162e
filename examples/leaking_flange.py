r"""A flange with a gasket: four bolts tightened one after the other, and water inside until it leaks.

             |    |           |    |
      ####   |    |           |    |   ####     ##  bolts M10, head and nut
     _####___|    |    p      |    |___####_
    |  | |        |           |        | |  |
    |__|_|________|           |________|_|__|
       | |     ===             ===     | |      ==  gasket, soft
     __|_|________             ________|_|__
    |  | |        |           |        | |  |
    |__|_|___     |           |     ___|_|__|
      ####   |    |           |    |   ####

The file ``meshes/leaking_flange.msh`` is what Gmsh makes of a STEP file: seven bodies and two sides,
"bore" and "end", with tags. What touches is found. All bolts are snugged first, then each is tightened
to 20 kN, crosswise: those that come later change the force in the earlier ones, by up to a tenth. Then
they are locked, and water presses on the bore and pulls at the end of the pipe.

The gasket is tight as long as around all of it some place on the way out is pressed by more than the
water. It leaks at 32 MPa, soon after friction has ceased to hold the gasket, which is pushed out. In
each step the bolts carry what is left on the gasket and the pull of the water, to nine digits.

Run ``python examples/leaking_flange.py [folder]``: tables, and a picture.
"""

import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import skfem_contact as sc

here = Path(__file__).parent
out = Path(sys.argv[1]) if len(sys.argv) > 1 else here / "out"
out.mkdir(parents=True, exist_ok=True)

# %% Bodies by their tags: N and mm
materials = {"gasket": sc.Elastic(3e3, 0.3), "*": sc.Elastic(210e3, 0.3)}
file = here / "meshes" / "leaking_flange.msh"
bodies = sc.read_bodies(file, materials, settings={"lower": {"D": "end"}})

# %% Contacts, bolts
pairs = sc.find_contacts(bodies, within=0.1, friction=sc.Coulomb(0.15))
print(pairs)
places = {"bolt 1": (45, 0, 0), "bolt 2": (0, 45, 0), "bolt 3": (-45, 0, 0), "bolt 4": (0, -45, 0)}
bolts = [sc.Bolt(bodies[name], point=at, axis=(0, 0, 1), name=name) for name, at in places.items()]
solver = sc.ContactSolver(bodies, pairs, bolts=bolts)

# %% Tighten crosswise: all snug, then one after the other
steps = [{"bolt": {name: {"force": 2e3} for name in places}}]
steps += [{"bolt": {f"bolt {i}": {"force": 20e3}}} for i in (1, 3, 2, 4)]
tightening = list(solver.history(steps))
print("\nforce in the bolts [N] while they are tightened")
for result in tightening:
    print("  ".join(f"{bolt.force:8.0f}" for bolt in result.bolts.values()))
tight = tightening[-1]

# %% Press: water in the bore of three bodies, and on the cap of the pipe
cap = 25**2 / (30**2 - 25**2)  # area of the bore over that of the pipe


def water(p):
    upper = {"bore": p, "end": (0, 0, p * cap)}
    return {"f": {"upper": upper, "gasket": {"bore": p}, "lower": {"bore": p}}}


pressures = np.arange(0.0, 35.0, 2.0)
pressed = list(solver.history(map(water, pressures), start=tight))


# %% Tight: in each of 24 sectors the largest pressure on the gasket holds the water back
def seal(values):
    sector = np.floor(np.arctan2(*values.points.T[:2]) / (2 * np.pi) * 24).astype(int)
    return min(values.pressure[sector == k].max() for k in np.unique(sector))


sides = ["upper - gasket", "lower - gasket"]
held = np.array([min(seal(result[side]) for side in sides) for result in pressed])
print("\n water [MPa]  held back by [MPa]  bolts [N]")
for p, least, result in zip(pressures, held, pressed, strict=True):
    forces = "  ".join(f"{bolt.force:6.0f}" for bolt in result.bolts.values())
    print(f"{p:12.0f}  {least:17.1f}  {forces}")
after = int(np.argmax(held < pressures))
spare = held - pressures
leak = np.interp(0.0, [spare[after], spare[after - 1]], [pressures[after], pressures[after - 1]])
print(f"\nleaks at {leak:.1f} MPa; the joints at {pressures[after]:.0f} MPa:")
print(pressed[after].joints())

# %% Picture
figure, axes = plt.subplots(1, 3, figsize=(13, 3.8), layout="constrained")
for bolt in places:
    axes[0].plot([result.bolts[bolt].force / 1e3 for result in tightening], "o-", label=bolt)
axes[0].set(xlabel="step of tightening", ylabel="force [kN]", xticks=range(5), xlim=(-0.2, 5.4))
axes[0].legend(frameon=False, loc="lower right")
axes[1].plot(pressures, held, "o-", label="gasket, at its weakest place")
axes[1].plot(pressures, pressures, "k--", label="water")
axes[1].set(xlabel="pressure of the water [MPa]", ylabel="pressure [MPa]", ylim=(0, None))
axes[1].axvline(leak, color="tab:red", linewidth=1)
axes[1].legend(frameon=False)
gasket = pressed[after]["upper - gasket"]
shown = axes[2].scatter(*gasket.points.T[:2], c=gasket.pressure, s=30)
axes[2].set(
    title=f"gasket at {pressures[after]:.0f} MPa", aspect="equal", xlabel="x [mm]", ylabel="y [mm]"
)
figure.colorbar(shown, ax=axes[2], label="pressure [MPa]")
figure.savefig(out / "leaking_flange.png", dpi=80)
plt.close(figure)

# %% Check what the first lines say
assert 31 < leak < 33
last = [bolt.force for bolt in tight.bolts.values()]
assert 1.08 < max(last) / 20e3 < 1.11 and abs(last[3] - 20e3) < 1e-9 * 20e3
errors = []
for p, result in zip(pressures, pressed, strict=True):
    pull = p * cap * bodies["upper"].surface("end").area.sum()
    carried = sum(bolt.force for bolt in result.bolts.values())
    errors.append(carried + result["upper - gasket"].force[2] - pull)
error = float(np.max(np.abs(errors)) / sum(last))
tolerance = 1e-9
print(f"balance of bolts, gasket and water: {error:.1e}")
assert error < tolerance
