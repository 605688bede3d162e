"""A dovetail of a blade in its slot, from geometry of one's own in Gmsh, pulled by 1000 N per mm."""

from pathlib import Path
from tempfile import TemporaryDirectory

import gmsh
import numpy as np
import skfem as fem
from skfem.models.elasticity import lame_parameters, linear_elasticity

import skfem_contact as sc

mu, pull, lean = 0.1, 1000.0, np.radians(50)  # of the flanks, from the horizontal
neck, tail, deep = 6.0, 6.0 + 8.0 / np.tan(lean), 8.0


def polygon(points, name, sides):
    tags = [gmsh.model.occ.addPoint(x, y, 0) for x, y in points]
    lines = [gmsh.model.occ.addLine(a, b) for a, b in zip(tags, tags[1:] + tags[:1], strict=True)]
    face = gmsh.model.occ.addPlaneSurface([gmsh.model.occ.addCurveLoop(lines)])
    gmsh.model.occ.synchronize()
    gmsh.model.addPhysicalGroup(2, [face], name=name)
    for side, numbers in sides.items():
        gmsh.model.addPhysicalGroup(1, [lines[i] for i in numbers], name=side)


gmsh.initialize()
gmsh.option.setNumber("General.Terminal", 0)
gmsh.option.setNumber("Mesh.MeshSizeMax", 1.2)
root = [(-tail, -deep), (tail, -deep), (neck, 0), (neck, 15), (-neck, 15), (-neck, 0)]
polygon(root, "blade", {"right flank": [1], "left flank": [5], "end": [3]})
slot = [(-30, -20), (30, -20), (30, 0), (neck, 0), (tail, -deep), (tail, -deep - 2), (-tail, -deep - 2)]
slot += [(-tail, -deep), (-neck, 0), (-30, 0)]
polygon(slot, "disc", {"base": [0], "right wall": [3], "left wall": [7]})
gmsh.model.mesh.generate(2)
with TemporaryDirectory() as folder:
    path = Path(folder) / "dovetail.msh"
    gmsh.write(str(path))
    mesh = fem.MeshTri.load(path)
gmsh.finalize()

steel = linear_elasticity(*lame_parameters(210e3, 0.3))
basis = {
    n: fem.Basis(mesh.restrict(n), fem.ElementVector(fem.ElementTriP2())) for n in ("blade", "disc")
}
blade = sc.Body(basis["blade"], steel, f={"end": (0.0, pull / (2 * neck))}, name="blade")
disc = sc.Body(basis["disc"], steel, D="base", name="disc")
flanks = [
    sc.Contact(blade.surface(f"{s} flank"), disc.surface(f"{s} wall"), friction=sc.Coulomb(mu), name=s)
    for s in ("left", "right")
]
result = sc.ContactSolver([blade, disc], flanks).solve()
print(result)
assert abs(sum(result[s].force[1] for s in ("left", "right")) + pull) < 1e-6 * pull
# where all of a flank slips: N (cos + mu sin) each, on a slope of 50 degrees
normal = [result[s].normal_force.sum() for s in ("left", "right")]
slipping = all((result[s].status[result[s].status > 0] == 2).all() for s in ("left", "right"))
wanted = pull / 2 / (np.cos(lean) + mu * np.sin(lean))
assert abs(normal[0] / normal[1] - 1) < 0.01 and normal[0] >= wanted * (1 - 1e-3)
assert not slipping or abs(normal[0] / wanted - 1) < 0.01
