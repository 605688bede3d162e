"""Mesh of a pin in the hole of a lug; writes `pin_in_lug.msh` next to this script (needs gmsh).

Lengths in mm. The two surfaces are not fragmented, so the pin and the hole have nodes of their own
and the meshes do not match: nothing is welded. Physical groups become subdomains and boundaries.
"""

from pathlib import Path

import gmsh

hole, clearance = 10.0, 0.03  # radius of the hole; what the pin's radius is smaller
head, shank = 22.0, 50.0  # radius of the head, which is half the width; length below the centre
fine, pin_size, coarse = 0.3, 0.37, 2.8  # size of the elements: at the hole, at the pin, elsewhere


def along(curve, inside):
    """Whether the bounding box of a curve satisfies a condition on (x0, y0, x1, y1)."""
    x0, y0, _, x1, y1, _ = gmsh.model.getBoundingBox(1, curve)
    return inside(x0, y0, x1, y1)


gmsh.initialize()
gmsh.option.setNumber("General.Terminal", 0)
occ = gmsh.model.occ

head_disk = occ.addDisk(0, 0, 0, head, head)
strip = occ.addRectangle(-head, -shank, 0, 2 * head, shank)
solid, _ = occ.fuse([(2, head_disk)], [(2, strip)])
occ.synchronize()
lug, _ = occ.cut(solid, [(2, occ.addDisk(0, 0, 0, hole, hole))])
pin = occ.addDisk(0, clearance, 0, hole - clearance, hole - clearance)  # it touches at the top
occ.synchronize()

lug_curves = [tag for _, tag in gmsh.model.getBoundary(lug, oriented=False)]
pin_curves = [tag for _, tag in gmsh.model.getBoundary([(2, pin)], oriented=False)]
margin = 1.01 * hole
hole_curves = [c for c in lug_curves if along(c, lambda x0, y0, x1, y1: x1 < margin and y0 > -margin)]
base_curves = [c for c in lug_curves if along(c, lambda x0, y0, x1, y1: y1 < -0.99 * shank)]

for dim, tags, name in [
    (2, [tag for _, tag in lug], "lug"),
    (2, [pin], "pin"),
    (1, hole_curves, "hole"),
    (1, pin_curves, "rim"),
    (1, base_curves, "base"),
]:
    gmsh.model.addPhysicalGroup(dim, tags, name=name)

field = gmsh.model.mesh.field
fields = []
for surface, curves, size, growth in [
    (lug[0][1], hole_curves, fine, 14.0),
    (pin, pin_curves, pin_size, 6.0),
]:
    distance = field.add("Distance")
    field.setNumbers(distance, "CurvesList", curves)
    field.setNumber(distance, "Sampling", 400)
    threshold = field.add("Threshold")
    for key, value in [
        ("InField", distance),
        ("SizeMin", size),
        ("SizeMax", coarse),
        ("DistMin", 0.5),
        ("DistMax", growth),
    ]:
        field.setNumber(threshold, key, value)
    here = field.add("Restrict")
    field.setNumber(here, "InField", threshold)
    field.setNumbers(here, "SurfacesList", [surface])
    fields.append(here)
smallest = field.add("Min")
field.setNumbers(smallest, "FieldsList", fields)
field.setAsBackgroundMesh(smallest)
for option in ("MeshSizeExtendFromBoundary", "MeshSizeFromPoints", "MeshSizeFromCurvature"):
    gmsh.option.setNumber(f"Mesh.{option}", 0)
gmsh.option.setNumber("Mesh.Algorithm", 6)
gmsh.option.setNumber("Mesh.RandomSeed", 1)
gmsh.option.setNumber("Mesh.MshFileVersion", 4.1)
gmsh.model.mesh.generate(2)
gmsh.write(str(Path(__file__).with_name("pin_in_lug.msh")))
gmsh.finalize()
