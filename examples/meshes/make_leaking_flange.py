"""Mesh of a flange with a gasket and four bolts; writes `leaking_flange.msh` beside it (needs gmsh).

Lengths in mm. The parts are drawn, and written as STEP, as any program for drawing does. This is read
again and meshed: each part has nodes of its own. Tags are given by position.
"""

import tempfile
from pathlib import Path

import gmsh
import numpy as np

bore, pipe, rim = 25.0, 30.0, 60.0  # radii: inside, outside of the pipe, outside of the flange
thick, height = 12.0, 26.0  # of the flange; of all
circle, hole, shank, head, head_height = 45.0, 6.5, 5.0, 9.0, 6.0  # radii of the four bolts
seal, gasket = (27.0, 35.0), 1.5  # radii of the gasket, thickness

gmsh.initialize()
gmsh.option.setNumber("General.Terminal", 0)
occ = gmsh.model.occ
angles = np.arange(4) * np.pi / 2
places = np.column_stack([circle * np.cos(angles), circle * np.sin(angles)])


def tube(inner, outer, z, length):
    solid, out = (occ.addCylinder(0, 0, z, 0, 0, length, r) for r in (outer, inner))
    return occ.cut([(3, solid)], [(3, out)])[0]


def flange():
    whole, _ = occ.fuse(
        tube(bore, rim, gasket / 2, thick),
        tube(bore, pipe, gasket / 2 + thick, height - thick),
    )
    return occ.cut(whole, [(3, occ.addCylinder(x, y, 0, 0, 0, height, hole)) for x, y in places])[0]


def bolt(x, y):
    reach = gasket / 2 + thick
    ends = [occ.addCylinder(x, y, z, 0, 0, head_height, head) for z in (reach, -reach - head_height)]
    rod = occ.addCylinder(x, y, -reach, 0, 0, 2 * reach, shank)
    return occ.fuse([(3, rod)], [(3, end) for end in ends])


flange()
occ.mirror(flange(), 0, 0, 1, 0)
tube(*seal, -gasket / 2, gasket)
for place in places:
    bolt(*place)
occ.synchronize()
with tempfile.TemporaryDirectory() as folder:
    gmsh.write(f"{folder}/flange.step")
    gmsh.clear()
    occ.importShapes(f"{folder}/flange.step")
occ.synchronize()


def box(dim, tag):
    return np.array(gmsh.model.getBoundingBox(dim, tag))


sides: dict[str, list[int]] = {"bore": [], "end": []}
for dim, tag in gmsh.model.getEntities(3):
    low, high = box(dim, tag).reshape(2, 3)
    middle, wide = (low + high) / 2, (high - low)[0] / 2
    if wide < 20:
        at = int(np.argmin(np.linalg.norm(places - middle[:2], axis=1)))
        name = f"bolt {at + 1}"
    else:
        name = "gasket" if wide < 40 else "upper" if middle[2] > 0 else "lower"
    gmsh.model.addPhysicalGroup(3, [tag], name=name)
    if name == "gasket":
        gmsh.model.mesh.setSize(gmsh.model.getBoundary([(3, tag)], recursive=True), 4.0)
    for _, face in gmsh.model.getBoundary([(3, tag)], oriented=False):
        a, b = box(2, face).reshape(2, 3)
        if name in ("upper", "lower") and abs(b[0] - bore) < 0.1 and b[2] - a[2] > 1:
            sides["bore"].append(face)
        elif b[2] - a[2] < 0.1 and abs(abs(a[2]) - height - gasket / 2) < 0.1:
            sides["end"].append(face)
        elif name == "gasket" and b[2] - a[2] > 1 and b[0] < 30:
            sides["bore"].append(face)
for name, faces in sides.items():
    gmsh.model.addPhysicalGroup(2, faces, name=name)

gmsh.option.setNumber("Mesh.MeshSizeMax", 9.0)
gmsh.option.setNumber("Mesh.MeshSizeFromCurvature", 10)
gmsh.option.setNumber("Mesh.MshFileVersion", 2.2)
gmsh.option.setNumber("Mesh.Binary", 1)
gmsh.model.mesh.generate(3)
gmsh.write(str(Path(__file__).with_name("leaking_flange.msh")))
gmsh.finalize()
