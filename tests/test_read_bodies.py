"""Bodies from files: tags become bodies and boundaries, whatever a format calls them."""

from __future__ import annotations

import sys

import meshio
import numpy as np
import pytest
import skfem as fem
from quick_elasticity import linear_elasticity

import skfem_contact as sc

STEEL, RUBBER = linear_elasticity(2.0, 1.0), linear_elasticity(0.2, 0.1)
CUBE = np.array(
    [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)]
)
EDGES = [(0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7)]
FACES = [(0, 3, 7, 4), (1, 2, 6, 5), (0, 1, 5, 4), (3, 2, 6, 7), (0, 1, 2, 3), (4, 5, 6, 7)]


def two_cubes(kind="hexahedron", shared=False):
    """A cube on another one: nodes, and the cells of both, whose nodes may be shared."""
    points = CUBE.astype(float)
    if kind != "hexahedron":
        middles = [points[list(edge)].mean(axis=0) for edge in EDGES]
        more = [points[list(face)].mean(axis=0) for face in FACES] + [points.mean(axis=0)]
        points = np.array([*points, *middles, *(more if kind == "hexahedron27" else [])])
    n = len(points)
    every = np.vstack([points, points + [0, 0, 1]])
    cells = np.arange(2 * n).reshape(2, n)
    if shared:
        every, number = np.unique(every.round(12), axis=0, return_inverse=True)
        cells = number.ravel()[cells]
    return every, cells


def tagged(path, points, cells, tags, names, faces=(), face_tags=()):
    """A Gmsh file."""
    kind = {8: "hexahedron", 20: "hexahedron20", 27: "hexahedron27"}[cells.shape[1]]
    blocks, data = [(kind, cells)], [np.array(tags)]
    if len(faces):
        blocks.append(("quad", np.array(faces)))
        data.append(np.array(face_tags))
    mesh = meshio.Mesh(
        points, blocks, cell_data={"gmsh:physical": data, "gmsh:geometrical": data}, field_data=names
    )
    meshio.write(path, mesh, file_format="gmsh22")
    return path


@pytest.mark.parametrize("shared", [False, True])
@pytest.mark.parametrize("kind", ["hexahedron", "hexahedron20", "hexahedron27"])
def test_every_tag_is_a_body(tmp_path, kind, shared):
    """Elements as they are in the file, boundaries too, and each with nodes of its own."""
    points, cells = two_cubes(kind, shared)
    names = {"low": [1, 3], "high": [2, 3], "ground": [7, 2]}
    path = tagged(tmp_path / "two.msh", points, cells, [1, 2], names, [cells[0, :4]], [7])
    bodies = sc.read_bodies(path, STEEL, settings={"low": {"D": "ground"}})
    assert bodies.names == ("low", "high") and bodies["high"] is bodies[1]
    element = {8: fem.ElementHex1, 20: fem.ElementHexS2, 27: fem.ElementHex2}[cells.shape[1]]
    for body, z in zip(bodies, (0.5, 1.5), strict=True):
        assert type(body.basis.elem.elem) is element
        volume = fem.Functional(lambda w: 1 + 0 * w.x[0]).assemble(body.basis)
        moment = fem.Functional(lambda w: w.x[2]).assemble(body.basis)
        np.testing.assert_allclose([volume, moment], [1, z], rtol=1e-13)
        assert abs(body.K @ body.rigid_modes).max() < 1e-12
    held = bodies["low"].basis.doflocs[2, bodies["low"].D]
    assert len(held) == 3 * {8: 4, 20: 8, 27: 9}[cells.shape[1]] and np.all(held == 0)
    pairs = sc.find_contacts(bodies, within=0.01)
    assert pairs.names == ("low - high",) and pairs.found[0].remark == "matching meshes"


@pytest.mark.parametrize("order", [1, 2])
def test_plane_meshes_are_read(tmp_path, order):
    """Of three coordinates, of which the last is nothing; eight nodes stay eight."""
    square = CUBE[:4].astype(float)
    nodes = square if order == 1 else np.vstack([square, (square + np.roll(square, -1, axis=0)) / 2])
    kind = "quad" if order == 1 else "quad8"
    meshio.Mesh(nodes, [(kind, [np.arange(len(nodes))])]).write(tmp_path / "plane.vtk")
    (body,) = sc.read_bodies(tmp_path / "plane.vtk", STEEL)
    assert (body.name, body.dim, body.n) == ("body 1", 2, 2 * len(nodes))
    bent = nodes.copy()
    bent[0, 2] = 0.1
    meshio.Mesh(bent, [(kind, [np.arange(len(nodes))])]).write(tmp_path / "shell.vtk")
    with pytest.raises(sc.errors.InputError, match="made of shells"):
        sc.read_bodies(tmp_path / "shell.vtk", STEEL)


def test_sets_of_abaqus(tmp_path):
    """Sets of elements are bodies, also those told with the elements; sets of nodes are boundaries."""
    points, cells = two_cubes()
    text = ["*NODE", *(f"{i + 1}, {x}, {y}, {z}" for i, (x, y, z) in enumerate(points))]
    for i, name in enumerate(("LOW", "HIGH")):
        text += [f"*ELEMENT, TYPE=C3D8, ELSET={name}", ", ".join(map(str, [i + 1, *(cells[i] + 1)]))]
    text += ["*NSET, NSET=GROUND", "1, 2, 3, 4", "*ELSET, ELSET=ALL", "1, 2", ""]
    path = tmp_path / "two.inp"
    path.write_text("\n".join(text))
    bodies = sc.read_bodies(path, {"LOW": STEEL, "*": RUBBER}, settings={"LOW": {"D": "GROUND"}})
    assert bodies.names == ("LOW", "HIGH") and len(bodies["LOW"].D) == 12
    np.testing.assert_allclose(10 * bodies["HIGH"].K.toarray(), bodies["LOW"].K.toarray(), atol=1e-12)
    one = sc.read_bodies(path, STEEL, bodies={"both": "ALL"})
    assert one.names == ("both",) and len(set(one[0].parts)) == 2


@pytest.mark.parametrize(
    "kind", ["CPS3", "CPE3", "CPS4", "CPE4R", "CAX4", "cpe4h", "CPE6", "CPS6M", "CAX6", "CPE8R", "CPS8"]
)
def test_plane_elements_of_abaqus(tmp_path, kind):
    """Nodes with two coordinates, and elements that meshio does not know by their names."""
    count = int(kind[3])
    square = CUBE[: 3 if count in (3, 6) else 4, :2].astype(float)
    nodes = np.vstack([square, (square + np.roll(square, -1, axis=0)) / 2])[:count]
    text = ["*Heading", "*NODE", *(f"{i + 1}, {x}, {y}" for i, (x, y) in enumerate(nodes))]
    text += [f"*ELEMENT, ELSET=PLATE, TYPE={kind}", ", ".join(map(str, [7, *range(1, count + 1)]))]
    (tmp_path / "plate.inp").write_text("\n".join([*text, "*NSET, NSET=BASE", "1, 2", ""]))
    (plate,) = sc.read_bodies(tmp_path / "plate.inp", STEEL, settings={"PLATE": {"D": "BASE"}})
    assert (plate.name, plate.dim, plate.n) == ("PLATE", 2, 2 * count)
    assert plate.basis.dx.sum() == pytest.approx(1.0 if len(square) == 4 else 0.5)
    assert len(plate.D) == 4 + 2 * (count > 4)


def test_families_of_med(tmp_path):
    """Groups of cells are bodies and boundaries; a cell in two groups is in a family of its own."""
    pytest.importorskip("h5py", reason="meshio reads .med by h5py, which is not installed")
    points, cells = two_cubes()
    blocks = [("hexahedron", cells), ("quad", [cells[0, :4], cells[1, 4:]])]
    mesh = meshio.Mesh(
        points, blocks, cell_data={"cell_tags": [np.array([-1, -2]), np.array([-3, -4])]}
    )
    mesh.cell_tags = {-1: ["low"], -2: ["high"], -3: ["ground", "ends"], -4: ["ends"]}
    mesh.write(tmp_path / "two.med")
    bodies = sc.read_bodies(tmp_path / "two.med", {"low": STEEL, "*": RUBBER})
    assert bodies.names == ("low", "high")
    assert [sorted(body.basis.mesh.boundaries) for body in bodies] == [["ends", "ground"], ["ends"]]
    assert bodies["high"].surface("ends").points[:, 2].min() == 2.0


def test_groups_of_unv(tmp_path):
    """Read by Gmsh, whose names of groups they have; each body with its side."""
    gmsh = pytest.importorskip("gmsh")
    gmsh.initialize(interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.option.setNumber("Mesh.SaveGroupsOfElements", 1)
        for i, name in enumerate(("low", "high")):
            box = gmsh.model.occ.addBox(0, 0, i, 1, 1, 1)
            gmsh.model.occ.synchronize()
            gmsh.model.addPhysicalGroup(3, [box], name=name)
            bottom = gmsh.model.getEntitiesInBoundingBox(-1, -1, i - 0.1, 2, 2, i + 0.1, 2)
            gmsh.model.addPhysicalGroup(2, [bottom[-1][1]], name=f"under_{name}")
        gmsh.option.setNumber("Mesh.MeshSizeMax", 1.0)
        gmsh.model.mesh.generate(3)
        gmsh.write(str(tmp_path / "two.unv"))
    finally:
        gmsh.finalize()
    bodies = sc.read_bodies(tmp_path / "two.unv", STEEL)
    assert bodies.names == ("low", "high")
    assert [*map(list, (b.basis.mesh.boundaries for b in bodies))] == [["under_low"], ["under_high"]]
    assert sc.find_contacts(bodies, within=0.01)["low - high"].tied is False


def test_cells_without_tags_are_bodies_by_what_hangs_together(tmp_path):
    points, cells = two_cubes()
    meshio.Mesh(points, [("hexahedron", cells)]).write(tmp_path / "two.vtk")
    assert sc.read_bodies(tmp_path / "two.vtk", STEEL).names == ("body 1", "body 2")
    points, cells = two_cubes(shared=True)
    meshio.Mesh(points, [("hexahedron", cells)]).write(tmp_path / "one.vtk")
    assert sc.read_bodies(tmp_path / "one.vtk", STEEL).names == ("body 1",)


def test_one_body_of_several_materials(tmp_path):
    """Its tags are subdomains, each with its material, functions of the basis included."""
    points, cells = two_cubes(shared=True)
    path = tagged(tmp_path / "two.msh", points, cells, [1, 2], {"low": [1, 3], "high": [2, 3]})
    read = {"low": lambda basis: STEEL, "high": RUBBER}
    (body,) = sc.read_bodies(path, read, bodies={"block": ["low", "high"]})
    assert sorted(body.basis.mesh.subdomains) == ["high", "low"] and body.n == 36
    where = np.where(body.basis.doflocs[2] < 0.5, 1.0, 0.0)  # a field that lives in the lower one alone
    u = where * body.basis.doflocs[0] * (body.dof_component == 0)
    both, _ = (sc.read_bodies(path, K, bodies={"block": ["low", "high"]})[0].K for K in (STEEL, RUBBER))
    np.testing.assert_allclose((body.K @ u) @ u, (both @ u) @ u, rtol=1e-12)


def test_bodies_that_yield(tmp_path):
    """A material that is not linear makes a NonlinearBody; parts of one body are linear."""
    points, cells = two_cubes()
    path = tagged(tmp_path / "two.msh", points, cells, [1, 2], {"low": [1, 3], "high": [2, 3]})
    soft = sc.J2(1.0, 0.3, 0.1)
    bodies = sc.read_bodies(path, {"low": sc.Elastic(1.0, 0.3), "high": soft})
    assert [type(body) for body in bodies] == [sc.Body, sc.NonlinearBody]
    assert bodies["high"].material is soft and not bodies["low"].nonlinear
    np.testing.assert_allclose(
        bodies["high"].linearize()[0].toarray() @ bodies["high"].rigid_modes, 0.0, atol=1e-12
    )
    with pytest.raises(sc.errors.InputError, match=r"J2 of 'high', .* has one material"):
        sc.read_bodies(path, {"low": STEEL, "high": soft}, bodies={"both": ["low", "high"]})


def test_boundaries_by_position_and_settings_by_pattern(tmp_path):
    """Of files without names: a side that is held, and one that is pressed."""
    points, cells = two_cubes()
    names = {"low": [1, 3], "high": [2, 3]}
    path = tagged(tmp_path / "two.msh", points, cells, [1, 2], names)
    sides = {"ends": lambda x: (x[2] < 0.1) | (x[2] > 1.9), "all": lambda x: x[2] > -1}
    bodies = sc.read_bodies(
        path, STEEL, settings={"low": {"boundaries": sides, "D": "ends"}, "h*": {"boundaries": sides}}
    )
    assert np.array_equal(np.unique(bodies["low"].dof_points[bodies["low"].D, 2]), [0.0])
    assert bodies["high"].surface("ends").area.sum() == pytest.approx(1.0)
    assert bodies["high"].surface("all").area.sum() == pytest.approx(6.0)
    assert repr(bodies) == "<bodies: low, high>"
    with pytest.raises(sc.errors.InputError, match=r"settings of 'x\*': no such body"):
        sc.read_bodies(path, STEEL, settings={"x*": {}})


def test_cells_of_several_kinds_in_one_file(tmp_path):
    """A brick, a wedge-free pair of tetrahedra and their sides, each as if it were alone."""
    points = np.array([*CUBE, *(CUBE[[0, 1, 3, 4]] + [0, 0, 1.0]), (1, 1, 2)], dtype=float)
    blocks = [
        ("triangle", [(8, 9, 10)]),
        ("hexahedron", [range(8)]),
        ("tetra", [(8, 9, 10, 11), (9, 10, 11, 12)]),
        ("quad", [(0, 1, 2, 3)]),
    ]
    tags = [np.array(t) for t in ([4], [1], [2, 2], [3])]
    data = {"gmsh:physical": tags, "gmsh:geometrical": tags}
    names = {"brick": [1, 3], "tip": [2, 3], "floor": [3, 2], "seat": [4, 2]}
    mesh = meshio.Mesh(points, blocks, cell_data=data, field_data=names)
    meshio.write(tmp_path / "mixed.msh", mesh, file_format="gmsh22")
    bodies = sc.read_bodies(tmp_path / "mixed.msh", STEEL)
    assert [type(body.basis.mesh) for body in bodies] == [fem.MeshHex1, fem.MeshTet1]
    assert [sorted(body.basis.mesh.boundaries) for body in bodies] == [["floor"], ["seat"]]
    assert bodies["tip"].surface("seat").area.sum() == pytest.approx(0.5)
    assert sc.find_contacts(bodies, within=0.01).names == ("brick - tip",)


def test_what_can_not_be_read_is_answered(tmp_path, monkeypatch):
    """No file, no format, wrong names, tags that share cells, kinds that are not known."""
    points, cells = two_cubes()
    path = tagged(tmp_path / "two.msh", points, cells, [1, 2], {"low": [1, 3], "high": [2, 3]})

    def refused(words, *given, **more):
        with pytest.raises(sc.errors.InputError, match=words):
            sc.read_bodies(*given, **more)

    refused("is no file", tmp_path / "none.msh", STEEL)
    (tmp_path / "two.xyz").write_text("")
    refused("can not be read by meshio", tmp_path / "two.xyz", STEEL)
    (tmp_path / "two.inp").write_text("*NODE\n1, 0, 0\n*ELEMENT, TYPE=XYZ4\n1, 1, 1, 1, 1\n")
    refused("by meshio: Element type not available: XYZ4", tmp_path / "two.inp", STEEL)
    refused("no such body; did you mean 'low'", path, STEEL, settings={"lwo": {}})
    refused("no such tag of cells", path, STEEL, bodies={"a": "middle"})
    refused("'a' has no tags", path, STEEL, bodies={"a": []})
    refused("nothing for 'high'", path, {"low": STEEL})
    refused("write material", path, materials=STEEL)
    sets = {"a": [[0, 1]], "b": [[1, 2]]}
    strange = meshio.Mesh(
        np.vstack([points, points[8:] + [0, 0, 1]]),
        [("hexahedron", np.vstack([cells, cells[1] + 8]))], cell_sets=sets,
    )  # fmt: skip
    monkeypatch.setattr(meshio, "read", lambda file: strange)
    refused("'b' and 'a' share 1 cells|'a' and 'b' share 1 cells", path, STEEL)
    flat = meshio.Mesh(points[:6], [("wedge", [range(6)])])
    monkeypatch.setattr(meshio, "read", lambda file: flat)
    refused("has cells wedge", path, STEEL)
    monkeypatch.setitem(sys.modules, "gmsh", None)
    (tmp_path / "two.step").write_text("")
    refused(r"pip install 'skfem-contact\[step\]'", tmp_path / "two.step", STEEL)


def test_round_faces_have_sixteen_nodes_to_the_turn(tmp_path):
    """However large elements are: a bore of radius 1 in a plate of 10."""
    gmsh = pytest.importorskip("gmsh")
    gmsh.initialize(interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        plate, bore = (
            gmsh.model.occ.addBox(-5, -5, 0, 10, 10, 1),
            gmsh.model.occ.addCylinder(0, 0, -1, 0, 0, 3, 1),
        )
        gmsh.model.occ.cut([(3, plate)], [(3, bore)])
        gmsh.model.occ.synchronize()
        gmsh.write(str(tmp_path / "bored.step"))
    finally:
        gmsh.finalize()
    for order in (1, 2):
        (body,) = sc.read_bodies(tmp_path / "bored.step", STEEL, size=8.0, order=order)
        x = body.surface(lambda x: np.hypot(x[0], x[1]) < 1.5).points
        assert np.count_nonzero((x[:, 2] == 0) & (np.hypot(x[:, 0], x[:, 1]) < 1 + 1e-9)) == 16


def test_geometry_is_meshed_by_gmsh(tmp_path):
    """A STEP of two cylinders, curved: volumes to the fourth order of the size of elements."""
    gmsh = pytest.importorskip("gmsh")
    gmsh.initialize(interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        for z in (0, 1):
            gmsh.model.occ.addCylinder(0, 0, z, 0, 0, 1, 1 + z)
        gmsh.model.occ.synchronize()
        gmsh.write(str(tmp_path / "two.step"))
    finally:
        gmsh.finalize()
    bodies = sc.read_bodies(tmp_path / "two.step", STEEL, size=0.7, order=2)
    assert bodies.names == ("body 1", "body 2")
    one = fem.Functional(lambda w: 1 + 0 * w.x[0])
    volumes = [one.assemble(body.basis) for body in bodies]
    np.testing.assert_allclose(volumes, [np.pi, 4 * np.pi], rtol=2e-3)
    assert sc.find_contacts(bodies, within=0.01).names == ("body 1 - body 2",)
    # Gmsh is left as it was found
    assert not gmsh.isInitialized()
    gmsh.initialize(interruptible=False)
    try:
        for name in ("other", "mine"):
            gmsh.model.add(name)
        gmsh.model.setCurrent("other")
        sc.read_bodies(tmp_path / "two.step", STEEL, size=1.0)
        assert gmsh.isInitialized() and gmsh.model.getCurrent() == "other"
    finally:
        gmsh.finalize()
