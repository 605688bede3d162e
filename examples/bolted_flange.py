r"""A bolted flange: a mesh from Gmsh, preload, and a joint that opens under the pull of a pipe.

            | |  pipe, pulled by up to 350 kN
            | |
       _____| |_____
      |__|#|___|#|__|     8 bolts, tightened; the joint is a plane of symmetry,
      =====joint=====     so each bolt clamps half of what is drawn here
                          and one sixteenth is meshed, from a bolt to half way to the next

Parts and their sides come by name from the file ``meshes/flange.msh``. Tightening draws the shank
of the bolt through the plane of symmetry. The plane half way to the next bolt lies at 22.5 degrees,
where no displacement of the mesh is along an axis: a contact without separation on a rigid plane is
the condition of symmetry there.

The bolt hardly feels the first pull, which only takes pressure off the joint: of the first 100 kN less
than 2 % of its share. Then the joint opens from the bore outwards, the flange levers about its rim, and
of the last 50 kN the bolt takes more than its whole share. In each step bolt, joint and pull are in
balance to nine digits.

Run ``python examples/bolted_flange.py [folder]``: report, files for ParaView, and a picture.
"""

import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import skfem as fem
from matplotlib.collections import PolyCollection
from skfem.models.elasticity import lame_parameters, linear_elasticity

import skfem_contact as sc

here = Path(__file__).parent
out = Path(sys.argv[1]) if len(sys.argv) > 1 else here / "out"

# %% Numbers: N and mm
bolts, mu = 8, 0.15
tightened = 0.06  # by what the shank is drawn through the plane
pulls = 50e3 * np.arange(8)  # on the pipe
E, nu = 210e3, 0.3

# %% Bodies from the file: straight tetrahedra, quadratic displacements
mesh = fem.MeshTet.load(here / "meshes" / "flange.msh")
element = fem.ElementVector(fem.ElementTetP2())
basis = {name: fem.Basis(mesh.restrict(name), element, intorder=2) for name in ("flange", "bolt")}
steel = linear_elasticity(*lame_parameters(E, nu))

flange = sc.Body(basis["flange"], steel, D={"flange middle": "y"}, name="flange")
bolt = sc.Body(basis["bolt"], steel, D={"cut": "z", "bolt middle": "y"}, name="bolt")

# %% Contacts: under the head, in the joint, and the plane half way to the next bolt
seat = sc.Contact(bolt.surface("head"), flange.surface("seat"), friction=sc.Coulomb(mu), name="seat")
joint = sc.Contact(flange.surface("joint"), sc.RigidPlane((0, 0, 0), (0, 0, 1)), name="joint")
angle = np.pi / bolts
plane = sc.RigidPlane((0, 0, 0), (np.sin(angle), -np.cos(angle), 0))
symmetry = sc.Contact(flange.surface("between bolts"), plane, separation=False, name="symmetry")
solver = sc.ContactSolver([flange, bolt], [seat, joint, symmetry])
print(solver)

# %% Tighten, then pull: all forces per bolt are twice those of the half that is meshed
upward = flange.load({"pipe": (0.0, 0.0, 1.0)}, "the pull")
share = 1 / (2 * bolts)
steps = [{"x": {"bolt": {"cut": (None, None, -tightened)}}}]
steps += [{"f": {"flange": upward * share * pull / upward.sum()}} for pull in pulls[1:]]
results = list(solver.history(steps))
in_bolt = np.array([-2 * result.reaction("bolt", "cut")[2] for result in results])
in_joint = np.array([2 * result["joint"].force[2] for result in results])
closed = np.array([result["joint"].contact_area for result in results])
for pull, *row in zip(pulls, in_bolt, in_joint, 100 * closed / closed[0], strict=True):
    print("pull {:6.0f} N: bolt {:6.0f} N, joint {:6.0f} N, {:3.0f} % of the area".format(pull, *row))
print(results[-1])

# %% Files and pictures
sc.write_series(out / "bolted_flange.pvd", results)


def mises(body, u):
    # at sharp edges stresses grow with every refinement: colours end at a stress that means something
    return np.minimum(sc.von_mises(body, u, E=E, nu=nu), 600.0)


figure = plt.figure(figsize=(12, 6.6), layout="constrained")
left, right = figure.subfigures(1, 2, squeeze=False, width_ratios=[9, 10]).flat
scene = left.subplots()
sc.plot_deformed(
    results[-1],
    scale=100,
    stress=mises,
    ax=scene,
    label="von Mises stress, up to 600 [MPa]",
    units={"length": "mm"},
    obstacles=False,  # the two planes of symmetry would hide the bodies
)
scene.set_title(
    f"pulled by {pulls[-1] / 1e3:.0f} kN, displacements magnified 100 times", fontsize="medium"
)
upper, lower = right.subfigures(2, 1, height_ratios=[1, 1.05])
views = upper.subplots(1, 2, sharey=True)
faces = joint.secondary.points[joint.secondary.facets[:, :3]][:, :, :2]
top = max(result["joint"].pressure.max() for result in results)
for ax, i in zip(views, (0, 7), strict=True):
    nodal = results[i]["joint"].pressure[joint.secondary.facets].mean(axis=1)
    filled = PolyCollection(faces, array=np.where(nodal > 0, nodal, np.nan), cmap="YlGnBu")
    filled.set(clim=(0, top), edgecolor="#bbbbbb", lw=0.3)
    ax.add_collection(filled)
    ax.set(xlim=(45, 102), ylim=(-2, 40), aspect="equal", xlabel="x [mm]")
    ax.set_title(f"joint, pulled by {pulls[i] / 1e3:.0f} kN", fontsize="medium")
views[0].set_ylabel("y [mm]")
upper.colorbar(filled, ax=views, label="pressure [MPa], white: open", shrink=0.8)
curve = lower.subplots()
curve.plot(pulls / 1e3, in_bolt / 1e3, "o-", label="in the bolt")
curve.plot(pulls / 1e3, in_joint / 1e3, "s-", label="in the joint")
curve.plot(pulls / 1e3, in_bolt[0] / 1e3 + 0 * pulls, "k:", lw=0.8, label="preload")
curve.set(xlabel="pull on the pipe [kN]", ylabel="force per bolt [kN]", ylim=(0, None))
curve.legend(frameon=False)
figure.savefig(out / "bolted_flange.png", dpi=100)

# %% Check what the first lines say
felt = np.diff(in_bolt) / np.diff(pulls / bolts)
assert np.abs(felt[:2]).max() < 0.05 and abs((in_bolt[2] - in_bolt[0]) * bolts / pulls[2]) < 0.02
assert felt[-1] > 1
error = float(np.max(np.abs(in_bolt - in_joint - pulls / bolts)) / in_bolt[0])
tolerance = 1e-9
assert error < tolerance
