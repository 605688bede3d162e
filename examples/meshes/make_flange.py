"""Mesh of a bolted flange, one sixteenth of it; writes `flange.msh` next to this script (needs gmsh).

Lengths in mm. The plane z = 0 between the two flanges is a plane of symmetry, and so are y = 0
through the bolt and the plane half way to the next bolt. Flange and bolt have nodes of their own:
nothing is welded. Physical groups become subdomains and boundaries.
"""

from pathlib import Path

import gmsh
import numpy as np

bore, pipe, rim = 50.0, 57.0, 100.0  # radii: inside, outside of the pipe, outside of the flange
thick, height, fillet = 16.0, 60.0, 5.0  # of the flange; of all; radius between flange and pipe
circle, hole, shank, head, head_height = 80.0, 9.0, 8.0, 13.0, 10.0  # of the bolts, 8 of them
half = np.pi / 8  # angle from a bolt to half way to the next one

gmsh.initialize()
gmsh.option.setNumber("General.Terminal", 0)
occ = gmsh.model.occ


def section(points, arcs=()):
    """A plane surface in the plane y = 0 through points (x, z)."""
    tags = [occ.addPoint(x, 0, z) for x, z in points]
    lines = []
    for i, tag in enumerate(tags):
        after = tags[(i + 1) % len(tags)]
        centre = dict(arcs).get(i)
        lines.append(
            occ.addCircleArc(tag, occ.addPoint(centre[0], 0, centre[1]), after)
            if centre
            else occ.addLine(tag, after)
        )
    return occ.addPlaneSurface([occ.addCurveLoop(lines)])


def turned(surface, x, angle):
    """The body that a surface sweeps about the axis through (x, 0, 0) along z."""
    swept = occ.revolve([(2, surface)], x, 0, 0, 0, 0, 1, angle)
    return [part for part in swept if part[0] == 3]


corner = (pipe + fillet, thick + fillet)
outline = [(bore, 0), (rim, 0), (rim, thick), (pipe + fillet, thick), (pipe, thick + fillet)]
outline += [(pipe, height), (bore, height)]
flange = turned(section(outline, [(3, corner)]), 0, half)
drill = occ.addCylinder(circle, 0, -1, 0, 0, thick + 2, hole)
flange, _ = occ.cut(flange, [(3, drill)])
outline = [(circle, 0), (circle + shank, 0), (circle + shank, thick)]
outline += [(circle + head, thick), (circle + head, thick + head_height), (circle, thick + head_height)]
bolt = turned(section(outline), circle, np.pi)
occ.synchronize()


def within(body, condition):
    """Tags of the surfaces of a body whose boxes (x0, y0, z0, x1, y1, z1) satisfy a condition."""
    faces = gmsh.model.getBoundary(body, oriented=False)
    return [tag for _, tag in faces if condition(*gmsh.model.getBoundingBox(2, tag))]


def between(faces):
    """Of these surfaces those whose middle is on the plane half way to the next bolt."""
    kept = []
    for tag in faces:
        x, y, _ = occ.getCenterOfMass(2, tag)
        if abs(np.arctan2(y, x) - half) < 1e-6:
            kept.append(tag)
    return kept


def flat(low, high, level):
    return abs(low - level) < 1e-3 and abs(high - level) < 1e-3


groups = [
    (3, flange, "flange"),
    (3, bolt, "bolt"),
    (2, within(flange, lambda a, b, c, d, e, f: flat(c, f, 0)), "joint"),
    (2, within(flange, lambda a, b, c, d, e, f: flat(c, f, height)), "pipe"),
    (2, within(flange, lambda a, b, c, d, e, f: flat(b, e, 0)), "flange middle"),
    (2, within(flange, lambda a, b, c, d, e, f: flat(c, f, thick)), "seat"),
    (2, between(within(flange, lambda *box: True)), "between bolts"),
    (2, within(bolt, lambda a, b, c, d, e, f: flat(c, f, 0)), "cut"),
    (2, within(bolt, lambda a, b, c, d, e, f: flat(b, e, 0)), "bolt middle"),
    (2, within(bolt, lambda a, b, c, d, e, f: flat(c, f, thick)), "head"),
]
for dim, tags, name in groups:
    tags = [tag if isinstance(tag, int) else tag[1] for tag in tags]
    assert tags, name
    gmsh.model.addPhysicalGroup(dim, tags, name=name)

gmsh.option.setNumber("Mesh.MeshSizeMax", 9.0)
gmsh.option.setNumber("Mesh.MeshSizeMin", 2.0)
gmsh.option.setNumber("Mesh.MeshSizeFromCurvature", 14)
gmsh.option.setNumber("Mesh.MeshSizeExtendFromBoundary", 1)
size = gmsh.model.mesh.field
size.add("Cylinder", 1)  # finer around the bolt
for name, value in {
    "Radius": head + 3,
    "XCenter": circle,
    "ZAxis": 30,
    "VIn": 3.2,
    "VOut": 7.0,
}.items():
    size.setNumber(1, name, value)
size.setAsBackgroundMesh(1)
gmsh.model.mesh.generate(3)
gmsh.option.setNumber("Mesh.Binary", 1)
gmsh.write(str(Path(__file__).with_name("flange.msh")))
gmsh.finalize()
