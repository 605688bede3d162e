"""Mesh of a die set with two shrink rings; writes `die_set.msh` next to this script (needs gmsh).

Lengths in mm. A quarter of each ring, before they are shrunk onto each other: each is larger outside
than the bore of the next. They are not fragmented, so each has nodes of its own. Second order, in the
format of version 2, which is the shortest.
"""

from pathlib import Path

import gmsh

rings = {"insert": (20.0, 32.08, 3.0), "ring 1": (32.0, 50.1, 4.2), "ring 2": (50.0, 80.0, 6.0)}

gmsh.initialize()
gmsh.option.setNumber("General.Terminal", 0)
occ = gmsh.model.occ
quarters = {}
for name, (inner, outer, size) in rings.items():
    disk, hole = occ.addDisk(0, 0, 0, outer, outer), occ.addDisk(0, 0, 0, inner, inner)
    ring, _ = occ.cut([(2, disk)], [(2, hole)])
    quarter, _ = occ.intersect(ring, [(2, occ.addRectangle(0, 0, 0, 100, 100))])
    quarters[name] = quarter[0][1], size
occ.synchronize()

sides: dict[str, list[int]] = {"left": [], "bottom": [], "bore": []}
for name, (tag, size) in quarters.items():
    gmsh.model.addPhysicalGroup(2, [tag], name=name)
    gmsh.model.mesh.setSize(gmsh.model.getBoundary([(2, tag)], recursive=True), size)
    for _, curve in gmsh.model.getBoundary([(2, tag)], oriented=False):
        x0, y0, _, x1, y1, _ = gmsh.model.getBoundingBox(1, curve)
        if x1 < 1:
            sides["left"].append(curve)
        elif y1 < 1:
            sides["bottom"].append(curve)
        elif x1 < 21:
            sides["bore"].append(curve)
for name, curves in sides.items():
    gmsh.model.addPhysicalGroup(1, curves, name=name)

gmsh.option.setNumber("Mesh.ElementOrder", 2)
gmsh.option.setNumber("Mesh.MshFileVersion", 2.2)
gmsh.model.mesh.generate(2)
gmsh.write(str(Path(__file__).with_name("die_set.msh")))
gmsh.finalize()
