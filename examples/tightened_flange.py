r"""Four bolts tightened one after the other, and a pull until the joint opens.

               | |   | |
        ##     | |   | |     ##
      _####____| |   | |____####_        ##  bolts, with head and nut
     |  ||                  ||   |
     |__||____  joint  _____||___|
      __||____|_______|_____||____
     |  ||                  ||   |
     |__||____       _______||___|
       ####    | |   | |    ####
        ##     | |   | |     ##
               | |   | |

Two square flanges on square pipes, which touch at a raised face around the bore, held together by four
bolts. All are snugged first, then each is tightened to 20 kN: on its way it changes the force in the
others. After that all are locked, and the pipe is pulled until the joint opens. Until then the bolts
feel a small part of it.

In each step what head and nut carry is the force in the bolt, and all bolts together carry what presses
the joint and the pull, to nine digits.

Run ``python examples/tightened_flange.py [folder]``: tables, and a picture of all joints.
"""

import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import skfem as fem
from skfem.models.elasticity import lame_parameters, linear_elasticity

import skfem_contact as sc

out = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent / "out"
out.mkdir(parents=True, exist_ok=True)

# %% Numbers: N and mm
tightened, mu = 20e3, 0.15
pulls = np.array([20e3, 40e3, 60e3, 80e3, 100e3])
steel = linear_elasticity(*lame_parameters(210e3, 0.3))
element = fem.ElementVector(fem.ElementHex1())


# %% Bodies: blocks of hexahedra, without what is no steel
def body(lines, solid, boundaries, name, **held):
    mesh = fem.MeshHex.init_tensor(*(np.array(along, dtype=float) for along in lines))
    mesh = mesh.restrict(mesh.elements_satisfying(solid)).with_boundaries(boundaries)
    return sc.Body.from_mesh(mesh, element, steel, name=name, **held)


def flange(side, **held):
    across = [-40, -33, -30.5, -21.5, -19, -15, 0, 15, 19, 21.5, 30.5, 33, 40]
    up = sorted(side * z for z in (0, 1, 6, 12, 24))

    def solid(x):
        a, b = np.abs(x[:2])
        out, z = np.maximum(a, b), abs(x[2])
        hole = (abs(a - 26) < 4.5) & (abs(b - 26) < 4.5)
        plate = (z > 1) & (z < 12) & ~hole
        return (out > 15) & (plate | (out < 19) | ((z < 1) & (out < 21.5)))

    levels = {"joint": 0, "seat": 12 * side, "end": 24 * side}
    faces = {face: (lambda x, z=z: x[2] == z) for face, z in levels.items()}
    return body([across, across, up], solid, faces, "upper" if side > 0 else "lower", **held)


def bolt(x, y, name):
    across, up = np.array([-7, -4, 0, 4, 7]), [-18, -12, -4, 4, 12, 18]

    def solid(at):
        shank = (abs(at[0] - x) < 4) & (abs(at[1] - y) < 4)
        return shank | (abs(at[2]) > 12)

    faces = {"head": lambda at: at[2] == 12, "nut": lambda at: at[2] == -12}
    return body([x + across, y + across, up], solid, faces, name)


upper, lower = flange(1), flange(-1, D="end")
places = {"bolt 1": (26, 26), "bolt 2": (-26, -26), "bolt 3": (-26, 26), "bolt 4": (26, -26)}
shanks = [bolt(x, y, name) for name, (x, y) in places.items()]

# %% Contacts and bolts
friction = sc.Coulomb(mu)
contacts = [sc.Contact(upper.surface("joint"), lower.surface("joint"), friction=friction, name="joint")]
for shank in shanks:
    for side, flange_body in (("head", upper), ("nut", lower)):
        pair = shank.surface(side), flange_body.surface("seat")
        contacts.append(sc.Contact(*pair, friction=friction, name=f"{side} of {shank.name}"))
bolts = [sc.Bolt(s, point=(*places[s.name], 0), axis=(0, 0, 1), name=s.name) for s in shanks]
solver = sc.ContactSolver([upper, lower, *shanks], contacts, bolts=bolts)

# %% Tighten: all snug, then one after the other
steps = [{"bolt": {name: {"force": 0.1 * tightened} for name in places}}]
steps += [{"bolt": {name: {"force": tightened}}} for name in places]
results = list(solver.history(steps))
print("force in the bolts [N] while they are tightened")
for result in results:
    print("  ".join(f"{bolt.force:8.0f}" for bolt in result.bolts.values()))
tight = results[-1]
print(f"\n{tight.joints()}\n")

# %% Pull, and look at some load cases from the same state
area = 38**2 - 30**2
pulled = list(solver.history([{"f": {"upper": {"end": (0, 0, p / area)}}} for p in pulls], start=tight))
for pull, result in zip(pulls, pulled, strict=True):
    force, joint = result.bolts["bolt 1"].force, result.joints()["joint"]
    words = f"bolt 1 {force:6.0f} N, joint {joint.force[2]:6.0f} N"
    print(f"pull {pull:6.0f}: {words}, closed {joint.closed:.2f}")
cases = {
    "pull": {"f": {"upper": {"end": (0, 0, 30e3 / area)}}},
    "side": {"f": {"upper": {"end": (4e3 / area, 0, 0)}}},
    "both": {"f": {"upper": {"end": (4e3 / area, 0, 30e3 / area)}}},
}
print(f"\n{solver.cases(cases, start=tight)}")

# %% Picture
figure = sc.output.plot_joints(pulled[1], units={"length": "mm", "stress": "MPa"})
figure.savefig(out / "tightened_flange.png", dpi=60)
plt.close(figure)

# %% Check what the first lines say
first, last = results[1].bolts["bolt 1"].force, tight.bolts["bolt 1"].force
assert abs(first - tightened) < 1e-9 * tightened and abs(last - tightened) > 0.01 * tightened
assert pulled[0].bolts["bolt 1"].force < 1.01 * last  # it hardly feels the first pull
assert not pulled[-1]["joint"].status.any()
errors = []
for pull, result in zip([0, *pulls], [tight, *pulled], strict=True):
    carried = [b.force for b in result.bolts.values()]
    errors.append(sum(carried) - result["joint"].force[2] - pull)
    for name, own in zip(places, carried, strict=True):
        errors.append(result[f"head of {name}"].force[2] - own)
        errors.append(result[f"nut of {name}"].force[2] + own)
error = float(np.max(np.abs(errors)) / tightened)
tolerance = 1e-9
assert error < tolerance
