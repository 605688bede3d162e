"""Files: what is read back by meshio is the answer, node by node."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import meshio
import numpy as np
import pytest
import skfem as fem
from numpy.testing import assert_allclose, assert_array_equal
from quick_elasticity import linear_elasticity
from skfem.models.poisson import laplace

import skfem_contact as sc

ELEMENTS = {
    "triangle": (fem.MeshTri, fem.ElementTriP1),
    "triangle6": (fem.MeshTri, fem.ElementTriP2),
    "quad": (fem.MeshQuad, fem.ElementQuad1),
    "quad8": (fem.MeshQuad, fem.ElementQuadS2),
    "quad9": (fem.MeshQuad, fem.ElementQuad2),
}
# corners, by local number, of the edges whose middle a quadratic cell has as further nodes
EDGES = {
    "triangle6": [(0, 1), (1, 2), (2, 0)],
    "quad8": [(0, 1), (1, 2), (2, 3), (3, 0)],
    "quad9": [(0, 1), (1, 2), (2, 3), (3, 0)],
    "tetra10": [(0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)],
    "hexahedron27": [
        *[(0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6)],
        *[(6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7)],
    ],
}


def block(mesh: Any, element: Any, name: str, **kwargs: Any) -> sc.Body:
    basis = fem.Basis(mesh.with_defaults(), fem.ElementVector(element()))
    return sc.Body(basis, linear_elasticity(0.0, 0.5), name=name, **kwargs)  # E = 1, nu = 0


def stacked(kind: str = "quad", width: float = 1.0, **kwargs: Any) -> sc.ContactSolver:
    """Two unit squares on top of each other, pressed together by 1 % of their joint height."""
    mesh, element = ELEMENTS[kind]
    lower = block(mesh().refined(2).scaled((width, 1.0)), element, "lower", D="bottom")
    upper = block(mesh().refined(2).translated((0.0, 1.0)), element, "upper")
    top = upper.basis.get_dofs("top")
    x = np.zeros(upper.n)
    x[top.all("u^2")] = -0.02
    upper = sc.Body(upper.basis, upper.K, D=top, x=x, name="upper")
    contact = sc.Contact(upper.surface("bottom"), lower.surface("top"), **kwargs)
    return sc.ContactSolver([lower, upper], [contact])


@pytest.mark.parametrize("kind", ELEMENTS)
def test_displacement_stands_at_its_node(kind: str, tmp_path: Path) -> None:
    """Two bars in uniform compression move down by one per cent of the height, at every node."""
    file, _ = sc.write(tmp_path / "bars.vtu", stacked(kind).solve())
    mesh = meshio.read(file)
    expected = np.zeros_like(mesh.points)
    expected[:, 1] = -0.01 * mesh.points[:, 1]
    # one linear solve: round-off of the largest displacement, times some condition number
    assert_allclose(mesh.point_data["displacement"], expected, rtol=0, atol=0.02 * 1e-11)
    assert {block.type for block in mesh.cells} == {kind}


@pytest.mark.parametrize("kind", ELEMENTS)
def test_cells_cover_the_bodies(kind: str, tmp_path: Path) -> None:
    """The corners of all cells enclose the area of the bodies; further nodes halve their edges."""
    file, _ = sc.write(tmp_path / "bars.vtu", stacked(kind).solve())
    mesh = meshio.read(file)
    corners = 3 if kind.startswith("tri") else 4
    total = 0.0
    for cells in mesh.cells:
        x, y = mesh.points[cells.data[:, :corners], :2].transpose(2, 0, 1)
        area = 0.5 * np.sum(x * np.roll(y, -1, axis=1) - y * np.roll(x, -1, axis=1), axis=1)
        assert np.all(np.abs(area) > 0)
        total += np.abs(area).sum()
        if kind in EDGES:
            ends = mesh.points[cells.data[:, EDGES[kind]]]
            middle = mesh.points[cells.data[:, corners : corners + len(EDGES[kind])]]
            assert_allclose(middle, ends.mean(axis=2), rtol=0, atol=1e-15)
        if kind == "quad9":
            centre = mesh.points[cells.data[:, :4]].mean(axis=1)
            assert_allclose(mesh.points[cells.data[:, 8]], centre, rtol=0, atol=1e-15)
    assert total == pytest.approx(2.0, rel=1e-14)


@pytest.mark.parametrize(
    ("kind", "mesh", "element"),
    [
        ("tetra", fem.MeshTet, fem.ElementTetP1),
        ("tetra10", fem.MeshTet, fem.ElementTetP2),
        ("hexahedron", fem.MeshHex, fem.ElementHex1),
        ("hexahedron27", fem.MeshHex, fem.ElementHex2),
    ],
)
def test_solid_cells_are_not_inside_out(kind: str, mesh: Any, element: Any, tmp_path: Path) -> None:
    """Bricks and tetrahedra have their corners and the middles of edges where VTK expects them."""
    body = block(mesh().refined(1), element, "brick", D="top")
    touching = sc.Contact(body.surface("bottom"), sc.RigidPlane((0, 0, 0), (0, 0, 1)))
    file, _ = sc.write(tmp_path / "brick.vtu", sc.ContactSolver(body, touching).solve())
    read = meshio.read(file)
    points, (cells,) = read.points, (block.data for block in read.cells)
    assert read.cells[0].type == kind
    corners = points[cells[:, [0, 1, 3, 4] if kind.startswith("hexa") else [0, 1, 2, 3]]]
    volume = np.linalg.det(corners[:, 1:] - corners[:, :1])
    if kind.startswith("hexa"):  # (a tetrahedron of scikit-fem may be a mirror image)
        assert_allclose(volume, 1 / 8, rtol=1e-14)
        p = points[cells[:, :8]]
        up = p[:, 4:] - p[:, :4]  # the upper face stands over the lower one
        assert_allclose(up, np.broadcast_to(up[:, :1], up.shape), rtol=0, atol=1e-15)
        assert_allclose(p[:, 1] - p[:, 0], p[:, 2] - p[:, 3], rtol=0, atol=1e-15)
    assert np.abs(volume).sum() == pytest.approx(1.0 if kind.startswith("hexa") else 6.0)
    if kind in EDGES:
        corners_of = 4 if kind == "tetra10" else 8
        middle = points[cells[:, corners_of : corners_of + len(EDGES[kind])]]
        assert_allclose(middle, points[cells[:, EDGES[kind]]].mean(axis=2), rtol=0, atol=1e-15)


def test_coincident_nodes_are_not_merged(tmp_path: Path) -> None:
    """Two bodies with five common positions keep twenty-five nodes each, and are numbered."""
    mesh = meshio.read(sc.write(tmp_path / "two.vtu", stacked("quad").solve())[0])
    assert len(mesh.points) == 50
    assert len(np.unique(mesh.points, axis=0)) == 45
    numbers = np.concatenate(mesh.cell_data["body"])
    assert_array_equal(numbers, np.repeat([1, 2], 16))
    table = np.concatenate([cells.data for cells in mesh.cells])
    assert_array_equal(np.unique(table[numbers == 1]), np.arange(25))
    assert_array_equal(np.unique(table[numbers == 2]), np.arange(25, 50))


@pytest.mark.parametrize("kind", ["triangle", "quad9"])
@pytest.mark.parametrize("extension", [".vtu", ".vtk"])
def test_surface_carries_the_force(kind: str, extension: str, tmp_path: Path) -> None:
    """The traction in the file, integrated over its lines by Simpson's rule, is the force 0.01."""
    result = stacked(kind, friction=sc.Coulomb(0.3)).solve()
    mesh = meshio.read(sc.write(tmp_path / f"bars{extension}", result)[1])
    ends = mesh.points[mesh.cells[0].data[:, :2]]
    lengths = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    traction = mesh.point_data["traction"][mesh.cells[0].data]
    weights = np.array([1, 1]) / 2 if kind == "triangle" else np.array([1, 1, 4]) / 6
    force = np.einsum("f,fkd,k->d", lengths, traction, weights)
    assert_allclose(force, [0.0, 0.01, 0.0], rtol=0, atol=0.01 * 1e-10)
    assert_allclose(mesh.point_data["pressure"], 0.01, rtol=1e-10)
    assert_array_equal(mesh.point_data["status"], 1)
    assert_allclose(mesh.point_data["displacement"][:, 1], -0.01, rtol=1e-10)


def test_what_slips_is_signed_along_the_tangent(tmp_path: Path) -> None:
    """Slip and tangential force in the file are those of the result, and opposite in sign."""
    solver = stacked("quad", friction=sc.Coulomb(0.1))
    upper = solver.system.bodies[1]
    x = np.array(upper.x)
    x[upper.basis.get_dofs("top").all("u^1")] = 0.05
    result = solver.solve(x={"upper": x})
    data = meshio.read(sc.write(tmp_path / "slip.vtu", result)[1]).point_data
    assert_array_equal(data["slip"], result.slip[:, 0])
    assert_array_equal(data["tangential_force"], result.tangential_force[:, 0])
    slipping = data["status"] == 2
    assert slipping.any()
    assert np.all(data["slip"][slipping] * data["tangential_force"][slipping] <= 0)


def test_point_without_partner_has_no_gap(tmp_path: Path) -> None:
    """A point beyond the end of the primary surface has the gap inf, and NaN in the file."""
    result = stacked("quad", width=0.6).solve()
    assert np.isinf(result.gap).any()
    gap = meshio.read(sc.write(tmp_path / "wide.vtu", result)[1]).point_data["gap"]
    assert_array_equal(np.isnan(gap), np.isinf(result.gap))


def test_several_contacts_stand_in_one_file(tmp_path: Path) -> None:
    """The surfaces of two contacts are numbered 1 and 2 and share no points."""
    basis = fem.Basis(fem.MeshQuad().refined(1).with_defaults(), fem.ElementVector(fem.ElementQuad1()))
    down_left = np.full(basis.N, -1e-3)
    plate = sc.Body(basis, linear_elasticity(0.0, 0.5), down_left, name="plate")
    contacts = [
        sc.Contact(plate.surface("bottom"), sc.RigidPlane((0, 0), (0, 1)), name="floor"),
        sc.Contact(plate.surface("left"), sc.RigidPlane((0, 0), (1, 0)), name="wall"),
    ]
    result = sc.ContactSolver([plate], contacts).solve()
    mesh = meshio.read(sc.write(tmp_path / "corner.vtu", result)[1])
    assert_array_equal(np.concatenate(mesh.cell_data["contact"]), [1, 1, 2, 2])
    assert_array_equal(np.unique(mesh.cells_dict["line"][:2]), [0, 1, 2])
    assert_array_equal(np.unique(mesh.cells_dict["line"][2:]), [3, 4, 5])
    assert_array_equal(mesh.points[3:, 0], 0.0)


def test_scalar_problem_has_a_scalar(tmp_path: Path) -> None:
    """Two tied bars conduct heat: u in the file is the linear profile between the ends."""
    bodies = []
    for name, shift, side, value in [("a", 0.0, "left", 0.0), ("b", 1.0, "right", 2.0)]:
        mesh = fem.MeshQuad().refined(1).translated((shift, 0.0)).with_defaults()
        basis = fem.Basis(mesh, fem.ElementQuad1())
        D = basis.get_dofs(side)
        bodies.append(sc.Body(basis, laplace, D=D, x=np.full(basis.N, value), name=name))
    contact = sc.Contact(bodies[1].surface("left"), bodies[0].surface("right"), tied=True)
    bodies_file, contact_file = sc.write(
        tmp_path / "heat.vtu", sc.ContactSolver(bodies, [contact]).solve()
    )
    mesh = meshio.read(bodies_file)
    assert_allclose(mesh.point_data["u"], mesh.points[:, 0], rtol=0, atol=2 * 1e-12)
    assert_allclose(meshio.read(contact_file).point_data["u"], 1.0, rtol=1e-12)


def test_stress_is_written_where_asked_for(tmp_path: Path) -> None:
    """Bars of modulus 1 compressed by one per cent carry 0.01 at every node."""
    result = stacked("triangle6").solve()

    def mises(body: sc.Body, u: np.ndarray) -> np.ndarray:
        return sc.von_mises(body, u, E=1.0, nu=0.0, plane="stress")

    data = meshio.read(sc.write(tmp_path / "bars.vtu", result, stress=mises)[0]).point_data
    assert_allclose(data["mises"], 0.01, rtol=1e-9)
    with pytest.raises(sc.errors.InputError, match="81 nodes"):
        sc.write(tmp_path / "bars.vtu", result, stress=lambda body, u: u)


def test_fields_are_written_by_their_names(tmp_path: Path) -> None:
    """Any field was stored as von_mises; it has the name of its function, von_mises if it is that."""

    def height(body: sc.Body, u: np.ndarray) -> np.ndarray:
        return body.basis.mesh.p[1]

    result, file = stacked().solve(), tmp_path / "bars.vtu"
    data = meshio.read(sc.write(file, result, stress=height)[0]).point_data
    assert set(data) == {"displacement", "height"}
    assert data["height"].max() == 2.0
    mises = partial(sc.von_mises, E=1.0, nu=0.0, plane="stress")
    assert "von_mises" in meshio.read(sc.write(file, result, stress=mises)[0]).point_data
    data = meshio.read(sc.write(file, result, stress=lambda body, u: height(body, u))[0]).point_data
    assert set(data) == {"displacement", "stress"}

    def displacement(body: sc.Body, u: np.ndarray) -> np.ndarray:
        return height(body, u)

    data = meshio.read(sc.write(file, result, stress=displacement)[0]).point_data
    assert data["displacement"].shape[1] == 3 and "displacement_given" in data


def test_unknown_extensions_are_refused(tmp_path: Path) -> None:
    """The message says what was given and what would do."""
    result = stacked().solve()
    with pytest.raises(sc.errors.InputError, match=r"'\.txt' is not one of \.vtu, \.vtk"):
        sc.write(tmp_path / "result.txt", result)
    with pytest.raises(sc.errors.InputError, match=r"write_series\('result\.pvd'"):
        sc.write_series(tmp_path / "result.vtu", [result])
    assert not list(tmp_path.iterdir())


def listed(path: Path) -> list[tuple[float, str]]:
    """Time and file of all entries of a collection."""
    entries = ElementTree.parse(path).getroot().iter("DataSet")
    return [(float(entry.attrib["timestep"]), entry.attrib["file"]) for entry in entries]


@pytest.mark.parametrize(
    ("factors", "times", "expected"),
    [
        ([0.5, 1.0], None, [0.5, 1.0]),  # increasing factors are the time
        ([1.0, 0.5, 1.0], None, [0, 1, 2]),  # a cycle can not be
        ([1.0, 0.5], [10.0, 20.0], [10, 20]),
    ],
)
def test_history_becomes_a_collection(
    factors: list[float], times: list[float] | None, expected: list[float], tmp_path: Path
) -> None:
    """A collection lists bodies and contacts of every step, in files that exist, over time."""
    solver = stacked("quad")
    path = sc.write_series(tmp_path / "new" / "loop.pvd", solver.history(factors), times=times)
    entries = listed(path)
    assert [time for time, _ in entries] == list(np.repeat(expected, 2))
    assert all((path.parent / file).is_file() for _, file in entries)
    for (_, file), factor in zip(entries[::2], factors, strict=True):
        u = meshio.read(path.parent / file).point_data["displacement"]
        assert np.abs(u).max() == pytest.approx(0.02 * factor, rel=1e-11)


def test_interrupted_history_can_be_opened(tmp_path: Path) -> None:
    """After an error in the third step, the collection lists the two that were reached."""

    def steps() -> Iterator[float]:
        yield from (0.5, 1.0)
        raise KeyboardInterrupt

    path = tmp_path / "loop.pvd"
    with pytest.raises(KeyboardInterrupt):
        sc.write_series(path, stacked().history(steps()))
    assert [time for time, _ in listed(path)] == [0.5, 0.5, 1.0, 1.0]
    with pytest.raises(sc.errors.InputError, match="times has 1 entries"):
        sc.write_series(path, stacked().history([0.5, 1.0]), times=[3.0])
